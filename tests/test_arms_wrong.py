"""Arms and tasks of arms that are made wrongly: each mistake is one sentence, when the task is made."""

import dataclasses
import re
import types

import mujoco
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

import jax
import jax.numpy as jnp
from worlds import elliptic

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.envs import Lift, OpenDrawer, PickAndPlace, Reach, Transfer, arms
from mjx_arenas.envs.arms import graspable, unreached
from mjx_arenas.envs.tasks import goals, robots
from mjx_arenas.sim.data import blank

WARP = {"impl": "warp"}


def with_servo(**values):
    """The small arm, with other numbers of its elbow's servo."""
    arm = arms.small()
    for name, value in values.items():
        setattr(arm.spec.actuator("elbow"), name, value)
    return arm


def arm_with(**values):
    return dataclasses.replace(arms.small(), **values)


def with_fingers(**fingers):
    return arm_with(fingers=fingers)


def edited(edit):
    arm = arms.small()
    edit(arm.spec)
    return arm


def second(spec):
    spec.add_actuator(name="again", target="elbow", trntype=mujoco.mjtTrn.mjTRN_JOINT)


BY = "`arm.spec` must move joint 'elbow' by a position servo alone: "
SERVOS = {
    "motor": (lambda: edited(lambda s: s.actuator("elbow").set_to_motor()), BY + "actuator 'elbow' is a motor."),
    "velocity": (
        lambda: edited(lambda s: s.actuator("elbow").set_to_velocity(kv=10)),
        BY + "actuator 'elbow' is a velocity servo.",
    ),
    "integrated": (
        lambda: edited(lambda s: s.actuator("elbow").set_to_intvelocity(kp=10)),
        BY + "actuator 'elbow' takes velocities.",
    ),
    "gear": (lambda: with_servo(gear=[100, 0, 0, 0, 0, 0]), BY + "actuator 'elbow' has a gear of 100 instead of 1."),
    "ctrlrange": (
        lambda: with_servo(ctrlrange=[-0.05, 0.05]),
        BY + "actuator 'elbow' has a `ctrlrange` of (-0.05, 0.05), less than the joint's range (-1.4, 1.4).",
    ),
    "two": (lambda: edited(second), BY + "it has 'elbow' and 'again'."),
    "beyond": (
        lambda: with_fingers(left=(255, 0), right=(-0.045, 0)),
        "`arm.fingers['left']` must be controls within the actuator's `ctrlrange`, -0.045 to 0, got (255, 0).",
    ),
    "the other way round": (
        lambda: with_fingers(left=(0, -0.045), right=(0, -0.045)),
        "`arm.fingers` must be (closed, open) controls, got others: with the first of each the fingers are 0.09 m apart, with the "
        "second 0 m.",
    ),
    "wide": (
        lambda: arm_with(width=9),
        "`arm.width` must be at most 0.092 m, got 9: the open fingers are 0.09 m apart, and may give way by 0.002 m.",
    ),
    "the same": (
        lambda: with_fingers(left=(0, 0), right=(-0.045, 0)),
        "`arm.fingers['left']` must be two different controls, (closed, open), got (0, 0).",
    ),
    "one number": (
        lambda: with_fingers(left=0.1, right=(-0.045, 0)),
        "`arm.fingers['left']` must be two different controls, (closed, open), got 0.1.",
    ),
    "one of two": (
        lambda: with_fingers(left=(-0.045, 0)),
        "`arm.fingers` must name all actuators behind the last joint before the tool: it lacks 'right'.",
    ),
    "of the arm": (
        lambda: with_fingers(left=(-0.045, 0), right=(-0.045, 0), roll=(0, 1)),
        "`arm.fingers` must name actuators of the gripper, got 'roll', which moves the arm.",
    ),
}


