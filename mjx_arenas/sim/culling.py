"""Steps on `impl="jax"` whose cost does not grow with the tables: each body meets the tables that it can touch.

MJX computes every pair of geoms that may collide, wherever they are. Here each movable body has `SLOTS` stand-ins for
the slabs of all tables, which take the sizes, poses and other rows of the tables nearest to it, anew in each step.
A table is left out only where a lower bound of its distance says that it cannot touch. Where more tables than slots
could touch a body of any world, the batch takes MJX's own step: no contact is ever lost.

Contacts of what is left out would be inactive: MJX gives such contacts zero rows and no force, so the motion is the
same but for the order of sums.
"""

import dataclasses
import operator
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import primitives
from mjx_arenas.record.layout import Layout
from mjx_arenas.sim.data import Impl
from mjx_arenas.write.replace import replace

SLOTS = 2  # tables that a body may touch at once before nothing is culled; it pays from more than twice as many on
FAR = 1e10  # [m] `contact.dist` of what was left out
SLACK = 64  # of rounding, in eps of the coordinates: MJX's distances are rounded, too
STEPS = {mjx.IntegratorType.EULER: mjx.euler, mjx.IntegratorType.IMPLICITFAST: mjx.implicit}
GEOM = mujoco.mjtGeom


class Unit(NamedTuple):
    """A movable body and the tables that collide with it alike: in the same order, with the same static rows."""

    body: int
    before: bool  # the tables' ids are smaller: MJX's box-box contacts depend on the order
    rows: tuple[int, ...]  # contype, conaffinity, condim, priority


@dataclasses.dataclass(frozen=True)
class Plan:
    """What is known of a culled step when it is compiled: T tables, U units, K slots, C contacts and c when culled."""

    slabs: np.ndarray  # (T,) geoms
    bodies: np.ndarray  # (G,) geoms that collide with slabs
    pairs: np.ndarray  # (U, G, T) bool
    slots: np.ndarray  # (K,) unit of each slot, in order
    statics: dict[str, Any]  # of the model with stand-ins
    blank: mjx.Data  # with c contacts
    named: np.ndarray  # (c, 2) geoms of the contacts; of a stand-in the unit's first slab
    slot: np.ndarray  # (c, 2) slot or -1
    source: np.ndarray  # (C, SLOTS) culled contacts that a contact may be
    table: np.ndarray  # (C, 1) its table, or -1
    slot_of: np.ndarray  # (C, SLOTS) the slots of these culled contacts
    true: np.ndarray  # (C, 2) geoms of MJX's contacts


def plan(model: mjx.Model, batched: Sequence[str], layout: Layout, data: mjx.Data) -> Plan | None:
    """How to cull the steps of a batch; None where MJX's own step is as fast, or culling might change a result.

    Args:
        model: of the batch.
        batched: names of its leaves of many worlds.
        layout: of the arena.
        data: of all worlds.
    """
    slabs = layout.table_geom[:, 0]
    if model.impl != Impl.JAX or len(slabs) <= 2 * SLOTS or not _can_cull(model, slabs):
        return None
    # Only shapes and static fields matter.
    rows = {name: operator.attrgetter(name)(model) for name in batched}
    one: dict[str, Any] = {name: jax.ShapeDtypeStruct(x.shape[1:], x.dtype) for name, x in rows.items()}
    blank = replace(model, one)
    blank = jax.tree.map(lambda x: np.zeros(x.shape, x.dtype), blank)
    return _plan(blank, jax.tree.map(lambda x: np.zeros(x.shape[1:], x.dtype), data), slabs)


def _can_cull(model: mjx.Model, slabs: np.ndarray) -> bool:
    flags = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    limits = ("max_geom_pairs", "max_contact_points")
    return (
        (model.geom_type[slabs] == GEOM.mjGEOM_BOX).all()
        and not model.body_weldid[model.geom_bodyid[slabs]].any()
        and not (model.geom_type == GEOM.mjGEOM_HFIELD).any()  # MJX keeps bounds for them by the ids of geoms
        and model.opt.integrator in STEPS
        and not model.opt.disableflags & flags
        and all(mjx.name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name) < 0 for name in limits)
        and not np.isin([model.pair_geom1, model.pair_geom2], slabs).any()
        and mujoco.mjtSensor.mjSENS_CONTACT not in model.sensor_type  # may depend on the contacts' order
    )


