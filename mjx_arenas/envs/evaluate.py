"""What a policy is worth: one episode in each of many arenas that no training has seen, on MJX or in C MuJoCo."""

import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.envs import refusals, worlds_in_c
from mjx_arenas.envs.base import ArenaEnv, Episode, sound
from mjx_arenas.envs.trained_policy import TrainedPolicy
from mjx_arenas.envs.worlds_in_c import shared
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import kind_of, warn
from mjx_arenas.rules import validation
from mjx_arenas.sim import data as data_

HELD_OUT = 10_000_019  # seed of the arenas that policies are judged on
UNSEEN = (HELD_OUT, HELD_OUT + 1)
"""Seeds of worlds that are drawn once to judge policies on, of which a training has one at most."""
MANY = 0.1  # share of worlds of which something is reported, from which on a warning says so
Policy = Callable[[Any, Any], tuple[jax.Array, Any]]
_CHECK = "mjx_arenas.check(arena, ranges) looks for causes that do not depend on the policy"
_CAUSES = {
    "not_finite": ("a number is not finite", _CHECK),
    "bad_action": ("an action of the policy is not finite", "its networks, or what it computes, have such numbers"),
    "invalid": ("the arena is not valid", _CHECK),
    "impossible": (
        "the task is not possible",
        'docs/arms.md has, under "What is possible", what arms and grippers cannot do',
    ),
    "dropped": ("contacts are dropped", "`config.max_contacts` makes more room"),
}
"""What is reported, as `Log` has it: what it means, and what to do."""


class Log(NamedTuple):
    """What each step of one episode in W worlds says, (T, W) bool."""

    success: Any
    done: Any
    not_finite: Any
    """A number of the state, of observations or of the score is not."""
    bad_action: Any
    """An action is not finite, which ends the episode."""
    invalid: Any
    """The arena or the task is not possible (`Episode.valid`)."""
    impossible: Any
    """The task is not (`possible` of `Episode.task`); False where an environment does not tell."""
    dropped: Any
    """Contacts were dropped; False in C."""
    limited: Any
    """The solver stopped at the limit of its iterations; False in C."""


@with_known_arguments
def evaluate(
    policy: Policy, env: Any, n_worlds: int, seed: int = HELD_OUT, engine: str | None = None
) -> dict[str, float]:
    """Success of a policy in one episode in each of W worlds.

    Args:
        policy: `policy(observations, key)` returns actions (W, n) and extra information, like the policies of Brax and
            `policies.load_policy`. It is traced, also for C, and so computes with `jax.numpy` and draws with its key.
        env: an `ArenaEnv`; its worlds are of its configuration's `level`. With `engine=None` it may be any environment with the same
            metrics.
        n_worlds: number of worlds W.
        seed: seed of the arenas, and of the keys that the policy gets, another one in each step.
        engine: None: MJX, as in the environment. "c": C MuJoCo on the recompiled worlds, on all cores. What is absent in a world is not
            in them; tasks and policies see it where it is at the start.

    Returns:
        Shares of worlds. `success`: the task is done in the last step, and the episode did not end early. `success_ever`: it is done in any
            step before the end. `ended_early`: the episode ended early. `reported`: something was not finite, the arena or the task is not
            possible, or contacts were dropped. `solver_limits`: the solver stopped at the limit of its iterations.

    Warns:
        UserWarning: `env` draws its arenas once, with the seed of a training, which may have seen them; or something is reported of at
            least a tenth of the worlds, so that the shares say little about the policy.

    Raises:
        ValueError, TypeError: an argument is invalid, or the policy does not return what it must, computes with NumPy, or was trained
            with other observations. With engine="c": the policy sees pictures, or sensors or tendons are absent in a world.
    """
    n_worlds = validation.whole("n_worlds", n_worlds, 1)
    if engine not in (None, "c"):
        raise validation.error([problem("engine", "must", None, engine, must="None (that of the environment) or 'c'")])
    _check(policy, env, seed, engine)
    if getattr(env, "pool", None) is not None and env.config.get("drawn_seed") not in UNSEEN:
        setting = "`config.settled`" if env.config.settled else "`config.num_arenas`"
        warn(problem("env", "judged_on_drawn", None, None, {"of": n_worlds, "setting": setting}))
    keys = jax.random.split(jax.random.key(seed), n_worlds)
    _check_actions(policy, env, keys, engine)
    log = _in_c(env, policy, keys) if engine == "c" else _on_mjx(env, policy, keys)
    _warn_of_reports(log)
    return shares(log)


