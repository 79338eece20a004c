"""Many worlds: a model of which only what varies is batched, and stepping it."""

import dataclasses
import functools
import operator
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import PartitionSpec as P
from mujoco import mjx
from mujoco.mjx._src.types import Impl

from mjx_arenas import strict
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import Told, problem
from mjx_arenas.record.record import Record
from mjx_arenas.rules import validation
from mjx_arenas.sim import constants, culling, devices, kernels, starts, warp_notes
from mjx_arenas.sim import data as data_
from mjx_arenas.sim.warp_notes import Capacity


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class ArenaBatch:
    """W worlds of one arena; a pytree."""

    model: mjx.Model
    """Leaves named in `fields` are batched (W, ...), the others shared."""
    params: ArenaParams
    """All leaves batched (W, ...)."""
    valid: jax.Array
    """(W,) bool: False if the world cannot exist.

    That is the case if its parameters break a rule (`arena.valid`; tables that overlap, for instance), if no table is there, if a table
    leaves the workspace or finds no place in it, or if traced ranges go beyond what is allowed."""
    fields: tuple[str, ...] = dataclasses.field(metadata={"static": True})
    """Names of the model's batched leaves."""
    record: Record = dataclasses.field(metadata={"static": True})
    """Description of the compiled arena, equal for equal arenas."""

    def __repr__(self) -> str:
        """How many worlds there are, of what, and what varies."""
        counts = len(self.record.table_names), len(self.record.object_names)
        of = f"n_tables={counts[0]}, n_objects={counts[1]}, impl={self.model.impl.value!r}"
        return f"ArenaBatch(n_worlds={self.n_worlds}, {of}, fields=({', '.join(self.fields)}))"

    @property
    def n_worlds(self) -> int:
        """The number of worlds, W."""
        return self.params.table_rots.shape[0]

    @property
    def in_axes(self) -> mjx.Model:
        """Tree for `jax.vmap(..., in_axes=(batch.in_axes, ...))`."""
        return in_axes(self.model, self.fields)

    @property
    def nbytes(self) -> int:
        """Number of bytes that one world adds to the model."""
        return sum(
            np.dtype(x.dtype).itemsize * int(np.prod(x.shape[1:]))
            for x in (operator.attrgetter(name)(self.model) for name in self.fields)
        )

    def world(self, index: int) -> ArenaParams:
        """Parameters of one world, for `arena.compile`, `arena.to_xml` or `arena.apply`."""
        return take(self.params, index)


def in_axes(model: mjx.Model, fields: tuple[str, ...]) -> mjx.Model:
    """`model` with 0 at the named leaves and None elsewhere. It holds Python ints: build it outside of `jit`'s arguments."""
    return jax.tree.map(lambda _: None, model).tree_replace(dict.fromkeys(fields, 0))


