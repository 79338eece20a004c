"""Bounds of geoms of models: `setFixed` in MuJoCo's `engine_setconst.c`."""

from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.primitives import PRIMITIVES, around
from mjx_arenas.rows import replace_rows


def geom_bounds(model: mjx.Model) -> dict[str, jax.Array]:
    """Boxes and spheres around primitive geoms, and sizes of height fields; what else is bounded, MJX cannot change."""
    kind, size = np.asarray(model.geom_type), model.geom_size
    (half, radius), primitive = around(kind, size), np.isin(kind, PRIMITIVES)
    aabb, rbound = model.geom_aabb.reshape(-1, 6), jnp.where(primitive, radius, model.geom_rbound)
    box = jnp.concatenate([jnp.zeros_like(half), half], axis=1)
    aabb = jnp.where(primitive[:, None], box, aabb)
    field = np.flatnonzero(kind == mujoco.mjtGeom.mjGEOM_HFIELD)
    x, y, top, bottom = np.asarray(model.hfield_size)[np.asarray(model.geom_dataid)[field]].T
    size = replace_rows(size, field, jnp.stack([x, y, top / 4 + bottom / 2], axis=1))
    found: dict[str, Any] = {"geom_size": size, "geom_aabb": aabb, "geom_rbound": rbound}
    return found
