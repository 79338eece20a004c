"""What a command says: in colour and with bars on a terminal, plain elsewhere."""

import contextlib
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from typing import Any, Protocol, TypeVar

import click

from mjx_arenas.progress import Tell, silent

_T = TypeVar("_T", covariant=True)


class _Sized(Sized, Iterable[_T], Protocol[_T]):
    """Things that can be counted."""


@contextlib.contextmanager
def busy(what: str) -> Iterator[Tell]:
    """Says what takes time, on a terminal: with a bar once it is told how much of it is done."""
    if not sys.stderr.isatty():
        yield silent
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        ProgressColumn,
        SpinnerColumn,
        Task,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
    )
    from rich.text import Text

    class IfKnown(ProgressColumn):
        """A column that is there once it is known how much there is to do."""

        def __init__(self, column: ProgressColumn) -> None:
            super().__init__()
            self.column = column

        def render(self, task: Task) -> Any:
            return self.column(task) if task.total else Text("")

    columns = (TextColumn("{task.description}"), IfKnown(BarColumn(30)), IfKnown(TaskProgressColumn()))
    console = Console(stderr=True)
    with Progress(SpinnerColumn(), *columns, TimeElapsedColumn(), console=console, transient=True) as progress:
        task = progress.add_task(what, total=None)
        yield lambda done, of: progress.update(task, completed=done, total=of)


def counted(things: _Sized[_T], tell: Tell) -> Iterator[_T]:
    """The things one after the other, while `tell` is told how many were done."""
    for done, thing in enumerate(things):
        tell(done, len(things))
        yield thing
    tell(len(things), len(things))


@contextlib.contextmanager
def answered(*kinds: type[Exception]) -> Iterator[None]:
    """Makes the library's answers to wrong input, errors of these kinds, the command's."""
    try:
        yield
    except kinds as error:
        raise click.ClickException(sentence(error)) from error


def sentence(error: Exception) -> str:
    """What an error says; of the system's own, without its number."""
    if isinstance(error, OSError) and error.strerror:
        where = "" if error.filename is None else f"{os.fspath(error.filename)!r}: "
        return f"{where}{error.strerror}."
    return str(error)


def each_once() -> Callable[..., None]:
    """What shows a warning, as `warnings.showwarning`, unless it was shown before, with or without the line of a file."""
    said = set()

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        if (plain := re.sub(r"^\S+:\d+: ", "", str(message))) not in said:
            said.add(plain)
            warn(str(message))

    return show


def warn(sentence: str) -> None:
    """A sentence on stderr."""
    click.secho("warning: ", fg="yellow", nl=False, err=True)
    click.echo(sentence, err=True)


def count(number: int, thing: str) -> str:
    """Such as 1 world, 1,000 worlds."""
    return f"{number:,} {thing}{'s' * (number != 1)}"


def listed(names: Sequence[str], last: str = "or") -> str:
    """Such as a, b or c."""
    return f" {last} ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))
