"""The arithmetic of one table and of what rests on it, shared by the model builder (NumPy) and the field writer (JAX).

Every function broadcasts over leading axes and works in the array library of its arguments, so that a leg stands
where one formula says, on the host and on the device. Lengths are in [m], angles in [rad], quaternions are (w, x, y,
z).

The formulas are robosuite's (`TableArena`, `MultiTableArena`), except that the yaw turns the body instead of its geoms.
"""

from types import ModuleType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

Array = Any  # np.ndarray | jax.Array: the same formula serves both

LEG_RADIUS = 0.025
LEG_INSET = 0.1  # from a table edge to a leg's axis
HIDDEN_SIZE = 1e-4  # of a leg that a table does not have: robosuite's way to hide one
HIDDEN_RGBA = (1.0, 0.0, 0.0, 0.0)
LEG_RGBA = (0.5, 0.5, 0.5, 1.0)  # MuJoCo's default: the material's colour shows
LEG_SIGNS = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))


def array_module(*arrays: Array) -> ModuleType:
    """`jax.numpy` if any of the arrays is JAX's, else `numpy`."""
    return jnp if any(isinstance(a, jax.Array) for a in arrays) else np


class Table(NamedTuple):
    """Where the elements of a table are. Positions are in the table body's frame unless the name says `body`."""

    body_pos: Array  # (..., 3) centre of the slab, in the world
    body_quat: Array  # (..., 4) yaw about the world's z axis
    half_size: Array  # (..., 3) of the slab
    top_pos: Array  # (..., 3) centre of the top surface
    leg_pos: Array  # (..., 4, 3)
    leg_size: Array  # (..., 4, 3) cylinder radius, half length, 0
    leg_rgba: Array  # (..., 4, 4)


def pick(values: Array, index: Array) -> Array:
    """`values[index]`, rows (n, ...) of `values` (T, ...) by `index` (n,); on the device without a gather."""
    xp = array_module(values, index)
    if xp is np:
        return np.asarray(values)[index]
    chosen = jnp.asarray(index)[:, None] == jnp.arange(values.shape[0])
    chosen = chosen.reshape(chosen.shape + (1,) * (values.ndim - 1))
    rows = jnp.where(chosen, values, jnp.zeros((), values.dtype))
    return rows.any(1) if values.dtype == bool else rows.sum(1)


def yaw_quat(yaw: Array) -> Array:
    """Quaternion (..., 4) of a rotation by `yaw` (...) about z."""
    xp = array_module(yaw)
    zero = xp.zeros_like(yaw)
    return xp.stack([xp.cos(yaw / 2), zero, zero, xp.sin(yaw / 2)], axis=-1)


def rotate_yaw(yaw: Array, xy: Array) -> Array:
    """Vectors (..., 2) turned by `yaw` (...) about z."""
    xp = array_module(yaw, xy)
    c, s = xp.cos(yaw), xp.sin(yaw)
    return xp.stack([c * xy[..., 0] - s * xy[..., 1], s * xy[..., 0] + c * xy[..., 1]], axis=-1)


