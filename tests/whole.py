"""Whole models in which everything varies at once, held against the compiler."""

import functools
import re
import warnings

import numpy as np
import oracle
import worlds
from models import spec_of
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas import dr, solids
from mjx_arenas.record import proof
from mjx_arenas.spec import automatic
from mjx_arenas.terms.attributes.poses import times
from mjx_arenas.terms.elements import ids_of

WHOLE = ("body.pseudo_inertia", "body.payload", "geom.density", "geom.mass")
ALL = [
    name
    for name in dr.ATTRIBUTES
    if name
    not in (
        "body.mass_alone",
        "body.inertia",
        "actuator.gainprm",
        "actuator.biasprm",
        "actuator.diameter",
        "actuator.dampratio",
        "body.active",
        *WHOLE,
    )
]
"""Attributes that do not decide what another one does."""


def everything(spec, model):
    """Terms of all that varies; worlds without some bodies have other fields (`test_whole_without.py`)."""
    return {a: dr.Term(a) for a in ALL}


def weighed(spec, model):
    """Terms of all other ways in which bodies weigh: of each third body its pseudo-inertia, a payload, or what its geoms weigh."""
    bodies = [body for body in spec.bodies if body.name and model.body(body.name).mass[0] > 0]
    geoms = [g.name for body in bodies[2::3] for g in body.geoms if g.name]
    given = [name for name in geoms if not np.isnan(spec.geom(name).mass)]
    chosen = {
        "body.pseudo_inertia": [b.name for b in bodies[::3]],
        "body.payload": [b.name for b in bodies[1::3]],
        "geom.mass": given,
        "geom.density": sorted(set(geoms) - set(given)),
    }
    terms = {a: dr.Term(a, list(map(re.escape, names))) for a, names in chosen.items() if names}
    return terms | {a: dr.Term(a) for a in ("geom.size", "geom.pos", "geom.rpy")}


def otherwise(spec, model):
    """Terms of what decides a part of what other terms decide: masses without inertias and the reverse, gains that are no servo's."""
    bodies = [re.escape(body.name) for body in spec.bodies if body.name and model.body(body.name).mass[0] > 0]
    chosen = {"body.mass_alone": bodies[::2], "body.inertia": bodies[1::2]}
    terms = {a: dr.Term(a, names) for a, names in chosen.items() if names}
    return terms | {a: dr.Term(a) for a in ("actuator.gainprm", "actuator.biasprm")}


@functools.lru_cache(maxsize=1)  # those with meshes are large
def with_everything(name, impl, terms=everything):
    """An arena of a model in which all varies that can."""
    spec = spec_of(name)
    automatic.give(spec)
    model = spec.compile()
    can = {}
    for a, term in terms(spec, model).items():
        names = term.select(spec, model)[0]
        names = tuple(name for name in names if not dr.Term(a, re.escape(name)).select(spec, model)[1])
        ids = ids_of(model, a.partition(".")[0], names)
        unseen = dr.ATTRIBUTES[a].unseen_on_jax if impl == "jax" else None
        seen = [re.escape(n) for n, i in zip(names, ids, strict=True) if not (unseen and unseen(model, int(i)))]
        can |= {a.replace(".", "_"): dr.Term(a, seen)} if seen else {}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The arena: geoms are inside each other")  # the Panda's, at `qpos0`
        warnings.filterwarnings("ignore", ".* does not change the centre of mass")  # as all varies at once
        warnings.filterwarnings("ignore", "Body .* only slides")
        arena = mja.Arena.from_xml(spec_of(name))
        arena.vary(**can)
    return arena


def elsewhere(arena, far):
    """Parameters in which all that varies is another."""
    record = arena.record
    return proof.elsewhere(record.nominal, record.parts, arena.quantities, far)


TENSOR = ("body_iquat", "body_inertia")


