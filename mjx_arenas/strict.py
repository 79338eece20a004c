"""JAX's strict modes, of which a user may have some on: what of ours and of MJX's they must let pass."""

import contextlib
import functools
import re
from collections.abc import Callable, Iterator
from typing import ParamSpec, TypeVar

import jax

_P = ParamSpec("_P")
_R = TypeVar("_R")
_FIRST: list[bool] = []  # whether numbers were of double precision when something of ours was first called


@contextlib.contextmanager
def one_precision() -> Iterator[None]:
    """Answers JAX's errors about types where `jax_enable_x64` was switched since the first call of something of ours.

    JAX keeps constants as they were before, until `jax.clear_caches()`.
    """
    now = bool(jax.config.jax_enable_x64)
    if not _FIRST:
        _FIRST.append(now)
    try:
        yield
    except (TypeError, ValueError) as error:
        if now == _FIRST[0] or not re.search(r"(float|int|f|i)64", str(error)):
            raise
        raise RuntimeError(
            "`jax_enable_x64` was switched after arenas had been used: set it when the program starts, or call jax.clear_caches() "
            "and make models, batches and data anew."
        ) from error


def own_constants(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """`function`, whose own numbers may go to the device under `jax.transfer_guard("disallow")`: few, and on purpose."""

    @functools.wraps(function)
    def allowed(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with jax.transfer_guard_host_to_device("allow"), one_precision():
            return function(*args, **kwargs)

    return allowed


def of_mjx(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """`function`, in which MJX promotes ranks, which `jax.numpy_rank_promotion("raise")` would not have."""

    @functools.wraps(function)
    def allowed(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with jax.numpy_rank_promotion("allow"):
            return function(*args, **kwargs)

    return allowed
