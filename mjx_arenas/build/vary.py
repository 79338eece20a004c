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
        elif not name.isidentifier() or keyword.iskeyword(name) or name in (*parts.quantities, *_TAKEN):
            problems.append(problem(name, "term_name"))
        else:
            problems += under(name, term.problems())
    validation.raise_all(problems, "vary")

    spec = spec.copy()
    model = specs.compiled(spec.copy(), "arena.spec")
    chosen: dict[str, tuple[str, ...]] = {}
    for name, term in terms.items():
        chosen[name], found = term.select(spec, model)
        problems += under(name, found)
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


def _mask(term: dr.Term, elements: tuple[str, ...], model: mujoco.MjModel) -> np.ndarray:
    """(N, ...) bool: which of the attribute's numbers vary: those of the axes that mean something for the element."""
    attribute = ATTRIBUTES[term.attribute]
    mask = np.ones((len(elements), *attribute.quantity.item), bool)
    if attribute.used is not None:
        mask &= attribute.used(model, ids_of(model, term.attribute.partition(".")[0], elements))
    return mask & np.array(term.chosen, bool) if attribute.quantity.item else mask
