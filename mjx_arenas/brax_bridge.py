"""What Brax's trainers need of JAX and newer versions of it no longer have."""

import contextlib
from collections.abc import Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding
from jax.sharding import PartitionSpec as P

from mjx_arenas.extras import extra

_AXIS = "i"  # of the `pmap` in Brax's trainers


@contextlib.contextmanager
def device_put_replicated() -> Iterator[None]:
    """Gives JAX its former `jax.device_put_replicated` while Brax trains, and has Brax's evaluation compiled once.

    Brax 0.14.2's `ppo.train`, `sac.train` and `apg.train` call that function (google/brax#671). JAX 0.10 removed it:

        with brax_bridge.device_put_replicated():
            ppo.train(...)

    What it gives is like what Brax's training steps return, which JAX's own was not: on the mesh axis of Brax's `pmap`, and without weak
    types. The first states of Brax's evaluations, too, are like what the evaluations return: on a fixed device. So JAX compiles the
    training once instead of twice, and the evaluation once instead of up to four times.
    """
    extra("brax", "train")
    from brax.training.acting import Evaluator

    run = Evaluator.run_evaluation

    def run_evaluation(self: Any, policy_params: Any, *args: Any, **kwargs: Any) -> Any:
        devices = {device for leaf in jax.tree.leaves(policy_params) for device in jnp.asarray(leaf).devices()}
        if hasattr(self, "_eval_state_to_donate") and len(devices) == 1:  # as in Brax 0.14.2
            self._eval_state_to_donate = jax.device_put(jax.tree.map(_strict, self._eval_state_to_donate), *devices)
        return run(self, policy_params, *args, **kwargs)

    with _replaced(jax, "device_put_replicated", _replicate), _replaced(Evaluator, "run_evaluation", run_evaluation):
        yield


@contextlib.contextmanager
def _replaced(owner: Any, name: str, new: Any) -> Iterator[None]:
    own = vars(owner).get(name)  # older versions of JAX give what they no longer have with a warning, only when asked
    setattr(owner, name, new)
    try:
        yield
    finally:
        if own is None:
            delattr(owner, name)
        else:
            setattr(owner, name, own)


def _replicate(tree: Any, devices: Sequence[Any]) -> Any:
    """`tree` with a copy of each leaf (...) on each of D devices, as (D, ...)."""
    on_each = NamedSharding(Mesh(np.array(devices), _AXIS), P(_AXIS))

    def put(leaf: Any) -> jax.Array:
        strict = _strict(leaf)
        return jax.device_put(jnp.broadcast_to(strict, (len(devices), *strict.shape)), on_each)

    return jax.tree.map(put, tree)


def _strict(leaf: Any) -> jax.Array:
    """The same (...) without a weak type."""
    leaf = jnp.asarray(leaf)
    return jax.lax.convert_element_type(leaf, leaf.dtype)
