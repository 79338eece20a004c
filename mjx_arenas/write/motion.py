"""How degrees of freedom move bodies at `qpos0`."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from mujoco import mjx

from mjx_arenas.write.kinematics import BALL, FREE, HINGE, SLIDE, Kinematics
from mjx_arenas.write.quaternions import quat_mul, quat_rotate, quat_to_mat


class Motion(NamedTuple):
    """Poses, and the velocity lin + ang x (point - anchor) of points that one degree of freedom moves at speed 1."""

    pos: jax.Array  # (nbody, 3)
    quat: jax.Array  # (nbody, 4)
    lin: jax.Array  # (nv, 3)
    ang: jax.Array  # (nv, 3)
    anchor: jax.Array  # (nv, 3)
    moved: np.ndarray  # (nbody, nv) bool: whether the degree of freedom moves the body

    def place(self, body: np.ndarray, local: jax.Array) -> jax.Array:
        """World positions (n, 3) of points (n, 3) in the frames of `body` (n,)."""
        return self.pos[body] + quat_rotate(self.quat[body], local)

    def frame(self, body: np.ndarray, local: jax.Array) -> jax.Array:
        """World orientations (n, 3, 3) of quaternions (n, 4) in the frames of `body` (n,)."""
        return quat_to_mat(quat_mul(self.quat[body], local))

    def jacobian(self, body: np.ndarray, point: jax.Array, dofs: np.ndarray) -> tuple[jax.Array, jax.Array]:
        """Velocities (..., k, 3) of points (..., 3) on `body` (...,), and of its rotation, by `dofs` (..., k)."""
        lin = self.lin[dofs] + jnp.cross(self.ang[dofs], point[..., None, :] - self.anchor[dofs])
        moved = self.moved[body[..., None], dofs][..., None]
        return jnp.where(moved, lin, 0.0), jnp.where(moved, self.ang[dofs], 0.0)


def motion(model: mjx.Model, kin: Kinematics) -> Motion:
    """How degrees of freedom move what stands in the poses `kin`."""
    moved = np.zeros((model.nbody, model.nv), bool)
    for body in range(1, model.nbody):
        moved[body] = moved[model.body_parentid[body]] | (model.dof_bodyid == body)
    joint = np.asarray(model.dof_jntid)
    kind = np.asarray(model.jnt_type)[joint]
    index = np.arange(model.nv) - np.asarray(model.jnt_dofadr)[joint]
    shift, spin = (kind == FREE) & (index < 3), (kind == BALL) | ((kind == FREE) & (index >= 3))
    axis, body_axis = kin.axis[joint], quat_to_mat(kin.quat)[model.dof_bodyid, :, index % 3]
    lin = jnp.where((kind == SLIDE)[:, None], axis, jnp.where(shift[:, None], jnp.eye(3)[index % 3], 0.0))
    ang = jnp.where((kind == HINGE)[:, None], axis, jnp.where(spin[:, None], body_axis, 0.0))
    return Motion(kin.pos, kin.quat, lin, ang, kin.anchor[joint], moved)
