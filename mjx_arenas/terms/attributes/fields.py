"""Attributes by the fields of `mjx.Model` that they decide (host)."""

from mjx_arenas.terms.attributes import ATTRIBUTES, KINDS


def attribute_of(field: str) -> str | None:
    """The attribute that a field is named after, or that decides it: "joint.damping" of "dof_damping", or "dof.damping"; None if none does.

    It may be one that stays, such as "geom.contype" of "geom_contype".
    """
    wanted = _plain(field)
    first = {_plain(one.targets[0].field): name for name, one in reversed(ATTRIBUTES.items()) if one.targets}
    rows = [(name, target) for name, one in reversed(ATTRIBUTES.items()) for target in one.targets]
    of_all_last = sorted(rows, key=lambda row: row[1].of is None)  # which count
    any_of = {_plain(target.field): name for name, target in of_all_last}
    named = {_plain(name): name for name in ATTRIBUTES}
    for found in (named, first, any_of):
        if wanted in found:
            return found[wanted]
    kinds = {kind.prefix: name for name, kind in KINDS.items()} | {
        "tex": "texture",
        "stat": "statistic",
        "vis": "visual",
    }
    kind, _, rest = wanted.partition("_")
    return f"{kinds.get(kind, kind)}.{rest}" if rest else None


def _plain(name: str) -> str:
    return name.replace(".", "_")
