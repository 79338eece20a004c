"""What is compiled for an arena: functions of its record, which equal arenas share. One world at a time, but where they say (W, ...).

The record is static in all of them, and equal by content. `jax.clear_caches()` frees what is compiled, with the records.
"""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.sharding import PartitionSpec as P
from mujoco import mjx

from mjx_arenas import rows, strict
from mjx_arenas.params.params import ArenaParams, ArenaRanges, canonical
from mjx_arenas.record.record import Record
from mjx_arenas.rules import validation_worlds
from mjx_arenas.sample import encoding, placement, sampling, tops
from mjx_arenas.sample.placement import Placement, place_objects
from mjx_arenas.sample.sampling import Nominal
from mjx_arenas.sim import devices
from mjx_arenas.sim.latest import Latest
from mjx_arenas.write import leaves, writer


def named(record: Record, model: mjx.Model, params: ArenaParams, varying: frozenset[str]) -> dict[str, jax.Array]:
    """The fields that follow from the quantities `varying`, by MuJoCo's names; nominal as in `model`."""
    with strict.one_precision():
        return writer.write(record.scene, model, canonical(params), varying)


def written(record: Record, model: mjx.Model, params: ArenaParams, varying: frozenset[str]) -> dict[str, jax.Array]:
    """The leaves of `model` with these fields."""
    return leaves.of_model(model, named(record, model, params, varying))


@functools.partial(jax.jit, static_argnums=0)
def fields(record: Record, model: mjx.Model, params: ArenaParams) -> dict[str, jax.Array]:
    """All fields that the parameters decide."""
    return written(record, model, params, record.everything)


@functools.partial(jax.jit, static_argnums=0)
def place(record: Record, params: ArenaParams, key: jax.Array, margin: float) -> Placement:
    """Places of the objects."""
    return place_objects(key, record.layout.places, params, margin)


@functools.partial(jax.jit, static_argnums=0)
def valid(record: Record, params: ArenaParams, ranges: ArenaRanges | None) -> jax.Array:
    """() bool: the world can be."""
    return validation_worlds.valid(params, record.rules, ranges)


@functools.partial(jax.jit, static_argnums=0)
def rest_heights(record: Record, params: ArenaParams) -> jax.Array:
    """(K,) heights [m] of the objects' origins when they touch what they stand on."""
    places = record.layout.places
    top = tops.surfaces(params, places.ground).of(params.object_tables).top[:, 2]
    laid = placement.lies(places, params)
    return top + laid.full_size[:, 2] / 2 - jnp.asarray(laid.center, top.dtype)[:, 2]


def qpos(record: Record, qpos0: jax.Array, params: ArenaParams, key: jax.Array | None) -> jax.Array:
    """(nq,) positions with the objects in the places that a key draws, or at their nominal ones."""
    if key is None or not record.parts.objects:
        return qpos0
    placed = place(record, canonical(params), key, 0.0).qpos
    return rows.replace_rows(qpos0, record.layout.object_qpos.reshape(-1), placed.reshape(-1))


@functools.partial(jax.jit, static_argnums=0)
def draw(record: Record, keys: jax.Array, ranges: ArenaRanges) -> tuple[ArenaParams, jax.Array, jax.Array]:
    """The parameters for keys (W,), whether these worlds can be, and whether they can at least be made and shown."""

    def one(key: jax.Array, ranges: ArenaRanges) -> tuple[ArenaParams, jax.Array, jax.Array]:
        params = sampling.sample_params(key, record.drawing, ranges)
        valid = validation_worlds.valid(params, record.rules, ranges)
        return params, valid, validation_worlds.possible(params, record.rules)

    return jax.vmap(one, in_axes=(0, None))(keys, ranges)


@functools.partial(jax.jit, static_argnums=0)
def sample(nominal: Nominal, key: jax.Array, ranges: ArenaRanges) -> ArenaParams:
    """Parameters of one world."""
    return sampling.sample_params(key, nominal, ranges)


@functools.partial(jax.jit, static_argnums=0)
def encode(nominal: Nominal, params: ArenaParams, ranges: ArenaRanges) -> jax.Array:
    """(D,) what was drawn for one world."""
    return encoding.encode(params, nominal, ranges)


@functools.partial(jax.jit, static_argnums=0)
def decode(nominal: Nominal, vector: jax.Array, ranges: ArenaRanges) -> ArenaParams:
    """Parameters of one world."""
    return encoding.decode(vector, nominal, ranges)


@functools.partial(jax.jit, static_argnums=0)
def log_prob(nominal: Nominal, params: ArenaParams, ranges: ArenaRanges) -> jax.Array:
    """() of one world."""
    return encoding.log_prob(params, nominal, ranges)


def dimensions(nominal: Nominal, ranges: ArenaRanges) -> int:
    """D."""
    return encoding.coded(nominal, ranges)[2]


class OfModel:
    """A function of a record, a model, arrays of worlds and what these share, compiled; each device computes its own worlds.

    Flattening a model takes longer than launching what is compiled, so the last one's leaves are kept while it lives.
    """

    def __init__(self, function: Callable[..., Any], shared: int) -> None:
        self._function, self._shared = function, shared
        self._last = Latest()
        self._run = jax.jit(self._flat, static_argnums=(0, 1, 2))

    def __call__(self, record: Record, model: mjx.Model, worlds: Any, *shared: Any) -> Any:
        """The function's result for worlds (W, ...)."""
        spread = devices.spread_of(jax.tree.leaves(worlds)[0])
        flat = self._last.of(model, spread)
        if flat is None:
            leaves, structure = jax.tree.flatten(model)
            if any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
                return self._on_each(record, spread)(model, worlds, *shared)
            flat = self._last.keep(model, spread, (_Tree(structure), leaves))
        tree, leaves = flat
        return self._run(record, tree, spread, leaves, worlds, *shared)

    def _flat(self, record: Record, tree: "_Tree", spread: Any, leaves: Any, worlds: Any, *shared: Any) -> Any:
        return self._on_each(record, spread)(tree.structure.unflatten(leaves), worlds, *shared)

    def _on_each(self, record: Record, spread: devices.Spread | None) -> Callable[..., Any]:
        function = jax.vmap(functools.partial(self._function, record), in_axes=(None, 0, *[None] * self._shared))
        return devices.on_each(function, spread, spread and (P(), spread.spec, *[P()] * self._shared))


class _Tree:
    """The structure of a model, whose hash is made once: MJX's has hundreds of arrays."""

    def __init__(self, structure: Any) -> None:
        self.structure, self._hash = structure, hash(structure)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, _Tree) and self.structure == other.structure)


def _randomized(
    record: Record, model: mjx.Model, key: jax.Array, ranges: ArenaRanges
) -> tuple[dict[str, jax.Array], ArenaParams, jax.Array]:
    params = sampling.sample_params(key, record.drawing, ranges)
    params = jax.lax.optimization_barrier(params)  # or each field draws its numbers anew
    values = written(record, model, params, ranges.varying)
    return values, params, validation_worlds.valid(params, record.rules, ranges)


def _given(record: Record, model: mjx.Model, params: ArenaParams) -> tuple[dict[str, jax.Array], jax.Array]:
    return written(record, model, params, record.everything), validation_worlds.valid(params, record.rules)


randomized = OfModel(_randomized, shared=1)
"""The fields and parameters for keys (W,), and whether the worlds can be."""
given = OfModel(_given, shared=0)
"""The fields for parameters (W, ...), and whether the worlds can be."""
beside = devices.LastBeside()
"""A model on the devices of the worlds."""
