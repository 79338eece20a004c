"""Environments whose worlds have new arenas in every episode: under all wrappers, physics stays that of the arena."""

import functools
import itertools
import types

import documented
import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds as shared
from brax.envs.wrappers import training as brax_wrappers
from ml_collections import config_dict
from mujoco_playground import registry, wrapper
from mujoco_playground._src import mjx_env

import mjx_arenas as mja
from mjx_arenas.envs import ArenaEnv, BraxEnv, Episode, env_config, refusals
from mjx_arenas.envs.when_needed import when_needed
from mjx_arenas.sim.warp_notes import dropped_contacts

RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.1, -0.1, -0.2], [0.1, 0.1, 0.2], relative="add"),
    table_rots=mja.Uniform(-0.5, 0.5),
    table_full_sizes=mja.Uniform([0.4, 0.4, 0.02], [0.8, 0.8, 0.1]),
    object_full_sizes=mja.Uniform(0.04, 0.08),
)
LENGTH, EPISODES, N = 3, 11, 4
SLIDE = """
<mujoco>
  <worldbody>
    <body pos="0 0 3"><joint name="slide" type="slide" axis="1 0 0" damping="1"/>
      <geom size="0.02" mass="0.1" contype="0" conaffinity="0"/></body>
  </worldbody>
  <actuator><velocity joint="slide" kv="1" ctrlrange="-1 1"/></actuator>
</mujoco>
"""


BALL = (mja.Object("ball", "sphere", 0.06),)


class Slide(ArenaEnv):
    """A ball that lies on a table, and a robot far above that is to go to x = 0.3 m."""

    robot = SLIDE

    def __init__(self, impl="jax", ranges=RANGES, objects=BALL, **config):
        arena = mja.TableArena(objects=objects)
        arena.attach(mujoco.MjSpec.from_string(self.robot))
        arena.spec.option.iterations, arena.spec.option.ls_iterations = 1, 6  # one is no loop, which compiles faster
        super().__init__(arena, ranges, env_config(0.05, 0.005, LENGTH), {"impl": impl, **config})
        self.slide = self.arena.mj_model.joint("robot_slide").qposadr[0]

    def draw_task(self, key, params, qpos):
        return {}

    def observe(self, data, episode):
        state = jnp.stack([data.qpos[self.slide], data.qvel[self.slide]])
        return {"state": state, "privileged_state": state}

    def score(self, data, episode, action):
        off = jnp.abs(data.qpos[self.slide] - 0.3)
        return -off, jnp.zeros((), bool), {"success": (off < 0.1).astype(jnp.float32)}


@functools.cache
def slide(impl):
    """An environment, and its compiled functions of all worlds."""
    env = Slide(impl)
    return env, jax.jit(jax.vmap(env.reset)), jax.jit(jax.vmap(env.step))


@pytest.fixture
def env(impl):
    return slide(impl)[0]


@pytest.fixture
def reset(impl):
    return slide(impl)[1]


@pytest.fixture
def step(impl):
    return slide(impl)[2]


def keys(n=N, seed=0):
    return jax.random.split(jax.random.PRNGKey(seed), n)


def played(name, env, reset, step):
    """(Reset, step) of all worlds with episodes of `LENGTH` steps, as different users have them; `reset` and `step` are plain."""
    if name == "plain":  # no wrapper: the loop says when an episode ends, and passes the state back
        steps = itertools.count(1)

        def loop(state, action):
            state = step(state, action)
            return state if next(steps) % LENGTH else state.replace(done=jnp.ones(N))

        return reset, loop
    if name == "brax":
        wrapped = brax_wrappers.wrap(BraxEnv(env), episode_length=LENGTH)
    else:
        wrapped = wrapper.wrap_for_brax_training(env, episode_length=LENGTH, full_reset=name == "playground_full_reset")
    return jax.jit(wrapped.reset), jax.jit(wrapped.step)


