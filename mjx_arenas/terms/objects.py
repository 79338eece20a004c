"""Objects on tables: where they stand, how large, heavy and rough they are, and their colours. K objects."""

import dataclasses

import mujoco
import numpy as np

from mjx_arenas import geometry, shapes
from mjx_arenas.furniture import surfaces
from mjx_arenas.params.params import ArenaParams, Quantity, whole
from mjx_arenas.rows import take
from mjx_arenas.sample import placement
from mjx_arenas.sample.placement import Places
from mjx_arenas.sample.poses import Poses
from mjx_arenas.sample.variants import Variants, which
from mjx_arenas.spec import objects, specs
from mjx_arenas.spec.hanging import hangs_on
from mjx_arenas.spec.objects import VARIANTS, Measures, Object
from mjx_arenas.terms.tables import WZ
from mjx_arenas.terms.term import Depends, Row, TermQuantity, places, row

VARIANT = "object.variant"
"""What the numbers of an object's variants are called."""
_SIZE = frozenset({"object_full_sizes"})
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

    @property
    def numbers(self) -> tuple[TermQuantity, ...]:
        """Which variants of objects are there, and in which poses objects rest."""
        chosen = (_which_of(one, self.objects[one.object].name) for one in self.places.variants)
        return (*chosen, *(_pose_of(one, self.objects[one.object].name) for one in self.places.poses))

    def edit(self, spec: mujoco.MjSpec, params: ArenaParams) -> None:
        """Gives the objects of a spec the numbers of one world, at their nominal places, as if all were there."""
        pos, quat = placement.nominal_poses(self.places, params)
        sizes = shapes.geom_size(self.places.kind, params.object_full_sizes)
        for one in self.places.variants:
            _edit_variants(spec, self.objects[one.object].name, one, params)
        for k, (obj, measures) in enumerate(zip(self.objects, self.measures, strict=True)):
            body = spec.body(obj.name)
            specs.assign(body, pos=pos[k], quat=quat[k])
            if obj.kind == VARIANTS:
                continue
            if obj.kind == "mjcf":
                heavier = params.object_masses[k] / measures.mass
                _edit_mjcf(body, heavier, params.object_frictions[k], params.object_rgba[k])
                continue
            geom = spec.geom(obj.geom)
            specs.assign(geom, mass=params.object_masses[k], friction=params.object_frictions[k])
            geom.rgba = params.object_rgba[k]
            if obj.is_primitive:
                geom.size = sizes[k]

    def bind(self, model: mujoco.MjModel) -> "BoundObjects":
        """The objects' ids."""
        body = np.array([model.body(o.name).id for o in self.objects], int)
        first_qpos = np.array([model.joint(o.joint).qposadr[0] for o in self.objects], int).reshape(-1, 1)
        primitive = np.array([k for k, o in enumerate(self.objects) if o.is_primitive], int)
        geom = np.array([model.geom(self.objects[k].geom).id for k in primitive], int)
        mass = np.array([m.mass for m in self.measures], float)
        return BoundObjects(
            model, self.places, body, first_qpos + np.arange(7), hangs_on(model, body), primitive, geom, mass
        )


def _edit_variants(spec: mujoco.MjSpec, name: str, one: Variants, params: ArenaParams) -> None:
    k, chosen = one.object, int(which(one, params.terms))
    body, mass = spec.body(name), params.object_masses[k]
    given = one.kind[chosen] == "mjcf"  # by its file; of others the compiler makes the inertial from the geom
    body.explicitinertial = bool(given)
    if given:
        inertia = one.inertia[chosen] * mass / one.mass[chosen]
        specs.assign(body, mass=mass, ipos=one.ipos[chosen], iquat=one.iquat[chosen], inertia=inertia)
    else:
        specs.assign(body, mass=0, ipos=(np.nan, 0, 0), iquat=(1, 0, 0, 0), inertia=(0, 0, 0))
    sizes = shapes.geom_size(one.kind, one.full_size)
    for v in np.flatnonzero(np.isin(one.kind, shapes.PRIMITIVES)).tolist():
        spec.geom(one.geoms[v][0]).size = sizes[v]
    for v, (names, colours) in enumerate(zip(one.geoms, one.colours, strict=True)):
        for geom, colour in zip(map(spec.geom, names), colours, strict=True):
            specs.assign(geom, rgba=colour * params.object_rgba[k], mass=mass if v == chosen and not given else 0)
            if geom.contype or geom.conaffinity:
                geom.friction = params.object_frictions[k]


def _which_of(one: Variants, name: str) -> TermQuantity:
    """The quantity that says which of the variants of the object of a name is there."""
    known = ", ".join(f"{i} ({variant})" for i, variant in enumerate(one.names))
    quantity = Quantity("object", (), float, "", whole, f"the number of one of its variants: {known}")
    quantity = quantity._replace(limits=(0, len(one.names) - 1))
    return TermQuantity.of(one.quantity, VARIANT, (name,), quantity, np.zeros(1))


