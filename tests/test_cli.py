"""The command line as a user types it: piped, on a terminal, and wrongly."""

import contextlib
import csv
import importlib
import io
import json
import os
import pathlib
import pty
import re
import signal
import subprocess
import sys
import tomllib
import types

import av
import click
import jax
import mujoco
import numpy as np
import polars
import pytest
from command import TIGHT, _load_once, command
from PIL import Image

import mjx_arenas as mja
from mjx_arenas import cli
from mjx_arenas.checks import bundles, failures
from mjx_arenas.cli import pictures, terminal
from mjx_arenas.cli import scenes as cli_scenes
from mjx_arenas.files import load, paths
from mjx_arenas.furniture.standing import Standing
from mjx_arenas.params import params
from mjx_arenas.params.params import QUANTITIES, named
from mjx_arenas.viz import plots, render, samples

ROOT = pathlib.Path(__file__).parent.parent


def test_entry_point():
    """The script that is installed exists."""
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    module, function = scripts["mjx-arenas"].split(":")
    assert callable(getattr(importlib.import_module(module), function))


@pytest.mark.xslow
@pytest.mark.slow
def test_warmup(here, capsys):
    """It steps as many worlds as are asked for, and says how long each stage took."""
    assert cli.main(["warmup", "small.yaml", "-n", "3", "--engine", "warp", "--camera", "frontview"]) == 0
    *stages, last = capsys.readouterr().out.splitlines()
    assert [re.fullmatch(r" *[0-9.]+ s  (.*)", line)[1] for line in stages] == [
        "randomize",
        "make_data",
        "step",
        "rollout on impl='warp'",
        "pictures of camera 'frontview'",
    ]
    assert last.startswith("3 worlds of small.yaml; XLA's programs are in ")


