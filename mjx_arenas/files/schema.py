"""What a file says as calls (host); `writer` has the way back.

The signatures of the constructors and methods (`calls.parameters`) are the schema.
"""

import functools
import os
import pathlib
import types
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas import keywords
from mjx_arenas.arena import Arena
from mjx_arenas.dr import Term
from mjx_arenas.files.numbered import numbered
from mjx_arenas.files.text import Path, dotted
from mjx_arenas.furniture import Part
from mjx_arenas.params.distribution import Distribution
from mjx_arenas.params.params import ArenaRanges
from mjx_arenas.problem import Problem, Source
from mjx_arenas.problems import messages
from mjx_arenas.problems.messages import problems_of
from mjx_arenas.rules import validation
from mjx_arenas.rules.options import integer_problems, named_option
from mjx_arenas.spec import calls, specs
from mjx_arenas.spec.follow import Follow
from mjx_arenas.spec.objects import Object
from mjx_arenas.spec.place import Place
from mjx_arenas.table_arenas import MultiTableArena, TableArena

_CONSTRUCTORS: dict[str, Callable] = {f.__qualname__: f for f in (MultiTableArena, TableArena, Arena.from_xml)}
_METHODS: dict[str, Callable] = {
    f.__name__: f
    for f in (
        Arena.attach,
        Arena.add_camera,
        Arena.add_material,
        Arena.add_part,
        Arena.add_object,
        Arena.vary,
        Arena.merge,
    )
}
_BESIDE = ("type", "then", "options", "spec")
"""What a file says of an arena beside the arguments of its constructor."""