def _plan(model: mjx.Model, data: mjx.Data, slabs: np.ndarray) -> Plan | None:
    body, table_of = np.asarray(model.geom_bodyid), {int(g): t for t, g in enumerate(slabs)}
    true = _contact_geoms(model, data)
    units: dict[Unit, dict[tuple[int, int], None]] = {}
    unit_of: dict[tuple[int, int], Unit] = {}
    for pair in true:
        slab, geom = sorted(pair, key=lambda g: g not in table_of)
        if slab in table_of:
            rows = (model.geom_contype, model.geom_conaffinity, model.geom_condim, model.geom_priority)
            unit = Unit(int(body[geom]), bool(body[slab] < body[geom]), tuple(int(x[slab]) for x in rows))
            units.setdefault(unit, {})[geom, table_of[slab]] = None
            unit_of[geom, table_of[slab]] = unit
    tables = {unit: sorted({t for _, t in pairs}) for unit, pairs in units.items()}
    slots = [unit for unit in units for _ in tables[unit][:SLOTS]]
    if not slots:
        return None
    statics = _statics(model, [(unit, slabs[tables[unit][0]]) for unit in units], slots, slabs)
    lean = _extended(model, statics, np.zeros(len(slots), int))
    with jax.ensure_compile_time_eval():
        blank = jax.tree.map(np.asarray, mjx.make_data(lean))
    culled = _contact_geoms(lean, blank)

    # Contacts of a pair come in one order, wherever the pair stands.
    index = {key: c for c, key in enumerate(_counted(culled))}
    first_slot = {unit: slots.index(unit) for unit in units}
    source, slot_of, table = (np.full((len(true), n), fill) for n, fill in ((SLOTS, len(culled)), (SLOTS, 0), (1, -1)))
    for c, ((a, b), k) in enumerate(_counted(true)):
        slab, geom = sorted((a, b), key=lambda g: g not in table_of)
        if slab not in table_of:
            source[c, 0] = index[(a, b), k]
            continue
        table[c] = table_of[slab]
        unit = unit_of[geom, table_of[slab]]
        for s in range(slots.count(unit)):
            slot_of[c, s] = first_slot[unit] + s
            stand_in = model.ngeom + slot_of[c, s]
            source[c, s] = index[(stand_in, geom) if a == slab else (geom, stand_in), k]
    if (table >= 0).sum() <= 2 * (culled >= model.ngeom).any(1).sum():
        return None  # it would not pay
    geoms = sorted({geom for geom, _ in unit_of})
    pairs = np.array([[[(g, t) in units[u] for t in range(len(slabs))] for g in geoms] for u in units])
    slot = np.where(culled >= model.ngeom, culled - model.ngeom, -1)
    named = np.array([slabs[tables[unit][0]] for unit in slots])[slot]
    named = np.where(slot >= 0, named, culled)
    unit_index = np.array([list(units).index(unit) for unit in slots])
    return Plan(slabs, np.array(geoms), pairs, unit_index, statics, blank, named, slot, source, table, slot_of, true)


def _contact_geoms(model: mjx.Model, data: mjx.Data) -> np.ndarray:
    """(C, 2) geoms of the contacts of a model."""
    # They are constants: what is compiled holds nothing else. Compiled ahead, it can be called while a step is traced.
    geoms = jax.jit(lambda model, data: mjx.collision(model, data)._impl.contact.geom)
    return np.asarray(geoms.lower(model, data).compile()(model, data))


def _counted(pairs: np.ndarray) -> Iterator[tuple[tuple[int, int], int]]:
    """The pairs of geoms (C, 2) with how often each came before."""
    seen: dict[tuple[int, int], int] = {}
    for a, b in pairs.tolist():
        seen[a, b] = seen.get((a, b), -1) + 1
        yield (a, b), seen[a, b]


