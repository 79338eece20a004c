"""What a stage of a training saves: evaluations in `progress.jsonl`, and a checkpoint of each policy until the best one is kept."""

import json
import pathlib
import shutil
import time
from collections.abc import Callable, Mapping
from typing import Any

from mjx_arenas.files import output
from mjx_arenas.trained import read, read_log, write


class Stage:
    """One stage in the folder of a training, as far as it is saved: a checkpoint counts once its policy is evaluated."""

    def __init__(self, out: pathlib.Path, number: int) -> None:
        """Reads what is there.

        Args:
            out: folder of the training.
            number: of the stage, from 0.
        """
        folder = out / "checkpoints"
        self.number, self.finished, self.log = number, folder / f"stage{number}", out / "progress.jsonl"
        self._before, self._unfinished = folder / f"stage{number - 1}" / "params", folder / f"unfinished{number}"
        lines = read_log(self.log)
        self._done = [line for line in lines if line["stage"] < number]
        self._start = self._done[-1]["steps"] if self._done else 0  # Brax does a few more than it is asked for
        self._lines = [line for line in lines if line["stage"] == number]
        self._drop_until(pathlib.Path.is_dir)
        self._from = self.steps

    @property
    def steps(self) -> int:
        """Steps after which training goes on, of all stages."""
        return self._lines[-1]["steps"] if self._lines else self._start

    @property
    def rounds(self) -> int:
        """The rounds of learning that are saved, each of which ended with an evaluation."""
        return sum(line["steps"] > self._start for line in self._lines)

    @property
    def new(self) -> pathlib.Path:
        """Where Brax saves a checkpoint before it is evaluated, or reported to be."""
        return self._unfinished / "new"

    @property
    def newest(self) -> pathlib.Path | None:
        """The checkpoint from which training goes on, of this stage or of the one before."""
        return self._checkpoint(self._lines[-1]) if self._lines else self._before if self.number else None

    def _checkpoint(self, line: Mapping[str, Any]) -> pathlib.Path:
        return self._unfinished / f"{line['steps'] - self._start:012d}"

    def _drop_until(self, whole: Callable[[pathlib.Path], bool]) -> None:
        """Drops evaluations from the last on, until there is one of a round with a whole checkpoint."""
        while self._lines and not (self._lines[-1]["steps"] > self._start and whole(self._checkpoint(self._lines[-1]))):
            self._lines.pop()

    def begin(self) -> None:
        """Removes what is left of a round that was not finished, and checkpoints that cannot be read, such as after a power cut."""
        self._drop_until(_is_whole)
        self._from = self.steps
        known = {self._checkpoint(line) for line in self._lines}
        for path in [*self._unfinished.glob("*")]:
            if path not in known:
                shutil.rmtree(path, ignore_errors=True)

    def left(self, steps: int, evals: int) -> tuple[int, int]:
        """What is left of a stage's steps and evaluations, with that of the policy from which it goes on; no steps: nothing."""
        rounds = max(evals - 1, 1)  # as Brax counts them
        if not self.rounds:
            return steps, evals
        return (self.steps - self._start) // self.rounds * (rounds - self.rounds), evals - self.rounds

    def add(self, step: int, metrics: Mapping[str, Any]) -> dict[str, Any] | None:
        """Takes an evaluation, and the checkpoint of its policy if Brax saved one.

        Args:
            step: number of steps since training went on.
            metrics: what Brax tells of it.

        Returns:
            Its line of the log; None: the policy was evaluated before the interruption.
        """
        if not step and self._lines:
            shutil.rmtree(self.new, ignore_errors=True)
            return None
        numbers = {name: float(x) for name, x in metrics.items()}
        line = {"stage": self.number, "steps": self._from + step, "time": time.time(), **numbers}
        for saved in [*self.new.glob("*")]:
            saved.rename(self._checkpoint(line))
        self._lines.append(line)
        self._write()
        return line

    def _write(self) -> None:
        write(self.log, "\n".join(json.dumps(line) for line in [*self._done, *self._lines]))

    def finish(self) -> None:
        """Keeps the policy of the best evaluation: the last of those with the most successes, on arenas of the training.

        PPO's success is not steady at a constant learning rate. Without a measure of success it is the last evaluation. A stage begins by
        judging the policy of the stage before, which may stay the best.
        """
        policies = []
        for line in self._lines:
            line.pop("kept", None)
            saved = self._checkpoint(line)
            saved = saved if saved.is_dir() else self._before
            if saved.is_dir() and (saved != self._before or line["steps"] == self._start):
                policies.append((line, saved))
        best, saved = max(reversed(policies), key=lambda one: one[0].get("eval/episode_success_at_end", 0.0))
        best["kept"] = True
        self._write()
        with output.whole(self.finished) as whole:  # a stage is there as a whole or not at all
            shutil.copytree(saved, whole / "params")
        self.clear()

    def clear(self) -> None:
        """Removes all but the policy that a finished stage keeps."""
        shutil.rmtree(self._unfinished, ignore_errors=True)


def saved_steps(out: pathlib.Path) -> int | None:
    """Steps after which the training in a folder goes on; None: nothing is saved."""
    number = 0
    while (stage := Stage(out, number)).finished.exists():
        number += 1
    return stage.steps if number or stage.rounds else None


def _is_whole(folder: pathlib.Path) -> bool:
    from brax.training import checkpoint

    try:
        checkpoint.load(str(folder))
        (of_network,) = folder.glob("*_network_config.json")
        read(of_network)
    except Exception:  # of many kinds: of the file system, of its format, of Brax
        return False
    return True
