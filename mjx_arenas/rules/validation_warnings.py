"""Warnings of arguments and ranges that are possible, and hardly meant (host)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mjx_arenas import geometry, shapes
from mjx_arenas.furniture import standing
from mjx_arenas.furniture.part import Part
from mjx_arenas.params.params import QUANTITIES, ArenaParams, ArenaRanges
from mjx_arenas.problem import numbered, problem
from mjx_arenas.problems.messages import warn
from mjx_arenas.rules import angle_rules, fixed_rules, furniture_rules, unit_rules, world_rules
from mjx_arenas.rules.rule import Rules
from mjx_arenas.rules.validation_ranges import reach, traced
from mjx_arenas.sample import tops
from mjx_arenas.sample.fixed import Fixed
from mjx_arenas.sample.placement import Places
from mjx_arenas.sample.sampling import Nominal
from mjx_arenas.sample.tops import Ground
from mjx_arenas.spec.follow import Follower
from mjx_arenas.spec.objects import Object


def warn_of_overlaps(params: ArenaParams, table_names: Sequence[str]) -> None:
    """Warns of each pair of slabs that overlap, and how far."""
    depth, touching = geometry.overlaps(params.table_offsets, params.table_rots, params.table_full_sizes)
    for a, b in np.argwhere(np.triu(depth > touching, 1)):
        what = {"first": table_names[a], "second": table_names[b], **world_rules.overlap_told(params, (a, b))}
        warn(problem("table_offsets", "tables_overlap", ("tables", (int(a), int(b))), None, what))


def warn_of_part(params: ArenaParams, furniture: tuple[Part, ...], tables: Sequence[str]) -> None:
    """Warns of what the last part of furniture overlaps, of its numbers in other units, and if it is larger than what carries it."""
    for what in furniture_rules.overlaps_of_last(params, furniture, numbered(tables)):
        warn(problem("part", "part_overlaps", None, None, what))
    for name, one in furniture[-1].parameters.items():
        if angle_rules.is_angle(one.quantity):
            angle_rules.warn_of_degrees(f"part.{name}", one.nominal, ("part", furniture[-1].name))
    _warn_of_metres(furniture[-1])
    _warn_of_larger(params, furniture, tables)


def _warn_of_metres(part: Part) -> None:
    """Warns of a part that is far away, and of one of pieces, such as boards or drawers, that has long lengths: centimetres, maybe."""
    item, away = ("part", part.name), np.abs(part.nominal["pos"]).max()
    if away > unit_rules.FAR:
        warn(problem("part.pos", "millimetres", item, None, most=away))
    lengths = {
        name: np.abs(one.nominal).max()
        for name, one in part.parameters.items()
        if one.quantity.unit == "[m]" and name != "pos" and (part.pieces or part.moving)
    }
    name = max(lengths, key=lambda name: lengths[name], default="")
    if name and lengths[name] > unit_rules.LONGEST:
        warn(problem(f"part.{name}", "long", item, None, most=lengths[name]))


def _warn_of_larger(params: ArenaParams, furniture: tuple[Part, ...], tables: Sequence[str]) -> None:
    """Warns if the last part is longer and wider than the table or surface on which it stands; a rail may be longer alone."""
    *others, part = furniture
    if part.on is None or not part.nominal_boxes:
        return
    if isinstance(part.on, int):
        below, top = f"table {numbered(tables)[part.on]!r}", params.table_full_sizes[part.on, :2]
    else:
        at = standing.surface_names(others).index(part.on)
        below, top = f"{part.on!r}", standing.surfaces(others, params).full_size[at]
    size = np.asarray(standing.size(part, params))[:2]
    if (np.sort(size) > np.sort(top) * (1 + 1e-6)).all():
        what = {"name": part.name, "size": size.round(3), "below": below, "top": np.round(top, 3)}
        warn(problem("part", "part_larger", None, None, what))


def warn_of_fixed(
    params: ArenaParams,
    places: Places,
    fixed: Fixed,
    follows: tuple[Follower, ...],
    tables: Sequence[str],
    of_part: Sequence[int],
    of: str = "",
) -> None:
    """Warns of tables and parts that are nominally in what is fixed, or below the floor, the deepest of each pair.

    Args:
        params: of the nominal arena.
        places: of its objects.
        fixed: what is fixed.
        follows: geoms that follow its tables.
        tables: their names.
        of_part: numbers of the parts that are looked at; -1: tables.
        of: in the names of the geoms that are.
    """
    none = (), np.zeros(0, str), np.zeros((0, 3)), {}
    rules = Rules(
        len(params.table_rots), *none, furniture=places.furniture, carriers=places.carriers, poses=places.poses
    )
    rules = rules._replace(fixed=fixed, follows=follows, tables=numbered(tables))
    found: dict[tuple[int, str], dict[str, Any]] = {}
    owners = fixed_rules.owners(rules)
    for first, second in np.argwhere(fixed_rules.overlapping(params, rules)).tolist():
        told = fixed_rules.pair_told((first, second), params, rules)
        key = owners[first] if owners[first] >= 0 else -1 - first, told["second"]
        deeper = told["depth"] > found.get(key, {"depth": 0.0})["depth"]
        if owners[first] in of_part and of in told["second"] and deeper:
            found[key] = told
    for told in found.values():
        warn(problem("params", "fixed_overlaps", None, None, told))
    for part in np.flatnonzero(fixed_rules.sunk(params, rules)).tolist():
        if part in of_part and not of:
            warn(problem("params", "sinks", None, None, fixed_rules.sunk_told(part, params, rules)))
    for t in np.flatnonzero(fixed_rules.low(params, rules)).tolist() if -1 in of_part and not of else ():
        item = world_rules.item("table", rules.called[t])
        warn(problem("params", "sinks", item, None, fixed_rules.low_told(t, params, rules)))


def warn_of_crowds(
    params: ArenaParams, ground: Ground, sizes: np.ndarray, drop: np.ndarray, tables: Sequence[str]
) -> None:
    """Warns of objects, of extents (K, 3), that are there nominally and cannot all lie on their nominal table or surface.

    Those that are dropped, (K,) bool, may lie on each other, and do not count.
    """
    there = np.asarray(tops.present(params, ground)[1]) & ~drop
    for t, size in enumerate(tops.surfaces(params, ground).size):
        on = there & (params.object_tables == t)
        covered, area = sizes[on, :2].prod(-1).sum(), size.prod()
        if covered > area:
            below = tops.label(t, numbered(tables), ground)
            what = {"n": on.sum(), "below": below, "covered": covered, "area": area}
            warn(problem("objects", "crowd", ("table", t), None, what))


def warn_of_places(
    params: ArenaParams, ground: Ground, object_names: Sequence[str], pos: np.ndarray, tables: Sequence[str]
) -> None:
    """Warns of objects that are there nominally with the middle, `pos` (K, 2) in the frame of their table or surface, off it."""
    half = tops.surfaces(params, ground).of(params.object_tables).size / 2
    off = (np.abs(pos) > half).any(-1) & np.asarray(tops.present(params, ground)[1])
    for k in np.flatnonzero(off).tolist():
        below = tops.label(int(params.object_tables[k]), numbered(tables), ground)
        what = {"below": below, "x": half[k, 0], "y": half[k, 1]}
        warn(problem("objects.pos", "off_table", ("object", object_names[k]), pos[k], what))


def warn_of_far(params: ArenaParams, tables: Sequence[str]) -> None:
    """Warns of tables so far away that millimetres may have been meant."""
    for t, at in enumerate(np.abs(params.table_offsets).max(-1, initial=0.0)):
        if at > unit_rules.FAR:
            warn(problem("table_offsets", "millimetres", ("table", tables[t]), None, most=at))


def warn_of_long(params: ArenaParams, tables: Sequence[str]) -> None:
    """Warns of tables so large that centimetres may have been meant."""
    for t, most in enumerate(params.table_full_sizes.max(-1, initial=0.0)):
        if most > unit_rules.LONGEST:
            warn(problem("table_full_sizes", "long", ("table", tables[t]), None, most=most))


def warn_of_dense(objects: Sequence[Object], masses: np.ndarray, full_sizes: np.ndarray) -> None:
    """Warns of objects (K) with masses (K,) so large that grams may have been meant."""
    for obj, mass, size in zip(objects, masses, full_sizes, strict=True):
        if obj.mass is None or obj.slots or obj.type in ("mesh", "mjcf"):
            continue
        density = mass / float(shapes.volume(np.array([obj.type]), size[None])[0])
        if density > unit_rules.DENSEST:
            warn(problem("objects.mass", "dense", ("object", obj.name), None, {"mass": mass, "density": density}))


def warn_of_idle(ranges: ArenaRanges, nominal: Nominal, condim: int, decide: str, adopted: Sequence[str] = ()) -> None:
    """Warns of what varies in vain.

    Args:
        ranges: that were found right.
        nominal: of the arena.
        condim: least of the tables' contacts, which use sliding friction alone below 4, and no rolling friction below 6.
        decide: what decides the friction of all that stands on something, as in "tables and furniture"; empty if nothing does.
        adopted: names of the tables, where all stand in a scene with what carries them.
    """
    dist = ranges.table_frictions
    if dist is not None and condim < 6 and not traced(dist):
        low, high = reach(dist, np.asarray(nominal.params.table_frictions))
        if np.any(low[:, 2 if condim == 4 else 1 :] != high[:, 2 if condim == 4 else 1 :]):
            rule = "idle_rolling" if condim == 4 else "idle_friction"
            warn(problem("ranges.table_frictions", rule, condim=condim))
    for name in QUANTITIES:
        scales = getattr(getattr(ranges, name), "relative", None) == "scale"
        if scales and not np.any(np.asarray(getattr(nominal.params, name))):
            warn(problem(f"ranges.{name}", "idle_scale"))
    if ranges.object_frictions is not None and decide:
        warn(problem("ranges.object_frictions", "idle_objects", what=decide))
    fixed = [k for k, kind in enumerate(nominal.object_kinds) if kind not in shapes.PRIMITIVES]
    if ranges.object_full_sizes is not None and fixed:
        names = [repr(nominal.object_names[k]) for k in fixed]
        warn(problem("ranges.object_full_sizes", "idle_sizes", names=names))
    if ranges.has_legs is not None and adopted:
        warn(problem("ranges.has_legs", "idle_legs", names=[repr(name) for name in adopted]))


def warn_of_left(kind: str, standing: Mapping[int, Sequence[str]], moved: np.ndarray, tables: Sequence[str]) -> None:
    """Warns of "free" or "fixed" bodies that stand on tables, given by these, but do not follow them where they are `moved` (T,)."""
    for t in (t for t in standing if moved[t]):
        one, names = len(standing[t]) == 1, ", ".join(standing[t])
        which, stay = ("body", "stays where it is") if one else ("bodies", "stay where they are")
        them = ("it" if one else "them") if kind == "fixed" else ("it" if one else "each")
        told = {"table": tables[t], "which": f"{which} {names}", "stay": stay, "them": them}
        warn(problem("ranges", f"{kind}_left", None, None, told))
