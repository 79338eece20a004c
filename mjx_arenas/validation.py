"""Answers to bad input: all problems of one call, a sentence each, in one error (host).

Every sentence names the argument, where in it, what came and what is allowed. Ranges are in `validation_ranges`.
"""

import itertools
import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import geometry
from mjx_arenas.objects import Object
from mjx_arenas.params import QUANTITIES, ArenaParams, present

LISTED = 30  # problems in one error


def raise_all(problems: Iterable[str], where: str) -> None:
    """Raises one `ValueError` with all problems, if there are any."""
    problems = list(dict.fromkeys(problems))
    if len(problems) == 1:
        raise ValueError(problems[0])
    if problems:
        more = [f"and {len(problems) - LISTED} more"] if len(problems) > LISTED else []
        listed = "\n".join(f"- {p}" for p in [*problems[:LISTED], *more])
        raise ValueError(f"{len(problems)} problems in {where}:\n{listed}")


def problems_of(error: Exception) -> list[str]:
    """The problems that an error of `raise_all` lists, or the one that another error is."""
    first, *listed = str(error).split("\n- ")
    return listed or [first]


def is_whole(value: object, least: float = -np.inf, most: float = np.inf) -> bool:
    """Whether a value is a whole number within limits, Python's or NumPy's; true and false are none."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool) and bool(least <= value <= most)


def whole(name: str, value: Any, least: int, most: float = np.inf, must: str = "") -> int:
    """An argument that is a whole number within limits, as Python's; `must` says in words what it must be, if not that."""
    if not is_whole(value, least, most):
        raise ValueError(f"`{name}` must be {must or f'a whole number >= {least}'}, got {brief(value)}.")
    return int(value)


def is_number(value: object) -> bool:
    """Whether a value is one number, of Python, NumPy or JAX; true and false are none."""
    one = isinstance(value, (int, float, np.generic, np.ndarray, jax.Array)) and np.ndim(value) == 0
    return one and np.asarray(value).dtype.kind in "iuf"


def show(value: object) -> str:
    """A value as a message shows it: numbers without their type."""
    try:
        return brief(np.asarray(value).tolist())
    except ValueError:
        return brief(value)


def brief(value: object) -> str:
    """A value, or, where it takes more than a line, what it is."""
    text = repr(value)
    if len(text) <= 200 and "\n" not in text:
        return text
    return f"{text[:100]} ..." if isinstance(value, (list, str)) else f"{type(value).__module__}.{type(value).__name__}"


def of_items(bad: Sequence[int] | np.ndarray, values: np.ndarray, labels: Sequence[str]) -> list[tuple[str, int]]:
    """Which tables or objects a sentence is about, and one of them: all in one sentence if all are alike."""
    bad = [int(i) for i in bad]
    if len(bad) > 1 and len(bad) == len(values) and all(np.array_equal(values[0], v, equal_nan=True) for v in values):
        kind = "tables" if labels[0].startswith("table") else "objects"
        return [(f" of all {kind}", 0)]
    return [(f" of {labels[i]}", i) for i in bad]


def labels(n_tables: int, object_names: Sequence[str] = ()) -> dict[str, list[str]]:
    """What sentences call the tables and the objects."""
    return {"table": [f"table {t}" for t in range(n_tables)], "object": [f"object {name!r}" for name in object_names]}


