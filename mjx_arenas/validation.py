"""Answers to bad input: all problems of one call, a sentence each, in one error (host).

Every sentence names the argument, where in it, what came and what is allowed.
"""

import itertools
import warnings
from collections.abc import Iterable, Sequence

import jax
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.distributions import Bernoulli, Distribution
from mjx_arenas.objects import Object
from mjx_arenas.params import ArenaParams, ArenaRanges

ITEM_SHAPES = {
    "table_offsets": (3,),
    "table_rots": (),
    "table_full_sizes": (3,),
    "table_frictions": (3,),
    "has_legs": (),
}
AXES = {
    "table_offsets": "x, y, z",
    "table_full_sizes": "length, width, thickness",
    "table_frictions": "sliding, torsional, rolling",
}


def raise_all(problems: Iterable[str], where: str) -> None:
    """Raises one `ValueError` with all problems, if there are any."""
    problems = list(problems)
    if len(problems) == 1:
        raise ValueError(problems[0])
    if problems:
        raise ValueError(f"{len(problems)} problems in {where}:\n" + "\n".join(f"- {p}" for p in problems))


def show(value: object) -> str:
    """A value as a message shows it: numbers without their type."""
    try:
        return str(np.asarray(value).tolist())
    except ValueError:
        return repr(value)


class Arguments:
    """Reads the per-table arguments of an arena into arrays, collecting problems.

    Args:
        singular: `TableArena`'s names (`table_full_size`), without an index, instead of `MultiTableArena`'s.
    """

    def __init__(self, singular: bool) -> None:
        self.singular = singular
        self.problems: list[str] = []

    def name(self, quantity: str) -> str:
        """The argument's name."""
        return quantity.removesuffix("s") if self.singular and quantity != "has_legs" else quantity

    def of_table(self, quantity: str, t: int | np.integer) -> str:
        """The argument and, where it has one, the table's index."""
        return f"`{self.name(quantity)}`" + ("" if self.singular else f" of table {t}")

    def params(
        self, offsets: object, rots: object, full_sizes: object, frictions: object, has_legs: object
    ) -> ArenaParams:
        """The nominal parameters, read-only, as far as they make sense; else `problems` says why not."""
        offsets = self.offsets([offsets] if self.singular else offsets)
        given = (
            ("table_rots", rots),
            ("table_full_sizes", full_sizes),
            ("table_frictions", frictions),
            ("has_legs", has_legs),
        )
        per_table = {name: self.per_table(name, value, len(offsets)) for name, value in given}
        params = ArenaParams(table_offsets=offsets, **per_table)  # type: ignore[arg-type]
        if not self.problems:
            self.problems += table_problems(params, self)
            for array in params:
                array.setflags(write=False)
        return params

    def offsets(self, value: object) -> np.ndarray:
        """(T, 3) offsets; their length is the number of tables."""
        array = self._numbers("table_offsets", value)
        if array is None or array.ndim != 2 or array.shape[1:] != (3,) or array.shape[0] == 0:
            if array is not None:
                must = "must be (x, y, z)" if self.singular else "must be one (x, y, z) per table, at least one table"
                shape, shown = (array.shape[1:], value[0]) if self.singular else (array.shape, value)  # type: ignore[index]
                self.problems.append(f"`{self.name('table_offsets')}` {must}, got shape {shape}: {show(shown)}.")
            return np.array([[0.0, 0.0, 0.8]])
        return array

    def per_table(self, quantity: str, value: object, n_tables: int) -> np.ndarray | None:
        """(T, ...) values, from one for all tables or one for each."""
        item = ITEM_SHAPES[quantity]
        array = self._booleans(quantity, value) if quantity == "has_legs" else self._numbers(quantity, value)
        if array is None:
            return None
        if array.shape == item:
            return np.broadcast_to(array, (n_tables, *item)).copy()
        if array.shape == (n_tables, *item) and not self.singular:
            return array
        one = f"({AXES[quantity]})" if item else "one value"
        each = "" if self.singular else f", or one such for each of the {n_tables} tables"
        self.problems.append(f"`{self.name(quantity)}` must be {one}{each}, got {_shaped(array)}: {show(value)}.")
        return None

    def _numbers(self, quantity: str, value: object) -> np.ndarray | None:
        try:
            array = np.array(value, float)
        except (TypeError, ValueError):
            array = None
        if array is None or (hasattr(value, "dtype") and getattr(value.dtype, "kind", "f") not in "fiu"):
            self.problems.append(f"`{self.name(quantity)}` must be numbers in a regular array, got {value!r}.")
            return None
        return array

    def _booleans(self, quantity: str, value: object) -> np.ndarray | None:
        array = None if isinstance(value, str) else _array_or_none(value)
        if array is None or array.dtype.kind not in "biuf" or not np.isin(array, (0, 1)).all():
            self.problems.append(f"`{quantity}` must be true or false, got {value!r}.")
            return None
        return array.astype(bool)


