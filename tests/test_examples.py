"""docs/examples: each script runs, its worlds are those that MuJoCo compiles, and docs/examples.md shows its code."""

import pathlib
import re
import runpy
import sys
import textwrap

import models
import mujoco
import numpy as np
import pytest

DOCS = pathlib.Path(__file__).parent.parent / "docs"
SCRIPTS = ("quadruped", "kitchen", "arm")
EXACT = 400 * 2.0**-24  # of a number: float32 through a factorization of the inertia matrix


def script(name):
    """What its names stand for."""
    return runpy.run_path(str(DOCS / "examples" / f"{name}.py"))


def text(name):
    return (DOCS / "examples" / f"{name}.py").read_text()


def all_differ(rows):
    """No two of the worlds are the same."""
    rows = np.asarray(rows)
    apart = abs(rows[:, None] - rows).max(-1) + np.eye(len(rows))
    return np.isfinite(rows).all() and apart.min() > 1e-3


@pytest.mark.xslow
@pytest.mark.skipif(mujoco.mj_version() < 4_000_000, reason="Playground's Go1 as mujoco_warp 4 steps it")
@pytest.mark.filterwarnings("ignore:The arena. geoms are inside each other")  # Go1's feet and the floor
def test_quadruped(tmp_path, monkeypatch, capsys):
    """Playground's environment, with the meshes of another package."""
    from mujoco_playground._src import mjx_env

    (tmp_path / "unitree_go1").symlink_to(models.ARMS["go1"].parent)
    monkeypatch.setattr(mjx_env, "MENAGERIE_PATH", mjx_env.MENAGERIE_PATH)
    picture = tmp_path / "worlds.png"
    off, ends = script("quadruped")["main"](str(tmp_path), worlds=3, steps=12, picture=picture)
    assert max(off.values()) < EXACT
    assert all_differ(ends)
    assert picture.stat().st_size > 0
    assert "3 worlds, no problems" in capsys.readouterr().out


@pytest.mark.xslow
@pytest.mark.slow
def test_kitchen(tmp_path):
    report, off, qpos = script("kitchen")["main"](worlds=4, steps=30, picture=tmp_path / "worlds.png")
    assert report.ok
    assert max(off.values()) < EXACT
    assert all_differ(qpos)
    assert (np.asarray(qpos)[:, :2] > [0.01, 0.05]).all(), "drawer and door open"
    assert (tmp_path / "worlds.png").exists()


@pytest.mark.xslow
@pytest.mark.filterwarnings("ignore:`robot`. geoms are inside each other")  # the Panda where all its joints are 0
def test_arm(tmp_path):
    arm = script("arm")
    n, off, qpos = arm["main"](models.ARMS["panda"], worlds=4, steps=20, picture=tmp_path / "worlds.png")
    assert n == len(arm["ARM"]) + len(arm["ARENA"]) == 30
    assert max(off.values()) < EXACT
    assert all_differ(qpos[:, :7] * 10), "the arms themselves"
    assert (abs(qpos[:, :7] - arm["GOAL"]) < abs(np.array(arm["HOME"]) - arm["GOAL"]) + 0.02).all()
    assert (tmp_path / "worlds.png").exists()


def test_missing_packages(monkeypatch):
    """One sentence says what to install."""
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(
        ModuleNotFoundError, match=r"gym_hil, which is not installed: pip install --no-deps gym-hil==0\.1\.14\.$"
    ):
        script("arm")["scene"]()
    monkeypatch.setitem(sys.modules, "mujoco_playground", None)
    with pytest.raises(
        SystemExit, match=r"^This example needs MuJoCo Playground: pip install 'mjx_arenas\[train\]'\.$"
    ):
        script("quadruped")


def test_page():
    """Its code is that of the scripts, line by line, and its pictures are there and small."""
    page = (DOCS / "examples.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    shown = "\n".join(text(name) for name in SCRIPTS)
    for block in blocks:
        assert block in shown or textwrap.indent(block, "    ") in shown, block
    for name in SCRIPTS:
        assert f"(examples/{name}.png)" in page
        assert f"python docs/examples/{name}.py" in page
        assert (DOCS / "examples" / f"{name}.png").stat().st_size < 250e3
        assert any(block in text(name) or textwrap.indent(block, "    ") in text(name) for block in blocks)
