"""Environments that are made or used wrongly: each mistake is one sentence, where it is made or traced."""

import random
import types
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds
from idle import Idle
from ml_collections import config_dict
from mujoco_playground import State
from sliding import LENGTH, RANGES, SLIDE, Slide, keys, slide

import mjx_arenas as mja
from mjx_arenas.envs import ArenaEnv, BraxEnv, env_config, refusals
from mjx_arenas.envs.evaluate import HELD_OUT, UNSEEN, _actions
from mjx_arenas.envs.trained_policy import TrainedPolicy


def used_arena():
    arena = mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06)])
    assert arena.mj_model.nq == 7
    return arena


@pytest.mark.slow
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
            lambda: Slide(action_repeat=2),
            "`config.action_repeat` must be 1, as `config.ctrl_dt` says how long an action is held, got 2.",
        ),
        (
            lambda: Slide(max_contacts=0),
            "`config.max_contacts` must be None or a whole number >= 1, got 0.",
        ),
        (
            lambda: Slide(level_step=0.1),
            "`config.level_step` must be 0, as `ranges` is no function of a level, got 0.1.",
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
            "`config_overrides` has 'lvel', which the configuration has not: did you mean 'level'?",
        ),
        (
            lambda: Slide(gamma=0.5),
            "`config_overrides` has 'gamma', which the configuration has not: it has 'action_repeat', 'arenas', 'ctrl_dt', 'drawn_seed', "
            "'episode_length', 'impl', 'level', 'level_step', 'max_contacts', 'num_arenas', 'settled' and 'sim_dt'.",
        ),
        (
            lambda: Slide(impl=3),
            "`config_overrides['impl']` must be a text, got 3.",
        ),
        (
            lambda: Slide(episode_length=1.5),
            "`config_overrides['episode_length']` must be a whole number, got 1.5.",
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
            lambda: Slide(ctrl_dt=float("inf")),
            "`config.ctrl_dt` must be a whole multiple of `config.sim_dt`, got inf and 0.005.",
        ),
        (
            lambda: (
                (env := Slide()) and jax.eval_shape(env.step, jax.eval_shape(env.reset, keys()[0]), jnp.zeros((4, 1)))
            ),
            "`action` must be of one world, got shape (4, 1) instead of (1,): use jax.vmap.",
        ),
        (
            lambda: (env := Slide()) and jax.eval_shape(env.step, jax.eval_shape(env.reset, keys()[0]), jnp.zeros(4)),
            "`action` must have 1 number, got 4.",
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


def test_missing_methods():
    """All that a task must define is named when the environment is made."""

    class Mine(ArenaEnv):
        def observe(self, data, episode):
            return {}

    with pytest.raises(TypeError) as error:
        Mine(mja.TableArena(), RANGES, env_config(0.05, 0.005, LENGTH))
    assert str(error.value) == "Mine must define 'draw_task' and 'score'."


@pytest.mark.parametrize(
    "use",
    [
        lambda env: jax.eval_shape(env.reset, keys()[0]),
        lambda env: env.mj_model,
        lambda env: env.arena,
        lambda env: env.dt,
        lambda env: env.config,
    ],
)
def test_constructor_that_is_not_called(use):
    """The class is told; what is missing otherwise is Python's to tell, and what is there counts."""

    class Mine(Idle):
        def __init__(self, n):
            self.n = n

    with pytest.raises(AttributeError) as error:
        use(Mine(1))
    assert str(error.value) == "`Mine.__init__` must call super().__init__(...) before the environment is used."
    with pytest.raises(AttributeError, match=r"^'Mine' object has no attribute 'bal'"):
        _ = Mine(1).bal
    one = Mine(1)
    one.arena = 3
    assert one.arena == 3


def test_numbers_that_are_not_known():
    """A branch on a traced number is answered by the method that has it."""

    class Mine:
        def score(self, height):
            return 1.0 if height > 0 else 0.0

        def observe(self, height):
            return np.array([height, height])

        def draw_task(self, height):
            return [1.0, 2.0][(height > 0).astype(int)]

    for method in (Mine().score, Mine().observe, Mine().draw_task):
        with pytest.raises(TypeError, match=rf"^`Mine.{method.__name__}` must work on traced arrays, .* use jnp.where"):
            jax.jit(lambda height, method=method: refusals.asked(method, height))(0.1)
    assert refusals.asked(Mine().score, 0.1) == 1.0


def test_numbers_of_the_host():
    """Of what is drawn without a key, and is the same ever after, a warning tells; of a generator of its own nothing can."""

    class Mine:
        def draw_task(self, height):
            return height + np.random.uniform()

        def observe(self, height):
            return height + random.random()

        def score(self, height):
            return height + np.random.default_rng(0).uniform()

    for method in (Mine().draw_task, Mine().observe):
        said = rf"^`Mine.{method.__name__}` seems to draw with `np\.random` or `random`: it is traced once, so that these numbers are the"
        with pytest.warns(UserWarning, match=said) as caught:
            refusals.asked(method, 0.1)
        assert len(caught) == 1
    assert refusals.asked(Mine().score, 0.1) == 0.1 + np.random.default_rng(0).uniform()


@pytest.mark.slow
def test_wrong_states_and_keys():
    """What belongs to many worlds, or to another argument, is answered where it is traced."""
    env = slide("warp")[0]
    state = jax.eval_shape(env.reset, keys()[0])
    many = jax.eval_shape(jax.vmap(env.reset), keys())
    action = jnp.zeros(1)
    with pytest.raises(ValueError, match=r"^`state` must be of one world, got 4 worlds: use jax\.vmap\."):
        jax.eval_shape(env.step, many, action)
    with pytest.raises(
        TypeError, match=r"^`state` must be a State, as reset and step give it, got float32 of shape \(1,\)\."
    ):
        jax.eval_shape(env.step, action, state)
    with pytest.raises(
        ValueError, match=r"^`rng` must be one key, of one world, got shape \(4, 2\): use jax\.vmap, or randomize\."
    ):
        jax.eval_shape(env.reset, keys())
    with pytest.raises(ValueError, match=r"^`rng` must be a key such as jax\.random\.key\(7\), got 7\."):
        env.reset(7)
    with pytest.raises(ValueError, match=r"^`rng` must be a key such as jax\.random\.key\(0\), got int32\."):
        jax.vmap(env.reset)(jnp.arange(4))
    one = jax.eval_shape(env.reset, keys()[0])
    for given, got in ((None, "NoneType"), (0.5, "float"), ([0.5], "list")):
        with pytest.raises(TypeError, match=rf"^`action` must be an array \(1,\), got {got}\."):
            jax.eval_shape(lambda state, given=given: env.step(state, given), one)
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


class Driven(Slide):
    def drive(self, data, episode, action):
        return jnp.zeros(3)


def test_a_control_of_a_task_that_drives():
    env = Driven(ranges=mja.ArenaRanges())
    with pytest.raises(
        ValueError, match=r"^`Driven\.drive` must give \(1,\), a number for each actuator, got shape \(3,\)\."
    ):
        jax.eval_shape(env.step, jax.eval_shape(env.reset, keys()[0]), jnp.zeros(1))


class Odd(Slide):
    """Draws, shows and marks what is none of it."""

    task, seen, marks = {}, {"state": 0.0}, True

    def draw_task(self, key, params, qpos):
        return self.task

    def observe(self, data, episode):
        return {name: jnp.zeros(2) for name in self.seen}

    def mark(self, data, episode):
        return data if self.marks else None


class Drawn(NamedTuple):
    possible: Any


def test_odd_tasks():
    env = Odd("warp", mja.ArenaRanges(), objects=())
    for name, value, says in (
        ("task", "a goal", "`Odd.draw_task` must give a tree of arrays, got str in it."),
        ("seen", {"states": 0.0}, "`Odd.observe` must give 'state' among its observations, got 'states'."),
        ("marks", False, "`Odd.mark` must be a function that returns the data, got NoneType."),
    ):
        setattr(env, name, value)
        with pytest.raises((TypeError, ValueError), match=r"^`Odd") as error:
            jax.eval_shape(env.reset, keys()[0])
        assert str(error.value) == says
        delattr(env, name)
    for value, got in ((0.5, "float32"), (np.ones(2, bool), "bool of shape (2,)")):
        with pytest.raises(ValueError, match=r"^`Odd\.draw_task` must give one bool as `possible`, got") as error:
            refusals.check_task("Odd.draw_task", Drawn(value))
        assert str(error.value).endswith(f" {got}.")


def policy(*shape):
    return lambda obs, key: (jnp.zeros(shape), {})


REPORTS = ("nan_state", "nan_action", "invalid_arena", "dropped_contacts", "solver_limits")


class Still:
    """An environment without a simulation."""

    action_size, _config = 1, types.SimpleNamespace(episode_length=1)

    def reset(self, key):
        metrics = dict.fromkeys(("success", *REPORTS), 0.0)
        return State(None, {"state": jnp.zeros(2)}, jnp.zeros(()), jnp.zeros(()), metrics, {})

    def step(self, state, action):
        return state


def test_policies_get_another_key_in_each_step():
    seen, env = [], Still()
    env._config = types.SimpleNamespace(episode_length=3)

    def policy(obs, key):
        jax.debug.callback(lambda x: seen.append(float(x)), jax.random.normal(key))
        return jnp.zeros((2, 1)), {}

    mja.evaluate(policy, env, 2)
    jax.effects_barrier()
    assert len({*seen}) == len(seen) == 3


def test_a_policy_that_draws_on_the_host():
    def by_numpy(obs, key):
        return jnp.full((2, 1), np.random.uniform()), {}

    with pytest.warns(
        UserWarning, match="^`policy` seems to draw with `np.random` or `random`: it is traced once"
    ) as told:
        mja.evaluate(by_numpy, Still(), 2)
    assert len(told) == 1


@pytest.mark.slow
def test_a_state_of_another_environment():
    state = jax.eval_shape(slide("jax")[1], keys())
    one = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape[1:], x.dtype), state)

    class Other(Slide):
        def draw_task(self, key, params, qpos):
            return {"more": jnp.zeros(2)}

    with pytest.raises(ValueError, match=r"^`state` is of another environment, whose episodes have other numbers\."):
        jax.eval_shape(Other().step, one, jnp.zeros(1))


