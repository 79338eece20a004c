"""The parameters of one world, drawn from ranges (device, pure)."""

import dataclasses
import operator
import zlib
from collections.abc import Mapping, Sequence, Sized
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas import geometry, shapes, strict
from mjx_arenas.content import ByContent
from mjx_arenas.furniture import surfaces
from mjx_arenas.furniture.part import Part
from mjx_arenas.geometry import Array
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.params.distribution import Distribution, aligned
from mjx_arenas.params.distributions import (
    SUM_ERROR,
    Bernoulli,
    Choice,
    Count,
    LogUniform,
    Normal,
    Uniform,
)
from mjx_arenas.params.params import QUANTITIES, ArenaParams, ArenaRanges, canonical, named, with_values
from mjx_arenas.problem import Problem, problem
from mjx_arenas.problems.messages import raise_all
from mjx_arenas.sample import placement, tops
from mjx_arenas.sample.poses import Poses, tossed
from mjx_arenas.sample.variants import Variants, of_chosen, with_own_numbers


class Drawn(NamedTuple):
    """What a term's draws depend on, beside the world's key."""

    name: str  # of the quantity
    attribute: str  # whose name folds the key, whatever the quantity is called
    tags: np.ndarray  # (N,) of the elements' names
    mask: np.ndarray  # (N, ...) bool: which of the attribute's numbers vary


@dataclasses.dataclass(frozen=True, eq=False)
class Nominal(ByContent):
    """What draws start from (host)."""

    params: ArenaParams
    object_names: tuple[str, ...]
    object_kinds: np.ndarray  # (K,) their types
    object_densities: np.ndarray  # (K,) [kg/m^3]
    terms: tuple[Drawn, ...] = ()
    furniture: tuple[Part, ...] = ()
    variants: tuple[Variants, ...] = ()
    poses: tuple[Poses, ...] = ()
    carriers: tuple[tops.Carrier, ...] = ()

    @property
    def ground(self) -> tops.Ground:
        """What objects stand on beside tables."""
        return tops.Ground(self.furniture, self.carriers, self.poses)

    @property
    def values(self) -> dict[str, Array]:
        """The nominal numbers of every quantity that ranges may give, by name."""
        return named(self.params) | {"object_densities": self.object_densities}

    def of_chosen(self, terms: Mapping[str, jax.Array]) -> "Nominal":
        """What draws start from where these variants of objects are there, by the quantities that say which."""
        if not self.variants:
            return self
        chosen = {one.quantity: terms[one.quantity] for one in self.variants}
        params = with_own_numbers(with_values(self.params, chosen), self.variants)
        densities = of_chosen(self.variants, chosen, "density", self.object_densities)
        return dataclasses.replace(self, params=params, object_densities=densities)  # type: ignore[arg-type]

    @property
    def table_tags(self) -> np.ndarray:
        """(T,) what the tables' keys are folded with."""
        return np.arange(len(self.params.table_rots))

    @property
    def object_tags(self) -> np.ndarray:
        """(K,) the same for objects."""
        return tags(self.object_names)


def tags(names: Sequence[str]) -> np.ndarray:
    """A number for each name, so that the draws of one do not depend on what else there is."""
    return np.array([zlib.crc32(name.encode()) for name in names], np.uint32)


def sample_params(key: jax.Array, nominal: Nominal, ranges: ArenaRanges) -> ArenaParams:
    """Draws the parameters of one world.

    Each quantity has a key of its own, folded from its name, of which each table draws the numbers at its index, and
    each object those of a key folded from its name: a draw depends on the world's key, the quantity and the table or
    object, and on nothing else.
    """
    drawn = drawing(nominal, ranges)
    with jax.threefry_partitionable(True):  # the numbers at an index do not depend on how many are drawn
        keys = zip(drawn, *_keys(key, drawn), strict=True)
        draws = {d.name: _draws(own, items, d.dist, d.base) for d, own, items in keys}
    if isinstance(ranges.object_tables, Choice):
        own, tags = _key_of(key, "object_tables"), nominal.object_tags
        draws["object_tables"] = _draws(own, _keys_of(own, tags), ranges.object_tables, jnp.zeros(len(tags)))
    return made(draws, nominal, ranges, key)


