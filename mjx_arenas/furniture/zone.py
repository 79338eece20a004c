"""Zones: places without anything to see or touch."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence

from mjx_arenas.furniture.part import LENGTH, Box, Parameter, Part, Surface, whole
from mjx_arenas.geometry import Array
from mjx_arenas.problem import Problem, problem


@dataclasses.dataclass(frozen=True)
class Zone(Part):
    """A level rectangle where objects may stand, such as a piece of the floor. It has no geoms. Its surface has the name of the zone.

    Args:
        size: (2,) lengths of its sides along x and y.
    """

    size: Sequence[float] = (1.0, 1.0)

    @property
    def own(self) -> dict[str, Parameter]:
        return {"size": whole(LENGTH._replace(item=(2,), axes="x, y"), self.size)}

    @functools.cached_property
    def parameters(self) -> dict[str, Parameter]:
        """All numbers that may vary, without those of boxes."""
        return {name: one for name, one in super().parameters.items() if name not in ("friction", "rgba")}

    def problems(self) -> list[Problem]:
        """Problems of this zone."""
        why = {"friction": "touches nothing", "rgba": "is not seen", "material": "is not seen"}
        given = [name for name in why if getattr(self, name) != getattr(Part, name)]
        must = "left out, as a Zone"
        found = [problem(name, "must", None, getattr(self, name), must=f"{must} {why[name]}") for name in given]
        return found or super().problems()

    def boxes(self, numbers: Mapping[str, Array]) -> list[Box]:
        return []

    def surfaces(self, numbers: Mapping[str, Array]) -> list[Surface]:
        x, y = (numbers["size"][i] / 2 for i in range(2))
        return [Surface("", (0.0, 0.0, 0.0), (x, y))]
