"""Films of rollouts (host)."""

import fractions
import functools
import os
import pathlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.arena import Arena
from mjx_arenas.extras import extra
from mjx_arenas.files.output import whole
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.params.params import on_host
from mjx_arenas.problem import problem
from mjx_arenas.progress import Tell, teller
from mjx_arenas.record.record import Record
from mjx_arenas.rules import validation
from mjx_arenas.sim.batch import ArenaBatch, check_data, take
from mjx_arenas.sim.rollouts import rollout
from mjx_arenas.twin import cpu, twin
from mjx_arenas.viz import render

if TYPE_CHECKING:
    from PIL import Image

FPS = 30.0  # pictures of a film in a second


@with_known_arguments
def video(
    batch: ArenaBatch,
    data: mjx.Data,
    path: str | os.PathLike,
    seconds: float = 2.0,
    fps: float = FPS,
    camera: render.Camera = None,
    width: int = render.WIDTH,
    height: int = render.HEIGHT,
    labels: Sequence[str] | None = None,
    progress: Tell | None = None,
) -> None:
    """Writes a video of a rollout of all worlds of a batch, side by side, in real time.

    Args:
        batch: W worlds; keep W small.
        data: data of all worlds; `ctrl` stays constant.
        path: path of an mp4. If the rollout or the drawing fails, nothing new is left there.
        seconds: length in simulated time [s].
        fps: pictures per second, as near as whole steps allow.
        camera: as for `Arena.render`.
        width: width of each world's pictures [pixels].
        height: height of each world's pictures [pixels].
        labels: (W,) text for each world, to which the time is added. Default: "world 0", ... in their order, as for `contact_sheet`.
        progress: function that is called with the numbers of pictures drawn and of all pictures.
    """
    check_data(batch, data)
    record, worlds = batch.record, [batch.world(i) for i in range(batch.n_worlds)]
    there = [record.layout.presence.there(on_host(params)) for params in worlds]
    twins = [twin.c_world(record, params, take(data, i)) for i, params in enumerate(worlds)]

    def advance(n_steps: int) -> None:
        nonlocal data
        data = rollout(batch, data, n_steps)
        for i, (_, c) in enumerate(twins):
            cpu.set_state(c, take(data, i), record.layout, there[i])

    c_video(record, twins, path, seconds, fps, camera, width, height, labels, progress, advance)


def c_video(
    arena: Arena | Record,
    twins: Sequence[tuple[mujoco.MjModel, mujoco.MjData]],
    path: str | os.PathLike,
    seconds: float = 2.0,
    fps: float = FPS,
    camera: render.Camera = None,
    width: int = render.WIDTH,
    height: int = render.HEIGHT,
    labels: Sequence[str] | None = None,
    progress: Tell | None = None,
    advance: Callable[[int], None] | None = None,
) -> None:
    """Writes a video as `video` does, of worlds in C MuJoCo, without compiling anything.

    Args:
        arena: arena of the worlds, or its record.
        twins: (W,) worlds from `arena.c_world`, drawn at each time.
        path: as for `video`, and so are those up to `labels`.
        seconds: length in simulated time [s].
        fps: pictures per second.
        camera: camera of all worlds.
        width: of each world's pictures [pixels].
        height: of each world's pictures [pixels].
        labels: (W,) text for each world.
        progress: as for `video`.
        advance: function that takes the twins a number of steps further. None: C MuJoCo steps them.
    """
    path, spans = checked_path(path), times([model.opt.timestep for model, _ in twins], seconds, fps)
    labels = [f"world {i}" for i in range(len(twins))] if labels is None else labels
    if len(labels) != len(twins):
        raise validation.error([problem("labels", "one_each", n=len(twins), what="worlds", came=len(labels))])
    extra("av")  # before anything is drawn
    with render.Drawing(arena.mj_model, width, height) as drawing:
        view = (
            render.overview(arena.table_names, twins, width / height, arena.record.part_names)
            if camera is None
            else camera
        )

        def frames() -> Iterator[list[np.ndarray]]:
            for frame in range(spans.n_frames):
                if frame:
                    (advance or functools.partial(_step, twins))(spans.n_steps)
                pictures = []
                for model, c in twins:
                    drawing.update(model, c, view)
                    pictures.append(drawing.pixels())
                yield pictures

        write_timed(path, spans, frames(), labels, progress)


