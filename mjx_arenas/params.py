"""The numbers that make one arena, the ranges they are drawn from, and the drawing.

T tables. One world at a time: `jax.vmap` adds the batch.
"""

import zlib
from typing import NamedTuple

import jax
import jax.numpy as jnp

from mjx_arenas.distributions import Distribution, LogUniform, Normal, Uniform
from mjx_arenas.geometry import Array


class ArenaParams(NamedTuple):
    """What may differ between the worlds of a batch.

    Attributes:
        table_offsets: (T, 3) centre of the top surface, in the world [m].
        table_rots: (T,) yaw about z [rad].
        table_full_sizes: (T, 3) length, width, thickness [m].
        table_frictions: (T, 3) sliding, torsional, rolling.
        has_legs: (T,) bool.
    """

    table_offsets: Array
    table_rots: Array
    table_full_sizes: Array
    table_frictions: Array
    has_legs: Array


def canonical(params: ArenaParams) -> ArenaParams:
    """The parameters as JAX arrays: numbers in JAX's default precision, whatever came (integers, lists), and bool."""
    numbers = (jnp.asarray(p, jnp.result_type(float)) for p in params[:-1])
    return ArenaParams(*numbers, has_legs=jnp.asarray(params.has_legs, bool))


class ArenaRanges(NamedTuple):
    """A distribution for each quantity of `ArenaParams`; what is left out (None) stays nominal."""

    table_offsets: Distribution | None = None
    table_rots: Distribution | None = None
    table_full_sizes: Distribution | None = None
    table_frictions: Distribution | None = None
    has_legs: Distribution | None = None

    @property
    def varying(self) -> frozenset[str]:
        """Names of the quantities that have a distribution."""
        return frozenset(name for name, dist in self._asdict().items() if dist is not None)


def sample_params(key: jax.Array, nominal: ArenaParams, ranges: ArenaRanges) -> ArenaParams:
    """Draws the parameters of one world.

    Each quantity has a key of its own, folded from its name, and in it each table has one: a draw depends on the
    world's key, the quantity and the table, and on nothing else.
    """
    drawn = {
        name: _sample(jax.random.fold_in(key, zlib.crc32(name.encode())), dist, getattr(nominal, name))
        for name, dist in ranges._asdict().items()
        if dist is not None
    }
    return nominal._replace(**drawn)


def in_order(ranges: ArenaRanges) -> jax.Array:
    """() bool: no bound lies above its counterpart; for numbers that only the device knows."""
    bounds = [(d.low, d.high) for d in ranges if isinstance(d, (Uniform, LogUniform, Normal))]
    return jnp.all(jnp.array([jnp.all(jnp.asarray(low) <= jnp.asarray(high)) for low, high in bounds] + [True]))


def _sample(key: jax.Array, dist: Distribution, nominal: jax.Array) -> jax.Array:
    """A draw of one quantity, (T, ...), for all tables."""
    nominal = jnp.asarray(nominal)
    item = () if dist.per_table else nominal.shape[1:]
    draw = jax.vmap(lambda i: dist.draw(jax.random.fold_in(key, i), item))(jnp.arange(nominal.shape[0]))
    tied = jnp.asarray(dist.tied)
    draw = jnp.where(tied, draw[:1], draw)
    value = dist.value(draw)
    if dist.per_table:  # (T,) numbers serve all axes
        value = value.reshape(value.shape + (1,) * (nominal.ndim - value.ndim))
    value = jnp.broadcast_to(value, nominal.shape)
    if dist.relative == "add":
        value = nominal + value
    elif dist.relative == "scale":
        value = nominal * value
    return value.astype(nominal.dtype)
