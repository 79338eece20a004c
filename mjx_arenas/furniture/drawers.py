"""Drawer units: drawers that slide out of a carcass."""

import dataclasses
from collections.abc import Mapping, Sequence

from mjx_arenas.furniture.carcass import carcass
from mjx_arenas.furniture.part import (
    DAMPING,
    HEIGHT,
    LENGTH,
    LOSS,
    Box,
    Condition,
    Joint,
    Parameter,
    Part,
    Surface,
    each,
    named,
    top,
    whole,
)
from mjx_arenas.geometry import Array
from mjx_arenas.problem import Problem, problem

GAP = 0.004  # around a drawer [m]
LEFT_INSIDE = 0.2  # of a drawer that is pulled out


@dataclasses.dataclass(frozen=True)
class Drawers(Part):
    """Drawers above each other, which slide out to the front. `openings` are where they start, `pieces_active` which of them are there.

    A drawer is a front with a tray behind it, whose walls are 70 % as high as the front. When it is fully open, a fifth of its depth stays
    inside.

    Args:
        size: (2,) depth and width.
        heights: (n,) heights of the drawers' fronts, from the bottom up.
        thickness: thickness of all panels.
        openings: (n,) lengths by which the drawers are pulled out at the start; None: all are shut.
        damping: damping of all slides [N s/m].
        frictionloss: friction loss of all slides [N].
    """

    size: Sequence[float] = (0.45, 0.5)
    heights: Sequence[float] = (0.25, 0.2, 0.15)
    thickness: float = 0.015
    openings: Sequence[float] | None = None
    damping: float = 5.0
    frictionloss: float = 1.0

    @property
    def own(self) -> dict[str, Parameter]:
        return {
            "size": whole(LENGTH._replace(item=(2,), axes="depth, width"), self.size),
            "heights": each(LENGTH, self.heights, "drawer"),
            "thickness": whole(LENGTH, self.thickness),
            "damping": whole(DAMPING._replace(must=f"{DAMPING.must} [N s/m]"), self.damping),
            "frictionloss": whole(LOSS._replace(must=f"{LOSS.must} [N]"), self.frictionloss),
            "openings": each(HEIGHT, self.openings or (0.0,) * len(self.heights), "drawer")._replace(starts=True),
        }

    @property
    def pieces(self) -> tuple[str, ...]:
        return tuple(f"drawer{i}" for i in range(len(self.heights)))

    @property
    def conditions(self) -> tuple[Condition, ...]:
        def thin(numbers: Mapping[str, Array]) -> Array:
            thick = numbers["thickness"]
            return (4 * (thick + GAP) < numbers["size"]).all() & (thick < 0.35 * numbers["heights"]).all()

        def inside(numbers: Mapping[str, Array]) -> Array:
            return ((numbers["openings"] >= 0) & (numbers["openings"] <= self._out(numbers))).all()

        return (
            Condition("thickness", "small against depth, width and heights [m]", thin),
            Condition("openings", f"from 0 to {1 - LEFT_INSIDE:g} of the depth inside [m]", inside),
        )

    def problems(self) -> list[Problem]:
        n = len(self.heights) if isinstance(self.heights, tuple) else 0
        if n == 0 or self.openings is None or (isinstance(self.openings, tuple) and len(self.openings) == n):
            return super().problems()
        return [
            problem("openings", "must", None, self.openings, must=f"{n} number{'s' * (n > 1)}, one for each drawer")
        ]

    def boxes(self, numbers: Mapping[str, Array]) -> list[Box]:
        depth, width = numbers["size"]
        thick, low = numbers["thickness"], numbers["thickness"] + GAP
        found = []
        for i in range(len(self.heights)):
            height = numbers["heights"][i]
            found += self._drawer(f"drawer{i}", depth, width - 2 * thick - 2 * GAP, low, height, thick)
            low = low + height + GAP
        return [*carcass(depth, width, low + thick, thick), *found]

    def surfaces(self, numbers: Mapping[str, Array]) -> list[Surface]:
        boxes, thick = self.boxes(numbers), numbers["thickness"]
        bottoms = named(boxes, *(f"drawer{i}_bottom" for i in range(len(self.heights))))
        return [*(top(box, right=thick, left=thick) for box in bottoms), *map(top, named(boxes, "top"))]

    def joints(self, numbers: Mapping[str, Array]) -> list[Joint]:
        out, none = self._out(numbers), (0.0, 0.0, 0.0)
        damping, loss = numbers["damping"], numbers["frictionloss"]
        return [
            Joint(f"drawer{i}", False, (-1.0, 0.0, 0.0), none, (0.0, out), damping, loss)
            for i in range(len(self.heights))
        ]

    def _out(self, numbers: Mapping[str, Array]) -> Array:
        """How far a drawer slides."""
        return (1 - LEFT_INSIDE) * (numbers["size"][0] - 2 * numbers["thickness"])

    def _drawer(self, name: str, depth: Array, width: Array, low: Array, height: Array, thick: Array) -> list[Box]:
        front, back = -depth / 2 + thick / 2, depth / 2 - 1.5 * thick - GAP  # middles of these panels
        middle, long = (front + back) / 2, (back - front) / 2 - thick / 2
        wall = 0.35 * height - thick / 2  # half of what stands on the bottom
        above = low + thick + wall
        y = width / 2 - thick / 2
        return [
            Box(f"{name}_front", (front, 0.0, low + height / 2), (thick / 2, width / 2, height / 2), piece=name),
            Box(f"{name}_bottom", (middle, 0.0, low + thick / 2), (long, width / 2, thick / 2), piece=name),
            Box(f"{name}_back", (back, 0.0, low + 0.35 * height), (thick / 2, width / 2, 0.35 * height), piece=name),
            Box(f"{name}_right", (middle, -y, above), (long, thick / 2, wall), piece=name),
            Box(f"{name}_left", (middle, y, above), (long, thick / 2, wall), piece=name),
        ]
