"""What is wrong with ranges, as problems (host); numbers that are being traced are left to the device's `valid` flag."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import jax
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.furniture import surfaces
from mjx_arenas.params.distribution import Distribution
from mjx_arenas.params.distributions import Bernoulli, Choice, Count, Fixed, Workspace
from mjx_arenas.params.params import QUANTITIES, ArenaParams, ArenaRanges, Quantity
from mjx_arenas.problem import Problem, problem, rounded, under
from mjx_arenas.rules import world_rules
from mjx_arenas.rules.validation import Labels
from mjx_arenas.sample import tops
from mjx_arenas.sample.sampling import Nominal
from mjx_arenas.spec import patterns
from mjx_arenas.spec.names import of_task

Bounds: TypeAlias = Mapping[str, tuple[np.ndarray, np.ndarray]]  # the least and the largest value of each quantity
OFFSETS = QUANTITIES["table_offsets"]
_PRESENCE = ("table_active", "object_active", "object_tables")


def ranges_problems(ranges: ArenaRanges, nominal: Nominal, labels: Labels) -> list[Problem]:
    """What is wrong with the distributions, or could be with a draw."""
    problems = _unknown(ranges, labels)
    if problems:
        return problems
    bounds: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    values = nominal.values
    given = {name: dist for name, dist in ranges._asdict().items() if name not in ("workspace", "terms")} | {
        name: ranges.terms.get(name) for name in labels.terms
    }
    for name, dist in given.items():
        value = np.asarray(values[name])
        if dist is None and name == "object_densities":
            continue  # masses are what counts
        if dist is None:
            bounds[name] = (value, value)
            continue
        if name not in labels.terms and not len(value):
            problems.append(problem(f"ranges.{name}", f"no_{labels.of(name)[0].of}s"))
            continue
        found = _distribution_problems(name, dist, value, labels)
        problems += found
        if not found and not traced(dist):
            bounds[name] = reach(dist, value)
        elif found and {p.rule for p in found} <= {"broadcast"} and not traced(dist):
            problems += _misshapen_problems(name, dist, labels)
    problems += _workspace_problems(ranges.workspace)
    if ranges.object_masses is not None and ranges.object_densities is not None:
        problems.append(problem("ranges", "either", first="object_masses", second="object_densities"))
    return problems + _reach_problems(bounds, ranges.object_full_sizes, nominal, labels)


def _unknown(ranges: ArenaRanges, labels: Labels) -> list[Problem]:
    """Ranges of quantities that `arena.vary` did not make."""
    known = list(labels.terms)
    every = [name for name in ranges.terms if name not in known]
    found = [problem("ranges.terms", "term_of_task", None, name) for name in every if of_task(name, known)]
    unknown = [name for name in every if not of_task(name, known)]
    if unknown and not known:
        *others, last = map(repr, unknown)
        what = f"quantities {', '.join(others)} and {last}" if others else f"quantity {last}"
        return [*found, problem("ranges.terms", "no_terms", None, unknown, what=what)]
    told = ((name, patterns.near(str(name), known)) for name in unknown)
    return found + [problem("ranges.terms", "unknown_term", None, name, nearest=near) for name, near in told]


def path_of(name: str, labels: Labels) -> str:
    """What messages call the range of a quantity."""
    return f"ranges.terms.{name}" if name in labels.terms else f"ranges.{name}"


def reach(dist: Distribution, nominal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest value that a quantity, of `nominal`'s shape (N, ...), can take."""
    low, high = (np.broadcast_to(b, nominal.shape) for b in dist.support())
    if isinstance(dist, Count):
        n = len(nominal)
        below = (np.arange(n), np.arange(n)) if dist.first else (np.full(n, n - 1), np.zeros(n))
        low, high = np.asarray(dist.low) > below[0], np.asarray(dist.high) > below[1]  # of each item
    if dist.relative == "add":
        return nominal + low, nominal + high
    if dist.relative == "scale":
        return np.minimum(nominal * low, nominal * high), np.maximum(nominal * low, nominal * high)
    return low, high


