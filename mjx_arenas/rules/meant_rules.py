"""Ranges that are possible, and may have been meant otherwise (host)."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from mjx_arenas.params.distribution import Distribution
from mjx_arenas.params.params import ArenaRanges, Quantity, Selected
from mjx_arenas.problem import Item, Problem, problem
from mjx_arenas.problems.messages import warn
from mjx_arenas.rules import unit_rules, world_rules
from mjx_arenas.rules.validation import Labels
from mjx_arenas.rules.validation_ranges import path_of, reach, traced
from mjx_arenas.sample.sampling import Nominal

FAR = 4  # times a number: no one means this by a range about 1
ABOUT_ONE = 0.1  # how far the middle of factors is from 1, at most
LEAST = 0.2  # of what are factors
PERCENT = 100  # times as large as factors
ABOUT_ZERO = 0.5  # the most of what is rather added than multiplied, and as far below 0
_BY_DEFAULT = ("object_masses", "object_densities")
"""What is often not stated, and then follows from a density by default."""


def far(ranges: ArenaRanges, nominal: Nominal, labels: Labels) -> Iterator[tuple[float, Problem]]:
    """Absolute ranges from which a nominal number is farther than they are wide, which may have been meant to be relative to it.

    Yields how many times as far, and what to say.
    """
    for name, dist, value in _known(ranges, nominal, labels):
        if dist.relative is not None:
            continue
        quantity = labels.of(name)[0]
        low, high = reach(dist, value)
        varies = _varies(name, low, high, value, labels)
        away = np.where(varies, np.maximum(low - value, value - high) / np.where(varies, high - low, 1), 0)
        if away.max() > 1:
            at = np.unravel_index(away.argmax(), away.shape)
            yield float(away[at]), _relative(name, low, high, value, at, _factors(low[at], high[at], quantity), labels)


def warn_of_ranges(ranges: ArenaRanges, nominal: Nominal, labels: Labels) -> None:
    """Warns of absolute ranges that look like factors, or like numbers in another unit, and of x, y and z that were given one range.

    Of what is added it warns of other units as well, and of factors where they look like percent, or like what is added.

    Args:
        ranges: that were found right.
        nominal: of the arena.
        labels: of its quantities.
    """
    for name, dist, value in _known(ranges, nominal, labels):
        if dist.relative == "scale":
            _warn_of_factors(name, dist, value, labels)
            continue
        quantity, absolute = labels.of(name)[0], dist.relative is None
        low, high = reach(dist, value)
        varies = _varies(name, low, high, value, labels)
        away = np.where(varies & _about_one(low, high), _times(low, high, value), 0)
        if absolute and away.max() > FAR and name not in _BY_DEFAULT:
            at = np.unravel_index(away.argmax(), away.shape)
            warn(_relative(name, low, high, value, at, True, labels))
        elif found := unit_rules.other_unit(quantity, low, high, value, _decided(name, value, labels)):
            rule, at, told = found
            warn(problem(path_of(name, labels), rule, _item(name, at, labels), None, told))
        if absolute and name in labels.terms and (told := _as_in_mjcf(labels.terms[name], low, high, value)):
            warn(problem(path_of(name, labels), "place_in_mjcf", _item(name, (told[0],), labels), None, told[1]))
        given = {np.shape(bound) for bound in dist.support()}
        if absolute and given == {()} and quantity.axes == "x, y, z" and _one_for_all(name, low, high, value, labels):
            of = "of a place " if quantity.of != "option" else ""
            told = {"least": low.min(), "most": high.max(), "of": of, "one": quantity.unit.strip("[]")}
            warn(problem(path_of(name, labels), "one_for_all_axes", None, None, told))


def _as_in_mjcf(
    selected: Selected, low: np.ndarray, high: np.ndarray, value: np.ndarray
) -> tuple[int, dict[str, Any]] | None:
    """The first element whose range is around its place in the MJCF, and not around that in the compiled model, and both."""
    if selected.in_mjcf is None:
        return None
    told = np.asarray(selected.in_mjcf)
    around = [((low <= x) & (x <= high) | ~selected.mask).all(-1) for x in (told, value)]
    found = np.flatnonzero(around[0] & ~around[1] & selected.mask.any(-1))
    if not found.size:
        return None
    told, compiled = (np.round(x[found[0]], 6).tolist() for x in (told, value))
    return int(found[0]), {"told": told, "compiled": compiled}


def _warn_of_factors(name: str, dist: Distribution, value: np.ndarray, labels: Labels) -> None:
    """Warns of factors about 100, which are percent, and of places and angles multiplied by what is about 0, as if it were added."""
    low, high = (np.broadcast_to(bound, value.shape) for bound in dist.support())
    found, quantity = _about_one(low / PERCENT, high / PERCENT), labels.of(name)[0]
    if quantity.allowed is None and quantity.unit in ("[m]", "[rad]"):
        found |= (np.abs(low + high) < 1e-6) & (high <= ABOUT_ZERO)
    found &= _varies(name, low, high, value, labels)
    if found.any():
        at = tuple(np.argwhere(found)[0].tolist())
        warn(problem(path_of(name, labels), "factors", _item(name, at, labels), least=low[at], most=high[at]))


def _one_for_all(name: str, low: np.ndarray, high: np.ndarray, value: np.ndarray, labels: Labels) -> bool:
    """Whether one range for three axes gives a place, or a vector such as gravity, what no one means.

    To a vector that is 0, such as wind where there is none, the same is added along all axes if the range has 0 in its middle.
    """
    quantity = labels.of(name)[0]
    varies, moves = _varies(name, low, high, value, labels), _moves(name, low, high, labels)
    if quantity.of == "option":
        aside = np.abs(low + high) > 1e-6 * np.maximum(np.abs(low), np.abs(high))
        return bool((_decided(name, value, labels).all(-1) & (aside | varies).any(-1)).any())
    place = quantity.unit == "[m]" and quantity.allowed is None
    return place and bool((varies.any(-1) & moves.all(-1)).any())


def _known(ranges: ArenaRanges, nominal: Nominal, labels: Labels) -> Iterator[tuple[str, Distribution, np.ndarray]]:
    """The ranges of numbers that are known, by name, with the nominal numbers."""
    for name, dist in ranges.distributions.items():
        value = np.asarray(nominal.values[name])
        if not traced(dist) and labels.of(name)[0].kind is float and value.size:
            yield name, dist, value


def _varies(name: str, low: np.ndarray, high: np.ndarray, value: np.ndarray, labels: Labels) -> np.ndarray:
    """Which numbers vary, and would differ if the range were relative: to add to 0 is to replace it."""
    return _moves(name, low, high, labels) & (value != 0)


def _moves(name: str, low: np.ndarray, high: np.ndarray, labels: Labels) -> np.ndarray:
    """Which numbers vary."""
    return (high > low) & _decided(name, high, labels)


def _decided(name: str, value: np.ndarray, labels: Labels) -> np.ndarray:
    """Which numbers a range decides."""
    return labels.terms[name].mask if name in labels.terms else np.ones(value.shape, bool)


def _about_one(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Whether 1 is about in the middle of the bounds, as of factors."""
    middle = np.minimum(np.abs((low + high) / 2 - 1), np.abs(np.sqrt(np.maximum(low * high, 0)) - 1))
    return (low >= LEAST) & (middle < ABOUT_ONE)


