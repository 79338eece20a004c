"""Which numbers go with failures, against ranks counted pair by pair."""

import functools

import jax
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas.checks.goes_with import goes_with

U = mja.Uniform
RANGES = mja.ArenaRanges(
    table_full_sizes=U([0.3, 0.5, 0.03], [0.5, 0.8, 0.06]),
    object_masses=U(0.1, 0.5),
    object_active=mja.Bernoulli(0.7),
)


@functools.cache
def drawn():
    arena = mja.TableArena(objects=[mja.Object("cube", full_size=0.06), mja.Object("ball", "sphere", 0.05)])
    keys = mja.world_keys(0, range(128))
    return arena.record, jax.device_get(jax.jit(jax.vmap(lambda key: arena.sample_params(key, RANGES)))(keys))


def test_a_number_that_decides():
    """It is told first, with its ranges; the share of pairs is the plain count."""
    record, params = drawn()
    lengths = params.table_full_sizes[:, 0, 0]
    failed = lengths < np.sort(lengths)[12]
    (first, *_) = goes_with(record, params, failed)
    assert str(first) == (
        f"table_full_sizes.table.length is {lengths.min():.3g} to {lengths[failed].max():.3g} m in worlds that fail, "
        f"{lengths[~failed].min():.3g} to {lengths.max():.3g} in others"
    )
    assert first.larger == 0


def test_pairs():
    """By a mass and by chance, only in worlds in which the object is."""
    record, params = drawn()
    masses, there = params.object_masses[:, 0], params.object_active[:, 0]
    failed = np.random.default_rng(0).random(128) < np.where(there, 0.1 + 0.8 * (masses > 0.3), 0.5)
    (found,) = [one for one in goes_with(record, params, failed) if one.name == "object_masses.cube"]
    pairs = [x > y for x in masses[failed & there] for y in masses[~failed & there]]
    assert found.larger == pytest.approx(np.mean(pairs), rel=1e-12)
    assert found.failed == (masses[failed & there].min(), masses[failed & there].max())


def test_presence():
    """What is absent can be what goes with it."""
    record, params = drawn()
    (first, *_) = goes_with(record, params, ~params.object_active[:, 1])
    assert (first.name, first.larger) == ("object_active.ball", 0)


@pytest.mark.parametrize("seed", range(5))
def test_chance(seed):
    """Worlds that fail without a reason have no number told; nor do too few of them."""
    record, params = drawn()
    rng = np.random.default_rng(seed)
    assert goes_with(record, params, rng.random(128) < 0.2) == ()
    assert goes_with(record, params, np.arange(128) == seed) == ()


def test_all_or_none():
    record, params = drawn()
    assert goes_with(record, params, np.ones(128, bool)) == ()
    assert goes_with(record, params, np.zeros(128, bool)) == ()


def test_reported():
    """By `check`, in words and as data."""
    arena = mja.TableArena(objects=[mja.Object("cube", full_size=0.06)])
    ranges = mja.ArenaRanges(table_full_sizes=U([0.03, 0.5, 0.03], [0.4, 0.8, 0.06]))
    report = mja.check(arena, ranges, 64, n_steps=1, engine="c")
    assert report.goes_with[0].name == "table_full_sizes.table.length"
    assert f"\n{report.goes_with[0]}" in str(report)
    assert report.to_dict()["goes_with"][0]["larger"] == 0