def _check(policy: Any, env: Any, seed: Any, engine: str | None) -> None:
    """Refuses what is no policy, no environment and no seed."""
    validation.check_type("policy", policy, Callable, "a function of (observations, key)")  # type: ignore[arg-type]
    validation.check_takes("policy", policy, ("observations", "key"))
    if isinstance(env, type):
        raise validation.error([problem("env", "env_class", None, Told(env.__name__))], kind=TypeError)
    wanted = ArenaEnv if engine == "c" else object
    if not isinstance(env, wanted) or not hasattr(env, "_config"):
        inside = ": give the environment in it, `env.env`" if isinstance(getattr(env, "env", None), ArenaEnv) else ""
        raise validation.error(
            [problem("env", "env_wrapped", None, Told(type(env).__name__), inside=inside)], kind=TypeError
        )
    if not validation.is_whole(seed, 0, 2**32 - 1):
        raise validation.error([problem("seed", "seed", None, seed)])


def _check_actions(policy: Policy, env: Any, keys: jax.Array, engine: str | None) -> None:
    """Refuses what the policy cannot do with what it sees, or gives wrongly, before anything is compiled."""
    seen = jax.eval_shape(jax.vmap(env.reset), keys).obs
    if engine == "c" and isinstance(seen, Mapping) and any(name.startswith("pixels/") for name in seen):
        raise validation.error([problem("env", "env_in_c")])
    before = refusals.drawn_on_host()
    jax.eval_shape(lambda obs: _actions(policy, obs, keys, 0, env), seen)
    if refusals.drawn_on_host() != before:
        warn(problem("policy", "policy_draws_on_host"))


def shares(log: Log) -> dict[str, float]:
    """The shares of worlds, as `evaluate` gives them."""
    ended = np.maximum.accumulate(log.done)
    at_goal = log.success & ~ended
    counts = {"success": at_goal[-1], "ended_early": ended[-1], "success_ever": at_goal.any(0)}
    counts |= {
        "reported": np.any([*_reports(log).values()], axis=0),
        "solver_limits": (log.limited & _before(log)).any(0),
    }
    return {name: float(x.mean()) for name, x in counts.items()}


def _before(log: Log) -> np.ndarray:
    """(T, W) bool: steps up to the one that ends the episode, which a state that is not finite does itself."""
    ended = np.maximum.accumulate(log.done)
    return ~np.vstack([np.zeros_like(ended[:1]), ended[:-1]])


def _reports(log: Log) -> dict[str, np.ndarray]:
    """(W,) bool for each cause: worlds of which it is reported; where the task is not possible, the arena is not also blamed."""
    log = log._replace(invalid=log.invalid & ~log.impossible)
    return {cause: (getattr(log, cause) & _before(log)).any(0) for cause in _CAUSES}


def _impossible(state: Any) -> jax.Array:
    """(W,) bool: where the task of the episode is not possible, of states that say so."""
    task = getattr(state.info.get("episode"), "task", None)
    return jnp.broadcast_to(~jnp.asarray(getattr(task, "possible", True), bool), state.done.shape)


