"""What an environment's configuration says, and what is refused of it (host)."""

import math
from collections.abc import Collection, Mapping
from typing import Any

from ml_collections import config_dict

from mjx_arenas.envs.vision import Vision
from mjx_arenas.keywords import nearest, quoted
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error, warn
from mjx_arenas.rules.validation import check_type, is_number, is_whole, whole

NEEDED = ("ctrl_dt", "sim_dt", "impl", "arenas", "level", "level_step")
"""Keys without which there is no environment."""
MOST_DRAWN = 2**20
"""Arenas or worlds that are drawn once."""
_KINDS = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a text",
    tuple: "two numbers, or one whole number for both",
    config_dict.ConfigDict: "a dictionary",
}
"""What values of a configuration must be, by their types."""


def env_config(ctrl_dt: float, sim_dt: float, episode_length: int) -> config_dict.ConfigDict:
    """Configuration that `ArenaEnv` needs as its `config`.

    Its keys, with their defaults, are

    - `ctrl_dt`, `sim_dt`: the time between actions, and that of a step of the physics [s], as given;
    - `episode_length`: the number of actions in an episode, for wrappers, as given;
    - `action_repeat` (1): how often wrappers repeat an action. It must be 1, as trainings and judges take each action once: `ctrl_dt` says
      how long it is held;
    - `impl` ("jax"): the implementation of MJX, "jax" or "warp", or None for the best one here;
    - `arenas` ("every_episode"): when a world gets a new arena. With "fixed" it keeps the arena of its first episode, with "nominal" it has
      the nominal one;
    - `num_arenas` (0): the number of arenas that all worlds and episodes share, at most 1,048,576. They are those of
      `world_keys(drawn_seed, range(num_arenas))`. Objects are placed anew in every episode. 0: every draw is a new arena;
    - `level` (0.0): where a world starts in a curriculum, from 0 to 1;
    - `level_step` (0.0): how far it goes up after an episode that ends in success, and down after any other. Arenas are drawn ahead, so an
      episode's arena is of the level that the world had in the episode before;
    - `max_contacts` (None): the room for contacts of one world on Warp, as for `make_data`. None: as many as can touch. If there are more
      contacts, the metric `dropped_contacts` says so;
    - `settled` (0): the number of worlds that are drawn once, and in which objects fall for 2 s. Episodes start in those in which all rest.
      With 0 every episode draws an arena, and starts while dropped objects fall. At most 1,048,576;
    - `drawn_seed` (0): the seed of the arenas of `num_arenas` and of the worlds of `settled`.
    """
    return config_dict.create(
        ctrl_dt=ctrl_dt,
        sim_dt=sim_dt,
        episode_length=episode_length,
        action_repeat=1,
        impl="jax",
        arenas="every_episode",
        num_arenas=0,
        level=0.0,
        level_step=0.0,
        max_contacts=config_dict.placeholder(int),
        settled=0,
        drawn_seed=0,
    )


def chosen_config(config: Any, overrides: Mapping[str, Any], needed: Collection[str]) -> config_dict.ConfigDict:
    """A locked copy of `config` with overrides, dotted names and values; it must have the keys `needed`."""
    check_type("config", config, config_dict.ConfigDict, "a ConfigDict, as from env_config(...)")
    missing = [name for name in needed if name not in config]
    if missing:
        what = f"{quoted(missing)} {'is' if len(missing) == 1 else 'are'} missing"
        raise error([problem("config", "config_keys", None, missing, needed=quoted(needed), what=what)])
    check_overrides(overrides)
    chosen = config.copy_and_resolve_references().lock()
    for name, value in overrides.items():
        if isinstance(value, Vision):
            raise error([problem("config_overrides", "vision_override", None, name)])
        if is_whole(value) and isinstance(chosen.get(name), tuple):
            value = (value, value)  # the least is the most
        try:
            chosen.update_from_flattened_dict({name: value})
        except KeyError:
            close, known = nearest(name, list(chosen)), quoted(list(chosen))
            rule = "config_meant" if close else "config_unknown"
            raise error([problem("config_overrides", rule, None, name, close=close, known=known)]) from None
        except TypeError:
            wanted = problem(f"config_overrides[{name!r}]", "must", None, value, must=_what(chosen, name))
            raise error([wanted]) from None
    return chosen