def _array_or_none(value: object) -> np.ndarray | None:
    try:
        return np.asarray(value)
    except ValueError:
        return None


def _shaped(array: np.ndarray) -> str:
    return f"shape {array.shape}" if array.ndim else "one number"


def table_problems(params: ArenaParams, arguments: Arguments) -> list[str]:
    """What is wrong with the values of an arena's tables, (T, ...) arrays."""
    problems = []
    rules = (
        ("table_offsets", np.isfinite, "must be finite [m]"),
        ("table_rots", np.isfinite, "must be finite [rad]"),
        ("table_full_sizes", lambda v: np.isfinite(v) & (v > 0), "must be finite and > 0 on every axis [m]"),
        ("table_frictions", lambda v: np.isfinite(v) & (v >= 0), "must be finite and >= 0 on every axis"),
    )
    for quantity, allowed, must in rules:
        value = getattr(params, quantity)
        for t in range(len(value)):
            if not np.all(allowed(value[t])):
                problems.append(f"{arguments.of_table(quantity, t)} {must}, got {show(value[t])}.")
    height, half = params.table_offsets[:, 2], params.table_full_sizes[:, 2] / 2
    for t in np.flatnonzero(params.has_legs & (height <= half)):
        problems.append(
            f"{arguments.of_table('table_offsets', t)} has its top at z = {height[t]:g} m, which leaves no room for legs under a slab "
            f"{2 * half[t]:g} m thick: with `has_legs`, z must be > {half[t]:g}."
        )
    return problems


def object_problems(
    objects: Sequence[Object], table_names: Sequence[str], taken: set[str]
) -> tuple[list[str], list[int]]:
    """What is wrong with the objects of an arena, and the table's index of each."""
    problems, tables = [], []
    seen: set[str] = set()
    for k, obj in enumerate(objects):
        if not isinstance(obj, Object):
            problems.append(f"`objects[{k}]` must be an mjx_arenas.Object, got {obj!r}.")
            continue
        problems += obj.problems()
        if obj.name in seen:
            problems.append(f"Two objects are named {obj.name!r}: names must differ.")
        elif obj.name in taken:
            problems.append(f"Object {obj.name!r}: the arena already has an element of that name.")
        seen.add(obj.name)
        index = table_names.index(obj.table) if obj.table in table_names else obj.table
        if isinstance(index, bool) or not isinstance(index, (int, np.integer)) or not 0 <= index < len(table_names):
            known = ", ".join(repr(n) for n in table_names)
            problems.append(
                f"Object {obj.name!r}: `table` must be an index from 0 to {len(table_names) - 1} or one of {known}, got {obj.table!r}."
            )
            index = 0
        tables.append(int(index))
    return problems, tables


def table_option_problems(priority: object, condim: object) -> list[str]:
    """What is wrong with the options of the tables' contacts."""
    problems = []
    if isinstance(priority, bool) or not isinstance(priority, (int, np.integer)):
        problems.append(f"`table_priority` must be an integer, got {priority!r}.")
    if condim not in (1, 3, 4, 6):
        problems.append(f"`table_condim` must be 1, 3, 4 or 6, got {condim!r}.")
    return problems


