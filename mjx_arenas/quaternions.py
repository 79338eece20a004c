"""Arithmetic of vectors and quaternions (w, x, y, z), over leading axes."""

import functools
import operator

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas.geometry import array_module
from mjx_arenas.rows import take

MINVAL = mujoco.mjMINVAL


def quat_mul(u: jax.Array, v: jax.Array) -> jax.Array:
    """Product (..., 4) of quaternions; NumPy or JAX."""
    u0, u1, u2, u3 = (u[..., i] for i in range(4))
    v0, v1, v2, v3 = (v[..., i] for i in range(4))
    return array_module(u, v).stack(
        [
            u0 * v0 - u1 * v1 - u2 * v2 - u3 * v3,
            u0 * v1 + u1 * v0 + u2 * v3 - u3 * v2,
            u0 * v2 - u1 * v3 + u2 * v0 + u3 * v1,
            u0 * v3 + u1 * v2 - u2 * v1 + u3 * v0,
        ],
        axis=-1,
    )


def conjugate(q: jax.Array) -> jax.Array:
    """Inverses (..., 4) of unit quaternions."""
    return jnp.concatenate([q[..., :1], -q[..., 1:]], axis=-1)


def angle(u: jax.Array, v: jax.Array) -> jax.Array:
    """(...) by how much unit quaternions (..., 4) differ, from 0 to pi [rad]; of small angles, too, to rounding, as an arccos is not."""
    turn = quat_mul(conjugate(u), v)
    return 2 * jnp.arctan2(jnp.linalg.norm(turn[..., 1:], axis=-1), jnp.abs(turn[..., 0]))


def quat_rotate(q: jax.Array, v: jax.Array) -> jax.Array:
    """Vectors (..., 3) turned by unit quaternions (..., 4); NumPy or JAX."""
    u = q[..., 1:]
    t = 2 * cross(u, v)
    return v + q[..., :1] * t + cross(u, t)


def cross(u: jax.Array, v: jax.Array) -> jax.Array:
    """Cross products (..., 3); NumPy or JAX."""
    return _axes(u, 1, 2, 0) * _axes(v, 2, 0, 1) - _axes(u, 2, 0, 1) * _axes(v, 1, 2, 0)


def _axes(v: jax.Array, *order: int) -> jax.Array:
    """Vectors (..., 3) with their axes in this order.

    By a gather, which a GPU fuses with what surrounds it; slices that are put together cost it a kernel
    (benchmarks/README.md).
    """
    return take(v, np.array(order), axis=-1)


def quat_to_mat_rows(q: jax.Array) -> list[list[jax.Array]]:
    """The nine entries (...), by rows, of the rotation matrices of unit quaternions (..., 4)."""
    w, x, y, z = (q[..., i] for i in range(4))
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def quat_to_mat(q: jax.Array) -> jax.Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4); NumPy or JAX."""
    xp = array_module(q)
    return xp.stack([xp.stack(row, axis=-1) for row in quat_to_mat_rows(q)], axis=-2)


def norm(v: jax.Array) -> jax.Array:
    """Lengths (...) of vectors (..., n), with gradient 0 where the length is 0."""
    square = functools.reduce(operator.add, (v[..., i] ** 2 for i in range(v.shape[-1])))
    return jnp.where(square == 0, 0.0, jnp.sqrt(jnp.where(square == 0, 1.0, square)))


def normalize(v: jax.Array) -> jax.Array:
    """Vectors or quaternions (..., n), scaled to length 1; as in C, (1, 0, ...) instead of nothing."""
    length = norm(v)[..., None]
    none = length < MINVAL
    first = jnp.broadcast_to(jnp.eye(v.shape[-1], dtype=v.dtype)[0], v.shape)
    return jnp.where(none, first, v / jnp.where(none, 1.0, length))
