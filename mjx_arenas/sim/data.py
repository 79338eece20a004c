"""The states of models: `mjx.Data` of one world, stepping a batch, and what may go wrong there."""

import copy
import importlib.util
import logging
import re
from collections.abc import Callable, Iterable
from typing import Any

import jax
import jax.extend
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx
from mujoco.mjx._src import collision_driver
from mujoco.mjx._src.types import Impl

from mjx_arenas import strict
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import problem
from mjx_arenas.quaternions import quat_mul, quat_rotate, quat_to_mat
from mjx_arenas.record.room import Room, max_rows, most_contacts
from mjx_arenas.rows import replace_rows, take
from mjx_arenas.rules import validation
from mjx_arenas.sim import devices, left_out, streams
from mjx_arenas.spec import names, specs
from mjx_arenas.write.kinematics import static_poses

_log = logging.getLogger("mjx_arenas")


def blank(mj_model: mujoco.MjModel) -> mjx.Data:
    """Data of one world without room for contacts, to hold what was computed elsewhere: of any model, also where only Warp collides it."""
    bare = copy.copy(mj_model)
    bare.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    return mjx.make_data(bare, impl="jax")


def put_model(mj_model: mujoco.MjModel, impl: str | None, varied: Iterable[tuple[str, np.ndarray]] = ()) -> mjx.Model:
    """`mjx.put_model` with the best implementation if none is named. One sentence says what MJX cannot simulate.

    Args:
        mj_model: nominal.
        impl: "jax", "warp" or None.
        varied: fields with the places, in the flattened field, of the numbers that vary.
    """
    if impl is None:
        impl = _best_impl()
    if impl not in ("jax", "warp"):
        raise validation.error([problem("impl", "must", None, impl, must="'jax', 'warp' or None")])
    if impl == "warp" and not warp_installed():
        raise validation.error([problem("impl", "no_warp", None, impl)])
    varied = tuple(varied)
    check_simulated(mj_model, impl, varied)
    try:
        return _put(mj_model, impl)
    except NotImplementedError as error:
        told: dict[str, Any] = {"what": str(error).rstrip(".")}
        flag = re.search(r"mj(?:ENBL|DSBL)_(\w+)", told["what"])
        told["flag"] = f"leave `{flag[1].lower()}` out of the MJCF's <flag>, or " if flag else ""
        told["warp"] = "impl='warp' or " if impl == "jax" and _on_warp(mj_model, varied) else ""
        raise validation.error([problem("impl", "not_simulated", None, impl, told)]) from None


def _put(mj_model: mujoco.MjModel, impl: str) -> mjx.Model:
    """A model on the device of this process.

    Raises:
        NotImplementedError: MJX does not simulate it.
    """
    if impl == "warp":
        _quiet_warp()
        streams.keep_known()
    return mjx.put_model(mj_model, impl=impl, device=devices.own_device())


def _on_warp(mj_model: mujoco.MjModel, varied: Iterable[tuple[str, np.ndarray]]) -> bool:
    """Whether Warp simulates a model, as far as can be known here."""
    if not warp_installed():
        return True
    try:
        check_simulated(mj_model, "warp", varied)
        _put(mj_model, "warp")
    except (NotImplementedError, ValueError, AssertionError):  # the last where it has no device for Warp
        return False
    return True


def check_simulated(mj_model: mujoco.MjModel, impl: str, varied: Iterable[tuple[str, np.ndarray]]) -> None:
    """Refuses what an implementation of MJX takes without a word, and simulates otherwise than MuJoCo; arguments as of `put_model`.

    Raises:
        ValueError: one sentence about the first that was found.
    """
    check_awake(mj_model)
    if impl == "jax":
        _check_pairs(mj_model)
        _check_fields(mj_model)
    left_out.check(mj_model, impl, varied)


def check_awake(mj_model: mujoco.MjModel) -> None:
    """Refuses sleeping, whose simulation is wrong if worlds differ.

    Bodies fall asleep by `dof_length`, which MJX shares between worlds. MuJoCo's own batch keeps sleeping in an `MjData` of each world, in
    which static geoms stay where they were when it was made: where the template has them.
    """
    if mj_model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP:
        raise validation.error([problem("arena.mj_model.opt.enableflags", "sleeping")])


