"""Furniture that is added to an arena (host)."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.build import assemble, carriers
from mjx_arenas.furniture import standing, surfaces
from mjx_arenas.furniture.part import DENSITY, Part
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import Problem, problem, under
from mjx_arenas.rules import validation
from mjx_arenas.spec import patterns, specs
from mjx_arenas.spec.place import moving_problems
from mjx_arenas.terms.attributes import prepare
from mjx_arenas.terms.furniture import Furniture
from mjx_arenas.terms.parts import Parts


def add(spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams, part: Any) -> tuple[mujoco.MjSpec, Parts, ArenaParams]:
    """The same with a part more; see `Arena.add_part`."""
    validation.raise_all(_of(part, _problems(spec, part)), "`add_part`")
    on = carriers.carrier("part.on", part.on, parts, part.stays)
    if isinstance(on, Problem):
        raise validation.error(_of(part, [on]))
    validation.raise_all(_of(part, [*_surface_problems(parts, part), *_beside_problems(parts, part)]), "`add_part`")
    part = dataclasses.replace(part, on=on)
    spec, term = spec.copy(), Furniture(part, standing.chain(part, parts.places.furniture))
    root = _body(spec.worldbody, part.name)
    bodies = {piece: _body(root, f"{part.name}_{piece}") for piece in part.pieces if piece not in part.moving}
    bodies |= {
        joint.piece: _moving(root, f"{part.name}_{joint.piece}", joint.turns) for joint in part.joints(part.nominal)
    }
    for name, box in zip(term.geoms, part.nominal_boxes, strict=True):
        geom = specs.add_geom(bodies.get(box.piece, root), name, mujoco.mjtGeom.mjGEOM_BOX)
        weight = {"density": DENSITY} if box.piece in part.moving else {"mass": 0}
        specs.assign(
            geom, material=part.material or "", size=box.half, priority=parts.priority, **weight
        )  # as tables have it
    places = parts.places._replace(furniture=(*parts.places.furniture, part))
    more, first = (len(parts.tables) + surfaces.count(p.furniture) for p in (places, parts.places))
    on = nominal.object_tables  # tops of objects come after surfaces
    nominal = nominal._replace(object_tables=np.where(on < first, on, on + more - first))
    parts = dataclasses.replace(parts, furniture=(*parts.furniture, term), places=places)
    nominal = parts.completed(nominal)
    term.edit(spec, nominal)
    assemble.raise_condim(spec, parts)
    return spec, parts, nominal


def _of(part: Any, problems: Sequence[Problem]) -> list[Problem]:
    """The same, with the part that they are about; those of a name say it themselves."""
    return [p if p.path in ("part", "part.name") else p._replace(item=("part", part.name)) for p in problems]


def _body(parent: mujoco.MjsBody, name: str) -> mujoco.MjsBody:
    body = parent.add_body(name=name)
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    specs.make_massless(body)
    return body


def _moving(parent: mujoco.MjsBody, name: str, turns: bool) -> mujoco.MjsBody:
    body = parent.add_body(name=name)
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    prepare.not_simple(body)
    kind = mujoco.mjtJoint.mjJNT_HINGE if turns else mujoco.mjtJoint.mjJNT_SLIDE
    body.add_joint(name=name, type=kind, limited=mujoco.mjtLimited.mjLIMITED_TRUE)
    return body


def _problems(spec: mujoco.MjSpec, part: Any) -> list[Problem]:
    if not isinstance(part, Part) or type(part) is Part:
        return [problem("part", "must", None, part, must="a part of `mjx_arenas.furniture`, such as Shelf('rack')")]
    if found := under("part", part.problems()):
        return found
    found = moving_problems("part.near", None, part.near, spec)
    geoms = Furniture(part).geoms
    if twice := [name for name in geoms if geoms.count(name) > 1][:1]:
        return [
            problem(
                "part", "must", None, type(part).__name__, must=f"of boxes with different names, two are {twice[0]!r}"
            )
        ]
    moving = [f"{part.name}_{piece}" for piece in part.moving]
    pieces = [f"{part.name}_{piece}" for piece in part.pieces]
    names = {"body": [part.name, *pieces, *moving], "geom": geoms, "joint": moving}
    for kind, wanted in names.items():
        taken = [name for name in wanted if getattr(spec, kind)(name) is not None]
        if taken:
            return [problem("part.name", "must", None, part.name, must=f"another one: there is a {kind} {taken[0]!r}")]
    if part.material is not None and part.material not in [m.name for m in spec.materials]:
        known = ", ".join(m.name for m in spec.materials) or "none"
        found.append(problem("part.material", "must", None, part.material, must=f"a material of the arena, of {known}"))
    return found


def _surface_problems(parts: Parts, part: Part) -> list[Problem]:
    """Whether its surfaces have names of their own among all that objects stand on."""
    taken = dict.fromkeys(parts.surfaces, "a surface") | {o.name: "an object" for o in parts.objects}
    found = [f"there is {taken[name]} {name!r}" for name in standing.surface_names([part]) if name in taken]
    return [problem("part.name", "must", None, part.name, must=f"another one: {found[0]}")] if found else []


def _beside_problems(parts: Parts, part: Part) -> list[Problem]:
    """Whether it can stand there."""
    if part.beside is None:
        return []
    known = [one.name for one in parts.places.furniture if one.nominal_boxes]
    if part.beside not in known:
        return [problem("part.beside", "no_part", None, part.beside, nearest=patterns.near(part.beside, known))]
    if part.on is not None:
        return [problem("part.on", "must", None, part.on, must="None where there is `beside`")]
    if not part.nominal_boxes:
        return [problem("part.beside", "must", None, part.beside, must="None for a part without boxes")]
    return []
