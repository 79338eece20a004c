"""Python calls as plain data: how an arena remembers what it was made of, and what a file may say (host).

The signatures of the constructors are all that is known here: a new argument needs no change.
"""

import dataclasses
import functools
import inspect
import os
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from mjx_arenas.spec import specs


class Call(NamedTuple):
    """A call: what is called, and its arguments, those that were given."""

    function: Callable
    arguments: dict[str, Any]
    """Numbers, strings and lists of them, and calls, by name; what is none of these (a `MjSpec`, pixels) as it is."""


class Made(tuple[Call, ...]):
    """The calls that made an arena, in order; none where it was made in another way."""


class Parameter(NamedTuple):
    """An argument as a signature describes it."""

    required: bool
    accepts: tuple[type, ...]  # the classes that its annotation names; empty where it is Any
    is_list: bool
    default: Any

    @property
    def is_path(self) -> bool:
        """Whether it may be the path of a file."""
        return os.PathLike in self.accepts


@functools.cache
def parameters(function: Callable) -> dict[str, Parameter]:
    """The arguments of a function or a class, by name."""
    annotated = typing.get_type_hints(_annotated(function))
    found = {}
    for name, parameter in inspect.signature(function).parameters.items():
        if name in ("self", "cls") or parameter.kind == inspect.Parameter.VAR_KEYWORD:
            continue
        accepts, is_list = _classes(annotated.get(name, Any))
        required = parameter.default is inspect.Parameter.empty
        found[name] = Parameter(required, accepts, is_list, parameter.default)
    return found


@functools.cache
def others(function: Callable) -> tuple[str, Parameter] | None:
    """The name and the kind of the arguments that may have any name (`**terms`), if there are such."""
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind == inspect.Parameter.VAR_KEYWORD:
            accepts, is_list = _classes(typing.get_type_hints(function)[name])
            return name, Parameter(False, accepts, is_list, None)
    return None


def of(function: Callable, arguments: Mapping[str, Any]) -> Call:
    """The call of `function` with `arguments` (its `locals()`), without those that are its defaults."""
    given = {}
    for name, parameter in parameters(function).items():
        value = plain(arguments[name], parameter.is_path)
        if parameter.required or not _same(value, plain(parameter.default)):
            given[name] = value
    more = others(function)
    given |= {name: plain(value) for name, value in arguments[more[0]].items()} if more else {}
    return Call(function, given)


def plain(value: Any, is_path: bool = False) -> Any:
    """A value as numbers, strings and lists of them, and calls; what cannot be is as it is. Paths become absolute."""
    if isinstance(value, (Call, Made)):
        return value
    if _are_pixels(value):
        return np.asarray(value)
    if is_path and isinstance(value, (str, os.PathLike)):
        text = os.fspath(value)
        return text if specs.is_mjcf(text) else os.path.abspath(text)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return of(type(value), {f.name: getattr(value, f.name) for f in dataclasses.fields(value)})
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (np.ndarray, np.generic, jax.Array)) and not isinstance(value, jax.core.Tracer):
        array = np.asarray(value)
        if array.dtype.kind == "f" and array.dtype != float:  # 0.05, not 0.05000000074505806
            array = np.array([float(str(x)) for x in array.ravel()]).reshape(array.shape)
        return array.tolist()
    return value


def _are_pixels(value: Any) -> bool:
    return isinstance(value, (np.ndarray, jax.Array)) and value.dtype == np.uint8 and value.ndim == 3


def _same(a: Any, b: Any) -> bool:
    return type(a) is type(b) and a == b


def _annotated(function: Callable) -> Any:
    """The function that has the annotations of a call's arguments."""
    plain_init = isinstance(function, type) and not (dataclasses.is_dataclass(function) or issubclass(function, tuple))
    return function.__init__ if plain_init else function  # type: ignore[misc]


def _classes(annotation: Any) -> tuple[tuple[type, ...], bool]:
    """The classes of an annotation, and whether it is a sequence of them."""
    origin = typing.get_origin(annotation)
    if origin in (typing.Union, types.UnionType):
        given = [part for part in typing.get_args(annotation) if part is not types.NoneType]
        parts = [_classes(part) for part in given]
        if len(parts) == 1:
            return parts[0]
        return tuple(cls for classes, is_list in parts if not is_list for cls in classes), False
    if origin is Sequence:
        return _classes(typing.get_args(annotation)[0])[0], True
    return (annotation,) if isinstance(annotation, type) and annotation is not Any else (), False
