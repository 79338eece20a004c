"""What was made of a model, kept as long as the model lives."""

import weakref
from typing import Any


class Latest:
    """What was made last, of one model and something else; it keeps no model alive, and goes with its own."""

    def __init__(self) -> None:
        self._kept: tuple[weakref.ref | None, Any, Any] = (None, None, None)

    def of(self, model: Any, other: Any) -> Any:
        """What was made of this very model and something equal to `other`; None if that was not the last."""
        ref, of, made = self._kept
        return made if ref is not None and ref() is model and of == other else None

    def keep(self, model: Any, other: Any, made: Any) -> Any:
        """`made`, kept until the model goes or the next is."""
        self._kept = weakref.ref(model, self._forget), other, made
        return made

    def _forget(self, ref: weakref.ref) -> None:
        if self._kept[0] is ref:
            self._kept = (None, None, None)
