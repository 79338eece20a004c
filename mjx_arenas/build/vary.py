"""Elements of an arena's MJCF become quantities (host)."""

import dataclasses
import itertools
import keyword
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas import dr
from mjx_arenas.build import frozen, points
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import Problem, problem, under
from mjx_arenas.rules import validation
from mjx_arenas.spec import automatic, comparing, masses, specs
from mjx_arenas.spec.objects import VARIANTS
from mjx_arenas.terms.attributes import ATTRIBUTES
from mjx_arenas.terms.attributes.attribute import KINDS
from mjx_arenas.terms.elements import Elements, ids_of, in_spec
from mjx_arenas.terms.owned import owned_by
from mjx_arenas.terms.parts import Parts

_TAKEN = ("object_densities", "workspace", "terms")
_PLACING = {"body": ("active", "pos", "rpy"), "geom": ("pos", "rpy"), "joint": ("ref",)}
"""Attributes that move what they are of, or take it away."""
_INNER = {"body": ("ipos",), "geom": ("pos", "rpy")}
"""Attributes that move the geom of an object, or its mass, in the frame of its body."""
_OF_INERTIALS = ("geom.pos", "geom.rpy", "geom.size", "geom.density", "geom.mass")
"""Attributes of geoms from which inertials follow."""


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
        elif not name.isidentifier() or keyword.iskeyword(name):
            problems.append(problem(name, "term_name"))
        elif name in (taken := (*parts.quantities, *_TAKEN)):
            problems.append(_taken(name, parts, taken))
        else:
            problems += under(name, term.problems())
    validation.raise_all(problems, "vary")
    last = {name: term for name, term in terms.items() if term.elements is None}
    if 0 < len(last) < len(terms):  # these take what the others leave
        first = {name: term for name, term in terms.items() if name not in last}
        spec, made, _ = vary(*vary(spec, parts, nominal, first), last)
        new = {one.name: one for one in made.varied[len(parts.varied) :]}
        made = dataclasses.replace(made, varied=(*parts.varied, *(new[name] for name in terms)))
        return spec, made, made.completed(nominal)

    spec = spec.copy()
    given = automatic.give(spec)
    model = specs.compiled(spec.copy(), "arena.spec")
    chosen = _selected(spec, model, parts, nominal, terms)
    kinds = {name: term.attribute.partition(".")[0] for name, term in terms.items()}
    automatic.take_back(given, {(kinds[name], element) for name, names in chosen.items() for element in names})
    of_others = {name: frozen.of_others(spec, term.attribute, chosen[name]) for name, term in terms.items()}
    in_mjcf = {name: _places_in_mjcf(spec, model, term.attribute, chosen[name], parts) for name, term in terms.items()}
    base = _prepared(spec, model, terms, chosen)
    made = tuple(
        Elements(
            name,
            term.attribute,
            chosen[name],
            _mask(term, chosen[name], base),
            base,
            _nominal(term, chosen[name], spec, base),
            of_others[name],
            in_mjcf[name],
        )
        for name, term in terms.items()
    )
    validation.raise_all(_of_no_axis(made, terms), "vary")
    parts = dataclasses.replace(parts, varied=(*parts.varied, *made))
    validation.raise_all(_overruled(spec, parts), "vary")
    validation.raise_all(_of_axes(parts.varied), "vary")
    nominal = parts.completed(nominal)
    owned_by(base, parts.terms, [term.bind(base) for term in parts.terms], nominal)
    frozen.warn_of_stale(spec, parts.varied, terms)
    without = parts.varied[: -len(made)]
    points.warn_of_ended(*(specs.compiled(points.end(spec.copy(), v), "arena.spec") for v in (without, parts.varied)))
    return spec, parts, nominal