@with_known_arguments
@strict.own_constants
def take(worlds: Any, index: int | Sequence[int] | slice) -> Any:
    """Takes one world, or some, out of many: parameters, `mjx.Data` on either implementation, or an environment's state.

    The contacts, which Warp keeps for all worlds together, are not reduced.

    Args:
        worlds: a tree of arrays (W, ...), or an `ArenaBatch`, of which some worlds can be taken, not one: that is its `world(i)`.
        index: number from 0 to W - 1, or from the end, -1 to -W; or a sequence or a slice of N numbers, for which the result has leaves
            (N, ...).
    """
    if any(isinstance(i, jax.core.Tracer) for i in jax.tree.leaves(index)):
        raise validation.error([problem("index", "known_index", None, Told("traced ones"))], kind=TypeError)
    if isinstance(worlds, ArenaBatch) and (isinstance(index, slice) or np.ndim(index)):
        fields = [operator.attrgetter(name)(worlds.model) for name in worlds.fields]
        fields, params, valid = take((fields, worlds.params, worlds.valid), index)
        model = worlds.model.tree_replace(dict(zip(worlds.fields, fields, strict=True)))
        return dataclasses.replace(worlds, model=model, params=params, valid=valid)

    def is_known(node: Any) -> bool:
        return isinstance(node, (mjx.Data, ArenaParams))

    def count(node: Any) -> int:
        rows = node.qpos if isinstance(node, mjx.Data) else node.table_rots if isinstance(node, ArenaParams) else node
        return 0 if np.ndim(rows) < (2 if is_known(node) else 1) else len(rows)

    counts = {count(node) for node in jax.tree.leaves(worlds, is_leaf=is_known)}
    if len(counts) != 1 or 0 in counts:
        if isinstance(worlds, ArenaBatch):
            raise validation.error([problem("worlds", "many_not_batch", None, Told("an ArenaBatch"))])
        raise validation.error([problem("worlds", "many", None, Told(validation.kind_of(worlds)))])
    n_worlds = counts.pop()
    indices = np.arange(n_worlds)[index] if isinstance(index, slice) else np.asarray(index)
    whole = indices.dtype.kind in "iu" and indices.ndim < 2 and indices.size
    bad = [i for i in indices.reshape(-1).tolist() if not -n_worlds <= i < n_worlds] if whole else [index]
    if bad:
        numbers = f"from {-n_worlds} to {n_worlds - 1}"
        raise validation.error(
            [problem("index", "must", None, bad[0], must=f"one number {numbers}, a list of them or a slice")],
            kind=IndexError,
        )

    indices = indices % n_worlds
    arrays = jax.tree.leaves(worlds)
    if all(isinstance(array, jax.Array) for array in arrays) and not any(map(devices.spread_of, arrays)):
        return _rows(worlds, indices)
    if not indices.ndim:
        return _each(worlds, lambda array: devices.row(array, int(indices)))
    return _each(worlds, lambda array: jnp.stack([devices.row(array, int(i)) for i in indices]))


def _each(worlds: Any, rows: Callable[[jax.Array], jax.Array]) -> Any:
    def one(node: Any) -> Any:
        return data_.of_worlds(node, rows) if isinstance(node, mjx.Data) else rows(node)

    return jax.tree.map(one, worlds, is_leaf=lambda node: isinstance(node, mjx.Data))


@jax.jit
def _rows(worlds: Any, indices: jax.Array) -> Any:
    return _each(worlds, lambda array: array[indices])


@with_known_arguments
def make_data(
    batch: ArenaBatch, keys: jax.Array | None = None, keyframe: str | None = None, max_contacts: int | None = None
) -> mjx.Data:
    """`mjx.Data` of all worlds, with the objects at rest on their tables.

    Args:
        batch: W worlds.
        keys: (W,) keys that place the objects, one for each world; `jax.vmap(arena.place)(batch.params, keys).valid` says whether each
            object found a free place. One without starts above the others. None: objects are at their nominal places. Nothing checks these
            in each world: they may coincide if `object_tables` varies, or be where a term has moved something.
        keyframe: name of the keyframe in which a robot starts. Objects stand on their tables nevertheless.
        max_contacts: number of contacts for which each world has room on Warp, which drops further ones (see `capacity`). None: as many as
            can touch at once.
    """
    validation.check_type("batch", batch, ArenaBatch, "an ArenaBatch, from arena.randomize() or arena.batch()")
    if keys is not None:
        validation.raise_all(validation.key_problems("keys", keys, batch.n_worlds), "`keys`")
    starts.warn_of_idle(batch.record, keyframe, batch.params.terms)
    return _make_data(batch, keys, keyframe, max_contacts, _spread(batch))


@functools.partial(jax.jit, static_argnames=("keyframe", "max_contacts", "spread"))
def _make_data(
    batch: ArenaBatch,
    keys: jax.Array | None,
    keyframe: str | None,
    max_contacts: int | None,
    spread: devices.Spread | None,
) -> mjx.Data:
    def make(batch: ArenaBatch, keys: jax.Array | None) -> mjx.Data:
        def one(model: mjx.Model, params: ArenaParams, key: jax.Array | None) -> mjx.Data:
            return starts.one_world(batch.record, model, params, key, batch.n_worlds, keyframe, max_contacts)

        return jax.vmap(one, in_axes=(batch.in_axes, 0, 0))(batch.model, batch.params, keys)

    return _on_each(make, batch, spread)(batch, keys)


