"""Parameters of many worlds as tables (host)."""

import pathlib
from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np

from mjx_arenas.arena import Arena
from mjx_arenas.calls import plain
from mjx_arenas.output import whole
from mjx_arenas.params import QUANTITIES, ArenaParams, ArenaRanges, Quantity
from mjx_arenas.sampling import world_keys


class Worlds(NamedTuple):
    """Some worlds of a seed."""

    seed: int
    numbers: np.ndarray  # (W,)
    params: ArenaParams  # (W, ...)
    valid: np.ndarray  # (W,) bool, see `arena.valid`


class Column(NamedTuple):
    """One number of each world."""

    quantity: str
    item: str  # name of the table's body or of the object
    axis: str
    values: np.ndarray  # (W,)
    nominal: float

    @property
    def name(self) -> str:
        """As "table_offsets.table0.x"."""
        return ".".join(filter(None, (self.quantity, self.item, self.axis)))

    @property
    def rule(self) -> Quantity:
        """What there is to know of the quantity."""
        return QUANTITIES[self.quantity]

    @property
    def varies(self) -> bool:
        """Whether two worlds differ in it."""
        return bool(np.any(self.values != self.values[:1]))


def draw(arena: Arena, ranges: ArenaRanges, seed: int, numbers: Sequence[int]) -> Worlds:
    """The parameters of some worlds of a seed, those that `randomize` draws with `world_keys`."""

    def one(key: jax.Array) -> tuple[ArenaParams, jax.Array]:
        params = arena.sample_params(key, ranges)
        return params, arena.valid(params, ranges)

    params, valid = jax.jit(jax.vmap(one))(world_keys(seed, numbers))
    return Worlds(seed, np.asarray(numbers), jax.tree.map(np.asarray, params), np.asarray(valid))


def columns(arena: Arena, params: ArenaParams) -> list[Column]:
    """All parameters (W, ...) as columns, in the order of `ArenaParams`."""
    names = {"table": arena.table_names, "object": [o.name for o in arena.objects]}
    found = []
    for (quantity, rule), values, usual in zip(QUANTITIES.items(), params, arena._nominal, strict=True):
        axes = rule.axes.split(", ")
        for i, item in enumerate(names[rule.of]):
            numbers = np.reshape(values[:, i], (len(values), -1))
            found += [
                Column(quantity, item, axis, number, float(one))
                for axis, number, one in zip(axes, numbers.T, np.ravel(usual[i]), strict=True)
            ]
    return found


class Summary(NamedTuple):
    """Between which values one number varies."""

    quantity: str
    item: str
    axis: str
    unit: str
    nominal: float
    min: float
    mean: float
    max: float


def summaries(found: Sequence[Column]) -> list[Summary]:
    """What varies, between which values."""
    return [
        Summary(
            *(c.quantity, c.item, c.axis, c.rule.unit, c.nominal),
            *(float(plain(f(c.values))) for f in (np.min, np.mean, np.max)),
        )
        for c in found
        if c.varies
    ]


def write(path: pathlib.Path, arena: Arena, worlds: Worlds) -> None:
    """Writes all parameters, a row for each world; replaces a file that is there.

    Args:
        path: `.npz`: the arrays (W, ...) by the names of `ArenaParams`, beside `world`, `valid` and `seed`. `.csv` and
            `.parquet`: a column for each number.
        arena: of the worlds.
        worlds: what to write.

    Raises:
        ValueError, OSError: one sentence.
    """
    with whole(path) as unfinished:
        if path.suffix == ".npz":
            beside = {"world": worlds.numbers, "valid": worlds.valid, "seed": worlds.seed}
            np.savez_compressed(unfinished, **beside, **worlds.params._asdict())
            return
        import polars

        numbers = {column.name: column.values for column in columns(arena, worlds.params)}
        table = polars.DataFrame({"world": worlds.numbers, "valid": worlds.valid, **numbers})
        if path.suffix == ".csv":
            table.write_csv(unfinished)
        else:
            table.write_parquet(unfinished)
