"""Causes of failure in words and numbers (host)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mjx_arenas.checks.watch import NEVER, Seen

CAUSES = {
    "not_finite": "not finite",
    "solver_gave_up": "solver gave up",
    "dropped_contacts": "contacts dropped",
    "through_table": "through its table",
    "deep_penetration": "deep penetration",
    "off_table": "off its table",
    "invalid_arena": "invalid arena",
    "invalid_placement": "no free place",
}
"""Names of all causes, the worst first, and what reports call them; objects often find no place because the arena is invalid."""


class Failure(NamedTuple):
    """Failure of one world for one cause."""

    world: int
    """Number of the world."""
    step: int
    """Step in which the failure is first seen, from 1; 0 before the first step."""
    number: float
    """Measure of how bad it is, by cause.

    - "not_finite": the number of the step.
    - "solver_gave_up": the deviation of an object's velocity from what its constraints require, over consecutive steps [m/s].
    - "dropped_contacts": the number of contacts for which a world needs room.
    - "deep_penetration": the depth as a share of the smaller half extent of the two geoms.
    - "through_table" and "off_table": how far below the top and outside the edges the middle of the object gets [m].
    - "invalid_placement": the number of objects without a free place.
    - "invalid_arena": the number of problems."""
    what: str
    """Description in words, with names and units."""

    def rank(self, cause: str) -> tuple[float, int]:
        """Sort key within a cause: the smallest is the worst."""
        return (self.step, 0) if cause == "not_finite" else (-self.number, self.step)


def happened(seen: Seen) -> np.ndarray:
    """(W,) bool: `steps` finds something in the world."""
    first = np.stack([seen.not_finite, seen.dropped, seen.deep], axis=1)
    return (np.concatenate([first, seen.through, seen.off, seen.unsolved], axis=1) != NEVER).any(1)


def steps(seen: Seen, world: int, pair: Sequence[str], names: Sequence[str]) -> dict[str, Failure]:
    """What went wrong in the steps of a world, by cause.

    Args:
        seen: of many worlds.
        world: which of them, whose number the failures get.
        pair: names of the geoms of its deepest contact.
        names: (K,) of the objects.
    """
    found = {}

    def add(cause: str, step: np.ndarray, amount: float, what: str) -> None:
        if step < NEVER:
            found[cause] = Failure(world, int(step), float(amount), f"{what}, from step {step}")

    first, needed = seen.not_finite[world], int(seen.needed)
    add("not_finite", first, first, "state is NaN, infinite or beyond 1e10")
    add("dropped_contacts", seen.dropped[world], needed, f"room for {needed} a world would have been enough")
    for cause, events, amounts, where in (
        ("through_table", seen.through[world], seen.below[world], "below the top"),
        ("off_table", seen.off[world], seen.outside[world], "outside the edges"),
        ("solver_gave_up", seen.unsolved[world], seen.most_lost[world], ""),
    ):
        if len(events):
            worst = int(np.where(events < NEVER, amounts, -1).argmax())
            what = (
                f"{length(amounts[worst])} {where}"
                if where
                else f"moves {amounts[worst]:.3g} m/s apart from its forces"
            )
            add(cause, events[worst], amounts[worst], f"{names[worst]} {what}")
    share, depth = seen.share[world], length(seen.depth[world])
    what = f"{pair[0]} and {pair[1]} {depth} deep, {100 * share:.0f} % of the smaller half extent"
    add("deep_penetration", seen.deep[world], share, what)
    return {cause: found[cause] for cause in CAUSES if cause in found}


def placement(names: Sequence[str], found: np.ndarray) -> dict[str, Failure]:
    """The objects of a world that found no free place; `found` (K,) bool."""
    without = [name for name, free in zip(names, found, strict=True) if not free]
    what = f"{', '.join(without)} start{'s' * (len(without) == 1)} above the others"
    return {"invalid_placement": Failure(0, 0, len(without), what)} if without else {}


def invalid(reasons: Sequence[str]) -> Failure:
    """The failure of an arena that cannot be."""
    return Failure(0, 0, len(reasons), " ".join(reasons) or "It is not valid in single precision.")


def length(metres: float) -> str:
    """A length with its unit."""
    return f"{metres:.3g} m" if abs(metres) >= 0.01 else f"{1000 * metres:.3g} mm"
