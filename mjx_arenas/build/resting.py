"""The poses in which objects rest on level ground: of primitive shapes by formulas, of all else from the convex hull (host).

A hull rests on a face if the centre of mass stands above it. It comes to rest there, after a toss, as often as a random direction from the
centre of mass meets that face, or one from which it topples there (Goldberg et al. 1999, and `trimesh.poses.compute_stable_poses`).
"""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from mjx_arenas import shapes
from mjx_arenas.geometry import yaw_quat
from mjx_arenas.problem import Item, problem
from mjx_arenas.problems.messages import error
from mjx_arenas.sample.poses import RESTING, Poses
from mjx_arenas.spec import objects
from mjx_arenas.spec.extents import extents
from mjx_arenas.spec.objects import Object

LEVEL = 1e-4  # rad by which faces differ that are one
SURE = np.tan(np.radians(0.1))  # contacts give way by 0.1 mm or so: what rests must bear to be tilted by that on 6 cm
_DOWN = np.array([0.0, 0.0, -1.0])
_POLYHEDRA = (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_MESH)


class Rest(NamedTuple):
    """A pose of one object."""

    share: float
    quat: np.ndarray  # (4,)
    center: np.ndarray  # (3,) middle of the extents, along axes that this turned [m]
    full_size: np.ndarray  # (3,) of what has one size, else nothing [m] ...
    axes: np.ndarray  # (3, 3) ... plus these rows times the object's own extents
    outline: str


def poses(objs: Sequence[Object], first: int) -> tuple[Poses, ...]:
    """The poses of the objects that may rest in any; the first object has the index `first`."""
    return tuple(_of(obj, k) for k, obj in enumerate(objs, first) if obj.pose == RESTING)


def _of(obj: Object, k: int) -> Poses:
    found = [_rests(one, ("object", one.name)) for one in obj.slots or (obj,)]
    most = max(map(len, found))
    padded = [[*rests, *[rests[0]._replace(share=0.0)] * (most - len(rests))] for rests in found]

    def all_(name: str) -> np.ndarray:
        return np.array([[getattr(rest, name) for rest in rests] for rests in padded])

    kind = np.array([one.type for one in obj.slots or (obj,)], str)
    return Poses(k, f"{obj.name}.pose", kind, np.array([len(rests) for rests in found]), *map(all_, Rest._fields))


def _rests(obj: Object, item: Item) -> list[Rest]:
    """The poses of an object without variants, the one nearest to upright first, then the likelier ones."""
    if obj.type in shapes.RESTS:
        size = objects.measure(obj, 0).full_size
        shares, own = shapes.rest_shares(obj.type, size), shapes.RESTS[obj.type]
        return [
            Rest(float(share), np.array(rest.quat), np.zeros(3), np.zeros(3), np.eye(3)[list(rest.axes)], rest.outline)
            for share, rest in zip(shares, own, strict=True)
        ]
    points, middle = _points(obj, item)
    downs, shares, edges = stable(points, middle)
    order = sorted(range(len(downs)), key=lambda i: -round(shares[i], 9))
    first = int(np.argmax(np.round(-downs[:, 2], 9)))
    found = []
    for i in [first, *(i for i in order if i != first)]:
        quat = _turn(points, downs[i], edges[i])
        turned = points @ _matrix(quat).T
        low, high = turned.min(0), turned.max(0)
        found.append(Rest(float(shares[i]), quat, (low + high) / 2, high - low, np.zeros((3, 3)), "box"))
    return found


