"""From the configuration of an arena to its `mujoco.MjSpec` (host)."""

import os
import warnings
from collections.abc import Sequence
from importlib import resources
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.layout import TableNames, nominal_places
from mjx_arenas.objects import GEOM_TYPES, Object
from mjx_arenas.params import ArenaParams

# Okabe and Ito's colours, which colour-blind readers can tell apart.
PALETTE = (
    (0.0, 0.45, 0.70),
    (0.90, 0.62, 0.0),
    (0.0, 0.62, 0.45),
    (0.80, 0.47, 0.65),
    (0.84, 0.37, 0.0),
    (0.34, 0.71, 0.91),
)

COLLISION_RGBA = (0.5, 0.5, 0.0, 0.0)  # robosuite's colour, but not drawn: the visual geom has the same faces


def load_spec(xml: str | os.PathLike | None) -> mujoco.MjSpec:
    """The base arena: the MJCF file (or MJCF text) of the user, or our own.

    Raises:
        FileNotFoundError, ValueError: one sentence that names the file and what MuJoCo says of it.
    """
    if xml is None:
        return mujoco.MjSpec.from_string(resources.files("mjx_arenas").joinpath("assets/arena.xml").read_text())
    if not isinstance(xml, (str, os.PathLike)):
        raise TypeError(f"`xml` must be a path or MJCF text, got {xml!r}.")
    text = os.fspath(xml)
    is_text = text.lstrip().startswith("<")
    if not is_text and not os.path.isfile(text):
        raise FileNotFoundError(f"`xml`: there is no file {text!r}.")
    if is_text and "<mujoco" not in text:
        raise ValueError("`xml`: the text is not MJCF, whose root is <mujoco>.")
    try:
        spec = mujoco.MjSpec.from_string(text) if is_text else mujoco.MjSpec.from_file(text)
    except ValueError as error:
        what = "the MJCF text" if is_text else repr(text)
        raise ValueError(f"`xml`: MuJoCo cannot read {what}: {' '.join(str(error).split())}") from None
    return spec


def add_tables(spec: mujoco.MjSpec, tables: Sequence[TableNames], priority: int, condim: int) -> None:
    """Adds the elements of the tables; those that the base MJCF has are made anew, and keep their material.

    The MJCF's `<default>`s do not reach them: a table is the same in every base arena.
    """
    floor = spec.geom("floor")
    if floor is not None and floor.parent.name == "world":
        floor.pos = (0, 0, 0)
    materials = {m.name for m in spec.materials}
    for names in tables:
        body = spec.body(names.body) or spec.worldbody.add_body(name=names.body)
        if body.parent.name != "world" or body.frame is not None or list(body.joints) or body.mocap:
            raise ValueError(
                f"`xml`: body {names.body!r} must be a fixed child of the world, without a frame, to serve as a table."
            )
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        # Of a massless body without this, MuJoCo's compiler would put the inertial frame where the body stands in the world.
        _set(body, explicitinertial=True, mass=0, inertia=(0, 0, 0), ipos=(0, 0, 0), iquat=(1, 0, 0, 0))
        for name in (names.collision, names.visual, *names.legs):
            is_leg, collides = name in names.legs, name == names.collision
            own = _remove(spec, body, name, spec.geom(name))
            geom = _add_geom(body, name, mujoco.mjtGeom.mjGEOM_CYLINDER if is_leg else mujoco.mjtGeom.mjGEOM_BOX)
            _set(geom, mass=0, group=0 if collides else 1, contype=int(collides), conaffinity=int(collides))
            if collides:
                _set(geom, condim=condim, priority=priority, rgba=COLLISION_RGBA)
                continue
            default = "table_legs_metal" if is_leg else "table_ceramic"
            geom.material = own or (default if default in materials else "")
        _remove(spec, body, names.top, spec.site(names.top))
        top = body.add_site(name=names.top)
        top.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        _set(top, type=mujoco.mjtGeom.mjGEOM_SPHERE, quat=(1, 0, 0, 0), group=0, size=(0.001,) * 3, rgba=(0, 0, 0, 0))


