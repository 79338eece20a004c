"""The places of objects and tables: nominal ones, and random ones that are free.

T tables, K objects; one world at a time. A footprint is a rectangle with rounded corners, so that a box, a sphere, a
lying capsule and a standing cylinder are all exact; a mesh and an MJCF body have the rectangle around them.
"""

import zlib
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.furniture import standing, surfaces
from mjx_arenas.furniture.part import Part
from mjx_arenas.furniture.standing import Standing
from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.distributions import Workspace
from mjx_arenas.params.params import ArenaParams, canonical
from mjx_arenas.quaternions import quat_mul, quat_rotate
from mjx_arenas.sample import packing, tops
from mjx_arenas.sample.dropping import FLUSH, lowered, piled
from mjx_arenas.sample.fixed import NOTHING, Fixed, Near, based, following, frames, points
from mjx_arenas.sample.poses import Lying, Poses, lying
from mjx_arenas.sample.variants import Variants
from mjx_arenas.spec.follow import Follower

PARKED_Z = 100.0  # height of the first absent object [m]; the next ones are each 1 m higher
FOREVER = 1e6  # a height above everything [m]
LIFTED = 1e-3  # what starts this far above its table or surface [m] had no free place, or is dropped


class Placement(NamedTuple):
    """Places where objects start."""

    qpos: jax.Array  # (K, 7) world position [m] and orientation
    valid: (
        jax.Array
    )  # (K,) bool: found a free place, or is absent; one that did not starts above the others, touching nothing


class Places(NamedTuple):
    """What of the objects' places does not vary (host)."""

    share: np.ndarray  # (K, 2) nominal place, as a share of the table's or surface's half size ...
    pos: np.ndarray  # (K, 2) ... plus [m], in the frame of its middle
    rot: np.ndarray  # (K,) nominal yaw relative to the table [rad]
    center: (
        np.ndarray
    )  # (K, 3) middle of the extents from the object's origin, along its axes as `tilt` leaves them [m]
    tilt: np.ndarray  # (K, 4) quaternion: how it stands before its yaw
    kind: np.ndarray  # (K,) type
    tag: np.ndarray  # (K,) that the object's keys are folded with
    region: np.ndarray  # (K, 2, 2) least and most x, y of where it may be, as shares of the half size
    margin: np.ndarray  # (K,) to the edges [m]
    rots: np.ndarray  # (K, 2) least and most yaw relative to what it stands on [rad]
    drop: np.ndarray  # (K,) bool: it starts above what it will fall onto
    near: Near  # (K,) what it stays near to
    distance: np.ndarray  # (K, 2) least and most from it [m]
    fixed: Fixed = NOTHING  # what stands in the way beside tables, furniture and objects
    furniture: tuple[Part, ...] = ()  # whose boxes stand in the way, and whose surfaces carry objects
    follows: tuple[Follower, ...] = ()  # geoms on tables, which stand in the way where they reach above the tops
    variants: tuple[Variants, ...] = ()  # of the objects that have some
    poses: tuple[Poses, ...] = ()  # of the objects that may rest in several
    carriers: tuple[tops.Carrier, ...] = ()  # objects on which others stand

    @property
    def ground(self) -> tops.Ground:
        """What objects stand on beside tables."""
        return tops.Ground(self.furniture, self.carriers, self.poses)

    @property
    def tilts(self) -> bool:
        """Whether an object may stand otherwise than upright."""
        return bool(self.poses) or bool(self.tilt[:, 1:].any())


def lies(places: Places, params: ArenaParams) -> Lying:
    """How the objects lie in one world; NumPy or JAX."""
    return lying(places.poses, places.variants, params, places.kind, places.tilt, places.center)


def _turned(places: Places, tilt: Array, quat: Array) -> Array:
    """Orientations (K, 4) of objects that are tilted and turned by yaws, both as quaternions (K, 4); NumPy or JAX."""
    return quat_mul(quat, array_module(quat).asarray(tilt, quat.dtype)) if places.tilts else quat


def body_centers(places: Places, params: ArenaParams) -> Array:
    """(K, 3) middles of the objects' extents in their frames [m]; NumPy or JAX."""
    found = lies(places, params)
    back = found.tilt * np.array([1.0, -1.0, -1.0, -1.0], found.tilt.dtype)
    xp = array_module(found.center, back)
    return quat_rotate(xp.asarray(back, found.center.dtype), found.center) if places.tilts else found.center