ARENA = "`arena` must be an arena such as mjx_arenas.TableArena()"
AN_ARM = "`arm` must be an envs.arms.Arm, such as envs.arms.small(), got "
CONFIG = "`config` must be a ConfigDict, as from `default_config()`, got "
TASKS = {
    "arm's name": ({"arm": "yam"}, AN_ARM + "str."),
    "arm's maker": ({"arm": arms.small}, AN_ARM + "function."),
    "arm's spec": ({"arm": mujoco.MjSpec()}, AN_ARM + "MjSpec."),
    "arena's name": (
        {"arena": "kitchen"},
        ARENA + ", or the first of the two that mjx_arenas.load(...) gives, got str.",
    ),
    "arena and ranges": (
        {"arena": (mja.TableArena(), mja.ArenaRanges())},
        ARENA + ", or the first of the two that mjx_arenas.load(...) gives, got tuple.",
    ),
    "arm first": ({"config": "panda"}, CONFIG + "'panda': give it as `arm=envs.arms.panda()`."),
    "a made arm first": ({"config": arms.small()}, CONFIG + "Arm: give it as `arm=`."),
    "arena first": ({"config": mja.TableArena()}, CONFIG + "TableArena: give it as `arena=`."),
    "a name first": (
        {"config": "kitchen"},
        CONFIG + "'kitchen': give it as `arm=`, made by `envs.arms`, or `arena=`, by `mjx_arenas.load`.",
    ),
    "a name": ({"robot_strenght": 1.0}, "Reach has no argument 'robot_strenght': did you mean 'robot_strength'?"),
    "a gain without a strength": (
        {"ranges": mja.ArenaRanges(terms={"arm_kp": mja.Uniform(0.5, 1.5, relative="scale")})},
        "`ranges.terms` has 'arm_kp', a quantity of `robot_strength`, which must be > 0 for it, got 0.",
    ),
    "pos": ({"pos": (5, 5)}, "`pos` must be 3 finite numbers [m], got (5, 5)."),
    "reach": (
        {"arm": arm_with(reach=(0.4, 0.3))},
        "`arm.reach` must be 2 numbers >= 0, the first below the second [m], got (0.4, 0.3).",
    ),
    "one reach": ({"arm": arm_with(reach=0.4)}, "`arm.reach` must be 2 finite numbers [m], got 0.4."),
    "width": ({"arm": arm_with(width=-0.1)}, "`arm.width` must be >= 0 [m], got -0.1."),
    "no width": ({"arm": arm_with(width=0)}, "`arm.width` must be > 0 [m], as there are fingers, got 0."),
    "millimetres": (
        {"arm": arm_with(reach=(300, 600))},
        "`arm.reach` must be at most 10 m, got (300, 600): lengths are in metres (300 mm are 0.3).",
    ),
    "beyond its links": (
        {"arm": arm_with(reach=(0.3, 0.93))},
        "`arm.reach` must be at most 0.925 m, which is all that the arm's links span, got (0.3, 0.93).",
    ),
    "above its links": (
        {"arm": arm_with(rise=3.0)},
        "`arm.rise` must be at most 0.925 m, which is all that the arm's links span, got 3.0.",
    ),
    "below what carries it": ({"arm": arm_with(rise=-1)}, "`arm.rise` must be >= 0 [m], got -1."),
    "rise": ({"arm": arm_with(rise=None)}, "`arm.rise` must be a finite number [m], got None."),
    "fingers": (
        {"arm": arm_with(fingers=["left"])},
        "`arm.fingers` must be a dictionary of controls by the names of actuators; {} for none, got list.",
    ),
    "tool": (
        {"arm": arm_with(tool="pinch")},
        "`arm.tool` must be the name of a site of `arm.spec`: no site is called 'pinch'; known are tool.",
    ),
    "a misspelled tool": (
        {"arm": arm_with(tool="tol")},
        "`arm.tool` must be the name of a site of `arm.spec`: no site is called 'tol': did you mean `tool`?",
    ),
    "base": (
        {"arm": arm_with(base="foot")},
        "`arm.base` must be the name of a body of `arm.spec`: no body is called 'foot'; known are base, turret, upper, fore, wrist, "
        "hand, left, right.",
    ),
    "a misspelled base": (
        {"arm": arm_with(base="bas")},
        "`arm.base` must be the name of a body of `arm.spec`: no body is called 'bas': did you mean `base`?",
    ),
    "a misspelled finger": (
        {"arm": arm_with(fingers={"lef": (0.0, -0.02)})},
        "`arm.fingers` must name actuators of the gripper: no actuator is called 'lef': did you mean `left`?",
    ),
    "another finger": (
        {"arm": arm_with(fingers={"gripper": (0.0, -0.02)})},
        "`arm.fingers` must name actuators of the gripper: no actuator is called 'gripper'; known are left, right.",
    ),
    "a base that moves": (
        {"arm": arm_with(base="turret")},
        "`arm.base` must be the name of a body that no joint moves and that is not mocap, got 'turret'.",
    ),
    "a tool without joints": (
        {"arm": arm_with(base="hand")},
        "`tool` must hang on a hinge or slide of body 'hand' or one that hangs on it, got 'tool'.",
    ),
}


