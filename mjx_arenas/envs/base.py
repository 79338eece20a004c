"""An environment whose worlds have arenas of their own, and new ones in every episode."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
from ml_collections import config_dict
from mujoco import mjx
from mujoco_playground import State
from mujoco_playground._src import mjx_env

from mjx_arenas import strict
from mjx_arenas.arena import Arena
from mjx_arenas.envs import config as config_
from mjx_arenas.envs import pictures as pictures_
from mjx_arenas.envs import pools, refusals
from mjx_arenas.envs.vision import Eyes, Now, Vision
from mjx_arenas.envs.when_needed import when_needed
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.problem import problem
from mjx_arenas.rows import replace_rows
from mjx_arenas.rules.validation import check_type, error, one_key_problems, raise_all
from mjx_arenas.sample.sampling import world_keys
from mjx_arenas.sim import programs, starts
from mjx_arenas.sim.data import place_static
from mjx_arenas.sim.warp_notes import dropped_contacts, quiet, solver_limits
from mjx_arenas.write.replace import replace

RangesAt = Callable[[jax.Array], ArenaRanges]


class Episode(NamedTuple):
    """An episode's arena, start and task, for one world."""

    params: ArenaParams
    """The numbers of its arena."""
    fields: dict[str, jax.Array]
    """Fields of `mjx.Model` in this world, by name."""
    qpos: jax.Array
    """(nq,) positions at the start."""
    task: Any
    """Whatever the task draws, such as a goal."""
    valid: jax.Array
    """() bool: whether the arena and the task are possible, and each object found a free place."""
    key: jax.Array
    """Key for draws during the episode."""


