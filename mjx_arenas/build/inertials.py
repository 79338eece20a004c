"""Inertials that stay when the geoms of which the compiler made them vary (host)."""

from collections.abc import Collection, Sequence

import mujoco
import numpy as np

from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import warn
from mjx_arenas.spec import specs, weighed
from mjx_arenas.terms.attributes import ATTRIBUTES, prepare
from mjx_arenas.terms.elements import Elements

_MOVING = {"geom.size": "size", "geom.pos": "place", "geom.rpy": "orientation"}
_SAME = 1e-9  # relative


def warn_of_stale(spec: mujoco.MjSpec, varied: Sequence[Elements], new: Collection[str]) -> None:
    """Warns of geoms that vary on bodies whose inertial another term decides, though the compiler makes it of these geoms.

    Args:
        spec: in which the terms' elements were prepared.
        varied: all terms of the arena.
        new: names of the terms that were not there before.
    """
    of = {name: one for one in varied if ATTRIBUTES[one.attribute].prepare is prepare.weighed for name in one.elements}
    pairs = [
        (one, geom, of[body])
        for one in varied
        if one.attribute in _MOVING
        for geom in one.elements
        if (body := spec.geom(geom).parent.name) in of and {one.name, of[body].name} & set(new)
    ]
    weighing = _weighing(spec, [geom for _, geom, _ in pairs])
    told = set()
    for one, geom, other in pairs:
        if geom in weighing and (one.name, other.name) not in told:
            told.add((one.name, other.name))
            what = {"name": one.name, "what": _MOVING[one.attribute], "geom": geom, "other": other.name}
            what |= {"body": spec.geom(geom).parent.name, "attribute": other.attribute}
            warn(problem(one.name, "stale_inertial", None, None, what))


def _weighing(spec: mujoco.MjSpec, geoms: Sequence[str]) -> set[str]:
    """The geoms that weigh something, and make the inertial that their body has."""
    if not geoms:
        return set()
    probe = spec.copy()
    names = {spec.geom(geom).parent.name for geom in geoms}
    for name in names:
        specs.assign(probe.body(name), explicitinertial=False, ipos=[np.nan] * 3)
    try:
        made = specs.compiled(probe.copy(), "arena.spec")
    except ValueError:  # the geoms weigh nothing
        return set()
    own, solids = specs.compiled(spec.copy(), "arena.spec"), weighed.of(probe, geoms)
    weighs = {made.geom(int(geom)).name for geom in solids.geom[solids.mass > 0]}
    same = np.ones(made.nbody, bool)
    for field in ("body_mass", "body_inertia", "body_ipos"):
        a, b = (np.reshape(getattr(model, field), (made.nbody, -1)) for model in (made, own))
        same &= np.isclose(a, b, _SAME, _SAME).all(-1)
    return {geom for geom in geoms if geom in weighs and same[made.geom(geom).bodyid[0]]}
