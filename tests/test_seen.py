"""Sheets and films of pictures: every pixel is shown, on one scale, and what is no picture is refused."""

import re

import av
import jax
import matplotlib
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas.pixels.renderer import Picture
from mjx_arenas.viz import render, seen

RNG = np.random.default_rng(0)
RGB = RNG.integers(0, 256, (5, 16, 24, 3), np.uint8)
DEPTH = RNG.uniform(0.5, 8.0, (5, 16, 24)).astype(np.float32)
DEPTH[0, 8, 8], DEPTH[3, 9, 9], DEPTH[:, 12:] = 0.5, 8.0, 0.0
THINGS = RNG.choice(np.array([-1, 0, 2, 5], np.int32), (5, 16, 24))
NAMES = ("floor", "wall", "table0", "door", "lamp", "cube", "ball")
PICTURE = Picture(RGB, DEPTH, THINGS)
TIMES = 10  # 24 pixels are 240


@pytest.fixture
def legends(monkeypatch):
    """The figures that are drawn below sheets."""
    found, picture = [], render.picture
    monkeypatch.setattr(render, "picture", lambda figure: (found.append(figure), picture(figure))[1])
    return found


def cells(sheet, shape, times, columns):
    """(worlds, height, width, 3) of a sheet of W worlds, the middle of each enlarged pixel."""
    pixels, (n, height, width) = np.asarray(sheet), shape
    found = []
    for i in range(n):
        y, x = (
            render.GAP + k * (size * times + render.GAP) for k, size in zip(divmod(i, columns), shape[1:], strict=True)
        )
        cell = pixels[y : y + height * times, x : x + width * times]
        blocks = cell.reshape(height, times, width, times, 3)
        assert (blocks[4:] == blocks[4:, :1, :, :1]).all()  # below the label
        found.append(blocks[:, times // 2, :, times // 2])
    return np.stack(found)


def test_colours():
    """Whole pixels; no more columns than two rows need; floats, greys and one world are the same pictures."""
    sheet = mja.picture_sheet(PICTURE, columns=3)
    assert sheet.size == (3 * (240 + render.GAP) + render.GAP, 2 * (160 + render.GAP) + render.GAP)
    assert np.array_equal(cells(sheet, RGB.shape[:3], TIMES, 3)[:, 4:], RGB[:, 4:])
    assert mja.picture_sheet(jax.numpy.asarray(RGB / np.float32(255)), columns=3) == sheet
    greys = cells(mja.picture_sheet(RGB[..., :1]), RGB.shape[:3], TIMES, 3)
    assert np.array_equal(greys[:, 4:], RGB[:, 4:, :, [0, 0, 0]])
    assert mja.picture_sheet(mja.take(PICTURE, 2), labels=["two"]) == mja.picture_sheet(RGB[2:3], labels=["two"])
    assert mja.picture_sheet(RGB, labels=list("abcde")) != mja.picture_sheet(RGB)
    assert mja.picture_sheet(np.zeros((1, 300, 20, 3))).size == (20 + 2 * render.GAP, 300 + 2 * render.GAP)


def test_distances(legends):
    """One scale for all worlds: a distance has a colour, nearer is brighter, nothing is black; its ends are written below."""
    got = cells(mja.picture_sheet(PICTURE, "depth"), DEPTH.shape, TIMES, 3)[:, 4:]
    depth, colour = DEPTH[:, 4:], got.sum(-1)
    assert (got[depth == 0] == 0).all()
    there = depth > 0
    assert (colour[there] > 0).all()
    order = np.argsort(depth[there])
    assert (np.diff(colour[there][order].astype(int)) <= 3).all()  # rounded
    by_hand = matplotlib.colormaps["viridis_r"](np.log(depth[there] / 0.5) / np.log(16), bytes=True)[:, :3]
    assert np.abs(got[there].astype(int) - by_hand).max() <= 3  # a shade of 256
    (figure,) = legends
    written = [text.get_text() for text in figure.axes[0].get_xticklabels()]
    assert (written[0], written[-1]) == ("0.50 m", "8.00 m")
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["nothing"]
    sheet = mja.picture_sheet(DEPTH[..., None], "depth")  # as policies have it
    assert sheet == mja.picture_sheet(DEPTH, "depth")
    mja.picture_sheet(np.ones((1, 8, 8)), "depth")
    mja.picture_sheet(np.zeros((1, 8, 8)), "depth")
    assert legends[-2].legends == legends[-1].axes == []


def test_things(legends):
    """Each label has its colour, whatever else is seen; the legend names what is, in these colours."""
    sheet = mja.picture_sheet(PICTURE, "segmentation", NAMES)
    got = cells(sheet, THINGS.shape, TIMES, 3)[:, 4:]
    (figure,) = legends
    entries = zip(figure.legends[0].get_texts(), figure.legends[0].get_patches(), strict=True)
    named = {text.get_text(): np.round(255 * np.array(patch.get_facecolor()[:3])) for text, patch in entries}
    assert list(named) == ["floor", "table0", "cube", "nothing"]
    for label, name in ((0, "floor"), (2, "table0"), (5, "cube"), (-1, "nothing")):
        assert (got[THINGS[:, 4:] == label] == named[name]).all()
    alone = cells(mja.picture_sheet(np.where(THINGS == 5, 5, -1), "segmentation", NAMES), THINGS.shape, TIMES, 3)
    assert np.array_equal(alone[:, 4:][THINGS[:, 4:] == 5], got[THINGS[:, 4:] == 5])
    assert mja.picture_sheet(THINGS, "segmentation") != sheet
    assert [text.get_text() for text in legends[-1].legends[0].get_texts()] == ["0", "2", "5", "nothing"]


@pytest.mark.parametrize("n", [7, 14, 20, 60])
def test_each_thing_has_its_own_colour(n):
    """However many there are; and a legend of them all fits the sheet."""
    things = np.resize(np.arange(-1, n), (1, 9, 8)).astype(np.int32)  # a label hides some of the first row
    sheet = mja.picture_sheet(things, "segmentation", [f"thing{i}" for i in range(n)])
    colours = np.unique(cells(sheet, things.shape, 28, 4)[:, 1:].reshape(-1, 3), axis=0)
    assert len(colours) == n + 1
    assert sheet.width == max(8 * 28 + 2 * render.GAP, seen.LEAST * 12)


def test_many_worlds(monkeypatch):
    """So many that they are not enlarged as much as one."""
    monkeypatch.setattr(seen, "SHEET", 1.0)
    sheet = mja.picture_sheet(np.zeros((100, 16, 16, 3), np.uint8), columns=100)
    assert sheet.size == (100 * (6 * 16 + render.GAP) + render.GAP, 6 * 16 + 2 * render.GAP)


def test_video(tmp_path):
    """As many pictures as there are times, each where it was, and a film of greys or floats is the same."""
    frames = np.repeat(RNG.integers(0, 256, (4, 3, 4, 4, 3), np.uint8), 4, axis=2)
    for name, given in (("bytes", frames), ("floats", jax.numpy.asarray(frames / np.float32(255)))):
        mja.picture_video(given, tmp_path / f"{name}.mp4", fps=12.5, labels=["a", "b", "c"])
    with av.open(tmp_path / "bytes.mp4") as file:
        assert float(file.streams.video[0].average_rate) == 12.5
        films = [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]
    assert len(films) == 4
    wide, high = 2 * (64 + render.GAP) + render.GAP, 2 * (256 + render.GAP) + render.GAP
    assert films[0].shape == (high, wide, 3)
    for film, frame in zip(films, frames, strict=True):
        shown = film[render.GAP + 256 + render.GAP :][:256, render.GAP :][:, :64]  # of the third
        want = frame[2].repeat(16, 0).repeat(16, 1)
        assert np.abs(shown[40:].astype(int) - want[40:]).mean() < 12  # H.264's
    assert (tmp_path / "bytes.mp4").read_bytes() == (tmp_path / "floats.mp4").read_bytes()


WRONG = {
    "kind": (
        lambda: mja.picture_sheet(PICTURE, "colour"),
        "`kind` must be one of 'rgb', 'depth', 'segmentation', got 'colour'.",
    ),
    "not asked for": (
        lambda: mja.picture_sheet(Picture(RGB, None, None), "depth"),
        "`picture` has no depth: its renderer gives it with arena.renderer(..., depth=True).",
    ),
    "all cameras": (
        lambda: mja.picture_sheet({"frontview": PICTURE}),
        '`picture` must be of one camera, got a dict of them: give pictures["frontview"].',
    ),
    "a path": (
        lambda: mja.picture_sheet("a.png"),
        "`picture` must be (worlds, height, width, 3 or 1) of uint8 or of floats from 0 to 1, got str.",
    ),
    "frames for a sheet": (
        lambda: mja.picture_sheet(RGB[None]),
        "`picture` must be (worlds, height, width, 3 or 1) of uint8 or of floats from 0 to 1, got uint8 of shape "
        "(1, 5, 16, 24, 3): give one time, picture[-1].",
    ),
    "no world": (
        lambda: mja.picture_sheet(RGB[:0]),
        "`picture` must be (worlds, height, width, 3 or 1) of uint8 or of floats from 0 to 1, got uint8 of shape (0, 16, 24, 3).",
    ),
    "stacked frames": (
        lambda: mja.picture_sheet(np.zeros((2, 8, 8, 9), np.float32)),
        "`picture` must be (worlds, height, width, 3 or 1) of uint8 or of floats from 0 to 1, got float32 of shape (2, 8, 8, 9): "
        "give the latest frame, picture[..., -3:] of colours or picture[..., -1:] of greys.",
    ),
    "colours and distances": (
        lambda: mja.picture_sheet(jax.numpy.zeros((8, 8, 4))),
        "`picture` must be (worlds, height, width, 3 or 1) of uint8 or of floats from 0 to 1, got float32 of shape (8, 8, 4): "
        'give the latest frame, picture[..., -4:-1] of "rgbd" or picture[..., -1:] of greys, or kind="depth".',
    ),
    "distances with colours": (
        lambda: mja.picture_sheet(np.zeros((2, 8, 8, 8), np.float32), "depth"),
        "`picture` must be (worlds, height, width) of floats >= 0 [m], got float32 of shape (2, 8, 8, 8): "
        "give the latest frame, picture[..., -1], or one time, picture[-1].",
    ),
    "recorded things": (
        lambda: mja.picture_sheet(Picture(None, None, THINGS[None]), "segmentation"),
        "`picture.segmentation` must be (worlds, height, width) of whole numbers >= -1, got int32 of shape (1, 5, 16, 24): "
        "give one time, picture.segmentation[-1].",
    ),
    "stacked frames in motion": (
        lambda: mja.picture_video(np.zeros((7, 2, 8, 8, 6), np.float32), "a.mp4"),
        "`frames` must be (times, worlds, height, width, 3 or 1) of uint8 or of floats from 0 to 1, got float32 of shape "
        "(7, 2, 8, 8, 6): give the latest frame, frames[..., -3:] of colours or frames[..., -1:] of greys.",
    ),
    "floats of bytes": (
        lambda: mja.picture_sheet(np.full((1, 8, 8, 3), 255.0)),
        "`picture` must be (worlds, height, width, 3 or 1) of uint8 or of floats from 0 to 1, got numbers from 255 to 255.",
    ),
    "not finite": (
        lambda: mja.picture_sheet(np.full((1, 8, 8), np.nan), "depth"),
        "`picture` must be (worlds, height, width) of floats >= 0 [m], got numbers from nan to nan.",
    ),
    "colours for distances": (
        lambda: mja.picture_sheet(RGB, "depth"),
        "`picture` must be (worlds, height, width) of floats >= 0 [m], got uint8 of shape (5, 16, 24, 3): "
        'give kind="rgb".',
    ),
    "things for colours": (
        lambda: mja.picture_sheet(THINGS),
        "`picture` must be (worlds, height, width, 3 or 1) of uint8 or of floats from 0 to 1, got int32 of shape (5, 16, 24): "
        'give kind="segmentation".',
    ),
    "distances of one world for colours": (
        lambda: mja.picture_sheet(DEPTH[0]),
        "`picture` must be (worlds, height, width, 3 or 1) of uint8 or of floats from 0 to 1, got float32 of shape (16, 24): "
        'give kind="depth".',
    ),
    "distances for things": (
        lambda: mja.picture_sheet(DEPTH, "segmentation"),
        "`picture` must be (worlds, height, width) of whole numbers >= -1, got float32 of shape (5, 16, 24): "
        'give kind="depth".',
    ),
    "names of colours": (
        lambda: mja.picture_sheet(PICTURE, names=NAMES),
        "`names` go with kind=\"segmentation\", got kind='rgb'.",
    ),
    "too few names": (
        lambda: mja.picture_sheet(PICTURE, "segmentation", NAMES[:5]),
        "`names` must be `Renderer.labels`, at least 6 names, got 5 names.",
    ),
    **{
        f"names in {kind}": (
            lambda names=names: mja.picture_sheet(PICTURE, "segmentation", names),
            f"`names` must be `Renderer.labels`, at least 6 names, got {got}.",
        )
        for kind, names, got in (
            ("a function", lambda i: f"thing {i}", "<lambda>"),
            ("a set", {"box"}, "{'box'}"),
            ("a dict", {0: "box"}, "{0: 'box'}"),
            ("a text", "floors", "'floors'"),
            ("numbers", [1, 2, 3, 4, 5, 6], "[1, 2, 3, 4, 5, 6]"),
            ("a list with None", [*NAMES[:5], None], f"{[*NAMES[:5], None]}"),
        )
    },
    "labels that are numbers": (
        lambda: mja.picture_sheet(PICTURE, labels=[1, 2, 3, 4, 5]),
        "`labels` must be a list of texts, got [1, 2, 3, 4, 5].",
    ),
    "one text": (lambda: mja.picture_sheet(PICTURE, labels="right"), "`labels` must be a list of texts, got 'right'."),
    "labels": (
        lambda: mja.picture_sheet(PICTURE, labels=["one"]),
        "`labels` must be one for each of the 5 pictures, got 1.",
    ),
    "columns": (lambda: mja.picture_sheet(PICTURE, columns=0), "`columns` must be a whole number >= 1, got 0."),
    "too many": (
        lambda: mja.picture_sheet(np.broadcast_to(np.uint8(0), (10_000, 256, 256, 3))),
        "`picture` must be of at most 250 million pixels side by side, got 10,000 of 256 x 256 pixels: give fewer worlds.",
    ),
    "traced": (
        lambda: jax.jit(lambda x: mja.picture_sheet(x) and x)(RGB),
        "`picture` is traced: call this outside jax.jit, vmap and scan.",
    ),
    "a video of one time": (
        lambda: mja.picture_video(RGB, "a.mp4"),
        "`frames` must be (times, worlds, height, width, 3 or 1) of uint8 or of floats from 0 to 1, got uint8 of shape (5, 16, 24, 3).",
    ),
    "a picture's path": (lambda: mja.picture_video(RGB[None], "a.gif"), "`path` must end in '.mp4', got 'a.gif'."),
    "fps": (lambda: mja.picture_video(RGB[None], "a.mp4", fps=0), "`fps` must be a number > 0, got 0."),
    "a film's labels": (
        lambda: mja.picture_video(RGB[None], "a.mp4", labels=["one"]),
        "`labels` must be one for each of the 5 pictures, got 1.",
    ),
    "too large a film": (
        lambda: mja.picture_video(np.broadcast_to(np.uint8(0), (1, 1000, 128, 128, 3)), "a.mp4"),
        "`frames` must be of at most 8.8 million pixels side by side, got 1,000 of 128 x 128 pixels: give fewer worlds.",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_use(case, tmp_path, monkeypatch):
    """One sentence, and nothing written."""
    monkeypatch.chdir(tmp_path)
    call, sentence = WRONG[case]
    with pytest.raises((ValueError, TypeError)) as error:
        call()
    assert str(error.value) == sentence
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("shape", "kind", "n"),
    [((2, 8, 8, 9), "rgb", 2), ((2, 8, 8, 12), "rgb", 3), ((2, 8, 8, 5), "rgb", 1), ((2, 8, 8, 8), "depth", 2)],
)
def test_what_to_give_instead(shape, kind, n):
    """What the sentence says is drawn."""
    picture = np.full(shape, 0.5)
    with pytest.raises(ValueError, match=": give the latest frame, ") as error:
        mja.picture_sheet(picture, kind)
    parts = re.findall(r"picture\[\S+(?: -\S+)?\]", str(error.value))
    assert len(parts) == n
    for part in parts:
        mja.picture_sheet(eval(part, {"picture": picture}), kind)