class Drawing(NamedTuple):
    """A quantity that is drawn."""

    name: str
    dist: Distribution
    base: jax.Array  # (N, ...) nominal
    tag: str  # that folds the key
    tags: np.ndarray | None  # (N,) that fold the keys of its items, or None: each draws at its index
    mask: np.ndarray  # (N, ...) bool: which of its numbers vary


def drawing(nominal: Nominal, ranges: ArenaRanges) -> list[Drawing]:
    """All quantities that are drawn, but for `object_tables` and `workspace`."""
    found, base = [], named(canonical(nominal.params))
    base["object_densities"] = jnp.asarray(nominal.object_densities, jnp.result_type(float))
    given = ranges.given_terms
    for name, dist in ranges.distributions.items():
        if name in base and name not in (*nominal.params.terms, "object_tables"):
            tags = None if name in QUANTITIES and QUANTITIES[name].of == "table" else nominal.object_tags
            found.append(Drawing(name, dist, base[name], name, tags, np.ones(base[name].shape, bool)))
    for t in nominal.terms:
        if t.name in given:
            found.append(Drawing(t.name, given[t.name], base[t.name], t.attribute, t.tags, t.mask))
    return found


def made(
    draws: Mapping[str, jax.Array], nominal: Nominal, ranges: ArenaRanges, key: jax.Array | None = None
) -> ArenaParams:
    """The parameters that belong to standard draws of the quantities.

    What hangs together is made so: objects stand on active tables, spheres stay round, larger objects are heavier. The key of
    the world places tables in a `workspace`.
    """
    nominal = nominal.of_chosen({**canonical(nominal.params).terms, **_values(draws, nominal, ranges)})
    values = _values(draws, nominal, ranges)
    densities = values.pop("object_densities", nominal.object_densities)
    params = with_values(canonical(nominal.params), values)
    kinds = nominal.object_kinds
    if ranges.object_full_sizes is not None:
        varies = np.isin(kinds, shapes.PRIMITIVES)[:, None]
        sizes = jnp.where(varies, params.object_full_sizes, nominal.params.object_full_sizes)
        params = params._replace(object_full_sizes=shapes.consistent(kinds, sizes))
    if "object_masses" in ranges.varying and ranges.object_masses is None:
        masses = mass_of_density(params.object_full_sizes, nominal) * densities
        params = params._replace(object_masses=masses.astype(params.object_masses.dtype))
    if nominal.poses:
        values = _values(draws, nominal, tossed(ranges, nominal.poses, nominal.variants, params))
        own = {one.quantity: values[one.quantity] for one in nominal.poses if one.quantity in values}
        params = with_values(params, own)
    if ranges.object_tables is not None:
        tables = _choose_tables(draws.get("object_tables"), ranges.object_tables, nominal, params)
        params = params._replace(object_tables=tables)
    if ranges.varying & tops.deciding(nominal.ground):
        params = params._replace(object_active=tops.present(params, nominal.ground)[1])
    if ranges.workspace is not None:
        assert key is not None, "places of a workspace need a key"
        keys = _keys_of(_key_of(key, "workspace"), nominal.table_tags)
        params = params._replace(table_offsets=placement.place_tables(keys, params, ranges.workspace))
    return params


def _values(draws: Mapping[str, jax.Array], nominal: Nominal, ranges: ArenaRanges) -> dict[str, jax.Array]:
    """The numbers of all quantities that are drawn."""
    return {d.name: jnp.where(d.mask, valued(d.dist, draws[d.name], d.base), d.base) for d in drawing(nominal, ranges)}


IMPL = "threefry2x32"  # of keys: what one world draws does not depend on the others then
MOST_WORLDS = 2**30  # of which keys still fit into memory


