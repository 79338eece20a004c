"""The arithmetic of the primitive shapes that objects have, shared by the model builder (NumPy) and the field writer (JAX).

`kinds` is a static (n,) array of "box", "sphere", "capsule" or "cylinder", `full_size` (..., n, 3) the extents along the
object's axes [m]: a capsule lies along x, (length with its caps, d, d); a cylinder stands along z, (d, d, height). The
formulas are those of MuJoCo's compiler (`mjCGeom` in `user_objects.cc`).
"""

from typing import NamedTuple

import mujoco
import numpy as np

from mjx_arenas import primitives
from mjx_arenas.geometry import Array, array_module

TYPES = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
}
PRIMITIVES = tuple(TYPES)

# How a shape's axes hang together: axis i is as long as axis SAME[kind][i].
_SAME = {"box": (0, 1, 2), "sphere": (0, 0, 0), "capsule": (0, 1, 1), "cylinder": (0, 0, 2)}


def consistent(kinds: np.ndarray, full_size: Array) -> Array:
    """Sizes (..., n, 3) that the shapes can have: a sphere takes its x, a capsule x and y, a cylinder x and z."""
    xp = array_module(full_size)
    x, y, z = (full_size[..., i] for i in range(3))
    same = np.array([_SAME.get(kind, (0, 1, 2)) for kind in kinds], int).reshape(-1, 3).T
    return xp.stack([xp.where(axis == 0, x, xp.where(axis == 1, y, z)) for axis in same], axis=-1)


def own_axes(kinds: np.ndarray) -> np.ndarray:
    """(n, 3) bool: the extents that a shape takes; the others follow. Meshes and MJCF bodies take none."""
    own = {kind: [i in axes for i in range(3)] for kind, axes in _SAME.items()}
    return np.array([own.get(kind, [False] * 3) for kind in kinds], bool).reshape(-1, 3)


def possible(kinds: np.ndarray, full_size: Array) -> Array:
    """(..., n) bool: the shape can have these extents; a capsule is longer than thick.

    Up to rounding: XLA may compute each axis of `consistent` anew.
    """
    right = array_module(full_size).isclose(full_size, consistent(kinds, full_size), rtol=1e-6, atol=0)
    return right.all(-1) & ((np.asarray(kinds) != "capsule") | (full_size[..., 0] > full_size[..., 1]))


def as_in_file(kinds: np.ndarray, full_size: Array, nominal: np.ndarray) -> Array:
    """(..., n) bool: a size that is given, a mesh's or an MJCF body's, is the nominal one, up to rounding."""
    kept = abs(full_size - nominal) <= 1e-5 * nominal
    return kept.all(-1) | np.isin(kinds, PRIMITIVES)


def _types(kinds: np.ndarray) -> np.ndarray:
    """(n,) MuJoCo's `geom_type`; -1 of files' shapes."""
    return np.array([int(TYPES.get(kind, -1)) for kind in kinds], int)


def geom_size(kinds: np.ndarray, full_size: Array) -> Array:
    """MuJoCo's `geom_size` (..., n, 3)."""
    xp = array_module(full_size)
    x, y, z = (full_size[..., i] / 2 for i in range(3))
    zero = xp.zeros_like(x)
    return _by_kind(
        kinds,
        1,
        box=xp.stack([x, y, z], axis=-1),
        sphere=xp.stack([x, zero, zero], axis=-1),
        capsule=xp.stack([y, x - y, zero], axis=-1),
        cylinder=xp.stack([x, z, zero], axis=-1),
    )


def full_size(kind: str, size: np.ndarray) -> np.ndarray:
    """The extents (3,) of one shape of MuJoCo's `geom_size` (3,)."""
    full = 2 * primitives.around(_types(np.array([kind])), size[None])[0][0]
    return full[::-1] if kind == "capsule" else full


