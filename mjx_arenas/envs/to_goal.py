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
from mjx_arenas.furniture.surfaces import Surfaces
from mjx_arenas.params.distribution import DRAWN
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.sample import tops

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

    Raises:
        ValueError: the arena's first object is not "box".
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
        if not arena.objects or arena.objects[0].name != "box":
            names = [o.name for o in arena.objects]
            raise ValueError(f"`arena` must have 'box' as its first object, got objects {names}.")
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

    def surface(self, params: ArenaParams, index: Any) -> Surfaces:
        """One of the arena's tables and surfaces in a world."""
        found = tops.surfaces(params, self.arena.layout.places.ground).of(jnp.asarray(index)[None])
        return jax.tree.map(lambda x: x[0], found)

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


def spot(key: jax.Array, below: Surfaces, margin: jax.Array | float) -> jax.Array:
    """(2,) a random place on a surface, in its frame, `margin` [m] inside its edges; the middle of one that is too small."""
    half = jnp.maximum(below.size / 2 - margin, 0.0)
    return jax.random.uniform(key, (2,), DRAWN, -half, half)


def goal_at(below: Surfaces, xy: jax.Array) -> Goal:
    """The goal at a place (2,) in the frame of a surface."""
    return Goal(jnp.append(below.top[:2] + geometry.rotate_yaw(below.rot, xy), below.top[2]))


def surface_numbers(below: Surfaces) -> list[jax.Array]:
    """Of a surface, for a critic: where it is, its yaw and its size; 7 numbers."""
    return [below.top, jnp.array([jnp.sin(below.rot), jnp.cos(below.rot)]), below.size]