@with_known_arguments
@strict.own_constants
def world_keys(seed: int, worlds: Sequence[int] | np.ndarray | jax.Array) -> jax.Array:
    """Keys of some worlds of a seed. World i is the same whichever others are there.

    Args:
        seed: seed of all worlds, from 0 to 2^32 - 1.
        worlds: (W,) numbers of the worlds, e.g. `range(1024)` or `[0, 5, 17]`.

    Returns:
        (W,) keys, for `randomize` or `sample_params` and for `make_data` alike.
    """
    raise_all(_seed_problems(seed, worlds), "world_keys")
    numbers = jnp.asarray(np.asarray(worlds, np.uint32))
    return _keys_of_worlds(jax.random.key(seed, impl=IMPL), numbers)


def _seed_problems(seed: object, worlds: object) -> list[Problem]:
    problems = []
    if not isinstance(seed, (int, np.integer)) or isinstance(seed, bool) or not 0 <= seed < 2**32:
        problems.append(problem("seed", "seed", None, seed))
    if isinstance(worlds, Sized) and len(worlds) > MOST_WORLDS:
        return [*problems, problem("worlds", "many_worlds", most=MOST_WORLDS, n=len(worlds))]
    array = np.asarray(worlds)
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu") or np.any((array < 0) | (array >= 2**32)):
        counted = array.ndim == 0 and array.dtype.kind in "iu" and 1 <= array <= MOST_WORLDS
        problems.append(problem("worlds", "worlds_counted" if counted else "worlds", None, worlds))
    return problems


_keys_of_worlds = jax.jit(
    jax.vmap(jax.random.fold_in, in_axes=(None, 0))
)  # jitted, as JAX forgets programs of its own functions sooner


@with_known_arguments
@strict.own_constants
def trainers_keys(keys: jax.Array) -> jax.Array:
    """Keys (W,) for worlds, from those that a trainer uses for them and then again to reset its environments.

    `jax.vmap(lambda key: arena.sample_params(key, ranges))(mja.trainers_keys(rng))` are the parameters that `randomization_fn` draws for
    `rng`.

    Args:
        keys: (W,) typed keys, or (W, 2) raw ones.
    """
    return jax.vmap(lambda key: _key_of(key, "arena"))(keys)


def in_order(ranges: ArenaRanges) -> jax.Array:
    """() bool: no bound lies above its counterpart, and probabilities are some; for numbers that only the device knows."""
    all_given = list(ranges.distributions.values())
    bounds = [(d.low, d.high) for d in all_given if isinstance(d, (Uniform, LogUniform, Normal, Count))]
    given = [jnp.asarray(d.p) for d in all_given if isinstance(d, (Bernoulli, Choice)) and d.p is not None]
    bounds += [(0.0, p) for p in given] + [(p, 1.0) for p in given]
    sums = [jnp.asarray(d.p).sum(-1) for d in all_given if isinstance(d, Choice) and d.p is not None]
    bounds += [(jnp.abs(total - 1.0), SUM_ERROR) for total in sums]
    return jnp.all(jnp.array([jnp.all(operator.le(*aligned(*pair))) for pair in bounds] + [True]))


def _key_of(key: jax.Array, name: str) -> jax.Array:
    return jax.random.fold_in(key, zlib.crc32(name.encode()))


def _keys_of(key: jax.Array, tags: np.ndarray) -> jax.Array:
    return jax.vmap(lambda tag: jax.random.fold_in(key, tag))(jnp.asarray(tags))


def _keys(key: jax.Array, drawn: Sequence[Drawing]) -> tuple[list[jax.Array], list[jax.Array | None]]:
    """Keys of quantities, and of their items (N,), or none where each draws at its index; all at once, in two kernels."""
    if not drawn:
        return [], []
    own = _keys_of(key, tags([d.tag for d in drawn]))
    of = np.repeat(np.arange(len(drawn)), [0 if d.tags is None else len(d.tags) for d in drawn])
    given = np.concatenate([np.zeros(0, np.uint32), *(d.tags for d in drawn if d.tags is not None)])
    items = jax.vmap(jax.random.fold_in)(own[of], jnp.asarray(given)) if len(given) else own
    return list(own), [None if d.tags is None else items[of == i] for i, d in enumerate(drawn)]


