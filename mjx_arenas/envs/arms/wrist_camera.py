"""A camera on the hand of an arm, for policies that see pictures: where it is, and how that varies (host)."""

import itertools
from typing import Any

import mujoco
import numpy as np

from mjx_arenas import dr
from mjx_arenas.arena import Arena
from mjx_arenas.params.distributions import Uniform

NAME = "policy_wrist"
LOOKS: dict[str, Any] = {
    "wrist_eye": (dr.Term("camera.pos", NAME), Uniform(-0.005, 0.005, relative="add")),
    "wrist_gaze": (dr.Term("camera.rpy", NAME), Uniform(-0.03, 0.03)),
    "wrist_lens": (dr.Term("camera.fovy", NAME), Uniform(0.95, 1.05, relative="scale")),
}
"""The terms of it by name, and what they vary by."""
_FOVY = 75.0  # [degrees]
_ASIDE, _BEHIND, _AHEAD = 0.09, 0.08, 0.02  # [m] of it from the tool, and of what it looks at before the tool
_SIDES = ((-1, 0), (1, 0), (0, -1), (0, 1))  # of the tool, by x and y of its frame
_AROUND = np.linspace(-0.04, 0.04, 5)  # [m] of the points around the tool that it should see


def add(arena: Arena, arm: mujoco.MjModel, keyframe: str, tool: str, prefix: str) -> None:
    """Adds the camera to an arena that an arm was attached to, and its terms.

    It looks at the tool from behind and aside, from the side on which the arm, in a keyframe, hides least of what is around the tool.
    """
    data = mujoco.MjData(arm)
    mujoco.mj_resetDataKeyframe(arm, data, arm.key(keyframe).id)
    mujoco.mj_kinematics(arm, data)
    eye = max(
        (np.array([_ASIDE * x, _ASIDE * y, -_BEHIND]) for x, y in _SIDES), key=lambda p: _seen(arm, data, tool, p)
    )
    back = eye - (0, 0, _AHEAD)  # a camera looks along its -z, with y up
    back /= np.linalg.norm(back)
    right = np.cross([-eye[0], -eye[1], 0.0], back)
    right /= np.linalg.norm(right)
    site, turn, quat = arm.site(tool), np.zeros(9), np.zeros(4)
    mujoco.mju_quat2Mat(turn, site.quat)
    turn, hand = turn.reshape(3, 3), arm.body(int(site.bodyid[0])).name
    mujoco.mju_mat2Quat(quat, (turn @ np.stack([right, np.cross(back, right), back], 1)).reshape(-1))
    pos = site.pos + turn @ eye
    arena.add_camera(NAME, pos=pos.tolist(), quat=quat.tolist(), fovy=_FOVY, on=prefix + hand)
    arena.vary(**{name: term for name, (term, _) in LOOKS.items()})


def _seen(arm: mujoco.MjModel, data: mujoco.MjData, tool: str, eye: np.ndarray) -> int:
    """How many points around a tool are seen from a place in its frame: no drawn geom of the arm is before them."""
    pos, mat = data.site(tool).xpos, data.site(tool).xmat.reshape(3, 3)
    drawn, geom, count = np.array([1, 1, 1, 0, 0, 0], np.uint8), np.zeros(1, np.int32), 0
    for x, y in itertools.product(_AROUND, _AROUND):
        ray = mat @ (np.array([x, y, _AHEAD]) - eye)
        hit = mujoco.mj_ray(arm, data, pos + mat @ eye, ray, drawn, 1, -1, geom, None)  # a share of the ray, or -1
        count += not 0 <= hit < 1
    return count
