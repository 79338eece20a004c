"""Worlds in which everything varies move as C MuJoCo moves the recompiled ones."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from models import SUITE
from rounding import Rounding
from test_dr import elsewhere, with_everything

import mjx_arenas as mja

pytestmark = pytest.mark.slow_on("warp")

STEPS = 20
RUNS = 8  # of C with rounding errors of single precision
FAR = 5  # times what the largest of these does to it, and what rounding in a chain of bodies does
EPS = 2.0**-23


def controls(model, rng):
    """(STEPS, nu) random, within the ranges."""
    low, high = np.where(model.actuator_ctrllimited[:, None], model.actuator_ctrlrange, [-1.0, 1.0]).T
    return rng.uniform(low, high, (STEPS, model.nu))


def moved(model, start, control, rng=None):
    """(STEPS, nv) velocities in C; with `rng`, of a state that is rounded in each step."""
    c, found = mujoco.MjData(model), []
    for name, value in start.items():
        getattr(c, name)[...] = value
    for u in control:
        c.ctrl[...] = u
        if rng is not None:
            for state in (c.qpos, c.qvel):
                state *= 1 + EPS * rng.choice([-1, 1], len(state))
        mujoco.mj_step(model, c)
        found.append(np.array(c.qvel))
    return np.array(found)


def stepped(step, data, control):
    """(STEPS, nv) velocities of the first world."""
    found = []
    for u in control:
        data = step(data, jnp.broadcast_to(jnp.asarray(u, jnp.float32), data.ctrl.shape))
        found.append(np.asarray(data.qvel, float).reshape(-1, data.qvel.shape[-1])[0])
    return np.array(found)


def held(name, impl, far):
    """Holds a world without contacts against C's: MJX finds contacts by other algorithms, here of bodies deep in each other."""
    arena = with_everything(name, impl)
    option = arena.mj_model.opt
    option.iterations, option.ls_iterations, option.tolerance = 100, 50, 1e-10
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_SENSOR)
    params = elsewhere(arena, far)
    batch = arena.batch(arena.put_model(impl), jax.tree.map(lambda x: np.stack([x, x]), params))
    model, rng = arena.compile(params), np.random.default_rng(0)
    control, data = controls(model, rng), mja.make_data(batch)
    start = {name: np.asarray(getattr(data, name)[0]) for name in ("qpos", "qvel", "eq_active")}
    step = jax.jit(lambda data, u: mja.step(batch, data.replace(ctrl=jnp.broadcast_to(u, data.ctrl.shape))))
    got = []
    for u in control:
        data = step(data, jnp.asarray(u, jnp.float32))
        got.append(np.asarray(data.qvel[0], float))
    want = moved(model, start, control)
    rounding = np.max([np.abs(moved(model, start, control, rng) - want).max(1) for _ in range(RUNS)], axis=0)
    error = Rounding(model, mujoco.MjData(model)).error  # of a number at the end of a chain of bodies
    allowed = FAR * np.maximum.accumulate(rounding + error * np.abs(want).max(1))
    off = np.abs(np.array(got) - want).max(1)
    assert (off <= allowed).all(), (name, impl, far, np.max(off / allowed), off / np.abs(want).max())


@pytest.mark.filterwarnings("ignore:.arena.mj_model.opt. has other")
@pytest.mark.slow
@pytest.mark.parametrize("name", ["acrobot", "fish"])
def test_as_in_c(name, impl):
    """20 steps under random controls."""
    held(name, impl, 0.2)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.arena.mj_model.opt. has other")
@pytest.mark.parametrize("impl", ["jax", "warp"], indirect=True)
@pytest.mark.parametrize("name", list(SUITE))
def test_suite_as_in_c(name, impl):
    """The same of the whole control suite, on either side of the nominal numbers."""
    for far in (0.2, -0.2):
        held(name, impl, far)