class Times(NamedTuple):
    """Times of the pictures of a film."""

    n_steps: int
    """Steps from one picture to the next."""
    n_frames: int
    """The number of pictures."""
    apart: float
    """Time from one picture to the next [s]."""


def times(timesteps: Sequence[float] | np.ndarray, seconds: float, fps: float = FPS) -> Times:
    """The times of the pictures of a film of `seconds` with `fps` pictures a second, rounded to whole steps.

    Raises:
        ValueError: the worlds' steps are not of one length.
    """
    seconds, fps = positive("seconds", seconds), positive("fps", fps)
    timestep = float(np.min(timesteps))
    if np.ptp(timesteps):
        told = {"least": timestep, "most": float(np.max(timesteps))}
        raise validation.error([problem("option.timestep", "film_steps", None, [*told.values()], told)])
    n_steps = max(1, round(1 / (fps * timestep)))
    return Times(n_steps, 1 + round(seconds / (n_steps * timestep)), n_steps * timestep)


def write_timed(
    path: pathlib.Path,
    spans: Times,
    frames: Iterable[Sequence[np.ndarray]],
    labels: Sequence[str],
    progress: Tell | None = None,
) -> None:
    """Writes a film in real time, with each world's time on its pictures.

    Args:
        path: path of an mp4.
        spans: times of the pictures.
        frames: for each time, a picture (height, width, 3) uint8 of each world.
        labels: text for each world.
        progress: function that is called with the numbers of pictures drawn and of all pictures.
    """
    tell, columns = teller(progress), int(np.ceil(np.sqrt(len(labels))))

    def sheets() -> "Iterator[Image.Image]":
        for frame, pictures in enumerate(frames):
            yield render.grid(pictures, [f"{label}, {frame * spans.apart:.2f} s" for label in labels], columns)
            tell(frame + 1, spans.n_frames)

    write(path, 1 / spans.apart, sheets())


def write(path: pathlib.Path, fps: float, sheets: "Iterable[Image.Image]") -> None:
    """Writes pictures of one size as an mp4 with a rate of pictures per second. If writing fails, nothing is left behind."""
    av = extra("av")
    with whole(path) as unfinished, av.open(str(unfinished), "w") as file:
        stream = file.add_stream("libx264", rate=fractions.Fraction(fps).limit_denominator(1000))
        for frame, picture in enumerate(sheets):
            sheet = np.asarray(picture)
            if not frame:
                stream.height, stream.width = (n // 2 * 2 for n in sheet.shape[:2])  # colours are of two by two pixels
            pixels = av.VideoFrame.from_ndarray(sheet[: stream.height, : stream.width], format="rgb24")
            file.mux(stream.encode(pixels))
        file.mux(stream.encode())


def checked_path(path: str | os.PathLike) -> pathlib.Path:
    """The path of an mp4."""
    validation.check_path("path", path)
    path = pathlib.Path(path)
    if path.suffix != ".mp4":
        raise validation.error([problem("path", "mp4", None, str(path))])
    return path


def positive(name: str, number: float) -> float:
    """A number above 0."""
    if not validation.is_number(number) or not 0 < number < np.inf:
        raise validation.error([problem(name, "must", None, number, must="a number > 0")])
    return float(number)


def _step(twins: Sequence[tuple[mujoco.MjModel, mujoco.MjData]], n_steps: int) -> None:
    with cpu.silent():
        for model, c in twins:
            mujoco.mj_step(model, c, n_steps)
            mujoco.mj_forward(model, c)
