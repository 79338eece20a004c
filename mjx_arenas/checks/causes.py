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
    """Measure of how bad it is at worst, by cause.

    - "not_finite": the number of the step.
    - "solver_gave_up": the deviation of an object's velocity from what its constraints require, over consecutive steps [m/s].
    - "dropped_contacts": the number of contacts for which a world needs room.
    - "deep_penetration": the depth as a share of the smaller half extent of the two geoms.
    - "through_table" and "off_table": how far below the top and outside the edges the middle of the object gets [m].
    - "invalid_placement": the number of objects without a free place.
    - "invalid_arena": the number of problems."""
    what: str
    """Description in words, with names and units. It says in which steps, and of which objects or geoms, `step` and `number` are."""

    def rank(self, cause: str) -> tuple[float, int]:
        """Sort key within a cause: the smallest is the worst."""
        return (self.step, 0) if cause == "not_finite" else (-self.number, self.step)


def happened(seen: Seen) -> np.ndarray:
    """(W,) bool: `steps` finds something in the world."""
    first = np.stack([seen.not_finite, seen.dropped, seen.deep], axis=1)
    return (np.concatenate([first, seen.through, seen.off, seen.unsolved], axis=1) != NEVER).any(1)


def steps(
    seen: Seen, world: int, pairs: Sequence[Sequence[str]], names: Sequence[str], before: int = 0
) -> dict[str, Failure]:
    """What went wrong in the steps of a world, by cause.

    Args:
        seen: of many worlds.
        world: which of them, whose number the failures get.
        pairs: names of the geoms of the contact that was first deep, and of the deepest.
        names: (K,) of the objects.
        before: number of steps that came before those that were seen.
    """
    found = {}

    def add(cause: str, step: np.ndarray, amount: float, what: str) -> None:
        if step < NEVER:
            found[cause] = Failure(world, int(step) + before, float(amount), what)

    def first(step: np.ndarray) -> str:
        return f"first in step {int(step) + before}"

    at, needed = seen.not_finite[world], int(seen.needed)
    add("not_finite", at, int(at) + before, f"state is NaN, infinite or beyond 1e10, {first(at)}")
    at, room = seen.dropped[world], f"room for {needed} a world would have been enough"
    add("dropped_contacts", at, needed, f"contacts dropped, {first(at)}; {room}")
    for cause, events, amounts, how in (
        ("through_table", seen.through[world], seen.below[world], lambda x: f"up to {length(x)} below the top"),
        ("off_table", seen.off[world], seen.outside[world], lambda x: f"up to {length(x)} outside the edges"),
        (
            "solver_gave_up",
            seen.unsolved[world],
            seen.most_lost[world],
            lambda x: f"moves up to {x:.3g} m/s apart from its forces",
        ),
    ):
        if len(events):
            worst, one = int(np.where(events < NEVER, amounts, -1).argmax()), int(events.argmin())
            what = f"{names[worst]} {how(amounts[worst])}, {first(events[worst])}"
            if events[one] < events[worst]:
                what += f"; {names[one]} already in step {int(events[one]) + before}"
            add(cause, events[one], amounts[worst], what)
    at, same = seen.deep[world], pairs[0] == pairs[1]
    geoms, most = (" and ".join(pair) for pair in pairs)
    depth = f"{length(seen.depth[world])} deep, {100 * seen.share[world]:.0f} % of the smaller half extent"
    what = (
        f"{geoms} up to {depth}, {first(at)}"
        if same
        else f"{geoms} too deep, {first(at)}; at worst {most} {depth}, in step {int(seen.deepest[world]) + before}"
    )
    add("deep_penetration", at, seen.share[world], what)
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
