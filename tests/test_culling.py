"""Culled steps against MJX's own: no contact is lost, wherever tables and bodies are."""

import dataclasses
import functools
import math
import operator

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas.sim import culling

pytestmark = pytest.mark.filterwarnings("ignore:`ranges` gives few valid worlds")

T = 8
CROWD = 1024  # worlds
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


def plan_of(batch, data):
    """How the steps of a batch are culled."""
    return culling.plan(batch.model, batch.fields, batch.record.layout, data)


def make_arena(n_tables=T, prefix="", n_objects=3):
    kinds = worlds.OBJECTS[:n_objects]
    objects = [mja.Object(f"{prefix}{o.name}", o.type, o.full_size, on=t) for t, o in enumerate(kinds)]
    return mja.MultiTableArena(table_offsets=worlds.offsets(n_tables), objects=objects)


@pytest.fixture(scope="module")
def arena():
    """Eight tables, a box, a ball, a capsule, and an arm."""
    arena = make_arena()
    arena.attach(ARM, "arm_", pos=(-0.9, 0, 0))
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


def chosen(batch, data, plan):
    """The tables of the slots, and which worlds are not culled."""

    @functools.partial(jax.vmap, in_axes=(batch.in_axes, 0))
    def one(model, data):
        return culling.choose(plan, model, mjx.kinematics(model, data))

    return jax.jit(one)(batch.model, data)


def contacts(batch, plan):
    """A function of the data and the chosen tables: all contacts of MJX, and the culled ones."""

    @functools.partial(jax.vmap, in_axes=(batch.in_axes, 0, 0))
    def one(model, data, chosen):
        data = mjx.collision(model, mjx.kinematics(model, data))
        lean = culling.spread(plan, culling.collide(plan, model, data, chosen), chosen)
        return data._impl.contact, lean

    compiled = jax.jit(one)
    return lambda data, tables: jax.tree.map(np.asarray, compiled(batch.model, data, tables))


def lost(true, lean, over):
    """How many contacts of culled worlds are not the same, how many are elsewhere, and how many there are.

    Where a pair has more equally deep points than contacts, rounding decides which ones MJX takes.
    """
    active = (true.dist < true.includemargin) & ~np.asarray(over)[:, None]

    def differ(*names):
        pairs = ((getattr(true, name), getattr(lean, name)) for name in names)
        same = (np.isclose(a, b, rtol=1e-5, atol=1e-5).reshape(*active.shape, -1).all(-1) for a, b in pairs)
        return int((active & ~functools.reduce(np.logical_and, same)).sum())

    values = ("dist", "includemargin", "friction", "solref", "solreffriction", "solimp", "geom", "geom1", "geom2")
    return differ(*values), differ("pos", "frame"), int(active.sum())


def by_spheres(plan, model, data):
    """Distances of spheres, by which MJX's `max_geom_pairs` ranks."""
    apart = data.geom_xpos[plan.bodies][:, None] - data.geom_xpos[plan.slabs]
    radii = model.geom_rbound[plan.bodies][:, None] + model.geom_rbound[plan.slabs]
    return jnp.linalg.norm(apart, axis=-1) - radii


@pytest.mark.slow
def test_no_contact_is_lost(arena, monkeypatch):
    """In a thousand random worlds each contact has its twin; and what a wrong choice loses would be seen."""
    batch, data = crowd(arena, CROWD)
    plan = plan_of(batch, data)
    collide, (tables, over) = contacts(batch, plan), chosen(batch, data, plan)
    true, lean = collide(data, tables)
    different, moved, active = lost(true, lean, over)
    assert different == 0
    assert moved <= 1e-3 * active
    assert active > CROWD
    np.testing.assert_array_equal(true.geom, lean.geom)
    assert not (lean.dist < lean.includemargin)[~(true.dist < true.includemargin)].any()
    assert 0.001 < over.mean() < 0.2

    exact = culling.clearance
    monkeypatch.setattr(culling, "clearance", by_spheres)
    assert lost(*collide(data, chosen(batch, data, plan)[0]), over)[0] > 10
    monkeypatch.setattr(culling, "clearance", lambda *args: exact(*args) + 0.01)
    tables, over = chosen(batch, data, plan)
    assert lost(*collide(data, tables), over)[0] > 0


