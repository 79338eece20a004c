"""Where the base of an arm is in each world, and what the arm reaches from there."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas.arena import Arena
from mjx_arenas.envs.arms.arm import Arm
from mjx_arenas.envs.arms.heights import Heights, heights
from mjx_arenas.envs.arms.moves import Moves
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.sample.fixed import Near, levels, points
from mjx_arenas.sample.tops import Ground


class Foot(NamedTuple):
    """An arm's base, and the places that it reaches with its tool pointing down (host)."""

    base: str
    """Name of its body."""
    near: Near
    ground: Ground
    above: float
    """Its height above its `levels` [m]."""
    reach: tuple[float, float]
    heights: Heights

    @classmethod
    def of(cls, arena: Arena, base: str, arm: Arm, moves: Moves) -> "Foot":
        """The foot of an arm whose base is the body `base` of a compiled arena, and whose joints move as `moves.moves` says."""
        near, ground, model = arena.layout.near([("arm.base", None, base)]), arena.layout.places.ground, arena.mj_model
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        nominal = jax.tree.map(np.asarray, arena.nominal_params())
        above = data.body(base).xpos[2] - levels(near, ground, nominal)[0]
        return cls(base, near, ground, float(above), arm.reach, heights(arm, moves))

    def at(self, params: ArenaParams) -> jax.Array:
        """(3,) where it is in a world [m]; jit, vmap."""
        xy, level = points(self.near, self.ground, params)[0], levels(self.near, self.ground, params)[0]
        return jnp.append(xy, level + self.above)

    def beyond(self, params: ArenaParams, pos: jax.Array) -> jax.Array:
        """(...) how far from the distances that it reaches places (..., 3) of the world are, > 0 out of reach [m]; jit, vmap.

        It is at least 1 m where the tool does not go as high or as low as the place.
        """
        base = self.at(params)
        distance = jnp.linalg.norm(pos[..., :2] - base[:2], axis=-1)
        aside = jnp.maximum(self.reach[0] - distance, distance - self.reach[1])
        level = self.heights.within(distance, pos[..., 2] - base[2])
        return jnp.where(level, aside, jnp.maximum(aside, 0.0) + 1.0)