@with_known_arguments
@strict.own_constants
def capacity(batch: ArenaBatch, data: mjx.Data) -> Capacity:
    """Whether Warp dropped contacts for lack of room, and in which worlds its solver gave up. Works in `jit`.

    Args:
        batch: W worlds.
        data: data of all worlds, after any number of steps.

    Returns:
        A `Capacity`. `overflowed` (W,) bool: contacts were dropped in a step since the data was made. `needed` (): the `max_contacts` for
            `make_data` that is enough for the last step. `solver_limits` (W,) bool: the solver stopped at the limit of its iterations in a
            step since then. `noted`: every message that Warp would have printed since then. For all steps of a rollout, take the largest
            `needed` that `rollout(..., record=lambda data: mja.capacity(batch, data).needed)` gives.
    """
    check_data(batch, data)
    return warp_notes.capacity(batch.record.mj_model, data)


@with_known_arguments
def step(batch: ArenaBatch, data: mjx.Data) -> mjx.Data:
    """Takes one `mjx.step` in all worlds.

    `data` must come from `make_data(batch)`. Data of another arena with the same sizes cannot be detected.
    """
    check_types(batch, data)
    check_devices(batch, data)
    spread = _spread(batch)
    with warp_notes.no_room_answered():
        data = _step(batch, data, spread)
    if spread is None:  # a sum over devices would be a collective
        warp_notes.NOTES.take(data)
    return data


@functools.partial(jax.jit, static_argnames="spread")
def _step(batch: ArenaBatch, data: mjx.Data, spread: devices.Spread | None) -> mjx.Data:
    _check_worlds(batch, data, spread)
    return _on_each(_step_here, batch, spread)(batch, data)


def _check_worlds(batch: ArenaBatch, data: mjx.Data, spread: devices.Spread | None) -> None:
    if data.qpos.shape[:1] != (batch.n_worlds,) or data.qpos.ndim != 2:
        n = data.qpos.shape[0]
        worlds = f"{n} world{'s' * (n != 1)}" if data.qpos.ndim == 2 else "one world"
        raise validation.error([problem("data", "worlds_of", n=batch.n_worlds, whose="the batch", of=worlds)])
    m = batch.model
    per_body = {
        "qfrc_applied": (m.nv,),
        "xfrc_applied": (m.nbody, 6),
        "mocap_pos": (m.nmocap, 3),
        "mocap_quat": (m.nmocap, 4),
        **{name: (n, 3) for name, n in (("geom_xpos", m.ngeom), ("site_xpos", m.nsite), ("cam_xpos", m.ncam))},
    }
    for name, shape in ({"qpos": (m.nq,), "qvel": (m.nv,), "act": (m.na,), "ctrl": (m.nu,)} | per_body).items():
        array, want = getattr(data, name), (batch.n_worlds, *shape)
        if array is None or array.shape != want:
            got = None if array is None else array.shape
            raise validation.error([problem(f"data.{name}", "shape", want=want, shape=got)])
    n_shards = spread.n_shards if spread else 1
    if batch.model.impl == Impl.WARP and len(data._impl.nacon) != n_shards:
        raise validation.error([problem("data", "where_stepped", None, len(data._impl.nacon), n_shards=n_shards)])


