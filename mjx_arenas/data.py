"""From models to states: `mjx.Data` of one world, stepping a batch, and what may go wrong there."""

import collections
import importlib.util
import logging
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.extend
import jax.numpy as jnp
import mujoco
import numpy as np
from jax.sharding import PartitionSpec as P
from mujoco import mjx
from mujoco.mjx._src import collision_driver
from mujoco.mjx._src.types import Impl

from mjx_arenas import mesh, specs, strict, validation
from mjx_arenas.params import ArenaParams
from mjx_arenas.write.kinematics import body_poses
from mjx_arenas.write.quaternions import quat_mul, quat_rotate, quat_to_mat
from mjx_arenas.write.rows import replace_rows

_log = logging.getLogger("mjx_arenas")


def put_model(mj_model: mujoco.MjModel, impl: str | None) -> mjx.Model:
    """`mjx.put_model`, which picks the best implementation if told none, and says in one sentence what it cannot do."""
    if impl is None:
        impl = _best_impl()
    if impl not in ("jax", "warp"):
        raise ValueError(f"`impl` must be 'jax', 'warp' or None, got {validation.show(impl)}.")
    for geom in np.flatnonzero(mj_model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD):
        name = specs.geom_name(mj_model, int(geom))
        which = f"Geom {name}" if mj_model.geom(geom).name else f"A{name[1:]}"
        raise ValueError(
            f"{which} is a height field, whose collisions in MJX use the template's bounds: use a plane, boxes or a mesh."
        )
    if impl == "warp" and not warp_installed():
        raise ValueError("impl='warp' needs warp-lang: pip install 'mjx_arenas[warp]'.")
    check_awake(mj_model)
    if impl == "jax":
        _check_pairs(mj_model)
    else:
        _quiet_warp()
    return mjx.put_model(mj_model, impl=impl, device=mesh.own_device())


def check_awake(mj_model: mujoco.MjModel) -> None:
    """Refuses sleeping, which is not simulated right where worlds differ.

    By `dof_length` bodies fall asleep, which MJX shares between worlds. MuJoCo's own batch keeps sleeping in an `MjData` of each
    world, with static geoms where they were when it was made, the template's.
    """
    if mj_model.opt.enableflags & getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", 0):
        raise ValueError(
            "`arena.mj_model.opt.enableflags`: bodies can sleep in compiled worlds alone, not in many at once: clear the bit "
            "mjENBL_SLEEP, or leave `sleep` out of the MJCF's <flag>."
        )


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

    if not hasattr(warp, "LOG_WARNING"):
        warp.config.quiet = True  # older versions
    elif warp.config.log_level == warp.LOG_INFO:  # the default
        warp.config.log_level = warp.LOG_WARNING


def _check_pairs(mj_model: mujoco.MjModel) -> None:
    for a, b, _ in collision_driver.geom_pairs(mj_model):
        types = mj_model.geom_type[[a, b]]
        if not collision_driver.has_collision_fn(*types):
            names = " and ".join(
                f"{specs.geom_name(mj_model, g)} ({mujoco.mjtGeom(t).name[7:].lower()})"
                for g, t in zip((a, b), types, strict=True)
            )
            raise ValueError(
                f"impl='jax' has no collision function for geoms {names}: use impl='warp', other shapes, or contype/conaffinity."
            )


def empty_data(mj_model: mujoco.MjModel, impl: Impl, n_worlds: int, room: "Room") -> mjx.Data:
    """`mjx.make_data`, with `room` for contacts in each of `n_worlds` worlds on Warp; may be traced.

    Leaves that hold one number over and over are made on the device: as constants of a compiled function they could
    be gigabytes.
    """
    device = mesh.own_device()
    with jax.ensure_compile_time_eval():
        if impl == Impl.JAX:
            data = mjx.make_data(mj_model, impl="jax", device=device)
        else:
            sizes: dict[str, Any] = {"naconmax": n_worlds * room.contacts, "njmax": max_rows(mj_model, room.contacts)}
            if _reports_pairs():
                sizes["naccdmax"] = n_worlds * min(room.pairs, room.contacts)
            data = mjx.make_data(mj_model, impl="warp", device=device, **sizes)
    return jax.tree.map(_compact, data)


def _reports_pairs() -> bool:
    """Whether Warp's data say that pairs found no room, which in mujoco-mjx 3.10 nothing does."""
    from mujoco.mjx.warp import types

    return "overflow" in types.DataWarp.__dataclass_fields__


def keyframe(mj_model: mujoco.MjModel, name: str) -> dict[str, jax.Array]:
    """What of `mjx.Data` a keyframe sets."""
    names = [mj_model.key(k).name for k in range(mj_model.nkey)]
    if name not in names:
        known = (
            f"must be one of {', '.join(map(repr, names))}" if names else "must be None, as the arena has no keyframes"
        )
        raise ValueError(f"`keyframe` {known}, got {name!r}.")
    key = mj_model.key(names.index(name))
    values = {"time": key.time.item(), "qpos": key.qpos, "qvel": key.qvel, "act": key.act, "ctrl": key.ctrl}
    if mj_model.nmocap:
        values |= {"mocap_pos": key.mpos.reshape(-1, 3), "mocap_quat": key.mquat.reshape(-1, 4)}
    return {field: jnp.asarray(value, jnp.result_type(float)) for field, value in values.items()}


