"""Objects that fall until they rest."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from mujoco import mjx

from mjx_arenas import geometry, strict
from mjx_arenas.furniture import surfaces
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.quaternions import angle, quat_rotate
from mjx_arenas.rules import validation
from mjx_arenas.sample import placement, tops
from mjx_arenas.sim import devices
from mjx_arenas.sim.batch import ArenaBatch
from mjx_arenas.sim.rollouts import Control, rollout

SPEED = 0.005  # [m/s] up to which an object rests


class Settled(NamedTuple):
    """What `settle` returns: the data of all worlds, and which of their objects rest."""

    data: mjx.Data
    """Data of all worlds, with the time of their start. Objects at rest have no velocity."""
    rests: jax.Array
    """(W, K) bool: the object is at rest, or absent.

    An object at rest hardly moves at the end. If it was dropped, its middle is also above its surface, so that it has not fallen through,
    and within the edges of the table or part that carries it, so that it has not bounced out. Drawers and other pieces that joints move
    have no edges in this sense."""


@with_known_arguments
@strict.own_constants
def settle(
    batch: ArenaBatch, data: mjx.Data, n_steps: int, speed: float = SPEED, control: Control | None = None
) -> Settled:
    """Steps all worlds until dropped objects (`Place(drop=True)`) have come to rest. Robots and doors move as well.

    Args:
        batch: W worlds of K objects.
        data: data of all worlds, from `make_data` with keys.
        n_steps: number of steps in which they fall; one or two seconds are enough for most bins.
        speed: an object rests if its mean speed over the last tenth of the steps is at most this [m/s]. Both the speed of its middle and
            that of the end of its longest side by turning count.
        control: as for `rollout`; None: `data.ctrl` stays. The step number that a function gets starts again at 0 for the last tenth of the
            steps.

    Raises:
        ValueError, TypeError: an argument makes no sense.
    """
    validation.raise_all(validation.not_negative_problems("speed", speed, "[m/s]"), "settle")
    n_steps = validation.whole("n_steps", n_steps, 10)
    last = n_steps // 10
    before = rollout(batch, data, n_steps - last, control=control)
    after = rollout(batch, before, last, control=control)
    layout = batch.record.layout
    rests = resting(batch, before, after, last, speed) & (~_astray(batch, after) | ~_there(batch))
    dofs = jnp.asarray(layout.model.body_dofadr[layout.object_body][:, None] + np.arange(6), int)  # (K, 6)
    qvel = after.qvel.at[:, dofs].set(jnp.where(rests[..., None], 0.0, after.qvel[:, dofs]))
    return Settled(after.replace(qvel=qvel, time=data.time), rests)


def resting(batch: ArenaBatch, before: mjx.Data, after: mjx.Data, n_steps: int, speed: float = SPEED) -> jax.Array:
    """(W, K) bool: objects whose mean speed between two states is at most that of `settle`, and those that are absent."""
    at = batch.record.layout.object_qpos
    moved = jnp.linalg.norm((after.qpos - before.qpos)[:, at[:, :3]], axis=-1)
    turned = angle(*(data.qpos[:, at[:, 3:]] for data in (before, after))) * batch.params.object_full_sizes.max(-1) / 2
    time = n_steps * batch.model.opt.timestep.reshape(-1, 1)
    return (jnp.maximum(moved, turned) <= speed * time) | ~_there(batch)


def _astray(batch: ArenaBatch, data: mjx.Data) -> jax.Array:
    """(W, K) bool: objects that were dropped whose middles are below the surfaces that they fell onto, or beyond the edges.

    Of what lies on an object, which may have moved, the edges are those of the table or part below. What a joint moves, such as a
    drawer, has no edges here, as it may be elsewhere than at the start.
    """
    layout = batch.record.layout
    places = layout.places
    if not places.drop.any():
        return jnp.zeros((), bool)
    moves = np.append(np.zeros(layout.n_tables, bool), surfaces.moving(places.furniture))

    def astray(params: ArenaParams, qpos: jax.Array) -> jax.Array:
        pose, every = qpos[layout.object_qpos], tops.surfaces(params, places.ground)  # (K, 7)
        middle = pose[:, :3] + quat_rotate(pose[:, 3:], jnp.asarray(placement.body_centers(places, params)))
        sunk = middle[:, 2] < every.of(params.object_tables).top[:, 2]
        roots = tops.roots(params, places.ground)
        below, still = every.of(roots), ~geometry.pick(moves, roots)
        beyond = geometry.beyond(below.top, below.rot, below.size, middle[:, :2])
        return places.drop & (sunk | (still & (beyond > 0).any(-1)))

    spread = devices.spread_of(data.qpos)
    return devices.on_each(jax.vmap(astray), spread, spread and (spread.spec, spread.spec))(batch.params, data.qpos)


def _there(batch: ArenaBatch) -> jax.Array:
    """(W, K) bool: which objects are there."""
    layout = batch.record.layout
    n, k = layout.n_tables, len(layout.object_names)
    return jax.vmap(layout.presence.there)(batch.params)[:, n : n + k]
