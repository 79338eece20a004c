"""`mjx-arenas bench`: the benchmarks of a checkout."""

import os
import pathlib
import subprocess
import sys

import click

from mjx_arenas.cli import options

ROOT = pathlib.Path(__file__).parents[2]
OTHERS = ("box_contacts", "devices", "training", "when_needed")


@click.command(
    cls=options.Command,
    context_settings={"ignore_unknown_options": True, "allow_extra_args": True},
    add_help_option=False,
)
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED, metavar="[NAME]... [OPTION]...")
def bench(arguments: tuple[str, ...]) -> int:
    """Measure what mjx_arenas costs, in a clone of its repository.

    NAMEs are cases, of which --list has a list; without any, all are run. `box_contacts`, `devices`, `training` and `when_needed` are
    benchmarks with options of their own (mjx-arenas bench training --help).
    """
    if not (ROOT / "benchmarks" / "__main__.py").is_file():
        raise click.UsageError(
            "The benchmarks are not part of the installed package: run this in a clone of the repository."
        )
    module, *rest = (
        (f"benchmarks.{arguments[0]}", *arguments[1:])
        if arguments[:1] and arguments[0] in OTHERS
        else ("benchmarks", *arguments)
    )
    paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    return subprocess.run(
        [sys.executable, "-m", module, *rest], env={**os.environ, "PYTHONPATH": paths}, check=False
    ).returncode
