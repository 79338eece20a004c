"""How far compiled geoms reach, and what volume they have (host)."""

import mujoco
import numpy as np

from mjx_arenas import primitives
from mjx_arenas.spec import specs


def extents(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: np.ndarray, origin: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest coordinates (3,) of some geoms, given as (ngeom,) bool, in a frame with `axes` (3, 3) as columns."""
    lows, highs = [], []
    for g in np.flatnonzero(geoms):
        turn, size = axes.T @ data.geom_xmat[g].reshape(3, 3), model.geom_size[g]
        kind, middle = mujoco.mjtGeom(model.geom_type[g]), axes.T @ (data.geom_xpos[g] - origin)
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.mesh(model.geom_dataid[g])
            points = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]] @ turn.T
            low, high = points.min(0), points.max(0)
        else:
            high = primitives.reach(np.array([kind]), size[None], turn[None])[0]
            low = -high
        lows.append(middle + low)
        highs.append(middle + high)
    return np.min(lows, axis=0), np.max(highs, axis=0)


def volumes(spec: mujoco.MjSpec, names: list[str]) -> list[float]:
    """Volumes [m^3] of what of some bodies, with all that hangs on them, collides."""
    spec = spec.copy()
    for kind in ("keys", "actuators", "sensors", "equalities", "tendons", "joints"):  # what moves must have a mass
        for element in list(getattr(spec, kind)):
            spec.delete(element)
    for body in spec.bodies:
        body.explicitinertial = False
    for geom in spec.geoms:
        collides = bool(geom.contype or geom.conaffinity)
        geom.mass, geom.density = (np.nan, 1.0) if collides else (0.0, 0.0)
    model = specs.compiled(spec, "xml")
    return [float(model.body(name).subtreemass[0]) for name in names]
