"""Tables that stand in a user's scene already (host)."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from mjx_arenas.build import assemble
from mjx_arenas.params.params import QUANTITIES, ArenaParams
from mjx_arenas.problem import Problem, problem
from mjx_arenas.rules import validation
from mjx_arenas.spec import patterns, scaled, specs
from mjx_arenas.spec.extents import extents
from mjx_arenas.spec.of_scene import UPRIGHT
from mjx_arenas.terms.parts import Parts, TableNames
from mjx_arenas.terms.tables import WORLD, Frame, Tables

RESTS = 0.01  # [m] from a table's top, at most: what stands there


def adopt_tables(
    spec: mujoco.MjSpec, tables: Sequence[str], priority: int
) -> tuple[list[TableNames], dict[str, np.ndarray]]:
    """Makes bodies of a scene tables of an arena; gives their names and nominal parameters.

    The body's frame moves to the middle of the slab; what else hangs on the body stays where it is. A slab of the world, and each of
    several of one body, becomes a body of its own, without what else hangs there.

    Raises:
        ValueError: for each name that is not a table.
    """
    if isinstance(tables, str) or not isinstance(tables, Sequence):
        raise validation.error([problem("tables", "adopted", None, tables)])
    found = [(name, _slab(spec, name)) for name in tables]
    problems = [slab for _, slab in found if isinstance(slab, Problem)]
    given = [(name, slab) for name, slab in found if not isinstance(slab, Problem)]
    problems += _given_again(given)
    validation.raise_all(problems, "from_xml")
    slabs = [slab for _, slab in given]
    scaled.refuse(spec, [slab for _, slab in given], "tables")
    for name, slab in given:
        if not slab.parent.name:
            slab.parent.name = unused(name, {b.name for b in spec.bodies})
        slab.name = slab.name or f"{slab.parent.name}_collision"
    apart = [slab.parent.name == "world" or len(_of(slab.parent, slabs)) > 1 for slab in slabs]
    validation.raise_all(_inside(given, apart), "from_xml")
    model = specs.compiled(spec.copy(), "xml")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    stood = [_Stood.of(model, data, slab.name) for slab in slabs]
    names = []
    for slab, one, alone in zip(slabs, stood, apart, strict=True):
        carrier = one.carrier if alone else int(model.body_parentid[one.carrier])
        frame = Frame(tuple(data.xpos[carrier].tolist()), tuple(data.xquat[carrier].tolist())) if carrier else WORLD
        names.append(dataclasses.replace(_adopt(spec, slab, one, alone, priority), frame=frame))
    params = {
        "table_offsets": np.array([one.offset for one in stood], float).reshape(-1, 3),
        "table_rots": np.array([one.rot for one in stood], float),
        "table_full_sizes": np.array([one.full_size for one in stood], float).reshape(-1, 3),
        "table_frictions": np.array([one.friction for one in stood], float).reshape(-1, 3),
        "has_legs": np.zeros(len(stood), bool),
        "table_active": np.ones(len(stood), bool),
    }
    no_objects = [np.zeros(0)] * (len(QUANTITIES) - len(params))
    Tables(tuple(names)).edit(spec, ArenaParams(*params.values(), *no_objects))
    return names, params


def _of(body: mujoco.MjsBody, slabs: Sequence[mujoco.MjsGeom]) -> list[mujoco.MjsGeom]:
    return [slab for slab in slabs if slab.parent == body]


def _given_again(given: Sequence[tuple[str, mujoco.MjsGeom]]) -> list[Problem]:
    """Slabs that are there more than once, by the names that were given."""
    problems = []
    for slab in (slab for i, (_, slab) in enumerate(given) if [s for _, s in given].index(slab) == i):
        names = [repr(name) for name, other in given if other == slab]
        item = ("entry", slab.parent.name)
        if len(set(names)) > 1:
            which = f"{', '.join(names[:-1])} and {names[-1]}"
            problems.append(problem("tables", "adopted_twice", item, which=which, name=slab.parent.name))
        elif len(names) > 1:
            times = "twice" if len(names) == 2 else f"{len(names)} times"
            problems.append(problem("tables", "adopted_again", item, name=names[0], times=times))
    return problems


def _inside(given: Sequence[tuple[str, mujoco.MjsGeom]], apart: Sequence[bool]) -> list[Problem]:
    """Tables whose bodies hang on another's, which moves them along."""
    bodies = {slab.parent.name: name for (name, slab), alone in zip(given, apart, strict=True) if not alone}
    problems = []
    for (name, slab), alone in zip(given, apart, strict=True):
        carrying = [b.name for b in specs.ancestors(slab.parent)[0 if alone else 1 :] if b.name in bodies]
        for body in carrying[:1]:
            what = {"name": name, "other": bodies[body], "body": body}
            problems.append(problem("tables", "adopted_inside", ("entry", name), None, what))
    return problems


