"""Proof, when an arena is compiled, that what is written into worlds is what MuJoCo's compiler makes of them (host).

For each quantity alone, for all of them together and with things absent, other worlds are compiled, and the written world is held
against them: a field that differs between worlds is written, or the arena is refused. Here the rows of the terms are written in
double precision, and C's `mj_setConst` derives what follows; that the device derives the same is for the tests to show.
"""

import copy
import functools
from collections.abc import Iterable, Sequence

import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import scales
from mjx_arenas.bounds import PRIMITIVES, around
from mjx_arenas.build import assemble
from mjx_arenas.named import NOT_IN_MODEL, WEIGHT, put
from mjx_arenas.named import field as field_of
from mjx_arenas.params.params import ArenaParams, with_values
from mjx_arenas.problem import problem
from mjx_arenas.record import refusals
from mjx_arenas.record.elsewhere import elsewhere as elsewhere
from mjx_arenas.record.layout import Layout
from mjx_arenas.rules import validation
from mjx_arenas.sample.variants import NUMBERS, with_own_numbers
from mjx_arenas.solids import inertials, tensors
from mjx_arenas.spec import specs, weighed
from mjx_arenas.terms.owned import element_name
from mjx_arenas.terms.parts import Parts
from mjx_arenas.terms.presence import Groups
from mjx_arenas.write import writer
from mjx_arenas.write.scene import INERTIAL, Given, Scene

EXACT = 1e-9  # of numbers in double precision, relative to themselves
SINGLE = 2.0**-22  # of what the compiler derives from numbers in single precision: a camera's focal length
OPTIONS = ("gravity", "wind", "magnetic", "density", "viscosity")
STATISTICS = ("center", "extent", "meansize", "meanmass", "meaninertia")
# What C MuJoCo derives when it is told to, or uses as a short-cut, the `qpos` of keyframes that have none, and which equalities
# are active at the start, which `make_data` sees to; no step of MJX reads any of it (docs/exactness.md), but for `dof_length` where
# bodies may sleep (`data.check_awake`).
NOT_READ = frozenset(
    {
        "body_margin",
        "body_sameframe",
        "site_sameframe",
        "tree_sleep_policy",
        "bvh_aabb",
        "bvh_child",
        "bvh_nodeid",
        "dof_length",
        "geom_sameframe",
        "key_qpos",
        "key_mpos",
        "key_mquat",
        "actuator_length0",
        "eq_active0",
    }
)
_STATISTICS = frozenset(f"stat.{name}" for name in STATISTICS)  # which C's `mj_setConst` does not derive since MuJoCo 4
_TENSOR = ("body_inertia", "body_iquat")
_WHY = {
    "actuator_biasprm": "the compiler makes a damping of its `dampratio`: give it a `kv`",
    "dof_damping": "the compiler makes it of the joint's `springdamper`: give the joint a `stiffness` and a `damping`",
    "eq_data": "the compiler takes its numbers from where bodies stand: give the equality its own (`relpose`, two sites)",
    "tendon_lengthspring": "the compiler takes it from where the tendon's ends stand: give the tendon a `springlength`",
}
_WHY_ELSE = "nothing here derives it: give it explicit numbers, or keep it off what varies"


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
    edited = differing(model, _world(spec, parts, nominal)) - NOT_READ
    if edited:
        _check_terms(model, spec, parts, nominal)
        raise ValueError(
            f"`arena.spec`: {', '.join(sorted(edited))} of a table{', part' * bool(parts.furniture)} or object was edited, which "
            f"parameters decide: give it as an argument of {maker}{', of the part' * bool(parts.furniture)} or of Object."
        )
    pinned = frozenset(f"stat.{name}" for name in STATISTICS if not np.isnan(getattr(spec.stat, name)).any())
    keys = (frozenset(key.name for key in spec.keys if len(getattr(key, x))) for x in ("qpos", "mpos", "mquat"))
    given = Given(pinned, weighed.of(spec, _touched_geoms(parts)), *keys)
    scene = Scene.of(model, parts.terms, nominal, _groups(model, parts), frozenset(), True, given)
    _check_nominal(scene, nominal)
    quantities = [name for term in parts.terms for name in term.quantities]
    alone = _that_something_follows(scene, spec, parts, nominal)
    for names, far in [*(([name], 1.0) for name in alone), (quantities, 1.0), (quantities, -0.5)]:
        _prove(scene, spec, parts, elsewhere(nominal, parts, names, far), names)
    refusals.check_variants(model, parts)
    _prove_variants(scene, spec, parts, nominal)
    refusals.check_armatures(model, parts)
    refusals.check_carriers(model, parts)
    refusals.check_coming(model, parts)
    refusals.check_wraps(scene, frozenset(quantities))
    _prove_absence(scene, spec, parts, nominal)
    return model, given


