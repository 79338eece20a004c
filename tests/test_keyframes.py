"""Keyframes of robots and scenes: with or without positions and names, moved with what they belong to."""

import re
import warnings

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds
from idle import Idle
from oracle import off

import mjx_arenas as mja
from mjx_arenas import dr

ARM = """<mujoco><worldbody><body name="base"><joint name="j" type="slide" ref=".2"/><geom size=".05" contype="0" conaffinity="0"/></body>
  </worldbody><keyframe>{}</keyframe></mujoco>"""
WALKER = """<mujoco><worldbody><frame pos=".1 0 0" euler="0 0 20"><body name="trunk" pos="0 0 1">
  <geom size=".05" contype="0" conaffinity="0"/><freejoint/>
  <body name="leg"><joint name="hip"/><geom size=".02" pos=".1 0 0" contype="0" conaffinity="0"/></body></body></frame>
  <body name="hand" mocap="true" pos="1 0 0"/></worldbody>
  <keyframe><key name="stand" qpos=".3 .4 .5 .8 .6 0 0 .7" qvel="1 2 3 .4 .5 .6 .7" mpos=".5 .6 .7" mquat=".6 0 .8 0"/>
    <key name="rest" qvel="1 2 3 .4 .5 .6 .7"/></keyframe></mujoco>"""
CUBE = mja.Object("cube", pos=(0.3, 0.3))
SCENE = """<mujoco><worldbody><body name="desk" pos="0 0 .8"><geom name="top" type="box" size=".4 .4 .02"/></body></worldbody>
  <keyframe><key/><key time="2"/></keyframe></mujoco>"""


def lower(arena):
    """Parameters with the tables 0.2 m lower."""
    params = arena.nominal_params()
    return params._replace(table_offsets=params.table_offsets - jnp.array([0, 0, 0.2]))


def as_base(xml):
    return mja.TableArena(xml=xml, objects=[CUBE]), ""


def as_robot(xml):
    arena = mja.TableArena(objects=[CUBE])
    arena.attach(xml, "r_", on=0)
    return arena, "r_"


@pytest.mark.parametrize("made", [as_base, as_robot])
def test_keyframe_without_positions(made):
    """It is the state at rest: joints at their references, objects on their tables, in each world."""
    arena, prefix = made(ARM.format('<key name="home" time="1.5"/>'))
    params = lower(arena)
    model = arena.compile(params)
    home = model.key(f"{prefix}home")
    assert home.time == 1.5
    np.testing.assert_array_equal(home.qpos, model.qpos0)
    assert home.qpos[model.joint("cube_joint0").qposadr[0] + 2] == pytest.approx(0.6 + 0.025, abs=1e-6)
    assert home.qpos[model.joint(f"{prefix}j").qposadr[0]] == pytest.approx(0.2)
    loaded = mujoco.MjModel.from_xml_string(arena.to_xml(params))
    np.testing.assert_allclose(loaded.key(f"{prefix}home").qpos, home.qpos, rtol=0, atol=1e-8)
    make = jax.jit(arena.make_world_data, static_argnames="keyframe")
    data = make(arena.apply(arena.put_model("jax"), params), params, keyframe=f"{prefix}home")
    np.testing.assert_allclose(data.qpos, home.qpos, rtol=0, atol=1e-6)
    assert data.time == 1.5


def test_world_at_rest_is_taken_back(tmp_path):
    """What `export` writes of a world at rest can be a base, a robot and a scene, each with objects."""
    arena = mja.TableArena(objects=[CUBE])
    params = arena.nominal_params()
    arena.export(params, tmp_path / "world", arena.c_world(params)[1])
    file, mug = tmp_path / "world" / "world.xml", mja.Object("mug", pos=(-0.3, -0.3))
    base = mja.TableArena(xml=file, objects=[mug])
    scene = mja.Arena.from_xml(file, ["table"], objects=[mug])
    beside = mja.TableArena(objects=[mug])
    beside.attach(file, "r_", pos=(3, 0, 0))
    for made, name, cube, x in (
        (base, "state", "cube", 0.3),
        (scene, "state", "cube", 0.3),
        (beside, "r_state", "r_cube", 3.3),
    ):
        model = made.compile(lower(made))
        c = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, c, model.key(name).id)
        np.testing.assert_allclose(c.joint("mug_joint0").qpos[:3], [-0.3, -0.3, 0.625], atol=1e-6)
        np.testing.assert_allclose(c.joint(f"{cube}_joint0").qpos[:3], [x, 0.3, 0.825], atol=1e-6)


