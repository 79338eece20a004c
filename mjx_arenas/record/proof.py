"""Proof, when an arena is compiled, that what is written into worlds is what MuJoCo's compiler makes of them (host).

For each quantity alone, for all of them together and with things absent, other worlds are compiled, and the written world is held
against them: a field that differs between worlds is written, or the arena is refused. Here the rows of the terms are written in
double precision, and C's `mj_setConst` derives what follows; that the device derives the same is for the tests to show.
"""

import copy
from collections.abc import Sequence

import mujoco
import numpy as np

from mjx_arenas.build import assemble, frozen
from mjx_arenas.named import NOT_IN_MODEL, WEIGHT, put
from mjx_arenas.params.params import ArenaParams, named, with_values
from mjx_arenas.primitives import PRIMITIVES, around
from mjx_arenas.problem import problem
from mjx_arenas.record import refusals
from mjx_arenas.record.elsewhere import elsewhere as elsewhere
from mjx_arenas.record.layout import Layout
from mjx_arenas.rules import validation
from mjx_arenas.sample.variants import NUMBERS, with_own_numbers
from mjx_arenas.solids import inertials
from mjx_arenas.spec import specs, weighed
from mjx_arenas.spec.comparing import (
    EXACT,
    NOT_READ,
    STATISTICS,
    TENSOR,
    UNDERIVED,
    array,
    differ,
    differing,
    far_apart,
    fields,
)
from mjx_arenas.spec.names import element
from mjx_arenas.spec.quick import boxed
from mjx_arenas.terms.owned import Owned, element_name
from mjx_arenas.terms.parts import Parts
from mjx_arenas.terms.term import Boxed, Boxes, Row, Term
from mjx_arenas.write import writer
from mjx_arenas.write.scene import INERTIAL, Given, Scene

WHY = {
    "actuator_biasprm": "the compiler makes a damping of its `dampratio`: give it a `kv`",
    "actuator_ctrlrange": "the compiler takes it from the joint (`inheritrange`): give the actuator a `ctrlrange`",
    "actuator_lengthrange": "the compiler simulates it, or takes it from the limits of the joint: give the actuator a `lengthrange`",
    "dof_damping": "the compiler makes it of the joint's `springdamper`: give the joint a `stiffness` and a `damping`",
    "jnt_stiffness": "the compiler makes it of the joint's `springdamper`: give the joint a `stiffness` and a `damping`",
    "geom_fluid": "the compiler makes coefficients of its drag: leave out its `fluidshape`",
    "tendon_lengthspring": "the compiler takes it from where the tendon's ends stand: give the tendon a `springlength`",
}
WHY_ELSE = "nothing here derives it: give it explicit numbers, or keep it off what varies"


