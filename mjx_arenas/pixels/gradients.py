"""Pictures have no gradient: what is drawn is known, and what would be differentiated is refused (at trace time)."""

from typing import Any

import jax

from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error

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
    raise error([problem("", "no_gradient")], kind=TypeError)
