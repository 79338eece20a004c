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
from typing import Any, ClassVar, Literal, TypeAlias, TypeVar, dataclass_transform

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas.problem import Problem, problem

Numbers: TypeAlias = Any  # float | sequence | np.ndarray | jax.Array
Relative: TypeAlias = Literal["add", "scale"] | None
Tied: TypeAlias = bool | tuple[bool, ...] | Literal["axes"]

DRAWN = jnp.float32  # with JAX_ENABLE_X64, too, or a key would draw other worlds there
SUM_ERROR = 2e-5  # of probabilities that add up to 1, in single precision

_Class = TypeVar("_Class", bound=type)


@dataclass_transform(frozen_default=True)
def _distribution(cls: _Class) -> _Class:
    """A frozen dataclass and pytree: all fields are numbers but `relative` and `tied`, which are structure."""
    cls = dataclasses.dataclass(frozen=True, eq=False)(cls)
    static = [f.name for f in dataclasses.fields(cls) if f.name in ("relative", "tied")]
    numbers = [f.name for f in dataclasses.fields(cls) if f.name not in static]
    return jax.tree_util.register_dataclass(cls, data_fields=numbers, meta_fields=static)


class _ByValue:
    """Equal where all numbers are; arrays, too, so that `==` of ranges says whether they are the same."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        names = [field.name for field in dataclasses.fields(self)]  # type: ignore[arg-type]
        return all(_same(getattr(self, name), getattr(other, name)) for name in names)

    def __hash__(self) -> int:
        return hash(type(self))  # arrays have none


class Distribution(_ByValue):
    """What the distributions share: a standard draw per table or object, and its value."""

    relative: Relative = None
    tied: Any = False  # Tied
    per_item: ClassVar[bool] = False  # one draw for a table or object, not one for each of its axes

    def __post_init__(self) -> None:
        # Sequences become one leaf each, NumPy's arrays are copied, so that they stay as they were checked; anything else
        # (numbers, tracers, JAX's placeholders) stays as it is.
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, (list, tuple)) and field.name != "relative":
                frozen = tuple(value) if field.name == "tied" else _array_or_same(value)
                object.__setattr__(self, field.name, frozen)
            elif isinstance(value, np.ndarray) and value.flags.writeable:
                copy = value.copy()
                copy.flags.writeable = False
                object.__setattr__(self, field.name, copy)

    def draw(self, key: jax.Array, shape: tuple[int, ...]) -> jax.Array:
        """A standard draw, uniform in [0, 1)."""
        return jax.random.uniform(key, shape, DRAWN)

    def value(self, draw: jax.Array) -> jax.Array:
        """The value that belongs to a standard draw."""
        raise NotImplementedError

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest value, of concrete numbers."""
        raise NotImplementedError

    def problems(self) -> list[Problem]:
        """What is wrong with its numbers."""
        return []


@_distribution
class Uniform(Distribution):
    """Uniform between `low` and `high`."""

    low: Numbers
    high: Numbers
    relative: Relative = None
    tied: Tied = False

    def value(self, draw: jax.Array) -> jax.Array:
        low, high, draw = aligned(self.low, self.high, draw)
        return low + (high - low) * draw

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        return np.asarray(self.low, float), np.asarray(self.high, float)

    def problems(self) -> list[Problem]:
        return _order_problems(self.low, self.high)


@_distribution
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

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        return np.asarray(self.low, float), np.asarray(self.high, float)

    def problems(self) -> list[Problem]:
        found = [] if np.all(self.support()[0] > 0) else [problem("low", "positive", None, self.low)]
        return found + _order_problems(self.low, self.high)


@_distribution
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

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        return np.asarray(self.low, float), np.asarray(self.high, float)

    def problems(self) -> list[Problem]:
        found = [] if np.all(np.asarray(self.std, float) >= 0) else [problem("std", "at_least_0", None, self.std)]
        return found + _order_problems(self.low, self.high)


