"""Answers to bad ranges (host); numbers that are being traced are left to the device's `valid` flag."""

import warnings
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import jax
import numpy as np

from mjx_arenas import geometry, shapes
from mjx_arenas.distributions import Bernoulli, Choice, Count, Distribution, Fixed, Workspace
from mjx_arenas.params import DENSITIES, QUANTITIES, ArenaRanges
from mjx_arenas.sampling import Nominal
from mjx_arenas.validation import of_items, show, warn_of_degrees

Labels: TypeAlias = Mapping[str, Sequence[str]]
OFFSETS = QUANTITIES["table_offsets"]


def ranges_problems(ranges: ArenaRanges, nominal: Nominal, labels: Labels) -> list[str]:
    """What is wrong with the distributions, or could be with a draw."""
    problems, bounds = [], {}
    values = nominal.params._asdict() | {"object_densities": nominal.object_densities}
    for name, dist in ranges._asdict().items():
        if name == "workspace":
            problems += _workspace_problems(dist)
            continue
        value = np.asarray(values[name])
        if dist is None:
            bounds[name] = (value, value)
            continue
        if QUANTITIES.get(name, DENSITIES).of == "object" and not len(value):
            problems.append(f"`ranges.{name}`: the arena has no objects.")
            continue
        problems += _distribution_problems(name, dist, value)
        if (
            isinstance(dist, Count)
            and not problems
            and not _traced(dist)
            and np.any(np.asarray(dist.high) > len(value))
        ):
            problems.append(f"`ranges.{name}` (Count): `high` must be at most {len(value)}, got {show(dist.high)}.")
        if not problems and not _traced(dist):
            bounds[name] = reach(dist, value)
    if ranges.object_masses is not None and ranges.object_densities is not None:
        problems.append("`ranges`: give `object_masses` or `object_densities`, not both.")
    return problems or _reach_problems(bounds, ranges.object_full_sizes, nominal, labels)


def reach(dist: Distribution, nominal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest value that a quantity, of `nominal`'s shape (N, ...), can take."""
    low, high = (np.broadcast_to(b, nominal.shape) for b in dist.support())
    if isinstance(dist, Count):
        low = np.broadcast_to(np.asarray(dist.low) >= len(nominal), nominal.shape)
    if dist.relative == "add":
        return nominal + low, nominal + high
    if dist.relative == "scale":
        return np.minimum(nominal * low, nominal * high), np.maximum(nominal * low, nominal * high)
    return low, high


def absence_problems(ranges: ArenaRanges, nominal: Nominal, held: Mapping[int, str], labels: Labels) -> list[str]:
    """Tables t and objects T + k that could be absent, or are, though something holds them, a clause."""
    params, bounds = nominal.params, {}
    for name in ("table_active", "object_active", "object_tables"):
        dist, value = getattr(ranges, name), np.asarray(getattr(params, name))
        bounds[name] = (value, value) if dist is None or _traced(dist) else reach(dist, value)
    tables, objects = (bounds[name][0].astype(bool) for name in ("table_active", "object_active"))
    on = zip(*(bound.astype(int) for bound in bounds["object_tables"]), strict=True)
    objects = objects & np.array([tables[low : high + 1].all() for low, high in on], bool)
    sure, names = np.concatenate([tables, objects]), [*labels["table"], *labels["object"]]
    where = ["`ranges.table_active`"] * len(tables) + ["`ranges`"] * len(objects)
    return [f"{where[i]}: {names[i]} can be absent, but {why}." for i, why in held.items() if not sure[i]]


def warn_of_idle(ranges: ArenaRanges, nominal: Nominal, condim: int, tables_decide: bool) -> None:
    """Warns of what varies in vain: friction where contacts of dimension `condim` or tables do not use it, sizes of meshes."""
    dist = ranges.table_frictions
    if dist is not None and condim < 6 and not _traced(dist):
        low, high = reach(dist, np.asarray(nominal.params.table_frictions))
        if np.any(low[:, 2 if condim == 4 else 1 :] != high[:, 2 if condim == 4 else 1 :]):
            idle = "rolling friction has" if condim == 4 else "torsional and rolling friction have"
            what = f"`ranges.table_frictions` varies more than has an effect: with table_condim={condim}, {idle} none."
            warnings.warn(what, stacklevel=4)
    if ranges.table_rots is not None and not _traced(ranges.table_rots):
        yaws = np.stack(reach(ranges.table_rots, np.asarray(nominal.params.table_rots)))
        warn_of_degrees("ranges.table_rots", yaws, stacklevel=5)
    for name in QUANTITIES:
        scales = getattr(getattr(ranges, name), "relative", None) == "scale"
        if scales and not np.any(np.asarray(getattr(nominal.params, name))):
            what = f"`ranges.{name}` scales what is nominally 0, so nothing varies: relative='add' adds to it."
            warnings.warn(what, stacklevel=4)
    if ranges.object_frictions is not None and tables_decide:
        what = "has no effect on tables, whose own friction counts: table_priority=0 takes the larger one"
        warnings.warn(f"`ranges.object_frictions` {what}.", stacklevel=4)
    fixed = [k for k, kind in enumerate(nominal.object_kinds) if kind not in shapes.PRIMITIVES]
    if ranges.object_full_sizes is not None and fixed:
        names = ", ".join(repr(nominal.object_names[k]) for k in fixed)
        warnings.warn(f"`ranges.object_full_sizes` leaves {names} as it is: files have one size.", stacklevel=4)


def moved_tables(ranges: ArenaRanges, nominal: Nominal) -> np.ndarray:
    """(T,) bool: whether a table's top can be elsewhere than nominally, of another outline, or absent."""
    workspace = ranges.workspace is not None and not _traced(ranges.workspace)
    moved = np.full(len(nominal.params.table_rots), workspace)
    for name, axes in (("table_offsets", 3), ("table_full_sizes", 2), ("table_rots", 1), ("table_active", 1)):
        dist, value = getattr(ranges, name), np.asarray(getattr(nominal.params, name))
        if dist is not None and not _traced(dist):
            moved |= np.any(
                [np.reshape(b != value, (len(value), -1))[:, :axes] for b in reach(dist, value)], axis=(0, 2)
            )
    return moved


def warn_of_left(standing: Mapping[int, Sequence[str]], moved: np.ndarray, tables: Sequence[str]) -> None:
    """Warns of free bodies that stand on tables, given by these, but do not follow them where they are `moved` (T,)."""
    for t in (t for t in standing if moved[t]):
        one, names = len(standing[t]) == 1, ", ".join(standing[t])
        left = (
            f"body {names} of the scene stays where it is"
            if one
            else f"bodies {names} of the scene stay where they are"
        )
        warnings.warn(
            f"`ranges` varies table {tables[t]!r}, on which the free {left}: make {'it' if one else 'each'} an "
            f"Object(..., 'mjcf', file=..., table={tables[t]!r}), which follows the table.",
            stacklevel=4,
        )


def _workspace_problems(workspace: object) -> list[str]:
    if workspace is None:
        return []
    if not isinstance(workspace, Workspace):
        return [f"`ranges.workspace` must be a Workspace(low, high, gap), or None, got {workspace!r}."]
    if _traced(workspace):
        return []
    problems = workspace.problems()
    for name in ("low", "high", "gap"):
        value = getattr(workspace, name)
        if not problems and not OFFSETS.right(np.asarray(value, float)).all():
            problems.append(f"`{name}` must be {OFFSETS.between}, got {show(value)}")
    return [f"`ranges.workspace`: {problem}." for problem in problems]


def _traced(dist: Distribution | Workspace) -> bool:
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(dist))


