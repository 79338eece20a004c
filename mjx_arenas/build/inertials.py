"""Inertials that stay when the geoms of which the compiler made them vary, or are edited (host)."""

from collections.abc import Collection, Sequence

import mujoco
import numpy as np

from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error, warn
from mjx_arenas.spec import comparing, masses, specs, weighed
from mjx_arenas.terms.attributes import ATTRIBUTES, prepare
from mjx_arenas.terms.elements import Elements

_MOVING = {"geom.size": "size", "geom.pos": "place", "geom.rpy": "orientation"}
_SAME = 1e-9  # relative


def made_of_geoms(spec: mujoco.MjSpec, attribute: str, names: Sequence[str]) -> tuple[str, ...]:
    """The elements of a term that gets masses as numbers, of which the compiler has made these of geoms until now."""
    if ATTRIBUTES[attribute].prepare is prepare.weighed:
        return tuple(name for name in names if masses.inferred(spec.body(name)))
    return tuple(name for name in names if np.isnan(spec.geom(name).mass)) if attribute == "geom.mass" else ()


def check_geoms(spec: mujoco.MjSpec, varied: Sequence[Elements]) -> None:
    """Refuses geoms that were added or edited since `arena.vary` has read what they weigh: bodies have kept the masses of before.

    Args:
        spec: of the arena, in which the terms' elements were prepared.
        varied: all terms of the arena.

    Raises:
        ValueError: a body would have another mass, centre of mass or inertia, or a geom another mass.
    """
    terms = [one for one in varied if one.weighed]
    if not terms:
        return
    probe = spec.copy()
    for one in terms:
        for name in one.weighed:
            if one.kind == "body":
                specs.assign(probe.body(name), explicitinertial=False, ipos=[np.nan] * 3)
            else:
                probe.geom(name).mass = np.nan
    model = specs.compiled(probe.copy(), "arena.spec")
    for one in terms:
        changed = _other_bodies(model, one) if one.kind == "body" else _other_geoms(probe, model, one)
        if changed:
            what = f"what {'the geoms of body' if one.kind == 'body' else 'geom'} {changed[0]!r} weigh"
            told = {"what": what + "s" * (one.kind == "geom"), "name": one.name}
            raise error([problem("arena.spec", "edited_since", None, None, told)])


def _other_bodies(model: mujoco.MjModel, term: Elements) -> list[str]:
    """The bodies of a term to which the compiler would give another inertial now."""

    def inertial(of: mujoco.MjModel, name: str) -> list[np.ndarray]:
        return [comparing.array(of, field)[of.body(name).id] for field in ("body_mass", "body_ipos", "body_inertia")]

    sizes = (0.0, term.base.stat.meansize, 0.0)
    pairs = {name: zip(inertial(model, name), inertial(term.base, name), sizes, strict=True) for name in term.weighed}
    return [
        name
        for name, both in pairs.items()
        if any(np.abs(a - b).max() > _SAME * (np.abs(b).max() + size) for a, b, size in both)
    ]


def _other_geoms(spec: mujoco.MjSpec, model: mujoco.MjModel, term: Elements) -> list[str]:
    """The geoms of a term that would weigh something else now."""
    solids = weighed.of(spec, term.weighed)
    now = dict(zip((model.geom(int(geom)).name for geom in solids.geom), solids.mass.tolist(), strict=True))
    before = dict(zip(term.elements, term.nominal.tolist(), strict=True))
    return [name for name in term.weighed if abs(now.get(name, 0.0) - before[name]) > _SAME * before[name]]


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
