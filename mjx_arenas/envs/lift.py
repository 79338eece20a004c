"""Lift an object of any size, mass, friction and shape off its table, with an arm."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from ml_collections import config_dict
from mujoco import mjx

from mjx_arenas.arena import Arena
from mjx_arenas.envs import arms, manipulation
from mjx_arenas.envs.arms import Arm
from mjx_arenas.envs.base import Episode, RangesAt
from mjx_arenas.envs.manipulation import ArmTask, thing_numbers
from mjx_arenas.envs.reach import MOUNT
from mjx_arenas.params.distributions import Choice, LogUniform, Uniform
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.spec.objects import Object
from mjx_arenas.spec.place import Place
from mjx_arenas.table_arenas import TableArena

HEIGHT = 0.1  # [m] of success, above where the object stood
HELD = 0.06  # [m] from the tool to the middle of an object that it holds
FALLEN = 0.1  # [m] below where it stood


def default_config() -> config_dict.ConfigDict:
    """Times in [s]."""
    return manipulation.default_config(episode_length=150)


def training_ranges() -> ArenaRanges:
    """The table, the box, and how the arm starts."""
    return ArenaRanges(
        table_offsets=Uniform([-0.1, -0.1, -0.2], [0.1, 0.1, 0.2], relative="add"),
        table_rots=Uniform(-0.6, 0.6),
        table_full_sizes=Uniform([0.8, 0.8, 0.03], [1.0, 1.0, 0.08]),
        table_frictions=LogUniform([0.4, 0.005, 0.0001], [1.2, 0.005, 0.0001]),
        object_full_sizes=Uniform(0.03, 0.06),
        object_masses=LogUniform(0.03, 0.2),
        terms={manipulation.START: Uniform(-0.15, 0.15)},
    )


def wider_ranges() -> ArenaRanges:
    """Tables lower or higher, and turned further, than in training; slippery or heavy boxes; an arm that starts further from home."""
    return training_ranges()._replace(
        table_offsets=Choice([[0, 0, -0.3], [0, 0, -0.25], [0, 0, 0.25], [0, 0, 0.3]], relative="add"),
        table_rots=Uniform(0.7, 1.2),
        table_frictions=LogUniform([0.2, 0.005, 0.0001], [0.4, 0.005, 0.0001]),
        object_full_sizes=Uniform(0.025, 0.065),
        object_masses=LogUniform(0.2, 0.4),
        terms={manipulation.START: Uniform(-0.25, 0.25)},
    )


class Stood(NamedTuple):
    """Where the object stood."""

    height: jax.Array
    """() of its origin in the world [m]."""


class Lift(ArmTask):
    """An arm lifts the arena's first object by 10 cm and holds it there.

    The policy sees its joints, its tool and the object in the frame of the arm's base; the critic sees the object's size, mass,
    friction and velocity, too. The reward is `0.4 (1 - tanh(6 distance))` of tool and object, up to 1 for the height of an object that is
    held, and 1 more at 10 cm, less 0.005 times the squares of the action. An episode ends where the object falls.

    Args:
        config: `default_config()`.
        config_overrides: dotted names and values.
        ranges: the arenas; None: `training_ranges()`, or, of an arena of your own, nothing varies.
        arena: not compiled yet, with the object as its first; None: a table with a box. `Object(place=Place(near="arm_base",
            distance=...))` keeps it within reach: "arm_base" is the arm's base with the prefix "arm_".
        arm: None: `arms.small()`.
        on: what carries the arm.
        pos: where its base stands on that.

    Raises:
        ValueError: the arena has no object.
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
    ) -> None:
        arm = arm or arms.small()
        ranges = (training_ranges() if arena is None else ArenaRanges()) if ranges is None else ranges
        if arena is None:
            place = Place(region=((-0.2, -0.7), (0.9, 0.7)), near=manipulation.PREFIX + arm.base, distance=(0.22, 0.42))
            arena = TableArena(
                (0.9, 0.9, 0.05), objects=[Object("box", full_size=0.045, place=place)], table_priority=0
            )
        if not arena.objects:
            raise ValueError("`arena` must have an object to lift: mjx_arenas.Object(...).")
        super().__init__(arena, arm, on, pos, ranges, config or default_config(), config_overrides)

    def draw_task(self, key: jax.Array, params: ArenaParams, qpos: jax.Array) -> Stood:
        del key, params
        return Stood(qpos[self.arena.layout.object_qpos[0, 2]])

    def observe(self, data: mjx.Data, episode: Episode) -> dict[str, jax.Array]:
        pos, mat = self.thing(data)
        tool = self.hand(data).tool.pos
        state = jnp.concatenate([self.proprioception(data), pos - tool, mat[:, 0], mat[:, 1]])
        more = [self.thing_velocity(data), *thing_numbers(episode.params)]
        return {"state": state, "privileged_state": jnp.concatenate([state, *more])}

    def score(
        self, data: mjx.Data, episode: Episode, action: jax.Array
    ) -> tuple[jax.Array, jax.Array, dict[str, jax.Array]]:
        pos, _ = self.thing(data)
        away = pos - self.hand(data).tool.pos
        distance = jnp.sqrt((away**2).sum() + 1e-12)
        height = data.qpos[self.arena.layout.object_qpos[0, 2]] - episode.task.height
        held = distance < HELD
        success = (held & (height > HEIGHT)).astype(jnp.float32)
        lifted = held * jnp.clip(height / HEIGHT, 0.0, 1.0)
        reward = 0.4 * (1 - jnp.tanh(6 * distance)) + lifted + success - 0.005 * (action**2).sum()
        return reward, height < -FALLEN, {"success": success, "distance": distance, "height": height}
