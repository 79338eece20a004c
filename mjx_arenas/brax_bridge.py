"""What Brax's trainers need of JAX and newer versions of it no longer have."""

import contextlib
from collections.abc import Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding
from jax.sharding import PartitionSpec as P

_AXIS = "i"  # of the `pmap` in Brax's trainers


@contextlib.contextmanager
def device_put_replicated() -> Iterator[None]:
    """Gives JAX its former `jax.device_put_replicated` while Brax trains.

    Brax 0.14.2's `ppo.train`, `sac.train` and `apg.train` call it (google/brax#671). JAX 0.10 removed it:

        with brax_bridge.device_put_replicated():
            ppo.train(...)

    What it gives is like what Brax's training steps return, which JAX's own was not: on the mesh axis of Brax's `pmap`, and without weak
    types. So JAX compiles the training once instead of twice, and the evaluation twice instead of up to four times.
    """
    own = vars(jax).get("device_put_replicated")  # older versions give theirs, with a warning, only when asked
    setattr(jax, "device_put_replicated", _replicate)  # noqa: B010
    try:
        yield
    finally:
        if own is None:
            delattr(jax, "device_put_replicated")
        else:
            jax.device_put_replicated = own


def _replicate(tree: Any, devices: Sequence[Any]) -> Any:
    """`tree` with a copy of each leaf (...) on each of D devices, as (D, ...)."""
    on_each = NamedSharding(Mesh(np.array(devices), _AXIS), P(_AXIS))

    def put(leaf: Any) -> jax.Array:
        leaf = jnp.asarray(leaf)
        strict = jax.lax.convert_element_type(leaf, leaf.dtype)
        return jax.device_put(jnp.broadcast_to(strict, (len(devices), *leaf.shape)), on_each)

    return jax.tree.map(put, tree)
