"""What can be said in a spec only once all terms are known (host)."""

from collections.abc import Sequence

import mujoco

from mjx_arenas.build import points, springs
from mjx_arenas.terms.elements import Elements


def finished(spec: mujoco.MjSpec, varied: Sequence[Elements]) -> mujoco.MjSpec:
    """The spec, changed so that its compiler treats bodies and tendons alike in all worlds.

    Args:
        spec: in which the terms' elements were prepared; changed, and returned.
        varied: all terms of the arena.
    """
    return springs.keep(points.end(spec, varied), varied)