def table(offset: Array, rot: Array, full_size: Array, has_legs: Array) -> Table:
    """Geometry of tables.

    Args:
        offset: (..., 3) centre of the top surface, in the world.
        rot: (...) yaw.
        full_size: (..., 3) length, width, thickness of the slab.
        has_legs: (...) bool; the legs of a table without are hidden: tiny, at the body's centre, transparent.
    """
    xp = array_module(offset, rot, full_size, has_legs)
    half = full_size / 2
    zero = xp.zeros_like(half[..., 2])
    body_pos = xp.stack([offset[..., 0], offset[..., 1], offset[..., 2] - half[..., 2]], axis=-1)
    top_pos = xp.stack([zero, zero, half[..., 2]], axis=-1)

    # A leg stands LEG_INSET inside the edge where the slab is wide enough, else on the axis; it reaches from the
    # floor to the slab's centre.
    reach = xp.where(half[..., :2] > 2 * LEG_INSET, half[..., :2] - LEG_INSET, 0.0)
    signs = xp.asarray(LEG_SIGNS, dtype=half.dtype)
    half_length = xp.broadcast_to((body_pos[..., 2] / 2)[..., None], (*zero.shape, 4))
    leg_xy = signs * reach[..., None, :]
    leg_pos = xp.stack([leg_xy[..., 0], leg_xy[..., 1], -half_length], axis=-1)
    leg_size = xp.stack([xp.full_like(half_length, LEG_RADIUS), half_length, xp.zeros_like(half_length)], axis=-1)

    def unless_hidden(hidden: tuple[float, ...], visible: Array) -> Array:
        return xp.where(has_legs[..., None, None], visible, xp.asarray(hidden, dtype=half.dtype))

    rgba = xp.broadcast_to(xp.asarray(LEG_RGBA, dtype=half.dtype), (*half_length.shape, 4))
    return Table(
        body_pos=body_pos,
        body_quat=yaw_quat(rot),
        half_size=half,
        top_pos=top_pos,
        leg_pos=unless_hidden((0.0, 0.0, 0.0), leg_pos),
        leg_size=unless_hidden((HIDDEN_SIZE, HIDDEN_SIZE, 0.0), leg_size),
        leg_rgba=unless_hidden(HIDDEN_RGBA, rgba),
    )


def legs_fit(offset: Array, full_size: Array, has_legs: Array) -> Array:
    """(...) bool: the slab's centre is above the floor, where there are legs to stand under it."""
    return ~has_legs | (offset[..., 2] > full_size[..., 2] / 2)


def on_table(offset: Array, rot: Array, xy: Array, yaw: Array, full_size: Array, center: Array) -> tuple[Array, Array]:
    """World pose (..., 3), (..., 4) of a body that rests on a table.

    Args:
        offset: (..., 3) of the table it stands on.
        rot: (...) of that table.
        xy: (..., 2) of its middle, in the frame of the table's top.
        yaw: (...) relative to the table.
        full_size: (..., 3) its extents.
        center: (..., 3) the middle of its extents, in its own frame.
    """
    middle = offset[..., :2] + rotate_yaw(rot, xy)
    return from_middle(middle, rot + yaw, offset[..., 2] + full_size[..., 2] / 2, center), yaw_quat(rot + yaw)


def from_middle(xy: Array, yaw: Array, z: Array, center: Array) -> Array:
    """Position (..., 3) of a body's origin.

    Args:
        xy: (..., 2) of the middle of its extents, in the world.
        yaw: (...) of the body, in the world.
        z: (...) of the middle, in the world.
        center: (..., 3) the middle in its own frame.
    """
    xp = array_module(xy, yaw, z, center)
    return xp.concatenate([xy - rotate_yaw(yaw, center[..., :2]), (z - center[..., 2])[..., None]], axis=-1)


def box_rbound(half_size: Array) -> Array:
    """Radius (...) of the sphere around boxes of `half_size` (..., 3): MuJoCo's `geom_rbound`."""
    return array_module(half_size).sqrt((half_size * half_size).sum(-1))


def cylinder_rbound(size: Array) -> Array:
    """Radius (...) of the sphere around cylinders of `size` (..., 3: radius, half length, unused)."""
    return array_module(size).sqrt((size[..., :2] * size[..., :2]).sum(-1))


def aabb(half_extent: Array) -> Array:
    """`geom_aabb` (..., 6), centre and half extents, of geoms that are centred in their frame."""
    xp = array_module(half_extent)
    return xp.concatenate([xp.zeros_like(half_extent), half_extent], axis=-1)


def cylinder_half_extent(size: Array) -> Array:
    """Half extents (..., 3) of cylinders of `size` (..., 3: radius, half length, unused)."""
    return array_module(size).stack([size[..., 0], size[..., 0], size[..., 1]], axis=-1)
