"""An arm for tasks: a robot with position servos, a tool between its fingers, and a pose in which it begins (host)."""

import dataclasses
from collections.abc import Mapping

import mujoco
import numpy as np

from mjx_arenas.build import keyframes
from mjx_arenas.envs.arms import servos
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error, raise_all
from mjx_arenas.rules.validation import check_type, is_number, vector_problems
from mjx_arenas.spec import patterns, specs
from mjx_arenas.terms.attributes.joints import JOINT_TRN

HOME = "home"  # name of the keyframe in which an arm begins


@dataclasses.dataclass(frozen=True)
class Arm:
    """A robot whose hinges or slides move a gripper.

    Args:
        spec: its MJCF, as a path, text or a spec; the arm has the spec. It has a keyframe "home", in which the robot begins, and one
            position servo (gear 1) of each joint between base and tool.
        base: name of the body that does not move.
        tool: name of a site between the fingertips, whose z axis points away from the hand. Policies see the heading of its x axis.
            Fingers should open along its y axis, as those of the library's arms do; a warning says where they open along another line.
        fingers: controls of the gripper's actuators by name: (closed, open). Each moves a joint, or a fixed tendon, as that of a Robotiq
            2F-85 does. Targets slightly beyond contact give the grip its force. Policies see how far it is open:
            0 where a servo is sent to close, 1 to open. {}: it has no gripper, and can only reach.
        width: width of the largest object that it can grip [m], the smaller of two seen from above. `invalid_arena` reports wider ones. It
            is > 0, and at most 2 mm more than the gap between the open fingers.
        reach: (least, most) horizontal distance from the base at which the tool, pointing down, reaches all heights that the tasks need
            [m].
        rise: height of its base above what carries it, on a post that comes with it, >= 0 [m].
    """

    spec: mujoco.MjSpec
    base: str
    tool: str
    fingers: Mapping[str, tuple[float, float]]
    width: float
    reach: tuple[float, float] = (0.22, 0.44)
    rise: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.spec, mujoco.MjSpec):
            object.__setattr__(self, "spec", specs.read(self.spec, "spec"))


def ready(spec: mujoco.MjSpec, home: Mapping[str, float], fingers: Mapping[str, tuple[float, float]]) -> None:
    """Adds the keyframe "home" to a spec. Joints are given by name; others stay at `qpos0`. Servos hold them, and the gripper is open.

    Raises:
        ValueError, TypeError: there is a keyframe "home", or no joint or actuator of a name; a joint is outside of its range; controls of
            a gripper are not (closed, open).
    """
    check_type("spec", spec, mujoco.MjSpec, "a mujoco.MjSpec")
    model = specs.compiled(spec, "spec")
    if HOME in [key.name for key in spec.keys]:
        raise error([problem("spec", "keyframe_taken", None, HOME)])
    check_type("home", home, Mapping, "a dictionary of positions by the names of joints; {} for none")
    servos.check_controls("fingers", fingers, model)
    qpos, ctrl = np.array(model.qpos0), np.zeros(model.nu)
    for name, value in home.items():
        _check_position(model, _joint("home", "home_joint", spec, name), value)
        qpos[model.joint(name).qposadr[0]] = value
    for i in range(model.nu):
        name = model.actuator(i).name
        if name in fingers:
            ctrl[i] = fingers[name][1]
        elif model.actuator_trntype[i] in JOINT_TRN:
            ctrl[i] = qpos[model.joint(int(model.actuator_trnid[i, 0])).qposadr[0]]
    spec.add_key(name=HOME, qpos=qpos, ctrl=ctrl)


def servo(spec: mujoco.MjSpec, joint: str, inertia: float, frequency: float, force: float) -> None:
    """Adds a critically damped position servo to a joint, named after it.

    Args:
        spec: spec of the robot.
        joint: name of the joint.
        inertia: inertia that it moves, [kg m^2] or [kg].
        frequency: frequency with which it would swing undamped [Hz].
        force: largest force, [N m] or [N].

    Raises:
        ValueError, TypeError: there is no hinge or slide of that name, or an actuator of that name already; a number is not > 0.
    """
    check_type("spec", spec, mujoco.MjSpec, "a mujoco.MjSpec")
    moved = _joint("joint", "servo_joint", spec, joint)
    if spec.actuator(joint) is not None:
        raise error([problem("joint", "servo_taken", None, joint)])
    for name, value in (("inertia", inertia), ("frequency", frequency), ("force", force)):
        if not (is_number(value) and 0 < value < np.inf):
            raise error([problem(name, "must", None, value, must="a number > 0")])
    actuator = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    omega = 2 * np.pi * frequency
    actuator.set_to_position(kp=inertia * omega**2, kv=2 * inertia * omega)
    in_degrees = moved.type == mujoco.mjtJoint.mjJNT_HINGE and moved.compiler.degree
    actuator.ctrlrange = (
        np.deg2rad(moved.range) if in_degrees else moved.range
    )  # the compiler converts that of joints alone
    actuator.forcerange = (-force, force)
    actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
    limited = moved.limited != mujoco.mjtLimited.mjLIMITED_FALSE and moved.range[0] < moved.range[1]
    actuator.ctrllimited = mujoco.mjtLimited.mjLIMITED_TRUE if limited else mujoco.mjtLimited.mjLIMITED_FALSE


def _joint(path: str, rule: str, spec: mujoco.MjSpec, name: object) -> mujoco.MjsJoint:
    """The hinge or slide of a name, where `rule` refuses others."""
    joints = {joint.name: joint for joint in spec.joints}
    if name not in joints:
        raise error([problem(path, "no_joint", None, name, nearest=patterns.near(str(name), [*joints]))])
    if joints[name].type not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
        raise error([problem(path, rule, None, name)])
    return joints[name]


def _check_position(model: mujoco.MjModel, joint: mujoco.MjsJoint, value: object) -> None:
    """Refuses a position that is no number, or that a joint cannot have."""
    path, (low, high) = f"home[{joint.name!r}]", model.joint(joint.name).range
    raise_all(vector_problems(path, value, 0, ""), "`home`")
    outside = not low - keyframes.LEAST <= value <= high + keyframes.LEAST  # type: ignore[operator]
    if outside and model.jnt_limited[model.joint(joint.name).id]:
        raise error([problem(path, "must", None, value, must=f"within the joint's range, {low:.4g} to {high:.4g}")])
