"""Sheets and films of what the device's renderer draws and policies see (host)."""

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import jax
import numpy as np
from mujoco import mjx

from mjx_arenas.extras import extra
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.pixels.renderer import Picture, Renderer
from mjx_arenas.problem import Told, problem
from mjx_arenas.progress import Tell
from mjx_arenas.rules import validation
from mjx_arenas.sim.batch import ArenaBatch
from mjx_arenas.sim.rollouts import rollout
from mjx_arenas.spec import patterns
from mjx_arenas.viz import film, render
from mjx_arenas.viz.limits import FILM, SHEET

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL import Image

    Pictures = Picture | jax.Array | np.ndarray

SIDE = 256  # pixels up to which the longer side of a small picture is enlarged
COLOURS = "viridis_r"  # of distances: what is near is bright
GOLDEN = 0.618034  # a step in a circle of colours, after which none comes again soon
DARK = 0.08  # share of a colour map that is nearly black
POINTS = 9  # size of a legend's text
BAR, MARGIN, NOTHING = (
    4,
    3,
    9,
)  # height of a scale of distances, room beside it, and for a word at its end, in heights of text
LEAST = 20  # width of a legend, in heights of text
MUST = {
    "rgb": "(worlds, height, width, 3 or 1) of uint8 or of floats from 0 to 1",
    "depth": "(worlds, height, width) of floats >= 0 [m]",
    "segmentation": "(worlds, height, width) of whole numbers >= -1",
}
FRAMES = {3: "[..., -3:] of colours", 4: '[..., -4:-1] of "rgbd"', 1: "[..., -1:] of greys"}
"""The colours of the latest of the frames in what a policy sees, by the channels of each."""


@with_known_arguments
def picture_sheet(
    picture: "Pictures",
    kind: str = "rgb",
    names: Sequence[str] | None = None,
    labels: Sequence[str] | None = None,
    columns: int = 4,
) -> "Image.Image":
    """A `PIL.Image` of what a camera sees in many worlds, in a grid. Small pictures are enlarged by whole pixels.

    Distances have one logarithmic scale in all worlds, which is drawn below, in metres. In a segmentation each thing has a colour, and a
    legend names it. In both, black means that there is nothing.

    Args:
        picture: picture of one camera, `renderer(batch, data)["frontview"]`, of all worlds or one. Or its array of this kind, such as
            altered colours (worlds, height, width, 3), or a frame of what a policy sees, floats from 0 to 1.
        kind: what is shown: "rgb", "depth" or "segmentation".
        names: names for the numbers of a segmentation, `Renderer.labels`; None: the legend has the numbers.
        labels: text on the picture of each world. Default: "world 0", ... in their order. Of worlds that `take` chose, say which they
            are: `labels=[f"world {i}" for i in chosen]`.
        columns: largest number of pictures side by side; fewer if these fill as few rows.

    Raises:
        ValueError, TypeError: an argument is wrong, or memory does not hold the sheet.
    """
    if not isinstance(kind, str) or kind not in MUST:
        raise validation.error([problem("kind", "one_of", None, kind, names=list(map(repr, MUST)))])
    if names is not None and kind != "segmentation":
        raise validation.error([problem("names", "names_of_kind", None, kind)])
    name = f"picture.{kind}" if isinstance(picture, Picture) else "picture"
    pixels = _checked(name, _of_kind(picture, kind), kind, 0)
    labels = _labels(labels, len(pixels))
    render.check_grid(len(pixels), labels, columns)
    times = _times("picture", pixels.shape, SHEET)
    legend = np.zeros((0, 1, 3), np.uint8)
    text = render.text_height(pixels.shape[1] * times)
    across = render.fewest_columns(len(pixels), columns)
    room = max(LEAST * text, across * (pixels.shape[2] * times + render.GAP) + render.GAP)
    if kind == "depth":
        pixels, legend = _distances(pixels, room, text)
    elif kind == "segmentation":
        pixels, legend = _things(pixels, names, room, text)
    return _above(render.grid(_enlarged(pixels, times), labels, columns), legend)


