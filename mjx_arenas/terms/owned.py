"""The elements of a model that terms decide; no two decide the same (host)."""

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

from mjx_arenas.named import field as field_of
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import Problem, problem
from mjx_arenas.problems.messages import error
from mjx_arenas.spec import names
from mjx_arenas.terms.term import Bound, Boxed, Depends, Term

_RANGES = {"tables": "table_...", "objects": "object_..."}
"""The terms that an arena has by itself, and how their quantities begin."""
_OTHERWISE = {
    "body_inertia": "inertia_of_object",
    "body_pos": "place_of_object",
    "body_quat": "place_of_object",
}
"""Fields of objects that no range gives, and the rules of their sentences."""


@dataclasses.dataclass(frozen=True)
class Owned:
    """Elements that a term decides, and the quantities from which they follow."""

    term: str
    field: str
    elements: np.ndarray
    depends: Depends


def owned_by(model: mujoco.MjModel, terms: Sequence[Term], bound: Sequence[Bound], nominal: ArenaParams) -> list[Owned]:
    """The elements that terms decide.

    Raises:
        ValueError: two terms decide one element, or how far one body reaches.
    """
    owned = [
        Owned(term.name, row.field, row.elements.reshape(-1), row.depends)
        for term, one in zip(terms, bound, strict=True)
        for row in one.rows(nominal)
    ]
    _check_disjoint(model, owned)
    _check_reaches(model, terms, bound, nominal)
    return owned


def _both(terms: Sequence[str], where: str, field: str = "") -> Problem:
    """What is wrong where two terms decide one element; the second may be that of all tables, or of all objects."""
    one, other = terms
    if other in _RANGES:
        told = {"where": where, "whose": other, "begins": _RANGES[other]}
        rule = _OTHERWISE.get(field, "term_of_arena") if other == "objects" else "term_of_arena"
        return problem("terms", rule, None, one, told)
    return problem("terms", "terms_both", None, one, other=other, where=where)


def _check_disjoint(model: mujoco.MjModel, owned: Sequence[Owned]) -> None:
    """Refuses two terms, or two rows of one, that decide the same element."""
    deciding: dict[str, np.ndarray] = {}
    for index, rows in enumerate(owned):
        taken = deciding.setdefault(rows.field, np.full(field_of(model, rows.field).size, -1))
        twice = rows.elements[taken[rows.elements] >= 0]
        if len(twice):
            other = owned[int(taken[twice[0]])].term
            where = element_name(model, rows.field, int(twice[0]))
            raise error([_both(sorted((other, rows.term), key=_RANGES.__contains__), where, rows.field)])
        taken[rows.elements] = index


def _check_reaches(model: mujoco.MjModel, terms: Sequence[Term], bound: Sequence[Bound], nominal: ArenaParams) -> None:
    """Refuses two terms that say how far the same body reaches."""
    saying: dict[int, str] = {}
    for term, one in zip(terms, bound, strict=True):
        for body in one.boxes(nominal).bodies.tolist() if isinstance(one, Boxed) else ():
            if body in saying:
                where = f"how far {names.element(model, 'body', body)} reaches"
                raise error([_both([saying[body], term.name], where)])
            saying[body] = term.name


_KINDS = {
    "body": "body",
    "geom": "geom",
    "site": "site",
    "jnt": "joint",
    "cam": "camera",
    "light": "light",
    "mat": "material",
}
_KINDS |= {"actuator": "actuator", "tendon": "tendon", "eq": "equality", "pair": "pair", "key": "key"}


def element_name(model: mujoco.MjModel, field: str, element: int) -> str:
    """What messages call an element of a flattened field: its field and the name of what it belongs to."""
    if field.startswith("opt."):
        return f"option {field[4:]!r}"
    array = field_of(model, field)
    if not array.ndim:
        return field
    index = element // max(1, array.size // max(1, array.shape[0]))
    kind = "equality" if field == "data.eq_active" else _KINDS.get(field.partition("_")[0])
    if field in ("qpos0", "qpos_spring", "data.qpos", "data.turn", "data.qvel") or field.startswith("dof_"):
        first = model.jnt_dofadr if field.startswith(("dof_", "data.qvel")) else model.jnt_qposadr
        kind, index = "joint", int(np.searchsorted(first, index, "right")) - 1
    return f"{field} of {names.element(model, kind, index)}" if kind else f"{field}[{index}]"
