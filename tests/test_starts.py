"""Worlds start with all that is state as fresh data has it: in every episode, in a keyframe, in pictures and in files."""

import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from idle import Idle

import mjx_arenas as mja
from mjx_arenas.sim import starts
from mjx_arenas.viz import render, tile
from mjx_arenas.write.replace import replace

# A hand that is welded to a mocap body, an arm that is let go in an episode, a motor with a state, and a keyframe.
ROBOT = """
<mujoco>
  <worldbody>
    <body name="lead" mocap="true" pos="0.4 0 1.5" quat="0.6 0 0.8 0"/>
    <body name="hand" pos="0.4 0 1.5" quat="0.6 0 0.8 0">
      <freejoint name="hand"/><geom name="hand" size="0.02" mass="0.1" contype="0" conaffinity="0"/></body>
    <body pos="0 0 3"><joint name="arm" axis="0 1 0" damping="1"/>
      <geom name="arm" size="0.02" pos="0.2 0 0" mass="0.1" contype="0" conaffinity="0"/></body>
  </worldbody>
  <equality><weld name="grip" body1="lead" body2="hand"/><joint joint1="arm" active="false"/></equality>
  <actuator><general joint="arm" dyntype="filter" dynprm="0.1" ctrlrange="-1 1"/></actuator>
  <keyframe>
    <key name="home" time="1.5" ctrl="0.3" act="0.2" qpos="0.5 0.1 1.4 1 0 0 0 0.7" qvel="0 0 0 0 0 0 0.1"
      mpos="0.5 0.1 1.4" mquat="1 0 0 0"/>
  </keyframe>
</mujoco>
"""
BALL = (mja.Object("ball", "sphere", 0.06),)
RANGES = mja.ArenaRanges(table_offsets=mja.Uniform([-0.1, -0.1, -0.2], [0.1, 0.1, 0.2], relative="add"))


class Grasp(Idle):
    """A hand that a mocap body leads."""

    def __init__(self, keyframe=None, impl="jax"):
        arena = mja.TableArena(objects=BALL)
        arena.attach(mujoco.MjSpec.from_string(ROBOT))
        arena.spec.nuserdata = 2
        arena.spec.option.iterations, arena.spec.option.ls_iterations = 1, 6
        super().__init__(arena, RANGES, 0.01, 0.005, 10, impl, keyframe)


@functools.cache
def grasp(keyframe):
    return Grasp(keyframe)


def used(data):
    """Data of an episode that has gone on: other numbers in all that `mjx.Data` has of its own."""
    rng = np.random.default_rng(0)

    def other(leaf):
        noise, value = rng.uniform(0.5, 1.5, leaf.shape), np.asarray(leaf)
        return ~value if leaf.dtype == bool else value + np.asarray(noise if leaf.dtype.kind == "f" else 1, leaf.dtype)

    return jax.tree.map(other, data).replace(_impl=data._impl)


def named(tree):
    return {jax.tree_util.keystr(path): np.asarray(x) for path, x in jax.tree_util.tree_leaves_with_path(tree)}


# What `mj_step` computes from the state before it reads it.
FOLLOWS = (
    "xpos xquat xmat xipos ximat xanchor xaxis ten_length geom_xpos geom_xmat site_xpos site_xmat cam_xpos cam_xmat"
)
FOLLOWS += (
    " subtree_com cvel cdof cdof_dot qfrc_bias qfrc_gravcomp qfrc_fluid qfrc_passive qfrc_actuator actuator_force"
)
FOLLOWS += " actuator_length qfrc_smooth qacc_smooth qfrc_constraint qfrc_inverse qacc act_dot sensordata"


@pytest.mark.slow
@pytest.mark.parametrize("keyframe", [None, "robot_home"])
def test_an_episode_starts_as_fresh_data(keyframe):
    """Leaf by leaf, but for what follows from the state; in worlds where no episode begins nothing changes."""
    env = grasp(keyframe)
    key = jax.random.key(3)
    state = jax.jit(env.reset)(key)
    episode = state.info["episode"]
    model = replace(env.mjx_model, episode.fields)
    make = jax.jit(env.arena.make_world_data, static_argnames="keyframe")
    fresh = make(model, episode.params, keyframe=keyframe).replace(qpos=episode.qpos)
    fresh = fresh.replace(time=jnp.zeros_like(fresh.time))
    dirty = used(fresh)
    started = jax.jit(env._started)
    want, got, left = (
        named(tree)
        for tree in (fresh, started(dirty, episode, jnp.array(True)), started(dirty, episode, jnp.array(False)))
    )
    assert want.keys() == got.keys()
    for name, value in want.items():
        if name[1:] not in FOLLOWS.split():
            np.testing.assert_array_equal(got[name], value, err_msg=name)
    for name, value in named(dirty).items():
        np.testing.assert_array_equal(left[name], value, err_msg=name)
    # The same as a first episode, and as C MuJoCo has it.
    c = mujoco.MjData(env.mj_model)
    if keyframe:
        mujoco.mj_resetDataKeyframe(env.mj_model, c, env.mj_model.key(keyframe).id)
    for data in (state.data, started(dirty, episode, jnp.array(True))):
        for name in ("qvel", "act", "ctrl", "mocap_pos", "mocap_quat", "eq_active", "qacc_warmstart", "userdata"):
            np.testing.assert_allclose(getattr(data, name), getattr(c, name), rtol=2**-22, atol=0, err_msg=name)
        robot = np.setdiff1d(np.arange(env.mj_model.nq), env.arena.layout.object_qpos)
        np.testing.assert_allclose(data.qpos[robot], c.qpos[robot], rtol=2**-22, atol=0)
        assert data.time == 0


