"""What happens to a picture on its way from the camera: pure functions of one picture, to which `jax.vmap` adds batches (device).

A picture is (height, width, channels), uint8 from 0 to 255 or floats from 0 to 1, and comes back as the same, cut to that range.
Pictures and numbers may be traced. Only of those that are not can be said whether floats are within 0 and 1.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas import strict
from mjx_arenas.problem import Problem, problem
from mjx_arenas.rules import validation

__all__ = ["background", "blur", "brightness", "contrast", "noise"]

_LUMA = (0.299, 0.587, 0.114)  # of red, green and blue: ITU-R BT.601
_SHARPEST = 0.02  # sigma [pixels] below which all weights but the middle one are 0 in double precision, too
_WIDEST = 64  # radius of a blur [pixels]
_WHOLE = 2  # standard deviations that a radius must hold, or a Gaussian would be a box


@strict.own_constants
def brightness(image: jax.Array, factor: jax.Array | float) -> jax.Array:
    """Multiplies a picture by a factor.

    Args:
        image: (height, width, channels).
        factor: factor >= 0; 1 leaves the picture as it is.

    Raises:
        ValueError: all problems of the call.
    """
    validation.raise_all(_image_problems(image) + _number_problems("factor", factor), "`brightness`")
    return _cut(_numbers(image) * factor, image)


@strict.own_constants
def contrast(image: jax.Array, factor: jax.Array | float) -> jax.Array:
    """Multiplies a picture's distance from its mean grey by a factor.

    The grey of red, green and blue is that of ITU-R BT.601, as in Pillow's `ImageEnhance.Contrast`. For other channels it is their mean.

    Args:
        image: (height, width, channels).
        factor: factor >= 0; 1 leaves the picture as it is, 0 gives grey.

    Raises:
        ValueError: all problems of the call.
    """
    validation.raise_all(_image_problems(image) + _number_problems("factor", factor), "`contrast`")
    numbers = _numbers(image)
    channels = jnp.mean(numbers, axis=(0, 1))
    weights = _LUMA if image.shape[2] == len(_LUMA) else (1 / image.shape[2],) * image.shape[2]
    grey = sum(weight * channels[i] for i, weight in enumerate(weights))
    return _cut(grey + (numbers - grey) * factor, image)


@strict.own_constants
def noise(key: jax.Array, image: jax.Array, std: jax.Array | float) -> jax.Array:
    """Adds Gaussian noise to a picture, drawn independently for every channel of every pixel.

    Args:
        key: key of this picture.
        image: (height, width, channels).
        std: standard deviation, >= 0, as a share of full scale. For a picture of bytes 0.02 is 5.1.

    Raises:
        ValueError: all problems of the call.
    """
    found = validation.one_key_problems("key", key) + _image_problems(image) + _number_problems("std", std)
    validation.raise_all(found, "`noise`")
    draws = jax.random.normal(key, image.shape, jnp.float32)
    return _cut(_numbers(image) + draws * (std * _full(image)), image)


@strict.own_constants
def blur(image: jax.Array, sigma: jax.Array | float, radius: int = 6) -> jax.Array:
    """Blurs a picture with a Gaussian along both axes. Pixels beyond an edge repeat the edge.

    Args:
        image: (height, width, channels).
        sigma: standard deviation, >= 0 [pixels]; 0 leaves the picture as it is.
        radius: radius of the Gaussian [pixels], at most 64, not traced. 3 times the largest sigma loses 0.3 % of it.

    Raises:
        ValueError: all problems of the call.
    """
    found = _image_problems(image) + _number_problems("sigma", sigma)
    if not validation.is_whole(radius, 0, _WIDEST):
        must = f"a whole number from 0 to {_WIDEST}, which is not traced"
        found.append(problem("radius", "must", None, radius, must=must))
    elif not found and not isinstance(sigma, jax.core.Tracer) and radius < _WHOLE * float(sigma):
        least = f"at least {_WHOLE} times `sigma`, {float(sigma):g}"
        found.append(problem("radius", "must", None, radius, must=f"{least}, or most of the Gaussian is cut off"))
    validation.raise_all(found, "`blur`")
    numbers = _numbers(image)
    sharp = jnp.maximum(jnp.asarray(sigma, numbers.dtype), _SHARPEST)
    weights = jnp.exp(-0.5 * (jnp.arange(-radius, radius + 1, dtype=numbers.dtype) / sharp) ** 2)
    weights = weights / weights.sum()
    for axis in (0, 1):
        n, sides = numbers.shape[axis], [(radius, radius) if axis == other else (0, 0) for other in range(3)]
        padded = jnp.pad(numbers, sides, mode="edge")
        shifted = (jax.lax.slice_in_dim(padded, k, k + n, axis=axis) for k in range(2 * radius + 1))
        numbers = sum(weights[k] * part for k, part in enumerate(shifted))
    return _cut(numbers, image)


@strict.own_constants
def background(image: jax.Array, depth: jax.Array, rgb: jax.Array | Sequence[float]) -> jax.Array:
    """Draws a colour, or another picture, where a picture shows nothing.

    Args:
        image: (height, width, 3).
        depth: (height, width) distances as `Renderer` gives them [m]; 0 means that there is nothing.
        rgb: (3,) or (height, width, 3), from 0 to 1 or uint8 from 0 to 255; both forms go with every picture.

    Raises:
        ValueError: all problems of the call.
    """
    found = _image_problems(image, channels=3)
    if not found:
        found = _depth_problems(depth, image.shape[:2]) + _rgb_problems(rgb, image.shape)
    validation.raise_all(found, "`background`")
    behind = _numbers(jnp.asarray(rgb)) * (_full(image) / _full(rgb))
    there = jnp.broadcast_to((depth != 0)[..., None], image.shape)
    return jnp.where(there, image, _cut(jnp.broadcast_to(behind, image.shape), image))


def _full(image: Any) -> float:
    """Full scale of a picture or a colour."""
    return 255.0 if getattr(image, "dtype", None) == np.uint8 else 1.0


def _numbers(image: jax.Array) -> jax.Array:
    """What is computed with: single precision, or the picture's own where that is more."""
    return image.astype(jnp.promote_types(image.dtype, jnp.float32))


