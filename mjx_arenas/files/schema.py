"""What a file says as calls, and calls as what a file says (host).

The signatures of the constructors and methods (`calls.parameters`) are the schema.
"""

import difflib
import functools
import json
import os
import pathlib
import re
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from mjx_arenas import calls, specs, validation
from mjx_arenas.arena import Arena
from mjx_arenas.calls import Call, Made
from mjx_arenas.files.text import Path
from mjx_arenas.objects import Object
from mjx_arenas.params import ArenaRanges
from mjx_arenas.table_arenas import MultiTableArena, TableArena

_CONSTRUCTORS: dict[str, Callable] = {f.__qualname__: f for f in (MultiTableArena, TableArena, Arena.from_xml)}
_METHODS: dict[str, Callable] = {f.__name__: f for f in (Arena.attach, Arena.merge)}


class Reader:
    """Makes the objects that a file describes, and collects its problems."""

    def __init__(self, file: pathlib.Path, lines: dict[Path, int | None]) -> None:
        self.file_path, self.lines = file, lines
        self.problems: list[str] = []
        self.warnings: list[str] = []
        self.objects: dict[tuple[Path, str], Path] = {}  # where each stands, by its arena and its name

    def sentence(self, at: Path, what: str) -> str:
        """About what stands at a path, with its line."""
        known = at
        while known and self.lines.get(known) is None:
            known = known[:-1]
        line = f":{self.lines[known]}" if at and self.lines.get(known) else ""
        return f"{self.file_path}{line}: " + (f"`{_dotted(at)}`{what}" if at else what)

    def problem(self, at: Path, what: str) -> None:
        self.problems.append(self.sentence(at, what))

    def file(self, data: Any) -> tuple[Arena | None, ArenaRanges | None]:
        if not isinstance(data, dict):
            empty = "it is empty, and " if data is None else ""
            self.problem((), f"{empty}it must have `arena` and `ranges`, by name.")
            return None, None
        self.check_keys(data, (), ("arena", "ranges"), "a part of a file")
        if "arena" not in data:
            self.problem((), "`arena` is missing.")
        arena = self.arena(data["arena"], ("arena",)) if "arena" in data else None
        ranges = self.ranges({} if data.get("ranges") is None else data["ranges"])
        if arena is not None and ranges is not None:
            self.run((), lambda: arena.check_ranges(ranges))
        return arena, ranges

    def arena(self, node: Any, at: Path) -> Arena | None:
        if not isinstance(node, dict) or "type" not in node:
            self.problem(at, f" has no `type`{_nearest('', _CONSTRUCTORS)}")
            return None
        name = node["type"]
        if not isinstance(name, str) or name not in _CONSTRUCTORS:
            self.problem((*at, "type"), f": {name!r} is unknown{_nearest(str(name), _CONSTRUCTORS)}")
            return None
        given = {key: value for key, value in node.items() if key not in ("type", "then")}
        arguments = self.arguments(_CONSTRUCTORS[name], given, at, name, ("type", "then"))
        changes = self.changes([] if node.get("then") is None else node["then"], (*at, "then"))
        if arguments is None or changes is None:
            return None
        arena = self.run(at, lambda: _CONSTRUCTORS[name](**arguments))
        for where, method, given in changes:
            if arena is not None:  # `attach` changes it, `merge` gives another
                arena = self.run(where, functools.partial(_change, arena, method, given))
        return arena

    def changes(self, node: Any, at: Path) -> list[tuple[Path, Callable, dict[str, Any]]] | None:
        """The calls of methods that follow."""
        if not isinstance(node, list):
            self.problem(at, f" must be a list of {' and '.join(_METHODS)}, got {_shown(node)}.")
            return None
        found = []
        for i, item in enumerate(node):
            name = self.name(item, (*at, i), _METHODS, "method")
            if name is None:
                continue
            arguments = self.arguments(_METHODS[name], item[name], (*at, i, name), name)
            if arguments is not None:
                found.append(((*at, i, name), _METHODS[name], arguments))
        return found if len(found) == len(node) else None

    def ranges(self, node: Any) -> ArenaRanges | None:
        if not isinstance(node, dict):
            self.problem(("ranges",), f" must be quantities, by name, got {_shown(node)}.")
            return None
        arguments = self.arguments(ArenaRanges, node, ("ranges",), "ArenaRanges")
        return None if arguments is None else ArenaRanges(**arguments)

    def arguments(
        self, function: Callable, node: Any, at: Path, name: str, beside: Sequence[str] = ()
    ) -> dict[str, Any] | None:
        """The arguments of a call; None if something is wrong with them."""
        known = calls.parameters(function)
        required = [key for key, parameter in known.items() if parameter.required]
        if isinstance(node, dict):
            given = {key: ((*at, key), value) for key, value in node.items()}
        elif len(required) == 1 and node is not None:
            given = {required[0]: (at, node)}
        elif isinstance(node, list) and len(node) == len(required):
            given = {key: ((*at, i), value) for i, (key, value) in enumerate(zip(required, node, strict=True))}
        else:
            listed = f" [{', '.join(required)}]" if required else ""
            by_name = f"{{{', '.join(f'{key}: ...' for key in required or list(known)[:1])}}}"
            what = f"{listed} or {by_name}" if listed else f" {by_name}"
            self.problem(at, f" must be{what}, got {_shown(node)}.")
            return None
        before = len(self.problems)
        if isinstance(node, dict):
            self.check_keys(node, at, [*known, *beside], f"an argument of {name}")
            for key in required:
                if key not in given:
                    self.problem(at, f" lacks `{key}`.")
        found = {key: self.value(value, known[key], where) for key, (where, value) in given.items() if key in known}
        return found if len(self.problems) == before else None

    def check_keys(self, node: Mapping[str, Any], at: Path, known: Sequence[str], what: str) -> None:
        for key in node:
            if key not in known:
                self.problem((*at, key), f" is not {what}{_nearest(str(key), known)}")

    def value(self, node: Any, parameter: calls.Parameter, at: Path) -> Any:
        """An argument: an object of the class that the signature asks for, the path of a file, or as it is."""
        if node is None:
            self.problem(at, f" is null: give it a value{'' if parameter.required else ', or leave it out'}.")
            return None
        if parameter.is_path and isinstance(node, str) and not specs.is_mjcf(node):
            return os.path.join(self.file_path.parent.absolute(), node)
        made = [cls for cls in parameter.accepts if cls.__module__.startswith("mjx_arenas")]
        if not made and isinstance(node, dict):
            self.problem(at, f" must be a value or a list of values, got {_shown(node)}.")
        if not made:
            return node
        if parameter.is_list:
            if not isinstance(node, list):
                self.problem(at, f" must be a list, got {_shown(node)}.")
                return None
            return [self.instance(item, made[0], (*at, i)) for i, item in enumerate(node)]
        return self.instance(node, made[0], at)

    def instance(self, node: Any, cls: type, at: Path) -> Any:
        if cls is Arena:
            return self.arena(node, at)
        if cls is Object:
            arguments = self.arguments(cls, node, at, cls.__name__)
            if arguments is None:
                return None
            self.objects[at[:-2], repr(arguments["name"])] = at
            return Object(**arguments)
        kinds = {kind.__name__: kind for kind in cls.__subclasses__() or [cls]}
        name = self.name(node, at, kinds, cls.__name__.lower())
        if name is None:
            return None
        arguments = self.arguments(kinds[name], node[name], (*at, name), name)
        return None if arguments is None else self.run(at, lambda: kinds[name](**arguments))

    def name(self, node: Any, at: Path, known: Iterable[str], kind: str) -> str | None:
        """The name of a call, `{name: arguments}`."""
        example = next(iter(known))
        if not isinstance(node, dict) or len(node) != 1:
            self.problem(at, f" must be a {kind} such as {{{example}: ...}}, got {_shown(node)}.")
            return None
        (name,) = node
        if name not in known:
            meant = f", which is written {{{example}: ...}}." if len(list(known)) == 1 else _nearest(str(name), known)
            self.problem((*at, name), f" is not a {kind}{meant}")
            return None
        return name

    def run(self, at: Path, function: Callable[[], Any]) -> Any:
        """What a call gives; its errors become problems of the file, and its warnings speak of the file."""
        result, problems = None, []
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                result = function()
            except (ValueError, TypeError, OSError) as error:
                problems = validation.problems_of(error)
        self.problems += [self.placed(at, problem) for problem in problems]
        self.warnings += [self.placed(at, str(warning.message)) for warning in caught]
        return result

    def placed(self, at: Path, sentence: str) -> str:
        """A sentence of a constructor, with the line of the argument or of the object that it names."""
        sentence = _in_a_file(sentence)
        name = re.match(r"`([\w.]+)`", sentence)
        keys = tuple(name.group(1).split(".")) if name else ()
        if name and (*at, *keys) in self.lines:
            return self.sentence((*at, *keys), sentence[name.end() :])
        for quoted in re.findall(r"'.*?'", sentence):
            if (at, quoted) in self.objects:
                return self.sentence(self.objects[at, quoted], f": {sentence}")
        return self.sentence(at, f": {sentence}" if at else sentence)


