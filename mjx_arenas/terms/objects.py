"""Objects on tables: where they stand, how large, heavy and rough they are, and their colours. K objects."""

import dataclasses

import mujoco
import numpy as np

from mjx_arenas import geometry, shapes
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.rows import take
from mjx_arenas.sample import placement
from mjx_arenas.sample.placement import Places
from mjx_arenas.spec import objects, specs
from mjx_arenas.spec.objects import Measures, Object, geom_name, joint_name
from mjx_arenas.terms.tables import WZ
from mjx_arenas.terms.term import Row, places, row

_SIZE = frozenset({"object_full_sizes"})
_YAW = frozenset({"table_rots", "object_tables"})
_PLACE = _YAW | _SIZE | {"table_offsets", "table_full_sizes"}
_MASS = frozenset({"object_masses"})
_FRICTION = frozenset({"object_frictions"})
_COLOUR = frozenset({"object_rgba"})


@dataclasses.dataclass(frozen=True)
class Objects:
    """The objects of an arena."""

    objects: tuple[Object, ...]
    measures: tuple[Measures, ...]
    places: Places
    name = "objects"
    quantities = ("object_full_sizes", "object_masses", "object_frictions", "object_rgba", "object_tables")

    def edit(self, spec: mujoco.MjSpec, params: ArenaParams) -> None:
        """Gives the objects of a spec the numbers of one world, at their nominal places, as if all were there."""
        pos, quat = placement.nominal_poses(self.places, params)
        sizes = shapes.geom_size(self.places.kind, params.object_full_sizes)
        for k, (obj, measures) in enumerate(zip(self.objects, self.measures, strict=True)):
            body = spec.body(obj.name)
            specs.assign(body, pos=pos[k], quat=quat[k])
            if obj.type == "mjcf":
                heavier = params.object_masses[k] / measures.mass
                _edit_mjcf(body, heavier, params.object_frictions[k], params.object_rgba[k])
                continue
            geom = spec.geom(geom_name(obj.name))
            specs.assign(geom, mass=params.object_masses[k], friction=params.object_frictions[k])
            geom.rgba = params.object_rgba[k]
            if obj.is_primitive:
                geom.size = sizes[k]

    def bind(self, model: mujoco.MjModel) -> "BoundObjects":
        """The objects' ids."""
        body = np.array([model.body(o.name).id for o in self.objects], int)
        owner = np.full(model.nbody, -1)
        owner[body] = np.arange(len(body))
        for b in range(1, model.nbody):  # parents come first
            if owner[b] < 0:
                owner[b] = owner[model.body_parentid[b]]
        first_qpos = np.array([model.joint(joint_name(o.name)).qposadr[0] for o in self.objects], int).reshape(-1, 1)
        primitive = np.array([k for k, o in enumerate(self.objects) if o.is_primitive], int)
        geom = np.array([model.geom(geom_name(self.objects[k].name)).id for k in primitive], int)
        mass = np.array([m.mass for m in self.measures], float)
        return BoundObjects(model, self.places, body, first_qpos + np.arange(7), owner, primitive, geom, mass)


def _edit_mjcf(body: mujoco.MjsBody, heavier: float, friction: np.ndarray, tint: np.ndarray) -> None:
    objects.scale_mass(body, heavier)
    for geom in body.find_all("geom"):
        geom.rgba = np.asarray(geom.rgba) * tint
        if geom.contype or geom.conaffinity:
            geom.friction = friction


@dataclasses.dataclass(frozen=True)
class BoundObjects:
    """The objects of a compiled model."""

    model: mujoco.MjModel
    places: Places
    body: np.ndarray  # (K,)
    qpos: np.ndarray  # (K, 7) entries of qpos
    owner: np.ndarray  # (nbody,) the object that a body is part of; -1: of none
    primitive: np.ndarray  # (P,) indices of objects of one geom of variable size
    primitive_geom: np.ndarray  # (P,)
    mass: np.ndarray  # (K,) nominal [kg]

    def rows(self, params: ArenaParams) -> list[Row]:
        """Poses, sizes, masses, friction and colours of the objects' elements."""
        if not len(self.body):
            return []
        return [*self._poses(params), *self._masses(params), *self._surfaces(params)]

    def _poses(self, params: ArenaParams) -> list[Row]:
        model, (pos, quat) = self.model, placement.nominal_poses(self.places, params)
        turn = quat[:, ::3]
        found = [
            row("body_pos", places(model.body_pos.shape, self.body), pos, _PLACE),
            row("body_quat", places(model.body_quat.shape, self.body, WZ), turn, _YAW),
        ]
        for field in ("qpos0", "qpos_spring"):
            found.append(row(field, self.qpos[:, :3], pos, _PLACE))
            found.append(row(field, self.qpos[:, 3 + WZ], turn, _PLACE))
        return found

    def _masses(self, params: ArenaParams) -> list[Row]:
        model, xp = self.model, geometry.array_module(params.object_masses)
        masses, sizes = params.object_masses, params.object_full_sizes
        kinds = self.places.kind[self.primitive]
        moments = shapes.inertia(kinds, take(sizes, self.primitive), take(masses, self.primitive))
        one = self.body[self.primitive]
        bodies = np.flatnonzero(self.owner >= 0)
        rest = np.setdiff1d(bodies, one)
        heavier = masses / xp.asarray(self.mass, masses.dtype)
        part = take(heavier, self.owner[bodies]) * xp.asarray(model.body_mass[bodies], masses.dtype)
        found = [
            row("body_mass", places(model.body_mass.shape, bodies), part, _MASS),
            row("body_inertia", places(model.body_inertia.shape, one), moments, _MASS | _SIZE),
        ]
        if len(rest):
            nominal = xp.asarray(model.body_inertia[rest], masses.dtype)
            scaled = nominal * take(heavier, self.owner[rest])[:, None]
            found.append(row("body_inertia", places(model.body_inertia.shape, rest), scaled, _MASS))
        return found

    def _surfaces(self, params: ArenaParams) -> list[Row]:
        model, xp = self.model, geometry.array_module(params.object_rgba)
        kinds, sizes = self.places.kind[self.primitive], take(params.object_full_sizes, self.primitive)
        size = shapes.geom_size(kinds, sizes)
        ids = np.flatnonzero(self.owner[model.geom_bodyid] >= 0)
        owner = self.owner[model.geom_bodyid[ids]]
        collides = (model.geom_contype[ids] | model.geom_conaffinity[ids]) != 0
        friction = np.arange(params.object_frictions.size).reshape(-1, 3)[owner[collides]]
        own = np.where((self.places.kind == "mjcf")[owner, None], model.geom_rgba[ids], 1.0)
        colour = xp.asarray(own, params.object_rgba.dtype) * take(params.object_rgba, owner)
        elements = places(model.geom_friction.shape, ids[collides])
        return [
            row("geom_size", places(model.geom_size.shape, self.primitive_geom), size, _SIZE),
            row("geom_friction", elements, params.object_frictions, _FRICTION, friction),
            row("geom_rgba", places(model.geom_rgba.shape, ids), colour, _COLOUR),
        ]
