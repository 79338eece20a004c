"""What a stage of a training saves: evaluations in `progress.jsonl`, and a checkpoint of each policy until the best one is kept."""

import json
import pathlib
import shutil
import time
from collections.abc import Mapping
from typing import Any

from mjx_arenas.files.output import sync
from mjx_arenas.problem import Problem
from mjx_arenas.problems.messages import error
from mjx_arenas.trained import read, read_log, write


class Stage:
    """One stage in the folder of a training, as far as it is saved: a checkpoint counts once its policy is evaluated.

    The policies are numbered by their rounds of learning, each of which ends with an evaluation. The policy of round 0 is that of the stage
    before, if there is one.
    """

    def __init__(self, out: pathlib.Path, number: int) -> None:
        """Reads what is there.

        Args:
            out: folder of the training.
            number: of the stage, from 0.
        """
        folder = out / "checkpoints"
        self.number, self.finished, self.log = number, folder / f"stage{number}", out / "progress.jsonl"
        self._before = folder / f"stage{number - 1}" / "params" if number else None
        self._unfinished = folder / f"unfinished{number}"
        lines = read_log(self.log)
        self._done = [line for line in lines if line["stage"] < number]
        # Older trainings wrote no rounds: their stages that are not finished begin again.
        self._lines = {line["round"]: line for line in lines if line["stage"] == number and "round" in line}
        starts = [line["start"] for line in self._lines.values()] or [line["steps"] for line in self._done[-1:]]
        self._start = starts[0] if starts else 0  # Brax does a few more than it is asked for
        self.rounds = max(self._saved(), default=0)
        """The round after which training goes on."""

    @property
    def steps(self) -> int:
        """Steps after which training goes on, of all stages."""
        return self._lines[self.rounds]["steps"] if self.rounds else self._start

    @property
    def new(self) -> pathlib.Path:
        """Where Brax saves a checkpoint before it is evaluated, or reported to be."""
        return self._unfinished / "new"

    @property
    def newest(self) -> pathlib.Path | None:
        """The checkpoint from which training goes on, of this stage or of the one before."""
        return self._policy(self.rounds)

    def _folder(self, k: int) -> pathlib.Path:
        return self._unfinished / f"round{k}"

    def _policy(self, k: int) -> pathlib.Path | None:
        return self._folder(k) / "params" if k else self._before

    def _saved(self) -> list[int]:
        """Rounds whose checkpoints are there, the last one first."""
        return sorted((k for k in self._lines if k and self._folder(k).is_dir()), reverse=True)

    def begin(self) -> list[str]:
        """Removes what is left of a round that was not finished, and finds the last checkpoint that can be read.

        Returns:
            What begins a sentence about each that cannot; they stay until training comes to their rounds again.

        Raises:
            ValueError: there are checkpoints, and no line of them, as after a power cut that took the log.
        """
        if not self._lines and any(self._unfinished.glob("round*")):
            raise error([Problem("", "unknown_rounds", None, None, {"folder": self._unfinished, "file": self.log})])
        broken, rounds, self.rounds = [], self._saved(), 0
        for k in rounds:
            if not (why := _unreadable(self._folder(k) / "params")):
                self.rounds = k
                break
            broken.append(self._cannot_be_read(k, why))
        for path in {*self._unfinished.glob("*")} - {*map(self._folder, rounds)}:
            shutil.rmtree(path, ignore_errors=True)
        return broken

    def _cannot_be_read(self, k: int, why: str) -> str:
        return f"The checkpoint of {self._lines[k]['steps']:,} steps cannot be read ({why})"

    def left(self, steps: int, evals: int) -> tuple[int, int]:
        """What is left of a stage's steps and evaluations, with that of the policy from which it goes on; no steps: nothing."""
        rounds = max(evals - 1, 1)  # as Brax counts them
        if not self.rounds:
            return steps, evals
        return (self.steps - self._start) // self.rounds * (rounds - self.rounds), evals - self.rounds

    def add(self, steps: int, metrics: Mapping[str, Any]) -> dict[str, Any] | None:
        """Takes an evaluation, and the checkpoint of its policy.

        Args:
            steps: of all stages, after which it was.
            metrics: what Brax tells of it.

        Returns:
            Its line of the log; None: the policy was evaluated before the interruption.
        """
        if learned := steps > self.steps:
            (saved,) = self.new.glob("*")
            saved.rename(self.new / "params")
            self.rounds += 1
            shutil.rmtree(self._folder(self.rounds), ignore_errors=True)  # if it could not be read
        else:  # DAgger saves the policy with which it begins, too
            shutil.rmtree(self.new, ignore_errors=True)
            if self.rounds:
                return None
        numbers = {name: float(x) for name, x in metrics.items()}
        at = {"stage": self.number, "start": self._start, "round": self.rounds, "steps": steps}
        line = self._lines[self.rounds] = {**at, "time": time.time(), **numbers}
        self._write()
        if learned:  # a line without a checkpoint is written again, and a checkpoint without a line would be refused
            self.new.rename(self._folder(self.rounds))
        return line

    def _write(self) -> None:
        lines = [*self._done, *(self._lines[k] for k in sorted(self._lines))]
        write(self.log, "\n".join(json.dumps(line) for line in lines))

    def finish(self) -> list[str]:
        """Keeps the policy of the best evaluation: the last of those with the most successes, on arenas drawn from the training's ranges.

        PPO's success is not steady at a constant learning rate. Without a measure of success it is the last evaluation. A stage begins by
        judging the policy of the stage before, which may stay the best.

        Returns:
            What begins a sentence about each better one whose checkpoint cannot be read.

        Raises:
            ValueError: none can be read.
        """
        broken = []
        for k in sorted(self._lines, key=lambda k: (self._lines[k].get("eval/episode_success_at_end", 0.0), k))[::-1]:
            policy = self._policy(k)
            if policy is None or not policy.is_dir():
                continue
            if not (why := _unreadable(policy)):
                self._keep(k, policy)
                return broken
            broken.append(self._cannot_be_read(k, why))
        raise error([Problem("", "unreadable_stage", None, None, {"folder": self._unfinished})])

    def _keep(self, best: int, policy: pathlib.Path) -> None:
        """Finishes the stage with a policy: it is there as a whole or not at all, also after a power cut."""
        for line in self._lines.values():
            line.pop("kept", None)
        self._lines[best]["kept"] = True
        self._write()
        if not best:  # that of the stage before stays there, too
            policy = pathlib.Path(shutil.copytree(policy, self._unfinished / "kept" / "params"))
        sync(policy.parent, *policy.parent.rglob("*"))
        policy.parent.rename(self.finished)
        sync(self.finished.parent)
        self.clear()

    def clear(self) -> None:
        """Removes all but the policy that a finished stage keeps."""
        for path in (self._unfinished, *self.finished.parent.glob(f".stage{self.number}.*")):
            shutil.rmtree(path, ignore_errors=True)


def saved_steps(out: pathlib.Path) -> int | None:
    """Steps after which the training in a folder goes on; None: nothing is saved."""
    number = 0
    while (stage := Stage(out, number)).finished.exists():
        number += 1
    return stage.steps if number or stage.rounds else None


def _unreadable(folder: pathlib.Path) -> str:
    """Why a checkpoint cannot be read, such as after a power cut; empty: it can."""
    from brax.training import checkpoint

    try:
        checkpoint.load(str(folder))
        if not (of_network := [*folder.glob("*_network_config.json")]):
            return "it has no configuration of its network"
        read(of_network[0], "broken_policy")
    except Exception as caught:  # of many kinds: of the file system, of its format, of Brax
        return (str(caught).strip() or type(caught).__name__).splitlines()[0][:200].rstrip(".: ")
    return ""
