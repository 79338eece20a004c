"""Bins and trays: a bottom and four walls."""

import dataclasses
from collections.abc import Mapping, Sequence

from mjx_arenas.furniture.part import LENGTH, Box, Parameter, Part, Surface, named, top, whole
from mjx_arenas.geometry import Array


@dataclasses.dataclass(frozen=True)
class Bin(Part):
    """A box that is open above: a bottom and four walls. With low walls it is a tray. `pos` may put it on something.

    Args:
        inner_size: (3,) length, width, and height of the walls above the bottom.
        thickness: thickness of bottom and walls.
    """

    inner_size: Sequence[float] = (0.4, 0.3, 0.15)
    thickness: float = 0.01

    @property
    def own(self) -> dict[str, Parameter]:
        size = LENGTH._replace(item=(3,), axes="length, width, height")
        return {"inner_size": whole(size, self.inner_size), "thickness": whole(LENGTH, self.thickness)}

    def boxes(self, numbers: Mapping[str, Array]) -> list[Box]:
        x, y, z = (numbers["inner_size"][i] / 2 for i in range(3))
        thick = numbers["thickness"] / 2
        middle = 2 * thick + z  # of the walls
        bottom = Box("bottom", (0.0, 0.0, thick), (x + 2 * thick, y + 2 * thick, thick))
        walls = [
            Box("front", (-x - thick, 0.0, middle), (thick, y + 2 * thick, z)),
            Box("back", (x + thick, 0.0, middle), (thick, y + 2 * thick, z)),
            Box("right", (0.0, -y - thick, middle), (x, thick, z)),
            Box("left", (0.0, y + thick, middle), (x, thick, z)),
        ]
        return [bottom, *walls]

    def surfaces(self, numbers: Mapping[str, Array]) -> list[Surface]:
        (bottom,), thick = named(self.boxes(numbers), "bottom"), numbers["thickness"]
        return [top(bottom, thick, thick, thick, thick)]
