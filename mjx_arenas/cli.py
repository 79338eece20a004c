"""The command line, `mjx-arenas`.

Commands import what is heavy themselves, so that `--help` and wrong use are answered at once.
"""

import contextlib
import itertools
import json as json_
import os
import pathlib
import signal
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, NoReturn, TypeVar

from mjx_arenas import paths

try:
    import click
except ImportError:
    sys.exit("mjx-arenas needs click: pip install 'mjx_arenas[cli]'.")

if TYPE_CHECKING:
    from rich.console import Console

    from mjx_arenas.arena import Arena
    from mjx_arenas.params import ArenaParams, ArenaRanges
    from mjx_arenas.tables import Summary

WRONG_USE, OUR_MISTAKE, INTERRUPTED = 2, 70, 130
TABLES = (".npz", ".csv", ".parquet")

_Command = TypeVar("_Command", bound=Callable)


class _Formatter(click.HelpFormatter):
    """Headings stand out on a terminal."""

    def write_heading(self, heading: str) -> None:
        super().write_heading(click.style(heading, bold=True))


class _Context(click.Context):
    formatter_class = _Formatter


class _OneCommand(click.Command):
    context_class = _Context


class _Group(click.Group):
    """Lists its commands in the order of a piece of work."""

    context_class = _Context
    command_class = _OneCommand

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="mjx_arenas")
def app() -> None:
    """See and keep any of thousands of randomized arenas.

    FILE is a .yaml or .json file that describes an arena and what varies (mjx_arenas.load), or the name of an example:
    clutter, pick_and_place, robosuite_multi_table, robosuite_table, shelf.

    World I of seed S is the same in every command, however many others there are.

    \b
    Examples:
      mjx-arenas demo                                        the main job, shown
      mjx-arenas stats shelf                                 what varies, between which values
      mjx-arenas stats shelf -o plots                        the same as pictures
      mjx-arenas sample shelf -n 1000 --seed 3 -o worlds.csv parameters of 1,000 worlds
      mjx-arenas render shelf -n 12 -o grid.png              twelve worlds, drawn
      mjx-arenas render shelf --worlds 5 -o five.mp4         world 5 in motion
      mjx-arenas view shelf --tile 9                         nine worlds in MuJoCo's viewer
      mjx-arenas export shelf --world 5 -o world_5           world 5 as MJCF with its assets
      mjx-arenas check shelf -n 256 --steps 500              which worlds fail, and why
      mjx-arenas replay out/check/world_17                   a world that failed, in C MuJoCo

    \b
    Exit codes: 0 fine, 1 check found something or replay did not, 2 wrong use (one sentence says what),
    70 a mistake of ours, 130 interrupted.
    """


class _Stop:
    """What a signal that asks this process to stop does."""

    def __init__(self) -> None:
        self.signals: list[int] = []
        self.importing = False

    def __call__(self, number: int, _: object) -> None:
        if self.importing:  # half of a module would fail in its own way, and there is nothing to tidy up yet
            show_cursor = b"\r\x1b[K\x1b[?25h" if sys.stderr.isatty() else b""
            os.write(2, show_cursor + b"interrupted\n")
            os._exit(128 + number)
        self.signals.append(number)
        signal.setitimer(signal.ITIMER_REAL, 1.0)  # again, as callbacks of the garbage collector swallow it
        raise KeyboardInterrupt

    @contextlib.contextmanager
    def at_once(self) -> Iterator[None]:
        """Imports of what is heavy."""
        self.importing = True
        try:
            yield
        finally:
            self.importing = False


_stop = _Stop()


def run() -> NoReturn:
    """The process `mjx-arenas`."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
        signal.signal(number, _stop)
    sys.unraisablehook = _unraisable
    warnings.showwarning = _show_warning
    code = main()
    signal.setitimer(signal.ITIMER_REAL, 0)
    sys.exit(128 + _stop.signals[0] if _stop.signals else code)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command; gives its exit code.

    Args:
        arguments: of the command line; None: those of the process.
    """
    try:
        return app.main(arguments, prog_name="mjx-arenas", standalone_mode=False) or 0
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        return WRONG_USE
    except click.ClickException as error:
        command = getattr(error, "ctx", None)
        more = f" See {command.command_path} --help." if command else ""
        click.secho("error: ", fg="red", bold=True, nl=False, err=True)
        click.echo(error.format_message() + more, err=True)
        return WRONG_USE
    except (click.Abort, KeyboardInterrupt):
        click.echo("interrupted", err=True)
        return INTERRUPTED
    except SystemExit as error:  # 1: click's, when whoever read the output has had enough; others: the demo's
        return 0 if error.code == 1 else int(error.code or 0)
    except Exception:
        if _stop.signals:  # what was interrupted can fail in its own way
            click.echo("interrupted", err=True)
            return INTERRUPTED
        traceback.print_exc()
        return OUR_MISTAKE


