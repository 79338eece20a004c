"""The writer: from `ArenaParams` to the fields of a model, for MJX on JAX, MJX on Warp and C MuJoCo.

T tables, K objects; one world at a time.
"""

import copy
import functools
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from mujoco import mjx

from mjx_arenas import geometry, placement, shapes
from mjx_arenas.layout import Layout
from mjx_arenas.params import ArenaParams, canonical, present
from mjx_arenas.write import quaternions, references, statistics
from mjx_arenas.write.kinematics import Kinematics, kinematics
from mjx_arenas.write.rows import replace_rows, take
from mjx_arenas.write.set_const import set_const
from mjx_arenas.write.weights import weights

# What is absent is out of reach, high above: tables with all that hangs on them, and objects. Where an absent object is
# moved all the same, its contacts are off, by a negative margin (the margins of two geoms add up).
ABSENT_TABLE_Z = 1000.0  # [m], added: far from the floor, whose plane has no other side
ABSENT_MARGIN = -1e4  # [m], less than that: behind a wall or above a ceiling, which are planes, too
ABSENT_ARMATURE = 1.0  # of an object without mass: nothing moves it, and the solver has something to divide by


class Palette:
    """The numbers of one world that fields are made of; a field takes each of its elements from there.

    On a GPU fields are written faster so: their numbers are computed once, and each thread writes one element
    (benchmarks/README.md).
    """

    def __init__(self) -> None:
        self._places: dict[str, np.ndarray] = {}
        self._numbers: dict[str, jax.Array] = {}
        self._size = 0

    def place(self, name: str, numbers: jax.Array) -> np.ndarray:
        """Where the numbers (...) of a quantity are: static integers (...). They are put there once."""
        if name not in self._places:
            self._places[name] = self._size + np.arange(numbers.size).reshape(numbers.shape)
            self._numbers[name] = numbers.reshape(-1)
            self._size += numbers.size
        return self._places[name]

    def mixed(self) -> "Palette":
        """The same, with all numbers computed before any field takes them."""
        self._numbers = jax.lax.optimization_barrier(self._numbers)
        return self

    def take(self, source: np.ndarray, base: jax.Array) -> jax.Array:
        """`base` (...) with the elements that have a source (...), which is not -1, taken from there."""
        for name, numbers in self._numbers.items():
            index = source - self._places[name].min(initial=self._size)
            here = (index >= 0) & (index < numbers.size)
            if here.any():
                found = numbers.at[np.where(here, index, 0)].get(mode="promise_in_bounds")
                base = jnp.where(here, found.astype(base.dtype), base)
        return base


class World(NamedTuple):
    """One world's geometry, from which the fields are read."""

    params: ArenaParams
    table: geometry.Table
    present: jax.Array  # (T + K + 1,) bool: tables, objects, and true for the rest
    object_pos: jax.Array  # (K, 3)
    object_quat: jax.Array  # (K, 4)
    template: mjx.Model  # the model that the world is written into
    varying: frozenset[str]  # names in ArenaParams; the template is right about all others
    palette: Palette
    memo: dict[str, Any]  # what several fields are computed from

    @property
    def object_present(self) -> jax.Array:
        """(K,) bool."""
        return self.present[self.params.table_rots.shape[0] : -1]


class Elements(NamedTuple):
    """How one field of `mjx.Model` is put together from numbers of the palette."""

    depends: frozenset[str]  # on these names in ArenaParams
    source: Callable[[mjx.Model, Layout, World], np.ndarray]  # its elements' places in the palette; -1: the template's


class Field(NamedTuple):
    """How one field of `mjx.Model` is computed from the parameters."""

    depends: frozenset[str]
    value: Callable[[mjx.Model, Layout, World], jax.Array]  # may read fields of the model that stand above it in FIELDS


def world_geometry(model: mjx.Model, layout: Layout, params: ArenaParams, varying: frozenset[str]) -> World:
    """The geometry of one world."""
    params = canonical(params)
    table_present, object_present = present(params)
    table = geometry.table(params.table_offsets, params.table_rots, params.table_full_sizes, params.has_legs)
    pos, quat = placement.nominal_poses(layout.places, params)
    parked = placement.parked(len(pos))
    pos = jnp.where(object_present[:, None], jnp.asarray(pos), parked)
    everything = jnp.concatenate([table_present, object_present, jnp.ones(1, bool)])
    return World(params, table, everything, pos, quat, model, varying, Palette(), {})


