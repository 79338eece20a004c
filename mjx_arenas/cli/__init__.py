"""The command line, `mjx-arenas`.

Commands import what is heavy themselves, so that `--help` and wrong use are answered at once.
"""

import errno
import pathlib
import re
import sys
import traceback
import warnings
from collections.abc import Sequence
from typing import NoReturn

try:
    import click
except ImportError:
    sys.exit("mjx-arenas needs click: pip install 'mjx_arenas[cli]'.")

from mjx_arenas import caches
from mjx_arenas.cli import options, scenes, stop, terminal
from mjx_arenas.cli.bench import bench
from mjx_arenas.cli.failures import check, replay
from mjx_arenas.cli.pictures import export, render, view
from mjx_arenas.cli.stats import sample, stats
from mjx_arenas.cli.train import train
from mjx_arenas.cli.warmup import warmup

WRONG_USE, OUR_MISTAKE, INTERRUPTED = 2, 70, 130


@click.group(cls=options.Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="mjx_arenas")
def app() -> None:
    """See and keep any of thousands of randomized arenas.

    FILE is a .yaml or .json file that describes an arena and what varies (mjx_arenas.load), or the name of an example:
    bin_picking, clutter, kitchen, living_room, pick_and_place, robosuite_multi_table, robosuite_table, shelf,
    warehouse, workshop.

    World I of seed S is the same in every command, however many others there are.

    \b
    Examples:
      mjx-arenas demo                                        1,024 arenas, compared with recompiled ones
      mjx-arenas stats shelf                                 what varies, between which values
      mjx-arenas stats shelf -o plots                        the same as pictures
      mjx-arenas sample shelf -n 1000 --seed 3 -o worlds.csv parameters of 1,000 worlds
      mjx-arenas render shelf -n 12 -o grid.png              twelve worlds, drawn
      mjx-arenas render shelf --worlds 5 -o five.mp4         world 5 in motion
      mjx-arenas view shelf --tile 9                         nine worlds in MuJoCo's viewer
      mjx-arenas export shelf --world 5 -o world_5           world 5 as MJCF with its assets
      mjx-arenas check shelf -n 256 --steps 500              which worlds fail, and why
      mjx-arenas replay out/check/world_17                   a world that failed, in C MuJoCo
      mjx-arenas train lift                                  a policy, on new arenas in every episode
      mjx-arenas warmup shelf -n 8192                        compiles ahead what a first step needs
      mjx-arenas bench --list                                what is measured, in a clone

    \b
    Exit codes:
      0        all is fine
      1        check found a world that fails, replay could not reproduce the failure, or a benchmark failed
      2        wrong use, which one sentence explains
      70       a bug in mjx_arenas
      128 + N  stopped by signal N: 130 by Ctrl-C, 143 by SIGTERM
    """


@click.command(cls=options.Command)
@options.how_many(1024, least=12)
@click.option("--worlds", type=options.Whole(12, 1_000_000), hidden=True)  # an older name of -n
@options.mjx_engine
@options.folder_out("Folder for pictures and MJCF.  [default: out/demo]", parents=True, default="out/demo")
def demo(n: int | None, worlds: int | None, impl: str | None, out: pathlib.Path) -> None:
    """Randomize arenas, and compare them with recompiled ones.

    Objects are dropped on the tables of the arenas, and pictures of twelve are drawn.
    """
    if n is not None and worlds is not None:
        raise click.UsageError("Give -n or --worlds, not both.")
    scenes.import_mujoco()
    from mjx_arenas import demo

    demo.main([f"-n={n or worlds or 1024}", f"--out={out}", *([f"--engine={impl}"] if impl else [])])


for command in (demo, sample, stats, render, view, export, check, replay, warmup, train, bench):
    app.add_command(command)


def run() -> NoReturn:
    """The process `mjx-arenas`."""
    stop.listen()
    caches.keep()
    warnings.showwarning = terminal.each_once()
    sys.exit(main())


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command; gives its exit code.

    Args:
        arguments: of the command line; None: those of the process.

    Raises:
        SystemExit: of a library that ends the process.
    """
    out = sys.stdout
    try:
        return app.main(arguments, prog_name="mjx-arenas", standalone_mode=False) or 0
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        return WRONG_USE
    except click.ClickException as error:
        command = getattr(error, "ctx", None)
        sentence = re.sub(r"\.? \((Did you mean .*\?)\)\.?$", r". \1", error.format_message())
        sentence += "" if sentence.endswith((".", "?")) else "."
        click.secho("error: ", fg="red", bold=True, nl=False, err=True)
        click.echo(sentence + (f" See {command.command_path} --help." if command else ""), err=True)
        return WRONG_USE
    except (click.Abort, KeyboardInterrupt):
        click.echo("interrupted", err=True)
        return INTERRUPTED
    except SystemExit as error:
        if sys.stdout is not out or isinstance(
            error.__context__, BrokenPipeError
        ):  # click's and rich's: nobody reads on
            return 0
        raise
    except MemoryError as error:
        click.echo(f"error: {error or 'There is not enough memory.'}", err=True)
        return WRONG_USE
    except Exception as error:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            click.echo(f"error: The output cannot be written: {error.strerror}.", err=True)
            return WRONG_USE
        traceback.print_exc()
        return OUR_MISTAKE