def _slab(spec: mujoco.MjSpec, name: str) -> mujoco.MjsGeom | Problem:
    """The geom on which things stand, or why there is none."""
    box = mujoco.mjtGeom.mjGEOM_BOX

    def wrong(rule: str, **numbers: object) -> Problem:
        return problem("tables", f"adopted_{rule}", ("entry", name), name=name, **numbers)

    body, slab = spec.body(name), spec.geom(name)
    if body is None and slab is None:
        bodies = [b for b in spec.bodies[1:] if mover(b) is None]
        known = [one.name for body in bodies for one in (body, *body.geoms) if one.name]
        return wrong("unknown", nearest=patterns.near(name, known))
    if body is not None and not (
        slab is not None and slab.parent == body
    ):  # of one body and its geom, the geom is meant
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
    moved_by = mover(slab.parent)
    return slab if moved_by is None else wrong("moves", body=moved_by)


def mover(body: mujoco.MjsBody) -> str | None:
    """What keeps a body from being fixed to the world, as messages call it."""
    for one in specs.ancestors(body):
        called = f"body {one.name!r}" if one.name else "a body without a name"
        if len(one.joints):
            joint = one.joints[0].name
            return f"joint {joint!r} of {called}" if joint else f"a joint of {called}"
        if one.mocap:
            return f"{called}, which is a mocap body,"
    return None


def _kind(geom: mujoco.MjsGeom) -> str:
    return mujoco.mjtGeom(geom.type).name[7:].lower()


class _Stood(NamedTuple):
    """A slab as a table has it: with its z axis up."""

    offset: np.ndarray  # (3,) middle of the top, in the world [m]
    rot: float  # yaw [rad]
    full_size: np.ndarray  # (3,) [m]
    friction: np.ndarray  # (3,)
    pos: np.ndarray  # (3,) in its body's frame [m]
    quat: np.ndarray  # (4,)
    carrier: int  # id of its body

    @classmethod
    def of(cls, model: mujoco.MjModel, data: mujoco.MjData, name: str) -> "_Stood":
        """A slab that lies on any of its sides."""
        geom, axes = model.geom(name), data.geom(name).xmat.reshape(3, 3)
        up = int(np.abs(axes[2]).argmax())
        if np.hypot(*axes[:2, up]) > UPRIGHT:
            raise validation.error([problem("tables", "adopted_tilted", ("entry", name), name=name)])
        order = (up + np.array([1, 2, 0])) % 3
        turn = np.eye(3)[:, order] * [1, np.sign(axes[2, up]), np.sign(axes[2, up])]
        own, quat, size = np.zeros(4), np.zeros(4), geom.size[order]
        mujoco.mju_mat2Quat(own, turn.reshape(-1))
        mujoco.mju_mulQuat(quat, geom.quat, own)
        along, offset = axes @ turn[:, 0], data.geom(name).xpos + np.array([0, 0, size[2]])
        yaw = float(np.arctan2(along[1], along[0]))
        return cls(offset, yaw, 2 * size, geom.friction, geom.pos, quat, int(geom.bodyid[0]))


def unused(name: str, taken: set[str]) -> str:
    """The name, with underscores until it is none of those that are taken."""
    while name in taken:
        name += "_"
    return name


def _unused_names(spec: mujoco.MjSpec, body: str, slab: str) -> TableNames:
    """Names of a table's elements, none of which the scene has."""
    geoms, sites, own = {g.name for g in spec.geoms}, {s.name for s in spec.sites}, body
    names = TableNames.of(own, 0, slab)
    while names.top in sites or not geoms.isdisjoint((names.visual, *names.legs)):
        own += "_"
        names = TableNames.of(own, 0, slab)
    return dataclasses.replace(names, body=body, adopted=True)


