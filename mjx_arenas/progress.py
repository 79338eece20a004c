"""How much of long work is done (host)."""

from collections.abc import Callable
from typing import TypeAlias

Tell: TypeAlias = Callable[[int, int], None]
"""Told how much is done, and of how much."""


def silent(done: int, of: int) -> None:
    """A `Tell` that says nothing."""


def teller(progress: Tell | None) -> Tell:
    """What to tell; None: nothing.

    Raises:
        TypeError: it cannot be told anything.
    """
    if progress is not None and not callable(progress):
        raise TypeError(
            f"`progress` must be a function of how much is done and of how much, or None, got {progress!r}."
        )
    return progress or silent
