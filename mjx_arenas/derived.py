"""What MuJoCo's compiler derives from the poses at `qpos0`: statistics, and the reference poses of cameras and lights.

The formulas are those of `mj_kinematics1` in MuJoCo's `engine_core_smooth.c`, and of `set0` and `setStat` in its
`engine_setconst.c`.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

MINVAL = mujoco.mjMINVAL
FREE, BALL, SLIDE, HINGE = (int(mujoco.mjtJoint(kind)) for kind in range(4))
_FAR = 1e10  # [m] where `setStat` starts its bounding box


def quat_mul(u: jax.Array, v: jax.Array) -> jax.Array:
    """Product (..., 4) of quaternions."""
    u0, u1, u2, u3 = (u[..., i] for i in range(4))
    v0, v1, v2, v3 = (v[..., i] for i in range(4))
    return jnp.stack(
        [
            u0 * v0 - u1 * v1 - u2 * v2 - u3 * v3,
            u0 * v1 + u1 * v0 + u2 * v3 - u3 * v2,
            u0 * v2 - u1 * v3 + u2 * v0 + u3 * v1,
            u0 * v3 + u1 * v2 - u2 * v1 + u3 * v0,
        ],
        axis=-1,
    )


def quat_rotate(q: jax.Array, v: jax.Array) -> jax.Array:
    """Vectors (..., 3) turned by unit quaternions (..., 4)."""
    t = 2 * jnp.cross(q[..., 1:], v)
    return v + q[..., :1] * t + jnp.cross(q[..., 1:], t)


def quat_to_mat(q: jax.Array) -> jax.Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = (q[..., i] for i in range(4))
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return jnp.stack([jnp.stack(row, axis=-1) for row in rows], axis=-2)


def norm(v: jax.Array) -> jax.Array:
    """Lengths (...) of vectors (..., n), with gradient 0 where the length is 0."""
    return jnp.sqrt((v * v).sum(-1) + 1e-30)


def normalize(v: jax.Array) -> jax.Array:
    """Vectors or quaternions (..., n), scaled to length 1."""
    return v / norm(v)[..., None]


def replace_rows(base: jax.Array, ids: np.ndarray, rows: jax.Array) -> jax.Array:
    """`base` (N, ...) with `rows` (n, ...) at the static row numbers `ids` (n,).

    Concatenates runs of rows: on a GPU many times faster than an indexed update, which XLA makes a scatter.
    """
    if not len(ids):
        return base
    order = np.argsort(ids)
    ids, pieces, end = np.asarray(ids)[order], [], 0
    breaks = np.flatnonzero(np.diff(ids) != 1) + 1
    if np.any(order != np.arange(len(order))):
        rows = rows[order]
    for run in np.split(np.arange(len(ids)), breaks):
        if not len(run):
            continue
        first, last = ids[run[0]], ids[run[-1]] + 1
        pieces += [base[end:first], rows[run[0] : run[-1] + 1].astype(base.dtype)]
        end = last
    return jnp.concatenate([p for p in (*pieces, base[end:]) if p.shape[0]])


class Kinematics(NamedTuple):
    """World poses of bodies and joints."""

    pos: jax.Array  # (nbody, 3)
    quat: jax.Array  # (nbody, 4)
    anchor: jax.Array  # (njnt, 3)
    axis: jax.Array  # (njnt, 3) unit vectors; without meaning for free and ball joints


def kinematics(model: mjx.Model) -> Kinematics:
    """World poses at `qpos0`, where no hinge and no slide displaces its body."""
    # First everything in the frame of the body's parent. Slides that stand before a ball joint do not turn with it.
    kinds, joint_body, adr = (np.asarray(a) for a in (model.jnt_type, model.jnt_bodyid, model.jnt_qposadr))
    free, ball = np.flatnonzero(kinds == FREE), np.flatnonzero(kinds == BALL)
    pos, quat = model.body_pos, model.body_quat
    anchor = pos[joint_body] + quat_rotate(quat[joint_body], model.jnt_pos)
    axis = quat_rotate(quat[joint_body], model.jnt_axis)
    if len(free):
        pose = model.qpos0[adr[free][:, None] + np.arange(7)]
        pos = replace_rows(pos, joint_body[free], pose[:, :3])
        quat = replace_rows(quat, joint_body[free], normalize(pose[:, 3:]))
        anchor = replace_rows(anchor, free, pose[:, :3])
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


class Statistic(NamedTuple):
    """The fields of `mjx.Statistic`."""

    center: jax.Array  # (3,) [m] of the box around everything
    extent: jax.Array  # () [m] its longest side
    meansize: jax.Array  # () [m] of bodies
    meanmass: jax.Array  # () [kg] of bodies
    meaninertia: jax.Array  # () of degrees of freedom


def statistic(model: mjx.Model, present: jax.Array | None = None) -> Statistic:
    """Statistics at `qpos0`.

    Args:
        model: the model; of derived fields, `geom_rbound` and `dof_M0` are read.
        present: (nbody,) bool, true for the world; the other bodies and all that is fixed to them count as if the
            model did not have them. Only `meaninertia` still divides by `nv`: MJX scales costs by its product with
            `nv`, which then is that of the model without them.
    """
    pos, quat, anchor, _ = kinematics(model)

    def world(body: np.ndarray, local: jax.Array) -> jax.Array:
        return pos[body] + quat_rotate(quat[body], local)

    bodies = np.arange(1, model.nbody)
    com = world(np.arange(model.nbody), model.body_ipos)
    geom = world(model.geom_bodyid, model.geom_pos)
    site = world(model.site_bodyid, model.site_pos)
    points = jnp.concatenate([pos[1:], com[1:], anchor, site])
    radius = _drawn_radius(model)[:, None]
    low, high = jnp.concatenate([points, geom - radius]), jnp.concatenate([points, geom + radius])
    if present is not None:
        owner = np.concatenate([bodies, bodies, model.jnt_bodyid, model.site_bodyid, model.geom_bodyid])
        low = jnp.where(present[owner][:, None], low, _FAR)
        high = jnp.where(present[owner][:, None], high, -_FAR)
    low, high = low.min(0, initial=_FAR), high.max(0, initial=-_FAR)

    # Size of a body: the farthest reach of its geoms from its centre of mass, or the distance to its and its
    # children's joints.
    bounded = np.asarray(model.geom_type) != mujoco.mjtGeom.mjGEOM_PLANE
    reach = jnp.where(model.geom_rbound > 0, model.geom_rbound + norm(geom - com[model.geom_bodyid]), 0.0)
    joint_body = np.asarray(model.jnt_bodyid)
    joint_base = np.asarray(model.body_parentid)[joint_body]
    from_base = norm(com[joint_base] - anchor)
    if present is not None:
        from_base = jnp.where(present[joint_body], from_base, 0.0)
    lengths = jnp.concatenate([reach[bounded], norm(com[joint_body] - anchor), from_base])
    owner = np.concatenate([model.geom_bodyid[bounded], joint_body, joint_base])
    sizes = jnp.maximum(_segment_max(lengths, owner, model.nbody)[1:], 1e-5)

    def mean(values: jax.Array) -> jax.Array:
        if present is None:
            return values.mean()
        return jnp.where(present[1:], values, 0.0).sum() / jnp.maximum(present[1:].sum(), 1)

    old = model.stat
    meansize = mean(sizes) if len(bodies) else old.meansize
    meanmass = mean(model.body_mass[1:]) if len(bodies) else old.meanmass
    inertia = model.dof_M0 if present is None else jnp.where(present[model.dof_bodyid], model.dof_M0, 0.0)
    meaninertia = inertia.mean() if model.nv else old.meaninertia
    extent = jnp.where(high[0] > low[0], jnp.maximum((high - low).max(), 1e-5), old.extent)
    return Statistic((low + high) / 2, jnp.maximum(extent, 2 * meansize), meansize, meanmass, meaninertia)


def _drawn_radius(model: mjx.Model) -> jax.Array:
    """(ngeom,) `geom_rbound`, or what stands for it where a geom has no bound."""
    size = model.geom_size[:, :2].max(-1)
    plane = np.asarray(model.geom_type) == mujoco.mjtGeom.mjGEOM_PLANE
    return jnp.where(plane, jnp.where(size > 0, 0.1 * size, 0.01), model.geom_rbound)


def _segment_max(values: jax.Array, owner: np.ndarray, n: int) -> jax.Array:
    """(n,) largest of the values (>= 0) of each owner, 0 where it has none; static owners, so no scatter."""
    width = max(np.bincount(owner, minlength=n).max(initial=0), 1)
    slots = np.full((n, width), len(values))
    fill = np.zeros(n, int)
    for value, body in enumerate(owner):
        slots[body, fill[body]] = value
        fill[body] += 1
    return jnp.append(values, 0.0)[slots].max(-1)


class References(NamedTuple):
    """Poses of cameras or lights at `qpos0`, in world axes."""

    pos0: jax.Array  # (n, 3) relative to the body
    poscom0: jax.Array  # (n, 3) relative to the centre of mass of the body's, or the target's, subtree


def references(model: mjx.Model, body: np.ndarray, target: np.ndarray, local_pos: jax.Array) -> References:
    """Reference positions of cameras or lights on `body` (n,), aimed at `target` (n,) or -1."""
    pos, quat = body_poses(model)
    offset = quat_rotate(quat[body], local_pos)
    com = _subtree_com(model, pos, quat)
    return References(offset, pos[body] + offset - com[np.where(target >= 0, target, body)])


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


def _subtree_com(model: mjx.Model, pos: jax.Array, quat: jax.Array) -> jax.Array:
    """(nbody, 3) centre of mass of each body's subtree; of a massless one, its own."""
    com = pos + quat_rotate(quat, model.body_ipos)
    mass = subtree_mass(model)
    weighted = jnp.where(subtrees(model)[:, :, None], model.body_mass[:, None] * com, 0.0).sum(1)
    return jnp.where((mass > MINVAL)[:, None], weighted / jnp.maximum(mass, MINVAL)[:, None], com)
