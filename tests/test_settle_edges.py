"""Whether what was dropped rests on its surface, in the frame of that: yawed bins, and drawers that moved meanwhile."""

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture, geometry

DROP = mja.Place(drop=True)


def test_beyond():
    """A plain loop over points of turned rectangles, in NumPy and JAX."""
    rng = np.random.default_rng(0)
    middle, rot, size, at = rng.normal(size=(50, 3)), rng.uniform(-4, 4, 50), rng.uniform(0.1, 2, (50, 2)), []
    points = rng.normal(size=(50, 2))
    for (x, y, _), yaw, (long, wide), (px, py) in zip(middle, rot, size, points, strict=True):
        along = (px - x) * np.cos(yaw) + (py - y) * np.sin(yaw)
        across = (py - y) * np.cos(yaw) - (px - x) * np.sin(yaw)
        at.append((abs(along) - long / 2, abs(across) - wide / 2))
    assert (np.array(at) > 0).any()
    assert (np.array(at) < 0).all(1).any()
    np.testing.assert_allclose(geometry.beyond(middle, rot, size, points), at, atol=1e-14)
    np.testing.assert_allclose(jax.jit(geometry.beyond)(middle, rot, size, points), at, atol=1e-5)  # |x| < 10


@pytest.mark.slow
def test_of_each_surface():
    """In the corner of a yawed bin, beside it, and in a drawer that was pulled beyond where it starts."""
    arena = mja.TableArena((0.8, 0.8, 0.04), table_offset=(0, 0, 0.8))
    arena.add_part(furniture.Bin("bin", on="table", rot=0.4, inner_size=(0.24, 0.24, 0.08)))
    arena.add_part(furniture.Drawers("unit", pos=(1.5, 0.3, 0), rot=0.9, heights=(0.2,), openings=(0.05,)))
    arena.add_object(mja.Object("part", full_size=0.04, on="bin_bottom", place=DROP))
    drawer = next(name for name in arena.surfaces if name.startswith("unit_") and "drawer" in name)
    arena.add_object(mja.Object("pen", full_size=(0.06, 0.02, 0.02), on=drawer, place=DROP))
    ranges = mja.ArenaRanges(table_rots=mja.Fixed(0.8))
    batch = arena.randomize(arena.put_model("jax"), mja.world_keys(0, range(4)), ranges)
    assert batch.valid.all()
    data, params = mja.make_data(batch), jax.tree.map(np.asarray, batch.world(0))
    model, c = arena.c_world(params)
    (joint,) = (model.joint(i) for i in range(model.njnt) if model.joint(i).type == mujoco.mjtJoint.mjJNT_SLIDE)
    part, pen = arena.layout.object_qpos[:, :3]
    qpos = np.array(data.qpos)
    qpos[:, [part[2], pen[2]]] = arena.rest_heights(params)

    axes = c.geom("bin_bottom").xmat.reshape(3, 3)[:2, :2]
    assert abs(axes[0, 0]) < 0.5  # turned by 1.2
    middle = c.geom("bin_bottom").xpos[:2]
    qpos[:, part[:2]] = middle + [axes @ local for local in ([0.09, -0.09], [0, 0], [-0.09, 0.09], [0.2, 0])]
    qpos[3, part[2]] = 0.8 + 0.02  # beside it, on the table

    before = c.body(model.joint(joint.id).name).xpos.copy()
    c.joint(joint.id).qpos += 0.2
    mujoco.mj_kinematics(model, c)
    pulled = (c.body(model.joint(joint.id).name).xpos - before)[:2]
    assert np.linalg.norm(pulled) == pytest.approx(0.2)
    at = arena.layout.model.joint(joint.name).qposadr[0]
    qpos[1:, at] += 0.2
    qpos[1:, pen[:2]] += 1.5 * pulled  # in front of its middle
    qpos[2, pen] = [3, 3, 0.01]  # on the floor

    rests = mja.settle(batch, data.replace(qpos=jax.numpy.asarray(qpos, data.qpos.dtype)), 20).rests
    assert rests[:, 0].tolist() == [True, True, True, False]
    assert rests[:, 1].tolist() == [True, True, False, True]


@pytest.mark.slow
def test_on_two_devices():
    """Worlds that are spread over a mesh with explicit axes, which is what `jax.make_mesh` makes."""
    arena = mja.TableArena()
    arena.add_part(furniture.Bin("bin", on="table", rot=0.4, inner_size=(0.24, 0.24, 0.08)))
    arena.add_object(mja.Object("ball", "sphere", 0.04, on="bin_bottom", place=DROP))
    mesh = jax.make_mesh((2,), ("worlds",), axis_types=(jax.sharding.AxisType.Explicit,))
    spread = jax.sharding.NamedSharding(mesh, jax.sharding.PartitionSpec("worlds"))
    batch = arena.randomize(
        arena.put_model("jax"), jax.device_put(mja.world_keys(0, range(2)), spread), mja.ArenaRanges()
    )
    data, at = mja.make_data(batch), arena.layout.object_qpos[0, :3]
    lies = np.array([[0, 0, arena.rest_heights(arena.nominal_params())[0]], [0.15, 0.15, 0.82]])
    qpos = jax.device_put(np.asarray(data.qpos), spread).at[:, at].set(jax.device_put(lies, spread))
    rests = mja.settle(batch, data.replace(qpos=qpos), 100).rests
    assert rests.sharding.mesh.size == 2
    assert np.asarray(rests).tolist() == [[True], [False]]
