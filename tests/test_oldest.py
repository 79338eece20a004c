"""The lower bounds are those that are tested."""

import pathlib
import re
import tomllib

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
