"""What MuJoCo's compiler derives from the poses at `qpos0`: statistics, and the reference poses of cameras and lights.

The formulas are those of `set0` and `setStat` in MuJoCo's `engine_setconst.c`. A free joint's body stands in `qpos0`
where `body_pos` and `body_quat` say, and no other joint displaces its body there, so the poses at `qpos0` are the
body frames multiplied along the tree.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

MINVAL = mujoco.mjMINVAL


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
    """Lengths (...) of vectors (..., 3), with gradient 0 where the length is 0."""
    return jnp.sqrt((v * v).sum(-1) + 1e-30)


def replace_rows(base: jax.Array, ids: np.ndarray, rows: jax.Array) -> jax.Array:
    """`base` (N, ...) with `rows` (n, ...) at the static row numbers `ids` (n,).

    Concatenates runs of rows: on a GPU many times faster than an indexed update, which XLA makes a scatter.
    """
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


def body_poses(model: mjx.Model) -> tuple[jax.Array, jax.Array]:
    """World positions (nbody, 3) and orientations (nbody, 4) of all bodies at `qpos0`."""
    parent = np.asarray(model.body_parentid)
    depth = np.zeros(len(parent), int)
    for body in range(1, len(parent)):
        depth[body] = depth[parent[body]] + 1
    pos, quat = model.body_pos, model.body_quat
    for level in range(2, depth.max(initial=0) + 1):
        ids = np.flatnonzero(depth == level)
        parent_quat = quat[parent[ids]]
        level_pos = pos[parent[ids]] + quat_rotate(parent_quat, model.body_pos[ids])
        level_quat = quat_mul(parent_quat, model.body_quat[ids])
        pos, quat = replace_rows(pos, ids, level_pos), replace_rows(quat, ids, level_quat)
    return pos, quat


class Statistic(NamedTuple):
    """The statistics that depend on poses and sizes; see `mjx.Statistic`."""

    center: jax.Array  # (3,)
    extent: jax.Array  # ()
    meansize: jax.Array  # ()


def statistic(model: mjx.Model) -> Statistic:
    """Bounding box and mean body size at `qpos0`."""
    pos, quat = body_poses(model)

    def world(body: np.ndarray, local: jax.Array) -> jax.Array:
        return pos[body] + quat_rotate(quat[body], local)

    com = world(np.arange(model.nbody), model.body_ipos)
    geom = world(model.geom_bodyid, model.geom_pos)
    anchor = world(model.jnt_bodyid, model.jnt_pos)
    points = [pos[1:], com[1:], anchor, world(model.site_bodyid, model.site_pos)]
    radius = _drawn_radius(model)[:, None]
    low = jnp.concatenate([*points, geom - radius]).min(0)
    high = jnp.concatenate([*points, geom + radius]).max(0)

    # Size of a body: the farthest reach of its geoms from its centre of mass, or the distance to its and its
    # children's joints.
    bounded = np.asarray(model.geom_type) != mujoco.mjtGeom.mjGEOM_PLANE
    reach = model.geom_rbound + norm(geom - com[model.geom_bodyid])
    owner = [model.geom_bodyid[bounded], model.jnt_bodyid, model.body_parentid[model.jnt_bodyid]]
    lengths = [reach[bounded], *(norm(com[body] - anchor) for body in owner[1:])]
    sizes = _segment_max(jnp.concatenate(lengths), np.concatenate(owner), model.nbody)[1:]
    meansize = jnp.maximum(sizes, 1e-5).mean()
    return Statistic((low + high) / 2, jnp.maximum((high - low).max(), 2 * meansize), meansize)


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


def _subtree_com(model: mjx.Model, pos: jax.Array, quat: jax.Array) -> jax.Array:
    """(nbody, 3) centre of mass of each body's subtree; of a massless one, its own."""
    member = np.eye(model.nbody, dtype=np.float32)  # member[a, b]: b is in a's subtree
    for body in range(model.nbody - 1, 0, -1):
        member[model.body_parentid[body]] += member[body]
    com = pos + quat_rotate(quat, model.body_ipos)
    mass = jnp.asarray(member) @ model.body_mass
    weighted = (jnp.asarray(member)[:, :, None] * (model.body_mass[:, None] * com)).sum(1)
    return jnp.where((mass > MINVAL)[:, None], weighted / jnp.maximum(mass, MINVAL)[:, None], com)