def _warn_of_reports(log: Log) -> None:
    """Warns where something is reported of many worlds, of the commonest cause."""
    reports = _reports(log)
    reported = np.any([*reports.values()], axis=0)
    if reported.mean() >= MANY:
        cause = max(reports, key=lambda name: reports[name].sum())
        why, do = _CAUSES[cause]
        counts = {"n": int(reported.sum()), "of": len(reported), "most": int(reports[cause].sum())}
        warn(problem("", "many_reported", None, None, {**counts, "why": why, "do": do}))


def episode_length(env: Any) -> int:
    """Number of actions in an episode; environments that are not ours have their configuration where Playground's keep it."""
    config: Any = env.config if isinstance(env, ArenaEnv) else env._config
    return int(config.episode_length)


def episode(env: Any, policy: Policy, keys: jax.Array, record: Callable[[Any], Any]) -> tuple[Any, Any]:
    """First states of W worlds, and what `record` keeps of all states of the episode that the policy plays there (T, ...).

    No world starts anew before the end: a box that fell stays fallen.
    """

    @jax.jit
    def run(keys: jax.Array) -> tuple[Any, Any]:
        def step(state: Any, t: jax.Array) -> tuple[Any, Any]:
            actions = _actions(policy, state.obs, keys, t, env)
            state = jax.vmap(env.step)(state.replace(done=jnp.zeros_like(state.done)), actions)
            return state, record(state)

        first = jax.vmap(env.reset)(keys)
        return first, jax.lax.scan(step, first, jnp.arange(episode_length(env)))[1]

    return run(keys)


_TAG = 0x504F4C49
"""Large, because `jax.random.split` of a world's key gives the keys that `fold_in` gives of 0, 1, 2, ..."""


def _actions(policy: Policy, obs: Any, keys: jax.Array, t: Any, env: Any) -> jax.Array:
    """(W, n) what the policy does in W worlds in step t."""
    if isinstance(policy, TrainedPolicy):
        policy.check(obs, "env")
    try:
        given = policy(obs, jax.random.fold_in(jax.random.fold_in(keys[0], _TAG), t))
    except (jax.errors.TracerArrayConversionError, jax.errors.ConcretizationTypeError) as error:
        raise validation.error([problem("policy", "policy_traced")], kind=TypeError) from error
    if not isinstance(given, tuple) or len(given) != 2:
        got = f"a tuple of {len(given)}" if isinstance(given, tuple) else kind_of(given)
        raise validation.error(
            [problem("policy", "policy_returns", None, Told(got), must="a tuple of actions and extra information")]
        )
    rows = f"actions ({len(keys)}, n), a row for each world"
    if not isinstance(given[0], (jax.Array, np.ndarray)):
        raise validation.error([problem("policy", "policy_returns", None, Told(kind_of(given[0])), must=rows)])
    if (shape := jnp.shape(given[0]))[:1] != (len(keys),):
        raise validation.error([problem("policy", "policy_returns", None, Told(f"shape {shape}"), must=rows)])
    if (size := getattr(env, "action_size", None)) is not None and shape[1:] != (size,):
        must = f"actions ({len(keys)}, {size}), as `env` has"
        raise validation.error([problem("policy", "policy_returns", None, Told(f"shape {shape}"), must=must)])
    return given[0]


def _on_mjx(env: Any, policy: Policy, keys: jax.Array) -> Log:
    def record(state: Any) -> Log:
        told = {name: x > 0 for name, x in state.metrics.items()}
        bad_action = told.get("nan_action", jnp.zeros_like(state.done, bool))  # environments of others may not tell
        unsound = told["nan_state"], bad_action, told["invalid_arena"], _impossible(state)
        return Log(told["success"], state.done > 0, *unsound, told["dropped_contacts"], told["solver_limits"])

    return Log(*map(np.asarray, episode(env, policy, keys, record)[1]))


