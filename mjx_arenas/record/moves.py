"""The fixed geoms that terms move, turn or resize, and the numbers from which these follow (host)."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.params.params import ArenaParams
from mjx_arenas.sample import moving
from mjx_arenas.sample.moving import FIELDS, Deciding, Moving
from mjx_arenas.terms.following import Following
from mjx_arenas.terms.furniture import Furniture
from mjx_arenas.terms.objects import Objects
from mjx_arenas.terms.parts import Parts
from mjx_arenas.terms.tables import Tables

_KNOWN = Tables, Objects, Following, Furniture
"""Terms that move the frames in which geoms are, or geoms of which placement knows."""


Element = tuple[str, int]
"""A "geom" or a "body", and its index."""


@dataclasses.dataclass(frozen=True)
class Frame:
    """The frame of something that is fixed in the nominal arena."""

    origin: np.ndarray  # (3,)
    axes: np.ndarray  # (3, 3) as columns


@dataclasses.dataclass(frozen=True)
class Moves:
    """What terms decide of fixed geoms, beside those of tables, objects and furniture."""

    model: mujoco.MjModel
    terms: tuple[Deciding, ...] = ()
    rows: tuple[Any, ...] = ()  # of the terms, in order

    @classmethod
    def of(cls, model: mujoco.MjModel, parts: Parts, nominal: ArenaParams | None) -> "Moves":
        """The moves of a compiled arena. Without `nominal` nothing moves."""
        bound = [] if nominal is None else [t.bind(model) for t in parts.terms if not isinstance(t, _KNOWN)]
        found = [(one, moving.deciding(one, nominal)) for one in bound if nominal is not None]
        found = [(one, rows) for one, rows in found if rows]
        return cls(model, tuple(one for one, _ in found), tuple(row for _, rows in found for row in rows))

    def decided(self, name: str) -> np.ndarray:
        """(n,) bool: elements of which a term decides one of the numbers in a field."""
        found = np.zeros(getattr(self.model, name).shape, bool)
        for row in self.rows:
            if row.field == name:
                found.reshape(-1)[row.elements.reshape(-1)] = True
        return np.asarray(found.any(-1))

    def geoms(self, turned: bool = False) -> np.ndarray:
        """(ngeom,) bool: they, or what they hang on, move, turn or change their size; or with `turned`, turn."""
        model = self.model
        bodies = self.bodies if not turned else self.decided("body_quat")
        for b in range(1, model.nbody):  # parents come first
            bodies[b] |= bodies[model.body_parentid[b]]
        own = [self.decided(name) for name in (("geom_quat",) if turned else FIELDS[2:])]
        return bodies[model.geom_bodyid] | np.any(own, axis=0)

    @property
    def bodies(self) -> np.ndarray:
        """(nbody,) bool: they move or turn in the frame of their parent."""
        return self.decided("body_pos") | self.decided("body_quat")

    def moving(self, data: mujoco.MjData, at: Sequence[int], of: Sequence[Element], frames: Sequence[Frame]) -> Moving:
        """Geoms, and bodies as points, each a row `at` of something, in the frames in which they stand; `data` is nominal."""
        model = self.model
        chains = [self._chain(element) for element in of]
        depth = max(map(len, chains)) + 2  # what they stand on, and the geom
        pos, turn = np.zeros((len(of), depth, 3)), np.tile([1.0, 0, 0, 0], (len(of), depth, 1))
        where = {name: np.full((*pos.shape[:2], getattr(model, name).shape[1]), -1) for name in FIELDS}
        kinds, size = np.full(len(of), mujoco.mjtGeom.mjGEOM_SPHERE), np.zeros((len(of), 3))
        for i, ((what, g), chain, frame) in enumerate(zip(of, chains, frames, strict=True)):
            base = model.body_parentid[chain[-1]] if chain else model.geom_bodyid[g]
            pos[i, 0] = frame.axes.T @ (data.xpos[base] - frame.origin)
            mujoco.mju_mat2Quat(turn[i, 0], (frame.axes.T @ data.xmat[base].reshape(3, 3)).reshape(-1))
            links = [("body", b) for b in reversed(chain)]
            if what == "geom":
                links.append((what, g))
                kinds[i], size[i] = model.geom_type[g], model.geom_size[g]
                where["geom_size"][i, 0] = self._places("geom_size", g)
            for d, (kind, index) in enumerate(links, 1):
                pos[i, d], turn[i, d] = getattr(model, f"{kind}_pos")[index], getattr(model, f"{kind}_quat")[index]
                for name in (f"{kind}_pos", f"{kind}_quat"):
                    where[name][i, d] = self._places(name, index)
        numbers = np.concatenate([pos.reshape(-1), turn.reshape(-1), size.reshape(-1)])
        places = [
            [where["body_pos"], where["geom_pos"]],
            [where["body_quat"], where["geom_quat"]],
            [where["geom_size"][:, 0]],
        ]
        decided = np.concatenate([np.max(some, axis=0).reshape(-1) for some in places])
        source = np.where(decided < 0, np.arange(len(numbers)), len(numbers) + decided)
        points = tuple(self._points(g) if what == "geom" else None for what, g in of)
        return Moving(np.array(at), kinds, points, numbers, source, self.terms)

    def _chain(self, element: Element) -> list[int]:
        """The bodies from one, or from that of a geom, up to the last that moves."""
        what, index = element
        found, body, moves = [], int(self.model.geom_bodyid[index]) if what == "geom" else index, self.bodies
        while body:
            found.append(body)
            body = int(self.model.body_parentid[body])
        while found and not moves[found[-1]]:
            found.pop()
        return found

    def _places(self, name: str, index: int) -> np.ndarray:
        """(c,) where the terms' numbers, one after the other, have an element's; -1: no term decides it."""
        width = getattr(self.model, name).shape[1]
        found, first = np.full(width, -1), 0
        for row in self.rows:
            if row.field == name:
                elements, source = row.elements.reshape(-1), row.source.reshape(-1)
                own = elements // width == index
                found[elements[own] % width] = first + source[own]
            first += row.values.size
        return found

    def _points(self, geom: int) -> np.ndarray | None:
        """(V, 3) corners of the hull of a mesh."""
        model = self.model
        if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
            return None
        mesh = int(model.geom_dataid[geom])
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        points = model.mesh_vert[first : first + count]
        adr = model.mesh_graphadr[mesh]
        if adr >= 0:  # numvert, numface, where each vertex of the hull has its edges, which vertices these are
            hull = int(model.mesh_graph[adr])
            points = points[model.mesh_graph[adr + 2 + hull : adr + 2 + 2 * hull]]
        return np.array(points, float)