def nominal_poses(places: Places, params: ArenaParams) -> tuple[Array, Array]:
    """Positions (K, 3) and orientations (K, 4) of objects at their nominal places; NumPy or JAX."""
    offset, rot, size, *_ = tops.surfaces(params, places.ground).of(params.object_tables)
    share, pos, yaw = (np.asarray(x, offset.dtype) for x in (places.share, places.pos, places.rot))
    laid = lies(places, params)
    center = laid.center.astype(offset.dtype)
    xy = share * (size / 2) + pos
    if places.drop.any():
        lifts = piled(places.drop, params.object_tables, np.ones(len(yaw), bool), laid.full_size[:, 2])
        xp = geometry.array_module(offset, lifts)
        offset = xp.concatenate([offset[:, :2], (offset[:, 2] + lifts)[:, None]], axis=-1)
    at, quat = geometry.on_table(offset, rot, xy, yaw, laid.full_size, center)
    return at, _turned(places, laid.tilt, quat)


def too_large(params: ArenaParams, ground: tops.Ground, laid: Lying) -> Array:
    """(K,) bool: an object cannot lie within the edges of its table or surface; NumPy or JAX."""
    print_, below = laid.full_size[:, :2], tops.surfaces(params, ground).of(params.object_tables)
    top = below.size
    diagonal = (top * top).sum(-1) ** 0.5
    found = (print_.min(-1) > top.min(-1)) | (print_.max(-1) > diagonal)
    if not ground.carriers:
        return found
    reach = (laid.half * laid.half).sum(-1) ** 0.5 + laid.radius
    return geometry.array_module(found, reach).where(below.round, reach > top[:, 0] / 2 * (1 + 1e-6), found)


def parked(n: int) -> np.ndarray:
    """Positions (n, 3) of absent objects [m]."""
    return np.stack([np.zeros(n), np.zeros(n), PARKED_Z + np.arange(n)], axis=-1)


def place_objects(key: jax.Array, places: Places, params: ArenaParams, margin: jax.Array | float = 0.0) -> Placement:
    """Draws a place and a yaw for each object, in order.

    Free is what lies inside the edges of its table or surface, `margin` [m] away from them, and touches neither an object that was
    placed before, nor what is fixed on a table or to the world, nor another table's slab, nor a part of furniture.
    """
    params = canonical(params)
    n = len(places.tag)
    if not n:
        return Placement(jnp.zeros((0, 7)), jnp.zeros(0, bool))
    on, n_tables = params.object_tables, len(params.table_rots)
    ground = places.ground
    every = tops.surfaces(params, ground)
    offset = every.of(on).top
    there = tops.present(params, ground)[1]
    laid = Lying(*map(jnp.asarray, lies(places, params)))
    half, radius = laid.half, laid.radius
    height: jax.Array = laid.full_size[:, 2]
    drops = places.drop.any()
    bottom: jax.Array = offset[:, 2] + (piled(places.drop, on, there, height) if drops else 0.0)
    solids = packing.Solids(jnp.zeros((n, 3)), half, radius, bottom, bottom + height, there)
    regions = _regions(places, params, every)
    bases, on_base = _bases(places, params, len(every.rot)), places.fixed.on
    on_top = (on_base >= 0) & (on_base < len(every.rot)) & ~places.fixed.under
    on_tables = jnp.where(on_top, FOREVER, 0.0)  # a robot's arm is above its base
    endless = bases._replace(top=bases.top + on_tables)
    there_already = [
        _slabs(params),
        endless,
        *([_solids(standing.standing(places.furniture, params))] if places.furniture else []),
    ]
    if places.follows:
        followers = _solids(following(places.follows, params))
        there_already.append(followers._replace(top=followers.top - FLUSH))
    obstacles = packing.Solids(*map(jnp.concatenate, zip(*there_already, strict=True)))
    own = (on[:, None] == jnp.arange(len(obstacles.radius))[None]) & (on < n_tables)[:, None]  # tables come first
    if places.furniture:
        first, boxes = n_tables + len(endless.radius), surfaces.boxes(places.furniture)
        box = np.concatenate([np.arange(n_tables), np.where(boxes < 0, -1, first + boxes)])
        own = geometry.pick(jnp.asarray(box[:, None] == np.arange(len(obstacles.radius))), on)
    key = jax.random.fold_in(key, zlib.crc32(b"place"))  # apart from what else splits the world's key
    keys = jax.vmap(lambda tag: jax.random.fold_in(key, tag))(jnp.asarray(places.tag))
    margins = jnp.maximum(margin, jnp.asarray(places.margin, offset.dtype))
    rings = _rings(places, params) if np.isfinite(places.distance).any() else None
    pose, found = packing.pack(keys, solids, regions, obstacles, own, _rots(places), margin=margins, rings=rings)
    if drops:
        solids = solids._replace(pose=pose, present=there & found)
        bottom = jnp.where(found, lowered(places.drop, solids, offset[:, 2], obstacles), bottom)

    # An object without a free place starts above all tables and all that stands on them, over its own, one over the other.
    stacked = there & ~found
    pose = jnp.where(stacked[:, None], _within(every.of(tops.roots(params, ground)), pose, solids), pose)
    highest = [every.top[:, 2], bases.top, *(one.top for one in there_already[2:])]
    ceiling = jnp.concatenate(highest).max() + height.max()
    above = ceiling + jnp.cumsum(jnp.where(stacked, height, 0.0))
    z = jnp.where(found, bottom + height / 2, above - height / 2)
    center = laid.center.astype(z.dtype)
    pos: jax.Array = geometry.from_middle(pose[:, :2], pose[:, 2], z, center)
    pos = jnp.where(there[:, None], pos, parked(n).astype(np.float32))
    return Placement(jnp.concatenate([pos, _turned(places, laid.tilt, geometry.yaw_quat(pose[:, 2]))], axis=-1), found)


