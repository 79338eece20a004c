"""What may stand on a table: free bodies of one geom, or whole bodies from a file (host)."""

import dataclasses
import os
from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from mjx_arenas import shapes
from mjx_arenas.keywords import WithKnownArguments, near_file, nearest
from mjx_arenas.params.params import DENSITIES, QUANTITIES
from mjx_arenas.problem import Item, Problem, problem, under
from mjx_arenas.problems.messages import error
from mjx_arenas.spec import masses, names, scaled, specs, variants
from mjx_arenas.spec.extents import extents, volumes
from mjx_arenas.spec.place import Place
from mjx_arenas.spec.rigid import flatten

# Okabe and Ito's colours, which colour-blind readers can tell apart.
COLOURS = (
    (0.0, 0.45, 0.70),
    (0.90, 0.62, 0.0),
    (0.0, 0.62, 0.45),
    (0.80, 0.47, 0.65),
    (0.84, 0.37, 0.0),
    (0.34, 0.71, 0.91),
)
_GREY = mujoco.MjSpec().worldbody.add_geom().rgba  # of a geom that says nothing
DEFAULT_EXTENT = 0.05
DEFAULT_DENSITY = 1000.0
DEFAULT_FRICTION = (1.0, 0.005, 0.0001)

GEOM_TYPES = {**shapes.TYPES, "mesh": mujoco.mjtGeom.mjGEOM_MESH}
TYPES = (*GEOM_TYPES, "mjcf")
_ASKED = (*TYPES, "scene")  # which `from_xml` replaces by one of the others


def joint_name(name: str) -> str:
    """Name of an object's free joint, as in robosuite."""
    return f"{name}_joint0"


def geom_name(name: str) -> str:
    """Name of an object's one geom, as in robosuite, if it has one of its own."""
    return f"{name}_g0"


