"""What Warp would print while it steps: kept from stdout, asked for by world, and said once.

Warp notes in its data, by world, what had no room and where its solver gave up, and prints a line each time, thousands in a rollout.
"""

import atexit
import collections
import contextlib
import functools
import logging
import operator
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx
from mujoco.mjx._src.types import Impl

from mjx_arenas.record import room

_log = logging.getLogger("mjx_arenas")

_DROPS = ("NEFC", "NJMAX_NNZ", "BROADPHASE", "NARROWPHASE", "CCD", "HFIELD")  # what drops contacts or their rows
_LIMITS = ("ITERATIONS", "LS_ITERATIONS")


class Capacity(NamedTuple):
    """Room for contacts on Warp, the room that was needed, and what Warp noted of each world. See `mja.capacity`."""

    overflowed: jax.Array
    """(W,) bool: contacts or constraint rows of this world were dropped in a step since its data was made."""
    needed: jax.Array
    """() `max_contacts` for `make_data` that is enough for the last step; 0 on impl="jax", which has room for all.

    If contacts were dropped before they were counted, it is an upper bound: the number that all pairs of geoms can have."""
    solver_limits: jax.Array
    """(W,) bool: the solver or its line search stopped at the limit of its iterations.

    It did so in a step since the data of this world was made. Forces of contacts are less exact in that step. False on impl="jax", which
    does not report it."""
    noted: dict[str, jax.Array]
    """(W,) bool for each kind of line that Warp would have printed since the data was made.

    The names are those of mujoco_warp's `OverflowType`. It is empty on impl="jax"."""

    def __str__(self) -> str:
        """How many worlds, instead of a flag for each; what Warp noted in none is left out."""
        if any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(tuple(self))):
            return repr(self)
        dropped, limits, needed = (
            int(np.sum(self.overflowed)),
            int(np.sum(self.solver_limits)),
            int(np.max(self.needed)),
        )
        worlds = np.size(self.overflowed)
        told = (
            f"Of {worlds:,} worlds: contacts were dropped in {dropped:,}, the solver stopped at its limit in {limits:,}"
        )
        if noted := {name: n for name, flags in self.noted.items() if (n := int(np.sum(flags)))}:
            told += "; Warp noted " + ", ".join(f"{name} in {n:,}" for name, n in noted.items())
        if not self.noted:
            return f"{told} (impl='jax' has room for all contacts, and does not report its solver)"
        return f"{told}; the last step needs room for {'at most ' if dropped else ''}{needed:,} contacts a world"


