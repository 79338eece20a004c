"""The inertia matrix at `qpos0`, factored: `mj_makeM` and `mj_factorM` in MuJoCo's `engine_core_smooth.c`."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.quaternions import conjugate, quat_rotate
from mjx_arenas.rows import dot, take
from mjx_arenas.write.centres import centred
from mjx_arenas.write.kinematics import FREE, Kinematics
from mjx_arenas.write.motion import Motion, motion
from mjx_arenas.write.tendons import Tendons, tendons
from mjx_arenas.write.trees import Trees, trees_of

MINVAL = mujoco.mjMINVAL
_UNROLLED = 12  # degrees of freedom: a GPU waits for the host, and copies, in each round of a loop
_ROUNDINGS = 8  # relative error of a number on its way into the factor, for one degree of freedom


class Factor(NamedTuple):
    """The inertia matrices M of some trees, factored; d, e count their degrees of freedom, g the trees."""

    trees: Trees
    diagonal: jax.Array  # (g, d) of the original M, without the armature of tendons
    root: jax.Array  # (g, e, d) W with W'W = inverse of the central M
    original: jax.Array  # (g, e, d) the same of the original M; its rows belong to those of `root`
    jacobian: jax.Array  # (g, bodies, 2, d, 3) of the centres of mass and of rotation, central

    def half_solve(self, rows: jax.Array) -> jax.Array:
        """Central `rows` (k, nv) times W' (k, g, e): squared, they are in the metric of M's inverse."""
        part = take(rows, self.trees.dofs, axis=1)
        half = dot("kgd,ged->kge", part, self.root)
        return jnp.where((part != 0).any(-1, keepdims=True), half, 0.0)  # whatever is wrong with other trees

    def solve(self, rows: jax.Array) -> jax.Array:
        """Original accelerations (k, g, d) that forces along central `rows` (k, nv) make."""
        half = self.half_solve(rows)
        return jnp.where((half != 0).any(-1, keepdims=True), dot("kge,ged->kgd", half, self.original), 0.0)


class Inertia(NamedTuple):
    """The trees of a model, and how they move."""

    model: mjx.Model  # with centred trees
    state: Motion
    tendon: Tendons
    lone: Trees  # lone free bodies that no tendon and no actuator moves
    factors: list[Factor]  # of all other trees


def inertia_of(model: mjx.Model, kin: Kinematics, roots: np.ndarray | None) -> Inertia:
    """The inertia of the trees with these first bodies, or of all, in the poses `kin`."""
    lone, groups = trees_of(model, roots)
    first = np.concatenate([trees.bodies[:, 0] for trees in groups] or [np.zeros(0, int)])
    near = centred(model, kin, first)
    state = motion(near)
    tendon = tendons(near.model, state)
    return Inertia(near.model, state, tendon, lone, [factored(near.model, state, tendon, trees) for trees in groups])


def reflected(inertia: Inertia) -> jax.Array:
    """(nv,) what the armatures of tendons add to the diagonal of the original inertia matrix."""
    moment = inertia.state.original(inertia.tendon.moment)
    return (inertia.model.tendon_armature[:, None] * moment**2).sum(0)


def factored(model: mjx.Model, state: Motion, tendon: Tendons, trees: Trees) -> Factor:
    """The inertia matrices of `trees`, and how their bodies move."""
    bodies, dofs = trees
    count, n = dofs.shape
    com = state.place(bodies, take(model.body_ipos, bodies))
    lin, ang = state.jacobian(bodies, com, dofs[:, None])
    spin = dot("gbdi,gbij->gbdj", ang, state.frame(bodies, take(model.body_iquat, bodies)))  # along the principal axes
    mass, inertia = take(model.body_mass, bodies)[..., None], take(model.body_inertia, bodies)
    armature = take(model.dof_armature, dofs)

    original = jnp.broadcast_to(jnp.eye(n, dtype=lin.dtype), (count, n, n))  # original velocities by central ones
    square = (lin**2).sum(3)  # of original velocities
    if n >= 6 and (model.jnt_type[model.dof_jntid[dofs[:, 0]]] == FREE).all():
        original = original.at[:, :3].add(-state.shift[dofs].swapaxes(1, 2))
        root = bodies[:, :1]
        lever = quat_rotate(conjugate(state.quat[root]), com) + state.centre[root]  # in the frame of the root
        square = square.at[:, :, 3:6].set(lever[..., [1, 2, 0]] ** 2 + lever[..., [2, 0, 1]] ** 2)
    columns = jnp.concatenate([lin, spin], axis=3).swapaxes(1, 2).reshape(count, n, -1)
    weights = jnp.concatenate([mass.repeat(3, axis=2), inertia], axis=2).reshape(count, -1)
    columns = jnp.concatenate([columns, original.swapaxes(1, 2)], axis=2)
    weights = jnp.concatenate([weights, armature], axis=1)
    columns, pivot = _orthogonal(columns, weights, _coupling(model, state, tendon, trees))
    roots = columns / jnp.sqrt(pivot)[..., None]

    diagonal = (mass * square).sum(1) + (inertia[:, :, None] * spin**2).sum((1, 3)) + armature
    return Factor(trees, diagonal, roots[..., -n:], roots[..., -2 * n : -n], jnp.stack([lin, ang], axis=2))


def _coupling(model: mjx.Model, state: Motion, tendon: Tendons, trees: Trees) -> jax.Array | None:
    """(g, d, d) what the armatures of tendons add to the inertia matrices."""
    if not model.ntendon:
        return None
    dofs = trees.dofs
    # The matrix of C has no place for a coupling of two branches: it is dropped.
    above = state.moved[model.dof_bodyid[dofs][:, :, None], dofs[:, None]]
    moment = tendon.moment[:, dofs]
    reflected = dot("tgd,tge->gde", moment * model.tendon_armature[:, None, None], moment)
    return jnp.where(above | above.swapaxes(1, 2), reflected, 0.0)


def _orthogonal(columns: jax.Array, weights: jax.Array, coupling: jax.Array | None) -> tuple[jax.Array, jax.Array]:
    """B'[R' 1] (g, d, n + d) and the diagonals (g, d) of D = B'MB, where the inverse of M is B inv(D) B'.

    M is R'WR with the columns of R (g, d, n) and its rows' diagonal `weights` W (g, n), plus `coupling`. It is never made: the
    columns of R and of 1 are orthogonalized from the last degree of freedom on, as C eliminates them. That loses half
    the digits that elimination would. As in C, D is at least `mjMINVAL`; where nothing but rounding is left of a column,
    that is taken for zero.
    """
    d = columns.shape[1]
    noise = (_ROUNDINGS * jnp.finfo(columns.dtype).eps) ** 2 * d * (weights[:, None] * columns**2).sum(2)
    unit = jnp.broadcast_to(jnp.eye(d, dtype=columns.dtype), (len(columns), d, d))
    columns, weights = jnp.concatenate([columns, unit], axis=2), jnp.pad(weights, ((0, 0), (0, d)))

    def eliminate(columns: jax.Array, k: jax.Array) -> tuple[jax.Array, jax.Array]:
        column = jax.lax.dynamic_index_in_dim(columns, k, axis=1)
        products = (weights[:, None] * column * columns).sum(2)
        if coupling is not None:
            products += dot("gi,gij,gdj->gd", column[:, 0, -d:], coupling, columns[..., -d:])
        pivot = jax.lax.dynamic_index_in_dim(products, k, axis=1)
        least = jnp.maximum(jax.lax.dynamic_index_in_dim(noise, k, axis=1), MINVAL)
        regular = ~(pivot <= least)  # what is no number, stays none
        share = jnp.where(regular & (jnp.arange(d)[None] < k), products / jnp.where(regular, pivot, 1.0), 0.0)
        return columns - share[..., None] * column, jnp.where(regular, pivot, MINVAL).squeeze(1)

    columns, pivots = jax.lax.scan(eliminate, columns, jnp.arange(d), reverse=True, unroll=max(1, min(d, _UNROLLED)))
    return columns, pivots.T
