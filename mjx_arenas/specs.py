"""Reading, editing and merging `mujoco.MjSpec`s (host)."""

import os
from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.messages import error
from mjx_arenas.problems import Item, problem


def read(source: str | os.PathLike | mujoco.MjSpec, path: str, item: Item | None = None) -> mujoco.MjSpec:
    """A spec of one's own from an MJCF file, MJCF text or a spec.

    Args:
        source: what was given.
        path: of the argument.
        item: the object whose argument it is.

    Raises:
        FileNotFoundError, TypeError, ValueError: the one problem.
    """
    if isinstance(source, mujoco.MjSpec):
        return source.copy()
    if not isinstance(source, (str, os.PathLike)):
        raise error([problem(path, "mjcf", item, source)], kind=TypeError)
    text = os.fspath(source)
    is_text = is_mjcf(text)
    if not is_text and not os.path.isfile(text):
        raise error([problem(path, "no_mjcf", item, text)], kind=FileNotFoundError)
    if is_text and "<mujoco" not in text:
        raise error([problem(path, "no_root", item)])
    try:
        return mujoco.MjSpec.from_string(text) if is_text else mujoco.MjSpec.from_file(text)
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


def set_options(spec: mujoco.MjSpec, option: mujoco.MjOption) -> None:
    """Gives a spec the options of a compiled model."""
    for name in (n for n in dir(option) if not n.startswith("_") and not callable(getattr(option, n))):
        if hasattr(spec.option, name) and not np.all(getattr(spec.option, name) == getattr(option, name)):
            setattr(spec.option, name, getattr(option, name))


def one_line(error: Exception) -> str:
    """MuJoCo's message without its line breaks."""
    return " ".join(str(error).split())


def assign(element: object, **attributes: object) -> None:
    """Sets attributes."""
    for name, value in attributes.items():
        setattr(element, name, value)


def make_massless(body: mujoco.MjsBody) -> None:
    """Gives a body no mass, and an inertial frame that stays where the body is.

    Of a massless body without this, MuJoCo's compiler would put the inertial frame where the body stands in the world.
    """
    assign(body, explicitinertial=True, mass=0, inertia=(0, 0, 0), ipos=(0, 0, 0), iquat=(1, 0, 0, 0))


def mass_rules(spec: mujoco.MjSpec) -> list[str]:
    """Rules of the compiler by which masses would not be those of the bodies and geoms alone."""
    compiler, (low, high) = spec.compiler, spec.compiler.inertiagrouprange
    found = [name for name in ("boundmass", "boundinertia", "settotalmass") if getattr(compiler, name) > 0]
    never = compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    found += ["inertiafromgeom"] * never + ["inertiagrouprange"] * (not low <= 0 <= high)
    return found


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
) -> None:
    """Puts all of a child into a frame of a spec, with its assets' files by their absolute paths.

    Raises:
        ValueError: names clash, or MuJoCo refuses the child, which comes from the argument `path`.
    """
    make_paths_absolute(child)
    compiled(child, path, item)  # its keyframes get their prefix only then
    both = clashes(spec, child, prefix)
    if both:
        names = [", ".join(both[:3]) + (f" and {len(both) - 3} more" if len(both) > 3 else "")]
        raise error([problem(path, "clash", item, names=names)])
    for shared in ("option", "visual", "stat"):  # of the whole model: the arena's, without MuJoCo's warning
        copy_settings(getattr(spec, shared), getattr(child, shared))
    try:
        spec.attach(child, prefix=prefix, frame=frame)
    except ValueError as refused:
        raise error([problem(path, "unattached", item, text=one_line(refused))]) from None


def copy_settings(source: Any, target: Any) -> None:
    """Copies the attributes of a part of a spec that is there once, its options for one, and of their parts."""
    for name in [n for n in dir(source) if not n.startswith("_")]:
        value = getattr(source, name)
        if type(value).__module__.startswith("mujoco") and not isinstance(value, (int, float)):
            copy_settings(value, getattr(target, name))
        elif not callable(value):
            setattr(target, name, value)


def make_paths_absolute(spec: mujoco.MjSpec) -> None:
    """Files of assets by their absolute paths, so that they are found from anywhere."""
    for assets, folder in ((spec.meshes, spec.meshdir), (spec.hfields, spec.meshdir), (spec.skins, spec.meshdir)):
        _absolute(assets, spec.modelfiledir, folder)
    _absolute(spec.textures, spec.modelfiledir, spec.texturedir)


def _absolute(assets: Iterable[Any], *folders: str) -> None:
    def absolute(file: str) -> str:
        path = os.path.join(*folders, file)
        return os.path.abspath(path) if file and os.path.exists(path) else file

    for asset in assets:
        asset.file = absolute(asset.file)
        if isinstance(asset, mujoco.MjsTexture):
            asset.cubefiles = [absolute(file) for file in asset.cubefiles]
