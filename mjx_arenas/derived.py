"""What MuJoCo's compiler derives from the poses at `qpos0`: statistics, and the reference poses of cameras and lights.

The formulas are those of `mj_kinematics1` in MuJoCo's `engine_core_smooth.c`, and of `set0` and `setStat` in its
`engine_setconst.c`.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.geometry import array_module

MINVAL = mujoco.mjMINVAL
FREE, BALL, SLIDE, HINGE = (int(mujoco.mjtJoint(kind)) for kind in range(4))
FAR = 1e10  # [m] where `setStat` starts its bounding box


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
    """Vectors (..., 3) turned by unit quaternions (..., 4); NumPy or JAX."""
    u = q[..., 1:]
    t = 2 * _cross(u, v)
    return v + q[..., :1] * t + _cross(u, t)


def _cross(u: jax.Array, v: jax.Array) -> jax.Array:
    """Cross products (..., 3); `jnp.cross` moves axes, which costs a GPU a transposition."""
    roll = array_module(u, v).roll
    left, right = (roll(u, -1, -1), roll(v, -1, -1)), (roll(u, 1, -1), roll(v, 1, -1))
    return left[0] * right[1] - right[0] * left[1]


def quat_to_mat_rows(q: jax.Array) -> list[list[jax.Array]]:
    """The nine entries (...), by rows, of the rotation matrices of unit quaternions (..., 4)."""
    w, x, y, z = (q[..., i] for i in range(4))
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def quat_to_mat(q: jax.Array) -> jax.Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    return jnp.stack([jnp.stack(row, axis=-1) for row in quat_to_mat_rows(q)], axis=-2)


def norm(v: jax.Array) -> jax.Array:
    """Lengths (...) of vectors (..., n), with gradient 0 where the length is 0."""
    return jnp.sqrt(sum((v[..., i] ** 2 for i in range(v.shape[-1])), jnp.float32(1e-30)))


def normalize(v: jax.Array) -> jax.Array:
    """Vectors or quaternions (..., n), scaled to length 1."""
    return v / norm(v)[..., None]


def take(rows: jax.Array, ids: np.ndarray) -> jax.Array:
    """`rows[ids]` for static row numbers; no gather where they are in a row."""
    if not len(ids) or np.any(np.diff(ids) != 1):
        return rows[ids]
    return rows if len(ids) == rows.shape[0] else rows[ids[0] : ids[-1] + 1]


def replace_rows(base: jax.Array, ids: np.ndarray, rows: jax.Array) -> jax.Array:
    """`base` (N, ...) with `rows` (n, ...) at the static row numbers `ids` (n,).

    Each row of the result looks its source up: on a GPU twice as fast as concatenating runs of rows, and many times as
    fast as an indexed update, which XLA makes a scatter (benchmarks/README.md).
    """
    if not len(ids):
        return base
    source, here = np.zeros(base.shape[0], int), np.zeros(base.shape[0], bool)
    source[ids], here[ids] = np.arange(len(ids)), True
    new = rows.astype(base.dtype).at[source].get(mode="promise_in_bounds")
    return jnp.where(here.reshape(-1, *(1,) * (base.ndim - 1)), new, base)


class Kinematics(NamedTuple):
    """World poses of bodies and joints."""

    pos: jax.Array  # (nbody, 3)
    quat: jax.Array  # (nbody, 4)
    anchor: jax.Array  # (njnt, 3)
    axis: jax.Array  # (njnt, 3) unit vectors; without meaning for free and ball joints


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


class Statistic(NamedTuple):
    """The fields of `mjx.Statistic`."""

    center: jax.Array  # (3,) [m] of the box around everything
    extent: jax.Array  # () [m] its longest side
    meansize: jax.Array  # () [m] of bodies
    meanmass: jax.Array  # () [kg] of bodies
    meaninertia: jax.Array  # () of degrees of freedom


def statistic(model: mjx.Model) -> Statistic:
    """Statistics at `qpos0`; of derived fields, `geom_rbound` and `dof_M0` are read."""
    kin, rows = kinematics(model), Rows.of(model, np.ones(model.nbody, bool))
    bodies = np.arange(1, model.nbody)
    reach = sizes(model, kin, rows, bodies)
    old = model.stat
    meaninertia = model.dof_M0.mean() if model.nv else old.meaninertia
    if not len(bodies):
        return Statistic(old.center, old.extent, old.meansize, old.meanmass, meaninertia)
    low, high = bounds(model, kin, rows)
    return combine(low, high, reach.mean(), model.body_mass[1:].mean(), meaninertia)


def combine(
    low: jax.Array, high: jax.Array, meansize: jax.Array, meanmass: jax.Array, meaninertia: jax.Array
) -> Statistic:
    """Statistics of what is within two corners (3,)."""
    extent = jnp.maximum((high - low).max(), jnp.maximum(2 * meansize, 1e-5))
    return Statistic((low + high) / 2, extent, meansize, meanmass, meaninertia)


class Rows(NamedTuple):
    """Ids of elements, static."""

    body: np.ndarray  # by their origins
    com: np.ndarray  # bodies by their centres of mass
    joint: np.ndarray
    site: np.ndarray
    geom: np.ndarray

    @classmethod
    def of(cls, model: mjx.Model | mujoco.MjModel, bodies: np.ndarray) -> "Rows":
        """Everything on some `bodies` (nbody,) bool; free joints are where their bodies are."""
        body = np.flatnonzero(bodies[1:]) + 1
        joint = np.flatnonzero(bodies[model.jnt_bodyid] & (np.asarray(model.jnt_type) != FREE))
        site, geom = np.flatnonzero(bodies[model.site_bodyid]), np.flatnonzero(bodies[model.geom_bodyid])
        return cls(body, body, joint, site, geom)


def bounds(
    model: mjx.Model, kin: Kinematics, rows: Rows, present: jax.Array | None = None
) -> tuple[jax.Array, jax.Array]:
    """Lowest and highest corner (3,) of the box around points and the spheres around geoms; `present` (nbody,) bool."""
    joint_body, site_body, geom_body = (np.asarray(x) for x in (model.jnt_bodyid, model.site_bodyid, model.geom_bodyid))
    on = np.concatenate([rows.com, site_body[rows.site], geom_body[rows.geom]])
    if not len(on) + len(rows.body) + len(rows.joint):
        return jnp.full(3, FAR), jnp.full(3, -FAR)
    local = (take(model.body_ipos, rows.com), take(model.site_pos, rows.site), take(model.geom_pos, rows.geom))
    turned = kin.pos[on] + quat_rotate(kin.quat[on], jnp.concatenate(local))
    points = jnp.concatenate([take(kin.pos, rows.body), take(kin.anchor, rows.joint), turned])
    radius = jnp.concatenate([jnp.zeros(len(points) - len(rows.geom)), _drawn_radius(model, rows.geom)])[:, None]
    low, high = points - radius, points + radius
    if present is not None:
        there = present[np.concatenate([rows.body, joint_body[rows.joint], on])][:, None]
        low, high = jnp.where(there, low, FAR), jnp.where(there, high, -FAR)
    return low.min(0), high.max(0)


def sizes(
    model: mjx.Model, kin: Kinematics, rows: Rows, bodies: np.ndarray, present: jax.Array | None = None
) -> jax.Array:
    """(n,) how far `bodies` (n,) reach from their centres of mass: to their geoms, and their and their children's joints.

    Of the `rows`, those that are on the bodies count.
    """
    geom_body, joint_body = np.asarray(model.geom_bodyid), np.asarray(model.jnt_bodyid)
    joint_base = np.asarray(model.body_parentid)[joint_body]
    solid = np.asarray(model.geom_type) != mujoco.mjtGeom.mjGEOM_PLANE

    reach = jnp.full(len(bodies), 1e-5)
    geom = rows.geom[solid[rows.geom] & np.isin(geom_body[rows.geom], bodies)]
    if len(geom):
        rbound = take(model.geom_rbound, geom)
        off_centre = norm(take(model.geom_pos, geom) - take(model.body_ipos, geom_body[geom]))
        reach = jnp.maximum(
            reach, _segment_max(jnp.where(rbound > 0, rbound + off_centre, 0.0), geom_body[geom], bodies)
        )
    free = np.flatnonzero(np.isin(joint_body, np.intersect1d(rows.com, bodies)) & (np.asarray(model.jnt_type) == FREE))
    if len(free):
        off_centre = norm(take(model.body_ipos, joint_body[free]))
        reach = jnp.maximum(reach, _segment_max(off_centre, joint_body[free], bodies))
    for end in (joint_body, joint_base):
        joint = rows.joint[np.isin(end[rows.joint], bodies)]
        if len(joint):
            joint = joint[np.argsort(end[joint], kind="stable")]
            body = end[joint]
            com = kin.pos[body] + quat_rotate(kin.quat[body], model.body_ipos[body])
            length = norm(com - kin.anchor[joint])
            if present is not None:
                length = jnp.where(present[joint_body[joint]], length, 0.0)
            reach = jnp.maximum(reach, _segment_max(length, body, bodies))
    return reach


def _drawn_radius(model: mjx.Model, geom: np.ndarray) -> jax.Array:
    """`geom_rbound` of some geoms (n,), or what stands for it where a geom has no bound."""
    radius, plane = take(model.geom_rbound, geom), np.asarray(model.geom_type)[geom] == mujoco.mjtGeom.mjGEOM_PLANE
    if not plane.any():
        return radius
    size = jnp.maximum(model.geom_size[geom, 0], model.geom_size[geom, 1])
    return jnp.where(plane, jnp.where(size > 0, 0.1 * size, 0.01), radius)


def _segment_max(values: jax.Array, owner: np.ndarray, ids: np.ndarray) -> jax.Array:
    """(n,) the largest of each owner's values (>= 0), 0 where it has none; `owner` is sorted and static."""
    counts = np.array([np.count_nonzero(owner == i) for i in ids], int)
    out, begin = [], 0
    for run in np.split(counts, np.flatnonzero(np.diff(counts)) + 1):
        if len(run):
            rows = values[begin : begin + run.sum()].reshape(len(run), run[0])
            columns = [rows[:, i] for i in range(run[0])]
            out.append(functools.reduce(jnp.maximum, columns) if columns else jnp.zeros(len(run), values.dtype))
            begin += run.sum()
    return jnp.concatenate(out) if out else jnp.zeros(0, values.dtype)


