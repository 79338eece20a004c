"""The lower bounds are those that are tested; pictures say what they need beside."""

import importlib.util
import pathlib
import re
import tomllib

import pytest

import mjx_arenas as mja

TESTS = pathlib.Path(__file__).parent


def test_lower_bounds_are_pinned():
    """`make test-oldest` runs on the lower bounds of what the library, pictures and the command line need, not on what is newest."""
    project = tomllib.loads((TESTS.parent / "pyproject.toml").read_text())["project"]
    pinned = dict(re.findall(r"^([\w.-]+)==([\d.]+)$", (TESTS / "oldest.txt").read_text(), re.MULTILINE))
    extras = [b for name in ("viz", "cli") for b in project["optional-dependencies"][name] if ">=" in b]
    assert len(extras) > 5
    for bound in [*extras, *project["dependencies"]]:
        name, least = bound.partition(",")[0].split(">=")
        assert re.fullmatch(rf"{re.escape(least)}(\.0)*", pinned[name]), bound


def test_pictures_need_warp(monkeypatch):
    there = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "warp" else there(name))
    with pytest.raises(
        RuntimeError, match=r"^Pictures on the device need MuJoCo Warp: pip install 'mjx_arenas\[warp\]'\.$"
    ):
        mja.TableArena().renderer()
