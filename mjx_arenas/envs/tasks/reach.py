"""Bring the tool of an arm to a point above its table."""

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple, Unpack

import jax
import jax.numpy as jnp
from ml_collections import config_dict
from mujoco import mjx

from mjx_arenas.envs.arms.moves import HEIGHTS
from mjx_arenas.envs.arms.report import HEADINGS
from mjx_arenas.envs.base import Episode
from mjx_arenas.envs.tasks import goals, manipulation
from mjx_arenas.envs.tasks.defaults import Defaults
from mjx_arenas.envs.tasks.manipulation import ArmTask, Given
from mjx_arenas.params.distribution import DRAWN
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.rows import dot
from mjx_arenas.table_arenas import TableArena

NEAR = 0.02  # [m] of success
LEAST = 0.05  # [m] of a goal above what carries the arm


def default_config() -> config_dict.ConfigDict:
    """Configuration of the task: `ctrl_dt` is 0.04 s, `sim_dt` 0.004 s and `episode_length` 75 actions.

    `env_config` says what its other keys are, and `ArmTask` those that all tasks of arms have.
    """
    return manipulation.default_config(episode_length=75)


def training_ranges() -> ArenaRanges:
    """Ranges of the table, and of how the arm starts."""
    return manipulation.training_ranges(**manipulation.TABLE)


def wider_ranges() -> ArenaRanges:
    """Ranges of tables that are lower or higher, and turned further, than in training. The arm starts further from home."""
    return manipulation.wider_ranges(training_ranges(), **manipulation.WIDER_TABLE)


class Point(NamedTuple):
    """The point where the tool is to go."""

    pos: jax.Array
    """(3,) in the frame of the arm's base [m]."""


class Reach(ArmTask):
    """An arm on a table brings its tool to within 2 cm of a random point in front of it.

    The point is 5 to 25 cm above the foot of the arm's base. Policy and critic see the arm and the way from its tool to the point, in the
    frame of its base.

    The reward of a step is the sum of

    - `1 - tanh(8 distance)`, with the distance [m] of the tool from the point;
    - 1 for success;
    - less 0.005 times the squares of the action.

    Args:
        config: `default_config()`.
        config_overrides: dotted names and values.
        given: `ranges`, `arena`, `arm`, `on`, `pos`, `vision`, `terms` and `robot_strength`, as for `ArmTask`. Its own arena is a table.
    """

    def __init__(
        self,
        config: config_dict.ConfigDict | None = None,
        config_overrides: Mapping[str, Any] | None = None,
        **given: Unpack[Given],
    ) -> None:
        super().__init__(DEFAULTS, config or default_config(), config_overrides, **given)

    def draw_task(self, key: jax.Array, params: ArenaParams, qpos: jax.Array) -> Point:
        (near, far), rise = self.arm.reach, self.arm.rise
        (left, right), (_, most) = HEADINGS, HEIGHTS
        low, high = jnp.array([near, left, LEAST - rise]), jnp.array([far, right, most - rise])
        distance, heading, height = jax.random.uniform(key, (3,), DRAWN, low, high)
        return Point(jnp.stack([distance * jnp.cos(heading), distance * jnp.sin(heading), height]))

    def mark(self, data: mjx.Data, episode: Episode) -> mjx.Data:
        at = data.xpos[self._base] + dot("ij,j->i", data.xmat[self._base], episode.task.pos)
        return goals.marked(self.arena, data, at)

    def observe(self, data: mjx.Data, episode: Episode) -> dict[str, jax.Array]:
        goal = episode.task.pos - self.hand(data, episode).tool.pos
        state = jnp.concatenate([self.proprioception(data, episode), goal])
        return {"state": state, "privileged_state": state}

    def score(
        self, data: mjx.Data, episode: Episode, action: jax.Array
    ) -> tuple[jax.Array, jax.Array, dict[str, jax.Array]]:
        away = episode.task.pos - self.hand(data, episode).tool.pos
        distance = jnp.sqrt((away**2).sum() + 1e-12)
        success = (distance < NEAR).astype(jnp.float32)
        reward = 1 - jnp.tanh(8 * distance) + success - 0.005 * (action**2).sum()
        return reward, jnp.zeros((), bool), {"success": success, "distance": distance}


DEFAULTS = Defaults(
    lambda _: TableArena((0.9, 0.9, 0.05)),
    training_ranges,
    0,
    manipulation.MOUNT,
    functools.partial(goals.add_ball, radius=NEAR),
)
