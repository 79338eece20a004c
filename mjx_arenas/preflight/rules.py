"""What the numbers of a randomized model are checked for: each check yields sentences (host)."""

import functools
from collections.abc import Callable, Iterator

import jax
import mujoco
import numpy as np
from mujoco import mjx
from mujoco.mjx._src import collision_driver
from mujoco.mjx._src.types import Impl

from mjx_arenas.preflight import elements
from mjx_arenas.preflight.leaves import Leaves, about, listed
from mjx_arenas.primitives import PRIMITIVES, around
from mjx_arenas.sim.data import static_geoms
from mjx_arenas.write.set_const import set_const

# What `mjx.step` never reads on an implementation, though it decides what happens in C.
UNREAD = {
    Impl.JAX: (
        "geom_gap",
        "pair_gap",
        "jnt_stiffnesspoly",
        "dof_dampingpoly",
        "tendon_stiffnesspoly",
        "tendon_dampingpoly",
    ),
    Impl.WARP: ("opt.impratio",),  # it reads opt._impl.impratio_invsqrt, which put_model derives
}

NOT_NEGATIVE = ("geom_friction", "pair_friction", "geom_size", "body_mass", "body_inertia", "dof_armature")
NOT_NEGATIVE += ("dof_frictionloss", "tendon_frictionloss", "opt.timestep", "opt.density", "opt.viscosity")

_ROUNDING = 1e-4  # relative; of float32 and what is derived in it


