"""Open a drawer, of units of other sizes and heights, with an arm."""

from collections.abc import Mapping
from typing import Any, NamedTuple, Unpack

import jax
import jax.numpy as jnp
from ml_collections import config_dict
from mujoco import mjx

from mjx_arenas import geometry
from mjx_arenas.arena import Arena
from mjx_arenas.envs.arms.arm import Arm
from mjx_arenas.envs.base import Episode
from mjx_arenas.envs.tasks import manipulation
from mjx_arenas.envs.tasks.manipulation import ArmTask, Given, Own
from mjx_arenas.furniture.drawers import LEFT_INSIDE, Drawers
from mjx_arenas.furniture.standing import frames, numbers_of
from mjx_arenas.params.distribution import DRAWN
from mjx_arenas.params.distributions import LogUniform, Uniform
from mjx_arenas.params.params import ArenaParams, ArenaRanges
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
    """Ranges of stiff units that are turned further, higher or lower than in training. The arm starts further from home."""
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


class OpenDrawer(ArmTask):
    """An arm opens the uppermost drawer of a unit, which is a little open, to within 2 cm of a random opening.

    Drawers have no handles. The tool hooks in behind the front, 2.5 cm from it and 2 cm below its upper edge.

    The policy sees the arm, the way from the tool to that point, which way the unit faces, and how far the drawer is open and still to be
    opened, in the frame of the arm's base. The critic also sees sizes, damping and friction.

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
        ValueError: the arena has no such unit, or its drawers may be absent.
    """

    def __init__(
        self,
        config: config_dict.ConfigDict | None = None,
        config_overrides: Mapping[str, Any] | None = None,
        unit: str = UNIT,
        **given: Unpack[Given],
    ) -> None:
        super().__init__(OWN, config or default_config(), config_overrides, **given)
        self._parts = self.arena.layout.places.furniture
        units = {i: part for i, part in enumerate(self._parts) if isinstance(part, Drawers)}
        names = [part.name for part in units.values()]
        if not names:
            raise ValueError(f"`arena` must have drawers to open: arena.add_part(furniture.Drawers({UNIT!r}, ...)).")
        if unit not in names:
            raise ValueError(f"`unit` must be the name of drawers of the arena, {', '.join(names)}, got {unit!r}.")
        for name in sorted({f"{unit}.active", f"{unit}.pieces_active"} & self._varying):
            raise ValueError(f"`ranges.terms` must not have {name!r}: the drawer that is to be opened is always there.")
        self._index = list(units)[names.index(unit)]
        self._unit, model = units[self._index], self.arena.mj_model
        joint = model.joint(f"{unit}_{self._unit.moving[-1]}")
        self._slide, self._speed = joint.qposadr[0], joint.dofadr[0]

    def draw_task(self, key: jax.Array, params: ArenaParams, qpos: jax.Array) -> Opened:
        own = numbers_of(self._unit, params)
        start, thick = qpos[self._slide], own["thickness"]
        most = (1 - LEFT_INSIDE) * (own["size"][0] - 2 * thick)
        further = jax.random.uniform(key, (), DRAWN, LEAST, MOST)
        return Opened(start, jnp.minimum(start + further, most))

    def hook(self, data: mjx.Data, episode: Episode) -> tuple[jax.Array, jax.Array]:
        """(3,) point where the tool hooks in [m], and (3,) direction in which the drawer opens, in the frame of the arm's base."""
        own, frame = numbers_of(self._unit, episode.params), frames(self._parts, episode.params)[self._index]
        (front,) = (box for box in self._unit.boxes(own) if box.name == f"{self._unit.moving[-1]}_front")
        x = front.pos[0] + front.half[0] + BEHIND - data.qpos[self._slide]
        z = frame.pos[2] + front.pos[2] + front.half[2] - BELOW
        xy = frame.pos[:2] + geometry.rotate_yaw(frame.rot, jnp.stack([x, jnp.zeros_like(x)]))
        out = geometry.rotate_yaw(frame.rot, jnp.array([-1.0, 0.0]))
        return self.local(data, jnp.append(xy, z)), self.local_vector(data, jnp.append(out, 0.0))

    def observe(self, data: mjx.Data, episode: Episode) -> dict[str, jax.Array]:
        at, out = self.hook(data, episode)
        opening, task, own = data.qpos[self._slide], episode.task, numbers_of(self._unit, episode.params)
        more = jnp.stack([opening - task.start, task.goal - opening])
        state = jnp.concatenate([self.proprioception(data), at - self.hand(data).tool.pos, out[:2], more])
        hidden = jnp.stack(
            [data.qvel[self._speed], task.start, own["damping"], own["frictionloss"], own["heights"][-1]]
        )
        return {"state": state, "privileged_state": jnp.concatenate([state, hidden, own["size"]])}

    def score(
        self, data: mjx.Data, episode: Episode, action: jax.Array
    ) -> tuple[jax.Array, jax.Array, dict[str, jax.Array]]:
        at, _ = self.hook(data, episode)
        away, opening, task = at - self.hand(data).tool.pos, data.qpos[self._slide], episode.task
        aside = jnp.sqrt((away[:2] ** 2).sum() + 1e-12)
        over = OVER * jnp.clip((aside - CLOSE) / (AROUND - CLOSE), 0.0, 1.0)
        distance = jnp.sqrt((away.at[2].add(over) ** 2).sum() + 1e-12)
        error = jnp.abs(task.goal - opening)
        success = (error < NEAR).astype(jnp.float32)
        way = 1 - error / (task.goal - task.start)
        reward = 0.4 * (1 - jnp.tanh(6 * distance)) + jnp.maximum(way, -1.0) + success - 0.005 * (action**2).sum()
        return reward, jnp.zeros((), bool), {"success": success, "distance": distance, "opening": opening}


def _before_a_unit(arm: Arm) -> Arena:
    arena = TableArena((0.24, 0.24, 0.05), table_offset=(0, 0, 0.55))
    away = 0.62 + max(0.0, arm.reach[0] - 0.22)  # what is opened comes towards the arm
    arena.add_part(
        Drawers(UNIT, pos=(away, 0, 0), size=(0.37, 0.42), heights=(0.26, 0.19, 0.15), openings=(0.0, 0.0, 0.08))
    )
    return arena


OWN = Own(_before_a_unit, training_ranges, 0)
