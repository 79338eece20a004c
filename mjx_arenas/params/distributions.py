"""Distributions of randomized quantities.

Each is a pytree whose numbers may be traced, so that a curriculum widens a range without recompiling. Numbers
broadcast against the quantity: one number, one per axis (3,), or one per table (T, 3), (T,).

`relative` says how a draw meets the nominal value: `None` replaces it, `"add"` is added to it, `"scale"` multiplies it.
`tied` gives all tables (or objects) the same draw: `True`, or per axis, e.g. `(False, False, True)` for one height;
`"axes"` gives all axes of one the same draw, e.g. a factor for its whole size.
"""

import dataclasses
import functools
import operator
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import gammaln, ndtr, ndtri
from jax.scipy.stats import norm

from mjx_arenas.params.distribution import (
    DRAWN,
    ByValue,
    Distribution,
    Numbers,
    Relative,
    Tied,
    aligned,
    distribution,
    floats,
    order_problems,
)
from mjx_arenas.problem import Problem, problem

SUM_ERROR = 2e-5  # of probabilities that add up to 1, in single precision
FARTHEST = 6.0  # standard deviations; single precision knows no number between that and 1
BELOW_ONE = 1 - 2.0**-24  # as a draw of `jax.random.uniform` is


@distribution
class Uniform(Distribution):
    """Uniform between `low` and `high`."""

    low: Numbers
    high: Numbers
    relative: Relative = None
    tied: Tied = False

    def value(self, draw: jax.Array) -> jax.Array:
        low, high, draw = aligned(self.low, self.high, draw)
        return low + (high - low) * draw

    def inverse(self, value: jax.Array) -> jax.Array:
        low, high, value = aligned(self.low, self.high, value)
        return _share(value - low, high - low)

    def log_density(self, value: jax.Array, near: jax.Array) -> tuple[jax.Array, jax.Array]:
        low, high, value = aligned(self.low, self.high, value)
        return _of_width(high - low, value)

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        return np.asarray(self.low, float), np.asarray(self.high, float)

    def problems(self) -> list[Problem]:
        return order_problems(self.low, self.high)


@distribution
class LogUniform(Distribution):
    """Uniform in the logarithm between `low` and `high`, both > 0."""

    low: Numbers
    high: Numbers
    relative: Relative = None
    tied: Tied = False

    def value(self, draw: jax.Array) -> jax.Array:
        least, most, draw = aligned(self.low, self.high, draw)
        low, high = jnp.log(least), jnp.log(most)
        return jnp.clip(jnp.exp(low + (high - low) * draw), least, most)  # exp(log(x)) may round past x

    def inverse(self, value: jax.Array) -> jax.Array:
        low, high, value = aligned(self.low, self.high, value)
        return _share(jnp.log(jnp.clip(value, low, high) / low), jnp.log(high / low))

    def log_density(self, value: jax.Array, near: jax.Array) -> tuple[jax.Array, jax.Array]:
        low, high, value = aligned(self.low, self.high, value)
        density, sure = _of_width(jnp.log(high / low), value)
        return density - jnp.where(sure, 0.0, jnp.log(jnp.clip(value, low, high))), sure

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        return np.asarray(self.low, float), np.asarray(self.high, float)

    def problems(self) -> list[Problem]:
        found = [] if np.all(self.support()[0] > 0) else [problem("low", "positive", None, self.low)]
        return found + order_problems(self.low, self.high)


