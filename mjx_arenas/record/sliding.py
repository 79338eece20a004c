"""The contacts whose sliding friction parameters decide (host)."""

import mujoco
import numpy as np

from mjx_arenas.params.params import ArenaParams, named
from mjx_arenas.rules.friction_rules import Decides
from mjx_arenas.rules.rule import NO_SLIDING, Sliding
from mjx_arenas.rules.sliding_rules import LEAST
from mjx_arenas.terms.parts import Parts
from mjx_arenas.terms.rubbing import pairs, rubbing


def sliding(spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams) -> Sliding:
    """The contacts that may have too little of it, one of all whose friction the same numbers decide."""
    geoms, own = rubbing(spec, parts), pairs(spec, parts)
    n = len(geoms.sliding)
    one, other = np.nonzero(np.triu(geoms.touch))
    first, second = (np.where(geoms.priority[a] >= geoms.priority[b], a, b) for a, b in ((one, other), (other, one)))
    condim = np.maximum(geoms.condim[first], geoms.condim[second])
    alone = n + np.arange(len(own.sliding))
    first, second = np.append(first, alone), np.append(second, alone)
    names = [f"{geoms.names[a]} and {geoms.names[b]}" for a, b in zip(one, other, strict=True)] + list(own.names)
    values, masks = named(nominal), {term.name: term.mask for term in parts.varied}
    decides = [one if one is None or _free(masks, one) else None for one in (*geoms.decides, *own.decides)]
    quantities = tuple(sorted({one.quantity for one in decides if one is not None}))
    starts = n + len(own.sliding) + np.cumsum([0, *(np.size(values[name]) for name in quantities)])
    at = {name: (int(start), np.shape(values[name])) for name, start in zip(quantities, starts, strict=False)}
    places = np.array([i if one is None else _place(at, one) for i, one in enumerate(decides)], int)
    constant = np.append(geoms.sliding, own.sliding)
    never = np.array([one is None for one in decides], bool)
    enough = never & (constant >= LEAST)
    kept = (np.append(condim, own.condim) > 1) & ~(never[first] & never[second]) & ~enough[first] & ~enough[second]
    if not kept.any():
        return NO_SLIDING
    found = np.sort(np.stack([places[first], places[second]], axis=1)[kept], axis=1)
    rows, which = np.unique(found, axis=0, return_index=True)
    called = np.array(names, object)[kept][which]
    return Sliding(tuple(called.tolist()), constant, quantities, rows)


def _free(masks: dict[str, np.ndarray], one: Decides) -> bool:
    """Whether the number varies that decides; the other axes may alone."""
    return one.quantity not in masks or bool(masks[one.quantity][one.row].reshape(-1)[0])


def _place(at: dict[str, tuple[int, tuple[int, ...]]], one: Decides) -> int:
    """Where the sliding friction of a row is."""
    start, shape = at[one.quantity]
    return start + one.row * int(np.prod(shape[1:]))
