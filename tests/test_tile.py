"""Many worlds in one model: each is as it is alone."""

import sys
import types

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas.viz import render

ROBOT = """<mujoco><asset><material name="paint" rgba="1 0 0 1"/></asset><worldbody>
  <body name="base"><geom type="box" size=".05 .05 .1" pos="0 0 .1" material="paint"/><body name="arm" pos="0 0 .3">
    <joint name="hinge" axis="0 1 0" damping="1"/><geom type="capsule" size=".02" fromto="0 0 0 .2 0 0"/></body></body>
  <body name="hand" mocap="true" pos="0 0 2"><site name="palm"/></body></worldbody>
  <actuator><intvelocity name="push" joint="hinge" kp="5" actrange="-1 1"/></actuator>
  <keyframe><key name="home" qpos="0.1"/></keyframe></mujoco>"""

WITHIN = 1e-5  # the robot's numbers have six digits


def arena():
    objects = [mja.Object("cube"), mja.Object("ball", "sphere", 0.06, on=1)]
    arena = mja.MultiTableArena([[0, 0, 0.8], [1.2, 0, 0.7]], objects=objects)
    arena.attach(ROBOT, "arm_", pos=(-0.6, 0.2, 0))
    return arena


@pytest.mark.slow
def test_each_world_is_as_alone():
    """Poses, states and steps of tiles are those of their worlds, moved; the floor is there once, and no name clashes."""
    a = arena()
    ranges = mja.ArenaRanges(
        table_rots=mja.Uniform(-3, 3), table_active=mja.Bernoulli([1.0, 0.5]), object_full_sizes=mja.Uniform(0.04, 0.08)
    )
    params = jax.vmap(lambda key: a.sample_params(key, ranges))(jax.random.split(jax.random.key(1), 5))
    assert 0 < params.table_active[:, 1].mean() < 1
    model = a.put_model("jax")
    batch = a.batch(model, params)
    data = mja.make_data(batch)
    raised = data.qpos.at[:, a.layout.object_qpos[:, 2]].add(0.05)
    ctrl, act, mocap = jnp.arange(5.0)[:, None], jnp.linspace(-1, 1, 5)[:, None], data.mocap_pos + 0.1
    data = data.replace(qpos=raised, ctrl=ctrl, act=act, mocap_pos=mocap, qvel=data.qvel + 0.1)
    tiles = a.tile(params, data)
    assert np.unique(tiles.offsets, axis=0).shape == (5, 3)
    assert (tiles.model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE).sum() == 1
    twins = [a.c_world(batch.world(i), mja.take(data, i)) for i in range(5)]
    for steps in (0, 30):  # all fall
        for one, c in twins:
            mujoco.mj_step(one, c, steps)
            mujoco.mj_forward(one, c)
        mujoco.mj_step(tiles.model, tiles.data, steps)
        mujoco.mj_forward(tiles.model, tiles.data)
        for i, (one, c) in enumerate(twins):
            for kind, n in (("geom", one.ngeom), ("site", one.nsite), ("body", one.nbody)):
                for k in range(n):
                    name = getattr(one, kind)(k).name
                    if name not in ("", "world", "floor"):
                        tiled, alone = (getattr(d, kind)(p + name) for d, p in ((tiles.data, f"world{i}_"), (c, "")))
                        np.testing.assert_allclose(tiled.xpos, alone.xpos + tiles.offsets[i], rtol=0, atol=WITHIN)
                        np.testing.assert_allclose(tiled.xmat, alone.xmat, rtol=0, atol=WITHIN)
            np.testing.assert_allclose(tiles.data.actuator(f"world{i}_arm_push").ctrl, c.actuator("arm_push").ctrl)
        np.testing.assert_allclose(tiles.data.qvel, np.concatenate([c.qvel for _, c in twins]), rtol=0, atol=WITHIN)
        np.testing.assert_allclose(tiles.data.act, np.concatenate([c.act for _, c in twins]), rtol=0, atol=WITHIN)
    assert tiles.data.time == pytest.approx(0.06)


def test_worlds_do_not_touch():
    """Geoms of different tiles are at least a metre apart, and contacts are within one world."""
    a = arena()
    params = jax.tree.map(lambda x: jnp.stack([x] * 4), a.nominal_params())
    tiles = a.tile(params)
    model, data = tiles.model, tiles.data
    of = np.array([model.body(b).name.split("_")[0] for b in model.geom_bodyid])
    solid = np.flatnonzero(model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
    for one in solid:
        for other in solid[of[solid] > of[one]]:
            assert mujoco.mj_geomDistance(model, data, one, other, 1.0, None) > 1 - 1e-6
    mujoco.mj_step(model, data, 50)
    assert data.ncon >= 8
    assert all(one == other for one, other in of[data.contact.geom])


def test_what_cannot_be_tiled():
    """A wall without an end would stand in all tiles; a floor that something refers to is there once."""
    wall = mja.TableArena(
        xml="<mujoco><worldbody><geom name='wall' type='plane' size='1 1 1' euler='0 90 0'/></worldbody></mujoco>"
    )
    two = jax.tree.map(lambda x: jnp.stack([x] * 2), wall.nominal_params())
    with pytest.raises(
        ValueError, match=r"^Geom 'wall' is an endless plane that is not level and would cut through all tiles"
    ):
        wall.tile(two)
    pair = mja.TableArena(objects=[mja.Object("cube")])
    pair.spec.add_pair(name="p", geomname1="floor", geomname2="cube_g0")
    two = jax.tree.map(lambda x: jnp.stack([x] * 2), pair.nominal_params())
    with pytest.raises(
        ValueError, match=r"^`arena.spec`: pair 'p' refers to plane 'floor', but all tiles share one such plane"
    ):
        pair.tile(two)
    with pytest.raises(ValueError, match=r"^`params` must be of many worlds"):
        pair.tile(pair.nominal_params())


@pytest.mark.skipif(sys.platform != "linux", reason="screens are X11's or Wayland's")
def test_view(monkeypatch):
    """The viewer gets one world or tiles; without a screen one sentence says so."""
    a, shown = mja.TableArena(objects=[mja.Object("cube")]), []
    params = a.nominal_params()
    monkeypatch.setenv("DISPLAY", ":77")  # there is none such
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(RuntimeError) as error:
        a.view(params)
    assert str(error.value) == (
        "MuJoCo's viewer needs a screen, and DISPLAY=:77 is none; arena.render draws pictures without one."
    )
    monkeypatch.setattr(render, "works", lambda _: True)

    def launch(loader):
        model, data, path = loader()
        assert path  # or the viewer keeps a camera at the origin
        shown.append((model.nbody, data.ncon))

    stub = types.SimpleNamespace(launch=launch)
    monkeypatch.setitem(sys.modules, "mujoco.viewer", stub)
    monkeypatch.setattr(mujoco, "viewer", stub, raising=False)
    a.view(params)
    a.view(jax.tree.map(lambda x: jnp.stack([x] * 2), params))
    assert shown == [(3, 4), (5, 8)]
