"""Arms for tasks: with position servos, a tool between their fingers, and a pose in which they begin (host)."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas import robots
from mjx_arenas.arena import Arena
from mjx_arenas.envs import chain, opening, servos
from mjx_arenas.envs.arm_report import ArmReport
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.robots.simplify import FAST, simplify
from mjx_arenas.rules.validation import check_type
from mjx_arenas.spec import patterns, specs
from mjx_arenas.terms.attributes.joints import JOINT_TRN

HOME = "home"  # name of the keyframe in which an arm begins
NEAR, STRAIGHT = 0.005, 0.05  # [m], [rad] by which a tool may miss a place that it reaches
HEADINGS, HEIGHTS = (-0.9, 0.9), (0.02, 0.25)  # [rad], [m] above what carries an arm, of the places that tasks need
SPACING = 0.02  # [m] of the distances of `check`


@dataclasses.dataclass(frozen=True)
class Arm:
    """A robot whose hinges or slides move a gripper.

    Args:
        spec: its MJCF. It has a keyframe "home", in which the robot begins, and one position servo (gear 1) of each joint between base and
            tool.
        base: name of the body that does not move.
        tool: name of a site between the fingertips, whose z axis points away from the hand.
        fingers: controls of the gripper's actuators by name: (closed, open). Each moves a joint, or a fixed tendon, as that of a Robotiq
            2F-85 does. {}: it has no gripper, and can only reach.
        width: width of the largest object that it can grip [m], the smaller of two seen from above. `invalid_arena` reports wider ones. It
            is at most the gap between the open fingers.
        reach: (least, most) horizontal distance from the base at which the tool, pointing down, reaches all heights that the tasks need
            [m].
        rise: height of its base above what carries it, on a post that comes with it [m].
    """

    spec: mujoco.MjSpec
    base: str
    tool: str
    fingers: Mapping[str, tuple[float, float]]
    width: float
    reach: tuple[float, float] = (0.22, 0.44)
    rise: float = 0.0


def ready(spec: mujoco.MjSpec, home: Mapping[str, float], fingers: Mapping[str, tuple[float, float]]) -> None:
    """Adds the keyframe "home" to a spec. Joints are given by name; others stay at `qpos0`. Servos hold them, and the gripper is open.

    Raises:
        ValueError: there is a keyframe "home", or no joint of a name.
    """
    model = specs.compiled(spec, "spec")
    if HOME in [key.name for key in spec.keys]:
        raise ValueError(
            f"`spec` must have no keyframe {HOME!r} yet: use that, or take it out, spec.delete(spec.key({HOME!r}))."
        )
    joints = [joint.name for joint in spec.joints]
    if wrong := [name for name in home if name not in joints]:
        raise error([problem("home", "no_joint", None, wrong[0], nearest=patterns.near(str(wrong[0]), joints))])
    qpos, ctrl = np.array(model.qpos0), np.zeros(model.nu)
    for name, value in home.items():
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
    """
    actuator, omega = (
        spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT),
        2 * np.pi * frequency,
    )
    actuator.set_to_position(kp=inertia * omega**2, kv=2 * inertia * omega)
    actuator.ctrlrange, actuator.forcerange = spec.joint(joint).range, (-force, force)
    actuator.ctrllimited = actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE


_SMALL = """
<mujoco model="small_arm">
  <compiler autolimits="true" angle="radian"/>
  <default>
    <geom type="capsule" rgba="0.85 0.85 0.85 1"/>
    <joint damping="0.1" armature="0.01"/>
    <default class="finger">
      <joint type="slide" range="-{stroke} 0" damping="4" armature="0"/>
      <geom type="box" size="0.012 {half} 0.025" mass="0.05" friction="1.5 0.01 0.0001" rgba="0.84 0.37 0 1"/>
    </default>
  </default>
  <worldbody>
    <body name="base" gravcomp="1">
      <geom type="cylinder" size="0.06 0.03" pos="0 0 0.03" mass="2" contype="0" conaffinity="0"/>
      <body name="turret" pos="0 0 0.06" gravcomp="1">
        <joint name="turret" axis="0 0 1" range="-2.8 2.8"/>
        <geom size="0.04 0.03" pos="0 0 0.03" mass="0.5" contype="0" conaffinity="0"/>
        <body name="upper" pos="0 0 0.08" gravcomp="1">
          <joint name="shoulder" axis="0 1 0" range="-1.6 1.9"/>
          <geom name="upper" fromto="0 0 0 0 0 0.32" size="0.035" mass="1"/>
          <body name="fore" pos="0 0 0.32" gravcomp="1">
            <joint name="elbow" axis="0 1 0" range="-1.4 1.4"/>
            <geom name="fore" fromto="0 0 0 0.32 0 0" size="0.03" mass="0.7"/>
            <body name="wrist" pos="0.32 0 0" gravcomp="1">
              <joint name="wrist" axis="0 1 0" range="-1.9 1.9"/>
              <geom name="wrist" fromto="0 0 0 0 0 -0.04" size="0.025" mass="0.2"/>
              <body name="hand" pos="0 0 -0.06" gravcomp="1">
                <joint name="roll" axis="0 0 -1" range="-3.1 3.1"/>
                <geom name="hand" type="box" size="0.018 {palm} 0.015" pos="0 0 -0.02" mass="0.15"/>
                <site name="tool" pos="0 0 -0.085" euler="3.14159265358979 0 0"/>
                <body name="left" pos="0 {open} -0.065" gravcomp="1">
                  <joint name="left" class="finger" axis="0 1 0"/>
                  <geom name="left" class="finger"/>
                </body>
                <body name="right" pos="0 -{open} -0.065" gravcomp="1">
                  <joint name="right" class="finger" axis="0 -1 0"/>
                  <geom name="right" class="finger"/>
                </body>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <contact><exclude body1="turret" body2="upper"/><exclude body1="upper" body2="fore"/><exclude body1="fore" body2="wrist"/>
    <exclude body1="fore" body2="hand"/><exclude body1="wrist" body2="hand"/><exclude body1="hand" body2="left"/>
    <exclude body1="hand" body2="right"/><exclude body1="left" body2="right"/></contact>
</mujoco>
"""
_STROKE, _HALF = 0.045, 0.006  # [m] of each finger from open to where they meet, half of its thickness


def small() -> Arm:
    """A simple arm of capsules and boxes: five joints, a reach of 0.6 m, and fingers that open 9 cm. It needs no other package.

    It turns, bends at shoulder, elbow and wrist, and rolls its hand. This is enough for anything that is gripped from above.
    """
    place = {"stroke": _STROKE, "half": _HALF, "open": _STROKE + _HALF, "palm": _STROKE + 2 * _HALF}
    spec = mujoco.MjSpec.from_string(_SMALL.format(**place))
    for joint, inertia, force in (("turret", 0.3, 60), ("shoulder", 0.4, 80), ("elbow", 0.15, 50), ("wrist", 0.02, 15)):
        servo(spec, joint, inertia, 4.0, force)
    servo(spec, "roll", 0.012, 4.0, 5)
    fingers = {}
    for finger in ("left", "right"):
        servo(spec, finger, 0.1, 18.0, 60)  # grips a box of 3 cm with 19 N
        fingers[finger] = (-_STROKE, 0.0)
    ready(spec, {"shoulder": 0.1, "elbow": 0.2, "wrist": -0.3}, fingers)
    return Arm(spec, "base", "tool", fingers, 2 * _STROKE)


_YAM = {  # inertia that a joint moves with the arm stretched out [kg m^2], largest torque [N m] of mjlab's yam_constants.py
    "joint1": (0.45, 28.0),
    "joint2": (0.45, 28.0),
    "joint3": (0.25, 28.0),
    "joint4": (0.0302, 10.0),
    "joint5": (0.0091, 10.0),
    "joint6": (0.0029, 10.0),
}
_YAM_ARMATURE = {
    "joint1": 0.032,
    "joint2": 0.032,
    "joint3": 0.032,
    "joint4": 0.0018,
    "joint5": 0.0018,
    "joint6": 0.0018,
}


_YAM_HOME = {
    "joint2": 1.763,
    "joint3": 1.204,
    "joint4": -1.012,
}  # the tool points down, 28 cm before the base, 5 cm above
_POST = 0.2  # [m]


