"""Arms reach, with the tool pointing down, what their tasks ask of them in the ranges of training and beyond them."""

import functools
import sys

import jax
import jax.numpy as jnp
import models
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

from mjx_arenas.envs import Lift, OpenDrawer, PickAndPlace, Reach, arms, chain, lift, open_drawer, pick_and_place, reach

pytestmark = pytest.mark.slow

N = 512
UP = jnp.array([0.0, 0.0, 1.0])


@functools.cache
def arm_of(name):
    """The robots of packages are beside the tests, not in the environment."""
    if name != "small" and not models.ROBOTS.exists():
        pytest.skip("needs tests/robots.txt")
    before, sys.path = sys.path, [*sys.path, str(models.ROBOTS)]
    try:
        return arms.ARMS[name]()
    finally:
        sys.path = before


def off(tool, pos, yaw):
    """(6,) from a tool to a place, pointing down, with a heading that looks the same from both sides."""
    heading = jnp.arctan2(tool.mat[1, 0], tool.mat[0, 0])
    turned = jnp.mod(yaw - heading + jnp.pi / 2, jnp.pi) - jnp.pi / 2
    return jnp.concatenate([pos - tool.pos, jnp.cross(tool.mat[:, 2], -UP) + UP * turned])


def reached(env, model, pos, yaw):
    """Whether inverse kinematics, from the keyframe on and within the joints' ranges, end at a place of the tool (3,)."""
    joints = [model.joint(name.removeprefix("arm_")) for name in env.arm_joints]
    low, high = np.array([joint.range for joint in joints]).T
    home = jnp.asarray([model.key("home").qpos[joint.qposadr[0]] for joint in joints])
    arm = chain.chain(model, env.arm.base, env.arm.tool)

    def one(q, _):
        at = chain.tool(arm, q)
        return jnp.clip(q + chain.steps(at.jacobian, jnp.clip(off(at, pos, yaw), -0.1, 0.1), 0.03), low, high), None

    at = chain.tool(arm, jax.lax.scan(one, home, length=120)[0])
    error = jnp.abs(off(at, pos, yaw))
    return (error[:3].max() < 0.005) & (error[3:].max() < 0.05) & (at.mat[2, 2] < 0)


def grasped(env, data):
    """Where the tool is to be on the object, and its heading: of four that are alike the one that turns it least."""
    pos, mat = env.thing(data)
    return pos, jnp.mod(jnp.arctan2(mat[1, 0], mat[0, 0]) + jnp.pi / 4, jnp.pi / 2) - jnp.pi / 4


def of_reach(env, data, episode):
    return [(episode.task.pos, 0.0)]


def of_lift(env, data, episode):
    pos, yaw = grasped(env, data)
    return [(pos, yaw), (pos + (lift.HEIGHT + 0.02) * UP, yaw)]


def of_pick_and_place(env, data, episode):
    pos, yaw = grasped(env, data)
    task, local = episode.task, functools.partial(env.local, data)
    rests = task.pos + task.above * UP
    high = jnp.maximum(task.start.top[2], task.below.top[2]) + pick_and_place.CLEARANCE + task.above
    world = data.qpos[env.arena.layout.object_qpos[0, :3]]
    return [(pos, yaw), (local(world.at[2].set(high)), yaw), (local(rests.at[2].set(high)), yaw), (local(rests), yaw)]


def of_open_drawer(env, data, episode):
    at, out = env.hook(data, episode)
    yaw, further = jnp.arctan2(out[1], out[0]), episode.task.goal - episode.task.start
    return [(at + open_drawer.OVER * UP, yaw), (at, yaw), (at + further * out, yaw)]


PLACES = {
    Reach: (reach, of_reach),
    Lift: (lift, of_lift),
    PickAndPlace: (pick_and_place, of_pick_and_place),
    OpenDrawer: (open_drawer, of_open_drawer),
}


@pytest.mark.parametrize("arm", ["small", "yam", "panda"])
@pytest.mark.parametrize("kind", PLACES)
def test_all_is_within_reach(kind, arm):
    module, places = PLACES[kind]
    for ranges in (module.training_ranges(), module.wider_ranges()):
        env = kind(config_overrides={"impl": "jax"}, arm=arm_of(arm), ranges=ranges)
        model = env.arm.spec.compile()

        def world(key, env=env, model=model):
            state = env.reset(key)
            asked = places(env, state.data, state.info["episode"])
            found = [reached(env, model, *place) for place in asked]
            return jnp.stack(found), state.info["episode"].valid

        found, valid = jax.jit(jax.vmap(world))(jax.random.split(jax.random.key(0), N))
        assert np.asarray(valid).mean() > 0.99
        assert np.asarray(found)[np.asarray(valid)].all(1).mean() >= 0.99, np.asarray(found).mean(0)