WRAPPERS = [("plain", "jax")]  # steps compile for long on JAX, and wrappers treat both alike; PPO has one of them there
WRAPPERS += [(name, "warp") for name in ("plain", "brax", "playground", "playground_full_reset")]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "impl"), WRAPPERS, indirect=["impl"])
def test_new_arenas_and_right_physics(name, env, impl, reset, step):
    """Ten resets later each world has had eleven arenas, and its ball moves as in fresh data of the arena that it has."""
    reset, step = played(name, env, reset, step)
    state, seen = reset(keys()), []
    for _ in range(LENGTH * EPISODES - 1):
        state = step(state, jnp.zeros((N, 1)))
        seen.append(np.asarray(state.info["episode"].params.table_offsets)[:, 0])

    def data_of(state):
        return state.pipeline_state if name == "brax" else state.data

    offsets = np.stack(seen)  # (steps, N, 3)
    assert len({offset.tobytes() for offset in offsets.reshape(-1, 3)}) == N * EPISODES
    change = (offsets[1:] != offsets[:-1]).any(-1)
    # A full reset gives the new arena with the last step of an episode, the others go over to it in the first of the next.
    first = np.arange(1, EPISODES) * LENGTH - (2 if name == "playground_full_reset" else 1)
    np.testing.assert_array_equal(np.flatnonzero(change[:, 0]), first)
    assert (change == change[:, :1]).all()

    last = state.info["episode"]
    batch = env.arena.batch(env.mjx_model, last.params)
    fresh = mja.make_data(batch).replace(qpos=last.qpos)
    steps = env.n_substeps * (LENGTH - 1)  # the last episode is one step short
    expected = mja.rollout(batch, fresh, steps)
    data = data_of(state)
    # A ball starts touching its table, and the last bit decides whether it first falls for a step, by g dt^2 = 2.5e-4 m.
    np.testing.assert_allclose(data.qpos, expected.qpos, rtol=0, atol=3e-4)
    still = env.arena.mj_model.body_dofnum[env.arena.mj_model.geom_bodyid] == 0
    np.testing.assert_allclose(data.geom_xpos[:, still], expected.geom_xpos[:, still], rtol=0, atol=2e-6)
    np.testing.assert_allclose(data.geom_xpos[:, ~still], expected.geom_xpos[:, ~still], rtol=0, atol=3e-4)
    top = np.asarray(last.params.table_offsets)[:, 0, 2] + np.asarray(last.params.object_full_sizes)[:, 0, 2] / 2
    np.testing.assert_allclose(data.qpos[:, env.arena.layout.object_qpos[0, 2]], top, rtol=0, atol=1e-3)
    assert np.ptp(top) > 0.02
    if impl == "jax":
        touching = [(np.asarray(d._impl.contact.dist) < 0).sum(1) for d in (data, expected)]
    else:
        touching = [np.asarray(d._impl.nefc) for d in (data, expected)]
    np.testing.assert_array_equal(*touching)
    assert touching[0].all()
    assert not any(np.asarray(state.metrics[name]).any() for name in ("nan_state", "invalid_arena", "dropped_contacts"))


@pytest.mark.slow
def test_first_step_of_an_episode_takes_no_action(env, reset, step):
    """The observation before it was of another arena; the first step after `reset` takes one, as that is of this arena."""
    state = step(reset(keys()), jnp.ones((N, 1)))
    assert (np.asarray(state.data.qvel[:, env.slide]) > 0).all()
    state = step(state.replace(done=jnp.ones(N)), jnp.ones((N, 1)))
    np.testing.assert_array_equal(state.data.qvel[:, env.slide], 0.0)
    np.testing.assert_array_equal(state.reward, 0.0)


@pytest.mark.slow
def test_only_worlds_that_end_change(env, reset, step):
    """One world's end leaves the others as they are."""
    before = step(step(reset(keys()), jnp.zeros((N, 1))), jnp.zeros((N, 1)))
    after = step(before.replace(done=jnp.array([0.0, 1.0, 0.0, 0.0])), jnp.zeros((N, 1)))
    changed = np.asarray(before.info["episode"].params.table_offsets != after.info["episode"].params.table_offsets)
    assert changed.any((1, 2)).tolist() == [False, True, False, False]
    assert np.asarray(after.data.time)[[0, 2, 3]].min() > np.asarray(after.data.time)[1]


