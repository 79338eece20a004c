"""Arenas in the training of others: Playground's wrappers and Brax's PPO, run for real."""

import functools

import jax
import numpy as np
import pytest
import third_party

import mjx_arenas as mja
from mjx_arenas import sampling
from mjx_arenas.envs.static_geoms import StaticGeoms

wrapper = pytest.importorskip("mujoco_playground").wrapper

RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.05, -0.05, -0.2], [0.05, 0.05, 0.2], relative="add"),
    table_rots=mja.Uniform(-0.5, 0.5),
)
N, STEPS = 4, 30
# C steps in double precision, with its own solver's iterations; worlds' tables differ by centimetres.
TOLERANCE = 1e-4


@pytest.fixture(scope="module")
def small():
    return third_party.small_arena()


@pytest.fixture(scope="module")
def expected(small):
    params = [small.sample_params(key, RANGES) for key in sampling.trainers_keys(third_party.keys(N))]
    z = third_party.heights(small, params, STEPS)
    assert np.ptp(z) > 0.1
    return z


def rolled(env, randomize, full_reset=False):
    """(W,) heights of the balls in the second episode, after STEPS steps."""
    env = wrapper.wrap_for_brax_training(
        env,
        episode_length=STEPS + 1,
        full_reset=full_reset,
        randomization_fn=functools.partial(randomize, rng=third_party.keys(N)),
    )
    step, state = jax.jit(env.step), jax.jit(env.reset)(third_party.keys(N))
    for i in range(2 * STEPS + 1):
        state = step(state, np.zeros((N, 1), np.float32))
        assert state.done.all() == (i == STEPS)  # and the state is the next episode's first one
    return np.asarray(state.data.qpos[:, 2])


@pytest.mark.parametrize("full_reset", [False, True])
def test_ball_rests_on_each_worlds_table(small, impl, expected, full_reset):
    """In an environment that makes its own data, in the second episode, too."""
    env = StaticGeoms(third_party.Rest(small.mj_model, small.put_model(impl)))
    z = rolled(env, small.randomization_fn(RANGES), full_reset)
    np.testing.assert_allclose(z, expected, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("impl", ["warp"], indirect=True)
def test_without_static_geoms(small, impl, expected):
    """On Warp, tables then collide where the template's stands: that is what the test above would see."""
    env = third_party.Rest(small.mj_model, small.put_model(impl))
    z = rolled(env, small.randomization_fn(RANGES))
    assert abs(z - expected).max() > 100 * TOLERANCE
