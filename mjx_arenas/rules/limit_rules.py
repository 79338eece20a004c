"""Joints and tendons are never within the margins of both of their limits: MJX holds one of them at a time, MuJoCo both."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mjx_arenas.furniture import standing
from mjx_arenas.furniture.part import stacked
from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.rules.rule import Rule, Rules


def _meet(p: ArenaParams, r: Rules) -> Array:
    """(N,) bool: a state is within both margins."""
    values = [p.terms[name] for name in r.limits.quantities]
    for part in r.limits.parts:
        numbers = standing.numbers_of(part, p)
        values.append(stacked([joint.range for joint in part.joints(numbers)], numbers["pos"]))
    xp = array_module(*values)
    every = xp.concatenate([xp.asarray(r.limits.nominal).ravel(), *(value.ravel() for value in values)])
    low, high, margin = every[r.limits.places].T
    return (low <= high) & (high - low < 2 * margin)  # ranges that turn over are another rule's


def _apart(p: ArenaParams, r: Rules) -> Array:
    return ~_meet(p, r).any() if r.limits.names else np.True_


def _told(p: ArenaParams, r: Rules, _: Any) -> Mapping[str, Any]:
    """What the message says about the first one."""
    return {"name": r.limits.names[int(np.flatnonzero(np.asarray(_meet(p, r)))[0])]}


APART = Rule("limits_meet", "params", "world", (), _apart, _told, shown=True)