@pytest.mark.parametrize("case", TASKS)
def test_wrong_arguments(case):
    """Before anything of an arena is changed."""
    given, says = TASKS[case]
    with pytest.raises((TypeError, ValueError), match=r"^(`|Reach)") as raised:
        Reach(config_overrides=WARP, **given)
    assert str(raised.value) == says


CONFIGS = {
    "scale": (
        {"action_scale": -1.0},
        "`config.action_scale` must be a number > 0 and <= 10, with which a step is 0.25 m, got -1.0.",
    ),
    "no scale": (
        {"action_scale": 0.0},
        "`config.action_scale` must be a number > 0 and <= 10, with which a step is 0.25 m, got 0.0.",
    ),
    "nan": (
        {"action_scale": float("nan")},
        "`config.action_scale` must be a number > 0 and <= 10, with which a step is 0.25 m, got nan.",
    ),
    "length": ({"episode_length": 0}, "`config.episode_length` must be a whole number >= 1, got 0."),
    "late": (
        {"action_delay": (0, 75)},
        "`config.action_delay` must be shorter than an episode, `config.episode_length` 75, got (0, 75).",
    ),
    "late by one number": (
        {"observation_delay": 75},
        "`config.observation_delay` must be shorter than an episode, `config.episode_length` 75, got (75, 75).",
    ),
    "keyframe": (
        {"keyframe": "hom"},
        "`config.keyframe` must be the name of a keyframe of `arm.spec`, 'home', got 'hom'.",
    ),
    "no delay": (
        {"action_delay": None},
        "`config.action_delay` must be least and most steps, two whole numbers from 0 on, the first not above the second, got None.",
    ),
    "no noise": (
        {"observation_noise": None},
        "`config.observation_noise` must be a standard deviation >= 0, got None.",
    ),
    "no step": ({"sim_dt": None}, "`config.sim_dt` must be a finite number [s], got None."),
    "a number for a truth": ({"vision": 1}, "`config_overrides['vision']` must be true or false, got 1."),
    "a text for a truth": ({"vision": "yes"}, "`config_overrides['vision']` must be true or false, got 'yes'."),
    "a list in a text": ({"action_scale": [1]}, "`config_overrides['action_scale']` must be a number, got [1]."),
    "no control": ({"ctrl_dt": None}, "`config.ctrl_dt` must be a finite number [s], got None."),
    "no level": ({"level": None}, "`config.level` must be between 0 and 1, got None."),
    "no name": ({1: 2}, "`config_overrides` must be a dictionary of dotted names and values, got 1."),
    "names alone": (["impl"], "`config_overrides` must be a dictionary of dotted names and values, got list."),
}


@pytest.mark.parametrize("case", CONFIGS)
def test_wrong_configurations(case):
    given, says = CONFIGS[case]
    with pytest.raises((TypeError, ValueError), match=r"^`config") as raised:
        Reach(config_overrides={**WARP, **given} if isinstance(given, dict) else given)
    assert str(raised.value) == says


