"""Robots that start inside themselves or the arena are a warning, with names, depths and states."""

import warnings

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from test_attach import file

import mjx_arenas as mja
from mjx_arenas import furniture

# A link turns about the axis along which it sinks 4 cm into its fixed base.
TURNTABLE = """<mujoco><worldbody><geom name="base" type="box" size=".06 .06 .06" pos="2 0 .3"/>
  <body name="link" pos="2 0 .36"><joint name="j" axis="0 0 1"/>
    <geom name="rod" type="capsule" size=".04" fromto="0 0 0 0 0 .3"/></body></worldbody>
  <keyframe><key name="home" qpos=".3"/><key qpos="1"/></keyframe></mujoco>"""
LIFT = """<mujoco><worldbody><geom type="box" size=".06 .06 .06" pos="2 0 .3"/>
  <body name="link" pos="2 0 .36"><joint name="j" type="slide" axis="0 0 1"/>
    <geom type="capsule" size=".04" fromto="0 0 0 0 0 .3" mass="1"/></body></worldbody>
  <keyframe><key name="up" qpos=".1"/><key name="low" qpos="-.02"/></keyframe></mujoco>"""
TELL = "Keep them apart, or leave out their contacts: `arena.spec.add_exclude(bodyname1={!r}, bodyname2={!r})`, or <exclude> in the MJCF."
ELSEWHERE, OR_ELSE = (
    "Put one of each pair elsewhere",
    ", or name the `keyframe` in which the robot starts, if they are apart in it.",
)
LOST = "Beside such contacts MJX diverges, or loses friction and support of all else in the world. "


def attached(xml, **kwargs):
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.attach(xml, "r_", **kwargs)
    return arena


def said(make):
    """The warnings of a call."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        make()
    return [str(w.message) for w in caught]


def test_link_in_its_base():
    """Names, depth, states and what it does are told; on a table the base is part of the robot's mount."""
    told = (
        "`robot`: geoms are inside each other: 'r_rod' and 'r_base' 0.040 m at qpos0, in keyframe 'r_home' and in keyframe "
        "'r_key1', from which no joint parts them. "
    )
    assert said(lambda: attached(TURNTABLE)) == [told + LOST + TELL.format("world", "r_link")]
    assert said(lambda: attached(TURNTABLE, on=0)) == [told + LOST + TELL.format("r_mount", "r_link")]


def test_keyframes_in_which_they_are_apart():
    """States are told apart; the deepest counts; what a joint can part is no danger to other contacts."""
    told = (
        "`robot`: geoms are inside each other: an unnamed capsule of body 'r_link' and 'r_world/geom0' 0.060 m at "
        "qpos0 and in keyframe 'r_low'. "
    )
    assert said(lambda: attached(LIFT)) == [told + TELL.format("world", "r_link")]


@pytest.mark.parametrize("on_table", [None, 0])
def test_excluded(on_table):
    """What the warning says to do leaves no such contact, and nothing more is said."""
    with pytest.warns(UserWarning, match="inside each other") as warned:
        arena = attached(TURNTABLE, on=on_table)
    line = str(warned[0].message).split("`")[-2]
    eval(line, {"arena": arena})
    model = arena.mj_model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    assert said(lambda: arena.compile(arena.nominal_params())) == []


def test_robot_in_the_arena():
    """A table counts, but for one that is absent; objects do not, as keys place them elsewhere."""
    ball = '<mujoco><worldbody><body name="ball"><joint type="slide" axis="0 0 1"/><geom name="g" size=".05"/></body></worldbody></mujoco>'
    told = "`robot`: geoms are inside each other: 'r_g' and 'table_collision' 0.030 m at qpos0. "
    assert said(lambda: attached(ball, pos=(0.3, 0.3, 0.82))) == [told + ELSEWHERE + OR_ELSE]
    assert said(lambda: attached(ball, pos=(0.0, 0.0, 0.86))) == []  # in the cube
    arena = mja.MultiTableArena([[0, 0, 0.8], [2, 0, 0.8]], table_active=[True, False])
    assert said(lambda: arena.attach(ball, "r_", pos=(2, 0, 0.82))) == []
    arena.attach(ball, "s_", pos=(0, 0, 2.0))
    assert said(lambda: arena.attach(ball, "t_", pos=(0, 0, 2.01)))[0].startswith(
        "`robot`: geoms are inside each other: 's_g' and 't_g' 0.090 m"
    )
    assert said(lambda: arena.attach(ball, "u_", pos=(3, 0, 2.0))) == []  # the other two are no business of this one's


