"""What worlds start with: no numbers of the model, but of the state in which `make_data` begins."""

from typing import Any

import mujoco
import numpy as np

from mjx_arenas.params.params import Quantity
from mjx_arenas.terms.attributes.attribute import Attribute, Target, axis_joint, number, reader, setter


def _nothing(element: Any, value: np.ndarray, model: mujoco.MjModel, index: int) -> None:
    """No spec has it."""


def _zeros(model: mujoco.MjModel, ids: np.ndarray) -> np.ndarray:
    return np.zeros(len(ids))


def _carried(model: mujoco.MjModel, index: int) -> str:
    """Why a body cannot come and go: it could not be kept elsewhere without a change to what stays."""
    if model.body_mocapid[model.body_rootid[index]] >= 0:
        return "a mocap body carries it, or is it"
    if model.body_weldid[model.body_parentid[index]]:
        return "it hangs on what moves, whose masses would be others"
    adr = model.body_jntadr[index]
    if adr >= 0 and model.jnt_type[adr] == mujoco.mjtJoint.mjJNT_FREE:
        return "it is free: make it an Object, which has `object_active`"
    return ""


PRESENCE = {
    "body.active": Attribute(
        Quantity("body", (), bool), (), _nothing, lambda model, ids: np.ones(len(ids), bool), refused=_carried
    ),
}
"""An inactive body, and all that hangs on it, touches nothing and is not drawn; what of it is fixed has no mass, what moves moves far
away, by itself."""
STARTS = {
    "joint.qpos": Attribute(
        number("joint", "", "[rad] or [m]"), (Target("data.qpos"),), _nothing, _zeros, refused=axis_joint
    ),
    "joint.qvel": Attribute(
        number("joint", "", "[rad/s] or [m/s]"),
        (Target("data.qvel", per_dof=True),),
        _nothing,
        _zeros,
        refused=axis_joint,
    ),
    "equality.active": Attribute(
        Quantity("equality", (), bool), (Target("data.eq_active"),), setter("active"), reader("eq_active0", None, True)
    ),
}
"""Positions and velocities are added to those in which a joint starts, at `qpos0` or in a keyframe."""