def write_fields(
    model: mjx.Model, layout: Layout, params: ArenaParams, varying: frozenset[str]
) -> dict[str, jax.Array]:
    """The fields of `model` that follow from the quantities `varying`, for `params`."""
    world = world_geometry(model, layout, params, varying)
    names = field_names(layout, varying)
    source = {name: row.source(model, layout, world) for name in names if isinstance(row := FIELDS[name], Elements)}
    palette = world.palette.mixed()
    written = {}
    for name in names:
        row = FIELDS[name]
        if isinstance(row, Elements):
            written[name] = palette.take(source[name], getattr(model, name))
        else:
            written[name] = row.value(model, layout, world)
        model = replace(model, {name: written[name]})
    return written


def replace(model: mjx.Model, values: Mapping[str, jax.Array | int | None]) -> mjx.Model:
    """`model` with other values of some fields; names may have dots (`stat.extent`)."""
    # `Model.replace` walks its 500 fields for each call: slower than the device for 100,000 worlds.
    new = copy.copy(model)
    own = {name: value for name, value in values.items() if "." not in name}
    inner = {name.split(".")[0] for name in values.keys() - own.keys()}
    for part in inner:
        changed = {name.split(".")[1]: value for name, value in values.items() if name.startswith(f"{part}.")}
        own[part] = getattr(model, part).replace(**changed)
    for name, value in own.items():
        if not hasattr(model, name):
            raise AttributeError(f"mjx.Model has no field {name!r}.")
        object.__setattr__(new, name, value)
    return new


def field_names(layout: Layout, varying: frozenset[str]) -> tuple[str, ...]:
    """Names of the fields that `write_fields` gives."""
    return tuple(name for name, field in FIELDS.items() if field.depends & varying and name in layout.varying)


def _unchanged(field: jax.Array) -> np.ndarray:
    """The sources of a field of which nothing changes."""
    return np.full(field.shape, -1)


# Poses.


def _body_pos(model: mjx.Model, layout: Layout, world: World) -> np.ndarray:
    source = _unchanged(model.body_pos)
    source[layout.table_body] = world.palette.place("table_pos", _table_pos(world))
    source[layout.object_body] = world.palette.place("object_pos", world.object_pos)
    if len(layout.mount_body):
        top = world.table.top_pos[:, 2]
        z = top[layout.mount_table] + layout.mount_height.astype(top.dtype)
        source[layout.mount_body, 2] = world.palette.place("mount_z", z)
    return source


def _table_pos(world: World) -> jax.Array:
    gone: jax.Array = jnp.where(world.params.table_active, 0.0, ABSENT_TABLE_Z)
    return world.table.body_pos + gone[:, None] * jnp.array([0.0, 0.0, 1.0])


_WZ = np.array([0, 3])  # of a quaternion: all turn about z alone


def _body_quat(model: mjx.Model, layout: Layout, world: World) -> np.ndarray:
    source = _unchanged(model.body_quat)
    source[np.ix_(layout.table_body, _WZ)] = world.palette.place("table_wz", world.table.body_quat[:, ::3])
    source[np.ix_(layout.object_body, _WZ)] = _object_wz(world)
    return source


def _object_wz(world: World) -> np.ndarray:
    return world.palette.place("object_wz", world.object_quat[:, ::3])


def _site_pos(model: mjx.Model, layout: Layout, world: World) -> np.ndarray:
    source = _unchanged(model.site_pos)
    source[layout.top, 2] = _half(world)[:, 2]
    return source


def _object_qpos(field: str) -> Callable[[mjx.Model, Layout, World], np.ndarray]:
    def source(model: mjx.Model, layout: Layout, world: World) -> np.ndarray:
        out = _unchanged(getattr(model, field))
        out[layout.object_qpos[:, :3]] = world.palette.place("object_pos", world.object_pos)
        out[layout.object_qpos[:, [3, 6]]] = _object_wz(world)
        return out

    return source


# Shapes.


def _table_size(world: World) -> np.ndarray:
    """(T, 5) half size of slabs, radius and half length of legs: fields that take from two arrays are slower by a half."""
    half, leg = jnp.asarray(world.table.half), jnp.asarray(world.table.leg_size)
    return world.palette.place("table_size", jnp.pad(half, ((0, 0), (0, 2))) + jnp.pad(leg, ((0, 0), (3, 0))))


