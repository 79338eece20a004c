"""Poses and velocities with which free and ball-jointed bodies start: a quadruped's base, a head on a ball joint."""

import functools
import re

import jax
import mujoco
import numpy as np
import pytest
import worlds
from idle import Idle

import mjx_arenas as mja
from mjx_arenas import dr

SCENE = """<mujoco><worldbody><geom name="floor" type="plane" size="3 3 .1" pos="0 0 -1"/>
<body name="post" pos="0 1 0"><body name="flag"><joint name="flag"/><geom size=".02" pos=".1 0 0" contype="0"
conaffinity="0"/></body></body>
<body name="trunk" pos=".2 .1 .5" euler="10 20 30"><freejoint/><geom name="trunk" type="box" size=".1 .05 .03"/>
<body name="head" pos=".15 0 0"><joint type="ball" pos="-.02 0 0" damping=".01"/><geom name="head" type="box" size=".03 .02 .02"/></body>
<body name="leg" pos="0 0 -.05"><joint name="hip" axis="0 1 0" damping=".1"/><geom name="leg" size=".02" pos="0 0 -.1"/></body></body>
<body name="lamp" pos="1 0 0" euler="0 0 40"><joint type="ball"/><geom name="lamp" size=".05" pos=".1 0 0"/></body></worldbody>
<keyframe><key name="low" qpos=".1 0 .1 .2 .7 .5 .5 .1 .6 .8 0 0 .3 .8 0 .6 0"
qvel=".1 .2 .3 .4 .5 .6 .7 .8 .9 .1 .2 .3 .4 .5"/></keyframe></mujoco>"""
RANGES = mja.ArenaRanges(
    terms={
        "at": mja.Uniform(-0.1, 0.1),
        "turned": mja.Uniform([-0.3, -0.5, -3.0], [0.3, 0.5, 3.0]),
        "speed": mja.Uniform(-0.5, 0.5),
        "spin": mja.Normal(0.0, 1.0, -2.0, 2.0),
        "hip": mja.Uniform(-0.2, 0.2),
        "there": mja.Bernoulli(0.5),
        "flag": mja.Uniform(0.1, 0.2),
    }
)
KEYS = mja.world_keys(0, range(6))
TURNED, SPUN = ("trunk", "head", "lamp"), ("trunk", "head", "lamp")


@functools.cache
def arena():
    made = mja.Arena.from_xml(SCENE)
    made.vary(
        at=dr.Term("body.start_pos", axes=("x", "z")),
        turned=dr.Term("body.start_rpy"),
        speed=dr.Term("body.start_vel", "trunk"),
        spin=dr.Term("body.start_angvel"),
        hip=dr.Term("joint.qpos", "hip"),
        there=dr.Term("body.active", "post"),
        flag=dr.Term("joint.qpos", "flag"),
    )
    return made


@functools.cache
def drawn():
    return jax.vmap(lambda key: arena().sample_params(key, RANGES))(KEYS)


def turned(start, rpy):
    """A quaternion turned by roll, pitch and yaw in its own frame, in C's arithmetic."""
    for axis, angle in zip(np.eye(3)[::-1], rpy[::-1], strict=True):
        turn = np.zeros(4)
        mujoco.mju_axisAngle2Quat(turn, axis, angle)
        mujoco.mju_mulQuat(start, start.copy(), turn)
    return start


def expected(params, keyframe):
    """(nq,) and (nv,) of the whole model: what is drawn, on top of the nominal start."""
    model, terms = arena().mj_model, params.terms
    c = mujoco.MjData(model)
    if keyframe:
        mujoco.mj_resetDataKeyframe(model, c, model.key(keyframe).id)
    adr, dof = (
        {name: getattr(model, f"jnt_{kind}adr")[model.body(name).jntadr[0]] for name in (*TURNED, "leg", "flag")}
        for kind in ("qpos", "dof")
    )
    c.qpos[adr["trunk"] + np.array([0, 2])] += terms["at"][0, [0, 2]]
    for name, rpy in zip(TURNED, terms["turned"], strict=True):
        first = adr[name] + 3 * (name == "trunk")
        c.qpos[first : first + 4] = turned(np.array(c.qpos[first : first + 4]), np.asarray(rpy, float))
    c.qvel[dof["trunk"] + np.arange(3)] += terms["speed"][0]
    for name, spin in zip(SPUN, terms["spin"], strict=True):
        c.qvel[dof[name] + 3 * (name == "trunk") + np.arange(3)] += spin
    c.qpos[adr["leg"]] += terms["hip"][0]
    c.qpos[adr["flag"]] += terms["flag"][0]
    return c.qpos, c.qvel