def _remove(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, element: Any) -> str:
    """Deletes a table's element that the base MJCF has; gives the name of its material."""
    if element is None:
        return ""
    if element.parent.name != body.name:
        raise ValueError(f"`xml`: {name!r} must be on body {body.name!r} to serve as a part of that table.")
    material = element.material
    spec.delete(element)
    return material


# What decides the physics of a geom, and would otherwise come from the `<default>`s of the base MJCF.
_GEOM_PHYSICS = (
    *("pos", "quat", "fromto", "contype", "conaffinity", "condim", "group", "priority", "friction", "solmix", "solref"),
    *("solimp", "margin", "gap", "mass", "density", "typeinertia", "meshname", "fluid_ellipsoid", "material", "rgba"),
)


def _add_geom(body: mujoco.MjsBody, name: str, type: mujoco.mjtGeom) -> mujoco.MjsGeom:
    """A geom with MuJoCo's own defaults."""
    geom, plain = body.add_geom(name=name), mujoco.MjSpec().worldbody.add_geom()
    for attribute in _GEOM_PHYSICS:
        setattr(geom, attribute, getattr(plain, attribute))
    geom.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    geom.type = type
    return geom


def _set(element: object, **attributes: object) -> None:
    for name, value in attributes.items():
        setattr(element, name, value)


def add_objects(spec: mujoco.MjSpec, objects: Sequence[Object]) -> None:
    """Adds the free bodies, without their poses; the MJCF's `<default>`s do not reach them either."""
    for k, obj in enumerate(objects):
        body = spec.worldbody.add_body(name=obj.name)
        joint = body.add_freejoint(name=f"{obj.name}_joint0")
        _set(joint, align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE, damping=np.zeros_like(joint.damping))
        _set(joint, stiffness=np.zeros_like(joint.stiffness), armature=0, frictionloss=0)
        geom = _add_geom(body, f"{obj.name}_g0", GEOM_TYPES[obj.type])
        _set(geom, size=obj.geom_size, quat=obj.geom_quat, density=obj.density)
        _set(geom, friction=obj.friction, condim=obj.condim)
        geom.rgba = (*PALETTE[k % len(PALETTE)], 1.0) if obj.rgba is None else obj.rgba


# What C MuJoCo derives from fields that are written, when it is told to, or uses as a short-cut; MJX reads none of it.
DERIVED_IN_C = frozenset({"bvh_aabb", "bvh_child", "bvh_nodeid", "geom_sameframe"})


