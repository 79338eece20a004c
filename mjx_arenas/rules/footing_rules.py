"""Geoms that float above what they stand on, or sink into it, because a size or what is below varies and their place does not (host)."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from mjx_arenas.params.params import ArenaRanges
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import warn
from mjx_arenas.rules.validation_ranges import reach, traced
from mjx_arenas.sample.sampling import Nominal

LEAST = 1e-3  # that is told [m]


class Footing(NamedTuple):
    """A geom that stands on another, and a quantity that decides the size of one of the two, or the place of the lower."""

    quantity: str
    row: int
    overlap: Callable[[np.ndarray], np.ndarray]
    """How far the two reach into each other (n,) [m], up to a constant, with values (n, ...) of that row."""
    upper: str
    """What messages call the geom that stands."""
    lower: str
    """The same of what it stands on."""
    place: str
    """The attribute that places the upper one."""
    placed_by: frozenset[str]
    """Other quantities that place one of the two."""


def warn_of_gaps(ranges: ArenaRanges, nominal: Nominal, footings: Sequence[Footing]) -> None:
    """Warns of ranges with which something floats or sinks by a millimetre or more, of each the worst case.

    Args:
        ranges: that were found right.
        nominal: of the arena.
        footings: what stands on what.
    """
    worst: dict[str, tuple[float, float, Footing]] = {}
    masks = {term.name: term.mask for term in nominal.terms}
    for one in footings:
        dist = ranges.terms.get(one.quantity)
        if dist is None or traced(dist) or one.placed_by & ranges.varying:
            continue
        values = np.asarray(nominal.params.terms[one.quantity])
        bounds = [np.where(masks[one.quantity], b, values)[one.row] for b in (values, *reach(dist, values))]
        now, *others = one.overlap(np.array(bounds))
        found = max(others) - now, now - min(others), one
        before = worst.get(one.quantity)
        if max(found[:2]) > LEAST and (before is None or max(found[:2]) > max(before[:2])):
            worst[one.quantity] = found
    for name, (sinks, floats, one) in worst.items():
        told = (
            (sinks, f"sink up to {sinks:.3g} m into {one.lower}"),
            (floats, f"float up to {floats:.3g} m above {one.lower}"),
        )
        does = [how for far, how in told if far > LEAST]
        what = {"upper": one.upper, "does": " or ".join(does), "place": one.place}
        warn(problem(f"ranges.terms.{name}", "sinks_or_floats", None, None, what))