@_distribution
class Choice(Distribution):
    """One row of `values` for each table or object, with probabilities `p` (N,); without `p`, all alike.

    `values` is (N,) or, for quantities with axes, (N, 3); a number then serves all axes.
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

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        values = np.asarray(self.values, float)
        if self.p is not None:
            values = values[np.any(np.atleast_2d(self.p) > 0, axis=0)]
        return values.min(0), values.max(0)

    def problems(self) -> list[Problem]:
        values = np.asarray(self.values, float)
        if values.ndim not in (1, 2) or values.shape[0] == 0:
            return [problem("values", "values", None, self.values)]
        if self.p is None:
            return []
        p = np.asarray(self.p, float)
        right = p.shape[-1:] == values.shape[:1] and np.all(p >= 0) and np.all(np.abs(p.sum(-1) - 1.0) <= SUM_ERROR)
        if not right:
            return [problem("p", "probabilities", None, self.p, n=len(values))]
        return []


@_distribution
class Bernoulli(Distribution):
    """True with probability `p`."""

    p: Numbers
    tied: bool = False

    def value(self, draw: jax.Array) -> jax.Array:
        return operator.lt(*aligned(draw, self.p))

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        p = np.asarray(self.p, float)
        return (p >= 1).astype(float), (p > 0).astype(float)

    def problems(self) -> list[Problem]:
        p = np.asarray(self.p, float)
        return [] if np.all((p >= 0) & (p <= 1)) else [problem("p", "probability", None, self.p)]


@_distribution
class Count(Distribution):
    """True for `low` to `high` of the tables or objects, which ones and how many at random.

    As `object_active` it counts objects on absent tables, too, so that fewer may be there.
    """

    low: Numbers
    high: Numbers
    per_item: ClassVar[bool] = True

    def draw(self, key: jax.Array, shape: tuple[int, ...]) -> jax.Array:
        """A draw that orders the items, and one for the number, of which the first item's counts."""
        return jax.random.uniform(key, (*shape, 2), DRAWN)

    def value(self, draw: jax.Array) -> jax.Array:
        order, number = draw[:, 0], draw[0, 1]
        n = jnp.floor(self.low + number * (jnp.asarray(self.high) - self.low + 1))
        return (order[:, None] > order[None]).sum(-1) < n

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(()), np.asarray(np.asarray(self.high) > 0, float)

    def problems(self) -> list[Problem]:
        low, high = np.asarray(self.low, float), np.asarray(self.high, float)
        if low.ndim or high.ndim or low != np.round(low) or high != np.round(high) or low < 0:
            return [problem("low", "counts", low=self.low, high=self.high)]
        return _order_problems(self.low, self.high)


@_distribution
class Fixed(Distribution):
    """Always `at`: another value than the nominal one, the same in every world."""

    at: Numbers
    relative: Relative = None

    def value(self, draw: jax.Array) -> jax.Array:
        return jnp.asarray(self.at)

    def support(self) -> tuple[np.ndarray, np.ndarray]:
        at = np.asarray(self.at, float)
        return at, at


@functools.partial(jax.tree_util.register_dataclass, data_fields=["low", "high", "gap"], meta_fields=[])
@dataclasses.dataclass(frozen=True, eq=False)
class Workspace(_ByValue):
    """Places for the tables: uniform, inside a rectangle on the floor, apart from each other.

    A table keeps the height, yaw and size that it has; tables that are absent are left out. Where no place was found
    the world's `valid` flag is false, and the table stands beside the workspace, apart from the others.
    """

    low: Numbers
    """(2,) x and y [m] of the rectangle's corner."""
    high: Numbers
    """(2,) of the opposite corner."""
    gap: Numbers = 0.0
    """Smallest distance between two tables, seen from above [m]."""

    def problems(self) -> list[Problem]:
        """What is wrong with its numbers."""
        low, high, gap = (_floats(x) for x in (self.low, self.high, self.gap))
        right = low.shape == high.shape == (2,) and np.all(low < high)
        found = [] if right else [problem("low", "corners", low=self.low, high=self.high)]
        return found if gap.ndim == 0 and gap >= 0 else [*found, problem("gap", "workspace_gap", None, self.gap)]


def aligned(*numbers: Numbers) -> list[jax.Array]:
    """Arrays with as many axes as the one with the most, if they have any: `jax.numpy_rank_promotion("raise")` asks for it."""
    arrays = [jnp.asarray(x) for x in numbers]
    most = max(x.ndim for x in arrays)
    return [x.reshape((1,) * (most - x.ndim) + x.shape) if 0 < x.ndim < most else x for x in arrays]


def _array_or_same(value: Any) -> Any:
    """The sequence as one array; as it is if it holds tracers, or is ragged (validation will say so)."""
    if any(isinstance(x, jax.Array) for x in jax.tree.leaves(value)):
        return jnp.asarray(value)
    try:
        return np.asarray(value)
    except ValueError:
        return value


def _same(a: Any, b: Any) -> bool:
    traced = isinstance(a, jax.core.Tracer) or isinstance(b, jax.core.Tracer)
    return a is b or (not traced and np.array_equal(a, b))


def _floats(value: Any) -> np.ndarray:
    """The numbers as an array; what are none as NaN."""
    try:
        return np.asarray(value, float)
    except (TypeError, ValueError):
        return np.asarray(np.nan)


def _order_problems(low: Numbers, high: Numbers) -> list[Problem]:
    """Of a lower bound that is above the upper one; none of bounds whose shapes do not fit, which is said elsewhere."""
    try:
        ordered = np.all(np.asarray(low) <= np.asarray(high))
    except ValueError:
        return []
    return [] if ordered else [problem("low", "ordered", low=low, high=high)]
