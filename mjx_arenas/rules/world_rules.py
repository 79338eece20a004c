"""What a world must be: one table of rules, which flags worlds on the device and finds their problems on the host.

T tables, K objects. A rule is a predicate that works with NumPy and with JAX, and the numbers that its sentence needs.
"""

import functools
import operator
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas import geometry, shapes
from mjx_arenas.geometry import Array
from mjx_arenas.params.params import QUANTITIES, ArenaParams, Quantity, Together
from mjx_arenas.problem import Item, Problem, problem, rounded
from mjx_arenas.rules import fixed_rules, furniture_rules, limit_rules, reach_rules, sliding_rules, unit_rules
from mjx_arenas.rules.rule import Held as Held
from mjx_arenas.rules.rule import Rule as Rule
from mjx_arenas.rules.rule import Rules as Rules
from mjx_arenas.sample import placement, poses, tops
from mjx_arenas.sample.variants import of_chosen, which
from mjx_arenas.spec import follow


def right(quantity: Quantity, values: Array) -> Array:
    """(N,) bool: all numbers of one table or object may be."""
    columns = quantity.right(values)
    return columns if columns.ndim == 1 else _both(columns[:, i] for i in range(columns.shape[1]))


def broken(name: str, quantity: Quantity, value: np.ndarray) -> tuple[str, dict[str, Any]]:
    """The rule that a wrong value of a quantity breaks, and its numbers."""
    signs = np.isfinite(value) & (True if quantity.allowed is None else quantity.allowed(value))
    return "limits" if np.all(signs) else "allowed", {"quantity": name if name in QUANTITIES else quantity}


def _value_rule(name: str, quantity: Quantity) -> Rule:
    def told(p: ArenaParams, r: Rules, i: int) -> dict[str, Any]:
        value = getattr(p, name)[i]
        rule, numbers = broken(name, quantity, value)
        return {"rule": rule, "got": value} | numbers

    return Rule("allowed", name, quantity.of, (name,), lambda p, r: right(quantity, getattr(p, name)), told)


def _legs_told(p: ArenaParams, r: Rules, t: int) -> dict[str, Any]:
    height, thickness = p.table_offsets[t, 2], p.table_full_sizes[t, 2]
    long = {"rule": "legs_long"} if p.table_full_sizes[t].max() > unit_rules.LONGEST else {}
    return {"height": height, "thickness": thickness, "least": thickness / 2, **long}


def _short_told(p: ArenaParams, r: Rules, _: Any) -> dict[str, Any]:
    one = r.follows[int(np.argmin(np.asarray(follow.long_enough(r.follows, p))))]
    return {"geom": one.geom, "table": r.called[one.table]}


def _n_surfaces(r: Rules) -> int:
    return r.n_tables + tops.count(r.ground)


def _index_right(p: ArenaParams, r: Rules) -> Array:
    return (p.object_tables >= 0) & (p.object_tables < _n_surfaces(r))


def _shape_told(p: ArenaParams, r: Rules, k: int) -> dict[str, Any]:
    return {"rule": f"shape_{r.object_kinds[k]}", "got": p.object_full_sizes[k]}


def _own_sizes(p: ArenaParams, r: Rules) -> Array:
    """(K, 3) the sizes of meshes, MJCF bodies and variants [m]; of others the nominal ones."""
    return of_chosen(r.variants, p.terms, "full_size", r.object_full_sizes)


def _file_told(p: ArenaParams, r: Rules, k: int) -> dict[str, Any]:
    told = {"wanted": rounded(_own_sizes(p, r)[k], 6).tolist(), "got": p.object_full_sizes[k]}
    for one in r.variants:
        if one.object == k:
            told |= {"rule": "of_variant", "name": r.object_names[k], "variant": one.names[which(one, p.terms)]}
    return told


def _laid(p: ArenaParams, r: Rules) -> poses.Lying:
    """How the objects lie."""
    k = len(r.object_names)
    return poses.lying(r.poses, r.variants, p, r.object_kinds, np.zeros((k, 4)), np.zeros((k, 3)))


def _larger_told(p: ArenaParams, r: Rules, k: int) -> dict[str, Any]:
    t = int(p.object_tables[k])
    below = tops.label(t, r.called, r.ground)
    top = np.maximum(tops.surfaces(p, r.ground).size[t], 0)  # below 0 where a part's numbers leave nothing of it
    return {"size": _laid(p, r).full_size[k, :2], "below": below, "top": top}


