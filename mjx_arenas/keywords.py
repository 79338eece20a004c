"""Answers an argument that is not there with the nearest that is; from 3.13 on, Python does so itself where names are alike."""

import difflib
import functools
import inspect
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., Any])


class WithKnownArguments:
    """A base class of dataclasses."""

    if not TYPE_CHECKING:  # so that type checkers know the arguments

        def __new__(cls, *args: Any, **kwargs: Any) -> Any:
            if not kwargs.keys() <= cls.__dataclass_fields__.keys():
                _check(cls.__name__, cls.__init__, kwargs)
            return super().__new__(cls)


def with_known_arguments(function: _Function) -> _Function:
    """The same function."""

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            return function(*args, **kwargs)
        except TypeError as error:
            if error.__traceback__ is not None and error.__traceback__.tb_next is None:  # it was not entered
                name = function.__qualname__.removesuffix(".__init__").rpartition(".")[2]
                _check(name, function, kwargs)
            raise

    return call  # type: ignore[return-value]


def hint(name: str, known: Sequence[str]) -> str:
    """The end of a sentence about a name that is not among those that are known."""
    close = difflib.get_close_matches(name, known, n=1)
    return f": did you mean {close[0]!r}?" if close else f"; there are {', '.join(known)}."


def _check(name: str, function: Callable[..., Any], given: Iterable[str]) -> None:
    parameters = list(inspect.signature(function).parameters.values())
    if any(one.kind is inspect.Parameter.VAR_KEYWORD for one in parameters):
        return
    known = [one.name for one in parameters if one.name != "self" and one.kind is not one.VAR_POSITIONAL]
    for one in given:
        if one not in known:
            raise TypeError(f"{name} has no argument {one!r}{hint(one, known)}") from None