@pytest.mark.slow_on("warp")
def test_world_depends_on_its_key_alone(env, reset, step):
    """The arenas of a world are the same whatever the other worlds do, and when."""

    def arenas(ends):
        state, seen = reset(keys()), []
        for done in ends:
            state = step(state.replace(done=jnp.asarray(done, jnp.float32)), jnp.zeros((N, 1)))
            seen.append(np.asarray(state.info["episode"].params.table_offsets)[0, 0])
        return np.stack(seen)

    alone = arenas([[1, 0, 0, 0]] * 5)
    np.testing.assert_array_equal(alone, arenas([[1, i % 2, 1, i % 3 == 0] for i in range(5)]))
    assert len({x.tobytes() for x in alone}) == 5


def test_nan_action(env, reset, step):
    """It moves nothing, ends its world's episode and is reported; the world goes on with a new arena."""
    state = step(reset(keys()), jnp.array([[np.nan], [0.5], [np.inf], [0.5]]))
    assert np.asarray(state.metrics["nan_action"]).tolist() == np.asarray(state.done).tolist() == [1, 0, 1, 0]
    assert np.isfinite(state.data.qpos).all()
    assert np.isfinite(state.reward).all()
    state = step(state, jnp.zeros((N, 1)))
    assert not np.asarray(state.metrics["nan_action"]).any()
    assert not np.asarray(state.done).any()


def test_broken_state(env, reset, step):
    """A state that is not finite ends the episode with a report, is not observed, and is gone with the next episode.

    So is a force that stays in the data.
    """
    state = step(reset(keys()), jnp.zeros((N, 1)))
    data = state.data.replace(qvel=state.data.qvel.at[2].set(np.nan))
    data = data.replace(
        xfrc_applied=data.xfrc_applied.at[1].set(np.nan), qfrc_applied=data.qfrc_applied.at[3].set(np.inf)
    )
    state = step(state.replace(data=data), jnp.zeros((N, 1)))
    assert np.asarray(state.metrics["nan_state"]).tolist() == np.asarray(state.done).tolist() == [0, 1, 1, 1]
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(state.obs))
    assert np.isfinite(state.reward).all()
    for _ in range(2):
        state = step(state, jnp.zeros((N, 1)))
    assert np.isfinite(state.data.qpos).all()
    assert not np.asarray(state.metrics["nan_state"]).any()


def test_equalities_start_as_the_model_has_them():
    """A grasp that a task has welded, or let go, is not there in the next episode."""

    class Tied(Slide):
        robot = SLIDE.replace("<actuator>", '<equality><joint joint1="slide" active="false"/></equality><actuator>')

    env = Tied("warp", ranges=mja.ArenaRanges())
    state = jax.jit(jax.vmap(env.reset))(keys(2))
    data = state.data.replace(eq_active=jnp.ones_like(state.data.eq_active))
    data = jax.vmap(env._started)(data, state.info["episode"], jnp.array([True, False]))
    assert np.asarray(data.eq_active).tolist() == [[0], [1]]


@pytest.mark.slow
@pytest.mark.parametrize("what", ["observe", "score", "beyond"])
def test_what_a_task_gives_is_not_finite(what):
    """Or beyond 1e10, which MuJoCo takes for no state: it ends the episode with a report, and neither policy nor trainer see it."""

    class Root(Slide):
        def observe(self, data, episode):
            state = super().observe(data, episode)["state"]
            wrong = {"observe": jnp.sqrt(state), "beyond": jnp.where(state < 0, 2e10, state)}
            state = wrong.get(what, state)
            return {"state": state, "privileged_state": state}

        def score(self, data, episode, action):
            reward, ends, metrics = super().score(data, episode, action)
            return (reward / (data.qpos[self.slide] > 0) if what == "score" else reward), ends, metrics

    env = Root("warp")
    step = jax.jit(jax.vmap(env.step))
    state = step(jax.jit(jax.vmap(env.reset))(keys()), jnp.zeros((N, 1)))
    for _ in range(2):  # the second begins an episode where the first ended one
        state = step(state.replace(done=jnp.zeros(N)), jnp.array([[1.0], [-1.0], [1.0], [-1.0]]))
        assert np.asarray(state.metrics["nan_state"]).tolist() == np.asarray(state.done).tolist() == [0, 1, 0, 1]
        assert all((np.abs(x) < 100).all() for x in jax.tree.leaves((state.obs, state.reward)))


