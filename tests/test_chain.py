"""Arms as chains of joints: tools are where C MuJoCo has them, move as its Jacobians say, and go where they are to."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from mjx_arenas.envs.arms import chain

CRANE = """<mujoco><compiler angle="radian"/><worldbody><body name="below" pos=".1 .2 .3" euler=".1 .2 .3">
  <body name="base" pos="1 2 3" euler=".3 0 1">
  <body name="mount" pos="0 0 .1" euler="0 .2 0">
  <body pos=".1 0 .2" euler=".4 .5 .6"><joint name="turn" axis="0 1 1" pos=".02 .01 -.03" ref=".3"/><geom size=".05"/>
  <body pos="0 .1 .1" quat=".5 .5 .5 -.5"><joint name="out" type="slide" axis="1 0 2" ref="-.1"/><geom size=".05"/>
  <body pos=".1 0 0"><geom size=".05"/>
  <body pos="0 0 .2" euler="1 0 0"><joint name="bend" axis="1 0 0"/><geom size=".05"/>
  <site name="tool" pos=".1 .2 .3" euler=".7 0 .1"/>
  <body name="two"><joint axis="1 0 0"/><joint axis="0 1 0"/><geom size=".05"/><site name="far"/>
  <body name="ball"><joint type="ball"/><geom size=".05"/></body></body>
  </body></body></body></body></body></body></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def crane():
    model = mujoco.MjModel.from_xml_string(CRANE)
    return model, chain.chain(model, "base", "tool")


def test_as_in_c(crane):
    """Place, axes and Jacobian, in the frame of the base."""
    model, arm = crane
    assert arm.joints == ("turn", "out", "bend")
    data = mujoco.MjData(model)
    with jax.enable_x64(True):
        look = jax.jit(lambda q: chain.tool(arm, q))
        for q in np.random.default_rng(0).uniform(-1, 1, (5, 3)):
            data.qpos[:3] = q
            mujoco.mj_forward(model, data)
            base, mat = data.body("base").xpos, data.body("base").xmat.reshape(3, 3)
            found = look(q)
            np.testing.assert_allclose(found.pos, mat.T @ (data.site("tool").xpos - base), atol=1e-12)
            np.testing.assert_allclose(found.mat, mat.T @ data.site("tool").xmat.reshape(3, 3), atol=1e-12)
            along, about = np.zeros((3, model.nv)), np.zeros((3, model.nv))
            mujoco.mj_jacSite(model, data, along, about, model.site("tool").id)
            want = np.concatenate([mat.T @ along[:, :3], mat.T @ about[:, :3]])
            np.testing.assert_allclose(found.jacobian, want, atol=1e-12)


def test_steps_go_there(crane):
    """Repeated, they bring the tool to a place that it can reach; to one that it cannot they stay small."""
    _, arm = crane

    def go(q, goal):
        def one(q, _):
            at = chain.tool(arm, q)
            change = chain.steps(at.jacobian[:3], 0.5 * (goal - at.pos), damping=0.01)
            return q + change, jnp.abs(change).max()

        return jax.lax.scan(one, q, length=60)

    goal = chain.tool(arm, jnp.array([0.8, 0.2, -0.6])).pos
    q, _ = jax.jit(go)(jnp.zeros(3), goal)
    np.testing.assert_allclose(chain.tool(arm, q).pos, goal, atol=1e-4)
    jacobian = jnp.diag(jnp.array([1.0, 1e-6, 0.0]))
    np.testing.assert_allclose(chain.steps(jacobian, jnp.full(3, 0.01), 0.1), [0.01 / 1.01, 1e-6, 0], atol=1e-8)


@pytest.mark.parametrize(
    ("base", "site", "says"),
    [
        ("two", "tool", "`tool` must be a site that hangs on body 'two', got 'tool'."),
        ("base", "far", "`tool` must hang on hinges and slides, one to a body, got others on body 'two'."),
    ],
)
def test_no_chain(crane, base, site, says):
    with pytest.raises(ValueError, match="tool") as raised:
        chain.chain(crane[0], base, site)
    assert str(raised.value) == says
