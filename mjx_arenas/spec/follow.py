"""Geoms of a scene that follow the slab of a table: legs that reach the floor, sides that keep to an edge.

F geoms. The formulas work in NumPy and in JAX.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from mjx_arenas.geometry import Array, array_module, less
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import Item, Problem, problem

ALONG = ("-", "+", "both")
_AXES = ("x", "y", "z")


@dataclasses.dataclass(frozen=True)
class Follow:
    """A geom of a scene that follows the slab of a table. Everything else on a table keeps its size and its distance from the middle.

    Args:
        geom: name of the geom.
        x: "-" or "+": it keeps its distance from the slab's edge on that side. "both": each of its ends keeps its distance from the edge on
            its side, so the geom grows with the slab. None: it keeps its distance from the middle.
        y: as `x`, along the slab's y axis.
        z: "+": it keeps its distance from the top. "-": it keeps its distance from the underside. "both": it grows with the slab. "floor":
            its upper end keeps its distance from the underside, and its lower end keeps its height above z = 0. None: it keeps its distance
            from the middle.
        table: body or slab of the table that it follows. None: the table to whose body the geom belongs. A geom of another fixed body is
            moved to the body of the table.
    """

    geom: str
    x: str | None = None
    y: str | None = None
    z: str | None = None
    table: str | None = None

    @property
    def item(self) -> Item:
        """Name of the geom in messages."""
        return "geom", self.geom

    def problems(self) -> list[Problem]:
        """What is wrong with its own numbers and names; empty if nothing is."""
        if not isinstance(self.geom, str) or not self.geom:
            return [problem("follow.geom", "text", None, self.geom)]
        found = []
        for axis, known in zip(_AXES, (ALONG, ALONG, (*ALONG, "floor")), strict=True):
            value = getattr(self, axis)
            if value is not None and value not in known:
                found.append(problem(f"follow.{axis}", "one_of", self.item, value, names=list(map(repr, known))))
        return found

    @property
    def grows(self) -> tuple[bool, bool, bool]:
        """Along which axes of the slab its length varies."""
        return self.x == "both", self.y == "both", self.z in ("both", "floor")


@dataclasses.dataclass(frozen=True)
class Follower:
    """A geom that follows a table, as it is nominally, in the frame of the slab's middle."""

    geom: str
    table: int
    how: tuple[str | None, str | None, str | None]  # along x, y, z
    pos: tuple[float, float, float]  # middle of its extents [m]
    half: tuple[float, float, float]  # half extents [m]
    shift: tuple[float, float, float]  # from that middle to the geom's own [m]
    size: tuple[float, float, float]  # MuJoCo's `geom_size`
    axes: tuple[int, ...]  # of the slab along which each of its sizes is; -1: of a size that stays
    slab: tuple[float, float, float, float]  # full size of the table's slab, and the height of its top [m]
    collides: bool

    def moved(self, prefix: str, table: int, height: float) -> "Follower":
        """The same in another arena, whose names have a prefix, for another table that is moved up by a height [m]."""
        slab = (*self.slab[:3], self.slab[3] + height)
        return dataclasses.replace(self, geom=prefix + self.geom, table=table, slab=slab)


def _ends(how: Sequence[str | None]) -> np.ndarray:
    """(3, 2, 4) by how much each end goes along with the slab's half size and with the height of its middle."""
    found = np.zeros((3, 2, 4))
    for axis, one in enumerate(how):
        if one in ("-", "both"):
            found[axis, 0, axis] = -1
        if one in ("+", "both"):
            found[axis, 1, axis] = 1
        if one in ("-", "+"):
            found[axis] = found[axis].sum(0)
        if one == "floor":
            found[axis, 0, 3], found[axis, 1, axis] = -1, -1
    return found


def extents(follows: Sequence[Follower], params: ArenaParams) -> tuple[Array, Array]:
    """Middles (F, 3) and half extents (F, 3) [m] of geoms, in the frames of their slabs' middles; these may be negative."""
    xp, dtype = array_module(params.table_rots), params.table_full_sizes.dtype
    tables, slabs = np.array([f.table for f in follows]), np.array([f.slab for f in follows])
    half = less(params.table_full_sizes[tables] / 2, slabs[:, :3] / 2)
    height = less(params.table_offsets[tables, 2], slabs[:, 3]) - half[:, 2]
    slab = xp.concatenate([half, height[:, None]], axis=-1)
    ends = np.array([_ends(f.how) for f in follows])
    across, along = (
        (xp.asarray(by, dtype) * slab[:, None]).sum(-1) for by in (ends.mean(2), (ends[:, :, 1] - ends[:, :, 0]) / 2)
    )
    middle, size = (xp.asarray(np.array([getattr(f, name) for f in follows]), dtype) for name in ("pos", "half"))
    return middle + across, size + along


def long_enough(follows: Sequence[Follower], params: ArenaParams) -> Array:
    """(F,) bool: the geom's size is one."""
    half = extents(follows, params)[1]
    xp = array_module(half)
    least = xp.asarray(np.array([_least(f) for f in follows]), half.dtype)
    return (half > least).all(-1)


def _least(follow: Follower) -> list[float]:
    """(3,) that its half extents must exceed: a capsule's the radius."""
    own = {axis: half - size for half, size, axis in _own(follow)}
    return [own.get(axis, -1.0) for axis in range(3)]


def _own(follow: Follower) -> list[tuple[float, float, int]]:
    return [(follow.half[axis], size, axis) for size, axis in zip(follow.size, follow.axes, strict=True) if axis >= 0]


def size_rows(follows: Sequence[Follower]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The sizes that vary, (n,) each: of which geom, which of its sizes, along which axis, and what it is less than the half extent."""
    found = [
        (i, column, axis, f.half[axis] - f.size[column])
        for i, f in enumerate(follows)
        for column, axis in enumerate(f.axes)
        if axis >= 0
    ]
    of, column, axis, less_by = zip(*found, strict=True) if found else ((), (), (), ())
    return np.array(of, int), np.array(column, int), np.array(axis, int), np.array(less_by, float)
