"""Carry a box from one table or surface to a goal on another, each of any height, place, size and yaw."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from ml_collections import config_dict
from mujoco import mjx

from mjx_arenas.arena import Arena
from mjx_arenas.envs import refusals
from mjx_arenas.envs.arms import graspable, unreached
from mjx_arenas.envs.base import Episode, RangesAt
from mjx_arenas.envs.config import env_config
from mjx_arenas.envs.tasks import goals as goals_
from mjx_arenas.envs.tasks import robots
from mjx_arenas.envs.tasks.goals import GOAL_RADIUS, goal_at, spot, surface_numbers
from mjx_arenas.envs.tasks.to_goal import ToGoal, turn
from mjx_arenas.furniture.surfaces import Surfaces
from mjx_arenas.params.distributions import LogUniform, Uniform
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.spec.objects import Object
from mjx_arenas.table_arenas import MultiTableArena

WIDTH = 2 * robots.STROKE  # [m] of what the gripper takes
REACH = 1.0  # [m] along x and y, to each side
_MARGIN = 0.1  # [m] between a goal and the table's edge
_CLEARANCE = 0.08  # [m] above both tops on the way
_NEAR = 0.2  # [m] from the goal, where the box may come down


def default_config() -> config_dict.ConfigDict:
    """Configuration of the task: `ctrl_dt` is 0.04 s, `sim_dt` 0.01 s and `episode_length` 200 actions.

    `env_config` says what its other keys are.
    """
    return env_config(ctrl_dt=0.04, sim_dt=0.01, episode_length=200)


def training_ranges() -> ArenaRanges:
    """Ranges of the tables and boxes to train on. The places of the tables cannot overlap at any yaw."""
    return ArenaRanges(
        table_offsets=Uniform([-0.1, -0.05, -0.15], [0.1, 0.05, 0.15], relative="add"),
        table_rots=Uniform(-0.6, 0.6),
        table_full_sizes=Uniform([0.45, 0.45, 0.03], [0.6, 0.6, 0.08]),
        table_frictions=LogUniform([0.3, 0.005, 0.0001], [1.0, 0.005, 0.0001]),
        object_full_sizes=Uniform(0.04, 0.05, tied="axes"),
    )


class GoalOn(NamedTuple):
    """The place where the box is to go, and what is below it."""

    pos: jax.Array  # (3,) on the surface, in the world [m]
    above: jax.Array  # () from a surface to the box's middle when it stands there [m]
    below: Surfaces
    frictions: jax.Array  # (2,) of what carries the box at first, and of this
    possible: jax.Array
    """() bool: the surface is there, does not carry the box, goal and box are within reach, also in height, and the gripper takes it."""


def _two_tables() -> Arena:
    arena = MultiTableArena(
        table_offsets=[[0, -0.5, 0.8], [0, 0.5, 0.8]],
        table_full_sizes=(0.55, 0.55, 0.05),
        objects=[Object("box", full_size=0.045, on=0)],
    )
    option = arena.spec.option
    option.iterations, option.ls_iterations = 4, 8
    arena.spec.stat.center, arena.spec.stat.extent = (0, 0, 0.85), 1.1  # the picture: both tables, from the front
    arena.spec.visual.global_.azimuth, arena.spec.visual.global_.elevation = 180, -25
    return arena


class Transfer(ToGoal):
    """A gripper on three slides carries a box from one table to a goal on another, or between surfaces of furniture.

    Actions are velocities along x, y and z and of the yaw, and a position of both fingers: 1 is open, -1 is closed.

    The task succeeds when the box rests within 5 cm of its goal, measured horizontally. An episode ends if the box falls below both
    surfaces.

    In its own arena the friction of a box on a table is the table's, which varies. The friction of the grip is that of the fingers, 1.5
    in all worlds. The task is therefore about where things are; in `PickAndPlace` grips can slip, too.

    The policy sees where the gripper, the box and the goal are, but not the tables. The critic also sees where both surfaces are, their
    yaws, sizes and friction, and the box's size, mass and friction.

    Args:
        config: `default_config()`.
        config_overrides: dotted names and values.
        ranges: ranges of the arenas, or for a curriculum a function from a level to ranges. None: `training_ranges()`; in an arena of your
            own nothing varies. `object_tables` is where the box starts. `invalid_arena` reports episodes without a surface for the goal,
            with a goal or box that is out of reach, also in height, or with a box that is too wide for the gripper. It does not look at
            what is above the box and the goal, such as the next board of a shelf, or the top of a unit whose drawer is shut.
        arena: arena that is not compiled yet, whose first object is called "box". It must have no actuators of its own. None: an
            arena with two tables.
        goals: a name or names of `arena.surfaces` that are not objects. Each episode draws one that is there and does not carry the box.
            None: the second of them, which is the second table, or where there is but one table a surface of furniture.
        reach: reach of the gripper along x and y, to each side of the middle of the floor [m]. Its tip reaches heights from 0.45 to 1.45 m,
            between which the box's middle must be.

    Raises:
        ValueError: the arena's first object is not "box", or is there in no world, the arena has actuators, a name in `goals` is not one
            of its surfaces, or no such surface is there in any world beside that of the box.
    """

    def __init__(
        self,
        config: config_dict.ConfigDict | None = None,
        config_overrides: Mapping[str, Any] | None = None,
        ranges: ArenaRanges | RangesAt | None = None,
        arena: Arena | None = None,
        goals: str | Sequence[str] | None = None,
        reach: float = REACH,
    ) -> None:
        given = arena is not None or ranges is not None or goals is not None or reach != REACH
        if arena is None:
            arena, ranges = _two_tables(), training_ranges() if ranges is None else ranges
        self._goals, self._reach = goals_.surface_indices(arena, goals), reach
        super().__init__(
            arena, robots.gripper(reach), ranges or ArenaRanges(), config or default_config(), config_overrides
        )
        refusals.check_goals_there(self.arena, self._levels, self._goals.tolist(), goals is not None)
        ranges_at = self._ranges_at(jnp.ones(()))
        graspable.warn_of_wide(arena, ranges_at, WIDTH)
        if given:  # all that is the task's own is in reach
            unreached.warn_of_tip(reach, robots.TIP_HEIGHTS, self.arena, ranges_at, self._goals.tolist())
        joints = [self.arena.mj_model.joint(f"robot_{name}") for name in ("yaw", "left", "right")]
        self._yaw, *self._fingers = (joint.qposadr[0] for joint in joints)

    @property
    def action_size(self) -> int:
        """Three velocities, a yaw rate and a grip."""
        return 5

    def control(self, action: jax.Array) -> jax.Array:
        return super().control(jnp.append(action, action[-1]))  # both fingers alike

    def draw_task(self, key: jax.Array, params: ArenaParams, qpos: jax.Array) -> GoalOn:
        which, where = jax.random.split(key)
        other = goals_.other_surface(which, self.arena, params, self._goals)
        goal = goal_at(other.surface, spot(where, other.surface, jnp.minimum(_MARGIN, other.surface.size.min() / 4)))
        box, start = goals_.middle(self.arena, params, qpos), self.surface(params, params.object_tables[0])
        above = box[2] - start.top[2]
        places = jnp.stack([goal.at[2].add(above), box])
        low, high = robots.TIP_HEIGHTS
        reached = (jnp.abs(places[:, :2]) <= self._reach).all() & (places[:, 2] >= low - graspable.SLACK).all()
        reached &= (places[:, 2] <= high + graspable.SLACK).all()
        possible = other.free & reached & graspable.taken(self.arena, params, WIDTH)
        return GoalOn(goal, above, other.surface, other.frictions, possible)

    def observe(self, data: mjx.Data, episode: Episode) -> dict[str, jax.Array]:
        tip, tip_velocity, box, yaw, velocity = self.look(data, episode.params)
        goal, p = episode.task.pos, episode.params
        fingers = jnp.stack([data.qpos[i] for i in self._fingers]) / robots.STROKE
        hand = [tip, tip_velocity, fingers, turn(yaw - data.qpos[self._yaw])]
        state = jnp.concatenate([*hand, box - tip, velocity, goal - box])
        tables = [*surface_numbers(self.surface(p, p.object_tables[0])), *surface_numbers(episode.task.below)]
        box = [p.object_full_sizes[0, :1], p.object_masses[:1], p.object_frictions[0, :1], episode.task.frictions]
        privileged = jnp.concatenate([state, *tables, *box])
        return {"state": state, "privileged_state": privileged}

    def score(
        self, data: mjx.Data, episode: Episode, action: jax.Array
    ) -> tuple[jax.Array, jax.Array, dict[str, jax.Array]]:
        tip, _, box, _, velocity = self.look(data, episode.params)
        goal, start = episode.task.pos, self.surface(episode.params, episode.params.object_tables[0]).top[2]
        tops = jnp.stack([start, goal[2]])
        reach = jnp.sqrt(((tip - box) ** 2).sum() + 1e-12)
        distance = jnp.sqrt(((goal - box)[:2] ** 2).sum() + 1e-12)
        bottom = box[2] - episode.task.above
        fallen = box[2] < tops.min()
        rests = (jnp.abs(bottom - goal[2]) < 0.01) & ((velocity**2).sum() < 0.1**2)
        success = (distance < GOAL_RADIUS) & rests
        # Above both tops on the way, on the goal's at the goal.
        way = jnp.clip((distance - GOAL_RADIUS) / (_NEAR - GOAL_RADIUS), 0.0, 1.0)
        height = goal[2] + way * (tops.max() + _CLEARANCE - goal[2])
        lift = 1 - jnp.tanh(5 * jnp.abs(bottom - height))
        carry = jnp.maximum(1 - distance / 1.5, 0.0)
        reward = 0.25 * (1 - jnp.tanh(4 * reach)) + lift * (0.5 + 2 * carry) + 2.0 * success
        reward = reward - 0.01 * (action**2).sum() - 5.0 * fallen
        return reward, fallen, {"success": success.astype(jnp.float32), "distance": distance}
