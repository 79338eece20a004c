"""The command line as a user types it: piped, on a terminal, and wrongly."""

import contextlib
import csv
import functools
import importlib
import json
import os
import pathlib
import pty
import re
import shutil
import subprocess
import sys
import tomllib

import av
import jax
import mujoco
import numpy as np
import polars
import pytest
from PIL import Image

import mjx_arenas as mja
from mjx_arenas import cli, params, paths, plots, tables

ROOT = pathlib.Path(__file__).parent.parent
SMALL = """
arena:
  type: MultiTableArena
  table_offsets: [[0, 0, 0.8], [1, 0, 0.8]]
  objects: [cube]
ranges:
  table_offsets: {Uniform: {low: [0, 0, -0.1], high: [0, 0, 0.1], relative: add}}
  table_rots: {Uniform: [-3, 3]}
  table_active: {Bernoulli: [1, 0.5]}
  object_tables: {Choice: [0, 1]}
"""


def command():
    """What a user types: the installed entry point, or the module where the package is not installed anew."""
    script = shutil.which("mjx-arenas", path=os.path.dirname(sys.executable))
    return [script] if script else [sys.executable, "-m", "mjx_arenas"]


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder to work in, with a file."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.yaml").write_text(SMALL)
    return tmp_path


def test_entry_point():
    """The script that is installed exists."""
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    module, function = scripts["mjx-arenas"].split(":")
    assert callable(getattr(importlib.import_module(module), function))


