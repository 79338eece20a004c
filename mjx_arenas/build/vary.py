"""Elements of an arena's MJCF become quantities (host)."""

import dataclasses
import keyword
from collections.abc import Mapping

import mujoco
import numpy as np

from mjx_arenas import dr
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import Problem, problem, under
from mjx_arenas.rules import validation
from mjx_arenas.spec import specs
from mjx_arenas.terms.attributes import ATTRIBUTES
from mjx_arenas.terms.elements import Elements, ids_of, in_spec
from mjx_arenas.terms.owned import owned_by
from mjx_arenas.terms.parts import Parts

_TAKEN = ("object_densities", "workspace", "terms")


def vary(
    spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams, terms: Mapping[str, dr.Term]
) -> tuple[mujoco.MjSpec, Parts, ArenaParams]:
    """The same with more quantities.

    Raises:
        ValueError: all problems of the terms, or two of them decide one element.
    """
    problems: list[Problem] = []
    for name, term in terms.items():
        if not isinstance(term, dr.Term):
            problems.append(problem(name, "term", None, term))
        elif (
            not name.isidentifier()
            or keyword.iskeyword(name)
            or name in parts.quantities
            or name in ("object_densities", "workspace", "terms")
        ):
            problems.append(problem(name, "term_name"))
        else:
            problems += under(name, term.problems())
    validation.raise_all(problems, "vary")

    spec = spec.copy()
    model = specs.compiled(spec.copy(), "arena.spec")
    chosen: dict[str, tuple[str, ...]] = {}
    for name, term in terms.items():
        chosen[name], found = term.select(model)
        problems += under(name, found)
    validation.raise_all(problems, "vary")

    problems += _inferred(spec, terms, chosen)
    validation.raise_all(problems, "vary")
    for name, term in terms.items():
        prepare, kind = ATTRIBUTES[term.attribute].prepare, term.attribute.partition(".")[0]
        if prepare is not None:
            for element, index in zip(chosen[name], ids_of(model, kind, chosen[name]), strict=True):
                prepare(spec, in_spec(spec, kind, element), model, int(index))
    base = specs.compiled(spec.copy(), "arena.spec")
    made = tuple(
        Elements(name, term.attribute, chosen[name], _mask(term, chosen[name], base), base)
        for name, term in terms.items()
    )
    parts = dataclasses.replace(parts, varied=(*parts.varied, *made))
    numbers = {one.name: one.nominal() for one in made}
    for array in numbers.values():
        array.setflags(write=False)
    nominal = nominal._replace(terms={**nominal.terms, **numbers})
    owned_by(base, parts.terms, [term.bind(base) for term in parts.terms], nominal)
    return spec, parts, nominal


def _inferred(
    spec: mujoco.MjSpec, terms: Mapping[str, dr.Term], chosen: Mapping[str, tuple[str, ...]]
) -> list[Problem]:
    """Inertials that vary where the compiler takes those of the geoms, whatever else the MJCF says."""
    always, found = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE, []
    for name, term in terms.items():
        for body in (
            chosen[name] if term.attribute in ("body.mass", "body.mass_alone", "body.inertia", "body.ipos") else ()
        ):
            compiler = getattr(spec.body(body), "compiler", spec.compiler)
            if compiler.inertiafromgeom == always:
                what = {"kind": "body", "name": body, "attribute": term.attribute, "why": _FROM_GEOMS}
                found.append(problem(f"{name}.elements", "cannot_vary", None, None, what))
                break
    return found


_FROM_GEOMS = 'the compiler takes it from the geoms: set `inertiafromgeom="auto"`'


def _mask(term: dr.Term, elements: tuple[str, ...], model: mujoco.MjModel) -> np.ndarray:
    """(N, ...) bool: which of the attribute's numbers vary: those of the axes that mean something for the element."""
    attribute = ATTRIBUTES[term.attribute]
    mask = np.ones((len(elements), *attribute.quantity.item), bool)
    if attribute.used is not None:
        mask &= attribute.used(model, ids_of(model, term.attribute.partition(".")[0], elements))
    return mask & np.array(term.chosen, bool) if attribute.quantity.item else mask
