"""From the configuration of an arena to its `mujoco.MjSpec` (host)."""

import os
from collections.abc import Sequence
from importlib import resources
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
    text = os.fspath(xml)
    is_text = text.lstrip().startswith("<")
    if not is_text and not os.path.isfile(text):
        raise FileNotFoundError(f"`xml`: there is no file {text!r}.")
    try:
        spec = mujoco.MjSpec.from_string(text) if is_text else mujoco.MjSpec.from_file(text)
    except ValueError as error:
        what = "the MJCF text" if is_text else repr(text)
        raise ValueError(f"`xml`: MuJoCo cannot read {what}: {' '.join(str(error).split())}") from None
    if spec.compiler.fusestatic:
        raise ValueError('`xml`: <compiler fusestatic="true"/> would dissolve the tables\' bodies; remove it.')
    return spec


def add_tables(spec: mujoco.MjSpec, tables: Sequence[TableNames], priority: int, condim: int) -> None:
    """Adds the elements of the tables; takes over those that the base MJCF has, as robosuite's `TableArena` does."""
    floor = spec.geom("floor")
    if floor is not None and floor.parent.name == "world":
        floor.pos = (0, 0, 0)
    materials = {m.name for m in spec.materials}
    for names in tables:
        body = spec.body(names.body) or spec.worldbody.add_body(name=names.body)
        if body.parent.name != "world" or list(body.joints) or body.mocap:
            raise ValueError(f"`xml`: body {names.body!r} must be a fixed child of the world to serve as a table.")
        # Of a massless body without this, MuJoCo's compiler would put the inertial frame where the body stands in the
        # world.
        _set(body, explicitinertial=True, mass=0, inertia=(0, 0, 0), ipos=(0, 0, 0), iquat=(1, 0, 0, 0))
        collision = _geom(spec, body, names.collision)
        _set(
            collision,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            group=0,
            contype=1,
            conaffinity=1,
            condim=condim,
            priority=priority,
        )
        _set(collision, rgba=COLLISION_RGBA, material="")
        for name in (names.visual, *names.legs):
            is_leg = name in names.legs
            geom = _geom(spec, body, name)
            _set(geom, type=mujoco.mjtGeom.mjGEOM_CYLINDER if is_leg else mujoco.mjtGeom.mjGEOM_BOX)
            _set(geom, group=1, contype=0, conaffinity=0)
            material = "table_legs_metal" if is_leg else "table_ceramic"
            if not geom.material and material in materials:
                geom.material = material
        top = spec.site(names.top) or body.add_site(name=names.top)
        _set(top, size=(0.001, 0.001, 0.001), rgba=(0, 0, 0, 0))


def _geom(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str) -> mujoco.MjsGeom:
    """The geom of that name, massless and in its body's frame."""
    geom = spec.geom(name) or body.add_geom(name=name)
    _set(geom, mass=0, pos=(0, 0, 0), quat=(1, 0, 0, 0), margin=0, gap=0)
    return geom


def _set(element: object, **attributes: object) -> None:
    for name, value in attributes.items():
        setattr(element, name, value)


def add_objects(spec: mujoco.MjSpec, objects: Sequence[Object]) -> None:
    """Adds the free bodies, without their poses."""
    for k, obj in enumerate(objects):
        body = spec.worldbody.add_body(name=obj.name)
        body.add_freejoint(name=f"{obj.name}_joint0")
        geom = body.add_geom(name=f"{obj.name}_g0", type=GEOM_TYPES[obj.type], size=obj.geom_size, quat=obj.geom_quat)
        _set(geom, density=obj.density, friction=obj.friction, condim=obj.condim)
        geom.rgba = (*PALETTE[k % len(PALETTE)], 1.0) if obj.rgba is None else obj.rgba


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
    elements = {(e.tag, e.get("name")): e for e in root.find("worldbody").iter()}  # type: ignore[union-attr]
    for body in (*(t.body for t in tables), *(o.name for o in objects)):
        _write(elements["body", body], spec.body(body), "pos", "quat")
    for names in tables:
        _write(elements["site", names.top], spec.site(names.top), "pos")
        _write(elements["geom", names.collision], spec.geom(names.collision), "size", "friction")
        _write(elements["geom", names.visual], spec.geom(names.visual), "size")
        for leg in names.legs:
            _write(elements["geom", leg], spec.geom(leg), "pos", "size")
    for obj in objects:
        _write(elements["geom", f"{obj.name}_g0"], spec.geom(f"{obj.name}_g0"), "quat", "size", "friction")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _write(element: ElementTree.Element, of: object, *attributes: str) -> None:
    for name in attributes:
        element.set(name, " ".join(f"{x:.9g}" for x in np.asarray(getattr(of, name))))
