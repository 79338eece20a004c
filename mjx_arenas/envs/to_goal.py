"""What the tasks with a box, its goal on a table and one of our own robots share."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
from ml_collections import config_dict
from mujoco import mjx

from mjx_arenas import geometry
from mjx_arenas.arena import Arena
from mjx_arenas.envs import robots
from mjx_arenas.envs.base import ArenaEnv, Episode, RangesAt
from mjx_arenas.envs.vision import Vision
from mjx_arenas.params.distribution import DRAWN
from mjx_arenas.params.params import ArenaParams, ArenaRanges

GOAL_RADIUS = 0.05  # [m] of success


class Goal(NamedTuple):
    """Where the box is to go."""

    pos: jax.Array  # (3,) on the table's top, in the world [m]


class Seen(NamedTuple):
    """The robot and the box, in the world [m], [m/s]."""

    tip: jax.Array  # (3,)
    tip_velocity: jax.Array  # (3,)
    box: jax.Array  # (3,)
    yaw: jax.Array  # () of the box [rad]
    velocity: jax.Array  # (3,) of the box


class ToGoal(ArenaEnv):
    """A robot of `robots` brings the arena's object "box" to a goal, which is shown as a disc.

    Args:
        arena: with that object as its first.
        robot: of `robots`.
        ranges, config, config_overrides, vision: as in `ArenaEnv`.
    """

    def __init__(
        self,
        arena: Arena,
        robot: mujoco.MjSpec,
        ranges: ArenaRanges | RangesAt,
        config: config_dict.ConfigDict,
        config_overrides: Mapping[str, Any] | None,
        vision: Vision | None = None,
    ) -> None:
        arena.attach(robot)
        goal = arena.spec.worldbody.add_body(name="goal", mocap=True)
        goal.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=(GOAL_RADIUS, 0.001, 0),
            rgba=(0, 0.62, 0.45, 0.8),
            contype=0,
            conaffinity=0,
        )
        super().__init__(arena, ranges, config, config_overrides, vision=vision)
        model = self.arena.mj_model
        self._slides = [model.joint(f"robot_{axis}") for axis in "xyz"]
        self._box = self.arena.layout.object_qpos[0]
        self._box_velocity = model.jnt_dofadr[model.body("box").jntadr[0]]

    def mark(self, data: mjx.Data, episode: Episode) -> mjx.Data:
        return data.replace(mocap_pos=episode.task.pos[None])

    def look(self, data: mjx.Data) -> Seen:
        """Where the robot's tip and the box are."""
        qpos, qvel, at = data.qpos, data.qvel, self._box_velocity
        tip = jnp.stack([qpos[j.qposadr[0]] for j in self._slides]) + jnp.array([0, 0, robots.TIP_HEIGHT])
        tip_velocity = jnp.stack([qvel[j.dofadr[0]] for j in self._slides])
        w, x, y, z = (qpos[i] for i in self._box[3:])
        yaw = jnp.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2))
        return Seen(tip, tip_velocity, qpos[self._box[:3]], yaw, qvel[at : at + 3])


def turn(yaw: jax.Array) -> jax.Array:
    """(2,) how a box is turned by a yaw () [rad]: it looks the same from four sides."""
    return jnp.array([jnp.sin(4 * yaw), jnp.cos(4 * yaw)])


def spot(key: jax.Array, params: ArenaParams, table: int, margin: float) -> jax.Array:
    """(2,) a random place on a table, in the frame of its top, `margin` [m] inside its edges."""
    half = params.table_full_sizes[table, :2] / 2 - margin
    return jax.random.uniform(key, (2,), DRAWN, -half, half)


def goal_at(params: ArenaParams, table: int, xy: jax.Array) -> Goal:
    """The goal at a place (2,) in the frame of a table's top."""
    offset = params.table_offsets[table]
    return Goal(jnp.append(offset[:2] + geometry.rotate_yaw(params.table_rots[table], xy), offset[2]))


def table_numbers(params: ArenaParams, table: int) -> list[jax.Array]:
    """Of a table, for a critic: where it is, its yaw, size and friction; 9 numbers."""
    rot = params.table_rots[table]
    yaw = jnp.array([jnp.sin(rot), jnp.cos(rot)])
    return [params.table_offsets[table], yaw, params.table_full_sizes[table], params.table_frictions[table, :1]]
