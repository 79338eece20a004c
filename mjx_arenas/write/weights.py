"""How hard degrees of freedom and bodies are to move at `qpos0`: `set0` in MuJoCo's `engine_setconst.c`."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.quaternions import cross, quat_to_mat
from mjx_arenas.rows import dot, replace_rows
from mjx_arenas.write.inertia import Factor, Inertia, inertia_of
from mjx_arenas.write.kinematics import BALL, FREE, Kinematics, kinematics
from mjx_arenas.write.trees import Trees

MINVAL = mujoco.mjMINVAL


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
    kin = kinematics(model)
    return weights_of(model, kin, inertia_of(model, kin, roots))


def weights_of(model: mjx.Model, kin: Kinematics, inertia: Inertia) -> Weights:
    """The weights, recomputed for the trees of `inertia`."""
    lone, factors = inertia.lone, inertia.factors
    found = [_dense_weights(model, f) for f in factors] + [_lone_weights(model, kin, lone)]
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
    inverse = (factor.original**2).sum(1)[np.arange(len(dofs))[:, None, None], axes].mean(2)
    body = (dot("gbxdi,ged->gbxie", factor.jacobian, factor.root) ** 2).sum((3, 4)) / 3

    # `mj_setConst` takes a body with nothing but slides along its axes for a point, and ignores armatures.
    point = np.asarray(model.body_simple) == 2
    light = 1 / jnp.maximum(model.body_mass, MINVAL)
    inverse = jnp.where(point[model.dof_bodyid[dofs]], light[model.dof_bodyid[dofs]], inverse)
    as_point = jnp.stack([light, jnp.zeros_like(light)], axis=1)
    body = jnp.where(point[bodies][..., None], as_point[bodies], body)
    return factor.diagonal.reshape(-1), inverse.reshape(-1), body.reshape(-1, 2)


def _lone_weights(model: mjx.Model, kin: Kinematics, trees: Trees) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Rows (6g,), (6g,), (g, 2) of `Weights`, by block elimination of each matrix.

    With mass m, centre of mass c, principal inertia I along the axes P, armatures a of translation and b of rotation,
    and H = R [c]x, the matrix is [[m + a, -m H], [-m H', P I P' + m H'H + b]]. All terms below are positive: no digits
    cancel. As C does, it takes m + a, and the pivots of rotation, for at least `mjMINVAL`.
    """
    body = trees.bodies[:, 0]
    mass, com = model.body_mass[body][:, None], model.body_ipos[body]
    slow, fast = model.dof_armature[trees.dofs].reshape(-1, 2, 3).swapaxes(0, 1)
    inertia, principal = model.body_inertia[body], quat_to_mat(model.body_iquat[body])
    lever = cross(jnp.eye(3)[None], com[:, None])
    arm = _product(_product(quat_to_mat(kin.quat[body]), lever), principal)  # HP or -HP
    turned = (principal**2 * inertia[:, None]).sum(2) + mass * (com[:, [1, 2, 0]] ** 2 + com[:, [2, 0, 1]] ** 2) + fast
    diagonal = jnp.concatenate([mass + slow, turned], axis=1)

    slow = jnp.maximum(slow, MINVAL - mass)
    heavy = mass + slow

    def outer(scale: jax.Array) -> jax.Array:
        return _product(arm.swapaxes(1, 2) * scale[:, None], arm)

    rest = _product(principal.swapaxes(1, 2) * fast[:, None], principal) + outer(mass * slow / heavy)
    inverse = _inverse(jnp.eye(3)[None] * inertia[:, None] + rest)

    def mean(matrix: jax.Array) -> jax.Array:
        return (matrix * inverse).sum((1, 2)) / 3

    light, turn = (1 / heavy).mean(1), jnp.trace(inverse, axis1=1, axis2=2) / 3
    at_origin, at_com = light + mean(outer((mass / heavy) ** 2)), light + mean(outer((slow / heavy) ** 2))
    inverse_diagonal = jnp.stack([at_origin, turn], axis=1).repeat(3, axis=1)
    return diagonal.reshape(-1), inverse_diagonal.reshape(-1), jnp.stack([at_com, turn], axis=1)


def _product(a: jax.Array, b: jax.Array) -> jax.Array:
    """Matrix products (n, 3, 3), fused with what surrounds them."""
    return (a[..., None] * b[:, None]).sum(2)


def _inverse(matrix: jax.Array) -> jax.Array:
    """Inverses of matrices (n, 3, 3), whose pivots, from the last on, are taken for at least `mjMINVAL`."""
    (xx, yx, zx), (_, yy, zy), (_, _, zz) = (tuple(row.T) for row in matrix.swapaxes(0, 1))
    z = jnp.maximum(zz, MINVAL)
    x_of_z, y_of_z = zx / z, zy / z
    y, yx = jnp.maximum(yy - y_of_z * zy, MINVAL), yx - y_of_z * zx
    x_of_y = yx / y
    x = jnp.maximum(xx - x_of_z * zx - x_of_y * yx, MINVAL)
    one, zero = jnp.ones_like(z), jnp.zeros_like(z)
    columns = [[one, -x_of_y, x_of_y * y_of_z - x_of_z], [zero, one, -y_of_z], [zero, zero, one]]
    units = jnp.stack([jnp.stack(column, axis=1) for column in columns], axis=2)
    return _product(units / jnp.stack([x, y, z], axis=1)[:, None], units.swapaxes(1, 2))
