"""What furniture must be in a world: possible in itself, and apart from tables and other furniture."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mjx_arenas import geometry
from mjx_arenas.furniture import standing
from mjx_arenas.furniture.part import Condition, Part
from mjx_arenas.geometry import Array
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import rounded
from mjx_arenas.rules.rule import Rule, Rules


def conditions(rules: Rules) -> list[Rule]:
    """What the numbers of each part must be together."""

    def rule(part: Part, condition: Condition) -> Rule:
        def holds(p: ArenaParams, r: Rules) -> Array:
            return condition.holds(standing.numbers_of(part, p))

        def told(p: ArenaParams, r: Rules, i: Any) -> Mapping[str, Any]:
            numbers = standing.numbers_of(part, p)
            got = rounded(np.asarray(numbers[condition.of]), 6)
            return {"got": got, **condition.told({name: np.asarray(x) for name, x in numbers.items()})}

        return Rule("condition", f"terms.{part.name}.{condition.of}", "world", (), holds, told)

    return [rule(part, condition) for part in rules.furniture for condition in part.conditions]


def overlapping(params: ArenaParams, furniture: tuple[Part, ...]) -> np.ndarray:
    """(T + N, T + N) bool: boxes of different parts, or of a part and a table, overlap, whether or not they are there; on the host."""
    if not furniture:
        return np.zeros((0, 0), bool)
    of_all, _ = slabs(params, furniture)
    depth, touching = geometry.overlaps(*of_all)
    return (depth > touching) & _of_two(params, furniture)


def depths(top: Array, rot: Array, full_size: Array, pair: tuple[int, int]) -> dict[str, Any]:
    """How far two slabs that overlap are in each other, seen from above and in height [m].

    Moved apart by one of the two, these slabs are not; other slabs of the same parts may be.
    """
    one, other = geometry.corners(top, rot, full_size)[list(pair)]
    sides = np.concatenate([np.diff(one[:3], axis=0), np.diff(other[:3], axis=0)])
    along = (sides / np.linalg.norm(sides, axis=1, keepdims=True)).T
    a, b = one @ along, other @ along  # (4, 4) corners along the sides of both
    (high, above), (thick, thicker) = (x[list(pair), 2] for x in (top, full_size))
    return {
        "across": np.minimum(a.max(0) - b.min(0), b.max(0) - a.min(0)).min(),
        "height": min(high - above + thicker, above - high + thick),
    }


def overlaps_of_last(params: ArenaParams, furniture: tuple[Part, ...], tables: Sequence[int]) -> list[dict[str, Any]]:
    """What the sentence says of the last part and each table and other part that it overlaps, there or not; on the host."""
    of_all, _ = slabs(params, furniture)
    n, owners = len(params.table_rots), standing.owners(furniture)
    of = [*range(-n, 0), *owners]
    found: dict[int, dict[str, Any]] = {}
    for first, second in np.argwhere(np.triu(overlapping(params, furniture))).tolist():
        if of[second] == len(furniture) - 1:
            found.setdefault(of[first], told(params, furniture, of_all, (first, second), tables))
    return list(found.values())


def told(
    params: ArenaParams,
    furniture: tuple[Part, ...],
    slabs: tuple[Array, Array, Array],
    pair: tuple[int, int],
    tables: Sequence[int],
) -> dict[str, Any]:
    """What the sentence says of two that overlap, of which the first may be a table."""
    n, boxes, owners = len(params.table_rots), standing.names(furniture), standing.owners(furniture)
    first, second = (f"table {tables[i]}" if i < n else f"part {furniture[owners[i - n]].name!r}" for i in pair)
    named = [repr(boxes[i - n]) for i in pair if i >= n]
    what = {"first": first[:1].upper() + first[1:], "second": second}
    return what | {"pair": f"{' and '.join(named)} " if len(named) > 1 else f"{named[0]} "} | depths(*slabs, pair)


def _apart(p: ArenaParams, r: Rules) -> Array:
    """() bool: no two things that are there overlap, but by intent."""
    if not r.furniture:
        return np.True_
    return ~_wrong(p, r).any()


def _wrong(p: ArenaParams, r: Rules) -> Array:
    of_all, there = slabs(p, r.furniture)
    depth, touching = geometry.overlaps(*of_all)
    intended = np.zeros((len(there), len(there)), bool) if r.touching is None else r.touching
    return (depth > touching) & there[:, None] & there[None] & _of_two(p, r.furniture) & ~intended


def _of_two(params: ArenaParams, furniture: tuple[Part, ...]) -> np.ndarray:
    """(T + N, T + N) bool: boxes of two parts, or of a part and a table; pairs of tables have a rule of their own."""
    n = len(params.table_rots)
    of = np.concatenate([np.full(n, -1), standing.owners(furniture)])
    return of[:, None] != of[None]


def slabs(p: ArenaParams, furniture: tuple[Part, ...]) -> tuple[tuple[Array, Array, Array], Array]:
    """Tops, yaws and sizes of tables, then of boxes, and which of them are there (T + N,)."""
    xp, boxes = geometry.array_module(p.table_rots), standing.standing(furniture, p)
    pairs = ((p.table_offsets, boxes.top), (p.table_rots, boxes.rot), (p.table_full_sizes, boxes.full_size))
    top, rot, size, there = map(xp.concatenate, (*pairs, (p.table_active, boxes.there)))
    return (top, rot, size), there


def _told(p: ArenaParams, r: Rules, _: Any) -> Mapping[str, Any]:
    """What the message says about the first pair."""
    first, second = np.argwhere(np.asarray(_wrong(p, r)))[0]
    of_all, _ = slabs(p, r.furniture)
    return told(p, r.furniture, of_all, (int(first), int(second)), r.called)


APART = Rule("parts_overlap", "params", "world", (), _apart, _told, shown=True)