def traced(dist: Distribution | Workspace) -> bool:
    """Whether any of its numbers is being traced."""
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(dist))


def of_presence(nominal: Nominal) -> tuple[str, ...]:
    """What problems of the ranges that decide what is there begin with; `absence_problems` asks that there are none."""
    return tuple(
        f"ranges.{name}" for name in (*_PRESENCE, *(f"terms.{x}" for x in surfaces.presence(nominal.furniture)))
    )


def absence_problems(ranges: ArenaRanges, nominal: Nominal, held: Mapping[int, str], labels: Labels) -> list[Problem]:
    """Tables t and objects T + k that could be absent, or are, though something holds them, a clause."""
    tables, objects, *_ = presence(ranges, nominal, most=False)
    sure, n = np.concatenate([tables, objects]), len(tables)
    items = [world_rules.item("table", t) for t in labels.table]
    items += [world_rules.item("object", name) for name in labels.object]
    paths = ["ranges.table_active" if i < n else "ranges" for i in range(len(sure))]
    return [problem(paths[i], "can_be_absent", items[i], why=why) for i, why in held.items() if not sure[i]]


def gone_problems(ranges: ArenaRanges, nominal: Nominal, tables: Sequence[str]) -> list[Problem]:
    """Objects that ranges leave nothing to stand on in any world; `tables` are the names of these."""
    deciding = ranges.varying & tops.deciding(nominal.ground)
    if not deciding or any(traced(dist) for dist in ranges.distributions.values()):
        return []
    _, can_be, _, on = presence(ranges, nominal, most=True)
    dist, active = ranges.object_active, np.asarray(nominal.params.object_active, bool)
    wanted = active if dist is None else reach(dist, active)[1].astype(bool)
    names = tops.names(tables, nominal.ground)
    return [
        problem("ranges", "gone", ("object", nominal.object_names[k]), names=[repr(names[i]) for i in on[k]])
        for k in np.flatnonzero(wanted & ~can_be).tolist()
    ]


def presence(
    ranges: ArenaRanges, nominal: Nominal, most: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[np.ndarray]]:
    """(T,), (K,), (S,) bool: tables, objects and what these stand on, in all worlds, or, for `most`, in any; what each can stand on."""
    params, bounds, side = nominal.params, {}, int(most)
    for name in _PRESENCE:
        dist, value = getattr(ranges, name), np.asarray(getattr(params, name))
        bounds[name] = (value, value) if dist is None or traced(dist) else reach(dist, value)
    tables, objects = (bounds[name][side].astype(bool) for name in ("table_active", "object_active"))
    terms, given, enough = dict(params.terms), ranges.given_terms, np.any if most else np.all
    for name in surfaces.presence(nominal.furniture) & set(given):
        dist, value = given[name], terms[name]
        terms[name] = np.zeros_like(value) if traced(dist) else reach(dist, value)[side].astype(bool)
    params = params._replace(table_active=tables, terms=terms)
    below = np.asarray(surfaces.surfaces(params, nominal.furniture).there, bool)
    on, ground, first = _below(ranges.object_tables, bounds["object_tables"], nominal), nominal.ground, len(below)
    below = np.append(below, np.zeros(len(ground.carriers), bool))
    for i in ground.order:
        k = ground.carriers[i].object
        below[first + i] = objects[k] and enough(below[on[k]])
    return tables, objects & np.array([enough(below[here]) for here in on], bool), below, on


def _below(dist: Distribution | None, bounds: tuple[np.ndarray, np.ndarray], nominal: Nominal) -> list[np.ndarray]:
    """(K,) indices of all that each object can stand on."""
    may = tops.may_stand(nominal.params, nominal.ground)
    if isinstance(dist, Choice) and not traced(dist):
        given = np.unique(dist.values).astype(int)
        return [given[own[given]] for own in may]
    low, high = (bound.astype(int) for bound in bounds)
    return [least + np.flatnonzero(own[least : most + 1]) for own, least, most in zip(may, low, high, strict=True)]


