"""Options of MuJoCo that are one of a few, by their names in MJCF (host)."""

from collections.abc import Mapping
from typing import Any

import mujoco

from mjx_arenas.problem import Problem, problem
from mjx_arenas.rules import validation

_KINDS: Mapping[str, Any] = {
    "cone": mujoco.mjtCone,
    "integrator": mujoco.mjtIntegrator,
    "jacobian": mujoco.mjtJacobian,
    "solver": mujoco.mjtSolver,
}
_CHOICES = {
    name: {one.name.partition("_")[2].lower(): int(one) for one in kind.__members__.values()}
    for name, kind in _KINDS.items()
}
"""The numbers of names, in lower case, by the option."""


def named_option(name: str, value: Any) -> Any:
    """The number of an option's name or of MuJoCo's constant, and anything else as it is."""
    if name in _KINDS and isinstance(value, _KINDS[name]):
        return int(value)
    return _CHOICES.get(name, {}).get(value.lower(), value) if isinstance(value, str) else value


def numbered(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options by their names, with numbers in the place of names."""
    return {name: named_option(name, value) for name, value in options.items()}


def is_choice(name: str) -> bool:
    """Whether an option is one of a few."""
    return name in _CHOICES


def integer_problems(name: str, value: object, path: str | None = None) -> list[Problem]:
    """What is wrong with an option that is an integer; `path`: what messages call it, if that is not its name."""
    path = path or name
    if name not in _CHOICES:
        return [] if validation.is_whole(value) else [problem(path, "integer", None, value)]
    known = _CHOICES[name]
    if validation.is_whole(value) and value in known.values():
        return []
    must = f"one of {', '.join(f'{one} ({number})' for one, number in known.items())}"
    return [problem(path, "must", None, value, must=must)]
