"""What can be wrong with a call, as data: which argument, where in it, which rule, what came. `messages` puts it into words."""

import types
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

Item: TypeAlias = tuple[str, Any]
"""The thing with the problem: ("table", its index), ("object", its name), ("tables", two of them), ("entry", of a list), or a kind of
MJCF and its name; None: all of them alike."""


class TableNumber(int):
    """The number of a table, which sentences show as its name, where that is more than "table" and the number."""

    name: str | None

    def __new__(cls, number: int, name: str | None = None) -> "TableNumber":
        found = super().__new__(cls, number)
        found.name = name
        return found

    def __repr__(self) -> str:
        return int.__repr__(self) if self.name is None else repr(self.name)


class Told(str):
    """What came, or what it is, in words: sentences show it without quotes."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


def numbered(names: Sequence[str]) -> tuple[int, ...]:
    """What sentences call tables, by the names of their bodies."""
    plain = [{f"table{i}", *(["table"] if len(names) == 1 else [])} for i in range(len(names))]
    return tuple(TableNumber(i, None if name in plain[i] else name) for i, name in enumerate(names))


class Source(NamedTuple):
    """The place of a problem in a file."""

    file: str
    line: int | None = None
    node: str = ""  # what there it is about, where the problem's own path is not in the file


class Problem(NamedTuple):
    """One thing that is wrong with a call."""

    path: str
    """The argument, as one would write it: "table_rots", "objects.mass", "ranges.table_offsets.low"; may be empty."""
    rule: str
    """The rule that it breaks: a name in `messages.SENTENCES`."""
    item: Item | None = None
    """The table or object that it is about."""
    got: Any = None
    """What came; `Told` of it, where its value says less than its kind or its shape, or would keep much memory."""
    numbers: Mapping[str, Any] = types.MappingProxyType({})
    """The numbers and names of the rule, by the names that its sentence has for them."""
    world: int | None = None
    """The world with the problem, if there are many."""
    source: Source | None = None
    """The place in a file, for what came from one."""

    @property
    def key(self) -> tuple[str, Any, str]:
        """Path, index ("all": of all tables or objects) and rule: what is wrong, without its numbers."""
        if self.item is None:
            return self.path, None, self.rule
        return self.path, "all" if self.item[1] is None else self.item[1], self.rule


def problem(
    path: str,
    rule: str,
    item: Item | None = None,
    got: object = None,
    numbers: Mapping[str, Any] | None = None,
    /,
    **more: Any,
) -> Problem:
    """A problem, with the numbers of its rule by name."""
    return Problem(path, rule, item, got, {**(numbers or {}), **more})


def rounded(values: Any, digits: int = 12) -> np.ndarray:
    """Numbers as messages show them: to so many digits, without what rounding in double precision has added."""
    return np.reshape([float(f"{x:.{digits}g}") for x in np.ravel(values)], np.shape(values))


def in_world(problems: Iterable[Problem], world: int | None) -> list[Problem]:
    """The same problems, of one of many worlds."""
    return [one._replace(world=world) for one in problems]


def under(path: str, problems: Iterable[Problem], **numbers: Any) -> list[Problem]:
    """The problems of a part, as those of the whole in which it stands at `path`."""
    return [p._replace(path=f"{path}.{p.path}" if p.path else path, numbers={**p.numbers, **numbers}) for p in problems]
