"""The numbers of one world, from which fields take their elements."""

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas.rows import take


class Palette:
    """Numbers of one world, each there once; a field takes each of its elements from here.

    On a GPU fields are written faster so: their numbers are computed once, and each thread writes one element
    (benchmarks/README.md).
    """

    def __init__(self) -> None:
        self._arrays: list[jax.Array] = []
        self._first: list[int] = []
        self._known: dict[int, int] = {}
        self._size = 0

    def place(self, values: jax.Array) -> int:
        """The index at which the numbers (...) of an array begin. The same array is put there once."""
        if id(values) not in self._known:
            self._known[id(values)] = self._size
            self._arrays.append(values)
            self._first.append(self._size)
            self._size += values.size
        return self._known[id(values)]

    def mixed(self) -> "Palette":
        """The same, with all numbers computed before any field takes them."""
        made = Palette()
        made._arrays = list(jax.lax.optimization_barrier(tuple(self._arrays)))
        made._first, made._known, made._size = self._first, self._known, self._size
        return made

    def take(self, source: np.ndarray, base: jax.Array) -> jax.Array:
        """`base` (...) with the elements that have a source (...), which is not -1, taken from there."""
        for first, values in zip(self._first, self._arrays, strict=True):
            index = source - first
            here = (index >= 0) & (index < values.size)
            if here.any():
                found = take(values.reshape(-1), np.where(here, index, 0))
                base = jnp.where(here, found.astype(base.dtype), base)
        return base