def _half(world: World) -> np.ndarray:
    """(T, 3) of slabs."""
    return _table_size(world)[:, :3]


def _leg_size(world: World) -> np.ndarray:
    """(T, 2) radius and half length."""
    return _table_size(world)[:, 3:]


def _of_shapes(
    name: str, formula: Callable[[np.ndarray, jax.Array], jax.Array], layout: Layout, world: World
) -> np.ndarray:
    """What follows from the sizes of objects that may vary (P, ...); -1 where they do not."""
    kinds, sizes = layout.object_kind[layout.primitive], take(world.params.object_full_sizes, layout.primitive)
    if "object_full_sizes" not in world.varying:
        return np.full(jax.eval_shape(functools.partial(formula, kinds), sizes).shape, -1)
    return world.palette.place(name, formula(kinds, sizes))


def _geom_size(model: mjx.Model, layout: Layout, world: World) -> np.ndarray:
    source = _unchanged(model.geom_size)
    source[layout.table_geom[:, geometry.SLABS]] = _half(world)[:, None]
    source[layout.table_geom[:, geometry.LEGS], :2] = _leg_size(world)[:, None]
    source[layout.primitive_geom] = _of_shapes("shape_size", shapes.geom_size, layout, world)
    return source


def _geom_pos(model: mjx.Model, layout: Layout, world: World) -> np.ndarray:
    source = _unchanged(model.geom_pos)
    pos = world.palette.place("leg_pos", world.table.leg_pos)
    minus = world.palette.place("leg_minus", -world.table.leg_pos[:, :2])
    for leg, signs in zip(layout.table_geom[:, geometry.LEGS].T, geometry.LEG_SIGNS, strict=True):
        xy = [(pos if sign > 0 else minus)[:, axis] for axis, sign in enumerate(signs)]
        source[leg] = np.stack([*xy, pos[:, 2]], axis=-1)
    return source


def _geom_rbound(model: mjx.Model, layout: Layout, world: World) -> np.ndarray:
    source = _unchanged(model.geom_rbound)
    slab = world.palette.place("slab_rbound", geometry.rbound(world.table.half))
    leg = world.palette.place("leg_rbound", geometry.rbound(world.table.leg_size))
    source[layout.table_geom[:, geometry.SLABS]] = slab[:, None]
    source[layout.table_geom[:, geometry.LEGS]] = leg[:, None]
    source[layout.primitive_geom] = _of_shapes("shape_rbound", shapes.rbound, layout, world)
    return source


def _geom_aabb(model: mjx.Model, layout: Layout, world: World) -> np.ndarray:
    # (ngeom, 6) on JAX and in C, (ngeom, 2, 3) on Warp: the same numbers in the same order. The centres are 0.
    source = _unchanged(model.geom_aabb).reshape(-1, 2, 3)
    source[layout.table_geom[:, geometry.SLABS], 1] = _half(world)[:, None]
    source[layout.table_geom[:, geometry.LEGS], 1] = _leg_size(world)[:, None, [0, 0, 1]]
    source[layout.primitive_geom, 1] = _of_shapes("shape_extent", shapes.half_extent, layout, world)
    return source.reshape(model.geom_aabb.shape)


# Contacts and looks.


def _geom_friction(model: mjx.Model, layout: Layout, world: World) -> np.ndarray:
    source = _unchanged(model.geom_friction)
    if "table_frictions" in world.varying:
        source[layout.table_geom[:, 0]] = world.palette.place("table_frictions", world.params.table_frictions)
    if "object_frictions" in world.varying:
        ids, owner = layout.rows("geom", "object")
        collides = (layout.nominal.geom_contype[ids] | layout.nominal.geom_conaffinity[ids]) != 0
        frictions = world.palette.place("object_frictions", world.params.object_frictions)
        source[ids[collides]] = frictions[owner[collides]]
    return source


