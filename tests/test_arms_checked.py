"""What `arms.check` says of fingers, of the MJCF and of keyframes, before a task is made with an arm."""

import dataclasses
import inspect
import re
import warnings

import mujoco
import numpy as np
import pages
import pytest

pytest.importorskip("mujoco_playground")

import mjx_arenas as mja
from mjx_arenas import envs
from mjx_arenas.envs import arms
from mjx_arenas.envs.arms import moves, opening, servos
from mjx_arenas.envs.tasks import lift
from mjx_arenas.envs.tasks.manipulation import Given
from mjx_arenas.spec import names


def turned(degrees):
    """The small arm, whose tool is turned about its z axis."""
    arm = arms.small()
    arm.spec.site("tool").alt.euler = (np.pi, 0, np.radians(degrees))  # it points down, about its x axis
    return arm


def without_ends(**fingers):
    """The small arm, with other controls of its fingers, no `ctrlrange` of theirs, and less force, which their joints' limits hold."""
    arm = arms.small()
    for name in arm.fingers:
        servo = arm.spec.actuator(name)
        servo.ctrllimited, servo.forcerange = False, (-2, 2)
    return dataclasses.replace(arm, fingers={**arm.fingers, **fingers})


@pytest.mark.slow
def test_a_path_or_text(tmp_path, monkeypatch):
    """As `attach` and `simplify` take them; a wrong one is answered when the arm is made."""
    small = arms.small()
    text = small.spec.to_xml()
    (tmp_path / "small.xml").write_text(text)
    monkeypatch.chdir(tmp_path)
    for given in ("small.xml", tmp_path / "small.xml", text):
        made = dataclasses.replace(small, spec=given)
        assert isinstance(made.spec, mujoco.MjSpec)
        assert arms.check(made).ok
    assert dataclasses.replace(small, rise=0.1).spec is small.spec
    wrong = {
        "smal.xml": (FileNotFoundError, "`spec`: there is no file 'smal.xml', but 'small.xml'."),
        "<robot/>": (ValueError, "`spec`: the text is not MJCF, as its root is not <mujoco>."),
        5: (TypeError, "`spec` must be a path, MJCF text or a mujoco.MjSpec, got 5."),
    }
    for given, (kind, says) in wrong.items():
        with pytest.raises(kind, match=f"^{re.escape(says)}$"):
            arms.Arm(given, "base", "tool", small.fingers, 0.09)
    with pytest.raises(TypeError, match=r"^`spec` must be one mujoco\.MjSpec, got a tuple that begins with one: "):
        arms.Arm(mja.simplify(small.spec), "base", "tool", small.fingers, 0.09)


def shaky(armature=0.0, force=1000.0, integrator=mujoco.mjtIntegrator.mjINT_EULER):
    """The small arm, with a stiff servo that is to turn its light hand without overshooting."""
    arm = arms.small()
    servo, arm.spec.joint("roll").armature = arm.spec.actuator("roll"), armature
    servo.gainprm[0], servo.biasprm[1], servo.biasprm[2] = 300, -300, 1  # `kp` 300, `dampratio` 1
    servo.forcerange, arm.spec.option.integrator = (-force, force), integrator
    return arm


@pytest.mark.slow
@pytest.mark.parametrize("force", [1000.0, 1e6])
def test_an_arm_that_shakes_apart(force):
    """Within bounds, or until MuJoCo would begin anew: what moves is told, in the warning and the report."""
    with pytest.warns(UserWarning, match="does not stay") as told:
        report = arms.check(shaky(force=force))
    says = r"`arm.spec` does not stay in its keyframe 'home': within a second (joint 'roll' moves at (\d+) rad/s)\. A servo shakes a "
    (what,) = [re.match(says, str(one.message)) for one in told]
    assert int(what[2]) > moves.STRAIGHT / moves.ACTION
    assert not report.ok
    assert dataclasses.replace(report, restless="").ok
    assert (report.restless, report.opening) == (what[1], None)
    widest = "widest object: not measured, as the arm does not stay"
    assert str(report).splitlines()[-2:] == [widest, f"rest: within a second of the keyframe {what[1]}"]


@pytest.mark.slow
def test_what_brings_an_arm_to_rest():
    """What the warning advises; warnings are errors here."""
    assert lift.default_config().ctrl_dt == moves.ACTION
    implicit = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for arm in (shaky(armature=0.01), shaky(integrator=implicit)):
        report = arms.check(arm)
        assert report.ok
        assert len(str(report).splitlines()) == 5


