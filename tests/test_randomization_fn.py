"""Arenas in the training of others: Playground's wrappers and Brax's PPO, run for real."""

import functools
import operator
import pickle
import re

import documented
import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import third_party
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas import brax_bridge, dr, furniture
from mjx_arenas.envs.static_geoms import StaticGeoms
from mjx_arenas.sample import sampling

pytestmark = pytest.mark.slow_on("warp")

wrapper = pytest.importorskip("mujoco_playground").wrapper

RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.05, -0.05, -0.2], [0.05, 0.05, 0.2], relative="add"),
    table_rots=mja.Uniform(-0.5, 0.5),
)
N, STEPS = 4, 30
# C steps in double precision, with its own solver's iterations; worlds' tables differ by centimetres.
TOLERANCE = 1e-4


@pytest.fixture(scope="module")
def small():
    return third_party.small_arena()


@pytest.fixture(scope="module")
def expected(small):
    params = [small.sample_params(key, RANGES) for key in sampling.trainers_keys(third_party.keys(N))]
    z = third_party.heights(small, params, STEPS)
    assert np.ptp(z) > 0.1
    return z


def rolled(env, randomize, full_reset=False):
    """(W,) heights of the balls in the second episode, after STEPS steps."""
    env = wrapper.wrap_for_brax_training(
        env,
        episode_length=STEPS + 1,
        full_reset=full_reset,
        randomization_fn=functools.partial(randomize, rng=third_party.keys(N)),
    )
    step, state = jax.jit(env.step), jax.jit(env.reset)(third_party.keys(N))
    for i in range(2 * STEPS + 1):
        state = step(state, np.zeros((N, 1), np.float32))
        assert state.done.all() == (i == STEPS)  # and the state is the next episode's first one
    return np.asarray(state.data.qpos[:, 2])


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
@pytest.mark.parametrize("full_reset", [False, True])
def test_ball_rests_on_each_worlds_table(small, impl, expected, full_reset):
    """In an environment that makes its own data, in the second episode, too."""
    env = StaticGeoms(third_party.Rest(small.mj_model, small.put_model(impl)))
    z = rolled(env, small.randomization_fn(RANGES), full_reset)
    np.testing.assert_allclose(z, expected, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("impl", ["warp"], indirect=True)
def test_without_static_geoms(small, impl, expected):
    """On Warp, tables then collide where the template's stands: that is what the test above would see."""
    env = third_party.Rest(small.mj_model, small.put_model(impl))
    z = rolled(env, small.randomization_fn(RANGES))
    assert abs(z - expected).max() > 100 * TOLERANCE


PPO = {
    "num_timesteps": 16,
    "num_evals": 2,
    "num_envs": N,
    "num_eval_envs": 3,
    "episode_length": 2,
    "unroll_length": 2,
    "batch_size": N,
    "num_minibatches": 1,
    "num_updates_per_batch": 1,
    "max_devices_per_host": 1,
}


@pytest.mark.slow
@pytest.mark.parametrize("impl", ["warp"], indirect=True)  # as above, where both are compared with C MuJoCo
def test_documented_training(small, impl, capsys):
    """The code of docs/training.md as it stands: the check, and PPO, which asks for training's worlds and evaluation's."""
    from brax.training.agents.ppo import networks

    blocks = documented.blocks("In your own Brax or Playground training")
    nets = functools.partial(networks.make_ppo_networks, policy_hidden_layer_sizes=(4,), value_hidden_layer_sizes=(4,))
    seen = []
    names = {
        "arena": small,
        "env": third_party.Rest(small.mj_model, small.put_model(impl)),
        "ppo_params": PPO | {"network_factory": nets, "progress_fn": lambda steps, metrics: seen.append(metrics)},
    }
    for block in blocks[:2]:
        documented.run(block, names)
    assert "body_pos" in capsys.readouterr().out
    randomize, asked = names["randomize"], []

    def recorded(model, rng):
        model_v, in_axes = randomize(model, rng=rng)
        asked.append(np.asarray(model_v.body_pos))
        return model_v, in_axes

    names["randomize"] = recorded
    theirs = {}
    documented.run(blocks[2], theirs)
    assert PPO.keys() - theirs["ppo_params"].keys() == {"num_evals", "num_eval_envs", "max_devices_per_host"}
    documented.run(blocks[3], names)
    assert [len(a) for a in asked] == [N, 3]
    assert len(np.unique(np.concatenate(asked)[:, 1], axis=0)) == N + 3
    assert [np.isfinite(m["eval/episode_reward"]) for m in seen] == [True, True]
    leaves = jax.tree.leaves(names["params"])
    assert all(np.isfinite(leaf).all() for leaf in leaves)


def test_worlds_are_those_of_randomize(small, impl):
    """With keys folded from the trainer's, typed or raw, of any number, call after call."""
    model, randomize = small.put_model(impl), small.randomization_fn(RANGES)
    for n, key in ((1, jax.random.key(5)), (N, jax.random.PRNGKey(5))):
        rng = jax.random.split(key, n)
        model_v, in_axes = randomize(model, rng=rng)
        batch = small.randomize(model, sampling.trainers_keys(rng), RANGES)
        assert jax.tree.structure(model_v) == jax.tree.structure(model)
        axes = {jax.tree_util.keystr(p)[1:] for p, _ in jax.tree_util.tree_leaves_with_path(in_axes)}
        assert axes == set(batch.fields)
        for name in batch.fields:
            got = operator.attrgetter(name)(model_v)
            assert got.shape == (n, *operator.attrgetter(name)(model).shape), name
            np.testing.assert_array_equal(got, operator.attrgetter(name)(batch.model), err_msg=name)
        plain = small.randomize(model, rng, RANGES)
        assert abs(np.asarray(plain.model.body_pos - model_v.body_pos)).max() > 1e-3, "draws are independent of resets"


def test_devices_share_arenas(small, caplog, monkeypatch):
    """Brax asks for the arenas of one device, and every device gets them: a warning says so, where there are several."""
    from brax.training.agents.ppo import train

    assert jax.local_device_count() > 1
    randomize = small.randomization_fn(RANGES)
    assert [r.name for r in caplog.records] == ["mjx_arenas"]
    assert "each of the 4 devices here the same arenas, num_envs // devices different ones in all" in caplog.text
    assert "draw their arenas in reset" in caplog.text
    env = StaticGeoms(third_party.Rest(small.mj_model, small.put_model("jax")))
    wrapped = train._maybe_wrap_env(
        env, True, 8, 2, 1, 4, jax.random.PRNGKey(0), wrapper.wrap_for_brax_training, randomize
    )
    assert wrapped.env.env._mjx_model_v.body_pos.shape[0] == 2
    caplog.clear()
    monkeypatch.setattr(jax, "local_device_count", lambda: 1)
    small.randomization_fn(RANGES)
    assert not caplog.records


BAD = {
    "numbers": (
        lambda f, m: f(m, rng=3),
        "`rng` must be an array of keys such as jax.random.split(key, n_worlds), got 3.",
    ),
    "one typed key": (
        lambda f, m: f(m, rng=jax.random.key(0)),
        "`rng` must be one key per world, shape (W,) or, of jax.random.PRNGKey, (W, 2), got shape ().",
    ),
    "one raw key": (
        lambda f, m: f(m, rng=jax.random.PRNGKey(0)),
        "`rng` must be one key per world, shape (W,) or, of jax.random.PRNGKey, (W, 2), got shape (2,).",
    ),
    "floats": (
        lambda f, m: f(m, rng=np.zeros((3, 2), np.float32)),
        (
            "`rng` must be keys such as jax.random.split(key, n_worlds), or raw keys, uint32 of shape (W, 2), got float32 "
            "of shape (W, 2)."
        ),
    ),
    "raw of another shape": (
        lambda f, m: f(m, rng=np.zeros((3, 4), np.uint32)),
        (
            "`rng` must be keys such as jax.random.split(key, n_worlds), or raw keys, uint32 of shape (W, 2), got uint32 "
            "of shape (W, 4)."
        ),
    ),
    "another arena": (
        lambda f, m: f(mja.TableArena().put_model("jax"), rng=third_party.keys(2)),
        (
            "`model` must come from this arena's put_model() (nbody 3, ngeom 8, nsite 1, nq 7, nv 6), got the model of "
            "another arena (nbody 2, ngeom 7, nsite 1, nq 0, nv 0)."
        ),
    ),
    "batched": (
        lambda f, m: f(f(m, rng=third_party.keys(2))[0], rng=third_party.keys(2)),
        "`model` must be of one world, got one with batched leaves: randomize and apply start from put_model().",
    ),
    "batched masses": (
        lambda f, m: f(m.replace(body_mass=jnp.stack([m.body_mass] * 2)), rng=third_party.keys(2)),
        "`model` must be of one world, got one with batched leaves: randomize and apply start from put_model().",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_calls(small, case):
    """One sentence each."""
    call, message = BAD[case]
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        call(small.randomization_fn(RANGES), small.put_model("jax"))


def test_bad_ranges(small):
    """When the function is made, as `randomize` says it."""
    for ranges in (
        mja.ArenaRanges(table_offsets=mja.Uniform(np.zeros((2, 3)), np.ones((2, 3)))),
        mja.ArenaRanges(table_rots=mja.Uniform(1, 0)),
    ):
        with pytest.raises(ValueError, match="`ranges") as alone:
            small.randomize(small.put_model("jax"), third_party.keys(2), ranges)
        with pytest.raises(ValueError, match=f"^{re.escape(str(alone.value))}$"):
            small.randomization_fn(ranges)
    with pytest.raises(TypeError, match=r"^`ranges` must be an mjx_arenas\.ArenaRanges, got dict\.$"):
        small.randomization_fn({})
    with pytest.raises(
        ValueError, match=r"^`ranges` gives no quantity a distribution: there is nothing to randomize\.$"
    ):
        small.randomization_fn(mja.ArenaRanges())


def test_static_geoms_is_the_environment(small):
    """All but `reset` is the environment's, also inside another wrapper; it survives a copy."""
    model = small.put_model("jax")
    env = third_party.Rest(small.mj_model, model)
    wrapped = StaticGeoms(wrapper.Wrapper(env))
    assert wrapped.unwrapped is wrapped
    assert wrapper.Wrapper(wrapped).unwrapped is wrapped
    assert (wrapped.action_size, wrapped.mjx_model, wrapped.mj_model) == (1, model, small.mj_model)
    other = model.replace(body_pos=model.body_pos + 1)
    wrapped._mjx_model = other
    assert env._mjx_model is other
    assert pickle.loads(pickle.dumps(StaticGeoms(_Empty()))).unwrapped.env.depth == 3
    with pytest.raises(AttributeError, match="no_such_thing"):
        wrapped.no_such_thing  # noqa: B018
    with pytest.raises(
        TypeError,
        match=r"^`env` must be an environment that reads its model from `_mjx_model`, as MuJoCo Playground's do, got int\.$",
    ):
        StaticGeoms(3)


class _Empty:
    _mjx_model, depth = None, 3


@pytest.mark.parametrize("own", [True, False])
def test_brax_bridge(own, monkeypatch):
    """A copy on each device while it lasts; afterwards JAX has what it had."""
    monkeypatch.delitem(vars(jax), "device_put_replicated", raising=False)
    if own:
        monkeypatch.setitem(vars(jax), "device_put_replicated", len)
    with brax_bridge.device_put_replicated():
        with brax_bridge.device_put_replicated():
            pass
        copies = jax.device_put_replicated({"x": np.arange(3.0), "y": 1.0}, jax.local_devices()[:2])
    np.testing.assert_array_equal(copies["x"], [[0, 1, 2]] * 2)
    assert {shard.device: shard.data.shape for shard in copies["x"].addressable_shards} == dict.fromkeys(
        jax.local_devices()[:2], (1, 3)
    )
    np.testing.assert_array_equal(jax.pmap(lambda x: x.sum())(copies["x"]), [3, 3])
    assert not copies["y"].weak_type
    assert vars(jax).get("device_put_replicated") is (len if own else None)


def test_evaluations_are_compiled_once():
    """The first, whose states a reset made, as those after it, whose states the evaluation before it returned."""
    from brax.envs.fast import Fast
    from brax.envs.wrappers import training
    from brax.training.acting import Evaluator

    def lowered(event, _, fun_name="", **__):
        if (event, fun_name) == ("/jax/core/compile/jaxpr_to_mlir_module_duration", "jit(generate_eval_unroll)"):
            programs.append(fun_name)

    class Other:
        @property
        def _key(self):
            raise ZeroDivisionError

    env, run, programs = training.wrap(Fast(), episode_length=2), Evaluator.run_evaluation, []
    evaluator = Evaluator(
        env, lambda params: lambda obs, key: (params + jnp.zeros((2, 1)), {}), 2, 2, 1, jax.random.PRNGKey(0)
    )
    params = jax.device_put(jnp.zeros(()), jax.local_devices()[0])  # as Brax gives them, on a fixed device
    jax.monitoring.register_event_duration_secs_listener(lowered)
    with brax_bridge.device_put_replicated():
        for _ in range(3):
            evaluator.run_evaluation(params, {})
        jax.monitoring.unregister_event_duration_listener(lowered)
        for anything in (np.zeros(()), {}):  # as of `restore_params` of what is loaded, or of no parameters
            evaluator._generate_eval_unroll = lambda state, policy_params, key: state
            evaluator.run_evaluation(anything, {})
        with pytest.raises(ZeroDivisionError):  # Brax's own, where it has no such state
            Evaluator.run_evaluation(Other(), np.zeros(()), {})
    assert len(programs) == 1
    assert Evaluator.run_evaluation is run


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Brax System:UserWarning", "ignore:Accessing `:DeprecationWarning")
def test_brax_environments(small):
    """Brax's own wrapper of its own environments takes the function, too."""
    from brax.envs import base
    from brax.envs.wrappers import training
    from brax.io import mjcf

    class Native(base.PipelineEnv):
        def reset(self, rng):
            state = self.pipeline_init(self.sys.qpos0, jnp.zeros(self.sys.nv))
            return base.State(state, state.qpos, jnp.zeros(()), jnp.zeros(()))

        def step(self, state, action):
            raise NotImplementedError

    randomize = functools.partial(small.randomization_fn(RANGES), rng=third_party.keys(N))
    env = training.wrap(Native(mjcf.load_model(small.mj_model)), episode_length=2, randomization_fn=randomize)
    assert jax.eval_shape(env.reset, third_party.keys(N)).pipeline_state.geom_xpos.shape[0] == N


QUADRUPED = """<mujoco><keyframe><key qpos="0 0 .5 1 0 0 0 0"/></keyframe>
<worldbody><geom type="plane" size="5 5 .1"/><body name="trunk" pos="0 0 .5"><freejoint/>
<geom type="box" size=".1 .1 .05"/><body name="leg"><joint name="hip" axis="0 1 0" armature=".01"/>
<geom name="shin" type="capsule" size=".02" fromto="0 0 0 0 0 -.2"/></body></body></worldbody></mujoco>"""


def test_elements_without_names():
    """The environment's own model is taken, though the arena named what it varies; not one in which names differ."""
    arena = mja.Arena.from_xml(QUADRUPED)
    arena.vary(friction=dr.Term("geom.friction", axes="sliding"), armature=dr.Term("joint.armature"))
    scale = mja.Uniform(0.9, 1.1, relative="scale")
    randomize = arena.randomization_fn(mja.ArenaRanges(terms={"friction": scale, "armature": scale}))
    keys = jax.random.split(jax.random.PRNGKey(0), 3)
    own = mjx.put_model(mujoco.MjModel.from_xml_string(QUADRUPED), impl="jax")
    model_v, _ = randomize(own, keys)
    same, _ = randomize(arena.put_model("jax"), keys)
    assert np.array_equal(model_v.geom_friction, same.geom_friction)
    assert len(np.unique(model_v.geom_friction[..., 0])) == 9
    assert (np.ptp(model_v.dof_armature, axis=0) > 0).tolist() == [False] * 6 + [True]
    other = mjx.put_model(mujoco.MjModel.from_xml_string(QUADRUPED.replace("shin", "thigh")), impl="jax")
    with pytest.raises(ValueError, match="has 'thigh' for 'shin'"):
        randomize(other, keys)


def test_start_states_are_left():
    """Models have none: a warning names those that vary."""
    arena = mja.Arena.from_xml(QUADRUPED)
    arena.add_part(furniture.Drawers("unit", pos=(2, 0, 0)))
    arena.vary(bent=dr.Term("joint.qpos", "hip"), mass=dr.Term("body.mass", "leg"))
    scale = mja.Uniform(0.9, 1.1, relative="scale")
    of_starts = {"bent": mja.Uniform(-0.1, 0.1), "unit.openings": mja.Uniform(0.0, 0.1)}
    with pytest.warns(UserWarning, match=r"^`ranges\.terms`: start states vary \('bent', 'unit\.openings'\), and"):
        arena.randomization_fn(mja.ArenaRanges(terms={"mass": scale, **of_starts}))
    others = {"unit.rgba": mja.Uniform(0.1, 1.0), "unit.size": scale, "unit.damping": scale}
    arena.randomization_fn(mja.ArenaRanges(terms={"mass": scale, **others}))  # without a warning