@pytest.mark.slow
@pytest.mark.parametrize("arenas", ["nominal", "fixed"])
def test_arenas_that_stay(arenas):
    """Objects are placed anew on the arena that a world keeps; there is room for the contacts of all worlds."""
    env = Slide("warp", RANGES._replace(object_full_sizes=None), arenas=arenas)
    state = jax.jit(jax.vmap(env.reset))(keys())
    step = jax.jit(jax.vmap(env.step))
    first = state = step(state, jnp.zeros((N, 1)))
    for _ in range(2):
        state = step(state.replace(done=jnp.ones(N)), jnp.zeros((N, 1)))
    for a, b in zip(first.info["episode"].params, state.info["episode"].params, strict=True):
        np.testing.assert_array_equal(a, b)
    assert (np.asarray(first.info["episode"].qpos != state.info["episode"].qpos)).any(1).all()
    assert len(np.unique(np.asarray(state.info["episode"].params.table_rots))) == (1 if arenas == "nominal" else N)
    assert state.data._impl.naconmax == N * env.arena.record.room(None).contacts


@pytest.mark.slow
@pytest.mark.parametrize("impl", ["warp"], indirect=True)
def test_every_device_has_its_own_arenas(env):
    """As `ppo.train` resets on two devices: no arena twice."""
    wrapped = wrapper.wrap_for_brax_training(env, episode_length=LENGTH)
    state = jax.pmap(wrapped.reset, devices=jax.devices()[:2])(keys(8).reshape(2, 4, -1))
    offsets = np.asarray(state.info["episode"].params.table_offsets).reshape(8, 3)
    assert len(np.unique(offsets, axis=0)) == 8


@pytest.mark.slow
def test_dropped_contacts():
    """The flag of one world says what `capacity` says of all."""
    objects = [mja.Object(f"ball{i}", "sphere", 0.06, pos=(0.1 * i, 0)) for i in range(3)]
    arena = mja.TableArena(objects=objects)
    batch = arena.batch(arena.put_model("warp"), jax.tree.map(lambda p: jnp.stack([p, p]), arena.nominal_params()))
    for room, dropped in ((1, True), (None, False)):
        data = mja.make_data(batch, max_contacts=room)
        data = mja.rollout(batch, data.replace(qpos=data.qpos.at[:, 2].add(-0.001)), 2)
        flags = np.asarray(jax.vmap(dropped_contacts)(data))
        np.testing.assert_array_equal(flags, mja.capacity(batch, data).overflowed)
        assert flags.any() == dropped


@pytest.mark.parametrize("n", [1, 5, 40])
@pytest.mark.parametrize("loop", [False, True])
def test_when_needed(n, loop):
    """Against a plain choice: results are right where there are any, urgent ones are there, others come in time."""
    rng = np.random.default_rng(n)

    def work(key, x, y):
        return {"a": x + y, "b": jax.random.uniform(key, (2,))}

    @jax.jit
    def many(keys, wanted, urgent, x, y):
        def one(key, wanted, urgent, x):
            return when_needed(work, wanted, urgent, {"a": -x, "b": jnp.zeros(2)}, key, x, y)

        if not loop:
            return jax.vmap(one)(keys, wanted, urgent, x)
        step = lambda carry, _: (carry, jax.vmap(one)(keys, wanted, urgent, x))  # noqa: E731
        return jax.tree.map(lambda v: v[0], jax.lax.scan(step, None, length=2)[1])

    keys, x, y = jax.random.split(jax.random.key(0), n), jnp.asarray(rng.normal(size=n), jnp.float32), jnp.float32(2)
    expected = jax.vmap(work, in_axes=(0, 0, None))(keys, x, y)
    for share in (0.0, 0.03, 0.5, 1.0):
        for hurry in (0.0, 0.1):
            wanted, urgent = rng.random(n) < share, rng.random(n) < hurry
            result, is_new = many(keys, wanted, urgent, x, y)
            is_new = np.asarray(is_new)
            np.testing.assert_allclose(result["a"], np.where(is_new, expected["a"], -x), rtol=1e-6)
            np.testing.assert_allclose(result["b"], np.where(is_new[:, None], expected["b"], 0), rtol=1e-6)
            assert not (is_new & ~wanted).any()
            due = (wanted & urgent).any() or wanted.sum() * 16 >= n
            np.testing.assert_array_equal(is_new, wanted if due else np.zeros(n, bool))


