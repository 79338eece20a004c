"""Films of rollouts (host)."""

import contextlib
import fractions
import os
import pathlib
from collections.abc import Generator, Sequence

import numpy as np
from mujoco import mjx

from mjx_arenas import cpu, render
from mjx_arenas.batch import ArenaBatch, rollout, take
from mjx_arenas.output import whole
from mjx_arenas.params import on_host, present


def video(
    batch: ArenaBatch,
    data: mjx.Data,
    path: str | os.PathLike,
    seconds: float = 2.0,
    fps: float = 30.0,
    camera: render.Camera = None,
    width: int = render.WIDTH,
    height: int = render.HEIGHT,
    labels: Sequence[str] | None = None,
) -> None:
    """Writes a video of a rollout of all worlds of a batch, side by side, at the speed of life.

    Args:
        batch: W worlds: few.
        data: of all worlds; its controls hold all the time.
        path: of an mp4. Nothing new is there if the rollout or the drawing fails.
        seconds: of simulated time.
        fps: pictures in a second, as near as whole steps come.
        camera: as for `Arena.render`.
        width: of each world's pictures [pixels].
        height: of each world's pictures [pixels].
        labels: (W,) of the worlds, to which the time is added. Default: "world 0", ...
    """
    path = pathlib.Path(path)
    if path.suffix != ".mp4":
        raise ValueError(f"`path` must end in '.mp4', got {str(path)!r}.")
    for name, number in (("seconds", seconds), ("fps", fps)):
        if isinstance(number, bool) or not isinstance(number, (int, float)) or not 0 < number < np.inf:
            raise ValueError(f"`{name}` must be a number > 0, got {number!r}.")
    labels = [f"world {i}" for i in range(batch.n_worlds)] if labels is None else labels
    if len(labels) != batch.n_worlds:
        raise ValueError(f"`labels` must be one for each of the {batch.n_worlds} worlds, got {len(labels)}.")
    av = render.extra("av")
    timestep = float(batch.arena.mj_model.opt.timestep)
    n_steps = max(1, round(1 / (fps * timestep)))
    n_frames = 1 + round(seconds / (n_steps * timestep))
    columns = int(np.ceil(np.sqrt(batch.n_worlds)))
    film = _film(batch, data, n_steps, camera, width, height)
    with whole(path) as unfinished, contextlib.closing(film), av.open(str(unfinished), "w") as file:
        stream = file.add_stream("libx264", rate=fractions.Fraction(1 / (n_steps * timestep)).limit_denominator(1000))
        for frame, pictures in zip(range(n_frames), film, strict=False):
            now = [f"{label}, {frame * n_steps * timestep:.2f} s" for label in labels]
            sheet = np.asarray(render.grid(pictures, now, columns))
            if not frame:
                stream.height, stream.width = (n // 2 * 2 for n in sheet.shape[:2])  # colours are of two by two pixels
            picture = av.VideoFrame.from_ndarray(sheet[: stream.height, : stream.width], format="rgb24")
            file.mux(stream.encode(picture))
        file.mux(stream.encode())


def _film(
    batch: ArenaBatch, data: mjx.Data, n_steps: int, camera: render.Camera, width: int, height: int
) -> Generator[list[np.ndarray], None, None]:
    """A picture of each world, now and after each `n_steps` steps, without an end."""
    arena = batch.arena
    worlds = [batch.world(i) for i in range(batch.n_worlds)]
    cameras = [render.overview(arena, params) if camera is None else camera for params in worlds]
    there = [np.concatenate(present(on_host(params))) for params in worlds]
    twins = [arena.c_world(params) for params in worlds]
    with render.Drawing(arena.mj_model, width, height) as drawing:
        while True:
            pictures = []
            for i, (model, c) in enumerate(twins):
                cpu.set_state(c, take(data, i), arena.layout, there[i])
                drawing.update(model, c, cameras[i])
                pictures.append(drawing.pixels())
            yield pictures
            data = rollout(batch, data, n_steps)
