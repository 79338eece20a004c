"""The command line used wrongly: each mistake is answered by one sentence."""

import importlib
import os
import re

import pytest
from click.testing import CliRunner

from benchmarks.__main__ import main as benchmarks_main
from mjx_arenas import cli
from mjx_arenas.cli import terminal
from mjx_arenas.files import paths

HILLY = """
arena:
  type: Arena.from_xml
  tables: [desk]
  xml: |
    <mujoco>
      <asset><hfield name="hill" nrow="2" ncol="2" size="1 1 1 1"/></asset>
      <worldbody>
        <geom name="hill" type="hfield" hfield="hill" pos="0 0 -2"/>
        <body name="desk" pos="0 0 0.8"><geom type="box" size="0.4 0.4 0.02"/></body>
        <body name="brick" pos="0 0 2"><freejoint/><geom name="brick" type="box" size="0.1 0.1 0.1"/></body>
      </worldbody>
    </mujoco>
"""
NEAR = "arena: {type: TableArena, objects: [{name: cube, place: {near: arm_base, distance: [0.2, 0.4]}}]}\nranges: {}\n"
LONG = 300 * "a"
WRONG = {
    "too much": (
        ["stats", "small.yaml", "more"],
        "Got unexpected extra argument (more). See mjx-arenas stats --help.",
    ),
    "demo": (
        ["demo", "-n", "3"],
        "Invalid value for '-n': '3' is not a whole number from 12 to 1,000,000. See mjx-arenas demo --help.",
    ),
    "no file": (["stats"], "Missing argument 'FILE'. See mjx-arenas stats --help."),
    "unknown file": (["stats", "no.yaml"], "There is no file 'no.yaml'."),
    "unknown arena": (
        ["train", "lift", "--arena", "kitchn"],
        "There is no file 'kitchn'; examples: bin_picking, clutter, kitchen, living_room, pick_and_place, robosuite_multi_table, "
        "robosuite_table, shelf, warehouse, workshop. Did you mean kitchen?",
    ),
    "unknown example": (
        ["stats", "shelv"],
        f"There is no file 'shelv'; examples: {', '.join(sorted(f.stem for f in paths.EXAMPLES.glob('*.yaml')))}. Did you mean shelf?",
    ),
    "a command that is another": (
        ["plot", "small.yaml"],
        "No such command 'plot'. Did you mean 'stats'? See mjx-arenas --help.",
    ),
    "a task": (
        ["train", "lft", "--show"],
        "'lft' is no task: it must be one of lift, open_drawer, pick_and_place, push, reach, a .yaml or .json file, or module:function. "
        "Did you mean lift?",
    ),
    "no task at all": (
        ["train", "juggle", "--show"],
        "'juggle' is no task: it must be one of lift, open_drawer, pick_and_place, push, reach, a .yaml or .json file, or module:function.",
    ),
    "a folder that is a file's name": (
        ["stats", "small.yaml", "-o", "plot.png"],
        "Invalid value for '-o' / '--out': 'plot.png' is the name of a file, and a folder is made: leave out .png. See mjx-arenas stats "
        "--help.",
    ),
    "an MJCF": (
        ["stats", "scene.xml"],
        "'scene.xml' must end in .yaml, .yml or .json: a file shows an MJCF as `arena: {type: Arena.from_xml, xml: scene.xml}`.",
    ),
    "no output": (["sample", "small.yaml"], "Missing option '-o' / '--out'. See mjx-arenas sample --help."),
    "number": (
        ["sample", "small.yaml", "-n", "-1", "-o", "a.csv"],
        "Invalid value for '-n': '-1' is not a whole number from 1 to 10,000,000. See mjx-arenas sample --help.",
    ),
    "no number": (
        ["sample", "small.yaml", "-n", "many", "-o", "a.csv"],
        "Invalid value for '-n': 'many' is not a whole number from 1 to 10,000,000. See mjx-arenas sample --help.",
    ),
    "seed": (
        ["stats", "small.yaml", "--seed", "4294967296"],
        "Invalid value for '--seed': '4294967296' is not a whole number from 0 to 4,294,967,295. See mjx-arenas stats --help.",
    ),
    "worlds": (
        ["stats", "small.yaml", "--worlds", "1,-2"],
        "Invalid value for '--worlds': '1,-2' is not a list of worlds such as 0,5,17 or 0-5,17. See mjx-arenas stats --help.",
    ),
    "worlds backwards": (
        ["stats", "small.yaml", "--worlds", "1, 5-3"],
        "Invalid value for '--worlds': '5-3' runs backwards: give 3-5. See mjx-arenas stats --help.",
    ),
    "too many worlds": (
        ["render", "small.yaml", "--worlds", "0-4000000000", "-o", "a.png"],
        "Invalid value for '--worlds': '0-4000000000' are 4,000,000,001 worlds, more than 400 at a time. "
        "See mjx-arenas render --help.",
    ),
    "world too large": (
        ["stats", "small.yaml", "--worlds", "4294967296"],
        "Invalid value for '--worlds': 4294967296 is not the number of a world, which is from 0 to 4,294,967,295. "
        "See mjx-arenas stats --help.",
    ),
    "both": (
        ["stats", "small.yaml", "--worlds", "1", "-n", "3"],
        "Give -n or --worlds, not both. See mjx-arenas stats --help.",
    ),
    "suffix": (
        ["sample", "small.yaml", "-o", "a.txt"],
        "Invalid value for '-o' / '--out': 'a.txt' must end in .npz, .csv or .parquet. See mjx-arenas sample --help.",
    ),
    "folder missing": (
        ["sample", "small.yaml", "-o", "no/a.csv"],
        "Invalid value for '-o' / '--out': there is no folder 'no'. See mjx-arenas sample --help.",
    ),
    "folder in its place": (
        ["sample", "small.yaml", "-o", "taken.csv"],
        "Invalid value for '-o' / '--out': 'taken.csv' is a folder. See mjx-arenas sample --help.",
    ),
    "plots without a folder": (
        ["stats", "small.yaml", "-o", "no/plots"],
        "Invalid value for '-o' / '--out': there is no folder 'no'. See mjx-arenas stats --help.",
    ),
    "picture": (
        ["render", "small.yaml", "-o", "a.jpg"],
        "Invalid value for '-o' / '--out': 'a.jpg' must end in .png or .mp4. See mjx-arenas render --help.",
    ),
    "too many": (
        ["render", "small.yaml", "-n", "100000", "-o", "a.png"],
        "Invalid value for '-n': '100000' is not a whole number from 1 to 400. See mjx-arenas render --help.",
    ),
    "size": (
        ["render", "small.yaml", "--size", "480", "-o", "a.png"],
        "Invalid value for '--size': '480' is not a size in pixels up to 4096x4096, such as 480x360. See mjx-arenas render --help.",
    ),
    "plan in motion": (
        ["render", "small.yaml", "--plan", "-o", "a.mp4"],
        "--plan is a picture from above: give a .png, and no --camera, --size or --engine. See mjx-arenas render --help.",
    ),
    "a picture in motion": (
        ["render", "small.yaml", "--seconds", "3", "-o", "a.png"],
        "--seconds needs a video: let -o end in .mp4. See mjx-arenas render --help.",
    ),
    "seconds": (
        ["render", "small.yaml", "--seconds", "nan", "-o", "a.mp4"],
        "Invalid value for '--seconds': 'nan' is not a number above 0, up to 3600 [s]. See mjx-arenas render --help.",
    ),
    "too large": (
        ["render", "small.yaml", "-n", "9", "--size", "2000x1000", "-o", "a.mp4"],
        "9 pictures of 2000x1000 are 18 megapixels, more than 8.8: give fewer or smaller ones. See mjx-arenas render --help.",
    ),
    "camera": (
        ["render", "small.yaml", "--camera", "frontvew", "-o", "a.png"],
        "--camera must be 'frontview', 'birdview', 'agentview' or 'sideview', got 'frontvew': did you mean 'frontview'?",
    ),
    "keyframe": (
        ["check", "small.yaml", "--keyframe", "home"],
        "--keyframe 'home': the arena has no keyframe with a name: leave --keyframe out.",
    ),
    "room without need": (
        ["check", "small.yaml", "--engine", "c", "--max-contacts", "9"],
        "--max-contacts goes with --engine warp: others drop no contacts. See mjx-arenas check --help.",
    ),
    "not a bundle's place": (
        ["check", "small.yaml", "--worlds", "3-5", "-o", "mine"],
        "-o: 'mine/world_4' is there already and is no bundle: give another folder.",
    ),
    "what MJX cannot": (
        ["check", "hilly.yaml", "--engine", "jax"],
        "impl='jax' of MJX loses contacts of geom 'brick' (box) with height field 'hill': use impl='warp', spheres and capsules, or "
        "contype/conaffinity.",
    ),
    "a name too long": (["sample", "small.yaml", "-o", LONG + ".csv"], f"'{LONG}.csv': File name too long."),
    "a folder's name too long": (["stats", "small.yaml", "-o", LONG], f"'{LONG}': File name too long."),
    "folders' names too long": (["check", "small.yaml", "-o", f"{LONG}/a"], f"'{LONG}/a': File name too long."),
    "a file's name too long": (["stats", LONG + ".yaml"], f"'{LONG}.yaml': File name too long."),
    "a bundle's name too long": (["replay", LONG], f"'{LONG}': File name too long."),
    "tiles and a world": (
        ["view", "small.yaml", "--tile", "4", "--world", "2"],
        "Give --world or --tile, which are worlds 0 to N - 1, not both. See mjx-arenas view --help.",
    ),
    "a file for a folder": (
        ["export", "small.yaml", "-o", "small.yaml"],
        "Invalid value for '-o' / '--out': 'small.yaml' is a file, not a folder. See mjx-arenas export --help.",
    ),
    "a file on the way": (
        ["check", "small.yaml", "-o", "small.yaml/a/b"],
        "Invalid value for '-o' / '--out': 'small.yaml' is a file, not a folder. See mjx-arenas check --help.",
    ),
    "a full folder": (
        ["export", "small.yaml", "-o", "."],
        "Invalid value for '-o' / '--out': '.' is a folder with something in it: give one that is empty or new. "
        "See mjx-arenas export --help.",
    ),
    "reach of nothing": (
        ["render", "small.yaml", "--reach", "1", "-o", "a.png"],
        "--reach goes with --plan. See mjx-arenas render --help.",
    ),
    "size without a camera": (
        ["warmup", "small.yaml", "--size", "3x3"],
        "--size goes with --camera. See mjx-arenas warmup --help.",
    ),
    "no world": (
        ["export", "small.yaml", "--world", "-3", "-o", "out"],
        "Invalid value for '--world': '-3' is not a whole number from 0 to 4,294,967,295. See mjx-arenas export --help.",
    ),
    "near a task's arm": (
        ["stats", "near.yaml"],
        "Object 'cube': `place.near` must be the name of a body that no joint moves and that is not mocap, a point x, y [m], or None: no "
        "body is called 'arm_base'. The arm of a task is there once the task has attached it: for an arena without the task, as in "
        "commands on a file, give the x and y of the arm's base.",
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
    (here / "mine" / "world_4" / "notes").mkdir(parents=True)
    (here / "mine" / "world_9" / "notes").mkdir(parents=True)
    (here / "hilly.yaml").write_text(HILLY)
    (here / "scene.xml").write_text("<mujoco/>")
    (here / "near.yaml").write_text(NEAR)
    (here / "broken.yaml").write_text("a: b: c")
    (here / "key.yaml").write_text("arena:\n  type: TableArena\n  table_ofset: [0, 0, 1]\n")
    before = sorted(here.rglob("*"))
    arguments, sentence = WRONG[case]
    assert cli.main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err == f"error: {sentence}\n"
    assert captured.out == ""
    assert sorted(here.rglob("*")) == before


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["sampel"], r"error: No such command 'sampel'\..* See mjx-arenas --help\.\n"),
        (
            ["stats", "small.yaml", "--zzz"],
            r"error: No such option:? '?--zzz'?\. See mjx-arenas stats --help\.\n",
        ),
        (
            ["render", "small.yaml", "--sise", "3x3"],
            r"error: No such option '--sise'\. Did you mean one of: [-', a-z]+\? See mjx-arenas render --help\.\n",
        ),
    ],
)
def test_unknown_words(arguments, sentence, here, capsys):
    """Click answers them, by words that differ between its versions."""
    assert cli.main(arguments) == 2
    assert re.fullmatch(sentence, capsys.readouterr().err)


