"""JAX's strict modes, of which a user may have some on: what of ours and of MJX's they must let pass."""

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import jax

_P = ParamSpec("_P")
_R = TypeVar("_R")


def own_constants(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """`function`, whose own numbers may go to the device under `jax.transfer_guard("disallow")`: few, and on purpose."""

    @functools.wraps(function)
    def allowed(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with jax.transfer_guard_host_to_device("allow"):
            return function(*args, **kwargs)

    return allowed


def of_mjx(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """`function`, in which MJX promotes ranks, which `jax.numpy_rank_promotion("raise")` would not have."""

    @functools.wraps(function)
    def allowed(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with jax.numpy_rank_promotion("allow"):
            return function(*args, **kwargs)

    return allowed
