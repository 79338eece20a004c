"""Materials that are added to an arena, with textures of its own (host)."""

import hashlib
import io
from collections.abc import Sequence
from typing import Any

import jax
import mujoco
import numpy as np

from mjx_arenas import textures
from mjx_arenas.extras import extra
from mjx_arenas.problem import Problem, problem, under
from mjx_arenas.rules import validation
from mjx_arenas.spec import names, specs


def add(
    spec: mujoco.MjSpec,
    name: str,
    texture: textures.Texture | np.ndarray | jax.Array | None,
    rgba: Sequence[float],
    texrepeat: Sequence[float],
    texuniform: bool,
    specular: float,
    shininess: float,
) -> None:
    """Adds a material to a spec; see `Arena.add_material`."""
    given = {"rgba": rgba, "texrepeat": texrepeat, "specular": specular, "shininess": shininess}
    found = _name_problems(spec, name) + _texture_problems(texture)
    for attribute, value in given.items():
        found += _number_problems(attribute, value)
    if not isinstance(texuniform, (bool, np.bool_)):
        found.append(problem("texuniform", "truth", None, texuniform))
    validation.raise_all(found, "`add_material`")
    pixels = None if texture is None else _pixels(texture)
    file = None if pixels is None else _held(spec, pixels)
    material = spec.add_material(name=name)
    plain = mujoco.MjSpec().add_material()  # a `<default>` of the MJCF does not reach it
    others = {
        attribute: getattr(plain, attribute) for attribute in ("emission", "reflectance", "metallic", "roughness")
    }
    specs.assign(material, texuniform=bool(texuniform), **given, **others)
    if file is not None:
        spec.add_texture(name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, file=file)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name


def _pixels(texture: textures.Texture | np.ndarray | jax.Array) -> np.ndarray:
    """The pixels of a texture, or of an array of them.

    Raises:
        ValueError: a texture of a class of your own has none.
    """
    if not isinstance(texture, textures.Texture):
        return np.asarray(texture)
    pixels = texture.pixels()
    validation.raise_all(_pixels_problems("texture.pixels()", pixels), "`add_material`")
    return pixels


def _held(spec: mujoco.MjSpec, pixels: np.ndarray) -> str:
    """The name of a PNG of pixels, which the spec then holds: MJCF has no pixels, but names of files.

    The name follows from the pixels, so that specs of equal MJCF have equal textures.
    """
    file = io.BytesIO()
    extra("PIL.Image").fromarray(pixels).save(file, "PNG")
    digest = hashlib.sha256(f"{pixels.shape}".encode() + pixels.tobytes()).hexdigest()[:16]
    name = f"texture-{digest}.png"
    spec.assets = {**spec.assets, name: file.getvalue()}
    return name


def _name_problems(spec: mujoco.MjSpec, name: Any) -> list[Problem]:
    """What is no name, or that of something else."""
    taken = {element.name for element in (*spec.materials, *spec.textures)}
    return names.problems("name", name, taken, "material or texture")


def _texture_problems(texture: Any) -> list[Problem]:
    """What is no texture."""
    if isinstance(texture, textures.Texture):
        return under("texture", texture.problems())
    if isinstance(texture, (np.ndarray, jax.Array)) and not isinstance(texture, jax.core.Tracer):
        return _pixels_problems("texture", texture)
    kinds = ", ".join(kind for kind in textures.__all__ if kind != "Texture")
    must = f"one of mjx_arenas.textures ({kinds}), an array (height, width, 3) of uint8, or None"
    return [] if texture is None else [problem("texture", "must", None, texture, must=must)]


def _pixels_problems(name: str, pixels: Any) -> list[Problem]:
    """What are no pixels."""
    is_array, most = isinstance(pixels, (np.ndarray, jax.Array)), textures.LARGEST
    right = is_array and pixels.ndim == 3 and pixels.shape[2] == 3 and pixels.dtype == np.uint8
    if right and all(1 <= n <= most for n in pixels.shape[:2]):
        return []
    must = f"(height, width, 3) uint8, with 1 to {most} rows and columns"
    got = f"{pixels.dtype} of shape {pixels.shape}" if is_array else type(pixels).__name__
    return [problem(name, "must", None, None, {"must": must, "got": got})]


def _number_problems(name: str, value: Any) -> list[Problem]:
    """What are no numbers that MuJoCo's attribute of that name may have."""
    found = validation.vector_problems(name, value, {"rgba": 4, "texrepeat": 2}.get(name, 0), "")
    numbers = np.array(0.5) if found else np.asarray(value)
    if name == "texrepeat":
        return found or ([] if (numbers > 0).all() else [problem(name, "must", None, value, must="> 0")])
    return found or ([] if ((numbers >= 0) & (numbers <= 1)).all() else [_share(name, value)])


def _share(name: str, value: Any) -> Problem:
    return problem(name, "limits", None, value, between="between 0 and 1")