@pytest.mark.slow
def test_no_contact_is_lost_of_merged_arenas():
    """The same where some tables' ids are smaller than the body's and some larger: box-box contacts depend on that."""
    arena = make_arena(6, n_objects=1).merge(make_arena(6, "b_", 1), prefix="b_", pos=(20, 0, 0))
    batch, data = crowd(arena, 1024)
    plan = plan_of(batch, data)
    tables, over = chosen(batch, data, plan)
    different, moved, active = lost(*contacts(batch, plan)(data, tables), over)
    assert different == 0
    assert moved <= 1e-3 * active
    assert active > 1024


@pytest.mark.slow
def test_bound_is_below_the_distance(arena):
    """No clearance exceeds the distance that C MuJoCo finds; most come close to it."""
    batch, data = crowd(arena, CROWD, seed=2)  # as many as above, which is compiled
    plan = plan_of(batch, data)

    @functools.partial(jax.vmap, in_axes=(batch.in_axes, 0))
    def clearance(model, data):
        bound = culling.clearance(plan, model, mjx.kinematics(model, data))
        return bound, model.geom_margin[plan.bodies][:, None] + model.geom_margin[plan.slabs]

    bounds, margins = jax.jit(clearance)(batch.model, data)
    bounds, there = np.asarray(bounds), np.asarray(margins) == 0
    model, ratios = arena.mj_model.__copy__(), []
    for world in range(64):
        for name in ("geom_size", "geom_pos", "body_pos", "body_quat"):
            getattr(model, name)[:] = getattr(batch.model, name)[world]
        c_data = mujoco.MjData(model)
        c_data.qpos[:] = data.qpos[world]
        mujoco.mj_kinematics(model, c_data)
        for g, geom in enumerate(plan.bodies):
            for t, slab in enumerate(plan.slabs):
                if there[world, g, t]:
                    distance = max(0, mujoco.mj_geomDistance(model, c_data, geom, slab, 20, None))
                    assert bounds[world, g, t] <= distance + 1e-6
                    if distance > 0.05:
                        ratios.append(bounds[world, g, t] / distance)
    assert len(ratios) > 1000
    assert np.median(ratios) > 0.95


@pytest.fixture(scope="module")
def plain():
    """MJX's own step of a batch."""
    return jax.jit(lambda batch, data: jax.vmap(mjx.step, in_axes=(batch.in_axes, 0))(batch.model, data))


@pytest.fixture(scope="module")
def resting():
    """Sixteen worlds of random tables that stand apart, in which nothing is ever at three; few types of geoms."""
    arena = make_arena(n_objects=2)
    bare = "\n".join(line for line in ARM.splitlines() if "mesh" not in line)
    bare = bare.replace('type="capsule" fromto="0 0 0 .4 0 0"', 'type="sphere"')
    arena.attach(bare, "arm_", pos=(-0.9, 0, 0))
    ranges = worlds.TABLES._replace(table_active=mja.Bernoulli([1.0] * 3 + [0.5] * (T - 3)))
    keys = jax.random.split(jax.random.key(3), 16)
    batch = arena.randomize(arena.put_model("jax"), keys, ranges)
    data = mja.make_data(batch, keys)
    lift = arena.mj_model.joint("arm_lift").qposadr[0]
    qpos = data.qpos.at[:, lift].set(-1.2)  # upright
    return batch, data.replace(qpos=qpos, qvel=data.qvel.at[:, :2].set(0.1), ctrl=data.ctrl - 1.2)


def differences(a, b):
    """Largest differences of what moves and of the forces of the constraints."""
    names = ("qpos", "qvel", "sensordata", "_impl.efc_force", "_impl.contact.geom")
    pairs = ((operator.attrgetter(name)(x) for x in (a, b)) for name in names)
    return {name: float(jnp.abs(x - y).max()) for name, (x, y) in zip(names, pairs, strict=True)}