def _pose_of(one: Poses, name: str) -> TermQuantity:
    """The quantity that says in which of its poses the object of a name rests."""
    most = int(one.n_poses.max()) - 1
    quantity = Quantity("object", (), float, "", whole, f"the number of one of its poses, from 0 to {most}")
    return TermQuantity.of(one.quantity, "object.pose", (name,), quantity._replace(limits=(0, most)), np.zeros(1))


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

    @property
    def _chosen(self) -> Depends:
        return frozenset(one.quantity for one in self.places.variants)

    @property
    def _lying(self) -> Depends:
        return self._chosen | {one.quantity for one in self.places.poses}

    def rows(self, params: ArenaParams) -> list[Row]:
        """Poses, sizes, masses, friction and colours of the objects' elements."""
        if not len(self.body):
            return []
        return [*self._poses(params), *self._masses(params), *self._surfaces(params)]

    def _poses(self, params: ArenaParams) -> list[Row]:
        model, (pos, quat) = self.model, placement.nominal_poses(self.places, params)
        axes = np.arange(4) if self.places.tilts else WZ
        turn, below = quat[:, axes], surfaces.deciding(self.places.furniture)
        yaw = frozenset({"table_rots", "object_tables"}) | below | (self._lying if self.places.poses else frozenset())
        place = yaw | _SIZE | {"table_offsets", "table_full_sizes"} | self._lying
        found = [
            row("body_pos", places(model.body_pos.shape, self.body), pos, place),
            row("body_quat", places(model.body_quat.shape, self.body, axes), turn, yaw),
        ]
        for field in ("qpos0", "qpos_spring"):
            found.append(row(field, self.qpos[:, :3], pos, place))
            found.append(row(field, self.qpos[:, 3 + axes], turn, place))
        return found

    def _masses(self, params: ArenaParams) -> list[Row]:
        model, xp = self.model, geometry.array_module(params.object_masses)
        masses, sizes = params.object_masses, params.object_full_sizes
        kinds = self.places.kind[self.primitive]
        moments = shapes.inertia(kinds, take(sizes, self.primitive), take(masses, self.primitive))
        one = self.body[self.primitive]
        bodies = np.flatnonzero(self.owner >= 0)
        varied = self.body[[one.object for one in self.places.variants]]
        rest = np.setdiff1d(bodies, np.concatenate([one, varied]))
        heavier = masses / xp.asarray(self.mass, masses.dtype)
        part = take(heavier, self.owner[bodies]) * xp.asarray(model.body_mass[bodies], masses.dtype)
        found = [
            row("body_mass", places(model.body_mass.shape, bodies), part, _MASS | self._chosen),
            row("body_inertia", places(model.body_inertia.shape, one), moments, _MASS | _SIZE),
            *(row for one in self.places.variants for row in self._inertials(one, params)),
        ]
        if len(rest):
            nominal = xp.asarray(model.body_inertia[rest], masses.dtype)
            scaled = nominal * take(heavier, self.owner[rest])[:, None]
            found.append(row("body_inertia", places(model.body_inertia.shape, rest), scaled, _MASS))
        return found

    def _inertials(self, one: Variants, params: ArenaParams) -> list[Row]:
        """The inertials of an object that is one of several variants."""
        model, mass = self.model, params.object_masses[one.object]
        xp, body, chosen = geometry.array_module(mass), self.body[[one.object]], which(one, params.terms)
        ipos, iquat, each = (xp.asarray(x, mass.dtype) for x in (one.ipos, one.iquat, one.inertia / one.mass[:, None]))
        depends = frozenset({one.quantity})
        return [
            row("body_ipos", places(model.body_ipos.shape, body)[0], ipos[chosen], depends),
            row("body_iquat", places(model.body_iquat.shape, body)[0], iquat[chosen], depends),
            row("body_inertia", places(model.body_inertia.shape, body)[0], each[chosen] * mass, depends | _MASS),
        ]

    def _surfaces(self, params: ArenaParams) -> list[Row]:
        model, xp = self.model, geometry.array_module(params.object_rgba)
        kinds, sizes = self.places.kind[self.primitive], take(params.object_full_sizes, self.primitive)
        size = shapes.geom_size(kinds, sizes)
        ids = np.flatnonzero(self.owner[model.geom_bodyid] >= 0)
        owner = self.owner[model.geom_bodyid[ids]]
        collides = (model.geom_contype[ids] | model.geom_conaffinity[ids]) != 0
        friction = np.arange(params.object_frictions.size).reshape(-1, 3)[owner[collides]]
        own = np.where((self.places.kind == "mjcf")[owner, None], model.geom_rgba[ids], 1.0)
        for one in self.places.variants:
            rows = np.searchsorted(ids, [model.geom(name).id for name in one.all_geoms])
            own[rows] = np.concatenate(one.colours)
        colour = xp.asarray(own, params.object_rgba.dtype) * take(params.object_rgba, owner)
        elements = places(model.geom_friction.shape, ids[collides])
        return [
            row("geom_size", places(model.geom_size.shape, self.primitive_geom), size, _SIZE),
            row("geom_friction", elements, params.object_frictions, _FRICTION | self._chosen, friction),
            row("geom_rgba", places(model.geom_rgba.shape, ids), colour, _COLOUR | self._chosen),
        ]