def test_wide_actions_of_a_late_arm():
    env = Reach(config_overrides={**WARP, "action_delay": 2})
    assert env.flaws.action_delay == (2, 2)
    state = jax.eval_shape(env.reset, jax.random.key(0))
    with pytest.raises(ValueError, match=r"^`action` must have 5 numbers, got 8\."):
        jax.eval_shape(env.step, state, jnp.zeros(8))


def test_cameras_of_policies():
    """That of a task has its name alone, and that on the hand is on a body with a name."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.add_camera("policy", pos=(1, 0, 2), look_at=(0, 0, 0.8))
    says = r"^`arena` must have no camera 'policy': the task adds it where the policy sees pictures\.$"
    with pytest.raises(ValueError, match=says):
        Lift(arena=arena, on=0, config_overrides=WARP | {"vision": True})
    arm = arms.small()
    for pair in list(arm.spec.excludes):  # which name the hand
        arm.spec.delete(pair)
    arm.spec.site(arm.tool).parent.name = ""
    says = r"^`arm\.spec` must name the body of site 'tool': where the policy sees pictures, a camera is on it\.$"
    with pytest.raises(ValueError, match=says):
        Reach(arm=arm, config_overrides=WARP | {"vision": True})


def test_wrong_goals():
    """One name is one goal; without a second table goals are to be named."""
    with pytest.raises(ValueError, match=r"^`goals` must be one or more of 'table', got \['shelf'\]\.$"):
        goals.surface_indices(mja.TableArena(), "shelf")
    with pytest.raises(ValueError, match=r"^`goals` must be one or more of 'table', got 5\.$"):
        goals.surface_indices(mja.TableArena(), 5)
    assert goals.surface_indices(mja.TableArena(), "table").tolist() == [0]
    with pytest.raises(
        ValueError, match=r"^`goals` must be one or more of 'table', got \['tabel'\]: did you mean 'table'\?$"
    ):
        goals.surface_indices(mja.TableArena(), "tabel")
    desk = mja.TableArena()
    desk.add_part(furniture.Bin("tray", inner_size=(0.2, 0.2, 0.02), on="table"))
    says = r"^`goals` must be one or more of 'table', 'tray_bottom', got \['tray'\]: did you mean 'tray_bottom'\?$"
    with pytest.raises(ValueError, match=says):
        goals.surface_indices(desk, "tray")
    says = "`arena` must have drawers to open: arena.add_part(furniture.Drawers('unit', ...))."
    with pytest.raises(ValueError, match=f"^{re.escape(says)}$"):
        OpenDrawer(arena=mja.TableArena(), config_overrides=WARP)
    says = "`arena` must have a second table or surface for goals, or `goals` a name: it has one, 'table'."
    with pytest.raises(ValueError, match=f"^{re.escape(says)}$"):
        goals.surface_indices(mja.TableArena(), None)


def test_home():
    """A keyframe that is there already, and a joint that is not; what is moved by no joint gets no joint's position."""
    with pytest.raises(
        ValueError, match=r"^`spec` must have no keyframe 'home' yet: use that, or take it out, spec\.delete"
    ):
        arms.ready(arms.small().spec, {}, {})
    spec = arms.small().spec
    spec.delete(spec.key("home"))
    spec.add_tendon(name="both").wrap_joint("left", 1)
    spec.actuator("left").trntype, spec.actuator("left").target = mujoco.mjtTrn.mjTRN_TENDON, "both"
    spec.actuator("turret").trntype = mujoco.mjtTrn.mjTRN_JOINTINPARENT
    arms.ready(spec, {"turret": 0.3}, {})
    np.testing.assert_array_equal(spec.compile().key("home").ctrl[[0, 4, 5]], [0.3, 0, 0])


