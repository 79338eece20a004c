"""Links, anchors and commands of README and docs."""

import importlib.util
import pathlib
import re
import runpy
import shlex
import types

import click
import command
import pages
import pytest

from benchmarks.cases import CASES
from mjx_arenas import cli
from mjx_arenas.cli.bench import OTHERS

ROBOT = """<mujoco><worldbody><body name='base'><geom size='.1'/><body pos="0 0 .4"><joint name="pan" axis="0 0 1" damping="1"/>
  <geom size='.1'/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize("page", pages.PAGES)
def test_links(page):
    """Every file that a page links to is there, and every heading."""
    for path, anchor in pages.links(page):
        assert (pages.ROOT / path).exists(), path
        if anchor and path.endswith(".md"):
            assert anchor in pages.anchors(path), f"{path}#{anchor}"


@pytest.mark.parametrize("page", pages.PAGES)
def test_tables(page):
    """The site shows every table of the source as a table, with all of its rows."""
    markdown = pytest.importorskip("markdown")
    pytest.importorskip("pymdownx")
    shown = markdown.markdown(pages.text(page), extensions=["tables", "pymdownx.superfences"])
    rows = [table.count("<tr>") for table in re.findall(r"<table>.*?</table>", shown, flags=re.DOTALL)]
    assert rows == [text.count("\n") - 1 for text in pages.tables(page)]  # lines without the one below the head


def test_links_that_leave(capsys):
    """`make links` asks for each once, and names those that lead nowhere with the files that they stand in."""
    tool = runpy.run_path(str(pages.ROOT / "tools" / "links.py"))
    found = tool["links"]()
    asked = []

    def ask(url, status):
        asked.append(url)
        return status

    assert found["https://robosuite.ai/docs/modeling/arena.html"] == ["docs/arena.md"]
    assert (
        tool["main"](lambda url: ask(url, 404 if url == "https://robosuite.ai/docs/modeling/arena.html" else 200)) == 1
    )
    assert sorted(asked) == sorted(found)
    assert len(found) > 20
    shown = capsys.readouterr().out
    assert (
        shown
        == f"https://robosuite.ai/docs/modeling/arena.html: 404, in docs/arena.md\n1 of {len(found)} links lead nowhere.\n"
    )
    assert (tool["main"](lambda _: 403), tool["main"](lambda _: None)) == (0, 2)


def test_links_are_found():
    """Pages link to each other and to headings, so that a page without any is not one that was read wrongly."""
    found = [link for page in pages.PAGES for link in pages.links(page)]
    assert len(found) > 200
    assert sum(bool(anchor) for _, anchor in found) > 50


def test_commands_parse(tmp_path, monkeypatch):
    """Every `mjx-arenas` command has its options, and takes what is shown."""
    monkeypatch.chdir(tmp_path)
    for name in ("arena", "first"):
        (tmp_path / f"{name}.yaml").write_text(command.SMALL)
    (tmp_path / "lift_ur5e.yaml").write_text("task: lift")
    (tmp_path / "few_worlds.yaml").write_text("task: pick_and_place")
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
            if name == "mjx-arenas" and not words[0].isupper() and words != ["--help"]:
                assert words[0] in cli.app.commands, f"{page}: {line}"
                known = {option for param in cli.app.commands[words[0]].params for option in param.opts}
                options = {word for word in words[1:] if word.startswith("-")}
                assert options <= known | {"--help"} or words[0] == "bench", f"{page}: {line}"  # which have their own
    assert seen >= {"stats", "sample", "render", "view", "export", "check", "replay"}


def runnable():
    """The commands of pages that need no screen, no GPU and no more than a minute; slow but those that draw few worlds of little.

    Those of hundreds of worlds or of the kitchen, and cases of benchmarks, which are run at their smallest size, are xslow.
    """
    found = dict.fromkeys(
        line for page in pages.PAGES for line in pages.commands(page) if line.startswith("mjx-arenas ")
    )
    for line in found:
        _, name, file, *options = shlex.split(line)
        if name in ("stats", "sample", "render", "export", "check", "replay", "warmup", "bench") and file not in OTHERS:
            fast = file == "arena.yaml" and name in ("sample", "export", "render") and "warp" not in options
            many = name in ("check", "warmup") and "-n" in options and int(options[options.index("-n") + 1]) > 200
            many |= file == "kitchen"
            many |= name == "bench" and file != "--list"  # tests/test_benchmarks.py runs some
            yield pytest.param(line, marks=() if fast else pytest.mark.xslow if many else pytest.mark.slow)


@pytest.mark.parametrize("line", list(runnable()))
def test_commands_run(line, here, scenes, capfd):
    """Each does as it stands what it says, and writes what it is asked for."""
    _, name, file, *options = shlex.split(line)
    for shown in ("arena.yaml", "first.yaml"):
        (here / shown).write_text(command.SMALL)
    if name == "replay":
        (here / "tight.yaml").write_text(command.TIGHT)
        assert cli.main(["check", "tight.yaml", "-n", "20", "--steps", "2", "--engine", "c"]) == 1
        file = str(next((here / "out" / "check").iterdir()))
    if "warp" in options:
        pytest.importorskip("warp")
    if name == "bench" and file != "--list":
        options += ["--size", "tiny", "--out", str(here)]
    assert cli.main([name, file, *options]) == 0
    captured = capfd.readouterr()
    assert captured.out
    assert name != "stats" or max(map(len, captured.out.splitlines())) <= 120  # as it stands where it is piped
    assert "-o" not in options or (here / options[options.index("-o") + 1]).exists()


def test_command_line():
    """The reference has every command, in the order of the code, and the site shows what its help says."""
    page = "docs/api/command_line.md"
    assert re.findall(r"^`mjx-arenas (\w+) --help`$", pages.text(page), re.MULTILINE) == [*cli.app.commands]
    hooks = pytest.importorskip("mkdocs") and runpy.run_path(str(pages.ROOT / "docs" / "hooks.py"))
    shown = hooks["HELP"].sub(hooks["printed"], "`mjx-arenas --help`\n\n## view\n\n`mjx-arenas view --help`")
    assert re.findall(r"^```text\nUsage: mjx-arenas (\S+)", shown, re.MULTILINE) == ["[OPTIONS]", "view"]
    assert "--tile" in shown.partition("## view")[2]


@pytest.mark.parametrize("name", sorted(cli.app.commands))
def test_help(name, capfd):
    """Every command says what it does, and shows its options; no line of the list of commands is cut."""
    assert cli.main([name, "--help"]) == 0
    shown = capfd.readouterr().out
    assert shown.lower().startswith(f"usage: mjx-arenas {name} ")
    assert name != "bench" or all(other in shown for other in OTHERS)
    assert not cli.app.commands[name].get_short_help_str(68).endswith("...")


OPTIONS = [
    (name, param) for name, command in cli.app.commands.items() for param in command.params if param.opts[0][0] == "-"
]


def test_options():
    """Options of one kind have one name in all commands, and their help is a sentence or a thing, and no fragment."""
    fragments = re.compile(r"(Of|To|In|Which|With|Instead)\b")
    for name, param in OPTIONS:
        where = f"{name} {param.opts}"
        assert param.hidden or not fragments.match(param.help) or param.help.startswith("With --"), where
        assert ("-o" in param.opts) == ("--out" in param.opts) == (param.name == "out"), where
        assert ("--impl" in param.opts) <= ("--engine" in param.opts), where
        assert param.make_metavar(click.Context(cli.app)) not in ("TEXT", "INTEGER", "WHOLE NUMBER", "PATH"), where


def test_other_commands():
    """Every target of make is in the Makefile; scripts, modules and cases of benchmarks are there."""
    targets = set(re.findall(r"^([\w-]+):", (pages.ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    cases, seen = {case.name for case in CASES}, set()
    for page in pages.PAGES:
        for line in (*pages.commands(page), *pages.named_commands(page)):
            words = shlex.split(line)
            seen |= {words[0], " ".join(words[:2])}
            if words[0] == "make":
                assert words[1] in targets, f"{page}: {line}"
            elif words[:2] == ["python", "-m"]:
                assert importlib.util.find_spec(words[2]) is not None, f"{page}: {line}"
            elif words[:2] == ["mjx-arenas", "bench"]:
                named = {word for word in words[2:] if re.fullmatch(r"[a-z_]+", word)}
                assert named <= cases or words[2] in OTHERS, f"{page}: {line}"
            elif words[0] == "python":
                folders = pages.ROOT, (pages.ROOT / page).parent
                assert any((folder / words[1]).exists() for folder in folders), f"{page}: {line}"
    assert seen >= {"make", "python", "python -m", "mjx-arenas bench"}


def test_file(tmp_path):
    """The file that docs/files.md shows loads."""
    import mjx_arenas as mja

    ((shown, _),) = pages.blocks("docs/files.md", "yaml")
    (tmp_path / "robot.xml").write_text(ROBOT)
    (tmp_path / "arena.yaml").write_text(shown)
    arena, ranges = mja.load(tmp_path / "arena.yaml")
    assert arena.mounts
    assert arena.elements("damping") == ("arm_pan",)
    assert ranges.terms.keys() == {"rack.heights", "damping"}


def test_pictures():
    """Pictures of docs are shown somewhere, and are small."""
    shown = {path for page in pages.PAGES for path, _ in pages.links(page)}
    pictures = [*(pages.ROOT / "docs").rglob("*.png")]
    assert len(pictures) > 10
    for picture in pictures:
        assert str(pathlib.Path(picture).relative_to(pages.ROOT)) in shown, picture
        assert picture.stat().st_size < 1.5e6, picture


def test_films():
    """The gallery shows every film, by a picture that leads to it; the site plays it there."""
    films = [path.name for path in (pages.ROOT / "docs").glob("*.mp4")]
    hooks = pytest.importorskip("mkdocs") and runpy.run_path(str(pages.ROOT / "docs" / "hooks.py"))
    text = pages.text("docs/gallery.md")
    page = types.SimpleNamespace(file=types.SimpleNamespace(src_uri="gallery.md", url="gallery/"))
    played = hooks["on_page_markdown"](text, page, types.SimpleNamespace(src_uris={}))
    assert films
    for film in films:
        assert re.search(rf"\[!\[[^\[\]]+\]\(\w+\.png\)\]\({film}\)", text), film
        assert re.search(rf'<video [^<>]*src="\.\./{film}"[^<>]*poster="\.\./\w+\.png"', played), film


def test_reference_as_files():
    """Pages that only the site fills say so where they are read as files, and not on the site."""
    hooks = pytest.importorskip("mkdocs") and runpy.run_path(str(pages.ROOT / "docs" / "hooks.py"))
    unfilled = [page for page in pages.PAGES if "\n::: " in pages.text(page)]
    assert len(unfilled) == 8
    for page in unfilled:
        at = types.SimpleNamespace(file=types.SimpleNamespace(src_uri=page.removeprefix("docs/"), url=""))
        shown = hooks["on_page_markdown"](pages.text(page), at, types.SimpleNamespace(src_uris={}))
        assert len(hooks["UNFILLED"].findall(pages.text(page))) == 1, page
        assert "as a file" not in shown, page
