"""Text of files, YAML or JSON, and the plain data in it (host)."""

import io
import json
import pathlib
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

from mjx_arenas.spec import specs

COLUMNS = 90  # of what stands on one line

Path: TypeAlias = tuple[str | int, ...]  # of keys and indices


def dotted(at: Path) -> str:
    """A path as problems say it: "arena.objects[1].name"."""
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in at).removeprefix(".")


class Parsed(NamedTuple):
    """What a file holds."""

    data: Any
    lines: dict[Path, int | None]
    """The line of everything in it; JSON has none."""
    twice: list[Path]
    """Keys that are there twice, without what stands in them."""


def read(file: pathlib.Path) -> str:
    """The text of a file.

    Raises:
        ValueError: it is none.
        OSError: it cannot be read.
    """
    try:
        return file.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ValueError(f"{file}: not a text file in UTF-8.") from None


def parse(text: str, file: pathlib.Path) -> Parsed:
    """The data in the text of a file.

    Raises:
        ValueError: one sentence with the line and the column.
        ImportError: YAML needs `ruamel.yaml`.
    """
    return _parse_json(text, file) if file.suffix == ".json" else _parse_yaml(text, file)


def dump(data: Any, file: pathlib.Path) -> str:
    """The text of a file, with what is short on one line."""
    return _json(data) + "\n" if file.suffix == ".json" else _yaml(data)


def _parse_json(text: str, file: pathlib.Path) -> Parsed:
    try:
        data = json.loads(text, object_pairs_hook=_Pairs)
    except json.JSONDecodeError as error:
        raise ValueError(f"{file}:{error.lineno}:{error.colno}: not JSON: {error.msg}.") from None
    lines: dict[Path, int | None] = {}
    twice: list[Path] = []

    def walk(value: Any, at: Path) -> Any:
        lines[at] = None
        if isinstance(value, _Pairs):
            twice.extend(_twice([key for key, _ in value], at))
            return {key: walk(item, (*at, key)) for key, item in value}
        return [walk(item, (*at, i)) for i, item in enumerate(value)] if isinstance(value, list) else value

    return Parsed(walk(data, ()), lines, twice)


def _twice(keys: Sequence[str], at: Path) -> list[Path]:
    """The paths of keys that one mapping has more than once."""
    return [(*at, key) for key, n in Counter(keys).items() if n > 1]


class _Pairs(list):
    """The keys and values of a JSON object, those too that are there twice."""


def _parse_yaml(text: str, file: pathlib.Path) -> Parsed:
    ruamel = _ruamel()
    yaml, nodes = ruamel.YAML(typ="safe", pure=True), ruamel.nodes
    lines: dict[Path, int | None] = {}
    twice: list[Path] = []
    within: list[int] = []

    def walk(node: Any, at: Path, line: int) -> Any:
        lines[at] = line + 1
        if isinstance(node, nodes.ScalarNode):
            try:
                return yaml.constructor.construct_object(node)
            except (ValueError, KeyError, AttributeError, OverflowError):
                what = f"{node.value!r} is no {node.tag.rpartition(':')[2]}: put it in quotes if it is text"
                raise ValueError(f"{file}:{line + 1}: {what}.") from None
        if id(node) in within:
            raise ValueError(f"{file}:{line + 1}: an alias stands in what it names.")
        within.append(id(node))
        if isinstance(node, nodes.MappingNode):
            keys = [key.value if isinstance(key, nodes.ScalarNode) else "[...]" for key, _ in node.value]
            twice.extend(_twice(keys, at))
            found: Any = {
                key: walk(item, (*at, key), name.start_mark.line)
                for key, (name, item) in zip(keys, node.value, strict=True)
            }
        else:
            found = [walk(item, (*at, i), item.start_mark.line) for i, item in enumerate(node.value)]
        within.pop()
        return found

    try:
        root = yaml.compose(text)
        return Parsed(None if root is None else walk(root, (), root.start_mark.line), lines, twice)
    except ruamel.error.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        what = ", ".join(part for part in (error.context, error.problem) if part)
        raise ValueError(f"{file}{place}: not YAML: {what}.") from None
    except ruamel.error.YAMLError as error:
        raise ValueError(f"{file}: not YAML: {specs.one_line(error)}.") from None


def _ruamel() -> Any:
    try:
        import ruamel.yaml

        return ruamel.yaml
    except ImportError:
        raise ImportError("YAML needs ruamel.yaml: pip install 'mjx_arenas[cli]', or use .json.") from None


def _yaml(data: Any) -> str:
    yaml, stream = _ruamel().YAML(), io.StringIO()
    yaml.width = 2 * COLUMNS
    yaml.indent(mapping=2, sequence=4, offset=2)
    yaml.dump(_laid_out(data), stream)
    return stream.getvalue()


def _laid_out(data: Any, depth: int = 0) -> Any:
    """The data as YAML lays them out: what is short on one line, MJCF text as lines."""
    from ruamel.yaml import comments, scalarstring

    if isinstance(data, str) and "\n" in data:
        return scalarstring.LiteralScalarString(data)
    if not isinstance(data, (dict, list)):
        return data
    if isinstance(data, dict):
        node: Any = comments.CommentedMap({key: _laid_out(item, depth + 1) for key, item in data.items()})
    else:
        node = comments.CommentedSeq(_laid_out(item, depth + 1) for item in data)
    if depth > 1 and _is_short(data):
        node.fa.set_flow_style()
    return node


def _json(data: Any, indent: str = "\n") -> str:
    """JSON with what is short on one line."""
    if not isinstance(data, (dict, list)) or _is_short(data):
        return json.dumps(data)
    deeper = indent + "  "
    if isinstance(data, dict):
        return (
            f"{{{deeper}{f',{deeper}'.join(f'{json.dumps(k)}: {_json(v, deeper)}' for k, v in data.items())}{indent}}}"
        )
    return f"[{deeper}{f',{deeper}'.join(_json(item, deeper) for item in data)}{indent}]"


def _is_short(data: Any) -> bool:
    return len(json.dumps(data)) <= COLUMNS
