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
          <joint name="z" type="slide" axis="0 0 1" range="-0.75 0.25" damping="1"/>
          <geom type="box" size="0.012 0.012 0.2" pos="0 0 {shaft}" mass="0.1" contype="0" conaffinity="0" rgba="0.3 0.3 0.3 1"/>
          {hand}
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <velocity name="x" joint="x" kv="10" ctrlrange="-{speed} {speed}"/>
    <velocity name="y" joint="y" kv="10" ctrlrange="-{speed} {speed}"/>
    <velocity name="z" joint="z" kv="10" ctrlrange="-{speed} {speed}"/>
    {motors}
  </actuator>
</mujoco>
"""

_TIP = '<geom name="tip" type="sphere" size="{radius}" mass="0.2" friction="0.8 0.005 0.0001" rgba="0.84 0.37 0 1"/>'

_FINGER = """
          <body name="{name}" pos="0 {side}{open} 0" gravcomp="1">
            <joint name="{name}" type="slide" axis="0 {side}1 0" range="-{open} 0" damping="2"/>
            <geom name="{name}" type="box" size="0.015 0.006 0.03" mass="0.05" friction="1.5 0.01 0.0001" rgba="0.84 0.37 0 1"/>
          </body>"""

TIP_HEIGHT = 1.2  # [m] of the tip at zero
TIP_RADIUS = 0.025  # [m]
SPEED = 0.6  # [m/s]
OPEN = 0.055  # [m] from the middle to each open finger


def pusher(reach: float = 1.0) -> mujoco.MjSpec:
    """A sphere on three slides x, y and z: 3 velocity actuators [m/s]; `reach` [m] along x and y to each side."""
    xml = _GANTRY.format(reach=reach, speed=SPEED, shaft=0.2, motors="", hand=_TIP.format(radius=TIP_RADIUS))
    return mujoco.MjSpec.from_string(xml)


def gripper(reach: float = 1.0) -> mujoco.MjSpec:
    """Two fingers on three slides: 3 velocity actuators [m/s], and a position for each finger [m], 0 open, -0.055 closed."""
    fingers = "".join(_FINGER.format(name=name, side=side, open=OPEN) for name, side in (("left", ""), ("right", "-")))
    motors = "".join(
        f'<position name="{name}" joint="{name}" kp="120" ctrlrange="-{OPEN} 0" forcerange="-8 8"/>'
        for name in ("left", "right")
    )
    xml = _GANTRY.format(reach=reach, speed=SPEED, shaft=0.25, motors=motors, hand=fingers)
    return mujoco.MjSpec.from_string(xml)
