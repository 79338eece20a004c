"""Ranges that widen with a level."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from mjx_arenas.arena import Arena
from mjx_arenas.envs.base import RangesAt
from mjx_arenas.params.distribution import Distribution
from mjx_arenas.params.distributions import Bernoulli, Choice, Count, Fixed, LogUniform, Normal, Uniform
from mjx_arenas.params.params import DENSITIES, ArenaRanges, Quantity, named
from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error

_SMALLEST = 1e-9  # what a bound of 0 counts as for LogUniform


def widening(arena: Arena, ranges: ArenaRanges) -> RangesAt:
    """Ranges that go from the nominal arena at level 0 to `ranges` at level 1, for `ArenaEnv`; jit, vmap.

    If the full range contains the nominal value, the range of every level lies inside it. Otherwise it grows from the nominal value. A
    range's bounds move in a straight line. Those of `LogUniform` move in a straight line of the logarithm (from 0 in a straight line that
    starts at 1e-9).

    - `Normal`: its mean moves, and its standard deviation grows from 0.
    - `Bernoulli`: its probability moves from that of the nominal value, 0 or 1.
    - `Count`: its bounds are rounded outwards. At level 0 the count is the nominal one; unless all are there, which ones is random.
    - `Fixed`: its number moves.
    - `Choice`: its values move if it is relative.

    Absolute `Choice`, `Fixed` of true, false or an index, and `Workspace` are the same at every level.

    Args:
        arena: arena whose nominal values the ranges start from.
        ranges: ranges at level 1; concrete numbers.

    Returns:
        Function of a () level within 0 and 1. Its result names the same quantities at every level.
    """
    if not isinstance(arena, Arena) or not isinstance(ranges, ArenaRanges):
        got = f"{type(arena).__name__} and {type(ranges).__name__}"
        raise error([problem("arena", "arena_and_ranges", None, Told(got))], kind=TypeError)
    nominal = named(arena.nominal_params()) | {"object_densities": arena.drawing.object_densities}
    quantities = arena.rules_of_quantities | {"object_densities": DENSITIES}

    def at(level: jax.Array) -> ArenaRanges:
        given = ranges.distributions.items()
        found = {name: _at(level, dist, nominal[name], quantities[name]) for name, dist in given}
        terms = {name: found.pop(name) for name in ranges.given_terms}
        return ranges._replace(**found, terms=terms)

    return at


def _at(level: jax.Array, dist: Any, nominal: Any, quantity: Quantity) -> Distribution:
    start = {None: nominal, "add": 0.0, "scale": 1.0}[dist.relative]
    start = jnp.asarray(start, jnp.result_type(float))

    def line(end: Any) -> jax.Array:
        """The line from `start` to `end`, which meets both exactly, and never goes beyond them."""
        x = (1 - level) * start + level * jnp.asarray(end)
        return jnp.clip(x, jnp.minimum(start, end), jnp.maximum(start, end))

    def log_line(end: Any) -> jax.Array:
        begin = jnp.maximum(start, _SMALLEST)
        x = begin * (jnp.asarray(end) / begin) ** level
        x = jnp.clip(x, jnp.minimum(begin, end), jnp.maximum(begin, end))
        return jnp.where(start > 0, x, jnp.maximum(line(end), _SMALLEST))

    number = quantity.kind is float
    match dist:
        case Uniform():
            return dataclasses.replace(dist, low=line(dist.low), high=line(dist.high))
        case LogUniform():
            low = log_line(dist.low)
            return dataclasses.replace(dist, low=low, high=jnp.maximum(log_line(dist.high), low))
        case Normal():
            std = level * jnp.asarray(dist.std)
            return dataclasses.replace(dist, mean=line(dist.mean), std=std, low=line(dist.low), high=line(dist.high))
        case Bernoulli():
            return dataclasses.replace(dist, p=line(dist.p))
        case Count():
            start = start.sum()
            return dataclasses.replace(dist, low=jnp.floor(line(dist.low)), high=jnp.ceil(line(dist.high)))
        case Fixed() if number:
            return dataclasses.replace(dist, at=line(dist.at))
        case Choice() if dist.relative is not None:
            return dataclasses.replace(dist, values=line(dist.values))
        case _:
            return dist
