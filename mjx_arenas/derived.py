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
    """Vectors (..., 3) turned by unit quaternions (..., 4)."""
    u = q[..., 1:]
    t = 2 * _cross(u, v)
    return v + q[..., :1] * t + _cross(u, t)


def _cross(u: jax.Array, v: jax.Array) -> jax.Array:
    """Cross products (..., 3); `jnp.cross` moves axes, which costs a GPU a transposition."""
    left, right = (jnp.roll(u, -1, -1), jnp.roll(v, -1, -1)), (jnp.roll(u, 1, -1), jnp.roll(v, 1, -1))
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


class Moving(NamedTuple):
    """What is elsewhere than in a template, so that the rest is computed once for all worlds."""

    bodies: np.ndarray  # (nbody,) bool; with a body, all that hangs on it
    template: mjx.Model
    boxed: dict[str, np.ndarray]  # of "body", "geom", "site": (n,) bool, what lies in the boxes
    low: jax.Array  # (B, 3) boxes that are known already
    high: jax.Array  # (B, 3)


def statistic(
    model: mjx.Model,
    present: jax.Array | None = None,
    moving: Moving | None = None,
    kin: Kinematics | None = None,
) -> Statistic:
    """Statistics at `qpos0`.

    Args:
        model: the model; of derived fields, `geom_rbound` and `dof_M0` are read.
        present: (nbody,) bool, true for what does not move; the other bodies and all that is fixed to them count as if
            the model did not have them. Only `meaninertia` still divides by `nv`: MJX scales costs by its product with
            `nv`, which then is that of the model without them.
        moving: what differs from a template; None: everything.
        kin: of the model, if it is known.
    """
    kin = kin or kinematics(model)
    everything = {
        "body": np.ones(model.nbody, bool),
        "geom": np.ones(model.ngeom, bool),
        "site": np.ones(model.nsite, bool),
    }
    low, high, size, count = jnp.full(3, FAR), jnp.full(3, -FAR), jnp.zeros(()), 0
    if moving is None:
        parts = [(model, kin, everything["body"], everything, present)]
    else:
        rest = moving.template
        unboxed = {kind: ~mask for kind, mask in moving.boxed.items()}
        parts = [
            (rest, kinematics(rest), ~moving.bodies, everything, None),
            (model, kin, moving.bodies, unboxed, present),
        ]
        low, high = (jnp.min(moving.low, 0, initial=FAR), jnp.max(moving.high, 0, initial=-FAR))
    for part, kin, bodies, counted, there in parts:
        part_low, part_high = _bounds(part, kin, bodies, counted, there)
        low, high = jnp.minimum(low, part_low), jnp.maximum(high, part_high)
        ids = np.flatnonzero(bodies[1:]) + 1
        sizes = jnp.maximum(_sizes(part, kin, ids, there), 1e-5)
        size += (sizes if there is None else jnp.where(take(there, ids), sizes, 0.0)).sum()
        count += len(ids) if there is None else take(there, ids).sum()

    def mean(total: jax.Array) -> jax.Array:
        return total / jnp.maximum(count, 1)

    old, masses, inertia = model.stat, model.body_mass[1:], model.dof_M0
    if present is not None:
        masses, inertia = jnp.where(present[1:], masses, 0.0), jnp.where(present[model.dof_bodyid], inertia, 0.0)
    has_bodies = model.nbody > 1
    meansize = mean(size) if has_bodies else old.meansize
    meanmass = mean(masses.sum()) if has_bodies else old.meanmass
    meaninertia = inertia.mean() if model.nv else old.meaninertia
    extent = jnp.where(high[0] > low[0], jnp.maximum((high - low).max(), 1e-5), old.extent)
    return Statistic((low + high) / 2, jnp.maximum(extent, 2 * meansize), meansize, meanmass, meaninertia)


def _bounds(
    model: mjx.Model,
    kin: Kinematics,
    bodies: np.ndarray,
    counted: dict[str, np.ndarray],
    present: jax.Array | None,
) -> tuple[jax.Array, jax.Array]:
    """Lowest and highest corner (3,) of the box around what counts of these bodies and all that is fixed to them."""
    joint_body, site_body, geom_body = (np.asarray(x) for x in (model.jnt_bodyid, model.site_bodyid, model.geom_bodyid))
    body = np.flatnonzero((bodies & counted["body"])[1:]) + 1
    joint = np.flatnonzero(bodies[joint_body] & (np.asarray(model.jnt_type) != FREE))  # a free one is where its body is
    site = np.flatnonzero(bodies[site_body] & counted["site"])
    geom = np.flatnonzero(bodies[geom_body] & counted["geom"])
    owner = np.concatenate([body, joint_body[joint], body, site_body[site], geom_body[geom]])
    if not len(owner):
        return jnp.full(3, FAR), jnp.full(3, -FAR)

    local = jnp.concatenate([take(model.body_ipos, body), take(model.site_pos, site), take(model.geom_pos, geom)])
    on = owner[len(body) + len(joint) :]
    points = jnp.concatenate([take(kin.pos, body), kin.anchor[joint], kin.pos[on] + quat_rotate(kin.quat[on], local)])
    radius = jnp.concatenate([jnp.zeros(len(owner) - len(geom)), take(_drawn_radius(model), geom)])[:, None]
    low, high = points - radius, points + radius
    if present is not None:
        there = present[owner][:, None]
        low, high = jnp.where(there, low, FAR), jnp.where(there, high, -FAR)
    return low.min(0), high.max(0)


def _sizes(model: mjx.Model, kin: Kinematics, ids: np.ndarray, present: jax.Array | None) -> jax.Array:
    """Sizes of bodies (n,): how far they reach, with their geoms, their and their children's joints, from the centre of mass."""
    geom_body, joint_body = np.asarray(model.geom_bodyid), np.asarray(model.jnt_bodyid)
    joint_base = np.asarray(model.body_parentid)[joint_body]
    free = np.asarray(model.jnt_type) == FREE
    solid = np.asarray(model.geom_type) != mujoco.mjtGeom.mjGEOM_PLANE

    geom = np.flatnonzero(np.isin(geom_body, ids) & solid)
    rbound = take(model.geom_rbound, geom)
    off_centre = norm(take(model.geom_pos, geom) - take(model.body_ipos, geom_body[geom]))
    sizes = _segment_max(jnp.where(rbound > 0, rbound + off_centre, 0.0), geom_body[geom], ids)

    joint = np.flatnonzero(np.isin(joint_body, ids) & free)
    if len(joint):
        off_centre = norm(take(model.body_ipos, joint_body[joint]))
        sizes = jnp.maximum(sizes, _segment_max(off_centre, joint_body[joint], ids))
    for end in (joint_body, joint_base):
        joint = np.flatnonzero(np.isin(end, ids) & ~free)
        if len(joint):
            joint = joint[np.argsort(end[joint], kind="stable")]
            body = end[joint]
            com = kin.pos[body] + quat_rotate(kin.quat[body], model.body_ipos[body])
            length = norm(com - kin.anchor[joint])
            if present is not None:
                length = jnp.where(present[joint_body[joint]], length, 0.0)
            sizes = jnp.maximum(sizes, _segment_max(length, body, ids))
    return sizes


def _drawn_radius(model: mjx.Model) -> jax.Array:
    """(ngeom,) `geom_rbound`, or what stands for it where a geom has no bound."""
    size = model.geom_size[:, :2].max(-1)
    plane = np.asarray(model.geom_type) == mujoco.mjtGeom.mjGEOM_PLANE
    return jnp.where(plane, jnp.where(size > 0, 0.1 * size, 0.01), model.geom_rbound)


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
