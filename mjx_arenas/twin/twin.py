"""One world, or many, again in C MuJoCo: functions of an arena's record and of parameters (host)."""

from collections.abc import Sequence
from typing import Any

import jax
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.build import assemble, mjcf
from mjx_arenas.params.params import ArenaParams, canonical, on_host
from mjx_arenas.problem import Told, problem
from mjx_arenas.record.record import Record
from mjx_arenas.rules import validation, validation_worlds
from mjx_arenas.sample import tops
from mjx_arenas.sim import devices, programs, starts
from mjx_arenas.sim.batch import take
from mjx_arenas.spec import specs
from mjx_arenas.twin import cpu


def world_spec(record: Record, params: ArenaParams, checked: bool = True) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    """The spec and the model of one world, without what is absent; not checked, of any that MuJoCo compiles."""
    validation.raise_all(validation.shape_problems(params, record.labels), "`params`")
    params = on_host(params)
    if checked:
        validation.raise_all(validation_worlds.refusals(params, record.rules), "`params`")
    spec = record.spec.copy()
    assemble.set_params(spec, record.parts, params)
    assemble.place_in_keyframes(spec, record.parts, params, record.layout.object_qpos)
    record.parts.presence.edit(spec, params)
    return spec, specs.compiled(spec, "params")


def to_xml(record: Record, params: ArenaParams) -> str:
    """MJCF of one world, without what is absent."""
    return mjcf.proven(*world_spec(record, params), "params")


def c_world(
    record: Record,
    params: ArenaParams,
    data: mjx.Data | mujoco.MjData | None = None,
    key: jax.Array | None = None,
    keyframe: str | None = None,
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """One world and its state, after `mj_forward`; see `Arena.c_world`."""
    if data is not None and key is not None:
        raise validation.error([problem("key", "key_with_data", None, Told("a key"))])
    if data is not None and keyframe is not None:
        raise validation.error([problem("keyframe", "keyframe_with_data", None, keyframe)])
    starts.check_keyframe(record.mj_model, keyframe)
    model = world_spec(record, params)[1]
    starts.warn_of_idle(record, keyframe, params.terms)
    c = starts.c_data(model, keyframe)
    starts.vary_c(record, on_host(params), c)
    objects = tops.present(on_host(params), record.parts.places.ground)[1]
    if data is not None:
        cpu.set_state(c, data, record.layout, record.layout.presence.there(on_host(params)))
        return model, c
    if key is not None and objects.any():
        validation.raise_all(validation.one_key_problems("key", key), "`key`")
        placed = np.asarray(programs.place(record, canonical(params), key, 0.0).qpos)
        for k in np.flatnonzero(objects):
            c.joint(record.parts.objects[k].joint).qpos = placed[k]
    mujoco.mj_forward(model, c)
    return model, c


def worlds(
    record: Record, params: ArenaParams, data: mjx.Data | Sequence[mujoco.MjData] | None
) -> list[tuple[ArenaParams, mjx.Data | mujoco.MjData | None]]:
    """Parameters and data of each of many worlds, all of which can be."""
    validation.raise_all(validation.batch_shape_problems(params, record.labels), "`params`")
    n_worlds, each = len(params.table_rots), on_host(params)
    found = [p for i in range(n_worlds) for p in validation_worlds.refusals(take(each, i), record.rules, i)]
    validation.raise_all(found, "`params`")
    if isinstance(data, Sequence):
        if len(data) != n_worlds:
            raise validation.error([problem("data", "worlds_of", n=n_worlds, whose="`params`", of=len(data))])
        return [(take(params, i), one) for i, one in enumerate(data)]
    if data is not None and data.qpos.shape[:-1] != (n_worlds,):
        of = f"`qpos` of shape {data.qpos.shape}"
        raise validation.error([problem("data", "worlds_of", n=n_worlds, whose="`params`", of=of)])
    return [(take(params, i), None if data is None else take(data, i)) for i in range(n_worlds)]


def c_batch(record: Record, params: ArenaParams, nthread: int, keys: jax.Array | None) -> Any:
    """`mujoco.batch.Batch` of many worlds; see `Arena.c_batch`."""
    validation.raise_all(validation.batch_shape_problems(params, record.labels), "`params`")
    nthread = validation.whole("nthread", nthread, 0)
    params, keys = devices.gather((canonical(params), keys))
    if keys is not None:
        validation.raise_all(validation.key_problems("keys", keys, len(params.table_rots)), "`keys`")
    values, start, valid = cpu.write_c(record, params, keys)
    bad = np.flatnonzero(~np.asarray(valid))
    if len(bad):
        world = on_host(take(params, int(bad[0])))
        validation.raise_all(validation_worlds.refusals_of(world, record.rules, int(bad[0])), "`params`")
    return cpu.c_batch(record, values, start, nthread)