def test_milliseconds():
    with pytest.warns(UserWarning, match=r"^`config\.ctrl_dt` is 40 s: it is in seconds, not in milliseconds\."):
        Slide(ctrl_dt=40.0)


def test_arenas_that_were_drawn_once_are_told():
    for setting, settled in (("num_arenas", 0), ("settled", 2)):
        env = Still()
        env.pool, env.config = (), config_dict.create(settled=settled, drawn_seed=0)
        with pytest.warns(UserWarning, match="^The arenas are no new ones") as told:
            mja.evaluate(policy(2, 1), env, 2)
        assert str(told[0].message) == (
            "The arenas are no new ones: `env` draws them once, and takes one of these in each of the 2 worlds. With "
            f"`config.{setting}` set to 0 they are new."
        )
        env.config.drawn_seed = UNSEEN[0]  # as in the judgement of a training
        mja.evaluate(policy(2, 1), env, 2)


def test_keys_of_policies():
    """They are none of those from which worlds and episodes are drawn."""
    keys, seen = jax.random.split(jax.random.key(HELD_OUT), 2), []

    def told(obs, key):
        seen.append(key)
        return jnp.zeros((2, 1)), {}

    for t in range(4):
        _actions(told, {"state": jnp.zeros((2, 1))}, keys, t, None)
    drawn = [one for n in (2, 3, 4) for one in jax.random.split(keys[0], n)]
    numbers = {tuple(jax.random.key_data(key).tolist()) for key in (*seen, *drawn)}
    assert len(numbers) == 4 + len({tuple(jax.random.key_data(key).tolist()) for key in drawn})


