"""What is wrong with the worlds and states that a renderer is given (host, at trace time)."""

from typing import Any

import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import Told, problem
from mjx_arenas.record.record import Record
from mjx_arenas.rules import validation
from mjx_arenas.sim import devices
from mjx_arenas.sim.batch import ArenaBatch, check_impl, check_types


def check_batch(record: Record, batch: ArenaBatch, data: mjx.Data) -> None:
    """Refuses worlds of another arena, and states of other worlds."""
    check_types(batch, data)
    if devices.spread_of(batch.params.table_rots) is not None:
        raise validation.error([problem("batch", "one_device")])
    if batch.record != record:
        raise validation.error([problem("batch", "batch_of_renderer")])
    n = len(data.qpos) if data.qpos.ndim == 2 else 1
    if data.qpos.ndim != 2 or n != batch.n_worlds:
        got = f"{n} worlds" if data.qpos.ndim == 2 else "one world"
        raise validation.error([problem("data", "worlds_of", n=batch.n_worlds, whose="the batch", of=got)])
    _check_state(record.mj_model, batch.model, data, (n,))


def check_world(record: Record, nominal: mjx.Model, model: mjx.Model, params: ArenaParams, data: mjx.Data) -> None:
    """Refuses what is not of one world of the arena, whose `nominal` model is on Warp."""
    given = {"model": (model, mjx.Model), "params": (params, ArenaParams), "data": (data, mjx.Data)}
    if not all(isinstance(value, kind) for value, kind in given.values()):
        got = ", ".join(type(value).__name__ for value, _ in given.values())
        raise validation.error([problem("model", "world_of_renderer", None, Told(got))], kind=TypeError)
    batched = _batched(model, nominal)
    if batched:
        told = {"of": f"one whose `{batched}` is of many", "instead": "use jax.vmap with in_axes=(batch.in_axes, 0, 0)"}
        raise validation.error([problem("model", "one_world", None, None, told)])
    validation.raise_all(validation.model_problems(model, record.mj_model), "`model`")
    validation.raise_all(validation.shape_problems(params, record.labels), "`params`")
    if data.qpos.ndim == 2:
        told = {"of": f"`qpos` of shape {data.qpos.shape}", "instead": "take one, mja.take(data, i), or use jax.vmap"}
        raise validation.error([problem("data", "one_world", None, None, told)])
    _check_state(record.mj_model, model, data, ())


def _batched(model: mjx.Model, nominal: mjx.Model) -> str | None:
    """The first field of a model that has more axes than that of one world."""
    names = (field.name for field in nominal.fields())
    return next((name for name in names if _rank(getattr(model, name)) > _rank(getattr(nominal, name))), None)


def _rank(value: Any) -> int:
    return getattr(value, "ndim", 0)


def _check_state(compiled: mujoco.MjModel, model: mjx.Model, data: mjx.Data, worlds: tuple[int, ...]) -> None:
    """Refuses states of another implementation or arena; `worlds` is (W,), or () of one."""
    check_impl(model, data)
    vectors = {"xpos": compiled.nbody, "geom_xpos": compiled.ngeom, "mocap_pos": compiled.nmocap}
    for name, shape in {"qpos": (compiled.nq,), **{name: (n, 3) for name, n in vectors.items()}}.items():
        got, want = np.shape(getattr(data, name)), (*worlds, *shape)
        if got != want:
            raise validation.error([problem(f"data.{name}", "shape", want=want, shape=got)])
