"""Pictures of worlds as they are (host)."""

import copy
import importlib
import os
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from mjx_arenas.extras import extra
from mjx_arenas.keywords import ALIKE, nearest
from mjx_arenas.problem import problem

if TYPE_CHECKING:
    import mujoco
    from matplotlib.figure import Figure
    from PIL import Image

    from mjx_arenas.params.params import ArenaParams
    from mjx_arenas.record.record import Record

Camera: TypeAlias = Any  # a camera's name or id, -1 for MuJoCo's free one, or a mujoco.MjvCamera

WIDTH, HEIGHT = 480, 360  # of a picture
GAP = 6  # between pictures of a grid, and around them [pixels]
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


def check_screen() -> None:
    """Refuses to open a window where there is no screen, which would end the process.

    Raises:
        RuntimeError: one sentence.
    """
    if sys.platform == "linux" and not works("glfw"):
        display = os.environ.get("DISPLAY")
        from mjx_arenas.problems import messages

        which = f"DISPLAY={display} is none" if display else "there is none"
        raise messages.error([problem("", "no_screen", None, display, which=which)], kind=RuntimeError)


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

        from mjx_arenas.rules import validation

        for name, size in (("width", width), ("height", height)):
            validation.whole(name, size, 1, 16384, "a whole number from 1 to 16384 [pixels]")
        gl = choose_gl()
        if gl is None:
            raise validation.error([problem("", "no_gl", None, gl, why=NO_GL)], kind=RuntimeError)
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

    from mjx_arenas.rules import validation

    if isinstance(camera, mujoco.MjvCamera):
        return camera
    names, view = [model.camera(i).name for i in range(model.ncam)], mujoco.MjvCamera()
    index = names.index(camera) if isinstance(camera, str) and camera in names else camera
    if not validation.is_whole(index, -1, model.ncam - 1):
        known = f"{', '.join(map(repr, filter(None, names)))}, an id from 0 to {model.ncam - 1}, " if names else ""
        close = nearest(camera, filter(None, names), ALIKE) if isinstance(camera, str) else None
        told = {"near": f": {close!r} may be meant" if close else ""}
        must = f"{known}-1 (MuJoCo's free camera), an MjvCamera or None"
        raise validation.error([problem("camera", "must", None, camera, told, must=must)])
    if index == -1:
        mujoco.mjv_defaultFreeCamera(model, view)
    else:
        view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, int(index)
    return view


def draw_worlds(
    record: "Record",
    worlds: "Iterable[tuple[ArenaParams, Any]]",
    camera: Camera,
    width: int,
    height: int,
    keyframe: str | None = None,
) -> "list[np.ndarray]":
    """A picture of each world with its state, `mjx.Data`, `MjData` or None: in a keyframe then, or at `qpos0`."""
    from mjx_arenas.twin import twin

    with Drawing(record.mj_model, width, height) as drawing:
        twins = [twin.c_world(record, params, data, keyframe=keyframe) for params, data in worlds]
        view = overview(record.table_names, twins, width / height, record.part_names) if camera is None else camera
        pictures = []
        for model, c in twins:
            drawing.update(model, c, view)
            pictures.append(drawing.pixels())
        return pictures


ASIDE, FROM_THE_FRONT = (115.0, -36.0), (20.0, -30.0)  # where the camera looks [deg]
BEYOND = 1.5  # what is farther away from the tables is left out of the frame [m]
SLAB = 0.1  # what is so far below the top of a table are its legs [m]


def overview(
    tables: Sequence[str],
    twins: "Iterable[tuple[mujoco.MjModel, mujoco.MjData]]",
    aspect: float,
    parts: Sequence[str] = (),
    towards: tuple[float, float] | None = None,
    legs: bool = True,
) -> "mujoco.MjvCamera":
    """A camera that sees the tables, objects, robots, goals and furniture of all of some worlds, which are so seen to differ.

    Args:
        tables: names of their bodies.
        twins: (W,) models and data, after `mj_forward`; an iterator may give the same data in one state after the other.
        aspect: width of the picture by its height.
        parts: names of the bodies of furniture, whose fronts are towards -x, if it was not turned.
        towards: azimuth and elevation in which it looks [deg]. None: at the fronts of furniture, else from the side.
        legs: whether it also sees what is more than `SLAB` below the top of a table.
    """
    import mujoco

    points, model = [], None
    for model, c in twins:
        points.append(_points(tables, parts, model, c, legs))
    places = np.concatenate(points)
    if len(places):
        return _framed(model, places, aspect, towards or (FROM_THE_FRONT if parts else ASIDE))
    view = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, view)
    return view


def _points(
    tables: Sequence[str], parts: Sequence[str], model: "mujoco.MjModel", c: "mujoco.MjData", legs: bool
) -> np.ndarray:
    """(n, 3) between which the tables and parts of a world are, and what moves near them."""
    from mjx_arenas.spec.hanging import hangs_on

    names = [model.body(b).name for b in range(model.nbody)]
    of_tables = hangs_on(model, np.array([b for b, name in enumerate(names) if name in (*tables, *parts)], int)) >= 0
    still = of_tables & (model.body_weldid == 0)
    movable = np.isin(model.body_rootid, model.body_rootid[model.jnt_bodyid]) | of_tables
    movable |= model.body_mocapid[model.body_rootid] >= 0
    slabs, moving = (_corners(model, c, bodies) for bodies in (still, movable & ~still))
    if not legs:
        slabs = np.concatenate([_corners(model, c, still & ~np.isin(names, tables)), *_slabs(tables, names, model, c)])
    if not len(slabs):
        return moving[np.isfinite(moving).all(1)]
    near = (moving > slabs.min(0) - BEYOND) & (moving < slabs.max(0) + BEYOND)
    return np.concatenate([slabs, moving[near.all(1)]])