HAND = """<mujoco><worldbody><body name="hand"><joint name="j" type="slide" axis="0 0 1"/><geom name="palm" size=".05"/>
  <body name="knuckle"><geom size=".01" contype="0" conaffinity="0"/><joint name="f" type="slide" axis="1 0 0"/>
    <body name="finger" pos="0 0 .04"><joint name="g" axis="0 0 1"/><geom name="tip" size=".02"/></body></body></body></worldbody>
  <keyframe><key name="up" qpos=".2 .08 0"/><key name="shut" qpos=".2 0 0"/><key name="down" qpos="-.01 .08 0"/></keyframe></mujoco>"""


def test_the_keyframe_in_which_it_starts():
    """It alone counts, with the robot and with the arena; a hand in a table is told apart, and never to pass through it."""
    palm = "`robot`: geoms are inside each other: 'r_palm' and 'r_tip' 0.0{}0 m {}. "
    told = TELL.format("r_hand", "r_finger")
    table = "`robot`: geoms are inside each other: 'r_palm' and 'table_collision' 0.0{}0 m {}. " + ELSEWHERE

    def here(keyframe=None):
        return said(lambda: attached(HAND, pos=(0.3, 0.3, 0.82), keyframe=keyframe))

    assert here("up") == []
    assert here("shut") == [palm.format(3, "in keyframe 'r_shut'") + told]
    assert here("down") == [table.format(4, "in keyframe 'r_down'") + "."]
    assert here() == [
        palm.format(3, "at qpos0 and in keyframe 'r_shut'") + told,
        table.format(4, "at qpos0 and in keyframe 'r_down'") + OR_ELSE,
    ]
    says = r"^`keyframe` must be None or a name of a keyframe of `robot`, which has 'up', 'shut', 'down', got 'r_up'\.$"
    with pytest.raises(ValueError, match=says):
        here("r_up")


def test_scene_with_a_robot():
    """A robot of a base MJCF is looked at, too; what is in the world is nobody's."""
    (told,) = said(lambda: mja.TableArena(xml=TURNTABLE, objects=[mja.Object("cube")]))
    assert told.startswith(
        "The arena: geoms are inside each other: 'rod' and 'base' 0.040 m at qpos0, in keyframe 'home'"
    )
    assert told.endswith(LOST + ELSEWHERE + ".")


STATIC = """<mujoco><worldbody><body name="base" pos="{} 0 {}"><geom name="foot" size=".08"/><body name="link" pos="0 0 .05">
  <joint axis="0 1 0"/><geom name="rod" type="capsule" size=".04" fromto=".06 0 0 .4 0 .1"/></body></body></worldbody></mujoco>"""


def test_link_in_a_base_that_does_not_move():
    """It is told alike of a base MJCF and of what is attached; neither is moved elsewhere without the other."""
    (told,) = said(lambda: mja.TableArena(xml=STATIC.format(2, 1)))
    assert told.endswith(TELL.format("base", "link"))
    (told,) = said(lambda: attached(STATIC.format(2, 1)))
    assert told.endswith(TELL.format("r_base", "r_link"))
    arena = mja.TableArena()
    assert said(lambda: arena.attach(STATIC.format(0, 0.2), "r_", on=0))[0].endswith(TELL.format("r_base", "r_link"))


TURNS = """<mujoco><worldbody><body name="hand"><joint axis="0 0 1"/><geom name="palm" size=".05"/></body></worldbody>
  <keyframe><key name="home" qpos="0"/></keyframe></mujoco>"""


