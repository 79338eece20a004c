"""Worlds in words and numbers (host)."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from mjx_arenas.params import QUANTITIES, ArenaParams, canonical, on_host, present

Numbers = tuple[float, ...]


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


class World(NamedTuple):
    """One world; `print` shows it."""

    tables: tuple[Table, ...]
    objects: tuple[Thing, ...]

    def __str__(self) -> str:
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
        shown = columns([head, *rows])
        if not self.objects:
            return shown
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
        return f"{shown}\n\n{columns([head, *rows])}"


class Range(NamedTuple):
    """What a quantity of one table or object is in many worlds: in those in which that is present; NaN if in none."""

    name: str
    """Of the table or object."""
    quantity: str
    """With its unit. "present", "legs" and "on ..." are 1 where that is so, else 0: the mean is a share."""
    min: float
    mean: float
    max: float

    @property
    def varies(self) -> bool:
        """Whether it is seen to differ."""
        return self.min < self.max


class Worlds(NamedTuple):
    """What many worlds are; `print` shows what differs between them."""

    n_worlds: int
    ranges: tuple[Range, ...]

    def __str__(self) -> str:
        varying = [r for r in self.ranges if r.varies]
        same = f"{len(self.ranges) - len(varying)} other quantities are the same in all {self.n_worlds:,} worlds."
        if not varying:
            return same.replace("other quantities", "quantities")
        rows = [
            (r.name, r.quantity, "", f"{100 * r.mean:.1f} %", "")
            if _is_share(r.quantity)
            else (r.name, r.quantity, *(f"{x:.4g}" for x in (r.min, r.mean, r.max)))
            for r in varying
        ]
        return columns([("", "", "min", "mean", "max"), *rows]) + f"\n\n{same}"


def world(params: ArenaParams, tables: Sequence[str], objects: Sequence[str], types: Sequence[str]) -> World:
    """One world, with the names of tables and objects, and the objects' types."""
    p = on_host(params)
    tables_there, objects_there = present(p)
    on = [tables[t] for t in p.object_tables]
    yaws, frictions = np.degrees(p.table_rots), p.table_frictions
    of_tables = (tables, tables_there, p.table_offsets, p.table_full_sizes, yaws, p.has_legs, frictions)
    numbers = (p.object_full_sizes, p.object_masses, p.object_frictions, p.object_rgba)
    of_objects = (objects, types, objects_there, on, *numbers)
    return World(
        tuple(Table(*map(_plain, row)) for row in zip(*of_tables, strict=True)),
        tuple(Thing(*map(_plain, row)) for row in zip(*of_objects, strict=True)),
    )


def _plain(value: Any) -> Any:
    """A value of NumPy as Python's own, an array as a tuple."""
    return tuple(value.tolist()) if isinstance(value, np.ndarray) else getattr(value, "tolist", lambda: value)()


def worlds(params: ArenaParams, tables: Sequence[str], objects: Sequence[str]) -> Worlds:
    """Many worlds, `params` (W, ...), with the names of tables and objects."""
    tables_there, objects_there = (np.asarray(there) for there in jax.vmap(present)(canonical(params)))
    of = {"table": (tables, tables_there), "object": (objects, objects_there)}
    ranges = []
    for kind, (names, there) in of.items():
        for i, name in enumerate(names):
            ranges.append(_range(name, "present", there[:, i]))
            for quantity, values in _quantities(on_host(params), kind, i, tables):
                ranges.append(_range(name, quantity, values[there[:, i]]))
    return Worlds(len(tables_there), tuple(ranges))


def _range(name: str, quantity: str, values: np.ndarray) -> Range:
    few = (np.min, np.mean, np.max)
    return Range(name, quantity, *(float(f(values)) if len(values) else np.nan for f in few))


# What a quantity is called, with its axis.
_CALLED = {
    "table_offsets": "{} [m]",
    "table_rots": "yaw [deg]",
    "table_full_sizes": "{} [m]",
    "table_frictions": "{} friction",
    "has_legs": "legs",
    "object_full_sizes": "size along {} [m]",
    "object_masses": "mass [kg]",
    "object_frictions": "{} friction",
    "object_rgba": "{}",
}


def _quantities(params: ArenaParams, kind: str, i: int, tables: Sequence[str]) -> Iterator[tuple[str, np.ndarray]]:
    """Names and values (W,) of all quantities of table or object `i`."""
    for field, called in _CALLED.items():
        quantity, values = QUANTITIES[field], getattr(params, field)
        if quantity.of != kind:
            continue
        values = np.degrees(values[:, i]) if field == "table_rots" else values[:, i]
        for axis, column in zip(quantity.axes.split(", "), np.reshape(values, (len(values), -1)).T, strict=True):
            yield called.format(axis), column
    if kind == "object":
        for t, table in enumerate(tables):
            yield f"on {table}", params.object_tables[:, i] == t


def _is_share(quantity: str) -> bool:
    return quantity in ("present", "legs") or quantity.startswith("on ")


def _absent(of: Table | Thing) -> str:
    return "" if of.present else "absent"


def _numbers(values: Numbers, between: str, form: str) -> str:
    return between.join(f"{x:{form}}" for x in values)


def columns(rows: Sequence[Sequence[str]]) -> str:
    """Rows of text under each other, without columns that hold nothing."""
    columns = [column for column in zip(*rows, strict=True) if any(column[1:])]
    widths = [max(map(len, column)) for column in columns]
    lines = (
        "  ".join(f"{cell:{w}}" for cell, w in zip(row, widths, strict=True)) for row in zip(*columns, strict=True)
    )
    return "\n".join(line.rstrip() for line in lines)