def _held(p: ArenaParams, r: Rules) -> Array:
    """(T + K,) bool: it is there, or may be absent."""
    if not r.held:
        return np.ones(1, bool)
    free = np.ones(r.n_tables + len(r.object_names), bool)
    free[list(r.held)] = False
    there = tops.present(p, r.ground)
    return geometry.array_module(*there).concatenate(there) | free


def _apart(p: ArenaParams, r: Rules) -> Array:
    """Two tables do not overlap, or do so by intent, or are not both there: (T, T) bool, or the same pairs in (T // 2, T)."""
    n = len(p.table_rots)
    if r.overlapping is None or n < 2:
        return np.ones((1, 1), bool)
    intended = r.overlapping | np.eye(n, dtype=bool)
    tops = p.table_offsets, p.table_rots, p.table_full_sizes
    if isinstance(p.table_rots, np.ndarray):
        depth, touching = geometry.overlaps(*tops)
        return (depth <= touching) | ~(p.table_active[:, None] & p.table_active[None]) | intended
    # On the device each pair once, table t with t + 1, t + 2 ...: a third of the time of all with all.
    slabs, held = geometry.slabs(*tops), []
    for shift in range(1, n // 2 + 1):
        others, there = jax.tree.map(lambda x, k=shift: jnp.concatenate([x[k:], x[:k]]), (slabs, p.table_active))
        depth, touching = geometry.overlap(slabs, others)
        held.append((depth <= touching) | ~(p.table_active & there) | np.roll(intended, -shift, 1).diagonal())
    return jnp.stack(held) if len(held) > 1 else held[0]


def overlap_told(p: ArenaParams, pair: tuple[int, int]) -> dict[str, Any]:
    """How far two tables' slabs that overlap are in each other (`furniture_rules.depths`)."""
    return furniture_rules.depths(p.table_offsets, p.table_rots, p.table_full_sizes, pair)


_keeps = jax.jit(placement.keeps)  # on the host: operation by operation it takes a hundred times as long


def _kept(p: ArenaParams, r: Rules, which: int) -> Array:
    if r.workspace is None:
        return np.ones((1, 1)[: which + 1], bool)
    on_host = isinstance(p.table_offsets, np.ndarray)
    return (_keeps if on_host else placement.keeps)(p, r.workspace)[which]


def _space_told(p: ArenaParams, r: Rules, i: object) -> dict[str, Any]:
    assert r.workspace is not None
    return {name: np.asarray(getattr(r.workspace, name), float).tolist() for name in ("low", "high", "gap")}


def _nothing(p: ArenaParams, r: Rules, i: object) -> dict[str, Any]:
    return {}


_VALUES = [_value_rule(name, quantity) for name, quantity in QUANTITIES.items() if quantity.kind is float]
_TOPS = ("table_offsets", "table_rots", "table_full_sizes")
_PRESENCE = ("table_active", "object_active", "object_tables")

RULES = (
    *(rule for rule in _VALUES if rule.of == "table"),
    Rule(
        "legs",
        "table_offsets",
        "table",
        ("table_offsets", "table_full_sizes", "has_legs"),
        lambda p, r: geometry.legs_fit(p.table_offsets, p.table_full_sizes, p.has_legs),
        _legs_told,
    ),
    Rule(
        "follow_short",
        "table_full_sizes",
        "world",
        ("table_offsets", "table_full_sizes"),
        lambda p, r: follow.long_enough(r.follows, p).all() if r.follows else np.True_,
        _short_told,
    ),
    *(rule for rule in _VALUES if rule.of == "object"),
    Rule(
        "table_number",
        "object_tables",
        "object",
        ("object_tables",),
        _index_right,
        lambda p, r, k: {"most": _n_surfaces(r) - 1, "got": p.object_tables[k]},
    ),
    Rule(
        "carried",
        "object_tables",
        "object",
        ("object_tables",),
        lambda p, r: tops.allowed(p, r.ground) if r.carriers else np.ones(len(r.object_names), bool),
        lambda p, r, k: {"got": p.object_tables[k], "on": tops.label(int(p.object_tables[k]), r.called, r.ground)},
    ),
    Rule(
        "shape",
        "object_full_sizes",
        "object",
        ("object_full_sizes",),
        lambda p, r: shapes.possible(r.object_kinds, p.object_full_sizes),
        _shape_told,
    ),
    Rule(
        "as_in_file",
        "object_full_sizes",
        "object",
        ("object_full_sizes",),
        lambda p, r: shapes.as_in_file(r.object_kinds, p.object_full_sizes, _own_sizes(p, r)),
        _file_told,
    ),
    Rule(
        "light",
        "object_masses",
        "object",
        ("object_masses", "object_full_sizes"),
        lambda p, r: shapes.heavy_enough(r.object_kinds, p.object_full_sizes, p.object_masses),
        lambda p, r, k: {"mass": p.object_masses[k], "least": mujoco.mjMINVAL},
    ),
    Rule(
        "larger",
        "objects",
        "object",
        ("object_full_sizes", "table_full_sizes", "object_tables"),
        lambda p, r: ~(placement.too_large(p, r.ground, _laid(p, r)) & tops.present(p, r.ground)[1]),
        _larger_told,
        shown=True,
    ),
    Rule("absent", "params", "any", _PRESENCE, _held, lambda p, r, i: {"why": r.held[i]}),
    Rule("overlap", "params", "tables", _TOPS, _apart, lambda p, r, pair: overlap_told(p, pair), shown=True),
    furniture_rules.APART,
    fixed_rules.APART,
    fixed_rules.ABOVE,
    fixed_rules.TOPS_ABOVE,
    reach_rules.REACH,
    limit_rules.APART,
    sliding_rules.GRIPS,
    Rule(
        "no_table",
        "params",
        "world",
        ("table_active",),
        lambda p, r: p.table_active.any() if r.drawn and r.n_tables else np.True_,
        _nothing,
        shown=True,
    ),
    Rule("outside", "params", "table", _TOPS, lambda p, r: _kept(p, r, 0), _space_told, shown=True),
    Rule("gap", "params", "tables", _TOPS, lambda p, r: _kept(p, r, 1), _space_told, shown=True),
    Rule("order", "ranges", "world", (), lambda p, r: r.ordered, _nothing, shown=True),
)


def _term_rules(rules: Rules) -> list[Rule]:
    """The limits of the numbers of terms."""

    def rule(name: str, quantity: Quantity, mask: np.ndarray) -> Rule:
        def told(p: ArenaParams, r: Rules, i: int) -> dict[str, Any]:
            value = p.terms[name][i]
            which, numbers = broken(name, quantity, value)
            return {"rule": which, "got": value} | numbers

        def holds(p: ArenaParams, r: Rules) -> Array:
            columns = quantity.right(p.terms[name]) | ~mask
            if columns.ndim == 1:
                return columns
            # `columns.all(-1)` would be a kernel for each quantity.
            return functools.reduce(operator.and_, (columns[:, k] for k in range(columns.shape[1])))

        return Rule("allowed", f"terms.{name}", "term", (), holds, told)

    def of_all(name: str, together: Together) -> Rule:
        def holds(p: ArenaParams, r: Rules) -> Array:
            return together.holds(p.terms[name])

        return Rule(together.name, f"terms.{name}", "term", (), holds, lambda p, r, i: {"got": p.terms[name][i]})

    def of_pose(one: poses.Poses) -> Rule:
        def holds(p: ArenaParams, r: Rules) -> Array:
            return poses.right(one, r.variants, p.terms)[None]

        def told(p: ArenaParams, r: Rules, i: int) -> dict[str, Any]:
            (own,) = (v for v in r.variants if v.object == one.object)
            n, of = int(one.n_poses[which(own, p.terms)]), f"variant {own.names[which(own, p.terms)]!r}"
            return {"n": n, "of": of, "poses": "poses" if n > 1 else "pose", "got": p.terms[one.quantity][0]}

        return Rule("pose_of_variant", f"terms.{one.quantity}", "term", (), holds, told)

    rules_of_all = [(name, one.quantity.together) for name, one in rules.terms.items()]
    found = [of_pose(one) for one in rules.poses if len(one.n_poses) > 1 and one.quantity in rules.terms]
    return [*found, *(of_all(name, together) for name, together in rules_of_all if together is not None)] + [
        rule(name, one.quantity, one.mask) for name, one in rules.terms.items() if one.quantity.kind is float
    ]


def hold(params: ArenaParams, rules: Rules, table: Sequence[Rule]) -> jax.Array:
    """() bool: all hold; JAX. Those of one shape are joined first, so that a compiler makes one kernel of it."""
    by_shape: dict[tuple[int, ...], list[Array]] = {}
    for rule in [*table, *_term_rules(rules), *furniture_rules.conditions(rules)]:
        held = rule.holds(params, rules)
        by_shape.setdefault(np.shape(held), []).append(held)
    return _both(jnp.all(functools.reduce(jnp.logical_and, held)) for held in by_shape.values())


def problems(params: ArenaParams, rules: Rules, table: Sequence[Rule]) -> list[Problem]:
    """What is wrong with a world; NumPy. A quantity that is None was refused already."""
    given = {name: getattr(params, name) for name in QUANTITIES}
    wrong = {name: np.zeros(len(value), bool) for name, value in given.items() if value is not None}
    found: list[Problem] = []
    on = params.object_tables
    if on is not None:
        params = params._replace(object_tables=np.clip(on, 0, _n_surfaces(rules) - 1))
    for rule in [*table, *_term_rules(rules), *furniture_rules.conditions(rules)]:
        if not wrong.keys() >= set(rule.reads):
            continue
        given = params._replace(object_tables=on) if rule.path == "object_tables" else params
        with np.errstate(all="ignore"):  # of other numbers, which are wrong
            held = np.asarray(rule.holds(given, rules))
            bad = [i for i in _failing(held, rule.of) if not _read_wrong(rule, i, wrong, params)]
            told = [_problem(rule, i, rule.told(given, rules, i), rules) for i in bad]
        found += joined(told, held.size if rule.path in QUANTITIES or rule.of == "term" else 0)
        if rule.of in ("table", "object") and rule.path in wrong:
            wrong[rule.path][bad] = True
    return found


def joined(problems: list[Problem], n: int) -> list[Problem]:
    """One problem for all of `n` tables or objects, where it is the same with each."""
    if len(problems) < 2 or len(problems) != n or problems[0].item is None:
        return problems
    told = {(p.item and p.item[0], p.rule, repr(p.got), repr(p.numbers)) for p in problems}
    return [problems[0]._replace(item=(problems[0].item[0], None))] if len(told) == 1 else problems


def item(of: str, which: Any) -> Item:
    """A table by its number, or what else there is by its name."""
    return (of, which)


def _failing(held: np.ndarray, of: str) -> list[Any]:
    if of == "world":
        return [] if held else [None]
    if of == "tables":
        return [(int(a), int(b)) for a, b in np.argwhere(np.triu(~held))]
    return np.flatnonzero(~held).tolist()


def _problem(rule: Rule, i: Any, told: Mapping[str, Any], rules: Rules) -> Problem:
    names, n_tables = rules.object_names, rules.n_tables
    which: Item | None = ("tables", tuple(rules.called[t] for t in i)) if rule.of == "tables" else None
    if rule.of == "term":
        of = rules.terms[rule.path.removeprefix("terms.")]
        which = (of.quantity.of, of.elements[i])
    if rule.of == "table" or (rule.of == "any" and i < n_tables):
        which = item("table", rules.called[i])
    elif rule.of in ("object", "any"):
        which = item("object", names[i - n_tables if rule.of == "any" else i])
    numbers = dict(told)
    return problem(rule.path, numbers.pop("rule", rule.name), which, numbers.pop("got", None), numbers)


def _read_wrong(rule: Rule, i: Any, wrong: Mapping[str, np.ndarray], params: ArenaParams) -> bool:
    """Whether one of the numbers that a rule reads is wrong by itself."""
    if rule.of in ("world", "any"):
        return False
    for name in rule.reads:
        own = QUANTITIES[name].of == rule.of or rule.of == "tables"
        rows = list(i) if rule.of == "tables" else [i] if own else [params.object_tables[i]]
        if np.any(wrong[name][[row for row in rows if row < len(wrong[name])]]):
            return True
    return False


def _both(terms: Iterable[Array]) -> Array:
    return functools.reduce(operator.and_, terms)
