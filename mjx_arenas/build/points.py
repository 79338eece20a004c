"""Bodies that only slide, which MuJoCo takes for points as long as their centres of mass are their origins (host)."""

from collections.abc import Iterable

import mujoco
import numpy as np

from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import warn
from mjx_arenas.terms.attributes import ATTRIBUTES
from mjx_arenas.terms.attributes.prepare import not_simple
from mjx_arenas.terms.elements import Elements, in_spec

_POINT = 2  # `body_simple` of one
_SAME = 1e-9  # relative


def end(spec: mujoco.MjSpec, varied: Iterable[Elements]) -> mujoco.MjSpec:
    """Has the compiler take no body for one, nor for any other whose inertia matrix is diagonal, that can be another one in some world.

    Args:
        spec: in which the terms' elements were prepared; changed, and returned.
        varied: all terms of the arena.
    """
    for one in varied:
        ends = ATTRIBUTES[one.attribute].ends_point
        for element in (in_spec(spec, one.kind, name) for name in one.elements) if ends is not None else ():
            assert ends is not None
            if ends(element):
                not_simple(element if one.kind == "body" else element.parent)
    return spec


def warn_of_ended(before: mujoco.MjModel, after: mujoco.MjModel) -> None:
    """Warns of bodies that are points no more, and have contacts of another softness.

    Args:
        before: the model without the new terms.
        after: the model that `end` left.
    """
    for body in np.flatnonzero((before.body_simple == _POINT) & (after.body_simple != _POINT)).tolist():
        one, other = (float(model.body_invweight0[body, 0]) for model in (before, after))
        if not np.isclose(one, other, _SAME, _SAME):
            warn(problem(before.body(body).name, "no_point", None, None, {"before": one, "after": other}))
