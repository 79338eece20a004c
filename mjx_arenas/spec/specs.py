"""Reading, editing and merging `mujoco.MjSpec`s (host)."""

import functools
import os
from collections.abc import Sequence
from typing import Any, TypeAlias

import mujoco
import numpy as np

from mjx_arenas.keywords import near_file
from mjx_arenas.problem import Item, problem
from mjx_arenas.problems.messages import error
from mjx_arenas.spec import automatic

Pose: TypeAlias = tuple[Sequence[float] | np.ndarray, Sequence[float] | np.ndarray]  # position [m], orientation


def read(source: str | os.PathLike | mujoco.MjSpec, path: str, item: Item | None = None) -> mujoco.MjSpec:
    """A spec of one's own from an MJCF file, MJCF text or a spec, all of whose keyframes have names.

    Args:
        source: what was given.
        path: of the argument.
        item: the object whose argument it is.

    Raises:
        FileNotFoundError, TypeError, ValueError: the one problem.
    """
    spec = source.copy() if isinstance(source, mujoco.MjSpec) else _parsed(source, path, item)
    automatic.keyframes(spec)
    if not os.path.isabs(spec.modelfiledir):  # the current folder may change
        make_paths_absolute(spec, path, item)
    return spec


def _parsed(source: str | os.PathLike, path: str, item: Item | None) -> mujoco.MjSpec:
    if not isinstance(source, (str, os.PathLike)):
        pair = isinstance(source, tuple) and len(source) > 0 and isinstance(source[0], mujoco.MjSpec)
        raise error([problem(path, "spec_and_more" if pair else "mjcf", item, source)], kind=TypeError)
    text, is_text = os.fspath(source), is_mjcf(os.fspath(source))
    if not is_text and os.path.isdir(text):
        raise error([problem(path, "mjcf_folder", item, text)], kind=IsADirectoryError)
    if not is_text and not os.path.isfile(text):
        rule = "named_robot" if path == "robot" and not os.path.splitext(text)[1] else "no_mjcf"
        raise error([problem(path, rule, item, text, near=near_file(text))], kind=FileNotFoundError)
    if is_text and "<mujoco" not in text:
        raise error([problem(path, "no_root", item)])
    try:
        return mujoco.MjSpec.from_string(text) if is_text else mujoco.MjSpec.from_file(os.path.abspath(text))
    except ValueError as refused:
        what = "the MJCF text" if is_text else repr(text)
        raise error([problem(path, "unread", item, what=what, text=one_line(refused))]) from None


def is_mjcf(text: str) -> bool:
    """Whether a string is MJCF text, not a path."""
    return text.lstrip().startswith("<")


def compiled(spec: mujoco.MjSpec, path: str, item: Item | None = None) -> mujoco.MjModel:
    """The compiled model, or a `ValueError` about the argument that it comes from."""
    try:
        return spec.compile()
    except ValueError as refused:
        raise error([problem(path, "uncompiled", item, text=one_line(refused))]) from None


@functools.cache
def option_names() -> tuple[str, ...]:
    """Names of MuJoCo's options."""
    plain = mujoco.MjSpec().option
    return tuple(n for n in dir(plain) if not n.startswith("_") and not callable(getattr(plain, n)))


def options(option: Any) -> tuple[object, ...]:
    """The options of a compiled model or of a spec, to be compared."""
    values = (getattr(option, name) for name in option_names())
    return tuple(value.tobytes() if isinstance(value, np.ndarray) else value for value in values)


def other_options(option: Any, than: Any) -> dict[str, Any]:
    """The options that differ from others, as numbers and lists of them, by name."""
    both = zip(option_names(), options(option), options(than), strict=True)
    return {name: np.asarray(getattr(option, name)).tolist() for name, a, b in both if a != b}


def set_options(target: Any, option: Any) -> None:
    """Gives a compiled model or a spec other options."""
    assign(target, **other_options(option, target))


def geom_name(model: mujoco.MjModel, geom: int) -> str:
    """What a geom is called in messages: its name, or what it is and of which body."""
    if name := model.geom(int(geom)).name:
        return repr(name)
    body = int(model.geom_bodyid[geom])
    of = f"body {body_name(model, body)}" if body else "the world"
    return f"an unnamed {mujoco.mjtGeom(model.geom_type[geom]).name[7:].lower()} of {of}"


