"""What is wrong with the arguments of calls, as problems (host). Ranges are in `validation_ranges`, worlds in `validation_worlds`."""

import inspect
import os
import types
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.params.params import DENSITIES, QUANTITIES, ArenaParams, ArenaRanges, Quantity, Selected, each, named
from mjx_arenas.problem import Problem, Told, numbered, problem
from mjx_arenas.problems.arguments import is_whole as is_whole
from mjx_arenas.problems.arguments import not_negative_problems as not_negative_problems
from mjx_arenas.problems.arguments import vector_problems as vector_problems
from mjx_arenas.problems.messages import error as error
from mjx_arenas.problems.messages import kind_of as kind_of
from mjx_arenas.problems.messages import raise_all as raise_all
from mjx_arenas.problems.messages import show as show
from mjx_arenas.rules import world_rules
from mjx_arenas.rules.world_rules import Rules
from mjx_arenas.sample.sampling import IMPL
from mjx_arenas.spec import automatic


def whole(name: str, value: Any, least: int, most: float = np.inf, must: str = "") -> int:
    """An argument that is a whole number within limits, as Python's; `must` says in words what it must be, if not that."""
    if not is_whole(value, least, most):
        raise error([problem(name, "must", None, value, must=must or f"a whole number >= {least}")])
    return int(value)


def is_number(value: object) -> bool:
    """Whether a value is one number, of Python, NumPy or JAX; true and false are none."""
    one = isinstance(value, (int, float, np.generic, np.ndarray, jax.Array)) and np.ndim(value) == 0
    return one and np.asarray(value).dtype.kind in "iuf"


def check_type(name: str, value: object, kinds: type | tuple[type, ...], must: str) -> None:
    """Refuses what is of none of these types; `must` says in words what it must be."""
    if not isinstance(value, kinds):
        raise error([problem(name, "of_type", None, Told(kind_of(value)), must=must)], kind=TypeError)


def check_path(name: str, value: object) -> None:
    """Refuses what is no path."""
    check_type(name, value, (str, os.PathLike), "a path")


def check_ranges_type(ranges: object) -> None:
    """Refuses what are no ranges, and ranges whose `terms` are no dictionary."""
    check_type("ranges", ranges, ArenaRanges, "an mjx_arenas.ArenaRanges")
    assert isinstance(ranges, ArenaRanges)
    if not isinstance(ranges.terms, Mapping):
        raise error([problem("ranges.terms", "terms_mapping", None, ranges.terms, of="distributions")])


def check_takes(name: str, function: Callable, arguments: Sequence[str]) -> None:
    """Refuses a function that does not take these arguments."""
    try:
        signature = inspect.signature(function)
    except ValueError:  # one of C's may have none
        return
    try:
        signature.bind(*arguments)
    except TypeError:
        want = f"({', '.join(arguments)})"
        told = Told(f"one of {signature}")
        raise error([problem(name, "must", None, told, must=f"a function of {want}")], kind=TypeError) from None


_ONE = "take one, batch.world(i), or use jax.vmap"  # world of many
Terms: TypeAlias = Mapping[str, Selected]


class Labels(NamedTuple):
    """What there is in an arena, as problems call it."""

    table: list[int]
    object: list[str]
    terms: Terms
    surfaces: Sequence[str] = ()

    def of(self, name: str) -> tuple[Quantity, Sequence[Any]]:
        """What there is to know of a quantity, and what its rows are called."""
        if name in self.terms:
            return self.terms[name].quantity, self.terms[name].elements
        quantity = QUANTITIES.get(name, DENSITIES)
        return quantity, self.table if quantity.of == "table" else self.object

    def rules(self, name: str) -> Sequence[Quantity]:
        """What there is to know of each row of a quantity, which may have a unit of its own."""
        quantity, rows = self.of(name)
        return self.terms[name].rules if name in self.terms else [quantity] * len(rows)

    @property
    def names(self) -> list[str]:
        """The names of all quantities."""
        return [*QUANTITIES, *self.terms]


def labels(
    tables: Sequence[str],
    object_names: Sequence[str] = (),
    terms: Terms = types.MappingProxyType({}),
    surfaces: Sequence[str] = (),
) -> Labels:
    """What problems call the tables, the objects, the elements of terms and what objects can stand on: numbers and names."""
    return Labels(list(numbered(tables)), list(object_names), terms, surfaces)