class Arguments:
    """Reads the per-table arguments of an arena into arrays, collecting problems.

    Args:
        singular: `TableArena`'s names (`table_full_size`), without an index, instead of `MultiTableArena`'s.
    """

    def __init__(self, singular: bool) -> None:
        self.singular = singular
        self.problems: list[str] = []

    def table_params(self, **given: object) -> dict[str, np.ndarray | None]:
        """The tables' nominal parameters, read-only, by name; None for those that make no sense: `problems` says why."""
        offsets = given.pop("table_offsets")
        table_offsets = self._offsets([offsets] if self.singular else offsets)
        n_tables = None if table_offsets is None else len(table_offsets)
        params: dict[str, np.ndarray | None] = {"table_offsets": table_offsets}
        params |= {name: self._per_table(name, value, n_tables) for name, value in given.items()}
        self.problems += value_problems(params, labels(n_tables or 0), self)
        for array in params.values():
            if array is not None:
                array.setflags(write=False)
        return params

    def name(self, quantity: str) -> str:
        """The argument's name."""
        if not self.singular or quantity == "has_legs":
            return quantity
        return quantity.removesuffix("s")

    def items(self, quantity: str, bad: np.ndarray, values: np.ndarray, labels: Sequence[str]) -> list[tuple[str, int]]:
        """The argument with the tables or objects that it is about, and one of them."""
        if self.singular:
            return [(f"`{self.name(quantity)}`", t) for t in bad]
        return [(f"`{quantity}`{of}", t) for of, t in of_items(bad, values, labels)]

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
        item, kind = QUANTITIES[quantity].item, QUANTITIES[quantity].kind
        array = self._booleans(quantity, value) if kind is bool else self._numbers(quantity, value)
        if array is None or n_tables is None:
            return None
        if array.shape == item:
            return np.broadcast_to(array, (n_tables, *item)).copy()
        if array.shape == (n_tables, *item) and not self.singular:
            return array
        one = f"({QUANTITIES[quantity].axes})" if item else "one value"
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


def value_problems(
    params: Mapping[str, np.ndarray | None], labels: Mapping[str, Sequence[str]], arguments: Arguments
) -> list[str]:
    """What is wrong with the values of an arena's parameters, by name; None has been reported already."""
    problems = []
    for name, values in params.items():
        quantity = QUANTITIES[name]
        if values is None or quantity.kind is not float:
            continue
        bad = np.flatnonzero(~quantity.right(values).all(axis=tuple(range(1, values.ndim))))
        problems += [
            f"{what} must be {quantity.broken(values[t])}, got {show(values[t])}."
            for what, t in arguments.items(name, bad, values, labels[quantity.of])
        ]
    offsets, sizes, has_legs = (params[name] for name in ("table_offsets", "table_full_sizes", "has_legs"))
    if offsets is None or sizes is None or has_legs is None:
        return problems
    heights = np.stack([offsets[:, 2], sizes[:, 2]], axis=1)
    bad = np.flatnonzero(~geometry.legs_fit(offsets, sizes, has_legs) & (sizes[:, 2] > 0) & np.isfinite(offsets[:, 2]))
    for what, t in arguments.items("table_offsets", bad, heights, labels["table"]):
        height, thickness = heights[t]
        problems.append(
            f"{what} puts the top at z = {height:g} m, which leaves no room for legs under a slab {thickness:g} m thick: "
            f"with `has_legs`, z must be > {thickness / 2:g}."
        )
    return problems


def object_problems(
    objects: object, table_names: Sequence[str] | None, spec: mujoco.MjSpec, slab_names: Sequence[str] = ()
) -> tuple[list[str], list[int]]:
    """What is wrong with the objects of an arena, and the index of each one's table (names None: not known)."""
    taken = {e.name for e in (*spec.bodies, *spec.geoms, *spec.joints)} | set(table_names or ())
    if isinstance(objects, (str, Object)) or not isinstance(objects, Iterable):
        got = f"the one object {objects.name!r}" if isinstance(objects, Object) else repr(objects)
        return [f"`objects` must be a sequence of mjx_arenas.Object, got {got}."], []
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
        index = table_index(obj.table, table_names, slab_names)
        if index is None:
            must = f"`table` must be {known_tables(table_names)}, got {obj.table!r}."
            problems.append(f"Object {obj.name!r}: {must}")
        else:
            tables.append(index)
    return problems, tables