def _within(below: surfaces.Surfaces, pose: jax.Array, solids: packing.Solids) -> jax.Array:
    """Poses (K, 3), moved to where solids reach over no edge of surfaces (K), or else to the middle."""
    reach = jnp.hypot(*solids.half.T) + solids.radius
    middle, half = below.top[:, :2], jnp.maximum(below.size / 2 - reach[:, None], 0.0)
    local = geometry.rotate_yaw(-below.rot, pose[:, :2] - middle)
    xy = middle + geometry.rotate_yaw(below.rot, jnp.clip(local, -half, half))
    return jnp.concatenate([xy, pose[:, 2:]], axis=-1)


def _regions(places: Places, params: ArenaParams, every: surfaces.Surfaces) -> packing.Region:
    """The region in which each object (K,) must stay; for one that stands on another one, in the frame of that."""
    offset, rot, size, _, round_ = every.of(params.object_tables)
    low, high = (jnp.asarray(places.region[:, i], size.dtype) for i in (0, 1))
    middle = offset[:, :2] + geometry.rotate_yaw(rot, (low + high) / 2 * size / 2)
    regions = packing.Region(jnp.concatenate([middle, rot[:, None]], axis=-1), (high - low) / 2 * size / 2)
    if not places.carriers:
        return regions
    below = tops.carrying(params, places.ground)  # where these stand is drawn, too
    local = jnp.pad((low + high) / 2 * size / 2, ((0, 0), (0, 1)))
    pose = jnp.where((below >= 0)[:, None], local, regions.pose)
    disc = jnp.asarray(jnp.where((below >= 0) & round_, size[:, 0] / 2, jnp.inf))
    return packing.Region(pose, regions.half, below, disc)


def _slabs(params: ArenaParams) -> packing.Solids:
    """The table tops (T,)."""
    return _solids(Standing(params.table_offsets, params.table_rots, params.table_full_sizes, params.table_active))


def _solids(stands: Standing) -> packing.Solids:
    """Boxes (N,) as obstacles."""
    top, rot, size, there = stands
    pose = jnp.concatenate([top[:, :2], rot[:, None]], axis=-1)
    return packing.Solids(pose, size[:, :2] / 2, jnp.zeros_like(rot), top[:, 2] - size[:, 2], top[:, 2], there)


def _rots(places: Places) -> jax.Array | None:
    """Least and most yaws (K, 2); None if all may have any."""
    return None if (np.ptp(places.rots, axis=-1) >= packing.FULL_TURN).all() else jnp.asarray(places.rots, float)


def _rings(places: Places, params: ArenaParams) -> packing.Rings:
    """How near to what objects may be (K,)."""
    center = jnp.asarray(points(places.near, places.ground, params))
    return packing.Rings(center, *jnp.asarray(places.distance, center.dtype).T)