@dataclasses.dataclass(frozen=True)
class Object(WithKnownArguments):
    """A free body on a table, on a part of furniture or on another object.

    In the model it is the body `name` with the joint `{name}_joint0` and the geom `{name}_g0` (robosuite's names). The elements of an MJCF
    file have the prefix `{name}_`.

    Args:
        name: name of its body.
        type: "box", "sphere", "capsule" (lying on its side, along its x axis), "cylinder" (upright), "mesh", "mjcf" or "scene". A "scene"
            object is a free body that is already in the scene under that name (`from_xml`); it keeps its names, its place and its physics.
        full_size: (3,) extents along its x, y, z [m]. A box has its edges; a sphere (d, d, d) with its diameter d; a capsule (length with
            its caps, d, d); a cylinder (d, d, height). One number stands for all three. A mesh is scaled to this size. Default: 5 cm; for a
            mesh the size in its file.
        on: the table that it stands on, by index or by body name (in a scene, `from_xml`, also by the name of its slab). Or a surface of a
            part of furniture by name, such as "rack_board1" (`arena.surfaces` lists all). Or an earlier object that is a box or an upright
            cylinder.
        pos: (2,) nominal place [m] of its middle in the frame of the table's top or of the surface; keys draw other places. Default: the
            objects there are spread over it.
        rot: nominal yaw [rad] relative to that frame.
        density: [kg/m^3]. Default: 1000. An MJCF file has its own densities: give a `mass` instead.
        friction: (3,) sliding, torsional, rolling. Of two geoms, that with the higher priority decides; tables have a `table_priority`. Of
            equal ones the larger friction counts. Default: 1, 0.005, 0.0001; for an MJCF file its own.
        condim: `condim` of its contacts, where its priority is not the lower one. Default: 3; for an MJCF file its own.
        priority: `priority` of its geoms. Default: 0; for an MJCF file its own. With 1 and `table_priority=2` its friction counts in grips.
        rgba: (4,) colour. Default: one of a colour-blind safe palette. For an MJCF file it is a factor on the file's colours.
        file: for a mesh its file (OBJ, STL, MSH); for an MJCF body the file or a `mujoco.MjSpec`. The content of an MJCF worldbody becomes
            one free body, with its inner joints.
        mass: [kg]; give this or `density`.
        active: whether it is there nominally.
        place: restricts where on its table or surface it is placed; None: anywhere.
        pose: "upright": as its axes are. "resting": in one of its resting poses; `params.terms["{name}.pose"]` is the number of the pose,
            nominally the first. `arena.poses(name)` lists them. See docs/placement.md.
        variants: objects of which each world has one; `params.terms["{name}.variant"]` is its number, nominally the first. Their names name
            the variants. They must not have `on`, `pos`, `rot`, `active`, `place`, `pose` or variants of their own. Size, mass, friction,
            contacts and colour are given by the variants, not by the object. Geoms are called `{name}_{variant}_g0`; those of MJCF files
            have the prefix `{name}_{variant}_` and are on one rigid body. See docs/variants.md.
    """

    name: str
    type: str = "box"
    full_size: float | Sequence[float] | None = None
    on: int | str = 0
    pos: Sequence[float] | None = None
    rot: float = 0.0
    density: float | None = None
    friction: Sequence[float] | None = None
    condim: int | None = None
    rgba: Sequence[float] | None = None
    file: str | os.PathLike | mujoco.MjSpec | None = None
    mass: float | None = None
    active: bool = True
    place: Place | None = None
    pose: str = "upright"
    variants: "Sequence[Object] | None" = None
    priority: int | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.type, str) or self.type not in _ASKED:
            close = nearest(self.type, _ASKED) if isinstance(self.type, str) else None
            told = {"names": _ASKED, "near": f": {close!r} may be meant" if close else ""}
            raise error([problem("objects.type", "one_of", ("object", self.name), self.type, told)])

    @property
    def content(self) -> tuple[object, ...]:
        """Its name, its kind, and what it stays near, which identify it besides its measures and the rest of its place."""
        place = self.place or Place()
        return self.name, self.kind, place.near, tuple(map(float, place.distance))

    @property
    def kind(self) -> str:
        """Its type, or "variants"."""
        return self.type if self.variants is None else VARIANTS

    @property
    def slots(self) -> "tuple[Object, ...]":
        """Its variants as objects with names of their own."""
        return tuple(dataclasses.replace(one, name=f"{self.name}_{one.name}") for one in self.variants or ())

    @property
    def is_primitive(self) -> bool:
        """Whether its size may vary."""
        return self.kind in shapes.PRIMITIVES

    @property
    def joint(self) -> str:
        """Name of its free joint."""
        return joint_name(self.name)

    @property
    def geom(self) -> str:
        """Name of its one geom, if it has one of its own."""
        return geom_name(self.name)

    @property
    def tilt(self) -> tuple[float, float, float, float]:
        """Quaternion of its orientation before its yaw."""
        return (1.0, 0.0, 0.0, 0.0)

    def prefixed(self, prefix: str) -> "Object":
        """A copy whose name has a prefix."""
        return dataclasses.replace(self, name=prefix + self.name)

    def problems(self) -> list[Problem]:
        """Problems of this object."""
        if not isinstance(self.name, str) or not self.name:
            return [problem("objects.name", "object_name", ("object", self.name), self.name)]
        if found := names.problems("objects.name", self.name):
            return found
        if self.variants is not None:
            return [p._replace(item=("object", self.name)) for p in under("objects", variants.problems(self))]
        found = [] if self.type in TYPES else [problem("type", "one_of", None, self.type, names=TYPES)]
        found += self._size_problems() + self._file_problems() + self._number_problems()
        if self.mass is not None and self.density is not None:
            found.append(problem("", "either", first="mass", second="density"))
        if self.type == "mjcf" and self.density is not None:
            found.append(problem("density", "density_of_file", None, self.density))
        if self.condim not in (None, 1, 3, 4, 6):
            found.append(problem("condim", "condim", None, self.condim))
        if isinstance(self.priority, bool) or not isinstance(self.priority, (int, np.integer, type(None))):
            found.append(problem("priority", "must", None, self.priority, must="a whole number"))
        if not isinstance(self.active, (bool, np.bool_)):
            found.append(problem("active", "truth", None, self.active))
        if isinstance(self.place, Place):
            found += under("place", self.place.problems())
        elif self.place is not None:
            found.append(problem("place", "must", None, self.place, must="an mjx_arenas.Place or None"))
        if self.pose not in ("upright", "resting"):
            found.append(problem("pose", "must", None, self.pose, must="'upright' or 'resting'"))
        return [p._replace(item=("object", self.name)) for p in under("objects", found)]

    def _number_problems(self) -> list[Problem]:
        found = []
        for field, (name, rule) in _RULES.items():
            value, shape = getattr(self, field), rule.item
            if value is None and field != "rot":
                continue
            array = _floats(value)
            if array is None or array.shape != shape or not np.all(np.isfinite(array)):
                found.append(
                    problem(field, "vector" if shape else "number", None, value, n=shape[0] if shape else 0, unit="")
                )
            elif not rule.right(array).all():
                limits = rule.allowed is None or bool(np.all(rule.allowed(array)))
                found.append(problem(field, "limits" if limits else "must", None, value, quantity=name))
        return found

    def _size_problems(self) -> list[Problem]:
        if self.full_size is None:
            return []
        size, quantity = _floats(self.full_size), QUANTITIES["object_full_sizes"]
        rule = ""
        if self.type == "mjcf":
            rule = "of_file"
        elif size is None or size.shape not in ((), (3,)) or not np.all(np.isfinite(size) & (size > 0)):
            rule = "extents"
        elif not quantity.right(size).all():
            rule = "limits"
        elif not shapes.possible(np.array([self.type]), np.broadcast_to(size, (1, 3))).all():
            rule = self.type
        return [problem("full_size", rule, None, self.full_size, quantity="object_full_sizes")] if rule else []

    def _file_problems(self) -> list[Problem]:
        if self.type not in ("mesh", "mjcf"):
            return [] if self.file is None else [problem("file", "file_without_use", None, self.file)]
        if isinstance(self.file, mujoco.MjSpec) and self.type == "mjcf":
            return []
        if not isinstance(self.file, (str, os.PathLike)):
            return [problem("file", "file", None, self.file, kind="mesh" if self.type == "mesh" else "MJCF")]
        text = os.fspath(self.file)
        return [] if os.path.isfile(text) else [problem("file", "no_file", None, text, near=near_file(text))]


