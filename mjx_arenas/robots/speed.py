"""How fast a robot steps in C MuJoCo (host)."""

import os
import time

import mujoco
import numpy as np

from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.rules import validation
from mjx_arenas.spec import specs

_STEPS = 100  # from the start, over and over


def steps_per_second(robot: str | os.PathLike | mujoco.MjSpec | mujoco.MjModel, seconds: float = 1.0) -> float:
    """Measures steps per second of C MuJoCo on one core.

    It repeats the first 100 steps from the first keyframe, or from `qpos0` if there is none.

    Args:
        robot: path of an MJCF file, MJCF text, a spec or a model.
        seconds: shortest duration of the measurement [s]; a warm-up of a tenth of it comes before.

    Raises:
        FileNotFoundError, TypeError, ValueError: the robot cannot be read, or `seconds` is no number > 0.
    """
    if not (validation.is_number(seconds) and 0 < seconds < np.inf):
        raise error([problem("seconds", "must", None, seconds, must="a number > 0 [s]")])
    model = robot if isinstance(robot, mujoco.MjModel) else specs.compiled(specs.read(robot, "robot"), "robot")
    data = mujoco.MjData(model)
    _stepped(model, data, seconds / 10)
    return _stepped(model, data, seconds)


def compared(
    before: mujoco.MjModel, after: mujoco.MjModel, seconds: float = 0.25, rounds: int = 4
) -> tuple[float, float]:
    """The speeds of two models, measured in turns: the best of each, as other work on the machine only makes it slower."""
    found = [(steps_per_second(before, seconds), steps_per_second(after, seconds)) for _ in range(rounds)]
    return max(one for one, _ in found), max(other for _, other in found)


def _stepped(model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> float:
    """Steps a second, measured for so long [s]."""
    begin, steps, spent = time.perf_counter(), 0, 0.0
    while not steps or spent < seconds:
        mujoco.mj_resetData(model, data)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_step(model, data, _STEPS)
        steps, spent = steps + _STEPS, time.perf_counter() - begin
    return steps / spent
