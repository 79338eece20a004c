"""The arithmetic of one table and of what rests on it, shared by the model builder (NumPy) and the field writer (JAX).

Every function broadcasts over leading axes and works in the array library of its arguments, so that a leg stands
where one formula says, on the host and on the device. Lengths are in [m], angles in [rad], quaternions are (w, x, y,
z).

The formulas are robosuite's (`TableArena`, `MultiTableArena`), except that the yaw turns the body instead of its geoms.
"""

import functools
import operator
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


def less(values: Array, constants: np.ndarray) -> Array:
    """`values` less constants in double precision, of which single precision loses nothing: two numbers for each, the near one first."""
    xp = array_module(values)
    high = constants.astype(values.dtype)
    return (values - xp.asarray(high)) - xp.asarray((constants - high).astype(values.dtype))


PARTS = 6  # geoms of a table: the slab that collides, the slab that is drawn, four legs
SLABS, LEGS = slice(0, 2), slice(2, 6)
_Z = np.array([0.0, 0.0, 1.0])


class Table(NamedTuple):
    """The places of a table's elements. Positions are in the table body's frame unless the name says `body`."""

    body_pos: Array  # (..., 3) centre of the slab, in the world
    body_quat: Array  # (..., 4) yaw about the world's z axis
    top_pos: Array  # (..., 3) centre of the top surface
    half: Array  # (..., 3) half size of the slabs, which are at the body's origin
    leg_size: Array  # (..., 2) radius and half length
    leg_pos: Array  # (..., 3) of the first leg; the others stand at the same x and y with the LEG_SIGNS
    leg_rgba: Array  # (..., 4)


def pick(values: Array, index: Array) -> Array:
    """`values[index]`, rows (n, ...) of `values` (T, ...) by `index` (n,); on the device without a gather."""
    xp = array_module(values, index)
    if xp is np:
        return np.asarray(values)[index]
    chosen = jnp.asarray(index)[:, None] == jnp.arange(values.shape[0])[None]
    chosen = chosen.reshape(chosen.shape + (1,) * (values.ndim - 1))
    rows = jnp.where(chosen, values, jnp.zeros((), values.dtype))
    return rows.any(1) if values.dtype == bool else rows.sum(1)


def with_row(values: Array, index: int, row: Array) -> Array:
    """`values` (n, ...) with another row at an index."""
    xp = array_module(values, row)
    values, row = xp.asarray(values), xp.asarray(row)
    return xp.concatenate([values[:index], row.astype(values.dtype)[None], values[index + 1 :]])


def along_last(values: Any, like: Array) -> Array:
    """Constants (n,) along the last axis, with as many axes, and in the library and type, of `like`: ranks are not promoted."""
    return array_module(like).asarray(np.reshape(values, (1,) * (like.ndim - 1) + (-1,)), like.dtype)


def yaw_quat(yaw: Array) -> Array:
    """Quaternion (..., 4) of a rotation by `yaw` (...) about z."""
    xp = array_module(yaw)
    half = (yaw / 2)[..., None]
    w, z = (along_last(row, half) for row in np.eye(4)[[0, 3]])
    return w * xp.cos(half) + z * xp.sin(half)


def rotate_yaw(yaw: Array, xy: Array) -> Array:
    """Vectors (..., 2) turned by `yaw` (...) about z."""
    xp = array_module(yaw, xy)
    c, s = xp.cos(yaw), xp.sin(yaw)
    return xp.stack([c * xy[..., 0] - s * xy[..., 1], s * xy[..., 0] + c * xy[..., 1]], axis=-1)


def beyond(offset: Array, rot: Array, size: Array, xy: Array) -> Array:
    """(..., 2) how far points are outside rectangles along each of their sides; below 0 inside [m].

    Args:
        offset: (..., 2 or 3) middles of the rectangles, in the world.
        rot: (...) their yaws [rad].
        size: (..., 2 or more) their sides.
        xy: (..., 2) the points, in the world.
    """
    return abs(rotate_yaw(-rot, xy - offset[..., :2])) - size[..., :2] / 2


def corners(offset: Array, rot: Array, full_size: Array) -> Array:
    """(..., 4, 2) corners of tables' tops seen from above, counter-clockwise.

    Args:
        offset: (..., 2 or 3) centre of the top surface, in the world.
        rot: (...) yaw.
        full_size: (..., 2 or 3) length, width, thickness of the slab.
    """
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return offset[..., None, :2] + rotate_yaw(rot[..., None], full_size[..., None, :2] / 2 * signs)


