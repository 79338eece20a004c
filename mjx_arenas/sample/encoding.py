"""The parameters of one world as a point of the unit cube, the way back, and their log density under ranges (device, pure).

N items of a quantity, D numbers that are drawn for a world: each of a quantity that varies has one, all that are tied have one.
"""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas import shapes
from mjx_arenas.params.distributions import BELOW_ONE, Choice, Count, Fixed
from mjx_arenas.params.params import ArenaParams, ArenaRanges, canonical, named
from mjx_arenas.sample import tops
from mjx_arenas.sample.poses import tossed
from mjx_arenas.sample.sampling import Drawing, Nominal, drawing, made, mass_of_density, table_weights, valued

ROUNDED = 16 * float(jnp.finfo(jnp.float32).eps)  # of what a number is made of: draws are in single precision


class Coded(NamedTuple):
    """A quantity, and where the standard draws of its numbers are in the vector."""

    of: Drawing
    mask: np.ndarray  # (N, ...) bool: which of its numbers follow from a draw of their own
    at: np.ndarray  # of each standard draw the place in the vector, -1: nothing follows from it

    def gathered(self, draws: jax.Array) -> jax.Array:
        """What of draws is in the vector."""
        _, first = np.unique(np.where(self.at < 0, self.at.max(initial=-1) + 1, self.at), return_index=True)
        return draws.reshape(-1)[first[: self.size]]

    @property
    def size(self) -> int:
        """Of its places in the vector."""
        return len(np.unique(self.at[self.at >= 0]))

    def by_place(self, *values: jax.Array) -> tuple[np.ndarray, tuple[jax.Array, ...]]:
        """Of what a quantity has for each number, or each draw, that which belongs to a place of the vector, and which place."""
        at = self.at
        if isinstance(self.of.dist.tied, str) and values[0].shape != at.shape:
            at = np.where(self.mask, at.reshape(-1, *(1,) * (self.mask.ndim - 1)), -1)
        used = np.flatnonzero(at >= 0)
        places = np.unique(at.reshape(-1)[used], return_inverse=True)[1]
        return places, tuple(jnp.broadcast_to(x, at.shape).reshape(-1)[used] for x in values)


def coded(nominal: Nominal, ranges: ArenaRanges) -> tuple[list[Coded], np.ndarray, int]:
    """All quantities with their places, those of `object_tables` (K,), and D."""
    found, start = list[Coded](), 0
    for one in drawing(nominal, ranges):
        mask = one.mask
        if one.name == "object_full_sizes":
            mask = shapes.own_axes(nominal.object_kinds)
        at = _places(one, mask)
        found.append(Coded(one, mask, np.where(at < 0, -1, at + start)))
        start += at.max(initial=-1) + 1
    tables, n = ranges.object_tables, len(nominal.object_tags)
    if not isinstance(tables, Choice):
        return found, np.full(n, -1), start
    at = start + (np.zeros(n, int) if tables.tied else np.arange(n))
    return found, at, int(at.max(initial=start - 1)) + 1


def _places(one: Drawing, mask: np.ndarray) -> np.ndarray:
    """Places in a vector of the quantity alone."""
    dist, n = one.dist, len(mask)
    same_axes = isinstance(dist.tied, str)
    drawn = mask.reshape(n, -1).any(1) if dist.per_item or same_axes else mask
    if isinstance(dist, Fixed):
        return np.full(drawn.shape, -1)
    if isinstance(dist, Count):
        which = np.full(n, -1) if dist.first else np.arange(n)
        return np.stack([which, np.full(n, which.max() + 1)], axis=-1)
    own = np.arange(drawn.size).reshape(drawn.shape)
    tied = np.broadcast_to(False if same_axes else dist.tied, drawn.shape)
    own = np.where(tied, own[:1], own)
    at = np.full(drawn.shape, -1)
    at[drawn] = np.unique(own[drawn], return_inverse=True)[1].reshape(-1)
    return at


def decode(vector: jax.Array, nominal: Nominal, ranges: ArenaRanges) -> ArenaParams:
    """The parameters of a vector (D,)."""
    found, tables, _ = coded(nominal, ranges)
    unit = jnp.clip(jnp.append(jnp.asarray(vector, float), 0.5), 0.0, 1.0)
    draws = {c.of.name: c.of.dist.from_unit(unit[c.at]) for c in found}
    return made(draws | {"object_tables": jnp.minimum(unit[tables], BELOW_ONE)}, nominal, ranges)


def encode(params: ArenaParams, nominal: Nominal, ranges: ArenaRanges) -> jax.Array:
    """The vector (D,) of parameters."""
    params = canonical(params)
    nominal = nominal.of_chosen(params.terms)
    ranges = tossed(ranges, nominal.poses, nominal.variants, params)
    found, tables, _ = coded(nominal, ranges)
    draws = _standard(found, params, nominal, ranges)
    parts = [c.gathered(c.of.dist.to_unit(draws[c.of.name])) for c in found]
    _, first = np.unique(tables[tables >= 0], return_index=True)
    return jnp.clip(jnp.concatenate([*parts, draws["object_tables"][first], jnp.zeros(0)]), 0.0, 1.0)


