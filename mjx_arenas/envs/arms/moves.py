"""How an arm moves: its joints from base to tool, and the places to which inverse kinematics bring the tool (host)."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas.envs.arms import chain, opening, servos
from mjx_arenas.envs.arms.arm import HOME, Arm
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error, warn
from mjx_arenas.rules.validation import check_type
from mjx_arenas.spec import specs

NEAR, STRAIGHT = 0.005, 0.05  # [m], [rad] by which a tool may miss a place that it reaches
ACTION = 0.04  # [s] that an action of tasks lasts
_JOINT = mujoco.mjtJoint
_AT_REST = {_JOINT.mjJNT_HINGE: (STRAIGHT / ACTION, "rad/s"), _JOINT.mjJNT_SLIDE: (NEAR / ACTION, "m/s")}
"""The speed up to which a joint counts as at rest: within an action it goes no further than a tool may miss a place. And its unit."""
HEIGHTS = (0.02, 0.25)  # [m] above what carries an arm, of the places that tasks need


def checked(arm: Arm) -> chain.Chain:
    """The joints of an arm, from its base to its tool.

    Raises:
        ValueError, TypeError: it is none, or one that tasks refuse.

    Warns:
        UserWarning: it does not stay in its keyframe "home"; as `servos.checked` and `opening.check`.
    """
    check_type("arm", arm, Arm, "an envs.arms.Arm, such as envs.arms.small()")
    found, model = servos.checked(arm), specs.compiled(arm.spec, "arm.spec")
    home = HOME if HOME in (key.name for key in arm.spec.keys) else None
    if home is not None and (what := restless(model, found.joints)):
        warn(problem("arm.spec", "restless", None, home, what=what))
    elif arm.fingers:  # what shakes opens no gap that could be measured
        opening.check(model, home, arm.tool, arm.fingers, arm.width)
    return found


def restless(model: mujoco.MjModel, joints: Sequence[str]) -> str:
    """What still moves a second after the keyframe "home", and how fast, in words; "": the arm stays there.

    Only what actuators move is to stay. The fastest of the arm's own joints, from its base to its tool, is told, or else of its gripper's.
    """
    speeds, found = opening.moved(model, HOME, {}).qvel, []
    for j, kind in enumerate(model.jnt_type):
        least, unit = _AT_REST.get(_JOINT(kind), (np.inf, ""))
        name, speed = model.joint(j).name, abs(speeds[model.jnt_dofadr[j]])
        if servos.on(model, j) and not speed <= least:
            shown = f"{speed:.0f}" if speed >= 10 else f"{speed:.2g}"
            found.append((name in joints, speed / least, f"joint {name!r} moves at {shown} {unit}"))
    return max(found, default=(False, 0.0, ""))[-1]


def check_keyframe(arm: Arm, keyframe: Any) -> None:
    """Refuses what is not the name of a keyframe of an arm."""
    keys = [key.name for key in arm.spec.keys]
    if keyframe not in keys:
        has = ", ".join(map(repr, keys)) or f"which has none: envs.arms.ready adds {HOME!r}"
        raise error(
            [problem("config.keyframe", "must", None, keyframe, must=f"the name of a keyframe of `arm.spec`, {has}")]
        )


class Moves(NamedTuple):
    """The joints of an arm from its base to its tool, and how they may move."""

    links: chain.Chain
    start: np.ndarray
    """(n,) positions in a keyframe [rad] or [m]."""
    limits: np.ndarray
    """(2, n) least and most that servos can be told; infinite without limits."""

    def misses(self, pos: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """(2, N) [m] and [rad] by which a tool that points down misses places (N, 3) in the base's frame, along axes of yaws (N,)."""
        start, limits = jnp.array(self.start), jnp.array(self.limits)
        errors = jax.jit(jax.vmap(lambda pos, yaw: chain.errors(self.links, start, limits, pos, yaw)))(pos, yaw)
        return np.asarray(errors).T


def reached(misses: np.ndarray) -> np.ndarray:
    """(N,) bool: a tool that misses places by (2, N) goes there."""
    return np.asarray((misses < np.array([[NEAR], [STRAIGHT]])).all(0))


def moves(arm: Arm, links: chain.Chain, keyframe: str) -> Moves:
    """How the joints of an arm move from one of its keyframes on."""
    model = arm.spec.compile()
    joints = [model.joint(name) for name in links.joints]
    ids = [joint.id for joint in joints]
    start = np.array([model.key(keyframe).qpos[joint.qposadr[0]] for joint in joints])
    return Moves(links, start, servos.targets(model, ids, np.array([servos.on(model, i)[0] for i in ids])))