class Arguments:
    """Reads the per-table arguments of an arena into arrays, collecting problems.

    Args:
        singular: `TableArena`'s names (`table_full_size`), without an index, instead of `MultiTableArena`'s.
    """

    def __init__(self, singular: bool) -> None:
        self.singular = singular
        self.problems: list[Problem] = []

    def table_params(self, **given: object) -> dict[str, np.ndarray | None]:
        """The tables' nominal parameters, read-only, by name; None for those that make no sense: `problems` says why."""
        offsets = given.pop("table_offsets")
        table_offsets = self._offsets([offsets] if self.singular else offsets)
        n_tables = None if table_offsets is None else len(table_offsets)
        params: dict[str, np.ndarray | None] = {"table_offsets": table_offsets}
        params |= {name: self._per_table(name, value, n_tables) for name, value in given.items()}
        of_tables = ArenaParams(*(params.get(name) for name in QUANTITIES), terms={})
        rules = Rules(n_tables or 0, (), np.empty(0, str), np.empty((0, 3)), {})
        found = world_rules.problems(of_tables, rules, world_rules.RULES)
        self.problems += [p._replace(path=self.name(p.path), item=None if self.singular else p.item) for p in found]
        for array in params.values():
            if array is not None:
                array.setflags(write=False)
        return params

    def name(self, quantity: str) -> str:
        """The argument's name."""
        if not self.singular or quantity == "has_legs":
            return quantity
        return quantity.removesuffix("s")

    def refuse(self, quantity: str, rule: str, got: object, **numbers: Any) -> None:
        """Adds a problem."""
        self.problems.append(problem(self.name(quantity), rule, None, got, quantity=quantity, **numbers))

    def _offsets(self, value: object) -> np.ndarray | None:
        """(T, 3) offsets; their length is the number of tables."""
        array = self._numbers("table_offsets", value)
        if array is None or (array.ndim == 2 and array.shape[1:] == (3,) and len(array)):
            return array
        given = value[0] if self.singular else value  # type: ignore[index]
        self.refuse("table_offsets", "item" if self.singular else "offsets", given)
        self._refuse_numbers("table_offsets", array, given)
        return None

    def _per_table(self, quantity: str, value: object, n_tables: int | None) -> np.ndarray | None:
        """(T, ...) values, from one for all tables or one for each."""
        item, kind = QUANTITIES[quantity].item, QUANTITIES[quantity].kind
        array = self._booleans(quantity, value) if kind is bool else self._numbers(quantity, value)
        if array is None:
            return None
        if n_tables is not None and array.shape == item:
            return np.broadcast_to(array, (n_tables, *item)).copy()
        if array.shape == (n_tables, *item) and not self.singular:
            return array
        may_fit = array.shape == item or (array.shape[1:] == item and array.ndim == len(item) + 1 and not self.singular)
        if n_tables is not None or not may_fit:
            self.refuse(quantity, "item" if self.singular else "items", value, n_tables=n_tables)
        self._refuse_numbers(quantity, array, value)
        return None

    def _refuse_numbers(self, quantity: str, array: np.ndarray, value: object) -> None:
        """Adds what is wrong with the numbers of an array, of whatever shape."""
        rule = QUANTITIES[quantity]
        if rule.kind is float and not rule.right(array).all():
            self.refuse(quantity, world_rules.broken(quantity, rule, array)[0], value)

    def _numbers(self, quantity: str, value: object) -> np.ndarray | None:
        try:
            kind = np.asarray(value).dtype.kind
            array = np.array(value, float) if kind in "fiu" or np.asarray(value).size == 0 else None
        except (TypeError, ValueError):
            array = None
        if array is None:
            self.refuse(quantity, "numbers", value[0] if self.singular and quantity == "table_offsets" else value)  # type: ignore[index]
        return array

    def _booleans(self, quantity: str, value: object) -> np.ndarray | None:
        try:
            array = np.asarray(value)
        except ValueError:
            array = np.asarray("ragged")
        if array.dtype.kind not in "biuf" or not np.isin(array, (0, 1)).all():
            self.refuse(quantity, "truth", value)
            return None
        return array.astype(bool)


def table_index(table: object, names: Sequence[str], slab_names: Sequence[str] = ()) -> int | None:
    """The index of a table that is given by its index, its body's name or its slab's; None if there is none."""
    of_name = dict(zip((*slab_names, *names), (*range(len(slab_names)), *range(len(names))), strict=True))
    index = of_name.get(table, table) if isinstance(table, str) else table
    return int(index) if is_whole(index, 0, len(names) - 1) else None  # type: ignore[arg-type]


