"""Pictures have no gradient: what is drawn is known, and what would be differentiated is refused (at trace time)."""

from typing import Any

import jax

Tree = Any


@jax.custom_jvp
def undifferentiated(tree: Tree) -> Tree:
    """The same tree of arrays, whose derivatives are refused.

    Raises:
        TypeError: it is differentiated, at trace time.
    """
    return tree


@undifferentiated.defjvp
def _refused(primals: Tree, tangents: Tree) -> Tree:
    raise TypeError(
        "Pictures have no gradient, but what is drawn depends on what is differentiated: draw `jax.lax.stop_gradient` of the batch and "
        "of the data."
    )
