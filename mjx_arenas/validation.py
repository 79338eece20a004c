"""Answers to bad input: all problems of one call, a sentence each, in one error (host).

Every sentence names the argument, where in it, what came and what is allowed. Ranges are in `validation_ranges`.
"""

import itertools
import warnings
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import geometry
from mjx_arenas.objects import Object
from mjx_arenas.params import ArenaParams

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
VALUE_RULES: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]] = {
    "table_offsets": (np.isfinite, "must be finite [m]"),
    "table_rots": (np.isfinite, "must be finite [rad]"),
    "table_full_sizes": (lambda v: np.isfinite(v) & (v > 0), "must be finite and > 0 on every axis [m]"),
    "table_frictions": (lambda v: np.isfinite(v) & (v >= 0), "must be finite and >= 0 on every axis"),
}


def raise_all(problems: Iterable[str], where: str) -> None:
    """Raises one `ValueError` with all problems, if there are any."""
    problems = list(dict.fromkeys(problems))
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


def of_tables(bad: Sequence[int] | np.ndarray, values: np.ndarray) -> list[tuple[str, int]]:
    """Which tables a sentence is about, and one of them: all in one sentence if all are alike."""
    bad = [int(t) for t in bad]
    if len(bad) > 1 and len(bad) == len(values) and all(np.array_equal(values[0], v, equal_nan=True) for v in values):
        return [(" of all tables", 0)]
    return [(f" of table {t}", t) for t in bad]


class Arguments:
    """Reads the per-table arguments of an arena into arrays, collecting problems.

    Args:
        singular: `TableArena`'s names (`table_full_size`), without an index, instead of `MultiTableArena`'s.
    """

    def __init__(self, singular: bool) -> None:
        self.singular = singular
        self.problems: list[str] = []

    def params(
        self, offsets: object, rots: object, full_sizes: object, frictions: object, has_legs: object
    ) -> ArenaParams:
        """The nominal parameters, read-only; None for those that make no sense: `problems` says why."""
        table_offsets = self._offsets([offsets] if self.singular else offsets)
        n_tables = None if table_offsets is None else len(table_offsets)
        params = ArenaParams(
            table_offsets,
            self._per_table("table_rots", rots, n_tables),
            self._per_table("table_full_sizes", full_sizes, n_tables),
            self._per_table("table_frictions", frictions, n_tables),
            self._per_table("has_legs", has_legs, n_tables),
        )
        self.problems += value_problems(params, self)
        for array in params:
            if array is not None:
                array.setflags(write=False)
        return params

    def name(self, quantity: str) -> str:
        """The argument's name."""
        return quantity.removesuffix("s") if self.singular and quantity != "has_legs" else quantity

    def tables(self, quantity: str, bad: np.ndarray, values: np.ndarray) -> list[tuple[str, int]]:
        """The argument with the tables that it is about, and one of them."""
        if self.singular:
            return [(f"`{self.name(quantity)}`", t) for t in bad]
        return [(f"`{quantity}`{of}", t) for of, t in of_tables(bad, values)]

    def _offsets(self, value: object) -> np.ndarray | None:
        """(T, 3) offsets; their length is the number of tables."""
        array = self._numbers("table_offsets", value)
        if array is None or (array.ndim == 2 and array.shape[1:] == (3,) and len(array)):
            return array
        must = "must be (x, y, z)" if self.singular else "must be one (x, y, z) per table, at least one table"
        shape, shown = (array.shape[1:], value[0]) if self.singular else (array.shape, value)  # type: ignore[index]
        self.problems.append(f"`{self.name('table_offsets')}` {must}, got shape {shape}: {show(shown)}.")
        return None

    def _per_table(self, quantity: str, value: object, n_tables: int | None) -> np.ndarray | None:
        """(T, ...) values, from one for all tables or one for each."""
        item = ITEM_SHAPES[quantity]
        array = self._booleans(quantity, value) if quantity == "has_legs" else self._numbers(quantity, value)
        if array is None or n_tables is None:
            return None
        if array.shape == item:
            return np.broadcast_to(array, (n_tables, *item)).copy()
        if array.shape == (n_tables, *item) and not self.singular:
            return array
        one = f"({AXES[quantity]})" if item else "one value"
        each = "" if self.singular else f", or one such for each of the {n_tables} tables"
        shape = f"shape {array.shape}" if array.ndim else "one number"
        self.problems.append(f"`{self.name(quantity)}` must be {one}{each}, got {shape}: {show(value)}.")
        return None

    def _numbers(self, quantity: str, value: object) -> np.ndarray | None:
        try:
            kind = np.asarray(value).dtype.kind
            array = np.array(value, float) if kind in "fiu" else None
        except (TypeError, ValueError):
            array = None
        if array is None:
            self.problems.append(f"`{self.name(quantity)}` must be numbers in a regular array, got {value!r}.")
        return array

    def _booleans(self, quantity: str, value: object) -> np.ndarray | None:
        try:
            array = np.asarray(value)
        except ValueError:
            array = np.asarray("ragged")
        if array.dtype.kind not in "biuf" or not np.isin(array, (0, 1)).all():
            self.problems.append(f"`{quantity}` must be true or false, got {value!r}.")
            return None
        return array.astype(bool)


