"""Which objects a gripper takes from above: by the smaller of their horizontal extents, as they lie."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas.arena import Arena
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import warn
from mjx_arenas.rules import validation_ranges
from mjx_arenas.sample.placement import lies
from mjx_arenas.sample.variants import which
from mjx_arenas.shapes import PRIMITIVES

_SLACK = 1e-4  # [m] for single precision


def taken(arena: Arena, params: ArenaParams, width: float) -> jax.Array:
    """() bool: the first object is there, and not wider than `width` [m] along both of its axes; jit, vmap.

    The shape of a file may have a narrower part, a handle, and so it may be as wide as it likes.
    """
    places = arena.layout.places
    primitive = jnp.asarray(places.kind[0] in PRIMITIVES)
    for one in places.variants:
        if one.object == 0:
            primitive = jnp.asarray(np.isin(one.kind, PRIMITIVES))[which(one, params.terms)]
    narrow = lies(places, params).full_size[0, :2].min() <= width + _SLACK
    return params.object_active[0] & (narrow | ~primitive)


def within(place: jax.Array, base: jax.Array, reach: tuple[float, float]) -> jax.Array:
    """() bool: a place (2,) is as far from a base (2,) as `reach` allows, least and most [m]; jit, vmap."""
    distance = jnp.linalg.norm(place - base)
    return (distance >= reach[0] - _SLACK) & (distance <= reach[1] + _SLACK)


def warn_of_wide(arena: Arena, ranges: ArenaRanges, width: float) -> None:
    """Warns where the first object can be too wide for a gripper that takes `width` [m], so that episodes are not possible (host)."""
    first, sizes = arena.objects[0], np.asarray(arena.nominal_params().object_full_sizes)
    varied = ranges.object_full_sizes
    told: dict[str, Any] = {"width": width, "can": "is" if varied is None else "can be", "dist": ""}
    path = "objects" if varied is None else "ranges.object_full_sizes"
    largest = sizes if varied is None else validation_ranges.reach(varied, sizes)[1]
    for one in (first, *first.slots):
        size = largest[0] if one is first else np.broadcast_to(np.asarray(one.full_size, float), 3)
        if one.kind in PRIMITIVES and one.pose == "upright" and min(size[:2]) > width + _SLACK:
            warn(problem(path, "too_wide", ("object", one.name), None, {**told, "size": size[:2]}))