VARIANTS = "variants"
"""What the kind of an object is called that is one of several in each world."""
_RULES = {
    "pos": ("table_offsets", QUANTITIES["table_offsets"]._replace(item=(2,))),
    "rot": ("table_rots", QUANTITIES["table_rots"]),
    "density": ("object_densities", DENSITIES),
    "mass": ("object_masses", QUANTITIES["object_masses"]),
    "friction": ("object_frictions", QUANTITIES["object_frictions"]),
    "rgba": ("object_rgba", QUANTITIES["object_rgba"]),
}


@dataclasses.dataclass(frozen=True)
class Measures:
    """What one object is, as MuJoCo compiles it alone at its nominal size."""

    full_size: np.ndarray  # (3,) extents of what collides, along the body's axes [m]
    center: np.ndarray  # (3,) middle of those extents, in the body's frame [m]
    mass: float  # [kg]
    density: float  # [kg/m^3], the mean one of an MJCF body
    friction: np.ndarray  # (3,)
    rgba: np.ndarray  # (4,)


def add(spec: mujoco.MjSpec, obj: Object, index: int) -> None:
    """Adds the free body to a spec, without its pose; the `<default>`s of that spec do not reach it."""
    body = spec.worldbody.add_body(name=obj.name)
    joint = body.add_freejoint(name=joint_name(obj.name))
    specs.assign(joint, align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE, damping=np.zeros_like(joint.damping))
    specs.assign(joint, stiffness=np.zeros_like(joint.stiffness), armature=0, frictionloss=0)
    if obj.slots:
        body.simple = 0  # its centre of mass is its origin in some worlds, and not in others
    for i, one in enumerate(obj.slots or (obj,)):
        _fill(spec, body, one, index + i, rigid=bool(obj.slots))


def _fill(spec: mujoco.MjSpec, body: mujoco.MjsBody, obj: Object, index: int, rigid: bool) -> None:
    """Adds to a body what an object without variants is made of; where it is to be rigid, an MJCF's geoms alone, without mass."""
    if obj.type == "mjcf":
        _add_mjcf(spec, body, obj, rigid)
        return
    geom = specs.add_geom(body, geom_name(obj.name), GEOM_TYPES[obj.type])
    if obj.type == "mesh":
        mesh = _add_mesh(spec, f"{obj.name}_mesh", obj)
        geom.meshname = mesh.name
    else:
        size = np.broadcast_to(np.asarray(DEFAULT_EXTENT if obj.full_size is None else obj.full_size, float), (1, 3))
        geom.size = shapes.geom_size(np.array([obj.type]), size)[0]
        geom.quat = (np.sqrt(0.5), 0, np.sqrt(0.5), 0) if obj.type == "capsule" else (1, 0, 0, 0)
    if obj.mass is None:
        geom.density = DEFAULT_DENSITY if obj.density is None else obj.density
    else:
        geom.mass = obj.mass
    geom.condim, geom.priority = 3 if obj.condim is None else obj.condim, obj.priority or 0
    geom.friction = DEFAULT_FRICTION if obj.friction is None else obj.friction
    geom.rgba = (*COLOURS[index % len(COLOURS)], 1.0) if obj.rgba is None else obj.rgba


def _add_mesh(spec: mujoco.MjSpec, name: str, obj: Object) -> mujoco.MjsMesh:
    mesh = specs.add_mesh(spec, name, file=os.path.abspath(os.fspath(obj.file)))  # type: ignore[arg-type]
    if obj.full_size is not None:
        low, high = _extents(alone(dataclasses.replace(obj, full_size=None))[1])
        mesh.scale = np.broadcast_to(np.asarray(obj.full_size, float), (3,)) / (high - low)
    return mesh