def test_a_table_and_what_stands_on_it_are_not_one_robot():
    """Also where no joint parts them, and where a part that is added has all of the arena looked at once more."""
    told = "`robot`: geoms are inside each other: 'r_palm' and 'table_collision' 0.030 m {}, from which no joint parts them. "
    assert said(lambda: attached(TURNS, pos=(0.3, 0.3, 0.82))) == [
        told.format("at qpos0 and in keyframe 'r_home'") + LOST + ELSEWHERE + OR_ELSE
    ]
    assert said(lambda: attached(TURNS, pos=(0.3, 0.3, 0.82), keyframe="home")) == [
        told.format("in keyframe 'r_home'") + LOST + ELSEWHERE + "."
    ]
    arena = mja.TableArena()
    assert said(lambda: arena.attach(TURNS, "r_", on=0, pos=(0, 0, 0.02)))[0].endswith(ELSEWHERE + OR_ELSE)
    (again,) = said(lambda: arena.add_part(furniture.Shelf("rack", pos=(0, 3, 0))))
    assert again.endswith(LOST + ELSEWHERE + ".")


def test_a_nameless_body_of_the_arena_is_none_of_a_robot():
    """What is attached has names."""
    block = '<mujoco><worldbody><body pos="2 0 .1"><geom size=".1"/></body></worldbody></mujoco>'
    arena = mja.TableArena(xml=block)
    assert said(lambda: arena.attach(TURNS, "r_", pos=(2, 0, 0.2)))[0].endswith(ELSEWHERE + OR_ELSE)


@pytest.mark.slow
def test_robot_folded_into_itself():
    """A Panda at `qpos0` has its gripper in its arm, which joints part; a UR5e touches nothing."""
    (told,) = said(lambda: attached(file("panda"), pos=(2, 0, 0)))
    assert "an unnamed mesh of body 'r_link5' and an unnamed mesh of body 'r_left_coupler' 0.016 m at qpos0;" in told
    assert ", and 2 more pairs. Keep them apart" in told
    assert said(lambda: attached(file("ur5e"), pos=(2, 0, 0))) == []


SPEED, STEPS = 0.5, 150  # [m/s] of a cube, and steps in which friction of 1 stops it; 0.07 s would do


def slides(arena):
    """How far a cube slides that lands with `SPEED` from 1 mm above its table, and how fast it is at last: in C, and on Warp."""
    params, cube = arena.nominal_params(), arena.objects[0].joint
    model, data = arena.c_world(params)
    joint = data.joint(cube)
    joint.qpos[2] += 0.001
    joint.qvel[0] = SPEED
    batch = arena.batch(arena.put_model("warp"), jax.tree.map(lambda x: x[None], params))
    start = mja.make_data(batch).replace(
        qpos=jnp.asarray(data.qpos, jnp.float32)[None], qvel=jnp.asarray(data.qvel, jnp.float32)[None]
    )
    end = jax.jit(lambda data: jax.lax.fori_loop(0, STEPS, lambda _, data: mja.step(batch, data), data))(start)
    x, speed = float(joint.qpos[0]), model.joint(cube)
    mujoco.mj_step(model, data, STEPS)
    of_warp = end.qpos[0, speed.qposadr[0]] - x, end.qvel[0, speed.dofadr[0]]
    return np.array([[joint.qpos[0] - x, joint.qvel[0]], of_warp])


@pytest.mark.slow
def test_beside_a_robot_inside_itself_a_cube_lands_without_friction():
    """On Warp it slides on, as the warning says, and in C it stops; after what the warning says to do it stops in both."""
    with pytest.warns(UserWarning, match=LOST):
        inside = attached(TURNTABLE)
    with pytest.warns(UserWarning, match=LOST):
        apart = attached(TURNTABLE)
    apart.spec.add_exclude(bodyname1="world", bodyname2="r_link")
    step = inside.mj_model.opt.timestep
    (in_c, on_warp), both = slides(inside), slides(apart)
    np.testing.assert_allclose(on_warp, [SPEED * STEPS * step, SPEED], rtol=1e-3)
    for stops in (in_c, *both):  # by Coulomb's law, with the blow of the landing; friction begins within a step
        np.testing.assert_allclose(stops, [SPEED**2 / (2 * 9.81) + 0.001, 0.0], atol=SPEED * step)