def test_sample(here, capsys):
    """The three kinds of table hold the same numbers, which are those that Python draws for the same worlds."""
    assert cli.main(["sample", "small.yaml", "-n", "20", "--seed", "3", "-o", "a.npz"]) == 0
    assert cli.main(["sample", "small.yaml", "--worlds", "5,17", "--seed", "3", "-o", "b.csv"]) == 0
    assert cli.main(["sample", "small.yaml", "--worlds", "5,17", "--seed", "3", "-o", "c.parquet", "--json"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == "a.npz: 20 worlds of small.yaml, seed 3; 20 are valid"
    assert json.loads(out[2]) == {"file": "c.parquet", "seed": 3, "worlds": 2, "valid": 2}

    arrays = np.load("a.npz")
    drawn = mja.ArenaParams(*(arrays[name] for name in mja.ArenaParams._fields))
    arena, ranges = mja.load("small.yaml")
    want = jax.vmap(arena.sample_params, in_axes=(0, None))(mja.world_keys(3, range(20)), ranges)
    for name, got in drawn._asdict().items():
        np.testing.assert_allclose(got, getattr(want, name), rtol=1e-6, err_msg=name)

    table = polars.read_parquet("c.parquet")
    with open("b.csv") as file:
        rows = list(csv.DictReader(file))
    assert table["world"].to_list() == [int(row["world"]) for row in rows] == [5, 17]
    for column, index in {
        "table_offsets.table1.z": (1, 2),
        "table_rots.table0": (0,),
        "table_active.table1": (1,),
        "object_full_sizes.cube.y": (0, 1),
        "object_tables.cube": (0,),
    }.items():
        expected = getattr(drawn, column.split(".")[0])[[5, 17]][(slice(None), *index)]
        np.testing.assert_allclose(table[column].to_numpy().astype(float), expected, rtol=1e-6, err_msg=column)
        assert table[column].dtype == {"f": polars.Float32, "b": polars.Boolean, "i": polars.Int32}[expected.dtype.kind]
        written = [{"true": "1", "false": "0"}.get(row[column], row[column]) for row in rows]
        assert np.array_equal(np.array(written, np.float32), table[column].to_numpy().astype(np.float32)), column


def test_every_number_has_a_column(arena):
    """A table's columns are all parameters, once each, so that a new quantity is in it."""
    names = [c.name for c in tables.columns(arena, jax.tree.map(lambda x: np.asarray(x)[None], arena.nominal_params()))]
    assert len(names) == len(set(names)) == sum(np.size(p) for p in arena.nominal_params())
    assert {name.split(".")[0] for name in names} == params.QUANTITIES.keys()


def test_stats(here, capsys):
    """What varies is listed with its bounds, and nothing else; plots are written."""
    assert cli.main(["stats", "small.yaml", "-n", "50", "-o", "plots", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {(s["quantity"], s["item"], s["axis"]) for s in found["varies"]} == {
        ("table_offsets", "table0", "z"),
        ("table_offsets", "table1", "z"),
        ("table_rots", "table0", ""),
        ("table_rots", "table1", ""),
        ("table_active", "table1", ""),
        ("object_tables", "cube", ""),
    }
    height = found["varies"][0]
    assert (height["unit"], height["nominal"]) == ("[m]", 0.8)
    assert 0.7 <= height["min"] < 0.72 < height["mean"] < 0.88 < height["max"] <= 0.9
    pictures = sorted(found["files"])
    assert pictures == ["plots/coverage.png", "plots/histograms.png", "plots/pairs.png"]
    assert all(pathlib.Path(p).read_bytes().startswith(b"\x89PNG") for p in pictures)

    assert cli.main(["stats", "small.yaml", "-n", "50"]) == 0
    lines = [re.split(r"\s{2,}", line.strip()) for line in capsys.readouterr().out.splitlines()]
    assert lines[0] == ["quantity", "of", "axes", "nominal", "least", "mean", "most"]
    assert lines[1][:4] == ["table_offsets [m]", "table0", "z", "0.8"]
    assert lines[-1] == ["50 worlds of small.yaml, seed 0; 50 are valid"]


def test_coverage_oracle():
    """A place is covered where a ray from above meets a slab in the world that MuJoCo compiles."""
    arena = mja.MultiTableArena([[0, 0, 0.8], [0.9, 0.4, 0.6]], table_rots=[0.4, -1], has_legs=False)
    world = arena.nominal_params()._replace(table_full_sizes=np.array([[0.8, 0.3, 0.05], [0.5, 0.9, 0.1]]))
    model = arena.compile(world)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    grid = np.stack(np.meshgrid(np.linspace(-0.7, 1.6, 40), np.linspace(-0.6, 1.1, 40)), axis=-1)
    hit = np.zeros(1, np.int32)
    meets = np.zeros(grid.shape[:2], bool)
    for i, j in np.ndindex(meets.shape):
        mujoco.mj_ray(model, data, np.array([*grid[i, j], 5.0]), np.array([0.0, 0.0, -1.0]), None, 1, -1, hit)
        meets[i, j] = model.geom(hit[0]).name != "floor"
    got = plots._covered(grid, params.on_host(world))
    assert 0.1 < meets.mean() < 0.5
    assert np.array_equal(got, meets)


@pytest.fixture
def scenes(monkeypatch):
    """Commands load a file that was loaded before in no time: what is compiled for its arena is kept."""
    monkeypatch.setattr(cli, "_load", _load_once)


@functools.cache
def _load_once(file):
    return mja.load(file)


def test_render(here, scenes, capsys):
    """A grid shows exactly the worlds that were asked for, their objects where a key of theirs places them."""
    choice = ["small.yaml", "--worlds", "5,17", "--seed", "3"]
    assert cli.main(["render", *choice, "--size", "96x64", "-o", "a.png"]) == 0
    assert cli.main(["render", *choice, "--plan", "--reach", "0.8", "-o", "plan.png"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines == [f"{name}: 2 of the worlds of small.yaml, seed 3" for name in ("a.png", "plan.png")]
    arena, ranges = _load_once(pathlib.Path("small.yaml"))
    keys = mja.world_keys(3, [5, 17])
    worlds = [arena.sample_params(key, ranges) for key in keys]
    twins = [arena.c_world(params, key=key)[1] for params, key in zip(worlds, keys, strict=True)]
    together = jax.tree.map(lambda *x: np.stack(x), *worlds)
    labels = ["world 5, seed 3", "world 17, seed 3"]
    want = np.asarray(arena.contact_sheet(together, twins, labels, width=96, height=64))
    with Image.open("a.png") as got, Image.open("plan.png") as plan:
        assert np.abs(np.asarray(got, int) - want).mean() < 1  # drawn by the same code, from float32's numbers
        assert plan.size[0] > 1000


def test_video(here, scenes, capsys):
    """A video has as many pictures as its time asks for, and says which engine stepped it."""
    assert (
        cli.main(["render", "small.yaml", "--worlds", "5", "--size", "96x64", "--seconds", "0.2", "-o", "a.mp4"]) == 0
    )
    assert (
        capsys.readouterr().out
        == "a.mp4: 1 of the worlds of small.yaml, seed 0, 0.2 s on C MuJoCo, the quick engine without a GPU\n"
    )
    with av.open("a.mp4") as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(frames) == 7  # 30 a second, and the first


def test_export(here, scenes, capsys):
    """What is written is the world, in the state that pictures show."""
    assert cli.main(["export", "small.yaml", "--world", "17", "--seed", "3", "-o", "out"]) == 0
    assert capsys.readouterr().out == "out: world 17 of small.yaml, seed 3\n"
    arena, ranges = _load_once(pathlib.Path("small.yaml"))
    key = mja.world_keys(3, [17])[0]
    _, want = arena.c_world(arena.sample_params(key, ranges), key=key)
    model = mujoco.MjModel.from_xml_path("out/world.xml")
    np.testing.assert_allclose(model.key("state").qpos, want.qpos, rtol=0, atol=1e-6)
    noted = json.loads(pathlib.Path("out/params.json").read_text())
    assert (noted["seed"], noted["world"]) == (3, 17)
    assert cli.main(["export", "small.yaml", "--world", "17", "--seed", "3", "-o", "out"]) == 2
    assert "out" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have a screen")
def test_view_without_a_screen(here, scenes, capsys, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert cli.main(["view", "small.yaml", "--world", "5"]) == 2
    assert capsys.readouterr().err == (
        "error: MuJoCo's viewer needs a screen, and DISPLAY= is none; arena.render draws pictures without one.\n"
    )


WRONG = {
    "unknown command": (["sampel"], "No such command 'sampel'. Did you mean 'sample'? See mjx-arenas --help."),
    "unknown option": (["stats", "small.yaml", "--colour"], "No such option '--colour'. See mjx-arenas stats --help."),
    "no file": (["stats"], "Missing argument 'FILE'. See mjx-arenas stats --help."),
    "unknown file": (["stats", "no.yaml"], "There is no file 'no.yaml'."),
    "unknown example": (
        ["stats", "shelv"],
        f"There is no file 'shelv'; examples: {', '.join(sorted(f.stem for f in paths.EXAMPLES.glob('*.yaml')))}.",
    ),
    "no output": (["sample", "small.yaml"], "Missing option '-o'. See mjx-arenas sample --help."),
    "number": (
        ["sample", "small.yaml", "-n", "-1", "-o", "a.csv"],
        "Invalid value for '-n': -1 is not in the range 1<=x<=10000000. See mjx-arenas sample --help.",
    ),
    "no number": (
        ["sample", "small.yaml", "-n", "many", "-o", "a.csv"],
        "Invalid value for '-n': 'many' is not a valid whole number. See mjx-arenas sample --help.",
    ),
    "seed": (
        ["stats", "small.yaml", "--seed", "4294967296"],
        "Invalid value for '--seed': 4294967296 is not in the range 0<=x<=4294967295. See mjx-arenas stats --help.",
    ),
    "worlds": (
        ["stats", "small.yaml", "--worlds", "1,-2"],
        "Invalid value for '--worlds': '1,-2' is not a list of worlds such as 0,5,17. See mjx-arenas stats --help.",
    ),
    "both": (
        ["stats", "small.yaml", "--worlds", "1", "-n", "3"],
        "Give -n or --worlds, not both. See mjx-arenas stats --help.",
    ),
    "suffix": (
        ["sample", "small.yaml", "-o", "a.txt"],
        "Invalid value for '-o': 'a.txt' must end in .npz, .csv or .parquet. See mjx-arenas sample --help.",
    ),
    "folder missing": (
        ["sample", "small.yaml", "-o", "no/a.csv"],
        "Invalid value for '-o': there is no folder 'no'. See mjx-arenas sample --help.",
    ),
    "folder in its place": (
        ["sample", "small.yaml", "-o", "taken.csv"],
        "Invalid value for '-o': 'taken.csv' is a folder. See mjx-arenas sample --help.",
    ),
    "plots without a folder": (
        ["stats", "small.yaml", "-o", "no/plots"],
        "Invalid value for '-o': there is no folder 'no'. See mjx-arenas stats --help.",
    ),
    "picture": (
        ["render", "small.yaml", "-o", "a.jpg"],
        "Invalid value for '-o': 'a.jpg' must end in .png or .mp4. See mjx-arenas render --help.",
    ),
    "too many": (
        ["render", "small.yaml", "-n", "100000", "-o", "a.png"],
        "Invalid value for '-n': 100000 is not in the range 1<=x<=400. See mjx-arenas render --help.",
    ),
    "size": (
        ["render", "small.yaml", "--size", "480", "-o", "a.png"],
        "Invalid value for '--size': '480' is not a size in pixels up to 4096x4096, such as 480x360. See mjx-arenas render --help.",
    ),
    "plan in motion": (
        ["render", "small.yaml", "--plan", "-o", "a.mp4"],
        "--plan is a picture from above: give a .png, and no --camera. See mjx-arenas render --help.",
    ),
    "reach of nothing": (
        ["render", "small.yaml", "--reach", "1", "-o", "a.png"],
        "--reach goes with --plan. See mjx-arenas render --help.",
    ),
    "no world": (
        ["export", "small.yaml", "--world", "-3", "-o", "out"],
        "Invalid value for '--world': -3 is not in the range 0<=x<=4294967295. See mjx-arenas export --help.",
    ),
    "broken YAML": (["stats", "broken.yaml"], "broken.yaml:1:5: not YAML: mapping values are not allowed here."),
    "wrong key": (
        ["stats", "key.yaml"],
        "key.yaml:3: `arena.table_ofset` is not an argument of TableArena: did you mean `table_offset`?",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_use(case, here, capsys):
    """One sentence on stderr, exit code 2, nothing written."""
    (here / "taken.csv").mkdir()
    (here / "broken.yaml").write_text("a: b: c")
    (here / "key.yaml").write_text("arena:\n  type: TableArena\n  table_ofset: [0, 0, 1]\n")
    before = sorted(here.rglob("*"))
    arguments, sentence = WRONG[case]
    assert cli.main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err == f"error: {sentence}\n"
    assert captured.out == ""
    assert sorted(here.rglob("*")) == before


@pytest.mark.parametrize(("error", "code"), [(KeyboardInterrupt, 130), (ZeroDivisionError, 70), (OSError, 2)])
def test_exit_codes(error, code, here, monkeypatch, capfd):
    """Interrupted while it writes, a mistake of ours, a full disk: each has its code, and the old output stays."""

    def fail(*_, **__):
        raise error

    (here / "a.npz").write_text("as before")
    monkeypatch.setattr(np, "savez_compressed", fail)
    assert cli.main(["sample", "small.yaml", "-n", "2", "-o", "a.npz"]) == code
    assert (here / "a.npz").read_text() == "as before"
    assert sorted(f.name for f in here.iterdir()) == ["a.npz", "small.yaml"]
    assert ("Traceback" in capfd.readouterr().err) == (code == 70)


def test_help_is_quick(here):
    """`--help` imports nothing heavy, is plain when piped, and names every example and exit code."""
    code = "import sys; from mjx_arenas import cli; cli.main(['--help']); print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"jax", "mujoco", "numpy", "matplotlib", "polars", "rich", "ruamel"}
    assert not heavy & {name.split(".")[0] for name in done.stderr.split()}
    assert "\x1b" not in done.stdout
    for word in (*(f.stem for f in paths.EXAMPLES.glob("*.yaml")), *cli.app.commands, "0 fine", "2 wrong", "130 inter"):
        assert word in done.stdout


def test_reader_gone():
    """Nobody reads on, as with `| head`: no complaint."""
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([*command(), "--help"], stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


TAKE_TERMINAL = """import fcntl, os, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.argv[1], sys.argv[1:])"""


def on_terminal(arguments, keys=b"", when=b""):
    """Runs a command on a terminal, types keys once it has shown something; its exit code and all that it showed."""
    ours, its = pty.openpty()
    words = [sys.executable, "-c", TAKE_TERMINAL, *command(), *arguments]
    with subprocess.Popen(words, stdin=its, stdout=its, stderr=its, start_new_session=True) as process:
        os.close(its)
        shown = b""
        with contextlib.suppress(OSError):  # the end, on Linux
            while read := os.read(ours, 4096):
                shown += read
                if keys and when in shown:
                    os.write(ours, keys)
                    keys = b""
    os.close(ours)
    return process.returncode, shown.decode()


def test_on_a_terminal(here):
    """Help stands out there; Ctrl-C is answered by one word and its code, and leaves nothing behind."""
    code, shown = on_terminal(["sample", "--help"])
    assert code == 0
    assert "\x1b[1mOptions" in shown
    code, shown = on_terminal(["sample", "small.yaml", "-n", "3000000", "-o", "a.csv"], b"\x03", b"loading")
    assert code == 130, shown
    assert "interrupted" in shown
    assert "Traceback" not in shown
    assert [f.name for f in here.iterdir()] == ["small.yaml"]


def test_piped(here):
    """The whole of a command in a process of its own, its output into a pipe."""
    arguments = ["stats", "small.yaml", "-n", "3", "--json"]
    done = subprocess.run([*command(), *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["worlds"] == 3
    assert "\x1b" not in done.stdout + done.stderr
