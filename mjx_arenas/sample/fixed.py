"""What stands in an arena beside tables, parts and objects: geoms that no joint moves, as upright boxes and discs; NumPy or JAX.

B geoms that are fixed to the world, a table or a part, robots' bases among them, and F geoms of a scene that follow its tables.
Terms may move, turn and resize them: they are where they are in each world.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from mjx_arenas import geometry
from mjx_arenas.furniture import standing, surfaces
from mjx_arenas.furniture.standing import Standing
from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.rows import take
from mjx_arenas.sample import moving, tops
from mjx_arenas.sample.dropping import FLUSH
from mjx_arenas.sample.moving import Moving
from mjx_arenas.sample.tops import Ground
from mjx_arenas.spec import follow
from mjx_arenas.spec.follow import Follower


class Near(NamedTuple):
    """What N things stay near to: points, in the frames in which they are (host)."""

    on: np.ndarray = np.zeros(0, int)  # (N,) index of the frame, as of `Fixed.on`
    at: np.ndarray = np.zeros((0, 2))  # (N, 2) where it is there [m]
    moving: Moving | None = None  # bodies that terms move, as rows of `at`, whose numbers are nominal


class Fixed(NamedTuple):
    """The geoms that are fixed, in the frames in which they are (host)."""

    on: np.ndarray  # (B,) index of a table or surface, S + p: part p's frame, -1: the world
    hangs: np.ndarray  # (B,) bool: it moves with the middle of the table's slab, not with the top
    pose: np.ndarray  # (B, 3) x, y, yaw of the box around it, in that frame
    half: np.ndarray  # (B, 2) its half sides [m]
    z: np.ndarray  # (B, 2) its lowest and highest z [m], above the slab's middle or the frame's origin
    round: np.ndarray  # (B,) bool: seen from above it is a disc
    carries: (
        np.ndarray
    )  # (B,) bool: on its body of the world actuators move something, or it is attached and has joints: a robot's base
    under: np.ndarray  # (B,) bool: it hangs at the underside of what it is on, from which `z` counts
    names: tuple[str, ...]  # (B,) what messages call it
    floor: float | None = None  # height of the highest level plane [m]; None: there is none
    near: Near = Near()  # (P,) what parts stay near to
    moving: Moving | None = None  # those that terms move; the numbers of these are nominal here
    group: np.ndarray = np.zeros(0, int)  # (B,) which of `presence` each is of; -1: it is always there
    presence: Callable[[ArenaParams], Array] | None = None  # what is there in a world, bool; None: all
    gone: np.ndarray = np.zeros(0, bool)  # (B,) bool: it is absent in all worlds


NONE = np.zeros(0)
NOTHING = Fixed(
    NONE.astype(int),
    NONE.astype(bool),
    NONE.reshape(0, 3),
    NONE.reshape(0, 2),
    NONE.reshape(0, 2),
    NONE.astype(bool),
    NONE.astype(bool),
    NONE.astype(bool),
    (),
)
"""No such geom, and no floor."""


def names(fixed: Fixed, follows: Sequence[Follower]) -> list[str]:
    """(B + F,) what messages call them."""
    return [*fixed.names, *(repr(one.geom) for one in follows)]


def standing_of(fixed: Fixed, follows: Sequence[Follower], ground: Ground, params: ArenaParams) -> Standing:
    """The boxes around them (B + F,) in one world."""
    found = [based(fixed, ground, params)] if len(fixed.on) else []
    found += [following(follows, params)] if follows else []
    xp = array_module(params.table_rots)
    return Standing(*map(xp.concatenate, zip(*found, strict=True)))


def frames(ground: Ground, params: ArenaParams) -> tuple[Array, Array, Array]:
    """Origins (N, 3), yaws (N,) and presence (N,) of tops and surfaces, then parts; the world is last, where an index of -1 finds it."""
    every, dtype, xp = tops.surfaces(params, ground), params.table_rots.dtype, array_module(params.table_rots)
    others = [*standing.frames(ground.furniture, params), standing.WORLD]
    offset = xp.concatenate([every.top, *(xp.asarray(f.pos, dtype)[None] for f in others)])
    rot = xp.concatenate([every.rot, xp.stack([xp.asarray(f.rot, dtype) for f in others])])
    return offset, rot, xp.concatenate([every.there, xp.stack([xp.asarray(f.there) for f in others])])


def points(near: Near, ground: Ground, params: ArenaParams) -> Array:
    """(N, 2) where in one world that is to which something stays near [m]."""
    xp = array_module(params.table_rots)
    offset, rot, _ = (x[xp.asarray(near.on)] for x in frames(ground, params))
    return offset[:, :2] + geometry.rotate_yaw(rot, xp.asarray(_at(near, params), offset.dtype))


def levels(near: Near, ground: Ground, params: ArenaParams) -> Array:
    """(N,) heights of these points in one world, up to a number for each that is the same in all worlds [m]."""
    xp = array_module(params.table_rots)
    height = frames(ground, params)[0][xp.asarray(near.on), 2]
    if near.moving is None:
        return height
    own, index = moving.boxes(near.moving, params).z[:, 0], np.zeros(len(near.at), int)
    index[near.moving.at] = 1 + np.arange(len(near.moving.at))
    return height + take(xp.concatenate([xp.zeros(1, own.dtype), own]), index)


def _at(near: Near, params: ArenaParams) -> Array:
    """(N, 2) the same in their frames."""
    if near.moving is None:
        return near.at
    index = np.arange(len(near.at))
    index[near.moving.at] = len(index) + np.arange(len(near.moving.at))
    own = moving.boxes(near.moving, params).pose[:, :2]
    xp = array_module(own)
    return take(xp.concatenate([xp.asarray(near.at, own.dtype), own]), index)


def based(fixed: Fixed, ground: Ground, params: ArenaParams) -> Standing:
    """The boxes around what is fixed (B,) in one world."""
    xp, dtype, n_tables = array_module(params.table_rots), params.table_rots.dtype, len(params.table_rots)
    offsets, rots, those_there = frames(ground, params)
    thick = xp.concatenate([params.table_full_sizes[:, 2], xp.zeros(len(rots) - n_tables, dtype)])
    if fixed.under.any() and ground.furniture:
        boxes, of = standing.standing(ground.furniture, params).full_size[:, 2], surfaces.boxes(ground.furniture)
        own = xp.where(of >= 0, boxes[of], 0.0)
        rest = xp.zeros(len(rots) - n_tables - len(of), dtype)
        thick = xp.concatenate([thick[:n_tables], own.astype(dtype), rest])
    on = xp.asarray(fixed.on)  # of JAX's own kind of integers, where that is tracing
    offset, rot, there, thick = (x[on] for x in (offsets, rots, those_there, thick))
    pose, half, z = (xp.asarray(x, dtype) for x in _boxes(fixed, params))
    xy = offset[:, :2] + geometry.rotate_yaw(rot, pose[:, :2])
    high = offset[:, 2] + z[:, 1] - xp.where(fixed.hangs, thick / 2, 0.0) - xp.where(fixed.under, thick, 0.0)
    size = xp.concatenate([2 * half, (z[:, 1] - z[:, 0])[:, None]], axis=-1)
    return Standing(xp.concatenate([xy, high[:, None]], axis=-1), rot + pose[:, 2], size, there & _there(fixed, params))


def _there(fixed: Fixed, params: ArenaParams) -> Array:
    """(B,) bool: it does not come and go, or is there in this world."""
    if fixed.presence is None or not (fixed.group >= 0).any():
        return ~fixed.gone
    present, xp = fixed.presence(params), array_module(params.table_rots)
    return take(xp.concatenate([present, np.ones(1, bool)]), np.where(fixed.group < 0, len(present), fixed.group))


def _boxes(fixed: Fixed, params: ArenaParams) -> tuple[Array, Array, Array]:
    """`pose` (B, 3), `half` (B, 2) and `z` (B, 2) in one world."""
    nominal, moves = (fixed.pose, fixed.half, fixed.z), fixed.moving
    if moves is None or (moves.at < 0).all():
        return nominal
    own, (pose, half, z) = moves.at >= 0, moving.boxes(moves, params)
    index = np.arange(len(fixed.on))
    index[moves.at[own]] = len(index) + np.flatnonzero(own)
    xp, dtype = array_module(pose), pose.dtype
    found = zip(nominal, (pose, half, z - np.array([[0.0, FLUSH]], dtype)), strict=True)
    pose, half, z = (take(xp.concatenate([xp.asarray(a, dtype), b]), index) for a, b in found)
    return pose, half, z


def floor(fixed: Fixed, params: ArenaParams) -> Array | None:
    """() height of the highest level plane in one world [m]; None: there is none."""
    moves = fixed.moving
    if moves is None or (moves.at >= 0).all():
        return None if fixed.floor is None else np.asarray(fixed.floor)
    own = moving.boxes(moves, params).z[moves.at < 0].sum(-1) / 2
    xp = array_module(own)
    others = [] if fixed.floor is None else [xp.asarray([fixed.floor], own.dtype)]
    return xp.concatenate([own, *others]).max()


def of_world(fixed: Fixed, params: ArenaParams) -> Fixed:
    """What is fixed, with the numbers of one world (host)."""
    pose, half, z = (np.asarray(x) for x in _boxes(fixed, params))
    level, gone = floor(fixed, params), ~np.asarray(_there(fixed, params))
    own = fixed._replace(pose=pose, half=half, z=z, floor=None if level is None else float(level), gone=gone)
    return own._replace(moving=None, presence=None, near=Near(fixed.near.on, np.asarray(_at(fixed.near, params))))


def following(follows: Sequence[Follower], params: ArenaParams) -> Standing:
    """The boxes around geoms that follow tables (F,) in one world."""
    tables = np.array([one.table for one in follows])
    xp, (pos, half) = array_module(params.table_rots), follow.extents(follows, params)
    offset, rot = params.table_offsets[tables], params.table_rots[tables]
    xy = offset[:, :2] + geometry.rotate_yaw(rot, pos[:, :2])
    high = offset[:, 2] - params.table_full_sizes[tables, 2] / 2 + pos[:, 2] + half[:, 2]
    there = params.table_active[tables] & np.array([one.collides for one in follows])
    return Standing(xp.concatenate([xy, high[:, None]], axis=-1), rot, 2 * half, there)