def test_when_needed_computes_nothing_otherwise():
    """The work of worlds that want nothing is not done: a callback counts."""
    calls = []

    def work(x):
        jax.debug.callback(lambda x: calls.append(float(x)), x)
        return x + 1

    f = jax.jit(jax.vmap(lambda w, x: when_needed(work, w, w, x, x)[0]))
    x = jnp.arange(64.0)
    f(jnp.zeros(64, bool), x).block_until_ready()
    jax.effects_barrier()
    assert not calls
    out = f(x == 3, x)
    jax.effects_barrier()
    assert set(calls) <= {3.0, 63.0}
    assert 3.0 in calls
    assert len(calls) == 8
    np.testing.assert_array_equal(out, jnp.where(x == 3, 4.0, x))


def used_arena():
    arena = mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06)])
    assert arena.mj_model.nq == 7
    return arena


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: Slide(arenas="each"),
            "`config.arenas` must be 'every_episode', 'fixed' or 'nominal', got 'each'.",
        ),
        (
            lambda: Slide(level=2.0),
            "`config.level` must be between 0 and 1, got 2.0.",
        ),
        (
            lambda: Slide(max_contacts=0),
            "`config.max_contacts` must be None or a whole number >= 1, got 0.",
        ),
        (
            lambda: Slide(level=0.5, level_step=float("nan")),
            "`config.level_step` must be between 0 and 1, got nan.",
        ),
        (
            lambda: ArenaEnv(used_arena(), RANGES, env_config(0.05, 0.005, LENGTH)),
            "`arena` is compiled already, with a timestep of 0.002 s instead of `config.sim_dt`, 0.005 s: give the environment an "
            "arena that nothing has used yet.",
        ),
        (
            lambda: Slide(lvel=0.5),
            "`config_overrides` has 'lvel', which the configuration has not: it has 'action_repeat', 'arenas', 'ctrl_dt', "
            "'episode_length', 'impl', 'level', 'level_step', 'max_contacts', 'settled', 'settled_seed' and 'sim_dt'.",
        ),
        (
            lambda: Slide(impl=3),
            "`config_overrides['impl']` must be of the type that the configuration has there, got 3.",
        ),
        (
            lambda: ArenaEnv(mja.TableArena(), RANGES, config_dict.create(ctrl_dt=0.05, sim_dt=0.005, arenas="fixed")),
            "`config` must have 'ctrl_dt', 'sim_dt', 'impl', 'arenas', 'level' and 'level_step', as from env_config(...): 'impl', "
            "'level' and 'level_step' are missing.",
        ),
        (
            lambda: Slide(ctrl_dt=0.012),
            "`config.ctrl_dt` must be a whole multiple of `config.sim_dt`, got 0.012 and 0.005.",
        ),
        (
            lambda: (
                (env := Slide()) and jax.eval_shape(env.step, jax.eval_shape(env.reset, keys()[0]), jnp.zeros((4, 1)))
            ),
            "`action` must be of one world, (1,), got shape (4, 1): use jax.vmap.",
        ),
    ],
)
def test_bad_use(call, message):
    with pytest.raises(ValueError, match="`") as error:
        call()
    assert str(error.value) == message