def prove(spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams, maker: str) -> tuple[mujoco.MjModel, Given]:
    """The nominal model, and what the MJCF says beside it.

    Args:
        spec: of the nominal arena, with whatever was added to it.
        parts: of the arena.
        nominal: its parameters.
        maker: name of the arena's class.

    Raises:
        ValueError: the parameters would not decide the arena alone.
    """
    refusals.check_rules(spec, parts)
    check_compiles(spec)  # a spec that was not compiled cannot be read any more
    model = _compiled(spec)
    quantities = [name for term in parts.terms for name in term.quantities]
    refusals.check_files(spec, parts, elsewhere(nominal, parts, quantities, 1.0))
    shaped = _shaped_geoms(parts)
    whole, solids = model, weighed.of(spec, shaped)
    own = spec
    spec = boxed(spec, model, [*shaped, *(g.name for o in parts.objects for g in spec.body(o.name).find_all("geom"))])
    model = _compiled(spec.copy())
    edited = differing(model, _world(spec, parts, nominal)) - NOT_READ
    if edited:
        _check_terms(model, spec, parts, nominal)
        told = {"names": sorted(edited), "maker": maker}
        told |= {"part": ", part", "of_part": ", of the part"} if parts.furniture else {"part": "", "of_part": ""}
        raise validation.error([problem("arena.spec", "decided", None, None, told)])
    frozen.check(own, parts.varied)
    pinned = frozenset(f"stat.{name}" for name in STATISTICS if not np.isnan(getattr(spec.stat, name)).any())
    placed, led, turned = (
        frozenset(key.name for key in spec.keys if len(getattr(key, x))) for x in ("qpos", "mpos", "mquat")
    )
    given = Given(pinned, solids, placed, led, turned, _ratios(spec))
    presence = parts.presence.bind(model)
    scene = Scene.of(model, parts.terms, presence._replace(quantities=frozenset()), nominal, given)  # all is there
    refusals.check_actuators(scene, frozenset(quantities))
    refusals.check_carriers(model, parts)
    _check_nominal(scene, nominal)
    alone = _that_something_follows(scene, spec, parts, nominal)
    for names, far in [*((names, 1.0) for names in _alike(scene, alone)), (quantities, 1.0), (quantities, -0.5)]:
        _prove(scene, spec, parts, elsewhere(nominal, parts, names, far), names)
    refusals.check_variants(model, parts)
    _prove_variants(scene, spec, parts, nominal)
    refusals.check_armatures(model, parts)
    refusals.check_coming(model, parts)
    refusals.check_wraps(scene, frozenset(quantities))
    _prove_absence(Scene.of(model, parts.terms, presence, nominal, given), spec, parts, nominal)
    return whole, given


def _check_terms(model: mujoco.MjModel, spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams) -> None:
    """Refuses numbers that were edited after `arena.vary` took them for nominal, by the name of the element."""
    for term in parts.varied:
        alone = spec.copy()
        term.edit(alone, nominal)
        other = _compiled(alone)
        for row in term.bind(model).rows(nominal):
            if row.field in (*NOT_IN_MODEL, *TENSOR):
                continue
            here = _other_than(model, other, row)
            if len(here):
                what = {"what": element_name(model, row.field, int(here[0])), "name": term.name}
                raise validation.error([problem("arena.spec", "edited_since", None, None, what)])


def _shaped_geoms(parts: Parts) -> list[str]:
    """Names of the geoms whose sizes or poses vary, by `arena.vary` or as those of furniture."""
    varied = [name for t in parts.varied if t.attribute in refusals.SHAPING for name in t.elements]
    return [*varied, *(name for term in parts.furniture for name in term.moving_geoms)]


