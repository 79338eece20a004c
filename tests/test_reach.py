"""Arms reach, with the tool pointing down, what their tasks ask of them in the ranges of training and beyond them."""

import dataclasses
import functools
import sys

import jax
import jax.numpy as jnp
import models
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

from mjx_arenas.envs import Lift, OpenDrawer, PickAndPlace, Reach, arms
from mjx_arenas.envs.arms import chain, moves
from mjx_arenas.envs.arms.report import SPACING
from mjx_arenas.envs.tasks import lift, open_drawer, pick_and_place, reach

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


def reached(env, model, pos, yaw):
    """Whether inverse kinematics, from the keyframe on and within the joints' ranges, end at a place of the tool (3,)."""
    joints = [model.joint(name.removeprefix("arm_")) for name in env.arm_joints]
    limits = jnp.array([joint.range for joint in joints]).T
    home = jnp.asarray([model.key("home").qpos[joint.qposadr[0]] for joint in joints])
    away, turned = chain.errors(chain.chain(model, env.arm.base, env.arm.tool), home, limits, pos, yaw)
    return (away < moves.NEAR) & (turned < moves.STRAIGHT)


def grasped(env, data, episode):
    """Where the tool is to be on the object, and its heading: of four that are alike the one that turns it least."""
    pos, mat = env.thing(data, episode)
    return pos, jnp.mod(jnp.arctan2(mat[1, 0], mat[0, 0]) + jnp.pi / 4, jnp.pi / 2) - jnp.pi / 4


def of_reach(env, data, episode):
    return [(episode.task.pos, 0.0)]


def of_lift(env, data, episode):
    pos, yaw = grasped(env, data, episode)
    return [(pos, yaw), (pos + (lift.HEIGHT + 0.02) * UP, yaw)]


def of_pick_and_place(env, data, episode):
    pos, yaw = grasped(env, data, episode)
    task, local = episode.task, functools.partial(env.local, data)
    rests = task.pos + task.above * UP
    high = jnp.maximum(task.start.top[2], task.below.top[2]) + pick_and_place.CLEARANCE + task.above
    world = env.middle(episode.params, data.qpos)
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


@pytest.mark.parametrize("arm", ["small", *(pytest.param(arm, marks=pytest.mark.xslow) for arm in ("yam", "panda"))])
@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=[pytest.mark.xslow] * (kind is not Reach)) for kind in PLACES]
)
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


def test_check():
    """The small arm does what it says, and goes as far as its links do; one that promises more, or starts askew, is told."""
    report = arms.check(arms.small())
    assert report.ok
    assert report.reached == 1
    assert report.worst_error < 1e-3
    shoulder, wrist = 0.14, 0.145  # [m] heights above the base, and above the tool
    links = 2 * 0.32 * np.cos((np.pi / 2 - 1.4) / 2)  # [m] at the elbow's limit
    furthest = np.sqrt(links**2 - (moves.HEIGHTS[1] + wrist - shoulder) ** 2)
    assert furthest - SPACING - 0.01 < report.reach[1] <= furthest + moves.NEAR
    assert arms.check(dataclasses.replace(arms.small(), reach=(0.3, 0.305))).reached == 1  # less than `SPACING`
    far = arms.check(dataclasses.replace(arms.small(), reach=(0.22, 0.7)))
    assert not far.ok
    assert 0.5 < far.reached < 1
    assert far.worst_error > 0.05
    assert far.reach[1] == pytest.approx(report.reach[1], abs=SPACING)
    assert "give a `reach`" in str(far)
    high = str(arms.check(dataclasses.replace(arms.small(), rise=0.9)))
    assert "distances: at no distance does it reach all of them: give another `rise` or another keyframe" in high
    bent = arms.small()
    bent.spec.key("home").qpos = np.array(bent.spec.key("home").qpos) - 2.0 * (np.arange(7) == 2)  # the elbow
    says = r"^`arm\.spec`: joints start outside of their ranges: joint 'elbow' at -1\.8 of -1\.4 to 1\.4 in keyframe 'home'\.$"
    with pytest.warns(UserWarning, match=says):
        arms.check(bent)
    skew = arms.small()
    home = skew.spec.key("home")
    home.qpos = np.array(home.qpos) + 0.5 * (np.arange(len(home.qpos)) == 3)  # the wrist
    skew = arms.check(skew)
    assert not skew.ok
    assert skew.tilt == pytest.approx(0.5, abs=1e-3)
    for line in ("28.6 degrees", "9.0 cm"):
        assert line in str(skew)
    assert "turn the site" not in str(skew)
    over = arms.small()
    over.spec.site("tool").alt.euler = (0, 0, 0)  # it was turned by pi about x
    over = arms.check(over)
    assert not over.ok
    assert ": turn the site of the tool first" in str(over)
    assert "give a `reach`" not in str(over)
    assert "180.0 degrees, so its z axis points up: turn the site, whose z axis must point away" in str(over)
    none = arms.small()
    none.spec.delete(none.spec.key("home"))
    with pytest.raises(
        ValueError, match=r"`arm.spec` must be a spec with a keyframe 'home': envs\.arms\.ready adds it"
    ):
        arms.check(none)