def shape_problems(params: ArenaParams, n_tables: int) -> list[str]:
    """Parameters that do not have the shapes of one world."""
    problems = []
    for quantity, item in ITEM_SHAPES.items():
        shape = np.shape(getattr(params, quantity))
        if shape != (n_tables, *item):
            problems.append(f"`params.{quantity}` must have shape {(n_tables, *item)} (one world), got {shape}.")
    return problems


def params_problems(params: ArenaParams, n_tables: int) -> list[str]:
    """What is wrong with one world's parameters that are to be used on the host."""
    return shape_problems(params, n_tables) or table_problems(params, Arguments(singular=False))


def ranges_problems(ranges: ArenaRanges, nominal: ArenaParams) -> list[str]:
    """What is wrong with ranges, of values that are known: those being traced are left to the device's `valid` flag."""
    problems = []
    bounds = {}
    n_tables = len(nominal.table_offsets)
    for quantity, dist in ranges._asdict().items():
        nominal_value = np.asarray(getattr(nominal, quantity))
        found = [] if dist is None else _distribution_problems(quantity, dist, nominal_value)
        problems += found
        if dist is None or found:
            bounds[quantity] = (nominal_value, nominal_value)
        elif not _traced(dist):
            bounds[quantity] = reach(dist, nominal_value)
    if not problems:
        problems += _reach_problems(bounds, n_tables)
    return problems


def reach(dist: Distribution, nominal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest value that a quantity, of `nominal`'s shape, can take."""
    low, high = (np.broadcast_to(b, nominal.shape) for b in dist.support())
    if dist.relative == "add":
        return nominal + low, nominal + high
    if dist.relative == "scale":
        return np.minimum(nominal * low, nominal * high), np.maximum(nominal * low, nominal * high)
    return low, high


def _traced(dist: Distribution) -> bool:
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(dist))


def _distribution_problems(quantity: str, dist: object, nominal: np.ndarray) -> list[str]:
    where = f"`ranges.{quantity}`"
    if not isinstance(dist, Distribution):
        return [f"{where} must be a distribution such as Uniform(low, high), or None, got {dist!r}."]
    where += f" ({type(dist).__name__})"
    if quantity == "has_legs" and dist.relative is not None:
        return [f"{where}: true and false cannot be relative to a nominal value, got relative={dist.relative!r}."]
    if quantity != "has_legs" and isinstance(dist, Bernoulli):
        return [f"{where}: Bernoulli gives true or false; it serves `has_legs` only."]
    if dist.relative not in (None, "add", "scale"):
        return [f"{where}: `relative` must be None, 'add' or 'scale', got {dist.relative!r}."]
    tied = np.shape(dist.tied)
    if tied not in ((), nominal.shape[1:]) or (tied and dist.per_table):
        return [f"{where}: `tied` must be true, false or one of them per axis, got {dist.tied!r}."]
    problems = _leaf_problems(where, dist, nominal)
    if not problems and not _traced(dist):
        problems = [f"{where}: {problem}." for problem in dist.problems()]
    return problems


def _leaf_problems(where: str, dist: Distribution, nominal: np.ndarray) -> list[str]:
    problems = []
    for path, leaf in jax.tree_util.tree_leaves_with_path(dist):
        name = path[0].name
        if len(path) > 1 or not (np.isscalar(leaf) or hasattr(leaf, "shape")):
            problems.append(f"{where}: `{name}` must be numbers in a regular array, got {show(getattr(dist, name))}.")
            continue
        if isinstance(leaf, jax.core.Tracer):
            continue
        array = np.asarray(leaf)
        if array.dtype.kind not in "biuf":
            problems.append(f"{where}: `{name}` must be numbers, got {leaf!r}.")
        elif not np.all(np.isfinite(array)):
            problems.append(f"{where}: `{name}` must be finite, got {show(leaf)}.")
        elif name != "p" and not _fits(
            array.shape[1:] if dist.per_table else array.shape, nominal.shape[1:] if dist.per_table else nominal.shape
        ):
            shapes = f"one number{', ' + str(nominal.shape[1:]) if nominal.ndim > 1 else ''} or {nominal.shape}"
            if dist.per_table:
                shapes = f"(N, {nominal.shape[1]})" if nominal.ndim > 1 else "(N,)"
            problems.append(f"{where}: `{name}` must be {shapes}, got shape {array.shape}.")
    return problems


