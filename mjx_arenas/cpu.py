"""The same worlds on CPU threads: C MuJoCo's own batch, `mujoco.batch` (MuJoCo 4)."""

import copy
from typing import TYPE_CHECKING, Any

import jax
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.params import ArenaParams

if TYPE_CHECKING:
    from mjx_arenas.arena import Arena


def c_batch(arena: "Arena", params: ArenaParams, nthread: int, keys: jax.Array | None) -> Any:
    """See `Arena.c_batch`."""
    try:
        from mujoco import batch as mj_batch
    except ImportError:
        raise ImportError(
            f"c_batch needs mujoco >= 4.0 (pip install -U mujoco); this is {mujoco.__version__}."
        ) from None
    model = _without_collisions(arena.mj_model)
    values = jax.jit(jax.vmap(lambda p: arena.fields(model, p)))(params)
    n_worlds = params.table_rots.shape[0]
    batch = mj_batch.Batch(arena.mj_model, n_worlds, nthread=nthread)
    for name, value in values.items():
        if name in mj_batch.MODEL_FIELDS:
            expanded = batch.expand(name)
            expanded[...] = np.asarray(value, expanded.dtype).reshape(expanded.shape)
    batch.set_const()  # what else C MuJoCo derives: the bounding volumes of bodies
    qpos = np.array(
        values["qpos0"] if "qpos0" in values else np.broadcast_to(arena.mj_model.qpos0, (n_worlds, arena.mj_model.nq))
    )
    if keys is not None and arena.objects:
        placed = jax.jit(jax.vmap(arena.place))(params, keys).qpos
        qpos[:, arena.layout.object_qpos] = np.asarray(placed)
    batch.qpos = qpos
    return batch


def _without_collisions(mj_model: mujoco.MjModel) -> mjx.Model:
    """A model to write fields into, also where MJX on JAX has no collision function for a pair of geoms."""
    blind = copy.copy(mj_model)
    blind.geom_contype[:] = blind.geom_conaffinity[:] = 0
    return mjx.put_model(blind, impl="jax")