def table_option_problems(priority: object, condim: object) -> list[Problem]:
    """What is wrong with the options of the tables' contacts."""
    problems = []
    if not is_whole(priority):
        problems.append(problem("table_priority", "integer", None, priority))
    if condim is not None and (isinstance(condim, bool) or condim not in (1, 3, 4, 6)):
        problems.append(problem("table_condim", "condim", None, condim))
    return problems


def shape_problems(params: ArenaParams, labels: Labels) -> list[Problem]:
    """Parameters that do not have the shapes of one world."""
    if not isinstance(params, ArenaParams):
        rule = "params_of" if hasattr(params, "params") else "params_called" if inspect.isroutine(params) else "params"
        return [problem("params", rule, kind=type(params).__name__)]
    unknown = _term_problems(params, labels)
    if unknown:
        return unknown
    want = {name: (len(labels.of(name)[1]), *labels.of(name)[0].item) for name in labels.names}
    got = {name: np.shape(value) for name, value in named(params).items()}
    if all(got[name][1:] == want[name] for name in want):
        return [problem("params", "one_world", of=f"{got['table_rots'][0]} worlds", instead=_ONE)]
    wrong = [name for name in want if got[name] != want[name]]
    shapes = [problem(_path(n, labels), "shape", want=want[n], shape=got[n]) for n in wrong]
    return shapes + _kind_problems(params, labels)


def _path(name: str, labels: Labels) -> str:
    return f"params.terms.{name}" if name in labels.terms else f"params.{name}"


def _term_problems(params: ArenaParams, labels: Labels) -> list[Problem]:
    """Quantities of `arena.vary` and of furniture that are not those of the arena."""
    if not isinstance(params.terms, Mapping):
        return [problem("params.terms", "terms_mapping", None, params.terms, of="numbers")]
    if set(params.terms) == set(labels.terms):
        return []
    known, given = set(labels.terms), set(map(str, params.terms))
    wrong = [("it lacks", sorted(known - given)), ("the arena has no", sorted(given - known))]
    told = [f"{what} {', '.join(names[:5])}{', ...' * (len(names) > 5)}" for what, names in wrong if names]
    return [problem("params.terms", "other_terms", wrong="; ".join(told))]


_KINDS = {bool: (jnp.bool_, jnp.integer), int: (jnp.integer,), float: (jnp.floating, jnp.integer)}


def _kind_problems(params: ArenaParams, labels: Labels) -> list[Problem]:
    """Numbers of another kind, of which a conversion would make what was not meant: 0.7 is no index."""
    problems = []
    for name, value in named(params).items():
        dtype = value.dtype if hasattr(value, "dtype") else np.asarray(value).dtype
        kind = labels.of(name)[0].kind
        allowed = (
            (jnp.bool_,) if kind is bool and name in labels.terms else _KINDS[kind]
        )  # what is a term stays what it is
        if np.size(value) and not any(jnp.issubdtype(dtype, one) for one in allowed):
            problems.append(problem(_path(name, labels), f"dtype_{kind.__name__}", dtype=dtype))
    return problems


def batch_shape_problems(params: ArenaParams, labels: Labels) -> list[Problem]:
    """Parameters that do not have the shapes of W worlds."""
    if not isinstance(params, ArenaParams):
        return shape_problems(params, labels)
    if np.ndim(params.table_rots) == 1 and not shape_problems(params, labels):
        return [problem("params", "of_many_worlds")]
    if unknown := _term_problems(params, labels):
        return unknown
    values = named(params)
    lengths = {np.shape(p)[0] if np.ndim(p) else None for p in values.values()}
    if len(lengths) != 1 or None in lengths:
        return [problem("params", "same_worlds", names=[f"{n} {np.shape(p)}" for n, p in values.items()])]
    if 0 in lengths:
        return [problem("params", "no_world")]
    one = each(lambda p: np.empty(np.shape(p)[1:], p.dtype if hasattr(p, "dtype") else np.asarray(p).dtype), params)
    return [
        p._replace(numbers={**p.numbers} | {name: ("W", *p.numbers[name]) for name in ("want", "shape")})
        if p.rule == "shape"
        else p
        for p in shape_problems(one, labels)
    ]


_RAW_KEY = jax.ShapeDtypeStruct((2,), jnp.uint32)


def _other_keys(name: str, key: jax.Array) -> Problem:
    return problem(name, "key_impl", must=IMPL, kind=jax.random.key_impl(key))


