"""Pick an object up from one surface and put it on another, with an arm, among obstacles."""

from collections.abc import Mapping, Sequence
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
from mjx_arenas.envs.tasks import goals as goals_
from mjx_arenas.envs.tasks import manipulation
from mjx_arenas.envs.tasks.defaults import Defaults
from mjx_arenas.envs.tasks.goals import GOAL_RADIUS, surface_numbers
from mjx_arenas.envs.tasks.manipulation import (
    TABLES_DECIDE,
    ArmTask,
    Given,
    firm_grips,
    gripped,
    thing_numbers,
)
from mjx_arenas.furniture.surfaces import Surfaces
from mjx_arenas.params.distributions import Uniform
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.spec.objects import Object
from mjx_arenas.spec.place import Place
from mjx_arenas.table_arenas import MultiTableArena

CLEARANCE = 0.08  # [m] above both surfaces on the way
COMES_DOWN = 0.15  # [m] from the goal, seen from above, where the object may come down
MARGIN = 0.06  # [m] between a goal and the edge of its surface
SLOW = 0.1  # [m/s] of an object at rest
FREE = 0.03  # [m] of the tool from half of the largest side of what it let go
FALLEN = 0.1  # [m] below both surfaces
_TRIES = 64  # places of a goal, of which the first is taken that is within reach


def default_config() -> config_dict.ConfigDict:
    """Configuration of the task: `ctrl_dt` is 0.04 s, `sim_dt` 0.004 s and `episode_length` 200 actions.

    `env_config` says what its other keys are, and `ArmTask` those that all tasks of arms have.
    """
    return manipulation.default_config(episode_length=200)


def training_ranges() -> ArenaRanges:
    """Ranges of the heights, places, yaws and friction of tables, of the object and the obstacle, and of how the arm starts."""
    low, high = [-0.03, -0.02, -0.1], [0.03, 0.02, 0.1]
    return manipulation.training_ranges(
        table_offsets=Uniform([low, low, [0, 0, 0]], [high, high, [0, 0, 0]], relative="add"),
        table_rots=Uniform([-0.15, -0.15, 0.0], [0.15, 0.15, 0.0]),
        **manipulation.BOXES,
    )


def wider_ranges() -> ArenaRanges:
    """Ranges with a goal 22 to 30 cm above the object, slippery and heavy boxes, and an arm that starts further from home."""
    low, high = [[0, 0, -0.15], [0, 0, 0.11], [0, 0, 0]], [[0, 0, -0.11], [0, 0, 0.15], [0, 0, 0]]
    offsets = Uniform(low, high, relative="add")
    return manipulation.wider_ranges(training_ranges(), table_offsets=offsets, **manipulation.WIDER_BOXES)


class Carried(NamedTuple):
    """The place where the object is to go."""

    pos: jax.Array
    """(3,) on a surface, in the world [m]."""
    above: jax.Array
    """() from there to the object's middle when it stands there [m]."""
    start: Surfaces
    """The surface on which the object stands."""
    below: Surfaces
    """The surface on which it is to stand."""
    frictions: jax.Array
    """(2,) of both."""
    possible: jax.Array
    """() bool: that surface is there and does not carry the object; the arm reaches the goal, and reaches and takes the object."""