def test_wrong_judgements():
    env = slide("warp")[0]
    by_numpy = (
        "`policy` must compute with jax.numpy, as it is traced; `jax.pure_callback` calls one that computes with NumPy."
    )
    says_tuple = "`policy` must return a tuple of actions and extra information, got "
    wrapped = "`env` must be an ArenaEnv, without a wrapper, got BraxEnv: give the environment in it, `env.env`."
    for given, says in (
        ({"policy": "out/train"}, "`policy` must be a function of (observations, key), got str."),
        ({"policy": lambda obs: obs}, "`policy` must be a function of (observations, key), got one of (obs)."),
        ({"env": Slide}, "`env` must be an environment, got the class Slide: make one, Slide()."),
        ({"env": BraxEnv(env)}, wrapped),
        ({"env": BraxEnv(env), "engine": "c"}, wrapped),
        ({"seed": 2**70}, f"`seed` must be a whole number from 0 to 2^32 - 1, got {2**70}."),
        ({"policy": lambda obs, key: jnp.zeros((2, 1))}, says_tuple + "float32 of shape (2, 1)."),
        ({"policy": lambda obs, key: None}, says_tuple + "NoneType."),
        ({"policy": lambda obs, key: (jnp.zeros((2, 1)),)}, says_tuple + "a tuple of 1."),
        (
            {"policy": lambda obs, key: (None, {})},
            "`policy` must return actions (2, n), a row for each world, got NoneType.",
        ),
        ({"policy": policy(2)}, "`policy` must return actions (2, 1), as `env` has, got shape (2,)."),
        ({"policy": policy(2, 8)}, "`policy` must return actions (2, 1), as `env` has, got shape (2, 8)."),
        ({"policy": lambda obs, key: (np.tanh(np.asarray(obs["state"])), {})}, by_numpy),
    ):
        with pytest.raises((TypeError, ValueError), match=r"^`") as error:
            mja.evaluate(**{"policy": policy(2, 1), "env": Still(), "n_worlds": 2, **given})
        assert str(error.value) == says
    assert mja.evaluate(policy(2, 1), Still(), 2)["success"] == 0.0