def _fits(shape: tuple[int, ...], target: tuple[int, ...]) -> bool:
    try:
        return np.broadcast_shapes(shape, target) == target
    except ValueError:
        return False


def _reach_problems(bounds: dict[str, tuple[np.ndarray, np.ndarray]], n_tables: int) -> list[str]:
    """What some draw could do wrong."""
    problems = []
    for quantity, must, strict in (("table_full_sizes", "> 0 [m]", True), ("table_frictions", ">= 0", False)):
        if quantity not in bounds:
            continue
        low = bounds[quantity][0]
        for t in range(n_tables):
            if np.any(low[t] <= 0 if strict else low[t] < 0):
                problems.append(
                    f"`ranges.{quantity}` can reach {show(np.round(low[t], 6))} on table {t}: it must stay {must} on every axis."
                )
    if {"table_offsets", "table_full_sizes", "has_legs"} <= bounds.keys():
        lowest, thickest = bounds["table_offsets"][0][:, 2], bounds["table_full_sizes"][1][:, 2]
        for t in np.flatnonzero(bounds["has_legs"][1].astype(bool) & (lowest <= thickest / 2)):
            problems.append(
                f"`ranges` can put the top of table {t} at z = {lowest[t]:g} m with a slab {thickest[t]:g} m thick, which leaves no room for "
                f"legs: keep z > thickness / 2, or give `has_legs` a distribution that is always false."
            )
    return problems


def warn_of_idle_friction(ranges: ArenaRanges, nominal: ArenaParams, condim: int) -> None:
    """Warns if torsional or rolling friction varies where contacts of dimension `condim` do not use it."""
    dist = ranges.table_frictions
    if dist is None or condim >= 6 or _traced(dist):
        return
    low, high = reach(dist, np.asarray(nominal.table_frictions))
    used = 2 if condim == 4 else 1
    if np.any(low[:, used:] != high[:, used:]):
        idle = "rolling friction has" if condim == 4 else "torsional and rolling friction have"
        warnings.warn(
            f"`ranges.table_frictions` varies more than its effect: with table_condim={condim}, {idle} none.",
            stacklevel=4,
        )


def warn_of_overlaps(params: ArenaParams, table_names: Sequence[str]) -> None:
    """Warns of each pair of slabs that overlap, with the depth."""
    for a, b in itertools.combinations(range(len(table_names)), 2):
        depth = overlap_depth(params, a, b)
        if depth > 1e-9:
            warnings.warn(f"Tables {table_names[a]!r} and {table_names[b]!r} overlap by {depth:.3f} m.", stacklevel=4)


def overlap_depth(params: ArenaParams, a: int, b: int) -> float:
    """How far two slabs would have to move apart [m]; 0 or less if they do not overlap.

    Separating axes of two upright boxes: z, and the sides of both in the plane.
    """
    table = geometry.table(params.table_offsets, params.table_rots, params.table_full_sizes, params.has_legs)
    half = table.half_size[[a, b]]
    delta = table.body_pos[b] - table.body_pos[a]
    depths = [half[:, 2].sum() - abs(delta[2])]
    yaws = params.table_rots[[a, b]]
    for yaw in (yaws[0], yaws[0] + np.pi / 2, yaws[1], yaws[1] + np.pi / 2):
        axis = np.array([np.cos(yaw), np.sin(yaw)])
        radii = (half[:, 0] * abs(np.cos(yaws - yaw)) + half[:, 1] * abs(np.sin(yaws - yaw))).sum()
        depths.append(radii - abs(delta[:2] @ axis))
    return float(min(depths))
