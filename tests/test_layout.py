"""The folders show the flow: imports point one way, and nothing is too large to see."""

import ast
import collections
import pathlib

import pytest

ROOT = pathlib.Path(__file__).parent.parent
PACKAGE = ROOT / "mjx_arenas"
FLOW = [
    *(
        "brax_bridge",
        "content",
        "extras",
        "geometry",
        "gpu",
        "caches",
        "robosuite",
        "named",
        "problem",
        "progress",
        "rows",
        "scales",
        "primitives",
        "shapes",
        "strict",
    ),
    *("quaternions", "bounds", "solids"),
    *(
        "params",
        "problems",
        "spec",
        "furniture",
        "sample",
        "rules",
        "terms",
        "dr",
        "textures",
        "build",
        "robots",
        "write",
        "record",
        "sim",
        "twin",
        "pixels",
    ),
    *("compiled", "drawn", "varied", "arena", "table_arenas", "world"),
    *("settings", "files", "viz", "preflight", "checks", "envs", "cli"),
    *("demo", "trained", "policies", "stages", "judged", "train", "__main__"),
]
"""Folders, and modules beside them, each of which imports from those before it alone (`shapes` from `geometry`)."""
BACK = {("compiled", "viz.shown")}
"""The methods with which an arena shows itself stand with what shows worlds; they take records, and know no arena."""


def modules():
    """Each module's tree, by its dotted name below the package."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        name = ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")
        found[name] = ast.parse(path.read_text())
    return found


def imports(trees):
    """Pairs of modules of which the first imports the second when it is imported itself."""
    for name, tree in trees.items():
        for node in tree.body:
            if isinstance(node, ast.ImportFrom) and node.module and node.module.partition(".")[0] == "mjx_arenas":
                base = node.module.removeprefix("mjx_arenas").lstrip(".")
                for alias in node.names:
                    whole = f"{base}.{alias.name}" if base else alias.name
                    yield name, whole if whole in trees else base


def test_no_circle_of_imports():
    """No module imports itself, by whatever way round."""
    reach = collections.defaultdict(set)
    for a, b in imports(modules()):
        reach[a].add(b)
    done, path = set(), []

    def visit(name):
        assert name not in path, " -> ".join([*path[path.index(name) :], name])
        if name not in done:
            path.append(name)
            for other in sorted(reach[name]):
                visit(other)
            path.pop()
            done.add(name)

    for name in list(reach):
        visit(name)
    assert len(done) > 90


def test_folders_show_the_flow():
    """A folder, or a module beside the folders, imports from those that come before it, and no two from each other."""
    trees = modules()
    place = {name: FLOW.index(name.partition(".")[0]) for name in trees if name != "__init__"}
    assert set(place.values()) == set(range(len(FLOW)))
    assert {(a, b) for a, b in imports(trees) if b and place[a] < place[b]} == BACK


def sizes(kind):
    """Lines of each class or function of the package, by file and name."""
    return {
        f"{name}.{node.name}": node.end_lineno - node.lineno + 1
        for name, tree in modules().items()
        for node in ast.walk(tree)
        if isinstance(node, kind)
    }


@pytest.mark.parametrize(("folder", "most"), [("mjx_arenas", 400), ("tests", 600), ("benchmarks", 400)])
def test_no_large_file(folder, most):
    """Nor class, nor hardly a function."""
    lines = {str(p.relative_to(ROOT)): p.read_text().count("\n") for p in (ROOT / folder).rglob("*.py")}
    assert {name: n for name, n in lines.items() if n > most} == {}


def test_no_large_class_and_few_large_functions():
    """No class over 300 lines; a function over 60 is one of few, whose argument parser or loop is one thing."""
    assert {name for name, n in sizes(ast.ClassDef).items() if n > 300} == set()
    large = {name for name, n in sizes((ast.FunctionDef, ast.AsyncFunctionDef)).items() if n > 60}
    assert large <= {"sample.packing.pack", "viz.film.c_video", "checks.failures.check"}
