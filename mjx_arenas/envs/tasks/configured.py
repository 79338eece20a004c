"""The tasks that can be trained, and their environments by configurations: on which arenas, and on what else they are judged."""

import dataclasses
import json
import pathlib
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from mjx_arenas import settings
from mjx_arenas.arena import Arena
from mjx_arenas.envs import arms, pools
from mjx_arenas.envs.base import ArenaEnv
from mjx_arenas.envs.evaluate import HELD_OUT
from mjx_arenas.envs.tasks import imported, lift, looks, open_drawer, pick_and_place, push, reach
from mjx_arenas.envs.tasks.manipulation import ArmTask, Given
from mjx_arenas.envs.vision import Vision
from mjx_arenas.files import load
from mjx_arenas.keywords import nearest
from mjx_arenas.params.params import ArenaRanges
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.sample.sampling import world_keys


class Task(NamedTuple):
    """One of the tasks."""

    kind: Callable[..., ArenaEnv]
    training_ranges: Callable[[], ArenaRanges]
    wider_ranges: Callable[[], ArenaRanges]
    n_objects: int
    """The number of objects in its own arena."""
    takes: tuple[str, ...]
    """Arguments that a configuration may give, `config` for `config_overrides`."""


_ARMS = ("arm", "arena", "on", "pos", "terms", "robot_strength", "config")
assert {*_ARMS} - {"config"} <= {*Given.__annotations__}
_ELSEWHERE = {
    "config_overrides": "`env.config`",
    "ranges": "`ranges` beside `env`",
    "vision": "`--pixels` on the command line",
}
"""Where a configuration has arguments of environments that are not in its `env`."""


def task(config: Mapping[str, Any]) -> Task:
    """The task that the configuration of a training names."""
    kind, module, n_objects, takes = {
        "push": (push.Push, push, 1, ("config",)),
        "reach": (reach.Reach, reach, 0, _ARMS),
        "lift": (lift.Lift, lift, 1, _ARMS),
        "pick_and_place": (pick_and_place.PickAndPlace, pick_and_place, 2, (*_ARMS, "goals")),
        "open_drawer": (open_drawer.OpenDrawer, open_drawer, 0, (*_ARMS, "unit")),
    }[config["task"]]
    return Task(kind, module.training_ranges, module.wider_ranges, n_objects, takes)


def environment(
    config: Mapping[str, Any], where: str = "training", overrides: Mapping[str, Any] | None = None
) -> ArenaEnv | None:
    """The environment of a configuration.

    Outside the ranges what `wider_ranges` of the task and of the configuration say takes the place of the ranges of training.

    Args:
        config: of a training: `task`, `env`, `ranges`, `wider_ranges`, `impl` and `sees`.
        where: "training", "held_out", the same ranges with other seeds, or "out_of_range". The arenas of the last two are new in every
            episode and not limited in number (`num_arenas`), those of a curriculum are of its last level, and worlds that are drawn once
            (`settled`) are others than in training, and at least as many as are judged, unless `overrides` say so.
        overrides: of the environment's configuration, dotted names and values.

    Returns:
        None where there are no ranges beyond those of training, as of an arena or a task of a user's own.

    Raises:
        ValueError: the task does not take an argument in `env`, or a task or an arm cannot be imported; as of the task, and of files.
    """
    if where == "training":
        return _environment(config, where, overrides or {})
    asked = {"arenas": "every_episode", **LAST_LEVEL, **(overrides or {})}
    asked = _unseen(config, (config.get("env") or {}).get("config") or {}) | asked
    env = _environment(config, where, asked)
    if env is None or env.pool is None:
        return env
    unseen = _unseen(config, env.config)  # of a task of a user's own that draws worlds once by itself
    return env if unseen.keys() <= asked.keys() else _environment(config, where, {**unseen, **asked})


LAST_LEVEL: Mapping[str, Any] = {"level": 1.0, "level_step": 0.0}
"""What an environment's configuration says for the whole ranges of a curriculum in every episode."""


