"""Warnings of angles that look like degrees (host)."""

import numpy as np

from mjx_arenas.params.params import ArenaRanges, Quantity
from mjx_arenas.problem import Item, problem
from mjx_arenas.problems.messages import warn
from mjx_arenas.rules.validation import Labels
from mjx_arenas.rules.validation_ranges import path_of, traced
from mjx_arenas.sample.sampling import Nominal

MOST = 6.3  # [rad] that no one doubts: a turn, however it is rounded


def is_angle(quantity: Quantity) -> bool:
    """Whether its numbers are in radians."""
    return quantity.unit == "[rad]"


def warn_of_degrees(name: str, angles: np.ndarray | float, item: Item | None = None) -> None:
    """Warns of angles [rad] of more than a turn."""
    most = np.abs(angles).max(initial=0.0)
    if most > MOST:
        warn(problem(name, "degrees", item, most=most))


def warn_of_ranges(ranges: ArenaRanges, nominal: Nominal, labels: Labels) -> None:
    """Warns of ranges of angles, absolute or added, that reach beyond a turn, and beyond twice what an element has nominally.

    Args:
        ranges: that were found right.
        nominal: of the arena.
        labels: of its quantities.
    """
    for name, dist in ranges.distributions.items():
        if traced(dist) or dist.relative == "scale":
            continue
        angles = np.array([is_angle(one) for one in labels.rules(name)], bool)
        if not angles.any():
            continue
        value = np.asarray(nominal.values[name])
        varies = labels.terms[name].mask if name in labels.terms else np.ones(value.shape, bool)
        far = np.max([np.abs(np.broadcast_to(bound, value.shape)) for bound in dist.support()], axis=0) * varies
        far, usual = (np.abs(x).reshape(len(value), -1).max(1) for x in (far, value))
        warn_of_degrees(path_of(name, labels), far[angles & (far > 2 * usual)])