def _unraisable(unraisable: Any) -> None:
    if not _stop.signals:
        sys.__unraisablehook__(unraisable)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    click.secho("warning: ", fg="yellow", nl=False, err=True)
    click.echo(str(message), err=True)


@contextlib.contextmanager
def _answered(*kinds: type[Exception]) -> Iterator[None]:
    """Makes the library's answers to wrong input, errors of these kinds, the command's."""
    try:
        yield
    except kinds as error:
        raise click.ClickException(str(error)) from error


class _File(click.ParamType):
    """A file that describes an arena, or an example's name."""

    name = "file"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> pathlib.Path:
        try:
            return paths.find(value)
        except (ValueError, OSError) as error:
            raise click.ClickException(str(error)) from None


class _Whole(click.IntRange):
    name = "whole number"


class _Numbers(click.ParamType):
    """Numbers of worlds: "0,5,17"."""

    name = "I,I,..."

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> list[int]:
        numbers = [part.strip() for part in value.split(",")]
        if all(part.isdecimal() and int(part) < 2**32 for part in numbers):
            return [int(part) for part in numbers]
        self.fail(f"{value!r} is not a list of worlds such as 0,5,17.", param, ctx)


def _of_worlds(default: int, most: int) -> Callable[[_Command], _Command]:
    """The options that choose worlds, of which there may be so many."""

    def add(command: _Command) -> _Command:
        seed = click.option(
            "--seed", type=_Whole(0, 2**32 - 1), default=0, metavar="S", help="Of all worlds.  [default: 0]"
        )
        worlds = click.option("--worlds", type=_Numbers(), help="Exactly these worlds.")
        number = click.option(
            "-n", "n", type=_Whole(1, most), help=f"Worlds 0 to N - 1.  [default: {default}]", metavar="N"
        )
        return number(worlds(seed(command)))

    return add


def _chosen(n: int | None, worlds: list[int] | None, default: int) -> Sequence[int]:
    if n is not None and worlds is not None:
        raise click.UsageError("Give -n or --worlds, not both.")
    return range(default if n is None else n) if worlds is None else worlds


def _out(suffixes: Sequence[str]) -> Callable[[click.Context, click.Parameter, pathlib.Path], pathlib.Path]:
    """Checks at once, before any work, that an output can be written."""

    def check(ctx: click.Context, param: click.Parameter, path: pathlib.Path) -> pathlib.Path:
        if path.suffix not in suffixes:
            ends = " or ".join(filter(None, (", ".join(suffixes[:-1]), suffixes[-1])))
            raise click.BadParameter(f"{str(path)!r} must end in {ends}.")
        if path.is_dir():
            raise click.BadParameter(f"{str(path)!r} is a folder.")
        if not path.parent.is_dir():
            raise click.BadParameter(f"there is no folder {str(path.parent)!r}.")
        return path

    return check


def _console() -> "Console":
    """Where tables go: in colour and as wide as it is on a terminal, plain and as wide as they are elsewhere."""
    from rich.console import Console

    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = 1000
    return console


@contextlib.contextmanager
def _busy(what: str) -> Iterator[None]:
    """Says what takes time, on a terminal."""
    from rich.console import Console

    with Console(stderr=True).status(what) if sys.stderr.isatty() else contextlib.nullcontext():
        yield


def _compile_quickly() -> None:
    """Makes XLA compile for a few worlds; call it before JAX is imported. Flags that are set stay."""
    os.environ.setdefault("XLA_FLAGS", "--xla_backend_optimization_level=0")


def _load(file: pathlib.Path) -> tuple["Arena", "ArenaRanges"]:
    _compile_quickly()
    with _busy("loading"):
        with _stop.at_once():
            from mjx_arenas import files
        with _answered(ValueError, TypeError, OSError, ImportError):
            return files.load(file)