@with_known_arguments
def picture_video(
    frames: "jax.Array | np.ndarray",
    path: str | os.PathLike,
    fps: float = 30.0,
    labels: Sequence[str] | None = None,
) -> None:
    """Writes pictures of many worlds at many times as a video, side by side. Small pictures are enlarged by whole pixels.

    Args:
        frames: (times, worlds, height, width, 3), or 1 for greys, uint8 or floats from 0 to 1. Give what `rollout(..., record=)` keeps of a
            renderer's pictures, or an environment's `pixels/view_0`.
        path: path of an mp4. If writing fails, nothing new is left there.
        fps: pictures per second; for real time give 1 / (time between frames).
        labels: text for each world. Default: "world 0", ... in their order, as for `picture_sheet`.

    Raises:
        ValueError, TypeError: an argument is wrong, or pictures are larger than those of a video can be.
    """
    path = film.checked_path(path)
    fps = film.positive("fps", fps)
    pixels = _checked("frames", frames, "rgb", 1)
    labels = _labels(labels, pixels.shape[1])
    render.check_grid(pixels.shape[1], labels, 1)
    times = _times("frames", pixels.shape[1:], FILM)
    columns = math.ceil(math.sqrt(pixels.shape[1]))
    film.write(path, fps, (render.grid(_enlarged(frame, times), labels, columns) for frame in pixels))


def rollout_video(
    batch: ArenaBatch,
    data: mjx.Data,
    draw: Renderer,
    path: str | os.PathLike,
    seconds: float,
    labels: Sequence[str],
    progress: Tell | None = None,
) -> None:
    """Writes a video of a rollout of all worlds of a batch in real time, as `film.video` does, but drawn on the device.

    Args:
        batch: W worlds.
        data: data of all worlds; `ctrl` stays constant.
        draw: a renderer of colours of one camera.
        path: as for `film.video`, and so are those that follow.
        seconds: length in simulated time [s].
        labels: (W,) text for each world.
        progress: function that is called with the numbers of pictures drawn and of all pictures.
    """
    times = film.times(np.ravel(batch.model.opt.timestep), seconds)
    (camera,) = draw.cameras
    enlarged = _times("frames", (batch.n_worlds, camera.height, camera.width), FILM)

    def frames() -> Iterator[list[np.ndarray]]:
        now = data
        for frame in range(times.n_frames):
            now = rollout(batch, now, times.n_steps) if frame else now
            yield _enlarged(np.asarray(draw(batch, now)[camera.name].rgb), enlarged)

    film.write_timed(film.checked_path(path), times, frames(), labels, progress)


def _of_kind(picture: Any, kind: str) -> Any:
    """The array of a picture."""
    if isinstance(picture, Mapping):
        name = next(iter(picture), "frontview")
        raise validation.error(
            [problem("picture", "one_camera", None, Told("a dict of them"), camera=name)], kind=TypeError
        )
    if not isinstance(picture, Picture):
        return picture
    array = getattr(picture, kind)
    if array is None:
        raise validation.error([problem("picture", "picture_without", None, Told(kind))])
    return array


