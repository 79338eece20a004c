"""Commands that show and keep worlds start robots in the keyframe that is named, as `check` does."""

import json

import mujoco
import numpy as np
import pytest
from PIL import Image

from mjx_arenas import cli

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


@pytest.mark.parametrize("command", ["render", "export"])
def test_unknown(command, capsys):
    assert cli.main([command, "arm.json", "--keyframe", "r_down", "-o", "a.png"]) == 2
    assert capsys.readouterr().err == "error: --keyframe must be 'r_up', got 'r_down'.\n"
