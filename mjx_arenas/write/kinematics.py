"""World poses of bodies and joints at `qpos0`: `mj_kinematics1` in MuJoCo's `engine_core_smooth.c`."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.quaternions import normalize, quat_mul, quat_rotate, quat_to_mat
from mjx_arenas.rows import replace_rows, take

FREE, BALL, SLIDE, HINGE = (int(mujoco.mjtJoint(kind)) for kind in range(4))


class Kinematics(NamedTuple):
    """World poses of bodies and joints."""

    pos: jax.Array  # (nbody, 3)
    quat: jax.Array  # (nbody, 4)
    anchor: jax.Array  # (njnt, 3)
    axis: jax.Array  # (njnt, 3) unit vectors; without meaning for free and ball joints

    def place(self, body: np.ndarray, local: jax.Array) -> jax.Array:
        """World positions (n, 3) of points (n, 3) in the frames of `body` (n,)."""
        return self.pos[body] + quat_rotate(self.quat[body], local)

    def frame(self, body: np.ndarray, local: jax.Array) -> jax.Array:
        """World orientations (n, 3, 3) of quaternions (n, 4) in the frames of `body` (n,)."""
        return quat_to_mat(quat_mul(self.quat[body], local))


def kinematics(model: mjx.Model, compiled: bool = False) -> Kinematics:
    """World poses at `qpos0`, where no hinge and no slide displaces its body.

    With `compiled`, free bodies start where `body_pos` and `body_quat` have them, as MuJoCo's compiler makes it.
    """
    # First everything in the frame of the body's parent. Slides that stand before a ball joint do not turn with it.
    kinds, joint_body, adr = (np.asarray(a) for a in (model.jnt_type, model.jnt_bodyid, model.jnt_qposadr))
    free, ball = np.flatnonzero(kinds == FREE), np.flatnonzero(kinds == BALL)
    pos, quat = model.body_pos, model.body_quat
    anchor = pos[joint_body] + quat_rotate(quat[joint_body], model.jnt_pos)
    axis = quat_rotate(quat[joint_body], model.jnt_axis)
    if len(free) and not compiled:
        pose = take(model.qpos0, (adr[free][:, None] + np.arange(7)).reshape(-1)).reshape(-1, 7)
        pos = replace_rows(pos, joint_body[free], pose[:, :3])
        quat = replace_rows(quat, joint_body[free], normalize(pose[:, 3:]))
        anchor = replace_rows(anchor, free, pose[:, :3])
    elif len(free):
        anchor = replace_rows(anchor, free, pos[joint_body[free]])
    if len(ball):
        turn = normalize(model.qpos0[adr[ball][:, None] + np.arange(4)])
        quat = replace_rows(quat, joint_body[ball], quat_mul(quat[joint_body[ball]], turn))
        arm = quat_rotate(quat[joint_body[ball]], model.jnt_pos[ball])
        pos = replace_rows(pos, joint_body[ball], anchor[ball] - arm)
        turning = np.full(model.nbody, model.njnt)
        turning[joint_body[ball]] = ball
        later = (np.arange(model.njnt) > turning[joint_body])[:, None]
        anchor = jnp.where(later, pos[joint_body] + quat_rotate(quat[joint_body], model.jnt_pos), anchor)
        axis = jnp.where(later, quat_rotate(quat[joint_body], model.jnt_axis), axis)

    # Then along the tree, all bodies of a depth at once.
    parent = np.asarray(model.body_parentid)
    depth = np.zeros(len(parent), int)
    for body in range(1, len(parent)):
        depth[body] = depth[parent[body]] + 1
    for level in range(2, depth.max(initial=0) + 1):
        ids = np.flatnonzero(depth == level)
        parent_quat = quat[parent[ids]]
        level_pos = pos[parent[ids]] + quat_rotate(parent_quat, pos[ids])
        level_quat = quat_mul(parent_quat, quat[ids])
        pos, quat = replace_rows(pos, ids, level_pos), replace_rows(quat, ids, level_quat)
    base = parent[joint_body]
    return Kinematics(pos, quat, pos[base] + quat_rotate(quat[base], anchor), quat_rotate(quat[base], axis))


def body_poses(model: mjx.Model) -> tuple[jax.Array, jax.Array]:
    """World positions (nbody, 3) and orientations (nbody, 4) of all bodies at `qpos0`."""
    return kinematics(model)[:2]
