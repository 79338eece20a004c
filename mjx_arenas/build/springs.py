"""Tendons that have no spring in any world, whose springs' lengths the compiler would take anew in each (host)."""

from collections.abc import Sequence

import mujoco
import numpy as np

from mjx_arenas.spec import specs
from mjx_arenas.terms.elements import Elements

_STIFF = ("tendon.stiffness", "tendon.stiffnesspoly")


def measured(tendon: mujoco.MjsTendon) -> bool:
    """Whether the compiler measures at `qpos0` how long a tendon is at rest."""
    return bool(np.all(np.array(tendon.springlength) == -1))


def keep(spec: mujoco.MjSpec, varied: Sequence[Elements]) -> mujoco.MjSpec:
    """Gives tendons that have no spring in any world the nominal length of one, which no step reads.

    The compiler takes this length from where the tendon's ends stand at `qpos0`, if the MJCF has no `springlength`.

    Args:
        spec: in which the terms' elements were prepared; changed, and returned.
        varied: all terms of the arena.
    """
    sprung = {name for one in varied if one.attribute in _STIFF for name in one.elements}
    lengths = [i for i, tendon in enumerate(spec.tendons) if measured(tendon)]
    slack = [i for i in lengths if not np.any(spec.tendons[i].stiffness) and spec.tendons[i].name not in sprung]
    if varied and slack:
        model = specs.compiled(spec.copy(), "arena.spec")
        for i in slack:
            spec.tendons[i].springlength = model.tendon_lengthspring[i]
    return spec