def coded_problems(ranges: ArenaRanges, nominal: ArenaParams, ground: tops.Ground) -> list[Problem]:
    """Why worlds of the ranges are no points of a unit cube."""
    if ranges.workspace is not None:
        return [problem("ranges.workspace", "coded_workspace")]
    sure = not (tops.deciding(ground) - {"object_active"}) & ranges.varying
    sure = sure and not ground.carriers and bool(np.all(surfaces.surfaces(nominal, ground.furniture).there))
    counted = isinstance(ranges.object_active, Count) and not sure
    return [problem("ranges.object_active", "coded_count")] if counted else []


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


def _distribution_problems(quantity: str, dist: object, nominal: np.ndarray, labels: Labels) -> list[Problem]:
    path = path_of(quantity, labels)
    if not isinstance(dist, Distribution):
        return [problem(path, "distribution", None, dist)]
    rule, _ = labels.of(quantity)
    problems = _kind_problems(labels, int if rule.counts else rule.kind, dist)
    if quantity in labels.terms and dist.relative == "scale" and not nominal[labels.terms[quantity].mask].any():
        problems = [*problems, problem("relative", "scale_of_nothing")]
    if not problems:
        problems = _structure_problems(dist, nominal)
        numbers = _number_problems(quantity, rule, dist, nominal, labels.surfaces)
        problems += numbers
        if {p.rule for p in numbers} <= {"broadcast"} and not traced(dist):  # numbers of whatever shapes
            problems += [p for p in dist.problems() if not (numbers and p.rule == "values")]
    if isinstance(dist, Count) and not problems and not traced(dist) and np.any(np.asarray(dist.high) > len(nominal)):
        problems = [problem("high", "count_high", None, dist.high, most=len(nominal))]
    return under(path, problems, dist=type(dist).__name__)


def _misshapen_problems(name: str, dist: Distribution, labels: Labels) -> list[Problem]:
    """What a draw could do wrong whatever shapes numbers have: of those that replace the nominal ones."""
    quantity, _ = labels.of(name)
    if quantity.kind is not float or dist.relative is not None or dist.per_item:
        return []
    wrong = [b for b in dist.support() if not quantity.right(b).all()]
    told = [(world_rules.broken(name, quantity, b), rounded(b)) for b in wrong]
    return [problem(path_of(name, labels), f"reach_{rule}", None, got, numbers) for (rule, numbers), got in told]


def _kind_problems(labels: Labels, kind: type, dist: Distribution) -> list[Problem]:
    """A distribution that cannot serve a quantity at all."""
    if kind is bool and not isinstance(dist, (Bernoulli, Choice, Count, Fixed)):
        return [problem("", "boolean")]
    if kind is bool and dist.relative is not None:
        return [problem("", "boolean_relative", None, dist.relative)]
    if kind is not bool and isinstance(dist, (Bernoulli, Count)):
        names = [f"`{n}`" for n in labels.names if labels.of(n)[0].kind is bool]
        return [problem("", "not_boolean", names=names)]
    if kind is int and (not isinstance(dist, (Choice, Fixed)) or dist.relative is not None):
        return [problem("", "indices")]
    return []


def _structure_problems(dist: Distribution, nominal: np.ndarray) -> list[Problem]:
    return [] if _tied_right(dist, nominal) else [problem("tied", "tied", None, dist.tied)]


def _tied_right(dist: Distribution, nominal: np.ndarray) -> bool:
    if isinstance(dist.tied, str):
        return dist.tied == "axes" and nominal.ndim == 2 and not dist.per_item
    try:
        tied = np.asarray(dist.tied)
    except ValueError:
        return False
    return tied.dtype == bool and (tied.shape == () or (tied.shape == nominal.shape[1:] and not dist.per_item))


_INDICES = {
    "pose": "numbers of its poses, which count from 0",
}


