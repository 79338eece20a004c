"""Warns where an arm stands so that a task is never or seldom possible: what it takes, or puts somewhere, is out of its reach (host)."""

from collections.abc import Callable, Sequence, Set
from typing import Any, NamedTuple

import jax
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.arena import Arena
from mjx_arenas.envs.arms import covered
from mjx_arenas.envs.arms.foot import Foot
from mjx_arenas.envs.arms.graspable import SLACK
from mjx_arenas.furniture.surfaces import Surfaces
from mjx_arenas.params.params import ArenaParams, ArenaRanges, each, on_host
from mjx_arenas.problem import numbered, problem
from mjx_arenas.problems.messages import warn
from mjx_arenas.sample import tops
from mjx_arenas.sample.fixed import points
from mjx_arenas.sample.sampling import world_keys
from mjx_arenas.spec.place import Place

WORLDS = 64  # drawn where the nominal arena is not possible
_TRIED = 33  # distances between the least and the most
_MOVE = frozenset(("table_offsets", "object_tables"))  # parameters by which a surface in reach may come out of it


class Wanted(NamedTuple):
    """Where something is to be: on any of these surfaces."""

    path: str
    """The argument that says so."""
    what: str
    """What messages call it."""
    on: Callable[[ArenaParams], Sequence[int]]
    """Surfaces, by index, in a world."""
    place: Place
    """Where on them."""
    lift: float = 0.0
    """How much higher the arm must go, too [m]."""


class Away(NamedTuple):
    """How far something on a surface is from the base of an arm, and how low and high the arm goes there [m]."""

    surface: int
    near: float
    far: float
    up: float
    low: float
    high: float
    reached: bool


class Level(NamedTuple):
    """How high a surface is in the world [m], and whether a gripper on slides reaches something on it."""

    surface: int
    up: float
    reached: bool


class Behind(NamedTuple):
    """Where behind the front of a drawer a tool hooks in, from the base of an arm, and how far the drawer is open [m]."""

    reached: jax.Array
    """() bool: the arm may go there."""
    near: jax.Array
    """() seen from above."""
    far: jax.Array
    """() likewise."""
    up: jax.Array
    """() above the base."""
    opening: jax.Array
    """() at first."""
    least: jax.Array
    """() from which on a tool fits in behind the front."""
    clear: jax.Array
    """() bool: no table and no part of furniture stands in the way of the front."""

    @property
    def enters(self) -> jax.Array:
        """() bool: a tool fits in."""
        return self.opening >= self.least - SLACK


def warn_of_drawer(
    arena: Arena, ranges: ArenaRanges, drawer: str, behind: Callable[[ArenaParams], Behind], moves: Set[str]
) -> None:
    """Warns where a drawer is out of reach, shut or blocked in the nominal arena, and in more than half of some worlds of the ranges.

    Worlds are drawn where it is so in the nominal arena, or where quantities of `moves` vary.
    """
    nominal, drawn = jax.device_get(jax.jit(behind)(arena.nominal_params())), None
    fine = nominal.reached and nominal.enters and nominal.clear
    if ranges.varying & (moves if fine else ranges.varying):
        worlds = jax.vmap(lambda key: behind(arena.sample_params(key, ranges)))
        drawn = jax.device_get(jax.jit(worlds)(world_keys(0, range(WORLDS))))
    for rule, name in (("front_unreached", "reached"), ("front_shut", "enters"), ("front_blocked", "clear")):
        here, there = bool(getattr(nominal, name)), None if drawn is None else getattr(drawn, name)
        if when := _when(here, there):
            first = 0 if there is None else int(there.argmin())
            found = jax.tree.map(lambda x, i=first: x[i], drawn) if here else nominal
            told = {"drawer": drawer, "when": when, **found._asdict(), "height": _signed(float(found.up))}
            warn(problem("arena", rule, None, None, told))