def _slabs(
    tables: Sequence[str], names: Sequence[str], model: "mujoco.MjModel", c: "mujoco.MjData"
) -> Iterator[np.ndarray]:
    """(n, 3) corners of each table that is there, the lower ones raised to `SLAB` below its top."""
    for table in set(tables).intersection(names):
        corners = _corners(model, c, np.array(names) == table)
        if len(corners):
            yield np.maximum(corners, [-np.inf, -np.inf, corners[:, 2].max() - SLAB])


def _corners(model: "mujoco.MjModel", c: "mujoco.MjData", bodies: np.ndarray) -> np.ndarray:
    """(n, 3) corners in the world of the boxes around the geoms of some bodies (nbody,) bool, as far as they are drawn."""
    geoms = bodies[model.geom_bodyid] & (model.geom_rgba[:, 3] > 0) & (model.geom_rbound > 0)
    box, axes = model.geom_aabb[geoms], c.geom_xmat[geoms].reshape(-1, 3, 3)
    signs = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T
    local = box[:, None, :3] + signs * box[:, None, 3:]
    return (c.geom_xpos[geoms, None] + np.einsum("gij,gkj->gki", axes, local)).reshape(-1, 3)


def _framed(
    model: "mujoco.MjModel", points: np.ndarray, aspect: float, towards: tuple[float, float]
) -> "mujoco.MjvCamera":
    """A camera that has points (n, 3) just in its frame, and looks towards an azimuth and elevation [deg]."""
    import mujoco

    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation = towards
    turn, tilt = np.radians([camera.azimuth, camera.elevation])
    ahead = np.array([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)])
    right = np.array([np.sin(turn), -np.cos(turn), 0])
    axes = np.stack([right, np.cross(right, ahead)], axis=1)
    half = 0.92 * np.tan(np.radians(model.vis.global_.fovy) / 2) * np.array([aspect, 1])
    at = (points.min(0) + points.max(0)) / 2
    distance = 0.0
    for _ in range(20):  # the middle of what is seen depends on how far away the camera is
        across, depth = (points - at) @ axes, (points - at) @ ahead
        distance = max((abs(across) / half - depth[:, None]).max(), 0.4 / half.min() / 2)
        seen = across / (distance + depth)[:, None]
        at = at + axes @ (seen.min(0) + seen.max(0)) / 2 * distance
    camera.lookat, camera.distance = at, distance
    return camera


def picture(figure: "Figure") -> np.ndarray:
    """(height, width, 3) uint8 of a `matplotlib` figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def text_height(height: int) -> int:
    """The height of the text [pixels] on pictures of a height [pixels]."""
    return max(12, height // 20)


def check_grid(n_pictures: int, labels: Sequence[str], columns: int) -> None:
    """Refuses what `grid` cannot make of so many pictures, before they are drawn."""
    from mjx_arenas.rules import validation
    from mjx_arenas.spec import patterns

    if patterns.listed(labels) is None:
        raise validation.error([problem("labels", "must", None, labels, must="a list of texts")])
    if len(labels) != n_pictures:
        raise validation.error([problem("labels", "one_each", n=n_pictures, what="pictures", came=len(labels))])
    validation.whole("columns", columns, 1)


def fewest_columns(n_pictures: int, most: int) -> int:
    """Number of columns, at most so many, with which pictures fill no more rows than with the most."""
    rows = -(-n_pictures // most)
    return -(-n_pictures // rows)


def grid(pictures: Sequence[np.ndarray], labels: Sequence[str], columns: int = 4) -> "Image.Image":
    """The pictures in a grid, each with its label.

    Args:
        pictures: N of (height, width, 3) uint8; smaller ones stand in the middle of as much room as the largest has.
        labels: N of them.
        columns: largest number of pictures side by side; fewer if these fill as few rows.
    """
    Image, ImageDraw, ImageFont = (extra(f"PIL.{name}") for name in ("Image", "ImageDraw", "ImageFont"))
    check_grid(len(pictures), labels, columns)
    height, width = np.max([p.shape[:2] for p in pictures], axis=0).tolist()
    columns, gap = fewest_columns(len(pictures), columns), GAP
    rows = -(-len(pictures) // columns)
    sheet = Image.new("RGB", (columns * (width + gap) + gap, rows * (height + gap) + gap), "white")
    draw, size = ImageDraw.Draw(sheet), text_height(height)
    longest = max(labels, key=len)
    while size > 8 and draw.textlength(longest, ImageFont.load_default(size=size)) > width - 16:
        size -= 1
    font = ImageFont.load_default(size=size)
    for i, (pixels, label) in enumerate(zip(pictures, labels, strict=True)):
        x, y = gap + (i % columns) * (width + gap), gap + (i // columns) * (height + gap)
        sheet.paste(Image.fromarray(pixels), (x + (width - pixels.shape[1]) // 2, y + (height - pixels.shape[0]) // 2))
        draw.text((x + 8, y + 6), label, fill="black", font=font, stroke_width=2, stroke_fill="white")
    return sheet