def _check_terms(model: mujoco.MjModel, spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams) -> None:
    """Refuses numbers that were edited after `arena.vary` took them for nominal, by the name of the element."""
    for term in parts.varied:
        alone = spec.copy()
        term.edit(alone, nominal)
        other = _compiled(alone)
        for row in term.bind(model).rows(nominal):
            if row.field in (*NOT_IN_MODEL, *_TENSOR):
                continue
            wrong = _far_apart(model, row.field, _array(other, row.field), _array(model, row.field)).reshape(-1)
            here = row.elements[wrong[row.elements]]
            if len(here):
                what = {"what": element_name(model, row.field, int(here[0])), "name": term.name}
                raise validation.error([problem("arena.spec", "edited_since", None, None, what)])


def _touched_geoms(parts: Parts) -> list[str]:
    """Names of the geoms on bodies that move whose sizes or poses vary, by `arena.vary` or as those of furniture."""
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


def _world(spec: mujoco.MjSpec, parts: Parts, params: ArenaParams) -> mujoco.MjModel:
    """Another world as the compiler makes it, with all tables and objects."""
    other = spec.copy()
    assemble.set_params(other, parts, params)
    return _compiled(other)


def _groups(model: mujoco.MjModel, parts: Parts) -> Groups:
    return Layout.of(model, parts).groups


def _check_nominal(scene: Scene, nominal: ArenaParams) -> None:
    """Refuses terms whose rows are not what their `edit` makes of the nominal arena."""
    model, got = scene.model, written(scene, nominal)
    for rows in scene.owned:
        wrong = _far_apart(model, rows.field, _array(got, rows.field), _array(model, rows.field)).reshape(-1)
        here = rows.elements[wrong[rows.elements]]
        if len(here):
            where = element_name(model, rows.field, int(here[0]))
            raise ValueError(f"Term {rows.term!r} writes {where} otherwise than it edits it.")


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
    other, got = _world(spec, parts, params), written(scene, params)
    as_written = not any(_differ(got, other, name) for name in fields - NOT_IN_MODEL.keys())
    return others if as_written and differing(scene.model, other) - NOT_READ <= fields else others + quiet


def _prove(scene: Scene, spec: mujoco.MjSpec, parts: Parts, params: ArenaParams, quantities: Sequence[str]) -> None:
    """Holds the written world in which these quantities are others than nominally against the compiled one.

    Raises:
        ValueError: a field differs and is not written, or not rightly.
    """
    other, got = _world(spec, parts, params), written(scene, params)
    varying = differing(scene.model, other) - NOT_READ
    names = set(writer.field_names(scene, frozenset(quantities)))
    wrong = {name for name in (varying | names) - _STATISTICS if _differ(got, other, name)}
    stale = sorted(wrong | varying - names)
    if stale:
        _refuse(scene, spec, parts, params, quantities, stale[0], other, got)


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
    want = _array(other, field)
    wrong = [_far_apart(scene.model, field, _array(model, field), want).reshape(-1) for model in (got, scene.model)]
    at = int(np.flatnonzero(wrong[0] if wrong[0].any() else wrong[1])[0])
    moving = []
    for term in parts.terms:
        alone = spec.copy()
        term.edit(alone, params)
        value = _array(_compiled(alone), field)
        if _far_apart(scene.model, field, value, _array(scene.model, field)).reshape(-1)[at]:
            moving.append(term)
    of = f" (of {' and '.join(repr(term.name) for term in moving)})" if moving else ""
    quantities = [name for term in moving for name in term.quantities if name in quantities] or quantities
    raise ValueError(
        f"`arena.spec`: {_name(scene.model, field, at)} would be stale in other worlds: it follows from "
        f"{_listed(quantities)}{of}, and {_WHY.get(field, _WHY_ELSE)}."
    )