def body_name(model: mujoco.MjModel, body: int) -> str:
    """What a body is called in messages: its name, or the one that it would get."""
    names = [model.body(i).name for i in range(model.nbody)]
    return automatic.body(names, model.body_parentid.tolist(), int(body))


def one_line(error: Exception) -> str:
    """MuJoCo's message without its line breaks."""
    return " ".join(str(error).split())


def assign(element: object, **attributes: object) -> None:
    """Sets attributes."""
    for name, value in attributes.items():
        setattr(element, name, value)


def out_of_frames(element: Any) -> None:
    """Takes an element of a body, or a body, out of its frames: its pose is then in numbers that of what it hangs on."""
    if element.frame is not None:
        element.set_frame(element.parent.add_frame())  # one that changes nothing: MuJoCo takes no None


def ancestors(body: mujoco.MjsBody) -> list[mujoco.MjsBody]:
    """A body and all that it hangs on, but for the world."""
    found = []
    while body.name != "world":
        found.append(body)
        body = body.parent
    return found


def make_massless(body: mujoco.MjsBody) -> None:
    """Gives a body no mass, and an inertial frame that stays where the body is.

    Of a massless body without this, MuJoCo's compiler would put the inertial frame where the body stands in the world.
    """
    assign(body, explicitinertial=True, mass=0, inertia=(0, 0, 0), ipos=(0, 0, 0), iquat=(1, 0, 0, 0))


# What decides the physics of a geom, and would otherwise come from the `<default>`s of the base MJCF.
_GEOM_PHYSICS = (
    *("pos", "quat", "fromto", "contype", "conaffinity", "condim", "group", "priority", "friction", "solmix", "solref"),
    *("solimp", "margin", "gap", "mass", "density", "typeinertia", "meshname", "fluid_ellipsoid", "material", "rgba"),
)


def add_geom(body: mujoco.MjsBody, name: str, type: mujoco.mjtGeom) -> mujoco.MjsGeom:
    """A geom with MuJoCo's own defaults."""
    geom, plain = body.add_geom(name=name), mujoco.MjSpec().worldbody.add_geom()
    for attribute in _GEOM_PHYSICS:
        setattr(geom, attribute, getattr(plain, attribute))
    geom.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    geom.type = type
    return geom


def add_mesh(spec: mujoco.MjSpec, name: str, **given: Any) -> mujoco.MjsMesh:
    """A convex mesh with MuJoCo's own defaults, of a file or of vertices."""
    mesh = spec.add_mesh(name=name, **given)
    assign(mesh, refpos=(0, 0, 0), refquat=(1, 0, 0, 0), scale=(1, 1, 1), maxhullvert=-1)
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
    return mesh


_NOT_COPIED = ("alt", "frame", "parent", "id", "info", "signature", "compiler", "classname", "plugin", "name")


def move_geom(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, body: mujoco.MjsBody) -> mujoco.MjsGeom:
    """The geom on another body, at the same place in that one's frame; what refers to it by its name refers to this one."""
    name, taken = geom.name, {g.name for g in spec.geoms}
    geom.name = next(f"{name}_{k}" for k in range(len(taken) + 1) if f"{name}_{k}" not in taken)
    moved = copy_geom(geom, body, name)
    spec.delete(geom)
    return moved


def turn(element: Any) -> np.ndarray:
    """(4,) the quaternion of an element in its frame; angles are in the units and the order of the MJCF that it comes from."""
    if element.alt.type == mujoco.mjtOrientation.mjORIENTATION_QUAT:
        return np.array(element.quat)
    rules = element.compiler
    resolve = mujoco.MjSpec.resolve_orientation
    return np.array(resolve(degree=rules.degree, sequence=rules.eulerseq, orientation=element.alt))


def copy_geom(geom: mujoco.MjsGeom, body: mujoco.MjsBody, name: str) -> mujoco.MjsGeom:
    """A geom like another one, in none of its frames."""
    copied = body.add_geom(name=name)
    copied.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    for attribute in dir(geom):
        value = None if attribute.startswith("_") or attribute in _NOT_COPIED else getattr(geom, attribute)
        if value is not None and not callable(value):
            setattr(copied, attribute, value)
    copied.quat = turn(geom)
    return copied