def capacity(mj_model: mujoco.MjModel, data: mjx.Data) -> Capacity:
    """Dropped contacts and the limits of the solver, from the data (W, ...) of all worlds."""
    n_worlds = data.qpos.shape[0]
    never = jnp.zeros(n_worlds, bool)
    if data.impl == Impl.JAX:  # has a slot for each contact
        return Capacity(never, jnp.zeros((), int), never, {})
    warp = data._impl
    per_contact, other = room.rows_each(mj_model)
    pooled = jnp.maximum(warp.nacon, warp.ncollision)  # (D,): of the worlds on each device
    n_here = n_worlds // len(pooled)
    rows = warp.nefc.reshape(-1)
    uncounted = pooled > warp.naconmax  # pairs that never came to the narrow phase, contacts without rows
    needed = jnp.maximum(-(-pooled.max() // n_here), -(-(rows.max() - other) // per_contact))
    needed = jnp.where(uncounted.any(), room.all_contacts(mj_model), jnp.maximum(needed, 1))
    now = (rows > warp.njmax) | jnp.repeat(uncounted, n_here)
    ever = warp.overflow.reshape(-1)
    needed = jnp.where(_has(ever, "CCD").any(), room.all_contacts(mj_model), needed)
    noted = {name: _has(ever, name) for name in _kinds()}
    return Capacity(now | _has(ever, *_DROPS), needed, _has(ever, *_LIMITS), noted)


def dropped_contacts(data: mjx.Data) -> jax.Array:
    """() bool: contacts or constraint rows of this world were dropped since its data was made; one world, jit, vmap."""
    return _of_one(data, _DROPS)


def solver_limits(data: mjx.Data) -> jax.Array:
    """() bool: the solver stopped at the limit of its iterations since this world's data was made; one world, jit, vmap."""
    return _of_one(data, _LIMITS)


def _of_one(data: mjx.Data, names: tuple[str, ...]) -> jax.Array:
    return _has(data._impl.overflow, *names).any() if data.impl == Impl.WARP else jnp.zeros((), bool)


def _has(ever: jax.Array, *names: str) -> jax.Array:
    return (ever & _bits(*names)) != 0


def _bits(*names: str) -> int:
    """The bits of Warp's `overflow` by the names of mujoco_warp's `OverflowType`; of names that a version lacks, none."""
    from mujoco.mjx.third_party import mujoco_warp

    return int(functools.reduce(operator.or_, (getattr(mujoco_warp.OverflowType, name, 0) for name in names)))


def _kinds() -> list[str]:
    from mujoco.mjx.third_party import mujoco_warp

    return [str(kind.name) for kind in mujoco_warp.OverflowType]


def quiet(model: mjx.Model) -> mjx.Model:
    """`model` without Warp's lines on stdout, which take time; the data says the same."""
    if model.impl != Impl.WARP:
        return model
    _finish_before_python()
    quieted: Any = model.tree_replace({"opt._impl.warn_overflow": 0})
    return quieted


@functools.cache
def _finish_before_python() -> None:
    """Lets Python wait, when it ends, for steps that still run: on a CPU Warp calls it in each, and both would wait for ever."""

    def wait() -> None:
        for x in jax.live_arrays():
            with contextlib.suppress(RuntimeError):  # which is deleted, or has said already why it is not there
                x.block_until_ready()

    atexit.register(wait)


# Said once.

_SAID = {
    _DROPS: "Warp dropped contacts for want of room: mja.capacity(batch, data) says in which worlds, and which `max_contacts` of "
    "make_data would have been enough. This is said once.",
    _LIMITS: "Warp's solver reached the limit of its iterations: mja.capacity(batch, data).solver_limits says in which worlds; "
    "`arena.spec.option` has `iterations` and `ls_iterations`. This is said once.",
}


class Notes:
    """Says in the log, once for each kind, what Warp noted of worlds, as soon as results are there; waits for none."""

    def __init__(self) -> None:
        self._pending: collections.deque[jax.Array] = collections.deque(maxlen=64)
        self._left = dict(_SAID)

    def take(self, data: mjx.Data) -> None:
        """Looks at the data (W, ...) of all worlds now or, while it is computed, when this is called again, or at the end."""
        self.tell()
        ever = getattr(data._impl, "overflow", None) if data.impl == Impl.WARP else None
        if self._left and ever is not None and not isinstance(ever, jax.core.Tracer):
            self._pending.append(_union(ever))

    def tell(self) -> None:
        """Says what is known by now; of results that failed nothing, as reading them raises why."""
        while self._pending and self._pending[0].is_ready():
            ever = 0
            with contextlib.suppress(RuntimeError):
                ever = int(jax.device_get(self._pending.popleft()))
            for names in [names for names in self._left if ever & _bits(*names)]:
                _log.warning(self._left.pop(names))
        if not self._left:
            self._pending.clear()


@jax.jit
def _union(ever: jax.Array) -> jax.Array:
    """() bits that any world has."""
    return jax.lax.reduce(ever, jnp.zeros((), ever.dtype), jax.lax.bitwise_or, tuple(range(ever.ndim)))


NOTES = Notes()
atexit.register(NOTES.tell)


# No room.

_NO_MEMORY = re.compile(r"Failed to allocate (\d+) bytes(?! on device 'cpu')|Warp CUDA error 2: out of memory")


@contextlib.contextmanager
def no_room_answered() -> Iterator[None]:
    """Says in one sentence what to set where Warp finds no memory on the GPU beside JAX.

    Raises:
        MemoryError: that sentence, in the place of the error of a call on the device, which names a number of bytes at most.
    """
    try:
        yield
    except Exception as error:
        found = _NO_MEMORY.search(str(error))
        if found is None:
            raise
        amount = f"{int(found[1]) / 1e6:,.0f} MB" if found[1] else "memory"
        raise MemoryError(
            f"Warp found no {amount} on the GPU beside what JAX holds: set XLA_PYTHON_CLIENT_PREALLOCATE=false, or "
            "XLA_PYTHON_CLIENT_MEM_FRACTION=0.5, before JAX starts, or make fewer worlds."
        ) from error