def _what(config: Any, name: str) -> str:
    """What a configuration takes under a dotted name, in words."""
    *above, last = name.split(".")
    for one in above:
        config = config[one]
    kind = config.get_type(last)
    return _KINDS.get(kind, f"of the type that the configuration has there, {kind.__name__}")


def check_overrides(overrides: Any) -> None:
    """Refuses what are no names and values; None is none."""
    must = "a dictionary of dotted names and values"
    check_type("config_overrides", overrides, (Mapping, type(None)), must)
    for name in (name for name in overrides or () if not isinstance(name, str)):
        raise error([problem("config_overrides", "must", None, name, must=must)])


def check(config: Any, ranges: Any) -> None:
    """Raises where a value of a task's configuration makes no sense."""
    if config.arenas not in ("every_episode", "fixed", "nominal"):
        must = "'every_episode', 'fixed' or 'nominal'"
        raise error([problem("config.arenas", "must", None, config.arenas, must=must)])
    for name in ("ctrl_dt", "sim_dt"):
        if not is_number(config[name]):
            raise error([problem(f"config.{name}", "number", None, config[name], unit="[s]")])
    ratio = config.ctrl_dt / config.sim_dt if config.sim_dt > 0 else 0.0
    if not 1 <= ratio < math.inf or abs(ratio - round(ratio)) > 1e-6:
        raise error([problem("config.ctrl_dt", "steps_of_control", None, config.ctrl_dt, sim_dt=config.sim_dt)])
    if config.ctrl_dt > 1:
        warn(problem("config.ctrl_dt", "long_step", None, None, seconds=config.ctrl_dt))
    must = "1, as `config.ctrl_dt` says how long an action is held"
    whole("config.action_repeat", config.get("action_repeat", 1), 1, 1, must)
    for name in ("level", "level_step"):
        if not (is_number(config[name]) and 0 <= config[name] <= 1):
            raise error([problem(f"config.{name}", "share", None, config[name])])
    if config.level_step and not callable(ranges):
        must = "0, as `ranges` is no function of a level"
        raise error([problem("config.level_step", "must", None, config.level_step, must=must)])
    if "episode_length" in config:
        whole("config.episode_length", config.episode_length, 1)
    if config.get("max_contacts") is not None:
        whole("config.max_contacts", config.max_contacts, 1, must="None or a whole number >= 1")
    _check_drawn(config, ranges)


def _check_drawn(config: Any, ranges: Any) -> None:
    """Raises where arenas or worlds cannot be drawn once."""
    whole("config.drawn_seed", config.get("drawn_seed", 0), 0, 2**32 - 1, "a whole number from 0 to 2^32 - 1")
    must = f"a whole number from 0 to {MOST_DRAWN:,}"
    n_arenas, n_worlds = (
        whole(f"config.{name}", config.get(name, 0), 0, MOST_DRAWN, must) for name in ("num_arenas", "settled")
    )
    if n_worlds and config.arenas == "fixed":
        raise error([problem("config.settled", "settled_of_fixed", None, n_worlds)])
    if n_arenas and config.arenas == "nominal":
        raise error([problem("config.num_arenas", "arenas_of_nominal", None, n_arenas)])
    if n_worlds and n_arenas:
        raise error([problem("config.num_arenas", "arenas_of_settled", None, n_arenas)])
    for name, n in (("num_arenas", n_arenas), ("settled", n_worlds)):
        if n and callable(ranges):
            raise error([problem(f"config.{name}", "drawn_of_levels", None, n)])