def _unseen(config: Mapping[str, Any], chosen: Any) -> dict[str, Any]:
    """What makes worlds new that an environment's configuration draws once."""
    if worlds := chosen.get("settled"):
        seed = HELD_OUT + (chosen.get("drawn_seed") == HELD_OUT)
        return {"drawn_seed": seed, "settled": max(worlds, config.get("eval_worlds", 0))}
    return {"num_arenas": 0} if chosen.get("num_arenas") else {}


def _environment(config: Mapping[str, Any], where: str, overrides: Mapping[str, Any]) -> ArenaEnv | None:
    """The same, with arenas that are drawn once as its configuration says also where a policy is judged."""
    if where == "training":  # older ones that have been trained with it are judged
        _check_vision(config)
    given = _arguments(config, overrides)
    if settings.is_own(config["task"]):
        return _imported(config, where, given)
    chosen = task(config)
    imported.check_env(config["task"], [name for name in given if name != "config_overrides"], chosen.takes)
    path = given.pop("arena", None)
    if path is None:
        base, wider, n_objects = chosen.training_ranges(), _replaced(chosen), chosen.n_objects
    elif where == "out_of_range" and not config.get("wider_ranges"):
        return None
    else:
        (given["arena"], base), wider = _arena(config, path), ArenaRanges()
        n_objects = len(given["arena"].objects)
    wrist = "arm" in chosen.takes
    asked = _ranges(config, where, base, wider)
    if where == "out_of_range" and asked == _ranges(config, "held_out", base):
        return None
    ranges, seen = _seen(config, given, asked, n_objects, wrist)
    return chosen.kind(ranges=ranges, **given, **seen)


def made(config: Mapping[str, Any]) -> dict[str, Any]:
    """What a task of a user's own is, beyond its configuration: what tells it from the same after a change of its code.

    Args:
        config: of a training.

    Returns:
        Sizes of actions and observations, the environment's configuration, and ranges by their text, as JSON has them.
    """
    env: Any = environment(config, overrides={"arenas": config["arenas"]})
    ranges = env.ranges._asdict() if isinstance(env.ranges, ArenaRanges) else {}
    ranges |= {f"terms.{name}": one for name, one in (ranges.pop("terms", None) or {}).items()}
    found = {
        "actions": env.action_size,
        "observations": {name: x.shape for name, x in jax.eval_shape(env.reset, jax.random.key(0)).obs.items()},
        "config": env.config.to_dict(),
        "range": {name: repr(one) for name, one in ranges.items() if one is not None},
    }
    return json.loads(json.dumps(found, default=repr))


def check_worlds(env: ArenaEnv, worlds: int = 64) -> None:
    """Refuses ranges that give no valid world, in which nothing can be learned.

    Args:
        env: the environment.
        worlds: how many are drawn to find out.

    Raises:
        ValueError: none of them is valid.
    """
    if env.pool is None:  # what is drawn once is checked when the environment is made
        ranges = env.ranges if isinstance(env.ranges, ArenaRanges) else env.ranges(jnp.ones(()))
        pools.drawn(env.arena, ranges, world_keys(0, range(worlds)))


def _imported(config: Mapping[str, Any], where: str, given: dict[str, Any]) -> ArenaEnv | None:
    """The environment of a user's own task. Its own ranges are those of the first that it makes, or of the arena's file."""
    name, path, pictures = config["task"], given.pop("arena", None), settings.sees_pictures(config)
    if where == "out_of_range" and not config.get("wider_ranges"):
        return None
    if path is not None:
        given["arena"], base = _arena(config, path)
        env, n_objects = None, len(given["arena"].objects)
    else:
        env = imported.environment(name, given)
        base, n_objects = env.ranges, len(env.arena.objects)
    if env is None or pictures or config.get("ranges") or where == "out_of_range":
        if not isinstance(base, ArenaRanges):
            raise error([problem("task", "levels_of_task", None, name)])
        ranges, seen = _seen(config, given, _ranges(config, where, base), n_objects, isinstance(env, ArmTask))
        env = imported.environment(name, {**given, "ranges": ranges, **seen})
    if where == "training" and not pictures:
        imported.check_observations(env)
    return env


