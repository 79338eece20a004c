"""Environments of ours under Brax's own wrappers, which Brax's trainers take if they are told no others."""

from typing import Any

import jax
from brax.envs import base
from mujoco_playground import State

from mjx_arenas.envs.base import ArenaEnv


class BraxEnv(base.Env):
    """Presents an `ArenaEnv` as Brax's `Env`. `pipeline_state` is its `mjx.Data`."""

    def __init__(self, env: ArenaEnv) -> None:
        self.env = env

    def reset(self, rng: jax.Array) -> base.State:
        """Resets as `ArenaEnv.reset` does."""
        return _brax(self.env.reset(rng))

    def step(self, state: base.State, action: jax.Array) -> base.State:
        """Steps as `ArenaEnv.step` does."""
        data: Any = state.pipeline_state
        ours = State(data, state.obs, state.reward, state.done, state.metrics, state.info)
        return _brax(self.env.step(ours, action))

    @property
    def observation_size(self) -> base.ObservationSize:
        """Shapes of the observations."""
        return self.env.observation_size

    @property
    def action_size(self) -> int:
        """Number of actions."""
        return self.env.action_size

    @property
    def backend(self) -> str:
        """Name of the implementation of MJX."""
        return "mjx"


def _brax(state: State) -> base.State:
    return base.State(state.data, state.obs, state.reward, state.done, state.metrics, state.info)  # type: ignore[arg-type]
