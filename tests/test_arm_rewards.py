"""Rewards of tasks of arms are those of docs/arms.md: in states made by hand, by plain formulas of what C MuJoCo says of them.

Neither they nor what policies see tell how high the tables are.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

import mujoco

import mjx_arenas as mja
from mjx_arenas.envs import Lift, OpenDrawer, PickAndPlace, Reach
from mjx_arenas.envs.base import Episode
from mjx_arenas.sim.data import blank

# A metre changes no reward by more than 30. Distances are up to 1e-6 m too long, so that they have derivatives at 0, and places are
# rounded to 1e-6 m in single precision after ten products.
OFF = 30 * 2e-6
STILL = [0.0, 0.0, 0.0, 0.0, 1.0]


@functools.cache
def made(kind):
    """An environment, the parameters of a random world, and what it draws there."""
    env = kind(config_overrides={"impl": "warp"})
    params = env.arena.sample_params(mja.world_keys(3, [0])[0], env.ranges)
    _, data = env.arena.c_world(params, keyframe="arm_home")
    task = jax.jit(env.draw_task)(jax.random.key(1), params, jnp.asarray(data.qpos, jnp.float32))
    return env, params, jax.device_get(task)


def world(env, params, **places):
    """The world in C, with the arm at home and some joints at other positions, with velocities."""
    model, data = env.arena.c_world(params, keyframe="arm_home")
    for name, (position, velocity) in places.items():
        joint = data.joint(name)
        joint.qpos[: len(np.atleast_1d(position))] = position
        joint.qvel[: len(np.atleast_1d(velocity))] = velocity
    mujoco.mj_forward(model, data)
    return data


def score(env, params, task, data, action):
    """What the task says of a state in C."""
    seen, episode = of_mjx(env, params, task, data)
    return jax.device_get(scored(env)(seen, episode, jnp.asarray(action)))


def of_mjx(env, params, task, data):
    """A state in C and its episode, as the task is given them."""
    given = {name: jnp.asarray(getattr(data, name), jnp.float32) for name in ("qpos", "qvel", "ctrl", "xpos")}
    seen = blank(env.mj_model).replace(**given, xmat=jnp.asarray(data.xmat, jnp.float32).reshape(-1, 3, 3))
    return seen, Episode(params, {}, seen.qpos, task, jnp.ones((), bool), jax.random.key(0))


@functools.cache
def scored(env):
    return jax.jit(env.score)


def cost(action):
    return 0.005 * np.sum(np.square(action))


def size(vector):
    return float(np.linalg.norm(vector))


def test_reach():
    env, params, _ = made(Reach)
    data = world(env, params)
    base, tool = data.body("arm_base"), data.site("arm_tool").xpos
    for off, action in (([0, 0, 0], STILL), ([0.015, 0, -0.01], STILL), ([0.1, -0.2, 0.05], [0.5, -1, 0.2, 1, 0])):
        goal = base.xmat.reshape(3, 3).T @ (tool + off - base.xpos)
        reward, ends, metrics = score(env, params, type(made(Reach)[2])(jnp.asarray(goal, jnp.float32)), data, action)
        d = size(off)
        np.testing.assert_allclose(reward, 1 - np.tanh(8 * d) + (d < 0.02) - cost(action), atol=OFF)
        assert (bool(ends), float(metrics["success"])) == (False, d < 0.02)


# Where the object is beside the tool, how much higher than it stood [m], and the action.
LIFTED = [
    ([0, 0, 0], 0.0, [0, 0, 0, 0, -1]),  # gripped
    ([0.005, 0, -0.005], 0.0, [0.3, 0, -0.7, 0, -0.2]),  # half gripped
    ([0, 0.015, 0], 0.05, STILL),  # half as high as it is to be, and not gripped
    ([0, 0, -0.03], 0.02, [0, 0, 0, 0, -1]),  # below what a grip holds
    ([0.01, 0, 0], 0.12, [0, 0, 0, 1, -1]),  # lifted
    ([0.059, 0, 0], 0.12, STILL),  # barely held
    ([0.05, 0.035, 0], 0.12, STILL),  # thrown
    ([0.2, 0, 0], -0.05, STILL),
    ([0.2, 0, -0.3], -0.12, STILL),  # fallen
]


def test_lift():
    env, params, task = made(Lift)
    tool = world(env, params).site("arm_tool").xpos.copy()
    for off, height, action in LIFTED:
        data = world(env, params, box_joint0=(tool + off, 0))
        stood = task._replace(height=np.float32(tool[2] + off[2] - height))
        reward, ends, metrics = score(env, params, stood, data, action)
        d, close = size(off), (1 - action[4]) / 2
        success = d < 0.06 and height > 0.1
        plain = 0.4 * (1 - np.tanh(6 * d)) + 0.3 * max(1 - d / 0.02, 0) * close
        plain += np.clip(height / 0.1, 0, 1) * (d < 0.06) + success - cost(action)
        np.testing.assert_allclose(reward, plain, atol=OFF)
        assert (bool(ends), float(metrics["success"])) == (height < -0.1, success)


# Where the object is beside the goal, at rest there, and where the tool is beside the object [m], the object's speed [m/s], and the grip.
CARRIED = [
    ([0, 0, 0], [0, 0, 0], 0.0, -1),  # placed, and held
    ([0, 0, 0], [0, 0, 0], 0.0, 0.4),  # placed, and told to open
    ([0.03, 0, 0.005], [0, 0, 0.05], 0.05, 1),
    ([0, 0.03, 0], [0, 0, 0.2], 0.0, 1),  # let go
    ([0.06, 0, 0], [0, 0, 0.2], 0.0, 1),  # beside the goal
    ([0, 0, 0.02], [0, 0, 0.2], 0.0, 1),  # above it
    ([0, 0, 0], [0, 0, 0.2], 0.2, 1),  # on its way
    ([0.1, 0, 0.05], [0.01, 0, 0], 0.0, -1),  # coming down, gripped
    ([0.2, -0.3, 0.1], [0, 0.005, 0.005], 0.0, -0.2),  # high, half gripped
    ([0.2, -0.3, 0.1], [0, 0.005, 0.005], 0.0, 1),  # between open fingers
    ([0.9, 0, 0.1], [0.02, 0, 0], 0.0, -1),  # beside closed ones
    ([0.3, 0.1, -0.6], [0.3, 0, 0], 0.0, -1),  # fallen
]


def test_pick_and_place():
    env, params, task = made(PickAndPlace)
    arm = world(env, params).site("arm_tool").xpos.copy()
    tops, largest = [task.start.top[2], task.below.top[2]], np.max(params.object_full_sizes[0])
    for off, tool, speed, grip in CARRIED:
        action, box = [0.0, 0.0, 0.0, 0.0, grip], arm - tool
        goal = box - off - [0, 0, task.above]
        moved = goal[2] - task.below.top[2]  # both surfaces, with the goal
        surfaces = {
            name: getattr(task, name)._replace(top=getattr(task, name).top + np.float32([0, 0, moved]))
            for name in ("start", "below")
        }
        data = world(env, params, box_joint0=(box, [0, speed, 0]))
        reward, ends, metrics = score(env, params, task._replace(pos=np.float32(goal), **surfaces), data, action)
        d, aside, rest = size(tool), size(off[:2]), goal[2] + task.above
        high = max(tops) + moved + 0.08 + task.above
        e = abs(box[2] - (rest + np.clip((aside - 0.05) / 0.1, 0, 1) * (high - rest)))
        placed, free = aside < 0.05 and abs(off[2]) < 0.01 and speed < 0.1, 0.03 + largest / 2
        fallen = box[2] < min(tops) + moved - 0.1
        taken = 0.3 * (1 - np.tanh(6 * d)) + 0.3 * max(1 - d / 0.02, 0) * (1 - grip) / 2
        plain = 0.6 + 0.3 * (1 + grip) / 2 + 0.5 * min(d / free, 1) if placed else taken
        plain += (1 - np.tanh(8 * e)) * (0.3 + 1.5 * max(1 - aside / 0.8, 0))
        plain += 2 * (placed and d > free) - 5 * fallen - cost(action)
        np.testing.assert_allclose(reward, plain, atol=OFF)
        assert (bool(ends), float(metrics["success"])) == (fallen, placed and d > free)


def hook(data):
    """(3,) 2.5 cm behind the front of the upper drawer, and 2 cm below its edge."""
    front = data.model.geom("unit_drawer2_front")
    mat = data.geom(front.id).xmat.reshape(3, 3)
    return data.geom(front.id).xpos + mat @ (front.size * [1, 0, 1] + [0.025, 0, -0.02])


# Where the hook point is beside the tool [m], and how far the drawer has been opened, as a share of the way.
OPENED = [
    ([0, 0, 0], 0.0),
    ([0.01, 0, 0.02], 0.5),  # above it
    ([0.03, 0, -0.05], 0.0),  # on the way down
    ([0.1, 0.05, 0], 0.0),
    ([0, 0.01, 0], 1.0),  # open
    ([0, 0, 0.01], 1.5),  # too far
    ([0.2, 0, 0.1], -1.5),
]


@pytest.mark.slow
def test_open_drawer():
    env, params, task = made(OpenDrawer)
    tool = world(env, params).site("arm_tool").xpos.copy()
    for off, share in OPENED:
        opening = task.start + share * (task.goal - task.start)
        slide = {"unit_drawer2": (opening, 0)}
        place = np.asarray(params.terms["unit.pos"]) + tool + off - hook(world(env, params, **slide))
        moved = params._replace(terms={**params.terms, "unit.pos": jnp.asarray(place, jnp.float32)})
        data = world(env, moved, **slide)
        away = hook(data) - tool
        np.testing.assert_allclose(away, off, atol=1e-6)
        reward, ends, metrics = score(env, moved, task, data, STILL)
        over = 0.07 * np.clip((size(away[:2]) - 0.015) / 0.045, 0, 1)
        error = abs(task.goal - opening)
        plain = 0.4 * (1 - np.tanh(6 * size(np.add(away, [0, 0, over])))) + (error < 0.02) - cost(STILL)
        plain += max(1 - error / (task.goal - task.start), -1)
        np.testing.assert_allclose(reward, plain, atol=OFF)
        assert (bool(ends), float(metrics["success"])) == (False, error < 0.02)


RAISED = 0.37  # [m]


@pytest.mark.slow
@pytest.mark.parametrize("kind", [Reach, Lift, PickAndPlace, OpenDrawer])
def test_heights_of_tables_are_not_seen(kind):
    """Where all tables, and all that stands on them or on the floor, are raised, policies see the same, and get the same reward.

    Critics do, too, but for the two surfaces of `PickAndPlace`, which they see in the frame of the world.
    """
    env, params, _ = made(kind)
    raised = params._replace(table_offsets=params.table_offsets + jnp.array([0, 0, RAISED]))
    if kind is OpenDrawer:
        raised = raised._replace(
            terms={**params.terms, "unit.pos": params.terms["unit.pos"] + jnp.array([0, 0, RAISED])}
        )
    found = []
    for each in (params, raised):
        data = world(env, each, **{f"arm_{name}": (0.2, 0.3) for name in ("turret", "shoulder", "elbow")})
        data.qvel[:] = np.linspace(-0.1, 0.1, len(data.qvel))
        data.ctrl[:] = np.linspace(-0.1, 0.1, len(data.ctrl))
        task = jax.jit(env.draw_task)(jax.random.key(1), each, jnp.asarray(data.qpos, jnp.float32))
        state, episode = of_mjx(env, each, task, data)
        reward = score(env, each, task, data, STILL)[0]
        found.append((data.body("arm_base").xpos[2], reward, jax.device_get(jax.jit(env.observe)(state, episode))))
    (low, before, saw), (high, after, sees) = found
    assert high - low == pytest.approx(RAISED, abs=1e-6)
    np.testing.assert_allclose(after, before, atol=OFF)
    np.testing.assert_allclose(sees["state"], saw["state"], atol=2e-6)
    known = np.zeros_like(saw["privileged_state"])
    if kind is PickAndPlace:
        known[len(saw["state"]) + np.array([2, 9])] = RAISED
    np.testing.assert_allclose(sees["privileged_state"] - saw["privileged_state"], known, atol=2e-6)
