"""Work that only some worlds need, under `jax.vmap`, where `jax.lax.cond` would do it for all of them in every step."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from mjx_arenas.envs import refusals

_PENDING = 4  # the work waits until one in so many worlds wants it
_CHUNK = 4  # and is done for one in so many worlds at once


def when_needed(
    function: Callable[..., Any], wanted: jax.Array, urgent: jax.Array, otherwise: Any, *args: Any
) -> tuple[Any, jax.Array]:
    """`function(*args)` of a world that wants it, now or later; jit, vmap.

    Each world alone is a `jax.lax.cond`. Under `jax.vmap` (the innermost) the worlds that want it are gathered, worked on in chunks and
    put back, so that nothing is computed where nothing is wanted. As a few worlds cost as much time as many, the work waits until one
    in 4 wants it, or until it is urgent for one.

    Args:
        function: of one world; gives a tree like `otherwise`. It must not close over arrays that `jax.vmap` batches.
        wanted: () bool.
        urgent: () bool; the result is needed now (if it is wanted, too).
        otherwise: what a world has that does not get its result in this call.
        args: of one world.

    Returns:
        The result or `otherwise`, and () bool: whether it is the result.
    """

    @jax.custom_batching.custom_vmap
    def one(wanted: jax.Array, urgent: jax.Array, otherwise: Any, args: tuple) -> tuple[Any, jax.Array]:
        del urgent
        try:
            return jax.lax.cond(wanted, lambda: function(*args), lambda: otherwise), wanted
        except TypeError:
            refusals.check_alike(jax.eval_shape(function, *args), otherwise)
            raise

    @one.def_vmap
    def many(n: int, batched: Any, wanted: jax.Array, urgent: jax.Array, otherwise: Any, args: tuple) -> tuple:
        def all_worlds(is_batched: Any, tree: Any) -> Any:
            return jax.tree.map(lambda b, x: x if b else jnp.broadcast_to(x, (n, *jnp.shape(x))), is_batched, tree)

        wanted, urgent, otherwise = all_worlds(tuple(batched[:3]), (wanted, urgent, otherwise))
        leaves, tree = jax.tree.flatten(args)
        of_worlds = jax.tree.leaves(batched[3])
        chunk = -(-n // _CHUNK)
        count = wanted.sum()
        go = ((count * _PENDING >= n) | (wanted & urgent).any()) & (count > 0)
        order = jnp.nonzero(wanted, size=n + chunk, fill_value=n)[0]

        def work(state: tuple[jax.Array, Any]) -> tuple[jax.Array, Any]:
            begin, results = state
            ids = jax.lax.dynamic_slice(order, (begin,), (chunk,))
            rows = [x.at[ids].get(mode="clip") if b else x for b, x in zip(of_worlds, leaves, strict=True)]
            axes = [0 if b else None for b in of_worlds]
            new = jax.vmap(lambda *row: function(*jax.tree.unflatten(tree, row)), in_axes=axes)(*rows)
            return begin + chunk, jax.tree.map(lambda old, x: old.at[ids].set(x, mode="drop"), results, new)

        results = jax.lax.while_loop(
            lambda state: go & (state[0] < count), work, (jnp.zeros((), count.dtype), otherwise)
        )[1]
        out = results, wanted & go
        return out, jax.tree.map(lambda _: True, out)

    return one(wanted, urgent, otherwise, args)
