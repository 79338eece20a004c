"""Worlds in words and numbers (host)."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from mjx_arenas.furniture import standing
from mjx_arenas.furniture.part import Part
from mjx_arenas.params.params import QUANTITIES, ArenaParams, Quantity, Selected, canonical, named, on_host
from mjx_arenas.record.record import Record
from mjx_arenas.rules import validation
from mjx_arenas.sample import tops
from mjx_arenas.spec.calls import plain
from mjx_arenas.viz.table import columns

Numbers = tuple[float, ...]
Terms = Mapping[str, Selected]


class Table(NamedTuple):
    """A table of one world."""

    name: str
    present: bool
    position: Numbers
    """(3,) centre of the top [m]."""
    size: Numbers
    """(3,) length, width, thickness [m]."""
    yaw: float
    """[deg]"""
    legs: bool
    friction: Numbers
    """(3,) sliding, torsional, rolling."""


class Thing(NamedTuple):
    """An object of one world."""

    name: str
    type: str
    present: bool
    """False on an absent table, too."""
    table: str
    """Name of the table on which it stands."""
    size: Numbers
    """(3,) extents along its axes [m]."""
    mass: float
    """[kg]"""
    friction: Numbers
    """(3,) sliding, torsional, rolling."""
    rgba: Numbers


class Furnishing(NamedTuple):
    """A part of furniture of one world."""

    name: str
    kind: str
    """Such as "Shelf"."""
    present: bool
    position: Numbers
    """(3,) of its frame [m]."""
    size: Numbers
    """(3,) of the box around it, along the axes of its frame, shut [m]."""
    yaw: float
    """[deg]"""
    without: tuple[str, ...]
    """Names of its pieces that are absent."""


class Setting(NamedTuple):
    """A number, or a few, of an element of `arena.vary`, or of a part of furniture, in one world."""

    quantity: str
    element: str
    axes: str
    values: Numbers
    unit: str


class World(NamedTuple):
    """One world; `print` shows it."""

    tables: tuple[Table, ...]
    objects: tuple[Thing, ...]
    terms: tuple[Setting, ...] = ()
    parts: tuple[Furnishing, ...] = ()

    def __str__(self) -> str:
        blocks = [self._tables(), self._objects(), self._parts(), self._terms()]
        return "\n\n".join(filter(None, blocks))

    def _parts(self) -> str:
        if not self.parts:
            return ""
        head = ("part", "", "kind", "pos [m]", "size [m]", "yaw [deg]", "without")
        rows = [
            (
                p.name,
                _absent(p),
                p.kind,
                _numbers(p.position, ", ", ".3f"),
                _numbers(p.size, " x ", ".3f"),
                f"{p.yaw:.1f}",
                ", ".join(p.without),
            )
            for p in self.parts
        ]
        return columns([head, *rows])

    def _terms(self) -> str:
        """But for what the rows of parts say."""
        said = {f"{p.name}.{name}" for p in self.parts for name in ("pos", "rot", "active", "pieces_active")}
        rows = [
            (" ".join(filter(None, (s.quantity, s.unit))), s.element, s.axes, _values(s.values))
            for s in self.terms
            if s.quantity not in said
        ]
        return columns([("quantity", "of", "axes", "value"), *rows]) if rows else ""

    def _tables(self) -> str:
        if not self.tables:
            return ""
        head = ("table", "", "middle of its top [m]", "size [m]", "yaw [deg]", "", "friction")
        rows = [
            (
                t.name,
                _absent(t),
                _numbers(t.position, ", ", ".3f"),
                _numbers(t.size, " x ", ".3f"),
                f"{t.yaw:.1f}",
                "legs" if t.legs else "",
                _numbers(t.friction, ", ", ".3g"),
            )
            for t in self.tables
        ]
        return columns([head, *rows])

    def _objects(self) -> str:
        if not self.objects:
            return ""
        head = ("object", "", "type", "on", "size [m]", "mass [kg]", "friction")
        rows = [
            (
                o.name,
                _absent(o),
                o.type,
                o.table,
                _numbers(o.size, " x ", ".3f"),
                f"{o.mass:.4g}",
                _numbers(o.friction, ", ", ".3g"),
            )
            for o in self.objects
        ]
        return columns([head, *rows])


class Column(NamedTuple):
    """One number of each of many worlds."""

    quantity: str
    item: str  # name of the table's body, of the object or of the element
    axis: str
    values: np.ndarray  # (W,)
    there: np.ndarray  # (W,) bool: the table, object or part is there
    nominal: float
    rule: Quantity  # what there is to know of the quantity
    presence: bool = False  # it says what is there

    @property
    def name(self) -> str:
        """The full name, such as "table_offsets.table0.x" or, of furniture, "rack.pos.x"."""
        part = self.quantity.rpartition(".")[0]
        item = self.item.removeprefix(part).lstrip(" _") if part else self.item
        return ".".join(filter(None, (self.quantity, item, self.axis)))

    @property
    def seen(self) -> np.ndarray:
        """The values in worlds in which its table, object or part is present; of presence itself, the values in all worlds."""
        return self.there if self.presence else self.values[self.there]

    @property
    def varies(self) -> bool:
        """Whether it is seen to differ."""
        return len(self.seen) > 0 and bool(self.seen.min() < self.seen.max())


class Range(NamedTuple):
    """Between which values a number is in many worlds: in those in which its table, object or part is; NaN if in none."""

    quantity: str
    """The quantity's name: that in `ArenaParams` or of `arena.vary`, or one of a part of furniture, such as "rack.heights"."""
    item: str
    """Name of the table's body, of the object or of the element."""
    axis: str
    """The axis, such as "z"; for `object_tables` the name of a table, on which the object stands or not."""
    unit: str
    nominal: float
    min: float
    mean: float
    """The mean; of what is true or false the share of worlds."""
    max: float
    kind: str = "number"
    """"number", "truth" of what is true or false, or "table" of the index of one."""

    @property
    def varies(self) -> bool:
        """Whether it is seen to differ."""
        return self.min < self.max


