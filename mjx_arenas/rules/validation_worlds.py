"""Whether a world can be: a flag on the device, problems on the host, by the same table of rules (`world_rules`)."""

from collections.abc import Sequence

import jax
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.params.params import ArenaParams, ArenaRanges, canonical
from mjx_arenas.problem import Problem, in_world, numbered, problem
from mjx_arenas.rules import fixed_rules, world_rules
from mjx_arenas.rules.world_rules import RULES
from mjx_arenas.rules.world_rules import Held as Held
from mjx_arenas.rules.world_rules import Rules as Rules
from mjx_arenas.sample import sampling
from mjx_arenas.sample.fixed import Fixed
from mjx_arenas.sample.placement import Places
from mjx_arenas.spec.follow import Follower

REFUSED = tuple(rule for rule in RULES if not rule.shown)


def valid(params: ArenaParams, rules: Rules, ranges: ArenaRanges | None = None) -> jax.Array:
    """() bool: the world can be; no more and no less than that `world_problems` finds nothing."""
    return world_rules.hold(canonical(params), bound(rules, ranges), RULES)


def possible(params: ArenaParams, rules: Rules) -> jax.Array:
    """() bool: the world can be made in C MuJoCo, and shown, whether or not it is valid (`refusals`)."""
    return world_rules.hold(canonical(params), rules, REFUSED)


def bound(rules: Rules, ranges: ArenaRanges | None) -> Rules:
    """The rules of worlds that are drawn from ranges."""
    if ranges is None:
        return rules
    return rules._replace(drawn=True, workspace=ranges.workspace, ordered=sampling.in_order(ranges))


def world_problems(params: ArenaParams, rules: Rules) -> list[Problem]:
    """Why a world cannot be; parameters of the right shapes, on the host."""
    return world_rules.problems(params, rules, RULES)


def refusals(params: ArenaParams, rules: Rules, world: int | None = None) -> list[Problem]:
    """Why a world, of many where it has a number, is not compiled and shown."""
    return in_world(world_rules.problems(params, rules, REFUSED), world)


def refusals_of(params: ArenaParams, rules: Rules, world: int) -> list[Problem]:
    """The same of one for which `possible` is false; of its numbers as they were rounded, if nothing else is wrong."""
    return refusals(params, rules, world) or [Problem("params", "precision", world=world)]


def place_problems(found: np.ndarray, object_names: Sequence[str]) -> list[Problem]:
    """The objects that did not find a free place; `found` (K,) bool."""
    without = np.flatnonzero(~found).tolist()
    return [problem("objects", "no_place", ("object", object_names[k]), name=object_names[k]) for k in without]


def size_problems(
    nominal: ArenaParams, object_names: tuple[str, ...], places: Places, tables: Sequence[str]
) -> list[Problem]:
    """Objects that are larger than their nominal table or surface, those too that are nominally absent, and any of their variants."""
    everything = {name: np.ones_like(getattr(nominal, name)) for name in ("table_active", "object_active")}
    kinds, sizes, furniture = places.kind, nominal.object_full_sizes, places.furniture
    rules = Rules(
        len(nominal.table_rots), object_names, kinds, sizes, {}, furniture=furniture, carriers=places.carriers
    )
    rules = rules._replace(tables=numbered(tables))
    worlds, larger = [(nominal, object_names, kinds)], [r for r in RULES if r.name == "larger"]
    for one in places.variants:
        for size, name, kind in zip(one.full_size, one.names, one.kind, strict=True):
            sizes, names, own = nominal.object_full_sizes.copy(), list(object_names), kinds.copy()
            own[one.object] = kind
            sizes[one.object], names[one.object] = size, f"{names[one.object]}_{name}"
            worlds.append((nominal._replace(object_full_sizes=sizes), tuple(names), own))
    found = [
        world_rules.problems(
            params._replace(**everything), rules._replace(object_names=names, object_kinds=own), larger
        )
        for params, names, own in worlds[bool(places.variants) :]
    ]
    return list({p.key: p for some in found for p in some}.values())


def with_fixed(rules: Rules, fixed: Fixed, follows: tuple[Follower, ...], nominal: ArenaParams) -> Rules:
    """The same with what stands fixed beside tables and parts: what is in it nominally is so by intent."""
    rules = rules._replace(fixed=fixed, follows=follows)
    sunk = fixed_rules.sunk(nominal, rules)
    inside = fixed_rules.overlapping(nominal, rules) | ~fixed_rules.counted(nominal, rules)
    return rules._replace(inside=inside, sunk=sunk, low=fixed_rules.low(nominal, rules))


def overlapping(params: ArenaParams) -> np.ndarray:
    """(T, T) bool: the slabs of two tables overlap, on the host."""
    depth, touching = geometry.overlaps(params.table_offsets, params.table_rots, params.table_full_sizes)
    return depth > touching