def _statics(model: mjx.Model, units: list[tuple[Unit, int]], slots: list[Unit], slabs: np.ndarray) -> dict[str, Any]:
    """Static fields of a model whose slabs collide no more, with a body of stand-ins for each unit and its first slab.

    The geoms of stand-ins are the last. Their bodies stand before all others but the world's, or behind, as the
    tables do: ids of bodies shift, which `mjx.collision` uses to enumerate pairs and for nothing else.
    """
    before = [unit for unit, _ in units if unit.before]
    after = [unit for unit, _ in units if not unit.before]
    shifted = np.arange(model.nbody) + len(before) * (np.arange(model.nbody) > 0)
    home = {unit: 1 + i for i, unit in enumerate(before)} | {
        unit: model.nbody + len(before) + i for i, unit in enumerate(after)
    }

    def rows(old: np.ndarray, new: dict[Unit, int]) -> np.ndarray:
        head, tail = [new[unit] for unit in before], [new[unit] for unit in after]
        return np.concatenate([old[:1], head, old[1:], tail]).astype(old.dtype)

    of = np.array([units[[u for u, _ in units].index(slot)][1] for slot in slots])
    statics = {}
    for field in model.fields():
        if field.name.startswith("geom_") and field.type is np.ndarray:
            value = getattr(model, field.name)
            statics[field.name] = np.concatenate([value, value[of]])
    for name in ("geom_contype", "geom_conaffinity"):
        statics[name][slabs] = 0
    movable = np.flatnonzero(np.asarray(model.body_weldid))
    apart = [sorted((home[unit], shifted[b])) for unit, _ in units for b in movable if b != unit.body]
    known = [(shifted[s >> 16], shifted[s & 0xFFFF]) for s in model.exclude_signature]
    excluded = np.array([(a << 16) + b for a, b in (*known, *apart)], int)
    world = dict.fromkeys(home, 0)
    return statics | {
        "nbody": model.nbody + len(units),
        "ngeom": model.ngeom + len(slots),
        "body_geomadr": rows(model.body_geomadr, {u: model.ngeom + slots.index(u) for u in home}),
        "body_geomnum": rows(model.body_geomnum, {u: slots.count(u) for u in home}),
        "body_weldid": rows(shifted[model.body_weldid], world),
        "body_parentid": rows(shifted[model.body_parentid], world),
        "geom_bodyid": np.concatenate([shifted[model.geom_bodyid], [home[unit] for unit in slots]]),
        "nexclude": len(excluded),
        "exclude_signature": excluded,
    }


def _extended(model: mjx.Model, statics: dict[str, Any], geoms: jax.Array | np.ndarray) -> mjx.Model:
    """`model` for `mjx.collision`, with stand-ins for `geoms` (K,): all their rows."""
    leaves = {}
    for field in model.fields():
        if field.name.startswith("geom_") and field.name not in statics:
            value = getattr(model, field.name)
            leaves[field.name] = (np if isinstance(value, np.ndarray) else jnp).concatenate([value, value[geoms]])
    return replace(model, statics | leaves)


# In a step, one world at a time.


def choose(plan: Plan, model: mjx.Model, data: mjx.Data) -> tuple[jax.Array, jax.Array]:
    """The tables (K,) that each slot stands for, and () bool whether more tables might touch a body."""
    closest = jnp.where(plan.pairs, clearance(plan, model, data), jnp.inf).min(1)  # (U, T)
    chosen = []
    for _ in range(SLOTS):
        nearest = closest.argmin(1)
        closest = jnp.where(jnp.arange(len(plan.slabs)) == nearest[:, None], jnp.inf, closest)
        chosen.append(nearest)
    rank = np.concatenate([np.arange(n) for n in np.bincount(plan.slots)])
    return jnp.stack(chosen, 1)[plan.slots, rank], (closest <= 0).any()


def clearance(plan: Plan, model: mjx.Model, data: mjx.Data) -> jax.Array:
    """(G, T) no more than the distance of each geom to each slab, less their margins: if positive they do not touch.

    It is the distance of the slab to the box around the geom that is parallel to it. The box is exact for spheres,
    capsules and boxes, and around the half extents of other geoms. No matrix products, which a GPU would round to ten bits.
    """
    geoms, slabs = plan.bodies, plan.slabs
    center, core, rounding = _hulls(model, geoms)
    axes, frame = data.geom_xmat[geoms], data.geom_xmat[slabs]  # (., 3, 3), axes are columns
    middle = data.geom_xpos[geoms] + (axes * center[:, None]).sum(-1)
    delta = middle[:, None] - data.geom_xpos[slabs]  # (G, T, 3)
    offset = jnp.abs((delta[..., None] * frame).sum(-2))
    turned = jnp.abs((axes[:, None, :, None, :] * frame[:, :, :, None]).sum(-3))  # (G, T, 3 of slab, 3 of geom)
    reach = (turned * core[:, None, None]).sum(-1) + rounding[:, None, None]
    half = model.geom_size[slabs]
    gap = jnp.maximum(offset - reach - half, 0)
    size = sum(jnp.abs(x).sum(-1) for x in (middle[:, None], data.geom_xpos[slabs], half, reach))
    slack = SLACK * jnp.finfo(size.dtype).eps * size
    return jnp.sqrt((gap * gap).sum(-1)) - slack - model.geom_margin[geoms][:, None] - model.geom_margin[slabs]


