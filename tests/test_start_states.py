"""Start states that vary: of joints, and of equalities; on the device, in C, in episodes and in files."""

import json
import re

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from idle import Idle

import mjx_arenas as mja
from mjx_arenas import dr

SCENE = """<mujoco><worldbody><geom name="floor" type="plane" size="3 3 .1" pos="0 0 -1"/>
<body name="cupboard" pos=".5 0 .5"><geom name="wall" type="box" size=".01 .2 .2" contype="0" conaffinity="0"/>
<body name="door" pos="0 -.2 0"><joint name="hinge" axis="0 0 1" damping=".1"/>
<geom name="leaf" type="box" size=".01 .1 .2" pos="0 .1 0"/></body></body>
<body name="drawer" pos="0 .5 .5"><joint name="slide" type="slide" axis="1 0 0" damping="1"/>
<geom name="box" type="box" size=".1 .1 .05"/></body>
<body name="ball" pos="0 0 2"><freejoint name="free"/><geom name="ball" size=".05"/></body></worldbody>
<equality><joint name="tied" joint1="hinge" joint2="slide" active="false"/></equality>
<keyframe><key name="ajar" qpos=".3 .02 0 0 2 1 0 0 0" qvel=".5 0 0 0 0 0 0 0"/></keyframe></mujoco>"""
RANGES = mja.ArenaRanges(
    terms={
        "opening": mja.Uniform(0.0, 1.2),
        "pulled": mja.Uniform(-0.05, 0.1),
        "speed": mja.Normal(0.0, 0.2, -1.0, 1.0),
        "tied": mja.Bernoulli(0.5),
    }
)


@pytest.fixture(scope="module")
def arena():
    arena = mja.Arena.from_xml(SCENE)
    arena.vary(
        opening=dr.Term("joint.qpos", "hinge"),
        pulled=dr.Term("joint.qpos", "slide"),
        speed=dr.Term("joint.qvel", ["hinge", "slide"]),
        tied=dr.Term("equality.active"),
    )
    return arena


KEYS = mja.world_keys(0, range(8))


@pytest.mark.xslow_on("jax")
@pytest.mark.parametrize("keyframe", [None, "ajar"])
@pytest.mark.slow
def test_data_begin_there(arena, impl, keyframe):
    """At `qpos0` or in a keyframe, and what a world draws on top; C's worlds begin and move alike."""
    batch = arena.randomize(arena.put_model(impl), KEYS, RANGES)
    data = mja.make_data(batch, KEYS, keyframe=keyframe)
    terms = batch.params.terms
    begin = (0.3, 0.02, 0.5) if keyframe else (0.0, 0.0, 0.0)
    np.testing.assert_allclose(data.qpos[:, 0], begin[0] + terms["opening"][:, 0], rtol=1e-6)
    np.testing.assert_allclose(data.qpos[:, 1], begin[1] + terms["pulled"][:, 0], rtol=1e-6)
    np.testing.assert_allclose(data.qvel[:, :2], terms["speed"] + jnp.array([begin[2], 0.0]), rtol=1e-6, atol=1e-7)
    np.testing.assert_array_equal(np.asarray(data.eq_active)[:, 0] != 0, terms["tied"][:, 0])
    assert len({*np.asarray(terms["tied"])[:, 0].tolist()}) == 2
    after = mja.rollout(batch, data, 5)
    for i in range(4):
        model, c = arena.c_world(batch.world(i), keyframe=keyframe)
        np.testing.assert_allclose(data.qpos[i], c.qpos, atol=1e-6)
        np.testing.assert_allclose(data.qvel[i], c.qvel, atol=1e-6)
        mujoco.mj_step(model, c, nstep=5)
        np.testing.assert_allclose(after.qpos[i], c.qpos, atol=2e-5)


def test_nothing_of_the_model_varies(arena):
    """Positions and velocities are none of its fields, and no program for it is traced anew."""
    model = arena.put_model("jax")
    batch = arena.randomize(model, KEYS, RANGES)
    assert batch.fields == ()
    assert jax.tree.leaves(batch.in_axes) == []


def test_c_batch_begins_there(arena):
    """C's own batch."""
    params = jax.vmap(lambda key: arena.sample_params(key, RANGES))(KEYS)
    batch = arena.c_batch(params)
    for i in range(4):
        c = arena.c_world(jax.tree.map(lambda x, i=i: np.asarray(x)[i], params))[1]
        np.testing.assert_allclose(batch.qpos[i], c.qpos, atol=1e-6)
        np.testing.assert_allclose(batch.qvel[i], c.qvel, atol=1e-6)
        np.testing.assert_array_equal(batch.eq_active[i], c.eq_active)


def test_exports_begin_there(arena, tmp_path):
    """A world's folder has the start as a keyframe, and the draw in its note."""
    params = arena.sample_params(KEYS[0], RANGES)
    arena.export(params, tmp_path / "world")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "world" / "world.xml"))
    c = arena.c_world(params)[1]
    key = next(model.key(i) for i in range(model.nkey) if np.allclose(model.key(i).qpos, c.qpos, atol=1e-6))
    np.testing.assert_allclose(key.qvel, c.qvel, atol=1e-6)
    assert model.eq_active0 == c.eq_active
    note = json.loads((tmp_path / "world" / "params.json").read_text())
    np.testing.assert_allclose(note["terms"]["opening"], params.terms["opening"], rtol=1e-6)


