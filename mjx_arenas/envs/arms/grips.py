"""A gripper's controls, and how far it is closed: by servos of joints, or of fixed tendons, which move several joints at once."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas.terms.attributes.joints import JOINT_TRN


class Grips(NamedTuple):
    """f controls of a gripper, each of which moves up to k joints."""

    ids: np.ndarray
    """(f,) the actuators' ids."""
    names: tuple[str, ...]
    """Names of the joints or tendons that they move."""
    qpos: np.ndarray
    """(f, k) where the joints' positions are in `qpos`."""
    share: np.ndarray
    """(f, k) what each counts: 1 of a joint, its coefficient in a tendon's length, 0 of none."""
    unit: np.ndarray
    """(f,) where a control of 1 sends it, [m] or [rad]; 1 of what is no servo."""
    controls: np.ndarray
    """(2, f) that close and open it."""
    ends: np.ndarray
    """(2, f) positions of the closed and the open gripper: where its servos are sent. What is no servo goes to the ends of its range; they
    are 0 and 1 without one."""


def joints_of(model: mujoco.MjModel, actuator: int) -> list[tuple[int, float]]:
    """Joints that an actuator moves, by index, with what each counts; none where it moves neither a joint nor a fixed tendon."""
    kind, at = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator, 0])
    if kind in JOINT_TRN:
        return [(at, 1.0)]
    if kind != mujoco.mjtTrn.mjTRN_TENDON:
        return []
    wraps = slice(model.tendon_adr[at], model.tendon_adr[at] + model.tendon_num[at])
    if (model.wrap_type[wraps] != mujoco.mjtWrap.mjWRAP_JOINT).any():
        return []
    return [*zip(model.wrap_objid[wraps].tolist(), model.wrap_prm[wraps].tolist(), strict=True)]


def grips(model: mujoco.MjModel, fingers: Mapping[str, Sequence[float]]) -> Grips:
    """The gripper that some actuators move, each of them joints; with the controls (closed, open) of each."""
    ids = np.array([model.actuator(name).id for name in fingers], int)
    moved = [joints_of(model, i) for i in ids]
    shape = len(ids), max(map(len, moved), default=1)
    qpos, share = np.zeros(shape, int), np.zeros(shape)
    for i, joints in enumerate(moved):
        for k, (joint, counts) in enumerate(joints):
            qpos[i, k], share[i, k] = model.jnt_qposadr[joint], counts
    back = -model.actuator_biasprm[ids, 1] * model.actuator_gear[ids, 0]
    unit = np.divide(model.actuator_gainprm[ids, 0], back, out=np.ones(len(ids)), where=back != 0)
    controls = np.reshape([*fingers.values()], (-1, 2)).T.astype(float)
    ends, forces = unit * controls, model.actuator_gainprm[:, 0] * model.actuator_gear[:, 0]
    for finger in np.flatnonzero(back == 0):
        index = int(ids[finger])
        ordered, (closes, opens) = travel(model, index), forces[index] * controls[:, finger]
        ends[:, finger] = (0, 1) if ordered is None else ordered if opens > closes else ordered[::-1]
    return Grips(ids, tuple(_name(model, i) for i in ids), qpos, share, unit, controls, ends)


def travel(model: mujoco.MjModel, actuator: int) -> np.ndarray | None:
    """(2,) the least and the most of the joint or the tendon that an actuator moves; None without limits."""
    at, moved = int(model.actuator_trnid[actuator, 0]), joints_of(model, actuator)
    if model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_TENDON and model.tendon_limited[at]:
        return model.tendon_range[at]
    if not all(model.jnt_limited[joint] for joint, _ in moved):
        return None
    return np.sum([np.sort(counts * model.jnt_range[joint]) for joint, counts in moved], axis=0)


def position(grips: Grips, qpos: jax.Array) -> jax.Array:
    """(f,) positions of joints, and lengths of tendons, [m] or [rad]."""
    return (qpos[grips.qpos] * jnp.asarray(grips.share, qpos.dtype)).sum(-1)


def opened(at: jax.Array, ends: np.ndarray) -> jax.Array:
    """(f,) how far a gripper is open `at` positions or controls (f,), whose `ends` (2, f) are: 0 closed, 1 open."""
    return (at - ends[0]) / (ends[1] - ends[0])


def _name(model: mujoco.MjModel, actuator: int) -> str:
    """The name of the joint or the tendon that an actuator moves."""
    at = int(model.actuator_trnid[actuator, 0])
    one = model.joint if int(model.actuator_trntype[actuator]) in JOINT_TRN else model.tendon
    return one(at).name