def table(offset: Array, rot: Array, full_size: Array, has_legs: Array) -> Table:
    """Geometry of tables.

    Args:
        offset: (..., 3) centre of the top surface, in the world.
        rot: (...) yaw.
        full_size: (..., 3) length, width, thickness of the slab.
        has_legs: (...) bool; the legs of a table without are hidden: tiny, at the body's centre, transparent.
    """
    # Sums of products with constants: of stacked numbers a compiler for GPUs makes a kernel each.
    xp = array_module(offset, rot, full_size, has_legs)
    half = full_size / 2

    def const(values: Any) -> Array:
        return along_last(values, half)

    # A leg stands LEG_INSET inside the edge where the slab is wide enough, else on the axis; it reaches from the
    # floor to the slab's centre.
    body_pos = offset - half * const(_Z)
    # A side of just 0.4 m is not, in single precision either.
    reach = xp.where(half > 2 * LEG_INSET + 1e-6, half - LEG_INSET, 0.0) * const((1, 1, 0))
    half_length = body_pos[..., 2, None] / 2
    shown = has_legs[..., None]
    return Table(
        body_pos=body_pos,
        body_quat=yaw_quat(rot),
        top_pos=half * const(_Z),
        half=half,
        leg_size=xp.where(shown, const((LEG_RADIUS, 0)) + half_length * const((0, 1)), HIDDEN_SIZE),
        leg_pos=xp.where(shown, reach - half_length * const(_Z), 0.0),
        leg_rgba=xp.where(shown, const(LEG_RGBA), const(HIDDEN_RGBA)),
    )


def table_box(table: Table) -> tuple[Array, Array]:
    """Corners (..., 3), (..., 3) in the world of the box around the spheres around all geoms of tables."""
    w, z = table.body_quat[..., 0, None], table.body_quat[..., 3, None]
    xp = array_module(w)
    cos, sin = abs(w * w - z * z), abs(2 * w * z)
    slab, leg = length(table.half)[..., None], length(table.leg_size)[..., None]
    out = abs(table.leg_pos)  # legs stand on both sides, under the body
    across = xp.where(np.array([True, False, False]), out[..., 1:2], out[..., :1])
    flat = np.array([True, True, False])
    reach, down = xp.where(flat, cos * out + sin * across, 0.0), xp.where(flat, 0.0, out)
    low, high = xp.minimum(-slab, -reach - down - leg), xp.maximum(slab, reach - down + leg)
    return table.body_pos + low, table.body_pos + high


def table_reach(table: Table) -> Array:
    """(...) how far tables reach from the middle of the slab: to the end of the spheres around their geoms."""
    slab, leg = length(table.half), length(table.leg_size)
    return array_module(slab).maximum(slab, length(table.leg_pos) + leg)


def legs_fit(offset: Array, full_size: Array, has_legs: Array) -> Array:
    """(...) bool: the slab's centre is above the floor, where there are legs to stand under it."""
    return ~has_legs | (offset[..., 2] > full_size[..., 2] / 2)


TOUCHING = 1e-6  # of sizes and distances from the origin: single precision moves a side by no more than half of it


class Slabs(NamedTuple):
    """Upright boxes, (...) each."""

    middle: tuple[Array, Array, Array]  # in the world
    half: tuple[Array, Array, Array]
    cos: Array  # of the yaw
    sin: Array


def slabs(offset: Array, rot: Array, full_size: Array) -> Slabs:
    """The slabs of tables whose top surfaces have their centres at `offset` (..., 3); `rot` (...), `full_size` (..., 3)."""
    xp = array_module(offset, rot, full_size)
    (x, y, z), half = (tuple(v[..., i] for i in range(3)) for v in (offset, full_size / 2))
    return Slabs((x, y, z - half[2]), half, xp.cos(rot), xp.sin(rot))


def overlap(one: Slabs, other: Slabs) -> tuple[Array, Array]:
    """How deep slabs are in others (...) [m]; 0 or less: apart. And up to where two only touch, (...) [m].

    Separating axes of upright boxes: z, and the sides of both seen from above; the depth is along the one with the least.
    """
    xp = array_module(one.cos)
    dx, dy, dz = (a - b for a, b in zip(one.middle, other.middle, strict=True))
    cos = abs(one.cos * other.cos + one.sin * other.sin)
    sin = abs(one.sin * other.cos - one.cos * other.sin)
    depth = one.half[2] + other.half[2] - abs(dz)
    for mine, (a, b, _) in ((one, other.half), (other, one.half)):
        along, across = abs(dx * mine.cos + dy * mine.sin), abs(dy * mine.cos - dx * mine.sin)
        depth = xp.minimum(depth, mine.half[0] + a * cos + b * sin - along)
        depth = xp.minimum(depth, mine.half[1] + a * sin + b * cos - across)
    return depth, TOUCHING * (_extent(one) + _extent(other))


def _extent(slabs: Slabs) -> Array:
    """(...) at least the largest of the numbers that say where a slab is [m]."""
    return sum(abs(x) for x in slabs.middle) + sum(slabs.half)


def overlaps(offset: Array, rot: Array, full_size: Array) -> tuple[Array, Array]:
    """`overlap` of T tables, each with each, (T, T); arguments as of `slabs`."""
    one = slabs(offset, rot, full_size)
    return overlap(jax.tree.map(lambda x: x[:, None], one), jax.tree.map(lambda x: x[None], one))


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


def length(vector: Array) -> Array:
    """(...) lengths of vectors (..., 2 or 3): of a box's half sides, or a cylinder's radius and half length, the sphere's around it."""
    squares = (vector[..., i] * vector[..., i] for i in range(vector.shape[-1]))
    return array_module(vector).sqrt(functools.reduce(operator.add, squares))
