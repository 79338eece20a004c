"""The reports in docs/upstream: their scripts print what they say."""

import contextlib
import importlib.metadata
import io
import pathlib
import re

import pytest

from mjx_arenas.viz import render

warp = pytest.importorskip("warp")

UPSTREAM = pathlib.Path(__file__).parent.parent / "docs" / "upstream"
REPORTS = re.findall(r"^\| \[\w+\]\((\w+)\.md\)", (UPSTREAM / "README.md").read_text(), re.MULTILINE)
ON_GPU = {name for name in REPORTS if ", on an NVIDIA GPU" in (UPSTREAM / f"{name}.md").read_text()}
REPORT = r"^Versions: (.*?), on a CPU.*^```python\n(.*?)^```.*?^```text\n(.*?)^```"


def release(version):
    return tuple(int(number) for number in re.findall(r"\d+", version)[:3])


def rounded(text):
    """Words, their numbers to two significant digits."""
    return re.sub(r"-?\d+\.?\d*(e[-+]?\d+)?", lambda number: f"{float(number[0]) + 0.0:.2g}", text).split()


def test_listed():
    """In the folder's table, on the site, and as many as the changelog counts."""
    assert sorted(REPORTS) == sorted(path.stem for path in UPSTREAM.glob("*.md") if "```python" in path.read_text())
    root = UPSTREAM.parent.parent
    assert [name for name in REPORTS if f"- upstream/{name}.md\n" not in (root / "mkdocs.yml").read_text()] == []
    assert f"docs/upstream: {len(REPORTS)} reports with scripts." in (root / "CHANGELOG.md").read_text()


@pytest.mark.xslow
@pytest.mark.parametrize("name", [name for name in REPORTS if name not in ON_GPU])
def test_output(name, monkeypatch):
    """A report that upstream has answered fails here; nothing is said of versions older than its own."""
    versions, code, expected = re.search(
        REPORT, (UPSTREAM / f"{name}.md").read_text(), re.DOTALL | re.MULTILINE
    ).groups()
    for package, version in (words.split() for words in versions.split(", ")):
        if release(importlib.metadata.version(package)) < release(version):
            pytest.skip(f"of {package} {version}")
    if "mujoco.Renderer" in code and render.choose_gl() is None:
        pytest.skip("no GL")
    monkeypatch.setattr(warp.config, "log_level", warp.LOG_WARNING)
    if "compile_aot_module" in code:
        monkeypatch.setattr(warp.config, "optimization_level", None)  # as users have it
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(code, f"{name}.md", "exec"), {})
    assert rounded(printed.getvalue()) == rounded(expected)