def _points(obj: Object, item: Item) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) corners of what collides, and the centre of mass (3,), from the object's origin [m].

    Raises:
        ValueError: it has joints, or round geoms that reach out of the hull of the others.
    """
    from scipy import spatial  # comes with jax

    _, model = objects.alone(obj)
    if model.njnt != 1:
        raise error([problem("objects.pose", "pose_moves", item, n=model.njnt - 1)])
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    hits = (model.geom_contype | model.geom_conaffinity) != 0
    corners, round_ = [], []
    for g in np.flatnonzero(hits).tolist():
        kind, turn, size = mujoco.mjtGeom(model.geom_type[g]), data.geom_xmat[g].reshape(3, 3), model.geom_size[g]
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.mesh(model.geom_dataid[g])
            local = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]].astype(float)
        else:
            local = np.stack(np.meshgrid(*np.array([[-1, 1]] * 3)), axis=-1).reshape(-1, 3) * size
        (corners if kind in _POLYHEDRA else round_).append((g, data.geom_xpos[g] + local @ turn.T))
    points = np.concatenate([points for _, points in corners]) if corners else np.zeros((0, 3))
    reach = np.ptp(points, axis=0).max() if corners else 0.0
    planes = spatial.ConvexHull(points).equations if corners else np.zeros((0, 4))
    for g, _ in round_:
        only = np.arange(model.ngeom) == g
        axes = [np.column_stack([n, np.zeros((3, 2))]) for n in planes[:, :3]]  # of which the first counts
        out = [extents(model, data, only, np.zeros(3), a)[1][0] + d for a, d in zip(axes, planes[:, 3], strict=True)]
        if not corners or max(out) > 1e-6 * reach:
            kind = mujoco.mjtGeom(model.geom_type[g]).name.removeprefix("mjGEOM_").lower()
            raise error([problem("objects.pose", "pose_round", item, geom=model.geom(g).name, kind=kind)])
    return points, data.subtree_com[1].copy()


def stable(points: np.ndarray, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """The faces on which the convex hull of points (n, 3) rests.

    Args:
        points: of which some are corners of the hull [m].
        middle: (3,) the centre of mass.

    Returns:
        Directions (F, 3) that point down then, the shares of tosses (F,) after which it rests so, and of each face the sides (m, 3).
    """
    from scipy import sparse, spatial

    hull = spatial.ConvexHull(points)
    tri, normal, beside = hull.simplices, hull.equations[:, :3], hull.neighbors
    n = len(tri)
    pairs = np.stack([np.repeat(np.arange(n), 3), beside.reshape(-1)])
    one = np.linalg.norm(normal[pairs[0]] - normal[pairs[1]], axis=1) <= LEVEL
    graph = sparse.coo_matrix((np.ones(one.sum()), pairs[:, one]), (n, n))
    faces, face = sparse.csgraph.connected_components(graph, directed=False)

    corner = points[tri] - middle
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    shares = np.bincount(face, _solid_angles(corner) / (4 * np.pi), faces)
    down = np.stack([np.bincount(face, area * normal[:, i], faces) for i in range(3)], axis=-1)
    down /= np.linalg.norm(down, axis=1, keepdims=True)

    # Of each side of a face how far the centre of mass is inside of it.
    at, across, corners = np.repeat(np.arange(n), 3), beside.reshape(-1), np.array([[1, 2], [2, 0], [0, 1]])
    ends, opposite = corner[:, corners].reshape(-1, 2, 3), corner.reshape(-1, 3)
    rim = face[at] != face[across]
    at, across, ends, opposite = at[rim], across[rim], ends[rim], opposite[rim]
    inward = np.cross(down[face[at]], ends[:, 1] - ends[:, 0])
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    inward *= np.sign(((opposite - ends[:, 0]) * inward).sum(1, keepdims=True))
    inside = (-ends[:, 0] * inward).sum(1)

    height = np.array([(down[f] * corner[face == f, 0]).sum(-1).max() for f in range(faces)])
    follows, least = np.arange(faces), np.zeros(faces)
    for f in range(faces):
        own = np.flatnonzero(face[at] == f)
        worst = own[np.argmin(inside[own])]
        least[f] = inside[worst]
        follows[f] = f if least[f] > 0 else face[across[worst]]
    for _ in range(faces):  # each step is to a face that is nearer to the centre of mass
        follows = follows[follows]
    rests = np.flatnonzero((follows == np.arange(faces)) & (least > SURE * height))
    total = np.bincount(follows, shares, faces)[rests]
    sides = [ends[face[at] == f, 1] - ends[face[at] == f, 0] for f in rests]
    return down[rests], total / total.sum(), sides


def _solid_angles(corner: np.ndarray) -> np.ndarray:
    """(n,) of triangles (n, 3, 3), from the origin (van Oosterom and Strackee 1983)."""
    a, b, c = np.moveaxis(corner, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return 2 * np.abs(np.arctan2((a * np.cross(b, c)).sum(1), below))


def _turn(points: np.ndarray, down: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """(4,) the shortest turn that makes a direction point down, then the yaw of a side with which the rectangle around is the smallest."""
    quat, found = np.array([-down[2] + 1.0, *np.cross(down, _DOWN)]), np.zeros(4)
    if quat[0] < 1e-9:
        quat = np.array([0.0, 1.0, 0.0, 0.0])
    quat /= np.linalg.norm(quat)
    if 1 + down[2] < 1e-12:  # as it is in its file
        return np.array([1.0, 0.0, 0.0, 0.0])
    turned, along = points @ _matrix(quat).T, sides @ _matrix(quat).T
    best, smallest = quat, np.ptp(turned[:, :2], axis=0).prod() * (1 - 1e-9)
    for yaw in np.arctan2(along[:, 1], along[:, 0]):
        cos, sin = np.cos(yaw), np.sin(yaw)
        area = np.ptp(turned[:, :2] @ np.array([[cos, -sin], [sin, cos]]), axis=0).prod()
        if area < smallest * (1 - 1e-9):
            mujoco.mju_mulQuat(found, yaw_quat(np.float64(-yaw)), quat)
            best, smallest = found.copy(), area
    return best


def _matrix(quat: np.ndarray) -> np.ndarray:
    """Rows (3, 3) of the rotation."""
    found = np.zeros(9)
    mujoco.mju_quat2Mat(found, quat)
    return found.reshape(3, 3)
