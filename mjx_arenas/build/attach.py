"""Robots into arenas, and arenas into each other (host)."""

import dataclasses
import logging
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import mujoco
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.build import carriers
from mjx_arenas.furniture import standing
from mjx_arenas.params.params import QUANTITIES, ArenaParams
from mjx_arenas.problem import Problem, Told, problem
from mjx_arenas.problems import messages
from mjx_arenas.rules import validation
from mjx_arenas.sample import tops
from mjx_arenas.sample.placement import Places
from mjx_arenas.sample.sampling import tags
from mjx_arenas.sample.variants import Variants
from mjx_arenas.spec import names, specs
from mjx_arenas.terms.parts import Mount, Parts, TableNames
from mjx_arenas.terms.tables import WORLD

_log = logging.getLogger("mjx_arenas")

Configured: TypeAlias = tuple[mujoco.MjSpec, Parts, ArenaParams]


def check(
    child: mujoco.MjSpec,
    prefix: object,
    pos: object,
    quat: object,
    on: object,
    options: object,
    parts: Parts,
    under: object = False,
    keyframe: object = None,
) -> int | str | None:
    """The index of the table that a robot stands on, or the name of a part or of its surface, None for the world.

    Raises:
        ValueError: all problems of the arguments.
    """
    problems = _prefix_problems(prefix)
    of_quat = validation.vector_problems("quat", quat, 4, "")
    if not of_quat and not np.any(np.asarray(quat, float)):
        of_quat = [problem("quat", "not_zero")]
    problems += validation.vector_problems("pos", pos, 3, "[m]") + of_quat
    below = carriers.carrier("on", on, parts, stays=True, frames=True)
    if isinstance(below, Problem):
        problems.append(below)
    elif not isinstance(under, bool):
        problems.append(problem("under", "truth", None, under))
    elif under and not _has_underside(below, parts):
        must = "a table, or a surface that is the upper side of a box, where it is `under` that"
        problems.append(problem("on", "must", None, on, must=must))
    free = [b.name for b in child.worldbody.bodies if any(j.type == mujoco.mjtJoint.mjJNT_FREE for j in b.joints)]
    if on is not None and free:
        problems.append(problem("on", "free_joint", body=f"body {free[0]!r}" if free[0] else "a body without a name"))
    if on is not None and (mocap := [b.name for b in child.worldbody.bodies if b.mocap]):
        body = f"body {mocap[0]!r}" if mocap[0] else "a body without a name"
        problems.append(problem("on", "mocap_body", body=body))
    if options is not None and options not in OPTIONS:
        problems.append(problem("options", "options", None, options, known=", ".join(map(repr, OPTIONS))))
    keys = [key.name for key in child.keys if key.name]
    if keyframe is not None and keyframe not in keys:
        must = f"None or a name of a keyframe of `robot`, which has {', '.join(map(repr, keys)) or 'none'}"
        problems.append(problem("keyframe", "must", None, keyframe, must=must))
    world = child.worldbody
    if not problems and not any((world.bodies, world.geoms, world.sites, world.cameras, world.lights, world.frames)):
        problems.append(problem("robot", "must", None, Told("none"), must="an MJCF with a body or a geom"))
    validation.raise_all(problems, "attach")
    assert not isinstance(below, Problem)
    return below


def _has_underside(on: int | str | None, parts: Parts) -> bool:
    """Whether a robot can hang below what carries it."""
    if on is None or isinstance(on, int):
        return on is not None
    furniture = parts.places.furniture
    return on in standing.names(furniture) and on in standing.surface_names(furniture)


def _table_index(table: object, tables: Sequence[TableNames]) -> int | None:
    """The index of a table that is given by its index, its body's name or its slab's; None if there is none."""
    return validation.table_index(table, [t.body for t in tables], [t.collision for t in tables])


def _prefix_problems(prefix: object) -> list[Problem]:
    return names.problems("prefix", prefix)


