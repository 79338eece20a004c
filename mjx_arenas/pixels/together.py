"""Work that takes all worlds at once, and must know how many they are, in functions of one world."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp

Work = Callable[[int, Any, Any], Any]


def together(work: Work, shared: Any, own: Any) -> Any:
    """`work` of all worlds that `jax.vmap` runs this for, however often it is nested; of one world without it.

    Args:
        work: of the number W of worlds, a tree like `shared` whose leaves are batched (W, ...) where any world differs, and a tree
            like `own` with all leaves (W, ...); and with it, as `in_axes` of `shared`, 0 or None for each leaf. Gives leaves (W, ...).
        shared: a tree of arrays, of one world.
        own: a tree of arrays, of one world.

    Returns:
        Of one world, what `work` gives.
    """
    shared_leaves, shared_tree = jax.tree.flatten(shared)
    own_leaves, own_tree = jax.tree.flatten(own)

    def flat(n: int, batched: Sequence[bool], leaves: Sequence[jax.Array]) -> Any:
        at = len(shared_leaves)
        axes = shared_tree.unflatten([0 if b else None for b in batched[:at]])
        rows = [x if b else jnp.broadcast_to(x, (n, *x.shape)) for b, x in zip(batched[at:], leaves[at:], strict=True)]
        return work(n, (shared_tree.unflatten(leaves[:at]), axes), own_tree.unflatten(rows))

    leaves = [jnp.asarray(x) for x in (*shared_leaves, *own_leaves)]
    return _of_one(flat)(*leaves)


def _of_one(flat: Callable[..., Any]) -> Callable[..., Any]:
    @jax.custom_batching.custom_vmap
    def run(*leaves: jax.Array) -> Any:
        return jax.tree.map(lambda x: x[0], flat(1, [False] * len(leaves), leaves))

    @run.def_vmap
    def rule(size: int, is_batched: Sequence[bool], *leaves: jax.Array) -> tuple[Any, Any]:
        out = _of_many(flat, size, tuple(is_batched))(*leaves)
        return out, jax.tree.map(lambda _: True, out)

    return run


def _of_many(flat: Callable[..., Any], n: int, batched: tuple[bool, ...]) -> Callable[..., Any]:
    """A program for `n` worlds; another `jax.vmap` around it makes them more."""

    @jax.custom_batching.custom_vmap
    def run(*leaves: jax.Array) -> Any:
        return flat(n, batched, leaves)

    @run.def_vmap
    def rule(size: int, is_batched: Sequence[bool], *leaves: jax.Array) -> tuple[Any, Any]:
        both = tuple(a or b for a, b in zip(batched, is_batched, strict=True))
        rows = [_rows(x, size, n, *at) for x, *at in zip(leaves, is_batched, batched, strict=True)]
        out = _of_many(flat, size * n, both)(*rows)
        out = jax.tree.map(lambda x: x.reshape(size, n, *x.shape[1:]), out)
        return out, jax.tree.map(lambda _: True, out)

    return run


def _rows(x: jax.Array, size: int, n: int, outer: bool, inner: bool) -> jax.Array:
    """(size * n, ...) of an array with one of the two axes at least; one without stays as it is."""
    if not outer and not inner:
        return x
    own = x.shape[outer + inner :]
    x = x if inner else x[:, None]
    x = x if outer else x[None]
    return jnp.broadcast_to(x, (size, n, *own)).reshape(math.prod((size, n)), *own)