def _places_in_mjcf(
    spec: mujoco.MjSpec, model: mujoco.MjModel, attribute: str, names: tuple[str, ...], parts: Parts
) -> np.ndarray | None:
    """(N, 3) places of elements in the MJCF, nan where the compiled ones are the same; None if they all are, or nothing places them.

    They are others in a <frame> with a pose, and of meshes, of which the compiler moves the middle to where the geom is. What an
    earlier term has taken out of its frame is where that one found it.
    """
    kind = attribute.partition(".")[0]
    if kind not in KINDS or not attribute.endswith(_OUT_OF_FRAMES):
        return None
    earlier: dict[str, np.ndarray] = {}
    for one in parts.varied:
        if one.kind == kind and one.in_mjcf is not None:
            earlier |= zip(one.elements, one.in_mjcf, strict=True)
    elements = {name: in_spec(spec, kind, name) for name in names}
    now = [np.full(3, np.nan) if _from_to(element) else element.pos for element in elements.values()]
    told = np.array([earlier.get(name, place) for name, place in zip(names, now, strict=True)]).reshape(-1, 3)
    compiled = getattr(model, f"{KINDS[kind].prefix}_pos")[ids_of(model, kind, names)]
    told[(np.abs(told - compiled) <= 1e-9 * np.abs(compiled).max(initial=1.0)).all(-1)] = np.nan
    return None if np.isnan(told).all() else told


_OUT_OF_FRAMES = (".pos", ".rpy", "joint.axis", "light.dir")
"""Attributes for which elements come out of their frames, by how they end."""


def _from_to(element: Any) -> bool:
    """Whether the place of a geom is between two points."""
    return hasattr(element, "fromto") and not np.isnan(element.fromto[0])


def _prepared(
    spec: mujoco.MjSpec, model: mujoco.MjModel, terms: Mapping[str, dr.Term], chosen: Mapping[str, tuple[str, ...]]
) -> mujoco.MjModel:
    """Prepares the elements of terms in a spec, of which the nominal model stays the same, and compiles it.

    Raises:
        ValueError: the nominal model would be another one.
    """
    for name, term in terms.items():
        prepare, kind = ATTRIBUTES[term.attribute].prepare, term.attribute.partition(".")[0]
        if prepare is not None:
            for element, index in zip(chosen[name], ids_of(model, kind, chosen[name]), strict=True):
                prepare(spec, in_spec(spec, kind, element), model, int(index))
    base = specs.compiled(spec.copy(), "arena.spec")
    edited = comparing.differing(model, base) - comparing.NOT_READ - _SHORT_CUTS
    edited = [name for name in sorted(edited) if not name.startswith("name")]
    if edited and (rules := [rule for rule in masses.mass_rules(spec) if rule in (*masses.BOUNDS, "settotalmass")]):
        told = {"names": rules, "varied": next(iter(terms))}
        raise validation.error([problem("spec.compiler", "compiler_weighs_all", None, None, told)])
    if edited:
        raise validation.error([problem("arena.spec", "nominal_changed", None, None, names=edited)])
    return base


_SHORT_CUTS = {"body_simple", "dof_simplenum"}
"""What the compiler takes a body for, of which `points` tells."""


def _taken(name: str, parts: Parts, taken: Collection[str]) -> Problem:
    """The problem of a term's name that something else has."""
    attribute = next((one.attribute for one in parts.varied if one.name == name), None)
    owner = f"an earlier `vary` gave it to {attribute!r}" if attribute else f"ArenaRanges({name}=...) has it"
    free = next(other for i in itertools.count(2) if (other := f"{name}_{i}") not in taken)
    return problem(name, "term_taken", owner=owner, free=free)


def _selected(
    spec: mujoco.MjSpec, model: mujoco.MjModel, parts: Parts, nominal: ArenaParams, terms: Mapping[str, dr.Term]
) -> dict[str, tuple[str, ...]]:
    """Names of the elements of each term, of a spec in which all elements have one.

    Raises:
        ValueError: all problems of the elements.
    """
    problems: list[Problem] = []
    chosen: dict[str, tuple[str, ...]] = {}
    for name, term in terms.items():
        chosen[name], found = term.select(spec, model)
        problems += under(name, found)
        if term.elements is None and not found:
            chosen[name] = _free(spec, parts, nominal, model, term, chosen[name])
        if term.attribute.startswith("body.start_"):
            chosen[name], found = _placed(parts, term, chosen[name])
            problems += under(name, found)
        if term.attribute == "body.active":
            problems += under(name, _standing(parts, spec, chosen[name]))
        if term.attribute in ("body.active", "body.pos", "body.rpy"):
            problems += under(name, _carrying(parts, spec, term.attribute, chosen[name]))
        if not problems:
            problems += under(name, _owned(parts, term.attribute, chosen[name]))
        if not problems:
            problems += under(name, _weighing(parts, spec, term.attribute, chosen[name]))
    validation.raise_all(problems, "vary")
    return chosen


