"""Geoms of a scene that follow tables: where they are on the tables' bodies, and how long. F geoms."""

import dataclasses

import mujoco
import numpy as np

from mjx_arenas.geometry import array_module
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.spec import follow
from mjx_arenas.spec.follow import Follower
from mjx_arenas.terms.term import Row, places, row

_SIZE = frozenset({"table_full_sizes"})
_FLOOR = _SIZE | {"table_offsets"}


@dataclasses.dataclass(frozen=True)
class Following:
    """The geoms of an arena that follow its tables."""

    follows: tuple[Follower, ...]
    name = "follow"
    quantities = ()

    def edit(self, spec: mujoco.MjSpec, params: ArenaParams) -> None:
        """Gives the geoms of a spec the places and sizes of one world."""
        if not self.follows:
            return
        pos, half = follow.extents(self.follows, params)
        for one, at in zip(self.follows, pos, strict=True):
            spec.geom(one.geom).pos = at + one.shift
        for i, column, axis, by in zip(*follow.size_rows(self.follows), strict=True):
            geom = spec.geom(self.follows[i].geom)
            size = np.array(geom.size)
            size[column] = half[i, axis] - by
            geom.size = size

    def bind(self, model: mujoco.MjModel) -> "BoundFollowing":
        """The geoms' ids."""
        return BoundFollowing(self.follows, np.array([model.geom(f.geom).id for f in self.follows], int), model.ngeom)


@dataclasses.dataclass(frozen=True)
class BoundFollowing:
    """The same geoms of a compiled model."""

    follows: tuple[Follower, ...]
    geom: np.ndarray  # (F,)
    ngeom: int

    def rows(self, params: ArenaParams) -> list[Row]:
        """Places and sizes of the geoms."""
        if not self.follows:
            return []
        pos, half = follow.extents(self.follows, params)
        xp, dtype = array_module(pos), pos.dtype
        of, column, axis, by = follow.size_rows(self.follows)
        depends = _FLOOR if any("floor" in one.how for one in self.follows) else _SIZE
        shift = xp.asarray(np.array([one.shift for one in self.follows]), dtype)
        found = [row("geom_pos", places((self.ngeom, 3), self.geom), pos + shift, depends)]
        if len(of):
            at = places((self.ngeom, 3), self.geom)[of, column]
            found.append(row("geom_size", at, half[of, axis] - xp.asarray(by, dtype), depends))
        return found