def _judged(
    env: ArenaEnv, data: mjx.Data, episode: Episode, action: jax.Array
) -> tuple[Any, jax.Array, Any, jax.Array]:
    """What a policy sees, without what is not finite; whether the episode ends; success; and () bool, whether a number is not finite."""
    obs, (reward, ends, metrics) = env.observe(data, episode), env.score(data, episode, action)
    broken = ~jnp.stack([sound(x).all() for x in jax.tree.leaves((obs, reward, metrics))]).all()
    obs = jax.tree.map(lambda x: jnp.where(sound(x), x, jnp.zeros_like(x)), obs)
    return obs, ends, metrics["success"], broken


def _in_c(env: ArenaEnv, policy: Policy, keys: jax.Array) -> Log:
    """The same steps as `ArenaEnv.step` takes, with C MuJoCo in the place of MJX."""
    flaws: Any = getattr(env, "flaws", None)  # delays and noise
    begins = jnp.zeros((), bool)  # no world begins another episode
    first = jax.jit(jax.vmap(env.reset))(keys)
    episodes = first.info["episode"]
    start = data_.blank(env.mj_model)
    names = shared(start, mujoco.MjData(env.mj_model))
    params, qpos = jax.tree.map(np.asarray, (episodes.params, episodes.qpos))
    each = [jax.tree.map(lambda x, w=w: x[w], params) for w in range(len(keys))]
    worlds = [worlds_in_c.world(env, each[w], qpos[w], names, w) for w in range(len(keys))]
    at_start = {name: np.asarray(getattr(first.data, name)) for name in names}

    def gathered() -> dict[str, jax.Array]:
        read = {
            name: np.array([one.read(name, x) for one, x in zip(worlds, at_start[name], strict=True)]) for name in names
        }
        return {name: jnp.asarray(x, getattr(start, name).dtype) for name, x in read.items()}

    def look(values: dict[str, jax.Array], episode: Episode, action: jax.Array, late: Any, t: Any) -> Any:
        data = start.replace(**values)
        obs, *judged = _judged(env, data, episode, action)
        late, obs = flaws.see(late, obs, begins, episode, t + 1) if flaws else (late, obs)
        return late, obs, *judged

    def drive(values: dict[str, jax.Array], episode: Episode, action: jax.Array, late: Any, t: Any) -> Any:
        late, action = flaws.act(late, action, begins, episode, t) if flaws else (late, action)
        wrong, data = ~jnp.isfinite(action).all(), env.mark(start.replace(**values), episode)
        action = jnp.where(wrong, env.neutral_action, jnp.clip(action, -1.0, 1.0))
        moved = {"ctrl": env.drive(data, episode, action), "mocap_pos": data.mocap_pos, "mocap_quat": data.mocap_quat}
        return late, action, moved, wrong

    @jax.jit
    def act(obs: Any, values: dict[str, jax.Array], late: Any, t: Any) -> tuple[Any, ...]:
        actions = _actions(policy, obs, keys, t, env)
        return jax.vmap(drive, (0, 0, 0, 0, None))(values, episodes, actions, late, t)

    def move(w: int, moved: dict[str, np.ndarray]) -> None:
        worlds[w].move({name: x[w] for name, x in moved.items()}, env.n_substeps)

    score, log, obs = jax.jit(jax.vmap(look, (0, 0, 0, 0, None))), [], first.obs
    late, values = first.info.get("late"), gathered()
    invalid, impossible = ~np.asarray(episodes.valid), np.asarray(_impossible(first))
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        for t in map(np.int32, range(episode_length(env))):
            late, actions, moved, wrong = act(obs, values, late, t)
            moved = jax.tree.map(np.asarray, moved)
            list(threads.map(lambda w, moved=moved: move(w, moved), range(len(worlds))))
            values = gathered()
            late, obs, ends, success, broken = score(values, episodes, actions, late, t)
            unsound = np.array([one.broken for one in worlds]) | np.asarray(broken)
            wrong, never = np.asarray(wrong), np.zeros_like(unsound)
            ended = np.asarray(ends) | unsound | wrong
            log.append(Log(np.asarray(success) > 0, ended, unsound, wrong, invalid, impossible, never, never))
    return Log(*map(np.stack, zip(*log, strict=True)))
