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