NUMBER = " must be a number > 0, got "
CALLS = {
    "no joint": (
        lambda s: arms.ready(s, {"sholder": 0.1}, {}),
        "`home`: no joint is called 'sholder': did you mean `shoulder`?",
    ),
    "out of range": (
        lambda s: arms.ready(s, {"elbow": -2}, {}),
        "`home['elbow']` must be within the joint's range, -1.4 to 1.4, got -2.",
    ),
    "no position": (lambda s: arms.ready(s, {"elbow": "up"}, {}), "`home['elbow']` must be a finite number, got 'up'."),
    "no finger": (
        lambda s: arms.ready(s, {}, {"lef": (-0.045, 0)}),
        "`fingers` must name actuators of the gripper: no actuator is called 'lef': did you mean `left`?",
    ),
    "one control": (
        lambda s: arms.ready(s, {}, {"left": 0.0}),
        "`fingers['left']` must be two different controls, (closed, open), got 0.0.",
    ),
    "servo of no joint": (
        lambda s: arms.servo(s, "rol", 1, 4, 10),
        "`joint`: no joint is called 'rol': did you mean `roll`?",
    ),
    "servo twice": (
        lambda s: arms.servo(s, "roll", 1, 4, 10),
        "`joint`: the spec has an actuator 'roll' already, and a servo is named after its joint: delete it first.",
    ),
    "servo of a ball": (lambda s: arms.servo(s, "pearl", 1, 4, 10), "`joint` must be a hinge or a slide, got 'pearl'."),
    "a ball": (lambda s: arms.ready(s, {"pearl": 0}, {}), "`home` must name hinges and slides, got 'pearl'."),
    "inertia": (lambda s: arms.servo(s, "spin", -1, 4, 10), "`inertia`" + NUMBER + "-1."),
    "frequency": (lambda s: arms.servo(s, "spin", 1, "4 Hz", 10), "`frequency`" + NUMBER + "'4 Hz'."),
    "force": (lambda s: arms.servo(s, "spin", 1, 4, 0), "`force`" + NUMBER + "0."),
}


@pytest.mark.parametrize("case", CALLS)
def test_wrong_servos_and_keyframes_to_add(case):
    """They are refused before anything is added."""
    call, says = CALLS[case]
    spec = arms.small().spec
    spec.delete(spec.key("home"))
    hand = spec.body("hand")
    for name, kind in (("pearl", mujoco.mjtJoint.mjJNT_BALL), ("spin", mujoco.mjtJoint.mjJNT_HINGE)):
        body = hand.add_body(name=name)
        body.add_joint(name=name, type=kind)
        body.add_geom(size=(0.01, 0.01, 0))
    actuators = len(spec.actuators)
    with pytest.raises(ValueError, match=r"^`") as raised:
        call(spec)
    assert str(raised.value) == says
    assert (len(spec.actuators), len(spec.keys)) == (actuators, 0)
    arms.servo(spec, "spin", 1, 4, 10)  # which has no limits
    assert spec.compile().actuator_ctrllimited.tolist() == [True] * actuators + [False]


def test_an_arena_is_of_one_task():
    """Its arm is in it already."""
    arena = mja.TableArena()
    Reach(arena=arena, on=0, config_overrides=WARP)
    with pytest.raises(
        ValueError,
        match=r"^`arena` is compiled already, or is another task.s, so that the arm cannot be put into it: make one",
    ):
        Reach(arena=arena, on=0, config_overrides=WARP)


def test_only_the_keyframe_of_episodes_counts():
    """A flag that is in the table at `qpos0` is told where episodes start with it there, and nowhere else."""
    arm = arms.small()
    flag = arm.spec.body("base").add_body(name="flag", pos=(0, 0.2, 0.02))
    flag.add_joint(name="mast", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 0, 1))
    flag.add_geom(name="ball", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.05, 0, 0), mass=0.1)
    arm.spec.delete(arm.spec.key("home"))
    arms.ready(arm.spec, {"shoulder": 0.1, "elbow": 0.2, "wrist": -0.3, "mast": 0.2}, arm.fingers)
    qpos, ctrl = np.array(arm.spec.key("home").qpos), arm.spec.key("home").ctrl
    qpos[arm.spec.compile().joint("mast").qposadr[0]] = 0
    arm.spec.add_key(name="low", qpos=qpos, ctrl=ctrl)
    Reach(arm=arm, config_overrides=WARP)
    says = r"'arm_ball' and 'table_collision' 0\.030 m in keyframe 'arm_low'\. Put one of each pair elsewhere\.$"
    with pytest.warns(UserWarning, match=says):
        Reach(arm=arm, config_overrides={**WARP, "keyframe": "low"})