class Worlds(NamedTuple):
    """What many worlds are; `print` shows what differs between them, and what is in none of them."""

    n_worlds: int
    ranges: tuple[Range, ...]
    absent: tuple[str, ...] = ()
    """Names of the tables, objects, parts and bodies that are in none of them."""

    @property
    def varying(self) -> tuple[Range, ...]:
        """The ranges of numbers that differ."""
        return tuple(r for r in self.ranges if r.varies)

    def __str__(self) -> str:
        absent = f"\n\nin no world: {', '.join(self.absent)}" if self.absent and self.n_worlds > 1 else ""
        return self._varying() + absent

    def _varying(self) -> str:
        if not self.varying:
            return "nothing varies" if self.n_worlds > 1 else "one world: nothing to compare it with"
        rows: list[tuple[str, ...]] = [("quantity", "of", "axes", "nominal", "least", "mean", "most")]
        before = "", ""
        rows_of = [(r.quantity, r.item, r.axis if r.kind == "table" else "") for r in self.varying]
        for (quantity, item, _), grouped in itertools.groupby(zip(rows_of, self.varying, strict=True), lambda r: r[0]):
            group = [r for _, r in grouped]
            title = " ".join(filter(None, (quantity, group[0].unit)))
            titles = (title if title != before[0] else "", item if (title, item) != before else "")
            before = title, item
            cells = [" ".join(f"{getattr(r, name):.3g}" for r in group) for name in ("nominal", "min", "mean", "max")]
            if group[0].kind != "number":
                cells = ["yes" if group[0].nominal else "no", "no", f"yes in {group[0].mean:.1%}", "yes"]
            rows.append((*titles, " ".join(r.axis for r in group), *cells))
        return columns(rows)


def of(record: Record, params: ArenaParams) -> World | Worlds:
    """One world, or what many are; see `Arena.describe`."""
    tables, things = record.table_names, [*record.object_names]
    ground = record.parts.places.ground
    if not are_many(params):
        validation.raise_all(validation.shape_problems(params, record.labels), "`params`")
        terms = record.parts.selected
        return world(params, tables, things, record.parts.types(params), terms, ground)
    validation.raise_all(validation.batch_shape_problems(params, record.labels), "`params`")
    return worlds(params, record.nominal, tables, things, record.parts.selected, ground)


def are_many(params: object) -> bool:
    """Whether these are the parameters of many worlds."""
    return isinstance(params, ArenaParams) and np.ndim(params.table_rots) > 1


def world(
    params: ArenaParams,
    tables: Sequence[str],
    objects: Sequence[str],
    types: Sequence[str],
    terms: Terms,
    ground: tops.Ground,
) -> World:
    """One world, with the names of tables and objects, and the objects' types, quantities of `arena.vary` and of furniture, and this."""
    p = on_host(params)
    tables_there, objects_there = tops.present(p, ground)
    below = tops.names(tables, ground)
    on = [below[t] for t in p.object_tables]
    yaws, frictions = np.degrees(p.table_rots), p.table_frictions
    of_tables = (tables, tables_there, p.table_offsets, p.table_full_sizes, yaws, p.has_legs, frictions)
    numbers = (p.object_full_sizes, p.object_masses, p.object_frictions, p.object_rgba)
    of_objects = (objects, types, objects_there, on, *numbers)
    return World(
        tuple(Table(*map(_plain, row)) for row in zip(*of_tables, strict=True)),
        tuple(Thing(*map(_plain, row)) for row in zip(*of_objects, strict=True)),
        tuple(
            Setting(
                name,
                element,
                ", ".join(_chosen(one, i)),
                tuple(np.ravel(value)[np.ravel(one.mask[i])].tolist()),
                rule.unit,
            )
            for name, one in terms.items()
            for i, (element, value, rule) in enumerate(zip(one.elements, p.terms[name], one.rules, strict=True))
        ),
        tuple(
            _furnishing(part, frame, p)
            for part, frame in zip(ground.furniture, standing.frames(ground.furniture, p), strict=True)
        ),
    )


