"""Where objects and tables stand: nominal places, and random ones that are free.

T tables, K objects; one world at a time. A footprint is a rectangle with rounded corners, so that a box, a sphere, a
lying capsule and a standing cylinder are all exact; a mesh and an MJCF body have the rectangle around them.
"""

import zlib
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas import geometry, shapes
from mjx_arenas.furniture import standing
from mjx_arenas.furniture.part import Part
from mjx_arenas.geometry import Array
from mjx_arenas.params.distributions import Workspace
from mjx_arenas.params.params import ArenaParams, canonical, present
from mjx_arenas.sample import packing

PARKED_Z = 100.0  # height of the first absent object [m]; the next ones are each 1 m higher
FOREVER = 1e6  # a height above everything [m]


class Placement(NamedTuple):
    """Where objects start."""

    qpos: jax.Array  # (K, 7) world position [m] and orientation
    valid: (
        jax.Array
    )  # (K,) bool: found a free place, or is absent; one that did not starts above the others, touching nothing


class Places(NamedTuple):
    """What of the objects' places does not vary (host)."""

    share: np.ndarray  # (K, 2) nominal place, as a share of the table's half size ...
    pos: np.ndarray  # (K, 2) ... plus [m], in the frame of the table's top
    rot: np.ndarray  # (K,) nominal yaw relative to the table [rad]
    center: np.ndarray  # (K, 3) middle of the extents, in the object's frame [m]
    kind: np.ndarray  # (K,) type
    tag: np.ndarray  # (K,) that the object's keys are folded with
    base_table: np.ndarray  # (B,) index of the table on which something is fixed, -1: to the world
    base_hangs: np.ndarray  # (B,) bool: it moves with the middle of the slab, not with the table's top
    base_pose: np.ndarray  # (B, 3) x, y, yaw of the rectangle around it, in the frame of the table's top or the world
    base_half: np.ndarray  # (B, 2) its half sides [m]
    base_z: np.ndarray  # (B, 2) its lowest and highest z [m], above the middle, the top or the world's origin
    furniture: tuple[Part, ...] = ()  # whose boxes stand in the way


def nominal_poses(places: Places, params: ArenaParams) -> tuple[Array, Array]:
    """Positions (K, 3) and orientations (K, 4) of objects at their nominal places; NumPy or JAX."""
    tables = (params.table_offsets, params.table_rots, params.table_full_sizes)
    offset, rot, size = (geometry.pick(x, params.object_tables) for x in tables)
    share, pos, yaw, center = (
        np.asarray(x, offset.dtype) for x in (places.share, places.pos, places.rot, places.center)
    )
    xy = share * (size[:, :2] / 2) + pos
    return geometry.on_table(offset, rot, xy, yaw, params.object_full_sizes, center)


def too_large(params: ArenaParams) -> Array:
    """(K,) bool: the object cannot lie within its table's edges; NumPy or JAX."""
    print_ = params.object_full_sizes[:, :2]
    top = geometry.pick(params.table_full_sizes, params.object_tables)[:, :2]
    diagonal = (top * top).sum(-1) ** 0.5
    return (print_.min(-1) > top.min(-1)) | (print_.max(-1) > diagonal)


def parked(n: int) -> np.ndarray:
    """Positions (n, 3) of absent objects [m]."""
    return np.stack([np.zeros(n), np.zeros(n), PARKED_Z + np.arange(n)], axis=-1)


def place_objects(key: jax.Array, places: Places, params: ArenaParams, margin: jax.Array | float = 0.0) -> Placement:
    """Draws a place and a yaw for each object, in order.

    Free is what lies inside the table's edges, `margin` [m] away from them, and touches neither an object that was
    placed before, nor what is fixed on a table or to the world, nor another table's slab.
    """
    params = canonical(params)
    n = len(places.tag)
    if not n:
        return Placement(jnp.zeros((0, 7)), jnp.zeros(0, bool))
    there, on = present(params)[1], params.object_tables
    tables = (params.table_offsets, params.table_rots, params.table_full_sizes)
    offset, rot, size = (geometry.pick(x, on) for x in tables)
    half, radius = shapes.footprint(places.kind, params.object_full_sizes)
    height: jax.Array = params.object_full_sizes[:, 2]
    solids = packing.Solids(jnp.zeros((n, 3)), half, radius, offset[:, 2], offset[:, 2] + height, there)
    regions = packing.Region(jnp.concatenate([offset[:, :2], rot[:, None]], axis=-1), size[:, :2] / 2)
    bases = _bases(places, params)
    on_tables = jnp.where(places.base_table >= 0, FOREVER, 0.0)  # a robot's arm is above its base
    endless = bases._replace(top=bases.top + on_tables)
    there_already = [_slabs(params), endless, *([_boxes(places, params)] if places.furniture else [])]
    obstacles = packing.Solids(*map(jnp.concatenate, zip(*there_already, strict=True)))
    own = on[:, None] == jnp.arange(len(obstacles.radius))[None]
    key = jax.random.fold_in(key, zlib.crc32(b"place"))  # apart from what else splits the world's key
    keys = jax.vmap(lambda tag: jax.random.fold_in(key, tag))(jnp.asarray(places.tag))
    pose, found = packing.pack(keys, solids, regions, obstacles, own, margin=margin)

    # An object without a free place starts above all tables and all that stands on them, one over the other.
    stacked = there & ~found
    tops = [params.table_offsets[:, 2], bases.top, *(one.top for one in there_already[2:])]
    ceiling = jnp.concatenate(tops).max() + height.max()
    top: jax.Array = offset[:, 2]
    above = ceiling + jnp.cumsum(jnp.where(stacked, height, 0.0))
    z = jnp.where(found, top + height / 2, above - height / 2)
    center = jnp.asarray(places.center, z.dtype)
    pos: jax.Array = geometry.from_middle(pose[:, :2], pose[:, 2], z, center)
    pos = jnp.where(there[:, None], pos, parked(n).astype(np.float32))
    return Placement(jnp.concatenate([pos, geometry.yaw_quat(pose[:, 2])], axis=-1), found)


