"""Commands that show parameters of many worlds as tables."""

import json as json_
import pathlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from mjx_arenas.cli import options, scenes
from mjx_arenas.cli.terminal import answered, busy, count

if TYPE_CHECKING:
    from mjx_arenas.arena import Arena
    from mjx_arenas.params.params import ArenaRanges
    from mjx_arenas.viz.samples import Sample


@click.command(cls=options.Command)
@click.argument("file", type=options.File())
@options.of_worlds(1000, 10_000_000)
@options.file_out((".npz", ".csv", ".parquet"), "A .npz, .csv or .parquet file; one that is there is replaced.")
@click.option("--valid", is_flag=True, help="Leave out invalid worlds.")
@click.option("--json", is_flag=True, help="Print what was written as JSON.")
def sample(file: pathlib.Path, numbers: Sequence[int], seed: int, out: pathlib.Path, valid: bool, json: bool) -> None:
    """Write the parameters of many worlds as a table.

    Each world is a row. A .csv or .parquet file has a column for each number, such as table_offsets.table0.z; a .npz file has the arrays of
    mjx_arenas.ArenaParams. `valid` says whether the world is valid. The last lines of the output say why some worlds are not.

    \b
    Examples:
      mjx-arenas sample shelf -n 1000 --seed 3 -o worlds.parquet
      mjx-arenas sample arena.yaml --worlds 0,5,17 -o three.csv    the same rows 0, 5 and 17
      mjx-arenas sample arena.yaml -n 1000 --valid -o good.npz     at most 1,000 rows
    """
    arena, ranges = scenes.load(file)
    drawn = scenes.draw(arena, ranges, seed, numbers)
    about = _about(arena, ranges, drawn)
    if valid and not drawn.valid.any():
        world, why = next(iter(about["invalid"].items()))
        raise click.ClickException(f"There is no valid world to write; world {world}, for example: {why}")
    with answered(OSError, ImportError), busy("writing"):
        from mjx_arenas.viz import samples

        samples.write(out, arena.record, _only_valid(drawn) if valid else drawn)
    if json:
        click.echo(json_.dumps({"file": str(out), **about}))
    else:
        click.echo(f"{out}: {'the valid of ' if valid else ''}{_said(file, seed, about)}")


@click.command(cls=options.Command)
@click.argument("file", type=options.File())
@options.of_worlds(1000, 10_000_000)
@options.folder_out("Folder for histograms.png, coverage.png and pairs.png; those that are there are replaced.")
@click.option("--json", is_flag=True, help="Print the table as JSON.")
def stats(file: pathlib.Path, numbers: Sequence[int], seed: int, out: pathlib.Path | None, json: bool) -> None:
    """Show what varies, between which values, as a table and as plots.

    \b
    Examples:
      mjx-arenas stats shelf
      mjx-arenas stats arena.yaml -n 10000 -o plots
      mjx-arenas stats arena.yaml --json | jq '.varies[] | select(.axis == "z")'
    """
    arena, ranges = scenes.load(file)
    drawn = scenes.draw(arena, ranges, seed, numbers)
    from mjx_arenas.viz import samples

    columns, written = samples.columns(arena.record, drawn.params), []
    if out is not None:
        with answered(OSError, ImportError), busy("plotting"):
            from mjx_arenas.viz import plots

            written = plots.write(out, arena.record, columns, drawn)
    found, about = arena.describe(drawn.params), _about(arena, ranges, drawn)
    if json:
        data = {**about, "varies": [r._asdict() for r in found.varying], "absent": list(found.absent)}
        click.echo(json_.dumps(data | ({"files": written} if written else {}), indent=2))
        return
    click.echo(str(found))
    click.echo(_said(file, seed, about))
    for path in written:
        click.echo(path)


def _about(arena: "Arena", ranges: "ArenaRanges", drawn: "Sample") -> dict[str, Any]:
    """What there is to say of worlds that were drawn, for JSON."""
    why = {str(world): sentence for world, sentence in scenes.impossible(arena, ranges, drawn).items()}
    counts = {"worlds": len(drawn.numbers), "valid": int(drawn.valid.sum())}
    return {"seed": drawn.seed, **counts, **({"invalid": why} if why else {})}


def _said(file: pathlib.Path, seed: int, about: dict[str, Any]) -> str:
    """The same for people, with an example for each reason why a world cannot be."""
    n, valid = about["worlds"], about["valid"]
    if n == 1:
        verdict = "it is valid" if valid else "it is not valid"
    elif valid == n:
        verdict = "all are valid"
    elif not valid:
        verdict = "none is valid, for example"
    else:
        verdict = f"{valid:,} {'is' if valid == 1 else 'are'} valid, {n - valid:,} not, such as"
    examples = [f"  world {world}: {why}" for world, why in about.get("invalid", {}).items()]
    return "\n".join([f"{count(n, 'world')} of {file.name}, seed {seed}; {verdict}", *examples])


def _only_valid(drawn: "Sample") -> "Sample":
    from mjx_arenas.params.params import each

    params = each(lambda values: values[drawn.valid], drawn.params)
    return drawn._replace(numbers=drawn.numbers[drawn.valid], params=params, valid=drawn.valid[drawn.valid])
