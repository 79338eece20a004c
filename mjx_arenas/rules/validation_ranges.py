"""What is wrong with ranges, as problems (host); numbers that are being traced are left to the device's `valid` flag."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import jax
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.params.distributions import Bernoulli, Choice, Count, Distribution, Fixed, Workspace
from mjx_arenas.params.params import DENSITIES, QUANTITIES, ArenaRanges
from mjx_arenas.problem import Problem, problem, under
from mjx_arenas.rules import world_rules
from mjx_arenas.sample.sampling import Nominal

Labels: TypeAlias = Mapping[str, Sequence[Any]]  # the tables' numbers and the objects' names
Bounds: TypeAlias = Mapping[str, tuple[np.ndarray, np.ndarray]]  # the least and the largest value of each quantity
OFFSETS = QUANTITIES["table_offsets"]


def ranges_problems(ranges: ArenaRanges, nominal: Nominal, labels: Labels) -> list[Problem]:
    """What is wrong with the distributions, or could be with a draw."""
    problems, bounds = [], {}
    values = nominal.params._asdict() | {"object_densities": nominal.object_densities}
    for name, dist in ranges._asdict().items():
        if name == "workspace":
            problems += _workspace_problems(dist)
            continue
        value = np.asarray(values[name])
        if dist is None and name == "object_densities":
            continue  # masses are what counts
        if dist is None:
            bounds[name] = (value, value)
            continue
        if QUANTITIES.get(name, DENSITIES).of == "object" and not len(value):
            problems.append(problem(f"ranges.{name}", "no_objects"))
            continue
        found = _distribution_problems(name, dist, value)
        problems += found
        if not found and not traced(dist):
            bounds[name] = reach(dist, value)
    if ranges.object_masses is not None and ranges.object_densities is not None:
        problems.append(problem("ranges", "either", first="object_masses", second="object_densities"))
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


def traced(dist: Distribution | Workspace) -> bool:
    """Whether any of its numbers is being traced."""
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(dist))


def absence_problems(ranges: ArenaRanges, nominal: Nominal, held: Mapping[int, str], labels: Labels) -> list[Problem]:
    """Tables t and objects T + k that could be absent, or are, though something holds them, a clause."""
    params, bounds = nominal.params, {}
    for name in ("table_active", "object_active", "object_tables"):
        dist, value = getattr(ranges, name), np.asarray(getattr(params, name))
        bounds[name] = (value, value) if dist is None or traced(dist) else reach(dist, value)
    tables, objects = (bounds[name][0].astype(bool) for name in ("table_active", "object_active"))
    on = zip(*(bound.astype(int) for bound in bounds["object_tables"]), strict=True)
    objects = objects & np.array([tables[low : high + 1].all() for low, high in on], bool)
    sure, n = np.concatenate([tables, objects]), len(tables)
    items = [world_rules.item("table", t) for t in labels["table"]]
    items += [world_rules.item("object", name) for name in labels["object"]]
    paths = ["ranges.table_active" if i < n else "ranges" for i in range(len(sure))]
    return [problem(paths[i], "can_be_absent", items[i], why=why) for i, why in held.items() if not sure[i]]


def moved_tables(ranges: ArenaRanges, nominal: Nominal) -> np.ndarray:
    """(T,) bool: whether a table's top can be elsewhere than nominally, of another outline, or absent."""
    workspace = ranges.workspace is not None and not traced(ranges.workspace)
    moved = np.full(len(nominal.params.table_rots), workspace)
    for name, axes in (("table_offsets", 3), ("table_full_sizes", 2), ("table_rots", 1), ("table_active", 1)):
        dist, value = getattr(ranges, name), np.asarray(getattr(nominal.params, name))
        if dist is not None and not traced(dist):
            moved |= np.any(
                [np.reshape(b != value, (len(value), -1))[:, :axes] for b in reach(dist, value)], axis=(0, 2)
            )
    return moved