def test_control_without_a_range():
    """By default an action would be mapped to nothing."""
    arena = mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06)])
    arena.attach(mujoco.MjSpec.from_string(SLIDE.replace('ctrlrange="-1 1"', 'name="drive"')))
    env = Idle(arena, mja.ArenaRanges(), 0.05, 0.005, LENGTH)
    with pytest.raises(ValueError, match=r"^`Idle\.control`") as error:
        env.control(jnp.zeros(1))
    message = "`Idle.control` must be defined, as actuator 'robot_drive' has no ctrlrange to map actions to."
    assert str(error.value) == message
    with pytest.raises(ValueError, match=r"^`Idle\.control`") as error:
        env.control(jnp.zeros(2))
    message = "`Idle.control` must be defined, from actions of shape (2,) to the arena's 1 actuators."
    assert str(error.value) == message


def test_wrong_types():
    with pytest.raises(TypeError, match=r"^`config` must be a ConfigDict, as from env_config\(\.\.\.\), got dict\.$"):
        ArenaEnv(mja.TableArena(), RANGES, {"ctrl_dt": 0.05})
    with pytest.raises(
        TypeError, match=r"^`arena` must be an arena such as mjx_arenas\.TableArena\(\), got MjModel\.$"
    ):
        ArenaEnv(mja.TableArena().mj_model, RANGES, env_config(0.05, 0.005, LENGTH))


def test_render_of_many_worlds():
    env = Slide()
    state = jax.eval_shape(jax.vmap(env.reset), keys())
    with pytest.raises(ValueError, match=r"^`trajectory` must be of one world, got many: mjx_arenas\.take"):
        env.render(state)


def test_ranges_of_another_arena():
    with pytest.raises(ValueError, match="table"):
        Slide(ranges=worlds.RANGES._replace(table_rots=mja.Uniform([0, 0, 0], [1, 1, 1])))


def test_observations_of_another_task():
    """They are refused where the policy is called, and where it is judged, with the argument that gives them."""
    policy = TrainedPolicy(
        lambda obs, key: (obs["state"][..., :1], {}), "reach", {"state": (31,), "pixels/a": (8, 8, 3)}
    )
    state, seen = jnp.zeros((2, 31)), jnp.zeros((2, 8, 8, 3))
    assert policy({"state": state, "pixels/a": seen, "more": seen}, None)[0].shape == (2, 1)
    says = " must give the policy {} as '{}', as in its training on 'reach', got {}."
    for observation, *told in (
        ({"state": jnp.zeros((2, 37)), "pixels/a": seen}, "31 numbers", "state", "37 numbers"),
        ({"state": jnp.zeros(()), "pixels/a": seen}, "31 numbers", "state", "one number"),
        ({"stat": state, "pixels/a": seen}, "31 numbers", "state", "'stat', 'pixels/a'"),
        ({"state": state, "pixels/a": seen[:, :4]}, "(8, 8, 3) numbers", "pixels/a", "(4, 8, 3) numbers"),
        (np.zeros((2, 31)), "31 numbers", "state", "ndarray"),
    ):
        with pytest.raises(ValueError, match=r"^`observation`") as error:
            policy(observation, None)
        assert str(error.value) == "`observation`" + says.format(*told)
    with pytest.raises(ValueError, match=r"^`env`") as error:
        mja.evaluate(policy, Still(), 2)
    assert str(error.value) == "`env`" + says.format("31 numbers", "state", "2 numbers")
