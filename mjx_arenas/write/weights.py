"""How hard degrees of freedom and bodies are to move at `qpos0`: `set0` in MuJoCo's `engine_setconst.c`."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from mujoco import mjx

from mjx_arenas.write.inertia import Factor, factored
from mjx_arenas.write.kinematics import BALL, FREE, kinematics
from mjx_arenas.write.motion import Motion, motion
from mjx_arenas.write.quaternions import quat_to_mat
from mjx_arenas.write.rows import dot, replace_rows
from mjx_arenas.write.tendons import tendons
from mjx_arenas.write.trees import Trees, trees_of


class Weights(NamedTuple):
    """How hard degrees of freedom and bodies are to move at `qpos0`; in [kg], where something turns in [kg m^2]."""

    dof_M0: jax.Array  # (nv,) diagonal of the inertia matrix
    dof_invweight0: jax.Array  # (nv,) diagonal of its inverse, averaged over the axes of free and ball joints
    body_invweight0: jax.Array  # (nbody, 2) mean inverse inertia against pushes at the centre of mass and turns


def weights(model: mjx.Model, roots: np.ndarray) -> Weights:
    """The weights, recomputed for the trees whose first bodies are `roots` (n,), and as in `model` for the others.

    Raises:
        ValueError: if one of `roots` is not the first body of a tree.
    """
    state = motion(model, kinematics(model))
    tendon = tendons(model, state)
    lone, groups = trees_of(model, roots)
    return weights_of(model, state, lone, [factored(model, state, tendon, trees) for trees in groups])


def weights_of(model: mjx.Model, state: Motion, lone: Trees, factors: Sequence[Factor]) -> Weights:
    """The weights, recomputed for these trees."""
    found = [_dense_weights(model, f) for f in factors] + [_lone_weights(model, state, lone)]
    bodies, dofs = (
        np.concatenate([ids.reshape(-1) for ids in part])
        for part in zip(*(f.trees for f in factors), lone, strict=True)
    )
    diagonal, inverse, body = (jnp.concatenate(rows) for rows in zip(*found, strict=True))
    return Weights(
        replace_rows(model.dof_M0, dofs, diagonal),
        replace_rows(model.dof_invweight0, dofs, inverse),
        replace_rows(model.body_invweight0, bodies, body),
    )


def _dense_weights(model: mjx.Model, factor: Factor) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Rows (gd,), (gd,), (g * bodies, 2) of `Weights`."""
    bodies, dofs = factor.trees
    joint = np.asarray(model.dof_jntid)[dofs]
    wide = np.isin(np.asarray(model.jnt_type)[joint], (FREE, BALL))
    index = dofs - np.asarray(model.jnt_dofadr)[joint]
    triple = np.where(wide, np.arange(dofs.shape[1]) - index % 3, np.arange(dofs.shape[1]))
    axes = triple[:, :, None] + np.where(wide[:, :, None], np.arange(3), 0)  # three of the joint, or three times one
    inverse = (factor.root**2).sum(1)[np.arange(len(dofs))[:, None, None], axes].mean(2)
    body = (dot("gbxdi,ged->gbxie", factor.jacobian, factor.root) ** 2).sum((3, 4)) / 3

    # `mj_setConst` takes a body with nothing but slides along its axes for a point, and ignores armatures.
    point = np.asarray(model.body_simple) == 2
    light = 1 / jnp.where(model.body_mass > 0, model.body_mass, 1.0)
    inverse = jnp.where(point[model.dof_bodyid[dofs]], light[model.dof_bodyid[dofs]], inverse)
    as_point = jnp.stack([light, jnp.zeros_like(light)], axis=1)
    body = jnp.where(point[bodies][..., None], as_point[bodies], body)
    return factor.diagonal.reshape(-1), inverse.reshape(-1), body.reshape(-1, 2)


def _lone_weights(model: mjx.Model, state: Motion, trees: Trees) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Rows (6g,), (6g,), (g, 2) of `Weights`, by block elimination of each matrix.

    With mass m, centre of mass c, inertia I about it, armatures a of translation and b of rotation, and H = R [c]x,
    the matrix is [[m + a, -m H], [-m H', I + m H'H + b]]. All terms below are positive: no digits cancel.
    """
    body = trees.bodies[:, 0]
    mass, slow = model.body_mass[body][:, None], model.dof_armature[trees.dofs[:, :3]]
    principal, eye = quat_to_mat(model.body_iquat[body]), jnp.eye(3)
    inertia = _product(principal * model.body_inertia[body][:, None], principal.swapaxes(1, 2))
    arm = _product(quat_to_mat(state.quat[body]), jnp.cross(eye, model.body_ipos[body][:, None]))  # H or -H
    heavy, fast = mass + slow, model.dof_armature[trees.dofs[:, 3:]]

    def outer(scale: jax.Array) -> jax.Array:
        return _product(arm.swapaxes(1, 2) * scale[:, None], arm)

    inverse = _inverse(inertia + eye * fast[:, None] + outer(mass * slow / heavy))

    def mean(matrix: jax.Array) -> jax.Array:
        return (matrix * inverse).sum((1, 2)) / 3

    light, turn = (1 / heavy).mean(1), mean(eye[None])
    at_origin, at_com = light + mean(outer((mass / heavy) ** 2)), light + mean(outer((slow / heavy) ** 2))
    turned = jnp.diagonal(inertia + outer(jnp.broadcast_to(mass, heavy.shape)), axis1=1, axis2=2) + fast
    inverse_diagonal = jnp.stack([at_origin, turn], axis=1).repeat(3, axis=1)
    diagonal = jnp.concatenate([heavy, turned], axis=1)
    return diagonal.reshape(-1), inverse_diagonal.reshape(-1), jnp.stack([at_com, turn], axis=1)


def _product(a: jax.Array, b: jax.Array) -> jax.Array:
    """Matrix products (n, 3, 3), fused with what surrounds them."""
    return (a[..., None] * b[:, None]).sum(2)


def _inverse(matrix: jax.Array) -> jax.Array:
    """Inverses of positive definite matrices (n, 3, 3)."""
    scale = jnp.trace(matrix, axis1=1, axis2=2)[:, None, None]  # keeps the determinants of small bodies in range
    x, y, z = (matrix / scale).swapaxes(0, 1)
    adjugate = jnp.stack([jnp.cross(y, z), jnp.cross(z, x), jnp.cross(x, y)], axis=1)
    return adjugate / ((x * adjugate[:, 0]).sum(1)[:, None, None] * scale)
