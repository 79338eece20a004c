"""The tasks that can be trained, and their environments by configurations: on which arenas, and on what else they are judged."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from mjx_arenas import settings
from mjx_arenas.envs import arms, imported, lift, looks, open_drawer, pick_and_place, push, reach
from mjx_arenas.envs.base import ArenaEnv
from mjx_arenas.envs.manipulation import Given
from mjx_arenas.envs.vision import Vision
from mjx_arenas.files import load
from mjx_arenas.params.params import ArenaRanges
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error


class Task(NamedTuple):
    """One of them."""

    kind: Callable[..., ArenaEnv]
    training_ranges: Callable[[], ArenaRanges]
    wider_ranges: Callable[[], ArenaRanges]
    n_objects: int
    """Of its own arena."""
    takes: tuple[str, ...]
    """Arguments that a configuration may give, `config` for `config_overrides`."""


_ARMS = ("arm", "arena", "on", "pos", "terms", "robot_strength", "config")
assert {*_ARMS} - {"config"} <= {*Given.__annotations__}


def task(config: Mapping[str, Any]) -> Task:
    """Of the configuration of a training."""
    kind, module, n_objects, takes = {
        "push": (push.Push, push, 1, ("config",)),
        "reach": (reach.Reach, reach, 0, _ARMS),
        "lift": (lift.Lift, lift, 1, _ARMS),
        "pick_and_place": (pick_and_place.PickAndPlace, pick_and_place, 2, (*_ARMS, "goals")),
        "open_drawer": (open_drawer.OpenDrawer, open_drawer, 0, (*_ARMS, "unit")),
    }[config["task"]]
    return Task(kind, module.training_ranges, module.wider_ranges, n_objects, takes)


def environment(config: Mapping[str, Any], where: str = "training", **overrides: Any) -> ArenaEnv | None:
    """The environment of a configuration.

    Args:
        config: of a training: `task`, `env`, `ranges`, `wider_ranges`, `impl` and `sees`.
        where: "training", "held_out", the same ranges with other seeds, or "out_of_range".
        overrides: of the environment's configuration.

    Returns:
        None where an arena or a task of a user's own has no ranges beyond those of training.

    Raises:
        ValueError: the task does not take an argument in `env`, or a task or an arm cannot be imported; as of the task, and of files.
    """
    given = _arguments(config, overrides)
    if settings.is_own(config["task"]):
        return _imported(config, where, given)
    chosen = task(config)
    imported.check_env(config["task"], [name for name in given if name != "config_overrides"], chosen.takes)
    path, more = given.pop("arena", None), _more(config, where)
    if path is None:
        base, n_objects = (
            chosen.wider_ranges() if where == "out_of_range" else chosen.training_ranges(),
            chosen.n_objects,
        )
    elif where == "out_of_range" and not more:
        return None
    else:
        given["arena"], base = load.load(path)
        n_objects = len(given["arena"].objects)
    ranges, seen = _seen(config, given, _over(base, more), n_objects)
    return chosen.kind(ranges=ranges, **given, **seen)


def _imported(config: Mapping[str, Any], where: str, given: dict[str, Any]) -> ArenaEnv | None:
    """The environment of a user's own task. Its own ranges are those of the first that it makes, or of the arena's file."""
    name, path, more = config["task"], given.pop("arena", None), _more(config, where)
    pictures = config.get("sees") == "pictures"
    if where == "out_of_range" and not more:
        return None
    if path is not None:
        given["arena"], base = load.load(path)
        env, n_objects = None, len(given["arena"].objects)
    else:
        env = imported.environment(name, given)
        base, n_objects = env.ranges, len(env.arena.objects)
    if env is None or more or pictures:
        if not isinstance(base, ArenaRanges):
            raise ValueError(
                f"`task` must have ranges that do not depend on a level, for other ones or pictures, got {name!r}."
            )
        ranges, seen = _seen(config, given, _over(base, more), n_objects)
        env = imported.environment(name, {**given, "ranges": ranges, **seen})
    if where == "training" and not pictures:
        imported.check_observations(env)
    return env


def _arguments(config: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """What `env` of a configuration gives a task; of an arena the path of its file."""
    given = dict(config.get("env") or {})
    overrides = {"impl": config["impl"], **(given.pop("config", None) or {}), **overrides}
    given["config_overrides"] = {name: tuple(x) if isinstance(x, list) else x for name, x in overrides.items()}
    if "arm" in given:
        name = given["arm"]
        if name not in arms.ARMS and not settings.is_own(name):
            raise error([problem("env.arm", "one_of", None, name, names=[*arms.ARMS, "module:function"])])
        given["arm"] = imported.arm(name) if settings.is_own(name) else arms.ARMS[name]()
    if "terms" in given:
        given["terms"] = load.terms(given["terms"], "`env.terms`")
    return given


def _more(config: Mapping[str, Any], where: str) -> Any:
    """Ranges that a configuration gives over those of the task."""
    return config.get("wider_ranges" if where == "out_of_range" else "ranges")


def _seen(
    config: Mapping[str, Any], given: Mapping[str, Any], ranges: ArenaRanges, n_objects: int
) -> tuple[ArenaRanges, dict[str, Vision]]:
    """Ranges with those of looks, and the pictures, as an argument, where the policy sees some."""
    if config.get("sees") != "pictures":
        return ranges, {}
    vision = looks.default_vision()
    if given["config_overrides"].get("arenas") == "nominal":
        vision = dataclasses.replace(vision, alter=None)
    return looks.with_looks(ranges, n_objects), {"vision": vision}


def _over(below: ArenaRanges, more: Any) -> ArenaRanges:
    """Ranges with those that a configuration gives, as it has them, in their place."""
    above = load.ranges(more, "`ranges`") if more else ArenaRanges()
    named = {name: dist for name, dist in above._asdict().items() if dist is not None and name != "terms"}
    return below._replace(**named, terms={**below.terms, **above.terms})
