"""Dampings of position servos that the compiler makes of their `dampratio`; NumPy or JAX.

They are 2 dampratio sqrt(kp / w) / |gear|, with the inverse weight w at `qpos0` of the servo's degree of freedom or
tendon, and 0 without a gear (`mj_setConst`). That of a body that only slides has its armature, too, which its
`dof_invweight0` leaves out. The ratio itself is in no compiled model: another world's damping follows from the nominal
one. Where the ratio varies, its row has what the damping would be with the nominal gain, gear and weight.
"""

from collections.abc import Collection
from typing import Any, NamedTuple

import mujoco
import numpy as np

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.terms.attributes.gains import along_one


class Ratios(NamedTuple):
    """The servos of a compiled model that have a ratio, n of them."""

    ids: np.ndarray  # (n,)
    weights: (
        np.ndarray
    )  # (n,) places of their inverse weights among those of all degrees of freedom, then of all tendons
    lone: (
        np.ndarray
    )  # (n,) bool: of a degree of freedom of a body that MuJoCo takes for a point, whose inertia matrix is diagonal
    share: np.ndarray  # (n,) of sqrt(kp / w) / |gear|, nominal
    written: np.ndarray  # (n,) bool: whether the ratio varies
    nominal: np.ndarray  # (n,) sqrt(kp / w) / |gear|

    @classmethod
    def of(
        cls, model: mujoco.MjModel, named: Collection[int], given: Collection[int], varied: Collection[int]
    ) -> "Ratios":
        """The ratios on hinges, slides and tendons.

        Args:
            model: nominal.
            named: ids of all servos with a ratio.
            given: ids of actuators whose damping is given otherwise.
            varied: ids of those whose ratio varies.
        """
        ids = [i for i in sorted(set(named) - set(given)) if along_one(model, i)]
        targets = model.actuator_trnid[ids, 0]
        on_tendon = model.actuator_trntype[ids] == mujoco.mjtTrn.mjTRN_TENDON
        weights = [
            model.nv + t if tendon else model.jnt_dofadr[t] for t, tendon in zip(targets, on_tendon, strict=True)
        ]
        none = np.zeros(len(ids))
        points = model.body_simple[model.dof_bodyid] == 2
        lone = np.append(points, np.zeros(model.ntendon, bool))[np.array(weights, int)]
        plain = cls(np.array(ids, int), np.array(weights, int), lone, none + 1.0, none.astype(bool), none + 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            nominal = plain.dampings(model)
            share = -model.actuator_biasprm[plain.ids, 2] / nominal
        share = np.where(np.isfinite(share), share, 0.0)  # without a gain there is no damping
        return plain._replace(share=share, written=np.isin(plain.ids, [*varied]), nominal=nominal)

    def dampings(self, model: Any) -> Array:
        """(n,) [N s/m] or the like, by fields of a model of MuJoCo or MJX in which the rows of terms are written."""
        gain, weight = model.actuator_gainprm[self.ids, 0], model.dof_invweight0
        xp = array_module(gain, weight)
        weight = xp.concatenate([weight, model.tendon_invweight0])[self.weights]
        if self.lone.any():
            inertia = xp.concatenate([model.dof_M0, xp.ones_like(model.tendon_invweight0)])[self.weights]
            weight = xp.where(self.lone, 1 / inertia, weight)
        share = xp.asarray(self.share, weight.dtype)
        if self.written.any():
            share = xp.where(
                self.written, -model.actuator_biasprm[self.ids, 2] / self.nominal.astype(weight.dtype), share
            )
        gear = xp.abs(model.actuator_gear[self.ids, 0])
        moves = (gear * gear > mujoco.mjMINVAL) & (weight > 0)  # else MuJoCo takes the mass, and so the damping, for 0
        weight, gear = xp.where(moves, weight, 1.0), xp.where(moves, gear, 1.0)
        return xp.where(moves, share * xp.sqrt(gain / weight) / gear, 0.0)