def _checked(name: str, given: Any, kind: str, leading: int) -> np.ndarray:
    """(..., worlds, height, width, 3) uint8 of colours, (..., worlds, height, width) of other kinds; one world without its axis gets it.

    Args:
        name: of the argument.
        given: for it.
        kind: of picture.
        leading: how many axes there are before the worlds.
    """
    must = MUST[kind].replace("(worlds", "(times, worlds") if leading else MUST[kind]
    if isinstance(given, jax.core.Tracer):
        raise validation.error([problem(name, "outside_jit")], kind=TypeError)
    validation.check_type(name, given, (jax.Array, np.ndarray), must)
    pixels, channels = np.asarray(given), (1, 3) if kind == "rgb" else (1,)
    rank = leading + (4 if kind == "rgb" else 3)
    if kind != "rgb" and pixels.ndim == rank + 1 and pixels.shape[-1] == 1:
        pixels = pixels[..., 0]
    if pixels.ndim == rank - 1 and not leading:
        pixels = pixels[None]
    dtypes = {"rgb": (np.uint8, np.floating), "depth": (np.floating,), "segmentation": (np.signedinteger,)}[kind]
    of_kind = bool(pixels.size) and any(np.issubdtype(pixels.dtype, t) for t in dtypes)
    if not of_kind or pixels.ndim != rank or (kind == "rgb" and pixels.shape[-1] not in channels):
        instead = _instead(name, pixels, kind, rank) if of_kind else []
        instead += [] if leading else _other_kind(np.asarray(given), kind)
        instead = f": give {', or '.join(instead)}" if instead else ""
        raise validation.error(
            [problem(name, "pixels", None, given.shape, must=must, dtype=given.dtype, instead=instead)]
        )
    most = 1 if kind == "rgb" and pixels.dtype != np.uint8 else np.inf
    least = -1 if kind == "segmentation" else 0
    if pixels.dtype != np.uint8 and not ((pixels >= least) & (pixels <= most) & (pixels < np.inf)).all():
        got = Told(f"numbers from {pixels.min():g} to {pixels.max():g}")
        raise validation.error([problem(name, "must", None, got, must=must)])
    if kind != "rgb":
        return pixels
    pixels = pixels if pixels.dtype == np.uint8 else np.round(255 * pixels).astype(np.uint8)
    return np.broadcast_to(pixels, (*pixels.shape[:-1], 3))


def _other_kind(given: np.ndarray, kind: str) -> list[str]:
    """The kind that pixels look like, if it is another one."""
    shape = given.shape[:-1] if given.ndim == 4 and given.shape[-1] == 1 else given.shape
    if len(shape) in (2, 3) and np.issubdtype(given.dtype, np.signedinteger):
        found = "segmentation"
    elif len(shape) in (2, 3) and np.issubdtype(given.dtype, np.floating):
        found = "depth"
    else:
        found = "rgb" if given.dtype == np.uint8 and shape[-1:] == (3,) else kind
    return [] if found == kind else [f'kind="{found}"']


def _instead(name: str, pixels: np.ndarray, kind: str, rank: int) -> list[str]:
    """What to give of stacked frames, or of many times; nothing where it is neither."""
    latest, more = [], pixels.ndim - rank
    if kind == "rgb" and more == 0:
        channels = pixels.shape[-1]
        latest = [f"{name}{frame}" for each, frame in FRAMES.items() if channels % each == 0]
    elif kind == "depth" and more == 1:
        latest = [f"{name}[..., -1]"]
    parts = [f"the latest frame, {' or '.join(latest)}"] if latest else []
    return parts + ([f"one time, {name}[-1]"] if more > 0 else [])


def _labels(labels: Sequence[str] | None, n_worlds: int) -> Sequence[str]:
    return [f"world {i}" for i in range(n_worlds)] if labels is None else labels