def test_keyframes_without_names():
    """They get the names of their numbers, whatever names there are."""
    keys = '<key qpos=".3"/><key name="key2" qpos=".4"/><key qpos=".5"/>'
    arena = mja.TableArena(objects=[CUBE])
    arena.attach(ARM.format(keys), "a_", pos=(2, 0, 0))
    arena.attach(ARM.format(keys), "b_", pos=(3, 0, 0))
    model = arena.mj_model
    names = [f"{prefix}{key}" for prefix in "ab" for key in ("_key0", "_key2", "_key3")]
    assert [model.key(k).name for k in range(model.nkey)] == names
    for name, angle in zip(names, [0.3, 0.4, 0.5] * 2, strict=True):
        assert model.key(name).qpos[model.joint(f"{name[:2]}j").qposadr[0]] == pytest.approx(angle)
    scene = mja.Arena.from_xml(SCENE, ["desk"], objects=[CUBE])
    assert scene.compile(lower(scene)).key("key1").time == 2
    padded = mja.TableArena(objects=[CUBE])
    padded.attach(
        ARM.format('<key name="home" qpos=".3"/>').replace("<worldbody>", '<size nkey="3"/><worldbody>'), "r_"
    )
    assert [padded.mj_model.key(k).name for k in range(3)] == ["r_home", "r_key1", "r_key2"]


def attached(pos, quat):
    arena = mja.TableArena(objects=[CUBE])
    arena.attach(WALKER, "r_", pos=pos, quat=quat)
    return arena


def merged(pos, quat):
    other = mja.MultiTableArena([[0, 5, 0.8]], objects=[CUBE])
    other.attach(WALKER, "walker_")
    return mja.TableArena(objects=[CUBE]).merge(other, "r_", pos, 2 * np.arctan2(quat[3], quat[0]))


def motion(model, prefix, key):
    """Positions, orientations and velocities of the bodies in a keyframe: (3,), (3, 3), (6,) of each."""
    c = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, c, model.key(key).id)
    mujoco.mj_forward(model, c)
    for name in ("trunk", "leg", "hand"):
        body, velocity = c.body(prefix + name), np.zeros(6)
        mujoco.mj_objectVelocity(model, c, mujoco.mjtObj.mjOBJ_BODY, body.id, velocity, 0)
        yield body.xpos, body.xmat.reshape(3, 3), velocity.reshape(2, 3)


@pytest.mark.parametrize("key", ["stand", "rest"])
@pytest.mark.parametrize("made", [attached, merged])
def test_keyframes_follow_their_robot(made, key):
    """A free base, a mocap body and velocities are moved and turned with the robot, as all else of it is."""
    pos, yaw = np.array([1.0, -2.0, 0.3]), 0.8
    arena = made(pos, (np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)))
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    prefix = "r_walker_" if made is merged else "r_"
    alone = motion(mujoco.MjModel.from_xml_string(WALKER), "", key)
    worlds = [motion(model, prefix, prefix + key) for model in (arena.mj_model, arena.compile(lower(arena)))]
    for before, *after in zip(alone, *worlds, strict=True):
        for at, axes, velocity in after:
            np.testing.assert_allclose(at, pos + turn @ before[0], rtol=0, atol=1e-12)
            np.testing.assert_allclose(axes, turn @ before[1], rtol=0, atol=1e-12)
            np.testing.assert_allclose(velocity, before[2] @ turn.T, rtol=0, atol=1e-12)
    if made is merged:
        model, c = arena.mj_model, mujoco.MjData(arena.mj_model)
        mujoco.mj_resetDataKeyframe(model, c, model.key(prefix + key).id)
        at = c.joint("r_cube_joint0").qpos[:3]  # on its table, which is 5 m away and has moved, too
        np.testing.assert_allclose(at, turn @ [0.3, 5.3, 0.825] + pos, rtol=0, atol=1e-12)


def with_keys():
    """Two tables with objects, a robot with keyframes without positions and with them, and one with objects thrown about."""
    arena = worlds.arena(2)
    arena.attach(ARM.format('<key name="home" time="1.5"/><key name="out" qpos=".7" qvel="2"/>'), "r_", on=0)
    start = arena.spec.copy().compile().qpos0
    arena.spec.add_key(name="thrown", qpos=np.where(start == 0, 0.4, 0.9 * start))
    return arena


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_keyframes_of_random_worlds(impl):
    """All that starts in a keyframe has the positions that it has in the recompiled model, without what is absent."""
    arena = with_keys()
    model = arena.put_model(impl)
    batch = arena.randomize(
        model, mja.world_keys(3, range(4)), worlds.RANGES._replace(object_active=mja.Bernoulli(0.7))
    )
    assert batch.valid.all()
    there = np.concatenate([batch.params.table_active, batch.params.object_active], axis=1)
    assert (~there).any()
    assert isinstance(model.key_qpos, np.ndarray)  # part of the structure, which worlds share
    for name in ("r_home", "r_out", "thrown"):
        qpos = np.asarray(mja.make_data(batch, keyframe=name).qpos)
        for i in range(4):
            compiled, c = arena.c_world(batch.world(i), keyframe=name)
            want, rows = compiled.key(name).qpos, arena.layout.state_rows(there[i])["qpos"]
            np.testing.assert_array_equal(c.qpos, want)
            assert not off(compiled, "qpos0", qpos[i, rows], want).any(), (name, i)
            assert off(compiled, "qpos0", model.key_qpos[arena.mj_model.key(name).id, rows], want).any(), (name, i)