@app.command(context_settings={"ignore_unknown_options": True, "help_option_names": []}, add_help_option=False)
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def demo(arguments: tuple[str, ...]) -> None:
    """Randomize 1,024 arenas, drop objects on them, compare, draw (see demo --help)."""
    from mjx_arenas import demo

    demo.main(arguments, prog="mjx-arenas demo")


@app.command()
@click.argument("file", type=_File())
@_of_worlds(1000, 10_000_000)
@click.option(
    "-o",
    "out",
    type=click.Path(path_type=pathlib.Path),
    required=True,
    callback=_out(TABLES),
    help="A .npz, .csv or .parquet file; one that is there is replaced.",
    metavar="OUT",
)
@click.option("--json", is_flag=True, help="Say what was written as JSON.")
def sample(
    file: pathlib.Path, n: int | None, worlds: list[int] | None, seed: int, out: pathlib.Path, json: bool
) -> None:
    """Parameters of many worlds as a table, a row for each.

    A .csv or .parquet file has a column for each number, such as table_offsets.table0.z; a .npz file has the arrays of
    mjx_arenas.ArenaParams. `valid` says whether the world can be.

    \b
    Examples:
      mjx-arenas sample shelf -n 1000 --seed 3 -o worlds.parquet
      mjx-arenas sample arena.yaml --worlds 0,5,17 -o three.csv    the same rows 0, 5 and 17
    """
    numbers = _chosen(n, worlds, 1000)
    arena, ranges = _load(file)
    from mjx_arenas import tables

    with _answered(OSError, ImportError), _busy(f"drawing {len(numbers):,} worlds"):
        drawn = tables.draw(arena, ranges, seed, numbers)
        tables.write(out, arena, drawn)
    valid = int(drawn.valid.sum())
    if json:
        click.echo(json_.dumps({"file": str(out), "seed": seed, "worlds": len(numbers), "valid": valid}))
    else:
        click.echo(f"{out}: {len(numbers):,} worlds of {file.name}, seed {seed}; {valid:,} are valid")


@app.command()
@click.argument("file", type=_File())
@_of_worlds(1000, 10_000_000)
@click.option(
    "-o",
    "out",
    type=click.Path(path_type=pathlib.Path, file_okay=False),
    help="Folder for histograms.png, coverage.png and pairs.png; those that are there are replaced.",
    metavar="DIR",
)
@click.option("--json", is_flag=True, help="The table as JSON.")
def stats(
    file: pathlib.Path, n: int | None, worlds: list[int] | None, seed: int, out: pathlib.Path | None, json: bool
) -> None:
    """What varies, between which values, as a table and as plots.

    \b
    Examples:
      mjx-arenas stats shelf
      mjx-arenas stats arena.yaml -n 10000 -o plots
      mjx-arenas stats arena.yaml --json | jq '.varies[] | select(.axis == "z")'
    """
    numbers = _chosen(n, worlds, 1000)
    if out is not None and not out.parent.is_dir():
        raise click.BadParameter(f"there is no folder {str(out.parent)!r}.", param_hint="'-o'")
    arena, ranges = _load(file)
    from mjx_arenas import tables

    with _busy(f"drawing {len(numbers):,} worlds"):
        drawn = tables.draw(arena, ranges, seed, numbers)
        columns = tables.columns(arena, drawn.params)
    written = []
    if out is not None:
        with _answered(OSError, ImportError), _busy("plotting"):
            from mjx_arenas import plots

            written = plots.write(out, arena, columns, drawn)
    found = tables.summaries(columns)
    valid = int(drawn.valid.sum())
    if json:
        data = {"seed": seed, "worlds": len(numbers), "valid": valid, "varies": [s._asdict() for s in found]}
        click.echo(json_.dumps(data | ({"files": written} if written else {}), indent=2))
        return
    _print_table(found)
    click.echo(f"{len(numbers):,} worlds of {file.name}, seed {seed}; {valid:,} are valid")
    for path in written:
        click.echo(path)


def _print_table(found: Sequence["Summary"]) -> None:
    from rich.table import Table
    from rich.text import Text

    from mjx_arenas.params import QUANTITIES

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for title in ("quantity", "of", "axes", "nominal", "least", "mean", "most"):
        table.add_column(title)
    before = ""
    for (quantity, item), grouped in itertools.groupby(found, lambda s: (s.quantity, s.item)):
        group = list(grouped)
        one = group[0]
        title = f"{quantity} {one.unit}" if quantity != before else ""
        before = quantity
        cells = [" ".join(f"{getattr(s, name):.3g}" for s in group) for name in ("nominal", "min", "mean", "max")]
        if QUANTITIES[quantity].kind is bool:
            cells = ["yes" if one.nominal else "no", "no", f"yes in {one.mean:.1%}", "yes"]
        elif QUANTITIES[quantity].kind is int:
            cells[2] = ""
        table.add_row(*map(Text, (title, item, " ".join(s.axis for s in group), *cells)))
    if found:
        _console().print(table)
    else:
        click.echo("nothing varies")