def _times(low: np.ndarray, high: np.ndarray, value: np.ndarray) -> np.ndarray:
    """How many times as small or large as bounds above 0 a number above 0 is; 0 for others."""
    right = (low > 0) & (value > 0)
    low, high, value = (np.where(right, x, 1.0) for x in (low, high, value))
    return np.where(right, np.maximum(low / value, value / high), 0)


def _relative(
    name: str, low: np.ndarray, high: np.ndarray, value: np.ndarray, at: tuple, factors: bool, labels: Labels
) -> Problem:
    numbers = {"least": low[at], "most": high[at], "nominal": value[at], "relative": "scale" if factors else "add"}
    return problem(path_of(name, labels), "meant_relative", _item(name, at, labels), None, numbers)


def _item(name: str, at: tuple, labels: Labels) -> Item | None:
    """What has a number of a quantity; None of an option, which is all of the arena's."""
    quantity, rows = labels.of(name)
    return None if quantity.of == "option" else world_rules.item(quantity.of, rows[int(at[0])])


def _factors(low: float, high: float, quantity: Quantity) -> bool:
    """Whether bounds rather look like factors than like what is added: they are about 1, and what is below 0 is seldom scaled."""
    about = 2 if quantity.limits[0] >= 0 else 1
    return 0 < low <= about and high * about >= 1
