"""Culled steps against MJX's own: no contact is lost, wherever tables and bodies are."""

import dataclasses
import functools
import math

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas import culling

T = 8
RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.7, -0.7, 0.35], [0.7, 0.7, 1.2]),
    table_rots=mja.Uniform(-math.pi, math.pi),
    table_full_sizes=mja.Uniform([0.02, 0.02, 0.005], [1.2, 0.6, 0.3]),
    table_active=mja.Bernoulli(0.7),
    table_frictions=mja.LogUniform([0.05, 0.005, 0.0001], [1.0, 0.005, 0.0001]),
    object_full_sizes=mja.Uniform(0.5, 2.0, relative="scale", tied="axes"),
    object_active=mja.Bernoulli(0.9),
)
ARM = """
<mujoco>
  <worldbody>
    <body name="base">
      <geom type="box" size=".05 .05 .2" pos="0 0 .2"/>
      <body name="upper" pos="0 0 .45">
        <joint name="lift" axis="0 1 0" damping=".1"/>
        <geom type="capsule" fromto="0 0 0 .4 0 0" size=".03"/>
        <body name="fore" pos=".5 0 0">
          <joint name="bend" axis="0 1 0" range="-90 90" damping=".1"/>
          <geom type="box" size=".15 .03 .02" pos=".15 0 0" quat=".9 .3 .2 .1"/>
          <geom type="mesh" mesh="tip" pos=".3 0 0"/>
          <site name="skin" type="box" size=".2 .06 .06" pos=".15 0 0"/>
        </body>
      </body>
    </body>
  </worldbody>
  <asset><mesh name="tip" vertex="0 0 0  .1 0 0  0 .06 0  0 0 .05"/></asset>
  <actuator><position joint="lift" kp="20"/></actuator>
  <sensor><touch site="skin"/><accelerometer site="skin"/></sensor>
</mujoco>
"""


def make_arena(n_tables=T, prefix=""):
    objects = [mja.Object(f"{prefix}{o.name}", o.type, o.full_size, table=t) for t, o in enumerate(worlds.OBJECTS)]
    return mja.MultiTableArena(table_offsets=worlds.offsets(n_tables), objects=objects)


@pytest.fixture(scope="module")
def arena():
    """Eight tables, a box, a ball, a capsule, and an arm."""
    arena = make_arena()
    arena.attach(ARM, "arm_")
    return arena


def crowd(arena, n, seed=0):
    """Random worlds, and data with each body in, on, below or beside a table."""
    keys = jax.random.split(jax.random.key(seed), n)
    batch = arena.randomize(arena.put_model("jax"), keys, RANGES)

    def pose(params, key):
        table, spot, turn, joints = (jax.random.fold_in(key, k) for k in range(4))
        shape = (len(arena.objects),)
        table = jax.random.randint(table, shape, 0, arena.n_tables)
        reach = params.table_full_sizes[table] / 2 + 0.08
        local = jax.random.uniform(spot, (*shape, 3), minval=-1.0) * reach
        c, s = jnp.cos(params.table_rots[table]), jnp.sin(params.table_rots[table])
        turned = jnp.stack([c * local[:, 0] - s * local[:, 1], s * local[:, 0] + c * local[:, 1], local[:, 2]], -1)
        pos = params.table_offsets[table] + turned
        quat = jax.random.normal(turn, (*shape, 4))
        quat = quat / jnp.linalg.norm(quat, axis=-1, keepdims=True)
        qpos = jax.random.uniform(joints, (arena.mj_model.nq,), minval=-1.5, maxval=1.5)
        return qpos.at[arena.layout.object_qpos].set(jnp.concatenate([pos, quat], -1))

    return batch, mja.make_data(batch).replace(qpos=jax.jit(jax.vmap(pose))(batch.params, keys))


def compare(batch, data, choose=culling.choose):
    """All contacts of MJX and the culled ones, and which worlds would not be culled."""
    plan = culling.plan(batch, data)

    @functools.partial(jax.vmap, in_axes=(batch.in_axes, 0))
    def one(model, data):
        data = mjx.collision(model, mjx.kinematics(model, data))
        chosen, over = choose(plan, model, data)
        lean = culling.spread(plan, culling.collide(plan, model, data, chosen), chosen)
        return data._impl.contact, lean, over

    return jax.tree.map(np.asarray, jax.jit(one)(batch.model, data))


def lost(true, lean, over):
    """How many contacts of culled worlds are not the same."""
    active = (true.dist < true.includemargin) & ~over[:, None]
    same = np.ones_like(active)
    for a, b in zip(jax.tree.leaves(true), jax.tree.leaves(lean), strict=True):
        same &= np.isclose(a, b, rtol=1e-5, atol=1e-5).reshape(*active.shape, -1).all(-1)
    return (active & ~same).sum(), active.sum()


@pytest.mark.parametrize("merged", [False, True])
def test_no_contact_is_lost(arena, merged):
    """In thousands of random worlds, each contact has its twin; where tables' ids surround the bodies', too."""
    if merged:
        arena = make_arena(6).merge(make_arena(6, "b_"), prefix="b_", pos=(20, 0, 0))
    batch, data = crowd(arena, 4096)
    true, lean, over = compare(batch, data)
    different, active = lost(true, lean, over)
    assert different == 0
    assert active > 4096
    np.testing.assert_array_equal(true.geom, lean.geom)
    assert not (lean.dist < lean.includemargin)[~(true.dist < true.includemargin)].any()
    assert 0.001 < over.mean() < 0.5