class PickAndPlace(ArmTask):
    """An arm carries the arena's first object from its surface to a goal on another, and lets it go there.

    The object counts as placed when it rests within 5 cm of its goal, measured horizontally, and its middle is as high above the goal's
    surface as it was above the first one, to 1 cm. A box that has tipped over onto a longer or shorter side may not count. The task
    succeeds when the object is placed and the tool is at least 3 cm beyond half of the object's largest side. An episode ends if the object
    falls below both surfaces.

    The policy sees the arm, the object and the goal in the frame of the arm's base, but not the surfaces. The critic also sees the surfaces
    and their friction, and the object's size, mass, friction and velocity. In the task's own arena a box on a table has the table's
    friction; between fingers it has its own.

    The error is the difference between the object's height and the height that it should have [m]. On the way it should be 8 cm above both
    surfaces; at the goal it should be at the height in which it rests there. Between 15 and 5 cm from the goal the height goes over in a
    straight line.

    The reward of a step is the sum of

    - until the object is placed, `0.3 (1 - tanh(6 distance))`, with the distance [m] of the tool from the middle of the object, and up to
      0.3 for a closed grip around it, as in `Lift`. Afterwards 0.6, plus up to 0.3 for an open grip, and up to 0.5 as the tool moves
      away, until it is far enough for success;
    - `(1 - tanh(8 error)) (0.3 + 1.5 near)`, where `near` is 1 at the goal and 0 from a horizontal distance of 80 cm on;
    - 2 for success;
    - less 5 for a fall, and 0.005 times the squares of the action.

    Args:
        config: `default_config()`.
        config_overrides: dotted names and values.
        goals: a name or names of `arena.surfaces` that are not objects. Each episode draws one that is there and does not carry the object.
            None: the second of them, which is the second table, or where there is but one table a surface of furniture.
        given: `ranges`, `arena`, `arm`, `on`, `pos`, `vision`, `terms` and `robot_strength`, as for `ArmTask`. Its own arena has two
            tables before an arm on a third one, a box, and an obstacle. Goals are within the arm's reach; `invalid_arena` reports an
            episode without such a goal, or with an object that is out of reach or too wide. It does not look at heights on the way: an arm
            that does not go as high where the object stands may draw it nearer first. Nor does it look at what is above the object and
            the goal, such as the next board of a shelf, or the top of a unit whose drawer is shut; a warning names such surfaces.

    Raises:
        ValueError: the arena has no object, or it, or all goals, are there in no world; or a name in `goals` is not one of its surfaces.
    """

    def __init__(
        self,
        config: config_dict.ConfigDict | None = None,
        config_overrides: Mapping[str, Any] | None = None,
        goals: str | Sequence[str] | None = None,
        **given: Unpack[Given],
    ) -> None:
        super().__init__(DEFAULTS, config or default_config(), config_overrides, **given)
        refusals.check_object_there(self.arena, self._levels)
        self._goals = goals_.surface_indices(self.arena, goals)
        refusals.check_goals_there(self.arena, self._levels, self._goals.tolist(), goals is not None)
        if given or goals is not None:  # all that is the task's own is in reach
            unreached.warn_of_task(self.foot, self.arena, self._ranges_at(jnp.ones(())), goals=self._goals.tolist())

    def draw_task(self, key: jax.Array, params: ArenaParams, qpos: jax.Array) -> Carried:
        which, where = jax.random.split(key)
        below, frictions, free = goals_.other_surface(which, self.arena, params, self._goals)
        start = goals_.surface(self.arena, params, params.object_tables[0])
        spots = goals_.spot(where, below, jnp.minimum(MARGIN, below.size.min() / 4), (_TRIES,))
        pos = jax.vmap(lambda xy: goals_.goal_at(below, xy))(spots)
        above = self.middle(params, qpos)[2] - start.top[2]
        beyond = self.foot.beyond(params, pos.at[:, 2].add(above))
        least = jnp.maximum(beyond.min(), 0.0)
        first = jnp.argmax(beyond <= least)
        return Carried(pos[first], above, start, below, frictions, free & (least <= 0) & self.takes(params, qpos))

    def mark(self, data: mjx.Data, episode: Episode) -> mjx.Data:
        return goals_.marked(self.arena, data, episode.task.pos)

    def observe(self, data: mjx.Data, episode: Episode) -> dict[str, jax.Array]:
        pos, mat = self.thing(data, episode)
        tool, task = self.hand(data, episode).tool.pos, episode.task
        goal = self.local(data, task.pos) - pos
        state = jnp.concatenate([self.proprioception(data, episode), pos - tool, mat[:, 0], mat[:, 1], goal])
        more = [*surface_numbers(task.start), *surface_numbers(task.below)]
        more += [self.thing_velocity(data, episode), *thing_numbers(episode.params), task.frictions]
        return {"state": state, "privileged_state": jnp.concatenate([state, *more])}

    def score(
        self, data: mjx.Data, episode: Episode, action: jax.Array
    ) -> tuple[jax.Array, jax.Array, dict[str, jax.Array]]:
        task, at = episode.task, self.middle(episode.params, data.qpos)
        away = self.local(data, at) - self.hand(data, episode).tool.pos
        off = jnp.sqrt((away**2).sum() + 1e-12)
        distance = jnp.sqrt(((task.pos - at)[:2] ** 2).sum() + 1e-12)
        tops = jnp.stack([task.start.top[2], task.below.top[2]])
        # Above both surfaces on the way, on the goal's at the goal.
        way = jnp.clip((distance - GOAL_RADIUS) / (COMES_DOWN - GOAL_RADIUS), 0.0, 1.0)
        height = task.pos[2] + task.above + way * (tops.max() + CLEARANCE - task.pos[2])
        high = 1 - jnp.tanh(8 * jnp.abs(at[2] - height))
        near = jnp.maximum(1 - distance / 0.8, 0.0)
        speed = jnp.sqrt((self.thing_velocity(data, episode) ** 2).sum() + 1e-12)
        rests = (jnp.abs(at[2] - task.pos[2] - task.above) < 0.01) & (speed < SLOW)
        placed, free = (distance < GOAL_RADIUS) & rests, FREE + episode.params.object_full_sizes[0].max() / 2
        success = placed & (off > free)
        fallen = at[2] < tops.min() - FALLEN
        taken = 0.3 * (1 - jnp.tanh(6 * off)) + 0.3 * gripped(off, action)
        let_go = 0.3 * (1 + action[-1]) / 2 + 0.5 * jnp.minimum(off / free, 1.0)
        tool = jnp.where(placed, 0.6 + let_go, taken)
        reward = tool + high * (0.3 + 1.5 * near) + 2.0 * success - 0.005 * (action**2).sum() - 5.0 * fallen
        return reward, fallen, {"success": success.astype(jnp.float32), "distance": distance}


def _tables(arm: Arm) -> Arena:
    near = Place(near=manipulation.PREFIX + arm.base, distance=arm.reach)
    arena = MultiTableArena(
        table_offsets=[[0.42, -0.27, 0.75], [0.42, 0.27, 0.75], [0, 0, 0.75]],
        table_full_sizes=[(0.42, 0.44, 0.05), (0.42, 0.44, 0.05), (0.24, 0.24, 0.05)],
        objects=[
            Object("box", full_size=0.045, on=0, place=near, priority=manipulation.IN_GRIPS),
            Object("hurdle", full_size=(0.05, 0.05, 0.05), on=0),
        ],
        table_priority=TABLES_DECIDE,
    )
    return firm_grips(arena)


DEFAULTS = Defaults(_tables, training_ranges, "table2", marks=goals_.add_disc, does="carry")