NO = np.zeros((), bool)
ENDS = "return one bool that says whether the episode ends, got"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((0.0, NO, {"off": 1.0, "speed": 0.0}), "have 'success', 0 or 1, among its metrics, got 'off' and 'speed'."),
        ((0.0, NO, {}), "have 'success', 0 or 1, among its metrics, got none."),
        ((0.0, 0.0, {"success": 0}), f"{ENDS} float32."),
        ((0.0, [NO] * 2, {"success": 0}), f"{ENDS} bool of shape (2,)."),
        (({"success": 0}, 0.0, NO), "give one number as reward, got dict."),
        ((0.0, None, {"success": 0}), "give one bool for whether the episode ends, got NoneType."),
        ((np.zeros(3), False, {"success": 0}), "give one number as reward, got shape (3,)."),
        (0.0, "give a reward, whether the episode ends, and metrics, got one float."),
        ((0.0, NO), "give a reward, whether the episode ends, and metrics, got 2 things."),
        ((0.0, NO, 1.0), "give metrics as a dict of numbers by name, got float."),
        ((0.0, NO, {"success": 0, "off": np.zeros(2)}), "give one number as metric 'off', got shape (2,)."),
        (
            (0.0, NO, {"success": 0, "nan_state": 0}),
            "not give a metric 'nan_state': the environment has one of that name.",
        ),
    ],
)
def test_wrong_score(given, message):
    with pytest.raises(ValueError, match=r"^`Mine.score` must ") as error:
        refusals.check_score("Mine.score", given, ("nan_state",))
    assert str(error.value) == f"`Mine.score` must {message}"


def test_wrong_methods():
    """A method that takes other arguments than it is given is named when the environment is made."""

    class Mine(Slide):
        def draw_task(self, key):
            return key

    with pytest.raises(TypeError) as error:
        Mine("warp")
    assert str(error.value) == "`Mine.draw_task` must be a function of (key, params, qpos), got one of (key)."


def test_wrong_states_and_keys():
    """What belongs to many worlds, or to another argument, is answered where it is traced."""
    env = slide("warp")[0]
    state = jax.eval_shape(env.reset, keys()[0])
    many = jax.eval_shape(jax.vmap(env.reset), keys())
    action = jnp.zeros(1)
    with pytest.raises(ValueError, match=r"^`state` must be of one world, got 4: use jax\.vmap\."):
        jax.eval_shape(env.step, many, action)
    with pytest.raises(TypeError, match=r"^`state` must be a State, as reset and step give it, got \w+\."):
        jax.eval_shape(env.step, action, state)
    with pytest.raises(
        ValueError, match=r"^`rng` must be one key, of one world, got shape \(4, 2\): use jax\.vmap, or randomize\."
    ):
        jax.eval_shape(env.reset, keys())
    with pytest.raises(ValueError, match=r"^`rng` must be a key such as jax\.random\.key\(7\), got 7\."):
        env.reset(7)
    with pytest.raises(
        TypeError, match=r"^`arena` and `ranges` must be an arena and mjx_arenas\.ArenaRanges, got ArenaRanges and "
    ):
        mja.envs.widening(RANGES, env.arena)
    with pytest.raises(
        ValueError,
        match=r"^`Slide.observe` must give a dict of arrays, 'state' and 'privileged_state', or one array, got NoneType\.",
    ):
        refusals.check_observation("Slide.observe", None)


class Mistaken(Slide):
    """Its `score` has no success, or its `control` an actuator too many."""

    def control(self, action):
        return jnp.append(action, 0.0)

    def score(self, data, episode, action):
        reward, ends, metrics = super().score(data, episode, action)
        return reward, ends, metrics if self.succeeds else {}


def test_wrong_task():
    """What a task gives is looked at where `reset` and `step` are traced."""
    env = Mistaken(ranges=mja.ArenaRanges())
    env.succeeds = False
    with pytest.raises(
        ValueError, match=r"^`Mistaken.score` must have 'success', 0 or 1, among its metrics, got none\."
    ):
        jax.eval_shape(env.reset, keys()[0])
    env.succeeds = True
    state = jax.eval_shape(env.reset, keys()[0])
    with pytest.raises(ValueError, match=r"^`Mistaken\.control` must give") as error:
        jax.eval_shape(env.step, state, jnp.zeros(1))
    assert str(error.value) == "`Mistaken.control` must give (1,), a number for each actuator, got shape (2,)."


def test_control_without_a_range():
    """By default an action would be mapped to nothing."""
    arena = mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06)])
    arena.attach(mujoco.MjSpec.from_string(SLIDE.replace('ctrlrange="-1 1"', 'name="drive"')))
    env = ArenaEnv(arena, mja.ArenaRanges(), env_config(0.05, 0.005, LENGTH))
    with pytest.raises(ValueError, match=r"^`ArenaEnv\.control`") as error:
        env.control(jnp.zeros(1))
    message = "`ArenaEnv.control` must be defined, as actuator 'robot_drive' has no ctrlrange to map actions to."
    assert str(error.value) == message
    with pytest.raises(ValueError, match=r"^`ArenaEnv\.control`") as error:
        env.control(jnp.zeros(2))
    message = "`ArenaEnv.control` must be defined, from actions of shape (2,) to the arena's 1 actuators."
    assert str(error.value) == message


