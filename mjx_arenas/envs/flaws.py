"""What a robot's actions and observations suffer on the way: delays and noise. Pure functions of one world."""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from ml_collections import config_dict

from mjx_arenas.envs.base import Episode
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import raise_all
from mjx_arenas.rules import validation

NONE = {"action_delay": (0, 0), "observation_delay": (0, 0), "action_noise": 0.0, "observation_noise": 0.0}
"""The keys of a configuration, off."""
_OF_EPISODE, _OF_STEP = 0x44454C41, 0x4E4F4953  # tags of keys, large as those of the environment's own


class Late(NamedTuple):
    """What is on its way."""

    actions: jax.Array
    """(A + 1, n) those of the last steps, the latest first."""
    obs: Mapping[str, jax.Array]
    """(O + 1, ...) what policies see, the same."""


@dataclasses.dataclass(frozen=True)
class Flaws:
    """Delays and noise of actions and observations.

    Args:
        neutral: (n,) what counts until the first action comes.
        action_delay: least and most steps by which actions come late. Each episode draws a number.
        observation_delay: least and most steps by which observations of policies come late. Until there is an earlier one, policies see the
            first observation of the episode.
        action_noise: standard deviation of the noise that is added to each action. The sum is clipped to [-1, 1].
        observation_noise: standard deviation of the noise that is added to each number of `state`, in the unit of that number.
    """

    neutral: tuple[float, ...]
    action_delay: tuple[int, int] = (0, 0)
    observation_delay: tuple[int, int] = (0, 0)
    action_noise: float = 0.0
    observation_noise: float = 0.0

    def start(self, obs: Any) -> Late:
        """Actions and observations on their way at the start of an episode."""
        return Late(
            _repeated(jnp.asarray(self.neutral), self.action_delay[1]),
            {name: _repeated(x, self.observation_delay[1]) for name, x in _seen(obs).items()},
        )

    def act(
        self, late: Late, action: jax.Array, begins: jax.Array, episode: Episode, step: jax.Array
    ) -> tuple[Late, jax.Array]:
        """Actions on their way after a step's action (n,), and the one that arrives; none does in an episode's first step."""
        action = jnp.clip(action, -1.0, 1.0)
        actions = jnp.where(begins, jnp.asarray(self.neutral), jnp.concatenate([action[None], late.actions[:-1]]))
        arrived = actions[_drawn(episode.key, 0, self.action_delay)]
        if self.action_noise:
            arrived = arrived + self.action_noise * jax.random.normal(_of_step(episode.key, 0, step), arrived.shape)
        return late._replace(actions=actions), arrived

    def see(
        self, late: Late, obs: Any, begins: jax.Array, episode: Episode, step: jax.Array
    ) -> tuple[Late, dict[str, jax.Array]]:
        """Observations on their way after a step, and those that arrive. The critic's arrive at once, unchanged."""
        fresh = _seen(obs)
        shifted = {name: jnp.concatenate([x[None], late.obs[name][:-1]]) for name, x in fresh.items()}
        kept = {
            name: jnp.where(begins, _repeated(fresh[name], self.observation_delay[1]), x) for name, x in shifted.items()
        }
        k = _drawn(episode.key, 1, self.observation_delay)
        seen = {name: x[k] for name, x in kept.items()}
        if self.observation_noise:
            noise = jax.random.normal(_of_step(episode.key, 1, step), seen["state"].shape)
            seen["state"] = seen["state"] + self.observation_noise * noise
        return late._replace(obs=kept), {**obs, **seen}


def of(config: config_dict.ConfigDict, neutral: Any) -> Flaws | None:
    """The flaws of a configuration with the keys of `NONE`, and what counts (n,) until the first action comes; None if there are none.

    Raises:
        ValueError: all that is wrong with them.
    """
    given: dict[str, Any] = {name: config[name] for name in NONE}
    found = []
    for name in ("action_delay", "observation_delay"):
        value = given[name]
        right = isinstance(value, (tuple, list)) and len(value) == 2
        right = right and all(validation.is_whole(x, 0) for x in value) and value[0] <= value[1]
        if right and value[1] and value[1] >= config.episode_length:
            must = f"shorter than an episode, `config.episode_length` {config.episode_length}"
            found.append(problem(f"config.{name}", "must", None, value, must=must))
        if not right:
            must = "least and most steps, two whole numbers from 0 on, the first not above the second"
            found.append(problem(f"config.{name}", "must", None, value, must=must))
    for name in ("action_noise", "observation_noise"):
        most = 1.0 if name == "action_noise" else float("inf")  # actions are within -1 and 1
        if not (validation.is_number(given[name]) and 0 <= given[name] <= most and given[name] < float("inf")):
            must = f"a standard deviation >= 0{' and <= 1, as actions are within -1 and 1' if most == 1 else ''}"
            found.append(problem(f"config.{name}", "must", None, given[name], must=must))
    raise_all(found, "`config`")
    given |= {name: tuple(given[name]) for name in ("action_delay", "observation_delay")}
    return None if given == NONE else Flaws(tuple(np.asarray(neutral).tolist()), **given)


def _seen(obs: Any) -> dict[str, jax.Array]:
    return {name: x for name, x in obs.items() if name != "privileged_state"}


def _repeated(x: jax.Array, delay: int) -> jax.Array:
    return jnp.broadcast_to(x, (delay + 1, *x.shape))


def _drawn(key: jax.Array, which: int, delay: tuple[int, int]) -> jax.Array:
    """() steps, the same in a whole episode."""
    low, high = delay
    if low == high:
        return jnp.asarray(low)
    return jax.random.randint(jax.random.fold_in(key, _OF_EPISODE + which), (), low, high + 1)


def _of_step(key: jax.Array, which: int, step: jax.Array) -> jax.Array:
    return jax.random.fold_in(jax.random.fold_in(key, _OF_STEP + which), step)