class Options(NamedTuple):
    """What became of the options of what came into an arena."""

    lost: list[str]
    """Options that both set, where the arena's hold."""
    changed: list[str]
    """Options taken over that change everything else in the arena: contact, gravity, medium."""
    taken: list[str]
    """Other options taken over: time step, integrator and solver."""


def merge_options(spec: mujoco.MjSpec, child: mujoco.MjSpec, options: str | None = None) -> Options:
    """Takes over options that a child sets and the arena does not; with "solver" none of contact, gravity and medium."""
    plain, lost, changed, taken = mujoco.MjSpec().option, [], [], []
    for name in [n for n in dir(plain) if not n.startswith("_") and not callable(getattr(plain, n))]:
        theirs, ours, default = (getattr(option, name) for option in (child.option, spec.option, plain))
        flags = _WORLD_FLAGS.get(name, {})
        if options == "solver":
            theirs = ours if name in _WORLD else theirs & ~sum(flags) if flags else theirs
        if np.all(theirs == ours) or np.all(theirs == default):
            continue
        if not np.all(ours == default):
            lost.append(_told(name, theirs, ours))
            continue
        setattr(spec.option, name, theirs)
        changed += [f"{words} ({name})" for flag, words in flags.items() if theirs & flag]
        rest = theirs & ~sum(flags) if flags else theirs
        if not np.all(rest == default):
            (changed if name in _WORLD else taken).append(_told(name, rest, default))
    total = child.compiler.settotalmass  # all other rules of its compiler go on for its bodies
    ours = f"{spec.compiler.settotalmass:g}" if spec.compiler.settotalmass > 0 else "none"
    lost += [f"settotalmass={total:g} of its compiler (arena: {ours})"] * (total > 0)
    return Options(lost, changed, taken)


def _told(name: str, theirs: Any, ours: Any) -> str:
    return f"{name}={_shown(name, theirs)} (arena: {_shown(name, ours)})"


def _shown(name: str, value: Any) -> str:
    """The value of an option, as MJCF has it where it is one of a few words, or a set of flags."""
    if name in _WORDS:
        return _WORDS[name](value).name.partition("_")[2].lower()
    if name in _FLAGS:
        flags = [flag for flag in _FLAGS[name].__members__.values() if value & flag.value and "_" in flag.name]
        return " ".join(flag.name.partition("_")[2].lower() for flag in flags) or "none"
    return validation.show(value)


_WORDS = {"integrator": mujoco.mjtIntegrator, "cone": mujoco.mjtCone}
_WORDS |= {"solver": mujoco.mjtSolver, "jacobian": mujoco.mjtJacobian}
_FLAGS = {"disableflags": mujoco.mjtDisableBit, "enableflags": mujoco.mjtEnableBit}


OPTIONS = ("all", "solver")
"""Names for the options of a robot that the arena takes over where it has MuJoCo's defaults."""

_WORLD = ("gravity", "density", "viscosity", "wind", "magnetic")
_WORLD_FLAGS: dict[str, dict[int, str]] = {
    "disableflags": {
        int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT): "constraints disabled, contacts too",
        int(mujoco.mjtDisableBit.mjDSBL_CONTACT): "contacts disabled",
        int(mujoco.mjtDisableBit.mjDSBL_GRAVITY): "gravity disabled",
    },
    "enableflags": {int(mujoco.mjtEnableBit.mjENBL_OVERRIDE): "parameters of all contacts overridden"},
}


def warn_of_options(options: Options, path: str, tell: str) -> None:
    """Warns of options that were not taken over, and of those that were and change all else; `tell` says what to do.

    The log has the others that were taken over.
    """
    if options.taken:
        _log.info("The arena takes over options of `%s`: %s.", path, ", ".join(options.taken))
    if options.lost:
        messages.warn(problem(path, "other_options", names=options.lost))
    if options.changed:
        messages.warn(problem(path, "changing_options", names=options.changed, tell=tell))