@strict.of_mjx
def _step_here(batch: ArenaBatch, data: mjx.Data) -> mjx.Data:
    """A step of the worlds of one device; without the tables that are out of reach, where that pays."""
    if batch.model.impl == Impl.WARP:
        kernels.compile_side_by_side(batch.record.mj_model, data, batch.fields)
    batch = dataclasses.replace(batch, model=warp_notes.quiet(batch.model))
    plain = jax.vmap(mjx.step, in_axes=(batch.in_axes, 0))
    plan = culling.plan(batch.model, batch.fields, batch.record.layout, data)
    if plan is None:
        return plain(batch.model, data)
    ahead = jax.vmap(mjx.fwd_position, in_axes=(batch.in_axes, 0))(batch.model, data)  # its contacts are not used
    chosen, overflow = jax.vmap(functools.partial(culling.choose, plan), in_axes=(batch.in_axes, 0))(batch.model, ahead)
    culled = jax.vmap(functools.partial(culling.step, plan), in_axes=(batch.in_axes, 0, 0))
    return jax.lax.cond(overflow.any(), lambda: plain(batch.model, data), lambda: culled(batch.model, ahead, chosen))


def stepper(batch: ArenaBatch, data: mjx.Data, spread: devices.Spread | None = None) -> Callable:
    """A step of all worlds, as a function of batch and data, for a loop in `jit` that starts with `data`."""
    _check_worlds(batch, data, spread)
    wanted = jnp.result_type(float)
    if batch.model.impl == Impl.JAX and data.qpos.dtype != wanted:
        raise validation.error([problem("data", "wide", None, Told(data.qpos.dtype), wanted=wanted)])
    step = _on_each(_step_here, batch, spread)
    return constants_ahead(step, batch, data) if batch.model.impl == Impl.WARP and spread is None else step


def constants_ahead(function: Callable, *args: Any) -> Callable:
    """`function` for a loop that starts here: its constant arrays are made now, not in each turn.

    MJX hands Warp the hundreds of arrays of its model's structure as constants. XLA moves constants into the loops that
    use them, where each that is one number or a count becomes a kernel (benchmarks/README.md).
    """
    return constants.changed(function, jax.lax.optimization_barrier, *args)


def check_data(batch: ArenaBatch, data: mjx.Data) -> None:
    """Refuses what is not a batch and its data."""
    check_types(batch, data)
    _check_worlds(batch, data, _spread(batch))


def check_types(batch: ArenaBatch, data: mjx.Data) -> None:
    """Refuses arguments that are not a batch and its data."""
    if not isinstance(batch, ArenaBatch) or not isinstance(data, mjx.Data):
        got = f"{type(batch).__name__} and {type(data).__name__}"
        raise validation.error([problem("batch", "batch_and_data", None, Told(got))], kind=TypeError)
    check_impl(batch.model, data)


def check_impl(model: mjx.Model, data: mjx.Data) -> None:
    """Refuses data of another implementation of MJX than the model's."""
    if data.impl != model.impl:
        raise validation.error([problem("data", "impl_of_model", None, data.impl.value, wanted=model.impl.value)])


def _spread(batch: ArenaBatch) -> devices.Spread | None:
    return devices.spread_of(batch.params.table_rots)


def check_devices(batch: ArenaBatch, data: mjx.Data) -> None:
    """Refuses data on other devices than the batch's."""
    arrays = batch.params.table_rots, data.qpos
    traced = any(isinstance(array, jax.core.Tracer) for array in arrays)
    if traced or not getattr(arrays[1], "committed", False):  # NumPy's arrays go where the batch is
        return
    on, got = (sorted(device.id for device in array.sharding.device_set) for array in arrays)
    if on != got:
        raise validation.error([problem("data", "devices_of_batch", None, got, wanted=on)])


def _on_each(function: Callable, batch: ArenaBatch, spread: devices.Spread | None) -> Callable:
    """`function` of a batch and of arrays of its worlds, with which each device computes its own."""
    if spread is None:
        return function
    model = jax.tree.map(lambda _: P(), batch.model).tree_replace(dict.fromkeys(batch.fields, spread.spec))
    specs = dataclasses.replace(batch, model=model, params=spread.spec, valid=spread.spec)  # type: ignore[arg-type]
    return devices.on_each(function, spread, (specs, spread.spec))
