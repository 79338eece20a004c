"""Furniture that is added to an arena (host)."""

import dataclasses
from typing import Any

import mujoco

from mjx_arenas.furniture.part import Part
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import Problem, problem, under
from mjx_arenas.rules import validation
from mjx_arenas.spec import specs
from mjx_arenas.terms.furniture import Furniture
from mjx_arenas.terms.parts import Parts


def add(spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams, part: Any) -> tuple[mujoco.MjSpec, Parts, ArenaParams]:
    """The same with a part more; see `Arena.add_part`."""
    validation.raise_all(_problems(spec, part), "`add_part`")
    spec, term = spec.copy(), Furniture(part)
    root = _body(spec.worldbody, part.name)
    bodies = {piece: _body(root, f"{part.name}_{piece}") for piece in part.pieces}
    for name, box in zip(term.geoms, part.boxes(part.nominal), strict=True):
        geom = specs.add_geom(bodies.get(box.piece, root), name, mujoco.mjtGeom.mjGEOM_BOX)
        specs.assign(geom, mass=0, material=part.material or "", size=box.half)
    nominal = nominal._replace(terms={**nominal.terms, **{one.name: one.nominal for one in term.numbers}})
    places = parts.places._replace(furniture=(*parts.places.furniture, part))
    parts = dataclasses.replace(parts, furniture=(*parts.furniture, term), places=places)
    term.edit(spec, nominal)
    return spec, parts, nominal


def _body(parent: mujoco.MjsBody, name: str) -> mujoco.MjsBody:
    body = parent.add_body(name=name)
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    specs.make_massless(body)
    return body


def _problems(spec: mujoco.MjSpec, part: Any) -> list[Problem]:
    if not isinstance(part, Part):
        return [problem("part", "must", None, part, must="a part of `mjx_arenas.furniture`, such as Shelf('rack')")]
    if found := under("part", part.problems()):
        return found
    names = {"body": [part.name, *(f"{part.name}_{piece}" for piece in part.pieces)], "geom": Furniture(part).geoms}
    for kind, wanted in names.items():
        taken = [name for name in wanted if getattr(spec, kind)(name) is not None]
        if taken:
            return [problem("part.name", "must", None, part.name, must=f"another one: there is a {kind} {taken[0]!r}")]
    if part.material is not None and part.material not in [m.name for m in spec.materials]:
        known = ", ".join(m.name for m in spec.materials) or "none"
        found.append(problem("part.material", "must", None, part.material, must=f"a material of the arena, of {known}"))
    return found