def _best_impl() -> str:
    if on_nvidia() and not warp_installed():
        _log.warning(
            "impl='jax': warp-lang is not installed; with it (pip install 'mjx_arenas[warp]') this GPU steps several times faster."
        )
        return "jax"
    impl = "warp" if on_nvidia() else "jax"
    _log.info("put_model: impl=%r on %s", impl, jax.devices()[0].device_kind)
    return impl


def on_nvidia() -> bool:
    """Whether there is an NVIDIA GPU that JAX uses."""
    return "cuda" in jax.extend.backend.backends()


def warp_installed() -> bool:
    """Whether MJX can use its Warp implementation."""
    return importlib.util.find_spec("warp") is not None


def _quiet_warp() -> None:
    """Keeps Warp from printing a line for each of its hundreds of kernels, unless somebody has chosen what it prints."""
    import warp

    if warp.config.log_level == warp.LOG_INFO:  # the default
        warp.config.log_level = warp.LOG_WARNING


def _check_pairs(mj_model: mujoco.MjModel) -> None:
    for a, b, _ in collision_driver.geom_pairs(mj_model):
        types = mj_model.geom_type[[a, b]]
        if not collision_driver.has_collision_fn(*types):
            both = " and ".join(
                f"{specs.geom_name(mj_model, g)} ({mujoco.mjtGeom(t).name[7:].lower()})"
                for g, t in zip((a, b), types, strict=True)
            )
            raise validation.error([problem("impl", "no_collision_function", None, "jax", both=both)])


def _check_fields(mj_model: mujoco.MjModel) -> None:
    """Refuses what MJX on JAX does not hold on height fields: of a box or a mesh it tests a part that is too small where it is turned."""
    for a, b, _ in collision_driver.geom_pairs(mj_model):
        kinds = [mujoco.mjtGeom(mj_model.geom_type[g]) for g in (a, b)]
        if kinds[0] == mujoco.mjtGeom.mjGEOM_HFIELD and kinds[1] in (
            mujoco.mjtGeom.mjGEOM_BOX,
            mujoco.mjtGeom.mjGEOM_MESH,
        ):
            field, geom = (names.element(mj_model, "geom", int(g)).removeprefix("geom ") for g in (a, b))
            raise validation.error(
                [problem("impl", "field_contacts", None, "jax", geom=geom, kind=kinds[1].name[7:].lower(), field=field)]
            )


def empty_data(mj_model: mujoco.MjModel, impl: Impl, n_worlds: int, room: Room) -> mjx.Data:
    """`mjx.make_data`, with `room` for contacts in each of `n_worlds` worlds on Warp; may be traced.

    Leaves that hold one number over and over are made on the device: as constants of a compiled function they could
    be gigabytes.
    """
    device = devices.own_device()
    with jax.ensure_compile_time_eval():
        if impl == Impl.JAX:
            data = mjx.make_data(mj_model, impl="jax", device=device)
        else:
            contacts, pairs = n_worlds * room.contacts, n_worlds * min(room.pairs, room.contacts)
            rows, full = max_rows(mj_model, room.contacts), _rubbing(mj_model)
            if (most := most_contacts(mj_model, n_worlds)) < room.contacts:
                must = f"at most {most:,}, as Warp's sizes for {n_worlds:,} worlds are int32"
                raise validation.error([problem("max_contacts", "must", None, room.contacts, must=must)])
            try:
                data = mjx.make_data(full, impl="warp", device=device, naconmax=contacts, naccdmax=pairs, njmax=rows)
            except (MemoryError, RuntimeError) as error:
                if not isinstance(error, MemoryError) and "Failed to allocate" not in str(error):
                    raise
                must = f"so small that data of {n_worlds:,} worlds fit into memory"
                raise validation.error([problem("max_contacts", "must", None, room.contacts, must=must)]) from None
    return jax.tree.map(_compact, data)


def _rubbing(mj_model: mujoco.MjModel) -> mujoco.MjModel:
    """The model with friction in all joints and tendons: Warp gives sparse Jacobians no room for rows that the template lacks."""
    if (mj_model.dof_frictionloss > 0).all() and (mj_model.tendon_frictionloss > 0).all():
        return mj_model
    rubbing = copy.copy(mj_model)
    rubbing.dof_frictionloss[:], rubbing.tendon_frictionloss[:] = 1.0, 1.0
    return rubbing


