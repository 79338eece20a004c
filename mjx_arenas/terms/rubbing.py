"""What the contacts of a spec take their friction from (host)."""

from collections.abc import Iterator

import mujoco
import numpy as np

from mjx_arenas.rules.friction_rules import Decides, Rubbing
from mjx_arenas.terms.parts import Parts


def rubbing(spec: mujoco.MjSpec, parts: Parts) -> Rubbing:
    """Of all geoms that collide."""
    named = _deciding(parts)
    variants = parts.geoms_of_variants
    objects = {o.name: Decides("object_frictions", k, o.name not in variants) for k, o in enumerate(parts.objects)}
    found = list(_geoms(spec.worldbody, (), None, objects))
    return Rubbing(
        np.unique([moves for _, moves, _ in found], return_inverse=True)[1].reshape(-1),
        np.array([geom.priority for geom, *_ in found], int),
        np.array([(geom.contype, geom.conaffinity) for geom, *_ in found], int).reshape(-1, 2),
        np.array([geom.friction[0] for geom, *_ in found], float),
        tuple(named.get(geom.name, of) for geom, _, of in found),
    )


def _geoms(
    body: mujoco.MjsBody, path: tuple[int, ...], of: Decides | None, objects: dict[str, Decides], moves: str = ""
) -> Iterator[tuple[mujoco.MjsGeom, str, Decides | None]]:
    """The geoms that collide of a body and of what hangs on it, what moves each, and what decides its friction."""
    moves = str(path) if len(body.joints) or body.mocap else moves
    of = objects.get(body.name, of)
    for geom in body.geoms:
        if geom.contype or geom.conaffinity:
            yield geom, moves, of
    for i, below in enumerate(body.bodies):
        yield from _geoms(below, (*path, i), of, objects, moves)


def _deciding(parts: Parts) -> dict[str, Decides]:
    """By names of geoms."""
    found = {table.collision: Decides("table_frictions", t) for t, table in enumerate(parts.tables)}
    for term in parts.furniture:
        if f"{term.name}.friction" in term.quantities:
            found |= {geom: Decides(f"{term.name}.friction", 0) for geom in term.geoms}
    for one in parts.varied:
        if one.attribute == "geom.friction":
            found |= {name: Decides(one.name, i) for i, name in enumerate(one.elements)}
    return found
