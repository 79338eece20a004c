"""Goals on the surfaces of an arena: where they may be, and the disc that shows them."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import geometry, quaternions
from mjx_arenas.arena import Arena
from mjx_arenas.furniture.surfaces import Surfaces
from mjx_arenas.keywords import nearest
from mjx_arenas.params.distribution import DRAWN
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error
from mjx_arenas.sample import placement, tops

GOAL_RADIUS = 0.05  # [m] of success
_NAME = "goal"


def add_disc(spec: mujoco.MjSpec) -> None:
    """Adds the disc that shows a goal on a surface."""
    _add(spec, mujoco.mjtGeom.mjGEOM_CYLINDER, (GOAL_RADIUS, 0.001, 0))


def add_ball(spec: mujoco.MjSpec, radius: float) -> None:
    """Adds the ball that shows a goal in the air; its radius is in [m]."""
    _add(spec, mujoco.mjtGeom.mjGEOM_SPHERE, (radius, 0, 0))


def _add(spec: mujoco.MjSpec, kind: mujoco.mjtGeom, size: tuple[float, float, float]) -> None:
    """Adds what shows a goal, the mocap body "goal"."""
    if spec.body(_NAME) is not None:
        raise error([problem("arena", "goal_body", None, _NAME)])
    goal, green = spec.worldbody.add_body(name=_NAME, mocap=True), (0, 0.62, 0.45, 0.8)
    goal.add_geom(type=kind, size=size, rgba=green, contype=0, conaffinity=0)


def marked(arena: Arena, data: mjx.Data, pos: jax.Array) -> mjx.Data:
    """The data with what shows the goal at a place (3,) [m]; other mocap bodies stay."""
    row = int(arena.mj_model.body(_NAME).mocapid[0])
    return data.replace(mocap_pos=data.mocap_pos.at[row].set(pos))


def middle(arena: Arena, params: ArenaParams, qpos: jax.Array) -> jax.Array:
    """(3,) middle of the first object where it is at `qpos` (nq,), in the world [m]; its origin may be elsewhere."""
    at = arena.layout.object_qpos[0]
    center = jnp.asarray(placement.body_centers(arena.layout.places, params)[0], qpos.dtype)
    return qpos[at[:3]] + quaternions.quat_rotate(quaternions.normalize(qpos[at[3:]]), center)


def middle_velocity(arena: Arena, params: ArenaParams, data: mjx.Data) -> jax.Array:
    """(3,) velocity of the middle of the first object in the world [m/s]; its joint turns in its own frame, about its origin."""
    v = arena.mj_model.joint(arena.objects[0].joint).dofadr[0]
    center = jnp.asarray(placement.body_centers(arena.layout.places, params)[0], data.qvel.dtype)
    quat = quaternions.normalize(data.qpos[arena.layout.object_qpos[0, 3:]])
    return data.qvel[v : v + 3] + quaternions.quat_rotate(quat, jnp.cross(data.qvel[v + 3 : v + 6], center))


def surface_indices(arena: Arena, goals: str | Sequence[str] | None) -> np.ndarray:
    """(G,) of the tables and surfaces of this name or these names, which are no objects; None: of the second.

    Raises:
        ValueError: there is none of a name, or no name.
    """
    names, objects = arena.surfaces, [one.name for one in arena.objects]
    fixed = [name for name in names if name not in objects]  # where an object stands is drawn
    if goals is None and len(fixed) < 2:
        has = f"one, {fixed[0]!r}" if fixed else "none"
        raise error([problem("arena", "second_surface", None, Told(has))])
    given = fixed[1:2] if goals is None else [goals] if isinstance(goals, str) else goals
    chosen = list(given) if isinstance(given, (Sequence, np.ndarray)) else []
    unknown = [name for name in chosen if name not in fixed]
    if unknown or not chosen:
        name = str(unknown[0]) if unknown else ""
        of_part = next((one for one in fixed if name and one.startswith(f"{name}_")), None)
        close = of_part or nearest(name, fixed)
        told = {"close": close, "must": f"one or more of {', '.join(map(repr, fixed))}"}
        raise error([problem("goals", "goals_meant" if close else "must", None, unknown or given, told)])
    return np.array([names.index(name) for name in chosen])


def surface(arena: Arena, params: ArenaParams, index: Any) -> Surfaces:
    """One of the arena's tables and surfaces in a world."""
    found = tops.surfaces(params, arena.layout.places.ground).of(jnp.asarray(index)[None])
    return jax.tree.map(lambda x: x[0], found)


class Other(NamedTuple):
    """A surface for a goal."""

    surface: Surfaces
    frictions: (
        jax.Array
    )  # (2,) sliding friction of what carries the object and of this surface (`friction_on`), for a critic
    free: jax.Array  # () bool: it is there, and does not carry the object


def other_surface(key: jax.Array, arena: Arena, params: ArenaParams, goals: np.ndarray) -> Other:
    """One of these (G,) surfaces that is there and does not carry the first object; any of them, if there is none."""
    free = tops.surfaces(params, arena.layout.places.ground).there[goals] & (goals != params.object_tables[0])
    weights = jnp.where(free.any(), free, True).astype(params.table_rots.dtype)
    index = jax.random.choice(key, jnp.asarray(goals), p=weights / weights.sum())
    frictions = jnp.concatenate([friction_on(params, on) for on in (params.object_tables[0], index)])
    return Other(surface(arena, params, index), frictions, free.any())


def friction_on(params: ArenaParams, index: Any) -> jax.Array:
    """(1,) sliding friction of the table of an index, for a critic; of another surface 0."""
    of_tables = params.table_frictions[:, 0]
    return jnp.where(jnp.arange(len(of_tables)) == index, of_tables, 0.0).sum()[None]


def spot(key: jax.Array, below: Surfaces, margin: jax.Array | float, n: tuple[int, ...] = ()) -> jax.Array:
    """(*n, 2) random places on a surface, in its frame, `margin` [m] inside its edges; the middle of one that is too small."""
    half = jnp.maximum(below.size / 2 - margin, 0.0)
    return jax.random.uniform(key, (*n, 2), DRAWN, -half, half)


def goal_at(below: Surfaces, xy: jax.Array) -> jax.Array:
    """(3,) the goal at a place (2,) in the frame of a surface, in the world [m]."""
    return jnp.append(below.top[:2] + geometry.rotate_yaw(below.rot, xy), below.top[2])


def surface_numbers(below: Surfaces) -> list[jax.Array]:
    """Seven numbers of a surface, for a critic: its place, the sine and cosine of its yaw, and its size."""
    return [below.top, jnp.array([jnp.sin(below.rot), jnp.cos(below.rot)]), below.size]