def warn_of_nominal_places(model: mujoco.MjModel, objects: Sequence[Object]) -> None:
    """Warns of objects that start inside something, at the arena's nominal places."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    geoms = {model.geom(f"{o.name}_g0").id: o.name for o in objects}
    for contact in data.contact:
        if contact.dist < -1e-3 and not geoms.keys().isdisjoint(contact.geom):
            a, b = (geoms.get(g) or model.geom(g).name or f"geom {g}" for g in contact.geom)
            depth = f"{-contact.dist:.3f} m inside each other"
            warnings.warn(
                f"{a!r} and {b!r} start {depth} at their nominal places; `make_data` with keys draws free ones.",
                stacklevel=5,
            )
            return


def differing(a: mujoco.MjModel, b: mujoco.MjModel) -> set[str]:
    """Names of the numbers in which two compiled models differ, `stat.` for those of the statistics."""
    found = {
        f"stat.{n}" for n in ("center", "extent", "meansize", "meanmass", "meaninertia") if not _same(a.stat, b.stat, n)
    }
    for name in dir(a):
        if (
            not name.startswith("_")
            and isinstance(getattr(a, name), np.ndarray)
            and getattr(a, name).dtype.kind in "fiu"
        ):
            found |= set() if _same(a, b, name) else {name}
    return found


def _same(a: object, b: object, name: str) -> bool:
    return np.allclose(getattr(a, name), getattr(b, name), rtol=1e-9, atol=1e-12, equal_nan=True)


def elsewhere(params: ArenaParams) -> ArenaParams:
    """Another world, in which every parameter of every table is another, and all tables may have legs."""
    sizes = params.table_full_sizes * 1.1
    offsets = params.table_offsets + np.array([0.11, 0.07, 0.05])
    offsets[:, 2] = np.maximum(offsets[:, 2], sizes[:, 2])
    frictions = params.table_frictions * 1.1 + 0.01
    return ArenaParams(offsets, params.table_rots + 0.3, sizes, frictions, ~params.has_legs)


def set_params(
    spec: mujoco.MjSpec,
    tables: Sequence[TableNames],
    objects: Sequence[Object],
    object_tables: Sequence[int],
    params: ArenaParams,
) -> None:
    """Gives the elements of a spec the poses, sizes and frictions of one world (float64, on the host)."""
    geom = geometry.table(params.table_offsets, params.table_rots, params.table_full_sizes, params.has_legs)
    for t, names in enumerate(tables):
        _set(spec.body(names.body), pos=geom.body_pos[t], quat=geom.body_quat[t])
        for name in (names.collision, names.visual):
            spec.geom(name).size = geom.half_size[t]
        spec.geom(names.collision).friction = params.table_frictions[t]
        spec.site(names.top).pos = geom.top_pos[t]
        for k, name in enumerate(names.legs):
            _set(spec.geom(name), pos=geom.leg_pos[t, k], size=geom.leg_size[t, k], rgba=geom.leg_rgba[t, k])
    frac, pos = nominal_places(objects, object_tables)
    for k, (obj, t) in enumerate(zip(objects, object_tables, strict=True)):
        xy = frac[k] * geom.half_size[t, :2] + pos[k]
        place = geometry.on_table(
            params.table_offsets[t], params.table_rots[t], xy, np.float64(obj.rot), obj.half_size[2]
        )
        _set(spec.body(obj.name), pos=place[0], quat=place[1])


def world_xml(spec: mujoco.MjSpec, tables: Sequence[TableNames], objects: Sequence[Object]) -> str:
    """MJCF of a compiled spec, with the numbers of its tables and objects in full precision; MuJoCo writes six digits."""
    root = ElementTree.fromstring(spec.to_xml())
    _make_paths_absolute(root, spec.modelfiledir)
    elements = {(e.tag, e.get("name")): e for e in root.find("worldbody").iter()}  # type: ignore[union-attr]
    for body in (*(t.body for t in tables), *(o.name for o in objects)):
        _write(elements["body", body], spec.body(body), "pos", "quat")
    for names in tables:
        _write(elements["site", names.top], spec.site(names.top), "pos", "size")
        _write(elements["geom", names.collision], spec.geom(names.collision), "size", "friction")
        _write(elements["geom", names.visual], spec.geom(names.visual), "size")
        for leg in names.legs:
            _write(elements["geom", leg], spec.geom(leg), "pos", "size")
    for obj in objects:
        _write(elements["geom", f"{obj.name}_g0"], spec.geom(f"{obj.name}_g0"), "quat", "size", "friction")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _make_paths_absolute(root: ElementTree.Element, folder: str) -> None:
    """Files of assets by their absolute paths, so that the MJCF can be read from anywhere."""
    compiler = root.find("compiler")
    settings = {} if compiler is None else compiler.attrib
    shared = settings.pop("assetdir", "")
    directories = {"texture": settings.pop("texturedir", shared)}
    meshes = settings.pop("meshdir", shared)
    for element in root.iterfind("asset/*[@file]"):
        path = os.path.join(folder, directories.get(element.tag, meshes), element.attrib["file"])
        if os.path.exists(path):
            element.set("file", os.path.abspath(path))


def _write(element: ElementTree.Element, of: object, *attributes: str) -> None:
    for name in attributes:
        element.set(name, " ".join(f"{x:.9g}" for x in np.asarray(getattr(of, name))))
