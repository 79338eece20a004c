"""Rollouts with controls: what acts in each step, in which world, and what is refused."""

import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from jax.sharding import AxisType, NamedSharding
from jax.sharding import PartitionSpec as P
from jax.tree_util import Partial

import mjx_arenas as mja
from mjx_arenas.sim import rollouts

N, STEPS = 3, 4
ROBOT = """
<mujoco>
  <worldbody>
    <body pos="0 0 3"><joint name="x" type="slide" axis="1 0 0"/><geom size=".1" contype="0" conaffinity="0"/>
      <body><joint name="y" type="slide" axis="0 1 0"/><geom size=".1" contype="0" conaffinity="0"/></body></body>
  </worldbody>
  <actuator><motor joint="x" gear="100"/><motor joint="y" gear="100"/></actuator>
</mujoco>
"""
RNG = np.random.default_rng(0)
CTRL = RNG.uniform(-1, 1, (STEPS, N, 2)).astype(np.float32)


@functools.cache
def moved_by_motors():
    """A table and a robot of two motors."""
    arena = mja.TableArena()
    arena.attach(mujoco.MjSpec.from_string(ROBOT))
    arena.spec.option.iterations = 1
    return arena


@functools.cache
def robots():
    """Three worlds with a robot of two motors, and their data."""
    arena = moved_by_motors()
    ranges = mja.ArenaRanges(table_rots=mja.Uniform(-1, 1))
    batch = arena.randomize(arena.put_model("jax"), jax.random.split(jax.random.key(0), N), ranges)
    return batch, mja.make_data(batch)


def expected(ctrl):
    """(STEPS, N, 2) positions of C MuJoCo with controls (STEPS, N, 2)."""
    batch, _ = robots()
    model, seen = batch.record.mj_model, np.zeros((STEPS, N, 2))
    for world in range(N):
        c = mujoco.MjData(model)
        for step in range(STEPS):
            c.ctrl = ctrl[step, world]
            mujoco.mj_step(model, c)
            seen[step, world] = c.qpos
    return seen


def _qpos(data):
    return data.qpos


def _chase(data, step):
    """Another number in each world and step, of what is there before the step."""
    return data.qpos + step + jnp.arange(N)[:, None]


GIVEN = {
    "of each world": (CTRL, CTRL),
    "of all worlds": (jnp.asarray(CTRL[:, 0]), np.repeat(CTRL[:, :1], N, axis=1)),
    "half precision": (jnp.asarray(CTRL, jnp.bfloat16), np.asarray(jnp.asarray(CTRL, jnp.bfloat16), np.float32)),
    "whole numbers": (np.ones((STEPS, 2), int), np.ones((STEPS, N, 2))),
}


@pytest.mark.parametrize("case", GIVEN)
@pytest.mark.slow
def test_array(case):
    """Row i of an array acts in step i; C MuJoCo goes the same way."""
    control, each = GIVEN[case]
    data, seen = mja.rollout(*robots(), STEPS, record=_qpos, control=control)
    # At most 100 N on 4 kg go 1 mm in four steps; 100 roundings to single precision are 6e-6 of that.
    np.testing.assert_allclose(seen, expected(each), rtol=1e-5, atol=1e-8)
    np.testing.assert_array_equal(data.ctrl, each[-1])


@pytest.mark.slow
def test_function():
    """A function sees the data before each step, and the number of it; C MuJoCo goes the same way."""
    batch, data = robots()
    data = mja.rollout(batch, data, STEPS, control=_chase)
    for world in range(N):
        c = mujoco.MjData(batch.record.mj_model)
        for step in range(STEPS):
            c.ctrl = c.qpos + step + world  # `_chase`
            mujoco.mj_step(batch.record.mj_model, c)
        np.testing.assert_allclose(data.qpos[world], c.qpos, rtol=1e-5, atol=1e-8)
        np.testing.assert_allclose(data.ctrl[world], c.ctrl, rtol=1e-5, atol=1e-6)


def _scaled(gain, data, step):
    return jnp.broadcast_to(gain, (N, 2))


@pytest.mark.slow
def test_nothing_compiles_anew():
    """Other numbers in an array, another call with a function and a policy's other parameters use what is compiled."""
    batch, data = robots()
    for control in (lambda i: CTRL + i, lambda _: _chase, lambda i: Partial(_scaled, jnp.float32(i))):
        mja.rollout(batch, data, STEPS, control=control(0))
        before = rollouts._rollout._cache_size()
        last = mja.rollout(batch, data, STEPS, control=control(1))
        assert rollouts._rollout._cache_size() == before
    np.testing.assert_array_equal(last.ctrl, np.ones((N, 2)))


@pytest.mark.slow
def test_without_control():
    """The data's own controls stay."""
    batch, data = robots()
    data = mja.rollout(batch, data.replace(ctrl=jnp.full((N, 2), 0.5)), STEPS)
    np.testing.assert_array_equal(data.ctrl, np.full((N, 2), 0.5))
    assert (np.asarray(data.qvel) > 0).all()


@pytest.mark.slow
def test_spread_worlds():
    """Controls of all worlds reach those of each device."""
    arena = moved_by_motors()
    mesh = jax.make_mesh((2,), ("w",), axis_types=(AxisType.Explicit,))
    keys = jax.random.split(jax.random.key(0), 2 * N)
    keys = jax.device_put(keys, NamedSharding(mesh, P("w")))
    batch = arena.randomize(arena.put_model("jax"), keys, mja.ArenaRanges(table_rots=mja.Uniform(-1, 1)))
    data = mja.rollout(batch, mja.make_data(batch), STEPS, control=np.concatenate([CTRL, CTRL], axis=1))
    np.testing.assert_allclose(data.qpos, np.tile(expected(CTRL)[-1], (2, 1)), rtol=1e-5, atol=1e-8)


ANY = "`control` must have shape (n_steps, W, nu), here (4, 3, 2), or (n_steps, nu), here (4, 2), got"
BAD = [
    (CTRL[:3], ValueError, f"{ANY} (3, 3, 2)."),
    (CTRL[0], ValueError, f"{ANY} (3, 2)."),
    (CTRL[..., :1], ValueError, f"{ANY} (4, 3, 1)."),
    (CTRL > 0, TypeError, "`control` must be an array of numbers, a function of data and step, or None, got bool numbers."),
    ([1, 2], TypeError, "`control` must be an array of numbers, a function of data and step, or None, got list."),
    (
        lambda data: data.ctrl,
        TypeError,
        "`control` must be a function of (data, step), got one of (data).",
    ),
    (
        lambda data, _: data.ctrl[0],
        ValueError,
        "`control` must give the ctrl of all worlds, (W, nu), here (3, 2), got shape (2,).",
    ),
    (
        lambda data, _: None,
        ValueError,
        "`control` must give the ctrl of all worlds, (W, nu), here (3, 2), got NoneType.",
    ),
]  # fmt: skip


@pytest.mark.parametrize("i", range(len(BAD)))
def test_bad_control(i):
    control, error, message = BAD[i]
    with pytest.raises(error) as caught:
        mja.rollout(*robots(), STEPS, control=control)
    assert str(caught.value) == message


def test_bad_record():
    """A function of too many arguments."""
    with pytest.raises(TypeError, match=r"^`record` must be a function of \(data\), got one of \(data, step\)\.$"):
        mja.rollout(*robots(), STEPS, record=lambda data, step: data.qpos)
