"""The tasks that can be trained, and their environments by configurations: on which arenas, and on what else they are judged."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from mjx_arenas.arena import Arena
from mjx_arenas.envs import arms, lift, looks, open_drawer, pick_and_place, push, reach
from mjx_arenas.envs.base import ArenaEnv
from mjx_arenas.envs.manipulation import Given
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
        None where an arena of a user's own has no ranges beyond those of training.

    Raises:
        ValueError: the task does not take an argument in `env`; as of the task, and of files.
    """
    chosen, sees = task(config), config.get("sees") == "pictures"
    given: dict[str, Any] = dict(config.get("env") or {})
    if unknown := [name for name in given if name not in chosen.takes]:
        takes = ", ".join(chosen.takes)
        raise ValueError(f"`env` of the task {config['task']} may have {takes}, got {', '.join(unknown)}.")
    overrides = {"impl": config["impl"], **(given.pop("config", None) or {}), **overrides}
    overrides = {name: tuple(x) if isinstance(x, list) else x for name, x in overrides.items()}
    arena, base, n_objects = _arena(given.pop("arena", None), chosen, where)
    if arena is not None:
        given["arena"] = arena
    more = config.get("wider_ranges" if where == "out_of_range" else "ranges")
    if base is None and not more:
        return None
    ranges = _over(base or ArenaRanges(), load.ranges(more, "`ranges`")) if more else base
    if "arm" in given:
        if given["arm"] not in arms.ARMS:
            raise error([problem("env.arm", "one_of", None, given["arm"], names=list(arms.ARMS))])
        given["arm"] = arms.ARMS[given["arm"]]()
    if "terms" in given:
        given["terms"] = load.terms(given["terms"], "`env.terms`")
    if sees:
        vision, ranges = looks.default_vision(), looks.with_looks(ranges, n_objects) if ranges is not None else None
        given["vision"] = dataclasses.replace(vision, alter=None) if overrides.get("arenas") == "nominal" else vision
    return chosen.kind(config_overrides=overrides, ranges=ranges, **given)


def _arena(path: str | None, chosen: Task, where: str) -> tuple[Arena | None, ArenaRanges | None, int]:
    """A user's arena, its ranges or those of the task, and how many objects there are."""
    beyond = where == "out_of_range"
    if path is None:
        return None, chosen.wider_ranges() if beyond else chosen.training_ranges(), chosen.n_objects
    arena, ranges = load.load(path)
    return arena, None if beyond else ranges, len(arena.objects)


def _over(below: ArenaRanges, above: ArenaRanges) -> ArenaRanges:
    """Ranges with those of others in their place."""
    named = {name: dist for name, dist in above._asdict().items() if dist is not None and name != "terms"}
    return below._replace(**named, terms={**below.terms, **above.terms})
