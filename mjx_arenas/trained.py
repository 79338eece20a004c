"""A training as one sees it: its progress, its log, its curve."""

import contextlib
import json
import pathlib
from collections.abc import Callable, Iterator
from typing import Any

from mjx_arenas.files import output
from mjx_arenas.problem import Problem
from mjx_arenas.problems.messages import error


@contextlib.contextmanager
def show(total: int) -> Iterator[Callable[[int, dict], None]]:
    """A progress bar on a terminal, lines elsewhere."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console()

    def line(numbers: dict[str, Any]) -> str:
        success = numbers.get("eval/episode_success_at_end", 0.0)
        speed = f", {numbers['training/sps']:,.0f} steps/s" if "training/sps" in numbers else ""
        return f"reward {numbers.get('eval/episode_reward', float('nan')):.1f}, success {success:.1%}{speed}"

    if not console.is_terminal:
        yield lambda step, numbers: print(f"{step:,} of at least {total:,} steps: {line(numbers)}", flush=True)
        return
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("compiling", total=total)
        yield lambda step, numbers: bar.update(task, completed=step, total=max(total, step), description=line(numbers))


def read_log(log: pathlib.Path) -> list[dict[str, Any]]:
    """Lines of the log, if there is one.

    Raises:
        ValueError: one is broken.
    """
    found, lines = [], log.read_text(errors="replace").splitlines() if log.exists() else []
    for number, line in enumerate(lines, 1):
        try:
            found.append(json.loads(line))
        except ValueError:
            raise error([Problem("", "broken_line", None, None, {"file": log, "line": number})]) from None
    return found


def read(file: pathlib.Path, rule: str = "broken_file") -> dict[str, Any]:
    """What the configuration or the result of a training says.

    Args:
        file: the file.
        rule: what an error says of it.

    Raises:
        ValueError: it is broken.
    """
    try:
        found = json.loads(file.read_text(errors="replace"))
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise error([Problem("", rule, None, None, {"file": file})])
    return found


def curve(log: pathlib.Path, picture: pathlib.Path) -> None:
    """Draws reward and success of the log against steps."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    rows = read_log(log)
    steps = [row["steps"] / 1e6 for row in rows]
    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6, 5), layout="constrained")
    above.plot(steps, [row["eval/episode_reward"] for row in rows], color="#0072B2", marker="o")
    above.set_ylabel("reward of an episode")
    below.plot(steps, [row["eval/episode_success_at_end"] for row in rows], color="#D55E00", marker="o")
    below.set_ylabel("success at the end of an episode")
    below.set_xlabel("million steps of all worlds")
    below.set_ylim(0, 1)
    with output.whole(picture) as unfinished:
        figure.savefig(unfinished, dpi=110)
    plt.close(figure)


def write(path: pathlib.Path, text: str) -> None:
    """Writes a file as a whole or not at all, also where the power is cut."""
    with output.whole(path) as unfinished:
        unfinished.write_text(text + "\n")
        output.sync(unfinished)