@distribution
class Normal(Distribution):
    """Normal with `mean` and standard deviation `std`, clipped to [`low`, `high`]."""

    mean: Numbers
    std: Numbers
    low: Numbers
    high: Numbers
    relative: Relative = None
    tied: Tied = False

    def draw(self, key: jax.Array, shape: tuple[int, ...]) -> jax.Array:
        """A standard normal draw."""
        return jax.random.normal(key, shape, DRAWN)

    def value(self, draw: jax.Array) -> jax.Array:
        mean, std, low, high, draw = aligned(self.mean, self.std, self.low, self.high, draw)
        return jnp.clip(mean + std * draw, low, high)

    def inverse(self, value: jax.Array) -> jax.Array:
        mean, std, low, high, value = aligned(self.mean, self.std, self.low, self.high, value)
        return (jnp.clip(value, low, high) - mean) / jnp.where(std > 0, std, 1.0)

    def draws_of(self, value: jax.Array, near: jax.Array) -> tuple[jax.Array, jax.Array]:
        std, low, high, value, near = aligned(self.std, self.low, self.high, value, near)
        least, most = self.inverse(value - near), self.inverse(value + near)
        at_low, at_high = (value <= low + near) | (std <= 0), (value >= high - near) | (std <= 0)
        return jnp.where(at_low, -jnp.inf, least), jnp.where(at_high, jnp.inf, most)

    def log_density(self, value: jax.Array, near: jax.Array) -> tuple[jax.Array, jax.Array]:
        mean, std, low, high, value, near = aligned(self.mean, self.std, self.low, self.high, value, near)
        std = jnp.where(std > 0, std, jnp.finfo(value.dtype).tiny)
        lowest, highest = value <= low + near, value >= high - near
        found = jnp.where(lowest, norm.logcdf(low, mean, std), norm.logpdf(value, mean, std))
        found = jnp.where(highest, norm.logsf(high, mean, std), found)
        sure = (lowest & highest) | (jnp.asarray(self.std) == 0)
        return jnp.where(sure, 0.0, found), sure | lowest | highest

    @staticmethod
    def to_unit(draw: jax.Array) -> jax.Array:
        return ndtr(draw)

    @staticmethod
    def from_unit(unit: jax.Array) -> jax.Array:
        return jnp.clip(ndtri(unit), -FARTHEST, FARTHEST)

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        return np.asarray(self.low, float), np.asarray(self.high, float)

    def problems(self) -> list[Problem]:
        found = [] if np.all(np.asarray(self.std, float) >= 0) else [problem("std", "at_least_0", None, self.std)]
        return found + order_problems(self.low, self.high)


@distribution
class Choice(Distribution):
    """One row of `values` for each table, object or element of a term.

    Rows are drawn with probabilities `p` (N,). Without `p` all are equally likely. `values` is (N,) or, for quantities with A axes, (N, A).
    With (N,) one number is used for all axes.
    """

    values: Numbers
    p: Numbers = None
    relative: Relative = None
    tied: bool = False
    per_item: ClassVar[bool] = True

    def value(self, draw: jax.Array) -> jax.Array:
        values = jnp.asarray(self.values)
        n = values.shape[0]
        if self.p is None:
            index = (draw * n).astype(int)
        else:
            edges = jnp.cumsum(jnp.asarray(self.p))
            index = operator.ge(*aligned(draw[..., None] * edges[-1], edges)).sum(-1)
        return values[jnp.minimum(index, n - 1)]

    def inverse(self, value: jax.Array) -> jax.Array:
        p, index = self._probabilities, self._apart(value).argmin(1)
        return (jnp.cumsum(p) - p / 2)[index]

    def draws_of(self, value: jax.Array, near: jax.Array) -> tuple[jax.Array, jax.Array]:
        middle, half = self.inverse(value), self._probabilities[self._apart(value).argmin(1)] / 2
        free = jnp.isnan(value.astype(float)).reshape(len(value), -1).all(1)
        return jnp.where(free, jnp.nan, middle - half), jnp.where(free, jnp.nan, middle + half)

    def log_density(self, value: jax.Array, near: jax.Array) -> tuple[jax.Array, jax.Array]:
        same = self._apart(value) <= near.reshape(len(near), -1).max(-1)[:, None]
        found = jnp.log(jnp.where(same, self._probabilities, 0.0).sum(1))
        return found, jnp.ones(found.shape, bool)

    @property
    def _probabilities(self) -> jax.Array:
        n = jnp.asarray(self.values).shape[0]
        return jnp.full(n, 1 / n) if self.p is None else jnp.asarray(self.p) / jnp.asarray(self.p).sum()

    def _apart(self, value: jax.Array) -> jax.Array:
        """(N, V) how far each item's value is from each row."""
        rows = jnp.asarray(self.values).astype(float)
        rows = rows.reshape(1, len(rows), *(rows.shape[1:] or (1,) * (value.ndim - 1)))
        return jnp.nan_to_num(abs(value.astype(float)[:, None] - rows)).reshape(len(value), rows.shape[1], -1).max(-1)

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        values = np.asarray(self.values, float)
        if self.p is not None:
            values = values[np.any(np.atleast_2d(self.p) > 0, axis=0)]
        return values.min(0), values.max(0)

    def problems(self) -> list[Problem]:
        values = np.asarray(self.values, float)
        if values.size == 0:
            return [problem("values", "empty")]
        if values.ndim not in (1, 2):
            return [problem("values", "values", None, self.values)]
        if self.p is None:
            return []
        p = np.asarray(self.p, float)
        right = p.shape[-1:] == values.shape[:1] and np.all(p >= 0) and np.all(np.abs(p.sum(-1) - 1.0) <= SUM_ERROR)
        if not right:
            return [problem("p", "probabilities", None, self.p, n=len(values))]
        return []


