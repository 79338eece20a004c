"""Whether a world can be: a flag on the device, sentences on the host. T tables, K objects."""

import functools
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas import geometry, placement, sampling, shapes
from mjx_arenas.distributions import Workspace
from mjx_arenas.params import QUANTITIES, ArenaParams, ArenaRanges, canonical, present
from mjx_arenas.validation import Arguments, labels, show, value_problems

Held: TypeAlias = Mapping[int, str]  # tables t and objects T + k that cannot be absent, with the reason, a clause


class Rules(NamedTuple):
    """What decides, beside its parameters, whether a world of an arena can be."""

    n_tables: int
    object_names: tuple[str, ...]
    object_kinds: np.ndarray  # (K,) their types
    object_full_sizes: np.ndarray  # (K, 3) nominal [m]; those of files stay
    held: Held
    drawn: bool = False  # from ranges: a table must be there
    workspace: Workspace | None = None


def valid(params: ArenaParams, rules: Rules, ranges: ArenaRanges | None = None) -> jax.Array:
    """() bool: the world can be; the same rules as those of `world_problems`, for numbers that only the device knows."""
    p, kinds = canonical(params), rules.object_kinds
    tables = geometry.legs_fit(p.table_offsets, p.table_full_sizes, p.has_legs)
    things = (p.object_tables >= 0) & (p.object_tables < rules.n_tables) & ~(placement.too_large(p) & present(p)[1])
    things &= shapes.possible(kinds, p.object_full_sizes)
    things &= shapes.heavy_enough(kinds, p.object_full_sizes, p.object_masses)
    things &= shapes.as_in_file(kinds, p.object_full_sizes, rules.object_full_sizes)
    for name, quantity in QUANTITIES.items():
        if quantity.kind is float:
            right = quantity.right(getattr(p, name))
            for column in [right] if right.ndim == 1 else [right[:, i] for i in range(right.shape[1])]:
                tables, things = (tables & column, things) if quantity.of == "table" else (tables, things & column)
    checks = [tables.all(), things.all(), jnp.concatenate(present(p))[np.array(list(rules.held), int)].all()]
    if ranges is not None:
        checks += [sampling.in_order(ranges), p.table_active.any()]
        checks += [] if ranges.workspace is None else [kept.all() for kept in placement.keeps(p, ranges.workspace)]
    return functools.reduce(jnp.logical_and, checks)


def world_problems(params: ArenaParams, rules: Rules) -> list[str]:
    """Why a world cannot be; parameters of the right shapes, on the host."""
    problems = params_problems(params, rules)
    if rules.drawn and not params.table_active.any():
        problems.append("No table is there.")
    if rules.workspace is None or problems:
        return problems
    inside, apart = map(np.asarray, placement.keeps(params, rules.workspace))
    low, high, gap = (show(np.asarray(getattr(rules.workspace, name), float)) for name in ("low", "high", "gap"))
    problems += [f"Table {t} is not inside the workspace, {low} to {high} m." for t in np.flatnonzero(~inside)]
    pairs = np.argwhere(np.triu(~apart))
    return problems + [f"Tables {a} and {b} are not apart by the workspace's gap of {gap} m." for a, b in pairs]


def params_problems(params: ArenaParams, rules: Rules) -> list[str]:
    """What is wrong with the values of one world's parameters, of the right shapes, on the host."""
    kinds, sizes, n_tables = rules.object_kinds, params.object_full_sizes, rules.n_tables
    names = labels(n_tables, rules.object_names)
    problems = value_problems(params._asdict(), names, Arguments(singular=False))
    for k, table in enumerate(params.object_tables):
        if not 0 <= table < n_tables:
            problems.append(
                f"`object_tables` of {names['object'][k]} must be from 0 to {n_tables - 1}, got {int(table)}."
            )
    bad = np.flatnonzero(~shapes.possible(kinds, sizes)).tolist()
    sized = [(k, SHAPES[kinds[k]]) for k in bad if kinds[k] in SHAPES]  # others are no numbers, as was said
    given = rules.object_full_sizes
    sized += [
        (k, f"{show(given[k].round(6))}, as in its file")
        for k in np.flatnonzero(~shapes.as_in_file(kinds, sizes, given)).tolist()
    ]
    problems += [
        f"`object_full_sizes` of {names['object'][k]} must be {rule}, got {show(sizes[k])}." for k, rule in sized
    ]
    if problems:
        return problems
    problems += [
        f"`object_masses` of {names['object'][k]}, {params.object_masses[k]:g} kg, is too small for its size: an inertia "
        f"must be >= {mujoco.mjMINVAL:g} kg m^2."
        for k in np.flatnonzero(~shapes.heavy_enough(kinds, sizes, params.object_masses)).tolist()
    ]
    tables, objects = present(params)
    problems += size_problems(params, names["object"], np.asarray(objects))
    there, every = np.concatenate([tables, objects]), [*names["table"], *names["object"]]
    return problems + [f"`params`: {every[i]} is absent, but {why}." for i, why in rules.held.items() if not there[i]]


SHAPES = {
    "sphere": "3 equal extents (a sphere)",
    "capsule": "(length, diameter, diameter) with length > diameter (a capsule)",
    "cylinder": "(diameter, diameter, height) (a cylinder)",
}


def size_problems(params: ArenaParams, object_labels: Sequence[str], counts: np.ndarray) -> list[str]:
    """Objects, of those that count (K,), that are larger than their table."""
    on, sizes = params.object_tables, params.object_full_sizes[:, :2]
    return [
        f"O{object_labels[k][1:]} is {_by(sizes[k])} m, larger than table {on[k]}, which is "
        f"{_by(params.table_full_sizes[on[k], :2])} m."
        for k in np.flatnonzero(placement.too_large(params) & counts).tolist()
    ]


def _by(lengths: np.ndarray) -> str:
    return " x ".join(f"{x:g}" for x in lengths.round(6))