@pytest.mark.skipif(not os.path.isdir("/proc"), reason="Linux's")
@pytest.mark.parametrize(
    "arguments", [["export", "-o", "/proc/a"], ["check", "-o", "/proc/a/b"], ["stats", "-o", "/proc"]]
)
def test_unwritable_folder(arguments, here, capsys):
    """Where even root cannot write."""
    assert cli.main([arguments[0], "small.yaml", *arguments[1:]]) == 2
    assert re.fullmatch(r"error: Nothing can be written in folder '/proc'(: [\w ]+)?\.\n", capsys.readouterr().err)


def test_bench_of_an_installed_package(monkeypatch, tmp_path, capsys):
    """Says in one sentence where benchmarks are; in a clone they answer themselves, by the command's name."""
    bench = importlib.import_module("mjx_arenas.cli.bench")
    done = CliRunner().invoke(bench.bench, ["--list"], standalone_mode=False)
    assert done.return_value == 0
    with pytest.raises(SystemExit):
        benchmarks_main(["--help"])
    assert capsys.readouterr().out.startswith("usage: mjx-arenas bench [-h] ")
    monkeypatch.setattr(bench, "ROOT", tmp_path)
    done = CliRunner().invoke(bench.bench, ["--list"], standalone_mode=False)
    assert str(done.exception) == (
        "The benchmarks are not part of the installed package: run this in a clone of the repository."
    )


def test_a_warning_is_shown_once(capsys):
    """Also where it is told with the line of a file and, later, without; others are shown."""
    show = terminal.each_once()
    for said in (
        "own.yaml:3: `ranges` are odd.",
        "`ranges` are odd.",
        "own.yaml:4: `ranges` are odd.",
        "World 3: odd.",
        "World 4: odd.",
    ):
        show(UserWarning(said), UserWarning, "a.py", 1)
    told = capsys.readouterr().err.splitlines()
    assert told == ["warning: own.yaml:3: `ranges` are odd.", "warning: World 3: odd.", "warning: World 4: odd."]
