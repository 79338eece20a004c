"""Pictures of worlds as they are (host)."""

import contextlib
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mujoco
    from PIL import Image

    from mjx_arenas.arena import Arena
    from mjx_arenas.params import ArenaParams


def choose_gl() -> str | None:
    """Sets `MUJOCO_GL` to a backend that works here without a screen; call it before `mujoco` is imported.

    Returns:
        The backend, or None if there is none; a set `MUJOCO_GL` and a screen are left alone.
    """
    chosen = os.environ.get("MUJOCO_GL")
    if chosen or sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        return chosen or "glfw"
    for backend in ("egl", "osmesa"):
        code = f"from mujoco.{backend} import GLContext; GLContext(8, 8).make_current()"
        environ = {**os.environ, "MUJOCO_GL": backend, "PYOPENGL_PLATFORM": backend}
        if subprocess.run([sys.executable, "-c", code], env=environ, capture_output=True, check=False).returncode == 0:
            os.environ["MUJOCO_GL"] = backend
            return backend
    os.environ["MUJOCO_GL"] = "disable"
    return None


@contextlib.contextmanager
def renderer(model: "mujoco.MjModel", height: int, width: int) -> "Iterator[mujoco.Renderer]":
    """`mujoco.Renderer`, which says in one sentence what to do where there is no OpenGL.

    Raises:
        RuntimeError: this process has no OpenGL.
    """
    import mujoco

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW's, of a screen that is not there
        try:
            made = mujoco.Renderer(model, height, width)
        except (mujoco.FatalError, AttributeError, ImportError):
            raise RuntimeError(
                "Pictures need OpenGL, which this process has not: without a screen set MUJOCO_GL=egl (or osmesa) in its "
                "environment, or call mjx_arenas.render.choose_gl() before mujoco is imported."
            ) from None
    with made:
        yield made


def render_world(
    arena: "Arena", params: "ArenaParams", qpos: np.ndarray | None = None, width: int = 480, height: int = 360
) -> np.ndarray:
    """Picture (height, width, 3) of one world, of the model compiled for it; `qpos` (nq,): None for nominal places."""
    import mujoco

    from mjx_arenas.params import on_host, present

    params = on_host(params)
    model = arena.compile(params)
    data = mujoco.MjData(model)
    if qpos is not None:
        data.qpos = np.asarray(qpos)[arena.layout.qpos_of(np.concatenate(present(params)))]
    mujoco.mj_forward(model, data)
    with renderer(model, height, width) as draw:
        draw.update_scene(data, _overview(arena, params))
        return draw.render()


def _overview(arena: "Arena", params: "ArenaParams") -> "mujoco.MjvCamera":
    """A camera that sees the tables of one world from the same side as in every other, and the robots on them."""
    import mujoco

    there = params.table_active if params.table_active.any() else ~params.table_active
    offsets, sizes = params.table_offsets[there], params.table_full_sizes[there]
    reach = np.hypot(sizes[:, 0], sizes[:, 1])[:, None] / 2
    low, high = (offsets[:, :2] - reach).min(0), (offsets[:, :2] + reach).max(0)
    robot = 0.5 if arena.mounts else 0.0
    camera = mujoco.MjvCamera()
    camera.lookat = (*(low + high) / 2, 0.75 * offsets[:, 2].mean() + robot / 2)
    camera.distance = 1.3 * max(float(np.max(high - low)), 1.2) + robot
    camera.azimuth, camera.elevation = 115, -36
    return camera


def contact_sheet(pictures: Sequence[np.ndarray], labels: Sequence[str], columns: int = 4) -> "Image.Image":
    """The pictures in a grid, each with its label."""
    from PIL import Image, ImageDraw, ImageFont

    height, width = pictures[0].shape[:2]
    rows, gap = -(-len(pictures) // columns), 6
    sheet = Image.new("RGB", (columns * (width + gap) + gap, rows * (height + gap) + gap), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=max(12, height // 20))
    for i, (picture, label) in enumerate(zip(pictures, labels, strict=True)):
        x, y = gap + (i % columns) * (width + gap), gap + (i // columns) * (height + gap)
        sheet.paste(Image.fromarray(picture), (x, y))
        draw.text((x + 8, y + 6), label, fill="black", font=font, stroke_width=2, stroke_fill="white")
    return sheet
