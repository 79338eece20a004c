"""Masses and inertias of bodies that follow from their geoms, as MuJoCo's compiler sums them (`mjCBody::InertiaFromGeom`).

NumPy or JAX: on the host for the proof of an arena, on the device for its worlds. G geoms, B bodies.
"""

from typing import Any, NamedTuple

import mujoco
import numpy as np

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.primitives import moments, volume
from mjx_arenas.quaternions import quat_to_mat_rows

_SWEEPS = 6  # of Jacobi rotations: a matrix of 3 x 3 is diagonal in double precision after five


class Solids(NamedTuple):
    """Geoms of the bodies whose inertials follow from geoms that vary (host)."""

    geom: np.ndarray  # (G,)
    body: np.ndarray  # (G,) whose they are
    mass: np.ndarray  # (G,) nominal [kg]
    inertia: np.ndarray  # (G, 3) nominal, along the geom's axes [kg m^2]
    dense: np.ndarray  # (G,) bool: the mass goes with the volume; else it is given
    solid: np.ndarray  # (G,) bool: a primitive shape that is not hollow, whose size decides its moments

    @property
    def bodies(self) -> np.ndarray:
        """(B,) whose geoms these are."""
        return np.unique(self.body)


_NO = np.zeros(0, bool)
NONE = Solids(np.zeros(0, int), np.zeros(0, int), np.zeros(0), np.zeros((0, 3)), _NO, _NO)


class Inertials(NamedTuple):
    """Inertials of bodies."""

    mass: Array  # (B,) [kg]
    ipos: Array  # (B, 3) centre of mass [m]
    iquat: Array  # (B, 4) principal axes
    inertia: Array  # (B, 3) about them [kg m^2]


def inertials(solids: Solids, model: mujoco.MjModel, size: Array, pos: Array, quat: Array, weight: Array) -> Inertials:
    """The inertials of the bodies, whose geoms have sizes, poses and relative densities or masses (G, ...).

    `model` has the nominal ones.
    """
    xp = array_module(size, pos, quat)

    def const(values: np.ndarray) -> Any:
        return xp.asarray(values, pos.dtype)

    kinds = model.geom_type[solids.geom]
    grown = volume(kinds, size) / const(volume(kinds, model.geom_size[solids.geom]))
    mass = const(solids.mass) * weight * xp.where(solids.dense, grown, xp.ones_like(grown))
    own = xp.where(solids.solid[:, None], moments(kinds, size, mass), const(solids.inertia) * weight[:, None])
    bodies = solids.bodies
    of = solids.body[None] == bodies[:, None]  # (B, G)

    def total(values: Array) -> Array:
        return xp.where(of.reshape(of.shape + (1,) * (values.ndim - 1)), values[None], xp.zeros_like(values[None])).sum(
            1
        )

    whole = total(mass)
    ipos = total(mass[:, None] * pos) / whole[:, None]
    arm = pos - ipos[np.searchsorted(bodies, solids.body)]
    tensor = _about(own, quat) + _lever(mass, arm)
    iquat, inertia = principal(total(tensor))
    alone = of.sum(1) == 1
    first = of.argmax(1)
    iquat = xp.where(alone[:, None], quat[first], iquat)
    return Inertials(whole, ipos, iquat, xp.where(alone[:, None], own[first], inertia))


def rotation(quat: Array) -> Array:
    """(..., 3, 3) matrices of unit quaternions."""
    xp = array_module(quat)
    return xp.stack([xp.stack(row, axis=-1) for row in quat_to_mat_rows(quat)], axis=-2)


def _about(moments: Array, quat: Array) -> Array:
    """(..., 3, 3) tensors of moments (..., 3) about axes turned by `quat` (..., 4)."""
    axes = rotation(quat)
    return (axes[..., :, None, :] * axes[..., None, :, :] * moments[..., None, None, :]).sum(-1)