def check_compiles(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """The compiled model; refuses what MuJoCo does not compile."""
    return _compiled(spec.copy())


def _compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    try:
        return spec.compile()
    except ValueError as error:
        raise ValueError(f"MuJoCo cannot compile the arena: {specs.one_line(error)}") from None


def _world(spec: mujoco.MjSpec, parts: Parts, params: ArenaParams, varied: Sequence[str] = ()) -> mujoco.MjModel:
    """Another world as the compiler makes it, with all tables and objects; `varied` are the quantities that are others than nominally."""
    other = spec.copy()
    assemble.set_params(other, parts, params)
    try:
        return other.compile()
    except ValueError as error:
        told = {"quantities": _listed(varied), "text": specs.one_line(error)}
        raise validation.error([problem("arena.spec", "uncompiled_world", None, None, told)]) from None


def _check_nominal(scene: Scene, nominal: ArenaParams) -> None:
    """Refuses terms whose rows are not what their `edit` makes of the nominal arena."""
    model, got = scene.model, written(scene, nominal)
    for rows in scene.owned:
        here = _other_than(model, got, rows)
        if len(here):
            where = element_name(model, rows.field, int(here[0]))
            raise validation.error([problem("terms", "term_writes", None, rows.term, where=where)])


def _other_than(model: mujoco.MjModel, other: mujoco.MjModel, rows: Row | Owned) -> np.ndarray:
    """The elements of some rows that differ in another model."""
    wrong = far_apart(model, rows.field, array(other, rows.field), array(model, rows.field)).reshape(-1)
    return rows.elements[wrong[rows.elements]]


def _that_something_follows(scene: Scene, spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams) -> list[str]:
    """The quantities that are to be proven alone: from the others nothing follows, as one world with all of them shows."""
    names = [term.name for term in parts.varied]
    own = {name: {rows.field for rows in scene.owned if name in rows.depends} for name in names}
    quiet = [name for name in names if set(writer.field_names(scene, frozenset({name}))) <= own[name]]
    others = [name for term in parts.terms for name in term.quantities if name not in quiet]
    if not quiet:
        return others
    fields = {field for name in quiet for field in own[name]}
    params = elsewhere(nominal, parts, quiet, 1.0)
    other, got = _world(spec, parts, params, quiet), written(scene, params)
    as_written = not any(differ(got, other, name) for name in fields - NOT_IN_MODEL.keys())
    return others if as_written and differing(scene.model, other) - NOT_READ <= fields else others + quiet


def _alike(scene: Scene, quantities: Sequence[str]) -> list[list[str]]:
    """The quantities, those together with which the same fields are written: one world shows a field that none of them writes."""

    def follow(names: Sequence[str]) -> frozenset[str]:
        return frozenset(writer.field_names(scene, frozenset(names)))

    found: dict[frozenset[str], list[str]] = {}
    for name in quantities:
        found.setdefault(follow([name]), []).append(name)
    return [
        group for own, names in found.items() for group in ([names] if follow(names) == own else [[n] for n in names])
    ]


def _prove(scene: Scene, spec: mujoco.MjSpec, parts: Parts, params: ArenaParams, quantities: Sequence[str]) -> None:
    """Holds the written world in which these quantities are others than nominally against the compiled one.

    Raises:
        ValueError: a field differs and is not written, or not rightly.
    """
    other, got = _world(spec, parts, params, quantities), written(scene, params)
    varying = differing(scene.model, other) - NOT_READ
    names = set(writer.field_names(scene, frozenset(quantities)))
    wrong = {name for name in (varying | names) - UNDERIVED if differ(got, other, name)}
    stale = sorted(wrong | varying - names)
    if stale:
        _refuse(scene, spec, parts, params, quantities, stale[0], other, got)
    _check_reaches(scene, parts.terms, other, params)


def _check_reaches(scene: Scene, terms: Sequence[Term], world: mujoco.MjModel, params: ArenaParams) -> None:
    """Refuses closed forms of how far bodies reach that are not those of the compiled world."""
    data = mujoco.MjData(world)
    mujoco.mj_kinematics(world, data)
    for term, bound in zip(terms, scene.terms, strict=True):
        if not isinstance(bound, Boxed):
            continue
        boxes = bound.boxes(params)
        got = np.column_stack([boxes.low, boxes.high, boxes.reach])
        want = np.array([_reach(world, data, boxes, body) for body in boxes.bodies]).reshape(-1, 7)
        wrong = (np.abs(got - want) > EXACT * np.abs(want).max(1, keepdims=True, initial=0.0)).any(1)
        if wrong.any():
            where = element(world, "body", int(boxes.bodies[wrong][0]))
            raise validation.error([problem("terms", "term_boxes", None, term.name, where=where)])


def _reach(world: mujoco.MjModel, data: mujoco.MjData, boxes: Boxes, body: int) -> np.ndarray:
    """(7,) the corners of the box around a body's covered sites, and spheres of geoms, and how far these are from its centre of mass."""
    geoms, sites = (
        boxes.geoms[world.geom_bodyid[boxes.geoms] == body],
        boxes.sites[world.site_bodyid[boxes.sites] == body],
    )
    points = np.concatenate([data.geom_xpos[geoms], data.site_xpos[sites], data.xipos[[body]], data.xpos[[body]]])
    radius = np.append(world.geom_rbound[geoms], np.zeros(len(points) - len(geoms)))[:, None]
    reach = np.linalg.norm(data.geom_xpos[geoms] - data.xipos[body], axis=1) + radius[: len(geoms), 0]
    return np.concatenate([(points - radius).min(0), (points + radius).max(0), reach.max(keepdims=True, initial=0.0)])


def _refuse(
    scene: Scene,
    spec: mujoco.MjSpec,
    parts: Parts,
    params: ArenaParams,
    quantities: Sequence[str],
    field: str,
    other: mujoco.MjModel,
    got: mujoco.MjModel,
) -> None:
    """Says which element would be stale, from which quantities it follows, and which term moves it."""
    want = array(other, field)
    wrong = [far_apart(scene.model, field, array(model, field), want).reshape(-1) for model in (got, scene.model)]
    at = int(np.flatnonzero(wrong[0] if wrong[0].any() else wrong[1])[0])
    moving = []
    for term in parts.terms:
        alone = spec.copy()
        term.edit(alone, params)
        value = array(_compiled(alone), field)
        if far_apart(scene.model, field, value, array(scene.model, field)).reshape(-1)[at]:
            moving.append(term)
    of = f" (of {' and '.join(repr(term.name) for term in moving)})" if moving else ""
    there = [name for name in quantities if np.size(named(params)[name])]
    quantities = [name for term in moving for name in term.quantities if name in quantities] or there
    told = {"element": _name(scene.model, field, at), "quantities": _listed(quantities), "of": of}
    told["why"] = WHY.get(field, WHY_ELSE)
    raise validation.error([problem("arena.spec", "stale", None, None, told)])


def _name(model: mujoco.MjModel, field: str, at: int) -> str:
    """What messages call an element that was found by `far_apart`; of inertias by the tensor's nine numbers."""
    if field == "tex_data":
        return f"{field} of {element(model, 'texture', int(np.searchsorted(model.tex_adr, at, side='right')) - 1)}"
    return element_name(model, field, at // 9 * 3 if field == "body_inertia" else at)


def _listed(names: Sequence[str]) -> str:
    quoted = [f"`{name}`" for name in names] or ["nothing"]
    return quoted[0] if len(quoted) == 1 else f"{', '.join(quoted[:-1])} and {quoted[-1]}"


def written(scene: Scene, params: ArenaParams) -> mujoco.MjModel:
    """The nominal model with the rows of all terms for other parameters, and what C MuJoCo derives from them."""
    model = copy.copy(scene.model)
    weight = np.ones(model.ngeom)
    for term in scene.terms:
        for row in term.rows(params):
            values = np.asarray(row.values).reshape(-1)[row.source]
            if row.field == WEIGHT:
                weight[row.elements] = values
            elif row.field not in NOT_IN_MODEL:
                put(model, row.field, row.elements, values)
    grown = np.flatnonzero((model.geom_size != scene.model.geom_size).any(1) & np.isin(model.geom_type, PRIMITIVES))
    model.geom_aabb[grown, 3:], model.geom_rbound[grown] = around(model.geom_type[grown], model.geom_size[grown])
    given = scene.given.solids
    if len(given.geom):
        size, pos, quat = (getattr(model, name)[given.geom] for name in ("geom_size", "geom_pos", "geom_quat"))
        for name, values in zip(
            INERTIAL, inertials(given, scene.model, size, pos, quat, weight[given.geom]), strict=True
        ):
            getattr(model, name)[given.bodies] = values
    mujoco.mj_setConst(model, mujoco.MjData(model))
    model.actuator_biasprm[scene.ratios.ids, 2] = -scene.ratios.dampings(model)
    return model


def _ratios(spec: mujoco.MjSpec) -> tuple[int, ...]:
    """Ids of the position servos with a `dampratio`."""
    return tuple(i for i, actuator in enumerate(spec.actuators) if specs.has_dampratio(actuator))


# Absence.


def _prove_variants(scene: Scene, spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams) -> None:
    """Holds worlds in which objects are others of their variants against worlds compiled with these variants alone.

    Raises:
        ValueError: something would differ.
    """
    variants, quantities = parts.places.variants, [one.name for one in parts.chosen]
    for v in range(max((len(one.names) for one in variants), default=0)):
        numbers = {one.quantity: np.full(1, float(min(v, len(one.names) - 1))) for one in variants}
        params = with_own_numbers(with_values(nominal, numbers), variants)
        _prove(scene, spec, parts, params, [*NUMBERS, *quantities])
        n = len(parts.presence.bodies)
        there = np.append(np.ones(n, bool), parts.wanted(params)[n:])
        alone = spec.copy()
        assemble.set_params(alone, parts, params)
        parts.presence.remove(alone, there)
        kept = np.ones(scene.model.nbody, bool), np.append(there, True)[scene.groups.geom]
        _compare_what_is_left(_world(spec, parts, params), _compiled(alone), *kept)


def _prove_absence(scene: Scene, spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams) -> None:
    """Holds what is left against worlds compiled without every second table or object.

    Raises:
        ValueError: something that is there would differ from the world without the rest.
    """
    model, groups = scene.model, scene.groups
    layout = Layout.of(model, parts)
    held = {*layout.held(), *parts.carrying(spec)}
    can_go = [g for g in range(len(groups.roots)) if g not in held]
    n_tables, n = len(parts.tables), len(parts.tables) + len(parts.objects)
    for start in (0, 1):
        gone = can_go[start::2]
        wanted = np.ones(len(groups.roots), bool)
        wanted[gone] = False
        ends = np.cumsum([n_tables, n - n_tables, *(len(term.elements) for term in parts.coming)])[:-1]
        tables, objects, *others = np.split(wanted, ends)
        more = {term.name: there for term, there in zip(parts.coming, others, strict=True)}
        params = nominal._replace(table_active=tables, object_active=objects, terms={**nominal.terms, **more})
        there = np.append(layout.presence.there(params), True)
        if there[: len(groups.roots)].all() or any(g in held for g in np.flatnonzero(~there)):
            continue
        other = spec.copy()
        assemble.set_params(other, parts, nominal)
        parts.presence.remove(other, there[:-1])
        body, left = there[groups.body], _compiled(other)
        _compare_what_is_left(model, left, body, body[model.geom_bodyid] & there[groups.geom])
        _compare_statistics(scene, left)


def _compare_what_is_left(full: mujoco.MjModel, left: mujoco.MjModel, body: np.ndarray, geom: np.ndarray) -> None:
    """Refuses a model of what is there, `body` (nbody,) and `geom` (ngeom,) bool, that differs from that of everything."""
    rows = {"body": body, "geom": geom, "site": body[full.site_bodyid], "jnt": body[full.jnt_bodyid]}
    rows["dof"] = body[full.dof_bodyid]
    for field in fields():
        kept = rows.get(field.partition("_")[0])
        if kept is None or field in ("body_subtreemass",) or field in NOT_READ:
            continue
        want, got = array(left, field), array(full, field)
        if want.dtype.kind != "f":
            continue
        got = got[kept]
        if got.shape != want.shape or far_apart(full, field, got, want).any():
            raise validation.error([problem("arena.spec", "stale_left", None, None, field=field)])


def _compare_statistics(scene: Scene, left: mujoco.MjModel) -> None:
    """Refuses statistics of a model of what is there that differ from those of everything and are not written."""
    names = {*writer.field_names(scene, scene.presence.quantities), *scene.given.pinned}
    for name in STATISTICS:
        got, want = (np.atleast_1d(getattr(model.stat, name)) for model in (scene.model, left))
        if name == "meaninertia":  # MJX scales costs by its product with the number of degrees of freedom
            got, want = got * scene.model.nv, want * left.nv
        if f"stat.{name}" not in names and not np.allclose(got, want, rtol=EXACT, atol=0.0):
            raise validation.error([problem("arena.spec", "stale_statistic", None, None, name=name, why=WHY_ELSE)])