def _name(model: mujoco.MjModel, field: str, at: int) -> str:
    """What messages call an element that was found by `_far_apart`; of inertias by the tensor's nine numbers."""
    return element_name(model, field, at // 9 * 3 if field == "body_inertia" else at)


def _listed(names: Sequence[str]) -> str:
    quoted = [f"`{name}`" for name in names]
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
    bounds = around(model.geom_type[grown], model.geom_size[grown])
    model.geom_aabb[grown, 3:], model.geom_rbound[grown] = bounds[:, :3], bounds[:, 3]
    given = scene.given.solids
    if len(given.geom):
        size, pos, quat = (getattr(model, name)[given.geom] for name in ("geom_size", "geom_pos", "geom_quat"))
        for name, values in zip(
            INERTIAL, inertials(given, scene.model, size, pos, quat, weight[given.geom]), strict=True
        ):
            getattr(model, name)[given.bodies] = values
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


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
        there = np.append(np.ones(len(parts.bodies), bool), parts.wanted(params)[len(parts.bodies) :])
        alone = spec.copy()
        assemble.set_params(alone, parts, params)
        assemble.remove_absent(alone, parts, there)
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
        there = np.append(layout.there(params), True)
        if there[: len(groups.roots)].all() or any(g in held for g in np.flatnonzero(~there)):
            continue
        other = spec.copy()
        assemble.set_params(other, parts, nominal)
        assemble.remove_absent(other, parts, there[:-1])
        body = there[groups.body]
        _compare_what_is_left(model, _compiled(other), body, body[model.geom_bodyid] & there[groups.geom])


def _compare_what_is_left(full: mujoco.MjModel, left: mujoco.MjModel, body: np.ndarray, geom: np.ndarray) -> None:
    """Refuses a model of what is there, `body` (nbody,) and `geom` (ngeom,) bool, that differs from that of everything."""
    rows = {"body": body, "geom": geom, "site": body[full.site_bodyid], "jnt": body[full.jnt_bodyid]}
    rows["dof"] = body[full.dof_bodyid]
    for field in _fields():
        kept = rows.get(field.partition("_")[0])
        if kept is None or field in ("body_subtreemass",) or field in NOT_READ:
            continue
        want, got = _array(left, field), _array(full, field)
        if want.dtype.kind != "f":
            continue
        got = got[kept]
        if got.shape != want.shape or _far_apart(full, field, got, want).any():
            raise ValueError(
                f"`arena.spec`: {field} of what is there would differ where other tables or objects are absent, from which the "
                f"compiler derives it: give it explicit numbers."
            )


# Comparing.


def _fields() -> Iterable[str]:
    """Names of the arrays that MJX has, too."""
    return (
        name for name in mjx.Model.__dataclass_fields__ if isinstance(getattr(mujoco.MjModel, name, None), property)
    )


def differing(a: mujoco.MjModel, b: mujoco.MjModel) -> set[str]:
    """Names of the numbers in which two compiled models of one topology differ, `stat.` for those of the statistics."""
    return {name for name in _number_names() if _differ(a, b, name)}


@functools.cache
def _number_names() -> tuple[str, ...]:
    """Names of all arrays of numbers of a compiled model, and of its statistics."""
    plain = mujoco.MjSpec().compile()
    arrays = {name: getattr(plain, name) for name in dir(plain) if not name.startswith("_")}
    numbers = [name for name, x in arrays.items() if isinstance(x, np.ndarray) and x.dtype.kind in "fiub"]
    numbers.remove("body_iquat")  # compared with `body_inertia`
    return (*(f"stat.{name}" for name in STATISTICS), *(f"opt.{name}" for name in OPTIONS), *numbers)


def _differ(a: mujoco.MjModel, b: mujoco.MjModel, name: str) -> bool:
    x, y = _array(a, name), _array(b, name)
    if x.shape != y.shape:
        return True
    if (x == y).all():
        return False
    return x.dtype.kind != "f" or bool(_far_apart(a, name, x, y).any())


def _array(model: mujoco.MjModel, name: str) -> np.ndarray:
    if name in _TENSOR:  # together: the axes may come in another order or sense
        return tensors(model.body_iquat, model.body_inertia).reshape(-1, 9)
    return np.atleast_1d(field_of(model, name))


def _far_apart(model: mujoco.MjModel, name: str, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Where numbers differ by more than rounding in double precision."""
    if a.dtype.kind != "f":
        return a != b
    if name == "body_invweight0":  # C's 0 is the square of what double precision rounds
        a, b = (np.where(x <= 2.0**-104 * x.max(-1, keepdims=True), 0.0, x) for x in (a, b))
    off = np.abs(a - b)
    if not off.any():
        return off > 0
    size = (
        np.maximum(scales.scale(model, name, a), scales.scale(model, name, b))
        if a.shape == _array(model, name).shape or name in _TENSOR
        else None
    )
    size = np.maximum(np.abs(a), np.abs(b)) if size is None else size
    exact = SINGLE if name == "cam_fovy" else EXACT
    return ~((off <= exact * size) | (np.isnan(a) & np.isnan(b)))