def _standing(parts: Parts, spec: mujoco.MjSpec, names: tuple[str, ...]) -> list[Problem]:
    """Bodies that cannot come and go by themselves: tables, objects, and what stands on them."""
    for name in names:
        body = spec.body(name)
        while body is not None and body.name != "world":
            if body.name in parts.presence.bodies:
                why = f"{body.name!r} comes and goes by its own quantity" + (
                    "" if body.name == name else ", and takes it along"
                )
                what = {"kind": "body", "name": name, "attribute": "body.active", "why": why}
                return [problem("elements", "cannot_vary", None, None, what)]
            body = body.parent
    return []


def _placed(parts: Parts, term: dr.Term, names: tuple[str, ...]) -> tuple[tuple[str, ...], list[Problem]]:
    """The bodies that are no objects, which start at rest at places of their own; why not, of one that was named or is alone."""
    objects = {o.name for o in parts.objects}
    left = tuple(name for name in names if name not in objects)
    given = [term.elements] if isinstance(term.elements, str) else term.elements or ()
    wrong = [name for name in names if name in objects and (name in given or not left)]
    what = {"kind": "body", "attribute": term.attribute, "why": "it is an Object, which has places instead"}
    return left, [problem("elements", "cannot_vary", None, None, what | {"name": name}) for name in wrong[:1]]


def _owned(parts: Parts, attribute: str, names: tuple[str, ...]) -> list[Problem]:
    """Geoms of tables, boxes, bodies and joints of parts, and what an object of one geom is: their own quantities say where they are."""
    kind, _, what = attribute.partition(".")
    of: dict[str, str] = {}
    if what in _PLACING.get(kind, ()):
        for table in parts.tables if kind == "geom" else ():
            of |= dict.fromkeys(table.geoms, f"table {table.body!r}")
        for term in parts.furniture:
            own = {"geom": term.geoms, "joint": term.joints, "body": term.bodies}[kind]
            of |= dict.fromkeys(own, f"part {term.name!r}")
    if what in _INNER.get(kind, ()):
        for obj in (one for one in parts.objects if one.kind != "mjcf"):
            own = (obj.name,) if kind == "body" else parts.geoms_of_variants.get(obj.name, (obj.geom,))
            of |= dict.fromkeys(own, f"object {obj.name!r}")
    for name in [name for name in names if name in of and not (what == "active" and name in parts.presence.bodies)]:
        whose = f"it is of {of[name]}, whose own quantities say where it is"
        why = f"{of[name]} is always there (`stays=True`)" if what == "active" else whose
        told = {"kind": kind, "name": name, "attribute": attribute, "why": why}
        return [problem("elements", "cannot_vary", None, None, told)]
    return []


def _carrying(parts: Parts, spec: mujoco.MjSpec, attribute: str, names: tuple[str, ...]) -> list[Problem]:
    """Bodies on which tables hang, which are where their own parameters say."""
    for table in parts.tables:
        carrier = [body.name for body in specs.ancestors(spec.body(table.body))[1:] if body.name in names]
        if carrier:
            what = {
                "kind": "body",
                "name": carrier[0],
                "attribute": attribute,
                "why": f"table {table.body!r} hangs on it",
            }
            return [problem("elements", "cannot_vary", None, None, what)]
    return []


def _weighing(parts: Parts, spec: mujoco.MjSpec, attribute: str, names: tuple[str, ...]) -> list[Problem]:
    """Geoms of which the compiler makes the inertials of objects from files and with variants, which `object_masses` decide."""
    if attribute not in _OF_INERTIALS:
        return []
    objects = {o.name: o for o in parts.objects if o.kind in ("mjcf", VARIANTS)}
    variants = {  # when they are there; those of files have inertials of their own
        name
        for one in parts.places.variants
        for kind, geoms in zip(one.kind, one.geoms, strict=True)
        for name in geoms
        if kind != "mjcf"
    }
    for name in names:
        body = spec.geom(name).parent
        of = next((one.name for one in specs.ancestors(body) if one.name in objects), None)
        if of is not None and (name in variants or masses.inferred(body)):
            why = f"the inertial of Object {of!r} follows `object_masses` alone: its `variants` can have other ones"
            told = {"kind": "geom", "name": name, "attribute": attribute, "why": why}
            return [problem("elements", "cannot_vary", None, None, told)]
    return []


