"""The same worlds on CPU threads: C MuJoCo's own batch, `mujoco.batch` (MuJoCo 4)."""

import copy
from collections.abc import Mapping
from typing import Any

import jax
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import mesh


def c_batch(mj_model: mujoco.MjModel, fields: Mapping[str, jax.Array], qpos: jax.Array, nthread: int) -> Any:
    """`mujoco.batch.Batch` of W simulations.

    Args:
        mj_model: of the nominal arena.
        fields: (W, ...) what differs, by the names of `mjx.Model`.
        qpos: (W, nq) where the simulations start.
        nthread: number of threads; 0: all cores.
    """
    try:
        from mujoco import batch as mj_batch
    except ImportError:
        needs = "c_batch needs mujoco >= 4.0 (pip install -U mujoco)"
        raise ImportError(f"{needs}; this is {mujoco.__version__}.") from None
    batch = mj_batch.Batch(mj_model, len(qpos), nthread=nthread)
    for name in fields.keys() & mj_batch.MODEL_FIELDS:  # statistics are shared by all simulations
        expanded = batch.expand(name)
        expanded[...] = np.asarray(fields[name], expanded.dtype).reshape(expanded.shape)
    batch.set_const()  # what else C MuJoCo derives: the bounding volumes of bodies
    batch.qpos = np.asarray(qpos)
    return batch


def blind_model(mj_model: mujoco.MjModel) -> mjx.Model:
    """A model to write fields into, also where MJX on JAX has no collision function for a pair of geoms."""
    blind = copy.copy(mj_model)
    blind.geom_contype[:] = blind.geom_conaffinity[:] = 0
    return mjx.put_model(blind, impl="jax", device=mesh.own_device())