def vector_problems(name: str, value: object, n: int, unit: str) -> list[str]:
    """An argument that is not `n` finite numbers, or, for 0, not one."""
    try:
        array = np.asarray(value, float) if np.asarray(value).dtype.kind in "iuf" else None
    except (TypeError, ValueError):
        array = None
    if array is not None and array.shape == ((n,) if n else ()) and np.isfinite(array).all():
        rule = QUANTITIES["table_offsets"]._replace(must=unit)
        return [] if rule.right(array).all() else [f"`{name}` must be {rule.between}, got {show(value)}."]
    must = f"{n} finite numbers {unit}" if n else f"a finite number {unit}"
    return [f"`{name}` must be {must.strip()}, got {brief(value)}."]


def table_index(table: object, names: Sequence[str], slab_names: Sequence[str] = ()) -> int | None:
    """The index of a table that is given by its index, its body's name or its slab's; None if there is none."""
    of_name = dict(zip((*slab_names, *names), (*range(len(slab_names)), *range(len(names))), strict=True))
    index = of_name.get(table, table) if isinstance(table, str) else table
    return int(index) if is_whole(index, 0, len(names) - 1) else None  # type: ignore[arg-type]


def known_tables(names: Sequence[str]) -> str:
    """What may be given as a table."""
    if len(names) == 1:
        return f"0 or {names[0]!r}"
    return f"an index from 0 to {len(names) - 1} or one of {', '.join(map(repr, names))}"


def warn_of_crowds(params: ArenaParams) -> None:
    """Warns of objects that are there nominally and cannot all lie on their nominal table."""
    there = np.asarray(present(params)[1])
    for t in range(len(params.table_rots)):
        on = there & (params.object_tables == t)
        covered, area = params.object_full_sizes[on, :2].prod(-1).sum(), params.table_full_sizes[t, :2].prod()
        if covered > area:
            what = f"The {on.sum()} objects on table {t} cover {covered:.3g} m^2, more than its top of {area:.3g} m^2"
            warnings.warn(f"{what}: with `active=False` an object is not there nominally.", stacklevel=4)


def warn_of_places(params: ArenaParams, object_names: Sequence[str], pos: np.ndarray) -> None:
    """Warns of objects that are there nominally with the middle, `pos` (K, 2) in the frame of their table's top, off the table."""
    half = params.table_full_sizes[params.object_tables, :2] / 2
    off = (np.abs(pos) > half).any(-1) & np.asarray(present(params)[1])
    for k in np.flatnonzero(off).tolist():
        reach = f"whose top reaches {half[k, 0]:g} m x {half[k, 1]:g} m from its middle"
        where = f"`pos` {show(pos[k])} is off table {params.object_tables[k]}"
        warnings.warn(
            f"Object {object_names[k]!r}: {where}, {reach}: without a key it starts in the air.", stacklevel=4
        )


def warn_of_degrees(name: str, yaws: np.ndarray, stacklevel: int = 4) -> None:
    """Warns of yaws [rad] of more than a turn."""
    most = np.abs(yaws).max(initial=0.0)
    if most > 2 * np.pi:
        warnings.warn(
            f"`{name}` has yaws of up to {most:g} rad, more than a turn: they are not in degrees.",
            stacklevel=stacklevel,
        )


def table_option_problems(priority: object, condim: object) -> list[str]:
    """What is wrong with the options of the tables' contacts."""
    problems = []
    if not is_whole(priority):
        problems.append(f"`table_priority` must be an integer, got {priority!r}.")
    if condim is not None and (isinstance(condim, bool) or condim not in (1, 3, 4, 6)):
        problems.append(f"`table_condim` must be 1, 3, 4 or 6, got {condim!r}.")
    return problems


def shape_problems(params: ArenaParams, labels: Mapping[str, Sequence[str]]) -> list[str]:
    """Parameters that do not have the shapes of one world."""
    if not isinstance(params, ArenaParams):
        hint = ": give its `params`" if hasattr(params, "params") else ""
        return [f"`params` must be an mjx_arenas.ArenaParams, got {type(params).__name__}{hint}."]
    want = {name: (len(labels[quantity.of]), *quantity.item) for name, quantity in QUANTITIES.items()}
    got = {name: np.shape(value) for name, value in params._asdict().items()}
    if all(got[name][1:] == want[name] for name in want):
        return [
            f"`params` must be of one world, got {got['table_rots'][0]} worlds: take one, batch.world(i), or use jax.vmap."
        ]
    problems = [
        f"`params.{name}` must have shape {want[name]}, got {got[name]}." for name in want if got[name] != want[name]
    ]
    return problems or _kind_problems(params)