def yam() -> Arm:
    """I2RT's YAM from the package mjlab, simplified: six joints and two fingers that open 7 cm. See `mja.robots`.

    Gravity on its links is compensated (`gravcomp`), as by the robot's own controller. Servos have a frequency of 4 Hz (mjlab: 2). It
    stands on a post of 20 cm, because the hand turns down by at most 90 degrees. On the post, pointing down, it reaches from 40 cm below
    its base to 10 cm above it.

    Raises:
        ModuleNotFoundError: mjlab is not installed; the message says how to do it.
    """
    spec, _ = simplify(robots.load("yam"), keep="(l|r)f_down[45]_collision", self_collisions=False, visual=False)
    for joint, (inertia, force) in _YAM.items():
        spec.joint(joint).armature = _YAM_ARMATURE[joint]
        servo(spec, joint, inertia, 4.0, force)
    servo(spec, "left_finger", 0.5, 10.0, 80)
    low, high = spec.joint("left_finger").range
    fingers = {"left_finger": (float(low), float(high))}
    _on_a_post(spec, "arm", 0.05)
    ready(spec, {**_YAM_HOME, "left_finger": high, "right_finger": -high}, fingers)
    return Arm(spec, "arm", "grasp_site", fingers, 0.07, (0.2, 0.42), _POST)


def _on_a_post(spec: mujoco.MjSpec, base: str, radius: float) -> None:
    """Compensates gravity on an arm, and adds a post under its base, which is drawn only."""
    for body in spec.bodies[1:]:
        body.gravcomp = 1
    post = spec.body(base).add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER, fromto=(0, 0, -_POST, 0, 0, 0), size=(radius, 0, 0)
    )
    post.contype = post.conaffinity = 0


_PANDA = {  # inertia that a joint moves with the arm stretched out or bent at the elbow [kg m^2], largest torque of the package [N m]
    "joint1": (3.7, 87.0),
    "joint2": (3.7, 87.0),
    "joint3": (1.2, 87.0),
    "joint4": (1.2, 87.0),
    "joint5": (0.25, 12.0),
    "joint6": (0.25, 12.0),
    "joint7": (0.11, 12.0),
}
_PANDA_HOME = {
    "joint2": -0.3,
    "joint4": -2.5,
    "joint6": 2.2,
    "joint7": 0.785,
}  # the tool points down, 43 cm before the base, 24 cm above
_LINKAGE = "(left|right)_(driver|coupler|spring_link|follower)"  # bars of the gripper, which hold nothing


def panda() -> Arm:
    """Franka's Panda with a Robotiq 2F-85 from the package gym_hil, simplified: seven joints, and fingers that open 8.5 cm.

    See `mja.robots`. Position servos of 4 Hz take the place of its motors, with their torques. Gravity is compensated (`gravcomp`), as by
    the robot's own controller. One servo closes both fingers, which the gripper's linkage moves alike. The fingers stay parallel: the
    hinges with which they curl around large objects are left out. The pads have no `priority`, so the friction of what they hold may count.
    It stands on a post of 20 cm, from which it reaches drawers, too.

    Raises:
        ModuleNotFoundError: gym_hil is not installed; the message says how to do it.
    """
    shapes, pads = {_LINKAGE: "none", "link0": "hull", ".*": "primitive"}, "(left|right)_pad.*"
    # The light wrist shakes under servos that Euler's method integrates, and small objects creep out of pads with an `impratio` of 1.
    options = {**FAST, "integrator": mujoco.mjtIntegrator.mjINT_IMPLICITFAST, "impratio": 10.0}
    spec, _ = simplify(
        robots.load("panda"), shapes, pads, self_collisions=False, visual=False, actuators=(), options=options
    )
    for sensor in list(spec.sensors):  # which nothing here reads
        spec.delete(sensor)
    for geom in spec.geoms:
        geom.priority = 0
    for side in ("left", "right"):  # with these hinges fingers curl around what they hold, and press small boxes out
        spec.delete(spec.joint(f"{side}_coupler_joint"))
    for joint, (inertia, force) in _PANDA.items():
        servo(spec, joint, inertia, 4.0, force)
    driver = "right_driver_joint"
    servo(spec, driver, 0.01, 6.0, 5)
    fingers = {driver: (float(spec.joint(driver).range[1]), 0.0)}
    spec.site("pinch").parent.add_site(name="tool", pos=(0, 0, 0.155))  # closed fingers reach 7 mm below it
    _on_a_post(spec, "link0", 0.08)
    ready(spec, _PANDA_HOME, fingers)
    return Arm(spec, "link0", "tool", fingers, 0.085, (0.3, 0.6), _POST)