class Reader:
    """Makes the objects that a file describes, and collects its problems."""

    def __init__(
        self,
        file: pathlib.Path,
        lines: dict[Path, int | None],
        elsewhere: Mapping[str, str] = types.MappingProxyType({}),
    ) -> None:
        self.file_path, self.lines = file, lines
        self.elsewhere = elsewhere  # where files that the file names are now
        self.problems: list[Problem] = []
        self.warnings: list[Problem] = []
        self.objects: dict[tuple[Path, str], Path] = {}  # where each stands, by its arena and its name

    def source(self, at: Path, node: str = "") -> Source:
        """The place of something in the file: the line of the innermost part that has one."""
        known = at
        while known and self.lines.get(known) is None:
            known = known[:-1]
        return Source(str(self.file_path), self.lines[known] if known else None, node)

    def problem(self, at: Path, rule: str, got: object = None, **numbers: Any) -> None:
        """Adds a problem of what stands at a path."""
        self.problems.append(Problem(dotted(at), rule, None, got, numbers, source=self.source(at)))

    def file(self, data: Any) -> tuple[Arena | None, ArenaRanges | None]:
        if not isinstance(data, dict):
            self.problem((), "empty_file" if data is None else "no_parts")
            return None, None
        self.check_keys(data, (), ("arena", "ranges"), "a part of a file")
        if "arena" not in data:
            self.problems.append(Problem("arena", "part_missing", source=self.source(())))
        arena = self.arena(data["arena"], ("arena",)) if "arena" in data else None
        node = {} if data.get("ranges") is None else data["ranges"]
        ranges = self.ranges(node if arena is None else numbered(node, arena, self.unknown))
        if arena is not None and ranges is not None:
            self.run((), lambda: arena.check_ranges(ranges))
        return arena, ranges

    def unknown(self, at: Path, what: str, name: str, known: Sequence[str]) -> None:
        """Adds the problem of a name of something that the arena does not have."""
        self.problem(at, "node_name", name, what=what, nearest=_nearest(name, known))

    def arena(self, node: Any, at: Path) -> Arena | None:
        if not isinstance(node, dict) or "type" not in node:
            self.problem(at, "no_type", nearest=_nearest("", _CONSTRUCTORS))
            return None
        name = node["type"]
        if not isinstance(name, str) or name not in _CONSTRUCTORS:
            self.problem((*at, "type"), "type_unknown", name, nearest=_nearest(str(name), _CONSTRUCTORS))
            return None
        given = {key: value for key, value in node.items() if key not in _BESIDE}
        arguments = self.arguments(_CONSTRUCTORS[name], given, at, name, _BESIDE)
        changes = self.changes([] if node.get("then") is None else node["then"], (*at, "then"))
        options = self.options({} if node.get("options") is None else node["options"], (*at, "options"))
        if arguments is None or changes is None or options is None:
            return None
        arena = self.run(at, lambda: _CONSTRUCTORS[name](**arguments))
        for where, method, given in changes:
            if arena is not None:  # `attach` changes it, `merge` gives another
                arena = self.run(where, functools.partial(_change, arena, method, given))
        if arena is None:
            return None
        given = node.get("spec")
        if given is not None:
            path = os.path.join(self.file_path.parent.absolute(), given) if isinstance(given, str) else given
            arena.adopt_spec(self.run(at, lambda: specs.read(path, "spec")) or arena.spec)
        specs.assign(arena.spec.option, **options)
        return arena

    def options(self, node: Any, at: Path) -> dict[str, Any] | None:
        """Options of MuJoCo; None if something is wrong with them."""
        if not isinstance(node, dict):
            self.problem(at, "options_by_name", json=node)
            return None
        before, plain = len(self.problems), mujoco.MjSpec().option
        self.check_keys(node, at, specs.option_names(), "an option of MuJoCo")
        for name in [name for name in node if name in specs.option_names()]:
            default, value = getattr(plain, name), node[name]
            if np.ndim(default):
                found = validation.vector_problems(name, value, len(default), "")
            elif isinstance(default, int):
                node = {**node, name: named_option(name, value)}
                found = integer_problems(name, node[name])
            else:
                found = validation.vector_problems(name, value, 0, "")
            self.problems += [p._replace(path=dotted((*at, name)), source=self.source((*at, name))) for p in found]
        return node if len(self.problems) == before else None

    def changes(self, node: Any, at: Path) -> list[tuple[Path, Callable, dict[str, Any]]] | None:
        """The calls of methods that follow."""
        if not isinstance(node, list):
            self.problem(at, "call_list", names=[*list(_METHODS)[:-2], " and ".join(list(_METHODS)[-2:])], json=node)
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
            self.problem(("ranges",), "quantities", json=node)
            return None
        own = {name: value for name, value in node.items() if name != "terms"}
        for name in [name for name in own if "." in str(name)]:
            self.problem(("ranges", name), "node_of_terms")
            del own[name]
        arguments = self.arguments(ArenaRanges, own, ("ranges",), "ArenaRanges")
        terms = self.terms({} if node.get("terms") is None else node["terms"], ("ranges", "terms"))
        return None if arguments is None or terms is None else ArenaRanges(**arguments, terms=terms)

    def terms(self, node: Any, at: Path) -> dict[str, Any] | None:
        """The distributions of quantities of `arena.vary`."""
        if not isinstance(node, dict):
            self.problem(at, "quantities", json=node)
            return None
        found = {name: self.instance(value, Distribution, (*at, name)) for name, value in node.items()}
        return None if any(value is None for value in found.values()) else found

    def arguments(
        self, function: Callable, node: Any, at: Path, name: str, beside: Sequence[str] = ()
    ) -> dict[str, Any] | None:
        """The arguments of a call; None if something is wrong with them."""
        known = calls.parameters(function)
        more = calls.others(function)
        if more and isinstance(node, dict):
            known = known | {str(key): more[1] for key in node if key not in known}
        required = [key for key, parameter in known.items() if parameter.required]
        if isinstance(node, dict):
            given = {key: ((*at, key), value) for key, value in node.items()}
        elif len(required) == 1 and node is not None:
            given = {required[0]: (at, node)}
        elif isinstance(node, list) and len(node) == len(required):
            given = {key: ((*at, i), value) for i, (key, value) in enumerate(zip(required, node, strict=True))}
        else:
            if more and Term in more[1].accepts:
                self.problem(at, "terms_by_name", node)
                return None
            by_name = f"{{{', '.join(f'{key}: ...' for key in required or list(known)[:1])}}}"
            form = f"[{', '.join(required)}] or {by_name}" if required else by_name
            self.problem(at, "call_values", form=form, json=node)
            return None
        before = len(self.problems)
        if isinstance(node, dict) and not self.is_of_another_form(node, at, known, name):
            self.check_keys(node, at, [*known, *beside], f"an argument of {name}")
            for key in required:
                if key not in given:
                    self.problem(at, "node_lacks", name=key)
        found = {key: self.value(value, known[key], where) for key, (where, value) in given.items() if key in known}
        return found if len(self.problems) == before else None

    def is_of_another_form(self, node: Any, at: Path, known: Mapping[str, calls.Parameter], name: str) -> bool:
        """Adds the problem of arguments under the name of their class, or of a part under no argument's name."""
        key = next(iter(node)) if len(node) == 1 else None
        if key in known:
            return False
        if key == name:
            self.problem(at, "node_in_name", name=name)
            return True
        for argument, parameter in known.items():
            if key in {kind.__name__ for cls in parameter.accepts for kind in cls.__subclasses__()}:
                self.problem(at, "node_in_argument", name=argument, kind=key, json=node)
                return True
        for argument, parameter in known.items() if not known.keys() & node.keys() else ():
            kinds = [kind for cls in parameter.accepts if parameter.required for kind in (cls, *cls.__subclasses__())]
            for kind in kinds:
                if kind in (Object, *Part.__subclasses__()) and node and node.keys() <= calls.parameters(kind).keys():
                    first = "name" if kind is Object else kind.__name__
                    self.problem(at, "node_in_argument", name=argument, kind=first, json=node)
                    return True
        return False

    def check_keys(self, node: Mapping[str, Any], at: Path, known: Sequence[str], what: str) -> None:
        for key in node:
            if key not in known:
                self.problem((*at, key), "node_unknown", what=what, nearest=_nearest(str(key), known))

    def value(self, node: Any, parameter: calls.Parameter, at: Path) -> Any:
        """An argument: an object of the class that the signature asks for, the path of a file, or as it is."""
        if node is None:
            self.problem(at, "null" if parameter.required else "null_optional")
            return None
        if parameter.is_path and isinstance(node, str) and not specs.is_mjcf(node):
            return self.elsewhere.get(node, os.path.join(self.file_path.parent.absolute(), node))
        made = [cls for cls in parameter.accepts if cls.__module__.startswith("mjx_arenas")]
        if not made and isinstance(node, dict):
            self.problem(at, "value", json=node)
        if not made:
            return node
        if parameter.is_list:
            if not isinstance(node, list):
                self.problem(at, "list", json=node)
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
            return self.run(at, lambda: Object(**arguments))
        if cls in (Term, Place, Follow):
            arguments = self.arguments(cls, node, at, cls.__name__)
            return None if arguments is None else cls(**arguments)
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
            called, key = (
                sorted(node, key=lambda key: key not in known)[:2] if isinstance(node, dict) and node else ("", "")
            )
            rule = "beside_call" if called in known and key not in known else "named_call"
            self.problem(at, rule, kind=kind, example=example, json=node, called=called, key=key)
            return None
        (name,) = node
        if name not in known:
            if len(list(known)) == 1:
                self.problem((*at, name), "other_kind", kind=kind, example=example)
            else:
                self.problem((*at, name), "node_unknown", what=f"a {kind}", nearest=_nearest(str(name), known))
            return None
        return name

    def run(self, at: Path, function: Callable[[], Any]) -> Any:
        """What a call gives; its errors become problems of the file, and its warnings speak of the file."""
        result = None
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                result = function()
            except (ValueError, TypeError, OSError) as error:
                self.problems += [self.placed(at, problem) for problem in problems_of(error)]
        for warning in caught:
            told = warning.message if isinstance(warning.message, Warning) else UserWarning(warning.message)
            self.warnings += [self.placed(at, problem) for problem in problems_of(told)]
        return result

    def placed(self, at: Path, problem: Problem) -> Problem:
        """A problem of a constructor, at the line of the argument or of the object that it is about."""
        keys: Path = tuple(problem.path.split(".")) if problem.path else ()
        where = self.objects.get((at, repr(problem.item[1]))) if problem.item else None
        if where is not None and keys[:1] == ("objects",):
            return problem._replace(source=self.source(where, dotted(where)))
        if keys[:2] == ("ranges", "terms"):
            return problem._replace(source=self.source(self._of_term(problem)))
        keys = keys[:2] if keys[:1] == ("ranges",) else keys
        where = self._of_part((*at, *keys), len(at))
        if not keys or where not in self.lines:
            return problem._replace(source=self.source(at, dotted(at)))
        if not messages.names_path(problem.rule):
            return problem._replace(source=self.source(where, dotted(where)))
        rest = problem.path.split(".")[len(keys) :]
        return problem._replace(path=".".join([dotted(where), *rest]), source=self.source(where))

    def _of_part(self, where: Path, n: int) -> Path:
        """The path of an argument of a call at its first `n` keys; those of a part of furniture stand under its kind."""
        if where[n : n + 1] != ("part",):
            return where
        kinds = [at[n + 1] for at in self.lines if len(at) == n + 2 and at[: n + 1] == where[: n + 1]]
        return (*where[: n + 1], *kinds, *where[n + 1 :]) if len(kinds) == 1 and len(where) > n + 1 else where

    def _of_term(self, problem: Problem) -> Path:
        """The path to the range of a term, whose name may have dots."""
        rest, above = problem.path.removeprefix("ranges.terms").removeprefix(".") or problem.got, ("ranges", "terms")
        names = [at[2] for at in self.lines if len(at) == 3 and at[:2] == above]
        own = [name for name in names if f"{rest}.".startswith(f"{name}.")]
        return (*above, max(own, key=lambda name: len(str(name)))) if own else above


def _change(arena: Arena, method: Callable, arguments: dict[str, Any]) -> Arena:
    return method(arena, **arguments) or arena


def _nearest(name: str, known: Iterable[str]) -> tuple[str | None, tuple[str, ...]]:
    """What a wrong name may have meant, and what there is."""
    known = tuple(known)
    return keywords.nearest(name, known), known
