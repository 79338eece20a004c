"""Pictures of worlds as they are (host)."""

import copy
import importlib
import os
import subprocess
import sys
from collections.abc import Iterable, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

if TYPE_CHECKING:
    import mujoco
    from matplotlib.figure import Figure
    from PIL import Image

    from mjx_arenas.arena import Arena
    from mjx_arenas.params import ArenaParams

Camera: TypeAlias = Any  # a camera's name or id, -1 for MuJoCo's free one, or a mujoco.MjvCamera

WIDTH, HEIGHT = 480, 360  # of a picture
NO_GL = "OpenGL is missing here (on Debian and Ubuntu: apt install libegl1 libgl1-mesa-dri)"


def choose_gl() -> str | None:
    """Sets `MUJOCO_GL` to a backend that works here, with a screen or without; a set `MUJOCO_GL` is left alone.

    Returns:
        The backend, or None if there is none.
    """
    chosen = os.environ.get("MUJOCO_GL")
    if not chosen and sys.platform != "linux":
        return "glfw"
    if not chosen:
        on_screen = ("glfw",) if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY") else ()
        chosen = next((gl for gl in (*on_screen, "egl", "osmesa") if works(gl)), "disable")
        os.environ["MUJOCO_GL"] = chosen
    backends = sys.modules.get("mujoco.rendering.classic.gl_context")
    if backends is not None and getattr(backends, "_MUJOCO_GL", chosen) != chosen.lower().strip():
        importlib.reload(backends)  # MuJoCo chose when it was imported, before the variable was set
    return None if chosen.lower().strip() in ("disable", "disabled", "off", "false", "0") else chosen


def works(backend: str) -> bool:
    """Whether a process of its own gets a context: one that fails leaves this process without OpenGL."""
    code = f"from mujoco.{backend} import GLContext; GLContext(8, 8).make_current()"
    environ = {**os.environ, "MUJOCO_GL": backend}
    if backend != "glfw":
        environ["PYOPENGL_PLATFORM"] = backend
    return (
        subprocess.run(
            [sys.executable, "-W", "error", "-c", code], env=environ, capture_output=True, check=False
        ).returncode
        == 0
    )


class Drawing:
    """Draws states of the worlds of one arena, with one OpenGL context, which takes longer to make than pictures; a context manager.

    Args:
        model: of any of the worlds: what is drawn may differ from it in all but the assets.
        width, height: of the pictures [pixels].

    Raises:
        RuntimeError: there is no OpenGL here; one sentence that says what to install.
    """

    def __init__(self, model: "mujoco.MjModel", width: int = WIDTH, height: int = HEIGHT) -> None:
        import mujoco

        for name, size in (("width", width), ("height", height)):
            if isinstance(size, bool) or not isinstance(size, (int, np.integer)) or not 0 < size <= 16384:
                raise ValueError(f"`{name}` must be a whole number from 1 to 16384 [pixels], got {size!r}.")
        gl = choose_gl()
        if gl is None:
            raise RuntimeError(f"Pictures cannot be drawn: {NO_GL}.")
        model = copy.copy(model)
        buffer = model.vis.global_
        buffer.offwidth, buffer.offheight = max(buffer.offwidth, width), max(buffer.offheight, height)
        try:
            self._renderer = mujoco.Renderer(model, height, width)
        except Exception as error:  # each backend fails in its own way
            why = " ".join(str(error).split())
            raise RuntimeError(f"Pictures cannot be drawn: OpenGL does not work with MUJOCO_GL={gl}: {why}") from error

    def __enter__(self) -> "Drawing":
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.close()

    def update(
        self,
        model: "mujoco.MjModel",
        data: "mujoco.MjData",
        camera: Camera = -1,
        option: "mujoco.MjvOption | None" = None,
    ) -> "mujoco.MjvScene":
        """The scene that `pixels` draws: of a state whose positions have been computed."""
        import mujoco

        scene, everything = self._renderer.scene, mujoco.mjtCatBit.mjCAT_ALL.value
        view = _camera(model, camera)
        mujoco.mjv_updateScene(model, data, option or mujoco.MjvOption(), None, view, everything, scene)
        return scene

    def pixels(self) -> np.ndarray:
        """(height, width, 3) uint8."""
        return self._renderer.render()