def one_key_problems(name: str, key: Any) -> list[Problem]:
    """A key that is not that of one world: () a typed one or (2,) of the old kind."""
    typed = hasattr(key, "dtype") and jnp.issubdtype(key.dtype, jax.dtypes.prng_key)
    if not typed and np.ndim(key) == 0:
        return [problem(name, "key", None, key, seed=key if is_whole(key) else 0)]
    raw = _RAW_KEY
    if typed and str(jax.random.key_impl(key)) != IMPL:
        return [_other_keys(name, key)]
    if key.ndim == 0 if typed else (getattr(key, "dtype", None), np.shape(key)) == (raw.dtype, raw.shape):
        return []
    if typed or np.shape(key)[1:] == raw.shape:
        return [problem(name, "one_key", shape=key.shape)]
    return [problem(name, "key_numbers", None, key)]


def key_problems(name: str, keys: Any, n_worlds: int | None = None) -> list[Problem]:
    """Keys that are not one for each of W worlds: (W,) typed ones or (W, 2) of the old kind."""
    if not hasattr(keys, "dtype") or not hasattr(keys, "ndim"):
        return [problem(name, "keys", None, keys)]
    if n_worlds is not None and keys.ndim and len(keys) != n_worlds:
        return [problem(name, "one_each", n=n_worlds, what="worlds", came=len(keys))]
    typed, raw = jnp.issubdtype(keys.dtype, jax.dtypes.prng_key), _RAW_KEY
    if typed and str(jax.random.key_impl(keys)) != IMPL:
        return [_other_keys(name, keys)]
    if keys.ndim == 1 if typed else (keys.dtype == raw.dtype and keys.shape[1:] == raw.shape):
        return [] if len(keys) else [problem(name, "no_key")]
    if not typed and keys.ndim == 2:
        return [problem(name, "raw_keys", dtype=keys.dtype, n=keys.shape[1])]
    return [problem(name, "keys_shape", shape=keys.shape)]


def point_problems(vector: Any, n: int) -> list[Problem]:
    """A point of the unit cube that is none, or not of this one."""
    shape = np.shape(vector)
    if shape != (n,):
        return [problem("vector", "point", n=n, shape=shape)]
    if isinstance(vector, jax.core.Tracer):
        return []
    values = np.asarray(vector)
    if values.dtype.kind not in "fiu":
        return [problem("vector", "point", n=n, shape=f"{values.dtype} ones")]
    wrong = np.flatnonzero(~((values >= 0) & (values <= 1)))
    return [problem(f"vector[{i}]", "share", None, values[i]) for i in wrong[:1]]


def model_problems(model: mjx.Model, mj_model: mujoco.MjModel) -> list[Problem]:
    """An `mjx.Model` that was not put on the device from this arena's."""
    if not isinstance(model, mjx.Model):
        return [problem("model", "model", kind=type(model).__name__)]
    sizes = ("nbody", "ngeom", "nsite", "nq", "nv")
    of_one = ("qpos0", "body_pos", "body_quat", "body_mass", "geom_size", "geom_pos", "geom_friction", "geom_margin")
    if any(getattr(model, name).ndim != getattr(mj_model, name).ndim for name in (*of_one, "geom_rgba")):
        return [problem("model", "batched_model")]
    if all(getattr(model, n) == getattr(mj_model, n) for n in sizes) and np.array_equal(
        [model.geom_bodyid, model.geom_type], [mj_model.geom_bodyid, mj_model.geom_type]
    ):
        return _name_problems(model.names, mj_model.names)
    if all(getattr(model, n) == getattr(mj_model, n) for n in sizes):
        differ = np.asarray(model.geom_bodyid) != mj_model.geom_bodyid
        g = int(np.flatnonzero(differ | (np.asarray(model.geom_type) != mj_model.geom_type))[0])
        shapes = [mujoco.mjtGeom(int(m.geom_type[g])).name.removeprefix("mjGEOM_").lower() for m in (model, mj_model)]
        got, want = (
            f"geom {g} is a {s} of body {m.geom_bodyid[g]}" for s, m in zip(shapes, (model, mj_model), strict=True)
        )
    else:
        got, want = (", ".join(f"{n} {getattr(m, n)}" for n in sizes) for m in (model, mj_model))
    return [problem("model", "other_sizes", wanted=want, kind=got)]


def _name_problems(got: bytes, want: bytes) -> list[Problem]:
    """Another model of the same sizes, by the names of all its elements; the model's own, which is the first, may differ."""
    pairs = zip(got.split(b"\0")[1:], want.split(b"\0")[1:], strict=False)
    differing = [(a.decode(), b.decode()) for a, b in pairs if a != b and not (a == b"" and automatic.made(b.decode()))]
    return [problem("model", "other_names", None, other, wanted=ours) for other, ours in differing[:1]]
