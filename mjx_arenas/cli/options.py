"""What commands take: kinds of arguments, checked at once, and the options that several commands share."""

import functools
import itertools
import pathlib
from collections.abc import Callable, Sequence
from typing import Any, NoReturn, TypeVar

import click

from mjx_arenas.cli.terminal import answered, count, listed
from mjx_arenas.files import output, paths

FILES = (".png", ".jpg", ".pdf", ".svg", ".mp4", ".gif", ".csv", ".npz", ".parquet", ".json", ".yaml", ".xml", ".html")
"""How names end that no one gives a folder."""
MEANT = {"plot": "stats", "describe": "stats", "draw": "render", "show": "view", "test": "check", "learn": "train"}
"""Commands by other names."""
MOST = 2**32 - 1  # the largest seed and number of a world

_Command = TypeVar("_Command", bound=Callable)
_Checked = Callable[[click.Context, click.Parameter, pathlib.Path | None], pathlib.Path | None]


class _Formatter(click.HelpFormatter):
    """Headings stand out on a terminal."""

    def write_heading(self, heading: str) -> None:
        super().write_heading(click.style(heading, bold=True))


class _Context(click.Context):
    formatter_class = _Formatter


class Command(click.Command):
    """A command of `mjx-arenas`."""

    context_class = _Context


class Group(click.Group):
    """Lists its commands in the order of a piece of work."""

    context_class = _Context

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] in MEANT:
            raise click.UsageError(f"No such command {args[0]!r}. Did you mean {MEANT[args[0]]!r}?", ctx)
        return super().resolve_command(ctx, args)


class File(click.ParamType):
    """A file that comes along, by its name, or one of the user's: by default one that describes an arena."""

    name = "file"

    def __init__(self, find: Callable[[str], pathlib.Path | str] = paths.find) -> None:
        self.find = find  # answers by the file

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> pathlib.Path | str:
        with answered(ValueError, OSError):
            return self.find(value)


class Whole(click.ParamType):
    """A whole number within limits."""

    name = "N"

    def __init__(self, least: int, most: int) -> None:
        self.least, self.most = least, most

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        try:
            number = int(value)
        except ValueError:
            number = None
        if number is None or not self.least <= number <= self.most:
            self.fail(f"{value!r} is not a whole number from {self.least} to {self.most:,}.", param, ctx)
        return number


class Positive(click.ParamType):
    """A number with a unit, above 0 and within a limit."""

    name = "number"

    def __init__(self, most: float, unit: str) -> None:
        self.most, self.unit = most, unit

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            number = float(value)
        except ValueError:
            number = 0.0
        if not 0 < number <= self.most:
            self.fail(f"{value!r} is not a number above 0, up to {self.most:g} [{self.unit}].", param, ctx)
        return number


class Size(click.ParamType):
    """Width and height of a picture: "480x360"."""

    name = "WxH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        sides = value.split("x")
        if len(sides) == 2 and all(side.isdecimal() and len(side) < 5 and 0 < int(side) <= 4096 for side in sides):
            return int(sides[0]), int(sides[1])
        self.fail(f"{value!r} is not a size in pixels up to 4096x4096, such as 480x360.", param, ctx)


class Worlds(click.ParamType):
    """Numbers of worlds, each once: "0,5,17", "0-5,17"."""

    name = "I,I-I,..."

    def __init__(self, most: int) -> None:
        self.most = most  # at a time

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> list[int]:
        def refuse(sentence: str) -> NoReturn:
            self.fail(sentence, param, ctx)

        parts = []
        for part in value.split(","):
            ends = [end.strip() for end in part.split("-")]
            if len(ends) > 2 or not all(end.isdecimal() and len(end) < 20 for end in ends):
                refuse(f"{value!r} is not a list of worlds such as 0,5,17 or 0-5,17.")
            first, last = int(ends[0]), int(ends[-1])
            if last > MOST:
                refuse(f"{last} is not the number of a world, which is from 0 to {MOST:,}.")
            if first > last:
                refuse(f"{part.strip()!r} runs backwards: give {last}-{first}.")
            parts.append(range(first, last + 1))
        if sum(map(len, parts)) > self.most:
            refuse(f"{value!r} are {sum(map(len, parts)):,} worlds, more than {self.most:,} at a time.")
        return list(dict.fromkeys(itertools.chain(*parts)))


def of_worlds(default: int, most: int) -> Callable[[_Command], _Command]:
    """The options that choose worlds, of which there may be so many: `numbers`, and their `seed`."""

    def add(command: _Command) -> _Command:
        @functools.wraps(command)
        def chosen(*args: Any, n: int | None, worlds: Sequence[int] | None, **given: Any) -> Any:
            if n is not None and worlds is not None:
                raise click.UsageError("Give -n or --worlds, not both.")
            return command(*args, numbers=range(n or default) if worlds is None else worlds, **given)

        seed = click.option(
            "--seed", type=Whole(0, MOST), default=0, metavar="S", help="Seed of all worlds.  [default: 0]"
        )
        exactly = click.option("--worlds", type=Worlds(most), help="Exactly these worlds, each once: 0,5,17 or 0-5,17.")
        number = click.option("-n", type=Whole(1, most), help=f"Worlds 0 to N - 1.  [default: {default}]", metavar="N")
        return number(exactly(seed(chosen)))  # type: ignore[return-value]

    return add


