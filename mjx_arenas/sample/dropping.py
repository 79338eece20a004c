"""How high objects start that are dropped onto their surface."""

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.sample import packing

GAP = 0.005  # between what is dropped and what it will fall onto [m]
FLUSH = 1e-6  # what does not reach higher above a surface is level with it [m]


def piled(drop: np.ndarray, on: Array, there: Array, height: Array) -> Array:
    """(K,) by how much objects are above their surface if each is above all that are dropped there before it [m]; NumPy or JAX."""
    below = np.tril(drop[:, None] & drop[None], -1) & there[None] & (on[:, None] == on[None])
    return array_module(height).where(below, height + GAP, 0.0).sum(-1)


def lowered(drop: np.ndarray, solids: packing.Solids, surface: jax.Array, others: packing.Solids) -> jax.Array:
    """How high objects start that are lowered from a pile: each in turn down to `GAP` above what is below its outline.

    Args:
        drop: (K,) bool, host: which are lowered.
        solids: (K,) objects where they stand or, those to lower, in the pile; in it nothing overlaps.
        surface: (K,) height of their surfaces [m].
        others: (N,) all else that objects could fall onto.

    Returns:
        (K,) heights of the objects' lower ends [m].
    """
    every = packing.Solids(*(jnp.concatenate(pair) for pair in zip(solids, others, strict=True)))
    falls = jnp.concatenate([jnp.asarray(drop), jnp.zeros(len(others.radius), bool)])
    beside = packing.apart(
        solids, every._replace(half=every.half - FLUSH)
    )  # what touches it from the side is not below it
    below = ~beside & every.present[None] & (every.top[None] <= solids.bottom[:, None] + FLUSH)

    def lower(i: int, bottom: jax.Array) -> jax.Array:
        tops = bottom.at[: len(drop)].add(solids.top - solids.bottom)
        counts = below[i] & (~falls | (jnp.arange(len(falls)) < i)) & (tops > surface[i] + FLUSH)
        rest = jnp.maximum(surface[i], jnp.where(counts, tops + GAP, -jnp.inf).max())
        return bottom.at[i].set(jnp.where(falls[i], jnp.minimum(rest, bottom[i]), bottom[i]))

    start = jnp.concatenate([solids.bottom, others.top])  # what stands keeps its top
    return jax.lax.fori_loop(0, len(drop), lower, start)[: len(drop)]
