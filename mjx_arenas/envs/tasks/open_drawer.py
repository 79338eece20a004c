"""Open a drawer, of units of other sizes and heights, with an arm."""

from collections.abc import Mapping
from typing import Any, NamedTuple, Unpack

import jax
import jax.numpy as jnp
import numpy as np
from ml_collections import config_dict
from mujoco import mjx

from mjx_arenas import geometry
from mjx_arenas.arena import Arena
from mjx_arenas.envs import refusals
from mjx_arenas.envs.arms import heights, moves, unreached
from mjx_arenas.envs.arms.arm import Arm
from mjx_arenas.envs.arms.foot import Foot
from mjx_arenas.envs.arms.opening import thinnest
from mjx_arenas.envs.base import Episode
from mjx_arenas.envs.tasks import manipulation
from mjx_arenas.envs.tasks.defaults import Defaults
from mjx_arenas.envs.tasks.manipulation import ArmTask, Given
from mjx_arenas.furniture.drawers import LEFT_INSIDE, Drawers
from mjx_arenas.furniture.part import Box, named
from mjx_arenas.furniture.standing import frames, numbers_of
from mjx_arenas.params.distribution import DRAWN
from mjx_arenas.params.distributions import LogUniform, Uniform
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.rules import furniture_rules
from mjx_arenas.sample import tops
from mjx_arenas.spec import specs
from mjx_arenas.table_arenas import TableArena

NEAR = 0.02  # [m] of success
BEHIND = 0.025  # [m] from the front of a drawer to where a tool hooks in
BELOW = 0.02  # [m] below its upper edge
CLOSE, AROUND = (
    0.015,
    0.06,
)  # [m] from there, seen from above, within which the tool may be down, and beyond which it is to be up
OVER = 0.07  # [m] how much higher
LEAST, MOST = 0.08, 0.16  # [m] by which a drawer is to be opened further
_ALONG = np.linspace(-1.0, 1.0, 9)  # of half of a front's width: where a tool may hook in
_ON_THE_WAY = np.linspace(0.0, 1.0, 5)  # of the way to the goal
UNIT = "unit"


def default_config() -> config_dict.ConfigDict:
    """Configuration of the task: `ctrl_dt` is 0.04 s, `sim_dt` 0.004 s and `episode_length` 150 actions.

    `env_config` says what its other keys are, and `ArmTask` those that all tasks of arms have.
    """
    return manipulation.default_config(episode_length=150)


def training_ranges() -> ArenaRanges:
    """Ranges of the unit's place, yaw, size and heights, of its drawers' openings and resistance, and of how the arm starts."""
    return manipulation.training_ranges(
        terms={
            f"{UNIT}.pos": Uniform([-0.03, -0.1, 0.0], [0.03, 0.1, 0.0], relative="add"),
            f"{UNIT}.rot": Uniform(-0.25, 0.25),
            f"{UNIT}.size": Uniform([0.34, 0.35], [0.4, 0.5]),
            f"{UNIT}.heights": Uniform([0.22, 0.16, 0.12], [0.3, 0.22, 0.18]),
            f"{UNIT}.openings": Uniform([0.0, 0.0, 0.07], [0.02, 0.02, 0.1]),
            f"{UNIT}.damping": LogUniform(2.0, 10.0),
            f"{UNIT}.frictionloss": LogUniform(0.5, 2.0),
        }
    )


def wider_ranges() -> ArenaRanges:
    """Ranges of stiff units that are turned further than in training, with drawers of more heights. The arm starts further from home."""
    terms = {
        f"{UNIT}.rot": Uniform(0.25, 0.4),
        f"{UNIT}.heights": Uniform([0.19, 0.13, 0.1], [0.33, 0.25, 0.2]),
        f"{UNIT}.damping": LogUniform(10.0, 15.0),
        f"{UNIT}.frictionloss": LogUniform(2.0, 3.0),
    }
    return manipulation.wider_ranges(training_ranges(), terms=terms)


class Opened(NamedTuple):
    """How far the drawer is to be open."""

    start: jax.Array
    """() at first [m]."""
    goal: jax.Array
    """() [m]"""
    possible: jax.Array
    """() bool: the drawer is there, is far enough open at first for the tool to hook in, but not as far as it opens, the arm may reach
    behind its front all the way, and nothing fixed stands in its way."""


