"""Push a box to a goal on a table of any height, size and yaw."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from ml_collections import config_dict
from mujoco import mjx

from mjx_arenas import geometry
from mjx_arenas.envs.base import Episode, RangesAt
from mjx_arenas.envs.config import check_overrides, env_config
from mjx_arenas.envs.tasks import looks, robots
from mjx_arenas.envs.tasks.goals import GOAL_RADIUS, goal_at, spot, surface_numbers
from mjx_arenas.envs.tasks.to_goal import ToGoal, turn
from mjx_arenas.envs.vision import Vision
from mjx_arenas.params.distributions import Choice, LogUniform, Uniform
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.spec.objects import Object
from mjx_arenas.table_arenas import TableArena

_MARGIN = 0.1  # [m] between a goal and the table's edge
_TRIES = 16  # places of a goal, of which the first is taken that is not where the box is
_FALLEN = 0.1  # [m] below the table's top


def default_config() -> config_dict.ConfigDict:
    """Configuration of the task: `ctrl_dt` is 0.04 s, `sim_dt` 0.005 s and `episode_length` 120 actions.

    With `vision` (False) the policy sees pictures. `env_config` says what its other keys are.
    """
    config = env_config(ctrl_dt=0.04, sim_dt=0.005, episode_length=120)
    config.vision = False
    return config


def training_ranges() -> ArenaRanges:
    """Ranges of the tables and boxes to train on."""
    return ArenaRanges(
        table_offsets=Uniform([-0.1, -0.1, -0.15], [0.1, 0.1, 0.15], relative="add"),
        table_rots=Uniform(-0.6, 0.6),
        table_full_sizes=Uniform([0.6, 0.6, 0.03], [0.9, 0.9, 0.08]),
        table_frictions=LogUniform([0.3, 0.005, 0.0001], [1.0, 0.005, 0.0001]),
        object_full_sizes=Uniform(0.06, 0.1, tied="axes"),
    )


def wider_ranges() -> ArenaRanges:
    """Ranges of tables that no training here has seen: lower or higher, turned further, smaller, slippery."""
    return training_ranges()._replace(
        table_offsets=Choice([[0, 0, -0.25], [0, 0, -0.2], [0, 0, 0.2], [0, 0, 0.25]], relative="add"),
        table_rots=Uniform(0.7, 1.2),
        table_full_sizes=Uniform([0.5, 0.5, 0.03], [0.6, 0.6, 0.1]),
        table_frictions=LogUniform([0.15, 0.005, 0.0001], [0.3, 0.005, 0.0001]),
    )


class PushedTo(NamedTuple):
    """The place where the box is to go."""

    pos: jax.Array
    """(3,) on the table, in the world [m]."""
    possible: jax.Array
    """() bool: the box is there."""


class Push(ToGoal):
    """A ball on three slides pushes a box to a goal on its table. Actions are velocities.

    The task succeeds when the box is within 5 cm of its goal, measured horizontally. An episode ends if the box falls. `invalid_arena`
    reports an episode without the box.

    The policy sees where the ball, the box and the goal are, but not the table. The critic also sees the table's height, yaw, size and
    friction and the box's size and mass. With `vision` the policy only sees pictures and where the ball is and how it moves.

    Args:
        config: `default_config()`.
        config_overrides: dotted names and values; `{"vision": True}` for pictures.
        ranges: ranges of the arenas, or for a curriculum a function from a level to ranges. None: `training_ranges()`, plus ranges of looks
            if the policy sees pictures.
        vision: the pictures. None: `looks.default_vision()` if `config.vision` is true. Its cameras may be "policy" and those of the arena.
    """

    def __init__(
        self,
        config: config_dict.ConfigDict | None = None,
        config_overrides: Mapping[str, Any] | None = None,
        ranges: ArenaRanges | RangesAt | None = None,
        vision: Vision | None = None,
    ) -> None:
        config = default_config() if config is None else config
        check_overrides(config_overrides)
        sees = vision is not None or (config_overrides or {}).get("vision", config.get("vision", False))
        arena = TableArena(table_full_size=(0.75, 0.75, 0.05), objects=[Object("box", full_size=0.08)])
        option = arena.spec.option
        option.iterations, option.ls_iterations = 4, 8
        if sees:
            vision = vision or looks.default_vision()
            looks.add_camera(arena, pos=(0.75, 0, 1.75), look_at=(0.05, 0, 0.8))
            ranges = looks.with_looks(training_ranges(), 1) if ranges is None else ranges
        ranges = training_ranges() if ranges is None else ranges
        super().__init__(arena, robots.pusher(), ranges, config, config_overrides, vision)

    def draw_task(self, key: jax.Array, params: ArenaParams, qpos: jax.Array) -> PushedTo:
        table = self.surface(params, 0)
        spots = spot(key, table, _MARGIN, (_TRIES,))
        box = geometry.rotate_yaw(-params.table_rots[0], qpos[self._box[:2]] - params.table_offsets[0, :2])
        away = jnp.linalg.norm(spots - box, axis=-1)
        first = jnp.argmax(away >= jnp.minimum(3 * GOAL_RADIUS, away.max()))  # not where the box is
        return PushedTo(goal_at(table, spots[first]), params.object_active[0])

    def observe(self, data: mjx.Data, episode: Episode) -> dict[str, jax.Array]:
        tip, tip_velocity, box, yaw, velocity = self.look(data, episode.params)
        goal, p = episode.task.pos, episode.params
        # The heights of box and goal stay out: until it falls, a box's hardly changes on one table, and Brax divides by its spread.
        state = jnp.concatenate([tip, tip_velocity, box - tip, turn(yaw), velocity[:2], (goal - box)[:2]])
        table = [*surface_numbers(self.surface(p, 0)), p.table_full_sizes[0, 2:], p.table_frictions[0, :1]]
        privileged = jnp.concatenate([state, *table, p.object_full_sizes[0, :1], p.object_masses])
        return {"state": state, "privileged_state": privileged}

    def proprioception(self, data: mjx.Data) -> jax.Array:
        return jnp.concatenate(self.tip(data))

    def score(
        self, data: mjx.Data, episode: Episode, action: jax.Array
    ) -> tuple[jax.Array, jax.Array, dict[str, jax.Array]]:
        tip, _, box, _, velocity = self.look(data, episode.params)
        to_goal = episode.task.pos[:2] - box[:2]
        distance = jnp.sqrt((to_goal**2).sum() + 1e-12)
        reach = jnp.sqrt(((tip - box) ** 2).sum() + 1e-12)
        fallen = box[2] < episode.task.pos[2] - _FALLEN
        success = (distance < GOAL_RADIUS) & ~fallen & episode.task.possible  # an absent box may be above the goal
        progress = (velocity[:2] * to_goal).sum() / distance * self.dt
        reward = 0.25 * (1 - jnp.tanh(4 * reach)) + 1 - jnp.tanh(4 * distance) + 20 * progress + 2.0 * success
        reward = reward - 0.01 * (action**2).sum() - 5.0 * fallen
        return reward, fallen, {"success": success.astype(jnp.float32), "distance": distance}