def _free(
    spec: mujoco.MjSpec,
    parts: Parts,
    nominal: ArenaParams,
    model: mujoco.MjModel,
    term: dr.Term,
    elements: tuple[str, ...],
) -> tuple[str, ...]:
    """The elements that no table, object or other term decides; all, where these decide all of them."""
    taken: dict[str, set[int]] = {}
    for row in (row for one in parts.terms for row in one.bind(model).rows(nominal)):
        taken.setdefault(row.field, set()).update(row.elements.reshape(-1).tolist())

    def free(name: str) -> bool:
        if _owned(parts, term.attribute, (name,)) or _weighing(parts, spec, term.attribute, (name,)):
            return False
        quantity = ATTRIBUTES[term.attribute].quantity
        numbers = np.ones((1, *quantity.item), quantity.kind)
        one = Elements("", term.attribute, (name,), _mask(term, (name,), model), model, numbers)
        rows = one.bind(model).rows(nominal._replace(terms={"": numbers}))
        return all(taken.get(row.field, set()).isdisjoint(row.elements.reshape(-1).tolist()) for row in rows)

    return tuple(filter(free, elements)) or elements


def _nominal(term: dr.Term, elements: tuple[str, ...], spec: mujoco.MjSpec, model: mujoco.MjModel) -> np.ndarray:
    """(N, ...) numbers of the elements as they are, read-only."""
    attribute, kind = ATTRIBUTES[term.attribute], term.attribute.partition(".")[0]
    if attribute.told is not None:
        found = np.array([attribute.told(in_spec(spec, kind, name)) for name in elements])
    else:
        assert attribute.read is not None
        found = np.array(attribute.read(model, ids_of(model, kind, elements)), attribute.quantity.kind)
    found.setflags(write=False)
    return found


def _of_no_axis(made: Sequence[Elements], terms: Mapping[str, dr.Term]) -> list[Problem]:
    """Terms whose axes mean nothing for any of their elements, such as the third size of a sphere."""
    musts = {one.name: f"axes of {one.attribute!r} that one of its elements has" for one in made if not one.mask.any()}
    return [problem(f"{name}.axes", "must", None, terms[name].axes, must=must) for name, must in musts.items()]


def _of_axes(varied: Sequence[Elements]) -> list[Problem]:
    """Two terms with axes of their own of one element, where the model's numbers follow from all axes."""
    for one, other in itertools.combinations(varied, 2):
        made = any(target.made is not None for target in ATTRIBUTES[one.attribute].targets)
        for name in one.elements if made and one.attribute == other.attribute else ():
            masks = [term.mask[term.elements.index(name)] for term in (one, other) if name in term.elements]
            if len(masks) == 2 and np.size(masks[0]) > 1 and not (masks[0] & masks[1]).any():
                what = {"other": other.name, "attribute": one.attribute, "kind": one.kind, "name": name}
                return [problem("terms", "axes_together", None, one.name, what)]
    return []


def _overruled(spec: mujoco.MjSpec, parts: Parts) -> list[Problem]:
    """Elements whose attribute has no effect any more, for what another term needed."""
    found = []
    for one in parts.varied:
        refused = ATTRIBUTES[one.attribute].refused_in_spec
        for name in one.elements if refused else ():
            assert refused is not None
            if why := refused(spec, in_spec(spec, one.kind, name)):
                what = {"kind": one.kind, "name": name, "attribute": one.attribute, "why": f"for another term {why}"}
                found.append(problem(f"{one.name}.elements", "cannot_vary", None, None, what))
                break
    return found


def _mask(term: dr.Term, elements: tuple[str, ...], model: mujoco.MjModel) -> np.ndarray:
    """(N, ...) bool: which of the attribute's numbers vary: those of the axes that mean something for the element."""
    attribute = ATTRIBUTES[term.attribute]
    mask = np.ones((len(elements), *attribute.quantity.item), bool)
    if attribute.used is not None:
        mask &= attribute.used(model, ids_of(model, term.attribute.partition(".")[0], elements))
    return mask & np.array(term.chosen, bool) if attribute.quantity.item else mask