@pytest.mark.slow
def test_keyframes_in_c_batch():
    """They are those of the recompiled model, in each simulation, which can be reset to them."""
    arena = with_keys()
    params = arena.randomize(arena.put_model("jax"), mja.world_keys(3, range(3)), worlds.RANGES).params
    batch = arena.c_batch(params)
    batch.reset(keyframe=2)
    for i in range(3):
        compiled = arena.compile(worlds.take(params, i))
        for got, want in zip(
            [*batch.get_model(i).key_qpos, batch.qpos[i]], compiled.key_qpos[[0, 1, 2, 2]], strict=True
        ):
            assert not off(compiled, "qpos0", got, want).any()


@pytest.mark.slow
def test_places_that_a_keyframe_has_itself():
    """Quantities that place free and mocap bodies have no effect there, as in the compiled world: a warning names body and quantity."""
    arena = mja.Arena.from_xml(WALKER)
    arena.vary(place=dr.Term("body.pos"), turn=dr.Term("body.rpy", "trunk"), grip=dr.Term("body.rpy", "hand"))
    told = "`keyframe`: 'stand' has a `{}`, so that body '{}' starts there in all worlds, and `{}`, its '{}', has no effect: leave "
    told += "`{}` out of the keyframe, or start without one."
    place, turn, grip = (
        told.format("qpos", "trunk", "place", "body.pos", "qpos"),
        told.format("qpos", "trunk", "turn", "body.rpy", "qpos"),
        told.format("mquat", "hand", "grip", "body.rpy", "mquat"),
    )
    nominal = arena.nominal_params()
    of = {name: nominal._replace(terms={**nominal.terms, name: nominal.terms[name] + 0.1}) for name in nominal.terms}
    model = arena.put_model("jax")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        arena.c_world(nominal, keyframe="stand")
        for params in of.values():
            arena.c_world(params)
            arena.c_world(params, keyframe="rest")
    for name, sentence in (("place", place), ("turn", turn), ("grip", grip)):
        worlds_ = jax.tree.map(lambda one, other: jnp.stack([one, other]), nominal, of[name])
        for call in (
            lambda name=name: arena.c_world(of[name], keyframe="stand"),
            lambda worlds_=worlds_: mja.make_data(arena.batch(model, worlds_), keyframe="stand"),
        ):
            with pytest.warns(UserWarning, match="starts there in all worlds") as warned:
                call()
            assert [str(w.message) for w in warned] == [sentence]
            assert warned[0].filename == __file__
    c = arena.c_world(nominal, keyframe="stand")[1]
    np.testing.assert_array_equal(c.joint(0).qpos, arena.mj_model.key("stand").qpos[:7])
    fresh = mja.Arena.from_xml(WALKER)
    fresh.vary(turn=dr.Term("body.rpy", "trunk"))
    with pytest.warns(
        UserWarning, match=f"^{re.escape(turn)}$"
    ):  # an environment says it of its ranges, before any world
        Idle(fresh, mja.ArenaRanges(terms={"turn": mja.Uniform(-1, 1)}), keyframe="stand")


RANGED = """<mujoco><compiler angle="radian"/><worldbody><body name="b"><joint name="turn" range="-1 1" limited="true"/>
  <joint type="slide" range="0 .2" limited="true"/>
  <joint name="free" type="slide" axis="1 0 0"/><geom size=".05" contype="0" conaffinity="0"/></body></worldbody>
  <keyframe><key name="in" qpos="1 .2 9"/><key name="out" qpos="1.2 -.1 0"/><key qpos="0 .2009 0"/></keyframe></mujoco>"""
TOLD = (
    "{}: joints start outside of their ranges: joint '{}turn' at 1.2 of -1 to 1 in keyframe '{}out'; joint {} (slide of body '{}b') at "
    "-0.1 of 0 to 0.2 in keyframe '{}out'."
)


def test_outside_of_ranges():
    """A warning names joint, angle, range and keyframe, of robots and of base MJCF; limits are soft, so that a millimetre is none."""
    with pytest.warns(UserWarning, match="outside of their ranges") as warned:
        mja.TableArena(xml=RANGED)
    assert [str(w.message) for w in warned] == [TOLD.format("The arena", "", "", 1, "", "")]
    arena = mja.TableArena()
    with pytest.warns(UserWarning, match="outside of their ranges") as warned:
        arena.attach(RANGED, "r_")
    assert [str(w.message) for w in warned] == [TOLD.format("`robot`", "r_", "r_", 1, "r_", "r_")]
    arena.attach(RANGED.replace("1.2 -.1", "0 0"), "s_")  # the others are no business of this one's
