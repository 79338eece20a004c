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


def _alone(model: mujoco.MjModel, index: int) -> str:
    """Why a body cannot come and go: it moves, or something on it does, or is tied to it."""
    if model.body_weldid[index] or model.body_mocapid[model.body_rootid[index]] >= 0:
        return "it moves: make it an Object, which has `object_active`"
    inside = np.arange(model.nbody) == index
    for body in range(index + 1, model.nbody):
        inside[body] = inside[model.body_parentid[body]]
    if inside[model.dof_bodyid].any():
        return "something with joints is fixed on it"
    return ""


PRESENCE = {
    "body.active": Attribute(
        Quantity("body", (), bool), (), _nothing, lambda model, ids: np.ones(len(ids), bool), refused=_alone
    ),
}
"""An inactive body, and all that hangs on it, touches nothing, is not drawn and has no mass."""
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
