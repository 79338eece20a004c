"""Contacts have some sliding friction: of less than `LEAST` MuJoCo makes `mjMINMU`, and MJX on JAX does not."""

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import ArenaParams, named
from mjx_arenas.rules.rule import Rule, Rules

LEAST = mujoco.mjMINMU * (1 - 2.0**-23)
"""`mjMINMU` as single precision may round it."""


def _slips(p: ArenaParams, r: Rules) -> Array:
    """(P,) bool: contacts that have less."""
    values = [named(p)[name] for name in r.sliding.quantities]
    xp = array_module(*values)
    every = xp.concatenate([xp.asarray(r.sliding.nominal), *(value.ravel() for value in values)])
    most = every[r.sliding.places].max(axis=1)
    return (most >= 0) & (most < LEAST)  # what is negative is another rule's


def _grips(p: ArenaParams, r: Rules) -> Array:
    return ~_slips(p, r).any() if r.sliding.names else np.True_


def _told(p: ArenaParams, r: Rules, _: Any) -> Mapping[str, Any]:
    """What the message says about the first one."""
    return {"name": r.sliding.names[int(np.flatnonzero(np.asarray(_slips(p, r)))[0])]}


GRIPS = Rule("too_smooth", "params", "world", (), _grips, _told, shown=True)