@pytest.mark.slow
def test_a_led_hand_starts_at_rest():
    """A hand that was led away in the last episode does not fly back to where it was led."""
    env = grasp(None)
    step = jax.jit(env.step)
    state = step(jax.jit(env.reset)(jax.random.key(0)), jnp.zeros(1))
    away = state.data.replace(mocap_pos=state.data.mocap_pos + jnp.array([0.5, 0, 0]))
    state = step(state.replace(data=away, done=jnp.ones(())), jnp.zeros(1))
    hand = env.mj_model.joint("robot_hand").dofadr[0]
    # It sinks until the weld holds it: at most g * 10 ms. A weld that pulls over 0.5 m gives metres a second.
    assert np.abs(state.data.qvel[hand : hand + 3]).max() < 9.81 * 0.01


def test_mocap_bodies_stand_where_the_world_has_them():
    """In data of a world whose mocap body somebody has moved, and in the next episode there."""
    env = grasp(None)
    body = env.mj_model.body("robot_lead").id
    model = env.mjx_model.tree_replace({"body_pos": env.mjx_model.body_pos.at[body].set(jnp.array([1.0, 2.0, 3.0]))})
    data = jax.jit(env.arena.make_world_data)(model, env.arena.nominal_params())
    np.testing.assert_array_equal(data.mocap_pos, [[1, 2, 3]])
    again = starts.again(env.arena.record, data, model, None)
    np.testing.assert_array_equal(again["mocap_pos"], [[1, 2, 3]])


def test_unknown_keyframe_of_an_environment():
    with pytest.raises(ValueError, match=r"^`keyframe` must be one of 'robot_home', got 'hom'\.$"):
        Grasp("hom")


ARM = """
<mujoco>
  <worldbody><body name="arm" pos="0 0 1"><joint name="turn" axis="0 1 0"/>
    <geom type="capsule" size="0.03" fromto="0 0 0 0.4 0 0" contype="0" conaffinity="0"/></body></worldbody>
  <actuator><motor joint="turn"/></actuator>
  <keyframe><key name="up" qpos="-1.2" ctrl="0.5"/></keyframe>
</mujoco>
"""


@functools.cache
def arm():
    """A table with a ball and an arm, and the same twice as worlds of which the second is higher."""
    arena = mja.TableArena(objects=BALL)
    arena.attach(ARM, "r_")
    params = arena.nominal_params()
    higher = params._replace(table_offsets=params.table_offsets + jnp.array([0, 0, 0.2]))
    return arena, params, jax.tree.map(lambda *x: jnp.stack(x), params, higher)


@pytest.mark.slow
def test_world_in_a_keyframe():
    """In C MuJoCo the robot is as `make_data` has it, and the ball on its table."""
    arena, _, two = arm()
    for params in (mja.take(two, i) for i in range(2)):
        _, c = arena.c_world(params, keyframe="r_up")
        data = arena.make_world_data(arena.apply(arena.put_model("jax"), params), params, keyframe="r_up")
        np.testing.assert_allclose(c.qpos, data.qpos, rtol=0, atol=1e-6)
        np.testing.assert_allclose(c.ctrl, data.ctrl, rtol=0, atol=0)
        assert c.xpos[c.model.body("r_arm").id][2] == 1  # positions are computed
    assert arena.c_world(params)[1].joint("r_turn").qpos == 0


@pytest.mark.slow
def test_pictures_and_files_of_a_keyframe(tmp_path, monkeypatch):
    """All that shows or keeps a world shows and keeps it in the keyframe."""
    arena, params, two = arm()
    at = {name: arena.c_world(params, keyframe=name)[1] for name in ("r_up", None)}
    small = {"width": 96, "height": 64, "camera": -1}
    got = arena.render(params, **small, keyframe="r_up")
    np.testing.assert_array_equal(got, arena.render(params, at["r_up"], **small))
    assert np.abs(got.astype(int) - arena.render(params, **small)).max() > 50
    both = [arena.c_world(mja.take(two, i), keyframe="r_up")[1] for i in range(2)]
    sheets = arena.contact_sheet(two, **small, keyframe="r_up"), arena.contact_sheet(two, both, **small)
    np.testing.assert_array_equal(*map(np.asarray, sheets))
    plans = [arena.plan(params, **of) for of in ({"keyframe": "r_up"}, {"data": at["r_up"]}, {})]
    drawn = [render.picture(plan) for plan in plans]
    np.testing.assert_array_equal(drawn[0], drawn[1])
    assert not np.array_equal(drawn[0], drawn[2])
    tiles = arena.tile(two, keyframe="r_up")
    assert [tiles.data.joint(f"world{i}_r_turn").qpos.item() for i in range(2)] == [-1.2, -1.2]

    shown = []
    monkeypatch.setattr(tile, "view", lambda model, data: shown.append(data))
    arena.view(params, keyframe="r_up")
    arena.view(two, keyframe="r_up")
    assert [
        c.qpos[c.model.joint(name).qposadr[0]] for c, name in zip(shown, ("r_turn", "world1_r_turn"), strict=True)
    ] == [-1.2] * 2

    arena.export(params, tmp_path / "world", keyframe="r_up")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "world" / "world.xml"))
    np.testing.assert_allclose(model.key("state").qpos, at["r_up"].qpos, rtol=0, atol=1e-6)
    assert model.key("state").ctrl == 0.5


def test_a_keyframe_or_a_state():
    """Not both, and a name that there is."""
    arena, params, _ = arm()
    data = arena.c_world(params)[1]
    with pytest.raises(ValueError, match=r"^`keyframe` must be None with `data`, which has a state\.$"):
        arena.render(params, data, keyframe="r_up")
    with pytest.raises(ValueError, match=r"^`keyframe` must be one of 'r_up', got 'r_down'\.$"):
        arena.plan(params, keyframe="r_down")