def log_prob(params: ArenaParams, nominal: Nominal, ranges: ArenaRanges) -> jax.Array:
    """() the log density of parameters; -inf of those that the ranges do not give."""
    params = canonical(params)
    nominal = nominal.of_chosen(params.terms)
    ranges = tossed(ranges, nominal.poses, nominal.variants, params)
    found, _, _ = coded(nominal, ranges)
    draws = _standard(found, params, nominal, ranges)
    again, given = named(made(draws, nominal, ranges)), named(params)
    near = {c.of.name: _near(c, params, nominal) for c in found}
    near["object_masses"] = 1e-5 * abs(given["object_masses"])
    same = [
        jnp.all(abs(again[name].astype(float) - given[name].astype(float)) <= near.get(name, 1e-5 * abs(again[name])))
        for name in given
    ]
    total = sum((_log_density(c, params, nominal, near[c.of.name]).sum() for c in found), jnp.zeros(()))
    if isinstance(ranges.object_tables, Choice):
        total += jnp.log(_choice(params, nominal, ranges.object_tables)[1]).sum()
    return jnp.where(jnp.all(jnp.array(same)), total, -jnp.inf)


def _standard(
    found: list[Coded], params: ArenaParams, nominal: Nominal, ranges: ArenaRanges
) -> Mapping[str, jax.Array]:
    """Standard draws to which the parameters belong."""
    draws = {}
    for c in found:
        draws[c.of.name] = jnp.full(c.at.shape, 0.5)
        if c.size:
            places, draw, low, high = _of_places(c, params, nominal, _near(c, params, nominal))
            exact = _first(places, high - low, c.size)
            one = jnp.clip(draw[exact], *_common(places, low, high, c.size))
            one = jnp.append(jnp.where(jnp.isfinite(one), one, 0.5), 0.5)
            draws[c.of.name] = one[np.where(c.at < 0, c.size, c.at - c.at[c.at >= 0].min())]
    draws["object_tables"] = jnp.zeros(len(nominal.object_tags))
    if isinstance(ranges.object_tables, Choice) and len(nominal.object_tags):
        draw, _ = _choice(params, nominal, ranges.object_tables)
        draws["object_tables"] = jnp.broadcast_to(draw, draws["object_tables"].shape)
    return draws


def _choice(params: ArenaParams, nominal: Nominal, dist: Choice) -> tuple[jax.Array, jax.Array]:
    """Draws (K,) with which objects chose what they stand on, and how likely these choices are; of tied ones the one draw (1,) of all."""
    weights = table_weights(dist, nominal, params)  # (K, V), of which tied objects may have different ones
    chosen = params.object_tables[:, None] == jnp.asarray(dist.values, jnp.result_type(int))[None]

    def one(weights: jax.Array, chosen: jax.Array) -> tuple[jax.Array, jax.Array]:
        total = weights.sum(-1, keepdims=True)
        edges = jnp.cumsum(weights, axis=-1) / jnp.where(total > 0, total, 1.0)
        ends = jnp.sort(jnp.concatenate([jnp.array([0.0, 1.0]), edges.reshape(-1)]))
        middle, length = (ends[1:] + ends[:-1]) / 2, ends[1:] - ends[:-1]
        index = jnp.minimum(
            (middle[:, None, None] >= edges[None]).sum(-1), edges.shape[-1] - 1
        )  # of each between two ends, and each object
        right = jnp.take_along_axis(chosen, index.T, axis=-1).all(0)
        length = jnp.where(right & (length > ROUNDED), length, 0.0)
        return middle[length.argmax()], length.sum()

    together = (1, *weights.shape) if dist.tied else (len(weights), 1, weights.shape[-1])
    return jax.vmap(one)(weights.reshape(together), chosen.reshape(together))


def _given(c: Coded, params: ArenaParams, nominal: Nominal) -> jax.Array:
    """(N, ...) the numbers of a quantity."""
    if c.of.name == "object_densities":
        return params.object_masses / mass_of_density(params.object_full_sizes, nominal)
    return named(params)[c.of.name]


def _drawn(c: Coded, params: ArenaParams, nominal: Nominal) -> jax.Array:
    """(N, ...) what the distribution gave, before it met the nominal numbers; NaN where none was needed."""
    value = _given(c, params, nominal)
    if value.dtype == bool:
        return value
    if c.of.dist.relative == "add":
        value = value - c.of.base
    elif c.of.dist.relative == "scale":
        value = jnp.where(c.of.base == 0, jnp.nan, value / c.of.base)
    return jnp.where(c.mask, value, jnp.nan)


