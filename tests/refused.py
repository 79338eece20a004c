"""What calls with wrong input are answered with, as data."""

import functools
import pathlib

import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas.problems.messages import problems_of

DATA = pathlib.Path(__file__).parent / "data"
OFFSETS = [[0, -1, 0.8], [0, 0, 0.8], [0, 1, 0.8]]


def told(call, kind=ValueError):
    """(path, index, rule) of each problem that a call is refused for."""
    with pytest.raises(kind) as raised:
        call()
    assert type(raised.value) is kind
    problems = problems_of(raised.value)
    assert problems[0].rule != "said"
    return [problem.key for problem in problems]


def open_arena():
    """Three tables and a cube, not compiled yet."""
    return mja.MultiTableArena(OFFSETS, objects=[mja.Object("cube")])


@functools.cache
def arena():
    """The same, which may be compiled."""
    return open_arena()


def host(arena, **values):
    """Nominal parameters with others, as the host sees them."""
    return arena._nominal._replace(**{name: np.asarray(value) for name, value in values.items()})