def _camera(model: "mujoco.MjModel", camera: Camera) -> "mujoco.MjvCamera":
    """The camera, or an error that lists those that there are."""
    import mujoco

    if isinstance(camera, mujoco.MjvCamera):
        return camera
    names, view = [model.camera(i).name for i in range(model.ncam)], mujoco.MjvCamera()
    index = names.index(camera) if isinstance(camera, str) and camera in names else camera
    if isinstance(index, (bool, str)) or not isinstance(index, (int, np.integer)) or not -1 <= index < model.ncam:
        known = f"{', '.join(map(repr, filter(None, names)))}, an id from 0 to {model.ncam - 1}, " if names else ""
        raise ValueError(f"`camera` must be {known}-1 (MuJoCo's free camera), an MjvCamera or None, got {camera!r}.")
    if index == -1:
        mujoco.mjv_defaultFreeCamera(model, view)
    else:
        view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, int(index)
    return view


def draw_worlds(
    arena: "Arena", worlds: "Iterable[tuple[ArenaParams, Any]]", camera: Camera, width: int, height: int
) -> "list[np.ndarray]":
    """A picture of each world with its state, `mjx.Data`, `MjData` or None."""
    with Drawing(arena.mj_model, width, height) as drawing:
        pictures = []
        for params, data in worlds:
            drawing.update(*arena.c_world(params, data), overview(arena, params) if camera is None else camera)
            pictures.append(drawing.pixels())
        return pictures


def overview(arena: "Arena", params: "ArenaParams") -> "mujoco.MjvCamera":
    """A camera that sees the tables of one world from the same side as in every other, and the robots on them."""
    import mujoco

    from mjx_arenas.params import on_host

    params = on_host(params)
    there = params.table_active if params.table_active.any() else ~params.table_active
    offsets, sizes = params.table_offsets[there], params.table_full_sizes[there]
    reach = np.hypot(sizes[:, 0], sizes[:, 1])[:, None] / 2
    low, high = (offsets[:, :2] - reach).min(0), (offsets[:, :2] + reach).max(0)
    tops = offsets[:, 2]
    robot = 0.5 if arena.mounts else 0.0
    camera = mujoco.MjvCamera()
    camera.lookat = (*(low + high) / 2, 0.75 * (tops.min() + tops.max()) / 2 + robot / 2)
    camera.distance = 1.3 * max(float(np.max(high - low)), 1.2) + robot + 1.5 * np.ptp(tops)
    camera.azimuth, camera.elevation = 115, -36
    return camera


def picture(figure: "Figure") -> np.ndarray:
    """(height, width, 3) uint8 of a `matplotlib` figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def grid(pictures: Sequence[np.ndarray], labels: Sequence[str], columns: int = 4) -> "Image.Image":
    """The pictures in a grid, each with its label.

    Args:
        pictures: N of (height, width, 3) uint8.
        labels: N of them.
        columns: at most so many pictures side by side.
    """
    Image, ImageDraw, ImageFont = (extra(f"PIL.{name}") for name in ("Image", "ImageDraw", "ImageFont"))
    if len(labels) != len(pictures):
        raise ValueError(f"`labels` must be one for each of the {len(pictures)} pictures, got {len(labels)}.")
    if isinstance(columns, bool) or not isinstance(columns, (int, np.integer)) or columns < 1:
        raise ValueError(f"`columns` must be a whole number >= 1, got {columns!r}.")
    height, width = pictures[0].shape[:2]
    columns = min(columns, len(pictures))
    rows, gap = -(-len(pictures) // columns), 6
    sheet = Image.new("RGB", (columns * (width + gap) + gap, rows * (height + gap) + gap), "white")
    draw, size = ImageDraw.Draw(sheet), max(12, height // 20)
    longest = max(labels, key=len)
    while size > 8 and draw.textlength(longest, ImageFont.load_default(size=size)) > width - 16:
        size -= 1
    font = ImageFont.load_default(size=size)
    for i, (pixels, label) in enumerate(zip(pictures, labels, strict=True)):
        x, y = gap + (i % columns) * (width + gap), gap + (i // columns) * (height + gap)
        sheet.paste(Image.fromarray(pixels), (x, y))
        draw.text((x + 8, y + 6), label, fill="black", font=font, stroke_width=2, stroke_fill="white")
    return sheet


def extra(module: str) -> ModuleType:
    """A module that the extra `[viz]` brings."""
    try:
        return importlib.import_module(module)
    except ImportError:
        raise ImportError(f"This needs {module.partition('.')[0]}: pip install 'mjx_arenas[viz]'.") from None
