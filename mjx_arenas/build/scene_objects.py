"""Free bodies that a user's scene has already become objects (host)."""

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from mjx_arenas import shapes
from mjx_arenas.build.from_mjcf import RESTS, unused
from mjx_arenas.problem import Item, Problem, problem
from mjx_arenas.spec import masses, objects, scaled, specs
from mjx_arenas.spec.extents import volumes
from mjx_arenas.spec.objects import Measures, Object
from mjx_arenas.spec.of_scene import SCENE, SceneObject, Stance, primitive, stance
from mjx_arenas.terms.parts import TableNames

_FREE = mujoco.mjtJoint.mjJNT_FREE
_AS_IN_SCENE = ("full_size", "pos", "rot", "density", "file", "pose", "variants")
_RULES = {"pose": "scene_pose", "variants": "scene_variants"}


def adopt(spec: mujoco.MjSpec, tables: Sequence[TableNames], given: Any) -> tuple[Any, list[Problem]]:
    """The objects of a call with the bodies of the scene that it asks for, which it edits; and what is wrong with these."""
    if isinstance(given, (str, Object)) or not isinstance(given, Iterable):
        return given, []
    given = list(given)
    named = [o for o in given if isinstance(o, Object) and isinstance(o.name, str)]
    ours = [o for o in named if o.type == SCENE or isinstance(o, SceneObject)]
    if not ours:
        return given, []
    problems = [p for obj in ours for p in _problems(spec, obj)]
    if problems:
        return [o for o in given if o not in ours], problems
    masses.weigh_groups(spec)
    for obj in ours:
        _prepare(spec, obj)
    scene = _Scene.of(spec, tables, [o.name for o in ours])
    found = {id(obj): _adopted(spec, scene, obj) for obj in ours}
    problems = [p for one in found.values() if isinstance(one, list) for p in one]
    return [found.get(id(o), o) for o in given if not isinstance(found.get(id(o)), list)], problems


def _item(obj: Object) -> Item:
    return "object", obj.name


def _problems(spec: mujoco.MjSpec, obj: Object) -> list[Problem]:
    """What of a body of the scene can be told before it is compiled."""
    if isinstance(obj, SceneObject):
        return [problem("objects", "scene_other", _item(obj))]
    body, plain = spec.body(obj.name), Object("")
    free = [b.name for b in spec.worldbody.find_all("body") if _free_joint(b) is not None and b.name]
    known = ", ".join(map(repr, free)) or "none"
    if body is None or not obj.name:
        return [problem("objects", "scene_unknown", _item(obj), obj.name, known=known)]
    if _free_joint(body) is None:
        return [problem("objects", "scene_fixed", _item(obj), known=known)]
    asked_for = dataclasses.replace(obj, type="box", **{name: getattr(plain, name) for name in _AS_IN_SCENE})
    return [
        *(
            problem(f"objects.{name}", _RULES.get(name, "as_in_scene"), _item(obj), getattr(obj, name))
            for name in _AS_IN_SCENE
            if not _is_plain(getattr(obj, name), getattr(plain, name))
        ),
        *asked_for.problems(),
    ]


def _is_plain(value: object, plain: object) -> bool:
    return value is plain or (isinstance(value, (int, float, str)) and value == plain)


def _free_joint(body: mujoco.MjsBody) -> Any:
    return next((joint for joint in body.joints if joint.type == _FREE), None)


def _prepare(spec: mujoco.MjSpec, obj: Object) -> None:
    """Gives a body what an object has: names, colours of its geoms' own, what was asked for; and takes it out of its frame."""
    body = spec.body(obj.name)
    joint = _free_joint(body)
    joint.name = joint.name or unused(objects.joint_name(obj.name), {j.name for j in spec.joints})
    joint.align = mujoco.mjtAlignFree.mjALIGNFREE_FALSE
    for geom in body.find_all("geom"):
        geom.name = geom.name or unused(objects.geom_name(obj.name), {g.name for g in spec.geoms})
        objects.dress(spec, geom, obj)


class _Scene(NamedTuple):
    """The compiled scene, and the tables in it."""

    model: mujoco.MjModel
    data: mujoco.MjData
    tables: Sequence[TableNames]
    volume: dict[str, float]  # of the bodies that are asked for

    @classmethod
    def of(cls, spec: mujoco.MjSpec, tables: Sequence[TableNames], names: list[str]) -> "_Scene":
        model = specs.compiled(spec.copy(), "xml")
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        return cls(model, data, tables, dict(zip(names, volumes(spec, names), strict=True)))

    def hits(self, body: int) -> np.ndarray:
        """(ngeom,) bool: the geoms of a free body, and of what hangs on it, that collide."""
        model = self.model
        return ((model.geom_contype | model.geom_conaffinity) != 0) & (model.body_rootid[model.geom_bodyid] == body)

    def tops(self, middle: np.ndarray) -> list[tuple[float, int, np.ndarray, float]]:
        """The tables under a point (3,), the nearest first: how far, which, where from the middle of its top, its yaw."""
        found = []
        for t, names in enumerate(self.tables):
            slab = self.model.geom(names.collision).id
            axes, half = self.data.geom_xmat[slab].reshape(3, 3), self.model.geom_size[slab]
            local = axes.T @ (middle - self.data.geom_xpos[slab]) - [0, 0, half[2]]
            if (np.abs(local[:2]) <= half[:2]).all():
                found.append((float(local[2]), t, local[:2], float(np.arctan2(axes[1, 0], axes[0, 0]))))
        return sorted(found, key=lambda one: abs(one[0]))