def _change(arena: Arena, method: Callable, arguments: dict[str, Any]) -> Arena:
    return method(arena, **arguments) or arena


def _dotted(at: Path) -> str:
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in at).removeprefix(".")


def _nearest(name: str, known: Iterable[str]) -> str:
    """The end of a sentence about a wrong name."""
    close = difflib.get_close_matches(name, known, n=1)
    return f": did you mean `{close[0]}`?" if close else f"; known are {', '.join(known)}."


def _in_a_file(sentence: str) -> str:
    """A sentence about arguments in the words of a file, in which None is what is left out."""
    sentence = re.sub(r"must be None, (.*?), got", r"must be \1, or None, got", sentence)
    sentence = re.sub(r",? or None, got", ", or left out, got", sentence)
    words = {"None": "null", "True": "true", "False": "false"}
    return re.sub(rf"\b({'|'.join(words)})\b", lambda word: words[word.group()], sentence)


def _shown(node: Any) -> str:
    text = repr(node) if isinstance(node, str) else json.dumps(node, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."


class Writer:
    """Makes plain data of calls, and collects what cannot be written."""

    def __init__(self, file: pathlib.Path) -> None:
        self.folder = os.path.abspath(file.parent)
        self.problems: list[str] = []

    def arena(self, made: Sequence[Call], at: Path) -> dict[str, Any]:
        first, *others = made
        data = {"type": first.function.__qualname__, **self.arguments(first, at)}
        if others:
            data["then"] = [self.named(call, (*at, "then", i)) for i, call in enumerate(others)]
        return data

    def named(self, call: Call, at: Path) -> dict[str, Any]:
        """`{name: arguments}`; those that are required alone, where there are no others."""
        name = call.function.__name__
        arguments = self.arguments(call, (*at, name))
        required = [key for key, parameter in calls.parameters(call.function).items() if parameter.required]
        values = list(arguments.values())
        if list(arguments) != required or any(isinstance(value, dict) for value in values):
            return {name: arguments}
        return {name: values if len(values) > 1 else values[0]}

    def arguments(self, call: Call, at: Path) -> dict[str, Any]:
        known = calls.parameters(call.function)
        return {key: self.value(value, (*at, key), known[key].is_path) for key, value in call.arguments.items()}

    def value(self, value: Any, at: Path, is_path: bool = False) -> Any:
        if is_path and isinstance(value, str) and not specs.is_mjcf(value):
            return self.relative(value)
        if isinstance(value, Call):
            arguments = self.arguments(value, at)
            return arguments["name"] if list(arguments) == ["name"] else arguments  # an object of which no more is said
        if isinstance(value, Made):
            return self.arena(value, at)
        if isinstance(value, list):
            return [self.value(item, (*at, i)) for i, item in enumerate(value)]
        if value is None or isinstance(value, (bool, int, float, str)):
            return value
        what = f"a {type(value).__name__}, which a file cannot hold"
        self.problems.append(f"`{_dotted(at)}` is {what}: give numbers, or the path of a file.")
        return None

    def relative(self, path: str) -> str:
        """Relative to the file's folder, unless the two have nothing but the root in common."""
        common = os.path.commonpath([path, self.folder])
        return path if common == os.path.sep else os.path.relpath(path, self.folder)