def _read_bounds(model: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Stale bounds on which collisions depend."""
    for name, sentence in _bounds(model, worlds):
        if _reads(model, name):
            yield f"{sentence}: contacts are lost where it is too small."


def _other_bounds(model: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Stale bounds that nothing reads here."""
    for name, sentence in _bounds(model, worlds):
        if not _reads(model, name):
            yield f"{sentence}: impl='jax' does not read it here."


def _reads(model: mjx.Model, name: str) -> bool:
    """Whether collisions depend on a bound."""
    culls = collision_driver._numeric(model, "max_geom_pairs") > -1
    return model.impl == Impl.WARP or (name == "geom_rbound" and culls)


def _bounds(model: mjx.Model, worlds: Leaves) -> Iterator[tuple[str, str]]:
    """Bounds, by name, that are not those of geoms whose size has changed."""
    types = np.asarray(model.geom_type)
    ids = np.flatnonzero(np.isin(types, PRIMITIVES))
    half, radius = around(types[ids], worlds["geom_size"][:, ids])
    resized = worlds.changed("geom_size")[:, ids].any(-1)
    want = {"geom_rbound": radius[..., None], "geom_aabb": np.concatenate([0 * half, half], -1)}
    for name, right in want.items():
        got = worlds[name].reshape(worlds.n, model.ngeom, -1)[:, ids]  # aabb: (ngeom, 6) on JAX, (ngeom, 2, 3) on Warp
        changed = resized | worlds.changed(name).reshape(worlds.n, model.ngeom, -1)[:, ids].any(-1)
        off = abs(got - right).max(-1)
        wrong = changed & (off > _ROUNDING * half.max(-1) + 1e-6)
        if wrong.any():
            w, g = np.unravel_index(np.argmax(np.where(wrong, off, -1)), off.shape)
            at = f"{elements.geom(model, ids[g])} in world {w}: {_numbers(got[w, g])}, its size asks for {_numbers(right[w, g])}"
            yield name, f"`{name}` does not belong to `geom_size` in {_of_worlds(wrong)} ({at})"


def _masses(model: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Masses of subtrees, from which MJX takes their centres of mass."""
    mass, template = (np.array(m, float) for m in (worlds["body_mass"], worlds.template["body_mass"][None]))
    parent = np.asarray(model.body_parentid)
    for body in range(model.nbody - 1, 0, -1):
        mass[:, parent[body]] += mass[:, body]
        template[:, parent[body]] += template[:, body]
    off = abs((worlds["body_subtreemass"] - worlds.template["body_subtreemass"]) - (mass - template))
    wrong = off > _ROUNDING * np.maximum(mass, template) + 1e-9
    if wrong.any():
        what = f"`body_subtreemass` does not add up to `body_mass` in {_of_worlds(wrong)}"
        yield f"{what}: centres of mass of subtrees are wrong; mjx_arenas.set_const derives it."


def _weights(model: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Inverse weights of bodies whose mass or inertia has changed, by which contacts and limits are soft."""
    mass, inertia = (
        abs(worlds[name] - worlds.template[name]) > _ROUNDING * worlds.template[name]
        for name in ("body_mass", "body_inertia")
    )
    heavier = (mass | inertia.any(-1)) & (np.asarray(model.body_weldid) != 0)
    stale = {
        "body_invweight0": heavier & ~worlds.changed("body_invweight0").any(-1),
        "dof_invweight0": heavier[:, np.asarray(model.dof_bodyid)] & ~worlds.changed("dof_invweight0"),
    }
    derive = functools.cache(lambda world: _set_const(worlds.model(model, world)))
    for name, rows in stale.items():
        if not rows.any():
            continue
        # They may well not depend on this mass, such as that of a wheel that only turns: what is right decides.
        world = int(np.flatnonzero(rows.any(-1))[0])
        derived = derive(world)
        right = None if derived is None else np.asarray(getattr(derived, name))
        if right is None or (abs(right - worlds[name][world]) > 1e-3 * abs(right))[rows[world]].any():
            what = f"`{name}` is the template's in {_of_worlds(rows)} in which `body_mass` or `body_inertia` is not"
            yield f"{what}: contacts and limits are too soft or too stiff; mjx_arenas.set_const derives it."


def _set_const(model: mjx.Model) -> mjx.Model | None:
    """`set_const`, or None for models that it does not know."""
    try:
        return jax.jit(set_const)(model)
    except NotImplementedError:
        return None


def _unread(model: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Writes that the implementation does not read."""
    for name in UNREAD.get(model.impl, ()):
        if name in worlds.template and worlds.changed(name).any():
            instead = ": it reads `opt._impl.impratio_invsqrt`" if name == "opt.impratio" else ""
            if instead and np.allclose(worlds["opt._impl.impratio_invsqrt"] ** -2.0, worlds[name], rtol=_ROUNDING):
                continue
            yield f"`{name}` is not the template's, but has no effect on impl={model.impl.value!r}{instead}."
    if model.impl == Impl.JAX:
        for kind in ("dof", "tendon"):
            name = f"{kind}_frictionloss"
            without = ~np.asarray(getattr(model._impl, f"{kind}_hasfrictionloss"), bool)
            if (worlds[name] > 0)[:, without].any():
                yield f"`{name}` has no effect on impl='jax' where the template's is 0: give it a small one."
        if not model.flg_gravcomp and worlds["body_gravcomp"].any():
            yield "`body_gravcomp` has no effect on impl='jax', as the template has none: give it to a body."
    if model.impl == Impl.WARP and "hfield_data" in worlds.batched and worlds.changed("hfield_data").any():
        yield "`hfield_data` has no effect on impl='warp' but that of world 0, whose ground all worlds have: give it to the template."
    if not (model.opt._impl.has_fluid_params if model.impl == Impl.JAX else model._impl.has_fluid):
        for name in ("opt.density", "opt.viscosity", "opt.wind"):
            if worlds.changed(name).any():
                yield f"`{name}` has no effect, as the template has no fluid: give it density, viscosity or wind."


def _on_height_fields(model: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Geoms that are larger than what MJX on JAX tests of a height field, by the template's bounds."""
    fields = np.asarray(model.geom_type) == mujoco.mjtGeom.mjGEOM_HFIELD
    if model.impl == Impl.JAX and fields.any() and worlds.changed("geom_size").any():
        met = sorted({int(b) for a, b, _ in collision_driver.geom_pairs(model) if fields[a]})
        larger = worlds["geom_size"][:, met] > worlds.template["geom_size"][met] * (1 + _ROUNDING)
        if larger.any():
            which = listed([elements.geom(model, met[i]) for i in np.flatnonzero(larger.any((0, 2)))])
            what = f"`geom_size` of {which} is larger than the template's in {_of_worlds(larger)}"
            yield f"{what}, by which impl='jax' tests height fields: contacts are lost; use impl='warp', or the largest template."


def _static_on_warp(model: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Poses of geoms that Warp places once."""
    if model.impl != Impl.WARP:
        return
    geoms = static_geoms(model)
    bodies = set(np.asarray(model.geom_bodyid)[geoms].tolist())
    for body in range(model.nbody - 1, 0, -1):
        if body in bodies:
            bodies.add(int(model.body_parentid[body]))
    rows = dict.fromkeys(("body_pos", "body_quat"), sorted(bodies)) | dict.fromkeys(("geom_pos", "geom_quat"), geoms)
    moved = [
        f"`{name}`" for name, ids in rows.items() if (abs(worlds[name] - worlds.template[name])[:, ids] > 1e-5).any()
    ]
    if moved:
        yield (
            f"{listed(moved)}: geoms move that are fixed to the world, which Warp places once, where the template has them: "
            "put data through mjx_arenas.place_static (environments: mjx_arenas.envs.static_geoms.StaticGeoms)."
        )


def _left_behind(model: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Bodies with a free joint that are moved by `body_pos` and `body_quat`, which only the compiler reads of them."""
    body, first = _free(model)
    for name, entries in (("body_pos", np.arange(3)), ("body_quat", np.arange(3, 7))):
        start = worlds.changed("qpos0")[:, first[:, None] + entries]
        wrong = np.asarray(worlds.changed(name)[:, body].any(-1) & ~start.any(-1))
        if wrong.any():
            names = listed([elements.body(model, b) for b in body[wrong.any(0)]])
            yield (
                f"`{name}` of {names} has no effect in {_of_worlds(wrong)}, as bodies with a free joint start where `qpos0` "
                "has them, which is the template's there: write that, too."
            )


def _not_carried(model: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Bodies on which others may stand that move while all with a free joint start where they did."""
    free = _free(model)[0]
    weld, collides = np.asarray(model.body_weldid), np.asarray(model.geom_contype) | np.asarray(model.geom_conaffinity)
    fixed = np.unique(np.asarray(model.geom_bodyid)[collides != 0])
    fixed = fixed[(weld[fixed] == 0) & (fixed != 0) & (np.asarray(model.body_mocapid)[fixed] == -1)]
    moved = np.concatenate([worlds.changed("body_pos"), worlds.changed("body_quat")], axis=-1).any((0, 2))
    moved = fixed[np.asarray(moved)[fixed]]
    if len(free) and len(moved) and not worlds.changed("qpos0").any():
        tables, things = (listed([elements.body(model, b) for b in bodies]) for bodies in (moved, free))
        yield (
            f"What may stand on {tables}, which moves, starts where the template has it: `qpos0` has {things} in the same place "
            "in all worlds, unless the environment sets it."
        )


def _free(model: mjx.Model) -> tuple[np.ndarray, np.ndarray]:
    """Bodies with a free joint, and the first entry of each in qpos."""
    free = np.asarray(model.jnt_type) == mujoco.mjtJoint.mjJNT_FREE
    return np.asarray(model.jnt_bodyid)[free], np.asarray(model.jnt_qposadr)[free]


def _idle_friction(model: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Sliding friction of geoms that never is the one that counts."""
    friction, priority = worlds["geom_friction"][..., 0], np.asarray(model.geom_priority)
    varies = (friction != friction[:1]).any(0)
    counts: dict[int, bool] = {}
    for a, b, pair in collision_driver.geom_pairs(model) if varies.any() else ():
        for geom, other in ((a, b), (b, a)) if pair == -1 else ():
            if varies[geom] and not counts.get(geom):
                larger = (friction[:, geom] > friction[:, other]).any()
                counts[geom] = bool(priority[geom] > priority[other] or (priority[geom] == priority[other] and larger))
    idle = [elements.geom(model, geom) for geom, does in counts.items() if not does]
    if idle:
        yield (
            f"`geom_friction` of {listed(idle)} varies without effect: what touches it has a higher priority, or the same "
            "and more sliding friction, of which the larger counts."
        )


def _of_worlds(wrong: np.ndarray) -> str:
    """Words for the worlds in which an array (W, ...) is true."""
    which = np.flatnonzero(wrong.reshape(len(wrong), -1).any(-1))
    return f"world {which[0]}" if len(which) == 1 else f"{len(which)} of {len(wrong)} worlds"


def _numbers(values: np.ndarray) -> str:
    return ", ".join(f"{x:.4g}" for x in values[-3:])  # of aabb the half extents


def _not_finite(_: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Numbers that are not finite where the template's are."""
    found: dict[str, list[str]] = {}
    for name, values in worlds.batched.items():
        wrong = np.isfinite(worlds.template[name]) & ~np.isfinite(values)
        if wrong.any():
            found.setdefault(_of_worlds(wrong), []).append(name)
    for where, names in found.items():
        yield about(
            names, f"has numbers that are not finite in {where}.", f"have numbers that are not finite in {where}."
        )


def _negative(_: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Numbers below zero of what has no meaning there."""
    for name in NOT_NEGATIVE:
        if name in worlds.batched:
            wrong = np.asarray(worlds.changed(name) & (worlds[name] < 0))
            if wrong.any():
                yield f"`{name}` must be >= 0, got {worlds[name][wrong].min():.4g} in {_of_worlds(wrong)}."


def _distinct(_: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Worlds that are the same."""
    if 1 < (distinct := worlds.n_distinct) < worlds.n:
        yield f"Of the {worlds.n} worlds {distinct} are distinct."


def _the_same(_: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Fields that are batched and do not vary, such as those of a range without width."""
    if worlds.n_distinct > 1:
        same = [name for name, value in worlds.batched.items() if not (value != value[:1]).any()]
        if same:
            rest = "batched, but the same in all worlds."
            yield about(same, f"is {rest}", f"are {rest}")


def _identical(_: mjx.Model, worlds: Leaves) -> Iterator[str]:
    """Batched in vain."""
    if not any(worlds.changed(name).any() for name in worlds.batched):
        what = f"all {worlds.n} worlds are" if worlds.n > 1 else "the one world is"
        yield f"Nothing has changed: {what} equal to `model`."
    elif worlds.n > 1 and worlds.n_distinct == 1:
        yield f"All {worlds.n} worlds are identical."


Check = Callable[[mjx.Model, Leaves], Iterator[str]]
PROBLEMS: tuple[Check, ...] = (
    _identical,
    _not_finite,
    _negative,
    _left_behind,
    _read_bounds,
    _masses,
    _weights,
    _unread,
    _on_height_fields,
)
NOTES: tuple[Check, ...] = (_distinct, _the_same, _static_on_warp, _not_carried, _other_bounds, _idle_friction)