def _distribution_problems(quantity: str, dist: object, nominal: np.ndarray) -> list[str]:
    where = f"`ranges.{quantity}`"
    if not isinstance(dist, Distribution):
        return [f"{where} must be a distribution such as Uniform(low, high), or None, got {dist!r}."]
    where += f" ({type(dist).__name__})"
    problems = _structure_problems(where, quantity, dist, nominal) or _number_problems(where, quantity, dist, nominal)
    if not problems and not _traced(dist):
        problems = [f"{where}: {problem}." for problem in dist.problems()]
    return problems


def _structure_problems(where: str, name: str, dist: Distribution, nominal: np.ndarray) -> list[str]:
    kind = QUANTITIES.get(name, DENSITIES).kind
    if kind is bool and not isinstance(dist, (Bernoulli, Choice, Count, Fixed)):
        return [f"{where}: true and false need Bernoulli, Count, Choice or Fixed."]
    if kind is bool and dist.relative is not None:
        return [f"{where}: true and false cannot be relative, got relative={dist.relative!r}."]
    if kind is not bool and isinstance(dist, (Bernoulli, Count)):
        return [f"{where}: {type(dist).__name__} gives true or false; it serves {', '.join(_BOOLEANS)}."]
    if kind is int and (not isinstance(dist, (Choice, Fixed)) or dist.relative is not None):
        return [f"{where}: indices of tables need Choice or Fixed, which cannot be relative."]
    if dist.relative not in (None, "add", "scale"):
        return [f"{where}: `relative` must be None, 'add' or 'scale', got {dist.relative!r}."]
    if isinstance(dist.tied, str):
        return (
            []
            if dist.tied == "axes" and not dist.per_item
            else [f"{where}: `tied` must be {_TIED}, got {dist.tied!r}."]
        )
    try:
        tied = np.asarray(dist.tied)
    except ValueError:
        tied = np.asarray("ragged")
    if tied.dtype != bool or tied.shape not in ((), nominal.shape[1:]) or (tied.ndim and dist.per_item):
        return [f"{where}: `tied` must be {_TIED}, got {dist.tied!r}."]
    return []


_BOOLEANS = tuple(f"`{name}`" for name, quantity in QUANTITIES.items() if quantity.kind is bool)
_TIED = "true, false, one of them per axis, or 'axes'"