@pytest.mark.parametrize("case", SERVOS)
def test_wrong_servos(case):
    make, says = SERVOS[case]
    with pytest.raises(ValueError, match=r"^`arm") as raised:
        Reach(arm=make(), config_overrides=WARP)
    assert str(raised.value) == says


def test_a_joint_without_limits_stays_where_it_is():
    """Its `range` is (0, 0) then. A servo's narrower `ctrlrange` holds its targets."""
    arm = arms.small()
    for name in ("turret", "shoulder"):
        joint = arm.spec.joint(name)
        joint.limited, joint.range = False, (0, 0)
    arm.spec.actuator("shoulder").ctrllimited = False
    env = Reach(arm=arm, config_overrides={**WARP, "action": "joint"})
    home = env.mj_model.key("arm_home")
    data = types.SimpleNamespace(qpos=jnp.asarray(home.qpos), ctrl=jnp.asarray(home.ctrl), time=1.0)
    held = env.drive(data, None, jnp.zeros(6).at[-1].set(1.0))
    np.testing.assert_allclose(held, home.ctrl, atol=1e-7)
    data.qpos, data.ctrl = (x.at[:2].set(jnp.array([2.79, 4.0])) for x in (data.qpos, data.ctrl))
    moved = env.drive(data, None, jnp.ones(6))
    np.testing.assert_allclose(moved[:2], [2.8, 4.08], atol=1e-6)


def test_reach_needs_no_fingers():
    """The last number of an action does nothing then; tasks that hold something say what they lack."""
    bare = with_fingers()
    env = Reach(arm=bare, config_overrides=WARP)
    assert env.finger_joints == ()
    home = env.mj_model.key("arm_home")
    data = types.SimpleNamespace(qpos=jnp.asarray(home.qpos), ctrl=jnp.asarray(home.ctrl), time=1.0)
    opened, closed = (env.drive(data, None, jnp.zeros(5).at[-1].set(grip)) for grip in (1.0, -1.0))
    np.testing.assert_array_equal(opened, closed)
    with pytest.raises(ValueError, match=r"^`arm\.fingers` must have what the task lifts an object with, got none\.$"):
        Lift(arm=with_fingers(), config_overrides=WARP)


def tables(*objects):
    """Two, with an object on the first."""
    offsets = [[0.42, -0.27, 0.8], [0.42, 0.27, 0.8]]
    return elliptic(mja.MultiTableArena(offsets, 0, (0.42, 0.44, 0.05), objects=objects))


def possible(env, at, **values):
    """Whether a task is, with other numbers of the nominal arena, and its object at a place (2,) in the frame of the world."""
    params = env.arena.nominal_params()
    params = params._replace(**{name: jnp.asarray(value) for name, value in values.items()})
    qpos = jnp.zeros(env.mj_model.nq).at[env.arena.layout.object_qpos[0, :3]].set(jnp.array([*at, 0.825]))
    return bool(env.draw_task(jax.random.key(0), params, qpos).possible)


WIDE, LONG = [[0.2, 0.2, 0.05]], [[0.2, 0.09, 0.05]]


@pytest.mark.slow
@pytest.mark.parametrize("kind", [Lift, PickAndPlace])
def test_impossible_tasks_of_arms_are_told(kind):
    """The object, 9 cm wide at most, is 22 to 44 cm from the small arm, which stands on any table at any yaw."""
    on = {"on": 1, "pos": (0.0, -0.2, 0.0)} if kind is Lift else {"pos": (0.0, 0.0, 0.8)}
    env = kind(arena=tables(mja.Object("box", full_size=0.05)), config_overrides=WARP, **on)
    base = np.array([0.42, 0.07]) if kind is Lift else np.zeros(2)
    for away, done in ((0.219, False), (0.221, True), (0.439, True), (0.441, False)):
        assert possible(env, base - [0, away]) == done, away
    assert possible(env, base - [0, 0.3], object_full_sizes=LONG)
    assert not possible(env, base - [0, 0.3], object_full_sizes=WIDE)
    assert not possible(env, base - [0, 0.3], object_active=[False])
    if kind is Lift:  # half a turn of its table brings the arm to the other side
        turned = {"table_rots": [0.0, np.pi]}
        assert possible(env, [0.42, 0.17], **turned)
        assert not possible(env, base - [0, 0.3], **turned)