def value_problems(params: ArenaParams, arguments: Arguments) -> list[str]:
    """What is wrong with the values of an arena's tables, (T, ...) arrays; None has been reported already."""
    problems = []
    for quantity, (allowed, must) in VALUE_RULES.items():
        values = getattr(params, quantity)
        if values is None:
            continue
        bad = np.flatnonzero(~allowed(values).reshape(len(values), -1).all(-1))
        problems += [f"{what} {must}, got {show(values[t])}." for what, t in arguments.tables(quantity, bad, values)]
    if any(p is None for p in (params.table_offsets, params.table_full_sizes, params.has_legs)):
        return problems
    height, thickness = params.table_offsets[:, 2], params.table_full_sizes[:, 2]
    bad = np.flatnonzero(params.has_legs & (height <= thickness / 2) & (thickness > 0))
    for what, t in arguments.tables("table_offsets", bad, np.stack([height, thickness], axis=1)):
        problems.append(
            f"{what} puts the top at z = {height[t]:g} m, which leaves no room for legs under a slab {thickness[t]:g} m thick: "
            f"with `has_legs`, z must be > {thickness[t] / 2:g}."
        )
    return problems


def object_problems(objects: object, table_names: Sequence[str] | None, taken: set[str]) -> tuple[list[str], list[int]]:
    """What is wrong with the objects of an arena, and the index of each one's table (names None: not known)."""
    if isinstance(objects, (str, Object)) or not isinstance(objects, Iterable):
        return [f"`objects` must be a sequence of mjx_arenas.Object, got {objects!r}."], []
    problems, tables = [], []
    seen: set[str] = set()
    for k, obj in enumerate(objects):
        if not isinstance(obj, Object):
            problems.append(f"`objects[{k}]` must be an mjx_arenas.Object, got {obj!r}.")
            continue
        problems += obj.problems()
        if obj.name in seen:
            problems.append(f"Two objects are named {obj.name!r}: names must differ.")
        elif {obj.name, f"{obj.name}_g0", f"{obj.name}_joint0"} & taken:
            problems.append(f"Object {obj.name!r}: the arena already has an element of that name.")
        seen.add(obj.name)
        if table_names is None:
            continue
        index = table_names.index(obj.table) if obj.table in table_names else obj.table
        if isinstance(index, bool) or not isinstance(index, (int, np.integer)) or not 0 <= index < len(table_names):
            known = f"an index from 0 to {len(table_names) - 1} or one of {', '.join(map(repr, table_names))}"
            if len(table_names) == 1:
                known = f"0 or {table_names[0]!r}"
            problems.append(f"Object {obj.name!r}: `table` must be {known}, got {obj.table!r}.")
        else:
            tables.append(int(index))
    return problems, tables


