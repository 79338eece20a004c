"""Steps and ramps."""

import dataclasses
from collections.abc import Mapping, Sequence

from mjx_arenas.furniture.part import LENGTH, Box, Parameter, Part, Surface, each, top, whole
from mjx_arenas.geometry import Array, array_module


@dataclasses.dataclass(frozen=True)
class Steps(Part):
    """Steps that rise towards x, each down to the floor. The frame is at the front edge of the first step.

    Args:
        rises: (n,) height of each step above the one before.
        run: depth of each step.
        width: width of all steps.
    """

    rises: Sequence[float] = (0.15, 0.15, 0.15)
    run: float = 0.28
    width: float = 1.0

    @property
    def own(self) -> dict[str, Parameter]:
        return {
            "rises": each(LENGTH, self.rises, "step"),
            "run": whole(LENGTH, self.run),
            "width": whole(LENGTH, self.width),
        }

    def boxes(self, numbers: Mapping[str, Array]) -> list[Box]:
        run, width, found, height = numbers["run"], numbers["width"], [], 0.0
        for i in range(len(self.rises)):
            height = height + numbers["rises"][i]
            found.append(Box(f"step{i}", ((i + 0.5) * run, 0.0, height / 2), (run / 2, width / 2, height / 2)))
        return found

    def surfaces(self, numbers: Mapping[str, Array]) -> list[Surface]:
        return list(map(top, self.boxes(numbers)))


@dataclasses.dataclass(frozen=True)
class Ramp(Part):
    """A plate that rises towards x. The frame is at its lower edge, at the height of the floor.

    Args:
        run: its length along the floor.
        rise: height of its upper edge.
        width: width across.
        thickness: thickness of the plate, below its upper side.
    """

    run: float = 1.0
    rise: float = 0.2
    width: float = 1.0
    thickness: float = 0.02

    @property
    def own(self) -> dict[str, Parameter]:
        return {name: whole(LENGTH, getattr(self, name)) for name in ("run", "rise", "width", "thickness")}

    def boxes(self, numbers: Mapping[str, Array]) -> list[Box]:
        run, rise, width, thick = (numbers[name] for name in ("run", "rise", "width", "thickness"))
        xp = array_module(run, rise)
        length = xp.sqrt(run * run + rise * rise)
        # The middle of the upper side is that of the slope; the plate's middle is half its thickness below, across the slope.
        pos = (run / 2 + rise / length * thick / 2, 0.0, rise / 2 - run / length * thick / 2)
        return [Box("plate", pos, (length / 2, width / 2, thick / 2), tilt=-xp.arctan2(rise, run))]
