"""Simpler shapes for meshes that collide, as MuJoCo fits them (host)."""

import contextlib
from collections.abc import Collection, Iterator
from typing import NamedTuple

import mujoco
import numpy as np

from mjx_arenas.robots import convex
from mjx_arenas.robots.convex import Convex

PRIMITIVES = {
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
}
"""What MuJoCo fits to meshes, and what both implementations of MJX collide with all else."""


class Fitted(NamedTuple):
    """A shape in the place of a mesh."""

    kind: str  # of `PRIMITIVES`, or "hull"
    size: np.ndarray  # (3,) of a primitive, as MuJoCo has it [m]
    pos: np.ndarray  # (3,) in the frame of the compiled mesh [m]
    quat: np.ndarray  # (4,)
    points: np.ndarray  # (n, 3) corners of a hull, in that frame [m]
    change: float  # Hausdorff distance from the mesh's convex hull [m]


def fitted(model: mujoco.MjModel, mesh: int, kinds: Collection[str], max_vertices: int) -> Fitted:
    """The one of some kinds that changes a mesh least.

    MuJoCo fits a primitive to a mesh in two ways, so that it has its moments of inertia, or that it has its extents (`fitaabb`): the
    nearer one counts.

    Args:
        model: that has the mesh, which collides.
        mesh: its index.
        kinds: some of `PRIMITIVES`, or "hull": a convex hull of fewer corners.
        max_vertices: of such a hull.
    """
    whole = Convex(convex.hull(model, mesh), 0.0)
    found = [_measured(whole, kind, probe) for kind in kinds for probe in _probes(whole.points, kind, max_vertices)]
    if not found:  # what is as thick as it is long has no capsule
        return fitted(model, mesh, ("sphere",), max_vertices)
    return min(found, key=lambda shape: shape.change)


def _probes(points: np.ndarray, kind: str, max_vertices: int) -> Iterator[mujoco.MjModel]:
    """Models whose one geom is a kind of shape that MuJoCo fits to the convex hull of points, as far as it can."""
    for fitaabb in (False, True)[: 1 if kind == "hull" else 2]:
        spec = mujoco.MjSpec()
        spec.compiler.fitaabb = fitaabb
        mesh = spec.add_mesh(name="mesh", uservert=points.reshape(-1))
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        if kind == "hull":
            mesh.maxhullvert = max_vertices
        spec.worldbody.add_geom(type=PRIMITIVES.get(kind, mujoco.mjtGeom.mjGEOM_MESH), meshname="mesh")
        with contextlib.suppress(ValueError):
            yield spec.compile()


def _measured(whole: Convex, kind: str, probe: mujoco.MjModel) -> Fitted:
    size, pos, quat = (np.array(x[0]) for x in (probe.geom_size, probe.geom_pos, probe.geom_quat))
    if kind == "hull":
        points = convex.placed(convex.hull(probe, 0), pos, quat)
        shape = Convex(points, 0.0)
    else:
        points, shape = np.empty((0, 3)), convex.primitive(PRIMITIVES[kind], size, pos, quat)
    return Fitted(kind, size, pos, quat, points, convex.distance(whole, shape))
