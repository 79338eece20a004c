"""Boxes and spheres around geoms: `setFixed` in MuJoCo's `engine_setconst.c`."""

from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.rows import replace_rows

_GEOM = mujoco.mjtGeom
PRIMITIVES = (
    _GEOM.mjGEOM_SPHERE,
    _GEOM.mjGEOM_CAPSULE,
    _GEOM.mjGEOM_CYLINDER,
    _GEOM.mjGEOM_ELLIPSOID,
    _GEOM.mjGEOM_BOX,
)


def around(kinds: np.ndarray, size: Array) -> Array:
    """(n, 4) half sides of the box and radius of the sphere around geoms of some kinds (n,) and sizes (n, 3); NumPy or JAX.

    Of primitive geoms; of others, zeros. The formulas are those of `mjCGeom` in MuJoCo's `user_objects.cc`.
    """
    xp = array_module(size)
    x, y, z = size[:, 0], size[:, 1], size[:, 2]
    of = {
        _GEOM.mjGEOM_SPHERE: (x, x, x, x),
        _GEOM.mjGEOM_CAPSULE: (x, x, x + y, x + y),
        _GEOM.mjGEOM_CYLINDER: (x, x, y, xp.sqrt(x * x + y * y)),
        _GEOM.mjGEOM_ELLIPSOID: (x, y, z, xp.maximum(x, xp.maximum(y, z))),
        _GEOM.mjGEOM_BOX: (x, y, z, xp.sqrt(x * x + y * y + z * z)),
    }
    columns = [xp.zeros_like(x)] * 4
    for kind, values in of.items():
        if (kinds == kind).any():
            columns = [xp.where(kinds == kind, value, column) for value, column in zip(values, columns, strict=True)]
    return xp.stack(columns, axis=-1)


def geom_bounds(model: mjx.Model) -> dict[str, jax.Array]:
    """Boxes and spheres around primitive geoms, and sizes of height fields; what else is bounded, MJX cannot change."""
    kind, size = np.asarray(model.geom_type), model.geom_size
    bounds, primitive = around(kind, size), np.isin(kind, PRIMITIVES)
    aabb, rbound = model.geom_aabb.reshape(-1, 6), jnp.where(primitive, bounds[:, 3], model.geom_rbound)
    box = jnp.concatenate([jnp.zeros_like(bounds[:, :3]), bounds[:, :3]], axis=1)
    aabb = jnp.where(primitive[:, None], box, aabb)
    field = np.flatnonzero(kind == _GEOM.mjGEOM_HFIELD)
    x, y, top, bottom = np.asarray(model.hfield_size)[np.asarray(model.geom_dataid)[field]].T
    size = replace_rows(size, field, jnp.stack([x, y, top / 4 + bottom / 2], axis=1))
    found: dict[str, Any] = {"geom_size": size, "geom_aabb": aabb, "geom_rbound": rbound}
    return found
