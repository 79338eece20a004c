"""Rows of arrays."""

import jax.numpy as jnp
import numpy as np

from mjx_arenas.rows import take


def test_none_of_none():
    """No rows, of an array that has none."""
    assert take(jnp.zeros((0, 3)), np.zeros((2, 0), int)).shape == (2, 0, 3)
    assert take(jnp.zeros((2, 0, 3), bool), np.zeros(0, int), 1).dtype == bool
