"""What worlds start with: all that is state, as MuJoCo's reset leaves it or as a keyframe of a robot has it."""

from collections.abc import Collection, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import ArenaParams, canonical
from mjx_arenas.problem import problem
from mjx_arenas.problems import messages
from mjx_arenas.quaternions import normalize, quat_mul
from mjx_arenas.record.record import Record
from mjx_arenas.rows import replace_rows
from mjx_arenas.rules import validation
from mjx_arenas.sim import data as data_
from mjx_arenas.sim import programs
from mjx_arenas.terms.term import Row

# All of MuJoCo's state (mjSTATE_INTEGRATION) but `qpos`, by the names of mjx.Data: what a step reads before it writes it.
_STATE = ("time", "qvel", "act", "history", "qacc_warmstart", "plugin_state", "ctrl", "qfrc_applied", "xfrc_applied")
_STATE += ("eq_active", "mocap_pos", "mocap_quat", "userdata")


def check_keyframe(mj_model: mujoco.MjModel, keyframe: str | None) -> None:
    """Refuses the name of a keyframe that a model has not."""
    if keyframe is not None:
        data_.keyframe(mj_model, keyframe)


def c_data(model: mujoco.MjModel, keyframe: str | None) -> mujoco.MjData:
    """Data of C MuJoCo at the start; positions are not computed yet."""
    c = mujoco.MjData(model)
    if keyframe is not None:
        mujoco.mj_resetDataKeyframe(model, c, model.key(keyframe).id)
    return c


def _places_in(record: Record, keyframe: str | None) -> dict[str, bool]:
    """Whether a keyframe itself says where free bodies (`qpos`) and mocap bodies (`mpos`) are, and how these are turned (`mquat`)."""
    given = record.given
    return {"qpos": keyframe in given.placed, "mpos": keyframe in given.led, "mquat": keyframe in given.turned}


def warn_of_idle(record: Record, keyframe: str | None, varying: Mapping[str, Any]) -> None:
    """Warns of quantities that place bodies which a keyframe puts in the same place in all worlds, as MuJoCo's does.

    Args:
        record: of the arena.
        keyframe: its name, or None.
        varying: the worlds' parameters by the terms' names (..., N, 3), or None where all elements vary. Of what is traced no
            number is known.
    """
    own, model = _places_in(record, keyframe), record.mj_model
    for term in record.parts.varied if any(own.values()) else ():
        values = varying.get(term.name, term.nominal)
        if term.attribute not in ("body.pos", "body.rpy") or isinstance(values, jax.core.Tracer):
            continue
        of_mocap = "mpos" if term.attribute == "body.pos" else "mquat"
        for n, name in enumerate(term.elements):
            body = model.body(name)
            moves = values is None or _differs(np.asarray(values)[..., n, :], term.nominal[n])
            free = body.jntnum[0] == 1 and model.jnt_type[body.jntadr[0]] == mujoco.mjtJoint.mjJNT_FREE
            field = of_mocap if model.body_mocapid[body.id] >= 0 else "qpos"
            if moves and (free or field != "qpos") and own[field]:
                what = {"field": field, "body": name, "name": term.name, "attribute": term.attribute}
                messages.warn(problem("keyframe", "idle_in_keyframe", None, keyframe, what))
                break


def warn_of_left(record: Record, varying: Collection[str]) -> None:
    """Warns of quantities of start states, of which models alone have nothing.

    Args:
        record: of the arena.
        varying: names of the quantities that differ between worlds.
    """
    rows = (row for term in record.scene.starting for row in term.rows(record.drawing.params))
    rows = (row for row in rows if row.field.startswith("data."))
    if left := sorted(set().union(*(row.depends for row in rows)) & set(varying)):
        messages.warn(problem("ranges.terms", "starts_left", None, None, {"left": ", ".join(map(repr, left))}))


def _differs(values: np.ndarray, nominal: np.ndarray) -> bool:
    return bool((values != nominal.astype(values.dtype)).any())


def mocap(model: mjx.Model) -> dict[str, jax.Array]:
    """`mocap_pos` and `mocap_quat` of `mjx.Data`, where the bodies stand in `model`, one world; nothing where there are none."""
    ids = np.asarray(model.body_mocapid)
    bodies = np.flatnonzero(ids >= 0)
    bodies = bodies[np.argsort(ids[bodies])]
    if not len(bodies):
        return {}
    quat = model.body_quat[bodies]
    return {"mocap_pos": model.body_pos[bodies], "mocap_quat": normalize(quat)}