def _draws(own: jax.Array, items: jax.Array | None, dist: Distribution, base: jax.Array) -> jax.Array:
    """Standard draws (N, ...) of one quantity; of tables each at its index, else each with a key of its own (N,)."""
    same_axes = isinstance(dist.tied, str)
    one = () if dist.per_item or same_axes else base.shape[1:]
    if items is None:
        draw = dist.draw(own, (len(base), *one))
        shared = draw[:1]
    else:  # what all share is drawn apart: it does not go with the first of them
        draw = jax.vmap(lambda key: dist.draw(key, one))(items)
        shared = dist.draw(_key_of(own, "tied"), one)[None] if np.any(dist.tied) else draw[:1]
    return draw if same_axes else jnp.where(*aligned(dist.tied, shared, draw))


def valued(dist: Distribution, draw: jax.Array, base: jax.Array) -> jax.Array:
    """The numbers (N, ...) that belong to standard draws of a quantity whose nominal ones are `base`."""
    if isinstance(dist.tied, str):
        draw = draw.reshape(len(base), *(1,) * (base.ndim - 1))
    value = dist.value(draw)
    if dist.per_item:  # (N,) numbers serve all axes
        value = value.reshape(value.shape + (1,) * (base.ndim - value.ndim))
    value = jnp.broadcast_to(value, base.shape)
    if dist.relative == "add":
        value = base + value
    elif dist.relative == "scale":
        value = base * value
    return value.astype(base.dtype)


def mass_of_density(full_sizes: jax.Array, nominal: Nominal) -> jax.Array:
    """(K,) mass [kg] for each kg/m^3 of objects of these sizes."""
    kinds, params = nominal.object_kinds, nominal.params
    grown = shapes.volume(kinds, full_sizes) / shapes.volume(kinds, params.object_full_sizes)
    return params.object_masses * grown / nominal.object_densities


def _choose_tables(draw: jax.Array | None, dist: Distribution, nominal: Nominal, params: ArenaParams) -> jax.Array:
    """(K,) indices of tables and surfaces, drawn among those that are there in this world; where none is, any."""
    if not isinstance(dist, Choice):  # Fixed
        return jnp.broadcast_to(jnp.asarray(dist.value(jnp.zeros(()))), nominal.object_tags.shape).astype(
            jnp.result_type(int)
        )
    assert draw is not None
    ground, tables = nominal.ground, jnp.asarray(dist.values, jnp.result_type(int))

    def chosen(there: jax.Array) -> jax.Array:
        edges = jnp.cumsum(_weights(dist, nominal, params, there), axis=-1)
        index = (draw[:, None] * edges[:, -1:] >= edges).sum(-1)
        return tables[jnp.minimum(index, len(tables) - 1)]

    there = jnp.asarray(surfaces.surfaces(params, ground.furniture).there)
    n = len(there)
    there = jnp.concatenate([there, jnp.zeros(len(ground.carriers), bool)])
    for i in ground.order:  # whether an object is there, on which others stand, depends on where it stands itself
        k = ground.carriers[i].object
        own = params.object_active[k] & geometry.pick(there, chosen(there)[k][None])[0]
        there = geometry.with_row(there, n + i, own)
    return chosen(there)


def table_weights(dist: Choice, nominal: Nominal, params: ArenaParams) -> jax.Array:
    """(K, N) weights of the tables, surfaces and objects that an object may stand on, 0 of those that are not there, if another is."""
    return _weights(dist, nominal, params, jnp.asarray(tops.surfaces(params, nominal.ground).there))


def _weights(dist: Choice, nominal: Nominal, params: ArenaParams, there: jax.Array) -> jax.Array:
    tables = jnp.asarray(dist.values, jnp.result_type(int))
    p = jnp.ones(tables.shape) if dist.p is None else jnp.asarray(dist.p)
    p = jnp.broadcast_to(p, (len(nominal.object_tags), len(tables)))
    may = jnp.asarray(tops.may_stand(params, nominal.ground))[:, tables]
    possible: jax.Array = p * (there[tables][None] & may)
    return jnp.where(possible.sum(-1, keepdims=True) > 0, possible, p * may)
