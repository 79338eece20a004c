"""Answers arguments that a call lacks, or that a function has not, by the names that a user knows."""

import dataclasses
import difflib
import functools
import inspect
import os
import traceback
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., Any])
_Class = TypeVar("_Class", bound=type)
ALIKE = 0.8  # for `nearest`, of names that share words: "topview" is not "frontview"
ALSO_CALLED = {
    "arena": ("Arena.from_xml",),
    "name": ("elements",),
    "names": ("elements",),
    "weight": ("mass",),
    "color": ("rgba", "diffuse"),
    "colour": ("rgba", "diffuse"),
    "position": ("pos",),
    "location": ("pos",),
    "rotation": ("rpy", "rot", "dir"),
    "orientation": ("rpy", "rot", "dir"),
    "velocity": ("start_vel", "qvel"),
    "angle": ("qpos",),
    "com": ("ipos",),
    "direction": ("dir",),
    "quat": ("rpy", "rot"),
    "euler": ("rpy", "rot"),
    "stiffness": ("kp",),
    "min": ("low",),
    "lower": ("low",),
    "max": ("high",),
    "upper": ("high",),
    "sigma": ("std",),
    "loc": ("mean",),
    "value": ("at", "values"),
    "cube": ("box",),
    "ball": ("sphere",),
    "prob": ("p",),
    "probability": ("p",),
}
"""What other libraries call things, and their names here."""


class WithKnownArguments:
    """A base class of dataclasses."""

    if not TYPE_CHECKING:  # so that type checkers know the arguments

        def __new__(cls, *args: Any, **kwargs: Any) -> Any:
            if args or kwargs:  # else it may be a copy, which is filled later
                named = [field for field in dataclasses.fields(cls) if field.init]
                needed = {field.name for field in named[len(args) :] if _is_needed(field)} - kwargs.keys()
                if not kwargs.keys() <= cls.__dataclass_fields__.keys() or needed or len(args) > len(named):
                    _check(cls.__name__, cls.__init__, kwargs)
                    _check_count(cls.__name__, cls.__init__, (None, *args), kwargs)
            return super().__new__(cls)


def _is_needed(field: dataclasses.Field) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def with_known_arguments(function: _Function) -> _Function:
    """The same function. Of a method, messages leave out the class, which may be an inner one."""
    inner = inspect.unwrap(function).__code__

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            return function(*args, **kwargs)
        except TypeError as error:
            if all(
                frame.f_code is not inner for frame, _ in traceback.walk_tb(error.__traceback__)
            ):  # it was not entered
                name = function.__qualname__.removesuffix(".__init__").rpartition(".")[2]
                _check(name, function, kwargs)
                _check_count(name, function, args, kwargs)
            raise

    return call  # type: ignore[return-value]


def made_by(ways: str) -> Callable[[_Function], _Function]:
    """Of a class whose constructor users do not call: says how its objects are made, where the arguments are others."""

    def of(init: _Function) -> _Function:
        @functools.wraps(init)
        def call(*args: Any, **kwargs: Any) -> None:
            try:
                inspect.signature(init).bind(*args, **kwargs)
            except TypeError:
                raise TypeError(f"{type(args[0]).__name__} is made by {ways}.") from None
            init(*args, **kwargs)

        return call  # type: ignore[return-value]

    return of


def with_known_methods(cls: _Class) -> _Class:
    """The same class, all of whose public methods are `with_known_arguments`."""
    for name, method in list(vars(cls).items()):
        if name.startswith("_"):
            continue
        if inspect.isfunction(method):
            setattr(cls, name, with_known_arguments(method))
        elif isinstance(method, classmethod):
            setattr(cls, name, classmethod(with_known_arguments(method.__func__)))
    return cls


