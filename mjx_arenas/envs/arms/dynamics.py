"""How an arm itself varies from episode to episode, as what a simulation has wrong about a real one (host)."""

from collections.abc import Callable, Mapping
from typing import Any

import jax.numpy as jnp

from mjx_arenas import dr
from mjx_arenas.arena import Arena
from mjx_arenas.params.distribution import Distribution
from mjx_arenas.params.params import ArenaRanges
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error, warn
from mjx_arenas.rules.validation import check_type, is_number

_OTHERS_DECIDE = "friction"
"""The quantity of the preset that has no effect on objects in the tasks' arenas, where these have a higher `priority`."""


def vary(arena: Arena, prefix: str, ranges: Any, terms: Mapping[str, dr.Term] | None, strength: float) -> Any:
    """Varies what a task's user asks for, once the arm is in the arena.

    Args:
        arena: not compiled yet.
        prefix: of the names of the arm's elements.
        ranges: ranges of the task, or a function of a level that gives them.
        terms: of the user's own, which take the place of the preset's of the same names; their ranges are the user's, too.
        strength: of `dr.robot` for the arm; with 0 nothing of it varies.

    Returns:
        The ranges with those of the preset, unless they have these already.

    Raises:
        ValueError, TypeError: the terms or the strength are wrong.
    """
    example = "{'kp': dr.Term('actuator.kp', 'arm_.*')}"
    check_type("terms", terms, (Mapping, type(None)), f"dr.Terms by their names, such as {example}")
    if not (is_number(strength) and 0 <= strength <= 1):
        raise error([problem("robot_strength", "must", None, strength, must="a number from 0 to 1")])
    own, of_arm = dict(terms or {}), {}
    if strength:
        preset = dr.robot(arena.spec, prefix, float(strength))
        others = (prefix + _OTHERS_DECIDE, *own)
        of_arm = {name: varies for name, varies in preset.ranges.items() if name not in others}
        own = {name: preset.terms[name] for name in of_arm} | own
    arena.vary(**own)
    found = _with_terms(ranges, of_arm)
    all_of = found if isinstance(found, ArenaRanges) or not callable(found) else found(jnp.ones(()))
    if not strength:
        _check_of_preset(arena, prefix, all_of)
    _warn_of_still(terms, all_of)
    return found


def _check_of_preset(arena: Arena, prefix: str, ranges: Any) -> None:
    """Refuses ranges of quantities that the preset brings, where it is not asked for."""
    terms = ranges.terms if isinstance(ranges, ArenaRanges) else {}
    unknown = [name for name in terms if name.startswith(prefix) and name not in arena.quantities]
    preset = dr.robot(arena.spec, prefix).terms if unknown else {}
    if lacks := [name for name in unknown if name in preset]:
        raise error([problem("ranges.terms", "strength_lacks", None, lacks[0])])


def _warn_of_still(terms: Mapping[str, dr.Term] | None, ranges: Any) -> None:
    """Warns of terms of a user's own for which there is no range, and which therefore never vary."""
    for name in terms or {}:
        if isinstance(ranges, ArenaRanges) and name not in ranges.terms:
            warn(problem(f"terms[{name!r}]", "no_range", name=name))


def _with_terms(ranges: Any, terms: Mapping[str, Distribution]) -> Any:
    """Ranges, or a function of a level that gives them, and those of further terms, unless they have these already."""

    def over(given: Any) -> Any:
        return given._replace(terms={**terms, **given.terms}) if isinstance(given, ArenaRanges) else given

    if not terms or isinstance(ranges, ArenaRanges) or not isinstance(ranges, Callable):
        return over(ranges)
    return lambda level: over(ranges(level))
