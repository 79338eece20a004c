"""Rows of arrays at static numbers, and products of them."""

from collections.abc import Sequence
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np


def take(values: jax.Array, ids: np.ndarray, axis: int = 0) -> jax.Array:
    """`values[ids]` for static numbers (...) of rows, or of what is along another axis; NumPy or JAX.

    A slice where they are in a row, else XLA's gather itself, which is traced in a sixth of the time that `jax.numpy` takes.
    """
    if isinstance(values, np.ndarray):
        return cast(jax.Array, np.take(values, ids, axis))
    n, axis = values.shape[axis], axis % values.ndim
    assert not ids.size or (ids.dtype.kind in "iu" and -n <= ids.min() and ids.max() < n), "rows that are none"
    if ids.ndim == 1 and len(ids) and ids[0] >= 0 and (ids == int(ids[0]) + np.arange(len(ids))).all():
        return values if len(ids) == n else jax.lax.slice_in_dim(values, ids[0], ids[-1] + 1, axis=axis)
    index = np.where(ids < 0, ids + n, ids)[..., None].astype(np.int32)
    kept = [a for a in range(values.ndim) if a != axis]
    numbers = jax.lax.GatherDimensionNumbers(
        offset_dims=tuple(a if a < axis else a + ids.ndim - 1 for a in kept),
        collapsed_slice_dims=(axis,),
        start_index_map=(axis,),
    )
    sizes = tuple(1 if a == axis else size for a, size in enumerate(values.shape))
    return jax.lax.gather(values, index, numbers, sizes, mode=jax.lax.GatherScatterMode.PROMISE_IN_BOUNDS)


def replace_rows(base: jax.Array, ids: np.ndarray, rows: jax.Array) -> jax.Array:
    """`base` (N, ...) with `rows` (n, ...) at the static row numbers `ids` (n,).

    Each row of the result looks its source up: on a GPU twice as fast as concatenating runs of rows, and many times as
    fast as an indexed update, which XLA makes a scatter (benchmarks/README.md).
    """
    if not len(ids):
        return base
    source, here = np.zeros(base.shape[0], int), np.zeros(base.shape[0], bool)
    source[ids], here[ids] = np.arange(len(ids)), True
    new = take(rows.astype(base.dtype), source)
    return jnp.where(here.reshape(-1, *(1,) * (base.ndim - 1)), new, base)


def joined(blocks: Sequence[jax.Array], n: int) -> jax.Array:
    """(n, k) the rows of all blocks (n, ...), one after the other."""
    return jnp.concatenate([jnp.zeros((n, 0)), *(block.reshape(n, -1) for block in blocks)], axis=1)


def dot(spec: str, *operands: Any) -> jax.Array:
    """`einsum` in full float32: by default, a GPU rounds what it multiplies to ten bits of mantissa."""
    return jnp.einsum(spec, *operands, precision=jax.lax.Precision.HIGHEST)
