"""All that objects can stand on: tables, surfaces of furniture, then tops of other objects; NumPy or JAX, one world at a time.

S surfaces, K objects. An object stands on tops of objects before it alone, so that none carries itself.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mjx_arenas import geometry
from mjx_arenas.furniture import surfaces as fixed
from mjx_arenas.furniture.part import Part
from mjx_arenas.furniture.surfaces import Surfaces
from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.sample.poses import Poses, sizes


class Carrier(NamedTuple):
    """An object on whose top others stand (host)."""

    object: int  # its index
    name: str
    round: bool  # whether the top is a disc
    share: tuple[float, float]  # nominal place, as a share of the half size of what it stands on ...
    pos: tuple[float, float]  # ... plus [m]
    rot: float  # nominal yaw there [rad]


class Ground(NamedTuple):
    """What objects stand on beside tables (host)."""

    furniture: tuple[Part, ...] = ()
    carriers: tuple[Carrier, ...] = ()
    poses: tuple[Poses, ...] = ()  # of the objects that may rest in several

    @property
    def order(self) -> list[int]:
        """Indices of the carriers, of which each may stand on those before it."""
        return sorted(range(len(self.carriers)), key=lambda i: self.carriers[i].object)


def surfaces(params: ArenaParams, ground: Ground) -> Surfaces:
    """All of a world, with objects at their nominal places."""
    found = fixed.surfaces(params, ground.furniture)
    if not ground.carriers:
        return found
    xp, n, more = array_module(params.table_rots), len(found.rot), len(ground.carriers)
    found = Surfaces(*(xp.concatenate([x, xp.zeros((more, *x.shape[1:]), x.dtype)]) for x in found))
    extents = sizes(ground.poses, (), params)
    for i in ground.order:
        one = ground.carriers[i]
        below = Surfaces(*(x[0] for x in found.of(params.object_tables[one.object][None])))
        share, pos, rot = (np.asarray(x, below.top.dtype) for x in (one.share, one.pos, one.rot))
        size = extents[one.object]
        xy = below.top[:2] + geometry.rotate_yaw(below.rot, share * (below.size / 2) + pos)
        top = xp.concatenate([xy, (below.top[2] + size[2])[None]])
        there = below.there & params.object_active[one.object]
        rows = (top, below.rot + rot, size[:2], there, xp.asarray(one.round))
        found = Surfaces(*(geometry.with_row(x, n + i, row) for x, row in zip(found, rows, strict=True)))
    return found


def may_stand(params: ArenaParams, ground: Ground) -> np.ndarray:
    """(K, S) bool: whether an object may stand there: on objects before it alone."""
    k, n = len(params.object_tables), len(params.table_rots) + fixed.count(ground.furniture)
    carriers = np.array([one.object for one in ground.carriers], int)
    return np.concatenate([np.ones((k, n), bool), carriers[None] < np.arange(k)[:, None]], axis=1)


def allowed(params: ArenaParams, ground: Ground) -> Array:
    """(K,) bool: each object stands where it may."""
    may, xp = may_stand(params, ground), array_module(params.object_tables)
    return (may & (xp.asarray(params.object_tables)[:, None] == np.arange(may.shape[1]))).any(-1)


def present(params: ArenaParams, ground: Ground) -> tuple[Array, Array]:
    """(T,) and (K,) bool: the tables and objects that are there. An object on something absent is absent, too."""
    there = geometry.pick(surfaces(params, ground).there, params.object_tables)
    if ground.carriers:
        there = there & allowed(params, ground)
    return params.table_active, params.object_active & there


def deciding(ground: Ground) -> frozenset[str]:
    """Names of the quantities that decide which tables and objects are there."""
    return fixed.presence(ground.furniture) | {"table_active", "object_active", "object_tables"}


def roots(params: ArenaParams, ground: Ground) -> Array:
    """(K,) index of the table or the surface of furniture on which each object stands, or the lowest of those below it."""
    on, n = params.object_tables, len(params.table_rots) + fixed.count(ground.furniture)
    if not ground.carriers:
        return on
    xp = array_module(on)
    of = xp.concatenate([np.arange(n), np.zeros(len(ground.carriers), int)]).astype(on.dtype)
    for i in ground.order:
        of = geometry.with_row(of, n + i, geometry.pick(of, on[ground.carriers[i].object][None])[0])
    return geometry.pick(of, on)


def carrying(params: ArenaParams, ground: Ground) -> Array:
    """(K,) index of the object on which each one stands; -1: on none."""
    n = len(params.table_rots) + fixed.count(ground.furniture)
    of = np.array([*[-1] * n, *(one.object for one in ground.carriers)])
    return geometry.pick(array_module(params.object_tables).asarray(of), params.object_tables)


def count(ground: Ground) -> int:
    """How many surfaces there are beside tables."""
    return fixed.count(ground.furniture) + len(ground.carriers)


def names(tables: Sequence[str], ground: Ground) -> list[str]:
    """(S,) of the tables' bodies, of the surfaces of furniture, and of objects on which others stand."""
    return [*fixed.names(tables, ground.furniture), *(one.name for one in ground.carriers)]


def label(index: int, tables: Sequence[int], ground: Ground) -> str:
    """What messages call one of them; `tables` as they call these (`problem.numbered`)."""
    first = len(tables) + fixed.count(ground.furniture)
    if index >= first:
        return f"object {ground.carriers[index - first].name!r}"
    return fixed.label(index, tables, ground.furniture)