def _adopted(spec: mujoco.MjSpec, scene: _Scene, obj: Object) -> SceneObject | list[Problem]:
    """A body of the scene as an object, or what is wrong with it."""
    model, body = scene.model, spec.body(obj.name)
    scaled.refuse(spec, scaled.of_body(body), "objects", _item(obj))
    index = model.body(obj.name).id
    hits = scene.hits(index)
    if not hits.any():
        return [problem("objects", "scene_ghost", _item(obj))]
    if np.ptp(model.geom_friction[hits], axis=0).any():
        return [problem("objects", "scene_frictions", _item(obj), name=obj.name)]
    stands = stance(model, scene.data, index, hits)
    table = _table(scene, obj, hits, index, stands)
    if isinstance(table, Problem):
        return [table]
    on, pos, yaw = table
    kind, measures = _measured(spec, scene, obj, stands)
    if obj.mass is not None:
        objects.scale_mass(body, obj.mass / measures.mass)
        measures = dataclasses.replace(measures, mass=obj.mass, density=measures.density * obj.mass / measures.mass)
    _settle(body, kind)
    found = {f.name: getattr(obj, f.name) for f in dataclasses.fields(Object)} | {"type": kind, "on": on}
    geom, joint = body.geoms[0].name if len(body.geoms) else "", _free_joint(body).name
    found |= {"pos": tuple(pos.tolist()), "rot": stands.yaw - yaw, "own_joint": joint, "own_geom": geom}
    return SceneObject(**found, own_tilt=tuple(stands.tilt.tolist()), measures=measures)


def _table(
    scene: _Scene, obj: Object, hits: np.ndarray, body: int, stands: Stance
) -> tuple[int, np.ndarray, float] | Problem:
    """The table that a body stands on, the place of its middle in the frame of the table's top, and the table's yaw."""
    model, cos, sin = scene.model, np.cos(stands.yaw), np.sin(stands.yaw)
    x, y, _ = (stands.low + stands.high) / 2
    foot = scene.data.xpos[body] + [cos * x - sin * y, sin * x + cos * y, stands.low[2]]
    below = scene.tops(foot)
    if not below or abs(below[0][0]) > RESTS:
        nearest = scene.tables[below[0][1]].body if below else None
        why = (
            f"table {nearest!r}, whose top is {abs(below[0][0]):.3g} m {_side(below[0][0])} that"
            if below
            else "no table"
        )
        place = {"place": ", ".join(f"{v:.3g}" for v in foot), "why": why, "name": obj.name}
        return problem("objects", "scene_no_table", _item(obj), None, place)
    _, on, pos, yaw = below[0]
    names = scene.tables[on]
    if obj.on not in (0, on, names.body, names.collision):
        return problem("objects.on", "scene_table", _item(obj), obj.on, name=names.body)
    slab = model.geom(names.collision).id
    meets = (model.geom_contype[hits] & model.geom_conaffinity[slab]) | (
        model.geom_conaffinity[hits] & model.geom_contype[slab]
    )
    return (on, pos, yaw) if meets.any() else problem("objects", "scene_through", _item(obj), name=names.body)


def _side(height: float) -> str:
    return "below" if height > 0 else "above"


def _measured(spec: mujoco.MjSpec, scene: _Scene, obj: Object, stands: Stance) -> tuple[str, Measures]:
    """The type of a body, and what it is."""
    model = scene.model
    index = model.body(obj.name).id
    hits = scene.hits(index)
    kind = primitive(spec, model, obj.name, stands.is_upright)
    mass = float(model.body_subtreemass[index])
    rgba = np.ones(4) if kind == "mjcf" else np.array(model.geom_rgba[hits][0], float)
    friction = np.array(model.geom_friction[hits][0], float)
    size, middle = stands.high - stands.low, (stands.high + stands.low) / 2
    if kind != "mjcf":
        size, middle = shapes.full_size(kind, model.geom_size[hits][0]), np.zeros(3)
    return kind, Measures(size, middle, mass, mass / scene.volume[obj.name], friction, rgba)


def _settle(body: mujoco.MjsBody, kind: str) -> None:
    """Takes a body out of its frame, and has its place, and a primitive shape's, be numbers that parameters decide."""
    specs.out_of_frames(body)
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    if kind != "mjcf":
        geom = body.geoms[0]
        geom.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        quat = (np.sqrt(0.5), 0, np.sqrt(0.5), 0) if kind == "capsule" else (1, 0, 0, 0)
        specs.assign(geom, pos=(0, 0, 0), quat=quat, fromto=[np.nan] * 6)
        specs.out_of_frames(geom)
