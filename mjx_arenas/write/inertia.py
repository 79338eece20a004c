"""The inertia matrix at `qpos0`, factored: `mj_makeM` and `mj_factorM` in MuJoCo's `engine_core_smooth.c`."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from mujoco import mjx

from mjx_arenas.write.motion import Motion
from mjx_arenas.write.rows import dot
from mjx_arenas.write.tendons import Tendons
from mjx_arenas.write.trees import Trees


class Factor(NamedTuple):
    """The inertia matrices M of some trees, factored; d, e count their degrees of freedom, g the trees."""

    trees: Trees
    diagonal: jax.Array  # (g, d) of M, without the armature of tendons
    root: jax.Array  # (g, e, d) W with W'W = inverse of M
    jacobian: jax.Array  # (g, bodies, 2, d, 3) of the centres of mass and of rotation

    def half_solve(self, rows: jax.Array) -> jax.Array:
        """`rows` (k, nv) times W' (k, g, e): squared, they are in the metric of M's inverse."""
        return dot("kgd,ged->kge", rows[:, self.trees.dofs], self.root)

    def solve(self, rows: jax.Array) -> jax.Array:
        """`rows` (k, nv) times the inverse of M (k, g, d)."""
        return dot("kge,ged->kgd", self.half_solve(rows), self.root)


def factored(model: mjx.Model, state: Motion, tendon: Tendons, trees: Trees) -> Factor:
    """The inertia matrices of `trees`, and how their bodies move."""
    bodies, dofs = trees
    com = state.place(bodies, model.body_ipos[bodies])
    lin, ang = state.jacobian(bodies, com, dofs[:, None])
    spin = dot("gbdi,gbij->gbdj", ang, state.frame(bodies, model.body_iquat[bodies]))  # along the principal axes
    mass, inertia = model.body_mass[bodies], model.body_inertia[bodies]
    matrix = dot("gbdi,gbei->gde", lin * mass[..., None, None], lin)
    matrix += dot("gbdi,gbei->gde", spin * inertia[:, :, None], spin)
    matrix += jnp.eye(dofs.shape[1]) * model.dof_armature[dofs][:, None]
    diagonal = jnp.diagonal(matrix, axis1=1, axis2=2)
    if model.ntendon:
        # The matrix of C has no place for a coupling of two branches: it is dropped.
        above = state.moved[model.dof_bodyid[dofs][:, :, None], dofs[:, None]]
        moment = tendon.moment[:, dofs]
        reflected = dot("tgd,tge->gde", moment * model.tendon_armature[:, None, None], moment)
        matrix += jnp.where(above | above.swapaxes(1, 2), reflected, 0.0)
    lower = jnp.linalg.cholesky(matrix)
    identity = jnp.broadcast_to(jnp.eye(dofs.shape[1], dtype=lower.dtype), lower.shape)
    root = jax.scipy.linalg.solve_triangular(lower, identity, lower=True)
    return Factor(trees, diagonal, root, jnp.stack([lin, ang], axis=2))
