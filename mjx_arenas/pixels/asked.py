"""The renderer that a call asks for, or all that is wrong with the call (host)."""

import importlib.util
from collections.abc import Collection, Mapping, Sequence, Set
from typing import Any

import jax
import mujoco
import numpy as np

from mjx_arenas.build.cameras import NO_SIZE, size_problems
from mjx_arenas.pixels.renderer import Camera, Renderer
from mjx_arenas.problem import Problem, problem
from mjx_arenas.record.record import Record
from mjx_arenas.rules import validation
from mjx_arenas.spec import patterns

RESOLUTION = (64, 64)
_KINDS = ("rgb", "depth", "segmentation")


def renderer(
    record: Record,
    cameras: Collection[str] | Mapping[str, tuple[int, int]] | None,
    shadows: bool,
    textures: bool,
    groups: Collection[int],
    background: Sequence[float],
    **wanted: bool | Collection[str],
) -> Renderer:
    """See `Varied.renderer`; `wanted` are rgb, depth and segmentation."""
    _check_warp()
    model, found = record.mj_model, []
    sizes = _resolutions(model, cameras, found)
    outputs = {kind: _outputs(kind, wanted[kind], sizes, found) for kind in _KINDS}
    for name, value in (("shadows", shadows), ("textures", textures)):
        if not isinstance(value, (bool, np.bool_)):
            found.append(problem(name, "truth", None, value))
    groups = _listed(groups)
    found += _groups_problems(model, groups)
    wrong = validation.vector_problems("background", background, 3, "")
    if not wrong and not all(0 <= x <= 1 for x in np.asarray(background).tolist()):
        wrong = [problem("background", "must", None, background, must="red, green and blue within 0 and 1")]
    validation.raise_all(found + wrong, "`renderer`")
    if model.nflex:
        raise validation.error([problem("arena", "renderer_flexes", None, model.nflex)])
    if not any(outputs.values()):
        raise validation.error([problem("rgb", "draws_nothing", None, False)])
    for name in sizes:
        if not any(name in outputs[kind] for kind in _KINDS):
            raise validation.error([problem("cameras", "draws_nothing_of", None, name)])
    _check_shadows(record, bool(shadows))
    _check_textures(record, bool(textures), groups)
    seen = tuple(Camera(name, *size, *(name in outputs[kind] for kind in _KINDS)) for name, size in sizes.items())
    red, green, blue = (float(x) for x in background)
    drawn = tuple(sorted(int(g) for g in groups))
    return Renderer(record, seen, bool(shadows), bool(textures), drawn, (red, green, blue))


def _check_warp() -> None:
    if importlib.util.find_spec("warp") is None:
        raise validation.error([problem("", "renderer_warp")], kind=RuntimeError)


def _listed(value: Any) -> Any:
    """The entries of an array as a list of Python's; what is no array, as it is."""
    return np.asarray(value).tolist() if isinstance(value, (np.ndarray, jax.Array)) else value


def _resolutions(model: mujoco.MjModel, cameras: Any, found: list[Problem]) -> dict[str, tuple[int, int]]:
    """Width and height of each camera's picture."""
    known = [name for i in range(model.ncam) if (name := model.camera(i).name)]
    if cameras is None:
        cameras = known
    cameras = _listed(cameras)
    if isinstance(cameras, Set):  # in an order that is the same in all processes
        cameras = sorted(cameras, key=lambda name: (known.index(name) if name in known else len(known), str(name)))
    if isinstance(cameras, str) or not isinstance(cameras, Sequence | Mapping):
        found.append(problem("cameras", "must", None, cameras, must="names, or a dict of (width, height) by name"))
        return {}
    if not len(cameras):
        raise validation.error(
            [problem("cameras", "a_camera", None, cameras, known=", ".join(known) or "none: arena.add_camera")]
        )
    sizes = {}
    for name in cameras:
        if not isinstance(name, str):
            found.append(problem("cameras", "must", None, name, must=f"one of {', '.join(known) or 'none'}"))
            continue
        if name not in known:
            found.append(problem("cameras", "no_camera", None, name, nearest=patterns.near(name, known)))
            continue
        name = str(name)  # NumPy's texts, too
        if name in sizes:
            found.append(problem("cameras", "twice", None, name))
        own = tuple(int(x) for x in model.cam_resolution[model.camera(name).id])
        size = cameras[name] if isinstance(cameras, Mapping) else own if own != NO_SIZE else RESOLUTION
        wrong = size_problems(f"cameras[{name!r}]", size)
        found += wrong
        sizes[name] = RESOLUTION if wrong else (int(size[0]), int(size[1]))
    return sizes