@pytest.mark.slow
def test_episodes_begin_there(arena):
    """The first episode of an environment, and the next, each with a draw of its own."""
    env = Idle(arena, RANGES)
    state = jax.jit(env.reset)(jax.random.key(0))
    first = state.info["episode"].params.terms
    np.testing.assert_allclose(state.data.qpos[0], first["opening"][0], rtol=1e-6)
    np.testing.assert_allclose(state.data.qvel[:2], first["speed"], rtol=1e-6)
    following = jax.jit(env._draw)(env.mjx_model, jax.random.key(9), jnp.zeros(()), None)
    begun = jax.jit(env._started)(state.data, following, jnp.array(True))
    want = following.params.terms
    assert want["opening"] != first["opening"]
    np.testing.assert_allclose(begun.qpos[:2], [want["opening"][0], want["pulled"][0]], rtol=1e-6)
    np.testing.assert_allclose(begun.qvel[:2], want["speed"], rtol=1e-6)
    assert bool(begun.eq_active[0]) == bool(want["tied"][0])


@pytest.mark.xslow
@pytest.mark.slow
def test_checks_begin_there(arena):
    """`check` on both engines starts worlds as `make_data` does."""
    for engine in ("jax", "c"):
        report = mja.check(arena, RANGES, n_worlds=4, n_steps=3, engine=engine)
        assert not report.failures, report


NO_AXIS = "it is no hinge and no slide: vary `body.start_rpy` or `body.start_angvel`"


@pytest.mark.parametrize(
    ("term", "why"),
    [
        (dr.Term("joint.qpos", "free"), NO_AXIS),
        (dr.Term("joint.qvel", "free"), NO_AXIS),
    ],
)
def test_refused(term, why):
    """Free and ball joints have no one number; objects have places."""
    with pytest.raises(ValueError, match=rf"cannot vary, as {why}\.$"):
        mja.Arena.from_xml(SCENE).vary(x=term)


def test_scaled_nothing(arena):
    """A factor on what is 0 varies nothing, and is refused."""
    why = "'scale' has no effect, as the MJCF has 0: use 'add', or leave it out."
    why = f"`ranges.terms.opening` (Uniform): `relative`: {why}"
    with pytest.raises(ValueError, match=f"^{re.escape(why)}$"):
        arena.check_ranges(mja.ArenaRanges(terms={"opening": mja.Uniform(0.5, 1.0, relative="scale")}))


PUSHED = """<mujoco><worldbody>
<body name="b" pos="0 0 1"><freejoint/><geom name="b" type="box" size=".1 .2 .3" contype="0" conaffinity="0"/>
</body></worldbody></mujoco>"""


@pytest.mark.slow
def test_pushes(impl):
    """Forces that are set between steps act on the masses of worlds."""
    arena = mja.Arena.from_xml(PUSHED)
    arena.vary(mass=dr.Term("body.mass"))
    ranges, wrench = mja.ArenaRanges(terms={"mass": mja.Uniform(0.5, 2, relative="scale")}), [3.0, 1, 0, 0.2, 0, 0.1]
    batch = arena.randomize(arena.put_model(impl), mja.world_keys(0, range(3)), ranges)
    data = mja.make_data(batch)
    data = data.replace(xfrc_applied=data.xfrc_applied.at[:, 1].set(jnp.array(wrench)))
    data = mja.step(batch, mja.step(batch, data))
    for i in range(3):
        model = arena.compile(batch.world(i))
        c = mujoco.MjData(model)
        c.xfrc_applied[1] = wrench
        mujoco.mj_step(model, c, 2)
        np.testing.assert_allclose(data.qvel[i], c.qvel, rtol=1e-5, atol=1e-7)


class Pushed(Idle):
    """A body that gets a push in each step, and is seen with a bias of its episode."""

    def draw_task(self, key, params, qpos):
        return jax.random.uniform(key, minval=0.5, maxval=1.0)

    def observe(self, data, episode):
        return {"state": data.qpos + episode.task, "privileged_state": data.qpos}

    def step(self, state, action):
        push = jnp.array([1.0, 0, 0, 0, 0, 0])
        return super().step(state.replace(data=state.data.replace(qvel=state.data.qvel + push)), action)


@pytest.mark.slow
def test_pushes_of_environments():
    """As docs/terms.md has them: in `step`, and a bias in `observe`."""
    env = Pushed(mja.Arena.from_xml(PUSHED), mja.ArenaRanges())
    state = jax.jit(env.reset)(jax.random.key(0))
    step = jax.jit(env.step)
    for n in range(1, 4):
        state = step(state, jnp.zeros(0))
        np.testing.assert_allclose(state.data.qvel[0], n, rtol=1e-6)
        bias = state.obs["state"] - state.obs["privileged_state"]
        np.testing.assert_allclose(bias, state.info["episode"].task, rtol=1e-5)
        assert 0.5 <= bias[0] <= 1.0
