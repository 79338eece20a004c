"""Tables that stand in a user's scene already (host)."""

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

from mjx_arenas.build import assemble
from mjx_arenas.problem import Problem, problem
from mjx_arenas.rules import validation
from mjx_arenas.spec import specs
from mjx_arenas.spec.extents import extents
from mjx_arenas.terms.parts import Parts, TableNames

UPRIGHT = 1e-6  # sine of the largest tilt that is taken for none
RESTS = 0.01  # [m] from a table's top, at most: what stands there


def adopt_tables(
    spec: mujoco.MjSpec, tables: Sequence[str], priority: int
) -> tuple[list[TableNames], dict[str, np.ndarray]]:
    """Makes bodies of a scene tables of an arena; gives their names and nominal parameters.

    The body's frame moves to the middle of the slab; what else hangs on the body stays where it is.

    Raises:
        ValueError: for each name that is not a table.
    """
    if isinstance(tables, str) or not isinstance(tables, Sequence):
        raise validation.error([problem("tables", "adopted", None, tables)])
    problems, given = [], []
    for name in tables:
        found = _slab(spec, name)
        if isinstance(found, Problem):
            problems.append(found)
        else:
            given.append((name, found))
    problems += _shared_bodies([name for name, _ in given], [slab.parent.name for _, slab in given])
    slabs = [slab for _, slab in given]
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
    offsets, rots, sizes, frictions = zip(*rows, strict=True) if rows else ((), (), (), ())
    params = {
        "table_offsets": np.array(offsets, float).reshape(-1, 3),
        "table_rots": np.array(rots, float),
        "table_full_sizes": np.array(sizes, float).reshape(-1, 3),
        "table_frictions": np.array(frictions, float).reshape(-1, 3),
        "has_legs": np.zeros(len(rots), bool),
        "table_active": np.ones(len(rots), bool),
    }
    return names, params


def _shared_bodies(names: Sequence[str], bodies: Sequence[str]) -> list[Problem]:
    """Names, each of a table and on a body, of which more than one is on the same body."""
    problems = []
    for body in dict.fromkeys(b for b in bodies if bodies.count(b) > 1):
        given = [repr(name) for name, b in zip(names, bodies, strict=True) if b == body]
        if len(set(given)) == 1:
            times = "twice" if len(given) == 2 else f"{len(given)} times"
            problems.append(problem("tables", "adopted_again", ("entry", body), name=given[0], times=times))
        else:
            which = f"{', '.join(given[:-1])} and {given[-1]}"
            problems.append(problem("tables", "adopted_twice", ("entry", body), which=which, name=body))
    return problems


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
            shown = ", ".join(f"{_kind(g)} {g.name!r}" if g.name else f"an unnamed {_kind(g)}" for g in body.geoms)
            return wrong("boxes", what=what, known=shown or "none")
        slab = boxes[0]
    elif slab.type != box:
        return wrong("kind", kind=_kind(slab))
    if not (slab.contype | slab.conaffinity) & 1:
        return wrong("masks", contype=slab.contype, conaffinity=slab.conaffinity)
    parent = slab.parent
    if parent.name == "world" or parent.parent.name != "world" or list(parent.joints) or parent.mocap:
        return wrong("moves", body=_called(parent))
    if not parent.name:
        return wrong("unnamed")
    return wrong("frame") if parent.frame is not None or slab.frame is not None else slab


def _called(body: mujoco.MjsBody) -> str:
    return (
        "the world" if body.name == "world" else f"body {body.name!r}" if body.name else "its body, which has no name,"
    )


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
    assemble.dress_table(spec, body, names, material)
    specs.assign(spec.geom(names.visual), rgba=rgba, material=material)
    return names


def standing(spec: mujoco.MjSpec, parts: Parts) -> dict[int, list[str]]:
    """The free bodies that stand on tables at `qpos0` and are no objects, so that they do not follow them: names by table."""
    if sum(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in spec.joints) == len(parts.objects):
        return {}
    model = specs.compiled(spec.copy(), "arena.spec")
    data, objects, found = mujoco.MjData(model), {o.name for o in parts.objects}, {}
    mujoco.mj_kinematics(model, data)
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    for body in model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]:
        geoms = collides & (model.body_rootid[model.geom_bodyid] == body)
        if model.body(body).name in objects or not geoms.any():
            continue
        for t, table in enumerate(parts.tables):
            slab = model.geom(table.collision)
            middle, half = data.geom_xpos[slab.id], slab.size
            low, high = extents(model, data, geoms, middle, data.geom_xmat[slab.id].reshape(3, 3))
            if abs(low[2] - half[2]) <= RESTS and (np.abs(low + high)[:2] <= 2 * half[:2]).all():
                found.setdefault(t, []).append(_shown(model, data, body))
    return found


def _shown(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> str:
    """A body by its name, or by where it is."""
    place = ", ".join(f"{x:.3g}" for x in data.xpos[body])
    return repr(name) if (name := model.body(body).name) else f"without a name at ({place})"
