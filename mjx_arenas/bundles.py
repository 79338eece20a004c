"""Worlds that fail as folders, and replayed in C MuJoCo (host). K objects."""

import copy
import dataclasses
import functools
import json
import os
import pathlib
import zipfile
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from mjx_arenas import causes, cpu, describe, render, watch, watch_c
from mjx_arenas.arena import Arena
from mjx_arenas.causes import CAUSES, Failure
from mjx_arenas.output import whole
from mjx_arenas.params import QUANTITIES, ArenaParams, on_host
from mjx_arenas.watch_c import Rolled, State

if TYPE_CHECKING:
    from PIL import Image

VERSION = 1
STATES = ("start", "good")
FAR = 3.0  # objects that get farther away from their tables are left out of pictures [m]
LIFTED = 1e-3  # an object that starts this far above its table [m] had no free place


def write(
    folder: str | os.PathLike, arena: Arena, params: ArenaParams, start: State, good: State, about: dict[str, Any]
) -> None:
    """Writes a bundle, whole or not at all; one that is there is replaced.

    Args:
        folder: that does not exist, is empty or is a bundle.
        arena: of the world.
        params: of the world.
        start: its first state, of the model that is compiled for it.
        good: the last state before anything went wrong.
        about: what was found, and how.
    """
    folder = pathlib.Path(folder)
    if folder.exists() and not is_bundle(folder) and not (folder.is_dir() and not any(folder.iterdir())):
        raise FileExistsError(f"{str(folder)!r} is there already and is no bundle: choose another folder.")
    c = arena.c_world(params)[1]
    watch_c.set_state(c, start)
    about = {"bundle": VERSION, **about, "center": arena.layout.places.center.tolist()}
    with whole(folder) as unfinished:
        arena.export(params, unfinished, c, seed=about["seed"], world=about["world"])
        states: dict[str, Any] = {
            f"{of}_{name}": x for of, state in zip(STATES, (start, good), strict=True) for name, x in state.items()
        }
        np.savez_compressed(unfinished / "states.npz", **states)
        (unfinished / "failure.json").write_text(json.dumps(about, indent=2) + "\n")
        if is_bundle(folder):
            os.replace(folder, unfinished.parent / "replaced")  # which goes with what is unfinished


FILES = ("failure.json", "states.npz", "params.json", "world.xml")


def is_bundle(folder: pathlib.Path) -> bool:
    """Whether a folder looks like a bundle."""
    return (folder / "failure.json").is_file() and (folder / "states.npz").is_file()


@dataclasses.dataclass(frozen=True)
class Bundle:
    """A world that failed."""

    about: dict[str, Any]
    recorded: dict[str, Failure]
    params: ArenaParams
    objects: tuple[str, ...]
    model: mujoco.MjModel
    states: dict[str, State]  # by `STATES`

    @classmethod
    def read(cls, folder: str | os.PathLike) -> "Bundle":
        """What `write` wrote; one sentence if it did not."""
        folder = pathlib.Path(folder)
        if not folder.is_dir():
            what = "is a file, not a bundle's folder" if folder.exists() else "does not exist"
            raise FileNotFoundError(f"{str(folder)!r} {what}.")
        missing = [name for name in FILES if not (folder / name).is_file()]
        if missing:
            raise FileNotFoundError(f"Folder {str(folder)!r} is no bundle of a failed world: {missing[0]} is missing.")
        try:
            about, world = (json.loads((folder / name).read_text()) for name in ("failure.json", "params.json"))
            if about["bundle"] != VERSION:
                raise ValueError(f"it is of version {about['bundle']}, this is for {VERSION}")
            recorded = {cause: Failure(**about["causes"][cause]) for cause in CAUSES if cause in about["causes"]}
            with np.load(folder / "states.npz") as arrays:
                states = {of: {name: arrays[f"{of}_{name}"] for name in cpu.STATE} for of in STATES}
            values = (np.reshape(world["params"][name], (-1, *rule.item)) for name, rule in QUANTITIES.items())
            params = on_host(ArenaParams(*values))
            model = mujoco.MjModel.from_xml_path(str(folder / "world.xml"))
            return cls(about, recorded, params, tuple(world["objects"]), model, states)
        except (KeyError, TypeError, ValueError, OSError, EOFError, zipfile.BadZipFile) as error:
            why = " ".join(str(error).split())
            raise ValueError(f"Folder {str(folder)!r} is no whole bundle: {why}.") from None

    @property
    def cause(self) -> str:
        """The worst of what was recorded."""
        return next(iter(self.recorded))

    @functools.cached_property
    def tops(self) -> watch.Tops:
        """Where the objects belong, of one world."""
        params = ArenaParams(*(np.asarray(value)[None] for value in self.params))
        return watch.tops(params, np.reshape(self.about["center"], (-1, 3)))

    def data(self, of: str) -> mujoco.MjData:
        """The world in one of its states."""
        c = mujoco.MjData(self.model)
        watch_c.set_state(c, self.states[of])
        return c

    def first_step(self, of: str) -> int:
        """The step after which it was in that state."""
        return 0 if of == "start" else self.about["good_step"]

    def roll(self, of: str) -> Rolled:
        """From one of the states to the last step."""
        n_steps = self.about["n_steps"] - self.first_step(of)
        return watch_c.roll(lambda _: self.data(of), self.tops, self.objects, n_steps)


