"""Rows of arrays at static numbers, and products of them."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np


def take(rows: jax.Array, ids: np.ndarray) -> jax.Array:
    """`rows[ids]` for static row numbers; no gather where they are in a row."""
    if not len(ids) or np.any(np.diff(ids) != 1):
        return rows[ids]
    return rows if len(ids) == rows.shape[0] else rows[ids[0] : ids[-1] + 1]


def replace_rows(base: jax.Array, ids: np.ndarray, rows: jax.Array) -> jax.Array:
    """`base` (N, ...) with `rows` (n, ...) at the static row numbers `ids` (n,).

    Each row of the result looks its source up: on a GPU twice as fast as concatenating runs of rows, and many times as
    fast as an indexed update, which XLA makes a scatter (benchmarks/README.md).
    """
    if not len(ids):
        return base
    source, here = np.zeros(base.shape[0], int), np.zeros(base.shape[0], bool)
    source[ids], here[ids] = np.arange(len(ids)), True
    new = rows.astype(base.dtype).at[source].get(mode="promise_in_bounds")
    return jnp.where(here.reshape(-1, *(1,) * (base.ndim - 1)), new, base)


def joined(blocks: Sequence[jax.Array], n: int) -> jax.Array:
    """(n, k) the rows of all blocks (n, ...), one after the other."""
    return jnp.concatenate([jnp.zeros((n, 0)), *(block.reshape(n, -1) for block in blocks)], axis=1)


def dot(spec: str, *operands: Any) -> jax.Array:
    """`einsum` in full float32: by default, a GPU rounds what it multiplies to ten bits of mantissa."""
    return jnp.einsum(spec, *operands, precision=jax.lax.Precision.HIGHEST)
