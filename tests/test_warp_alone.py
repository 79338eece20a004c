"""Terms that MJX honours on Warp alone: each world is the compiled one, and steps as C does; on JAX they are refused."""

import functools
import re

import jax
import mujoco
import numpy as np
import pytest
import worlds
from mujoco import mjx
from whole import differing

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.params.params import with_values

BELT = """<mujoco><option cone="elliptic"/><worldbody><geom name="floor" type="plane" size="5 5 .1" surfacevel=".2 0 0 0 0 .1"/>
<geom name="ceiling" type="plane" pos="0 0 2" euler="180 0 0" size="5 5 .1" adhesion=".5"/>
<body name="ball" pos="0 0 .0998"><freejoint/><geom name="ball" size=".1" condim="6"/></body>
<body name="up" pos="1 0 1.9002"><freejoint/><geom name="up" size=".1" mass=".3" adhesion="0"/></body>
<body name="low" pos="2 0 .0998"><freejoint/><geom name="low" size=".1" mass=".3"/></body></worldbody>
<contact><pair name="stuck" geom1="low" geom2="floor" adhesion="1"/></contact></mujoco>"""
SPRINGS = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="j" axis="0 1 0" stiffness="3 1 2" damping=".2 .1 .3"/>
<geom type="box" size=".1 .2 .3" pos=".2 0 0" contype="0" conaffinity="0"/><site name="s" pos=".3 .1 0"/></body>
<site name="slider" pos=".1 0 .5"/>
<body name="b" pos="1 0 1"><joint name="k" axis="0 1 0"/><geom size=".1" pos=".1 0 0"/></body></worldbody>
<tendon><fixed name="t" stiffness="1 .5 .2" damping=".1 .2 .3"><joint joint="k" coef="2"/></fixed></tendon>
<actuator><general name="m" cranksite="s" slidersite="slider" cranklength=".8" gear="2"/></actuator></mujoco>"""
SCENES = {
    "belt": (
        BELT,
        {
            "belt": (dr.Term("geom.surfacevel", "floor"), lambda n: n * 2 + np.array([0.05, 0.1, 0, 0.1, 0.2, 0.3])),
            "sticks": (dr.Term("geom.adhesion", ["ceiling", "up"]), lambda n: n + 50),
            "pair": (dr.Term("pair.adhesion"), lambda n: n + 100),
        },
    ),
    "springs": (
        SPRINGS,
        {
            "stiff": (dr.Term("joint.stiffnesspoly", "j"), lambda n: n * 100 + 200),
            "damp": (dr.Term("joint.dampingpoly", "j"), lambda n: n * 3),
            "taut": (dr.Term("tendon.stiffnesspoly"), lambda n: n * 100 + 100),
            "slow": (dr.Term("tendon.dampingpoly"), lambda n: n * 3),
            "rod": (dr.Term("actuator.cranklength"), lambda n: n * 0.7),
        },
    ),
}


@functools.cache
def arena(scene):
    made = mja.Arena.from_xml(SCENES[scene][0])
    made.vary(**{name: term for name, (term, _) in SCENES[scene][1].items()})
    return made


def other(scene, names):
    """Parameters in which some quantities are others."""
    nominal = jax.tree.map(np.asarray, arena(scene).nominal_params())
    return with_values(nominal, {name: SCENES[scene][1][name][1](nominal.terms[name]) for name in names})


def push(data, scene):
    """Something to do for springs, dampings, belts and cranks."""
    qvel = np.zeros(data.qvel.shape)
    if scene == "springs":
        qvel[..., :2] = 1.5
    else:
        qvel[..., [0, 14]] = 0.3  # the ball along the belt, and the low one up
    return qvel, np.full(data.ctrl.shape, 100.0)


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_as_compiled_and_as_in_c(scene):
    """Each quantity alone has an effect, in the same steps as in C."""
    quantities = arena(scene).quantities
    cases = [(), *((name,) for name in quantities), quantities]
    params = [other(scene, names) for names in cases]
    model = arena(scene).put_model("warp")
    batch = arena(scene).batch(model, jax.tree.map(lambda *x: np.stack(x), *params))
    data = mja.make_data(batch)
    qvel, ctrl = push(data, scene)
    after = mja.rollout(batch, data.replace(qvel=qvel.astype(np.float32), ctrl=ctrl.astype(np.float32)), 40)
    ends = []
    for i, names in enumerate(cases):
        compiled = arena(scene).compile(params[i])
        got, want = (
            worlds.leaves(arena(scene).apply(model, params[i])),
            worlds.leaves(mjx.put_model(compiled, impl="warp")),
        )
        assert differing(compiled, got, want) == set(), names
        c = mujoco.MjData(compiled)
        c.qvel[:], c.ctrl[:] = push(c, scene)
        mujoco.mj_step(compiled, c, 40)
        np.testing.assert_allclose(after.qpos[i], c.qpos, atol=2e-5, err_msg=str(names))
        ends.append(c.qpos.copy())
    effects = {names: np.abs(end - ends[0]).max() for names, end in zip(cases[1:], ends[1:], strict=True)}
    assert min(effects.values()) > 2e-4, effects
    off = mja.differences(batch.model, {i: arena(scene).compile(one) for i, one in enumerate(params)})
    assert max(off.values()) < 1e-5, off


@pytest.mark.parametrize("attribute", ["geom.surfacevel", "geom.adhesion"])
def test_refused_on_jax(attribute):
    """MJX on JAX would leave them out."""
    made = mja.Arena.from_xml(BELT)
    made.vary(x=dr.Term(attribute, "floor|ceiling"))
    why = f"impl='jax' of MJX cannot vary '{attribute}' of geom 'floor', as MJX has it on Warp alone: use impl='warp'."
    with pytest.raises(ValueError, match=f"^{re.escape(why)}$"):
        made.apply(mjx.put_model(made.mj_model, impl="jax"), made.nominal_params())


NOTHING = "no element of the MJCF has any, so MJX leaves it out of the step: give one element a small number"
FLAT = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/><body name="b" pos="0 0 .1"><joint name="j" type="slide"/>
<geom name="b" size=".1"/></body></worldbody><actuator><motor name="m" joint="j"/></actuator></mujoco>"""
REFUSED = {
    "geom.surfacevel": ("floor", f"'geom.surfacevel' of geom 'floor' cannot vary, as {NOTHING}."),
    "geom.adhesion": ("floor", f"'geom.adhesion' of geom 'floor' cannot vary, as {NOTHING}."),
    "actuator.cranklength": (
        "m",
        "'actuator.cranklength' of actuator 'm' cannot vary, as it has no `cranksite`: vary `actuator.gear`.",
    ),
}