class _Size(click.ParamType):
    """Width and height of a picture: "480x360"."""

    name = "WxH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        sides = value.split("x")
        if len(sides) == 2 and all(side.isdecimal() and 0 < int(side) <= 4096 for side in sides):
            return int(sides[0]), int(sides[1])
        self.fail(f"{value!r} is not a size in pixels up to 4096x4096, such as 480x360.", param, ctx)


def _engine(of: str) -> Callable[[_Command], _Command]:
    quick = "Default: warp on an NVIDIA GPU, else c."
    return click.option("--engine", type=click.Choice(["c", "jax", "warp"]), help=f"What {of}. {quick}")


class _Scene(NamedTuple):
    """Some worlds of a file, in C MuJoCo, with their objects in place."""

    arena: "Arena"
    ranges: "ArenaRanges"
    keys: Any  # (W,)
    params: "ArenaParams"  # (W, ...)
    twins: list[tuple[Any, Any]]  # (W,) MjModel and MjData

    @property
    def worlds(self) -> list["ArenaParams"]:
        """Of each, (W,)."""
        from mjx_arenas import take

        return [take(self.params, i) for i in range(len(self.twins))]

    @property
    def data(self) -> list[Any]:
        """The state of each, (W,)."""
        return [data for _, data in self.twins]


def _scene(file: pathlib.Path, seed: int, numbers: Sequence[int]) -> _Scene:
    arena, ranges = _load(file)
    with _busy(f"making {len(numbers):,} worlds"), _answered(ValueError, TypeError):
        from mjx_arenas import tables, take, world_keys

        params, keys = tables.draw(arena, ranges, seed, numbers).params, world_keys(seed, numbers)
        twins = [arena.c_world(take(params, i), key=keys[i]) for i in range(len(numbers))]
    return _Scene(arena, ranges, keys, params, twins)


@app.command()
@click.argument("file", type=_File())
@_of_worlds(12, 400)
@click.option(
    "-o",
    "out",
    type=click.Path(path_type=pathlib.Path),
    required=True,
    callback=_out((".png", ".mp4")),
    help="A .png picture or an .mp4 video of a rollout; a file that is there is replaced.",
    metavar="OUT",
)
@click.option("--plan", is_flag=True, help="Seen from above, to scale, with names, sizes and yaws.")
@click.option("--reach", type=click.FloatRange(0, min_open=True), help="With --plan: a robot's reach [m], drawn.")
@click.option("--camera", help="A camera of the arena.  [default: one that sees all tables]", metavar="NAME")
@click.option("--size", type=_Size(), default="480x360", help="Of each world's picture.  [default: 480x360]")
@click.option(
    "--seconds", type=click.FloatRange(0, min_open=True), default=2.0, help="Of a video.  [default: 2]", metavar="T"
)
@_engine("that steps a video")
def render(
    file: pathlib.Path,
    n: int | None,
    worlds: list[int] | None,
    seed: int,
    out: pathlib.Path,
    plan: bool,
    reach: float | None,
    camera: str | None,
    size: tuple[int, int],
    seconds: float,
    engine: str | None,
) -> None:
    """Draw worlds as they are: one, many in a grid, from above, or in motion.

    \b
    Examples:
      mjx-arenas render shelf -n 12 --seed 3 -o grid.png
      mjx-arenas render shelf --worlds 0,5,17 --size 800x600 -o three.png
      mjx-arenas render pick_and_place --worlds 5 --plan --reach 0.855 -o plan.png
      mjx-arenas render clutter --worlds 0,1,2,3 --seconds 3 -o clutter.mp4
    """
    numbers = _chosen(n, worlds, 12)
    film = out.suffix == ".mp4"
    if plan and (film or camera is not None):
        raise click.UsageError("--plan is a picture from above: give a .png, and no --camera.")
    if reach is not None and not plan:
        raise click.UsageError("--reach goes with --plan.")
    scene = _scene(file, seed, numbers)
    from mjx_arenas import engines, make_data, output
    from mjx_arenas import film as film_
    from mjx_arenas.render import grid, picture

    engine, why = engines.choose(engine)
    arena, labels = scene.arena, [f"world {number}, seed {seed}" for number in numbers]
    shown = {"camera": camera, "width": size[0], "height": size[1], "labels": labels}
    with _answered(ValueError, RuntimeError, ImportError, OSError), _busy(f"drawing {len(numbers):,} worlds"):
        if not film:
            if plan:
                placed = zip(scene.worlds, scene.data, labels, strict=True)
                plans = [picture(arena.plan(params, data, reach or (), label)) for params, data, label in placed]
                pictures = grid(plans, [""] * len(plans), min(2, len(plans)))
            else:
                pictures = arena.contact_sheet(scene.params, scene.data, **shown)
            with output.whole(out) as unfinished:
                pictures.save(unfinished)
        elif engine == "c":
            film_.c_video(arena, scene.worlds, scene.twins, out, seconds, **shown)
        else:
            batch = arena.randomize(arena.put_model(engine), scene.keys, scene.ranges)
            film_.video(batch, make_data(batch, scene.keys), out, seconds, **shown)
    motion = f", {seconds:g} s on {why}" if film else ""
    click.echo(f"{out}: {len(numbers):,} of the worlds of {file.name}, seed {seed}{motion}")


