"""Geoms of a user's scene that follow its tables (host)."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.build.from_mjcf import mover
from mjx_arenas.keywords import nearest
from mjx_arenas.problem import Problem, problem
from mjx_arenas.rules import validation
from mjx_arenas.spec import scaled, specs
from mjx_arenas.spec.extents import extents
from mjx_arenas.spec.follow import Follow, Follower
from mjx_arenas.terms.parts import TableNames

_GEOM = mujoco.mjtGeom
_ROUND = (_GEOM.mjGEOM_CAPSULE, _GEOM.mjGEOM_CYLINDER)
_ENDLESS = (_GEOM.mjGEOM_PLANE, _GEOM.mjGEOM_HFIELD, _GEOM.mjGEOM_SDF)
ALONG = 1e-6  # sine of the largest angle between two axes that are taken for one


def adopt(
    spec: mujoco.MjSpec, tables: Sequence[TableNames], params: Mapping[str, np.ndarray], given: Any
) -> tuple[Follower, ...]:
    """Has geoms of a scene follow its tables: they come onto the tables' bodies, out of all frames.

    Raises:
        ValueError: all problems of what was given.
    """
    if isinstance(given, (str, Follow)) or not isinstance(given, Iterable):
        raise validation.error([problem("follow", "follow", None, given)])
    follows = list(given)
    problems = [problem("follow", "follow", None, f) for f in follows if not isinstance(f, Follow)]
    problems += [p for f in follows if isinstance(f, Follow) for p in f.problems()]
    validation.raise_all(problems, "from_xml")
    names = [f.geom for f in follows]
    problems = [_about(f, "again") for i, f in enumerate(follows) if names.index(f.geom) < i]
    on = [_table(spec, tables, f) for f in follows]
    validation.raise_all([*problems, *(t for t in on if isinstance(t, Problem))], "from_xml")
    if not follows:
        return ()
    model = specs.compiled(spec.copy(), "xml")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found, quats = [], []
    for f, t in zip(follows, on, strict=True):
        assert isinstance(t, int)
        slab = (*params["table_full_sizes"][t].tolist(), float(params["table_offsets"][t, 2]))
        follower, quat = _follower(model, data, f, t, tables[t], slab)
        found.append(follower)
        quats.append(quat)
    validation.raise_all([one for one in found if isinstance(one, Problem)], "from_xml")
    for one, quat in zip(found, quats, strict=True):
        _settle(spec, one, tables[one.table], quat)
    return tuple(found)


def _about(f: Follow, rule: str, **numbers: object) -> Problem:
    return problem("follow", f"follow_{rule}", ("entry", f.geom), f, name=f.geom, **numbers)


def _table(spec: mujoco.MjSpec, tables: Sequence[TableNames], f: Follow) -> int | Problem:
    """The index of the table that a geom follows."""
    bodies, ours = [t.body for t in tables], {name for t in tables for name in t.geoms}
    geom = spec.geom(f.geom)
    if geom is None and (close := nearest(f.geom, [g.name for g in spec.geoms if g.name and g.name not in ours])):
        return _about(f, "misspelled", close=close)
    if geom is None:
        there = [g.name for t in tables for g in spec.body(t.body).find_all("geom") if g.name and g.name not in ours]
        return _about(f, "unknown", known=", ".join(map(repr, there)) or "none")
    if f.geom in ours:
        return _about(f, "slab")
    if geom.type in _ENDLESS:
        return _about(f, "kind", kind=_kind(geom.type))
    if moved_by := mover(geom.parent):
        return _about(f, "moves", body=moved_by)
    own = bodies.index(geom.parent.name) if geom.parent.name in bodies else None
    index = own if f.table is None else validation.table_index(f.table, bodies, [t.collision for t in tables])
    if index is None or (f.table is not None and not isinstance(f.table, str)):
        return _about(f, "table", known=", ".join(map(repr, bodies)) or "none")
    if own == index and (f.x, f.y, f.z) == (None, None, None):
        return _about(f, "nothing", table=bodies[index])
    return index


def _kind(kind: int) -> str:
    return _GEOM(kind).name[7:].lower()


def _follower(
    model: mujoco.MjModel, data: mujoco.MjData, f: Follow, table: int, names: TableNames, slab: tuple
) -> tuple[Follower | Problem, np.ndarray]:
    """A geom as it is in the frame of its table's slab, and its orientation there."""
    index, body = model.geom(f.geom).id, data.body(names.body)
    axes, kind = body.xmat.reshape(3, 3), _GEOM(model.geom_type[index])
    low, high = extents(model, data, np.arange(model.ngeom) == index, body.xpos, axes)
    turn = axes.T @ data.geom_xmat[index].reshape(3, 3)
    pos, quat = axes.T @ (data.geom_xpos[index] - body.xpos), np.zeros(4)
    mujoco.mju_mat2Quat(quat, turn.reshape(-1))
    along = [int(np.abs(turn[:, i]).argmax()) if _is_along(turn[:, i]) else -1 for i in range(3)]  # of the slab's axes
    round_ = [-1, along[2], -1] if kind in _ROUND else [-1, -1, -1]
    of_sizes = along if kind == _GEOM.mjGEOM_BOX else round_
    for axis in np.flatnonzero(f.grows):
        if axis not in of_sizes:
            why = (
                "it is turned"
                if kind == _GEOM.mjGEOM_BOX
                else "that is not its own axis"
                if kind in _ROUND
                else "its size stays"
            )
            return _about(f, "turned", kind=_kind(kind), axis="xyz"[axis], why=why), quat
    middle = (low + high) / 2
    follower = Follower(
        f.geom,
        table,
        (f.x, f.y, f.z),
        tuple(middle.tolist()),
        tuple(((high - low) / 2).tolist()),
        tuple((pos - middle).tolist()),
        tuple(model.geom_size[index].tolist()),
        tuple(axis if axis >= 0 and f.grows[axis] else -1 for axis in of_sizes),
        slab,
        bool(model.geom_contype[index] | model.geom_conaffinity[index]),
    )
    return follower, quat


def _is_along(axis: np.ndarray) -> bool:
    return float(np.sort(np.abs(axis))[1]) <= ALONG


def _settle(spec: mujoco.MjSpec, one: Follower, names: TableNames, quat: np.ndarray) -> None:
    """Has a geom's place and size be numbers that parameters decide."""
    geom, body = spec.geom(one.geom), spec.body(names.body)
    scaled.refuse(spec, [geom], "follow", ("entry", one.geom))
    if geom.parent != body:
        geom = specs.move_geom(spec, geom, body)
    specs.out_of_frames(geom)
    geom.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    size = geom.size if geom.type == _GEOM.mjGEOM_MESH else one.size
    specs.assign(geom, quat=quat, fromto=[np.nan] * 6, size=size)