def attach(
    spec: mujoco.MjSpec,
    parts: Parts,
    child: mujoco.MjSpec,
    prefix: str,
    pos: Sequence[float],
    quat: Sequence[float],
    on: int | str | None,
    under: bool = False,
) -> Parts:
    """Puts a robot into a spec that has its tables; gives the parts with its mount."""
    if on is None:
        specs.attach(spec, child, prefix, spec.worldbody.add_frame(pos=pos, quat=quat), "robot", pose=(pos, quat))
        return parts
    name = f"{prefix}mount"
    if spec.body(name) is not None:
        raise validation.error([problem("robot", "clash", names=[f"body {name!r}"])])
    below = parts.tables[on].body if isinstance(on, int) else parts.part_of(on).name
    body = spec.body(below).add_body(name=name, pos=pos, quat=quat)
    specs.make_massless(body)
    specs.attach(spec, child, prefix, body.add_frame(), "robot")
    if isinstance(on, int):
        return dataclasses.replace(parts, mounts=(*parts.mounts, Mount(name, on, float(pos[2]), under)))
    own = tuple(t.carrying(name, on, pos, under) if t.name == below else t for t in parts.furniture)
    return dataclasses.replace(parts, furniture=own)


def merge(one: Configured, other: Configured, prefix: object, pos: object, rot: object) -> Configured:
    """Spec, parts and nominal parameters of two arenas in one, `other` moved and turned, its names prefixed.

    Both specs are used up.
    """
    problems = _prefix_problems(prefix)
    problems += validation.vector_problems("pos", pos, 3, "[m]") + validation.vector_problems("rot", rot, 0, "[rad]")
    validation.raise_all(problems, "merge")
    assert isinstance(prefix, str)
    shift, turn = np.asarray(pos, float), float(rot)  # type: ignore[arg-type]
    spec, child = one[0], other[0]
    problems = []
    for kind in ("geoms", "lights", "cameras"):
        mine = {e.name for e in getattr(spec.worldbody, kind) if e.name}
        for element in [e for e in getattr(child.worldbody, kind) if e.name in mine]:
            what = {"kind": kind[:-1], "what": f"{kind[:-1]} {element.name!r}"}
            problems += [
                problem("other", "shared_name", who=who, **what) for who in referring(child, kind, element.name)
            ]
            child.delete(element)
    validation.raise_all(problems, "merge")
    _move(child, other[1], shift, turn)
    options = merge_options(spec, child)
    pose = shift, geometry.yaw_quat(np.float64(turn))
    specs.attach(spec, child, prefix, spec.worldbody.add_frame(), "other", pose=pose)
    warn_of_options(options, "other", "options of the merged arena's `spec.option` can be set otherwise")
    beside = tops.count(one[1].places.ground)
    params = _joined_params(one[2], other[2], shift, turn, prefix, beside)
    return spec, _joined(one[1], other[1], prefix, shift, turn), params


def referring(spec: mujoco.MjSpec, kind: str, name: str) -> list[str]:
    """The pairs and sensors that name a geom or camera."""
    of = {"geoms": mujoco.mjtObj.mjOBJ_GEOM, "cameras": mujoco.mjtObj.mjOBJ_CAMERA}.get(kind)
    pairs = [p for p in spec.pairs if kind == "geoms" and name in (p.geomname1, p.geomname2)]
    sensors = [s for s in spec.sensors if (of, name) in ((s.objtype, s.objname), (s.reftype, s.refname))]
    return [f"pair {p.name!r}" if p.name else "a pair" for p in pairs] + [f"sensor {s.name!r}" for s in sensors]


def _move(child: mujoco.MjSpec, parts: Parts, shift: np.ndarray, turn: float) -> None:
    """Moves what stands in a world, but for tables and objects: parameters move those."""
    own = [child.body(name) for name in (*(t.body for t in parts.tables), *(o.name for o in parts.objects))]
    staying = [*own, *_frames_around(own)]
    world = child.worldbody
    frame = world.add_frame(pos=shift, quat=geometry.yaw_quat(np.float64(turn)))
    for kind in ("bodies", "geoms", "sites", "lights", "cameras", "frames"):
        for element in [e for e in getattr(world, kind) if e not in staying and e != frame]:
            if element.frame is None or element.frame in staying:
                element.set_frame(frame)


