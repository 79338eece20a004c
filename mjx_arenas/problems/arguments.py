"""What is wrong with arguments that are numbers (host)."""

import numpy as np

from mjx_arenas.params.params import QUANTITIES
from mjx_arenas.problem import Problem, problem


def is_whole(value: object, least: float = -np.inf, most: float = np.inf) -> bool:
    """Whether a value is a whole number within limits, Python's or NumPy's; true and false are none."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool) and bool(least <= value <= most)


def vector_problems(name: str, value: object, n: int, unit: str) -> list[Problem]:
    """An argument that is not `n` finite numbers, or, for 0, not one."""
    try:
        array = np.asarray(value, float) if np.asarray(value).dtype.kind in "iuf" else None
    except (TypeError, ValueError):
        array = None
    if array is None or array.shape != ((n,) if n else ()) or not np.isfinite(array).all():
        return [problem(name, "vector" if n else "number", None, value, n=n, unit=unit)]
    rule = QUANTITIES["table_offsets"]._replace(must=unit)
    return [] if rule.right(array).all() else [problem(name, "limits", None, value, between=rule.between)]


def not_negative_problems(name: str, value: object, unit: str) -> list[Problem]:
    """An argument that is not one number >= 0."""
    problems = vector_problems(name, value, 0, unit)
    negative = not problems and np.asarray(value) < 0
    return [problem(name, "not_negative", None, value, unit=unit)] if negative else problems
