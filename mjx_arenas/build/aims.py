"""Cameras and lights that aim at what ranges may leave out (host)."""

import mujoco
import numpy as np

from mjx_arenas.params.params import ArenaRanges
from mjx_arenas.problem import problem
from mjx_arenas.problems import messages
from mjx_arenas.rules import validation_ranges
from mjx_arenas.sample import tops
from mjx_arenas.sample.sampling import Nominal
from mjx_arenas.terms.parts import Parts
from mjx_arenas.terms.presence import aims, with_all_on

_POSES = {"camera": ("orientation", "cam_xmat"), "light": ("direction", "light_xdir")}


def warn_of_absent(spec: mujoco.MjSpec, parts: Parts, ranges: ArenaRanges, nominal: Nominal) -> None:
    """Warns of cameras and lights that aim at what is absent in some worlds, and are there themselves."""
    presence, kinds = parts.presence, {"camera": spec.cameras, "light": spec.lights}
    aimed = [(kind, i, one) for kind, some in kinds.items() for i, one in enumerate(some) if aims(one)]
    if not aimed or not ranges.varying & (tops.deciding(nominal.ground) | frozenset(presence.quantities)):
        return
    names = [presence.bodies[i] for i in np.flatnonzero(~_sure(parts, ranges, nominal))]
    gone = [with_all_on(spec, name) for name in names]
    for kind, i, one in aimed:
        if any(one.targetbody in bodies and one.parent.name not in bodies for bodies in gone):
            own, pose = _POSES[kind]
            name = f"{kind} {one.name!r}" if one.name else f"{kind} {i}"
            told = {"name": name, "target": one.targetbody, "own": own, "pose": pose}
            messages.warn(problem("ranges", "aims_at_absent", None, None, told))


def _sure(parts: Parts, ranges: ArenaRanges, nominal: Nominal) -> np.ndarray:
    """(T + K + E,) bool: tables, objects, and others that come and go, that are there in all worlds."""
    tables, objects, *_ = validation_ranges.presence(ranges, nominal, most=False)
    terms, first = dict(nominal.params.terms), len(tables) + len(objects)
    given = ranges.given_terms
    for name in (one.name for one in parts.coming if one.name in given):
        dist, value = given[name], np.asarray(terms[name])
        least = np.zeros_like(value) if validation_ranges.traced(dist) else validation_ranges.reach(dist, value)[0]
        terms[name] = np.asarray(least).astype(bool)
    least = nominal.params._replace(table_active=tables, object_active=objects, terms=terms)
    others = np.asarray(parts.wanted(least), bool)[first : len(parts.presence.bodies)]
    return np.concatenate([tables, objects, others])