def _lever(mass: Array, arm: Array) -> Array:
    """(G, 3, 3) tensors of points."""
    xp = array_module(arm)
    square = (arm * arm).sum(-1)
    return mass[:, None, None] * (
        square[:, None, None] * xp.eye(3, dtype=arm.dtype)[None] - arm[:, :, None] * arm[:, None, :]
    )


def tensors(iquat: Array, inertia: Array) -> Array:
    """(..., 3, 3) what principal axes and moments stand for: the same in whatever order and sense the axes come."""
    return _about(inertia, iquat)


def principal(tensor: Array) -> tuple[Array, Array]:
    """Principal axes (B, 4) and moments (B, 3), the largest first, of tensors (B, 3, 3); by cyclic Jacobi rotations."""
    xp = array_module(tensor)
    scale = abs(tensor).max((-2, -1), keepdims=True)  # squares of small moments are below what float32 can hold
    tensor = tensor / xp.where(scale > 0, scale, 1.0)
    a = {(i, j): tensor[..., i, j] for i in range(3) for j in range(i, 3)}
    axes = [[xp.ones_like(a[0, 0]) * (i == j) for j in range(3)] for i in range(3)]  # columns turn
    for _ in range(_SWEEPS):
        for p, q in ((0, 1), (0, 2), (1, 2)):
            r = 3 - p - q
            off, gap = a[p, q], a[q, q] - a[p, p]
            # Rutishauser's formula: the smaller angle, without loss of digits.
            square = gap * gap + 4 * off * off
            done = square == 0
            below = abs(gap) + xp.sqrt(xp.where(done, 1.0, square))
            t = xp.where(done, 0.0, 2 * off * xp.where(gap < 0, -1.0, 1.0) / xp.where(done, 1.0, below))
            c = 1 / xp.sqrt(t * t + 1)
            s = t * c
            pr, qr = a[min(p, r), max(p, r)], a[min(q, r), max(q, r)]
            a[p, p], a[q, q] = a[p, p] - t * off, a[q, q] + t * off
            a[p, q] = xp.zeros_like(off)
            a[min(p, r), max(p, r)], a[min(q, r), max(q, r)] = c * pr - s * qr, s * pr + c * qr
            for row in axes:
                row[p], row[q] = c * row[p] - s * row[q], s * row[p] + c * row[q]
    moments = [a[0, 0], a[1, 1], a[2, 2]]
    for i, j in (
        (0, 1),
        (1, 2),
        (0, 1),
    ):  # the larger first; one column changes its sense, so that they stay right-handed
        swap = moments[i] < moments[j]
        moments[i], moments[j] = xp.where(swap, moments[j], moments[i]), xp.where(swap, moments[i], moments[j])
        for row in axes:
            row[i], row[j] = xp.where(swap, row[j], row[i]), xp.where(swap, -row[i], row[j])
    return _quat_of(axes), xp.stack(moments, axis=-1) * scale[..., 0]


def _quat_of(m: list[list[Array]]) -> Array:
    """Quaternions (B, 4) of rotation matrices, by the largest of the four numbers."""
    xp = array_module(m[0][0])
    squares = [
        1 + m[0][0] + m[1][1] + m[2][2],
        1 + m[0][0] - m[1][1] - m[2][2],
        1 - m[0][0] + m[1][1] - m[2][2],
        1 - m[0][0] - m[1][1] + m[2][2],
    ]
    yz, zx, xy = m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]
    sums = m[2][1] + m[1][2], m[0][2] + m[2][0], m[1][0] + m[0][1]
    columns = [
        (squares[0], yz, zx, xy),
        (yz, squares[1], sums[2], sums[1]),
        (zx, sums[2], squares[2], sums[0]),
        (xy, sums[1], sums[0], squares[3]),
    ]
    quats = [xp.stack(column, axis=-1) for column in columns]
    best, largest = quats[0], squares[0]
    for quat, square in zip(quats[1:], squares[1:], strict=True):
        better = square > largest
        best, largest = xp.where(better[..., None], quat, best), xp.where(better, square, largest)
    return best / xp.sqrt((best * best).sum(-1, keepdims=True))
