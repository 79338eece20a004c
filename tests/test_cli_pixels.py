"""The command line where MuJoCo Warp draws: what is drawn, by what, and wrong use."""

import importlib.util
import pathlib

import av
import jax
import numpy as np
import pytest
from command import _load_once
from gl import needs_gl
from PIL import Image

import mjx_arenas as mja
from mjx_arenas import cli
from mjx_arenas.cli import pictures

SEEN = ["render", "small.yaml", "--camera", "frontview", "--engine", "warp"]
BLIND = """
arena:
  type: Arena.from_xml
  tables: [desk]
  xml: <mujoco><worldbody><body name="desk"><geom type="box" size="0.4 0.4 0.02"/></body></worldbody></mujoco>
"""


def sheet(name):
    with Image.open(name) as picture:
        return np.asarray(picture, int)


@pytest.mark.xslow
@needs_gl
def test_sheet(here, scenes, capsys):
    """Warp draws what OpenGL draws of the same worlds, in the same places of the sheet; small pictures are enlarged."""
    chosen = ["--worlds", "3,17,5", "--size", "256x192"]
    assert cli.main([*SEEN, *chosen, "-o", "warp.png"]) == 0
    assert (
        capsys.readouterr().out
        == "warp.png: 3 worlds of small.yaml, seed 0, drawn by MJX on Warp from camera 'frontview'\n"
    )
    assert cli.main(["render", "small.yaml", "--camera", "frontview", *chosen, "-o", "gl.png"]) == 0
    got, want = sheet("warp.png"), sheet("gl.png")
    off = np.abs(got - want).mean(-1)
    assert np.median(off) < 4
    assert (off > 30).mean() < 0.05  # edges, of shadows, too
    other = np.abs(np.roll(got, got.shape[1] // 3, 1) - want).mean(-1)  # the pictures of other worlds
    assert (other > 30).mean() > 0.08

    arena, ranges = _load_once(pathlib.Path("small.yaml"))
    keys = mja.world_keys(0, [3, 17, 5])
    batch = arena.randomize(arena.put_model("warp"), keys, ranges)
    draw = arena.renderer({"frontview": (64, 48)}, rgb=False, depth=True, segmentation=True)
    picture = draw(batch, mja.make_data(batch, keys))["frontview"]
    labels = [f"world {i}, seed 0" for i in (3, 17, 5)]
    for kind, names in (("depth", None), ("segmentation", draw.labels)):
        assert cli.main([*SEEN, *chosen[:2], "--size", "64x48", "--show", kind, "-o", "kind.png"]) == 0
        got, want = sheet("kind.png"), np.asarray(mja.picture_sheet(picture, kind, names, labels), int)
        assert got.shape == want.shape
        assert (np.abs(got - want).max(-1) > 8).mean() < 0.005  # of float32's numbers that are written again


@pytest.mark.xslow
@pytest.mark.slow
def test_film(here, scenes, capsys):
    """Stepped and drawn by Warp: as many pictures as its time asks for, the last one as Python draws it after as many steps."""
    asked = ["--worlds", "5,7", "--size", "64x48", "--seconds", "0.2"]
    assert cli.main([*SEEN, *asked, "-o", "a.mp4"]) == 0
    assert capsys.readouterr().out == "a.mp4: 2 worlds of small.yaml, seed 0, 0.2 s, stepped and drawn by MJX on Warp\n"
    with av.open("a.mp4") as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(frames) == 7  # 30 a second, and the first
    arena, ranges = _load_once(pathlib.Path("small.yaml"))
    keys = mja.world_keys(0, [5, 7])
    batch = arena.randomize(arena.put_model("warp"), keys, ranges)
    data = mja.rollout(batch, mja.make_data(batch, keys), 6 * 17)
    draw = arena.renderer({"frontview": (64, 48)}, shadows=True, background=pictures.SKY)
    rgb = jax.jit(draw)(batch, data)["frontview"].rgb
    want = np.asarray(mja.picture_sheet(rgb, labels=["", ""]), int)
    off = np.abs(frames[-1].astype(int) - want[: frames[-1].shape[0], : frames[-1].shape[1]])
    assert off[40:].mean() < 6  # below what is written, and but for H.264


@pytest.mark.parametrize(
    ("arguments", "by"),
    [
        (["--camera", "frontview", "-o", "a.png"], "_sheet"),
        (["--camera", "frontview", "--engine", "warp", "-o", "a.png"], "_by_warp"),
        (["--camera", "frontview", "--engine", "warp", "-o", "a.mp4"], "_by_warp"),
        (["--camera", "frontview", "--engine", "c", "-o", "a.mp4"], "_film"),
        (["--camera", "frontview", "-o", "a.mp4"], "_film"),
        (["--engine", "warp", "-o", "a.mp4"], "_film"),
        (["--plan", "-o", "a.png"], "_plans"),
    ],
)
def test_what_draws(arguments, by, here, scenes, monkeypatch):
    """Warp draws where it is the engine and a camera is named; all else is drawn as without it."""
    called = []
    for name in ("_sheet", "_plans", "_film", "_by_warp"):
        monkeypatch.setattr(pictures, name, lambda *_, name=name: called.append(name) or "")
    monkeypatch.setattr(pictures, "_save", lambda *_: None)
    assert cli.main(["render", "small.yaml", "-n", "1", *arguments]) == 0
    assert called == [by]


@pytest.mark.parametrize(
    ("file", "camera"), [("small.yaml", "frontview"), pytest.param("kitchen", "room", marks=pytest.mark.xslow)]
)
def test_default_camera(file, camera, here, scenes, monkeypatch, capsys):
    """Of Warp's pictures: "room", or the first that the arena has; it is said which."""
    monkeypatch.setattr(pictures, "_by_warp", lambda *given: f" from {given[4]}")
    assert cli.main(["render", file, "-n", "1", "--engine", "warp", "-o", "a.png"]) == 0
    assert capsys.readouterr().out.endswith(f" from {camera}\n")


WRONG = {
    "no camera to name": (
        ["render", "blind.yaml", "--engine", "warp", "-o", "a.png"],
        "--engine warp draws a .png from a camera of the arena: this one has none with a name. See mjx-arenas render --help.",
    ),
    "unknown camera": (
        ["render", "small.yaml", "--engine", "warp", "--camera", "frontvew", "-o", "a.png"],
        "--camera must be 'frontview', 'birdview', 'agentview' or 'sideview', got 'frontvew': did you mean 'frontview'?",
    ),
    "another engine": (
        ["render", "small.yaml", "--engine", "jax", "--camera", "frontview", "-o", "a.png"],
        "--engine jax only steps videos: let -o end in .mp4, or take --engine warp. See mjx-arenas render --help.",
    ),
    "a plan": (
        ["render", "small.yaml", "--engine", "warp", "--plan", "-o", "a.png"],
        "--plan is a picture from above: give a .png, and no --camera, --size or --engine. See mjx-arenas render --help.",
    ),
    "distances by OpenGL": (
        ["render", "small.yaml", "--camera", "frontview", "--show", "depth", "-o", "a.png"],
        "--show goes with --engine warp, and a .png. See mjx-arenas render --help.",
    ),
    "distances in motion": (
        [*SEEN, "--show", "depth", "-o", "a.mp4"],
        "--show goes with --engine warp, and a .png. See mjx-arenas render --help.",
    ),
    "too large": (
        [*SEEN, "-n", "100", "--size", "2000x2000", "-o", "a.png"],
        "100 pictures of 2000x2000 are 400 megapixels, more than 250: give fewer or smaller ones. See mjx-arenas render --help.",
    ),
    "too large a film": (
        [*SEEN, "-n", "9", "--size", "2000x1000", "-o", "a.mp4"],
        "9 pictures of 2000x1000 are 18 megapixels, more than 8.8: give fewer or smaller ones. See mjx-arenas render --help.",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_use(case, here, scenes, capsys):
    """One sentence on stderr, exit code 2, nothing written."""
    (here / "blind.yaml").write_text(BLIND)
    before = sorted(here.rglob("*"))
    arguments, sentence = WRONG[case]
    assert cli.main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err == f"error: {sentence}\n"
    assert captured.out == ""
    assert sorted(here.rglob("*")) == before


def test_warmup_of_what_is_not_drawn(here, capsys):
    """It is refused in a sentence, before anything is compiled."""
    (here / "cube.xml").write_text(
        "<mujoco><asset><texture name='sky' type='cube' builtin='flat' width='4' height='4'/><material name='blue' texture='sky'/></asset>"
        "<worldbody><camera name='front'/><geom size='.1' material='blue'/></worldbody></mujoco>"
    )
    (here / "cube.yaml").write_text("arena: {type: Arena.from_xml, xml: cube.xml}")
    assert cli.main(["warmup", "cube.yaml", "--camera", "front"]) == 2
    out, err = capsys.readouterr()
    assert err.startswith("error: Material 'blue' has the cube texture 'sky', which the renderer draws wrong")
    assert out == ""


@pytest.mark.parametrize("out", ["a.png", "a.mp4"])
def test_without_warp(out, here, scenes, capsys, monkeypatch):
    """It says what to install."""
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *_: None if name == "warp" else find(name, *_))
    assert cli.main([*SEEN, "-n", "1", "-o", out]) == 2
    assert (
        capsys.readouterr().err == "error: Pictures on the device need MuJoCo Warp: pip install 'mjx_arenas[warp]'.\n"
    )
    assert sorted(path.name for path in here.iterdir()) == ["small.yaml"]
