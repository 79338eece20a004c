"""Equality by content, for what compiled functions hold (host)."""

import dataclasses
import functools
import hashlib
import itertools
import weakref
from collections.abc import Iterable, Mapping
from typing import Any

import mujoco
import numpy as np


class ByContent:
    """Equal to, and hashed like, another of its class with the same content, whose digest is made once.

    A frozen dataclass with `eq=False`, of numbers, strings, arrays, models, specs, and dataclasses, mappings and sequences of these.
    Of what has a `content`, only that counts. Instances of two classes differ, be it one that a notebook defined anew.
    """

    @functools.cached_property
    def digest(self) -> str:
        """The digest of the content."""
        found = hashlib.sha256()
        for piece in _pieces(self):
            found.update(piece)
        return found.hexdigest()

    def __hash__(self) -> int:
        return hash(self.digest)

    def __eq__(self, other: object) -> bool:
        return self is other or (
            isinstance(other, ByContent) and type(self) is type(other) and self.digest == other.digest
        )


def of_model(model: mujoco.MjModel) -> np.ndarray:
    """All that a compiled model is, as bytes."""
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer


_NUMBERS: weakref.WeakKeyDictionary[type, int] = weakref.WeakKeyDictionary()
_NEXT = itertools.count()


def _kind(of: type) -> bytes:
    """A class by a number of its own: what it computes is no content, and its name may be given twice."""
    return b"%d " % _NUMBERS.setdefault(of, next(_NEXT))


def _pieces(value: Any) -> Iterable[bytes]:
    """What a value is made of, as bytes."""
    if isinstance(value, mujoco.MjModel):
        yield of_model(value).tobytes()
    elif isinstance(value, mujoco.MjSpec):
        yield value.to_xml().encode()
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype.str}{value.shape}".encode()
        yield repr(value.tolist()).encode() if value.dtype.kind in "OU" else np.ascontiguousarray(value).tobytes()
    elif hasattr(value, "content"):
        yield from _pieces(value.content)
    elif dataclasses.is_dataclass(value):
        yield _kind(type(value))
        for field in dataclasses.fields(value):
            yield field.name.encode()
            yield from _pieces(getattr(value, field.name))
    elif isinstance(value, Mapping):
        yield from _pieces(tuple(value.items()))
    elif isinstance(value, (tuple, list, frozenset)):
        items = sorted(value) if isinstance(value, frozenset) else value
        yield _kind(type(value)) + b"%d" % len(items)
        for item in items:
            yield from _pieces(item)
    else:
        yield f"{type(value).__name__} {value!r}".encode()