ARMS: Mapping[str, Callable[[], Arm]] = {"small": small, "yam": yam, "panda": panda}
"""The library's arms, by the names that configurations of trainings use."""


def check_config(config: Any) -> None:
    """Refuses an arm or an arena in the place of a task's configuration, and says where it goes."""
    if not isinstance(config, (str, Arm, Arena)):
        return
    goes, got = "`arm=`" if isinstance(config, Arm) else "`arena=`", type(config).__name__
    if isinstance(config, str):
        got = repr(config)
        goes = (
            f"`arm=envs.arms.{config}()`"
            if config in ARMS
            else "`arm=`, made by `envs.arms`, or `arena=`, by `mjx_arenas.load`"
        )
    raise TypeError(f"`config` must be a ConfigDict, as from `default_config()`, got {got}: give it as {goes}.")


def checked(arm: Arm) -> chain.Chain:
    """The joints of an arm, from its base to its tool.

    Raises:
        ValueError, TypeError: it is none, or one that tasks refuse.
    """
    check_type("arm", arm, Arm, "an envs.arms.Arm, such as envs.arms.small()")
    found = servos.checked(arm)
    if arm.fingers:
        home = HOME if HOME in (key.name for key in arm.spec.keys) else None
        opening.check(specs.compiled(arm.spec, "arm.spec"), home, arm.tool, arm.fingers, arm.width)
    return found


def check_keyframe(arm: Arm, keyframe: Any) -> None:
    """Refuses what is not the name of a keyframe of an arm."""
    keys = [key.name for key in arm.spec.keys]
    if keyframe not in keys:
        has = ", ".join(map(repr, keys)) or f"which has none: envs.arms.ready adds {HOME!r}"
        raise error(
            [problem("config.keyframe", "must", None, keyframe, must=f"the name of a keyframe of `arm.spec`, {has}")]
        )


def check(arm: Arm) -> ArmReport:
    """What an arm can do, before a task is made with it: inverse kinematics go to places like those that tasks need.

    The places are up to 0.9 rad to either side of the base's x axis and 2 to 25 cm above what carries the arm. The tool is along and across
    the direction from the base. They are from half of the least distance of the arm's `reach` to one and a half times the most. Contacts
    and forces do not count. `print(check(arm))` says all in five lines.

    Raises:
        ValueError, TypeError: the arm is one that tasks refuse, or has no keyframe "home".
    """
    links = checked(arm)
    if HOME not in (key.name for key in arm.spec.keys):
        raise error(
            [problem("arm.spec", "must", None, None, must=f"a spec with a keyframe {HOME!r}: envs.arms.ready adds it")]
        )
    (near, far), (low, high) = arm.reach, HEIGHTS
    distances = np.union1d(np.arange(near / 2, 1.5 * far, SPACING), arm.reach)
    places = np.meshgrid(distances, np.linspace(*HEADINGS, 7), np.linspace(low, high, 5), (0, np.pi / 2), indexing="ij")
    distance, heading, height, turn = (x.ravel() for x in places)
    pos = np.stack([distance * np.cos(heading), distance * np.sin(heading), height - arm.rise], axis=-1)
    joints = moves(arm, links, HOME)
    away, _ = misses = joints.misses(pos, heading + turn)
    found, asked = reached(misses), (near <= distance) & (distance <= far)
    down = np.clip(-float(chain.tool(links, jnp.array(joints.start)).mat[2, 2]), -1, 1)
    return ArmReport(
        float(found[asked].mean()),
        float(away[asked].max()),
        (near, far),
        _longest(distances, np.asarray(found.reshape(len(distances), -1).all(1))),
        HEIGHTS,
        float(np.arccos(down)),
        arm.width,
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


def _longest(distances: np.ndarray, good: np.ndarray) -> tuple[float, float] | None:
    """First and last of the most distances in a row that are good."""
    runs = np.split(np.arange(len(good)), np.flatnonzero(np.diff(good)) + 1)
    best = max((run for run in runs if good[run[0]]), key=len, default=None)
    return None if best is None else (float(distances[best[0]]), float(distances[best[-1]]))
