"""Poses that equality constraints keep, those at `qpos0`: `set0` in MuJoCo's `engine_setconst.c`."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.quaternions import conjugate, quat_mul, quat_rotate
from mjx_arenas.rows import replace_rows
from mjx_arenas.write.kinematics import Kinematics

_EQ, _OBJ = mujoco.mjtEq, mujoco.mjtObj
_WELD_MARK = 11  # column of `eq_data` in which MuJoCo marks welds whose pose is that of `qpos0`


def eq_data(model: mjx.Model, kin: Kinematics) -> jax.Array:
    """`eq_data` with the anchors of connected bodies, and the poses of welds that MuJoCo marks as derived."""
    kind, of_bodies = np.asarray(model.eq_type), np.asarray(model.eq_objtype) == _OBJ.mjOBJ_BODY
    first, second = np.asarray(model.eq_obj1id), np.asarray(model.eq_obj2id)
    connects = np.flatnonzero(of_bodies & (kind == _EQ.mjEQ_CONNECT))
    welds = np.flatnonzero(of_bodies & (kind == _EQ.mjEQ_WELD))

    def relative(ids: np.ndarray, given: np.ndarray, other: np.ndarray) -> tuple[jax.Array, jax.Array]:
        """The anchors that are in the frames of `given`, and these frames, both in the frames of bodies `other`."""
        inverse = conjugate(kin.quat[other[ids]])
        anchor = kin.place(given[ids], model.eq_data[ids, :3]) - kin.pos[other[ids]]
        return quat_rotate(inverse, anchor), quat_mul(inverse, kin.quat[given[ids]])

    data = model.eq_data
    anchor, _ = relative(connects, first, second)
    old = data[connects]
    data = replace_rows(data, connects, jnp.concatenate([old[:, :3], anchor, old[:, 6:]], axis=1))
    anchor, turn = relative(welds, second, first)
    old = data[welds]
    new = jnp.concatenate([old[:, :3], anchor, turn, old[:, 10:]], axis=1)
    return replace_rows(data, welds, jnp.where(old[:, _WELD_MARK, None] != 0, new, old))