def test_impossible_transfers_are_told():
    env = Transfer(arena=tables(mja.Object("box", full_size=0.05)), config_overrides=WARP, reach=0.9)
    assert possible(env, (0.89, 0))
    assert not possible(env, (0.91, 0))
    assert not possible(env, (0.5, 0), object_full_sizes=[[0.1, 0.1, 0.05]])


def at_heights(env, start, goal):
    """Whether a transfer is possible, between tables at these heights."""
    params = env.arena.nominal_params()
    params = params._replace(table_offsets=params.table_offsets.at[:, 2].set(jnp.array([start, goal])))
    qpos = (
        jnp.zeros(env.mj_model.nq).at[env.arena.layout.object_qpos[0, :3]].set(jnp.array([0.42, -0.27, start + 0.025]))
    )
    return bool(env.draw_task(jax.random.key(0), params, qpos).possible)


UNREACHED = "is out of the gripper's reach {}. It is on table {}, whose top is {} m high. The tip goes to heights from 0.45 to 1.45 m, and "
UNREACHED += "1 m to each side of the middle of the floor along x and y. `invalid_arena` reports such episodes."


def test_transfers_at_heights_out_of_reach_are_told():
    """The tip goes to 0.45 to 1.45 m, and the middle of the box is 2.5 cm above its table."""
    offsets = [[0.42, -0.27, 0.1], [0.42, 0.27, 0.2]]
    low = mja.MultiTableArena(offsets, 0, (0.42, 0.44, 0.05), objects=[mja.Object("box", full_size=0.05)])
    with pytest.warns(UserWarning, match="out of the gripper's reach") as told:
        env = Transfer(arena=low, config_overrides=WARP)
    nominal = "in the nominal arena"
    says = ["`arena`: object 'box' " + UNREACHED.format(nominal, 0, "0.10")]
    assert [str(one.message) for one in told] == [*says, "`goals`: the goal " + UNREACHED.format(nominal, 1, "0.20")]
    for height, done in ((0.1, False), (0.424, False), (0.426, True), (1.424, True), (1.426, False)):
        assert at_heights(env, height, 0.8) == at_heights(env, 0.8, height) == done, height

    def warned(least, most, reach=1.0, goals=()):
        ranges = mja.ArenaRanges(table_offsets=mja.Uniform([0, 0, least], [0, 0, most], relative="add"))
        unreached.warn_of_tip(reach, robots.TIP_HEIGHTS, env.arena, ranges, goals)

    warned(0.4, 0.6, goals=[1])
    drawn = r"reach in the nominal arena, and in (3[3-9]|4\d|5\d|6[0-3]) of 64 worlds that were drawn\. It is on"
    with pytest.warns(UserWarning, match=f"^`arena`: object 'box' is out of the gripper's {drawn} table 0"):
        warned(0.0, 0.5)
    with pytest.warns(UserWarning, match="in all of 64 worlds that were drawn") as told:
        warned(0.4, 0.6, 0.2, [1])  # too far along x, from 21 cm on
    assert len(told) == 2