def of_one_world(command: _Command) -> _Command:
    """The options that choose one world."""
    seed = click.option("--seed", type=Whole(0, MOST), default=0, metavar="S", help="Seed of the world.  [default: 0]")
    number = click.option("--world", type=Whole(0, MOST), metavar="I", help="Number of the world.  [default: 0]")
    return number(seed(command))


def how_many(default: int, least: int = 1) -> Callable[[_Command], _Command]:
    """`-n`, of worlds that are the first ones: `n`."""
    kind = Whole(least, 1_000_000)
    return click.option("-n", type=kind, help=f"Number of worlds.  [default: {default}]", metavar="N")


def engine(of: str, more: str = "") -> Callable[[_Command], _Command]:
    """The option that chooses what steps worlds."""
    text = f"What {of}. {more}".rstrip() + "  [default: warp on an NVIDIA GPU, else c]"
    return click.option("--engine", type=click.Choice(["c", "jax", "warp"]), help=text)


MJX_ENGINE = ("--engine", "--impl", "impl")
"""The option of commands that step by MJX alone, with its older name, and the argument."""
MJX_ENGINES: dict[str, Any] = {"type": click.Choice(["jax", "warp"])}
MJX_ENGINE_HELP = "Implementation of MJX that steps.  [default: warp on an NVIDIA GPU, else jax]"


def mjx_engine(command: _Command) -> _Command:
    """The option that chooses the implementation of MJX: `impl`."""
    return click.option(*MJX_ENGINE, **MJX_ENGINES, help=MJX_ENGINE_HELP)(command)


def keyframe(command: _Command) -> _Command:
    """The option that names the keyframe that robots are in."""
    text = "Keyframe in which robots start.  [default: at rest at qpos0]"
    return click.option("--keyframe", help=text, metavar="NAME")(command)


def state(command: _Command) -> _Command:
    """The option that gives the state of the one world that is shown."""
    return click.option(
        "--state",
        type=click.Path(exists=True, dir_okay=False, path_type=pathlib.Path),
        help="An .npz file with `qpos` of the world, and `qvel`, `act`, `ctrl`, `mocap_pos` or `mocap_quat`.",
        metavar="FILE",
    )(command)


def file_out(suffixes: Sequence[str], text: str, required: bool = True) -> Callable[[_Command], _Command]:
    """`--out` of a file, checked before any work."""

    def check(ctx: click.Context, param: click.Parameter, path: pathlib.Path | None) -> pathlib.Path | None:
        if path is None:
            return None
        if path.suffix not in suffixes:
            raise click.BadParameter(f"{str(path)!r} must end in {listed(suffixes)}.")
        if _exists(path) and path.is_dir():
            raise click.BadParameter(f"{str(path)!r} is a folder.")
        _check_parent(path)
        return path

    return _out(check, text, "FILE", required)


def folder_out(
    text: str,
    required: bool = False,
    empty: bool = False,
    parents: bool = False,
    default: str | None = None,
) -> Callable[[_Command], _Command]:
    """`--out` of a folder, checked before any work.

    Args:
        text: what it is.
        required: it must be given.
        empty: it may be there already only if it is empty.
        parents: the folders that it stands in are made, too.
        default: where it must not be given.
    """

    def check(ctx: click.Context, param: click.Parameter, path: pathlib.Path | None) -> pathlib.Path | None:
        if path is None:
            return None
        if path.suffix in FILES and not _exists(path):
            raise click.BadParameter(
                f"{str(path)!r} is the name of a file, and a folder is made: leave out {path.suffix}."
            )
        there = next(p for p in (path, *path.parents) if _exists(p)) if parents or _exists(path) else path.parent
        if _exists(there) and not there.is_dir():
            raise click.BadParameter(f"{str(there)!r} is a file, not a folder.")
        with answered(OSError):
            if empty and there == path and any(path.iterdir()):
                must = "give one that is empty or new"
                raise click.BadParameter(f"{str(path)!r} is a folder with something in it: {must}.")
        _check_parent(there / "it")
        return path

    return _out(check, text, "DIR", required, default)


def _out(
    check: _Checked, text: str, metavar: str, required: bool, default: str | None = None
) -> Callable[[_Command], _Command]:
    given: dict[str, Any] = {"required": True} if required else {"default": default}
    kind = click.Path(path_type=pathlib.Path)
    return click.option("-o", "--out", "out", type=kind, callback=check, help=text, metavar=metavar, **given)


def _exists(path: pathlib.Path) -> bool:
    """Whether something is there; refuses a path of which the system does not even say that."""
    with answered(OSError):
        try:
            path.stat()
        except (FileNotFoundError, NotADirectoryError):
            return False
    return True


def _check_parent(path: pathlib.Path) -> None:
    if not path.parent.is_dir():
        raise click.BadParameter(f"there is no folder {str(path.parent)!r}.")
    with answered(OSError):
        output.check_folder(path.parent)


def check_pixels(size: tuple[int, int], pictures: int, most: float) -> None:
    """Refuses pictures that no memory holds; `most` in megapixels."""
    got = size[0] * size[1] * pictures / 1e6
    if got > most:
        each = f"{count(pictures, 'picture')} of {size[0]}x{size[1]}"
        raise click.UsageError(f"{each} are {got:,.0f} megapixels, more than {most:g}: give fewer or smaller ones.")
