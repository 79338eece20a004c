"""How a package is built, counted from its source: `python tests/structure.py [--draw PICTURE] [FOLDER ...]`, of clones."""

import ast
import pathlib
import sys

ROOT = pathlib.Path(__file__).parent.parent
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
FOREIGN = {
    "_impl",  # MJX's fields of one implementation
    *("_BATCH_DIM", "_numeric"),  # of mujoco_warp and MJX, where nothing public tells
    "_config",  # of environments of Playground, which has no public one
    *("_mjPRIVATE__get_xml_precision", "_mjPRIVATE__set_xml_precision"),
    *("_exit", "_getframe"),  # Python's, documented
    *("_replace", "_asdict", "_fields"),  # of named tuples, documented
}
"""Private names of other libraries that are used all the same."""


def modules(root=ROOT):
    """Each module's tree, by its dotted name below the package."""
    package, found = root / "mjx_arenas", {}
    for path in sorted(package.rglob("*.py")):
        name = ".".join(path.relative_to(package).with_suffix("").parts).removesuffix(".__init__")
        found[name] = ast.parse(path.read_text())
    return found


def lines(folder):
    """Of each file below a folder, by its path there."""
    return {str(path.relative_to(folder)): path.read_text().count("\n") for path in sorted(folder.rglob("*.py"))}


def imports(trees, later=False):
    """Pairs of modules of which the first imports the second when it is imported itself, or, with `later`, when it is used, too."""
    for name, tree in trees.items():
        for node in ast.walk(tree) if later else tree.body:
            if isinstance(node, ast.ImportFrom) and node.module and node.module.partition(".")[0] == "mjx_arenas":
                base = node.module.removeprefix("mjx_arenas").lstrip(".")
                for alias in node.names:
                    whole = f"{base}.{alias.name}" if base else alias.name
                    yield name, whole if whole in trees else base


def reached(trees, imported):
    """By module, all that it imports, by whatever way round; of pairs as `imports` gives them."""
    direct = {name: set() for name in trees}
    for a, b in imported:
        if b and b in trees:  # not the package itself, which imports all
            direct[a].add(b)

    def of(name):
        found, ahead = set(), list(direct[name])
        while ahead:
            one = ahead.pop()
            if one not in found:
                found.add(one)
                ahead += direct[one]
        return found

    return {name: of(name) for name in trees}


def in_circles(trees):
    """Modules that import themselves, by whatever way round, in their functions, too."""
    return {name for name, found in reached(trees, imports(trees, later=True)).items() if name in found}


def sizes(trees, kind):
    """Lines of each class or function, by module and name."""
    return {
        f"{name}.{node.name}": node.end_lineno - node.lineno + 1
        for name, tree in trees.items()
        for node in ast.walk(tree)
        if isinstance(node, kind)
    }


def private(trees):
    """(module, name): names that begin with an underscore and are another module's."""
    seen = set()
    for name, tree in trees.items():
        nodes = list(ast.walk(tree))
        own = {node.name for node in nodes if isinstance(node, (*FUNCTIONS, ast.ClassDef))}
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
        seen |= {(name, one) for one in names - FOREIGN if one.startswith("_") and not one.startswith("__")}
    return seen


def table(root):
    """Rows of what is counted: what, and the number."""
    trees = modules(root)
    each, classes, functions = lines(root / "mjx_arenas"), sizes(trees, ast.ClassDef), sizes(trees, FUNCTIONS)
    tests = lines(root / "tests")

    def longest(of):
        name = max(of, key=of.__getitem__)
        return f"{of[name]:,} (`{name if name.endswith('.py') else name.rpartition('.')[-1]}`)"

    return {
        "modules": len(each),
        "lines": sum(each.values()),
        "lines of a module, on average": round(sum(each.values()) / len(each)),
        "longest module": longest(each),
        "longest class": longest(classes),
        "longest function": longest(functions),
        "modules over 400 lines": sum(n > 400 for n in each.values()),
        "classes over 300 lines": sum(n > 300 for n in classes.values()),
        "functions over 60 lines": sum(n > 60 for n in functions.values()),
        "modules in a circle of imports": len(in_circles(trees)),
        "private names of other modules in use": len(private(trees)),
        "files of tests": len(tests),
        "lines of tests": sum(tests.values()),
        "longest file of tests": longest(tests),
    }


def flow(trees):
    """Modules so that each comes after what it imports, where that can be, and those of a folder are side by side."""
    pairs, folders = set(imports(trees)), {name: name.partition(".")[0] for name in trees}
    within = reached(trees, pairs)
    of = reached(set(folders.values()), {(folders[a], b.partition(".")[0]) for a, b in pairs if b})
    return sorted(
        trees, key=lambda name: (len(of[folders[name]] - {folders[name]}), folders[name], len(within[name]), name)
    )


def draw(picture, roots):
    """A dot for each import of packages side by side: red in a circle, orange against the flow and in a function, blue else."""
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, len(roots), figsize=(7.5 * len(roots), 7.2), layout="constrained", squeeze=False)
    for root, one in zip(roots, axes[0], strict=True):
        trees = modules(root)
        del trees["__init__"]  # which imports all
        names, circles = flow(trees), in_circles(trees)
        at = {name: i for i, name in enumerate(names)}
        dots = {"tab:blue": set(), "tab:orange": set(), "tab:red": set()}
        for pair in {(a, b) for a, b in imports(trees, later=True) if b in trees and b != a}:
            back = "tab:orange" if at[pair[0]] < at[pair[1]] else "tab:blue"
            dots["tab:red" if circles.issuperset(pair) else back].add(pair)
        for colour, pairs in dots.items():
            one.scatter([at[b] for _, b in pairs], [at[a] for a, _ in pairs], s=900 / len(names), color=colour, lw=0)
        folders = [name.partition(".")[0] for name in names]
        for folder in dict.fromkeys(folders):
            first, size = folders.index(folder), folders.count(folder)
            if size > 1:
                one.add_patch(plt.Rectangle((first - 0.5, first - 0.5), size, size, fill=False, lw=0.5))
            if size > len(names) / 60:
                one.text(first + size, first + size / 2, folder, va="center", fontsize=8)
        one.set(xlim=(-1, 1.09 * len(names)), ylim=(1.02 * len(names), -1), aspect="equal", xticks=[], yticks=[])
        blue, orange, red = map(len, dots.values())
        one.set_xlabel(f"imported; {len(names)} modules, {blue + orange + red:,} imports: {red} red, {orange} orange")
        one.set_ylabel("importing")
    figure.savefig(picture, dpi=90)


if __name__ == "__main__":
    arguments = sys.argv[1:]
    picture = arguments.pop(1) if arguments[:1] == ["--draw"] else None
    roots = [pathlib.Path(folder) for folder in arguments[picture is not None :] or [ROOT]]
    if picture:
        draw(picture, roots)
    columns = [table(root) for root in roots]
    for what in columns[0]:
        print(
            "|",
            " | ".join([what, *(f"{one[what]:,}" if isinstance(one[what], int) else one[what] for one in columns)]),
            "|",
        )