@pytest.mark.parametrize("degrees", [90, -60, 30, 5])
def test_the_line_along_which_fingers_open(degrees):
    """A tool that is not turned as it should be is told, and how to turn it; a few degrees are none."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        moves.checked(turned(degrees))
    turn = 90 if degrees == 90 else -degrees
    says = f"`arm.tool`: the fingers open along a line that is {abs(turn)} degrees from the y axis of site 'tool'. They should open "
    says += f"along that axis: turn the site by {turn} degrees about its z axis."
    told = [str(one.message) for one in caught]
    assert told in ([says], [says.replace("by 90", "by -90")]) if abs(degrees) > 10 else not told


def test_three_fingers_open_along_no_line():
    """Nor do those that stay where they are."""
    finger = '<body pos="{x} {y} 0"><joint name="f{i}" type="slide" axis="{x} {y} 0"/><geom size=".01"/></body>'
    around = [
        np.round(0.05 * np.array([np.cos(a), np.sin(a)]), 6) for a in (0.3, 0.3 + 2 * np.pi / 3, 0.3 + 4 * np.pi / 3)
    ]
    bodies = "".join(finger.format(x=x, y=y, i=i) for i, (x, y) in enumerate(around))
    model = mujoco.MjModel.from_xml_string(f'<mujoco><worldbody><site name="tool"/>{bodies}</worldbody></mujoco>')
    closed, opened = mujoco.MjData(model), mujoco.MjData(model)
    opened.qpos[:] = 0.03
    for data in (closed, opened):
        mujoco.mj_kinematics(model, data)
    assert opening.aside(model, closed, opened, "tool") is None
    assert opening.aside(model, closed, closed, "tool") is None
    opened.qpos[1:] = 0
    mujoco.mj_kinematics(model, opened)
    np.testing.assert_allclose(opening.aside(model, closed, opened, "tool"), np.degrees(0.3) - 90, atol=0.01)


@pytest.mark.slow
def test_width_and_gap():
    """The report has both; what an object may be wider than the gap is said."""
    arm = arms.small()
    narrow = dataclasses.replace(arm, fingers={"left": (-0.045, -0.005), "right": (-0.045, -0.005)})
    report = arms.check(dataclasses.replace(narrow, width=0.06))
    np.testing.assert_allclose(report.opening, 0.08, atol=1e-4)
    assert str(report).splitlines()[-1] == "widest object: 6.0 cm by `width`; the open fingers are 8.0 cm apart"
    arms.check(dataclasses.replace(narrow, width=0.0815))
    says = "`arm.width` must be at most 0.082 m, got 0.085: the open fingers are 0.08 m apart, and may give way by 0.002 m."
    with pytest.raises(ValueError, match=f"^{re.escape(says)}$"):
        arms.check(dataclasses.replace(narrow, width=0.085))
    bare = arms.check(dataclasses.replace(arm, fingers={}))
    assert (bare.opening, str(bare).splitlines()[-1]) == (None, "widest object: none, as there are no `fingers`")
    far = dataclasses.replace(report, opening=np.inf)
    assert str(far).endswith("the open fingers are further than can be seen apart")


def test_controls_far_beyond():
    """Another unit, or a slip, is told; a little beyond contact is meant."""
    moves.checked(without_ends(left=(-0.06, 0.01), right=(-0.06, 0.01)))
    says = "`arm.fingers['left']` sends 'left' to -0.3, far beyond its range, -0.045 to 0. A target slightly beyond contact is enough for "
    with pytest.warns(UserWarning, match=f"^{re.escape(says)}the force of the grip\\.$") as told:
        moves.checked(without_ends(left=(-0.3, 0.0)))
    assert len(told) == 1
    other = without_ends(left=(-0.3, 0.0))
    other.spec.joint("left").limited = False
    servos.checked(other)  # it has no range
    tendon = other.spec.add_tendon(name="pull", limited=True, range=(-0.045, 0))
    tendon.wrap_joint("left", 1)
    other.spec.actuator("left").trntype, other.spec.actuator("left").target = mujoco.mjtTrn.mjTRN_TENDON, "pull"
    with pytest.warns(UserWarning, match="^`arm.fingers\\['left'\\]` sends 'pull' to -0.3, far"):
        servos.checked(other)


@pytest.mark.parametrize(("field", "value"), [("qpos", np.nan), ("ctrl", np.inf), ("qvel", np.nan)])
def test_keyframes_that_are_not_finite(field, value):
    arm = arms.small()
    key = arm.spec.key("home")
    numbers = np.zeros(7) if field == "qvel" else np.array(getattr(key, field))
    numbers[2] = value
    setattr(key, field, numbers)
    says = f"`arm.spec` must have finite numbers in keyframe 'home', got {value} in its `{field}`."
    with pytest.raises(ValueError, match=f"^{re.escape(says)}$"):
        moves.checked(arm)


def test_names_of_an_arm_that_is_to_come():
    """Those that are unknown, unless some that are known begin so."""
    assert names.of_task("arm_kp", ["cam_pos"])
    assert not names.of_task("arm_kp", ["arm_kv"])
    assert not names.of_task("kp", ["cam_pos"])


def test_the_table_of_arguments():
    """That of docs/arms.md has those of all tasks of arms, and no others."""
    table = next(one for one in pages.tables("docs/arms.md") if one.startswith("| argument |"))
    listed = re.findall(r"`(\w+)`", " ".join(line.split("|")[1] for line in table.splitlines()[2:]))
    kinds = (envs.Reach, envs.Lift, envs.PickAndPlace, envs.OpenDrawer)
    own = {name for kind in kinds for name in inspect.signature(kind).parameters} - {"given"}
    assert sorted(listed) == sorted(own | {*Given.__annotations__})
