"""The arms that come along: a small one of our own, and two of other packages (host)."""

from collections.abc import Callable, Mapping
from typing import Any

import mujoco

from mjx_arenas import robots
from mjx_arenas.arena import Arena
from mjx_arenas.envs.arms.arm import Arm, ready, servo
from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error
from mjx_arenas.robots.simplify import simplify

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
    shapes = {"(l|r)f_(down([6-9]|1[01])|rot2)_collision": "none"}  # knuckles, and bumps of 0.6 mm
    spec, _ = simplify(
        robots.load("yam"), shapes, keep="(l|r)f_down[45]_collision", self_collisions=False, visual=False, options={}
    )
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
    hinges with which they curl around large objects are left out. Its bars have the armature of ogbench's 2F-85,
    which the package's lacks. The pads have no `priority`, so the friction of what they hold may count.
    It stands on a post of 20 cm, from which it reaches drawers, too.

    Raises:
        ModuleNotFoundError: gym_hil is not installed; the message says how to do it.
    """
    shapes, pads = {_LINKAGE: "none", "link0": "hull", ".*": "primitive"}, "(left|right)_pad.*"
    # The light wrist shakes under servos that Euler's method integrates, and small objects creep out of pads with an `impratio` of 1.
    options = {"integrator": mujoco.mjtIntegrator.mjINT_IMPLICITFAST, "impratio": 10.0}
    spec, _ = simplify(
        robots.load("panda"), shapes, pads, self_collisions=False, visual=False, actuators=(), options=options
    )
    for sensor in list(spec.sensors):  # which nothing here reads
        spec.delete(sensor)
    for geom in spec.geoms:
        geom.priority = 0
    for side in ("left", "right"):  # with these hinges fingers curl around what they hold, and press small boxes out
        spec.delete(spec.joint(f"{side}_coupler_joint"))
        for bar in ("spring_link", "follower"):  # as in ogbench's 2F-85; without it, pads of 3.5 g give way
            spec.joint(f"{side}_{bar}_joint").armature = 0.001
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
    raise error([problem("config", "config_type", None, Told(got), goes=goes)], kind=TypeError)
