"""Commands that show and keep worlds start robots in the keyframe that is named, as `check` does."""

import json
import pathlib

import mujoco
import numpy as np
import pytest
from PIL import Image

import mjx_arenas as mja
from mjx_arenas import cli
from mjx_arenas.viz import render, tile

ROBOT = """
<mujoco>
  <worldbody><body name="base" pos="0 0 1"><joint name="turn" axis="0 1 0"/>
    <geom type="capsule" size="0.05" fromto="0 0 0 0.6 0 0" contype="0" conaffinity="0"/></body></worldbody>
  <keyframe><key name="up" qpos="-1.5"/></keyframe>
</mujoco>
"""
FILE = {
    "arena": {"type": "TableArena", "objects": ["cube"], "then": [{"attach": {"robot": "robot.xml", "prefix": "r_"}}]},
    "ranges": {"table_rots": {"Uniform": [-1, 1]}},
}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """A folder with an arena and its robot."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.xml").write_text(ROBOT)
    (tmp_path / "arm.json").write_text(json.dumps(FILE))


@pytest.mark.slow
def test_export():
    for keyframe, turn in (([], 0), (["--keyframe", "r_up"], -1.5)):
        out = f"out{len(keyframe)}"
        assert cli.main(["export", "arm.json", "-o", out, *keyframe]) == 0
        model = mujoco.MjModel.from_xml_path(f"{out}/world.xml")
        assert model.key("state").qpos[model.joint("r_turn").qposadr[0]] == turn


def test_render():
    small = ["-n", "1", "--size", "96x64"]
    for name, keyframe in (("rest", []), ("up", ["--keyframe", "r_up"])):
        assert cli.main(["render", "arm.json", *small, *keyframe, "-o", f"{name}.png"]) == 0
    with Image.open("rest.png") as rest, Image.open("up.png") as up:
        assert rest.size != up.size or (np.asarray(rest) != np.asarray(up)).any()


def viewed(monkeypatch):
    """What MuJoCo's viewer is given in this process: (model, data) of each call."""
    shown = []
    monkeypatch.setattr(render, "check_screen", lambda: None)
    monkeypatch.setattr(tile, "view", lambda model, data: shown.append((model, data)))
    return shown


@pytest.mark.slow
def test_view(monkeypatch):
    """The viewer gets the world in the keyframe, or in the state, that is named; many stand side by side."""
    shown = viewed(monkeypatch)
    assert cli.main(["view", "arm.json"]) == 0
    assert cli.main(["view", "arm.json", "--keyframe", "r_up"]) == 0
    arena = mja.load("arm.json")[0]
    qpos = mujoco.MjData(arena.mj_model).qpos.copy()
    turn, at = arena.mj_model.joint("r_turn").qposadr[0], arena.layout.object_qpos[0]
    qpos[turn], qpos[at] = 0.7, [0.5, 0.4, 1.5, 0, 1, 0, 0]
    np.savez("state.npz", qpos=qpos)
    assert cli.main(["view", "arm.json", "--state", "state.npz"]) == 0
    assert [data.qpos[turn] for _, data in shown] == [0, -1.5, 0.7]
    np.testing.assert_array_equal(shown[2][1].qpos, qpos)

    assert cli.main(["view", "arm.json", "--tile", "2", "--keyframe", "r_up"]) == 0
    model, data = shown[3]
    turns = [i for i in range(model.njnt) if model.joint(i).name.endswith("r_turn")]
    assert data.qpos[model.jnt_qposadr[turns]].tolist() == [-1.5, -1.5]


@pytest.mark.parametrize(("command", "out"), [("render", "a.png"), ("export", "a")])
def test_unknown(command, out, capsys):
    assert cli.main([command, "arm.json", "--keyframe", "r_down", "-o", out]) == 2
    assert capsys.readouterr().err == "error: --keyframe must be 'r_up', got 'r_down'.\n"


@pytest.mark.slow
def test_a_state_is_shown(capsys):
    """The state that Python saved of a world is what `export` writes and `render` draws."""
    arena, ranges = mja.load("arm.json")
    key = mja.world_keys(0, [3])[0]
    params = arena.sample_params(key, ranges)
    data = arena.c_world(params, key=key)[1]
    at = arena.layout.object_qpos[0]
    qpos = mujoco.MjData(arena.mj_model).qpos.copy()
    qpos[at] = [0.5, 0.4, 1.5, 0, 1, 0, 0]
    np.savez("state.npz", qpos=qpos)
    given = ["--state", "state.npz"]
    assert cli.main(["export", "arm.json", "--world", "3", *given, "-o", "out"]) == 0
    model = mujoco.MjModel.from_xml_path("out/world.xml")
    np.testing.assert_array_equal(model.key("state").qpos[model.joint("cube_joint0").qposadr[0] :][:7], qpos[at])
    assert data.qpos[2] != 1.5
    assert cli.main(["render", "arm.json", "--worlds", "3", *given, "--size", "64x48", "-o", "at.png"]) == 0
    assert cli.main(["render", "arm.json", "--worlds", "3", "--size", "64x48", "-o", "start.png"]) == 0
    assert pathlib.Path("at.png").read_bytes() != pathlib.Path("start.png").read_bytes()

    np.savez("many.npz", qpos=np.zeros((4, len(qpos))))
    np.savez("none.npz", qvel=np.zeros(6))
    wrong = {
        (
            "--worlds",
            "3",
            "--state",
            "many.npz",
        ): f"`qpos` must be ({len(qpos)},) finite numbers of one world, got float64 of shape (4, {len(qpos)}).",
        (
            "--worlds",
            "3",
            "--state",
            "none.npz",
        ): "--state 'none.npz' must be an .npz file with the array `qpos` of a world.",
        (
            "-n",
            "2",
            *given,
        ): "--state shows one world, and cannot be combined with --keyframe. See mjx-arenas render --help.",
        (
            "-n",
            "1",
            *given,
            "--engine",
            "warp",
        ): "--state is drawn and stepped by C MuJoCo: leave --engine out. See mjx-arenas render --help.",
    }
    capsys.readouterr()
    for options, says in wrong.items():
        assert cli.main(["render", "arm.json", *options, "-o", "no.png"]) == 2
        assert says in capsys.readouterr().err
