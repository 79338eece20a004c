"""Options of MuJoCo that are one of a few, by their names in MJCF (host)."""

from typing import Any

import mujoco

from mjx_arenas.problem import Problem, problem
from mjx_arenas.rules import validation

_CHOICES = {
    name: {one.name.partition("_")[2].lower(): int(one) for one in kind.__members__.values()}
    for name, kind in {
        "cone": mujoco.mjtCone,
        "integrator": mujoco.mjtIntegrator,
        "jacobian": mujoco.mjtJacobian,
        "solver": mujoco.mjtSolver,
    }.items()
}
"""The numbers of names, in lower case, by the option."""


def named_option(name: str, value: Any) -> Any:
    """The number of an option's name, and anything else as it is."""
    return _CHOICES.get(name, {}).get(value.lower(), value) if isinstance(value, str) else value


def integer_problems(name: str, value: object) -> list[Problem]:
    """What is wrong with an option that is an integer."""
    if name not in _CHOICES:
        return [] if validation.is_whole(value) else [problem(name, "integer", None, value)]
    known = _CHOICES[name]
    if validation.is_whole(value) and value in known.values():
        return []
    must = f"one of {', '.join(f'{one} ({number})' for one, number in known.items())}"
    return [problem(name, "must", None, value, must=must)]
