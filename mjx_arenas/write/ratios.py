"""Dampings of position servos that the compiler makes of their `dampratio`; NumPy or JAX.

They are 2 dampratio sqrt(kp / w) / |gear|, with the inverse weight w at `qpos0` of the servo's degree of freedom or
tendon. The ratio itself is in no compiled model: another world's damping follows from the nominal one.
"""

from collections.abc import Collection
from typing import NamedTuple

import mujoco
import numpy as np

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.write.trees import JOINT_TRN

_TENDON = int(mujoco.mjtTrn.mjTRN_TENDON)
_AXIAL = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))


class Ratios(NamedTuple):
    """The servos of a compiled model that have a ratio, n of them."""

    ids: np.ndarray  # (n,)
    weights: (
        np.ndarray
    )  # (n,) places of their inverse weights among those of all degrees of freedom, then of all tendons
    share: np.ndarray  # (n,) of sqrt(kp / w) / |gear|, the same in all worlds

    @classmethod
    def of(cls, model: mujoco.MjModel, named: Collection[int], given: Collection[int]) -> "Ratios":
        """Those on hinges, slides and tendons.

        Args:
            model: nominal.
            named: ids of all servos with a ratio.
            given: ids of actuators whose damping is given otherwise.
        """
        ids, weights = [], []
        for i in sorted(set(named) - set(given)):
            kind, target = int(model.actuator_trntype[i]), int(model.actuator_trnid[i, 0])
            if kind == _TENDON:
                ids, weights = [*ids, i], [*weights, model.nv + target]
            elif kind in JOINT_TRN and int(model.jnt_type[target]) in _AXIAL:
                ids, weights = [*ids, i], [*weights, model.jnt_dofadr[target]]
        plain = cls(np.array(ids, int), np.array(weights, int), np.ones(len(ids)))
        fields = (model.actuator_gainprm, model.actuator_gear, model.dof_invweight0, model.tendon_invweight0)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = -model.actuator_biasprm[plain.ids, 2] / plain.dampings(*fields)
        return plain._replace(share=np.where(np.isfinite(share), share, 0.0))  # without a gain there is no damping

    def dampings(self, gainprm: Array, gear: Array, dof_invweight0: Array, tendon_invweight0: Array) -> Array:
        """(n,) [N s/m] or the like, by fields of a model."""
        xp = array_module(gainprm, dof_invweight0)
        weight = xp.concatenate([dof_invweight0, tendon_invweight0])[self.weights]
        share = xp.asarray(self.share, weight.dtype)
        return share * xp.sqrt(gainprm[self.ids, 0] / weight) / xp.abs(gear[self.ids, 0])
