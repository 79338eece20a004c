"""Keyframes in which joints are outside of their ranges (host)."""

import mujoco
import numpy as np

from mjx_arenas.problem import problem
from mjx_arenas.problems import messages
from mjx_arenas.spec.names import element

LEAST = 1e-3  # that is told [m] or [rad]
SHOWN = 3  # joints that are told


def warn_of_ranges(model: mujoco.MjModel, where: str, prefix: str = "") -> None:
    """Warns of slides and hinges that a keyframe puts outside of their range.

    Args:
        model: of an arena.
        where: what the sentence begins with.
        prefix: of the names of the keyframes, and of the joints or their bodies, that are looked at: those of one robot.
    """
    kinds = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    names = [(model.joint(j).name, model.body(model.jnt_bodyid[j]).name) for j in range(model.njnt)]
    own = [any(name.startswith(prefix) for name in both) for both in names]
    joints = np.flatnonzero(np.isin(model.jnt_type, kinds) & (model.jnt_limited != 0) & np.array(own, bool))
    (low, high), told = model.jnt_range[joints].T, []
    for k in range(model.nkey):
        at = model.key_qpos[k, model.jnt_qposadr[joints]]
        if not model.key(k).name.startswith(prefix):
            continue
        for i in np.flatnonzero((at < low - LEAST) | (at > high + LEAST)).tolist():
            joint, key = element(model, "joint", int(joints[i])), repr(model.key(k).name)
            told.append(f"{joint} at {at[i]:.4g} of {low[i]:.4g} to {high[i]:.4g} in keyframe {key}")
    if told:
        more = f", and {len(told) - SHOWN} more" if len(told) > SHOWN else ""
        messages.warn(problem("", "out_of_range", where=where, told="; ".join(told[:SHOWN]) + more))