def _frames_around(bodies: Sequence[mujoco.MjsBody]) -> list[mujoco.MjsFrame]:
    """The frames that bodies are in: those that `merge` attached an arena in, which turn and move nothing."""
    found: list[mujoco.MjsFrame] = []
    for body in bodies:
        frame = body.frame
        while frame is not None and frame not in found:
            found.append(frame)
            frame = frame.frame
    return found


def _joined(one: Parts, other: Parts, prefix: str, shift: np.ndarray, turn: float) -> Parts:
    n, k, theirs = len(one.tables), len(one.objects), [t.prefixed(prefix) for t in other.tables]
    moved = [t if t.frame == WORLD else dataclasses.replace(t, frame=t.frame.moved(shift, turn)) for t in theirs]
    names = [c.name for c in other.places.carriers]
    on = [prefix + o.on if o.on in names else n + (_table_index(o.on, other.tables) or 0) for o in other.objects]  # type: ignore[operator]
    near = [o.place and o.place.moved(prefix, shift, turn) for o in other.objects]
    own = zip(other.objects, on, near, strict=True)
    objects = tuple(dataclasses.replace(o.prefixed(prefix), on=t, place=place) for o, t, place in own)
    both = zip(Places._fields, one.places, other.places, strict=True)
    joined = {
        name: np.concatenate([a, b]) for name, a, b in both if isinstance(a, np.ndarray) and isinstance(b, np.ndarray)
    }
    follows = (*one.follows, *(f.moved(prefix, n + f.table, float(shift[2])) for f in other.follows))
    variants = [_prefixed(v, prefix)._replace(object=k + v.object) for v in other.places.variants]
    poses = [p._replace(quantity=prefix + p.quantity, object=k + p.object) for p in other.places.poses]
    carriers = [c._replace(object=k + c.object, name=prefix + c.name) for c in other.places.carriers]
    places = one.places._replace(
        **joined,
        variants=(*one.places.variants, *variants),
        poses=(*one.places.poses, *poses),
        carriers=(*one.places.carriers, *carriers),
        follows=follows,
    )
    mounts = (dataclasses.replace(m, body=prefix + m.body, table=m.table + n) for m in other.mounts)
    return dataclasses.replace(
        one,
        tables=(*one.tables, *moved),
        mounts=(*one.mounts, *mounts),
        objects=(*one.objects, *objects),
        measures=(*one.measures, *other.measures),
        places=places._replace(tag=tags([o.name for o in (*one.objects, *objects)])),
        follows=follows,
    )


def _prefixed(one: Variants, prefix: str) -> Variants:
    geoms = tuple(tuple(prefix + name for name in names) for names in one.geoms)
    return one._replace(quantity=prefix + one.quantity, geoms=geoms)


def _joined_params(
    one: ArenaParams, other: ArenaParams, shift: np.ndarray, turn: float, prefix: str, beside: int
) -> ArenaParams:
    """The parameters of two arenas, of which the first has so many surfaces beside tables, on which the other's objects come after."""
    xy = geometry.rotate_yaw(np.float64(turn), other.table_offsets[:, :2]) + shift[:2]
    n, m = len(one.table_rots), len(other.table_rots)
    on = np.where(one.object_tables < n, one.object_tables, one.object_tables + m)  # surfaces of furniture come last
    theirs = np.where(other.object_tables < m, other.object_tables + n, other.object_tables + n + beside)
    moved = other._replace(
        table_offsets=np.column_stack([xy, other.table_offsets[:, 2] + shift[2]]),
        table_rots=other.table_rots + turn,
        object_tables=theirs,
    )
    given = one._replace(object_tables=on)
    own = (np.concatenate([getattr(given, name), getattr(moved, name)]) for name in QUANTITIES)
    return ArenaParams(*own, terms={**one.terms, **{prefix + name: value for name, value in other.terms.items()}})
