"""Worlds in which everything varies move as C MuJoCo moves the recompiled ones."""

import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from models import FEW_ARMS, MJX, SUITE
from mujoco import mjx
from rounding import Rounding
from test_start_poses import turned
from whole import elsewhere, everything, with_everything

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
        data = step(data, jnp.asarray(u, data.ctrl.dtype))
        found.append(np.asarray(data.qvel, float).reshape(-1, data.qvel.shape[-1])[0])
    return np.array(found)


def of_mjx(model, impl, start):
    """The same runs as `moved`, of MJX."""
    one, data = mjx.put_model(model, impl=impl), mjx.make_data(model, impl=impl)
    data = data.replace(**{name: jnp.asarray(value, getattr(data, name).dtype) for name, value in start.items()})
    return lambda control, rng=None: stepped(functools.partial(alone, one), data, control, rng)


@jax.jit
def alone(one, data, u):
    """A step of MJX's own model, as above."""
    return mjx.step(one, data.replace(ctrl=u))


@jax.jit
def step(batch, data, u):
    """A step of all worlds under one control; compiled once for both sides of the nominal numbers."""
    return mja.step(batch, data.replace(ctrl=jnp.broadcast_to(u, data.ctrl.shape)))


STATE = {"joint_qpos": "qpos", "joint_qvel": "dof"} | {
    f"body_start_{what}": "qpos" if what in ("pos", "rpy") else "dof" for what in ("pos", "rpy", "vel", "angvel")
}
"""Quantities of the start, and whose addresses their joints have in it."""


def begun(arena, params, model):
    """The state in which a world starts, in single precision: `qpos0` of its MJCF, and what its terms add to that."""
    state = {"qpos": np.array(model.qpos0), "dof": np.zeros(model.nv)}
    for quantity in STATE.keys() & set(arena.quantities):
        into = state[STATE[quantity]]
        for name, value in zip(arena.elements(quantity), params.terms[quantity], strict=True):
            joint = model.joint(name).id if quantity.startswith("joint") else model.body(name).jntadr[0]
            first = getattr(model, f"jnt_{STATE[quantity]}adr")[joint]
            if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE and quantity.endswith(("rpy", "angvel")):
                first += 3
            if quantity.endswith("rpy"):
                into[first : first + 4] = turned(into[first : first + 4], np.asarray(value, float))
            else:
                into[first : first + np.size(value)] += value
    active = np.array(model.eq_active0)
    if "equality_active" in arena.quantities:
        active[[model.equality(name).id for name in arena.elements("equality_active")]] = params.terms[
            "equality_active"
        ]
    return {"qpos": np.float32(state["qpos"]), "qvel": np.float32(state["dof"]), "eq_active": active}


def prepared(name, impl):
    """An arena of a model in which everything varies, without contacts."""
    arena = with_everything(name, impl, calm)
    option = arena.mj_model.opt
    option.iterations, option.ls_iterations, option.tolerance = 100, 50, 1e-10
    option.cone = int(mujoco.mjtCone.mjCONE_PYRAMIDAL)  # MJX on JAX cannot step an elliptic one where nothing touches
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_SENSOR)
    return arena


def closed(arena, params):
    """The same world with the equalities of the MJCF, where `elsewhere` switches them off."""
    return params._replace(terms=params.terms | {"equality_active": arena.nominal_params().terms["equality_active"]})


ROUNDED = ("go1",)
"""Models whose steps on JAX round by more than those of C that is perturbed: as much as MJX's own steps of the recompiled model do."""
OTHERWISE = ("ur5e",)
"""Models of which MJX's own steps on JAX are others than C's, beside rounding. `test_why_otherwise` says why, of both."""


def held(name, impl, far, loops=False):
    """Holds a world without contacts against C's: MJX finds contacts by other algorithms, here of bodies deep in each other.

    With `loops`, a world whose equalities hold; that one and those of `OTHERWISE` against MJX's steps of the recompiled model.
    """
    arena = prepared(name, impl)
    params = closed(arena, elsewhere(arena, far)) if loops else elsewhere(arena, far)
    batch = arena.batch(arena.put_model(impl), jax.tree.map(lambda x: np.stack([x, x]), params))
    model, rng = arena.compile(params), np.random.default_rng(0)
    control, data = controls(model, rng), mja.make_data(batch)
    start = begun(arena, params, model)
    got = stepped(functools.partial(step, batch), data, control)
    alike = functools.partial(of_mjx, model, impl, start)
    run = alike() if loops or (impl == "jax" and name in OTHERWISE) else functools.partial(moved, model, start)
    want = run(control)
    allowed, off = within(model, run, control, want, rng), np.abs(got - want).max(1)
    if impl == "jax" and name in ROUNDED:
        allowed = allowed + FAR * np.abs(alike()(control) - want).max()
    if loops:  # the solver stops at its limit in some steps, and rounding decides where
        allowed = allowed.max()
    assert (off <= allowed).all(), (name, impl, far, np.max(off / allowed), off / np.abs(want).max())


