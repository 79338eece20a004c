"""Lift an object of any size, mass, friction and shape off its table, with an arm."""

from collections.abc import Mapping
from typing import Any, NamedTuple, Unpack

import jax
import jax.numpy as jnp
from ml_collections import config_dict
from mujoco import mjx

from mjx_arenas.arena import Arena
from mjx_arenas.envs import refusals
from mjx_arenas.envs.arms import unreached
from mjx_arenas.envs.arms.arm import Arm
from mjx_arenas.envs.base import Episode
from mjx_arenas.envs.tasks import manipulation
from mjx_arenas.envs.tasks.defaults import Defaults
from mjx_arenas.envs.tasks.goals import friction_on
from mjx_arenas.envs.tasks.manipulation import (
    TABLES_DECIDE,
    ArmTask,
    Given,
    firm_grips,
    gripped,
    thing_numbers,
)
from mjx_arenas.params.distributions import Uniform
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.spec.objects import Object
from mjx_arenas.spec.place import Place
from mjx_arenas.table_arenas import TableArena

HEIGHT = 0.1  # [m] of success, above where the object stood
HELD = 0.06  # [m] from the tool to the middle of an object that it holds
FALLEN = 0.1  # [m] below where it stood


def default_config() -> config_dict.ConfigDict:
    """Configuration of the task: `ctrl_dt` is 0.04 s, `sim_dt` 0.004 s and `episode_length` 150 actions.

    `env_config` says what its other keys are, and `ArmTask` those that all tasks of arms have.
    """
    return manipulation.default_config(episode_length=150)


def training_ranges() -> ArenaRanges:
    """Ranges of the table, of the box, and of how the arm starts."""
    return manipulation.training_ranges(**manipulation.TABLE, **manipulation.BOXES)


def wider_ranges() -> ArenaRanges:
    """Ranges beyond training: tables lower, higher or turned further; slippery and heavy boxes; an arm further from home."""
    boxes = {**manipulation.WIDER_BOXES, "object_full_sizes": Uniform(0.025, 0.065)}
    return manipulation.wider_ranges(training_ranges(), **manipulation.WIDER_TABLE, **boxes)


class Stood(NamedTuple):
    """The place where the object stood."""

    height: jax.Array
    """() of its middle in the world [m]."""
    possible: jax.Array
    """() bool: the arm takes it there, and reaches as high as it is to be lifted."""


class Lift(ArmTask):
    """An arm lifts the arena's first object by 10 cm and holds it there.

    The policy sees the arm and the object in the frame of the arm's base. The critic also sees the object's size, mass, friction and
    velocity and the table's friction. In the task's own arena a box on the table has the table's friction; between fingers it has its own.
    An episode ends if the object falls. `invalid_arena` reports an episode whose object is out of the arm's reach, also in height, or
    too wide for it. It does not look at what is above the object, such as the next board of a shelf.

    The reward of a step is the sum of

    - `0.4 (1 - tanh(6 distance))`, with the distance [m] of the tool from the middle of the object;
    - up to 0.3 for a closed grip around the object. It falls to 0 where the object's middle is 2 cm from the tool, and is 0 for an open
      grip;
    - the height that the object has gained, 1 at 10 cm, if the tool holds it, that is, if they are less than 6 cm apart;
    - 1 for success;
    - less 0.005 times the squares of the action.

    Args:
        config: `default_config()`.
        config_overrides: dotted names and values.
        given: `ranges`, `arena`, `arm`, `on`, `pos`, `vision`, `terms` and `robot_strength`, as for `ArmTask`. Its own arena is a table
            with a box.

    Raises:
        ValueError: the arena has no object, or it is there in no world.
    """

    def __init__(
        self,
        config: config_dict.ConfigDict | None = None,
        config_overrides: Mapping[str, Any] | None = None,
        **given: Unpack[Given],
    ) -> None:
        super().__init__(DEFAULTS, config or default_config(), config_overrides, **given)
        refusals.check_object_there(self.arena, self._levels)
        if given:  # all that is the task's own is in reach
            unreached.warn_of_task(self.foot, self.arena, self._ranges_at(jnp.ones(())), HEIGHT)

    def draw_task(self, key: jax.Array, params: ArenaParams, qpos: jax.Array) -> Stood:
        del key
        return Stood(self.middle(params, qpos)[2], self.takes(params, qpos, HEIGHT))

    def observe(self, data: mjx.Data, episode: Episode) -> dict[str, jax.Array]:
        pos, mat = self.thing(data, episode)
        tool = self.hand(data, episode).tool.pos
        state = jnp.concatenate([self.proprioception(data, episode), pos - tool, mat[:, 0], mat[:, 1]])
        params = episode.params
        more = [
            self.thing_velocity(data, episode),
            *thing_numbers(params),
            friction_on(params, params.object_tables[0]),
        ]
        return {"state": state, "privileged_state": jnp.concatenate([state, *more])}

    def score(
        self, data: mjx.Data, episode: Episode, action: jax.Array
    ) -> tuple[jax.Array, jax.Array, dict[str, jax.Array]]:
        middle = self.middle(episode.params, data.qpos)
        away = self.local(data, middle) - self.hand(data, episode).tool.pos
        distance = jnp.sqrt((away**2).sum() + 1e-12)
        height = middle[2] - episode.task.height
        held = distance < HELD
        success = (held & (height > HEIGHT)).astype(jnp.float32)
        lifted = held * jnp.clip(height / HEIGHT, 0.0, 1.0)
        near = 0.4 * (1 - jnp.tanh(6 * distance)) + 0.3 * gripped(distance, action)
        reward = near + lifted + success - 0.005 * (action**2).sum()
        return reward, height < -FALLEN, {"success": success, "distance": distance, "height": height}


def _table(arm: Arm) -> Arena:
    place = Place(region=((-0.2, -0.7), (0.9, 0.7)), near=manipulation.PREFIX + arm.base, distance=arm.reach)
    box = Object("box", full_size=0.045, place=place, priority=manipulation.IN_GRIPS)
    return firm_grips(TableArena((0.9, 0.9, 0.05), objects=[box], table_priority=TABLES_DECIDE))


DEFAULTS = Defaults(_table, training_ranges, 0, manipulation.MOUNT, does="lift")