def warn_of_task(foot: Foot, arena: Arena, ranges: ArenaRanges, lift: float = 0.0, goals: Sequence[int] = ()) -> None:
    """Warns where the first object is out of reach, or `lift` [m] above it is, or all surfaces for goals are.

    Worlds of the ranges are drawn where the nominal arena is out of reach, or where what carries the object may be elsewhere.
    """
    first = arena.objects[0]
    here = Wanted(
        "arena", f"object {first.name!r}", lambda params: params.object_tables[:1], first.place or Place(), lift
    )
    warn_of(foot, arena, ranges, here)
    covered.warn_of_covers(arena, foot.base, "arena", here.what, np.asarray(here.on(arena.nominal_params())).tolist())
    if len(goals):
        warn_of(foot, arena, ranges, Wanted("goals", "the goal", lambda _: goals, Place()))
        covered.warn_of_covers(arena, foot.base, "goals", "the goal", goals)


def warn_of(foot: Foot, arena: Arena, ranges: ArenaRanges, wanted: Wanted) -> None:
    """Warns where it is out of reach in the nominal arena, and in more than half of some worlds of the ranges.

    Only what certainly is counts: the surface as a whole, at the heights at which the first object may lie on it.
    """
    away, when = _out(arena, ranges, wanted, lambda params, i: _away(foot, arena, params, i, wanted))
    if not when:
        return
    first = min(away, key=lambda one: abs(one.up))
    told: dict[str, Any] = {"what": wanted.what, "surface": _label(arena, first), "near": first.near, "far": first.far}
    told |= {"height": _signed(first.up), "least": foot.reach[0], "most": foot.reach[1]}
    told |= {"from_": _signed(first.low), "to": _signed(first.high)}
    told["lift"] = f" It must go {wanted.lift:.2f} m higher than the object, too." if wanted.lift else ""
    told["when"] = when
    warn(problem(wanted.path, "never_reached", None, None, told))


def warn_of_tip(
    reach: float, heights: tuple[float, float], arena: Arena, ranges: ArenaRanges, goals: Sequence[int]
) -> None:
    """Warns where a gripper on slides does not reach the first object, or no surface for goals, as `warn_of` does.

    It goes `reach` [m] to each side of the middle of the floor along x and y, and to places between two heights [m].
    """
    first = arena.objects[0]
    place, box = first.place or Place(), f"object {first.name!r}"
    here = Wanted("arena", box, lambda params: params.object_tables[:1], place)
    for wanted in (here, Wanted("goals", "the goal", lambda _: goals, Place())):
        out, when = _out(arena, ranges, wanted, lambda params, i, w=wanted: _level(reach, heights, arena, params, i, w))
        if when:
            told = {"what": wanted.what, "when": when, "surface": _label(arena, out[0]), "up": out[0].up}
            told |= {"reach": reach, "least": heights[0], "most": heights[1]}
            warn(problem(wanted.path, "tip_unreached", None, None, told))


def _label(arena: Arena, found: Away | Level) -> str:
    """What messages call the surface."""
    return tops.label(found.surface, numbered(arena.table_names), arena.layout.places.ground)


def _out(
    arena: Arena, ranges: ArenaRanges, wanted: Wanted, away: Callable[[ArenaParams, int], Any]
) -> tuple[list[Any], str]:
    """What `away` tells of surfaces out of reach, and where these are so, in words; "": nowhere that is to be told."""
    nominal = on_host(arena.nominal_params())
    found = [away(nominal, i) for i in wanted.on(nominal)]
    here = any(one.reached for one in found)
    drawn = ranges.varying if not here else ranges.varying & _MOVE
    if not found or (here and not drawn):
        return found, ""
    worlds = _of_worlds(arena, ranges, wanted, away) if drawn else []
    there = np.array([any(one.reached for one in world) for world in worlds], bool)
    out = [one for world, ok in zip(worlds, there, strict=True) if not ok for one in world]
    return out or found, _when(here, there if drawn else None)


def _of_worlds(
    arena: Arena, ranges: ArenaRanges, wanted: Wanted, away: Callable[[ArenaParams, int], Any]
) -> list[list[Any]]:
    """What `away` tells in each of some worlds of the ranges."""
    drawn = jax.jit(jax.vmap(lambda key: arena.sample_params(key, ranges)))(world_keys(0, range(WORLDS)))
    every = on_host(drawn)
    worlds = (each(lambda x, w=w: x[w], every) for w in range(WORLDS))
    return [[away(params, i) for i in wanted.on(params)] for params in worlds]


