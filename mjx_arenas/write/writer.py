"""The writer: from the rows that terms push to the fields of one world, for MJX on JAX, MJX on Warp and C MuJoCo.

It knows no tables and no objects: terms decide elements, absence takes things away, and the rest follows (`write.follows`).
"""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx
from mujoco.mjx._src.types import Impl

from mjx_arenas.named import NOT_IN_MODEL, ON_WARP, WEIGHT
from mjx_arenas.named import field as field_of
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.primitives import around
from mjx_arenas.solids import inertials
from mjx_arenas.terms.presence import Absent
from mjx_arenas.terms.term import Boxes, Depends
from mjx_arenas.write import follows
from mjx_arenas.write.palette import Palette
from mjx_arenas.write.scene import INERTIAL, Scene


def field_names(scene: Scene, varying: Depends) -> tuple[str, ...]:
    """Names of the fields that `write` gives."""
    touched = scene.touched(varying)
    if varying not in scene.names:
        names = [
            *(name for name in touched.masks if name not in NOT_IN_MODEL),
            *(rule.field for rule in follows.RULES if rule.differs(scene, touched)),
        ]
        scene.names[varying] = tuple(name for name in dict.fromkeys(names) if name not in scene.given.pinned)
    return scene.names[varying]


def write(scene: Scene, model: mjx.Model, params: ArenaParams, varying: Depends) -> dict[str, jax.Array]:
    """The fields of `model`, by MuJoCo's names, that follow from the quantities `varying`, for the numbers of one world.

    Args:
        scene: of the arena.
        model: nominal in what does not vary.
        params: of the world, canonical.
        varying: names of quantities.
    """
    names, palette = field_names(scene, varying), Palette()
    there = jnp.append(jnp.asarray(scene.presence.there(params)), True)  # (G + S + 1,), and what is always there
    source: dict[str, np.ndarray] = {}
    for term in scene.terms:
        for row in term.rows(params):
            if row.depends & varying:
                flat = source.setdefault(row.field, np.full(field_of(scene.model, row.field).size, -1))
                flat[row.elements] = palette.place(row.values) + row.source
    if "geom_size" in source:
        source |= _bounds(scene.model, palette, source["geom_size"].reshape(-1, 3))
    _weigh(scene, palette, source)
    palette = palette.mixed()
    written: dict[str, jax.Array] = {}
    absences = scene.absent if scene.presence.quantities & varying or not scene.all_there else {}
    for name in (name for name in names if name in scene.touched(varying).masks):
        field = _base(scene, model, name)
        flat = source.get(name, np.full(field.size, -1)).reshape(field.shape)
        if name in absences:
            base = _nominal(field, getattr(scene.model, name), absences[name])
            written[name] = _without(palette.take(flat, base), absences[name], there)
        else:
            written[name] = palette.take(flat, field)
    return follows.complete(scene, model, written, names, there, Boxes.of(scene.terms, params), varying)


def _base(scene: Scene, model: mjx.Model, name: str) -> jax.Array:
    """A field as the template has it; where MJX on JAX has none, as it is compiled."""
    there = name not in ON_WARP or model.impl == Impl.WARP
    return jnp.asarray(field_of(model if there else scene.model, name))


def _nominal(field: jax.Array, nominal: np.ndarray, rows: Absent) -> jax.Array:
    """A field, nominal in the elements that absence changes: they may be absent in the template."""
    here = np.zeros(nominal.size, bool)
    here[rows.elements] = True
    return jnp.where(here.reshape(field.shape), jnp.asarray(nominal.reshape(field.shape), field.dtype), field)


def _without(field: jax.Array, rows: Absent, there: jax.Array) -> jax.Array:
    """A field, in which the elements of what is absent are those of something absent."""
    scale, shift = np.ones(field.size), np.zeros(field.size)
    scale[rows.elements], shift[rows.elements] = rows.scale, rows.shift
    kept: jax.Array | None = None
    for column in rows.groups.T:
        group = np.full(field.size, -1)
        group[rows.elements] = column
        is_there = there.at[np.where(group < 0, there.shape[0] - 1, group)].get(mode="promise_in_bounds")
        kept = is_there if kept is None else kept & is_there
    assert kept is not None
    scale, shift = (jnp.asarray(x.reshape(field.shape), field.dtype) for x in (scale, shift))
    return jnp.where(kept.reshape(field.shape), field, field * scale + shift)


def _weigh(scene: Scene, palette: Palette, source: dict[str, np.ndarray]) -> None:
    """Adds the sources of inertials that follow from geoms whose sizes or poses have sources."""
    given, model = scene.given.solids, scene.model
    fields = ("geom_size", "geom_pos", "geom_quat", WEIGHT)
    if not len(given.geom) or source.keys().isdisjoint(fields):
        return

    def of_geoms(name: str) -> jax.Array:
        base = field_of(model, name)
        flat = source.get(name, np.full(base.size, -1)).reshape(base.shape)
        return palette.take(flat[given.geom], jnp.asarray(base[given.geom], jnp.result_type(float)))

    found = inertials(given, model, *(of_geoms(name) for name in fields))
    for name, values in zip(INERTIAL, found, strict=True):
        field = getattr(model, name)
        flat = source.setdefault(name, np.full(field.size, -1)).reshape(field.shape)
        flat[given.bodies] = palette.place(values) + np.arange(values.size).reshape(values.shape)


def _bounds(model: mujoco.MjModel, palette: Palette, size: np.ndarray) -> dict[str, np.ndarray]:
    """Sources of the boxes and spheres around geoms whose sizes have sources (ngeom, 3), once for each shape."""
    kinds, ids = model.geom_type, np.flatnonzero((size >= 0).any(-1))
    given = np.where(size[ids] >= 0, 0.0, model.geom_size[ids])  # what has no source counts by its number
    key = np.column_stack([kinds[ids], size[ids], given])
    _, first, shape = np.unique(key, axis=0, return_index=True, return_inverse=True)
    one = ids[first]
    sizes = palette.take(size[one], jnp.asarray(model.geom_size[one], jnp.result_type(float)))
    rbound, aabb = np.full(model.ngeom, -1), np.full((model.ngeom, 6), -1)
    half, radius = around(kinds[one], sizes)  # (U, 3), (U,)
    aabb[ids, 3:] = palette.place(half) + np.arange(half.size).reshape(half.shape)[shape.reshape(-1)]
    rbound[ids] = palette.place(radius) + shape.reshape(-1)
    return {"geom_rbound": rbound, "geom_aabb": aabb.reshape(-1)}
