"""Tasks go by the middle of an object: one whose origin is elsewhere is as good as one whose origin is its middle."""

import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

import mjx_arenas as mja
from mjx_arenas import quaternions
from mjx_arenas.envs import Lift, PickAndPlace, Transfer
from mjx_arenas.envs.base import Episode
from mjx_arenas.envs.tasks import goals, manipulation
from mjx_arenas.sim.data import blank

SIDES, FRICTION, MASS = np.array([0.04, 0.05, 0.06]), [0.8, 0.005, 0.0001], 0.1
ORIGIN = np.array([0.01, -0.015, -0.03])  # [m] from the middle: at the bottom, beside its middle
OFF = f"""<mujoco><worldbody><geom type="box" size="{" ".join(map(str, SIDES / 2))}" pos="{" ".join(map(str, -ORIGIN))}"
mass="{MASS}" friction="{" ".join(map(str, FRICTION))}"/></worldbody></mujoco>"""
KINDS = {
    "in the middle": {"full_size": SIDES, "mass": MASS, "friction": FRICTION},
    "elsewhere": {"type": "mjcf", "file": OFF, "mass": MASS},
}


@functools.cache
def made(kind, where):
    given = dict(KINDS[where])
    if "file" in given:
        given["file"] = mujoco.MjSpec.from_string(OFF)
    box = mja.Object("box", pos=(0.05, 0.0), **given)
    arena = mja.MultiTableArena(
        [[0.42, -0.27, 0.75], [0.42, 0.27, 0.8]], table_full_sizes=(0.42, 0.44, 0.05), objects=[box]
    )
    arena.spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    more = {} if kind is Transfer else {"pos": (0.0, 0.0, 0.75)}
    return kind(arena=arena, config_overrides={"impl": "warp"}, **more)


def told(kind, where, middle, yaw):
    """What the task says of a box in a place: whether it is possible there at the start, observations, and score."""
    env = made(kind, where)
    at, params = env.arena.layout.object_qpos[0], env.arena.nominal_params()
    quat = np.array([np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)])
    origin = np.zeros(3) if where == "in the middle" else ORIGIN
    keyframe = np.zeros(env.mj_model.nq) if env.keyframe is None else env.mj_model.key(env.keyframe).qpos

    @jax.jit
    def run(middle):
        qpos = jnp.asarray(keyframe, jnp.float32)
        pose = jnp.concatenate([middle + quaternions.quat_rotate(jnp.asarray(quat), jnp.asarray(origin)), quat])
        start = qpos.at[at].set(jnp.concatenate([jnp.array([0.42, -0.27, 0.78]) + origin, jnp.array([1.0, 0, 0, 0])]))
        task = env.draw_task(jax.random.key(3), params, start)
        kinematics = mujoco.MjData(env.mj_model)
        kinematics.qpos = keyframe
        mujoco.mj_kinematics(env.mj_model, kinematics)
        data = blank(env.mj_model).replace(
            qpos=qpos.at[at].set(pose),
            xpos=jnp.asarray(kinematics.xpos, jnp.float32),
            xmat=jnp.asarray(kinematics.xmat, jnp.float32).reshape(-1, 3, 3),
        )
        episode = Episode(params, {}, start, task, jnp.ones((), bool), jax.random.key(0))
        action = jnp.zeros(env.action_size).at[-1].set(-1.0)
        return getattr(task, "possible", True), env.observe(data, episode), env.score(data, episode, action), task

    return jax.device_get(run(jnp.asarray(middle, jnp.float32)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", [Lift, PickAndPlace])
def test_an_object_whose_origin_is_elsewhere(kind):
    """Near the tool, lifted, at its goal, and fallen."""
    tool = tool_at_home(kind)
    goal = told(kind, "in the middle", tool, 0.0)[3]
    places = [tool + np.array([0.005, 0.0, 0.0]), tool + np.array([0.0, 0.1, 0.05]), np.array([0.4, 0.27, 0.2])]
    if kind is PickAndPlace:
        places.append(goal.pos + np.array([0.0, 0.0, SIDES[2] / 2]))
    for middle in places:
        both = [told(kind, where, middle, 0.4)[:3] for where in KINDS]
        for a, b in zip(*map(jax.tree.leaves, both), strict=True):
            np.testing.assert_allclose(a, b, atol=5e-6, rtol=2e-5)
    assert both[0][2][2]["success"] == (kind is PickAndPlace)


def tool_at_home(kind):
    """(3,) where the tool is in the keyframe [m]."""
    env = made(kind, "in the middle")
    data = mujoco.MjData(env.mj_model)
    mujoco.mj_resetDataKeyframe(env.mj_model, data, env.mj_model.key(env.keyframe).id)
    mujoco.mj_kinematics(env.mj_model, data)
    return data.site(manipulation.PREFIX + env.arm.tool).xpos.copy()


@pytest.mark.parametrize("where", KINDS)
def test_velocity_of_the_middle(where):
    """That of its geom in C MuJoCo, while it turns and flies."""
    env = made(Lift, where)
    data, row = mujoco.MjData(env.mj_model), env.arena.layout.object_qpos[0]
    joint = env.mj_model.joint(env.arena.objects[0].joint).dofadr[0]
    data.qpos[row[3:]] = np.array([0.5, -0.1, 0.7, 0.3]) / np.sqrt(0.84)
    data.qvel[joint : joint + 6] = [0.1, -0.2, 0.3, 1.0, -2.0, 3.0]
    mujoco.mj_forward(env.mj_model, data)
    geom, want = env.mj_model.body("box").geomadr[0], np.zeros(6)
    mujoco.mj_objectVelocity(env.mj_model, data, mujoco.mjtObj.mjOBJ_GEOM, geom, want, 0)
    seen = blank(env.mj_model).replace(qpos=jnp.asarray(data.qpos), qvel=jnp.asarray(data.qvel))
    found = goals.middle_velocity(env.arena, env.arena.nominal_params(), seen)
    np.testing.assert_allclose(found, want[3:], atol=1e-6)


@pytest.mark.parametrize("where", KINDS)
def test_rest_at_the_goal_of_transfer(where):
    """Success is rest on the goal, wherever its origin is."""
    goal = told(Transfer, where, np.zeros(3), 0.0)[3].pos
    for high, success in ((0.0, 1), (0.015, 0)):
        middle = goal + np.array([0.0, 0.0, SIDES[2] / 2 + high])
        assert told(Transfer, where, middle, 0.0)[2][2]["success"] == success
