"""Where worlds start: `mjx.Data` of one world of an arena's record (device, pure)."""

import jax
import numpy as np
from mujoco import mjx

from mjx_arenas import data as data_
from mjx_arenas import programs, validation
from mjx_arenas.params import ArenaParams
from mjx_arenas.record import Record
from mjx_arenas.write.rows import replace_rows


def one_world(
    record: Record,
    model: mjx.Model,
    params: ArenaParams,
    key: jax.Array | None,
    n_worlds: int | None,
    keyframe: str | None,
    max_contacts: int | None,
) -> mjx.Data:
    """`mjx.Data` of one world at rest; see `Arena.make_data`."""
    if record.mj_model.nv == 0:
        raise ValueError(
            "MJX cannot step a model without a degree of freedom: give the arena `objects=`, or add a joint to `arena.spec`."
        )
    if key is not None:
        validation.raise_all(validation.one_key_problems("key", key), "`key`")
    if n_worlds is not None:
        n_worlds = validation.whole("n_worlds", n_worlds, 1, must="None or a whole number >= 1")
    elif model.impl == data_.Impl.WARP:
        n_worlds, model, params, key = data_.world_count(model, params, key)
    data = data_.empty_data(record.mj_model, model.impl, n_worlds or 1, record.room(max_contacts))
    qpos = model.qpos0
    if keyframe is not None:
        values = data_.keyframe(record.mj_model, keyframe)
        free = np.setdiff1d(np.arange(record.mj_model.nq), record.layout.object_qpos)
        qpos = replace_rows(qpos, free, values.pop("qpos")[free])
        data = data.replace(**values)
    return data_.place_static(model, data.replace(qpos=programs.qpos(record, qpos, params, key)))