def _outputs(kind: str, given: Any, cameras: Collection[str], found: list[Problem]) -> frozenset[str]:
    """The cameras that give something."""
    if isinstance(given, (bool, np.bool_)):
        return frozenset(cameras if given else ())
    if isinstance(given, (str, Mapping)) or not isinstance(given, Collection):
        found.append(problem(kind, "must", None, given, must="true, false, or names of cameras"))
        return frozenset()
    of_cameras = [name for name in given if isinstance(name, str) and name in cameras]
    must = f"names of the `cameras` {', '.join(cameras)}"
    found += [
        problem(kind, "must", None, name, must=must)
        for name in given
        if not isinstance(name, str) or name not in cameras
    ]
    return frozenset(of_cameras)


def _groups_problems(model: mujoco.MjModel, groups: Any) -> list[Problem]:
    must = f"a list of whole numbers from 0 to {mujoco.mjNGROUP - 1}"
    if isinstance(groups, (str, Mapping)) or not isinstance(groups, Collection):
        return [problem("groups", "must", None, groups, must=must)]
    wrong = [g for g in groups if not validation.is_whole(g, 0, mujoco.mjNGROUP - 1)]
    if wrong:
        return [problem("groups", "must", None, wrong[0], must=must)]
    if again := [g for g in groups if list(groups).count(g) > 1]:
        return [problem("groups", "twice", None, again[0])]
    if not np.isin(model.geom_group, list(groups)).any():
        there = ", ".join(str(g) for g in sorted({int(g) for g in model.geom_group}))
        return [problem("groups", "must", None, list(groups), must=f"groups that have a geom, of {there}")]
    return []


def _check_shadows(record: Record, shadows: bool) -> None:
    """Refuses terms of shadows that are not drawn."""
    for term in record.scene.owned:
        if term.field == "light_castshadow" and not shadows:
            raise validation.error([problem("shadows", "shadows_vary", None, False, name=term.term)])


def _check_textures(record: Record, textures: bool, groups: Collection[int]) -> None:
    """Refuses textures that are drawn wrong, and terms of what is not drawn."""
    model, owned = record.mj_model, record.scene.owned
    if not textures:
        for term in owned:
            textured = (model.mat_texid >= 0).any() and term.field == "geom_matid"
            if textured or term.field in ("mat_texid", "mat_texrepeat"):
                raise validation.error([problem("textures", "textures_vary", None, False, name=term.term)])
        return
    visible = np.isin(model.geom_group, list(groups))
    chosen = any(term.field in ("mat_texid", "geom_matid") for term in owned)
    used = range(model.nmat) if chosen else sorted({int(m) for m in model.geom_matid[visible] if m >= 0})
    cubes = np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_CUBE)
    for texture in cubes:
        name = model.texture(int(texture)).name
        for material in used:
            if texture in model.mat_texid[material]:
                told = {"material": model.material(material).name, "texture": name}
                raise validation.error([problem("textures", "cube_texture", None, True, told)])
        for term in owned:
            if term.field == "mat_texid":
                raise validation.error(
                    [problem("textures", "cube_texture_varies", None, True, name=term.term, texture=name)]
                )
