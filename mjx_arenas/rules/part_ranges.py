"""Ranges of furniture that give what a part cannot be (host)."""

from collections.abc import Iterator

import numpy as np

from mjx_arenas.furniture import standing
from mjx_arenas.furniture.part import Condition, Part
from mjx_arenas.params.distribution import Distribution
from mjx_arenas.params.params import ArenaRanges
from mjx_arenas.problem import Problem, problem, rounded
from mjx_arenas.problems.messages import warn
from mjx_arenas.rules import world_rules
from mjx_arenas.rules.validation import Labels
from mjx_arenas.rules.validation_ranges import path_of, reach, traced
from mjx_arenas.sample.sampling import Nominal

INSIDE = 1e-6  # of a number: how far bounds are moved inwards, as JAX holds them in single precision


class _Read(dict):
    """Numbers by name, which note the names that are read."""

    def __init__(self, numbers: dict[str, np.ndarray]) -> None:
        super().__init__(numbers)
        self.names: set[str] = set()

    def __getitem__(self, name: str) -> np.ndarray:
        self.names.add(name)
        return super().__getitem__(name)


def reach_problems(ranges: ArenaRanges, nominal: Nominal, labels: Labels) -> list[Problem]:
    """Joints that can start where they do not reach, where nothing else varies that decides how far they do.

    Args:
        ranges: of which each is right by itself.
        nominal: of the arena.
        labels: of its quantities.
    """
    found = []
    for part, condition, dist in _conditions(ranges, nominal):
        name, own = f"{part.name}.{condition.of}", _Read(standing.numbers_of(part, nominal.params))
        condition.holds(own)
        others = {f"{part.name}.{one}" for one in own.names - {condition.of}}
        if not part.parameters[condition.of].starts or others & set(ranges.given_terms):
            continue
        for bound in _bounds(name, dist, nominal):
            wrong = []
            for i, row in enumerate(labels.of(name)[1]):
                numbers = np.array(nominal.params.terms[name])
                numbers[i] = bound[i]
                if not condition.holds(_with(own, part, condition.of, numbers)):
                    got, item = rounded(bound[i], 5), world_rules.item("part", row)
                    wrong.append(problem(path_of(name, labels), "reach_allowed", item, got, must=condition.must))
            found += world_rules.joined(wrong, len(bound))
    return found


def warn_of_ranges(ranges: ArenaRanges, nominal: Nominal, labels: Labels) -> None:
    """Warns of one absolute range for several pieces, which is wrong at both ends.

    It also warns of one that is added to x, y and z, so that the part sinks into the floor.

    Args:
        ranges: that were found right.
        nominal: of the arena.
        labels: of its quantities.
    """
    for part, condition, dist in _conditions(ranges, nominal):
        name = f"{part.name}.{condition.of}"
        if dist.relative is not None or _n(dist) > 1 or len(labels.of(name)[1]) < 2:
            continue
        own, bounds = standing.numbers_of(part, nominal.params), _bounds(name, dist, nominal)
        if not any(condition.holds(_with(own, part, condition.of, bound)) for bound in bounds):
            least, most = (float(np.min(bounds[0])), float(np.max(bounds[1])))
            told = {"must": condition.must, "least": least, "most": most}
            warn(problem(path_of(name, labels), "one_for_all_pieces", ("part", part.name), None, told))
    for part in nominal.furniture:
        name = f"{part.name}.pos"
        dist = ranges.terms.get(name)
        if dist is None or traced(dist) or dist.relative != "add" or _n(dist) > 1:
            continue
        least, most = (float(np.min(bound)) for bound in dist.support())
        height = standing.numbers_of(part, nominal.params)["pos"][2]
        if least < most and part.on is None and part.beside is None and height + least < 0 <= height:
            told = {"least": least, "most": most}
            warn(problem(path_of(name, labels), "below_zero", ("part", part.name), None, told))


def _conditions(ranges: ArenaRanges, nominal: Nominal) -> Iterator[tuple[Part, Condition, Distribution]]:
    """The conditions of parts on quantities that vary, with ranges of known numbers."""
    for part in nominal.furniture:
        for condition in part.conditions:
            dist = ranges.terms.get(f"{part.name}.{condition.of}")
            if dist is not None and not traced(dist):
                yield part, condition, dist


def _n(dist: Distribution) -> int:
    """How many numbers its bounds have, at most."""
    return max(np.size(bound) for bound in dist.support())


def _bounds(name: str, dist: Distribution, nominal: Nominal) -> tuple[np.ndarray, np.ndarray]:
    low, high = reach(dist, np.asarray(nominal.params.terms[name]))
    inside = INSIDE * np.maximum(np.abs(low), np.abs(high))
    return np.minimum(low + inside, high), np.maximum(high - inside, low)


def _with(own: dict[str, np.ndarray], part: Part, name: str, numbers: np.ndarray) -> dict[str, np.ndarray]:
    """A part's numbers, with others of one parameter."""
    return {**own, name: numbers[0] if part.parameters[name].items == ("",) else numbers}
