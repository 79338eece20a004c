"""How much of long work is done (host)."""

from collections.abc import Callable
from typing import TypeAlias

Tell: TypeAlias = Callable[[int, int], None]
"""A function that is told the finished and the total work."""


def silent(done: int, of: int) -> None:
    """A `Tell` that says nothing."""


def teller(progress: Tell | None) -> Tell:
    """What to tell; None: nothing.

    Raises:
        TypeError: it cannot be told anything.
    """
    if progress is not None and not callable(progress):
        from mjx_arenas.problem import problem
        from mjx_arenas.problems.messages import error  # which imports JAX

        must = "None or a function of two numbers, the finished and the total work"
        raise error([problem("progress", "must", None, progress, must=must)], kind=TypeError)
    return progress or silent