def _hulls(model: mjx.Model, geoms: np.ndarray) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Centres (G, 3) and half sizes (G, 3) of boxes in the geoms' frames, and how far (G,) the geoms reach beyond."""
    kinds, box = model.geom_type[geoms], model.geom_aabb[geoms]
    core, beyond = map(jnp.asarray, primitives.core(kinds, model.geom_size[geoms]))
    mesh = jnp.asarray(kinds == GEOM.mjGEOM_MESH)[:, None]
    return jnp.where(mesh, box[:, :3], 0.0), jnp.where(mesh, box[:, 3:], core), beyond


def collide(plan: Plan, model: mjx.Model, data: mjx.Data, chosen: jax.Array) -> Any:
    """The c contacts with the chosen tables (K,), of which they name each unit's first; `data` with positions."""
    geoms = jnp.asarray(plan.slabs)[chosen]
    poses = {name: getattr(data, name) for name in ("geom_xpos", "geom_xmat")}
    poses = {name: jnp.concatenate([x, x[geoms]]) for name, x in poses.items()}
    found = mjx.collision(_extended(model, plan.statics, geoms), _resized(data, plan.blank).replace(**poses))
    return _name(found._impl.contact, plan.named)


def step(plan: Plan, model: mjx.Model, data: mjx.Data, chosen: jax.Array) -> mjx.Data:
    """`mjx.step` from its positions on (`data` after `mjx.fwd_position`), with the chosen tables (K,)."""
    contact, full = collide(plan, model, data, chosen), data
    # No table moves, so constraints may name any: one that is known when compiling keeps their rows cheap.
    data = mjx.make_constraint(model, _with_contact(_resized(data, plan.blank), contact))
    named = jnp.where(plan.slot >= 0, jnp.asarray(plan.slabs)[chosen][plan.slot], plan.named)
    data = mjx.transmission(model, _with_contact(data, _name(contact, named)))
    for stage in (mjx.sensor_pos, mjx.fwd_velocity, mjx.sensor_vel, mjx.fwd_actuation, mjx.fwd_acceleration):
        data = stage(model, data)
    data = mjx.sensor_acc(model, mjx.solve(model, data))
    data = STEPS[model.opt.integrator](model, data)

    index, rows = _where(plan, chosen), _resized(data, full)
    contact = spread(plan, data._impl.contact, chosen)
    contact = contact.replace(dim=full._impl.contact.dim, efc_address=full._impl.contact.efc_address)
    begin = contact.efc_address
    width = np.diff(begin, append=full._impl.nefc)
    of, first = np.repeat(np.arange(len(width)), width), full._impl.nefc - width.sum()
    address = jnp.asarray(np.append(data._impl.contact.efc_address, plan.blank._impl.nefc))[index]
    nth = first + np.arange(len(of)) - begin[of]
    efc = jnp.concatenate([jnp.arange(first), address[of] + nth])
    values = {name: _take(getattr(data._impl, name), efc) for name in _rows(data) if name != "efc_type"}
    return rows.replace(_impl=rows._impl.replace(**values, contact=contact))


def spread(plan: Plan, contact: Any, chosen: jax.Array) -> Any:
    """The C contacts where MJX has them; those left out are `FAR`."""
    index = _where(plan, chosen)
    rows = jax.tree.map(lambda x: _take(x, index), contact)
    return _name(rows, plan.true).replace(dist=_take(contact.dist, index, FAR))


def _where(plan: Plan, chosen: jax.Array) -> jax.Array:
    """(C,) which of the c culled contacts each is; c: none."""
    there = (chosen[plan.slot_of] == plan.table) | (plan.table < 0)
    return jnp.where(there, plan.source, len(plan.named)).min(1)


def _take(rows: jax.Array, index: jax.Array, fill: float = 0) -> jax.Array:
    return jnp.asarray(rows).at[index].get(mode="fill", fill_value=fill)


def _rows(data: mjx.Data) -> list[str]:
    return [field.name for field in data._impl.fields() if field.name.startswith("efc_")]


def _resized(data: mjx.Data, like: mjx.Data) -> mjx.Data:
    """`data` with the contacts and constraints of another."""
    names = ("ne", "nf", "nl", "nefc", "ncon", "contact", *_rows(data))
    return data.replace(_impl=data._impl.replace(**{name: getattr(like._impl, name) for name in names}))


def _with_contact(data: mjx.Data, contact: Any) -> mjx.Data:
    return data.replace(_impl=data._impl.replace(contact=contact))


def _name(contact: Any, geom: jax.Array | np.ndarray) -> Any:
    geom = jnp.asarray(geom, contact.geom.dtype)
    return contact.replace(geom=geom, geom1=geom[:, 0], geom2=geom[:, 1])
