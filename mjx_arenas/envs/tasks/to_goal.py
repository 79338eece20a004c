"""What the tasks with a box, its goal on a table and one of our own robots share."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
from ml_collections import config_dict
from mujoco import mjx

from mjx_arenas.arena import Arena
from mjx_arenas.envs import refusals
from mjx_arenas.envs.base import ArenaEnv, Episode, RangesAt
from mjx_arenas.envs.tasks import goals, robots
from mjx_arenas.envs.vision import Vision
from mjx_arenas.furniture.surfaces import Surfaces
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error


class Seen(NamedTuple):
    """The robot and the box, in the world [m], [m/s]."""

    tip: jax.Array  # (3,)
    tip_velocity: jax.Array  # (3,)
    box: jax.Array  # (3,) its middle
    yaw: jax.Array  # () of the box [rad]
    velocity: jax.Array  # (3,) of its middle


class ToGoal(ArenaEnv):
    """A robot of `robots` brings the arena's object "box" to a goal, which is shown as a disc.

    Args:
        arena: arena whose first object is "box". It must have no actuators of its own.
        robot: of `robots`.
        ranges, config, config_overrides, vision: as in `ArenaEnv`.

    Raises:
        ValueError: the arena's first object is not "box", or is there in no world, or the arena has actuators.
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
            raise error([problem("arena", "has", None, Told(f"objects {names}"), must="'box' as its first object")])
        _check_alone(arena.spec)
        arena.attach(robot)
        goals.add_disc(arena.spec)
        super().__init__(arena, ranges, config, config_overrides, vision=vision)
        refusals.check_object_there(arena, self._levels)
        model = self.arena.mj_model
        self._slides = [model.joint(f"robot_{axis}") for axis in "xyz"]
        self._box = self.arena.layout.object_qpos[0]

    def surface(self, params: ArenaParams, index: Any) -> Surfaces:
        """One of the arena's tables and surfaces in a world."""
        return goals.surface(self.arena, params, index)

    def mark(self, data: mjx.Data, episode: Episode) -> mjx.Data:
        return goals.marked(self.arena, data, episode.task.pos)

    def tip(self, data: mjx.Data) -> tuple[jax.Array, jax.Array]:
        """(3,) place of the robot's tip in the world [m], and its velocity [m/s]."""
        place = jnp.stack([data.qpos[j.qposadr[0]] for j in self._slides]) + jnp.array([0, 0, robots.TIP_HEIGHT])
        return place, jnp.stack([data.qvel[j.dofadr[0]] for j in self._slides])

    def look(self, data: mjx.Data, params: ArenaParams) -> Seen:
        """The places and velocities of the robot's tip and of the box."""
        w, x, y, z = (data.qpos[i] for i in self._box[3:])
        yaw = jnp.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2))
        middle, velocity = goals.middle(self.arena, params, data.qpos), goals.middle_velocity(self.arena, params, data)
        return Seen(*self.tip(data), middle, yaw, velocity)


def _check_alone(spec: mujoco.MjSpec) -> None:
    """Refuses what actions would move beside the robot.

    Raises:
        ValueError: there are actuators.
    """
    if spec.actuators:
        names = ", ".join(repr(one.name) if one.name else "one without a name" for one in spec.actuators)
        raise error([problem("arena", "other_actuators", None, Told(names))])


def turn(yaw: jax.Array) -> jax.Array:
    """(2,) how a box is turned by a yaw () [rad]: it looks the same from four sides."""
    return jnp.array([jnp.sin(4 * yaw), jnp.cos(4 * yaw)])
