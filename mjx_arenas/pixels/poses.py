"""The poses of cameras, lights and geoms in one world's state (device, pure).

The formulas are those of `mj_camlight` in MuJoCo's `engine_core_smooth.c`.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.params.params import ArenaParams
from mjx_arenas.quaternions import cross, normalize, quat_mul, quat_rotate, quat_to_mat
from mjx_arenas.record.layout import Layout
from mjx_arenas.rows import take
from mjx_arenas.sim.data import place_static

_MODE = mujoco.mjtCamLight
_TRACK = (int(_MODE.mjCAMLIGHT_TRACK), int(_MODE.mjCAMLIGHT_TRACKCOM))
_AIMED = (int(_MODE.mjCAMLIGHT_TARGETBODY), int(_MODE.mjCAMLIGHT_TARGETBODYCOM))
_BY_MASS = (int(_MODE.mjCAMLIGHT_TRACKCOM), int(_MODE.mjCAMLIGHT_TARGETBODYCOM))


class Poses(NamedTuple):
    """Poses in one world, in world axes [m]."""

    geom_xpos: jax.Array  # (ngeom, 3)
    geom_xmat: jax.Array  # (ngeom, 3, 3)
    cam_xpos: jax.Array  # (ncam, 3)
    cam_xmat: jax.Array  # (ncam, 3, 3)
    light_xpos: jax.Array  # (nlight, 3)
    light_xdir: jax.Array  # (nlight, 3)


def poses(layout: Layout, params: ArenaParams, model: mjx.Model, drawn: mjx.Model, data: mjx.Data) -> Poses:
    """The poses in the state `data.qpos`, whatever was computed from it before.

    Args:
        layout: of the arena, whose model has what no world varies.
        params: of the world: what aims at something absent is fixed there, as in the compiled world.
        model: of the world, on the implementation of `data`.
        drawn: the same on Warp, which alone knows lights.
        data: of the world.
    """
    compiled = layout.model
    data = place_static(model, mjx.kinematics(model, data))
    by_mass = np.isin(np.concatenate([compiled.cam_mode, compiled.light_mode]), _BY_MASS).any()
    com = _centres(model, data) if by_mass else data.xpos
    cam = _Mounted(compiled.cam_mode, compiled.cam_bodyid, compiled.cam_targetbodyid, data, com)
    cam_there = _there(layout, params, compiled.cam_targetbodyid)
    cam_xpos = cam.placed(drawn.cam_pos, drawn.cam_pos0, drawn.cam_poscom0)
    cam_xmat = quat_to_mat(quat_mul(take(data.xquat, cam.body), drawn.cam_quat))
    cam_xmat = cam.chosen(_TRACK, drawn.cam_mat0, cam_xmat)
    cam_xmat = cam.chosen(_AIMED, _looking(cam_xpos - cam.target), cam_xmat, cam_there)
    light = _Mounted(compiled.light_mode, compiled.light_bodyid, compiled.light_targetbodyid, data, com)
    light_there = _there(layout, params, compiled.light_targetbodyid)
    light_xpos = light.placed(drawn.light_pos, drawn.light_pos0, drawn.light_poscom0)
    light_xdir = quat_rotate(take(data.xquat, light.body), drawn.light_dir)
    light_xdir = light.chosen(_TRACK, drawn.light_dir0, light_xdir)
    light_xdir = normalize(light.chosen(_AIMED, light.target - light_xpos, light_xdir, light_there))
    return Poses(data.geom_xpos, data.geom_xmat, cam_xpos, cam_xmat, light_xpos, light_xdir)


class _Mounted:
    """Cameras or lights, and what they are on."""

    def __init__(self, mode: np.ndarray, body: np.ndarray, target: np.ndarray, data: mjx.Data, com: jax.Array) -> None:
        # Without a target they are fixed.
        self.mode = np.where(np.isin(mode, _AIMED) & (target < 0), int(_MODE.mjCAMLIGHT_FIXED), mode)
        self.body, self._data, self._com = body, data, com
        self.target = self._at(np.maximum(target, 0))  # (n, 3)

    def placed(self, pos: jax.Array, pos0: jax.Array, poscom0: jax.Array) -> jax.Array:
        """(n, 3) where they are."""
        data, by_mass = self._data, np.isin(self.mode, _BY_MASS)[:, None]
        fixed = take(data.xpos, self.body) + quat_rotate(take(data.xquat, self.body), pos)
        return self.chosen(_TRACK, self._at(self.body) + jnp.where(by_mass, poscom0, pos0), fixed)

    def chosen(
        self, modes: tuple[int, ...], these: jax.Array, others: jax.Array, there: jax.Array | None = None
    ) -> jax.Array:
        """Rows of `these` (n, ...) where the mode is one of `modes` and they are `there` (n,), of `others` elsewhere."""
        here = np.isin(self.mode, modes)
        if not here.any():
            return others
        mask = jnp.asarray(here) if there is None else here & there
        return jnp.where(mask.reshape(-1, *(1,) * (others.ndim - 1)), these, others)

    def _at(self, bodies: np.ndarray) -> jax.Array:
        """(n, 3) origins of bodies, or centres of mass of their subtrees where the mode asks for these."""
        by_mass = np.isin(self.mode, _BY_MASS)[:, None]
        origins = take(self._data.xpos, bodies)
        return jnp.where(by_mass, take(self._com, bodies), origins) if by_mass.any() else origins


def _centres(model: mjx.Model, data: mjx.Data) -> jax.Array:
    """(nbody, 3) centres of mass of subtrees; of those without mass, which Warp puts at the world's origin, where C has them."""
    light = model.body_subtreemass < mujoco.mjMINVAL
    return jnp.where(light[:, None], data.xipos, mjx.com_pos(model, data).subtree_com)


def _there(layout: Layout, params: ArenaParams, target: np.ndarray) -> jax.Array | None:
    """(n,) bool: which targets are there in the world; None: all of them in every world."""
    group = np.where(target >= 0, layout.owner[target], -1)
    if not (group >= 0).any():
        return None
    there = jnp.append(jnp.asarray(layout.presence.there(params)), True)
    return take(there, group)


def _looking(back: jax.Array) -> jax.Array:
    """(n, 3, 3) orientations of cameras with these directions to their backs (n, 3), upright."""
    z = normalize(back)
    x = normalize(cross(jnp.broadcast_to(jnp.array([0.0, 0.0, 1.0]), z.shape), z))
    return jnp.stack([x, normalize(cross(z, x)), z], axis=-1)