def nearest(name: str, known: Iterable[str], alike: float = 0.6) -> str | None:
    """The one of the known names that means the same in other words, or else is written most alike; None if none is near.

    `alike` is from 0 to 1, which is the same name.
    """
    known = tuple(known)
    head, dot, last = name.rpartition(".")
    same = (f"{head}{dot}{other}" for other in ALSO_CALLED.get(last.lower(), ()))
    return next(
        (one for one in same if one in known),
        next(iter(difflib.get_close_matches(name, known, n=1, cutoff=alike)), None),
    )


def letters(name: str) -> str:
    """A name without its digits: another number is no misspelling."""
    return "".join(c for c in name if not c.isdigit())


def near_file(path: str) -> str:
    """The end of a sentence about a file that is not there: the one beside it whose name is nearest; "" if none is near."""
    folder, name = os.path.split(path)
    try:
        beside = {one.lower(): one for one in sorted(os.listdir(folder or ".")) if one != name}
    except (OSError, ValueError):
        return ""
    kind = os.path.splitext(name)[1].lower()
    close = difflib.get_close_matches(name.lower(), [one for one in beside if os.path.splitext(one)[1] == kind], n=1)
    return f", but {beside[close[0]]!r}" if close else ""


def hint(name: str, known: Sequence[str]) -> str:
    """The end of a sentence about a name that is not among those that are known."""
    close = nearest(name, known)
    return f": did you mean {close!r}?" if close else f"; there {'are' if len(known) > 1 else 'is'} {', '.join(known)}."


def _parameters(function: Callable[..., Any]) -> list[inspect.Parameter]:
    """All but the object or the class of a method."""
    return [one for one in inspect.signature(function).parameters.values() if one.name not in ("self", "cls")]


def _check(name: str, function: Callable[..., Any], given: Iterable[str]) -> None:
    parameters = _parameters(function)
    if any(one.kind is one.VAR_KEYWORD for one in parameters):
        return
    check_known(name, [one.name for one in parameters if one.kind is not one.VAR_POSITIONAL], given)


def check_known(name: str, known: Sequence[str], given: Iterable[str]) -> None:
    """Names of arguments that something takes.

    Raises:
        TypeError: one of them is none of its names.
    """
    for one in given:
        if one not in known:
            has = f"no argument {one!r}{hint(one, known)}" if known else f"no arguments, got {one!r}."
            raise TypeError(f"{name} has {has}") from None


def _check_count(name: str, function: Callable[..., Any], args: Sequence[Any], given: Iterable[str]) -> None:
    """Refuses too many arguments by place, and those that are left out."""
    parameters = _parameters(function)
    n_given = len(args) - (len(inspect.signature(function).parameters) - len(parameters))
    by_place = [one.name for one in parameters if one.kind in (one.POSITIONAL_ONLY, one.POSITIONAL_OR_KEYWORD)]
    if n_given > len(by_place) and not parameters:
        raise TypeError(f"{name} takes no arguments, got {n_given}.") from None
    if n_given > len(by_place) and not by_place:
        one = "a" if parameters[0].kind is inspect.Parameter.VAR_KEYWORD else parameters[0].name
        like = f"{name}({one}=...)"
        raise TypeError(f"{name} takes arguments by name alone, as in {like}, got {n_given} without a name.") from None
    if n_given > len(by_place):
        takes = f"at most {len(by_place)} without a name ({', '.join(by_place)})"
        raise TypeError(f"{name} takes {takes}, got {n_given}.") from None
    needed = [
        one.name
        for one in parameters
        if one.default is one.empty and one.kind not in (one.VAR_POSITIONAL, one.VAR_KEYWORD)
    ]
    lacks = [repr(one) for one in needed if one not in (*by_place[:n_given], *given)]
    if lacks:
        *others, last = lacks
        raise TypeError(f"{name} must be given {', '.join(others)}{' and ' if others else ''}{last}.") from None


def quoted(names: Collection[str]) -> str:
    """Names in quotation marks, as a list in words."""
    *rest, last = map(repr, names) if names else [""]
    return f"{', '.join(rest)} and {last}" if rest else last
