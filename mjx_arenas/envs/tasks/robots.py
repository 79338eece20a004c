"""Robots of our own, made of boxes and spheres: quick to simulate, and they reach over tables of any height."""

import mujoco

# Slides along x, y and z; at zero the tip is 1.2 m above the middle of the arena's floor.
_GANTRY = """
<mujoco model="gantry">
  <compiler autolimits="true"/>
  <worldbody>
    <body name="x" gravcomp="1">
      <joint name="x" type="slide" axis="1 0 0" range="-{reach} {reach}" damping="1"/>
      <geom type="box" size="0.02 0.02 0.02" mass="0.1" contype="0" conaffinity="0" pos="0 0 1.6" rgba="0.3 0.3 0.3 1"/>
      <body name="y" gravcomp="1">
        <joint name="y" type="slide" axis="0 1 0" range="-{reach} {reach}" damping="1"/>
        <geom type="box" size="0.02 0.02 0.02" mass="0.1" contype="0" conaffinity="0" pos="0 0 1.6" rgba="0.3 0.3 0.3 1"/>
        <body name="z" gravcomp="1" pos="0 0 1.2">
          <joint name="z" type="slide" axis="0 0 1" range="{low} {high}" damping="1"/>
          <geom type="box" size="0.012 0.012 0.2" pos="0 0 {shaft}" mass="0.1" contype="0" conaffinity="0" rgba="0.3 0.3 0.3 1"/>
          {hand}
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <velocity name="x" joint="x" kv="{kv}" ctrlrange="-{speed} {speed}"/>
    <velocity name="y" joint="y" kv="{kv}" ctrlrange="-{speed} {speed}"/>
    <velocity name="z" joint="z" kv="{kv}" ctrlrange="-{speed} {speed}"/>
    {motors}
  </actuator>
  <contact>{excluded}</contact>
</mujoco>
"""

_TIP = '<geom name="tip" type="sphere" size="{radius}" mass="0.2" friction="0.8 0.005 0.0001" rgba="0.84 0.37 0 1"/>'

# Turns under the slides, as its yaw; the fingers reach 1 cm below the tip, their palm is drawn only.
_HAND = """<body name="hand" gravcomp="1">
            <joint name="yaw" type="hinge" axis="0 0 1" damping="0.05" armature="0.01"/>
            <geom type="box" size="0.015 {palm} 0.008" pos="0 0 0.058" mass="0.2" contype="0" conaffinity="0" rgba="0.3 0.3 0.3 1"/>
            {fingers}
          </body>"""

_FINGER = """
            <body name="{name}" pos="0 {side}{open} 0.02" gravcomp="1">
              <joint name="{name}" type="slide" axis="0 {side}1 0" range="-{stroke} 0" damping="4"/>
              <geom name="{name}" type="box" size="0.015 {half} 0.03" mass="0.05" friction="1.5 0.01 0.0001" rgba="0.84 0.37 0 1"/>
            </body>"""

_GRIP = """
    <velocity name="yaw" joint="yaw" kv="0.5" ctrlrange="-{turn} {turn}"/>
    <position name="left" joint="left" kp="120" ctrlrange="-{stroke} 0"/>
    <position name="right" joint="right" kp="120" ctrlrange="-{stroke} 0"/>
"""

TIP_HEIGHT = 1.2  # [m] of the tip at zero
_DOWN, _UP = -0.75, 0.25  # [m] from there
TIP_HEIGHTS = (TIP_HEIGHT + _DOWN, TIP_HEIGHT + _UP)
"""The least and the most [m]."""
TIP_RADIUS = 0.025  # [m]
SPEED = 0.6  # [m/s]
TURN = 2.0  # [rad/s]
STROKE = 0.049  # [m] of each finger from open to where they meet
_FINGER_HALF = 0.006  # [m] of its thickness


def pusher() -> mujoco.MjSpec:
    """A sphere on three slides x, y and z, 1 m along x and y to each side: 3 velocity actuators [m/s]."""
    return _gantry(1.0, kv=10, shaft=0.2, hand=_TIP.format(radius=TIP_RADIUS))


def gripper(reach: float = 1.0) -> mujoco.MjSpec:
    """Two fingers on three slides and a yaw hinge; the tip is the point between them.

    Six actuators: velocities along x, y and z [m/s] and of the yaw [rad/s], and a position of each finger [m], from 0, open, to
    -0.049, where they meet.
    """
    place = {"open": STROKE + _FINGER_HALF, "half": _FINGER_HALF, "stroke": STROKE}
    fingers = "".join(_FINGER.format(name=name, side=side, **place) for name, side in (("left", ""), ("right", "-")))
    hand = _HAND.format(fingers=fingers, palm=STROKE + 2 * _FINGER_HALF)
    motors = _GRIP.format(turn=TURN, stroke=STROKE)
    pairs = ("left", "right"), ("left", "world"), ("right", "world")  # they cannot reach the floor
    excluded = "".join(f'<exclude body1="{one}" body2="{other}"/>' for one, other in pairs)
    # Stiffer than the pusher, as it sinks by weight / kv while it holds something.
    return _gantry(reach, kv=40, shaft=0.26, hand=hand, motors=motors, excluded=excluded)


def _gantry(reach: float, kv: float, shaft: float, hand: str, motors: str = "", excluded: str = "") -> mujoco.MjSpec:
    place = {"reach": reach, "low": _DOWN, "high": _UP, "shaft": shaft}
    xml = _GANTRY.format(**place, speed=SPEED, kv=kv, hand=hand, motors=motors, excluded=excluded)
    return mujoco.MjSpec.from_string(xml)
