"""The lower bounds are those that are tested; pictures say which they need beside."""

import importlib.metadata
import importlib.util
import pathlib
import re
import tomllib

import pytest

import mjx_arenas as mja

TESTS = pathlib.Path(__file__).parent


def test_lower_bounds_are_pinned():
    """`make test-oldest` runs on the lower bounds of what pictures and the command line need, not on what is newest."""
    project = tomllib.loads((TESTS.parent / "pyproject.toml").read_text())["project"]
    pinned = dict(re.findall(r"^([\w.-]+)==([\d.]+)$", (TESTS / "oldest.txt").read_text(), re.MULTILINE))
    bounds = [b for name in ("viz", "cli") for b in project["optional-dependencies"][name] if ">=" in b]
    assert len(bounds) > 5
    for bound in [*bounds, *(b for b in project["dependencies"] if b.startswith("mujoco"))]:
        name, least = bound.split(">=")
        assert re.fullmatch(rf"{re.escape(least)}(\.0)*", pinned[name]), bound


@pytest.mark.parametrize(
    ("version", "old"), [("3.12.0", True), ("3.9.1", True), ("3.14.0", False), ("3.14.0rc1", False), ("4.0.0", False)]
)
def test_pictures_need_a_newer_one(version, old, monkeypatch):
    """Older ones draw the last state at times: one sentence, before an arena is compiled or a camera looked up."""
    monkeypatch.setattr(importlib.metadata, "version", lambda name: version)
    arena = mja.TableArena()
    if not old:
        assert arena.renderer(["frontview"]).cameras
        return
    says = rf"^Pictures on the device need mujoco-mjx 3\.14 or newer, this is {re.escape(version)}: 3\.12 takes no cameras by name"
    with pytest.raises(RuntimeError, match=says):
        arena.renderer(["nowhere"])


def test_pictures_need_warp(monkeypatch):
    there = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "warp" else there(name))
    with pytest.raises(
        RuntimeError, match=r"^Pictures on the device need MuJoCo Warp: pip install 'mjx_arenas\[warp\]'\.$"
    ):
        mja.TableArena().renderer()
