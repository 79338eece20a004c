"""Masses and inertias of bodies that follow from their geoms, as MuJoCo's compiler sums them (`mjCBody::InertiaFromGeom`).

NumPy or JAX: on the host for the proof of an arena, on the device for its worlds. G geoms, B bodies.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import mujoco
import numpy as np

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.primitives import moments, volume
from mjx_arenas.quaternions import quat_mul, quat_to_mat_rows

_ROTATIONS = 12  # of Jacobi's: of 200,000 random bodies none needs more than ten in double precision
_WEIGHS = 1e-14  # more than which a geom weighs that counts for the compiler [kg]
_TIE = 4  # roundings by which equal numbers may differ
# The compiler's, as shares of the largest number of a tensor: a product of inertia that is none, and moments that are equal.
_NONE, _EQUAL = 4e-15, 1e-12


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
    weighs = of & (mass > _WEIGHS)[None]
    alone, first = weighs.sum(1) == 1, weighs.argmax(1)  # the compiler takes its axes and moments as they are
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
    """Principal axes (B, 4) and moments (B, 3), the largest first, of tensors (B, 3, 3), as the compiler chooses them.

    An axis has two senses, and the frame of a body's inertia is read by sensors. The compiler (`mju_eig3`) turns the body's frame
    by Jacobi rotations, each of which clears the largest product of inertia, and sorts the moments by quarter turns. So does this.
    Numbers that differ by rounding count as equal, as those of symmetric bodies are.
    """
    xp = array_module(tensor)
    scale = abs(tensor).max((-2, -1))  # squares of small moments are below what float32 can hold
    tensor = tensor / xp.where(scale > 0, scale, 1.0)[..., None, None]
    tie = _TIE * float(np.finfo(tensor.dtype).eps)
    turned = _Turned(
        [tensor[..., i, i] for i in range(3)],
        [tensor[..., i - 2, i - 1] for i in range(3)],
        xp.stack([xp.ones_like(scale), *[xp.zeros_like(scale)] * 3], axis=-1),
    )
    if xp is np:
        for _ in range(_ROTATIONS):
            turned = _cleared(turned, tie)
    else:  # unrolled, XLA would compute most of it again for each number that comes out
        turned = jax.lax.fori_loop(0, _ROTATIONS, lambda _, turned: _cleared(turned, tie), turned)
    moments, quat = turned.moments, turned.quat
    for i in (0, 1, 0):
        swap = moments[i] + max(_EQUAL, tie) < moments[i + 1]
        moments[i], moments[i + 1] = (xp.where(swap, moments[k], moments[j]) for j, k in ((i, i + 1), (i + 1, i)))
        quarter = xp.asarray(np.sqrt(0.5) * np.eye(4)[[0, (i + 2) % 3 + 1]].sum(0), tensor.dtype)
        quat = xp.where(swap[..., None], quat_mul(quat, quarter), quat)
    return quat / xp.sqrt((quat * quat).sum(-1, keepdims=True)), xp.stack(moments, axis=-1) * scale[..., None]


class _Turned(NamedTuple):
    """Tensors in frames that turn."""

    moments: list[Array]  # three of (B,)
    products: list[Array]  # each by the axis about which a rotation clears it
    quat: Array  # (B, 4) the frames


def _cleared(turned: _Turned, tie: float) -> _Turned:
    """After the rotation that clears the largest product of inertia, if it counts."""
    moments, products, quat = turned
    xp = array_module(quat)
    x, y, z = (abs(product) for product in products)
    by_z = (z > y + tie) & (z > x + tie)
    by_y = ~by_z & (y > x + tie)

    def pick(values: Sequence[Array]) -> Array:
        """What is for the axis of the rotation."""
        return xp.where(by_z, values[2], xp.where(by_y, values[1], values[0]))

    def place(values: Sequence[Array]) -> list[Array]:
        """By axis, what is for that of the rotation and for the next two."""
        return [pick([values[i], values[i - 1], values[i - 2]]) for i in range(3)]

    a, b, c = (pick(moments[i:] + moments[:i]) for i in range(3))  # of the axis of the rotation and of the next two
    off, to_b, to_c = (pick(products[i:] + products[:i]) for i in range(3))
    gap = xp.where(abs(c - b) > tie, c - b, 0.0)
    # Rutishauser's formula: the smaller angle, without loss of digits. Of 45 degrees, the compiler turns about y the other way.
    below = abs(gap) + xp.sqrt(xp.where(off == 0, 1.0, gap * gap + 4 * off * off))
    sense = xp.where(xp.where(gap == 0, by_y, (gap < 0) != (off < 0)), -1.0, 1.0)
    idle = abs(off) < max(_NONE, tie)
    tangent = xp.where(idle, 0.0, sense * 2 * abs(off) / below)
    cos = 1 / xp.sqrt(1 + tangent * tangent)
    sin, half = cos * tangent, xp.sqrt((1 + cos) / 2)
    none = xp.zeros_like(off)
    turn = xp.stack([half, *place([-sin / (2 * half), none, none])], axis=-1)
    moments = place([a, b - tangent * off, c + tangent * off])
    products = place([xp.where(idle, off, none), sin * to_c + cos * to_b, cos * to_c - sin * to_b])
    return _Turned(moments, products, quat_mul(quat, turn))
