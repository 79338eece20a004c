"""Robots into arenas, and arenas into each other (host)."""

import dataclasses
from collections.abc import Sequence
from typing import TypeAlias

import mujoco
import numpy as np

from mjx_arenas import geometry, messages, specs, validation
from mjx_arenas.params import ArenaParams
from mjx_arenas.parts import Mount, Parts
from mjx_arenas.placement import Places
from mjx_arenas.problems import Problem, problem
from mjx_arenas.sampling import tags

Configured: TypeAlias = tuple[mujoco.MjSpec, Parts, ArenaParams]


def check(
    child: mujoco.MjSpec, prefix: object, pos: object, quat: object, on_table: object, table_names: Sequence[str]
) -> int | None:
    """The index of the table that a robot stands on, None for the world.

    Raises:
        ValueError: all problems of the arguments.
    """
    problems = _prefix_problems(prefix)
    problems += validation.vector_problems("pos", pos, 3, "[m]") + validation.vector_problems("quat", quat, 4, "")
    if not problems and not np.any(np.asarray(quat, float)):
        problems.append(problem("quat", "not_zero"))
    table = None if on_table is None else validation.table_index(on_table, table_names)
    if on_table is not None and table is None:
        problems.append(problem("on_table", "table", None, on_table, tables=tuple(table_names), optional=True))
    free = [b.name for b in child.worldbody.bodies if any(j.type == mujoco.mjtJoint.mjJNT_FREE for j in b.joints)]
    if table is not None and free:
        problems.append(problem("on_table", "free_joint", name=free[0]))
    validation.raise_all(problems, "attach")
    return table


def _prefix_problems(prefix: object) -> list[Problem]:
    return [] if isinstance(prefix, str) and prefix else [problem("prefix", "text", None, prefix)]


def merge_options(spec: mujoco.MjSpec, child: mujoco.MjSpec) -> list[str]:
    """Takes over options that a child sets and the arena does not; gives those that both set, where the arena's hold."""
    plain, lost = mujoco.MjSpec().option, []
    for name in [n for n in dir(plain) if not n.startswith("_") and not callable(getattr(plain, n))]:
        theirs, ours, default = (getattr(option, name) for option in (child.option, spec.option, plain))
        if np.all(theirs == ours) or np.all(theirs == default):
            continue
        if np.all(ours == default):
            setattr(spec.option, name, theirs)
        else:
            lost.append(f"{name}={theirs} (arena: {ours})")
    rules = [name for name in ("boundmass", "boundinertia", "settotalmass") if getattr(child.compiler, name) > 0]
    return lost + [f"{name}={getattr(child.compiler, name)} (of the compiler)" for name in rules]


def warn_of_options(lost: Sequence[str], path: str) -> None:
    """Warns of options of an argument that were not taken over."""
    if lost:
        messages.warn(problem(path, "other_options", names=lost), stacklevel=3)


def attach(
    spec: mujoco.MjSpec,
    parts: Parts,
    child: mujoco.MjSpec,
    prefix: str,
    pos: Sequence[float],
    quat: Sequence[float],
    table: int | None,
) -> Parts:
    """Puts a robot into a spec that has its tables; gives the parts with its mount."""
    if table is None:
        specs.attach(spec, child, prefix, spec.worldbody.add_frame(pos=pos, quat=quat), "robot")
        return parts
    name = f"{prefix}mount"
    if spec.body(name) is not None:
        raise validation.error([problem("robot", "clash", names=[f"body {name!r}"])])
    body = spec.body(parts.tables[table].body).add_body(name=name, pos=pos, quat=quat)
    specs.make_massless(body)
    specs.attach(spec, child, prefix, body.add_frame(), "robot")
    return dataclasses.replace(parts, mounts=(*parts.mounts, Mount(name, table, float(pos[2]))))


def merge(one: Configured, other: Configured, prefix: object, pos: object, rot: object) -> Configured:
    """Spec, parts and nominal parameters of two arenas in one, `other` moved and turned, its names prefixed."""
    problems = _prefix_problems(prefix)
    problems += validation.vector_problems("pos", pos, 3, "[m]") + validation.vector_problems("rot", rot, 0, "[rad]")
    validation.raise_all(problems, "merge")
    assert isinstance(prefix, str)
    shift, turn = np.asarray(pos, float), float(rot)  # type: ignore[arg-type]
    spec, child = one[0].copy(), other[0].copy()
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
    lost = merge_options(spec, other[0])
    specs.attach(spec, child, prefix, spec.worldbody.add_frame(), "other")
    warn_of_options(lost, "other")
    return spec, _joined(one[1], other[1], prefix), _joined_params(one[2], other[2], shift, turn)


def referring(spec: mujoco.MjSpec, kind: str, name: str) -> list[str]:
    """The pairs and sensors that name a geom or camera."""
    of = {"geoms": mujoco.mjtObj.mjOBJ_GEOM, "cameras": mujoco.mjtObj.mjOBJ_CAMERA}.get(kind)
    pairs = [p for p in spec.pairs if kind == "geoms" and name in (p.geomname1, p.geomname2)]
    sensors = [s for s in spec.sensors if (of, name) in ((s.objtype, s.objname), (s.reftype, s.refname))]
    return [f"pair {p.name!r}" if p.name else "a pair" for p in pairs] + [f"sensor {s.name!r}" for s in sensors]


def _move(child: mujoco.MjSpec, parts: Parts, shift: np.ndarray, turn: float) -> None:
    """Moves what stands in a world, but for tables and objects: parameters move those."""
    own = {t.body for t in parts.tables} | {o.name for o in parts.objects}
    world = child.worldbody
    frame = world.add_frame(pos=shift, quat=geometry.yaw_quat(np.float64(turn)))
    for kind in ("bodies", "geoms", "sites", "lights", "cameras"):
        for element in [e for e in getattr(world, kind) if e.name not in own and e.frame is None]:
            element.set_frame(frame)
    for nested in [f for f in world.frames if f is not frame and f.frame is None]:
        nested.set_frame(frame)


def _joined(one: Parts, other: Parts, prefix: str) -> Parts:
    n = len(one.tables)
    tables = [t.body for t in other.tables]
    objects = tuple(
        dataclasses.replace(o, name=prefix + o.name, table=n + (validation.table_index(o.table, tables) or 0))
        for o in other.objects
    )
    places = Places(*(np.concatenate([a, b]) for a, b in zip(one.places, other.places, strict=True)))
    return Parts(
        (*one.tables, *(t.prefixed(prefix) for t in other.tables)),
        (*one.mounts, *(Mount(prefix + m.body, m.table + n, m.height) for m in other.mounts)),
        (*one.objects, *objects),
        (*one.measures, *other.measures),
        places._replace(tag=tags([o.name for o in (*one.objects, *objects)])),
    )


def _joined_params(one: ArenaParams, other: ArenaParams, shift: np.ndarray, turn: float) -> ArenaParams:
    xy = geometry.rotate_yaw(np.float64(turn), other.table_offsets[:, :2]) + shift[:2]
    moved = other._replace(
        table_offsets=np.column_stack([xy, other.table_offsets[:, 2] + shift[2]]),
        table_rots=other.table_rots + turn,
        object_tables=other.object_tables + len(one.table_rots),
    )
    return ArenaParams(*(np.concatenate([a, b]) for a, b in zip(one, moved, strict=True)))