@pytest.mark.parametrize("attribute", REFUSED)
def test_from_nothing(attribute):
    """Warp compiles its steps without what nothing has."""
    name, why = REFUSED[attribute]
    with pytest.raises(ValueError, match=f"^`x.elements`: {re.escape(why)}$"):
        mja.Arena.from_xml(FLAT).vary(x=dr.Term(attribute, name))


def test_c_batch():
    """C's own batch has them, too, also where MJX on JAX has no field for them."""
    params = [other("belt", names) for names in ((), arena("belt").quantities)]
    many = arena("belt").c_batch(jax.tree.map(lambda *x: np.stack(x), *params))
    many.step(nstep=20)
    for i, one in enumerate(params):
        compiled = arena("belt").compile(one)
        c = mujoco.MjData(compiled)
        mujoco.mj_step(compiled, c, 20)
        np.testing.assert_allclose(many.qpos[i], c.qpos, atol=1e-6)


TILES = """<mujoco><asset><texture name="t" type="2d" builtin="checker" rgb1="1 1 1" rgb2="0 0 0" width="64" height="64"/>
<material name="m" texture="t" texrepeat="2 2"/></asset><worldbody><light pos="0 0 3"/><geom type="plane" size="1.3 .7 .1" material="m"/>
<body name="b" pos="0 0 5"><freejoint/><geom size=".1"/></body><camera name="c" pos="0 0 2" resolution="32 32"/></worldbody></mujoco>"""


@pytest.mark.slow
def test_textures_in_pictures(impl):
    """Repeated otherwise: each world is drawn as an arena of its own MJCF, states of JAX, too."""
    made = mja.Arena.from_xml(TILES)
    made.vary(repeat=dr.Term("material.texrepeat"), spread=dr.Term("material.texuniform"))
    nominal = jax.tree.map(np.asarray, made.nominal_params())
    params = [
        nominal,
        with_values(nominal, {"repeat": np.array([[5.0, 3.0]])}),
        with_values(nominal, {"spread": np.array([True])}),
    ]
    batch = made.batch(made.put_model(impl), jax.tree.map(lambda *x: np.stack(x), *params))
    pictures = np.asarray(made.renderer()(batch, mja.make_data(batch))["c"].rgb)
    for i, one in enumerate(params):
        alone = mja.Arena.from_xml(made.to_xml(one))
        world = alone.batch(alone.put_model(impl), jax.tree.map(lambda x: np.asarray(x)[None], alone.nominal_params()))
        np.testing.assert_array_equal(pictures[i], alone.renderer()(world, mja.make_data(world))["c"].rgb[0])
    assert (pictures[1:] != pictures[0]).any((1, 2, 3)).all()