def footprint(kinds: np.ndarray, full_size: Array) -> tuple[Array, Array]:
    """Half sides (..., n, 2) and rounding (..., n) of the rectangle with rounded corners that the shape covers."""
    xp = array_module(full_size)
    x, y = full_size[..., 0] / 2, full_size[..., 1] / 2
    zero = xp.zeros_like(x)
    radius = _by_kind(kinds, 0, box=zero, sphere=x, capsule=y, cylinder=x)
    return xp.stack([x - radius, y - radius], axis=-1), radius


def volume(kinds: np.ndarray, full_size: Array) -> Array:
    """Volume (..., n) [m^3]; 1 of files' shapes."""
    return primitives.volume(_types(kinds), geom_size(kinds, full_size))


def inertia(kinds: np.ndarray, full_size: Array, mass: Array) -> Array:
    """Principal moments (..., n, 3) [kg m^2] in the geom's frame, of solids of `mass` (..., n) [kg]."""
    return primitives.moments(_types(kinds), geom_size(kinds, full_size), mass)


def heavy_enough(kinds: np.ndarray, full_size: Array, mass: Array) -> Array:
    """(..., n) bool: moments of inertia are not below the smallest that MuJoCo compiles; not known of files' shapes."""
    return (inertia(kinds, full_size, mass).min(-1) >= mujoco.mjMINVAL) | ~np.isin(kinds, PRIMITIVES)


class Rest(NamedTuple):
    """One of the poses in which a primitive shape rests."""

    quat: tuple[float, float, float, float]  # how it is turned from upright, before its yaw
    axes: tuple[int, int, int]  # which of its axes lie along x, y, z then
    outline: str  # the shape whose footprint it has then


_HALF = float(np.sqrt(0.5))
RESTS = {
    "box": (
        Rest((1.0, 0.0, 0.0, 0.0), (0, 1, 2), "box"),  # z points up
        Rest((0.0, 1.0, 0.0, 0.0), (0, 1, 2), "box"),  # -z
        Rest((_HALF, 0.0, -_HALF, 0.0), (2, 1, 0), "box"),  # x
        Rest((_HALF, 0.0, _HALF, 0.0), (2, 1, 0), "box"),  # -x
        Rest((_HALF, _HALF, 0.0, 0.0), (0, 2, 1), "box"),  # y
        Rest((_HALF, -_HALF, 0.0, 0.0), (0, 2, 1), "box"),  # -y
    ),
    "sphere": (Rest((1.0, 0.0, 0.0, 0.0), (0, 1, 2), "sphere"),),
    "capsule": (Rest((1.0, 0.0, 0.0, 0.0), (0, 1, 2), "capsule"),),
    "cylinder": (
        Rest((1.0, 0.0, 0.0, 0.0), (0, 1, 2), "cylinder"),
        Rest((0.0, 1.0, 0.0, 0.0), (0, 1, 2), "cylinder"),  # upside down
        Rest((_HALF, 0.0, _HALF, 0.0), (2, 1, 0), "box"),  # on its side
    ),
}
"""The poses in which a shape rests, whatever its size; upright first."""


def rest_shares(kind: str, full_size: Array) -> Array:
    """(R,) how likely each of `RESTS` is for a shape of extents (3,): the share of all directions from its middle that meet that side."""
    xp = array_module(full_size)
    x, y, z = (full_size[i] / 2 for i in range(3))
    if kind == "cylinder":
        side = z / xp.sqrt(x * x + z * z)
        return xp.stack([(1 - side) / 2, (1 - side) / 2, side])
    if kind == "box":
        diagonal = xp.sqrt(x * x + y * y + z * z)
        faces = [xp.arctan2(a * b, c * diagonal) / xp.pi for a, b, c in ((x, y, z), (y, z, x), (x, z, y))]
        return xp.stack([face for face in faces for _ in range(2)])
    return xp.ones(1, full_size.dtype)


def _by_kind(kinds: np.ndarray, trailing: int, box: Array, **others: Array) -> Array:
    """The value that is given for each shape's kind, or the box's; arrays (..., n) with `trailing` axes behind."""
    out = box
    for kind, value in others.items():
        is_kind = np.asarray(kinds) == kind
        if is_kind.any():
            out = array_module(out, value).where(is_kind.reshape(-1, *(1,) * trailing), value, out)
    return out