@pytest.mark.slow
def test_documented_task(monkeypatch, tmp_path):
    """The code of docs/how_to/own_task.md: registered, and it scores what C MuJoCo shows."""
    monkeypatch.setattr(mjx_env, "MENAGERIE_PATH", tmp_path)  # `load` would download it
    (block,) = documented.code(documented.TASK)
    assert len([line for line in block.splitlines() if line.strip()]) < 55
    documented.run(block, {})
    env = registry.load("ArenaHover", config_overrides={"sim_dt": 0.02})
    assert env.n_substeps == 2
    state = jax.eval_shape(env.reset, keys()[0])
    assert {name: x.shape for name, x in state.obs.items()} == {"state": (6,), "privileged_state": (9,)}
    assert jax.eval_shape(env.step, state, jnp.zeros(3)).metrics.keys() == state.metrics.keys()

    params = env.arena.nominal_params()._replace(table_offsets=np.array([[0.1, 0.05, 0.9]]))
    model = env.arena.compile(params)
    data, robot = mujoco.MjData(model), model.joint("robot_x").bodyid[0]
    for distance, success in ((0.04, 1), (0.06, 0)):
        data.joint("robot_x").qpos, data.joint("robot_y").qpos = 0.1, 0.05 + distance
        data.joint("robot_z").qpos = 0.9 + 0.03 + 0.25 - 1.2  # table, ball, height and the tip's own
        mujoco.mj_kinematics(model, data)
        above = data.body("ball").xpos + np.array([0, 0, 0.25])
        np.testing.assert_allclose(
            np.linalg.norm(above - data.geom_xpos[model.body_geomadr[robot]]), distance, rtol=1e-9
        )
        episode = Episode(params, {}, data.qpos, jnp.float32(0.25), True, keys()[0])
        seen = types.SimpleNamespace(qpos=jnp.asarray(data.qpos, jnp.float32))
        reward, ends, metrics = env.score(seen, episode, jnp.zeros(3))
        np.testing.assert_allclose(-reward, distance, rtol=1e-4)
        assert (bool(ends), int(metrics["success"])) == (False, success)


def test_wrong_types():
    with pytest.raises(TypeError, match=r"^`config` must be a ConfigDict, as from env_config\(\.\.\.\), got dict\.$"):
        ArenaEnv(mja.TableArena(), RANGES, {"ctrl_dt": 0.05})
    with pytest.raises(
        TypeError, match=r"^`arena` must be an arena such as mjx_arenas\.TableArena\(\), got MjModel\.$"
    ):
        ArenaEnv(mja.TableArena().mj_model, RANGES, env_config(0.05, 0.005, LENGTH))


def test_overrides_leave_the_configuration():
    config = env_config(0.05, 0.005, LENGTH)
    env = ArenaEnv(mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06)]), RANGES, config, {"level": 0.5})
    assert (config.level, env._config.level) == (0.0, 0.5)


def test_render_of_many_worlds():
    env = Slide()
    state = jax.eval_shape(jax.vmap(env.reset), keys())
    with pytest.raises(ValueError, match=r"^`trajectory` must be of one world: mjx_arenas\.take"):
        env.render(state)


def test_ranges_of_another_arena():
    with pytest.raises(ValueError, match="table"):
        Slide(ranges=shared.RANGES._replace(table_rots=mja.Uniform([0, 0, 0], [1, 1, 1])))


def test_playground_conventions(env, reset):
    """What Playground's tools ask of an environment."""
    assert env.observation_size == {"state": (2,), "privileged_state": (2,)}
    assert env.action_size == 1
    assert env.mj_model.nu == 1
    assert env.dt == 0.05
    assert env.n_substeps == 10
    assert env.unwrapped is env
    assert "<mujoco" in env.xml_path
    assert functools.reduce(lambda a, b: a and b, (x.shape[0] == N for x in jax.tree.leaves(reset(keys()).obs)))
