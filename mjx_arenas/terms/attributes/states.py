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