class ArenaEnv(mjx_env.MjxEnv):
    """A task in an arena, for one world (use `jax.vmap`).

    It works with MuJoCo Playground's wrappers, with Brax's (as `BraxEnv(env)`), and in a loop of your own. A subclass defines `draw_task`,
    `observe` and `score`, and may define `mark`. For `vision` it also defines `proprioception`.

    A world keeps its arena in `state.info["episode"]` and has the next one ready in `state.info["next_episode"]`. It switches to the next
    arena in the first step of an episode. This step comes after `state.done` (in a loop that passes the state back as it is), or when a
    wrapper has put back the data of an earlier start (the auto-reset of Playground and Brax). The step takes no action, because the
    observation before it was of another arena. Nothing is compiled again, nothing goes to the host, and only worlds that need an arena draw
    one (`when_needed`).

    Args:
        arena: arena with its robot, not compiled yet.
        ranges: ranges of what varies between episodes. For a curriculum, a function from a world's `level`, a traced number from 0 to 1, to
            ranges (`curriculum.widening`): it may change numbers of distributions, but must name the same quantities at every level.
        config: configuration as from `env_config`, which says what its keys mean.
        config_overrides: dotted names and values. `config` itself stays as it is.
        keyframe: name of the keyframe in which the robot starts each episode, except for the objects' places and the time, which is 0.
            None: at `qpos0`, at rest.
        vision: the pictures that the policy sees. Observations are then `pixels/view_0`, ..., `proprioception` as `state`, and `observe`'s
            `privileged_state`. Pictures show the state after a step; in the first step of an episode they show its start.

    Raises:
        ValueError, TypeError: the configuration, the ranges or the vision are wrong; or, once traced, `score` or `control` are.
    """

    arena: Arena = refusals.of_init()
    """The arena with its robot. `arena.compile(params)` and `arena.c_world(params)` make the world of an episode's `params`."""
    _config = _ctrl_dt = _sim_dt = _mjx_model = refusals.of_init()

    def __init__(
        self,
        arena: Arena,
        ranges: ArenaRanges | RangesAt,
        config: config_dict.ConfigDict,
        config_overrides: Mapping[str, Any] | None = None,
        keyframe: str | None = None,
        vision: Vision | None = None,
    ) -> None:
        chosen: Any = config_.chosen_config(config, config_overrides or {}, config_.NEEDED)
        super().__init__(chosen)
        refusals.check_arena(arena)
        config_.check(chosen, ranges)
        refusals.check_timestep(arena, chosen.sim_dt)
        check_type("ranges", ranges, (ArenaRanges, Callable), "ArenaRanges or a function of a level")  # type: ignore[arg-type]
        refusals.check_methods(self, ArenaEnv)
        arena.spec.option.timestep = chosen.sim_dt
        self.arena, self.ranges = arena, ranges
        self._levels = [self._ranges_at(jnp.float32(level)) for level in ((0, 1) if callable(ranges) else (0,))]
        for at in self._levels:
            arena.sample_params(world_keys(0, [0])[0], at)  # says what is wrong with the ranges
            arena.check_ranges(at, held=True)
        if self._levels[0].varying != self._levels[-1].varying:
            raise error([problem("ranges", "same_quantities")])
        self._varying = self._levels[0].varying
        starts.check_keyframe(arena.mj_model, keyframe)
        starts.warn_of_idle(arena.record, keyframe, dict.fromkeys(self._varying))
        self.keyframe = keyframe
        self._max_contacts: int | None = chosen.get("max_contacts")
        self._mjx_model = quiet(arena.put_model(chosen.impl))
        self.pool = pools.pool(arena, self._mjx_model, self._levels[0], chosen, keyframe)
        self._eyes = None if vision is None else Eyes(arena, vision, chosen.get("episode_length", jnp.inf))

    @property
    def config(self) -> config_dict.ConfigDict:
        """Configuration with which the environment was made."""
        return self._config

    # A task.

    def draw_task(self, key: jax.Array, params: ArenaParams, qpos: jax.Array) -> Any:
        """Draws what the task needs for an episode, a tree of arrays. `params` and `qpos` (nq,) are those of the episode.

        If it has an attribute `possible`, () bool, this says whether the task can be done; else `invalid_arena` reports the episode.
        """
        raise NotImplementedError(f"{type(self).__name__} must define `draw_task`.")

    def observe(self, data: mjx.Data, episode: Episode) -> dict[str, jax.Array]:
        """Observations: `state`, which a policy may see, and `privileged_state`, for a critic."""
        raise NotImplementedError(f"{type(self).__name__} must define `observe`.")

    def proprioception(self, data: mjx.Data) -> jax.Array:
        """(n,) the robot's knowledge of itself, which a policy gets besides pictures. With an argument `episode` it gets that, too."""
        raise NotImplementedError(f"{type(self).__name__} must define `proprioception` for `vision`.")

    def score(
        self, data: mjx.Data, episode: Episode, action: jax.Array
    ) -> tuple[jax.Array, jax.Array, dict[str, jax.Array]]:
        """() reward, () bool whether the episode ends, and () metrics by name, including `success` (0 or 1)."""
        raise NotImplementedError(f"{type(self).__name__} must define `score`.")

    def mark(self, data: mjx.Data, episode: Episode) -> mjx.Data:
        """Returns `data` with the task's marker in place, for pictures."""
        del episode
        return data

    def control(self, action: jax.Array) -> jax.Array:
        """(nu,) control of the actuators for an action (`action_size`,) within -1 and 1.

        By default actions are scaled to the nominal ctrlrange. If `actuator.ctrlrange` varies, the world's range clamps the result.
        """
        refusals.check_default_control(f"{type(self).__name__}.control", jnp.shape(action), self.arena.mj_model)
        low, high = self.arena.mj_model.actuator_ctrlrange.T
        return jnp.asarray((low + high) / 2 + (high - low) / 2 * action)

    def drive(self, data: mjx.Data, episode: Episode, action: jax.Array) -> jax.Array:
        """(nu,) control for an action, if it also depends on the state before the step. By default it is `control`."""
        del data, episode
        return self.control(action)

    # Playground's interface.

    def reset(self, rng: jax.Array) -> State:
        """A world at the start of its first episode; vmap."""
        raise_all(one_key_problems("rng", rng), "`rng`")
        rng, key = jax.random.split(rng)
        level = jnp.asarray(self._config.level, jnp.float32)
        episode = self._draw(self._mjx_model, key, level, None)
        model = replace(self._mjx_model, episode.fields)
        # The key tells how many worlds there are, where all else is the same in all of them.
        data = self.arena.make_world_data(model, episode.params, key, None, self.keyframe, self._max_contacts)
        data = data.replace(qpos=episode.qpos, time=jnp.zeros_like(data.time))
        data = refusals.marked(self, strict.of_mjx(mjx.kinematics)(model, data), episode)
        reward, _, metrics = self._scored(data, episode, jnp.zeros(self.action_size))
        false = jnp.zeros((), bool)
        info = {"rng": rng, "level": level, "episode": episode, "next_episode": episode}
        info |= {"step": jnp.zeros((), jnp.int32), **dict.fromkeys(("ready", "started", "succeeded"), false)}
        obs = self._observed(data, episode)
        if self._eyes is not None:
            info |= {"drawn_steps": jnp.zeros((), jnp.int32), "unseen": false}
            obs |= self._eyes.first(self._now(model, data, episode, info["step"]))
        zeros = dict.fromkeys({**_REPORTS, **metrics}, jnp.zeros((), jnp.float32))
        return State(data, obs, jnp.zeros_like(reward), jnp.zeros_like(reward), zeros, info)

    def step(self, state: State, action: jax.Array) -> State:
        """Takes one control step; vmap. Actions are clipped to [-1, 1]. One that is not finite counts as none and ends the episode."""
        refusals.check_step(state, action, self.action_size)
        info, data = dict(state.info), state.data
        begins = self.begins(state)
        moved = jnp.where(info["succeeded"], 1.0, -1.0) * float(self._config["level_step"])
        info["level"] = jnp.where(begins, jnp.clip(info["level"] + moved, 0.0, 1.0), info["level"])
        info["step"] = 1 + info["step"] * ~begins  # times are sums of rounded numbers, and would be others
        upcoming, rng, ready = self._prepare(info, begins)
        episode = jax.tree.map(lambda new, old: jnp.where(begins, new, old), upcoming, info["episode"])
        model = replace(self._mjx_model, episode.fields)
        data = refusals.marked(self, place_static(model, self._started(data, episode, begins)), episode)

        not_finite = ~jnp.isfinite(action).all()
        action = jnp.where(not_finite | begins, self.neutral_action, jnp.clip(action, -1.0, 1.0))
        control = self.drive(data, episode, action)
        refusals.check_control(self, ArenaEnv, control)
        data = strict.of_mjx(mjx_env.step)(model, data, control, self.n_substeps)
        obs = self._observed(data, episode)
        if self._eyes is not None:
            info["drawn_steps"] = info["drawn_steps"] + 1
            due, new = info["drawn_steps"] % self._eyes.every == 0, begins | info["unseen"]
            info["unseen"] = new & ~due
            obs |= self._eyes.next(self._now(model, data, episode, info["step"]), state.obs, new, due)
        reward, ends, metrics = self._scored(data, episode, action)
        numbers = jax.tree.leaves((data.qpos, data.qvel, obs, reward, metrics))
        broken = ~jnp.stack([sound(x).all() for x in numbers]).all()
        obs = jax.tree.map(lambda x: jnp.where(sound(x), x, jnp.zeros_like(x)), obs)
        failed = not_finite | broken
        reward, metrics = jax.tree.map(lambda x: jnp.where(failed, 0.0, x).astype(jnp.float32), (reward, metrics))
        length: Any = self._config.get("episode_length", jnp.inf)
        at_end = (metrics["success"] > 0) & (info["step"] >= length)
        reports = (not_finite, broken, ~episode.valid, dropped_contacts(data), solver_limits(data), at_end)
        reports = {name: jnp.asarray(x, jnp.float32) for name, x in zip(_REPORTS, reports, strict=True)}
        metrics = {**state.metrics, **metrics, **reports}  # wrappers add to them
        info |= {"rng": rng, "episode": episode, "next_episode": upcoming, "ready": ready & ~begins}
        info |= {"started": jnp.ones((), bool), "succeeded": metrics["success"] > 0}
        reward = jnp.asarray(jnp.where(begins, 0.0, reward))
        return State(data, obs, reward, (ends | failed).astype(jnp.float32), metrics, info)

    def begins(self, state: State) -> jax.Array:
        """() bool: whether the next step is the first one of an episode."""
        return (state.done > 0) | ((state.data.time == 0) & state.info["started"])

    @property
    def xml_path(self) -> str:
        """Text of the nominal arena's MJCF, as there is no file."""
        return self.arena.xml

    @property
    def action_size(self) -> int:
        """Number of actuators."""
        return self.arena.mj_model.nu

    @property
    def neutral_action(self) -> jax.Array:
        """(`action_size`,) what counts where no action is taken, as in the first step of an episode; by default zeros."""
        return jnp.zeros(self.action_size)

    @property
    def mj_model(self) -> mujoco.MjModel:
        """Model of the nominal arena. That of a world is `arena.compile(state.info["episode"].params)`."""
        return self.arena.mj_model

    @property
    def mjx_model(self) -> mjx.Model:
        """MJX model of the nominal arena."""
        return self._mjx_model

    def arena_fields(self, model: mjx.Model) -> dict[str, jax.Array]:
        """The fields of `model`, one world, that the environment writes itself, as they are in the nominal arena; jit, vmap.

        These are the fields that the ranges affect. A `randomization_fn` has no effect on them, because each episode overwrites them.
        """
        return programs.written(self.arena.record, model, self.arena.nominal_params(), self._varying)

    def render(
        self,
        trajectory: list[State] | State,
        height: int = 240,
        width: int = 320,
        camera: str | mujoco.MjvCamera | None = None,
        scene_option: mujoco.MjvOption | None = None,
        modify_scene_fns: Sequence[Callable[[mujoco.MjvScene], None]] | None = None,
    ) -> Any:
        """Pictures (height, width, 3) of states of one world, each in the arena that the world has then.

        `mjx_arenas.take(state, 0)` is that of the first of many worlds.

        Without a `camera` one is chosen for all of the states together: give a list of them, as pictures that are drawn one by one are
        each seen from elsewhere. Tables and furniture are in view in all of the states, and so are robots, objects and goals that are
        bodies, as far as they are within 1.5 m of these. MuJoCo's free camera is taken if a state has neither a table nor furniture.

        Raises:
            ValueError: the states are of many worlds.
            RuntimeError: there is no OpenGL here.
        """
        states = trajectory if isinstance(trajectory, list) else [trajectory]
        pictures = pictures_.of(self.arena, states, (height, width), camera, scene_option, modify_scene_fns)
        return pictures if isinstance(trajectory, list) else pictures[0]

    # Internals.

    def _ranges_at(self, level: jax.Array) -> ArenaRanges:
        if self._config.arenas == "nominal":
            return ArenaRanges()
        return self.ranges if isinstance(self.ranges, ArenaRanges) else self.ranges(level)

    def _observed(self, data: mjx.Data, episode: Episode) -> Any:
        """What the task's `observe` gives, if it is as it must be."""
        given = refusals.asked(self.observe, data, episode)
        refusals.check_observation(f"{type(self).__name__}.observe", given, sees=self._eyes is not None)
        if self._eyes is None:
            return given
        refusals.check_privileged(f"{type(self).__name__}.observe", given)
        return {"state": refusals.felt(self, data, episode), "privileged_state": given["privileged_state"]}

    def _now(self, model: mjx.Model, data: mjx.Data, episode: Episode, step: jax.Array) -> Now:
        """What there is to see."""
        lasting, passing = (jax.random.fold_in(episode.key, tag) for tag in _TAGS[1:])
        return Now(model, episode.params, data, lasting, jax.random.fold_in(passing, step))

    def _scored(
        self, data: mjx.Data, episode: Episode, action: jax.Array
    ) -> tuple[jax.Array, jax.Array, dict[str, jax.Array]]:
        """What the task's `score` gives, if it is as it must be."""
        given = refusals.asked(self.score, data, episode, action)
        refusals.check_score(f"{type(self).__name__}.score", given, _REPORTS)
        return given

    def _draw(self, model: mjx.Model, key: jax.Array, level: jax.Array, params: ArenaParams | None) -> Episode:
        """Another episode; with `params`, on that arena."""
        *keys, task_key = jax.random.split(key, 3)
        params, objects, valid = pools.start(self.arena, self._ranges_at(level), keys, params, self.pool)
        values = programs.written(self.arena.record, model, params, self._varying)
        ids = self.arena.layout.object_qpos.reshape(-1)
        qpos = starts.qpos(self.arena.record, values.get("qpos0", model.qpos0), self.keyframe)
        qpos = replace_rows(qpos, ids, objects.reshape(-1))
        qpos = starts.varied(self.arena.record, params, {"qpos": qpos})["qpos"]
        if self.pool is not None and self.pool.objects is not None:  # whose places have what terms add already
            qpos = replace_rows(qpos, ids, objects.reshape(-1))
        task = refusals.asked(self.draw_task, task_key, params, qpos)
        refusals.check_task(f"{type(self).__name__}.draw_task", task)
        valid &= getattr(task, "possible", True)
        return Episode(params, values, qpos, task, valid, jax.random.fold_in(task_key, _TAGS[0]))

    def _prepare(self, info: Mapping[str, Any], begins: jax.Array) -> tuple[Episode, jax.Array, jax.Array]:
        """The next episode, drawn if it is time to; the key that is left; and whether that episode is new."""

        def draw(model: mjx.Model, rng: jax.Array, level: jax.Array, params: ArenaParams) -> tuple[Episode, jax.Array]:
            rng, key = jax.random.split(rng)
            return self._draw(model, key, level, params if self._config.arenas == "fixed" else None), rng

        otherwise = info["next_episode"], info["rng"]
        args = self._mjx_model, info["rng"], info["level"], info["episode"].params
        (upcoming, rng), drawn = when_needed(draw, ~info["ready"], begins, otherwise, *args)
        return upcoming, rng, info["ready"] | drawn

    def _started(self, data: mjx.Data, episode: Episode, begins: jax.Array) -> mjx.Data:
        """`data` at the start of an episode in a world where one begins."""
        model = replace(self._mjx_model, episode.fields)
        start = starts.again(self.arena.record, data, model, self.keyframe)
        start = {"qpos": episode.qpos, **starts.varied(self.arena.record, episode.params, start)}
        return data.replace(**{name: jnp.where(begins, x, getattr(data, name)) for name, x in start.items()})


# Large, because `jax.random.split` gives the keys that `fold_in` gives of 0, 1, 2, ...
_TAGS = 0x45504953, 0x4C415354, 0x50415353


def sound(x: jax.Array) -> jax.Array:
    """A mask of the numbers that are finite, and not beyond what MuJoCo takes for a state (`mjMAXVAL`)."""
    return jnp.abs(x) <= mujoco.mjMAXVAL


_REPORTS = dict.fromkeys(
    ("nan_action", "nan_state", "invalid_arena", "dropped_contacts", "solver_limits", "success_at_end"), 0.0
)
