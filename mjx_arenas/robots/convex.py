"""How far apart convex shapes are."""

from typing import NamedTuple

import mujoco
import numpy as np

_MANY, _FEW, _BEST = 4096, 512, 8
_ROUNDS, _NARROWER = 4, 8.0


class Convex(NamedTuple):
    """The convex hull of points, with all that is within a radius of it: meshes, boxes, capsules and spheres alike."""

    points: np.ndarray  # (n, 3) [m]
    radius: float  # [m]

    def reach(self, towards: np.ndarray) -> np.ndarray:
        """(m,) how far it reaches along unit vectors (m, 3) [m]: its support function."""
        return (towards @ self.points.T).max(1) + self.radius


def primitive(type: mujoco.mjtGeom, size: np.ndarray, pos: np.ndarray, quat: np.ndarray) -> Convex:
    """A sphere, capsule or box, sizes as MuJoCo has them."""
    kinds, corners = mujoco.mjtGeom, np.zeros((1, 3))
    if type == kinds.mjGEOM_CAPSULE:
        corners = np.array([[0, 0, -size[1]], [0, 0, size[1]]])
    if type == kinds.mjGEOM_BOX:
        corners = size * np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T
    return Convex(placed(corners, pos, quat), 0.0 if type == kinds.mjGEOM_BOX else float(size[0]))


def hull(model: mujoco.MjModel, mesh: int) -> np.ndarray:
    """(n, 3) corners of the convex hull of a mesh that collides, in the frame of the compiled mesh [m]."""
    first, graph = model.mesh_vertadr[mesh], model.mesh_graphadr[mesh]
    points = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
    if graph < 0:  # a mesh of few vertices
        return np.array(points, float)
    corners = int(model.mesh_graph[graph])
    of = model.mesh_graph[graph + 2 + corners : graph + 2 + 2 * corners]  # after their edges' addresses
    return np.array(points[of], float)


def placed(points: np.ndarray, pos: np.ndarray, quat: np.ndarray) -> np.ndarray:
    """(n, 3) points of a frame that stands at `pos`, turned by `quat`, in the frame in which it stands."""
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, np.asarray(quat, float))
    return points @ turn.reshape(3, 3).T + pos


def distance(one: Convex, other: Convex) -> float:
    """The Hausdorff distance of two convex shapes [m]: how far a point of either can be from the other.

    Of convex shapes it is the largest difference of their support functions over all directions. That is searched among
    directions all around, and then ever more closely about the best of them.
    """
    towards = _all_around(_MANY)
    angle = float(np.sqrt(4 * np.pi / _MANY))  # between neighbours [rad]
    for _ in range(_ROUNDS):
        off = abs(one.reach(towards) - other.reach(towards))
        best = towards[np.argsort(off)[-_BEST:]]
        towards = np.concatenate([best, *(_about(axis, angle) for axis in best)])
        angle /= _NARROWER
    return float(abs(one.reach(towards) - other.reach(towards)).max())


def _all_around(n: int) -> np.ndarray:
    """(n, 3) unit vectors, evenly over the sphere: a spiral with the golden angle between them."""
    z = 1 - (2 * np.arange(n) + 1) / n
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(n)
    return np.column_stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z])


def _about(axis: np.ndarray, angle: float) -> np.ndarray:
    """(m, 3) unit vectors within an angle of one."""
    across = np.linalg.svd(axis[None])[2][1:]  # two axes at right angles to it
    out, turn = np.sqrt((np.arange(_FEW) + 0.5) / _FEW), np.pi * (3 - np.sqrt(5)) * np.arange(_FEW)
    near = axis + angle * np.column_stack([out * np.cos(turn), out * np.sin(turn)]) @ across
    return near / np.linalg.norm(near, axis=1, keepdims=True)
