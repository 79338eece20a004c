"""Bring the tool of an arm to a point above its table."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
from ml_collections import config_dict
from mujoco import mjx

from mjx_arenas.arena import Arena
from mjx_arenas.envs import arms, manipulation
from mjx_arenas.envs.arms import Arm
from mjx_arenas.envs.base import Episode, RangesAt
from mjx_arenas.envs.manipulation import ArmTask
from mjx_arenas.params.distribution import DRAWN
from mjx_arenas.params.distributions import Choice, Uniform
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.table_arenas import TableArena

NEAR = 0.02  # [m] of success
MOUNT = (-0.3, 0.0, 0.0)  # [m] of an arm on the table


def default_config() -> config_dict.ConfigDict:
    """Times in [s]."""
    return manipulation.default_config(episode_length=75)


def training_ranges() -> ArenaRanges:
    """The table, and how the arm starts."""
    return ArenaRanges(
        table_offsets=Uniform([-0.1, -0.1, -0.2], [0.1, 0.1, 0.2], relative="add"),
        table_rots=Uniform(-0.6, 0.6),
        table_full_sizes=Uniform([0.8, 0.7, 0.03], [1.0, 1.0, 0.08]),
        terms={manipulation.START: Uniform(-0.15, 0.15)},
    )


def wider_ranges() -> ArenaRanges:
    """Tables lower or higher, and turned further, than in training, and an arm that starts further from home."""
    return training_ranges()._replace(
        table_offsets=Choice([[0, 0, -0.3], [0, 0, -0.25], [0, 0, 0.25], [0, 0, 0.3]], relative="add"),
        table_rots=Uniform(0.7, 1.2),
        terms={manipulation.START: Uniform(-0.25, 0.25)},
    )


class Point(NamedTuple):
    """Where the tool is to go."""

    pos: jax.Array
    """(3,) in the frame of the arm's base [m]."""


class Reach(ArmTask):
    """An arm on a table brings its tool to within 2 cm of a point, which is drawn in front of it, 5 to 25 cm above its base's floor.

    The policy sees its joints, its tool and the point in the frame of the arm's base; nothing of the table. The reward is
    `1 - tanh(8 distance)`, and 1 more at the point, less 0.005 times the squares of the action.

    Args:
        config: `default_config()`.
        config_overrides: dotted names and values.
        ranges: the arenas; None: `training_ranges()`, or, of an arena of your own, nothing varies.
        arena: not compiled yet; None: a table.
        arm: None: `arms.small()`.
        on: what carries the arm.
        pos: where its base stands on that.
        reach: least and most distance of points from the arm's base, seen from above [m].
    """

    def __init__(
        self,
        config: config_dict.ConfigDict | None = None,
        config_overrides: Mapping[str, Any] | None = None,
        ranges: ArenaRanges | RangesAt | None = None,
        arena: Arena | None = None,
        arm: Arm | None = None,
        on: int | str | None = 0,
        pos: Sequence[float] = MOUNT,
        reach: tuple[float, float] = (0.2, 0.45),
    ) -> None:
        ranges = (training_ranges() if arena is None else ArenaRanges()) if ranges is None else ranges
        arena = TableArena((0.9, 0.9, 0.05)) if arena is None else arena
        self._reach = reach
        ball = arena.spec.worldbody.add_body(name="goal", mocap=True)
        geom = ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(NEAR, 0, 0), rgba=(0, 0.62, 0.45, 0.8))
        geom.contype = geom.conaffinity = 0
        super().__init__(arena, arm or arms.small(), on, pos, ranges, config or default_config(), config_overrides)

    def draw_task(self, key: jax.Array, params: ArenaParams, qpos: jax.Array) -> Point:
        low, high = jnp.array([self._reach[0], -0.9, 0.05]), jnp.array([self._reach[1], 0.9, 0.25])
        distance, heading, height = jax.random.uniform(key, (3,), DRAWN, low, high)
        return Point(jnp.stack([distance * jnp.cos(heading), distance * jnp.sin(heading), height]))

    def mark(self, data: mjx.Data, episode: Episode) -> mjx.Data:
        at = data.xpos[self._base] + data.xmat[self._base] @ episode.task.pos
        return data.replace(mocap_pos=at[None])

    def observe(self, data: mjx.Data, episode: Episode) -> dict[str, jax.Array]:
        goal = episode.task.pos - self.hand(data).tool.pos
        state = jnp.concatenate([self.proprioception(data), goal])
        return {"state": state, "privileged_state": state}

    def score(
        self, data: mjx.Data, episode: Episode, action: jax.Array
    ) -> tuple[jax.Array, jax.Array, dict[str, jax.Array]]:
        away = episode.task.pos - self.hand(data).tool.pos
        distance = jnp.sqrt((away**2).sum() + 1e-12)
        success = (distance < NEAR).astype(jnp.float32)
        reward = 1 - jnp.tanh(8 * distance) + success - 0.005 * (action**2).sum()
        return reward, jnp.zeros((), bool), {"success": success, "distance": distance}
