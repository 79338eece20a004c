"""Names of surfaces, variants, textures and materials in the ranges of a file, which draws count by numbers (host)."""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

from mjx_arenas.arena import Arena

Unknown: TypeAlias = Callable[[tuple[str | int, ...], str, str, Sequence[str]], None]
"""A function that is told of an unknown name: its place in the file, what it should be, the name, and the names that exist."""


def numbered(node: Any, arena: Arena, unknown: Unknown) -> Any:
    """The ranges of a file with the numbers of names: `object_tables: {Choice: [rack_board0, rack_board1]}`."""
    if not isinstance(node, dict):
        return node
    found = dict(node)
    if "object_tables" in node:
        found["object_tables"] = _of(
            node["object_tables"], arena.surfaces, "a surface", ("ranges", "object_tables"), unknown
        )
    terms = node.get("terms")
    if isinstance(terms, dict):
        names, at = _named(arena), ("ranges", "terms")
        found["terms"] = {
            key: _of(value, *names[key], (*at, key), unknown) if key in names else value for key, value in terms.items()
        }
    return found


def named(node: dict[str, Any], arena: Arena) -> dict[str, Any]:
    """The ranges of a file that is to be written, with the names of numbers that `numbered` knows."""
    found = dict(node)
    if "object_tables" in node:
        found["object_tables"] = _called(node["object_tables"], arena.surfaces)
    if "terms" in node:
        names = _named(arena)
        found["terms"] = {
            key: _called(value, names[key][0]) if key in names else value for key, value in node["terms"].items()
        }
    return found


def _named(arena: Arena) -> dict[str, tuple[Sequence[str], str]]:
    """The names that the numbers of some terms stand for, and what these are, by the quantity."""
    found: dict[str, tuple[Sequence[str], str]] = {
        f"{o.name}.variant": ([v.name for v in o.variants], "a variant") for o in arena.objects if o.variants
    }
    for quantity, rule in arena.rules_of_quantities.items():
        if rule.ids_of:
            found[quantity] = ([one.name for one in getattr(arena.spec, f"{rule.ids_of}s")], f"a {rule.ids_of}")
    return found


def _of(node: Any, names: Sequence[str], what: str, at: tuple[str | int, ...], unknown: Unknown) -> Any:
    """The same with numbers instead of names, wherever these stand."""
    if isinstance(node, dict):
        return {key: _of(value, names, what, (*at, key), unknown) for key, value in node.items()}
    if isinstance(node, list):
        return [_of(value, names, what, (*at, i), unknown) for i, value in enumerate(node)]
    if not isinstance(node, str):
        return node
    if node not in names:
        unknown(at, what, node, names)
        return 0
    return list(names).index(node)


def _called(node: dict[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """A distribution with names instead of the numbers that it gives, where each number has one of its own."""

    def called(value: Any) -> Any:
        if isinstance(value, list):
            return [called(item) for item in value]
        name = names[int(value)] if value == int(value) and 0 <= value < len(names) else ""
        return name if name and names.count(name) == 1 else value

    names = list(names)
    ((kind, given),) = node.items()
    if not isinstance(given, dict):
        return {kind: called(given)}
    return {kind: {key: called(value) if key in ("values", "at") else value for key, value in given.items()}}