def _indices_of(surfaces: Sequence[str], given: np.ndarray) -> str:
    """What indices of what objects stand on are, with those of the names that were given, or else of the first ones."""
    known = {name: i for i, name in enumerate(surfaces)}
    asked = [name for name in np.unique(given.astype(str)).tolist() if name in known] or list(known)
    shown = [f"{known[name]} for {name!r}" for name in asked[:12]] + ["..."] * (len(asked) > 12)
    return f"indices of `arena.surfaces`, which are {', '.join(shown)}"


def _number_problems(
    name_of: str, quantity: Quantity, dist: Distribution, nominal: np.ndarray, surfaces: Sequence[str]
) -> list[Problem]:
    problems = []
    shape = nominal.shape[1:] if dist.per_item else nominal.shape
    of_tables = name_of == "object_tables"
    leaves = jax.tree_util.tree_leaves_with_path(dist, is_leaf=lambda x: x is None)
    numbers: list[Any] = [x for x in leaves if x[1] is not None or getattr(type(dist), x[0][0].name, dist) is not None]
    for path, leaf in numbers:  # all but what may be left out
        name = path[0].name
        if len(path) > 1 or not (np.isscalar(leaf) or hasattr(leaf, "shape")):
            problems.append(problem(name, "numbers", None, getattr(dist, name)))
            continue
        given = np.shape(leaf)[1:] if dist.per_item else np.shape(leaf)
        if not isinstance(leaf, jax.core.Tracer):
            rule = _number_rule(quantity, of_tables, name, np.asarray(leaf))
            what = _indices_of(surfaces, np.asarray(leaf)) if of_tables else _INDICES.get(name_of.rpartition(".")[2])
            if what is None and quantity.counts and name in ("at", "values"):
                what = quantity.must
            rule = "are_indices" if rule == "are_numbers" and what else rule
            problems += [problem(name, rule, None, leaf, what=what)] if rule else []
            if rule in ("are_numbers", "are_indices", "truth"):
                continue
        if isinstance(dist, Count) or (dist.per_item and name == "p"):
            rows = nominal.shape[:1] if of_tables else ()
            if name == "p" and np.shape(leaf)[:-1] not in ((), rows):
                allowed = f"(N,){' or (K, N)' if rows else ''}"
                problems.append(problem(name, "broadcast", None, leaf, allowed=allowed))
        elif not _fits(given, shape):
            problems.append(problem(name, "broadcast", None, leaf, allowed=_allowed(dist, nominal.shape, quantity)))
    seen = set()
    return [p for p in problems if p.key not in seen and not seen.add(p.key)]


def _number_rule(quantity: Quantity, of_tables: bool, name: str, array: np.ndarray) -> str:
    """The rule that the numbers of a distribution break by themselves; none where they are right."""
    truths = quantity.kind is bool and name in ("at", "values")
    if array.dtype.kind not in "biuf":
        return "truth" if truths else "are_numbers"
    if truths and not np.isin(array, (0, 1)).all():
        return "truth"
    if not np.all(np.isfinite(array)):
        return "finite"
    chosen = of_tables and name in ("values", "at")
    return "whole_numbers" if chosen and np.any(array != np.round(array)) else ""


def _allowed(dist: Distribution, shape: tuple[int, ...], quantity: Quantity) -> str:
    if dist.per_item:
        return f"of shape (N,) or (N, {shape[1]})" if shape[1:] else "of shape (N,)"
    axes = f", for {quantity.axes}, whether these vary or not" if shape[1:] and quantity.axes else ""
    return f"one number or of shape {shape[1:]} or {shape}{axes}" if shape[1:] else f"one number or of shape {shape}"


def _fits(shape: tuple[int, ...], target: tuple[int, ...]) -> bool:
    try:
        return np.broadcast_shapes(shape, target) == target
    except ValueError:
        return False


