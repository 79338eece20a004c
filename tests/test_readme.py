"""The README's Python runs as it stands."""

import pathlib
import re

import worlds

import mjx_arenas as mja

README = (pathlib.Path(__file__).parent.parent / "README.md").read_text()


def test_code_blocks():
    """All blocks, one after the other, in one namespace."""
    blocks = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert len(blocks) >= 2
    names = {
        "ROBOT": '<mujoco><worldbody><body name="base"><joint/><geom size=".05 .2" type="capsule"/></body></worldbody></mujoco>'
    }
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