def within(model, run, control, want, rng):
    """(STEPS,) how far velocities may be from those of a run for rounding in single precision."""
    rounding = np.max([np.abs(run(control, rng) - want).max(1) for _ in range(RUNS)], axis=0)
    error = Rounding(model, mujoco.MjData(model)).error  # of a number at the end of a chain of bodies
    return FAR * np.maximum.accumulate(rounding + error * np.abs(want).max(1))


AT_EACH_CHANGE = {(name, impl) for name in ("acrobot", "fish") for impl in ("jax", "warp")}
AT_EACH_CHANGE |= {(name, "warp") for name in ("ball_in_cup", "finger", "hopper")}
"""Models of `make test-slow`, and on what; those of a release step what joints and actuators others here have, too."""
ROWS = [
    pytest.param(name, impl, marks=[pytest.mark.xslow] * ((name, impl) not in AT_EACH_CHANGE))
    for name in (*SUITE, *MJX)
    for impl in ("jax", "warp")
]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.arena.mj_model.opt.. .* changed since")
@pytest.mark.parametrize(("name", "impl"), ROWS, indirect=["impl"])
def test_suite_as_in_c(name, impl):
    """20 steps under random controls of the control suite and of models of MJX's own tests, on either side of the nominal numbers."""
    for far in (0.2, -0.2):
        held(name, impl, far)


LOOPS = ("2f85", "panda")
"""Grippers whose fingers are closed loops of links where their equalities hold."""
DRIFT = 4e-4, 1.9e-3
"""Of the largest velocity: how far MJX's own steps of these models, compiled, are off C's, at least and at most."""


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.arena.mj_model.opt.. .* changed since", "ignore:Mesh .* has a coplanar face")
@pytest.mark.xslow_on("jax")
@pytest.mark.parametrize("name", FEW_ARMS)
def test_robots_as_in_c(name, impl):
    """The same of arms, hands and legs with meshes; closed loops against MJX's own steps."""
    for far in (0.2, -0.2):
        held(name, impl, far)
        if name in LOOPS:
            held(name, impl, far, loops=True)


@pytest.mark.xslow
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.arena.mj_model.opt.. .* changed since")
@pytest.mark.parametrize("name", LOOPS)
def test_loops_drift(name):
    """MJX's own steps of the compiled models with loops: as far off C's as `DRIFT` says, within a factor of 2, and beyond rounding."""
    arena = prepared(name, "warp")
    for far in (0.2, -0.2):
        params = closed(arena, elsewhere(arena, far))
        model, rng = arena.compile(params), np.random.default_rng(0)
        control, start = controls(model, rng), begun(arena, params, model)
        run = functools.partial(moved, model, start)
        want = run(control)
        off = np.abs(of_mjx(model, "warp", start)(control) - want).max(1)
        assert DRIFT[0] / 2 < off.max() / np.abs(want).max() < DRIFT[1] * 2
        assert (off > within(model, run, control, want, rng)).any()


@pytest.mark.xslow
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.arena.mj_model.opt.. .* changed since")
@pytest.mark.parametrize("name", [*ROUNDED, *OTHERWISE])
def test_why_otherwise(name):
    """In double precision MJX's own steps of the compiled models are C's, where no actuator's force is at its limit.

    Limits of the Go1's joints amplify the solver's rounding, which shrinks with the precision. Servos of the UR5e are at limits of their
    forces, where C's implicit integrator leaves out their damping, and that of MJX on JAX does not (docs/upstream/implicit_limits.md).
    """
    arena = prepared(name, "jax")
    for far in (0.2, -0.2):
        params = elsewhere(arena, far)
        model, rng = arena.compile(params), np.random.default_rng(0)
        control, start = np.float32(controls(model, rng)), begun(arena, params, model)
        limited = model.actuator_forcelimited.any()
        if limited:
            off = np.abs(of_mjx(model, "jax", start)(control) - moved(model, start, control))
            assert off.max() > 0.1 * np.abs(moved(model, start, control)).max()
            model.actuator_forcelimited[:] = False
        run = functools.partial(moved, model, start)
        want = run(control)
        single = np.abs(of_mjx(model, "jax", start)(control) - want).max()
        with jax.enable_x64(True):
            double = np.abs(of_mjx(model, "jax", start)(control) - want).max()
        assert double <= 2.0**-29 * (FAR * single + within(model, run, control, want, rng).max())
