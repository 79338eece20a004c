"""Worlds that failed, again in C MuJoCo (host). K objects."""

import copy
import dataclasses
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import mujoco

from mjx_arenas.checks import causes
from mjx_arenas.checks.causes import CAUSES, Failure
from mjx_arenas.checks.folders import STATES, Bundle
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.twin import cpu
from mjx_arenas.viz import render
from mjx_arenas.viz.table import columns

if TYPE_CHECKING:
    from PIL import Image


@dataclasses.dataclass(frozen=True, eq=False)
class Replay:
    """Compares a recorded failure with what C MuJoCo does in the same world; `print` it."""

    reproduced: bool
    """Whether the worst recorded failure also occurs in C. For dropped contacts: whether there are more than there was room for."""
    begins: str
    """The state from which C was started: "start" or "good".

    "good" is the last state before anything went wrong. It is used if the failure does not occur from the start."""
    cause: str
    """Cause of the worst recorded failure."""
    recorded: Mapping[str, Failure]
    """Failures that `check` found, by cause."""
    found: Mapping[str, Failure]
    """Failures in C MuJoCo, by cause; steps count from the first state."""
    contacts: int
    """Largest number of contacts at once in C."""
    room: int | None
    """Number of contacts for which there was room; None: all."""
    _bundle: Bundle = dataclasses.field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The replay as numbers, lists and words, e.g. for JSON."""
        by_cause = {
            name: {cause: f._asdict() for cause, f in getattr(self, name).items()} for name in ("recorded", "found")
        }
        names = ("reproduced", "begins", "cause", "contacts", "room")
        about = {name: self._bundle.about[name] for name in ("engine", "seed", "world", "n_steps", "good_step")}
        return {name: getattr(self, name) for name in names} | about | by_cause

    def picture(self, width: int = render.WIDTH, height: int = render.HEIGHT) -> "Image.Image":
        """A `PIL.Image` of the world in C: where it starts, just before the failure, at the failure, and at the end.

        Args:
            width: width of each of the four pictures [pixels].
            height: height of each of the four pictures [pixels].

        Raises:
            RuntimeError: MuJoCo does not compile the world, or there is no OpenGL here.
        """
        bundle, first = self._bundle, self._bundle.first_step(self.begins)
        if bundle.model is None:
            raise error([problem("bundle", "no_picture")], kind=RuntimeError)
        failure = self.found.get(self.cause, self.recorded[self.cause])
        last = bundle.about["n_steps"]
        titles = {first: "start" if self.begins == "start" else "last good"}
        titles |= {max(first, failure.step - 1): "before"} if failure.step > first + 1 else {}
        titles |= (
            {max(first, failure.step): CAUSES[self.cause], last: "end"}
            if failure.step < last
            else {last: CAUSES[self.cause]}
        )
        c, shots, pictures = bundle.data(self.begins), [], []
        with render.Drawing(bundle.model, width, height) as drawing:
            with cpu.silent():
                for step, title in sorted(titles.items()):
                    mujoco.mj_step(bundle.model, c, nstep=step - first)
                    first = step
                    shots.append((f"step {step}: {title}", copy.copy(c)))
                    mujoco.mj_forward(bundle.model, shots[-1][1])
            twins = [(bundle.model, shot) for _, shot in shots]
            camera = render.overview(bundle.tables, twins, width / height, bundle.parts)
            for _, shot in shots:
                drawing.update(bundle.model, shot, camera)
                pictures.append(drawing.pixels())
        return render.grid(pictures, [label for label, _ in shots])

    def __str__(self) -> str:
        about = self._bundle.about
        words = {name: {cause: f.what for cause, f in getattr(self, name).items()} for name in ("recorded", "found")}
        rows: list[tuple[str, ...]] = [("", f"recorded, engine {about['engine']}", "C MuJoCo")]
        for cause, title in CAUSES.items():
            if cause in words["recorded"] or cause in words["found"]:
                rows.append((title, *(words[name].get(cause, "no") for name in ("recorded", "found"))))
        head = f"World {about['world']} of seed {about['seed']}, {about['n_steps']} steps: {CAUSES[self.cause]}."
        if not about["n_steps"]:
            rows = [("cause", "found again"), *((CAUSES[cause], what) for cause, what in words["found"].items())]
            end = "The same problem was found again." if self.reproduced else "The problem was not found again."
            return f"{head}\n\n{columns(rows)}\n\nThe arena is invalid, so nothing was stepped. {end}"
        room = "all" if self.room is None else f"{self.room}"
        rows.append(("contacts", f"room for {room}", f"{self.contacts} at most"))
        end = "the same failure shows" if self.reproduced else "the failure does not show"
        begins = "start" if self.begins == "start" else f"last good state, after step {about['good_step']}"
        return f"{head}\n\n{columns(rows)}\n\nC MuJoCo, from its {begins}: {end}."


@with_known_arguments
def replay(bundle: str | os.PathLike) -> Replay:
    """Steps a failed world again, in C MuJoCo, and says whether the same failure occurs.

    It starts from the recorded first state. If the failure does not occur within the number of steps that were checked, it starts again
    from the last state before anything went wrong.

    A world that MuJoCo would not compile, or whose parameters are wrong, is not stepped. Its parameters are checked again.

    Args:
        bundle: path of a folder that `CheckReport.save_bundle` wrote.

    Raises:
        FileNotFoundError, ValueError: the folder is not a bundle, or a file in it is damaged.
    """
    read = Bundle.read(bundle)
    replays = (_replay(read, of) for of in STATES)
    first = next(replays)
    return first if first.reproduced else next((r for r in replays if r.reproduced), first)


def _replay(bundle: Bundle, begins: str) -> Replay:
    room, contacts = bundle.about["room"], 0
    found = bundle.at_the_start() if begins == "start" else {}
    if bundle.model is not None:
        rolled = bundle.roll(begins)
        contacts, first = int(rolled.contacts[0]), bundle.first_step(begins)
        found |= causes.steps(rolled.seen, 0, rolled.pairs[0], bundle.objects, first)
    if room is not None and contacts > room:
        what = f"{contacts} are found, {contacts - room} more than there was room for"
        found["dropped_contacts"] = Failure(0, 0, contacts, what)
    found = {cause: found[cause]._replace(world=bundle.about["world"]) for cause in CAUSES if cause in found}
    cause = bundle.cause
    return Replay(cause in found, begins, cause, bundle.recorded, found, contacts, room, bundle)