def test_variants_and_files_are_told():
    """Of variants that of the world counts, and those that ranges draw; what comes from a file may have a handle."""
    mug = mujoco.MjSpec.from_string(
        "<mujoco><worldbody><body><geom size='.1 .1 .1' type='box'/></body></worldbody></mujoco>"
    )
    variants = [mja.Object("box", full_size=0.05), mja.Object("can", "cylinder", (0.2, 0.2, 0.1))]
    variants += [mja.Object("mug", "mjcf", file=mug)]
    arena = tables(mja.Object("box", variants=variants))
    with pytest.warns(
        UserWarning, match=r"^Object 'box_can' is 0\.2 x 0\.2 m, seen from above, and the gripper takes at"
    ):
        graspable.warn_of_wide(arena, mja.ArenaRanges(terms={"box.variant": mja.Choice([0, 1])}), 0.09)
    graspable.warn_of_wide(arena, mja.ArenaRanges(), 0.09)  # only the first is ever there
    nominal = arena.nominal_params()
    worlds = [arena.with_variants(nominal, box=name) for name in ("box", "can", "mug")]
    assert [bool(graspable.taken(arena, params, 0.09)) for params in worlds] == [True, False, True]


@pytest.mark.parametrize("kind", [Lift, PickAndPlace])
def test_friction_that_does_not_hold_is_told(kind):
    """Once, in an arena of a user's own; a task that holds nothing needs no other cone."""
    arena = tables(mja.Object("box", full_size=0.05))
    arena.spec.option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    says = "`arena.spec.option.cone` is a pyramid, with which a held object slips by millimetres a second: `arena.spec.option.cone, "
    says += "arena.spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10` before the task is made, or "
    goals = {"goals": "table1"} if kind is PickAndPlace else {}
    with pytest.warns(UserWarning, match=f"^{re.escape(says)}") as told:
        kind(arena=arena, config_overrides=WARP, on=1, pos=(0.0, -0.2, 0.0), **goals)
    assert len(told) == 1
    Reach(arena=mja.TableArena(), on=0, config_overrides=WARP)


def test_ranges_beyond_the_gripper_are_told():
    ranges = mja.ArenaRanges(object_full_sizes=mja.Uniform(0.05, 0.3))
    says = "`ranges.object_full_sizes` of object 'box' can be 0.3 x 0.3 m, seen from above, and the gripper takes at most 0.09 m: "
    with pytest.warns(UserWarning, match=f"^{re.escape(says)}`invalid_arena` reports such episodes\\.$"):
        Lift(arena=tables(mja.Object("box", full_size=0.05)), ranges=ranges, on=1, config_overrides=WARP)


@pytest.mark.parametrize(
    ("task", "given"), [(Reach, {}), (PickAndPlace, {"goals": "table1", "pos": (0, 0, 0.8)}), (Transfer, {})]
)
def test_mocap_bodies_of_an_arena_stay(task, given):
    """The goal is shown by its own mocap body, whatever others there are; a body of that name is told."""
    arena = tables(mja.Object("box", full_size=0.04))
    cursor = arena.spec.worldbody.add_body(name="cursor", mocap=True, pos=(0.5, 0.5, 2.0))
    cursor.add_geom(size=(0.01, 0, 0), contype=0, conaffinity=0)
    env = task(arena=arena, config_overrides=WARP, **given)
    c = mujoco.MjData(env.mj_model)
    mujoco.mj_kinematics(env.mj_model, c)
    at, base = jnp.array([0.1, 0.2, 0.3]), c.body("arm_base").xpos if task is Reach else np.zeros(3)
    data = blank(env.mj_model).replace(xpos=jnp.asarray(c.xpos), xmat=jnp.asarray(c.xmat.reshape(-1, 3, 3)))
    marked = env.mark(data, types.SimpleNamespace(task=types.SimpleNamespace(pos=at)))
    rows = [int(env.mj_model.body(name).mocapid[0]) for name in ("cursor", "goal")]
    np.testing.assert_allclose(marked.mocap_pos[np.array(rows)], [(0.5, 0.5, 2.0), base + at], atol=1e-6)
    taken = tables(mja.Object("box", full_size=0.04))
    taken.spec.worldbody.add_body(name="goal")
    with pytest.raises(
        ValueError, match=r"^`arena` must have no body 'goal', as the task adds one that shows the goal\.$"
    ):
        task(arena=taken, config_overrides=WARP, **given)