_KINDS = {
    bool: ((jnp.bool_, jnp.integer), "true or false"),
    int: ((jnp.integer,), "whole numbers"),
    float: ((jnp.floating, jnp.integer), "numbers"),
}


def _kind_problems(params: ArenaParams) -> list[str]:
    """Numbers of another kind, of which a conversion would make what was not meant: 0.7 is no index."""
    problems = []
    for name, value in params._asdict().items():
        dtype = value.dtype if hasattr(value, "dtype") else np.asarray(value).dtype
        kinds, must = _KINDS[QUANTITIES[name].kind]
        if np.size(value) and not any(jnp.issubdtype(dtype, kind) for kind in kinds):
            problems.append(f"`params.{name}` must be {must}, got {dtype}.")
    return problems


def batch_shape_problems(params: ArenaParams, labels: Mapping[str, Sequence[str]]) -> list[str]:
    """Parameters that do not have the shapes of W worlds."""
    if not isinstance(params, ArenaParams):
        return shape_problems(params, labels)
    if np.ndim(params.table_rots) == 1 and not shape_problems(params, labels):
        return [
            "`params` must be of many worlds, (W, ...), got one: jax.tree.map(lambda x: x[None], params) adds the axis."
        ]
    lengths = {np.shape(p)[0] if np.ndim(p) else None for p in params}
    if len(lengths) != 1 or None in lengths:
        shapes = ", ".join(f"{name} {np.shape(p)}" for name, p in params._asdict().items())
        return [f"`params` must be (W, ...) of the same W worlds in every field, got {shapes}."]
    if 0 in lengths:
        return ["`params` must be of at least one world, got none."]
    one = ArenaParams(
        *(np.empty(np.shape(p)[1:], p.dtype if hasattr(p, "dtype") else np.asarray(p).dtype) for p in params)
    )
    problems = shape_problems(one, labels)
    return [p.replace(" must have shape (", " must have shape (W, ").replace(",)", ")") for p in problems]


IMPL = "threefry2x32"  # of keys: what one world draws does not depend on the others then
_RAW_KEY = jax.ShapeDtypeStruct((2,), jnp.uint32)


def _other_keys(name: str, key: jax.Array) -> str:
    got = jax.random.key_impl(key)
    return f"`{name}` must be of JAX's {IMPL}, with which a world does not depend on the others, got {got}."


def one_key_problems(name: str, key: Any) -> list[str]:
    """A key that is not that of one world: () a typed one or (2,) of the old kind."""
    typed = hasattr(key, "dtype") and jnp.issubdtype(key.dtype, jax.dtypes.prng_key)
    if not typed and np.ndim(key) == 0:
        seed = key if is_whole(key) else 0
        return [f"`{name}` must be a key such as jax.random.key({seed}), got {brief(key)}."]
    raw = _RAW_KEY
    if typed and str(jax.random.key_impl(key)) != IMPL:
        return [_other_keys(name, key)]
    if key.ndim == 0 if typed else (getattr(key, "dtype", None), np.shape(key)) == (raw.dtype, raw.shape):
        return []
    if typed or np.shape(key)[1:] == raw.shape:
        return [f"`{name}` must be one key, of one world, got shape {key.shape}: use jax.vmap, or randomize."]
    return [f"`{name}` must be a key such as jax.random.key(0), got numbers of shape {np.shape(key)}."]


def check_path(name: str, value: object) -> None:
    """Refuses what is no path."""
    if not isinstance(value, (str, os.PathLike)):
        raise TypeError(f"`{name}` must be a path, got {type(value).__name__}.")