@distribution
class Bernoulli(Distribution):
    """True with probability `p`."""

    p: Numbers
    tied: bool = False

    def value(self, draw: jax.Array) -> jax.Array:
        return operator.lt(*aligned(draw, self.p))

    def inverse(self, value: jax.Array) -> jax.Array:
        value, p = aligned(value, self.p)
        return jnp.where(value, p / 2, (1 + p) / 2)

    def draws_of(self, value: jax.Array, near: jax.Array) -> tuple[jax.Array, jax.Array]:
        value, p = aligned(value, self.p)
        return jnp.where(value, 0.0, p), jnp.where(value, p * BELOW_ONE, 1.0)

    def log_density(self, value: jax.Array, near: jax.Array) -> tuple[jax.Array, jax.Array]:
        value, p = aligned(value, self.p)
        return jnp.log(jnp.where(value, p, 1 - p)), jnp.ones(value.shape, bool)

    @staticmethod
    def from_unit(unit: jax.Array) -> jax.Array:
        return jnp.minimum(unit, BELOW_ONE)

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        p = np.asarray(self.p, float)
        return (p >= 1).astype(float), (p > 0).astype(float)

    def problems(self) -> list[Problem]:
        p = np.asarray(self.p, float)
        return [] if np.all((p >= 0) & (p <= 1)) else [problem("p", "share", None, self.p)]