def _compact(leaf: Any) -> Any:
    array = np.asarray(leaf)
    if array.size > 1 and np.all(array == array.flat[0]):
        return jnp.full(array.shape, array.flat[0], array.dtype)
    return jnp.asarray(leaf)


# Contacts that a pair of geoms can have at most, where it is not the four that mujoco_warp keeps.
_SPHERE, _CAPSULE, _BOX = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_BOX
_PAIR_CONTACTS = {
    frozenset({_SPHERE}): 1,
    frozenset({_SPHERE, mujoco.mjtGeom.mjGEOM_PLANE}): 1,
    frozenset({_SPHERE, _CAPSULE}): 1,
    frozenset({_SPHERE, _BOX}): 1,
    frozenset({_CAPSULE}): 2,
    frozenset({_CAPSULE, mujoco.mjtGeom.mjGEOM_PLANE}): 2,
    frozenset({_CAPSULE, _BOX}): 2,
}
_MAX_PAIR_CONTACTS = 4
_BOXES_CONTACTS = 8  # of two boxes without native collision detection
_FACE_CONTACTS = 64  # of two bodies that touch face to face, whatever number of geoms they have there
_TABLES = 4  # tops side by side meet in fours
_NEIGHBOURS = 6  # touching pairs a body in the densest heap of balls: each of twelve neighbours is shared by two


class Room(NamedTuple):
    """What one world is given room for on Warp."""

    contacts: int
    pairs: int
    """Pairs of geoms whose contacts are searched at once; Warp keeps 3 kB for each."""


def _pairs(mj_model: mujoco.MjModel) -> Iterator[tuple[int, int, int]]:
    """Pairs of geoms that may collide, each with the contacts that it can have."""
    boxes = _BOXES_CONTACTS if mj_model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_NATIVECCD else _MAX_PAIR_CONTACTS
    of = {**_PAIR_CONTACTS, frozenset({_BOX}): boxes}
    for a, b, _ in collision_driver.geom_pairs(mj_model):
        kind = frozenset({mujoco.mjtGeom(mj_model.geom_type[a]), mujoco.mjtGeom(mj_model.geom_type[b])})
        yield a, b, of.get(kind, _MAX_PAIR_CONTACTS)


def all_contacts(mj_model: mujoco.MjModel) -> int:
    """Contacts of all pairs of geoms that may collide, as if all touched."""
    return max(1, sum(contacts for _, _, contacts in _pairs(mj_model)))


def room_for(mj_model: mujoco.MjModel, n_contacts: int) -> Room:
    """Room for a number of contacts, of whatever pairs they are."""
    return Room(n_contacts, max(1, sum(1 for _ in _pairs(mj_model))))


def room(mj_model: mujoco.MjModel, slabs: np.ndarray) -> Room:
    """What one world is given room for: what can touch at once.

    A body may touch four of the tables, all else that is fixed, and in a heap others at six pairs a body. More is
    possible in theory (a body across five tables, a heap of small bodies on a large one): `capacity` tells.

    Args:
        mj_model: the arena.
        slabs: geoms on which things stand, of which a body touches few.
    """
    return Room(_at_once(mj_model, slabs, lambda contacts: contacts), _at_once(mj_model, slabs, lambda _: 1))


def _at_once(mj_model: mujoco.MjModel, slabs: np.ndarray, weight: Callable[[int], int]) -> int:
    """Sum of `weight` of the contacts of each pair of geoms, over the pairs that can touch at once."""
    fixed = mj_model.body_weldid[mj_model.geom_bodyid] == 0
    on_slab: dict[int, collections.Counter] = collections.defaultdict(collections.Counter)  # of a body: by slab
    between: collections.Counter = collections.Counter()  # bodies that move
    total = 0
    for a, b, contacts in _pairs(mj_model):
        first, second = sorted((a, b), key=lambda g: not fixed[g])  # what is fixed, if anything is, comes first
        bodies = mj_model.geom_bodyid[[first, second]]
        if first in slabs:
            on_slab[bodies[1]][first] += weight(contacts)
        elif fixed[first]:
            total += weight(contacts)
        else:
            between[tuple(sorted(bodies))] += weight(contacts)
    moving = {body for pair in between for body in pair}
    total += sum(min(count, _FACE_CONTACTS) for c in on_slab.values() for _, count in c.most_common(_TABLES))
    heap = sorted((min(count, _FACE_CONTACTS) for count in between.values()), reverse=True)
    return max(1, total + sum(heap[: _NEIGHBOURS * len(moving)]))


