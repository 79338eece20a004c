"""What is wrong with the variants of an object (host)."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from mjx_arenas.problem import Problem, problem

OF_WHOLE = ("on", "pos", "rot", "active", "place", "pose", "variants")
"""Arguments of an object that its variants do not have."""
OF_VARIANTS = ("type", "full_size", "density", "mass", "friction", "condim", "rgba", "file", "priority")
"""Arguments of its variants that it has not beside them."""


def problems(whole: Any) -> list[Problem]:
    """What is wrong with an object that has variants, and with these."""
    found = [problem(name, "of_variants", None, getattr(whole, name)) for name in _given(whole, OF_VARIANTS)]
    own = dataclasses.replace(whole, variants=None, **_defaults(whole, OF_VARIANTS)).problems()
    found += [p._replace(path=p.path.removeprefix("objects.")) for p in own]
    if not isinstance(whole.variants, (list, tuple)) or not whole.variants:
        return [*found, problem("variants", "variants", None, whole.variants)]
    names: list[str] = []
    for i, one in enumerate(whole.variants):
        at = f"variants[{i}]"
        if not isinstance(one, type(whole)):
            found.append(problem(at, "variant", None, one))
            continue
        for name in _given(one, OF_WHOLE):
            rule = "variants_again" if name == "variants" else "of_whole"
            found.append(problem(f"{at}.{name}", rule, None, getattr(one, name)))
        own = dataclasses.replace(one, **_defaults(one, OF_WHOLE)).problems()
        found += [p._replace(path=at + p.path.removeprefix("objects")) for p in own]
        if one.name in names:
            found.append(problem(f"{at}.name", "variant_twice", None, one.name))
        names.append(one.name)
    return found


def _defaults(obj: Any, names: Sequence[str]) -> dict[str, Any]:
    return {f.name: f.default for f in dataclasses.fields(obj) if f.name in names}


def _given(obj: Any, names: Sequence[str]) -> list[str]:
    """The arguments among `names` that are not their defaults."""
    plain = _defaults(obj, names)
    given = {name: getattr(obj, name) for name in names}
    return [n for n, v in given.items() if v is not plain[n] and (plain[n] is None or not np.array_equal(v, plain[n]))]