_NAMED = (
    *("bodies", "joints", "geoms", "sites", "cameras", "lights", "meshes", "materials", "textures", "hfields", "pairs"),
    *("excludes", "equalities", "tendons", "actuators", "sensors", "numerics", "texts", "tuples", "keys"),
)


def clashes(spec: mujoco.MjSpec, child: mujoco.MjSpec, prefix: str) -> list[str]:
    """What both specs would have under one name, e.g. "body 'base'"."""
    found = []
    for kind in _NAMED:
        taken = {e.name for e in getattr(spec, kind)} - {"", "world"}
        one = {"bodies": "body", "meshes": "mesh", "equalities": "equality"}.get(kind, kind.removesuffix("s"))
        found += [f"{one} {prefix + e.name!r}" for e in getattr(child, kind) if e.name and prefix + e.name in taken]
    return found


def attach(
    spec: mujoco.MjSpec,
    child: mujoco.MjSpec,
    prefix: str,
    frame: mujoco.MjsFrame,
    path: str,
    item: Item | None = None,
    pose: Pose | None = None,
) -> None:
    """Puts all of a child into a frame of a spec, with its assets' files by their absolute paths.

    What stands in the child's world without a name gets one, as there it would be numbered with what else stands in the arena's.

    Args:
        spec: of the arena.
        child: what comes into it, which is used up.
        prefix: of all its names.
        frame: of the arena.
        path: of the argument that it comes from.
        item: the object whose argument it is.
        pose: where the child's world comes to stand in the arena's, which its keyframes follow.

    Raises:
        ValueError: names clash, or MuJoCo refuses the child, which comes from the argument `path`.
    """
    make_paths_absolute(child, path, item)
    model = compiled(child, path, item)  # its keyframes get their prefix only then
    automatic.keyframes(child)
    automatic.give(child, "world", spec, prefix)
    if pose is not None:
        _move_keyframes(child, model, *pose)
    both = clashes(spec, child, prefix)
    if both:
        names = [", ".join(both[:3]) + (f" and {len(both) - 3} more" if len(both) > 3 else "")]
        raise error([problem(path, "clash", item, names=names)])
    for shared in ("option", "visual", "stat"):  # of the whole model: the arena's, without MuJoCo's warning
        copy_settings(getattr(spec, shared), getattr(child, shared))
    _share_sizes(spec, child)
    try:
        spec.attach(child, prefix=prefix, frame=frame)
    except ValueError as refused:
        raise error([problem(path, "unattached", item, text=one_line(refused))]) from None


def _share_sizes(spec: mujoco.MjSpec, child: mujoco.MjSpec) -> None:
    """Gives both specs the `<size>`s of one with all of both, where MuJoCo would warn and keep the arena's.

    Memory is the arena's, as more is found on its own; -1 leaves it to MuJoCo, and keyframes it counts itself.
    """
    for name in ("nuserdata", *(n for n in dir(spec) if n.startswith("nuser_"))):
        both = getattr(spec, name), getattr(child, name)
        setattr(spec, name, -1 if -1 in both else max(both))
    for name in [n for n in dir(spec) if n in _ROOM or n.startswith("nuser")]:
        setattr(child, name, getattr(spec, name))


_ROOM = ("memory", "nkey", "njmax", "nconmax", "nemax", "nstack")


def _move_keyframes(spec: mujoco.MjSpec, model: mujoco.MjModel, pos: Any, quat: Any) -> None:
    """Moves free bodies and mocap bodies in keyframes, whose numbers are in the world; `model` is of the spec."""
    pos, quat = np.asarray(pos, float), np.asarray(quat, float) / np.linalg.norm(quat)
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    for key in spec.keys:  # what one leaves out, MuJoCo fills in
        if len(key.qpos):
            qpos = np.array(key.qpos)
            for adr in model.jnt_qposadr[free]:
                qpos[adr : adr + 3] = pos + _turned(quat, qpos[adr : adr + 3])
                qpos[adr + 3 : adr + 7] = _after(quat, qpos[adr + 3 : adr + 7])
            key.qpos = qpos
        if len(key.qvel):
            qvel = np.array(key.qvel)
            for adr in model.jnt_dofadr[free]:
                qvel[adr : adr + 3] = _turned(quat, qvel[adr : adr + 3])
            key.qvel = qvel
        if len(key.mpos):
            key.mpos = np.concatenate([pos + _turned(quat, p) for p in np.reshape(key.mpos, (-1, 3))])
        if len(key.mquat):
            key.mquat = np.concatenate([_after(quat, q) for q in np.reshape(key.mquat, (-1, 4))])