class References(NamedTuple):
    """Poses of cameras or lights at `qpos0`, in world axes."""

    pos0: jax.Array  # (n, 3) relative to the body
    poscom0: jax.Array  # (n, 3) relative to the centre of mass of the body's, or the target's, subtree


def references(kin: Kinematics, body: np.ndarray, local_pos: jax.Array, com: jax.Array) -> References:
    """Reference positions of cameras or lights on `body` (n,), before the `subtree_com` (n, 3) that they refer to."""
    offset = quat_rotate(kin.quat[body], local_pos)
    return References(offset, kin.pos[body] + offset - com)


class Heavy(NamedTuple):
    """The bodies that have mass."""

    ids: np.ndarray
    centred: bool  # their centres of mass are their origins


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


def subtree_com(model: mjx.Model, kin: Kinematics, bodies: np.ndarray, heavy: Heavy | None = None) -> jax.Array:
    """(n, 3) centre of mass of the subtrees of `bodies` (n,); of a massless one, the body's own.

    `heavy`: what has mass, if that is known; None: anything may.
    """
    heavy = heavy or Heavy(np.arange(model.nbody), False)
    asked, bodies = bodies, np.unique(bodies)

    def own(ids: np.ndarray) -> jax.Array:
        return kin.pos[ids] + quat_rotate(kin.quat[ids], model.body_ipos[ids])

    masses, com = take(model.body_mass, heavy.ids), take(kin.pos, heavy.ids) if heavy.centred else own(heavy.ids)
    members = subtrees(model)[bodies][:, heavy.ids]
    mass = jnp.where(members, masses, 0.0).sum(1)
    weighted = jnp.where(members[:, :, None], masses[:, None] * com, 0.0).sum(1)
    com = jnp.where((mass > MINVAL)[:, None], weighted / jnp.maximum(mass, MINVAL)[:, None], own(bodies))
    return com[np.searchsorted(bodies, asked)]
