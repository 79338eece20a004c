"""Numbers that the compiler made of others, such as inertials of geoms, until a term froze them: what would change them now (host)."""

import dataclasses
from collections.abc import Collection, Iterator, Sequence

import mujoco
import numpy as np

from mjx_arenas.build import springs
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error, warn
from mjx_arenas.spec import comparing, masses, specs, weighed
from mjx_arenas.terms.attributes import ATTRIBUTES, prepare
from mjx_arenas.terms.elements import Elements

_MOVING = {"geom.size": "size", "geom.pos": "place", "geom.rpy": "orientation"}
_SAME = 1e-9  # relative


def of_others(spec: mujoco.MjSpec, attribute: str, names: Sequence[str]) -> tuple[str, ...]:
    """The elements of a term that gets numbers of its own, which the compiler has made of others until now.

    These are inertials of bodies and masses, made of geoms, and lengths of tendons at rest, measured at `qpos0`.
    """
    if ATTRIBUTES[attribute].prepare is prepare.weighed:
        return tuple(name for name in names if masses.inferred(spec.body(name)))
    if attribute == "geom.mass":
        return tuple(name for name in names if np.isnan(spec.geom(name).mass))
    lengths = names if attribute == "tendon.springlength" else ()
    return tuple(name for name in lengths if springs.measured(spec.tendon(name)))


def check(spec: mujoco.MjSpec, varied: Sequence[Elements]) -> None:
    """Refuses what was added or edited since `arena.vary` has read numbers that are made of it, which are still those of before.

    Args:
        spec: of the arena, in which the terms' elements were prepared.
        varied: all terms of the arena.

    Raises:
        ValueError: a body would have another mass, centre of mass or inertia, a geom another mass, or a tendon another length at rest.
    """
    for one, changed in _changed(spec, varied):
        if one.kind == "body" and spec.compiler.settotalmass > 0:
            told = {"names": ["settotalmass"], "varied": one.name}
            raise error([problem("spec.compiler", "compiler_weighs_all", None, None, told)])
        told = {"what": _TOLD[one.kind].format(changed[0]), "name": one.name}
        raise error([problem("arena.spec", "edited_since", None, None, told)])


def as_held(spec: mujoco.MjSpec, varied: Sequence[Elements]) -> tuple[Elements, ...]:
    """The terms of an arena of which a file holds the spec, with which nothing counts as edited since they have read it.

    MuJoCo writes the inertial of a body, but not always what its geoms weigh. What then cannot be told is not looked at any more.
    """

    def tells(one: Elements, name: str) -> bool:
        element = getattr(spec, one.kind)(name)
        return element is not None and (one.kind != "body" or any(map(masses.makes_inertial, element.geoms)))

    kept = [dataclasses.replace(one, made=tuple(x for x in one.made if tells(one, x))) for one in varied]
    changed = {one.name: names for one, names in _changed(spec, kept)}
    return tuple(
        dataclasses.replace(one, made=tuple(x for x in one.made if x not in changed.get(one.name, ()))) for one in kept
    )


def _changed(spec: mujoco.MjSpec, varied: Sequence[Elements]) -> Iterator[tuple[Elements, list[str]]]:
    """The terms of whose elements the compiler would make other numbers now than it did, with the names of these."""
    terms = [one for one in varied if one.made]
    if not terms:
        return
    probe = spec.copy()
    for one in terms:
        for name in one.made:
            if one.kind == "body":
                specs.assign(probe.body(name), explicitinertial=False, ipos=[np.nan] * 3)
            elif one.kind == "geom":
                probe.geom(name).mass = np.nan
            else:
                probe.tendon(name).springlength = [-1, -1]
    model = specs.compiled(probe.copy(), "arena.spec")
    for one in terms:
        changed = _other_geoms(probe, model, one) if one.kind == "geom" else _others(model, one)
        if changed:
            yield one, changed


_TOLD = {
    "body": "what the geoms of body {!r} weigh",
    "geom": "what geom {!r} weighs",
    "tendon": "the length at rest of tendon {!r}",
}
_MADE = {"body": ("body_mass", "body_ipos", "body_inertia"), "tendon": ("tendon_lengthspring",)}


def _others(model: mujoco.MjModel, term: Elements) -> list[str]:
    """The elements of a term for which the compiler would make other numbers now."""

    def numbers(of: mujoco.MjModel, name: str) -> list[np.ndarray]:
        return [comparing.array(of, field)[getattr(of, term.kind)(name).id] for field in _MADE[term.kind]]

    def differ(a: np.ndarray, b: np.ndarray, field: str) -> bool:
        size = term.base.stat.meansize if field == "body_ipos" else 0.0
        return bool(np.abs(a - b).max() > _SAME * (np.abs(b).max() + size))

    both = {
        name: zip(numbers(model, name), numbers(term.base, name), _MADE[term.kind], strict=True) for name in term.made
    }
    return [name for name, pairs in both.items() if any(differ(*pair) for pair in pairs)]


def _other_geoms(spec: mujoco.MjSpec, model: mujoco.MjModel, term: Elements) -> list[str]:
    """The geoms of a term that would weigh something else now."""
    solids = weighed.of(spec, term.made)
    now = dict(zip((model.geom(int(geom)).name for geom in solids.geom), solids.mass.tolist(), strict=True))
    before = dict(zip(term.elements, term.nominal.tolist(), strict=True))
    return [name for name in term.made if abs(now.get(name, 0.0) - before[name]) > _SAME * before[name]]


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
