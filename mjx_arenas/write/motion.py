"""How degrees of freedom move bodies at `qpos0`.

Where a tree is `centred`, its root's first three degrees of freedom move its centre of mass, and the next three turn it
about that: rows of derivatives with respect to them are "central". MuJoCo's own, "original" ones are about the root's
origin.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas.quaternions import cross, quat_mul, quat_rotate, quat_to_mat
from mjx_arenas.rows import take
from mjx_arenas.write.centres import Centred
from mjx_arenas.write.kinematics import BALL, FREE, HINGE, SLIDE, kinematics


class Motion(NamedTuple):
    """Poses, and the velocity lin + ang x (point - anchor) of points that one degree of freedom moves at speed 1.

    Positions are relative to the zeros of their trees: there are no digits to lose far away from the world's origin.
    """

    pos: jax.Array  # (nbody, 3)
    quat: jax.Array  # (nbody, 4)
    origin: jax.Array  # (nbody, 3) the zeros, in the world
    lin: jax.Array  # (nv, 3)
    ang: jax.Array  # (nv, 3)
    anchor: jax.Array  # (nv, 3)
    centre: jax.Array  # (nbody, 3) of centred roots, where their origins are in their old frames
    shift: jax.Array  # (nv, 3) velocity of the centre relative to the root's origin; 0 but for turns of centred roots
    carrier: np.ndarray  # (nv, 3) for these the degrees of freedom that move the root along the axes
    moved: np.ndarray  # (nbody, nv) bool: whether the degree of freedom moves the body

    def place(self, body: np.ndarray, local: jax.Array) -> jax.Array:
        """Positions (n, 3) of points (n, 3) in the frames of `body` (n,), relative to the zeros of their trees."""
        return take(self.pos, body) + quat_rotate(take(self.quat, body), local)

    def frame(self, body: np.ndarray, local: jax.Array) -> jax.Array:
        """World orientations (n, 3, 3) of quaternions (n, 4) in the frames of `body` (n,)."""
        return quat_to_mat(quat_mul(take(self.quat, body), local))

    def jacobian(self, body: np.ndarray, point: jax.Array, dofs: np.ndarray) -> tuple[jax.Array, jax.Array]:
        """Velocities (..., k, 3) of points (..., 3) as `place` has them, on `body` (...,), and of its rotation, by `dofs` (..., k)."""
        dofs = dofs.reshape((1,) * (body.ndim + 1 - dofs.ndim) + dofs.shape)
        lin = take(self.lin, dofs) + cross(take(self.ang, dofs), point[..., None, :] - take(self.anchor, dofs))
        moved = self.moved[body[..., None], dofs][..., None]
        return jnp.where(moved, lin, 0.0), jnp.where(moved, take(self.ang, dofs), 0.0)

    def central(self, rows: jax.Array) -> jax.Array:
        """Original rows (k, nv), made central."""
        return rows - (rows[:, self.carrier] * self.shift[None]).sum(-1)

    def original(self, rows: jax.Array) -> jax.Array:
        """Central rows (k, nv), made original."""
        return rows + (rows[:, self.carrier] * self.shift[None]).sum(-1)


def motion(centred: Centred) -> Motion:
    """How degrees of freedom move the bodies of a model."""
    model, kin = centred.model, kinematics(centred.model)
    moved = np.zeros((model.nbody, model.nv), bool)
    for body in range(1, model.nbody):
        moved[body] = moved[model.body_parentid[body]] | (model.dof_bodyid == body)
    joint = np.asarray(model.dof_jntid)
    kind = np.asarray(model.jnt_type)[joint]
    first = np.asarray(model.jnt_dofadr)[joint]
    index = np.arange(model.nv) - first
    push, spin = (kind == FREE) & (index < 3), (kind == BALL) | ((kind == FREE) & (index >= 3))
    axis, body_axis = take(kin.axis, joint), quat_to_mat(kin.quat)[model.dof_bodyid, :, index % 3]
    lin = jnp.where((kind == SLIDE)[:, None], axis, jnp.where(push[:, None], jnp.eye(3)[index % 3], 0.0))
    ang = jnp.where((kind == HINGE)[:, None], axis, jnp.where(spin[:, None], body_axis, 0.0))
    turns = (kind == FREE) & (index >= 3)
    shift = jnp.where(turns[:, None], cross(ang, quat_rotate(kin.quat, centred.centre)[model.dof_bodyid]), 0.0)
    carrier = np.where(turns[:, None], first[:, None] + np.arange(3), 0)
    return Motion(
        kin.pos, kin.quat, centred.origin, lin, ang, take(kin.anchor, joint), centred.centre, shift, carrier, moved
    )
