"""The same worlds in C MuJoCo: one alone, or many on CPU threads in C's own batch, `mujoco.batch`."""

import contextlib
import copy
import functools
from collections.abc import Iterator, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import batch as mj_batch
from mujoco import mjx

from mjx_arenas.params.params import ArenaParams, canonical
from mjx_arenas.problem import problem
from mjx_arenas.record.layout import Layout
from mjx_arenas.record.record import Record
from mjx_arenas.rules import validation, validation_worlds
from mjx_arenas.sim import data as data_
from mjx_arenas.sim import devices, programs, starts

# The state of a world, as `mjx.Data` and `MjData` name it; the rows of some go with what is there.
_WHOLE = ("time", "mocap_pos", "mocap_quat", "userdata")
STATE = ("time", "qpos", "qvel", "act", "ctrl", "qacc_warmstart", "mocap_pos", "mocap_quat")
"""What a world can start from again, as long as no forces are applied."""


def set_state(c: mujoco.MjData, data: mjx.Data | mujoco.MjData, layout: Layout, there: np.ndarray) -> None:
    """Gives the C data of one world a state, and all positions, velocities and forces that follow from it.

    Args:
        c: of the model that was compiled for the world, without what is absent.
        data: of the world, `mjx.Data` or `MjData`; or `MjData` of the compiled model itself.
        layout: of the arena.
        there: (T + K + E,) bool, the tables, objects and others that are.
    """
    validation.check_type("data", data, (mjx.Data, mujoco.MjData), "an mjx.Data, a mujoco.MjData or None")
    if data.qpos.ndim != 1:
        told = {"of": f"{len(data.qpos)} worlds", "instead": "mjx_arenas.take(data, i) is world i"}
        raise validation.error([problem("data", "one_world", None, None, told)])
    n_bodies = data.model.nbody if isinstance(data, mujoco.MjData) else layout.model.nbody
    full = (n_bodies, len(data.qpos)) == (layout.model.nbody, layout.model.nq)
    if not full and len(data.qpos) != len(c.qpos):
        without = "" if there.all() else f", or {len(c.qpos)} without what is absent"
        raise validation.error(
            [
                problem(
                    "data",
                    "must",
                    None,
                    len(data.qpos),
                    must=f"of this world, with {layout.model.nq} positions{without}",
                )
            ]
        )
    for name, rows in layout.state_rows(there).items():
        value = np.asarray(getattr(data, name))
        getattr(c, name)[...] = value[rows] if full else value
    for name in _WHOLE:
        setattr(c, name, np.asarray(getattr(data, name)))
    mujoco.mj_forward(c.model, c)


@contextlib.contextmanager
def silent() -> Iterator[None]:
    """MuJoCo's warnings are counted, not written to a log file."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def c_batch(record: Record, fields: Mapping[str, jax.Array], start: Mapping[str, jax.Array], nthread: int) -> Any:
    """`mujoco.batch.Batch` of W simulations.

    Args:
        record: of the arena.
        fields: (W, ...) what differs, by the names of `mjx.Model`.
        start: (W, ...) the state in which the simulations start.
        nthread: number of threads; 0: all cores.
    """
    mj_model, objects = record.mj_model, record.layout.object_qpos
    data_.check_awake(mj_model)
    batch = mj_batch.Batch(mj_model, len(start["qpos"]), nthread=nthread)
    for name in fields.keys() & mj_batch.MODEL_FIELDS:  # statistics are shared by all simulations
        expanded = batch.expand(name)
        expanded[...] = np.asarray(fields[name], expanded.dtype).reshape(expanded.shape)
    if (
        mj_model.nkey and "qpos0" in fields
    ):  # as in compiled worlds: objects on their tables, and what a keyframe leaves out
        keys = batch.expand("key_qpos")
        for k in range(mj_model.nkey):
            own = objects.reshape(-1) if mj_model.key(k).name in record.given.placed else slice(None)
            keys[:, k, own] = np.asarray(fields["qpos0"])[:, own]
    mocap = np.flatnonzero(mj_model.body_mocapid >= 0)  # in the order of their poses
    for name, field, own in (
        ("key_mpos", "body_pos", record.given.led),
        ("key_mquat", "body_quat", record.given.turned),
    ):
        if mj_model.nkey and len(mocap) and field in fields:
            keys, values = batch.expand(name), np.asarray(fields[field])[:, mocap]
            for k in (k for k in range(mj_model.nkey) if mj_model.key(k).name not in own):
                keys[:, k] = values.reshape(keys[:, k].shape)
    batch.set_const()  # what else C MuJoCo derives: the bounding volumes of bodies
    for name, value in start.items():
        setattr(batch, name, np.asarray(value))
    return batch


class _AsAccepted:
    """A compiled model as MJX on JAX takes it, without what only C simulates; of all else the model itself."""

    def __init__(self, mj_model: mujoco.MjModel) -> None:
        opt = copy.copy(mj_model.opt)
        opt.integrator, opt.solver = mujoco.mjtIntegrator.mjINT_EULER, mujoco.mjtSolver.mjSOL_NEWTON
        opt.enableflags = 0
        self._model, self.opt = mj_model, opt
        self.changed = dict.fromkeys(("nflex", "npair"), 0) | {n: getattr(mj_model, n) * 0 for n in _KINDS}

    def __getattr__(self, name: str) -> Any:
        return self.changed[name] if name in self.changed else getattr(self._model, name)


# Kinds of elements, of which each implementation simulates some; 0 is one of these.
_KINDS = (
    *("geom_contype", "geom_conaffinity", "eq_type", "sensor_type"),
    *("actuator_biastype", "actuator_dyntype", "actuator_gaintype", "actuator_trntype"),
)


def blind_model(mj_model: mujoco.MjModel) -> mjx.Model:
    """A model to write fields into, not to step, also where MJX on JAX does not simulate what is in it."""
    accepted = _AsAccepted(mj_model)
    model = mjx.put_model(accepted, impl="jax", device=devices.own_device())  # type: ignore[arg-type]
    # Flexes count in statistics alone, which simulations share.
    true = {name: copy.copy(getattr(mj_model, name)) for name in accepted.changed if name != "nflex"}
    return model.replace(**true)


@functools.partial(jax.jit, static_argnums=0)
def write_c(
    record: Record, params: ArenaParams, keys: jax.Array | None
) -> tuple[dict[str, jax.Array], dict[str, jax.Array], jax.Array]:
    """The fields for C MuJoCo of worlds (W, ...), the state at the start, and whether these worlds can be."""
    model = blind_model(record.mj_model)

    def one(params: ArenaParams, key: jax.Array | None) -> tuple[dict[str, jax.Array], dict[str, jax.Array], jax.Array]:
        values = programs.named(record, model, params, record.everything)
        state = {"qpos": programs.qpos(record, values.get("qpos0", model.qpos0), params, key)}
        if record.scene.starting:
            active = jnp.asarray(record.mj_model.eq_active0, bool)
            state |= {"qvel": jnp.zeros(record.mj_model.nv), "eq_active": active}
        return values, starts.varied(record, canonical(params), state), validation_worlds.possible(params, record.rules)

    return jax.vmap(one)(params, keys)
