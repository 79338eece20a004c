"""Steps of another length, and other ratios of friction, in each world; and what takes one length of a step for all of them."""

import functools
import re

import jax
import mujoco
import numpy as np
import pytest
import worlds
from idle import Idle
from mujoco import mjx
from whole import differing

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.viz import film

SCENE = """<mujoco><option cone="elliptic" impratio="2" timestep=".002"/><worldbody>
<geom name="floor" type="plane" size="5 5 .1" friction="1 .05 .001" condim="6"/>
<body name="ball" pos="0 0 .1"><freejoint/><geom name="ball" size=".1" condim="6" friction=".6 .05 .001"/></body>
<body name="arm" pos="1 0 1"><joint name="hinge" axis="0 1 0" damping=".2" frictionloss=".1"/>
<geom name="arm" type="box" size=".1 .2 .3" pos=".2 0 0" contype="0" conaffinity="0"/></body></worldbody>
<actuator><general name="a" joint="hinge" dyntype="filterexact" dynprm=".03" gainprm="20"/></actuator></mujoco>"""
RANGES = mja.ArenaRanges(terms={"dt": mja.Uniform(0.001, 0.004), "ratio": mja.LogUniform(1.0, 20.0)})
KEYS = mja.world_keys(0, range(4))


@functools.cache
def arena():
    made = mja.Arena.from_xml(SCENE)
    made.vary(dt=dr.Term("option.timestep"), ratio=dr.Term("option.impratio"))
    return made


def batch(impl):
    return arena().randomize(arena().put_model(impl), KEYS, RANGES)


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_as_compiled_and_as_in_c(impl):
    """Leaf by leaf, and after thirty steps of a ball that slides and rolls, and of an actuator with a time constant."""
    made = batch(impl)
    data = mja.make_data(made)
    data = data.replace(qvel=data.qvel.at[:, :2].set(np.array([0.5, 0.2])), ctrl=data.ctrl + 0.3)
    after = mja.rollout(made, data, 30)
    ends = []
    for i in range(len(KEYS)):
        compiled = arena().compile(made.world(i))
        want = worlds.leaves(mjx.put_model(compiled, impl=impl))
        assert differing(compiled, worlds.leaves(arena().apply(arena().put_model(impl), made.world(i))), want) == set()
        c = mujoco.MjData(compiled)
        c.qvel[:2], c.ctrl[:] = (0.5, 0.2), 0.3
        mujoco.mj_step(compiled, c, 30)
        np.testing.assert_allclose(after.time[i], c.time, rtol=1e-5)
        np.testing.assert_allclose(after.qpos[i], c.qpos, atol=2e-5)
        np.testing.assert_allclose(after.qvel[i], c.qvel, atol=2e-3)
        ends.append(c.qpos)
    assert np.ptp([end[0] for end in ends]) > 0.01
    other = mja.check_randomization(arena().put_model(impl), made.model, made.in_axes)
    assert not other.problems


def test_c_batch(tmp_path):
    """C's own batch has them, and so has an export."""
    params = jax.vmap(lambda key: arena().sample_params(key, RANGES))(KEYS)
    many = arena().c_batch(params)
    many.step(nstep=10)
    np.testing.assert_allclose(np.ravel(many.time), 10 * params.terms["dt"].ravel(), rtol=1e-6)
    one = worlds.take(params, 1)
    arena().export(one, tmp_path / "world")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "world" / "world.xml"))
    assert [model.opt.timestep, model.opt.impratio] == [one.terms["dt"][0], one.terms["ratio"][0]]


def test_checks_say_no_seconds():
    """Where worlds have steps of several lengths; in C, whose worlds are compiled."""
    report = mja.check(arena(), RANGES, n_worlds=3, n_steps=5, engine="c")
    assert report.ok, report
    lengths = [arena().sample_params(key, RANGES).terms["dt"].item() for key in mja.world_keys(0, range(3))]
    assert f"5 steps of {min(lengths):g} to {max(lengths):g} s on" in str(report)
    assert report.to_dict()["seconds"] is None
    assert report.timestep is None


def two_in_c():
    """Two worlds whose steps are not of one length."""
    params = jax.vmap(lambda key: arena().sample_params(key, RANGES))(KEYS)
    return [arena().c_world(worlds.take(params, i)) for i in range(2)]


def test_films_need_one():
    """A film goes at the speed of life."""
    why = "`option.timestep` varies, and a film needs steps of one length"
    with pytest.raises(ValueError, match=f"^{re.escape(why)}"):
        film.c_video(arena(), two_in_c(), "x.mp4", seconds=0.1)


def test_environments_have_one():
    """`config.sim_dt` says how long a step is."""
    made = mja.Arena.from_xml(SCENE)
    made.vary(dt=dr.Term("option.timestep"))
    why = "`arena` must not vary `option.timestep` ('dt'): `config.sim_dt` is the step of all worlds of an environment."
    with pytest.raises(ValueError, match=f"^{re.escape(why)}$"):
        Idle(made, mja.ArenaRanges())


def test_wrong():
    """No step goes back in time."""
    with pytest.raises(
        ValueError, match=r"`ranges\.terms\.dt` of option 'option' can reach -0\.1: it must stay > 0 \[s\]"
    ):
        arena().check_ranges(mja.ArenaRanges(terms={"dt": mja.Uniform(-0.1, 0.1)}))
