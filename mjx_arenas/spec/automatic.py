"""Names of elements that have none: of what they belong to, their kind and their number there (host)."""

import collections
import itertools
import re
from collections.abc import Callable, Sequence
from typing import Any

import mujoco


def _body(element: Any) -> str:
    return element.parent.name


def _wrapped(tendon: mujoco.MjsTendon) -> str:
    """The first that a tendon goes through; a pulley has no name."""
    targets = (wrap.target for wrap in tendon.path)
    return next((target.name for target in targets if target is not None and target.name), "")


ON_BODIES = ("geom", "joint", "site", "camera", "light")
"""Kinds of elements that belong to a body."""
_OWNERS: dict[str, tuple[str, Callable[[Any], str]]] = {
    "body": ("bodies", _body),  # first, as the names of what is on them begin with theirs
    **{kind: (f"{kind}s", _body) for kind in ON_BODIES},
    "tendon": ("tendons", _wrapped),
    "actuator": ("actuators", lambda actuator: actuator.target),
    "equality": ("equalities", lambda equality: equality.name1),
    "pair": ("pairs", lambda pair: pair.geomname1),
}
"""What lists the elements of a kind in a spec, and the name of what one belongs to. All else in MJCF has a name, or is there once."""
_MADE = re.compile(rf"(^key|/({'|'.join(_OWNERS)}))\d+$")


def give(
    spec: mujoco.MjSpec, owner: str | None = None, into: mujoco.MjSpec | None = None, prefix: str = ""
) -> list[tuple[str, Any]]:
    """Gives elements without a name one such as "hand/geom0": of the unnamed geoms of body "hand", the first.

    Numbers count up in the order of the MJCF, and leave out names that an element of the kind has already. So names do not depend on
    what else is there, nor on which of these elements got theirs before.

    Args:
        spec: gets the names.
        owner: only what belongs to this; None: all.
        into: a spec into which this one will come, and from whose names its own must differ.
        prefix: of the names there.

    Returns:
        The elements that got a name, with their kinds.
    """
    given = []
    for kind, (listed, owner_of) in _OWNERS.items():
        elements = list(getattr(spec, listed))
        unnamed = [e for e in elements if not e.name and owner in (None, owner_of(e))]
        if not unnamed:
            continue
        there = {e.name for e in getattr(into, listed)} if into is not None else set()
        taken = {e.name for e in elements} | {name.removeprefix(prefix) for name in there if name.startswith(prefix)}
        numbers = collections.defaultdict[str, Any](itertools.count)
        for element in unnamed:
            of = owner_of(element)  # which may have got its name just now
            names = (f"{of}/{kind}{number}" for number in numbers[of])
            element.name = next(name for name in names if name not in taken)
            given.append((kind, element))
    return given


def body(names: Sequence[str], parents: Sequence[int], index: int) -> str:
    """What messages call a body: 'hand', or 'arm/body0' (unnamed), the name that `give` would give it.

    Args:
        names: (nbody,) of all bodies, "" of those without.
        parents: (nbody,) ids.
        index: of the body.
    """
    return repr(names[index]) if names[index] else f"{_name_of_body(names, parents, index)!r} (unnamed)"


def _name_of_body(names: Sequence[str], parents: Sequence[int], index: int) -> str:
    if names[index]:
        return names[index]
    of = _name_of_body(names, parents, parents[index])
    unnamed = [i for i in range(1, len(names)) if parents[i] == parents[index] and not names[i]]
    free = (name for number in itertools.count() if (name := f"{of}/body{number}") not in names)
    return next(itertools.islice(free, unnamed.index(index), None))


def made(name: str) -> bool:
    """Whether it could be a name of `give`."""
    return _MADE.search(name) is not None


def take_back(given: list[tuple[str, Any]], kept: set[tuple[str, str]]) -> None:
    """Takes names away again, but for some of a kind."""
    for kind, element in given:
        if (kind, element.name) not in kept:
            element.name = ""


def keyframes(spec: mujoco.MjSpec) -> None:
    """Gives keyframes without a name that of their number: "key0", "key1", ..."""
    taken = {key.name for key in spec.keys}
    for i, key in enumerate(spec.keys):
        if not key.name:
            key.name = next(name for k in range(i, i + len(taken) + 1) if (name := f"key{k}") not in taken)
            taken.add(key.name)