def _geom_margin(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    ids, owner = layout.rows("geom", "any")
    margin = jnp.asarray(layout.nominal.geom_margin[ids], model.geom_margin.dtype)
    return replace_rows(model.geom_margin, ids, jnp.where(world.present[owner], margin, ABSENT_MARGIN))


def _pair_margin(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    nominal, owner = layout.nominal, layout.owner["geom"]
    there = world.present[owner[nominal.pair_geom1]] & world.present[owner[nominal.pair_geom2]]
    return jnp.where(there, jnp.asarray(nominal.pair_margin, model.pair_margin.dtype), ABSENT_MARGIN)


def _geom_matid(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    """Materials, -1 for what is absent: rays pass through what has none and no colour."""
    ids, owner = layout.rows("geom", "any")
    material = jnp.asarray(layout.nominal.geom_matid[ids], model.geom_matid.dtype)
    return replace_rows(model.geom_matid, ids, jnp.where(take(world.present, owner), material, -1))


def _geom_rgba(model: mjx.Model, layout: Layout, world: World) -> np.ndarray:
    source = _unchanged(model.geom_rgba)
    hidden, nominal = jnp.asarray(geometry.HIDDEN_RGBA, model.geom_rgba.dtype), layout.nominal.geom_rgba
    active = jnp.asarray(world.params.table_active)[:, None]
    leg_rgba = jnp.where(active, jnp.asarray(world.table.leg_rgba), hidden)
    legs = world.palette.place("leg_rgba", leg_rgba)
    source[layout.table_geom[:, geometry.LEGS]] = legs[:, None]
    if PRESENCE & world.varying:
        ids, owner = layout.rows("geom", "any")
        of_table = (owner < layout.n_tables) & ~np.isin(ids, layout.table_geom[:, geometry.LEGS])
        ids, owner = ids[of_table], owner[of_table]
        own = jnp.asarray(nominal[ids], hidden.dtype)
        source[ids] = world.palette.place("slab_rgba", jnp.where(take(active, owner), own, hidden))
    if (PRESENCE | {"object_rgba"}) & world.varying:
        ids, owner = layout.rows("geom", "object")
        own = np.where((layout.object_kind == "mjcf")[owner, None], nominal[ids], 1.0).astype(hidden.dtype)
        there = take(world.object_present, owner)[:, None]
        colour = jnp.where(there, own * take(world.params.object_rgba, owner), hidden)
        source[ids] = world.palette.place("object_rgba", colour)
    return source


# Masses, and what the compiler derives from them.


def _heavier(layout: Layout, world: World) -> jax.Array:
    """(K,) how many times as heavy as nominal each object is; 0 if absent."""
    mass: jax.Array = world.params.object_masses
    return jnp.where(world.object_present, mass / layout.object_mass, 0.0)


def _body_mass(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    ids, owner = layout.rows("body", "object")
    mass = jnp.asarray(layout.nominal.body_mass[ids], model.body_mass.dtype)
    mass = replace_rows(model.body_mass, ids, mass * take(_heavier(layout, world), owner))
    return _of_fixtures(mass, layout, world)


def _body_inertia(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    ids, owner = layout.rows("body", "object")
    inertia = jnp.asarray(layout.nominal.body_inertia[ids], model.body_inertia.dtype)
    inertia = replace_rows(model.body_inertia, ids, inertia * take(_heavier(layout, world), owner)[:, None])
    kinds, sizes = layout.object_kind[layout.primitive], take(world.params.object_full_sizes, layout.primitive)
    nominal: jax.Array = world.params.object_masses
    mass = jnp.where(world.object_present, nominal, 0.0)
    moments = shapes.inertia(kinds, sizes, take(mass, layout.primitive))
    return _of_fixtures(replace_rows(inertia, layout.object_body[layout.primitive], moments), layout, world)


def _of_fixtures(rows: jax.Array, layout: Layout, world: World) -> jax.Array:
    """Masses or inertias of bodies (nbody, ...), without those of what is fixed on absent tables."""
    ids = layout.heavy_fixtures
    there = take(world.present, layout.owner["body"][ids])
    return replace_rows(rows, ids, jnp.where(there.reshape(-1, *[1] * (rows.ndim - 1)), take(rows, ids), 0.0))


def _dof_armature(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    ids, owner = layout.rows("dof", "object")
    armature = jnp.asarray(layout.nominal.dof_armature[ids], model.dof_armature.dtype)
    there = take(world.object_present, owner)
    return replace_rows(model.dof_armature, ids, jnp.where(there, armature, ABSENT_ARMATURE))


def _weights(name: str) -> Callable[[mjx.Model, Layout, World], jax.Array]:
    return lambda model, layout, world: getattr(weights(model, layout.object_body), name)


def _derived(name: str) -> Callable[[mjx.Model, Layout, World], jax.Array]:
    return lambda model, layout, world: getattr(set_const(model), name)


def _once(world: World, name: str, value: Callable[[], Any]) -> Any:
    """What several fields are read from; their rows stand below those of all that it is derived from."""
    if name not in world.memo:
        world.memo[name] = value()
    return world.memo[name]


def _kinematics(model: mjx.Model, layout: Layout, world: World, bodies: np.ndarray | None = None) -> Kinematics:
    """The poses in this world; of `bodies` that do not move, those of the template, the same for all worlds."""
    if bodies is not None and not layout.moves[bodies].any():
        return _once(world, "template", lambda: kinematics(world.template, compiled=True))
    return _once(world, "kinematics", lambda: kinematics(model, compiled=True))


def _statistics(model: mjx.Model, layout: Layout, world: World) -> statistics.Statistic:
    """Statistics over what is there, as if the model did not have the rest.

    Only `meaninertia` still divides by `nv`: MJX scales costs by its product with `nv`, which then is that of the model
    without what is absent. What does not move is computed once for all worlds; tables and most objects, which are
    spheres here, in closed form.
    """
    there = world.present[layout.owner["body"]]
    kin, ball = _kinematics(model, layout, world), layout.ball_geom
    ball_body = np.asarray(model.geom_bodyid)[ball]
    sized = model if "object_full_sizes" in world.varying else world.template
    center, radius = take(kin.pos, ball_body), take(sized.geom_rbound, ball)
    active: jax.Array = world.params.table_active

    table_low, table_high = (jnp.asarray(corner) for corner in geometry.table_box(world.table))
    still = _kinematics(model, layout, world, layout.still.body)
    corners = [
        statistics.bounds(world.template, still, layout.still),
        statistics.bounds(model, kin, layout.rest, there),
        _box(table_low, table_high, active),
        _box(center - radius[:, None], center + radius[:, None], there[ball_body]),
    ]
    low = functools.reduce(jnp.minimum, [low for low, _ in corners])
    high = functools.reduce(jnp.maximum, [high for _, high in corners])

    fixed = statistics.sizes(world.template, still, layout.still, layout.still.body)
    moved = statistics.sizes(model, kin, layout.rest, layout.moving_body, there)
    known = replace_rows(jnp.zeros(model.nbody), layout.table_body, jnp.asarray(geometry.table_reach(world.table)))
    known = take(replace_rows(known, ball_body, radius), layout.moving_body)
    moved = jnp.where(take(there, layout.moving_body), jnp.maximum(moved, known), 0.0)
    count = jnp.maximum(len(fixed) + take(there, layout.moving_body).sum(), 1)
    inertia = jnp.where(there[model.dof_bodyid], model.dof_M0, 0.0)
    return statistics.combine(
        low,
        high,
        (fixed.sum() + moved.sum()) / count,
        jnp.where(there, model.body_mass, 0.0)[1:].sum() / count,
        (inertia.mean() if model.nv else model.stat.meaninertia) + layout.reflected_inertia,
    )


def _box(low: jax.Array, high: jax.Array, there: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Corners (3,) of the box around those boxes (n, 3) that are there."""
    low, high = jnp.where(there[:, None], low, statistics.FAR), jnp.where(there[:, None], high, -statistics.FAR)
    return low.min(0, initial=statistics.FAR), high.max(0, initial=-statistics.FAR)


def _statistic(name: str) -> Callable[[mjx.Model, Layout, World], jax.Array]:
    def value(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
        return getattr(_once(world, "statistic", lambda: _statistics(model, layout, world)), name)

    return value


def _reference(kind: str, name: str) -> Callable[[mjx.Model, Layout, World], jax.Array]:
    def value(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
        def found() -> references.References:
            body, target = getattr(layout, f"{kind}_body").T
            kin = _kinematics(model, layout, world)
            com = references.subtree_com(model, kin, np.where(target >= 0, target, body), layout.heavy)
            poses = _kinematics(model, layout, world, body)
            return references.references(poses, body, getattr(model, f"{kind}_pos"), com)

        return getattr(_once(world, kind, found), name)

    return value


def _cam_mat0(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    body = layout.cam_body[:, 0]
    return quaternions.quat_to_mat(
        quaternions.quat_mul(_kinematics(model, layout, world, body).quat[body], model.cam_quat)
    )


def _light_dir0(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    body = layout.light_body[:, 0]
    return quaternions.quat_rotate(_kinematics(model, layout, world, body).quat[body], model.light_dir)


def _on(*names: str) -> frozenset[str]:
    return frozenset(names)


PRESENCE = _on("table_active", "object_active")
ALWAYS = _on("geom_margin", "geom_matid", "geom_rgba", "pair_margin", "dof_armature")
ALWAYS |= _on("stat.meanmass", "stat.center", "stat.extent", "stat.meansize")
_YAW = _on("table_rots", "object_tables")
_TABLE_SIZE = _on("table_full_sizes")
_LEGS = _on("table_offsets", "table_full_sizes", "has_legs")  # the height makes the legs long
_OBJECT_SIZE = _on("object_full_sizes")
_PLACE = _YAW | _TABLE_SIZE | _OBJECT_SIZE | PRESENCE | _on("table_offsets")
_MASS = PRESENCE | _on("object_masses")
_INERTIA = _MASS | _OBJECT_SIZE

FIELDS: dict[str, Elements | Field] = {
    "body_pos": Elements(_PLACE, _body_pos),
    "body_quat": Elements(_YAW, _body_quat),
    "geom_size": Elements(_LEGS | _OBJECT_SIZE, _geom_size),
    "geom_pos": Elements(_LEGS, _geom_pos),
    "geom_rbound": Elements(_LEGS | _OBJECT_SIZE, _geom_rbound),
    "geom_aabb": Elements(_LEGS | _OBJECT_SIZE, _geom_aabb),
    "geom_friction": Elements(_on("table_frictions", "object_frictions"), _geom_friction),
    "geom_margin": Field(PRESENCE, _geom_margin),
    "pair_margin": Field(PRESENCE, _pair_margin),
    "geom_matid": Field(PRESENCE, _geom_matid),
    "geom_rgba": Elements(PRESENCE | _on("has_legs", "object_rgba"), _geom_rgba),
    "site_pos": Elements(_TABLE_SIZE, _site_pos),
    "qpos0": Elements(_PLACE, _object_qpos("qpos0")),
    "qpos_spring": Elements(_PLACE, _object_qpos("qpos_spring")),
    "body_mass": Field(_MASS, _body_mass),
    "body_inertia": Field(_INERTIA, _body_inertia),
    "body_subtreemass": Field(_MASS, lambda model, layout, world: references.subtree_mass(model)),
    "dof_armature": Field(PRESENCE, _dof_armature),
    "dof_M0": Field(_INERTIA, _weights("dof_M0")),
    "dof_invweight0": Field(_INERTIA, _weights("dof_invweight0")),
    "body_invweight0": Field(_INERTIA, _weights("body_invweight0")),
    "tendon_length0": Field(_PLACE, _derived("tendon_length0")),
    "tendon_invweight0": Field(_INERTIA | _PLACE, _derived("tendon_invweight0")),
    "actuator_acc0": Field(_INERTIA, _derived("actuator_acc0")),
    "stat.center": Field(_PLACE | _LEGS, _statistic("center")),
    "stat.extent": Field(_PLACE | _LEGS, _statistic("extent")),
    "stat.meansize": Field(PRESENCE | _LEGS | _OBJECT_SIZE, _statistic("meansize")),
    "stat.meanmass": Field(_MASS, _statistic("meanmass")),
    "stat.meaninertia": Field(_INERTIA, _statistic("meaninertia")),
    "cam_pos0": Field(_YAW, _reference("cam", "pos0")),
    "cam_mat0": Field(_YAW, _cam_mat0),
    "cam_poscom0": Field(_PLACE | _MASS, _reference("cam", "poscom0")),
    "light_pos0": Field(_YAW, _reference("light", "pos0")),
    "light_dir0": Field(_YAW, _light_dir0),
    "light_poscom0": Field(_PLACE | _MASS, _reference("light", "poscom0")),
}
"""Every field that the parameters decide. Derived ones stand below those that they are derived from."""