def table_option_problems(priority: object, condim: object) -> list[str]:
    """What is wrong with the options of the tables' contacts."""
    problems = []
    if isinstance(priority, bool) or not isinstance(priority, (int, np.integer)):
        problems.append(f"`table_priority` must be an integer, got {priority!r}.")
    if condim is not None and (isinstance(condim, bool) or condim not in (1, 3, 4, 6)):
        problems.append(f"`table_condim` must be 1, 3, 4 or 6, got {condim!r}.")
    return problems


def shape_problems(params: ArenaParams, n_tables: int) -> list[str]:
    """Parameters that do not have the shapes of one world."""
    problems = []
    for quantity, item in ITEM_SHAPES.items():
        want, got = (n_tables, *item), np.shape(getattr(params, quantity))
        if got != want:
            hint = ": take one world of a batch, batch.world(i)" if got[1:] == want else ""
            problems.append(f"`params.{quantity}` must have shape {want}, got {got}{hint}.")
    return problems


def params_problems(params: ArenaParams, n_tables: int) -> list[str]:
    """What is wrong with one world's parameters that are to be used on the host."""
    return shape_problems(params, n_tables) or value_problems(params, Arguments(singular=False))


def batch_shape_problems(params: ArenaParams, n_tables: int) -> list[str]:
    """Parameters that do not have the shapes of W worlds."""
    lengths = {np.shape(p)[0] if np.ndim(p) else None for p in params}
    if len(lengths) != 1 or None in lengths:
        shapes = ", ".join(f"{name} {np.shape(p)}" for name, p in params._asdict().items())
        return [f"`params` must be (W, ...) of the same W worlds in every field, got {shapes}."]
    problems = shape_problems(_first(params), n_tables)
    return [p.replace(" must have shape (", " must have shape (W, ").replace(",)", ")") for p in problems]


def _first(params: ArenaParams) -> ArenaParams:
    return ArenaParams(*(p[0] for p in params))


def key_problems(name: str, keys: Any, n_worlds: int | None = None) -> list[str]:
    """Keys that are not one for each of W worlds: (W,) typed ones or (W, 2) of the old kind."""
    if not hasattr(keys, "dtype") or not hasattr(keys, "ndim"):
        return [f"`{name}` must be an array of keys such as jax.random.split(key, n_worlds), got {keys!r}."]
    if n_worlds is not None and keys.ndim and len(keys) != n_worlds:
        return [f"`{name}` must be one for each of the {n_worlds} worlds, got {len(keys)}."]
    typed = jnp.issubdtype(keys.dtype, jax.dtypes.prng_key)
    if keys.ndim == (1 if typed else 2):
        return []
    return [
        f"`{name}` must be one key per world, shape (W,) or, of jax.random.PRNGKey, (W, 2), got shape {keys.shape}."
    ]


def model_problems(model: mjx.Model, mj_model: mujoco.MjModel) -> list[str]:
    """An `mjx.Model` that was not put on the device from this arena's."""
    if not isinstance(model, mjx.Model):
        return [f"`model` must be an mjx.Model, from put_model(), got {type(model).__name__}."]
    sizes = ("nbody", "ngeom", "nsite", "nq", "nv")
    if any(
        getattr(model, name).ndim != 2 for name in ("body_pos", "body_quat", "geom_size", "geom_friction", "geom_rgba")
    ):
        return [
            "`model` must be of one world, got one with batched leaves: randomize and apply start from put_model()."
        ]
    if all(getattr(model, n) == getattr(mj_model, n) for n in sizes) and np.array_equal(
        [model.geom_bodyid, model.geom_type], [mj_model.geom_bodyid, mj_model.geom_type]
    ):
        return []
    got, want = (", ".join(f"{n} {getattr(m, n)}" for n in sizes) for m in (model, mj_model))
    return [f"`model` must come from this arena's put_model() ({want}), got another model ({got})."]


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
