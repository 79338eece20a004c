"""Rollouts on MJX that are watched (device). W worlds."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from mujoco import mjx
from mujoco.mjx._src.types import Impl

from mjx_arenas.checks import watch
from mjx_arenas.checks.watch import Now, Seen, Tops
from mjx_arenas.sim import batch as batch_
from mjx_arenas.sim.batch import ArenaBatch
from mjx_arenas.sim.warp_notes import capacity
from mjx_arenas.twin.cpu import STATE

State = dict[str, jax.Array]  # (W, ...) by the names of mjx.Data


class Rolled(NamedTuple):
    """Worlds, and what was seen of them so far."""

    data: mjx.Data
    seen: Seen
    kept: State  # the last state of each world before anything went wrong
    kept_step: jax.Array  # (W,) its step


def begin(batch: ArenaBatch, data: mjx.Data) -> Rolled:
    """Before the first step."""
    nothing = watch.nothing(batch.n_worlds, len(batch.record.parts.objects), data.qpos.dtype)
    return Rolled(data, jax.tree.map(jnp.asarray, nothing), state(data), jnp.zeros(batch.n_worlds, jnp.int32))


@jax.jit
def fall(batch: ArenaBatch, data: mjx.Data, n_steps: int) -> mjx.Data:
    """After `n_steps` steps in which nothing is watched."""
    step = batch_.stepper(batch, data)
    return jax.lax.fori_loop(0, n_steps, lambda _, before: step(batch, before), data)


@jax.jit
def roll(batch: ArenaBatch, rolled: Rolled, tops: Tops, n_steps: int) -> Rolled:
    """After `n_steps` more steps."""
    step = batch_.stepper(batch, rolled.data)
    size = batch.model.geom_size
    half = jnp.broadcast_to(watch.half_extents(batch.model.geom_type, size), (batch.n_worlds, size.shape[-2]))

    def body(_: Any, before: Rolled) -> Rolled:
        data = step(batch, before.data)
        seen, good = watch.update(before.seen, _look(batch, data, tops, half), tops.there)
        kept = jax.tree.map(lambda new, old: _where(good, new, old), state(data), before.kept)
        return Rolled(data, seen, kept, jnp.where(good, seen.step, before.kept_step))  # type: ignore[arg-type]

    return jax.lax.fori_loop(0, n_steps, body, rolled)


def state(data: mjx.Data) -> State:
    """What a rollout can start from again."""
    return {name: getattr(data, name) for name in STATE}


def _where(rows: jax.Array, new: jax.Array, old: jax.Array) -> jax.Array:
    return jnp.where(rows.reshape(-1, *(1,) * (new.ndim - 1)), new, old)


def _look(batch: ArenaBatch, data: mjx.Data, tops: Tops, half: jax.Array) -> Now:
    room = capacity(batch.record.mj_model, data)
    poses = data.qpos[:, batch.record.layout.object_qpos]
    finite = watch.is_finite(data.qpos, data.qvel, data.qacc)
    placed = watch.out_of_place(tops, poses[..., :3], poses[..., 3:])
    deepest, needed = _deepest(data, half), room.needed.astype(jnp.int32)
    return Now(finite, room.overflowed, needed, *deepest, *placed, _lost_velocity(batch, data))


def _lost_velocity(batch: ArenaBatch, data: mjx.Data) -> jax.Array:
    """(W, K), of the objects that are one rigid body."""
    model, body = batch.record.mj_model, batch.record.layout.object_body
    dof = model.body_dofadr[body][:, None] + np.arange(6)
    gained = (data.qacc - data.qacc_smooth)[:, dof]
    mass = jnp.where(watch.rigid(model, body), batch.model.body_subtreemass[..., body], 0.0)
    arm, force = (data.subtree_com - data.xpos)[:, body], data.qfrc_constraint[:, dof[:, :3]]
    timestep = jnp.reshape(batch.model.opt.timestep, (-1, 1))
    return watch.lost_velocity(data.xquat[:, body], arm, mass, gained, force, timestep)


def _deepest(data: mjx.Data, half: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Share (W,), depth (W,) [m] and geoms (W, 2) of each world's deepest contact; zeros where there is none."""
    n_worlds = len(half)
    if data.impl == Impl.JAX:
        dist, geom = data._impl.contact.dist, data._impl.contact.geom
        n = dist.shape[-1]
        dist, geom = dist.reshape(-1), geom.reshape(-1, 2)
        margin = data._impl.contact.includemargin.reshape(-1)  # of what is not there far below 0
        world, live = jnp.repeat(jnp.arange(n_worlds), n), (dist < 0) & (dist < margin)
    else:  # of all worlds together
        dist, geom, world = (getattr(data._impl, f"contact__{name}") for name in ("dist", "geom", "worldid"))
        live = (jnp.arange(len(dist)) < data._impl.nacon[0]) & (dist < 0) & (geom >= 0).all(-1)
    if not len(dist):
        return jnp.zeros(n_worlds), jnp.zeros(n_worlds), jnp.zeros((n_worlds, 2), jnp.int32)
    world = jnp.where(live, world, 0)
    pair = jnp.where(live[:, None], geom, 0).astype(jnp.int32)
    share = jnp.where(live, -dist / half[world[:, None], pair].min(-1), 0.0)
    largest = jax.ops.segment_max(share, world, n_worlds)
    index = jnp.where(live & (share >= largest[world]), jnp.arange(len(dist)), -1)
    deepest = jax.ops.segment_max(index, world, n_worlds)
    found = (deepest >= 0) & (largest > 0)
    rows = jnp.where(found, deepest, 0)
    zero = jnp.zeros((), dist.dtype)
    return (
        jnp.where(found, largest, zero),
        jnp.where(found, -dist[rows], zero),
        jnp.where(found[:, None], pair[rows], 0),
    )
