"""What the distributions of randomized quantities share: a standard draw, the value that belongs to it, and the way back."""

import dataclasses
from typing import Any, ClassVar, Literal, TypeAlias, TypeVar, dataclass_transform

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas.keywords import WithKnownArguments
from mjx_arenas.problem import Problem, problem

Numbers: TypeAlias = Any  # float | sequence | np.ndarray | jax.Array
Relative: TypeAlias = Literal["add", "scale"] | None
Tied: TypeAlias = bool | tuple[bool, ...] | Literal["axes"]

DRAWN = jnp.float32  # with JAX_ENABLE_X64, too, or a key would draw other worlds there

_Class = TypeVar("_Class", bound=type)


@dataclass_transform(frozen_default=True)
def distribution(cls: _Class) -> _Class:
    """A frozen dataclass and pytree: all fields are numbers but `relative`, `tied` and `first`, which are structure."""
    cls = dataclasses.dataclass(frozen=True, eq=False)(cls)
    static = [f.name for f in dataclasses.fields(cls) if f.name in ("relative", "tied", "first")]
    numbers = [f.name for f in dataclasses.fields(cls) if f.name not in static]
    return jax.tree_util.register_dataclass(cls, data_fields=numbers, meta_fields=static)


class ByValue(WithKnownArguments):
    """Equal where all numbers are; arrays, too, so that `==` of ranges says whether they are the same."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        names = [field.name for field in dataclasses.fields(self)]  # type: ignore[arg-type]
        return all(_same(getattr(self, name), getattr(other, name)) for name in names)

    def __hash__(self) -> int:
        return hash(type(self))  # arrays have none


class Distribution(ByValue):
    """Base class of the distributions: a standard draw for each table or object, and its value."""

    relative: Relative = None
    tied: Any = False  # Tied
    per_item: ClassVar[bool] = False  # one draw for a table or object, not one for each of its axes

    def __post_init__(self) -> None:
        if not (self.relative is None or (isinstance(self.relative, str) and self.relative in ("add", "scale"))):
            kind, got = type(self).__name__, self.relative
            raise ValueError(f"`relative` of {kind} must be 'add' or 'scale', or left out, got {got!r}.")
        # Sequences become one leaf each, NumPy's arrays are copied, so that they stay as they were checked; anything else
        # (numbers, tracers, JAX's placeholders) stays as it is.
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, (list, tuple)):
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

    def inverse(self, value: jax.Array) -> jax.Array:
        """The standard draw that gives a value. For an unreachable value it is the draw of the nearest reachable one.

        Args:
            value: (N, ...) values of all tables or objects; NaN stands for any value.
        """
        raise NotImplementedError

    def draws_of(self, value: jax.Array, near: jax.Array) -> tuple[jax.Array, jax.Array]:
        """The smallest and the largest standard draw that give a value, in the shape of `inverse`; of what is sure, all do.

        Args:
            value: (N, ...) as for `inverse`.
            near: (N, ...) as for `log_density`.
        """
        _, sure = self.log_density(value, near)
        low, high = self.inverse(value - near), self.inverse(value + near)
        return jnp.where(sure, -jnp.inf, low), jnp.where(sure, jnp.inf, high)

    def log_density(self, value: jax.Array, near: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Log densities of values, or log probabilities, and a mask (bool) of the values that have one.

        Args:
            value: (N, ...) as for `inverse`.
            near: (N, ...) distance within which two values count as equal, because of rounding.
        """
        raise NotImplementedError

    @staticmethod
    def to_unit(draw: jax.Array) -> jax.Array:
        """Maps standard draws to numbers that are uniform in [0, 1]."""
        return draw

    @staticmethod
    def from_unit(unit: jax.Array) -> jax.Array:
        """The inverse of `to_unit`."""
        return unit

    def problems(self) -> list[Problem]:
        """What is wrong with its numbers; empty if nothing is."""
        return []


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


def floats(value: Any) -> np.ndarray:
    """The numbers as an array; what are none as NaN."""
    try:
        return np.asarray(value, float)
    except (TypeError, ValueError):
        return np.asarray(np.nan)


def order_problems(low: Numbers, high: Numbers) -> list[Problem]:
    """The problem of a lower bound above the upper one. Bounds whose shapes do not fit are another rule's."""
    try:
        ordered = np.all(np.asarray(low) <= np.asarray(high))
    except ValueError:
        return []
    return [] if ordered else [problem("low", "ordered", low=low, high=high)]
