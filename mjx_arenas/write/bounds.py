"""Boxes and spheres around geoms: `setFixed` in MuJoCo's `engine_setconst.c`."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.write.quaternions import norm
from mjx_arenas.write.rows import replace_rows

_GEOM = mujoco.mjtGeom


def geom_bounds(model: mjx.Model) -> dict[str, jax.Array]:
    """Boxes and spheres around primitive geoms, and sizes of height fields; what else is bounded, MJX cannot change."""
    kind, size = np.asarray(model.geom_type), model.geom_size
    radius, length = size[:, 0], size[:, 1]

    def around(height: jax.Array) -> jax.Array:
        return jnp.stack([radius, radius, height], axis=1)

    bounds = {  # of each type: half sizes of the box, radius of the sphere
        _GEOM.mjGEOM_SPHERE: (around(radius), radius),
        _GEOM.mjGEOM_CAPSULE: (around(radius + length), radius + length),
        _GEOM.mjGEOM_CYLINDER: (around(length), norm(size[:, :2])),
        _GEOM.mjGEOM_ELLIPSOID: (size, size.max(1)),
        _GEOM.mjGEOM_BOX: (size, norm(size)),
    }
    aabb, rbound = model.geom_aabb.reshape(-1, 6), model.geom_rbound
    for of_kind, (half, sphere) in bounds.items():
        rbound = jnp.where(kind == of_kind, sphere, rbound)
        aabb = jnp.where((kind == of_kind)[:, None], jnp.concatenate([0 * half, half], axis=1), aabb)
    field = np.flatnonzero(kind == _GEOM.mjGEOM_HFIELD)
    x, y, top, bottom = np.asarray(model.hfield_size)[np.asarray(model.geom_dataid)[field]].T
    size = replace_rows(size, field, jnp.stack([x, y, top / 4 + bottom / 2], axis=1))
    return {"geom_size": size, "geom_aabb": aabb, "geom_rbound": rbound}