@dataclasses.dataclass(frozen=True)
class Replay:
    """A recorded failure beside what C MuJoCo does with the same world; `print` it."""

    reproduced: bool
    """The worst of what was recorded happens in C, too: for dropped contacts, there are more than there was room for."""
    begins: str
    """The state from which C was started: "start", or "good", the last one before anything went wrong, where the failure does
    not show from the start."""
    cause: str
    """The worst of what was recorded."""
    recorded: Mapping[str, Failure]
    """By cause, what `check` found."""
    found: Mapping[str, Failure]
    """By cause, what C MuJoCo shows; steps count from the first state."""
    contacts: int
    """Most contacts at once in C."""
    room: int | None
    """Contacts that there was room for; None: all."""
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
            width: of each of the four pictures [pixels].
            height: of each of the four pictures [pixels].
        """
        bundle, first = self._bundle, self._bundle.first_step(self.begins)
        failure = self.found.get(self.cause, self.recorded[self.cause])
        last = bundle.about["n_steps"]
        titles = {first: "start" if self.begins == "start" else "last good"}
        titles |= {max(first, failure.step - 1): "before"} if failure.step > first + 1 else {}
        titles |= (
            {max(first, failure.step): CAUSES[self.cause], last: "end"}
            if failure.step < last
            else {last: CAUSES[self.cause]}
        )
        c, shots = bundle.data(self.begins), []
        for step, title in sorted(titles.items()):
            mujoco.mj_step(bundle.model, c, nstep=step - first)
            first = step
            shots.append((f"step {step}: {title}", copy.copy(c)))
            mujoco.mj_forward(bundle.model, shots[-1][1])
        camera, pictures = _camera(bundle, [shot for _, shot in shots]), []
        with render.Drawing(bundle.model, width, height) as drawing:
            for _, shot in shots:
                drawing.update(bundle.model, shot, camera)
                pictures.append(drawing.pixels())
        return render.grid(pictures, [label for label, _ in shots])

    def __str__(self) -> str:
        about = self._bundle.about
        words = {name: {cause: f.what for cause, f in getattr(self, name).items()} for name in ("recorded", "found")}
        rows = [("", f"recorded, engine {about['engine']}", "C MuJoCo")]
        for cause, title in CAUSES.items():
            if cause in words["recorded"] or cause in words["found"]:
                rows.append((title, *(words[name].get(cause, "no") for name in ("recorded", "found"))))
        room = "all" if self.room is None else f"{self.room}"
        rows.append(("contacts", f"room for {room}", f"{self.contacts} at most"))
        end = "the same failure shows" if self.reproduced else "the failure does not show"
        begins = "start" if self.begins == "start" else f"last good state, after step {about['good_step']}"
        head = f"World {about['world']} of seed {about['seed']}, {about['n_steps']} steps: {CAUSES[self.cause]}."
        return f"{head}\n\n{describe.columns(rows)}\n\nC MuJoCo, from its {begins}: {end}."


def _camera(bundle: Bundle, shots: Sequence[mujoco.MjData]) -> mujoco.MjvCamera:
    """One that sees the tops of the objects' tables and, unless they get too far away, the objects at all times."""
    there = bundle.tops.there[0]
    tops, reach = bundle.tops.pos[0][there], np.hypot(*bundle.tops.half[0][there].T)[:, None] * (1, 1, 0)
    bodies = [bundle.model.body(name).id for name, here in zip(bundle.objects, there, strict=True) if here]
    points = np.concatenate([tops - reach, tops + reach, *(shot.xpos[bodies] for shot in shots), np.zeros((0, 3))])
    near = np.isfinite(points).all(1) & (abs(points - tops.mean(0)).max(1) < FAR) if len(points) else []
    camera = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(bundle.model, camera)
    if np.any(near):
        low, high = points[near].min(0), points[near].max(0)
        camera.lookat, camera.distance = (low + high) / 2, 1.8 * max(float((high - low).max()), 0.5)
        camera.azimuth, camera.elevation = 115, -25
    return camera


def replay(bundle: str | os.PathLike) -> Replay:
    """Steps a world that failed in C MuJoCo, and says whether the same failure shows.

    It starts from the recorded first state; if the failure does not show in as many steps as were checked, from the last state
    before anything went wrong.

    Args:
        bundle: folder that `CheckReport.save_bundle` wrote.

    Raises:
        FileNotFoundError, ValueError: the folder is no bundle, or not whole.
    """
    read = Bundle.read(bundle)
    replays = (_replay(read, of) for of in STATES)
    first = next(replays)
    return first if first.reproduced else next((r for r in replays if r.reproduced), first)


def _replay(bundle: Bundle, begins: str) -> Replay:
    rolled, room = bundle.roll(begins), bundle.about["room"]
    contacts = int(rolled.contacts[0])
    half = np.asarray(bundle.params.object_full_sizes)[:, 2] / 2
    placed = ~bundle.tops.there[0] | (rolled.above[0] < half + LIFTED)
    found = causes.placement(bundle.objects, placed) if begins == "start" else {}
    found |= causes.steps(rolled.seen, 0, rolled.pairs[0], bundle.objects)
    first = bundle.first_step(begins)
    found = {cause: f._replace(step=f.step + first, world=bundle.about["world"]) for cause, f in found.items()}
    if room is not None and contacts > room:
        what = f"{contacts} are found, {contacts - room} more than there was room for"
        found["dropped_contacts"] = Failure(bundle.about["world"], 0, contacts, what)
    found = {cause: found[cause] for cause in CAUSES if cause in found}
    cause = bundle.cause
    return Replay(cause in found, begins, cause, bundle.recorded, found, contacts, room, bundle)
