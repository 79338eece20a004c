"""A robot that is put far from its table is told; one at its edge or a little above it is not."""

import re

import pytest

import mjx_arenas as mja

ROBOT = """<mujoco><worldbody><body name="base"><geom name="foot" type="box" size=".05 .05 .05" pos="0 0 .05"/>
<body name="link" pos="0 0 .3"><joint name="hinge"/><geom name="rod" type="capsule" size=".02 .1"/></body></body></worldbody></mujoco>"""
FAR = {
    "above": ((0, 0, 0.41), "0.4 m"),
    "beside": ((-1.05, 0, 0), "at least 0.6 m"),
    "far above": ((0, 0, 1.8), "at least 0.6 m"),
}
HIGH = ROBOT.replace('<body name="base">', '<body name="base" pos="0 0 1">')
NEAR = {"on it": (0, 0, 0), "at its edge": (-0.6, 0, 0), "raised": (0, 0, 0.25)}


def attached(pos, robot=ROBOT):
    arena = mja.TableArena(table_full_size=(0.8, 0.8, 0.05), table_offset=(0, 0, 0.9))
    arena.attach(robot, "arm_", pos=pos, on=0)


@pytest.mark.parametrize("case", FAR)
def test_far(case):
    pos, gap = FAR[case]
    said = f"`pos` leaves the robot {gap} from table 'table', on which it was put: `pos` is in the frame of the middle of its top."
    with pytest.warns(UserWarning, match=f"^{re.escape(said)}$"):
        attached(pos)


@pytest.mark.parametrize("case", NEAR)
def test_near(case, recwarn):
    attached(NEAR[case])
    assert not recwarn.list


def test_above_by_itself(recwarn):
    """A robot whose MJCF has it above its origin, such as one that hangs from a gantry."""
    attached((0, 0, 0), HIGH)
    assert not recwarn.list
