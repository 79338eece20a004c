"""Cupboards: a carcass behind a hinged door."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from mjx_arenas.furniture.carcass import carcass
from mjx_arenas.furniture.part import (
    DAMPING,
    LENGTH,
    LOSS,
    Box,
    Condition,
    Joint,
    Parameter,
    Part,
    Surface,
    named,
    top,
    whole,
)
from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import Quantity

WIDEST = 1.9  # a door opens so far [rad]
GAP = 0.002  # between the door and the carcass, and below and above the door [m]
_ANGLE = Quantity("part", (), float, "", None, "[rad]", (0.0, WIDEST))


@dataclasses.dataclass(frozen=True)
class Cupboard(Part):
    """A carcass with a door in front, which opens to the front. `pos` may hang it on a wall.

    Args:
        size: (3,) depth, width, height of the carcass.
        thickness: thickness of all panels.
        hinge_left: whether the hinge is on the left, seen from the front.
        opening: angle of the door at the start [rad].
        damping: damping of the hinge [N m s/rad].
        frictionloss: friction loss of the hinge [N m].
    """

    size: Sequence[float] = (0.35, 0.6, 0.7)
    thickness: float = 0.018
    hinge_left: bool = False
    opening: float = 0.0
    damping: float = 0.5
    frictionloss: float = 0.1

    @property
    def own(self) -> dict[str, Parameter]:
        return {
            "size": whole(LENGTH._replace(item=(3,), axes="depth, width, height"), self.size),
            "thickness": whole(LENGTH, self.thickness),
            "hinge_left": whole(Quantity("part", (), bool), self.hinge_left),
            "damping": whole(DAMPING._replace(must=f"{DAMPING.must} [N m s/rad]"), self.damping),
            "frictionloss": whole(LOSS._replace(must=f"{LOSS.must} [N m]"), self.frictionloss),
            "opening": whole(_ANGLE, self.opening)._replace(starts=True),
        }

    @property
    def conditions(self) -> tuple[Condition, ...]:
        return (
            Condition(
                "thickness",
                "less than half of depth, width and height [m]",
                lambda n: (2 * n["thickness"] < n["size"]).all(),
            ),
        )

    def boxes(self, numbers: Mapping[str, Array]) -> list[Box]:
        depth, width, height = numbers["size"]
        thick = numbers["thickness"]
        at = (-depth / 2 - GAP - thick / 2, 0.0, height / 2)
        door = Box("door", at, (thick / 2, width / 2, height / 2 - GAP), piece="door")
        return [*carcass(depth, width, height, thick), door]

    def surfaces(self, numbers: Mapping[str, Array]) -> list[Surface]:
        bottom, lid = named(self.boxes(numbers), "bottom", "top")
        return [top(bottom, back=numbers["thickness"]), top(lid)]

    def joints(self, numbers: Mapping[str, Array]) -> list[Joint]:
        depth, width, _ = numbers["size"]
        xp = array_module(width)
        side = xp.where(numbers["hinge_left"], 1.0, -1.0).astype(width.dtype)  # of y
        pos = (-depth / 2 - GAP - numbers["thickness"], side * width / 2, 0.0)
        axis, none = (0.0, 0.0, -side), np.zeros(())
        return [Joint("door", True, axis, pos, (none, WIDEST), numbers["damping"], numbers["frictionloss"])]