def _reach_problems(bounds: Bounds, sizes: Distribution | None, nominal: Nominal, labels: Labels) -> list[Problem]:
    """What some draw could do wrong, by the bounds of each quantity that are known."""
    problems = [p for name, bound in bounds.items() for p in _value_problems(name, bound, labels)]
    problems += [
        p for name in labels.terms if name in bounds for p in _never_right(name, bounds[name], nominal, labels)
    ]
    if {"table_offsets", "table_full_sizes", "has_legs"} <= bounds.keys() and not problems:
        problems += _legs_problems(bounds, labels)
    if "table_active" in bounds and labels.table and not bounds["table_active"][1].any():
        problems.append(problem("ranges.table_active", "reach_no_table"))
    if "object_tables" in bounds and labels.object:
        low, high = bounds["object_tables"]
        most = len(labels.table) + tops.count(nominal.ground) - 1
        if low.min(initial=0) < 0 or high.max(initial=0) > most:
            what = {"low": int(low.min()), "high": int(high.max()), "most": most}
            problems.append(problem("ranges.object_tables", "reach_table", None, None, what))
    scaled = isinstance(sizes, Distribution) and sizes.relative == "scale" and isinstance(sizes.tied, str)
    if "object_full_sizes" in bounds and not scaled:  # which keeps its proportions
        low, high = bounds["object_full_sizes"]
        for k in np.flatnonzero((nominal.object_kinds == "capsule") & (low[:, 0] <= high[:, 1])).tolist():
            what = {"length": low[k, 0], "diameter": high[k, 1]}
            problems.append(
                problem("ranges.object_full_sizes", "reach_capsule", ("object", labels.object[k]), None, what)
            )
    return problems


def _value_problems(name: str, bound: tuple[np.ndarray, np.ndarray], labels: Labels) -> list[Problem]:
    (quantity, rows), problems = labels.of(name), []
    if quantity.kind is not float:
        return []
    for values in bound:
        found = []
        varies = labels.terms[name].mask if name in labels.terms else True
        wrong = ~quantity.right(values) & varies
        for i in np.flatnonzero(wrong.any(tuple(range(1, wrong.ndim)))).tolist():
            rule, numbers = world_rules.broken(name, quantity, values[i])
            item = world_rules.item(quantity.of, rows[i])
            found.append(problem(path_of(name, labels), f"reach_{rule}", item, rounded(values[i]), numbers))
        problems += world_rules.joined(found, len(values))
    return problems


def _never_right(name: str, bound: tuple[np.ndarray, np.ndarray], nominal: Nominal, labels: Labels) -> list[Problem]:
    """Elements whose numbers break what they must be together in every draw: given ones, and those whose best ones do."""
    quantity, rows = labels.of(name)
    if quantity.together is None:
        return []
    low, high = (np.where(labels.terms[name].mask, b, nominal.params.terms[name]) for b in bound)
    together = quantity.together
    best = np.stack([low[:, 0], high[:, 1]], axis=1) if together.ordered else low
    if together.best is not None:
        best = np.asarray(together.best(low, high))
    given = (best == low).all(1) & (best == high).all(1)
    wrong = ~np.asarray(together.holds(best)) & (given | together.ordered | (together.best is not None))
    found = []
    for i in np.flatnonzero(wrong).tolist():
        item = world_rules.item(quantity.of, rows[i])
        found.append(problem(path_of(name, labels), together.name, item, rounded(best[i])))
    return world_rules.joined(found, len(best))


def _legs_problems(bounds: Bounds, labels: Labels) -> list[Problem]:
    low, thick = bounds["table_offsets"][0], bounds["table_full_sizes"][1]
    bad = np.flatnonzero(~geometry.legs_fit(low, thick, bounds["has_legs"][1].astype(bool)))
    found = []
    for t in bad.tolist():
        what = {"height": low[t, 2], "thickness": thick[t, 2]}
        found.append(problem("ranges", "reach_legs", ("table", labels.table[t]), None, what))
    return world_rules.joined(found, len(low))