def _times(name: str, shape: tuple[int, ...], most: float) -> int:
    """How often each pixel of pictures (worlds, height, width, ...) is drawn along both axes, with `most` megapixels in all."""
    n, height, width = shape[:3]
    if n * height * width > 1e6 * most:
        got = f"{n:,} of {width} x {height} pixels"
        raise validation.error([problem(name, "megapixels", None, Told(got), most=most)])
    return max(1, min(SIDE // max(height, width), math.isqrt(int(1e6 * most) // (n * height * width))))


def _enlarged(pictures: np.ndarray, times: int) -> list[np.ndarray]:
    """Each of pictures (worlds, height, width, 3)."""
    return list(pictures.repeat(times, axis=1).repeat(times, axis=2))


def _distances(depth: np.ndarray, room: int, text: int) -> tuple[np.ndarray, np.ndarray]:
    """Colours (worlds, height, width, 3) of distances, and their scale as wide as `room`, with text as high as `text` [pixels]."""
    matplotlib, colours = extra("matplotlib"), extra("matplotlib.colors")
    there = depth > 0
    near, far = (float(f(depth[there])) if there.any() else 1.0 for f in (np.min, np.max))
    scale = colours.LogNorm(near, far if far > near else 1.001 * near)
    shades = matplotlib.colormaps[COLOURS]
    shares = scale(np.where(there, depth, near).ravel()).reshape(depth.shape)  # of the way from near to far
    pixels = shades(shares, bytes=True)[..., :3] * there[..., None]
    figure = _strip(room, text)
    if there.any():
        from matplotlib.cm import ScalarMappable

        long = room - text * (2 * MARGIN + NOTHING * (not there.all()))
        axes = figure.add_axes((MARGIN * text / room, 0.52, long / room, 0.34))
        ticks = np.geomspace(near, scale.vmax, min(max(2, long // (NOTHING * text)), 7))
        bar = figure.colorbar(ScalarMappable(scale, shades), axes, orientation="horizontal", ticks=ticks, format="")
        bar.minorticks_off()
        bar.set_ticklabels([f"{x:.2f} m" for x in ticks], fontsize=POINTS)
    if not there.all():
        _named(figure, [("nothing", "black")], 1, "upper right")
    return pixels, render.picture(figure)


def _things(
    segmentation: np.ndarray, names: Sequence[str] | None, room: int, text: int
) -> tuple[np.ndarray, np.ndarray]:
    """Colours (worlds, height, width, 3) of what is seen where, and a legend of it as wide as `room`, or as its longest name."""
    matplotlib = extra("matplotlib")
    seen = np.unique(segmentation).tolist()
    names = [str(i) for i in range(seen[-1] + 1)] if names is None else names
    if (texts := patterns.listed(names)) is None or seen[-1] >= len(texts):
        got = names if texts is None else Told(f"{len(texts)} names")
        must = f"`Renderer.labels`, at least {seen[-1] + 1} names"
        raise validation.error([problem("names", "must", None, got, must=must)])
    n, maps = len(names), matplotlib.colormaps
    few = "tab10" if n <= 10 else "tab20"
    shades = maps[few](np.arange(n)) if n <= 20 else maps["turbo"](DARK + (1 - DARK) * (np.arange(n) * GOLDEN % 1))
    colours = np.append(np.round(255 * shades[:, :3]), [[0, 0, 0]], axis=0).astype(np.uint8)  # -1: nothing
    entries = [(names[i], tuple(shades[i])) for i in seen if i >= 0]
    entries += [("nothing", "black")] * (seen[0] < 0)
    columns, figure = min(len(entries), room // (4 * text)), _strip(room, text)  # none is narrower
    width, height = _named(figure, entries, columns, "upper left")
    while width > room and columns > 1:
        columns, figure = columns - 1, _strip(room, text)
        width, height = _named(figure, entries, columns, "upper left")
    figure.set_size_inches(max(room, math.ceil(width)) / figure.dpi, (math.ceil(height) + text // 2) / figure.dpi)
    return colours[segmentation], render.picture(figure)


def _strip(width: int, text: int) -> "Figure":
    """A figure so wide, for text so high [pixels]."""
    from matplotlib.figure import Figure

    dpi = text / POINTS * 72
    return Figure((width / dpi, BAR * text / dpi), dpi=dpi)


def _named(
    figure: "Figure", entries: Sequence[tuple[str, Any]], columns: int, place: Literal["upper left", "upper right"]
) -> tuple[float, float]:
    """Adds a legend of names and colours to a figure; gives its width and height [pixels]."""
    from matplotlib.patches import Patch

    handles = [Patch(facecolor=colour, label=name) for name, colour in entries]
    legend = figure.legend(handles=handles, ncols=columns, loc=place, frameon=False, fontsize=POINTS)
    box = legend.get_window_extent()
    return box.width, box.height


def _above(sheet: "Image.Image", legend: np.ndarray) -> "Image.Image":
    """A sheet above its legend (h, w, 3)."""
    Image = extra("PIL.Image")
    if not len(legend):
        return sheet
    whole = Image.new("RGB", (max(sheet.width, legend.shape[1]), sheet.height + len(legend)), "white")
    whole.paste(sheet, (0, 0))
    whole.paste(Image.fromarray(legend), (0, sheet.height))
    return whole