def keyframe(mj_model: mujoco.MjModel, name: str) -> dict[str, jax.Array]:
    """The fields of `mjx.Data` that a keyframe sets."""
    keys = [mj_model.key(k).name for k in range(mj_model.nkey)]
    if name not in keys:
        must = f"one of {', '.join(map(repr, keys))}" if keys else "None, as the arena has no keyframes"
        raise validation.error([problem("keyframe", "must", None, name, must=must)])
    key = mj_model.key(keys.index(name))
    values = {"time": key.time.item(), "qpos": key.qpos, "qvel": key.qvel, "act": key.act, "ctrl": key.ctrl}
    if mj_model.nmocap:
        values |= {"mocap_pos": key.mpos.reshape(-1, 3), "mocap_quat": key.mquat.reshape(-1, 4)}
    return {field: jnp.asarray(value, jnp.result_type(float)) for field, value in values.items()}


def _compact(leaf: Any) -> Any:
    array = np.asarray(leaf)
    if array.size > 1 and np.all(array == array.flat[0]):
        return jnp.full(array.shape, array.flat[0], array.dtype)
    return jnp.asarray(leaf)


def of_worlds(data: mjx.Data, rows: Callable[[jax.Array], jax.Array]) -> mjx.Data:
    """`data` with `rows` of each leaf (W, ...). What Warp keeps for all worlds together stays as it is."""
    if data.impl != Impl.WARP:
        return jax.tree.map(rows, data)
    from mujoco.mjx.warp import types

    def one(path: Any, leaf: jax.Array) -> jax.Array:
        parts = [key.name for key in path]
        per_world = parts[0] != "_impl" or types._BATCH_DIM["Data"]["__".join(parts[1:])]
        return rows(leaf) if per_world else leaf

    return jax.tree_util.tree_map_with_path(one, data)


def static_geoms(model: mjx.Model) -> np.ndarray:
    """Ids of the geoms that are fixed to the world, which Warp places once."""
    weld, root, mocap = (np.asarray(x) for x in (model.body_weldid, model.body_rootid, model.body_mocapid))
    body = np.asarray(model.geom_bodyid)
    return np.flatnonzero((weld[body] == 0) & (mocap[root[body]] == -1))


@with_known_arguments
@strict.own_constants
def place_static(model: mjx.Model, data: mjx.Data) -> mjx.Data:
    """Returns `data` in which the geoms that are fixed to the world are placed as `model` has them; one world, jit, vmap.

    MJX on Warp places such geoms once, when `mjx.Data` is made, and as the template has them. Call this on data that was made by something
    else, or after the model's arena has changed. It only changes `geom_xpos` and `geom_xmat` of static geoms.

    Raises:
        ValueError: the model or the data is of many worlds, outside `jax.vmap`.
    """
    if model.body_pos.ndim != 2 or model.geom_pos.ndim != 2 or data.geom_xpos.ndim != 2:
        raise validation.error([problem("model", "place_static_one")])
    body, ids = np.asarray(model.geom_bodyid), static_geoms(model)
    if not len(ids):
        return data
    pos, quat = static_poses(model, body[ids])
    xpos = pos + quat_rotate(quat, take(model.geom_pos, ids))
    xmat = quat_to_mat(quat_mul(quat, take(model.geom_quat, ids)))
    return data.replace(
        geom_xpos=replace_rows(data.geom_xpos, ids, xpos),
        geom_xmat=replace_rows(data.geom_xmat, ids, xmat),
    )


def world_count(
    model: mjx.Model, params: ArenaParams, key: jax.Array | None
) -> tuple[int, mjx.Model, ArenaParams, jax.Array | None]:
    """How many worlds `jax.vmap` stands for around this call, and the same arguments.

    The rule of a `custom_vmap` learns the size of the axis. Under `vmap(jit(f))` or inside a `lax.scan` it learns it
    only after `f` was traced, too late to size anything; then it raises.
    """
    count = 1
    sealed = False

    @jax.custom_batching.custom_vmap
    def probe(*arrays: jax.Array) -> tuple[jax.Array, ...]:
        return arrays

    @probe.def_vmap
    def _(axis_size: int, in_batched: list[bool], *arrays: jax.Array) -> tuple[tuple[jax.Array, ...], tuple[bool, ...]]:
        nonlocal count
        if sealed:
            raise validation.error([problem("n_worlds", "traced_for_one")])
        count *= axis_size
        return probe(*arrays), tuple(in_batched)

    leaves, tree = jax.tree.flatten((model, params, key))
    model, params, key = jax.tree.unflatten(tree, probe(*leaves))
    sealed = True
    return count, model, params, key
