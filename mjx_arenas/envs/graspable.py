"""The objects that a gripper takes from above: by the smaller of their horizontal extents, as they lie."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas.arena import Arena
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import warn
from mjx_arenas.rules.validation_ranges import reach
from mjx_arenas.sample.placement import lies
from mjx_arenas.sample.variants import nearest, which
from mjx_arenas.shapes import PRIMITIVES

SLACK = 1e-4  # [m] for single precision


def taken(arena: Arena, params: ArenaParams, width: float) -> jax.Array:
    """() bool: the first object is there, and not wider than `width` [m] along both of its axes; jit, vmap.

    The shape of a file may have a narrower part, a handle, and so it may be as wide as it likes.
    """
    places = arena.layout.places
    primitive = jnp.asarray(places.kind[0] in PRIMITIVES)
    for one in places.variants:
        if one.object == 0:
            primitive = jnp.asarray(np.isin(one.kind, PRIMITIVES))[which(one, params.terms)]
    narrow = lies(places, params).full_size[0, :2].min() <= width + SLACK
    return params.object_active[0] & (narrow | ~primitive)


def warn_of_wide(arena: Arena, ranges: ArenaRanges, width: float) -> None:
    """Warns where the first object can be too wide for a gripper that takes `width` [m], so that episodes are not possible (host)."""
    if arena.objects[0].pose != "upright":
        return
    varied = ranges.object_full_sizes
    for name, kind, size in _shapes(arena, ranges):
        if kind in PRIMITIVES and min(size[:2]) > width + SLACK:
            can, path = ("is", "objects") if varied is None else ("can be", "ranges.object_full_sizes")
            told = {"width": width, "can": can, "dist": "", "size": size[:2]}
            warn(problem(path, "too_wide", ("object", name), None, told))


def warn_of_object(arena: Arena, ranges: ArenaRanges, width: float) -> None:
    """Warns where the first object is never there, or too wide."""
    warn_of_absent(arena, ranges)
    warn_of_wide(arena, ranges, width)


def warn_of_absent(arena: Arena, ranges: ArenaRanges) -> None:
    """Warns where the first object, which a task is about, is switched off in all worlds (host)."""
    dist, active = ranges.object_active, np.asarray(arena.nominal_params().object_active, bool)
    if not (active if dist is None else reach(dist, active)[1])[0]:
        path, name = "arena" if dist is None else "ranges.object_active", arena.objects[0].name
        warn(problem(path, "off_in_task", ("object", name)))


def warn_of_cone(option: mujoco.MjOption) -> None:
    """Warns of a pyramidal friction cone, with which objects slip out of fingers."""
    if option.cone != mujoco.mjtCone.mjCONE_ELLIPTIC:
        warn(problem("arena.spec.option.cone", "slips"))


def _shapes(arena: Arena, ranges: ArenaRanges) -> list[tuple[str, str, np.ndarray]]:
    """Name, kind and largest size (3,) [m] of the first object, or of those of its variants that ranges leave."""
    first, nominal = arena.objects[0], arena.nominal_params()
    variants = next((one for one in arena.layout.places.variants if one.object == 0), None)
    if variants is None:
        largest, varied = np.asarray(nominal.object_full_sizes), ranges.object_full_sizes
        return [(first.name, first.kind, largest[0] if varied is None else reach(varied, largest)[1][0])]
    number, varied = np.asarray(nominal.terms[variants.quantity]), ranges.terms.get(variants.quantity)
    low, high = (number, number) if varied is None else reach(varied, number)
    least, most = (int(nearest(x[0], len(variants.names))) for x in (low, high))
    slots = zip(first.slots, variants.kind.tolist(), variants.full_size, strict=True)
    return [(slot.name, kind, size) for slot, kind, size in slots][least : most + 1]