def key_problems(name: str, keys: Any, n_worlds: int | None = None) -> list[str]:
    """Keys that are not one for each of W worlds: (W,) typed ones or (W, 2) of the old kind."""
    if not hasattr(keys, "dtype") or not hasattr(keys, "ndim"):
        return [f"`{name}` must be an array of keys such as jax.random.split(key, n_worlds), got {brief(keys)}."]
    if n_worlds is not None and keys.ndim and len(keys) != n_worlds:
        return [f"`{name}` must be one for each of the {n_worlds} worlds, got {len(keys)}."]
    typed, raw = jnp.issubdtype(keys.dtype, jax.dtypes.prng_key), _RAW_KEY
    if typed and str(jax.random.key_impl(keys)) != IMPL:
        return [_other_keys(name, keys)]
    if keys.ndim == 1 if typed else (keys.dtype == raw.dtype and keys.shape[1:] == raw.shape):
        return [] if len(keys) else [f"`{name}` must be at least one key, of one world, got none."]
    if not typed and keys.ndim == 2:
        want, got = (
            f"{dtype} numbers of shape (W, {n})"
            for dtype, n in ((raw.dtype, raw.shape[0]), (keys.dtype, keys.shape[1]))
        )
        return [f"`{name}` must be keys such as jax.random.split(key, n_worlds), raw ones as {want}, got {got}."]
    return [
        f"`{name}` must be one key per world, shape (W,) or, of jax.random.PRNGKey, (W, 2), got shape {keys.shape}."
    ]


def model_problems(model: mjx.Model, mj_model: mujoco.MjModel) -> list[str]:
    """An `mjx.Model` that was not put on the device from this arena's."""
    if not isinstance(model, mjx.Model):
        return [f"`model` must be an mjx.Model, from put_model(), got {type(model).__name__}."]
    sizes = ("nbody", "ngeom", "nsite", "nq", "nv")
    of_one = (
        "qpos0",
        "body_pos",
        "body_quat",
        "body_mass",
        "geom_size",
        "geom_pos",
        "geom_friction",
        "geom_margin",
        "geom_rgba",
    )
    if any(getattr(model, name).ndim != getattr(mj_model, name).ndim for name in of_one):
        return [
            "`model` must be of one world, got one with batched leaves: randomize and apply start from put_model()."
        ]
    if all(getattr(model, n) == getattr(mj_model, n) for n in sizes) and np.array_equal(
        [model.geom_bodyid, model.geom_type], [mj_model.geom_bodyid, mj_model.geom_type]
    ):
        return _name_problems(model.names, mj_model.names)
    got, want = (", ".join(f"{n} {getattr(m, n)}" for n in sizes) for m in (model, mj_model))
    return [f"`model` must come from this arena's put_model() ({want}), got another model ({got})."]


def _name_problems(got: bytes, want: bytes) -> list[str]:
    """Another model of the same sizes, by the names of all its elements; the model's own, which is the first, may differ."""
    pairs = zip(got.split(b"\0")[1:], want.split(b"\0")[1:], strict=False)
    differing = [(a.decode(), b.decode()) for a, b in pairs if a != b]
    if not differing:
        return []
    other, ours = differing[0]
    return [f"`model` must come from this arena's put_model(), got another model, which has {other!r} for {ours!r}."]


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
    half = table.half[[a, b]]
    delta = table.body_pos[b] - table.body_pos[a]
    depths = [half[:, 2].sum() - abs(delta[2])]
    yaws = params.table_rots[[a, b]]
    for yaw in (yaws[0], yaws[0] + np.pi / 2, yaws[1], yaws[1] + np.pi / 2):
        axis = np.array([np.cos(yaw), np.sin(yaw)])
        radii = (half[:, 0] * abs(np.cos(yaws - yaw)) + half[:, 1] * abs(np.sin(yaws - yaw))).sum()
        depths.append(radii - abs(delta[:2] @ axis))
    return float(min(depths))