def test_sample(here, capsys):
    """The three kinds of table hold the same numbers, which are those that Python draws for the same worlds."""
    assert cli.main(["sample", "small.yaml", "-n", "20", "--seed", "3", "-o", "a.npz"]) == 0
    assert cli.main(["sample", "small.yaml", "--worlds", "5-5, 17,5", "--seed", "3", "-o", "b.csv"]) == 0
    assert cli.main(["sample", "small.yaml", "--worlds", "5,17", "--seed", "3", "-o", "c.parquet", "--json"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == "a.npz: 20 worlds of small.yaml, seed 3; all are valid"
    assert json.loads(out[2]) == {"file": "c.parquet", "seed": 3, "worlds": 2, "valid": 2}

    arrays = np.load("a.npz")
    drawn = mja.ArenaParams(*(arrays[name] for name in QUANTITIES))
    arena, ranges = mja.load("small.yaml")
    want = jax.vmap(arena.sample_params, in_axes=(0, None))(mja.world_keys(3, range(20)), ranges)
    for name, got in named(drawn).items():
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
    names = [
        c.name
        for c in samples.columns(arena.record, jax.tree.map(lambda x: np.asarray(x)[None], arena.nominal_params()))
    ]
    assert len(names) == len(set(names)) == sum(np.size(p) for p in named(arena.nominal_params()).values())
    assert {name.split(".")[0] for name in names} == params.QUANTITIES.keys()


@pytest.mark.slow
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
        ("object_tables", "cube", "table0"),
        ("object_tables", "cube", "table1"),
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
    assert lines[-1] == ["50 worlds of small.yaml, seed 0; all are valid"]


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
    p = params.on_host(world)
    got = plots._covered(grid, Standing(p.table_offsets, p.table_rots, p.table_full_sizes, p.table_active))
    assert 0.1 < meets.mean() < 0.5
    assert np.array_equal(got, meets)


@pytest.mark.slow
def test_worlds_that_cannot_be(here, scenes, capsys, monkeypatch):
    """How many there are, an example for each reason; `--valid` leaves them out; pictures warn of each, and show the others."""
    (here / "tight.yaml").write_text(TIGHT)
    arena, ranges = _load_once(pathlib.Path("tight.yaml"))
    with monkeypatch.context() as patch:
        patch.setattr(samples, "CHUNK", 5)
        told = []
        drawn = samples.draw(arena.record, ranges, 0, range(12), lambda *progress: told.append(progress))
    assert told == [(5, 12), (10, 12), (12, 12)]
    sizes, there = drawn.params.table_full_sizes[:, 0], drawn.params.table_active[:, 0]
    small, none = (sizes[:, :2] < 0.5).any(1) & there, ~there
    assert np.array_equal(drawn.valid, ~small & ~none)
    assert 0 < small.sum() < (~drawn.valid).sum() < 11
    by = "0.5 x 0.5 m, larger than table 0, which is {:g} x {:g} m.".format(*sizes[small.argmax(), :2].round(6))
    why = {small.argmax(): f"Object 'cube' is {by}", none.argmax(): "No table is present."}

    assert cli.main(["sample", "tight.yaml", "-n", "12", "--valid", "-o", "a.csv"]) == 0
    out = capsys.readouterr().out.splitlines()
    n = int(drawn.valid.sum())
    assert out[0] == f"a.csv: the valid of 12 worlds of tight.yaml, seed 0; {n} are valid, {12 - n} not, such as"
    assert out[1:] == [f"  world {world}: {sentence}" for world, sentence in sorted(why.items())]
    with open("a.csv") as file:
        assert [int(row["world"]) for row in csv.DictReader(file)] == np.flatnonzero(drawn.valid).tolist()

    wrong = ",".join(map(str, sorted(why)))
    assert cli.main(["sample", "tight.yaml", "--worlds", wrong, "-o", "b.csv"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == "b.csv: 2 worlds of tight.yaml, seed 0; none is valid, for example"
    assert cli.main(["sample", "tight.yaml", "--worlds", wrong, "--valid", "-o", "c.csv"]) == 2
    first = min(why)
    assert (
        capsys.readouterr().err
        == f"error: There is no valid world to write; world {first}, for example: {why[first]}\n"
    )
    assert not (here / "c.csv").exists()

    chosen = [small.argmax(), none.argmax(), drawn.valid.argmax()]
    assert (
        cli.main(["render", "tight.yaml", "--worlds", ",".join(map(str, chosen)), "--size", "48x36", "-o", "a.png"])
        == 0
    )
    shown = capsys.readouterr()
    assert shown.err.splitlines() == [
        f"warning: World {world} of seed 0 is not valid: {why[world]}" for world in chosen[:2]
    ]
    assert shown.out == "a.png: 3 worlds of tight.yaml, seed 0\n"
    scene = cli_scenes.make(pathlib.Path("tight.yaml"), 0, chosen)
    assert scene.labels == [
        f"world {world}, seed 0{said}" for world, said in zip(chosen, (*[", invalid"] * 2, ""), strict=True)
    ]
    capsys.readouterr()

    assert cli.main(["export", "tight.yaml", "--world", str(chosen[0]), "-o", "out"]) == 0
    assert capsys.readouterr().err == f"warning: World {chosen[0]} of seed 0 is not valid: {why[chosen[0]]}\n"
    world = mujoco.MjModel.from_xml_path("out/world.xml")
    np.testing.assert_allclose(world.geom("table_collision").size[:2], sizes[small.argmax(), :2] / 2, rtol=1e-5)


@pytest.mark.slow
def test_worlds_that_mujoco_does_not_compile(here, scenes, capsys):
    """Pictures warn of each and show the others; there are no files of one."""
    arena = mja.TableArena()
    arena.add_part(mja.furniture.Wall("wall", pos=(2.4, 0, 0), full_size=(0.1, 3, 2.5), window=(1.2, 0.9)))
    heights = mja.Uniform([0.1, 3, 1.2], [0.1, 3, 2.5])
    mja.save("wall.yaml", arena, mja.ArenaRanges(terms={"wall.full_size": heights}))
    keys = mja.world_keys(0, range(5))
    worlds = [arena.sample_params(key, mja.ArenaRanges(terms={"wall.full_size": heights})) for key in keys]
    tall = [bool(world.terms["wall.full_size"][0, 2] > 1.8) for world in worlds]
    assert 0 < sum(tall) < 5
    says = "cannot be made: `terms.wall.window` must be a hole within the wall's edges [m], got [1.2, 0.9]."
    assert cli.main(["render", "wall.yaml", "-n", "5", "--size", "48x36", "-o", "a.png"]) == 0
    shown = capsys.readouterr()
    assert shown.err.splitlines() == [f"warning: World {i} of seed 0 {says}" for i in range(5) if not tall[i]]
    assert shown.out.startswith(f"a.png: {sum(tall)} world")
    low = tall.index(False)
    assert cli.main(["export", "wall.yaml", "--world", str(low), "-o", "out"]) == 2
    assert capsys.readouterr().err == f"error: World {low} of seed 0 {says}\n"
    assert not (here / "out").exists()


@pytest.mark.slow
def test_render(here, scenes, capsys):
    """A grid shows exactly the worlds that were asked for, their objects where a key of theirs places them."""
    choice = ["small.yaml", "--worlds", "5,17", "--seed", "3"]
    assert cli.main(["render", *choice, "--size", "96x64", "-o", "a.png"]) == 0
    assert cli.main(["render", *choice, "--plan", "--reach", "0.8", "-o", "plan.png"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines == [f"{name}: 2 worlds of small.yaml, seed 3" for name in ("a.png", "plan.png")]
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


@pytest.mark.slow
def test_video(here, scenes, capsys):
    """A video has as many pictures as its time asks for, and says which engine stepped it."""
    asked = ["--worlds", "5", "--size", "96x64", "--seconds", "0.2", "--engine", "c"]
    assert cli.main(["render", "small.yaml", *asked, "-o", "a.mp4"]) == 0
    assert capsys.readouterr().out == "a.mp4: 1 world of small.yaml, seed 0, 0.2 s on C MuJoCo\n"
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
        "error: MuJoCo's viewer needs a screen, and there is none; mjx-arenas render draws pictures without one.\n"
    )


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


@pytest.mark.parametrize(
    ("module", "name", "arguments"),
    [
        (samples, "draw", ["stats", "small.yaml"]),
        (failures, "check", ["check", "small.yaml"]),
        (mja.Arena, "c_world", ["render", "small.yaml", "-n", "1", "-o", "a.png"]),
        (render, "draw_worlds", ["render", "small.yaml", "-n", "1", "-o", "a.png"]),
    ],
)
@pytest.mark.parametrize("error", [ValueError, TypeError])
def test_our_mistakes(module, name, arguments, error, here, scenes, monkeypatch, capsys):
    """What goes wrong after all input was checked, as shapes do while JAX traces, is not put down to the user."""

    def fail(*_, **__):
        raise error("shapes differ")

    if name != "draw":
        nominal = jax.tree.map(
            lambda x: np.asarray(x)[None], _load_once(pathlib.Path("small.yaml"))[0].nominal_params()
        )
        drawn = samples.Sample(0, np.arange(1), nominal, np.ones(1, bool))
        monkeypatch.setattr(samples, "draw", lambda *_: drawn)
    monkeypatch.setattr(module, name, fail)
    assert cli.main(arguments) == 70
    assert f"{error.__name__}: shapes differ" in capsys.readouterr().err


class Report:
    """What `check` finds, of two worlds that fail."""

    ok, seed, worst, failures = False, 0, (3, 5), {}

    def to_dict(self):
        return {"n_failed": 2}

    def __str__(self):
        return "2 of 256 worlds fail"

    def save_bundle(self, folder, world):
        if world == 3:
            raise OSError(28, "No space left on device", str(folder / "states.npz"))


def test_very_long_words(here, capsys):
    """More digits than Python makes numbers of are refused; a name may be as long as the system takes."""
    assert cli.main(["stats", "small.yaml", "--worlds", "1" * 5000]) == 2
    assert cli.main(["render", "small.yaml", "--size", "1" * 5000 + "x3", "-o", "a.png"]) == 2
    assert capsys.readouterr().err.count("error: ") == 2
    name = "a" * 248 + ".csv"
    assert cli.main(["sample", "small.yaml", "-n", "2", "-o", name]) == 0
    assert (here / name).exists()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full")
def test_output_to_a_full_disk():
    """What is piped into a file that cannot grow: one sentence."""
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "mjx_arenas", "--help"], stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert done.returncode == 2
    assert done.stderr.startswith("error: The output cannot be written: No space left on device.")


def test_check_on_a_full_disk(here, scenes, monkeypatch, capsys):
    """What was found after a long rollout is said, whatever becomes of the bundles."""
    monkeypatch.setattr(failures, "check", lambda *_, **__: Report())
    assert cli.main(["check", "small.yaml", "--json", "-o", "out"]) == 1
    shown = capsys.readouterr()
    assert json.loads(shown.out) == {"n_failed": 2, "bundles": {"5": "out/world_5"}}
    warning = "warning: There is no bundle of world 3: 'out/world_3/states.npz': No space left on device.\n"
    assert shown.err == warning
    assert cli.main(["check", "small.yaml", "-o", "out"]) == 1
    shown = capsys.readouterr()
    assert shown.out.splitlines()[0] == "2 of 256 worlds fail"
    assert shown.out.splitlines()[-1] == "replay it:  mjx-arenas replay out/world_5"
    assert shown.err == warning


class Replayed:
    """A world that fails again, and is drawn or not."""

    reproduced, problem = True, None

    def picture(self):
        if self.problem:
            raise RuntimeError(self.problem)
        return Image.new("RGB", (8, 8))

    def to_dict(self):
        return {"reproduced": True}

    def __str__(self):
        return "the same failure shows"


def test_replay_without_a_picture(here, monkeypatch, capsys):
    """Its numbers are said, and then why there is none."""
    monkeypatch.setattr(bundles, "replay", lambda _: Replayed())
    assert cli.main(["replay", "bundle", "-o", "a.png"]) == 0
    assert capsys.readouterr().out == "the same failure shows\na.png: the world, drawn\n"
    os.remove("a.png")
    monkeypatch.setattr(Replayed, "problem", "There is no picture.")
    for options, said in (([], "the same failure shows\n"), (["--json"], '{\n  "reproduced": true\n}\n')):
        assert cli.main(["replay", "bundle", "-o", "a.png", *options]) == 2
        assert capsys.readouterr() == (said, "error: There is no picture.\n")
    assert not (here / "a.png").exists()


@pytest.mark.parametrize(
    ("arguments", "gpu", "quick"),
    [
        (["check", "--steps", "1000", "--engine", "c"], True, True),
        (["check", "--steps", "1000"], False, True),
        (["check", "--steps", "1000"], True, False),
        (["check", "--steps", "1000", "--engine", "jax"], False, False),
        (["check", "--steps", "10", "-n", "4", "--engine", "warp"], True, True),
        (["render", "-o", "a.mp4", "--engine", "jax", "-n", "1"], False, True),
        (["render", "-o", "a.mp4", "--engine", "jax", "--seconds", "60"], False, False),
        (["render", "-o", "a.mp4", "--seconds", "60"], True, False),
        (["render", "-o", "a.mp4", "--seconds", "3600"], False, True),
        (["render", "-o", "a.png"], True, True),
        (["stats"], True, True),
    ],
)
def test_xla_optimizes_what_runs_long(arguments, gpu, quick, here, monkeypatch):
    """It does where MJX takes many steps, as it compiles for longer than a few of them take."""
    flags = {}
    monkeypatch.setattr(os, "environ", flags)
    monkeypatch.setattr(cli_scenes, "has_gpu", lambda: gpu)
    monkeypatch.setattr(load, "load", lambda _: _stop())
    assert cli.main([arguments[0], "small.yaml", *arguments[1:]]) == 2
    assert flags["XLA_FLAGS"] == ("--xla_backend_optimization_level=0" if quick else "")


def _stop():
    raise ValueError("far enough")


def test_many_plans(monkeypatch):
    """More of them than memory holds are refused once the first shows how large they are."""
    drawn = []
    arena = types.SimpleNamespace(plan=lambda *_: drawn.append(1))
    monkeypatch.setattr(render, "picture", lambda _: np.zeros((700, 1000, 3), np.uint8))
    scene = types.SimpleNamespace(
        arena=arena, numbers=range(400), worlds=range(400), data=range(400), labels=range(400)
    )
    with pytest.raises(
        click.UsageError, match="400 pictures of 1000x700 are 280 megapixels, more than 250: give fewer"
    ):
        pictures._plans(scene, None)
    assert len(drawn) == 1


@pytest.mark.parametrize("code", [1, 3, "It cannot go on."])
def test_ended_by_a_library(code, here, monkeypatch):
    """Its exit code is the command's, unless it is for want of a reader."""
    monkeypatch.setattr(cli_scenes, "load", lambda *_: sys.exit(code))
    with pytest.raises(SystemExit) as ended:
        cli.main(["stats", "small.yaml"])
    assert ended.value.code == code


def test_wrong_variable():
    """MuJoCo refuses a wrong `MUJOCO_GL` when it is imported."""
    code = "from mjx_arenas import cli; print(cli.main(['stats', 'shelf']), cli.main(['replay', 'bundle']))"
    environ = {**os.environ, "MUJOCO_GL": "paper"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environ)
    assert done.stdout == "2 2\n"
    assert done.stderr == 2 * "error: invalid value for environment variable MUJOCO_GL: paper.\n"


def test_help_is_quick(here):
    """`--help` imports nothing heavy, is plain when piped, and names every example and exit code."""
    code = "import sys; from mjx_arenas import cli; cli.main(['--help']); print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"jax", "mujoco", "numpy", "matplotlib", "polars", "rich", "ruamel"}
    assert not heavy & {name.split(".")[0] for name in done.stderr.split()}
    assert "\x1b" not in done.stdout
    for word in (
        *(f.stem for f in paths.EXAMPLES.glob("*.yaml")),
        *cli.app.commands,
        "0        all is fine",
        "2        wrong use",
        "130 by",
        "143 by",
    ):
        assert word in done.stdout


def test_reader_gone():
    """Nobody reads on, as with `| head`: no complaint."""
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([*command(), "--help"], stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


BUSY = """import hashlib, pathlib
from mjx_arenas.cli import stop
from mjx_arenas.files import output

stop.listen()
def unreadable():
    raise PermissionError

with stop.saying(unreadable), stop.saying(lambda: "more"), output.whole(pathlib.Path("a.csv")) as unfinished:
    unfinished.write_text("half")
    print("now", flush=True)
    hashlib.pbkdf2_hmac("sha256", b"", b"", 10**9)  # minutes in which Python has no turn, as while XLA compiles
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals(number, here):
    """They stop at once a process that is busy elsewhere, and what it left unfinished goes."""
    took = signal.signal(number, signal.SIG_DFL)  # where these tests run in the background they are ignored
    try:
        child = subprocess.Popen([sys.executable, "-c", BUSY], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    finally:
        signal.signal(number, took)
    with child:
        assert child.stdout.readline() == b"now\n", child.stderr.read()
        assert len(list(here.iterdir())) == 2
        child.send_signal(number)
        assert child.wait(timeout=20) == 128 + number
        assert child.stderr.read() == b"interrupted; more\n"
    assert [f.name for f in here.iterdir()] == ["small.yaml"]


class Screen(io.StringIO):
    def isatty(self):
        return True


def test_progress(monkeypatch):
    """A terminal shows how much is done, and is left as it was; elsewhere nothing is said."""
    for stream in (Screen(), io.StringIO()):
        monkeypatch.setattr(sys, "stderr", stream)
        monkeypatch.setenv("TERM", "xterm")
        with terminal.busy("drawing") as tell:
            assert list(terminal.counted("abcd", tell)) == list("abcd")
        shown = stream.getvalue()
        assert ("drawing" in shown and "100%" in shown) == stream.isatty()
        assert shown.endswith("\x1b[2K") or not shown


TAKE_TERMINAL = """import fcntl, os, signal, sys, termios
signal.signal(signal.SIGINT, signal.SIG_DFL)
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


@pytest.mark.slow
def test_piped(here):
    """The whole of a command in a process of its own, its output into a pipe."""
    arguments = ["stats", "small.yaml", "-n", "3", "--json"]
    done = subprocess.run([*command(), *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["worlds"] == 3
    assert "\x1b" not in done.stdout + done.stderr