def _of_places(
    c: Coded, params: ArenaParams, nominal: Nominal, near: jax.Array
) -> tuple[np.ndarray, jax.Array, jax.Array, jax.Array]:
    """Of each number that belongs to a place of the vector: the place, its draw, the smallest and the largest draw that give it."""
    value, dist = _drawn(c, params, nominal), c.of.dist
    draw = dist.inverse(value)
    low, high = dist.draws_of(value, near / _per(c))
    free = ~_decided(c, params, nominal, low)
    places, (draw, low, high, free) = c.by_place(draw, low, high, jnp.isnan(low) | jnp.isnan(high) | free)
    return places, draw, jnp.where(free, -jnp.inf, low), jnp.where(free, jnp.inf, high)


def _common(places: np.ndarray, low: jax.Array, high: jax.Array, n: int) -> tuple[jax.Array, jax.Array]:
    """(n,) the smallest and the largest draw that give all numbers of a place; the wrong way round where none does."""
    return jax.ops.segment_max(low, places, n), jax.ops.segment_min(high, places, n)


def _first(places: np.ndarray, of: jax.Array, n: int) -> jax.Array:
    """(n,) the index of the first of the numbers of each place for which `of` is smallest."""
    least = jax.ops.segment_min(of, places, n)[places]
    return jax.ops.segment_min(jnp.where(of <= least, np.arange(len(places)), len(places) - 1), places, n)


def _near(c: Coded, params: ArenaParams, nominal: Nominal) -> jax.Array:
    """(N, ...) how far the numbers of a quantity may be off by rounding."""
    dist, base = c.of.dist, c.of.base
    ends = (valued(dist, dist.from_unit(jnp.full(c.at.shape, end)), base) for end in (0.0, 1.0))
    made_of = sum(abs(x.astype(float)) for x in (*ends, base, _given(c, params, nominal)))
    return ROUNDED * jnp.asarray(made_of)


def _per(c: Coded) -> jax.Array:
    """(N, ...) how much a quantity changes where what the distribution gave changes by one."""
    base = c.of.base
    scales = c.of.dist.relative == "scale"
    return jnp.where(base == 0, 1.0, abs(base.astype(float))) if scales else jnp.ones(base.shape)


def _log_density(c: Coded, params: ArenaParams, nominal: Nominal, near: jax.Array) -> jax.Array:
    """The log density of a quantity, or its parts.

    Numbers that share a draw have the density of the first that is neither sure nor a multiple of 0. If there is none, they have the
    probability of the draws that give them all.
    """
    dist, base = c.of.dist, c.of.base
    if isinstance(dist, Fixed) or not c.size:
        return jnp.zeros(())
    per = _per(c)
    density, sure = dist.log_density(_drawn(c, params, nominal), near / per)
    if isinstance(dist, Count):
        return _where_there(c, params, nominal, density)
    if density.ndim == base.ndim:
        if c.of.name == "object_densities":
            per = per * mass_of_density(params.object_full_sizes, nominal)
        density = density - jnp.where(sure, 0.0, jnp.log(per))
        density = jnp.where((dist.relative == "scale") & (base == 0), 0.0, density)
    density = _where_there(c, params, nominal, density)
    any_ = ~_decided(c, params, nominal, density) | _any(c, params, nominal, density)
    places, (density, sure, any_) = c.by_place(density, sure, any_)
    first = _first(places, sure + 2 * any_, c.size)
    if not dist.tied or isinstance(dist, Choice):  # whose rows are the same for all
        return density[first]
    _, _, low, high = _of_places(c, params, nominal, near)
    low, high = _common(places, low, high, c.size)
    share = dist.to_unit(jnp.maximum(high, low)) - dist.to_unit(low)
    share = jnp.where(jnp.isinf(low) & jnp.isinf(high), 1.0, share)
    return jnp.where(sure[first], jnp.log(jnp.where(sure[first], share, 1.0)), density[first])


def _where_there(c: Coded, params: ArenaParams, nominal: Nominal, density: jax.Array) -> jax.Array:
    """The density, but 0 of what no draw decided."""
    return jnp.where(_decided(c, params, nominal, density), density, 0.0)


def _decided(c: Coded, params: ArenaParams, nominal: Nominal, like: jax.Array) -> jax.Array:
    """In the shape of `like`, bool: what follows from a draw; an object on an absent table is absent, whatever was drawn."""
    if c.of.name != "object_active":
        return jnp.ones(like.shape, bool)
    there = tops.surfaces(params, nominal.ground).of(params.object_tables).there
    return jnp.broadcast_to(there.reshape(-1, *(1,) * (like.ndim - 1)), like.shape)


def _any(c: Coded, params: ArenaParams, nominal: Nominal, like: jax.Array) -> jax.Array:
    """In the shape of `like`, bool: what any draw gives, as a factor of 0."""
    free = jnp.isnan(_drawn(c, params, nominal).astype(float))
    return free if like.ndim == free.ndim else free.reshape(len(free), -1).all(1)