def _world(command: _Command) -> _Command:
    """The options that choose one world."""
    seed = click.option("--seed", type=_Whole(0, 2**32 - 1), default=0, metavar="S", help="Of the world.  [default: 0]")
    number = click.option("--world", type=_Whole(0, 2**32 - 1), default=0, metavar="I", help="Which one.  [default: 0]")
    return number(seed(command))


@app.command()
@click.argument("file", type=_File())
@_world
@click.option("--tile", type=_Whole(1), metavar="N", help="Instead: worlds 0 to N - 1 side by side.")
def view(file: pathlib.Path, world: int, seed: int, tile: int | None) -> None:
    """Open MuJoCo's viewer on a world, or on many side by side.

    \b
    Examples:
      mjx-arenas view shelf --world 5
      mjx-arenas view clutter --tile 16
    """
    scene = _scene(file, seed, [world] if tile is None else range(tile))
    with _answered(ValueError, RuntimeError):
        if tile is None:
            scene.arena.view(scene.worlds[0], scene.data[0])
        else:
            scene.arena.view(scene.params, scene.data)


@app.command()
@click.argument("file", type=_File())
@_world
@click.option(
    "-o",
    "out",
    type=click.Path(path_type=pathlib.Path, file_okay=False),
    required=True,
    help="A folder that is not there yet, or is empty.",
    metavar="DIR",
)
@click.option(
    "--format",
    "form",
    type=click.Choice(["xml", "mjb"]),
    default="xml",
    help="MJCF with its assets, or one binary file for this version of MuJoCo.  [default: xml]",
)
def export(file: pathlib.Path, world: int, seed: int, out: pathlib.Path, form: Literal["xml", "mjb"]) -> None:
    """Write a world as files that any MuJoCo opens, with its parameters as JSON.

    Its objects are in place in the keyframe "state".

    \b
    Examples:
      mjx-arenas export shelf --world 5 -o world_5
      python -m mujoco.viewer --mjcf=world_5/world.xml
    """
    scene = _scene(file, seed, [world])
    with _answered(ValueError, OSError, RuntimeError), _busy("writing"):
        scene.arena.export(scene.worlds[0], out, scene.data[0], form, seed, world)
    click.echo(f"{out}: world {world} of {file.name}, seed {seed}")


def _can_be_made(ctx: click.Context, param: click.Parameter, path: pathlib.Path) -> pathlib.Path:
    """Checks at once that a folder is there or can be made."""
    there = next(parent for parent in (path, *path.parents) if parent.exists())
    if not there.is_dir() or not os.access(there, os.W_OK):
        raise click.BadParameter(f"cannot write {str(path)!r} in {str(there)!r}.")
    return path


