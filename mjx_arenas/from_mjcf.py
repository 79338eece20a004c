"""Tables that stand in a user's scene already (host)."""

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

from mjx_arenas import build, specs, validation
from mjx_arenas.parts import TableNames
from mjx_arenas.problems import Problem, problem

UPRIGHT = 1e-6  # sine of the largest tilt that is taken for none


def adopt_tables(
    spec: mujoco.MjSpec, tables: Sequence[str], priority: int
) -> tuple[list[TableNames], dict[str, np.ndarray]]:
    """Makes bodies of a scene tables of an arena; gives their names and nominal parameters.

    The body's frame moves to the middle of the slab; what else hangs on the body stays where it is.

    Raises:
        ValueError: for each name that is not a table.
    """
    if isinstance(tables, str) or not isinstance(tables, Sequence) or not tables:
        raise validation.error([problem("tables", "adopted", None, tables)])
    problems, slabs = [], []
    for name in tables:
        found = _slab(spec, name)
        if isinstance(found, Problem):
            problems.append(found)
        else:
            slabs.append(found)
    by_body: dict[str, list[str]] = {}
    for slab, name in zip(slabs, [n for n in tables if n not in {p.numbers["name"] for p in problems}], strict=True):
        by_body.setdefault(slab.parent.name, []).append(repr(name))
    twice = {body: names for body, names in by_body.items() if len(names) > 1}
    problems += [problem("tables", "adopted_twice", ("entry", b), name=b, names=twice[b]) for b in sorted(twice)]
    validation.raise_all(problems, "from_xml")
    for slab in slabs:
        slab.name = slab.name or f"{slab.parent.name}_collision"
    model = specs.compiled(spec.copy(), "xml")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    names, rows = [], []
    for slab in slabs:
        rows.append(_pose(model, data, slab.name))
        names.append(_adopt(spec, model, slab, priority))
    offsets, rots, sizes, frictions = (np.array(x, float) for x in zip(*rows, strict=True))
    params = {
        "table_offsets": offsets,
        "table_rots": rots,
        "table_full_sizes": sizes,
        "table_frictions": frictions,
        "has_legs": np.zeros(len(rots), bool),
        "table_active": np.ones(len(rots), bool),
    }
    return names, params


def _slab(spec: mujoco.MjSpec, name: str) -> mujoco.MjsGeom | Problem:
    """The geom on which things stand, or why there is none."""
    box = mujoco.mjtGeom.mjGEOM_BOX

    def wrong(rule: str, **numbers: object) -> Problem:
        return problem("tables", f"adopted_{rule}", ("entry", name), name=name, **numbers)

    body, slab = spec.body(name), spec.geom(name)
    if body is None and slab is None:
        return wrong("unknown", known=", ".join(repr(b.name) for b in spec.worldbody.bodies if b.name) or "none")
    if body is not None:
        boxes = [g for g in body.geoms if g.type == box and (g.contype or g.conaffinity)]
        if len(boxes) != 1:
            what = f"{len(boxes)} boxes that collide" if boxes else "no box that collides"
            shown = ", ".join(_kind(g) + (f" {g.name!r}" if g.name else "") for g in body.geoms) or "none"
            return wrong("boxes", what=what, known=shown)
        slab = boxes[0]
    elif slab.type != box:
        return wrong("kind", kind=_kind(slab))
    if not (slab.contype | slab.conaffinity) & 1:
        return wrong("masks", contype=slab.contype, conaffinity=slab.conaffinity)
    parent = slab.parent
    if parent.name == "world" or parent.parent.name != "world" or list(parent.joints) or parent.mocap:
        return wrong("moves", body=parent.name)
    if not parent.name:
        return wrong("unnamed")
    return wrong("frame") if parent.frame is not None or slab.frame is not None else slab


def _kind(geom: mujoco.MjsGeom) -> str:
    return mujoco.mjtGeom(geom.type).name[7:].lower()


def _pose(model: mujoco.MjModel, data: mujoco.MjData, name: str) -> tuple:
    """Offset, yaw, full size and friction of a slab."""
    geom = model.geom(name)
    axes, size = data.geom_xmat[geom.id].reshape(3, 3), geom.size
    if np.hypot(*axes[:2, 2]) > UPRIGHT or axes[2, 2] < 0:
        raise validation.error([problem("tables", "adopted_tilted", ("entry", name), name=name)])
    offset = data.geom_xpos[geom.id] + [0, 0, size[2]]
    return offset, np.arctan2(axes[1, 0], axes[0, 0]), 2 * size, geom.friction


def _unused_names(spec: mujoco.MjSpec, body: str, slab: str) -> TableNames:
    """Names of a table's elements, none of which the scene has."""
    geoms, sites, own = {g.name for g in spec.geoms}, {s.name for s in spec.sites}, body
    names = TableNames.of(own, 0, slab)
    while names.top in sites or not geoms.isdisjoint((names.visual, *names.legs)):
        own += "_"
        names = TableNames.of(own, 0, slab)
    return dataclasses.replace(names, body=body, adopted=True)


def _adopt(spec: mujoco.MjSpec, model: mujoco.MjModel, slab: mujoco.MjsGeom, priority: int) -> TableNames:
    """Makes a body a table: its frame becomes the slab's, and it gets the other elements of a table."""
    body, compiled = slab.parent, model.geom(slab.name)
    inverse = compiled.quat * [1, -1, -1, -1]
    pos = np.zeros(3)
    mujoco.mju_rotVecQuat(pos, -compiled.pos, inverse)
    frame = body.add_frame(pos=pos, quat=inverse)
    for kind in ("geoms", "sites", "bodies", "cameras", "lights", "frames"):
        for element in [e for e in getattr(body, kind) if e.frame is None and e not in (slab, frame)]:
            element.set_frame(frame)
    material, rgba, names = slab.material, np.array(slab.rgba), _unused_names(spec, body.name, slab.name)
    specs.assign(slab, pos=(0, 0, 0), quat=(1, 0, 0, 0), fromto=[np.nan] * 6, mass=0, priority=priority)
    slab.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    specs.assign(slab, material="", rgba=(*rgba[:3], 0.0))
    build.dress_table(spec, body, names, material)
    specs.assign(spec.geom(names.visual), rgba=rgba, material=material)
    return names