def _led(record: Record, model: mjx.Model, keyframe: str | None) -> dict[str, jax.Array]:
    """The same, without what a keyframe itself says."""
    own = _places_in(record, keyframe)
    return {name: value for name, value in mocap(model).items() if not own[name.replace("mocap_", "m")]}


def qpos(record: Record, qpos0: jax.Array, keyframe: str | None) -> jax.Array:
    """(nq,) `qpos0` of a world, with all but the objects' rows as a keyframe has them, if it has any."""
    if keyframe not in record.given.placed:
        return qpos0
    model = record.mj_model
    free = np.setdiff1d(np.arange(model.nq), record.layout.object_qpos)
    return replace_rows(qpos0, free, jnp.asarray(model.key(keyframe).qpos[free]))


def varied(record: Record, params: ArenaParams, state: Mapping[str, Array]) -> dict[str, Array]:
    """A state, by names of `mjx.Data`, with what terms vary in it: added to positions and velocities, and else in their place."""
    found = dict(state)
    for row in (row for term in record.scene.starting for row in term.rows(params)):
        name = row.field.removeprefix("data.")
        into = "qpos" if name == "turn" else name
        if into in found:
            found[into] = _started(found[into], name, row)
    return found


def _started(start: Array, name: str, row: Row) -> Array:
    """Part of a state as one row of a term has it; NumPy or JAX."""
    at = row.elements.reshape(-1)
    old, new = start[at], row.values.reshape(-1)[row.source.reshape(-1)].astype(start.dtype)
    if name == "turn":
        new = quat_mul(old.reshape(-1, 4), new.reshape(-1, 4)).reshape(-1)
    elif name != "eq_active":
        new = old + new
    if array_module(start, new) is jnp:
        return replace_rows(jnp.asarray(start), at, jnp.asarray(new))
    found = start.copy()
    found[at] = new
    return found


def vary_c(record: Record, params: ArenaParams, c: mujoco.MjData) -> None:
    """The same for C data of the arena's model, or of the one compiled for a world, which has the equalities already.

    Args:
        record: of the arena.
        params: of the world, on the host.
        c: at the start of the world.
    """
    model = record.mj_model
    whole = (c.model.nq, c.model.nv) == (model.nq, model.nv)
    rows = {} if whole else record.layout.state_rows(record.layout.presence.there(params))
    state = {"qpos": np.zeros(model.nq), "qvel": np.zeros(model.nv)}
    for name, full in state.items():
        full[rows.get(name, slice(None))] = getattr(c, name)
    for name, full in varied(record, params, state).items():
        getattr(c, name)[...] = full[rows.get(name, slice(None))]


def again(record: Record, data: mjx.Data, model: mjx.Model, keyframe: str | None) -> dict[str, Any]:
    """State with which the world of `data` starts an episode, by name: all but `qpos`. The time is 0; jit, vmap.

    Args:
        record: of the arena.
        data: of the world, in any state.
        model: of the world.
        keyframe: its name, or None.
    """
    c = c_data(record.mj_model, keyframe)
    c.time = 0.0
    here: dict[str, Any] = _led(record, model, keyframe)
    start = {}
    for name in _STATE:
        old = getattr(data, name)
        start[name] = jnp.asarray(here.get(name, getattr(c, name)), old.dtype).reshape(old.shape)
    return start


def one_world(
    record: Record,
    model: mjx.Model,
    params: ArenaParams,
    key: jax.Array | None,
    n_worlds: int | None,
    keyframe: str | None,
    max_contacts: int | None,
) -> mjx.Data:
    """`mjx.Data` of one world at rest; see `Arena.make_world_data`."""
    if record.mj_model.nv == 0:
        raise messages.error([problem("objects", "no_freedom")])
    if key is not None:
        validation.raise_all(validation.one_key_problems("key", key), "`key`")
    if n_worlds is not None:
        n_worlds = validation.whole("n_worlds", n_worlds, 1, must="None or a whole number >= 1")
    elif model.impl == data_.Impl.WARP:
        n_worlds, model, params, key = data_.world_count(model, params, key)
    data = data_.empty_data(record.mj_model, model.impl, n_worlds or 1, record.room(max_contacts))
    if keyframe is not None:
        values = data_.keyframe(record.mj_model, keyframe)
        data = data.replace(**{name: value for name, value in values.items() if name != "qpos"})
    data = data.replace(**_led(record, model, keyframe))
    start = qpos(record, model.qpos0, keyframe)
    state = {"qpos": programs.qpos(record, start, params, key), "qvel": data.qvel, "eq_active": data.eq_active}
    return data_.place_static(model, data.replace(**varied(record, canonical(params), state)))
