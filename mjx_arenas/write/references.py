"""Masses and centres of mass of subtrees, and the poses of cameras and lights at `qpos0` that refer to them.

The formulas are those of `set0` in MuJoCo's `engine_setconst.c`.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.quaternions import normalize, quat_rotate
from mjx_arenas.rows import take
from mjx_arenas.write.kinematics import Kinematics

MINVAL = mujoco.mjMINVAL


class Heavy(NamedTuple):
    """The bodies that have mass."""

    ids: np.ndarray
    centred: bool  # their centres of mass are their origins


def subtrees(model: mjx.Model) -> np.ndarray:
    """(nbody, nbody) bool: whether the second body is in the subtree of the first."""
    member = np.eye(model.nbody, dtype=bool)
    for body in range(model.nbody - 1, 0, -1):
        member[model.body_parentid[body]] |= member[body]
    return member


def subtree_mass(model: mjx.Model) -> jax.Array:
    """(nbody,) mass of each body's subtree."""
    # Not a matrix product, which a GPU would round to ten bits of mantissa.
    return jnp.where(subtrees(model), model.body_mass, 0.0).sum(1)


def subtree_com(model: mjx.Model, kin: Kinematics, bodies: np.ndarray, heavy: Heavy | None = None) -> jax.Array:
    """(n, 3) centre of mass of the subtrees of `bodies` (n,); of a massless one, the body's own.

    `heavy`: what has mass, if that is known; None: anything may.
    """
    heavy = heavy or Heavy(np.arange(model.nbody), False)
    asked, bodies = bodies, np.unique(bodies)

    def own(ids: np.ndarray) -> jax.Array:
        return kin.place(ids, take(model.body_ipos, ids))

    masses, com = take(model.body_mass, heavy.ids), take(kin.pos, heavy.ids) if heavy.centred else own(heavy.ids)
    members = subtrees(model)[bodies][:, heavy.ids]
    mass = jnp.where(members, masses, 0.0).sum(1)
    weighted = jnp.where(members[:, :, None], masses[:, None] * com, 0.0).sum(1)
    com = jnp.where((mass > MINVAL)[:, None], weighted / jnp.maximum(mass, MINVAL)[:, None], own(bodies))
    return com[np.searchsorted(bodies, asked)]


class References(NamedTuple):
    """Poses of cameras or lights at `qpos0`, in world axes."""

    pos0: jax.Array  # (n, 3) relative to the body
    poscom0: jax.Array  # (n, 3) relative to the centre of mass of the body's, or the target's, subtree


def references(kin: Kinematics, body: np.ndarray, local_pos: jax.Array, com: jax.Array) -> References:
    """Reference positions of cameras or lights on `body` (n,), before the `subtree_com` (n, 3) that they refer to."""
    offset = quat_rotate(take(kin.quat, body), local_pos)
    return References(offset, take(kin.pos, body) + offset - com)


def reference_fields(model: mjx.Model, kin: Kinematics) -> dict[str, jax.Array]:
    """Reference poses of cameras, and of lights where the model knows their bodies."""
    fields = {}
    if model.ncam:
        body, target = np.asarray(model.cam_bodyid), np.asarray(model.cam_targetbodyid)
        com = subtree_com(model, kin, np.where(target >= 0, target, body))
        cam = references(kin, body, model.cam_pos, com)
        fields |= {"cam_pos0": cam.pos0, "cam_poscom0": cam.poscom0, "cam_mat0": kin.frame(body, model.cam_quat)}
    if model.nlight and model.impl.value == "warp":
        body, target = np.asarray(model._impl.light_bodyid), np.asarray(model._impl.light_targetbodyid)
        com = subtree_com(model, kin, np.where(target >= 0, target, body))
        light = references(kin, body, model.light_pos, com)
        direction = normalize(quat_rotate(take(kin.quat, body), model.light_dir))
        fields |= {"light_pos0": light.pos0, "light_poscom0": light.poscom0, "light_dir0": direction}
    return fields
