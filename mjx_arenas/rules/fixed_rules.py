"""Tables and parts are apart from what is fixed in an arena beside them, and above its floor: R tables, then boxes of parts."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mjx_arenas import geometry
from mjx_arenas.furniture import standing, surfaces
from mjx_arenas.geometry import Array, Slabs, array_module
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.rules import furniture_rules
from mjx_arenas.rules.rule import Rule, Rules
from mjx_arenas.sample import fixed as fixed_


def overlapping(params: ArenaParams, rules: Rules) -> np.ndarray:
    """(R, B + F) bool: overlap in a world, whether or not they are there; on the host."""
    if not len(fixed_.names(rules.fixed, rules.follows)):
        return np.zeros((len(furniture_rules.slabs(params, rules.furniture)[1]), 0), bool)
    depth, touching, _ = _depths(params, rules)
    return (depth > touching) & counted(params, rules)


def counted(params: ArenaParams, rules: Rules) -> np.ndarray:
    """(R, B + F) bool: neither carries the other; and of tables, not with a robot's base, on which actuators move something.

    What is in the frame of a part, such as a robot beside it, is not on it: the part may grow to where that is.
    """
    fixed, n = rules.fixed, len(params.table_rots)
    names, parts = surfaces.names(["" for _ in range(n)], rules.furniture), rules.furniture
    n_tops = len(names) + len(rules.carriers)
    part_of = [standing.carrier(name, parts)[0] for name in names[n:]]
    rows = np.concatenate([np.arange(n), n + np.array(standing.owners(parts), int)])  # table t, or n + part p
    below = np.concatenate(
        [np.arange(n), n + np.array(part_of, int), np.full(n_tops - len(names) + len(parts) + 1, -1)]
    )
    below = np.concatenate([below[fixed.on], np.array([one.table for one in rules.follows], int)])
    harmless = np.concatenate([fixed.carries, np.zeros(len(rules.follows), bool)])
    return (rows[:, None] != below[None]) & ~((rows < n)[:, None] & harmless[None])


def sunk(params: ArenaParams, rules: Rules) -> np.ndarray:
    """(P,) bool: parts that stand below the floor in a world, there or not; on the host."""
    if not rules.furniture or fixed_.floor(rules.fixed, params) is None:
        return np.zeros(len(rules.furniture), bool)
    below, level, _ = _below(params, rules)
    return below > level


def low(params: ArenaParams, rules: Rules) -> np.ndarray:
    """(T,) bool: tables whose top is below the floor in a world, there or not; on the host."""
    if not rules.n_tables or fixed_.floor(rules.fixed, params) is None:
        return np.zeros(rules.n_tables, bool)
    below, level = _tops_below(params, rules)
    return below > level


def owners(rules: Rules) -> list[int]:
    """(R,) which part each row is of; -1: of none, a table."""
    return [-1] * rules.n_tables + standing.owners(rules.furniture)


def pair_told(pair: Sequence[int], params: ArenaParams, rules: Rules) -> dict[str, Any]:
    """What the sentence says of two that overlap."""
    first, second = pair
    part, n = owners(rules)[first], rules.n_tables
    box = "" if part < 0 else standing.names(rules.furniture)[first - n]
    who = f"Table {rules.called[first]}" if part < 0 else f"Part {rules.furniture[part].name!r} ({box!r})"
    depth = _depths(params, rules)[0][first, second]
    return {"first": who, "second": fixed_.names(rules.fixed, rules.follows)[second], "depth": depth}


def sunk_told(part: int, params: ArenaParams, rules: Rules) -> dict[str, Any]:
    """What the sentence says of a part below the floor."""
    return {"what": f"Part {rules.furniture[part].name!r} stands", "depth": _below(params, rules)[0][part]}


def low_told(table: int, params: ArenaParams, rules: Rules) -> dict[str, Any]:
    """What the sentence says of a top below the floor."""
    return {"what": f"The top of table {rules.called[table]!r} is", "depth": _tops_below(params, rules)[0][table]}


def _apart(p: ArenaParams, r: Rules) -> Array:
    """() bool: nothing that is there is in what is fixed, but by intent."""
    if r.inside is None or not r.inside.size or r.inside.all():
        return np.True_
    return ~_wrong(p, r).any()


def _wrong(p: ArenaParams, r: Rules) -> Array:
    assert r.inside is not None
    depth, touching, there = _depths(p, r)
    return (depth > touching) & there & ~r.inside


def _depths(p: ArenaParams, r: Rules) -> tuple[Array, Array, Array]:
    """(R, B + F) how deep each is in each [m], up to where two only touch, and whether both are there."""
    (top, rot, size), there = furniture_rules.slabs(p, r.furniture)
    others = fixed_.standing_of(r.fixed, r.follows, r.ground, p)
    one = geometry.slabs(top[:, None], rot[:, None], size[:, None])
    other = geometry.slabs(others.top[None], others.rot[None], others.full_size[None])
    depth, touching = geometry.overlap(one, other)
    round_ = np.concatenate([r.fixed.round, np.zeros(len(r.follows), bool)])
    if round_.any():
        depth = array_module(depth).where(round_, _in_disc(one, other), depth)
    return depth, touching, there[:, None] & others.there[None]


def _in_disc(one: Slabs, other: Slabs) -> Array:
    """How deep boxes are in upright cylinders, which have the radius `half[0]` (...) [m]; 0 or less: apart."""
    xp = array_module(one.cos)
    dx, dy, dz = (a - b for a, b in zip(one.middle, other.middle, strict=True))
    along, across = abs(dx * one.cos + dy * one.sin), abs(dy * one.cos - dx * one.sin)
    away = xp.hypot(xp.maximum(along - one.half[0], 0.0), xp.maximum(across - one.half[1], 0.0))
    return xp.minimum(other.half[0] - away, one.half[2] + other.half[2] - abs(dz))


def _below(p: ArenaParams, r: Rules) -> tuple[Array, Array, Array]:
    """(P,) how far parts stand below the floor [m], what rounding explains, and which of them are there."""
    level = fixed_.floor(r.fixed, p)
    assert level is not None
    frames, xp = standing.frames(r.furniture, p), array_module(p.table_rots)
    heights = xp.stack([frame.pos[2] for frame in frames])
    return *_depth(heights, level), xp.stack([xp.asarray(frame.there) for frame in frames])


def _tops_below(p: ArenaParams, r: Rules) -> tuple[Array, Array]:
    """(T,) how far tops are below the floor [m], and what rounding explains."""
    level = fixed_.floor(r.fixed, p)
    assert level is not None
    return _depth(p.table_offsets[:, 2], level)


def _depth(heights: Array, level: Array) -> tuple[Array, Array]:
    """How far heights are below the floor [m], and what rounding explains."""
    floor = array_module(heights).asarray(level, heights.dtype)
    return floor - heights, geometry.TOUCHING * (abs(heights) + abs(floor) + 1.0)


def _above(p: ArenaParams, r: Rules) -> Array:
    """() bool: nothing that is there is below the floor, but by intent."""
    if r.sunk is None or r.sunk.all() or fixed_.floor(r.fixed, p) is None:  # of no parts, too
        return np.True_
    below, level, there = _below(p, r)
    return ~((below > level) & there & ~r.sunk).any()


def _tops_above(p: ArenaParams, r: Rules) -> Array:
    """(T,) bool: its top is above the floor, or it is not there, or it is so by intent."""
    if r.low is None or r.low.all() or fixed_.floor(r.fixed, p) is None:  # of no tables, too
        return np.ones(1, bool)
    below, level = _tops_below(p, r)
    return (below <= level) | ~p.table_active | r.low


def _apart_told(p: ArenaParams, r: Rules, _: Any) -> Mapping[str, Any]:
    """What the message says about the first pair."""
    first, second = np.argwhere(np.asarray(_wrong(p, r)))[0]
    return pair_told((int(first), int(second)), p, r)


def _above_told(p: ArenaParams, r: Rules, _: Any) -> Mapping[str, Any]:
    """What the message says about the first one."""
    below, level, there = _below(p, r)
    return sunk_told(int(np.flatnonzero((below > level) & there & ~np.asarray(r.sunk))[0]), p, r)


APART = Rule("fixed_overlap", "params", "world", (), _apart, _apart_told, shown=True)
ABOVE = Rule("below_floor", "params", "world", (), _above, _above_told, shown=True)
TOPS_ABOVE = Rule(
    "below_floor", "params", "table", ("table_offsets",), _tops_above, lambda p, r, t: low_told(t, p, r), shown=True
)
