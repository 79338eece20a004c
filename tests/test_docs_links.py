"""Links, anchors and commands of README and docs."""

import importlib.util
import pathlib
import re
import shlex

import command
import pages
import pytest

from benchmarks.cases import CASES
from mjx_arenas import cli

ROBOT = "<mujoco><worldbody><body name='base'><geom size='.1'/></body></worldbody></mujoco>"


@pytest.mark.parametrize("page", pages.PAGES)
def test_links(page):
    """Every file that a page links to is there, and every heading."""
    for path, anchor in pages.links(page):
        assert (pages.ROOT / path).exists(), path
        if anchor and path.endswith(".md"):
            assert anchor in pages.anchors(path), f"{path}#{anchor}"


def test_commands_parse(tmp_path, monkeypatch):
    """Every `mjx-arenas` command has its options, and takes what is shown."""
    monkeypatch.chdir(tmp_path)
    for name in ("arena", "first"):
        (tmp_path / f"{name}.yaml").write_text(command.SMALL)
    (tmp_path / "docs").mkdir()
    seen = set()
    for page in pages.PAGES:
        for line in pages.commands(page):
            name, *words = shlex.split(line)
            if name == "mjx-arenas":
                seen.add(words[0])
                assert words[0] in cli.app.commands, f"{page}: {line}"
                assert cli.app.commands[words[0]].make_context(words[0], words[1:]) is not None
        for line in pages.named_commands(page):
            name, *words = shlex.split(line)
            if name == "mjx-arenas" and not words[0].isupper():
                assert words[0] in cli.app.commands, f"{page}: {line}"
                known = {option for param in cli.app.commands[words[0]].params for option in param.opts}
                assert {word for word in words[1:] if word.startswith("-")} <= known | {"--help"}, f"{page}: {line}"
    assert seen >= {"stats", "sample", "render", "view", "export", "check", "replay"}


def test_other_commands():
    """Every target of make is in the Makefile; scripts, modules and cases of benchmarks are there."""
    targets = set(re.findall(r"^([\w-]+):", (pages.ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    cases = {case.name for case in CASES}
    for page in pages.PAGES:
        for line in (*pages.commands(page), *pages.named_commands(page)):
            words = shlex.split(line)
            if words[0] == "make":
                assert words[1] in targets, f"{page}: {line}"
            elif words[:2] == ["python", "-m"]:
                assert importlib.util.find_spec(words[2]) is not None, f"{page}: {line}"
                if words[2] == "benchmarks":
                    named = [word for word in words[3:] if re.fullmatch(r"[a-z_]+", word)]
                    assert set(named) <= cases, f"{page}: {line}"
            elif words[0] == "python":
                folders = pages.ROOT, (pages.ROOT / page).parent
                assert any((folder / words[1]).exists() for folder in folders), f"{page}: {line}"


def test_file(tmp_path):
    """The file that docs/files.md shows loads, also with what it leaves out by a comment."""
    import mjx_arenas as mja

    ((shown, _),) = pages.blocks("docs/files.md", "yaml")
    (tmp_path / "robot.xml").write_text(ROBOT)
    (tmp_path / "arena.yaml").write_text(re.sub(r"# (then: .*\])", r"\1", shown))
    assert mja.load(tmp_path / "arena.yaml")[0].mounts


def test_pictures():
    """Pictures of docs are shown somewhere, and are small."""
    shown = {path for page in pages.PAGES for path, _ in pages.links(page)}
    for picture in (pages.ROOT / "docs").rglob("*.png"):
        assert str(pathlib.Path(picture).relative_to(pages.ROOT)) in shown, picture
        assert picture.stat().st_size < 1.5e6, picture
