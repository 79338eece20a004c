"""What worlds start with: no numbers of the model, but of the state in which `make_data` begins."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.geometry import Array
from mjx_arenas.params.params import Quantity
from mjx_arenas.terms.attributes.attribute import (
    JOINT,
    RPY,
    XYZ,
    Attribute,
    Target,
    axis_joint,
    carriers_of_flexes,
    number,
    reader,
    setter,
)
from mjx_arenas.terms.attributes.poses import rpy_quat


def _nothing(element: Any, value: np.ndarray, model: mujoco.MjModel, index: int) -> None:
    """No spec has it."""


def _zeros(model: mujoco.MjModel, ids: np.ndarray) -> np.ndarray:
    return np.zeros(len(ids))


def _carried(model: mujoco.MjModel, index: int) -> str:
    """Why a body cannot come and go: it could not be kept elsewhere without a change to what stays."""
    if model.body_mocapid[model.body_rootid[index]] >= 0:
        return "it is a mocap body, or is attached to one: put that elsewhere by `body.pos`"
    if model.body_weldid[model.body_parentid[index]]:
        return "it is attached to a moving body, whose mass would change with it: vary `body.active` of what carries it"
    if index in carriers_of_flexes(model):
        return "a flex is on it, which the compiler would take away as a whole: make an arena for each"
    adr = model.body_jntadr[index]
    if adr >= 0 and model.jnt_type[adr] == mujoco.mjtJoint.mjJNT_FREE:
        return "it is free: make it an Object, which has `object_active`"
    return ""


def _carriers(model: mujoco.MjModel, index: int, ball: bool) -> np.ndarray:
    """The free joint of a body, or its ball joint, if it has one."""
    own = model.body_jntadr[index] + np.arange(model.body_jntnum[index])
    return own[np.isin(model.jnt_type[own], [JOINT.mjJNT_FREE, *([JOINT.mjJNT_BALL] if ball else [])])]


def _kept_by_joints(ball: bool) -> Callable[[mujoco.MjModel, int], str]:
    which = "free or ball" if ball else "free"

    def refused(model: mujoco.MjModel, index: int) -> str:
        why = f"no {which} joint of its own carries it: vary `body.pos`, `body.rpy` or `joint.qpos`"
        return "" if len(_carriers(model, index, ball)) else why

    return refused


def _places(address: str, count: int, ball: bool) -> Callable[[mujoco.MjModel, np.ndarray], np.ndarray]:
    """The first entries of a free joint in `qpos` or `qvel`, or the last ones of a free or a ball joint."""

    def at(model: mujoco.MjModel, ids: np.ndarray) -> np.ndarray:
        joint = np.array([_carriers(model, int(index), ball)[0] for index in ids], int)
        after = 3 * (ball & (model.jnt_type[joint] == JOINT.mjJNT_FREE))
        return (getattr(model, address)[joint] + after)[:, None] + np.arange(count)

    return at


def _of_base(unit: str, ball: bool, field: str, address: str, count: int = 3, made: Any = None) -> Attribute:
    """Three numbers of how a body with a free joint starts, or of how it is turned, with a ball joint, too."""
    return Attribute(
        number("body", RPY if made else XYZ, unit),
        (Target(field, made=made, at=_places(address, count, ball)),),
        _nothing,
        lambda model, ids: np.zeros((len(ids), 3)),
        refused=_kept_by_joints(ball),
    )


def _turns(values: Array, model: mujoco.MjModel, ids: np.ndarray) -> Array:
    return rpy_quat(values)


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
    "body.start_pos": _of_base("[m]", False, "data.qpos", "jnt_qposadr"),
    "body.start_rpy": _of_base("[rad]", True, "data.turn", "jnt_qposadr", 4, _turns),
    "body.start_vel": _of_base("[m/s]", False, "data.qvel", "jnt_dofadr"),
    "body.start_angvel": _of_base("[rad/s]", True, "data.qvel", "jnt_dofadr"),
    "equality.active": Attribute(
        Quantity("equality", (), bool), (Target("data.eq_active"),), setter("active"), reader("eq_active0", None, True)
    ),
}
"""Positions and velocities are added to those in which a joint starts, at `qpos0` or in a keyframe.

Of free and ball joints they go by the body: its place and velocity in the world, turns and angular velocities in its own frame, as in
`qpos` and `qvel`.
"""
