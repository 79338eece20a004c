"""Renderers that are made from others, and what is drawn where there is nothing."""

import dataclasses

import jax
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
def test_nothing(scene):
    """Where there is nothing, the background is, and the depth is 0."""
    arena, batch, data = scene
    drawing = arena.renderer(SIZE, depth=True, segmentation=True, background=(0.2, 0.4, 0.6))
    rgb, depth, label = drawing(batch, data)["eye"]
    nothing = np.asarray(label) < 0
    assert 0.2 < nothing.mean() < 0.8
    np.testing.assert_array_equal(np.asarray(depth) == 0, nothing)
    assert (np.asarray(rgb)[nothing] == [51, 102, 153]).all()