@distribution
class Count(Distribution):
    """True for `low` to `high` of the tables or objects. Which ones and how many is random.

    With `first` they are the first ones, such as the cabinets of a shorter row; only how many is random.

    As `object_active` it also counts objects on absent tables, so fewer may be there.
    """

    low: Numbers
    high: Numbers
    first: bool = False
    per_item: ClassVar[bool] = True

    def draw(self, key: jax.Array, shape: tuple[int, ...]) -> jax.Array:
        """A draw that orders the items, and a draw for the number. Only the number of the first item counts."""
        return jax.random.uniform(key, (*shape, 2), DRAWN)

    def value(self, draw: jax.Array) -> jax.Array:
        order, number = draw[:, 0], draw[0, 1]
        n = jnp.floor(self.low + number * (jnp.asarray(self.high) - self.low + 1))
        if self.first:
            return jnp.arange(len(draw)) < n
        return (order[:, None] > order[None]).sum(-1) < n

    def inverse(self, value: jax.Array) -> jax.Array:
        rank = jnp.argsort(jnp.argsort(~value, stable=True))  # those that are there come first
        number = (value.sum() - jnp.asarray(self.low) + 0.5) / (jnp.asarray(self.high) - self.low + 1)
        return jnp.stack([(rank + 0.5) / len(value), jnp.broadcast_to(jnp.clip(number, 0, 1), value.shape)], axis=-1)

    def draws_of(self, value: jax.Array, near: jax.Array) -> tuple[jax.Array, jax.Array]:
        draws = self.inverse(value)
        return draws, draws

    def log_density(self, value: jax.Array, near: jax.Array) -> tuple[jax.Array, jax.Array]:
        """The log density of all items together, divided evenly among them."""
        all_, some = jnp.asarray(float(len(value))), value.sum().astype(float)
        if self.first:
            ways = jnp.where((value == (jnp.arange(len(value)) < some)).all(), 0.0, jnp.inf)
        else:
            ways = gammaln(all_ + 1) - gammaln(some + 1) - gammaln(all_ - some + 1)
        found = -jnp.log(jnp.asarray(self.high) - self.low + 1.0) - ways
        return jnp.broadcast_to(found / all_, value.shape), jnp.ones(value.shape, bool)

    @staticmethod
    def from_unit(unit: jax.Array) -> jax.Array:
        return jnp.minimum(unit, BELOW_ONE)

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(()), np.asarray(np.asarray(self.high) > 0, float)

    def problems(self) -> list[Problem]:
        low, high = np.asarray(self.low, float), np.asarray(self.high, float)
        if low.ndim or high.ndim or low != np.round(low) or high != np.round(high) or low < 0:
            return [problem("low", "counts", low=self.low, high=self.high)]
        if not isinstance(self.first, bool):
            return [problem("first", "truth", None, self.first)]
        return order_problems(self.low, self.high)


@distribution
class Fixed(Distribution):
    """The value `at` in every world, in place of the nominal one."""

    at: Numbers
    relative: Relative = None

    def value(self, draw: jax.Array) -> jax.Array:
        return jnp.asarray(self.at)

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        at = np.asarray(self.at, float)
        return at, at


@functools.partial(jax.tree_util.register_dataclass, data_fields=["low", "high", "gap"], meta_fields=[])
@dataclasses.dataclass(frozen=True, eq=False)
class Workspace(ByValue):
    """Random places for the tables: uniform, inside a rectangle on the floor, apart from each other.

    A table keeps its height, yaw and size. Absent tables are left out. If no place is found for a table, the world's `valid` flag is false,
    and the table stands beside the workspace, apart from the others.
    """

    low: Numbers
    """(2,) x and y [m] of the rectangle's corner."""
    high: Numbers
    """(2,) x and y [m] of the opposite corner."""
    gap: Numbers = 0.0
    """Smallest horizontal distance between two tables [m]."""

    def problems(self) -> list[Problem]:
        """What is wrong with its numbers; empty if nothing is."""
        low, high, gap = (floats(x) for x in (self.low, self.high, self.gap))
        right = low.shape == high.shape == (2,) and np.all(low < high)
        found = [] if right else [problem("low", "corners", low=self.low, high=self.high)]
        return found if gap.ndim == 0 and gap >= 0 else [*found, problem("gap", "workspace_gap", None, self.gap)]


def _share(part: jax.Array, whole: jax.Array) -> jax.Array:
    """How much of a width a part is, from 0 to 1; half of no width."""
    return jnp.where(whole > 0, jnp.clip(part / jnp.where(whole > 0, whole, 1.0), 0.0, 1.0), 0.5)


def _of_width(width: jax.Array, value: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The logarithm of a density that is the same everywhere in a width; no width is a value that is sure."""
    sure = jnp.broadcast_to(width <= 0, value.shape)
    return jnp.where(sure, 0.0, -jnp.log(jnp.where(sure, 1.0, width))), sure