def _workspace_problems(workspace: object) -> list[Problem]:
    if workspace is None:
        return []
    if not isinstance(workspace, Workspace):
        return [problem("ranges.workspace", "workspace", None, workspace)]
    if traced(workspace):
        return []
    problems = workspace.problems()
    for name in ("low", "high", "gap") if not problems else ():
        value = getattr(workspace, name)
        if not OFFSETS.right(np.asarray(value, float)).all():
            problems.append(problem(name, "limits", None, value, quantity="table_offsets"))
    return under("ranges.workspace", problems, dist="")


def _distribution_problems(quantity: str, dist: object, nominal: np.ndarray) -> list[Problem]:
    path = f"ranges.{quantity}"
    if not isinstance(dist, Distribution):
        return [problem(path, "distribution", None, dist)]
    problems = _structure_problems(quantity, dist, nominal) or _number_problems(quantity, dist, nominal)
    if not problems and not traced(dist):
        problems = dist.problems()
        if isinstance(dist, Count) and not problems and np.any(np.asarray(dist.high) > len(nominal)):
            problems = [problem("high", "count_high", None, dist.high, most=len(nominal))]
    return under(path, problems, dist=type(dist).__name__)


def _structure_problems(name: str, dist: Distribution, nominal: np.ndarray) -> list[Problem]:
    kind = QUANTITIES.get(name, DENSITIES).kind
    if kind is bool and not isinstance(dist, (Bernoulli, Choice, Count, Fixed)):
        return [problem("", "boolean")]
    if kind is bool and dist.relative is not None:
        return [problem("", "boolean_relative", None, dist.relative)]
    if kind is not bool and isinstance(dist, (Bernoulli, Count)):
        return [problem("", "not_boolean", names=[f"`{n}`" for n, q in QUANTITIES.items() if q.kind is bool])]
    if kind is int and (not isinstance(dist, (Choice, Fixed)) or dist.relative is not None):
        return [problem("", "indices")]
    if dist.relative not in (None, "add", "scale"):
        return [problem("relative", "relative", None, dist.relative, optional=True)]
    return [] if _tied_right(dist, nominal) else [problem("tied", "tied", None, dist.tied)]


def _tied_right(dist: Distribution, nominal: np.ndarray) -> bool:
    if isinstance(dist.tied, str):
        return dist.tied == "axes" and not dist.per_item
    try:
        tied = np.asarray(dist.tied)
    except ValueError:
        return False
    return tied.dtype == bool and (tied.shape == () or (tied.shape == nominal.shape[1:] and not dist.per_item))


def _number_problems(quantity: str, dist: Distribution, nominal: np.ndarray) -> list[Problem]:
    problems = []
    shape = nominal.shape[1:] if dist.per_item else nominal.shape
    of_tables = quantity == "object_tables"
    for path, leaf in jax.tree_util.tree_leaves_with_path(dist):
        name = path[0].name
        if len(path) > 1 or not (np.isscalar(leaf) or hasattr(leaf, "shape")):
            problems.append(problem(name, "numbers", None, getattr(dist, name)))
            continue
        given = np.shape(leaf)[1:] if dist.per_item else np.shape(leaf)
        if not isinstance(leaf, jax.core.Tracer):
            rule = _number_rule(quantity, name, np.asarray(leaf))
            problems += [problem(name, rule, None, leaf)] if rule else []
            if rule in ("are_numbers", "are_truths"):
                continue
        if isinstance(dist, Count) or (dist.per_item and name == "p"):
            rows = nominal.shape[:1] if of_tables else ()
            if name == "p" and np.shape(leaf)[:-1] not in ((), rows):
                allowed = f"(N,){' or (K, N)' if rows else ''}"
                problems.append(problem(name, "broadcast", None, leaf, allowed=allowed))
        elif not _fits(given, shape):
            problems.append(problem(name, "broadcast", None, leaf, allowed=_allowed(dist, nominal.shape)))
    seen = set()
    return [p for p in problems if p.key not in seen and not seen.add(p.key)]