@app.command()
@click.argument("file", type=_File())
@_of_worlds(256, 1_000_000)
@click.option("--steps", type=_Whole(1), default=500, metavar="T", help="How many to take.  [default: 500]")
@_engine("steps them")
@click.option("--keyframe", help="In which a robot starts.", metavar="NAME")
@click.option("--max-contacts", type=_Whole(1), help="With --engine warp: room for contacts of a world.", metavar="N")
@click.option(
    "-o",
    "out",
    type=click.Path(path_type=pathlib.Path, file_okay=False),
    default="out/check",
    callback=_can_be_made,
    help="Folder for bundles of the worst worlds; those of the same worlds are replaced.  [default: out/check]",
    metavar="DIR",
)
@click.option("--json", is_flag=True, help="The report as JSON.")
def check(
    file: pathlib.Path,
    n: int | None,
    worlds: list[int] | None,
    seed: int,
    steps: int,
    engine: str | None,
    keyframe: str | None,
    max_contacts: int | None,
    out: pathlib.Path,
    json: bool,
) -> None:
    """Roll worlds out and say which of them fail, and why.

    \b
    A world fails where
      its state is NaN, infinite or beyond 1e10,
      contacts are dropped for want of room (warp),
      the middle of an object gets below its table's top, or outside the edges,
      two geoms sink into each other by more than a quarter of the smaller half extent,
      an object finds no free place, or the arena cannot be.

    The worst world of each cause is written as a bundle, for replay. Exit code 1 if any world fails.

    \b
    Examples:
      mjx-arenas check shelf
      mjx-arenas check arena.yaml -n 8192 --steps 1000 --engine warp
      mjx-arenas check arena.yaml --worlds 1713 --engine c
    """
    numbers = _chosen(n, worlds, 256)
    if engine in ("jax", "warp"):
        os.environ.setdefault("XLA_FLAGS", "")  # steps take longer than compiling
    arena, ranges = _load(file)
    with _answered(ValueError, TypeError), _busy(f"stepping {len(numbers):,} worlds"):
        with _stop.at_once():
            from mjx_arenas import demo, failures
        demo.quiet_warp()
        limits = {"keyframe": keyframe, "max_contacts": max_contacts}
        report = failures.check(arena, ranges, worlds=numbers, seed=seed, n_steps=steps, engine=engine, **limits)
    bundles = {world: out / f"world_{world}" for world in report.worst}
    if not json:
        click.echo(str(report))
    with _answered(OSError, ValueError), _busy("writing"):
        if bundles:
            out.mkdir(parents=True, exist_ok=True)
        for world, folder in bundles.items():
            report.save_bundle(folder, world)
    if json:
        written = {str(world): str(folder) for world, folder in bundles.items()}
        click.echo(json_.dumps(report.to_dict() | {"bundles": written}, indent=2))
    elif not report.ok:
        world = next(iter(bundles), next(iter(report.failures.values()))[0].world)
        name = file.stem if file.parent == paths.EXAMPLES else file
        click.echo(f"\nlook at it: mjx-arenas render {name} --worlds {world} --seed {seed} -o world_{world}.png")
        for folder in bundles.values():
            click.echo(f"replay it:  mjx-arenas replay {folder}")
    if not report.ok:
        raise click.exceptions.Exit(1)


@app.command()
@click.argument("bundle", type=click.Path(path_type=pathlib.Path))
@click.option(
    "-o",
    "out",
    type=click.Path(path_type=pathlib.Path),
    callback=lambda ctx, param, path: None if path is None else _out((".png",))(ctx, param, path),
    help="A .png picture of the world before, at and after the failure; one that is there is replaced.",
    metavar="OUT",
)
@click.option("--json", is_flag=True, help="The numbers as JSON.")
def replay(bundle: pathlib.Path, out: pathlib.Path | None, json: bool) -> None:
    """Step a world that failed in C MuJoCo, and say whether the same failure shows.

    BUNDLE is a folder that check wrote. Exit code 1 if the failure does not show.

    \b
    Examples:
      mjx-arenas replay out/check/world_17 -o world_17.png
      python -m mujoco.viewer --mjcf=out/check/world_17/world.xml
    """
    with _busy("loading"), _stop.at_once():
        from mjx_arenas import bundles, output
    with _answered(ValueError, OSError), _busy("stepping"):
        replayed = bundles.replay(bundle)
    if out is not None:
        with _answered(RuntimeError, ImportError, OSError), _busy("drawing"), output.whole(out) as unfinished:
            replayed.picture().save(unfinished)
    if json:
        click.echo(json_.dumps(replayed.to_dict() | ({"file": str(out)} if out else {}), indent=2))
    else:
        click.echo(str(replayed) + (f"\n{out}: before, at and after the failure" if out else ""))
    if not replayed.reproduced:
        raise click.exceptions.Exit(1)
