"""The README's Python runs as it stands."""

import pathlib
import re

import pytest
import worlds

import mjx_arenas as mja
from mjx_arenas import cli

README = (pathlib.Path(__file__).parent.parent / "README.md").read_text()


@pytest.mark.slow
def test_code_blocks():
    """All blocks, one after the other, in one namespace."""
    blocks = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert len(blocks) >= 2
    names = {}
    for block in blocks:
        if not worlds.HAS_C_BATCH:
            block = re.sub(r"^cpu.*$", "", block, flags=re.MULTILINE)
        exec(compile(block, "README.md", "exec"), names)
    assert names["data"].qpos.shape == (64, 15)
    assert names["batch"].valid.all()


def test_names_exist():
    """Every public name that the README speaks of is there."""
    for name in re.findall(r"mja\.(\w+)", README):
        assert hasattr(mja, name), name
    for name in re.findall(r"`arena\.(\w+)", README):
        assert hasattr(mja.Arena, name) or name == "spec", name


def test_links_exist():
    """Every file that the README links to is there."""
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (pathlib.Path(__file__).parent.parent / target).exists(), target


def test_commands_exist(tmp_path):
    """Every command that the README shows is there, with its options; its file loads."""
    block = re.search(r"```yaml\n(.*?)```", README, flags=re.DOTALL)
    assert block
    (tmp_path / "robot.xml").write_text(
        "<mujoco><worldbody><body name='base'><geom size='.1'/></body></worldbody></mujoco>"
    )
    (tmp_path / "arena.yaml").write_text(re.sub(r"# (then: .*\])", r"\1", block[1]))
    assert mja.load(tmp_path / "arena.yaml")[0].mounts
    shown = re.findall(r"^mjx-arenas (\w+)(.*?)(?:#|$)", README, flags=re.MULTILINE)
    assert {name for name, _ in shown} >= {"stats", "sample", "render", "view", "export", "check", "replay"}
    for name, rest in shown:
        known = {option for parameter in cli.app.commands[name].params for option in parameter.opts}
        assert set(re.findall(r"(?<!\S)--?\w[\w-]*", rest)) <= known, name