def _furnishing(part: Part, frame: standing.Frame, params: ArenaParams) -> Furnishing:
    pieces = zip(part.coming, params.terms[f"{part.name}.pieces_active"], strict=True) if part.coming else ()
    without = tuple(piece for piece, there in pieces if not there)
    size, yaw = standing.size(part, params), float(np.degrees(frame.rot))
    return Furnishing(part.name, type(part).__name__, bool(frame.there), _plain(frame.pos), _plain(size), yaw, without)


def _chosen(selected: Selected, index: int) -> list[str]:
    """The axes that vary of an element."""
    axes = selected.quantity.axes.split(", ")
    return [axis for axis, varies in zip(axes, np.ravel(selected.mask[index]), strict=True) if varies]


def _plain(value: Any) -> Any:
    """A value of NumPy as Python's own, an array as a tuple."""
    return tuple(value.tolist()) if isinstance(value, np.ndarray) else getattr(value, "tolist", lambda: value)()


def worlds(
    params: ArenaParams,
    nominal: ArenaParams,
    tables: Sequence[str],
    objects: Sequence[str],
    terms: Terms,
    ground: tops.Ground,
) -> Worlds:
    """Many worlds, `params` (W, ...), with the names of tables and objects, and what `arena.vary` made."""
    found, below = numbers(params, nominal, tables, objects, terms, ground), tops.names(tables, ground)
    never = {c.item: c.quantity.rpartition(".")[0] for c in found if c.presence and not c.there.any()}
    absent = tuple(name for name, part in never.items() if part == name or part not in never)  # not of these the pieces
    return Worlds(len(params.table_rots), tuple(r for column in found for r in _ranges(column, below)), absent)


def numbers(
    params: ArenaParams,
    nominal: ArenaParams,
    tables: Sequence[str],
    objects: Sequence[str],
    terms: Terms,
    ground: tops.Ground,
) -> list[Column]:
    """All numbers of many worlds, `params` (W, ...), in the order of `ArenaParams`."""
    of_all = jax.vmap(lambda p: (tops.present(p, ground), [f.there for f in standing.frames(ground.furniture, p)]))
    present, frames = jax.jit(of_all)(canonical(params))
    tables_there, objects_there = map(np.asarray, present)
    of = {"table": (tables, tables_there), "object": (objects, objects_there)}
    found, usually, given = [], named(nominal), named(params)
    parts_there = {part.name: np.asarray(there) for part, there in zip(ground.furniture, frames, strict=True)}
    parts_there[""] = np.ones(len(tables_there), bool)  # what is no part's
    rules = {name: ((rule,) * len(of[rule.of][0]), *of[rule.of]) for name, rule in QUANTITIES.items()}
    presence = {"table_active", "object_active"}
    for name, one in terms.items():
        there = np.repeat(parts_there[one.part][:, None], len(one.elements), 1)
        if one.quantity.kind is bool and one.quantity.of == "body":
            presence.add(name)
            there = there & np.asarray(given[name], bool)
        rules[name] = (one.rules, one.elements, there)
    for quantity, (own, names, there) in rules.items():
        values, usual = given[quantity], usually[quantity]
        for i, (item, rule) in enumerate(zip(names, own, strict=True)):
            columns = np.reshape(np.asarray(values)[:, i], (len(there), -1)).T
            found += [
                Column(quantity, item, axis, column, there[:, i], float(one), rule, quantity in presence)
                for axis, column, one in zip(rule.axes.split(", "), columns, np.ravel(usual[i]), strict=True)
            ]
    return found


def _ranges(column: Column, tables: Sequence[str]) -> list[Range]:
    """The range of one number; for the index of a table the share of each."""
    if column.rule.kind is int:
        return [_range(column, name, column.seen == t, float(column.nominal == t)) for t, name in enumerate(tables)]
    return [_range(column, column.axis, column.seen, column.nominal)]


def _range(column: Column, axis: str, values: np.ndarray, nominal: float) -> Range:
    few = [float(plain(f(values))) if len(values) else np.nan for f in (np.min, np.mean, np.max)]
    kind = {bool: "truth", int: "table"}.get(column.rule.kind, "number")
    return Range(column.quantity, column.item, axis, column.rule.unit, nominal, *few, kind=kind)


def _absent(of: Table | Thing | Furnishing) -> str:
    return "" if of.present else "absent"


def _values(values: Sequence[float]) -> str:
    truths = {True: "yes", False: "no"}
    return ", ".join(truths[x] if isinstance(x, bool) else f"{x:.4g}" for x in values)


def _numbers(values: Numbers, between: str, form: str) -> str:
    return between.join(f"{x:{form}}" for x in values)
