"""Numbers of worlds that go with their failures (host). W worlds."""

from typing import NamedTuple

import numpy as np

from mjx_arenas.params.params import ArenaParams
from mjx_arenas.record.record import Record
from mjx_arenas.viz import describe

SURE = 3.5  # standard deviations of chance: one of 2,000 numbers that have nothing to do with it is this far off
TOLD = 3


class GoesWith(NamedTuple):
    """A number that is larger, or smaller, in worlds that fail."""

    name: str
    """Its full name, such as "table_frictions.table.sliding"."""
    unit: str
    failed: tuple[float, float]
    """The least and the most in worlds that fail."""
    others: tuple[float, float]
    """The least and the most in the others."""
    larger: float
    """Share of pairs of a world that fails and one that does not, in which it is larger in the first: from 0 to 1, 0.5 by chance."""

    def __str__(self) -> str:
        fail, rest = (f"{low:.3g} to {high:.3g}" for low, high in (self.failed, self.others))
        return f"{self.name} is {fail}{self.unit and ' ' + self.unit.strip('[]')} in worlds that fail, {rest} in others"


def goes_with(record: Record, params: ArenaParams, failed: np.ndarray) -> tuple[GoesWith, ...]:
    """The numbers by which worlds that fail differ most from the others, beyond chance (Mann and Whitney's test), the first few.

    Args:
        record: of the arena.
        params: (W, ...) of the worlds.
        failed: (W,) bool.
    """
    if failed.all() or not failed.any():
        return ()
    ground = record.parts.places.ground
    things = record.table_names, [*record.object_names], record.parts.selected, ground
    found = []
    for column in describe.numbers(params, record.nominal, *things):
        if column.rule.kind is int or not column.varies:
            continue
        there = np.ones_like(failed) if column.presence else column.there
        values = np.asarray(column.values, float)
        fail, rest = values[failed & there], np.sort(values[~failed & there])
        if not len(fail) or not len(rest):
            continue
        below = (np.searchsorted(rest, fail, "left") + np.searchsorted(rest, fail, "right")) / 2
        larger = float(below.mean() / len(rest))
        if abs(larger - 0.5) > SURE * np.sqrt((len(fail) + len(rest) + 1) / (12 * len(fail) * len(rest))):
            of_failed, of_others = ((float(x.min()), float(x.max())) for x in (fail, rest))
            found.append(GoesWith(column.name, column.rule.unit, of_failed, of_others, larger))
    return tuple(sorted(found, key=lambda one: -abs(one.larger - 0.5))[:TOLD])
