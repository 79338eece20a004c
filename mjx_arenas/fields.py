"""The writer: from `ArenaParams` to the fields of a model, for MJX on JAX, MJX on Warp and C MuJoCo.

T tables, K objects; one world at a time.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
from mujoco import mjx

from mjx_arenas import constants, geometry
from mjx_arenas.constants import replace_rows
from mjx_arenas.layout import Layout
from mjx_arenas.params import ArenaParams, canonical


class World(NamedTuple):
    """One world's geometry, from which the fields are read."""

    params: ArenaParams
    table: geometry.Table
    object_pos: jax.Array  # (K, 3)
    object_quat: jax.Array  # (K, 4)


class Field(NamedTuple):
    """How one field of `mjx.Model` follows from the parameters."""

    depends: frozenset[str]  # on these names in ArenaParams
    value: Callable[[mjx.Model, Layout, World], jax.Array]  # may read fields of the model that stand above it in FIELDS


def world_geometry(layout: Layout, params: ArenaParams) -> World:
    """The geometry of one world."""
    params = canonical(params)
    table = geometry.table(params.table_offsets, params.table_rots, params.table_full_sizes, params.has_legs)
    on, dtype = layout.object_table, params.table_offsets.dtype
    frac, pos, rot, half_size = (
        jnp.asarray(a, dtype)
        for a in (layout.object_frac, layout.object_pos, layout.object_rot, layout.object_half_size)
    )
    xy = frac * table.half_size[on, :2] + pos
    object_pos, object_quat = geometry.on_table(
        params.table_offsets[on], params.table_rots[on], xy, rot, half_size[:, 2]
    )
    return World(params, table, object_pos, object_quat)


def write_fields(
    model: mjx.Model, layout: Layout, params: ArenaParams, varying: frozenset[str]
) -> dict[str, jax.Array]:
    """The fields of `model` that follow from the quantities `varying`, for `params`."""
    world = world_geometry(layout, params)
    written = {}
    for name in field_names(layout, varying):
        written[name] = FIELDS[name].value(model, layout, world)
        model = replace(model, {name: written[name]})
    return written


def replace(model: mjx.Model, values: Mapping[str, jax.Array | int | None]) -> mjx.Model:
    """`model` with other values of some fields; names may have dots (`stat.extent`)."""
    return cast(mjx.Model, model.tree_replace(dict(values)))


def field_names(layout: Layout, varying: frozenset[str]) -> tuple[str, ...]:
    """Names of the fields that `write_fields` gives."""
    return tuple(name for name, field in FIELDS.items() if field.depends & varying and name in layout.present)