def _arena(config: Mapping[str, Any], path: str) -> tuple[Arena, ArenaRanges]:
    """The arena of a file, which must be as it was when the training began."""
    if settings.DIGEST in config and pathlib.Path(path).is_file() and settings.digest(path) != config[settings.DIGEST]:
        raise error([problem("env.arena", "arena_changed", None, path)])
    return load.load(path)


def _check_vision(config: Mapping[str, Any]) -> None:
    """Refuses pictures that a task would draw, and no policy would see."""
    vision = ((config.get("env") or {}).get("config") or {}).get("vision")
    if vision and not settings.is_own(config["task"]):
        raise error([problem("env.config.vision", "vision_of_training", None, vision)])


def _arguments(config: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """What `env` of a configuration gives a task; of an arena the path of its file."""
    given = dict(config.get("env") or {})
    for name in (name for name in _ELSEWHERE if name in given):
        raise error([problem(f"env.{name}", "env_elsewhere", None, given[name], there=_ELSEWHERE[name])])
    own = given.pop("config", None) or {}
    overrides = {"impl": config["impl"], **own, **overrides}
    given["config_overrides"] = {name: tuple(x) if isinstance(x, list) else x for name, x in overrides.items()}
    if "arm" in given:
        name = given["arm"]
        if name not in arms.ARMS and not settings.is_own(name):
            close = nearest(str(name), arms.ARMS)
            told = {"close": close, "known": ", ".join(arms.ARMS)}
            raise error([problem("env.arm", "no_arm_meant" if close else "no_arm", None, name, told)])
        given["arm"] = imported.arm(name) if settings.is_own(name) else arms.ARMS[name]()
    if "terms" in given:
        given["terms"] = load.terms(given["terms"], "`env.terms`")
    return given


def _seen(
    config: Mapping[str, Any], given: Mapping[str, Any], ranges: ArenaRanges, n_objects: int, wrist: bool
) -> tuple[ArenaRanges, dict[str, Vision]]:
    """Ranges with those of looks, and the pictures, as an argument, where the policy sees some, with an arm also from its hand."""
    if not settings.sees_pictures(config):
        return ranges, {}
    vision = looks.default_vision(wrist)
    if given["config_overrides"].get("arenas") == "nominal":
        vision = dataclasses.replace(vision, alter=None)
    return looks.with_looks(ranges, n_objects, wrist), {"vision": vision}


def _ranges(config: Mapping[str, Any], where: str, base: ArenaRanges, wider: ArenaRanges | None = None) -> ArenaRanges:
    """Ranges of a task or a file with those of a configuration, and outside of these the task's `wider` ones and the configuration's.

    Of what the configuration's own ranges name, the task does not know what lies outside.
    """
    own = load.ranges(config.get("ranges") or {}, "`ranges`")
    if where != "out_of_range":
        return _over(base, own)
    ranges = _over(_over(base, wider or ArenaRanges()), own)
    return _over(ranges, load.ranges(config.get("wider_ranges") or {}, "`wider_ranges`"))


def _replaced(chosen: Task) -> ArenaRanges:
    """The wider ranges of a task, without those that are as in training."""
    before, after = chosen.training_ranges(), chosen.wider_ranges()
    named = {name: dist for name, dist in after._asdict().items() if name != "terms" and dist != getattr(before, name)}
    return ArenaRanges(**named, terms={name: x for name, x in after.terms.items() if x != before.terms.get(name)})


def _over(below: ArenaRanges, above: ArenaRanges) -> ArenaRanges:
    """Ranges with those of others in their place."""
    named = {name: dist for name, dist in above._asdict().items() if dist is not None and name != "terms"}
    return below._replace(**named, terms={**below.terms, **above.terms})