def _number_rule(quantity: str, name: str, array: np.ndarray) -> str:
    """The rule that the numbers of a distribution break by themselves; none where they are right."""
    if array.dtype.kind not in "biuf":
        truths = QUANTITIES.get(quantity, DENSITIES).kind is bool and name == "at"
        return "are_truths" if truths else "are_numbers"
    if not np.all(np.isfinite(array)):
        return "finite"
    chosen = quantity == "object_tables" and name in ("values", "at")
    return "whole_numbers" if chosen and np.any(array != np.round(array)) else ""


def _allowed(dist: Distribution, shape: tuple[int, ...]) -> str:
    if dist.per_item:
        return f"(N,) or (N, {shape[1]})" if shape[1:] else "(N,)"
    return f"one number, {shape[1:]} or {shape}" if shape[1:] else f"one number or {shape}"


def _fits(shape: tuple[int, ...], target: tuple[int, ...]) -> bool:
    try:
        return np.broadcast_shapes(shape, target) == target
    except ValueError:
        return False


def _reach_problems(bounds: Bounds, sizes: Distribution | None, nominal: Nominal, labels: Labels) -> list[Problem]:
    """What some draw could do wrong, by the bounds of each quantity that are known."""
    problems = [p for name, bound in bounds.items() for p in _value_problems(name, bound, labels)]
    if {"table_offsets", "table_full_sizes", "has_legs"} <= bounds.keys() and not problems:
        problems += _legs_problems(bounds, labels)
    if "table_active" in bounds and not bounds["table_active"][1].any():
        problems.append(problem("ranges.table_active", "reach_no_table"))
    if "object_tables" in bounds:
        low, high = bounds["object_tables"]
        most = len(labels["table"]) - 1
        if low.min(initial=0) < 0 or high.max(initial=0) > most:
            what = {"low": int(low.min()), "high": int(high.max()), "most": most}
            problems.append(problem("ranges.object_tables", "reach_table", None, None, what))
    scaled = sizes is not None and sizes.relative == "scale" and isinstance(sizes.tied, str)  # keeps its proportions
    if "object_full_sizes" in bounds and not scaled:
        low, high = bounds["object_full_sizes"]
        for k in np.flatnonzero((nominal.object_kinds == "capsule") & (low[:, 0] <= high[:, 1])).tolist():
            what = {"length": low[k, 0], "diameter": high[k, 1]}
            problems.append(
                problem("ranges.object_full_sizes", "reach_capsule", ("object", labels["object"][k]), None, what)
            )
    return problems


def _value_problems(name: str, bound: tuple[np.ndarray, np.ndarray], labels: Labels) -> list[Problem]:
    quantity, problems = QUANTITIES.get(name, DENSITIES), []
    if quantity.kind is not float:
        return []
    for values in bound:
        found = []
        for i in np.flatnonzero(~world_rules.right(quantity, values)).tolist():
            rule, numbers = world_rules.broken(name, quantity, values[i])
            item = world_rules.item(quantity.of, labels[quantity.of][i])
            found.append(problem(f"ranges.{name}", f"reach_{rule}", item, values[i].round(6), numbers))
        problems += world_rules.joined(found, len(values))
    return problems


def _legs_problems(bounds: Bounds, labels: Labels) -> list[Problem]:
    low, thick = bounds["table_offsets"][0], bounds["table_full_sizes"][1]
    bad = np.flatnonzero(~geometry.legs_fit(low, thick, bounds["has_legs"][1].astype(bool)))
    found = []
    for t in bad.tolist():
        what = {"height": low[t, 2], "thickness": thick[t, 2]}
        found.append(problem("ranges", "reach_legs", ("table", t), None, what))
    return world_rules.joined(found, len(low))