def _body_pos(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    pos = replace_rows(model.body_pos, layout.table_body, world.table.body_pos)
    return replace_rows(pos, layout.object_body, world.object_pos)


def _body_quat(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    quat = replace_rows(model.body_quat, layout.table_body, world.table.body_quat)
    return replace_rows(quat, layout.object_body, world.object_quat)


def _replace_table_geoms(base: jax.Array, layout: Layout, slab: jax.Array, legs: jax.Array) -> jax.Array:
    """A geom field with new rows for slabs (T, ...), collision and visual alike, and for legs (T, 4, ...)."""
    rows = jnp.concatenate([slab[:, None], slab[:, None], legs], axis=1)
    return replace_rows(base, layout.table_geom.reshape(-1), rows.reshape(-1, *base.shape[1:]))


def _geom_size(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    return _replace_table_geoms(model.geom_size, layout, world.table.half_size, world.table.leg_size)


def _geom_pos(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    return _replace_table_geoms(model.geom_pos, layout, jnp.zeros_like(world.table.top_pos), world.table.leg_pos)


def _geom_rbound(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    slab, legs = geometry.box_rbound(world.table.half_size), geometry.cylinder_rbound(world.table.leg_size)
    return _replace_table_geoms(model.geom_rbound, layout, slab, legs)


def _geom_aabb(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    # (ngeom, 6) on JAX and in C, (ngeom, 2, 3) on Warp: the same numbers in the same order.
    slab = geometry.aabb(world.table.half_size)
    legs = geometry.aabb(geometry.cylinder_half_extent(world.table.leg_size))
    return _replace_table_geoms(model.geom_aabb, layout, slab, legs)


def _geom_friction(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    return replace_rows(model.geom_friction, layout.table_geom[:, 0], world.params.table_frictions)


def _geom_rgba(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    return replace_rows(model.geom_rgba, layout.table_geom[:, 2:].reshape(-1), world.table.leg_rgba.reshape(-1, 4))


def _site_pos(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    return replace_rows(model.site_pos, layout.top, world.table.top_pos)


def _object_qpos(field: str) -> Callable[[mjx.Model, Layout, World], jax.Array]:
    def value(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
        pose = jnp.concatenate([world.object_pos, world.object_quat], axis=-1)
        return replace_rows(getattr(model, field), layout.object_qpos.reshape(-1), pose.reshape(-1))

    return value


def _statistic(name: str) -> Callable[[mjx.Model, Layout, World], jax.Array]:
    return lambda model, layout, world: getattr(constants.statistic(model), name)


def _reference(kind: str, name: str) -> Callable[[mjx.Model, Layout, World], jax.Array]:
    def value(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
        body, target = getattr(layout, f"{kind}_body").T
        return getattr(constants.references(model, body, target, getattr(model, f"{kind}_pos")), name)

    return value


def _cam_mat0(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    _, quat = constants.body_poses(model)
    return constants.quat_to_mat(constants.quat_mul(quat[layout.cam_body[:, 0]], model.cam_quat))


def _light_dir0(model: mjx.Model, layout: Layout, world: World) -> jax.Array:
    _, quat = constants.body_poses(model)
    return constants.quat_rotate(quat[layout.light_body[:, 0]], model.light_dir)


_YAW = frozenset({"table_rots"})
_THICKNESS = frozenset({"table_full_sizes"})
_POSE = frozenset(
    {"table_offsets", "table_rots", "table_full_sizes"}
)  # the slab's centre lies half a thickness under the offset
_SHAPE = frozenset({"table_offsets", "table_full_sizes", "has_legs"})  # the height makes the legs long

FIELDS: dict[str, Field] = {
    "body_pos": Field(_POSE, _body_pos),
    "body_quat": Field(_YAW, _body_quat),
    "geom_size": Field(_SHAPE, _geom_size),
    "geom_pos": Field(_SHAPE, _geom_pos),
    "geom_rbound": Field(_SHAPE, _geom_rbound),
    "geom_aabb": Field(_SHAPE, _geom_aabb),
    "geom_friction": Field(frozenset({"table_frictions"}), _geom_friction),
    "geom_rgba": Field(frozenset({"has_legs"}), _geom_rgba),
    "site_pos": Field(_THICKNESS, _site_pos),
    "qpos0": Field(_POSE, _object_qpos("qpos0")),
    "qpos_spring": Field(_POSE, _object_qpos("qpos_spring")),
    "stat.center": Field(_POSE | _SHAPE, _statistic("center")),
    "stat.extent": Field(_POSE | _SHAPE, _statistic("extent")),
    "stat.meansize": Field(_SHAPE, _statistic("meansize")),
    "cam_pos0": Field(_YAW, _reference("cam", "pos0")),
    "cam_mat0": Field(_YAW, _cam_mat0),
    "cam_poscom0": Field(_POSE, _reference("cam", "poscom0")),
    "light_pos0": Field(_YAW, _reference("light", "pos0")),
    "light_dir0": Field(_YAW, _light_dir0),
    "light_poscom0": Field(_POSE, _reference("light", "poscom0")),
}
"""Every field that the parameters decide. Derived ones stand below those that they are derived from."""