def _adopt(spec: mujoco.MjSpec, slab: mujoco.MjsGeom, stood: _Stood, alone: bool, priority: int) -> TableNames:
    """Makes a body a table: its frame becomes the slab's, and it gets the other elements of a table.

    An `alone` slab gets a new body.
    """
    if alone:
        slab = _split(spec, slab)
    else:
        _reframe(slab.parent, slab, stood.pos, stood.quat)
    body = slab.parent
    material, rgba, names = slab.material, np.array(slab.rgba), _unused_names(spec, body.name, slab.name)
    specs.assign(slab, pos=(0, 0, 0), quat=(1, 0, 0, 0), fromto=[np.nan] * 6, mass=0, priority=priority)
    slab.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    specs.assign(slab, size=stood.full_size / 2, material="", rgba=(*rgba[:3], 0.0))
    assemble.dress_table(spec, body, names, material)
    specs.assign(spec.geom(names.visual), rgba=rgba, material=material)
    return names


def _reframe(body: mujoco.MjsBody, slab: mujoco.MjsGeom, at: np.ndarray, turn: np.ndarray) -> None:
    """Moves a body's frame to the slab, what else hangs on it staying where it is, and takes both out of frames of their own."""
    inverse, pos = turn * [1, -1, -1, -1], np.zeros(3)
    mujoco.mju_rotVecQuat(pos, -at, inverse)
    frame = body.add_frame(pos=pos, quat=inverse)
    for kind in ("geoms", "sites", "bodies", "cameras", "lights", "frames"):
        for element in [e for e in getattr(body, kind) if e.frame is None and e not in (slab, frame)]:
            element.set_frame(frame)
    specs.out_of_frames(slab)
    specs.out_of_frames(body)


def _split(spec: mujoco.MjSpec, slab: mujoco.MjsGeom) -> mujoco.MjsGeom:
    """The slab on a new body, which hangs where the slab was; what refers to the slab by its name refers to this one."""
    name, taken = slab.name, {b.name for b in spec.bodies}
    own = name if name not in taken else unused(f"{slab.parent.name}_{name}", taken)
    return specs.move_geom(spec, slab, slab.parent.add_body(name=own))


class Left(NamedTuple):
    """What stands on tables of a scene at `qpos0` and does not follow them: names by table."""

    free: dict[int, list[str]]
    """Bodies that are no objects."""
    fixed: dict[int, list[str]]
    """Bodies on the world, of which actuators move nothing."""


def standing(model: mujoco.MjModel, parts: Parts, driven: np.ndarray) -> Left:
    """The bodies that stand on tables at `qpos0` and do not follow them, but for robots, with one of the bodies that are `driven`."""
    found, data, objects = Left({}, {}), mujoco.MjData(model), {o.name for o in parts.objects}
    robots = set(model.body_rootid[driven].tolist())
    mujoco.mj_kinematics(model, data)
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    own = {*(t.body for t in parts.tables), *parts.robots, *(part.name for part in parts.furniture)}
    moved = {name for term in parts.varied if term.kind == "body" for name in term.elements}
    for body in np.flatnonzero(model.body_parentid == 0)[1:].tolist():
        joints = model.jnt_type[model.jnt_bodyid == body]
        free, name = mujoco.mjtJoint.mjJNT_FREE in joints, model.body(body).name
        geoms = collides & (model.body_rootid[model.geom_bodyid] == body)
        if not geoms.any() or name in objects | own | moved or (not free and (len(joints) or body in robots)):
            continue
        for t, table in enumerate(parts.tables):
            slab = model.geom(table.collision)
            middle, half = data.geom_xpos[slab.id], slab.size
            low, high = extents(model, data, geoms, middle, data.geom_xmat[slab.id].reshape(3, 3))
            if abs(low[2] - half[2]) <= RESTS and (np.abs(low + high)[:2] <= 2 * half[:2]).all():
                (found.free if free else found.fixed).setdefault(t, []).append(specs.body_name(model, body))
    return found