def _slabs(params: ArenaParams) -> packing.Solids:
    """The table tops (T,)."""
    pose = jnp.concatenate([params.table_offsets[:, :2], params.table_rots[:, None]], axis=-1)
    top, size = params.table_offsets[:, 2], params.table_full_sizes
    return packing.Solids(pose, size[:, :2] / 2, jnp.zeros_like(top), top - size[:, 2], top, params.table_active)


def _boxes(places: Places, params: ArenaParams) -> packing.Solids:
    """The boxes of furniture (N,)."""
    top, rot, size, there = standing.standing(places.furniture, params)
    pose = jnp.concatenate([top[:, :2], rot[:, None]], axis=-1)
    return packing.Solids(pose, size[:, :2] / 2, jnp.zeros_like(rot), top[:, 2] - size[:, 2], top[:, 2], there)


def _bases(places: Places, params: ArenaParams) -> packing.Solids:
    """What is fixed on the tables, from the top up where it reaches above it, and to the world (B,)."""
    table, dtype = places.base_table, params.table_rots.dtype
    # The world's frame comes last, where an index of -1 finds it.
    offset = jnp.concatenate([params.table_offsets, jnp.zeros((1, 3), dtype)])[table]
    rot, there = jnp.append(params.table_rots, 0.0)[table], jnp.append(params.table_active, True)[table]
    local, half, z = (jnp.asarray(x, dtype) for x in (places.base_pose, places.base_half, places.base_z))
    xy = offset[:, :2] + geometry.rotate_yaw(rot, local[:, :2])
    pose = jnp.concatenate([xy, (rot + local[:, 2])[:, None]], axis=-1)
    thick = jnp.append(params.table_full_sizes[:, 2], 0.0)[table]
    high = offset[:, 2] + z[:, 1] - jnp.where(places.base_hangs, thick / 2, 0.0)
    low = offset[:, 2] + jnp.where(table >= 0, 0.0, z[:, 0])
    return packing.Solids(pose, half, jnp.zeros_like(rot), low, high, there & (high > low))


def place_tables(keys: jax.Array, params: ArenaParams, workspace: Workspace) -> jax.Array:
    """`table_offsets` (T, 3) with other x and y: at random in a workspace, seen from above apart by its gap.

    A table that finds no place stands beside the workspace, apart from the others: `keeps` says so.

    Args:
        keys: (T,) one for each table.
        params: of the world.
        workspace: where.
    """
    solids, regions = _plan(params, workspace)
    n, gap = len(params.table_rots), jnp.asarray(workspace.gap)
    none = jax.tree.map(lambda x: x[:0], solids)
    pose, found = packing.pack(keys, solids, regions, none, jnp.zeros((n, 0), bool), params.table_rots, gap)
    reach = jnp.hypot(*params.table_full_sizes[:, :2].T) / 2
    beside = regions.half[:, 0] + jnp.cumsum(jnp.where(found, 0.0, 2 * reach + gap)) - reach
    xy = jnp.where(found[:, None], pose[:, :2], regions.pose[:, :2] + beside[:, None] * jnp.array([[1.0, 0.0]]))
    return jnp.concatenate([xy, params.table_offsets[:, 2:]], axis=-1)


def _plan(params: ArenaParams, workspace: Workspace) -> tuple[packing.Solids, packing.Region]:
    """The tables (T,) as seen from above, all at one height, and where they may stand."""
    low, high = (jnp.asarray(x, params.table_rots.dtype) for x in (workspace.low, workspace.high))
    zero = jnp.zeros_like(params.table_rots)
    middle = jnp.append((low + high) / 2, 0.0)
    regions = packing.Region(jnp.tile(middle, (len(zero), 1)), jnp.tile((high - low) / 2, (len(zero), 1)))
    return _slabs(params)._replace(bottom=zero, top=zero + 1), regions


def keeps(params: ArenaParams, workspace: Workspace) -> tuple[jax.Array, jax.Array]:
    """(T,) bool, the table stands inside the workspace, and (T, T) bool, two are apart by its gap; absent ones do both."""
    return packing.in_place(*_plan(canonical(params), workspace), jnp.asarray(workspace.gap))