def _level(
    reach: float, heights: tuple[float, float], arena: Arena, params: ArenaParams, surface: int, wanted: Wanted
) -> Level:
    """How high a surface is in a world, and whether slides reach anything on it."""
    below, low, high = _places(arena, params, surface, wanted)
    corners = np.array([(x, y) for x in (low[0], high[0]) for y in (low[1], high[1])])
    corners = below.top[:2] + geometry.rotate_yaw(below.rot, corners)
    there = (corners.min(0) <= reach + SLACK).all() and (corners.max(0) >= -reach - SLACK).all()
    lies, stands = _middles(params, float(below.top[2]))
    reached = there and lies <= heights[1] + SLACK and stands >= heights[0] - SLACK
    return Level(surface, float(below.top[2]), bool(reached))


def _places(arena: Arena, params: ArenaParams, surface: int, wanted: Wanted) -> tuple[Surfaces, np.ndarray, np.ndarray]:
    """A surface in a world, and the least and most x and y (2,) in its frame of places on it [m]."""
    every = tops.surfaces(params, arena.layout.places.ground)
    below = Surfaces(*(np.asarray(x)[surface] for x in every))
    inside = np.maximum(below.size / 2 - wanted.place.margin, 0.0)
    low, high = np.clip(np.asarray(wanted.place.region) * (below.size / 2), -inside, inside)
    return below, low, high


def _middles(params: ArenaParams, up: float) -> tuple[float, float]:
    """The least and the greatest height of the first object's middle on a surface at this height [m]; it may lie on any of its sides."""
    size = np.asarray(params.object_full_sizes[0])
    return up + float(size.min()) / 2, up + float(size.max()) / 2


def _away(foot: Foot, arena: Arena, params: ArenaParams, surface: int, wanted: Wanted) -> Away:
    """How far the nearest and furthest places on a surface are in a world."""
    below, low, high = _places(arena, params, surface, wanted)
    base = np.asarray(foot.at(params), float)
    local = geometry.rotate_yaw(-below.rot, base[:2] - below.top[:2])
    near = np.linalg.norm(np.maximum(0.0, np.maximum(low - local, local - high)))
    far = np.linalg.norm(np.maximum(np.abs(low - local), np.abs(high - local)))
    told = near, far
    if wanted.place.near is not None:
        least, most = _from_foot(arena, params, base[:2], wanted.place)
        near, far = max(near, least), min(far, most)
    up = float(below.top[2] - base[2])
    least, most = max(near, foot.reach[0] - SLACK), min(far, foot.reach[1] + SLACK)
    there = least <= most
    distances = np.linspace(least, most, _TRIED) if there else foot.heights.distances
    low, high = (np.interp(distances, foot.heights.distances, x) for x in (foot.heights.low, foot.heights.high))
    lies, stands = _middles(params, up)
    reached = there & (low - SLACK <= stands) & (lies + wanted.lift <= high + SLACK)
    near, far = (
        (near, far) if near <= far else told
    )  # of the whole surface, where nothing on it is as near as the place asks
    return Away(surface, float(near), float(far), up, float(low.min()), float(high.max()), bool(reached.any()))


def _from_foot(arena: Arena, params: ArenaParams, base: np.ndarray, place: Place) -> tuple[float, float]:
    """The least and the greatest distance from a foot (2,) at which the first object may be, as near as it stays to something else [m]."""
    places, (low, high) = arena.layout.places, place.distance
    aside = float(np.linalg.norm(np.asarray(points(places.near, places.ground, params))[0] - base))
    return max(aside - high, low - aside), aside + high


def _when(here: bool, there: np.ndarray | None) -> str:
    """In words, where something is not so: nominally, or in more than half of worlds that were drawn, if some were; "": nowhere else."""
    nominal = "" if here else "in the nominal arena"
    if there is None:
        return nominal
    out = int((~there).sum())
    drawn = f"in {'all' if out == WORLDS else out} of {WORLDS} worlds that were drawn"
    return ", and ".join(filter(None, (nominal, drawn))) if 2 * out > WORLDS else ""


def _signed(height: float) -> str:
    """A height above or below the base, in words."""
    return f"{abs(height):.2f} m {'below' if height < 0 else 'above'}"
