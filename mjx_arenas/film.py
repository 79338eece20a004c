"""Films of rollouts (host)."""

import fractions
import os
import pathlib
from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import cpu, render
from mjx_arenas.arena import Arena
from mjx_arenas.batch import ArenaBatch, rollout, take
from mjx_arenas.output import whole
from mjx_arenas.params import ArenaParams, on_host, present


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
    if len(np.shape(data.qpos)) != 2 or len(data.qpos) != batch.n_worlds:
        raise ValueError(f"`data` must be of the batch's {batch.n_worlds} worlds, got qpos of shape {data.qpos.shape}.")
    arena, worlds = batch.arena, [batch.world(i) for i in range(batch.n_worlds)]
    there = [np.concatenate(present(on_host(params))) for params in worlds]
    twins = [arena.c_world(params, take(data, i)) for i, params in enumerate(worlds)]

    def advance(n_steps: int) -> None:
        nonlocal data
        data = rollout(batch, data, n_steps)
        for i, (_, c) in enumerate(twins):
            cpu.set_state(c, take(data, i), arena.layout, there[i])

    _write(arena, worlds, twins, advance, pathlib.Path(path), seconds, fps, camera, width, height, labels)


def c_video(
    arena: Arena,
    params: Sequence[ArenaParams],
    twins: Sequence[tuple[mujoco.MjModel, mujoco.MjData]],
    path: str | os.PathLike,
    seconds: float = 2.0,
    fps: float = 30.0,
    camera: render.Camera = None,
    width: int = render.WIDTH,
    height: int = render.HEIGHT,
    labels: Sequence[str] | None = None,
) -> None:
    """The same of worlds that C MuJoCo steps, which compiles nothing.

    Args:
        arena: of the worlds.
        params: (W,) of each world.
        twins: (W,) from `arena.c_world`; they are stepped.
        path: of an mp4.
        seconds: of simulated time.
        fps: pictures in a second.
        camera: as for `Arena.render`.
        width: of each world's pictures [pixels].
        height: of each world's pictures [pixels].
        labels: (W,) as for `video`.
    """

    def advance(n_steps: int) -> None:
        for model, c in twins:
            mujoco.mj_step(model, c, n_steps)
            mujoco.mj_forward(model, c)

    _write(arena, params, twins, advance, pathlib.Path(path), seconds, fps, camera, width, height, labels)


def _write(
    arena: Arena,
    params: Sequence[ArenaParams],
    twins: Sequence[tuple[mujoco.MjModel, mujoco.MjData]],
    advance: Callable[[int], None],
    path: pathlib.Path,
    seconds: float,
    fps: float,
    camera: render.Camera,
    width: int,
    height: int,
    labels: Sequence[str] | None,
) -> None:
    """Draws the twins, and again each time after they were advanced by so many steps."""
    if path.suffix != ".mp4":
        raise ValueError(f"`path` must end in '.mp4', got {str(path)!r}.")
    for name, number in (("seconds", seconds), ("fps", fps)):
        if isinstance(number, bool) or not isinstance(number, (int, float)) or not 0 < number < np.inf:
            raise ValueError(f"`{name}` must be a number > 0, got {number!r}.")
    labels = [f"world {i}" for i in range(len(twins))] if labels is None else labels
    if len(labels) != len(twins):
        raise ValueError(f"`labels` must be one for each of the {len(twins)} worlds, got {len(labels)}.")
    av = render.extra("av")
    timestep = float(arena.mj_model.opt.timestep)
    n_steps = max(1, round(1 / (fps * timestep)))
    n_frames = 1 + round(seconds / (n_steps * timestep))
    columns = int(np.ceil(np.sqrt(len(twins))))
    cameras = [render.overview(arena, p) if camera is None else camera for p in params]
    with (
        whole(path) as unfinished,
        render.Drawing(arena.mj_model, width, height) as drawing,
        av.open(str(unfinished), "w") as file,
    ):
        stream = file.add_stream("libx264", rate=fractions.Fraction(1 / (n_steps * timestep)).limit_denominator(1000))
        for frame in range(n_frames):
            if frame:
                advance(n_steps)
            pictures = []
            for (model, c), view in zip(twins, cameras, strict=True):
                drawing.update(model, c, view)
                pictures.append(drawing.pixels())
            now = [f"{label}, {frame * n_steps * timestep:.2f} s" for label in labels]
            sheet = np.asarray(render.grid(pictures, now, columns))
            if not frame:
                stream.height, stream.width = (n // 2 * 2 for n in sheet.shape[:2])  # colours are of two by two pixels
            picture = av.VideoFrame.from_ndarray(sheet[: stream.height, : stream.width], format="rgb24")
            file.mux(stream.encode(picture))
        file.mux(stream.encode())
