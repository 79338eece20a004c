"""The worlds of the examples are those of 3eba325, before the house was rebuilt around terms: parameters and all fields."""

import importlib.resources
import operator
import pathlib

import numpy as np
import pytest
from oracle import EPS, off

import mjx_arenas as mja
from mjx_arenas.params.params import named

NUMBERS = pathlib.Path(__file__).parent / "data" / "worlds_3eba325.npz"
EXAMPLES = ["clutter", "pick_and_place", "robosuite_multi_table", "robosuite_table", "shelf"]


@pytest.mark.filterwarnings("ignore:.*overlap")
@pytest.mark.parametrize("example", EXAMPLES)
def test_same_worlds(example):
    """64 worlds of seed 0: the same parameters, the same fields stored, and the same numbers in them, to rounding."""
    arena, ranges = mja.load(importlib.resources.files("mjx_arenas") / "examples" / f"{example}.yaml")
    batch = arena.randomize(arena.put_model("jax"), mja.world_keys(0, range(64)), ranges)
    with np.load(NUMBERS) as file:
        then = {name.removeprefix(f"{example}/"): file[name] for name in file.files if name.startswith(f"{example}/")}
    np.testing.assert_array_equal(batch.valid, then.pop("valid"))
    for name, values in named(batch.params).items():
        want = then.pop(f"params/{name}")
        rounding = 8 * EPS * np.abs(want).max(initial=0.0)  # of a draw's span, which may straddle 0
        np.testing.assert_allclose(values, want, rtol=0, atol=rounding, err_msg=name)
    assert {f"fields/{name}" for name in batch.fields} == then.keys()
    for name in batch.fields:
        got, want = np.asarray(operator.attrgetter(name)(batch.model)), then[f"fields/{name}"]
        wrong = [w for w in range(64) if off(arena.mj_model, name, got[w], want[w]).any()]
        assert not wrong, (name, wrong)
