"""Renderers that are made from others, and what is drawn where there is nothing."""

import copy
import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mjx_arenas as mja

pytest.importorskip("warp")

SCENE = """<mujoco><worldbody><light name="lamp" pos="1 0 3" dir="-.3 0 -1" castshadow="true"/><camera name="eye" pos="0 0 4"/>
<geom name="floor" type="box" size="1 1 .1"/><body name="box" pos="0 0 .6"><freejoint/><geom type="box" size=".25 .25 .25"/></body>
</worldbody></mujoco>"""
SIZE = {"eye": (24, 20)}


@pytest.fixture(scope="module")
def scene():
    """An arena, two of its worlds, and their data."""
    arena = mja.Arena.from_xml(SCENE)
    two = jax.tree.map(lambda x: np.repeat(np.asarray(x)[None], 2, 0), arena.nominal_params())
    batch = arena.batch(arena.put_model("warp"), two)
    return arena, batch, mja.make_data(batch)


@pytest.mark.slow
def test_replaced(scene):
    """A renderer that `dataclasses.replace` made from one that has drawn draws what it says, and so do later ones that equal it."""
    arena, batch, data = scene
    plain = arena.renderer(SIZE)
    without = np.asarray(plain(batch, data)["eye"].rgb)
    other = dataclasses.replace(plain, shadows=True)
    replaced = np.asarray(other(batch, data)["eye"].rgb)
    own = arena.renderer(SIZE, shadows=True)
    assert own == other
    np.testing.assert_array_equal(replaced, own(batch, data)["eye"].rgb)
    assert (replaced != without).mean() > 0.01


@pytest.mark.slow
def test_copies(scene):
    """A renderer that has drawn holds what cannot be copied: copies are itself."""
    arena, batch, data = scene
    drawing = arena.renderer(SIZE)
    drawing(batch, data)
    for copied in (copy.copy(drawing), copy.deepcopy(drawing), copy.deepcopy({"draw": drawing})["draw"]):
        assert copied is drawing


NO_GRADIENT = (
    r"^Pictures have no gradient, but what is drawn depends on what is differentiated: draw `jax.lax.stop_gradient` "
)


@pytest.mark.slow
@pytest.mark.parametrize("impl", ["jax", "warp"])
def test_gradients(scene, impl):
    """They are refused in one sentence, of states, of worlds and of one world; what is stopped is drawn."""
    arena, other, _ = scene
    batch = arena.batch(arena.put_model(impl), other.params)
    data = mja.make_data(batch)
    drawing = arena.renderer(SIZE, depth=True)
    want = drawing(batch, data)["eye"].depth.mean()

    def of_state(qpos):
        return drawing(batch, data.replace(qpos=qpos))["eye"].depth.mean()

    def of_model(size):
        changed = dataclasses.replace(batch, model=batch.model.tree_replace({"geom_size": size}))
        return drawing(changed, data)["eye"].depth.mean()

    def of_world(qpos):
        model = arena.apply(arena.put_model(impl), batch.world(0))
        state = mja.take(data, 0).replace(qpos=qpos)
        return drawing.of_world(model, batch.world(0), state)["eye"].rgb.astype(jnp.float32).mean()

    def stopped(qpos):
        state = jax.lax.stop_gradient(data.replace(qpos=qpos))
        depth = drawing(jax.lax.stop_gradient(batch), state)["eye"].depth.mean()
        return (qpos**2).sum() + depth

    for function, at in ((of_state, data.qpos), (of_model, batch.model.geom_size), (of_world, data.qpos[0])):
        for differentiated in (jax.grad(function), jax.jit(jax.grad(function)), jax.jacfwd(function)):
            with pytest.raises(TypeError, match=NO_GRADIENT):
                differentiated(at)
    value, gradient = jax.value_and_grad(stopped)(data.qpos)
    np.testing.assert_allclose(gradient, 2 * data.qpos)
    np.testing.assert_allclose(value, (data.qpos**2).sum() + want, rtol=1e-6)


@pytest.mark.slow
def test_nothing(scene):
    """Where there is nothing, the background is, and the depth is 0."""
    arena, batch, data = scene
    drawing = arena.renderer(SIZE, depth=True, segmentation=True, background=(0.2, 0.4, 0.6))
    rgb, depth, label = drawing(batch, data)["eye"]
    nothing = np.asarray(label) < 0
    assert 0.2 < nothing.mean() < 0.8
    np.testing.assert_array_equal(np.asarray(depth) == 0, nothing)
    assert (np.asarray(rgb)[nothing] == [51, 102, 153]).all()