def tensors(leaves):
    """(nbody, 18) inertia tensors, and their axes as far as they are defined: each times how far its moment is from the next."""
    quat, moments = (np.asarray(leaves[name], float) for name in TENSOR)
    apart = np.abs(moments[:, [0, 1, 2]] - moments[:, [1, 2, 0]])
    axes = solids.rotation(quat) * np.minimum(apart, apart[:, [2, 0, 1]])[:, None]
    return np.concatenate([solids.tensors(quat, moments).reshape(-1, 9), axes.reshape(-1, 9)], axis=1)


def differing(model, got, want):
    """Names of the leaves in which a model differs from the compiled one by more than rounding."""
    found = oracle.differing(model, *({n: x for n, x in leaves.items() if n not in TENSOR} for leaves in (got, want)))
    weighed = {"body_inertia"} if other_inertias(got, want).any() else set()
    return (found | weighed) - oracle.STRUCTURE_MAY_DIFFER.keys()


def other_inertias(got, want):
    """(nbody,) bool: whose tensors differ by more than rounding, or whose axes are no unit quaternion."""
    a, b, rounding = tensors(got), tensors(want), oracle.FOLLOWING * oracle.EPS
    length = np.linalg.norm(np.asarray(got["body_iquat"], float), axis=1)
    return (np.abs(a - b) > rounding * np.linalg.norm(b, axis=1, keepdims=True)).any(1) | (
        np.abs(length - 1) > rounding
    )


def other_moments(inertia):
    """Inertias (nbody, 3) of which in turn each moment is 1.003 times itself; a small one is larger by 1e-4 of the largest."""
    moved = inertia * (1 + oracle.MUTATION)
    small = oracle.MUTATION * inertia <= 2 * oracle.FOLLOWING * oracle.EPS * inertia.max(1, keepdims=True)
    moved = np.where(small, inertia + 1e-4 * np.maximum(inertia.max(1, keepdims=True), 1e-9), moved)
    return [np.where(np.arange(3) == axis, moved, inertia) for axis in range(3)]


def other_axes(iquat, inertia):
    """Axes of inertias (nbody, 4) that are in turn 0.003 rad off about each of them, and of which bodies this is another inertia."""
    for axis in range(3):
        turn = np.append(1.0, np.where(np.arange(3) == axis, oracle.MUTATION / 2, 0.0)) / np.hypot(
            1, oracle.MUTATION / 2
        )
        one, other = np.delete(inertia, axis, axis=1).T
        yield np.array([times(quat, turn) for quat in iquat]), np.abs(one - other) > 0.01 * inertia.max(1)
    yield iquat * (1 + oracle.MUTATION), np.ones(len(iquat), bool)


def held(name, impl, terms=everything):
    """Holds worlds of a model, in which everything varies, against the compiled ones, and mutants of them, too."""
    hold(with_everything(name, impl, terms), impl)


def hold(arena, impl):
    """The same of an arena."""
    model = arena.put_model(impl)
    for far in (0.5, -0.3):
        params = elsewhere(arena, far)
        fields = arena.fields(model, params)
        compiled = arena.compile(params)
        want = worlds.leaves(mjx.put_model(compiled, impl=impl))
        got = worlds.leaves(arena.apply(model, params))
        assert differing(compiled, got, want) == set()
        for field in fields:
            leaf = field if field in got else f"_impl.{field}"
            other = ~got[leaf] if got[leaf].dtype == bool else oracle.mutants(compiled, field, got[leaf])
            if field == "body_inertia":
                inertia = got[leaf].astype(float)
                assert all(other_inertias(got | {leaf: moments}, want).all() for moments in other_moments(inertia))
            elif field == "body_iquat":
                for axes, seen in other_axes(got[leaf].astype(float), got["body_inertia"].astype(float)):
                    assert other_inertias(got | {leaf: axes}, want)[seen].all()
            else:
                assert oracle.off(compiled, field, other, want[leaf]).all(), field
