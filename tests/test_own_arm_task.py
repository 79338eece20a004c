"""The task of docs/how_to/own_arm_task.md: it goes by the middle of the box, in the arm's frame, and is trained from its file."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pages
import pytest

pytest.importorskip("mujoco_playground")

from mjx_arenas import settings
from mjx_arenas.envs.base import Episode
from mjx_arenas.envs.tasks import configured
from mjx_arenas.sim.data import blank

PAGE = "docs/how_to/own_arm_task.md"


@pytest.fixture
def push_aside(tmp_path, monkeypatch):
    """The module of the page."""
    (tmp_path / "push_aside.py").write_text(pages.blocks(PAGE)[0][0])
    monkeypatch.syspath_prepend(tmp_path)
    return configured.environment({"task": "push_aside:PushAside", "impl": "warp", "sees": "numbers"})


def test_the_task_of_the_page(push_aside):
    env = push_aside
    params, model = env.arena.nominal_params(), env.mj_model
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(env.keyframe).id)
    at = env.arena.layout.object_qpos[0]
    data.qpos[at[:3]] = [0.1, 0.05, 0.83]
    mujoco.mj_forward(model, data)
    qpos = jnp.asarray(data.qpos, jnp.float32)
    tasks = jax.vmap(lambda key: env.draw_task(key, params, qpos))(jax.random.split(jax.random.key(0), 200))
    away = np.asarray(tasks.pos) - data.qpos[at[:3]]
    assert tasks.possible.all()
    assert not env.draw_task(jax.random.key(0), params, qpos.at[at[0]].set(0.44)).possible  # out of reach
    np.testing.assert_allclose(away[:, [0, 2]], 0, atol=1e-6)
    assert ((np.abs(away[:, 1]) >= 0.1 - 1e-6) & (np.abs(away[:, 1]) <= 0.15 + 1e-6)).all()
    assert 60 < (away[:, 1] > 0).sum() < 140
    seen = blank(model).replace(
        qpos=qpos,
        qvel=jnp.zeros(model.nv),
        ctrl=jnp.asarray(data.ctrl),
        xpos=jnp.asarray(data.xpos, jnp.float32),
        xmat=jnp.asarray(data.xmat, jnp.float32).reshape(-1, 3, 3),
    )
    task = jax.tree.map(lambda x: x[0], tasks)
    base, tool = data.body("arm_base"), data.site("arm_tool").xpos
    box = base.xmat.reshape(3, 3).T @ (data.qpos[at[:3]] - base.xpos)
    for shift, success, ends in ((away[0], True, False), ([0, 0, 0], False, False), ([0, 0, -0.2], False, True)):
        moved = seen.replace(qpos=qpos.at[at[:3]].add(jnp.asarray(shift)))
        episode = Episode(params, {}, qpos, task, jnp.ones((), bool), jax.random.key(0))
        reward, fallen, metrics = env.score(moved, episode, jnp.zeros(5))
        distance, reach = (np.linalg.norm(x) for x in (shift - away[0], tool - data.qpos[at[:3]] - shift))
        assert (bool(metrics["success"]), bool(fallen)) == (success, ends)
        np.testing.assert_allclose(metrics["distance"], distance, atol=2e-6)
        want = 0.3 * (1 - np.tanh(6 * reach)) + 1 - np.tanh(8 * distance) + success
        np.testing.assert_allclose(reward, want, atol=1e-5)
    state = env.observe(seen, episode)["state"]
    np.testing.assert_allclose(state[-3:], base.xmat.reshape(3, 3).T @ away[0], atol=1e-6)
    np.testing.assert_allclose(state[-6:-3], box - base.xmat.reshape(3, 3).T @ (tool - base.xpos), atol=1e-5)


def test_it_is_trained_from_its_file(push_aside):
    """As the command of the page does."""
    data = settings.settled(settings.read(settings.find("push_aside:PushAside")), gpu=False, pixels=False)
    assert settings.problem(settings.configuration(data, "warp", False), 1) is None
    state = jax.eval_shape(
        jax.vmap(push_aside.step),
        *jax.eval_shape(
            lambda keys: (jax.vmap(push_aside.reset)(keys), jnp.zeros((2, push_aside.action_size))),
            jax.random.split(jax.random.key(0)),
        ),
    )
    assert state.reward.shape == (2,)
