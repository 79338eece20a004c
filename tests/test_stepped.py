"""Worlds in which everything varies move as C MuJoCo moves the recompiled ones."""

import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from models import FEW_ARMS, SUITE
from mujoco import mjx
from rounding import Rounding
from test_dr import elsewhere, everything, with_everything

import mjx_arenas as mja

pytestmark = pytest.mark.slow_on("warp")

STEPS = 20
RUNS = 8  # of C with rounding errors of single precision
FAR = 5  # times what the largest of these does to it, and what rounding in a chain of bodies does
EPS = 2.0**-23


def calm(spec, model):
    """All but higher powers of damping and stiffness, with which C diverges at the speeds here; `test_warp_alone.py` steps them."""
    return {attribute: term for attribute, term in everything(spec, model).items() if not attribute.endswith("poly")}


def controls(model, rng):
    """(STEPS, nu) random, within the ranges."""
    low, high = np.where(model.actuator_ctrllimited[:, None], model.actuator_ctrlrange, [-1.0, 1.0]).T
    return rng.uniform(low, high, (STEPS, model.nu))


def forces(model, c):
    """(nv,) sizes of the forces that add up to accelerations, and of what accelerations take."""
    mujoco.mj_forward(model, c)
    inertia = np.zeros((model.nv, model.nv))
    for row, unit in zip(inertia, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, c, row, unit)
    acting = (c.qfrc_passive, c.qfrc_bias, c.qfrc_actuator, c.qfrc_constraint)
    return sum(np.abs(force) for force in acting) + np.abs(inertia) @ np.abs(c.qacc)


def moved(model, start, control, rng=None):
    """(STEPS, nv) velocities in C; with `rng`, of a state and of forces that are rounded in each step."""
    c, found = mujoco.MjData(model), []
    for name, value in start.items():
        getattr(c, name)[...] = value
    for u in control:
        c.ctrl[...] = u
        if rng is not None:
            for state in (c.qpos, c.qvel):
                state *= 1 + EPS * rng.choice([-1, 1], len(state))
            c.qfrc_applied[:] = EPS * rng.choice([-1, 1], model.nv) * forces(model, c)
        mujoco.mj_step(model, c)
        found.append(np.array(c.qvel))
    return np.array(found)


def stepped(step, data, control, rng=None):
    """(STEPS, nv) velocities of one world, or of the first; with `rng`, of a state that is rounded in each step."""
    found = []
    for u in control:
        if rng is not None:
            state = {name: getattr(data, name) for name in ("qpos", "qvel")}
            data = data.replace(
                **{n: x * jnp.asarray(1 + EPS * rng.choice([-1, 1], x.shape), x.dtype) for n, x in state.items()}
            )
        data = step(data, jnp.asarray(u, jnp.float32))
        found.append(np.asarray(data.qvel, float).reshape(-1, data.qvel.shape[-1])[0])
    return np.array(found)


def of_mjx(model, impl, start):
    """The same runs as `moved`, of MJX."""
    one, data = mjx.put_model(model, impl=impl), mjx.make_data(model, impl=impl)
    data = data.replace(**{name: jnp.asarray(value) for name, value in start.items()})
    return lambda control, rng=None: stepped(functools.partial(alone, one), data, control, rng)


@jax.jit
def alone(one, data, u):
    """A step of MJX's own model, as above."""
    return mjx.step(one, data.replace(ctrl=u))


@jax.jit
def step(batch, data, u):
    """A step of all worlds under one control; compiled once for both sides of the nominal numbers."""
    return mja.step(batch, data.replace(ctrl=jnp.broadcast_to(u, data.ctrl.shape)))


def held(name, impl, far, against=None):
    """Holds a world without contacts against C's: MJX finds contacts by other algorithms, here of bodies deep in each other.

    `against`: another reference than C MuJoCo, a function of the recompiled model, `impl` and the start.
    """
    arena = with_everything(name, impl, calm)
    option = arena.mj_model.opt
    option.iterations, option.ls_iterations, option.tolerance = 100, 50, 1e-10
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_SENSOR)
    params = elsewhere(arena, far)
    batch = arena.batch(arena.put_model(impl), jax.tree.map(lambda x: np.stack([x, x]), params))
    model, rng = arena.compile(params), np.random.default_rng(0)
    control, data = controls(model, rng), mja.make_data(batch)
    start = {name: np.asarray(getattr(data, name)[0]) for name in ("qpos", "qvel", "eq_active")}
    got = stepped(functools.partial(step, batch), data, control)
    run = functools.partial(moved, model, start) if against is None else against(model, impl, start)
    want = run(control)
    rounding = np.max([np.abs(run(control, rng) - want).max(1) for _ in range(RUNS)], axis=0)
    error = Rounding(model, mujoco.MjData(model)).error  # of a number at the end of a chain of bodies
    allowed = FAR * np.maximum.accumulate(rounding + error * np.abs(want).max(1))
    off = np.abs(got - want).max(1)
    assert (off <= allowed).all(), (name, impl, far, np.max(off / allowed), off / np.abs(want).max())


@pytest.mark.filterwarnings("ignore:.arena.mj_model.opt.. .* changed since")
@pytest.mark.slow
@pytest.mark.parametrize("name", ["acrobot", "fish"])
def test_as_in_c(name, impl):
    """20 steps under random controls."""
    held(name, impl, 0.2)


STEPPED = ("ball_in_cup", "finger", "hopper")
IN_TURNS = [
    pytest.param(name, ("jax", "warp")[i % 2], marks=[pytest.mark.xslow] * (name not in STEPPED))
    for i, name in enumerate(SUITE)
]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.arena.mj_model.opt.. .* changed since")
@pytest.mark.parametrize(("name", "impl"), IN_TURNS, indirect=["impl"])
def test_suite_as_in_c(name, impl):
    """The same of the whole control suite, on either side of the nominal numbers.

    Each on one implementation, in turns: `test_dr.py` holds the rows of all of them on both, and two are stepped on both above.
    The tests before a release step those whose joints, contacts and actuators others here have, too.
    """
    for far in (0.2, -0.2):
        held(name, impl, far)


LOOPS = ("2f85", "panda")
"""Grippers whose fingers are closed loops of links: MJX's own steps of a compiled model are 4e-4 to 1.6e-3 off C's."""


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.arena.mj_model.opt.. .* changed since")
@pytest.mark.parametrize("name", FEW_ARMS)
def test_robots_as_in_c(name):
    """The same of arms, hands and legs with meshes."""
    for far in (0.2, -0.2):
        held(name, "warp", far, against=of_mjx if name in LOOPS else None)
