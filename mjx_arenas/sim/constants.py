"""The constant arrays of a function that JAX traces."""

from collections.abc import Callable
from typing import Any

import jax
from jax.extend.core import ClosedJaxpr, jaxpr_as_fun


def changed(function: Callable, change: Callable[[list[Any]], list[Any]], *args: Any) -> Callable:
    """`function` of arrays like `args`, with what `change` makes of the constants that it takes from outside."""
    traced, shape = jax.make_jaxpr(function, return_shape=True)(*args)
    tree, run = jax.tree.structure(shape), jaxpr_as_fun(ClosedJaxpr(traced.jaxpr, change(traced.consts)))
    return lambda *args: jax.tree.unflatten(tree, run(*jax.tree.leaves(args)))
