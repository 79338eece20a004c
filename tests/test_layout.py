"""The folders show the flow: imports point one way, and nothing is too large to see."""

import ast
import collections
import pathlib
import re

import pytest

from mjx_arenas.problems.sentences import SENTENCES

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
        "keywords",
        "robosuite",
        "named",
        "parser",
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


def imports(trees, later=False):
    """Pairs of modules of which the first imports the second when it is imported itself, or, with `later`, when it is used, too."""
    for name, tree in trees.items():
        for node in ast.walk(tree) if later else tree.body:
            if isinstance(node, ast.ImportFrom) and node.module and node.module.partition(".")[0] == "mjx_arenas":
                base = node.module.removeprefix("mjx_arenas").lstrip(".")
                for alias in node.names:
                    whole = f"{base}.{alias.name}" if base else alias.name
                    yield name, whole if whole in trees else base


def test_no_circle_of_imports():
    """No module imports itself, by whatever way round, not in its functions either."""
    reach = collections.defaultdict(set)
    for a, b in imports(modules(), later=True):
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
    """Neither of the package, nor of the tests and benchmarks."""
    lines = {str(p.relative_to(ROOT)): p.read_text().count("\n") for p in (ROOT / folder).rglob("*.py")}
    assert {name: n for name, n in lines.items() if n > most} == {}


def test_no_large_class_nor_function():
    """No class over 300 lines, no function over 60."""
    assert {name for name, n in sizes(ast.ClassDef).items() if n > 300} == set()
    assert {name for name, n in sizes((ast.FunctionDef, ast.AsyncFunctionDef)).items() if n > 60} == set()


def wording(text):
    """A text without the name of the argument that it begins with."""
    return re.sub(r"^`[^`]*`", "{}", text)


def raised(tree):
    """Texts of the errors that are raised with words of their own, `{}` for what is put into them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and node.exc.args:
            text = node.exc.args[0]
            if isinstance(text, ast.JoinedStr):
                yield "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in text.values)
            elif isinstance(text, ast.Constant) and isinstance(text.value, str):
                yield text.value


def test_sentences_stand_once():
    """Warnings come from `problems.messages` alone, and an error that is raised in words says what no other and no rule says."""
    texts, warners = collections.Counter(), set()
    for name, tree in modules().items():
        calls = (node for node in ast.walk(tree) if isinstance(node, ast.Call))
        warners |= {name for call in calls if ast.unparse(call.func) == "warnings.warn"}
        if name.partition(".")[0] != "cli":  # click's own errors begin with the option
            texts.update(map(wording, raised(tree)))
    assert len(texts) > 100
    assert warners == {"problems.messages"}
    assert {text for text, n in texts.items() if n > 1} == set()
    assert texts.keys() & {wording(re.sub(r"\{\w+[^}]*\}", "{}", text)) for text in SENTENCES.values()} == set()


FOREIGN = {
    "_impl",  # MJX's fields of one implementation
    *("_BATCH_DIM", "_numeric"),  # of mujoco_warp and MJX, where nothing public tells
    "_config",  # of environments of Playground, which has no public one
    *("_mjPRIVATE__get_xml_precision", "_mjPRIVATE__set_xml_precision"),
    *("_exit", "_getframe"),  # Python's, documented
}
"""Private names of other libraries that are used all the same."""


def test_no_private_members_of_others():
    """A name that begins with an underscore is used in its own module alone, and imported by none."""
    seen = set()
    for name, tree in modules().items():
        nodes = list(ast.walk(tree))
        own = {node.name for node in nodes if isinstance(node, ast.FunctionDef | ast.ClassDef)}
        used = [node for node in nodes if isinstance(node, ast.Attribute)]
        own |= {node.attr for node in used if ast.unparse(node.value) in ("self", "cls", "super()")}
        own |= {
            node.target.id for node in nodes if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
        }
        names = {node.attr for node in used} - own
        names |= {
            alias.name
            for node in nodes
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("mjx_arenas")
            for alias in node.names
        }
        private = {one for one in names if one.startswith("_") and not one.startswith("__")}
        seen |= {(name, one) for one in private - {"_replace", "_asdict", "_fields"} if one not in FOREIGN}
    assert seen == set()
