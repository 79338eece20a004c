"""Arms whose links differ from world to world: tasks have the tool where each world has it, as C MuJoCo does."""

import functools
import types

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.envs import Reach
from mjx_arenas.envs.base import Episode
from mjx_arenas.envs.tasks import reach
from mjx_arenas.sim.data import blank

N = 3
LINKS = {  # what there is to vary between an arm's base and its tool
    "links": ("body.pos", "arm_(upper|fore|wrist|hand)", 0.04),
    "bends": ("body.rpy", "arm_(fore|hand)", 0.1),
    "anchors": ("joint.pos", "arm_(shoulder|elbow)", 0.02),
    "axes": ("joint.axis", "arm_(elbow|roll)", 0.1),
    "zeros": ("joint.ref", "arm_(shoulder|elbow)", 0.1),
    "tool": ("site.pos", "arm_tool", 0.02),
    "tool_turned": ("site.rpy", "arm_tool", 0.2),
}


def varied(names=LINKS, impl="jax", **more):
    """Reach with an arm some of whose numbers vary; its table and its start do, too."""
    terms = {name: dr.Term(attribute, of) for name, (attribute, of, _) in LINKS.items() if name in names}
    ranges = reach.training_ranges()
    of_terms = {name: mja.Uniform(-LINKS[name][2], LINKS[name][2], relative="add") for name in names}
    ranges = ranges._replace(terms={**ranges.terms, **of_terms})
    return Reach(config_overrides={"impl": impl, **more}, ranges=ranges, terms=terms)


def pose(env, data):
    """(3,) and (3, 3) of the tool in the frame of the arm's base, by C MuJoCo."""
    base, tool = data.body("arm_base"), data.site(f"arm_{env.arm.tool}")
    turned = base.xmat.reshape(3, 3).T
    return turned @ (tool.xpos - base.xpos), turned @ tool.xmat.reshape(3, 3)


def tools(env, state):
    """(W, 3) and (W, 3, 3) these of recompiled worlds."""
    poses = []
    params, qpos = jax.device_get((state.info["episode"].params, state.data.qpos))
    for w in range(len(qpos)):
        model = env.arena.compile(jax.tree.map(lambda x, w=w: x[w], params))
        data = mujoco.MjData(model)
        data.qpos[:] = qpos[w]
        mujoco.mj_kinematics(model, data)
        poses.append(pose(env, data))
    return map(np.array, zip(*poses, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("impl", ["jax", "warp"])
def test_tools_are_where_each_world_has_them(impl):
    """At the start and after a step: what policies see, the pose, and the distance to the goal by which they are judged."""
    env = varied(impl=impl)
    keys = jax.random.split(jax.random.key(3), N)
    state, step = jax.jit(jax.vmap(env.reset))(keys), jax.jit(jax.vmap(env.step))
    for n_steps in range(2):
        if n_steps:
            state = step(state, jnp.full((N, 5), 0.7))
        pos, mat = tools(env, state)
        episode = state.info["episode"]
        seen = jax.vmap(env.hand)(state.data, episode).tool
        np.testing.assert_allclose(seen.pos, pos, atol=2e-6)
        np.testing.assert_allclose(seen.mat, mat, atol=5e-6)
        assert np.ptp(pos, axis=0).max() > 0.02
        away = np.asarray(episode.task.pos) - pos
        np.testing.assert_allclose(state.obs["state"][:, -3:], away, atol=2e-6)
        if n_steps:
            np.testing.assert_allclose(state.metrics["distance"], np.linalg.norm(away, axis=1), atol=2e-6)


@functools.cache
def at_nominal():
    """The tool's pose by the nominal arm."""
    env = Reach()
    return jax.jit(lambda state: env.hand(types.SimpleNamespace(**state)).tool)


@functools.cache
def alone(name):
    return varied([name])


def in_c(env):
    """A state of a random world, as the task is given it, its episode, and the same in C."""
    key = jax.random.key(5)
    params = env.arena.sample_params(key, env.ranges)
    model = env.arena.compile(params)
    fields = {
        name: jnp.asarray(getattr(model, name), jnp.float32)
        for name in jax.eval_shape(env.arena_fields, env.mjx_model)
        if "." not in name
    }
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(env.keyframe).id)
    data.qpos[:5] += np.array([0.3, -0.2, 0.4, 0.5, -0.6])
    mujoco.mj_kinematics(model, data)
    state = {x: jnp.array(getattr(data, x), jnp.float32) for x in ("qpos", "qvel", "ctrl")}
    episode = Episode(params, fields, state["qpos"], None, jnp.ones((), bool), key)
    return state, episode, data


@pytest.mark.slow
@pytest.mark.parametrize("name", LINKS)
def test_each_of_them_counts(name):
    """Alone, too, by C MuJoCo. Without the episode a pose is refused, not taken for the nominal arm's."""
    env = alone(name)
    state, episode, data = in_c(env)
    pos, mat = pose(env, data)
    seen = jax.jit(lambda state, episode: env.hand(types.SimpleNamespace(**state), episode).tool)(state, episode)
    np.testing.assert_allclose(seen.pos, pos, atol=2e-6)
    np.testing.assert_allclose(seen.mat, mat, atol=5e-6)
    nominal = at_nominal()(state)
    assert max(np.abs(nominal.pos - pos).max(), np.abs(nominal.mat - mat).max()) > 0.001
    for asked in (env.hand, env.proprioception):
        with pytest.raises(ValueError, match=r"^`episode` must be that of the world, .* got None\.$"):
            asked(types.SimpleNamespace(**state))


def test_policies_that_see_pictures(monkeypatch):
    """They get the same pose, from a `proprioception` that takes the episode."""
    env = alone("tool")
    state, episode, _ = in_c(env)
    episode = episode._replace(task=jax.jit(env.draw_task)(episode.key, episode.params, state["qpos"]))
    data = blank(env.mj_model).replace(**state)
    own = jax.jit(lambda *x: env._observed(*x))(data, episode)["state"][:-3]
    monkeypatch.setattr(env, "_eyes", object())
    np.testing.assert_allclose(jax.jit(lambda *x: env._observed(*x))(data, episode)["state"], own, atol=1e-6)


def test_nominal_links():
    """Nothing is read of the episode where no link varies, whatever else of the arm and the arena does, or where ranges do not say so."""
    base = {"base": dr.Term("body.pos", "arm_base")}
    ranges = mja.ArenaRanges(terms={"base": mja.Uniform(-0.01, 0.01, relative="add")})
    with pytest.warns(UserWarning, match="varies nothing"):
        still = Reach(terms={"links": dr.Term("body.pos", "arm_hand")})
    for env in (Reach(robot_strength=1.0), Reach(terms=base, ranges=ranges), still):
        data = types.SimpleNamespace(qpos=jnp.zeros(env.mj_model.nq), qvel=jnp.zeros(env.mj_model.nv))
        assert env.hand(data).tool.pos.shape == (3,)