def _turned(quat: np.ndarray, vector: np.ndarray) -> np.ndarray:
    turned = np.zeros(3)
    mujoco.mju_rotVecQuat(turned, vector, quat)
    return turned


def _after(second: np.ndarray, first: np.ndarray) -> np.ndarray:
    quat = np.zeros(4)
    mujoco.mju_mulQuat(quat, second, first)
    return quat


def copy_settings(source: Any, target: Any) -> None:
    """Copies the attributes of a part of a spec that is there once, its options for one, and of their parts."""
    for name in [n for n in dir(source) if not n.startswith("_")]:
        value = getattr(source, name)
        if type(value).__module__.startswith("mujoco") and not isinstance(value, (int, float)):
            copy_settings(value, getattr(target, name))
        elif not callable(value):
            setattr(target, name, value)


def make_paths_absolute(spec: mujoco.MjSpec, path: str, item: Item | None = None) -> None:
    """Files of assets by the absolute paths at which MuJoCo finds them now, so that they are found from anywhere.

    What `MjSpec.attach` brought from another folder is found there, which only the compiler knows. Files that the spec holds
    itself keep their names.

    Raises:
        ValueError: MuJoCo does not find one of those of the argument `path`.
    """
    kinds = {"meshes": "mesh", "hfields": "hfield", "skins": "skin", "textures": "tex"}
    assets = [(kind, i) for kind in kinds for i, asset in enumerate(getattr(spec, kind)) if _is_relative(asset.file)]
    found = _found_at(spec, path, item) if assets else {}
    for kind, i in assets:
        asset = getattr(spec, kind)[i]
        asset.file = _absolute(found.get((kinds[kind], i), ""), asset.file)
    cubes = [(i, list(t.cubefiles)) for i, t in enumerate(spec.textures) if any(map(_is_relative, t.cubefiles))]
    for face in range(max((len(files) for _, files in cubes), default=0)):
        probe = spec.copy()  # of textures of one file each, as the model has the path of one alone
        for i, files in cubes:
            texture = probe.textures[i]
            texture.file, texture.cubefiles, texture.type = files[face], [""] * len(files), _FLAT
        found = _found_at(probe, path, item)
        for i, files in cubes:
            files[face] = _absolute(found.get(("tex", i), ""), files[face])
    for i, files in cubes:
        spec.textures[i].cubefiles = files


_FLAT = mujoco.mjtTexture.mjTEXTURE_2D


def _is_relative(file: str) -> bool:
    return bool(file) and not os.path.isabs(file)


def _absolute(path: str, file: str) -> str:
    """The absolute path of a file that was found at `path`; as it is, if it is none on the disk."""
    return os.path.abspath(path) if _is_relative(file) and os.path.isfile(path) else file


def _found_at(spec: mujoco.MjSpec, path: str, item: Item | None) -> dict[tuple[str, int], str]:
    """Paths of the files of assets, as MuJoCo found them, by the kind and the index in the spec."""
    spec = spec.copy()
    assign(spec.compiler, discardvisual=False)  # or visual meshes are none of the model's
    model, found = compiled(spec, path, item), {}
    for name, assets in (("mesh", spec.meshes), ("hfield", spec.hfields), ("skin", spec.skins), ("tex", spec.textures)):
        addresses = getattr(model, f"{name}_pathadr")
        for i, asset in enumerate(assets):
            address = addresses[asset.id]
            if address >= 0:
                found[name, i] = model.paths[address : model.paths.index(b"\0", address)].decode()
    return found


def has_dampratio(actuator: mujoco.MjsActuator) -> bool:
    """Whether an actuator is a position servo with a `dampratio`, which a spec has as a positive damping."""
    fixed, affine = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
    servo = actuator.gaintype == fixed and actuator.biastype == affine and actuator.gainprm[0] == -actuator.biasprm[1]
    return bool(servo and actuator.biasprm[2] > 0)
