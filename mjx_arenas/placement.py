"""Objects onto table tops: inside the edges, apart from each other, touching.

A footprint is a rectangle with rounded corners: half sides and a radius, so that a box, a sphere and a lying capsule
are all exact. K objects; one world at a time.
"""

import zlib
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.layout import Layout
from mjx_arenas.objects import Object
from mjx_arenas.params import ArenaParams, canonical

TRIES = 32  # places tried for each object


class Placement(NamedTuple):
    """Where objects start."""

    qpos: jax.Array  # (K, 7) world position [m] and orientation
    valid: jax.Array  # (K,) bool: found a free place; an object that did not starts above the others, touching nothing


class Footprints(NamedTuple):
    """Rectangles with rounded corners."""

    half: np.ndarray  # (K, 2) half sides of the rectangle [m]
    radius: np.ndarray  # (K,) of its rounding [m]


def footprints(objects: Sequence[Object]) -> Footprints:
    """Footprints of objects on a table."""
    half = np.array([o.half_size[:2] for o in objects], float).reshape(-1, 2)
    radius = np.array([0.0 if o.type == "box" else o.half_size[2] for o in objects])
    return Footprints(half - radius[:, None], radius)


class _Solids(NamedTuple):
    """Upright prisms over footprints, in the world."""

    pose: jax.Array  # (n, 3) x, y [m], yaw [rad]
    half: jax.Array  # (n, 2)
    radius: jax.Array  # (n,)
    bottom: jax.Array  # (n,) z [m]
    top: jax.Array  # (n,)


def place(key: jax.Array, layout: Layout, prints: Footprints, params: ArenaParams) -> Placement:
    """Draws a place and a yaw for each object, in order, from `TRIES` candidates each; the first free one is taken.

    Free is what lies inside the table's edges and touches neither an object that was placed before nor another table's
    slab.
    """
    params = canonical(params)
    table = np.asarray(layout.object_table)
    offset, rot = params.table_offsets[table], params.table_rots[table]
    table_half = params.table_full_sizes[table, :2] / 2
    half, radius, rest = (jnp.asarray(a, offset.dtype) for a in (*prints, layout.object_half_size[:, 2]))
    slabs, n, n_tables = _slabs(params), len(table), len(params.table_rots)
    if n == 0:
        return Placement(jnp.zeros((0, 7)), jnp.zeros(0, bool))
    key = jax.random.fold_in(key, zlib.crc32(b"place"))  # apart from what else splits the world's key
    objects = _Solids(jnp.zeros((n, 3)), half, radius, offset[:, 2], offset[:, 2] + 2 * rest)

    def one(pose: jax.Array, k: jax.Array) -> tuple[jax.Array, tuple[jax.Array, jax.Array]]:
        draw = jax.random.uniform(jax.random.fold_in(key, k), (TRIES, 3), minval=-1.0)
        yaw = jnp.pi * draw[:, 2]
        c, s = jnp.abs(jnp.cos(yaw))[:, None], jnp.abs(jnp.sin(yaw))[:, None]
        room = table_half[k] - _spread(c, s, half[k]) - radius[k]  # of the centre, to either side
        xy = offset[k, :2] + geometry.rotate_yaw(rot[k], draw[:, :2] * jnp.maximum(room, 0.0))
        candidates = jnp.concatenate([xy, (rot[k] + yaw)[:, None]], axis=-1)

        solids = _Solids(*map(jnp.concatenate, zip(objects._replace(pose=pose), slabs, strict=True)))
        there = jnp.concatenate([jnp.arange(n) < k, jnp.arange(n_tables) != jnp.asarray(table)[k]])
        level = there & (objects.top[k] > solids.bottom) & (objects.bottom[k] < solids.top)
        gap = jax.vmap(lambda candidate: _gap(candidate, half[k], solids.pose, solids.half))(candidates)
        free = jnp.all((gap > radius[k] + solids.radius) | ~level, axis=-1) & jnp.all(room >= 0, axis=-1)
        first = jnp.argmax(free)
        return pose.at[k].set(candidates[first]), (candidates[first], free[first])

    _, (pose, valid) = jax.lax.scan(one, objects.pose, jnp.arange(n))
    # An object without a free place starts above all tables and all that stands on them, one over the other.
    ceiling = params.table_offsets[:, 2].max() + 2 * rest.max(initial=0.0)
    z = jnp.where(valid, offset[:, 2] + rest, ceiling + jnp.cumsum(jnp.where(valid, 0.0, 2 * rest)) - rest)
    return Placement(jnp.concatenate([pose[:, :2], z[:, None], geometry.yaw_quat(pose[:, 2])], axis=-1), valid)


def _slabs(params: ArenaParams) -> _Solids:
    """The table tops (T,)."""
    pose = jnp.concatenate([params.table_offsets[:, :2], params.table_rots[:, None]], axis=-1)
    top, thickness = params.table_offsets[:, 2], params.table_full_sizes[:, 2]
    return _Solids(pose, params.table_full_sizes[:, :2] / 2, jnp.zeros_like(top), top - thickness, top)


def _gap(pose: jax.Array, half: jax.Array, poses: jax.Array, halves: jax.Array) -> jax.Array:
    """Gaps (K,) between a rectangle and others along the best of their sides' axes; never more than the distance.

    Args:
        pose: (3,) x, y, yaw.
        half: (2,) half sides.
        poses: (K, 3) of the others.
        halves: (K, 2) of the others.
    """
    delta, turn = poses[:, :2] - pose[:2], poses[:, 2] - pose[2]
    c, s = jnp.abs(jnp.cos(turn))[:, None], jnp.abs(jnp.sin(turn))[:, None]
    own = jnp.abs(geometry.rotate_yaw(-pose[2], delta)) - half - _spread(c, s, halves)
    other = jnp.abs(geometry.rotate_yaw(-poses[:, 2], delta)) - halves - _spread(c, s, half)
    return jnp.maximum(own, other).max(-1)


def _spread(c: jax.Array, s: jax.Array, half: jax.Array) -> jax.Array:
    """Half extents (n, 2) of rectangles along axes turned by angles of |cosine| c (n, 1) and |sine| s (n, 1)."""
    return c * half + s * half[..., ::-1]
