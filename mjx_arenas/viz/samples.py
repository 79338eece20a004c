"""Parameters of many worlds as tables (host)."""

import io
import pathlib
from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np

from mjx_arenas.files.output import whole
from mjx_arenas.params.params import ArenaParams, ArenaRanges, canonical, named, on_host
from mjx_arenas.progress import Tell, silent
from mjx_arenas.record.record import Record
from mjx_arenas.sample.sampling import world_keys
from mjx_arenas.sim import programs
from mjx_arenas.viz import describe
from mjx_arenas.viz.describe import Column

CHUNK = 100_000  # worlds that are drawn together


class Sample(NamedTuple):
    """Some worlds of a seed."""

    seed: int
    numbers: np.ndarray  # (W,)
    params: ArenaParams  # (W, ...)
    valid: np.ndarray  # (W,) bool, see `arena.valid`


def draw(
    record: Record,
    ranges: ArenaRanges,
    seed: int,
    numbers: Sequence[int],
    progress: Tell = silent,
) -> Sample:
    """The parameters of some worlds of a seed, those that `randomize` draws with `world_keys`.

    Args:
        record: of the arena.
        ranges: that they are drawn from.
        seed: of all worlds.
        numbers: (W,) of the worlds.
        progress: called with how many are drawn, and of how many.
    """
    n_worlds, size, chunks = len(numbers), min(len(numbers), CHUNK), []
    for first in range(0, n_worlds, size):
        rows = np.resize(numbers[first : first + size], size)  # the last ones, too, or they would be compiled anew
        chunks.append(jax.tree.map(np.asarray, programs.draw(record, world_keys(seed, rows), ranges)[:2]))
        progress(min(first + size, n_worlds), n_worlds)
    params, valid = jax.tree.map(lambda *parts: np.concatenate(parts)[:n_worlds], *chunks)
    return Sample(seed, np.asarray(numbers), params, valid)


def columns(record: Record, params: ArenaParams) -> list[Column]:
    """All parameters (W, ...) as columns, in the order of `ArenaParams`."""
    nominal, parts, names = on_host(canonical(record.nominal)), record.parts, list(record.object_names)
    return describe.numbers(params, nominal, record.table_names, names, parts.selected, parts.places.ground)


def write(path: pathlib.Path, record: Record, worlds: Sample) -> None:
    """Writes all parameters, a row for each world; replaces a file that is there.

    Args:
        path: `.npz`: the arrays (W, ...) by the names of `ArenaParams`, beside `world`, `valid` and `seed`. `.csv` and
            `.parquet`: a column for each number.
        record: of the arena.
        worlds: what to write.

    Raises:
        ValueError, OSError: one sentence.
    """
    with whole(path) as unfinished:
        if path.suffix == ".npz":
            beside = {"world": worlds.numbers, "valid": worlds.valid, "seed": worlds.seed}
            np.savez_compressed(unfinished, **beside, **named(worlds.params))
            return
        import polars

        numbers = {column.name: column.values for column in columns(record, worlds.params)}
        table = polars.DataFrame({"world": worlds.numbers, "valid": worlds.valid, **numbers})
        text = io.BytesIO()  # of a full disk, polars says what only polars understands
        table.write_csv(text) if path.suffix == ".csv" else table.write_parquet(text)
        unfinished.write_bytes(text.getvalue())