@pytest.mark.xslow
@pytest.mark.slow
def test_culled_steps_are_steps(resting, plain):
    """One step and twenty are MJX's, also in a loop of the user's; data keep their structure."""
    batch, data = resting
    assert not chosen(batch, data, plan_of(batch, data))[1].any()
    ours, theirs = mja.step(batch, data), plain(batch, data)
    assert jax.tree.structure(ours) == jax.tree.structure(theirs) == jax.tree.structure(data)
    assert [(x.shape, x.dtype) for x in jax.tree.leaves(ours)] == [(x.shape, x.dtype) for x in jax.tree.leaves(data)]
    assert float(theirs._impl.efc_force.max()) > 0.1
    worst = differences(ours, theirs)
    for _ in range(19):
        again = mja.step(batch, theirs)  # from the same state: impacts magnify what sums in another order differ by
        ours, theirs = mja.step(batch, ours), plain(batch, theirs)
        worst = {name: max(worst[name], value) for name, value in differences(again, theirs).items()}
    assert worst["_impl.contact.geom"] == 0
    assert worst["qpos"] < 1e-5
    assert worst["qvel"] < 5e-3
    assert np.median(np.abs(ours.qpos - theirs.qpos).max(1)) < 1e-5


@pytest.mark.slow
def test_a_body_at_three_tables(resting, plain):
    """Where a body touches more tables than it has stand-ins for, nothing is culled."""
    batch, data = resting
    layout, pos = batch.record.layout, batch.model.body_pos
    half = batch.model.geom_size[0, layout.table_geom[:3, 0], 2]
    middle = pos[0, layout.table_body[0], :2]
    for t in (1, 2):  # under the object that is on the first table, tops at one height
        pos = pos.at[0, layout.table_body[t]].set(pos[0, layout.table_body[0]].at[2].add(half[0] - half[t]))
    batch = dataclasses.replace(batch, model=batch.model.replace(body_pos=pos))
    x, y, z = layout.object_qpos[0, :3]
    data = data.replace(qpos=data.qpos.at[0, [x, y]].set(middle).at[0, z].add(-0.01))
    plan = plan_of(batch, data)
    assert list(np.flatnonzero(chosen(batch, data, plan)[1])) == [0]
    ours, theirs = mja.step(batch, data), plain(batch, data)
    contact = ours._impl.contact
    touched = np.asarray(contact.geom[0])[np.asarray(contact.dist < contact.includemargin)[0]]
    assert set(batch.record.layout.table_geom[:3, 0]) <= set(touched.ravel())
    for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    "edit",
    [
        lambda spec: setattr(spec.option, "integrator", mujoco.mjtIntegrator.mjINT_RK4),
        lambda spec: spec.add_numeric(name="max_geom_pairs", data=[6]),
        lambda spec: spec.add_pair(geomname1="table0_collision", geomname2="cube_g0"),
        lambda spec: setattr(spec.option, "disableflags", mujoco.mjtDisableBit.mjDSBL_CONTACT),
    ],
)
def test_not_culled(edit):
    """What could change a result is left to MJX's own step."""
    arena = make_arena()
    edit(arena.spec)
    batch = arena.randomize(arena.put_model("jax"), jax.random.split(jax.random.key(0), 2), mja.ArenaRanges())
    assert plan_of(batch, mja.make_data(batch)) is None


@pytest.mark.slow
@pytest.mark.parametrize(("n_tables", "culled"), [(1, False), (4, False), (5, True)])
def test_culled_where_it_pays(n_tables, culled):
    """Few tables are not worth it."""
    arena = make_arena(n_tables, n_objects=1)
    batch = arena.randomize(arena.put_model("jax"), jax.random.split(jax.random.key(0), 2), mja.ArenaRanges())
    assert (plan_of(batch, mja.make_data(batch)) is not None) == culled
