"""A quadruped that stands on a floor: contacts, sensors and all that varies step as in C MuJoCo."""

import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from models import ARMS
from rounding import Rounding
from test_stepped import step
from whole import elsewhere

import mjx_arenas as mja
from mjx_arenas import dr

STEPS, RUNS, FAR, EPS = 20, 8, 5, 2.0**-23  # as in test_stepped.py
STANDING = {"hip": 0.0, "thigh": 0.9, "calf": -1.8}  # [rad]
DEPTH = 5e-4  # of the lowest foot in the floor, at the start [m]


def _legs(name):
    return "_foot_" in name


@functools.cache
def arena():
    """A Go1 of which only the feet touch the floor, with motors, and much that varies."""
    spec = mujoco.MjSpec.from_file(str(ARMS["go1"]))
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1], contype=0, conaffinity=1)
    for geom in spec.geoms:
        if geom.name != "floor":
            geom.contype, geom.conaffinity = int(_legs(geom.name)), 0
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
            motor = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            motor.set_to_position(kp=40, kv=1.0)
    foot = next(body for body in spec.bodies if body.name.endswith("calf"))
    foot.add_site(name="contact", pos=[0, 0, -0.213], size=[0.04, 0, 0])
    for kind, site in (("TOUCH", "contact"), ("ACCELEROMETER", "contact"), ("FORCE", "contact")):
        spec.add_sensor(
            name=kind, type=getattr(mujoco.mjtSensor, f"mjSENS_{kind}"), objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site
        )
    made = mja.Arena.from_xml(spec)
    attributes = [
        "body.mass",
        "body.ipos",
        "joint.damping",
        "joint.armature",
        "actuator.kp",
        "actuator.kv",
        "option.gravity",
    ]
    terms = {attribute.replace(".", "_"): dr.Term(attribute) for attribute in attributes}
    terms |= {
        f"{a}_{b}": dr.Term(f"{a}.{b}", ".*_foot_.*|floor")
        for a, b in (("geom", "friction"), ("geom", "solref"), ("geom", "solimp"), ("geom", "margin"))
    }
    terms |= {"feet": dr.Term("geom.size", ".*_foot_.*"), "legs": dr.Term("body.pos", ".*thigh|.*calf")}
    made.vary(**terms)
    return made


def standing(model):
    """(nq,) on four feet, the lowest of which is a little in the floor."""
    c = mujoco.MjData(model)
    for joint in range(1, model.njnt):
        c.qpos[model.jnt_qposadr[joint]] = STANDING[model.joint(joint).name.split("_")[1]]
    mujoco.mj_kinematics(model, c)
    feet = [g for g in range(model.ngeom) if _legs(model.geom(g).name)]
    c.qpos[2] -= min(c.geom_xpos[g, 2] - model.geom_size[g, 0] for g in feet) + DEPTH
    return np.array(c.qpos)


def moved(model, qpos, controls, rng=None):
    """(STEPS, nv), (STEPS, nsensordata) velocities and what is sensed in C; with `rng`, of a state that is rounded in each step."""
    c = mujoco.MjData(model)
    c.qpos[:] = qpos
    speeds, sensed = [], []
    for control in controls:
        c.ctrl[:] = control
        if rng is not None:
            for state in (c.qpos, c.qvel):
                state *= 1 + EPS * rng.choice([-1, 1], len(state))
        mujoco.mj_step(model, c)
        speeds.append(np.array(c.qvel))
        sensed.append(np.array(c.sensordata))
    return np.array(speeds), np.array(sensed)


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.arena.mj_model.opt.. .* changed since", "ignore:The arena. geoms are inside")
@pytest.mark.parametrize("far", [0.2, -0.2])
@pytest.mark.parametrize("impl", ["jax", "warp"], indirect=True)
def test_stands_as_in_c(impl, far):
    made = arena()
    option = made.mj_model.opt
    option.iterations, option.ls_iterations, option.tolerance = 100, 50, 1e-10
    params = elsewhere(made, far)
    model, rng = made.compile(params), np.random.default_rng(0)
    qpos = standing(model)
    controls = np.tile(qpos[7:], (STEPS, 1)) + rng.uniform(-0.3, 0.3, (STEPS, model.nu))
    batch = made.batch(made.put_model(impl), jax.tree.map(lambda x: np.stack([x, x]), params))
    data = mja.make_data(batch)
    data = data.replace(qpos=jnp.broadcast_to(jnp.asarray(qpos, jnp.float32), data.qpos.shape))
    got = [[], []]
    for control in controls:
        data = step(batch, data, jnp.asarray(control, jnp.float32))
        got[0].append(np.asarray(data.qvel[0], float))
        got[1].append(np.asarray(data.sensordata[0], float))
    start = np.asarray(jnp.asarray(qpos, jnp.float32), float)
    want = moved(model, start, controls)
    assert n_contacts(model, start) == 4
    error = Rounding(model, mujoco.MjData(model)).error
    parts = [slice(a, a + n) for a, n in zip(model.sensor_adr, model.sensor_dim, strict=True)]
    runs = [moved(model, start, controls, rng) for _ in range(RUNS)]
    for which, columns in ((0, [slice(None)]), (1, parts)):
        for part in columns:
            exact = want[which][:, part]
            rounding = np.max([np.abs(run[which][:, part] - exact).max(1) for run in runs], axis=0)
            allowed = FAR * np.maximum.accumulate(rounding + error * np.abs(exact).max(1))
            off = np.abs(np.array(got[which])[:, part] - exact).max(1)
            assert (off <= allowed).all(), (which, part, off / allowed)


def n_contacts(model, qpos):
    """How many contacts there are at the start."""
    c = mujoco.MjData(model)
    c.qpos[:] = qpos
    mujoco.mj_forward(model, c)
    return c.ncon