@pytest.mark.xslow_on("jax")
@pytest.mark.parametrize("keyframe", [None, "low"])
@pytest.mark.slow
def test_data_begin_there(impl, keyframe):
    """At `qpos0` or in a keyframe, and what a world draws composed with that; C's worlds begin and move alike."""
    batch = arena().batch(arena().put_model(impl), drawn())
    data = mja.make_data(batch, keyframe=keyframe)
    after = mja.rollout(batch, data, 5)
    present = np.asarray(drawn().terms["there"])[:, 0]
    assert 0 < present.sum() < len(present)
    for i in range(len(KEYS)):
        params = worlds.take(drawn(), i)
        qpos, qvel = expected(params, keyframe)
        np.testing.assert_allclose(data.qpos[i], qpos, atol=1e-6)
        np.testing.assert_allclose(data.qvel[i], qvel, atol=1e-6)
        model, c = arena().c_world(params, keyframe=keyframe)
        first = 0 if present[i] else 1  # the flag goes with its post
        np.testing.assert_allclose(c.qpos, qpos[first:], atol=1e-6)
        np.testing.assert_allclose(c.qvel, qvel[first:], atol=1e-6)
        mujoco.mj_step(model, c, nstep=5)
        np.testing.assert_allclose(after.qpos[i, first:], c.qpos, atol=2e-5)


@pytest.mark.slow
def test_c_begins_there(tmp_path):
    """C's own batch, and a world's folder, which has the start as a keyframe."""
    batch = arena().c_batch(drawn())
    for i in range(len(KEYS)):
        qpos, qvel = expected(worlds.take(drawn(), i), None)
        np.testing.assert_allclose(batch.qpos[i], qpos, atol=1e-6)
        np.testing.assert_allclose(batch.qvel[i], qvel, atol=1e-6)
    there = int(np.flatnonzero(drawn().terms["there"][:, 0])[0])
    qpos, qvel = expected(worlds.take(drawn(), there), None)
    arena().export(worlds.take(drawn(), there), tmp_path / "world")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "world" / "world.xml"))
    assert [k for k in range(model.nkey) if np.allclose(model.key(k).qpos, qpos, atol=1e-6)]
    assert [k for k in range(model.nkey) if np.allclose(model.key(k).qvel, qvel, atol=1e-6)]


@pytest.mark.slow
def test_episodes_begin_there():
    """Each with a draw of its own."""
    env = Idle(arena(), RANGES)
    state = jax.jit(env.reset)(jax.random.key(0))
    qpos, qvel = expected(jax.tree.map(np.asarray, state.info["episode"].params), None)
    np.testing.assert_allclose(state.data.qpos, qpos, atol=1e-6)
    np.testing.assert_allclose(state.data.qvel, qvel, atol=1e-6)


@pytest.mark.xslow
@pytest.mark.slow
def test_checks_begin_there():
    """On both engines."""
    for engine in ("jax", "c"):
        report = mja.check(arena(), RANGES, n_worlds=4, n_steps=3, engine=engine)
        assert not report.failures, report


def test_as_points():
    """They are numbers of a unit cube, and back."""
    params = arena().sample_params(KEYS[0], RANGES)
    point = arena().encode(params, RANGES)
    again = arena().decode(point, RANGES)
    for name in RANGES.terms:
        np.testing.assert_allclose(again.terms[name], params.terms[name], rtol=1e-5, atol=1e-6)
    assert np.isfinite(arena().log_prob(params, RANGES))


OTHERS = "vary `body.pos`, `body.rpy` or `joint.qpos`"
WRONG = {
    "a hinge": ("body.start_rpy", "leg", "leg", f"no free or ball joint of its own carries it: {OTHERS}"),
    "a ball": ("body.start_pos", "head", "head", f"no free joint of its own carries it: {OTHERS}"),
    "an object": ("body.start_vel", "cube", "cube", "it is an Object, which has places instead"),
    "objects alone": ("body.start_pos", None, "cube", "it is an Object, which has places instead"),
}


@pytest.mark.parametrize("case", WRONG)
def test_refused(case):
    attribute, elements, name, why = WRONG[case]
    objects = "object" in case
    made = mja.TableArena(objects=[mja.Object("cube")]) if objects else mja.Arena.from_xml(SCENE)
    with pytest.raises(
        ValueError, match=rf"^`x.elements`: '{attribute}' of body '{name}' cannot vary, as {re.escape(why)}\.$"
    ):
        made.vary(x=dr.Term(attribute, elements))