class Reach(NamedTuple):
    """How far the middles of objects are from what they stay near [m]."""

    nearest: np.ndarray  # (K,) wherever they may be placed, without regard to what else stands there
    farthest: np.ndarray  # (K,)
    nominal: np.ndarray  # (K,) at their nominal places
    rounding: np.ndarray  # (K,) by which single precision may move these distances


def reach(places: Places, params: ArenaParams) -> Reach:
    """The distances of one world; of what stands on other objects, any is possible (host)."""
    with jax.ensure_compile_time_eval():
        params = canonical(params)
        every = tops.surfaces(params, places.ground)
        laid, rings = lies(places, params), _rings(places, params)
        regions = jax.tree.map(np.asarray, _regions(places, params, every))
        below = jax.tree.map(np.asarray, every.of(params.object_tables))
    center, yaw = np.asarray(rings.center), regions.pose[:, 2]
    away = np.abs(geometry.rotate_yaw(-yaw, center - regions.pose[:, :2]))
    # At any yaw an outline reaches as far from its middle as the disc in it.
    thin = np.asarray(laid.half).min(-1) + np.asarray(laid.radius)
    room = np.maximum(regions.half - (thin + places.margin)[:, None], 0.0)
    nearest, farthest = np.hypot(*np.maximum(away - room, 0.0).T), np.hypot(*(away + room).T)
    if regions.on is not None:
        nearest, farthest = np.where(regions.on < 0, nearest, 0.0), np.where(regions.on < 0, farthest, np.inf)
    xy = places.share * below.size[:, :2] / 2 + places.pos
    middle = below.top[:, :2] + geometry.rotate_yaw(below.rot, xy)
    rounding = geometry.TOUCHING * (abs(middle).sum(-1) + abs(center).sum(-1) + 1.0)
    return Reach(nearest, farthest, np.hypot(*(middle - center).T), rounding)


class Room(NamedTuple):
    """What the regions and margins of objects leave them (host)."""

    enough: np.ndarray  # (K,) bool: the outline fits there at its one yaw, or at some, where nothing else is
    size: np.ndarray  # (K, 2) of the rectangle that they leave, or twice the diameter of the disc [m]
    outline: np.ndarray  # (K, 2) extents of the object as it lies [m]
    round: np.ndarray  # (K,) bool: the rectangle is large enough, and the disc is not


def room(places: Places, params: ArenaParams) -> Room:
    """The room of one world (host)."""
    with jax.ensure_compile_time_eval():
        params = canonical(params)
        regions = _regions(places, params, tops.surfaces(params, places.ground))
        laid = Lying(*map(jnp.asarray, lies(places, params)))
        n, margin = len(laid.radius), jnp.asarray(places.margin, laid.radius.dtype)
        zero = jnp.zeros(n)
        solids = packing.Solids(jnp.zeros((n, 3)), laid.half, laid.radius, zero, zero, jnp.ones(n, bool))
        flat = regions._replace(on=None, radius=None)
        rots = _rots(places)
        enough, within = (np.asarray(packing.fit(solids, one, margin, rots)) for one in (regions, flat))
        half = np.asarray(regions.half)
        disc = half if regions.radius is None else np.asarray(regions.radius)[:, None]
        outline = np.asarray(laid.full_size)[:, :2]
    left = np.where((within & ~enough)[:, None], disc, half) - places.margin[:, None]
    return Room(enough, np.maximum(2 * left, 0.0), outline, within & ~enough)


def _bases(places: Places, params: ArenaParams, n_surfaces: int) -> packing.Solids:
    """What is fixed on tables and furniture, from the top up where it reaches above it, and to the world (B,)."""
    on = places.fixed.on
    found = _solids(based(places.fixed, places.ground, params))
    surface = jnp.asarray(frames(places.ground, params)[0])[jnp.asarray(on), 2]
    low: jax.Array = jnp.where((on >= 0) & (on < n_surfaces) & ~places.fixed.under, surface, found.bottom)
    return found._replace(bottom=low, present=found.present & (found.top > low))


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
    rots = jnp.stack([params.table_rots, params.table_rots], axis=-1)
    pose, found = packing.pack(keys, solids, regions, none, jnp.zeros((n, 0), bool), rots, gap)
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
