"""Names and regular expressions by which arguments choose elements."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from mjx_arenas.keywords import nearest


def are_texts(value: object) -> bool:
    """Whether a value is a text, or some of them."""
    texts = [value] if isinstance(value, str) else value
    return isinstance(texts, Sequence) and len(texts) > 0 and all(isinstance(text, str) for text in texts)


def listed(value: Any) -> list[str] | None:
    """The texts of a list, a tuple or an array of NumPy; None of anything else."""
    texts = value.tolist() if isinstance(value, np.ndarray) and value.ndim == 1 else value
    ordered = isinstance(texts, Sequence) and not isinstance(texts, (str, bytes))
    return list(texts) if ordered and all(isinstance(text, str) for text in texts) else None


def matching(pattern: str, names: Sequence[str]) -> set[str]:
    """The name, or those that a regular expression matches whole."""
    if pattern in names:
        return {pattern}
    try:
        return {name for name in names if re.fullmatch(pattern, name)}
    except re.error:
        return set()


def no_pattern(pattern: str) -> str:
    """Why a text is no regular expression; "" if it is one."""
    try:
        re.compile(pattern)
    except re.error as error:
        return str(error)
    return ""


def near(name: str, known: Sequence[str]) -> tuple[str | None, list[str]]:
    """The one of the known names that is nearest, if any is near, and the first of them."""
    return nearest(name, known), ([*known[:12], *["..."] * (len(known) > 12)] or ["none"])
