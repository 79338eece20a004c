"""Objects onto table tops: inside the edges, apart from each other, touching.

A footprint is a rectangle with rounded corners: half sides and a radius, so that a box, a sphere and a lying capsule
are all exact. K objects; one world at a time.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.layout import Layout
from mjx_arenas.objects import Object
from mjx_arenas.params import ArenaParams

TRIES = 32  # places tried for each object


class Placement(NamedTuple):
    """Where objects start."""

    qpos: jax.Array  # (K, 7) world position [m] and orientation
    valid: jax.Array  # (K,) bool: found a free place; an object that did not starts above the others, touching nothing


class _Footprints(NamedTuple):
    half: np.ndarray  # (K, 2) half sides of the rectangle [m]
    radius: np.ndarray  # (K,) of its rounding [m]


def footprints(objects: Sequence[Object]) -> _Footprints:
    """Footprints of objects on a table."""
    half = np.array([o.half_size[:2] for o in objects], float).reshape(-1, 2)
    radius = np.array([0.0 if o.type == "box" else o.half_size[2] for o in objects])
    return _Footprints(half - radius[:, None], radius)


def place(key: jax.Array, layout: Layout, prints: _Footprints, params: ArenaParams) -> Placement:
    """Draws a place and a yaw for each object, in order, from `TRIES` candidates each; the first free one is taken."""
    params = ArenaParams(*(jnp.asarray(p) for p in params))
    n = len(layout.object_body)
    table = jnp.asarray(layout.object_table)
    half, radius = jnp.asarray(prints.half, jnp.float32), jnp.asarray(prints.radius, jnp.float32)
    height = 2 * jnp.asarray(layout.object_half_size[:, 2], jnp.float32)
    table_half = params.table_full_sizes[table, :2] / 2

    def one(placed: jax.Array, k: jax.Array) -> tuple[jax.Array, tuple[jax.Array, jax.Array]]:
        draw = jax.random.uniform(jax.random.fold_in(key, k), (TRIES, 3), minval=-1.0)
        yaw = jnp.pi * draw[:, 2]
        c, s = jnp.abs(jnp.cos(yaw)), jnp.abs(jnp.sin(yaw))
        reach = jnp.stack([c * half[k, 0] + s * half[k, 1], s * half[k, 0] + c * half[k, 1]], -1) + radius[k]
        room = table_half[k] - reach  # of the centre, to either side
        candidates = jnp.concatenate([draw[:, :2] * jnp.maximum(room, 0.0), yaw[:, None]], -1)
        others = (jnp.arange(n) < k) & (table == table[k])
        gap = jax.vmap(lambda pose: _gap(pose, half[k], placed, half))(candidates)  # (TRIES, K)
        free = jnp.all((gap > radius[k] + radius) | ~others, axis=-1) & jnp.all(room >= 0, axis=-1)
        first = jnp.argmax(free)
        return placed.at[k].set(candidates[first]), (candidates[first], free[first])

    _, (pose, valid) = jax.lax.scan(one, jnp.zeros((n, 3)), jnp.arange(n))
    # Objects without a free place are stacked above all others of the arena.
    stack = jnp.cumsum(jnp.where(valid, 0.0, height)) - jnp.where(valid, 0.0, height) + height.sum()
    rest = jnp.asarray(layout.object_half_size[:, 2], jnp.float32) + jnp.where(valid, 0.0, stack)
    pos, quat = geometry.on_table(params.table_offsets[table], params.table_rots[table], pose[:, :2], pose[:, 2], rest)
    return Placement(jnp.concatenate([pos, quat], axis=-1), valid)


def _gap(pose: jax.Array, half: jax.Array, poses: jax.Array, halves: jax.Array) -> jax.Array:
    """Gaps (K,) between a rectangle and others along the best of their sides' axes; never more than the distance.

    Args:
        pose: (3,) x, y, yaw.
        half: (2,) half sides.
        poses: (K, 3) of the others.
        halves: (K, 2) of the others.
    """
    delta, turn = poses[:, :2] - pose[:2], poses[:, 2] - pose[2]
    c, s = jnp.abs(jnp.cos(turn)), jnp.abs(jnp.sin(turn))
    own = jnp.abs(geometry.rotate_yaw(-pose[2], delta)) - half - _spread(c, s, halves)
    other = (
        jnp.abs(geometry.rotate_yaw(-poses[:, 2], delta)) - halves - _spread(c, s, jnp.broadcast_to(half, halves.shape))
    )
    return jnp.maximum(own, other).max(-1)


def _spread(c: jax.Array, s: jax.Array, half: jax.Array) -> jax.Array:
    """Half extents (K, 2) of rectangles along axes turned by an angle of |cosine| c and |sine| s."""
    return jnp.stack([c * half[:, 0] + s * half[:, 1], s * half[:, 0] + c * half[:, 1]], axis=-1)
