"""Worlds that are spread over the devices of a mesh: each device computes its own, and none waits for another."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AbstractMesh, AxisType, Mesh, NamedSharding
from jax.sharding import PartitionSpec as P

from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.sim import constants
from mjx_arenas.sim.latest import Latest


class Spread(NamedTuple):
    """How worlds are spread: their axis over axes of a mesh."""

    mesh: Mesh | AbstractMesh
    axes: str | tuple[str, ...]

    @property
    def spec(self) -> P:
        """The partition of an array (W, ...)."""
        return P(self.axes)

    @property
    def n_shards(self) -> int:
        """Number of parts."""
        axes = (self.axes,) if isinstance(self.axes, str) else self.axes
        return int(np.prod([self.mesh.shape[axis] for axis in axes]))


def spread_of(worlds: jax.Array) -> Spread | None:
    """How an array (W, ...) is spread over a mesh, as far as can be seen.

    While tracing, it can be seen on a mesh with explicit axes; on others, XLA's partitioner spreads the worlds.
    """
    sharding = jax.typeof(worlds).sharding if isinstance(worlds, jax.core.Tracer) else _sharding(worlds)
    if sharding is None or not len(sharding.spec) or sharding.spec[0] is None:
        return None
    return Spread(sharding.mesh, sharding.spec[0])


def on_each(function: Callable, spread: Spread | None, in_specs: Any) -> Callable:
    """`function` of arrays of worlds, with which each device computes its own; as it is without a spread.

    XLA's partitioner alone would make one loop of the loops of all devices, placement's and that of MJX's solver, which
    they end together: a collective in each turn. And it cannot split a call of Warp.
    """
    if spread is None:
        return function
    function = _made_empties(function)
    each = jax.shard_map(function, mesh=spread.mesh, in_specs=in_specs, out_specs=spread.spec, check_vma=False)
    if AxisType.Explicit not in spread.mesh.axis_types:
        return each

    def aligned(*args: Any) -> Any:
        """Arguments that came without a sharding get theirs, as they do by themselves on other meshes."""
        return each(*jax.tree.map(lambda s, x: jax.sharding.reshard(x, NamedSharding(spread.mesh, s)), in_specs, args))

    return aligned


def _made_empties(function: Callable) -> Callable:
    """`function` with each array that has no elements made where it is used: XLA's compiler for several GPUs crashes on given ones.

    They are the tables of an arena that has none, and so on (docs/upstream/empty_arrays.md).
    """

    def made(arrays: Any) -> Any:
        return jax.tree.map(lambda x: x if np.size(x) else jnp.zeros(np.shape(x), x.dtype), arrays)

    return lambda *args: constants.changed(function, made, *args)(*made(args))


def beside(worlds: jax.Array, tree: Any) -> Any:
    """`tree` on all devices of the mesh over which an array of worlds is spread, those of other processes too."""
    sharding = None if isinstance(worlds, jax.core.Tracer) else _sharding(worlds)
    if sharding is None:
        return tree
    everywhere = NamedSharding(sharding.mesh, P())

    def put(leaf: Any) -> Any:
        if not isinstance(leaf, jax.Array) or isinstance(leaf, jax.core.Tracer) or leaf.sharding == everywhere:
            return leaf
        copies = [jax.device_put(leaf, device) for device in everywhere.addressable_devices]
        return jax.make_array_from_single_device_arrays(leaf.shape, everywhere, copies)

    return jax.tree.map(put, tree)


class LastBeside:
    """`beside` for models: leaf by leaf it takes longer than `randomize`, so the last copy is kept while its model lives."""

    def __init__(self) -> None:
        self._last = Latest()

    def __call__(self, worlds: jax.Array, model: Any) -> Any:
        sharding = _sharding(worlds)
        if sharding is None or isinstance(worlds, jax.core.Tracer):
            return model
        copy = self._last.of(model, sharding.mesh)
        if copy is None:
            copy = beside(worlds, model)
            if not any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(copy)):
                self._last.keep(model, sharding.mesh, copy)
        return copy


def row(worlds: jax.Array, index: int) -> jax.Array:
    """World `index` of an array (W, ...), on the default device if the worlds are spread.

    Raises:
        IndexError: another process has it.
    """
    if isinstance(worlds, jax.core.Tracer) or spread_of(worlds) is None:
        return worlds[index]
    mine = []
    for shard in worlds.addressable_shards:
        start, stop, _ = shard.index[0].indices(len(worlds))
        if start <= index < stop:
            return jnp.asarray(np.asarray(shard.data[index - start]))
        mine += [f"{start} to {stop - 1}"]
    raise error(
        [problem("index", "must", None, index, must=f"of a world of this process, which has {', '.join(mine)}")],
        kind=IndexError,
    )


def gather(tree: Any) -> Any:
    """`tree` with arrays that are spread over a mesh on the default device."""

    def one(leaf: Any) -> Any:
        if _sharding(leaf) is None:
            return leaf
        if jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key):
            return jax.random.wrap_key_data(
                jnp.asarray(np.asarray(jax.random.key_data(leaf))), impl=jax.random.key_impl(leaf)
            )
        return jnp.asarray(np.asarray(leaf))

    return jax.tree.map(one, tree)


def own_device() -> Any:
    """The device for what is made on the host: MJX takes the first of all processes' devices if told none."""
    return jax.local_devices()[0] if jax.process_count() > 1 else None


def _sharding(array: Any) -> NamedSharding | None:
    sharding = getattr(array, "sharding", None)
    return sharding if isinstance(sharding, NamedSharding) else None
