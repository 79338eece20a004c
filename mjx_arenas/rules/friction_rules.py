"""Sliding friction that varies, and is not the one that counts (host)."""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import numpy as np

from mjx_arenas.params.distribution import Distribution
from mjx_arenas.params.distributions import Choice
from mjx_arenas.params.params import ArenaRanges, named
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import warn
from mjx_arenas.rules.validation_ranges import reach, traced
from mjx_arenas.sample.sampling import Nominal


class Decides(NamedTuple):
    """What decides the friction of a geom: a row of a quantity whose first number is sliding friction."""

    quantity: str
    row: int
    known: bool = True
    """Whether its nominal number is all that it can be without a range: of objects with variants it is not."""


class OfPairs(NamedTuple):
    """N pairs of geoms that have a friction of their own."""

    names: tuple[str, ...]
    """(N,) what messages call them."""
    condim: np.ndarray
    """(N,)"""
    sliding: np.ndarray
    """(N,) nominal friction."""
    decides: tuple[Decides | None, ...]
    """(N,) None: it is as it is."""


class Rubbing(NamedTuple):
    """N geoms that collide, and what their contacts take friction from."""

    touch: np.ndarray
    """(N, N) bool: which may touch each other, with friction of their own."""
    priority: np.ndarray
    """(N,)"""
    sliding: np.ndarray
    """(N,) nominal friction."""
    decides: tuple[Decides | None, ...]
    """(N,) None: it is as it is."""
    names: tuple[str, ...]
    """(N,) what messages call them."""
    condim: np.ndarray
    """(N,)"""


def warn_of_idle(ranges: ArenaRanges, nominal: Nominal, rubbing: Rubbing, decided: bool) -> None:
    """Warns of friction, other than the nominal one, that no contact has, in whole or in the lower half and more.

    A contact has the friction of the geom of higher priority, of two with the same the larger. So a range counts where it is higher
    than the least that some other geom of the same priority can have. Of geoms such as fingers it warns, too, if it counts elsewhere alone,
    and objects have a higher priority.

    Args:
        ranges: that were found right.
        nominal: of the arena.
        rubbing: what may touch what.
        decided: the friction of objects, by all on which they stand, of which there is another warning.
    """
    low, high = _bounds(ranges, nominal, rubbing)
    known = {name for name, dist in _given(ranges).items() if not traced(dist)}
    given = np.array([one is not None and one.quantity in known for one in rubbing.decides], bool)
    changes = given & ((low < high) | ~np.isclose(low, rubbing.sliding, 1e-6, 0.0))
    found: dict[str, tuple[float, float, float]] = {}  # the least number that counts, and the range
    for i, decides in enumerate(rubbing.decides):
        if decides is None or not changes[i] or (decided and decides.quantity == "object_frictions"):
            continue
        others = rubbing.touch[i]
        if not others.any():
            continue
        least = np.where(rubbing.priority[others] < rubbing.priority[i], -np.inf, low[others])
        least = np.where(rubbing.priority[others] > rubbing.priority[i], np.inf, least).min()
        before = found.get(decides.quantity, (np.inf, np.inf, -np.inf))
        found[decides.quantity] = min(least, before[0]), min(low[i], before[1]), max(high[i], before[2])
    beneath = _beneath_objects(rubbing, changes)
    for name, (least, lowest, highest) in found.items():
        path = f"ranges.{name}" if hasattr(ranges, name) else f"ranges.terms.{name}"
        if least >= highest:
            rule = "idle_priority" if np.isinf(least) else "idle_sliding"
            warn(problem(path, rule, least=least))
        elif least > (lowest + highest) / 2:
            warn(problem(path, "idle_below", least=least, lowest=lowest))
        elif name in beneath:
            warn(problem(path, "idle_on_objects"))


