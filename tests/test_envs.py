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
from brax.envs.wrappers import training as brax_wrappers
from idle import Idle
from mujoco_playground import registry, wrapper
from mujoco_playground._src import mjx_env
from sliding import LENGTH, RANGES, SLIDE, N, Slide, keys, slide

import mjx_arenas as mja
from mjx_arenas.envs import ArenaEnv, BraxEnv, Episode, env_config
from mjx_arenas.envs.when_needed import when_needed
from mjx_arenas.sim.warp_notes import dropped_contacts

EPISODES = 11


@pytest.fixture
def env(impl):
    return slide(impl)[0]


@pytest.fixture
def reset(impl):
    return slide(impl)[1]


@pytest.fixture
def step(impl):
    return slide(impl)[2]


@pytest.fixture
def apart(impl):
    """These three of an environment in which nothing touches, for what does not depend on it: its steps compile faster."""
    return slide(impl, touching=False)


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


WRAPPERS = [(name, "warp") for name in ("plain", "playground_full_reset")]
WRAPPERS += [pytest.param(name, "warp", marks=pytest.mark.xslow) for name in ("brax", "playground")]
# Steps compile for long on JAX, and wrappers treat both alike; PPO has one of them there.
WRAPPERS += [pytest.param("plain", "jax", marks=pytest.mark.xslow)]


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
def test_braxs_wrapper_takes_brax_env():
    """As docs/training.md has it. A plain `ArenaEnv` has no `pipeline_state`, which the wrapper reads."""
    env = Slide("jax", mja.ArenaRanges(), objects=(), sim_dt=0.05)
    wrapped = brax_wrappers.wrap(BraxEnv(env), episode_length=LENGTH)
    state = jax.eval_shape(wrapped.reset, keys())
    assert jax.eval_shape(wrapped.step, state, jnp.zeros((N, env.action_size))) == state
    assert state.pipeline_state.qpos.shape == (N, env.mjx_model.nq)
    assert {name: shape.shape[1:] for name, shape in state.obs.items()} == env.observation_size
    with pytest.raises(AttributeError, match=r"^'State' object has no attribute 'pipeline_state'"):
        jax.eval_shape(brax_wrappers.wrap(env, episode_length=LENGTH).reset, keys())


@pytest.mark.xslow_on("jax")
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


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_world_depends_on_its_key_alone(apart):
    """The arenas of a world are the same whatever the other worlds do, and when."""
    _, reset, step = apart

    def arenas(ends):
        state, seen = reset(keys()), []
        for done in ends:
            state = step(state.replace(done=jnp.asarray(done, jnp.float32)), jnp.zeros((N, 1)))
            seen.append(np.asarray(state.info["episode"].params.table_offsets)[0, 0])
        return np.stack(seen)

    alone = arenas([[1, 0, 0, 0]] * 5)
    np.testing.assert_array_equal(alone, arenas([[1, i % 2, 1, i % 3 == 0] for i in range(5)]))
    assert len({x.tobytes() for x in alone}) == 5


@pytest.mark.slow
def test_nan_action(env, reset, step):
    """It moves nothing, ends its world's episode and is reported; the world goes on with a new arena."""
    state = step(reset(keys()), jnp.array([[np.nan], [0.5], [np.inf], [0.5]]))
    assert np.asarray(state.metrics["nan_action"]).tolist() == np.asarray(state.done).tolist() == [1, 0, 1, 0]
    assert np.isfinite(state.data.qpos).all()
    assert np.isfinite(state.reward).all()
    state = step(state, jnp.zeros((N, 1)))
    assert not np.asarray(state.metrics["nan_action"]).any()
    assert not np.asarray(state.done).any()


@pytest.mark.slow_on("warp")
def test_broken_state(apart):
    """A state that is not finite ends the episode with a report, is not observed, and is gone with the next episode.

    So is a force that stays in the data.
    """
    _, reset, step = apart
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


@pytest.mark.xslow
@pytest.mark.slow
def test_what_a_task_gives_is_not_finite():
    """Or beyond 1e10, which MuJoCo takes for no state: it ends the episode with a report, and neither policy nor trainer see it.

    Which of the three it is, is drawn for each episode: one program for all.
    """
    observe, score, beyond = range(3)

    class Root(Slide):
        def draw_task(self, key, params, qpos):
            return jax.random.randint(key, (), 0, 3)

        def observe(self, data, episode):
            state, what = super().observe(data, episode)["state"], episode.task
            state = jnp.where(what == observe, jnp.sqrt(state), state)
            state = jnp.where((what == beyond) & (state < 0), 2e10, state)
            return {"state": state, "privileged_state": state}

        def score(self, data, episode, action):
            reward, ends, metrics = super().score(data, episode, action)
            return jnp.where(episode.task == score, reward / (data.qpos[self.slide] > 0), reward), ends, metrics

    n = 24
    env = Root("warp")
    step = jax.jit(jax.vmap(env.step))
    state = step(jax.jit(jax.vmap(env.reset))(keys(n)), jnp.zeros((n, 1)))
    for _ in range(2):  # the second begins an episode where the first ended one
        state = step(state.replace(done=jnp.zeros(n)), jnp.tile(jnp.array([[1.0], [-1.0]]), (n // 2, 1)))
        assert np.asarray(state.metrics["nan_state"]).tolist() == np.asarray(state.done).tolist() == [0, 1] * (n // 2)
        assert all((np.abs(x) < 100).all() for x in jax.tree.leaves((state.obs, state.reward)))
        for worlds in (slice(0, n, 2), slice(1, n, 2)):
            assert set(state.info["episode"].task[worlds].tolist()) == {observe, score, beyond}


@pytest.mark.slow
@pytest.mark.parametrize("arenas", [pytest.param("nominal", marks=pytest.mark.xslow), "fixed"])
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
            due = (wanted & urgent).any() or wanted.sum() * 4 >= n
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
    assert len(calls) == 16
    np.testing.assert_array_equal(out, jnp.where(x == 3, 4.0, x))


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


def test_overrides_leave_the_configuration():
    config = env_config(0.05, 0.005, LENGTH)

    class Mine(Idle):
        def __init__(self):
            arena = mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06)])
            ArenaEnv.__init__(self, arena, RANGES, config, {"level": 0.5})

    env = Mine()
    assert (config.level, env._config.level) == (0.0, 0.5)


@pytest.mark.slow_on("warp")
def test_playground_conventions(apart):
    """What Playground's tools ask of an environment."""
    env, reset, _ = apart
    assert env.observation_size == {"state": (2,), "privileged_state": (2,)}
    assert env.action_size == 1
    assert env.mj_model.nu == 1
    assert env.dt == 0.05
    assert env.n_substeps == 10
    assert env.unwrapped is env
    assert "<mujoco" in env.xml_path
    assert functools.reduce(lambda a, b: a and b, (x.shape[0] == N for x in jax.tree.leaves(reset(keys()).obs)))
