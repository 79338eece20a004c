"""The folders show the flow: imports point one way, and nothing is too large to see."""

import ast
import collections
import importlib.util
import re
import string

import pytest
import structure

from mjx_arenas.problems.sentences import GENERAL, SENTENCES, TABLES, WARNINGS

TREES = structure.modules()
FLOW = [
    *(
        "content",
        "extras",
        "brax_bridge",
        "geometry",
        "gpu",
        "caches",
        "keywords",
        "robosuite",
        "named",
        "parser",
        "problem",
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
        "progress",
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
    *("demo", "trained", "checkpoints", "policies", "stages", "judged", "train", "__main__"),
]
"""Folders, and modules beside them, each of which imports from those before it alone (`shapes` from `geometry`)."""
BACK = {("compiled", "viz.shown")}
"""The methods with which an arena shows itself stand with what shows worlds; they take records, and know no arena."""


def test_no_circle_of_imports():
    """No module imports itself, by whatever way round, not in its functions either."""
    assert structure.in_circles(TREES) == set()
    assert len(set(structure.imports(TREES, later=True))) > 500


def test_circles_are_found():
    """Two modules of which each imports the other, one of them in a function."""
    a = ast.parse("from mjx_arenas.b import x")
    b = ast.parse("def f():\n    from mjx_arenas import a")
    assert structure.in_circles({"a": a, "b": b, "c": a}) == {"a", "b"}


def test_folders_show_the_flow():
    """A folder, or a module beside the folders, imports from those that come before it, and no two from each other."""
    place = {name: FLOW.index(name.partition(".")[0]) for name in TREES if name != "__init__"}
    assert set(place.values()) == set(range(len(FLOW)))
    assert {(a, b) for a, b in structure.imports(TREES) if b and place[a] < place[b]} == BACK


def test_arms_know_no_tasks():
    """Tasks are made of arms, and environments of neither."""
    order = ("envs.tasks", "envs.arms", "envs")
    place = {name: next((i for i, folder in enumerate(order) if name.startswith(folder)), None) for name in TREES}
    pairs = [(a, b) for a, b in structure.imports(TREES, later=True) if place[a] is not None is not place.get(b)]
    assert len(pairs) > 50
    assert {(a, b) for a, b in pairs if place[a] > place[b]} == set()


@pytest.mark.parametrize(("folder", "most"), [("mjx_arenas", 400), ("tests", 600), ("benchmarks", 400)])
def test_no_large_file(folder, most):
    """Neither of the package, nor of the tests and benchmarks."""
    lines = structure.lines(structure.ROOT / folder)
    assert len(lines) > 10
    assert {name: n for name, n in lines.items() if n > most} == {}


def test_no_large_class_nor_function():
    """No class over 300 lines, no function over 60."""
    classes, functions = (structure.sizes(TREES, kind) for kind in (ast.ClassDef, structure.FUNCTIONS))
    assert {name for name, n in classes.items() if n > 300} == set()
    assert {name for name, n in functions.items() if n > 60} == set()
    assert len(classes) > 100 < len(functions)


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


def in_words():
    """(module, text): errors that are raised with words of their own, but those of click, which begin with the option."""
    texts = [(name, text) for name, tree in TREES.items() if not name.startswith("cli") for text in raised(tree)]
    return [
        (name, text) for name, text in texts if " " in text
    ]  # and not the argument of a function that makes the error


def test_what_must_be_is_data():
    """An error that says what must be and what came is a problem, and its sentence in `problems`.

    Only what `problems` itself imports, and so cannot import it, says so in words.
    """
    before = FLOW[: FLOW.index("problems")]
    wrong = [(name, text) for name, text in in_words() if "must be" in text and "got" in text]
    assert {name for name, _ in wrong} <= {"params.distribution", "params.params"}
    assert {name.partition(".")[0] for name, _ in wrong} <= {*before}
    assert len([text for name, text in in_words() if name.partition(".")[0] not in before]) <= 31


def test_sentences_stand_once():
    """Warnings come from `problems.messages` alone, no rule has two sentences, and errors in words say what no other and no rule says."""
    texts, warners = collections.Counter(wording(text) for _, text in in_words()), set()
    for name, tree in TREES.items():
        calls = (node for node in ast.walk(tree) if isinstance(node, ast.Call))
        warners |= {name for call in calls if ast.unparse(call.func) == "warnings.warn"}
    assert len(texts) > 20
    assert len(SENTENCES) == sum(map(len, TABLES)) > 500
    assert warners == {"problems.messages"}
    assert {text for text, n in texts.items() if n > 1} == set()
    assert texts.keys() & {wording(re.sub(r"\{\w+[^}]*\}", "{}", text)) for text in SENTENCES.values()} == set()


GIVEN = {"path", "at", "owner", "label", "Label", "got", "got_shape", "or_none", "later", "near"}
"""Fields that every sentence has."""
OF_QUANTITY = {"must", "finite", "between", "one"}
LATER = {"dist"}
"""Numbers that `under` adds."""


def named(call):
    """Numbers that a call of `problem` gives by name; None: it does not say which."""
    names = {keyword.arg for keyword in call.keywords}
    if len(call.args) > 4 and isinstance(call.args[4], ast.Dict):
        names |= {key.value if isinstance(key, ast.Constant) else None for key in call.args[4].keys}
    unsaid = None in names or "numbers" in names or (len(call.args) > 4 and not isinstance(call.args[4], ast.Dict))
    return None if unsaid else names | (OF_QUANTITY if "quantity" in names else set())


def test_sentences_get_their_numbers():
    """A problem has a rule that there is, and the numbers of its sentence; and the modules of words have no rule that nobody breaks."""
    said, wrong, n = set(), [], 0
    for name, tree in TREES.items():
        for node in ast.walk(tree) if not name.startswith("problems.") else ():
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                said.add(node.value)
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("problem", "Problem") and len(node.args) > 1:
                rule, names = node.args[1], named(node)
                if isinstance(rule, ast.Constant) and names is not None:
                    n += 1
                    fields = {field for _, field, _, _ in string.Formatter().parse(SENTENCES[rule.value]) if field}
                    wrong += [(name, rule.value)] if fields - GIVEN - LATER - names else []
    assert n > 400
    assert wrong == []
    assert {rule for table in TABLES if table not in (GENERAL, WARNINGS) for rule in table} - said == set()


def test_no_private_members_of_others():
    """A name that begins with an underscore is used in its own module alone, and imported by none."""
    assert structure.private(TREES) == set()
    assert structure.private({"a": ast.parse("from mjx_arenas.b import _x\ny._z\nself._w")}) == {
        ("a", "_x"),
        ("a", "_z"),
    }


def modules_of(tree):
    """The package's own modules that another imports, by their names there."""
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("mjx_arenas"):
            for alias in node.names:
                if importlib.util.find_spec(node.module).submodule_search_locations is not None:
                    name = f"{node.module}.{alias.name}"
                    if importlib.util.find_spec(name) is not None:
                        found[alias.asname or alias.name] = importlib.import_module(name)
    return found


def test_what_modules_are_asked_for_is_there():
    """`module.name` of the package's own modules; pyright is told not to look, as mujoco has no stubs."""
    pytest.importorskip("mujoco_playground")
    asked, missing = 0, []
    for name, tree in TREES.items():
        modules = modules_of(tree)
        stored = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
        stored |= {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                module = modules.get(node.value.id) if node.value.id not in stored else None
                asked += module is not None
                if module is not None and not hasattr(module, node.attr):
                    missing.append(f"{name}: {node.value.id}.{node.attr}")
    assert missing == []
    assert asked > 1000
