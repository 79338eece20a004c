"""Why none, or few, of many worlds are valid (host)."""

import jax
import numpy as np

from mjx_arenas.params.params import ArenaParams, ArenaRanges, each, on_host
from mjx_arenas.problem import Problem, in_world, problem
from mjx_arenas.problems import messages
from mjx_arenas.rules import meant_rules
from mjx_arenas.rules.validation import Labels
from mjx_arenas.rules.validation_worlds import Rules, bound, world_problems
from mjx_arenas.sample.sampling import Nominal

FEWEST = 8  # worlds of which one expects that many are valid
EXPECTED = 0.5  # their share
_LOOKED_AT = 16  # worlds, for the reasons
_TOLD = 2  # reasons


def warn(
    valid: jax.Array, params: ArenaParams, rules: Rules, ranges: ArenaRanges, nominal: Nominal, labels: Labels
) -> None:
    """Warns where fewer than half of many worlds are valid. Waits for the device.

    Args:
        valid: (W,) bool, of this process's worlds.
        params: (W, ...) of the worlds.
        rules: of the arena.
        ranges: from which the worlds were drawn, with numbers that are known.
        nominal: what the draws started from.
        labels: of the arena's quantities.
    """
    with jax.transfer_guard_device_to_host("allow"):
        right = jax.device_get(valid)
        if len(right) >= FEWEST and right.sum() < EXPECTED * len(right):
            messages.warn(found(jax.device_get(params), right, rules, ranges, nominal, labels))


def found(
    params: ArenaParams, valid: np.ndarray, rules: Rules, ranges: ArenaRanges, nominal: Nominal, labels: Labels
) -> Problem:
    """What is wrong with ranges that gave W worlds of which few or none are valid: the commonest reasons, and what may have been meant.

    Args:
        params: (W, ...) of these worlds.
        valid: (W,) bool, which of them are.
        rules: of the arena.
        ranges: from which the worlds were drawn.
        nominal: what the draws started from.
        labels: of the arena's quantities.
    """
    params, rules = on_host(params), bound(rules, ranges)
    reasons: dict[tuple[str, str], list[Problem]] = {}  # by argument and rule, one of each world
    for world in np.flatnonzero(~valid)[:_LOOKED_AT].tolist():
        problems = world_problems(each(lambda x, w=world: x[w], params), rules)
        first = {(p.path, p.rule): p for p in reversed(problems or [Problem("params", "precision")])}
        for kind, one in reversed(first.items()):
            reasons.setdefault(kind, []).extend(in_world([one], world))
    often = sorted(reasons.values(), key=len, reverse=True)
    told = [some[0] for some in often[:_TOLD] if 2 * len(some) >= len(often[0])]
    meant = max(meant_rules.far(ranges, nominal, labels), key=lambda one: one[0], default=None)
    why = " ".join(map(messages.sentence, [*told, *([meant[1]] if meant else [])]))
    rule = "few_valid" if valid.any() else "none_valid"
    return problem("ranges", rule, n=len(valid), n_valid=int(valid.sum()), why=why.removesuffix("."))