def _cut(numbers: jax.Array | float, image: jax.Array) -> jax.Array:
    """Numbers as a picture like another: within its range, the nearest of its kind."""
    numbers = jnp.clip(numbers, 0.0, _full(image))
    return (jnp.round(numbers) if _full(image) > 1 else numbers).astype(image.dtype)


def _kind(value: Any) -> str:
    """What came, by its shape."""
    shape = f"{value.dtype} of shape {value.shape}" if _is_array(value) else type(value).__name__
    return f"{shape}: jax.vmap adds batches" if _is_array(value) and value.ndim > 3 else shape


def _is_array(value: object) -> bool:
    return isinstance(value, (np.ndarray, jax.Array))


def _of_pixels(dtype: Any) -> bool:
    return dtype == np.uint8 or jnp.issubdtype(dtype, jnp.floating)


def _image_problems(image: Any, channels: int | None = None) -> list[Problem]:
    """What is no picture."""
    right = _is_array(image) and image.ndim == 3 and 0 not in image.shape and _of_pixels(image.dtype)
    if right and channels in (None, image.shape[2]):
        return _bright_problems(image)
    must = f"one picture, (height, width, {channels or 'channels'}) of uint8 or floats"
    return [problem("image", "must", None, None, {"must": must, "got": _kind(image)})]


def _bright_problems(image: Any) -> list[Problem]:
    """Floats above 1, such as bytes as floats, and below 0, which would be cut off; and nan."""
    if isinstance(image, jax.core.Tracer) or image.dtype == np.uint8:
        return []
    numbers = np.asarray(image)
    least, most = float(numbers.min()), float(numbers.max())  # nan if any is
    if least >= 0 and most <= 1:
        return []
    must = "from 0 to 1 where it is of floats (bytes are uint8; distances are no colours)"
    return [problem("image", "must", None, None, {"must": must, "got": f"one with {least if least < 0 else most:g}"})]


def _number_problems(name: str, value: Any) -> list[Problem]:
    """What is not one number >= 0; of a traced one, its shape alone is known."""
    if isinstance(value, jax.core.Tracer):
        one = value.ndim == 0 and jnp.issubdtype(value.dtype, jnp.number)
        must = "one number >= 0"
        return [] if one else [problem(name, "must", None, None, {"must": must, "got": _kind(value)})]
    found = validation.vector_problems(name, value, 0, "")
    return found or ([problem(name, "not_negative", None, value, unit="")] if np.asarray(value) < 0 else [])


def _depth_problems(depth: Any, shape: tuple[int, ...]) -> list[Problem]:
    """What are no distances of a picture of this shape."""
    if _is_array(depth) and depth.shape == shape and jnp.issubdtype(depth.dtype, jnp.floating):
        return []
    must = f"floats of the picture's shape {shape} [m]"
    return [problem("depth", "must", None, None, {"must": must, "got": _kind(depth)})]


def _rgb_problems(rgb: Any, shape: tuple[int, ...]) -> list[Problem]:
    """What is neither a colour nor a picture of this shape."""
    traced = isinstance(rgb, jax.core.Tracer)
    if not traced and not _is_array(rgb):
        found = validation.vector_problems("rgb", rgb, 3, "")
        if found:
            return found
    array = rgb if traced else np.asarray(rgb)
    of_list = not _is_array(rgb)
    if array.shape not in ((3,), shape) or not (of_list or _of_pixels(array.dtype)):
        must = f"(3,) or a picture {shape}, of floats from 0 to 1 or of uint8"
        return [problem("rgb", "must", None, None, {"must": must, "got": _kind(rgb)})]
    if traced or array.dtype == np.uint8 or ((array >= 0) & (array <= 1)).all():
        return []
    if array.ndim == 1:
        return [
            problem("rgb", "must", None, array.tolist() if _is_array(rgb) else rgb, must="between 0 and 1, or of uint8")
        ]
    got = f"a picture with numbers from {float(array.min()):g} to {float(array.max()):g}"
    return [problem("rgb", "must", None, None, {"must": "between 0 and 1, or of uint8", "got": got})]
