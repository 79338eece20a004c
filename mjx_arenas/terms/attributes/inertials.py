"""Inertials of bodies as a whole: by their pseudo-inertia, and with a payload.

N bodies. `body` is in each name the frame of the body, not of its inertia.
"""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from mjx_arenas import solids
from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import Quantity
from mjx_arenas.solids import Inertials
from mjx_arenas.terms.attributes.attribute import Attribute, Target
from mjx_arenas.terms.attributes.prepare import always, always_inferred, weighed

Change = Callable[[Array, mujoco.MjModel, np.ndarray], Inertials]
PSEUDO = "alpha, d1, d2, d3, s12, s13, s23, t1, t2, t3"
_FIELDS = {"mass": "body_mass", "ipos": "body_ipos", "iquat": "body_iquat", "inertia": "body_inertia"}


def has_mass(model: mujoco.MjModel, index: int) -> str:
    """Why a body without mass cannot vary in it."""
    return "" if model.body_mass[index] > 0 else "it has no mass: give it an <inertial>"


def pseudo(values: Array, model: mujoco.MjModel, ids: np.ndarray) -> Inertials:
    """Bodies stretched, sheared, shifted and made denser by ten numbers (N, 10), whose inertia some real body has.

    Rucker and Wensing 2022, "Smooth parameterization of rigid-body inertia": the pseudo-inertia J becomes U J U', with
    U = exp(alpha) [[exp(d1), s12, s13, t1], [0, exp(d2), s23, t2], [0, 0, exp(d3), t3], [0, 0, 0, 1]].
    """
    xp = array_module(values)
    mass, ipos, tensor = _nominal(values, model, ids)
    alpha, d1, d2, d3, s12, s13, s23 = (values[:, i] for i in range(7))
    none, shift = xp.zeros_like(alpha), values[:, 7:]
    rows = [[xp.exp(d1), s12, s13], [none, xp.exp(d2), s23], [none, none, xp.exp(d3)]]
    stretch = xp.stack([xp.stack(row, axis=-1) for row in rows], axis=-2)
    denser = xp.exp(2 * alpha)
    spread = _times(_times(stretch, _rest(tensor, 0.5)), stretch.swapaxes(-1, -2))
    ipos = (stretch * ipos[:, None, :]).sum(-1) + shift
    return Inertials(mass * denser, ipos, *solids.principal(denser[:, None, None] * _rest(spread, 1.0)))


def payload(values: Array, model: mujoco.MjModel, ids: np.ndarray) -> Inertials:
    """Bodies that carry points of a mass [kg] at a place [m] in the body's frame, (N, 4)."""
    xp = array_module(values)
    mass, ipos, tensor = _nominal(values, model, ids)
    more, place = values[:, 0], values[:, 1:]
    whole, arm = mass + more, place - ipos
    reduced = (mass * more / whole)[:, None, None]
    lever = (arm * arm).sum(-1)[:, None, None] * xp.eye(3, dtype=values.dtype) - arm[:, :, None] * arm[:, None, :]
    return Inertials(whole, ipos + (more / whole)[:, None] * arm, *solids.principal(tensor + reduced * lever))


def _nominal(values: Array, model: mujoco.MjModel, ids: np.ndarray) -> tuple[Array, Array, Array]:
    """Masses (N,), centres (N, 3) and tensors (N, 3, 3) about them, along the bodies' axes."""
    tensor = solids.tensors(model.body_iquat[ids], model.body_inertia[ids])
    const = array_module(values).asarray
    return tuple(const(x, values.dtype) for x in (model.body_mass[ids], model.body_ipos[ids], tensor))  # type: ignore[return-value]


def _rest(tensor: Array, share: float) -> Array:
    """A share of the trace in the diagonal, less the tensors (N, 3, 3).

    Inertias are so made of second moments of mass, with all of the trace, and these of inertias, with half of it.
    """
    one = array_module(tensor).eye(3, dtype=tensor.dtype)
    return share * (tensor * one).sum((-1, -2))[:, None, None] * one - tensor


def _times(a: Array, b: Array) -> Array:
    """Matrix products, in full precision on any device."""
    return (a[..., :, :, None] * b[..., None, :, :]).sum(-2)


def _whole(quantity: Quantity, change: Change) -> Attribute:
    """An attribute that decides all of a body's inertial; nominally, its numbers are 0."""

    def target(name: str) -> Target:
        return Target(_FIELDS[name], made=lambda values, model, ids: getattr(change(values, model, ids), name))

    def edit(element: Any, value: np.ndarray, model: mujoco.MjModel, index: int) -> None:
        found = change(np.nan_to_num(np.asarray(value, float))[None], model, np.array([index]))
        for name in _FIELDS:
            setattr(element, name, getattr(found, name)[0])

    return Attribute(
        quantity,
        tuple(map(target, _FIELDS)),
        edit,
        lambda model, ids: np.zeros((len(ids), *quantity.item)),
        prepare=weighed,
        ends_point=always,
        refused=has_mass,
        refused_in_spec=always_inferred,
    )


def _payload_right(values: Array) -> Array:
    return (values >= 0) | (np.arange(4) > 0)


INERTIAL = {
    "body.pseudo_inertia": _whole(Quantity("body", (10,), float, PSEUDO, limits=(-5.0, 5.0)), pseudo),
    "body.payload": _whole(Quantity("body", (4,), float, "mass, x, y, z", _payload_right, ">= 0 in its mass"), payload),
}
