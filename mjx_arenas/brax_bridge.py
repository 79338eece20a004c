"""What Brax's trainers need of JAX and newer versions of it no longer have."""

import contextlib
from collections.abc import Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding
from jax.sharding import PartitionSpec as P


@contextlib.contextmanager
def device_put_replicated() -> Iterator[None]:
    """Gives JAX its former `jax.device_put_replicated` while Brax trains. It does nothing if JAX has it.

    Brax 0.14.2's `ppo.train`, `sac.train` and `apg.train` call it (google/brax#671). JAX 0.10 removed it:

        with brax_bridge.device_put_replicated():
            ppo.train(...)
    """
    if hasattr(jax, "device_put_replicated"):
        yield
        return
    setattr(jax, "device_put_replicated", _replicate)  # noqa: B010
    try:
        yield
    finally:
        delattr(jax, "device_put_replicated")


def _replicate(tree: Any, devices: Sequence[Any]) -> Any:
    """`tree` with a copy of each leaf (...) on each of D devices, as (D, ...)."""
    on_each = NamedSharding(Mesh(np.array(devices), "device"), P("device"))

    def put(leaf: Any) -> jax.Array:
        leaf = jnp.asarray(leaf)
        return jax.device_put(jnp.broadcast_to(leaf, (len(devices), *leaf.shape)), on_each)

    return jax.tree.map(put, tree)