def _add_mjcf(spec: mujoco.MjSpec, body: mujoco.MjsBody, obj: Object, rigid: bool) -> None:
    item: Item = ("object", obj.name)
    child = specs.read(obj.file, "objects.file", item)
    scaled.refuse(child, scaled.of_body(child.worldbody), "objects.file", item)
    free = [j for top in child.worldbody.bodies for j in top.joints if j.type == mujoco.mjtJoint.mjJNT_FREE]
    for one in (*free, *child.keys):
        child.delete(one)
    rules = [name for name in masses.mass_rules(child) if name.startswith(("bound", "settotal"))]
    if rules:
        raise error([problem("objects.file", "mass_rules", item, names=rules)])
    for geom in child.geoms:
        dress(child, geom, obj)
    if rigid:
        flatten(child, item)
    specs.attach(spec, child, f"{obj.name}_", body.add_frame(), "objects", item)
    if rigid:
        return
    if all(geom.parent.name != body.name for geom in body.find_all("geom")):
        specs.make_massless(body)
    if obj.mass is not None:
        scale_mass(body, obj.mass / alone(dataclasses.replace(obj, mass=None))[1].body_subtreemass[0])


def scale_mass(body: mujoco.MjsBody, factor: float) -> None:
    """Makes a body and all that hangs on it so many times as heavy, its inertias too."""
    for part in (body, *body.find_all("body")):
        part.mass *= factor
        part.inertia, part.fullinertia = np.asarray(part.inertia) * factor, np.asarray(part.fullinertia) * factor
    for geom in body.find_all("geom"):
        geom.density *= factor
        geom.mass *= factor  # NaN where the density decides


def addition_problems(spec: mujoco.MjSpec, objs: Sequence[Object], geoms: Mapping[str, Sequence[str]]) -> list[Problem]:
    """What was added to the bodies of objects of one geom, or of these geoms, that would not follow their numbers."""
    problems = []
    for obj in objs:
        body = spec.body(obj.name)
        if obj.kind == "mjcf" or body is None:
            continue
        own = geoms.get(obj.name, [obj.geom])
        added = [f"geom {g.name!r}" for g in body.geoms if g.name not in own]
        added += [f"body {b.name!r}" for b in body.bodies] + ["an inertial"] * bool(
            body.explicitinertial and obj.name not in geoms
        )
        if added:
            rule = "added_to_variants" if obj.name in geoms else "added"
            problems.append(problem("arena.spec", rule, ("object", obj.name), names=added))
    return problems


def measure(obj: Object, index: int) -> Measures:
    """Compiles an object alone.

    Raises:
        ValueError: one sentence with what is wrong with its file.
    """
    item: Item = ("object", obj.name)
    spec, model = alone(obj, index)
    hits = np.flatnonzero(_collides(model))
    if not len(hits):
        raise error([problem("objects.file", "ghost", item)])
    frictions = model.geom_friction[hits]
    if np.ptp(frictions, axis=0).any():
        raise error([problem("objects.file", "frictions", item)])
    low, high = _extents(model)
    mass = float(model.body_subtreemass[0])
    rgba = np.ones(4) if obj.type == "mjcf" else model.geom_rgba[0]
    return Measures(
        high - low, (high + low) / 2, mass, mass / volumes(spec, ["world"])[0], frictions[0], np.array(rgba, float)
    )


def alone(obj: Object, index: int = 0) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    """The spec and the model of an object alone."""
    spec = mujoco.MjSpec()
    add(spec, obj, index)
    return spec, specs.compiled(spec, "objects", ("object", obj.name))


def dress(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, obj: Object) -> None:
    """Gives a geom of an object the friction, contacts and colour asked for; MuJoCo draws a material's colour, now the geom's own."""
    if geom.material and np.array_equal(geom.rgba, _GREY):
        geom.rgba = spec.material(geom.material).rgba
    if obj.friction is not None:
        geom.friction = obj.friction
    if obj.condim is not None and (geom.contype or geom.conaffinity):
        geom.condim = obj.condim
    if obj.priority is not None:
        geom.priority = obj.priority
    if obj.rgba is not None:
        geom.rgba = np.asarray(geom.rgba) * obj.rgba


def _extents(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest coordinates (3,) of what collides, in the world, at `qpos0`."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return extents(model, data, _collides(model), np.zeros(3), np.eye(3))


def _collides(model: mujoco.MjModel) -> np.ndarray:
    """(ngeom,) bool."""
    return (model.geom_contype | model.geom_conaffinity) != 0


def _floats(value: object) -> np.ndarray | None:
    """The numbers, or None where they are none: text and truth values, which NumPy would take, too."""
    try:
        array = np.asarray(value)
        return None if array.dtype.kind in "USb" else array.astype(float)
    except (TypeError, ValueError):
        return None
