"""What the contacts of a spec take their friction from (host)."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from mjx_arenas.rules.friction_rules import Decides, OfPairs, Rubbing
from mjx_arenas.terms.parts import Parts

_WORLD = ""  # what moves all that does not move


class _Geom(NamedTuple):
    """A geom that collides."""

    geom: mujoco.MjsGeom
    body: str
    moves: str
    """What moves it: one text for all that moves as one."""
    above: str
    """What moves that."""
    free: bool
    """Whether a joint moves it, or something above it."""
    of: Decides | None


def rubbing(spec: mujoco.MjSpec, parts: Parts) -> Rubbing:
    """The friction of all geoms that collide."""
    named = _deciding(parts)
    variants = parts.geoms_of_variants
    objects = {o.name: Decides("object_frictions", k, o.name not in variants) for k, o in enumerate(parts.objects)}
    found = list(_geoms(spec.worldbody, (), None, objects))
    return Rubbing(
        _touch(spec, found),
        np.array([one.geom.priority for one in found], int),
        np.array([one.geom.friction[0] for one in found], float),
        tuple(named.get(one.geom.name, one.of) for one in found),
        tuple(_of_geom(one) for one in found),
        np.array([one.geom.condim for one in found], int),
    )


def pairs(spec: mujoco.MjSpec, parts: Parts) -> OfPairs:
    """The friction of all pairs of geoms that have their own."""
    off = spec.option.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT
    found = [] if off else list(spec.pairs)
    terms = [one for one in parts.varied if one.attribute == "pair.friction"]
    decides = {name: Decides(one.name, i) for one in terms for i, name in enumerate(one.elements)}
    return OfPairs(
        tuple(f"pair {one.name!r}" if one.name else f"a pair of {one.geomname1!r}" for one in found),
        np.array([one.condim for one in found], int),
        np.array([one.friction[0] for one in found], float),
        tuple(decides.get(one.name) for one in found),
    )


def _of_geom(one: _Geom) -> str:
    """What a message calls it."""
    if one.geom.name:
        return f"geom {one.geom.name!r}"
    return f"an unnamed geom of body {one.body!r}" if one.body else "an unnamed geom"


def _geoms(
    body: mujoco.MjsBody,
    path: tuple[int, ...],
    of: Decides | None,
    objects: dict[str, Decides],
    moves: str = _WORLD,
    above: str = _WORLD,
    free: bool = False,
) -> Iterator[_Geom]:
    """The geoms that collide of a body and of what hangs on it."""
    if len(body.joints) or body.mocap:
        moves, above, free = str(path), moves, free or len(body.joints) > 0
    of = objects.get(body.name, of)
    for geom in body.geoms:
        if geom.contype or geom.conaffinity:
            yield _Geom(geom, body.name, moves, above, free, of)
    for i, below in enumerate(body.bodies):
        yield from _geoms(below, (*path, i), of, objects, moves, above, free)


def _touch(spec: mujoco.MjSpec, found: Sequence[_Geom]) -> np.ndarray:
    """(N, N) bool: the pairs of geoms that MuJoCo's filters leave. A contact of a `<pair>` has the friction of that."""
    flags, disabled = mujoco.mjtDisableBit, spec.option.disableflags
    if disabled & flags.mjDSBL_CONTACT:
        return np.zeros((len(found), len(found)), bool)
    contype, conaffinity = np.array([(g.geom.contype, g.geom.conaffinity) for g in found], int).reshape(-1, 2).T
    moves, above = (np.array(texts, object) for texts in ([g.moves for g in found], [g.above for g in found]))
    touch = (contype[:, None] & conaffinity).astype(bool)
    free = np.array([g.free for g in found], bool)
    touch = (touch | touch.T) & (moves[:, None] != moves) & (free[:, None] | free)
    if not disabled & flags.mjDSBL_FILTERPARENT:
        child = (moves != _WORLD)[:, None] & (moves[:, None] == above)
        touch &= ~(child | child.T)
    bodies, geoms = np.array([g.body for g in found], object), np.array([g.geom.name for g in found], object)
    apart = [(bodies, one.bodyname1, one.bodyname2) for one in spec.excludes]
    apart += [(geoms, one.geomname1, one.geomname2) for one in spec.pairs]
    for names, one, other in apart:
        first, second = np.flatnonzero(names == one), np.flatnonzero(names == other)
        touch[np.ix_(first, second)] = touch[np.ix_(second, first)] = False
    return touch


def _deciding(parts: Parts) -> dict[str, Decides]:
    """What decides the friction of geoms, by their names."""
    found = {table.collision: Decides("table_frictions", t) for t, table in enumerate(parts.tables)}
    for term in parts.furniture:
        if f"{term.name}.friction" in term.quantities:
            found |= {geom: Decides(f"{term.name}.friction", 0) for geom in term.geoms}
    for one in parts.varied:
        if one.attribute == "geom.friction":
            found |= {name: Decides(one.name, i) for i, name in enumerate(one.elements)}
    return found