def _number_problems(where: str, quantity: str, dist: Distribution, nominal: np.ndarray) -> list[str]:
    problems = []
    shape = nominal.shape[1:] if dist.per_item else nominal.shape
    of_tables = quantity == "object_tables"
    for path, leaf in jax.tree_util.tree_leaves_with_path(dist):
        name = path[0].name
        if len(path) > 1 or not (np.isscalar(leaf) or hasattr(leaf, "shape")):
            problems.append(f"{where}: `{name}` must be numbers in a regular array, got {show(getattr(dist, name))}.")
            continue
        given = np.shape(leaf)[1:] if dist.per_item else np.shape(leaf)
        if not isinstance(leaf, jax.core.Tracer):
            array = np.asarray(leaf)
            if array.dtype.kind not in "biuf":
                what = (
                    "true or false" if QUANTITIES.get(quantity, DENSITIES).kind is bool and name == "at" else "numbers"
                )
                problems.append(f"{where}: `{name}` must be {what}, got {show(leaf)}.")
                continue
            if not np.all(np.isfinite(array)):
                problems.append(f"{where}: `{name}` must be finite, got {show(leaf)}.")
            elif of_tables and name in ("values", "at") and np.any(array != np.round(array)):
                problems.append(f"{where}: `{name}` must be whole numbers, got {show(leaf)}.")
        if isinstance(dist, Count) or (dist.per_item and name == "p"):
            rows = nominal.shape[:1] if of_tables else ()
            if name == "p" and np.shape(leaf)[:-1] not in ((), rows):
                problems.append(f"{where}: `p` must be (N,){' or (K, N)' if rows else ''}, got shape {np.shape(leaf)}.")
        elif not _fits(given, shape):
            problems.append(f"{where}: `{name}` must be {_allowed(dist, nominal.shape)}, got shape {np.shape(leaf)}.")
    return list(dict.fromkeys(problems))


def _allowed(dist: Distribution, shape: tuple[int, ...]) -> str:
    if dist.per_item:
        return f"(N,) or (N, {shape[1]})" if shape[1:] else "(N,)"
    return f"one number, {shape[1:]} or {shape}" if shape[1:] else f"one number or {shape}"


def _fits(shape: tuple[int, ...], target: tuple[int, ...]) -> bool:
    try:
        return np.broadcast_shapes(shape, target) == target
    except ValueError:
        return False


def _reach_problems(
    bounds: dict[str, tuple[np.ndarray, np.ndarray]], sizes: Distribution | None, nominal: Nominal, labels: Labels
) -> list[str]:
    """What some draw could do wrong, by the bounds of each quantity that are known."""
    problems = []
    for name, (low, high) in bounds.items():
        quantity = QUANTITIES.get(name, DENSITIES)
        if quantity.kind is not float:
            continue
        for bound in (low, high):
            bad = ~quantity.right(bound).all(axis=tuple(range(1, bound.ndim)))
            for of, i in of_items(np.flatnonzero(bad), bound, labels[quantity.of]):
                rule = quantity.broken(bound[i]).removeprefix("finite and ")
                problems.append(f"`ranges.{name}`{of} can reach {show(bound[i].round(6))}: it must stay {rule}.")
    if {"table_offsets", "table_full_sizes", "has_legs"} <= bounds.keys() and not problems:
        low, thick = bounds["table_offsets"][0], bounds["table_full_sizes"][1]
        bad = ~geometry.legs_fit(low, thick, bounds["has_legs"][1].astype(bool))
        heights = np.stack([low[:, 2], thick[:, 2]], axis=1)
        for of, t in of_items(np.flatnonzero(bad), heights, labels["table"]):
            problems.append(
                f"`ranges` can put the top{of} at z = {low[t, 2]:g} m with a slab {thick[t, 2]:g} m thick, which leaves no room for legs: "
                f"keep z > thickness / 2, or give `has_legs` a distribution that is always false."
            )
    if "table_active" in bounds and not bounds["table_active"][1].any():
        problems.append("`ranges.table_active` leaves no table in any world.")
    if "object_tables" in bounds:
        low, high = bounds["object_tables"]
        if low.min(initial=0) < 0 or high.max(initial=0) >= len(labels["table"]):
            got = f"{int(low.min())} to {int(high.max())}"
            problems.append(f"`ranges.object_tables` must be indices from 0 to {len(labels['table']) - 1}, got {got}.")
    scaled = sizes is not None and sizes.relative == "scale" and isinstance(sizes.tied, str)  # keeps its proportions
    if "object_full_sizes" in bounds and not scaled:
        low, high = bounds["object_full_sizes"]
        for k in np.flatnonzero((nominal.object_kinds == "capsule") & (low[:, 0] <= high[:, 1])).tolist():
            can = f"can reach a length of {low[k, 0]:g} m and a diameter of {high[k, 1]:g} m"
            problems.append(
                f"`ranges.object_full_sizes` of {labels['object'][k]} {can}: a capsule must be longer than thick."
            )
    return problems
