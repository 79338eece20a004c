"""What the demo leaves behind."""

import json
import pathlib
import types

import pytest
from PIL import Image

import mjx_arenas as mja
from mjx_arenas import cli, demo

pytestmark = pytest.mark.slow


@pytest.fixture
def shown(tmp_path, monkeypatch):
    """The demo at its end, on an arena of which nothing is computed, after an earlier one."""
    found = demo.Demo(12, None, tmp_path, "egl")
    found.arena = types.SimpleNamespace(to_xml=lambda _: "<mujoco/>", contact_sheet=lambda *_: Image.new("RGB", (8, 8)))
    found.device = "a device"
    for name in ("world_0.xml", "worlds.png", "report.json"):
        (tmp_path / name).write_text("as before")
    monkeypatch.setattr(mja, "take", lambda *_: None)
    return found


def test_command(tmp_path, capsys, monkeypatch):
    """It ends by itself, with worlds that are those of the compiler, and with what it says it wrote."""
    monkeypatch.setattr(demo, "ON_CPU", 12)
    assert cli.main(["demo", "-n", "16", "--engine", "jax", "--out", str(tmp_path)]) == 0
    assert "worlds against recompiled twins" in capsys.readouterr().out
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["worlds"] == 16
    assert report["objects"] == 12 * 4
    assert 0 < report["largest_model_difference"] < 1e-5
    assert (tmp_path / "world_0.xml").exists()


BATCH = types.SimpleNamespace(world=lambda _: None, params=None)


def test_files(shown, tmp_path, capsys):
    """A world as MJCF, pictures, and the numbers."""
    shown.draw(BATCH, None)
    shown.report()
    assert (tmp_path / "world_0.xml").read_text() == "<mujoco/>"
    with Image.open(tmp_path / "worlds.png") as sheet:
        assert sheet.size == (8, 8)
    assert json.loads((tmp_path / "report.json").read_text())["worlds"] == 12
    printed = capsys.readouterr().out
    assert f"{tmp_path}/worlds.png: 12 of the 12 worlds" in printed.replace("\n", "")
    assert "Some tables have no legs: `has_legs` varies." in " ".join(printed.split())


@pytest.mark.parametrize("name", ["world_0.xml", "worlds.png", "report.json"])
def test_half_a_file(name, shown, tmp_path, monkeypatch):
    """Where the disk is full, what was there stays, and nothing else comes."""

    def half(path, *_, **__):
        path.write_bytes(b"half")
        if path.name == name:
            raise OSError("the disk is full")

    monkeypatch.setattr(pathlib.Path, "write_text", half)
    monkeypatch.setattr(Image.Image, "save", lambda _, path: half(path))
    with pytest.raises(OSError, match="the disk is full"):
        shown.report() if name == "report.json" else shown.draw(BATCH, None)
    assert (tmp_path / name).read_text() == "as before"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["report.json", "world_0.xml", "worlds.png"]
