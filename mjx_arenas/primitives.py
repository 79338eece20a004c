"""Boxes and spheres around MuJoCo's primitive geoms, their volumes and moments: the one place of these formulas.

`kinds` is a static (n,) array of `geom_type`, `size` (..., n, 3) MuJoCo's `geom_size` [m]. NumPy or JAX; the formulas are those of
`mjCGeom` in MuJoCo's `user_objects.cc`.
"""

import math
from collections.abc import Mapping

import mujoco
import numpy as np

from mjx_arenas.geometry import Array, along_last, array_module, length

_GEOM = mujoco.mjtGeom
SIZES = {
    _GEOM.mjGEOM_SPHERE: 1,
    _GEOM.mjGEOM_CAPSULE: 2,
    _GEOM.mjGEOM_CYLINDER: 2,
    _GEOM.mjGEOM_ELLIPSOID: 3,
    _GEOM.mjGEOM_BOX: 3,
}
"""How many of the three numbers of `geom_size` a shape has."""
PRIMITIVES = tuple(SIZES)
_BALL = 4 / 3 * math.pi


def core(kinds: np.ndarray, size: Array) -> tuple[Array, Array]:
    """Half sides (..., n, 3) of a box in the geom's frame, and how far (..., n) the geom reaches beyond it on all sides.

    The two are exact for spheres, capsules and boxes; the box is around cylinders and ellipsoids.
    """
    xp = array_module(size)
    x, y = size[..., 0], size[..., 1]
    # Sums of products with constants: of stacked numbers a compiler for GPUs makes a kernel each.
    zero, along = xp.zeros_like(x), y[..., None] * along_last((0, 0, 1), size)
    half = _by_kind(
        kinds,
        1,
        size,
        {
            _GEOM.mjGEOM_SPHERE: xp.zeros_like(size),
            _GEOM.mjGEOM_CAPSULE: along,
            _GEOM.mjGEOM_CYLINDER: x[..., None] * along_last((1, 1, 0), size) + along,
        },
    )
    return half, _by_kind(kinds, 0, zero, {_GEOM.mjGEOM_SPHERE: x, _GEOM.mjGEOM_CAPSULE: x})


def around(kinds: np.ndarray, size: Array) -> tuple[Array, Array]:
    """Half sides (..., n, 3) of the box in the geom's frame, and radius (..., n) of the sphere, around primitive geoms; zeros of others."""
    half, beyond = core(kinds, size)
    xp = array_module(size)
    half = half + beyond[..., None]
    largest = xp.maximum(half[..., 0], xp.maximum(half[..., 1], half[..., 2]))
    radius = _by_kind(kinds, 0, largest, {_GEOM.mjGEOM_CYLINDER: length(size[..., :2]), _GEOM.mjGEOM_BOX: length(size)})
    known = np.isin(kinds, PRIMITIVES)
    if known.all():
        return half, radius
    return xp.where(known[:, None], half, xp.zeros_like(half)), xp.where(known, radius, xp.zeros_like(radius))


def reach(kinds: np.ndarray, size: Array, axes: Array) -> Array:
    """(..., n, 3) how far geoms reach along three directions, the rows of `axes` (..., n, 3, 3) in their frames."""
    xp = array_module(size, axes)
    half, beyond = core(kinds, size)
    found = (abs(axes) * half[..., None, :]).sum(-1) + beyond[..., None]
    cos, across = abs(axes[..., 2]), size[..., :1]
    disc = across * xp.sqrt(xp.maximum(1 - cos * cos, 0.0)) + size[..., 1:2] * cos
    turned = axes * size[..., None, :]
    ellipsoid = xp.sqrt((turned * turned).sum(-1))
    return _by_kind(kinds, 1, found, {_GEOM.mjGEOM_CYLINDER: disc, _GEOM.mjGEOM_ELLIPSOID: ellipsoid})


def volume(kinds: np.ndarray, size: Array) -> Array:
    """(..., n) volumes of primitive geoms [m^3]; 1 of others."""
    x, y, z = (size[..., i] for i in range(3))
    return _by_kind(
        kinds,
        0,
        array_module(size).ones_like(x),
        {
            _GEOM.mjGEOM_SPHERE: _BALL * x**3,
            _GEOM.mjGEOM_CAPSULE: 2 * math.pi * x**2 * y + _BALL * x**3,
            _GEOM.mjGEOM_CYLINDER: 2 * math.pi * x**2 * y,
            _GEOM.mjGEOM_ELLIPSOID: _BALL * x * y * z,
            _GEOM.mjGEOM_BOX: 8 * x * y * z,
        },
    )


def moments(kinds: np.ndarray, size: Array, mass: Array) -> Array:
    """(..., n, 3) moments [kg m^2] about the axes of solid primitive geoms of `mass` (..., n) [kg]; their mass of others."""
    xp = array_module(size, mass)
    x, y, z = (size[..., i] for i in range(3))

    def round_(across: Array, along: Array) -> Array:
        return xp.stack([across, across, along], axis=-1)

    ball = 2 / 5 * mass * x * x
    # A capsule is a cylinder of length 2 y with half a ball of the same density at each end.
    caps = mass * 2 * x / (2 * x + 3 * y)
    middle, ends = mass - caps, 2 / 5 * caps * x * x
    across = middle * (3 * x * x + 4 * y * y) / 12 + ends + caps * y * (3 * x + 4 * y) / 4
    sides = xp.stack([y * y + z * z, x * x + z * z, x * x + y * y], axis=-1) * mass[..., None]
    return _by_kind(
        kinds,
        1,
        xp.broadcast_to(mass[..., None], size.shape),
        {
            _GEOM.mjGEOM_SPHERE: round_(ball, ball),
            _GEOM.mjGEOM_CAPSULE: round_(across, middle * x * x / 2 + ends),
            _GEOM.mjGEOM_CYLINDER: round_(mass * (3 * x * x + 4 * y * y) / 12, mass * x * x / 2),
            _GEOM.mjGEOM_ELLIPSOID: sides / 5,
            _GEOM.mjGEOM_BOX: sides / 3,
        },
    )


def _by_kind(kinds: np.ndarray, trailing: int, other: Array, values: Mapping[mujoco.mjtGeom, Array]) -> Array:
    """The value that is given for each geom's kind, or the other; arrays (..., n) with `trailing` axes behind."""
    for kind, value in values.items():
        here = np.asarray(kinds == int(kind))
        if here.any():
            other = array_module(other, value).where(here.reshape(-1, *(1,) * trailing), value, other)
    return other