def warn_of_spin(ranges: ArenaRanges, nominal: Nominal, rubbing: Rubbing) -> None:
    """Warns of torsional and rolling friction that varies in contacts without any, if it has numbers of its own or varies alone.

    That of tables has a warning that knows `table_condim`.

    Args:
        ranges: that were found right.
        nominal: of the arena.
        rubbing: what may touch what.
    """
    given = {"object_frictions": ranges.object_frictions, **ranges.terms}
    masks = {term.name: term.mask for term in nominal.terms}
    for name, condim in _condims(rubbing).items():
        dist, value = given.get(name), np.asarray(named(nominal.params)[name])
        mask = np.broadcast_to(masks.get(name, np.ones(3, bool)), value.shape)
        if dist is None or condim >= 6 or traced(dist) or value.shape[-1:] != (3,):
            continue
        low, high = reach(dist, value)
        own = [dist.values] if isinstance(dist, Choice) else jax.tree.leaves(dist)
        each = any(np.shape(x)[dist.per_item :][-1:] == (3,) for x in own) or not mask[:, 0].any()
        idle = slice(2 if condim == 4 else 1, None)
        if each and np.any((low != high)[:, idle] & mask[:, idle]):
            which = "rolling friction has" if condim == 4 else "torsional and rolling friction have"
            at = f"ranges.{name}" if hasattr(ranges, name) else f"ranges.terms.{name}"
            warn(problem(at, "idle_spin", None, None, {"which": which, "condim": condim}))


def _given(ranges: ArenaRanges) -> dict[str, Distribution]:
    """The distributions by quantity."""
    return {name: dist for name, dist in {**ranges._asdict(), **ranges.terms}.items() if dist is not None}


def _condims(rubbing: Rubbing) -> dict[str, int]:
    """By quantity, the largest `condim` of the contacts that can have its friction; without those that have none."""
    found: dict[str, int] = {}
    for i, decides in enumerate(rubbing.decides):
        even = rubbing.touch[i] & (rubbing.priority == rubbing.priority[i])
        counts = rubbing.touch[i] & (rubbing.priority <= rubbing.priority[i])
        if decides is not None and decides.quantity != "table_frictions" and counts.any():
            most = int(rubbing.condim[even].max(initial=rubbing.condim[i]))
            found[decides.quantity] = max(found.get(decides.quantity, 0), most)
    return found


def _bounds(ranges: ArenaRanges, nominal: Nominal, rubbing: Rubbing) -> tuple[np.ndarray, np.ndarray]:
    """(N,) the least and the most sliding friction of each geom; of what is traced nothing is known."""
    given = _given(ranges)
    values: Mapping[str, np.ndarray] = named(nominal.params)
    masks = {term.name: term.mask for term in nominal.terms}
    low, high = rubbing.sliding.copy(), rubbing.sliding.copy()
    for i, decides in enumerate(rubbing.decides):
        if decides is None:
            continue
        name, row, known = decides
        dist = given.get(name)
        if dist is None:
            low[i], high[i] = (low[i], high[i]) if known else (0.0, 0.0)
        elif traced(dist):
            low[i] = high[i] = 0.0
        elif name not in masks or masks[name].reshape(len(masks[name]), -1)[row, 0]:
            value = np.asarray(values[name])
            low[i], high[i] = (b.reshape(len(value), -1)[row, 0] for b in reach(dist, value))
    return low, high


def _beneath_objects(rubbing: Rubbing, varies: np.ndarray) -> set[str]:
    """The quantities of geoms that may touch objects, all of which have a higher priority; `varies` (N,) bool."""
    of_objects = np.array([one is not None and one.quantity == "object_frictions" for one in rubbing.decides], bool)
    found: dict[str, bool] = {}
    for i, decides in enumerate(rubbing.decides):
        objects = rubbing.touch[i] & of_objects
        if decides is not None and varies[i] and not of_objects[i] and objects.any():
            beneath = bool((rubbing.priority[objects] > rubbing.priority[i]).all())
            found[decides.quantity] = found.get(decides.quantity, True) and beneath
    return {name for name, beneath in found.items() if beneath}
