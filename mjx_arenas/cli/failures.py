"""Commands that find worlds that fail, and show them again."""

import json as json_
import pathlib
import shlex
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from mjx_arenas import gpu
from mjx_arenas.cli import options, scenes
from mjx_arenas.cli.terminal import answered, busy, count, counted, sentence, warn

if TYPE_CHECKING:
    from mjx_arenas.checks.failures import CheckReport


@click.command(cls=options.Command)
@click.argument("file", type=options.File())
@options.of_worlds(256, 1_000_000)
@click.option(
    "--steps", type=options.Whole(1, 10_000_000), default=500, metavar="T", help="Number of steps.  [default: 500]"
)
@options.engine("steps worlds")
@options.keyframe
@click.option(
    "--max-contacts",
    type=options.Whole(1, 1_000_000),
    help="With --engine warp: for how many contacts of a world there is room.",
    metavar="N",
)
@options.folder_out(
    "Folder for bundles of the worst worlds; bundles of the same worlds are replaced.  [default: out/check]",
    parents=True,
    default="out/check",
)
@click.option("--json", is_flag=True, help="Print the report as JSON.")
def check(
    file: pathlib.Path,
    numbers: Sequence[int],
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
      the solver gave up: an object does not move as its contacts' forces say,
      contacts are dropped for want of room (warp),
      the middle of an object gets below its table's top, or outside the edges,
      two geoms sink into each other by more than a quarter of the smaller half extent,
      an object finds no free place, or the arena is invalid.

    Worlds with dropped objects are first stepped for 2 s in which nothing is judged. The steps of --steps follow.

    The worst world of each cause is written as a bundle, for replay. Worlds that MuJoCo would not compile, or whose parameters
    are wrong, are not stepped. The exit code is 1 if any world fails.

    \b
    Examples:
      mjx-arenas check shelf
      mjx-arenas check arena.yaml -n 8192 --steps 1000 --engine warp
      mjx-arenas check arena.yaml --worlds 1713 --engine c
    """
    if max_contacts is not None and engine != "warp":
        raise click.UsageError("--max-contacts goes with --engine warp: others drop no contacts.")
    gpu.leave_room(engine)
    arena, ranges = scenes.load(file, scenes.steps_on_mjx(engine, steps * len(numbers)))
    _check_free(out, numbers)
    scenes.check_keyframe(arena, keyframe)
    with busy(f"stepping {count(len(numbers), 'world')}") as tell:
        from mjx_arenas.checks import engines, failures

        chosen, _ = engines.choose(engine)
        if chosen != "c":
            scenes.put_model(arena, ranges, chosen)
        limits = {"keyframe": keyframe, "max_contacts": max_contacts, "progress": tell}
        report = failures.check(arena, ranges, worlds=numbers, seed=seed, n_steps=steps, engine=engine, **limits)
    if not json:
        click.echo(str(report))
    bundles = _save(report, out)
    if json:
        written = {str(world): str(folder) for world, folder in bundles.items()}
        click.echo(json_.dumps(report.to_dict() | {"bundles": written}, indent=2))
    elif not report.ok:
        _say_what_next(report, bundles, scenes.name_of(file), keyframe)
    if not report.ok:
        raise click.exceptions.Exit(1)


def _say_what_next(report: "CheckReport", bundles: dict[int, pathlib.Path], name: str, keyframe: str | None) -> None:
    """Commands for the worlds that fail; those that cannot be are not drawn."""
    impossible = {failure.world for failure in report.failures.get("invalid_arena", ())}
    world = next((world for world in report.worst if world not in impossible), None)
    click.echo()
    if world is not None:
        chosen = f"--worlds {world} --seed {report.seed}"
        chosen += "" if keyframe is None else f" --keyframe {shlex.quote(keyframe)}"
        click.echo(f"look at it: mjx-arenas render {shlex.quote(name)} {chosen} -o world_{world}.png")
    for folder in bundles.values():
        click.echo(f"replay it:  mjx-arenas replay {shlex.quote(str(folder))}")


def _check_free(out: pathlib.Path, numbers: Sequence[int]) -> None:
    """Refuses folders of these worlds in which something else is than a bundle, before what takes long."""
    from mjx_arenas.checks import folders

    with answered(OSError):
        for folder in sorted(out.glob("world_*")):
            number = folder.name.removeprefix("world_")
            ours = folders.is_bundle(folder) or (folder.is_dir() and not any(folder.iterdir()))
            if number.isdecimal() and int(number) in numbers and not ours:
                raise click.ClickException(
                    f"-o: {str(folder)!r} is there already and is no bundle: give another folder."
                )


def _save(report: "CheckReport", out: pathlib.Path) -> dict[int, pathlib.Path]:
    """Writes a bundle of each of the worst worlds, and warns of those that cannot be written; gives where they are."""
    bundles, lost = {}, []
    with busy("writing") as tell:
        for world in counted(report.worst, tell):
            folder = out / f"world_{world}"
            try:
                out.mkdir(parents=True, exist_ok=True)
                report.save_bundle(folder, world)
                bundles[world] = folder
            except OSError as error:
                lost.append(f"There is no bundle of world {world}: {sentence(error)}")
    for what in lost:
        warn(what)
    return bundles


@click.command(cls=options.Command)
@click.argument("bundle", type=click.Path(path_type=pathlib.Path))
@options.file_out(
    (".png",), "A .png picture of the world before, at and after the failure; one that is there is replaced.", False
)
@click.option("--json", is_flag=True, help="Print the numbers as JSON.")
def replay(bundle: pathlib.Path, out: pathlib.Path | None, json: bool) -> None:
    """Step a world that failed again, in C MuJoCo.

    BUNDLE is a folder that check wrote. What was recorded is shown beside what C MuJoCo does. The exit code is 1 if the failure is not
    reproduced.

    \b
    Examples:
      mjx-arenas replay out/check/world_17 -o world_17.png
      python -m mujoco.viewer --mjcf=out/check/world_17/world.xml
    """
    with busy("stepping"), answered(ValueError, OSError):
        scenes.import_mujoco()
        from mjx_arenas.checks import bundles
        from mjx_arenas.files import output

        replayed = bundles.replay(bundle)
    drawn, problem = {}, None
    if out is not None:
        try:
            with answered(RuntimeError, ImportError, OSError), busy("drawing"), output.whole(out) as unfinished:
                replayed.picture().save(unfinished)
            drawn = {"file": str(out)}
        except click.ClickException as error:  # the numbers come first
            problem = error
    if json:
        click.echo(json_.dumps(replayed.to_dict() | drawn, indent=2))
    else:
        click.echo("\n".join([str(replayed), *(f"{file}: the world, drawn" for file in drawn.values())]))
    if problem is not None:
        raise problem
    if not replayed.reproduced:
        raise click.exceptions.Exit(1)