def max_rows(mj_model: mujoco.MjModel, n_contacts: int) -> int:
    """Constraint rows that one world can have, with `n_contacts` contacts."""
    per_contact, other = rows_each(mj_model)
    return n_contacts * per_contact + other


def rows_each(mj_model: mujoco.MjModel) -> tuple[int, int]:
    """Constraint rows of a contact, and of all else in one world."""
    condim = int(max(mj_model.geom_condim.max(initial=3), mj_model.pair_dim.max(initial=3)))
    per_contact = 2 * (condim - 1) if mj_model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL and condim > 1 else condim
    return per_contact, 6 * mj_model.neq + 2 * mj_model.njnt + mj_model.nv + 3 * mj_model.ntendon


def of_worlds(data: mjx.Data, rows: Callable[[jax.Array], jax.Array]) -> mjx.Data:
    """`data` with `rows` of each leaf (W, ...); what Warp keeps for all worlds together stays as it is."""
    if data.impl != Impl.WARP:
        return jax.tree.map(rows, data)
    from mujoco.mjx.warp import types

    def one(path: Any, leaf: jax.Array) -> jax.Array:
        names = [key.name for key in path]
        per_world = names[0] != "_impl" or types._BATCH_DIM["Data"]["__".join(names[1:])]
        return rows(leaf) if per_world else leaf

    return jax.tree_util.tree_map_with_path(one, data)


def static_geoms(model: mjx.Model) -> np.ndarray:
    """Ids of the geoms that are fixed to the world, which Warp places once."""
    weld, root, mocap = (np.asarray(x) for x in (model.body_weldid, model.body_rootid, model.body_mocapid))
    body = np.asarray(model.geom_bodyid)
    return np.flatnonzero((weld[body] == 0) & (mocap[root[body]] == -1))


@strict.own_constants
def place_static(model: mjx.Model, data: mjx.Data) -> mjx.Data:
    """`data` with the geoms that are fixed to the world where `model` has them; one world, jit, vmap.

    MJX on Warp places such geoms once, when `mjx.Data` is made, and where the template has them. Call this on data
    that something else made, or after the model's arena has changed. It moves nothing but `geom_xpos` and `geom_xmat`
    of static geoms.

    Raises:
        ValueError: the model or the data is of many worlds, outside `jax.vmap`.
    """
    if model.body_pos.ndim != 2 or model.geom_pos.ndim != 2 or data.geom_xpos.ndim != 2:
        raise ValueError(
            "`place_static` takes one world: jax.vmap(mja.place_static, in_axes=(batch.in_axes, 0))(batch.model, data)."
        )
    body, ids = np.asarray(model.geom_bodyid), static_geoms(model)
    if not len(ids):
        return data
    pos, quat = body_poses(model)
    pos, quat = pos[body[ids]], quat[body[ids]]
    xpos = pos + quat_rotate(quat, model.geom_pos[ids])
    xmat = quat_to_mat(quat_mul(quat, model.geom_quat[ids]))
    return data.replace(
        geom_xpos=replace_rows(data.geom_xpos, ids, xpos),
        geom_xmat=replace_rows(data.geom_xmat, ids, xmat),
    )


class OfModel:
    """A function of a model, of arrays of worlds and of what these share, compiled; each device computes its own worlds.

    Flattening a model takes longer than launching what is compiled, so the last one's leaves are kept.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._compiled: dict[Any, Callable[..., Any]] = {}
        self._last: tuple[Any, list[jax.Array], Callable[..., Any]] = ((None, None), [], function)

    def __call__(self, model: mjx.Model, worlds: Any, *shared: Any) -> Any:
        spread = mesh.spread_of(jax.tree.leaves(worlds)[0])
        (last, over), leaves, compiled = self._last
        if last is not model or over != spread:
            leaves, tree = jax.tree.flatten(model)
            if any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
                return self._on_each(spread, len(shared))(model, worlds, *shared)
            if (tree, spread) not in self._compiled:
                on_each = self._on_each(spread, len(shared))
                self._compiled[tree, spread] = jax.jit(lambda leaves, *args: on_each(tree.unflatten(leaves), *args))
            compiled = self._compiled[tree, spread]
            self._last = (model, spread), leaves, compiled
        return compiled(leaves, worlds, *shared)

    def _on_each(self, spread: mesh.Spread | None, n_shared: int) -> Callable[..., Any]:
        return mesh.on_each(self._function, spread, spread and (P(), spread.spec, *[P()] * n_shared))


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
            raise ValueError(
                "make_world_data was traced for one world before jax.vmap came to it, and so has no room for the contacts of all worlds "
                "on impl='warp'. Write jax.jit(jax.vmap(make_world_data)), not jax.vmap(jax.jit(make_world_data)), or pass `n_worlds`."
            )
        count *= axis_size
        return probe(*arrays), tuple(in_batched)

    leaves, tree = jax.tree.flatten((model, params, key))
    model, params, key = jax.tree.unflatten(tree, probe(*leaves))
    sealed = True
    return count, model, params, key