class OpenDrawer(ArmTask):
    """An arm opens the uppermost drawer of a unit, which is a little open, to within 2 cm of a random opening.

    Drawers have no handles. The tool hooks in behind the front, 2.5 cm from it and 2 cm below its upper edge.

    The policy sees the arm, the way from the tool to that point, which way the unit faces, and how far the drawer is open and still to be
    opened, in the frame of the arm's base. The critic also sees sizes, damping and friction. `invalid_arena` reports an episode whose
    drawer is absent, starts with a gap that is too small for the tool, is at most 2 cm from its limit, is out of the arm's reach, or whose
    front would come where a table or a part of furniture is.

    The reward of a step is the sum of

    - `0.4 (1 - tanh(6 distance))`, with the distance [m] of the tool from the point where it hooks in or, while it is not yet above that
      point, from a point up to 7 cm above it;
    - the share of the way to the goal that the drawer has been opened, which decreases again beyond the goal;
    - 1 for success;
    - less 0.005 times the squares of the action.

    Args:
        config: `default_config()`.
        config_overrides: dotted names and values.
        unit: name of the arena's `furniture.Drawers`.
        given: `ranges`, `arena`, `arm`, `on`, `pos`, `vision`, `terms` and `robot_strength`, as for `ArmTask`. Its own arena is a unit of
            three drawers before a small table that carries the arm.

    Raises:
        ValueError: the arena has no such unit, its drawers may be absent, or it stands on something that is there in no world.
    """

    def __init__(
        self,
        config: config_dict.ConfigDict | None = None,
        config_overrides: Mapping[str, Any] | None = None,
        unit: str = UNIT,
        **given: Unpack[Given],
    ) -> None:
        super().__init__(DEFAULTS, config or default_config(), config_overrides, **given)
        self._parts = self.arena.layout.places.furniture
        units = {i: part for i, part in enumerate(self._parts) if isinstance(part, Drawers)}
        names = [part.name for part in units.values()]
        if not names:
            raise error([problem("arena", "a_drawer_to", None, None, unit_name=UNIT)])
        if unit not in names:
            raise error(
                [problem("unit", "must", None, unit, must=f"the name of drawers of the arena, {', '.join(names)}")]
            )
        for name in sorted({f"{unit}.active", f"{unit}.pieces_active"} & self._varying):
            raise error([problem("ranges.terms", "drawer_there", None, name)])
        self._index = list(units)[names.index(unit)]
        self._unit, model = units[self._index], self.arena.mj_model
        drawer = f"{unit}_{self._unit.moving[-1]}"
        self._bottom = self.arena.surfaces.index(f"{drawer}_bottom")
        refusals.check_surface_there(self.arena, self._levels, "unit", unit, self._bottom)
        joint = model.joint(drawer)
        self._slide, self._speed = joint.qposadr[0], joint.dofadr[0]
        keyframe: Any = self.config.keyframe
        moved, base = moves.moves(self.arm, self._chain, keyframe), manipulation.PREFIX + self.arm.base
        self._foot, self._goes = Foot.of(self.arena, base, self.arm, moved), heights.anywhere(self.arm, moved)
        self._thin = thinnest(specs.compiled(self.arm.spec, "arm.spec"), keyframe, self.arm.tool)
        self._stands = np.concatenate([np.ones(len(self.arena.table_names), bool), self._solid()])
        if given:  # all that is the task's own is in reach
            ranges = self._levels[-1]
            moving = ranges.varying - {manipulation.START}
            unreached.warn_of_drawer(self.arena, ranges, drawer, self._nearest, moving)

    def draw_task(self, key: jax.Array, params: ArenaParams, qpos: jax.Array) -> Opened:
        start, further = qpos[self._slide], jax.random.uniform(key, (), DRAWN, LEAST, MOST)
        goal = jnp.minimum(start + further, self._most(params))
        there = tops.surfaces(params, self.arena.layout.places.ground).there[self._bottom]
        behind = self._behind(params, start, goal)
        return Opened(start, goal, there & (goal - start > NEAR) & behind.reached & behind.enters & behind.clear)

    def _most(self, params: ArenaParams) -> jax.Array:
        """() how far the drawer opens [m]."""
        own = numbers_of(self._unit, params)
        return (1 - LEFT_INSIDE) * (own["size"][0] - 2 * own["thickness"])

    def _nearest(self, params: ArenaParams) -> unreached.Behind:
        """Where a tool hooks in on the way to the nearest goal."""
        start = numbers_of(self._unit, params)["openings"][-1]
        return self._behind(params, start, jnp.minimum(start + LEAST, self._most(params)))

    def _behind(self, params: ArenaParams, start: jax.Array, goal: jax.Array) -> unreached.Behind:
        """Where a tool hooks in, anywhere along the front, on the way to a goal."""
        openings = start + _ON_THE_WAY[:, None] * jnp.maximum(goal - NEAR - start, 0.0)
        away = self._hooks(params, openings, _ALONG) - self.foot.at(params)
        distance = jnp.linalg.norm(away[..., :2], axis=-1)
        reached = self._goes.at(distance, away[..., 2]).any(-1).all()
        front, top = self._box(params, f"{self._unit.moving[-1]}_front"), self._box(params, "top")
        shut = front.pos[0] + front.half[0] - (top.pos[0] - top.half[0])  # from the unit's edge to behind the front
        least, clear = shut + self._thin, self._clear(params, start, goal)
        return unreached.Behind(reached, distance.min(), distance.max(), away[0, 0, 2], start, least, clear)

    def _solid(self) -> np.ndarray:
        """(N,) bool: boxes of other parts that no joint moves, and that are upright, as what is around a tilted one is larger."""
        others = ((part, box, part is not self._unit) for part in self._parts for box in part.nominal_boxes)
        return np.array([other and box.is_upright and box.piece not in part.moving for part, box, other in others])

    def _clear(self, params: ArenaParams, start: jax.Array, goal: jax.Array) -> jax.Array:
        """() bool: no table and no such box is where the front comes on the way to a goal."""
        front, frame = self._box(params, f"{self._unit.moving[-1]}_front"), frames(self._parts, params)[self._index]
        way = jnp.maximum(goal - NEAR - start, 0.0)
        x, z = front.pos[0] - front.half[0] - start - way / 2, front.pos[2] + front.half[2]
        top = jnp.append(frame.pos[:2] + geometry.rotate_yaw(frame.rot, jnp.stack([x, 0.0 * x])), frame.pos[2] + z)
        swept = geometry.slabs(top, frame.rot, jnp.stack([way, 2 * front.half[1], 2 * front.half[2]]))
        others, there = furniture_rules.slabs(params, self._parts)
        depth, touching = geometry.overlap(swept, geometry.slabs(*others))
        return ~((depth > touching) & there & self._stands).any()

    def _box(self, params: ArenaParams, name: str) -> Box:
        """A box of the unit, in its frame, with all drawers shut."""
        (found,) = named(self._unit.boxes(numbers_of(self._unit, params)), name)
        return found

    def _hooks(self, params: ArenaParams, opening: jax.Array, along: np.ndarray | float = 0.0) -> jax.Array:
        """(..., 3) in the world where the tool hooks in, shares of half of the front's width from its middle [m]."""
        front, frame = self._box(params, f"{self._unit.moving[-1]}_front"), frames(self._parts, params)[self._index]
        x, y = front.pos[0] + front.half[0] + BEHIND - opening, along * front.half[1]
        xy = frame.pos[:2] + geometry.rotate_yaw(frame.rot, jnp.stack(jnp.broadcast_arrays(x, y), axis=-1))
        z = frame.pos[2] + front.pos[2] + front.half[2] - BELOW
        return jnp.concatenate([xy, jnp.broadcast_to(z, (*xy.shape[:-1], 1))], axis=-1)

    def hook(self, data: mjx.Data, episode: Episode) -> tuple[jax.Array, jax.Array]:
        """(3,) point where the tool hooks in [m], and (3,) direction in which the drawer opens, in the frame of the arm's base."""
        at = self._hooks(episode.params, data.qpos[self._slide])
        out = geometry.rotate_yaw(frames(self._parts, episode.params)[self._index].rot, jnp.array([-1.0, 0.0]))
        return self.local(data, at), self.local_vector(data, jnp.append(out, 0.0))

    def observe(self, data: mjx.Data, episode: Episode) -> dict[str, jax.Array]:
        at, out = self.hook(data, episode)
        opening, task, own = data.qpos[self._slide], episode.task, numbers_of(self._unit, episode.params)
        more = jnp.stack([opening - task.start, task.goal - opening])
        state = jnp.concatenate(
            [self.proprioception(data, episode), at - self.hand(data, episode).tool.pos, out[:2], more]
        )
        hidden = jnp.stack(
            [data.qvel[self._speed], task.start, own["damping"], own["frictionloss"], own["heights"][-1]]
        )
        return {"state": state, "privileged_state": jnp.concatenate([state, hidden, own["size"]])}

    def score(
        self, data: mjx.Data, episode: Episode, action: jax.Array
    ) -> tuple[jax.Array, jax.Array, dict[str, jax.Array]]:
        at, _ = self.hook(data, episode)
        away, opening, task = at - self.hand(data, episode).tool.pos, data.qpos[self._slide], episode.task
        aside = jnp.sqrt((away[:2] ** 2).sum() + 1e-12)
        over = OVER * jnp.clip((aside - CLOSE) / (AROUND - CLOSE), 0.0, 1.0)
        distance = jnp.sqrt((away.at[2].add(over) ** 2).sum() + 1e-12)
        error, room = jnp.abs(task.goal - opening), task.goal - task.start
        success = ((error < NEAR) & (room > NEAR)).astype(jnp.float32)
        way = 1 - error / jnp.maximum(room, NEAR)
        reward = 0.4 * (1 - jnp.tanh(6 * distance)) + jnp.maximum(way, -1.0) + success - 0.005 * (action**2).sum()
        return reward, jnp.zeros((), bool), {"success": success, "distance": distance, "opening": opening}


def _before_a_unit(arm: Arm) -> Arena:
    arena = TableArena((0.24, 0.24, 0.05), table_offset=(0, 0, 0.55))
    away = 0.62 + max(0.0, arm.reach[0] - 0.22)  # what is opened comes towards the arm
    arena.add_part(
        Drawers(UNIT, pos=(away, 0, 0), size=(0.37, 0.42), heights=(0.26, 0.19, 0.15), openings=(0.0, 0.0, 0.08))
    )
    return arena


DEFAULTS = Defaults(_before_a_unit, training_ranges, 0)
