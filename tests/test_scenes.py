"""Objects of every type, and what is absent: each world is the model that MuJoCo compiles without it."""

import functools
import operator
import pathlib

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds
from mujoco import mjx
from oracle import STRUCTURE_MAY_DIFFER, differing, from_compiled, off

import mjx_arenas as mja
from mjx_arenas.params.params import QUANTITIES

pytestmark = pytest.mark.slow_on("warp")

DATA = pathlib.Path(__file__).parent / "data"
SCENE = worlds.RANGES._replace(
    table_offsets=mja.Uniform([0, 0, -0.2], [0, 0, 0.2], relative="add"),
    table_full_sizes=mja.Uniform([0.6, 0.6, 0.01], [0.9, 0.9, 0.2]),
    table_active=mja.Count(1, 3),
    object_active=mja.Bernoulli(0.7),
    object_tables=mja.Choice([0, 1, 2], p=[0.5, 0.3, 0.2]),
    object_masses=mja.LogUniform(0.05, 2.0),
    object_densities=None,
    object_frictions=mja.Uniform([0.3, 0.005, 0.0001], [1.5, 0.005, 0.0001]),
    workspace=mja.Workspace([-2, -2], [2, 2], gap=0.1),
)


def every_type(impl):
    """An object of each type that an implementation collides with boxes."""
    objects = [
        mja.Object("cube"),
        mja.Object("ball", "sphere", 0.06, on=1),
        mja.Object("rod", "capsule", (0.12, 0.04, 0.04), on=2),
        mja.Object("wedge", "mesh", file=DATA / "wedge.obj", on=1),
        mja.Object("block", "mesh", (0.1, 0.1, 0.06), file=DATA / "wedge.obj", mass=0.3),
        mja.Object("drawer", "mjcf", file=DATA / "drawer.xml", on=2),
        mja.Object("can", "cylinder", (0.06, 0.06, 0.1), on=2, rgba=(0.2, 0.3, 0.4, 0.5)),
    ]
    return objects if impl == "warp" else objects[:-1]


@functools.cache
def scene(impl):
    return mja.MultiTableArena(
        [[0, 0, 0.8], [1.4, 0, 0.7], [0, 1.4, 0.9]], objects=every_type(impl), table_condim=6, table_priority=0
    )


def drawn(arena, model, ranges):
    """A function of a key: parameters, the model's fields, and whether this world can be."""

    def of_key(key):
        params = arena.sample_params(key, ranges)
        return params, arena.fields(model, params), arena.valid(params, ranges)

    return jax.jit(of_key)


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:`ranges.object_full_sizes` does not change")
@pytest.mark.parametrize("n_worlds", [20])
def test_every_object_type(impl, n_worlds):
    """With objects of every type no leaf differs from the recompiled model's."""
    arena = scene(impl)
    ranges = SCENE._replace(table_active=None, object_active=None)
    model = arena.put_model(impl)
    apply = drawn(arena, model, ranges)
    for key in jax.random.split(jax.random.key(2), n_worlds):
        params, fields, valid = apply(key)
        assert valid
        assert from_compiled(model.tree_replace(fields), arena.compile(params)) <= STRUCTURE_MAY_DIFFER.keys()


def kept_rows(arena, there):
    """Rows of the full model that a model without the absent has, by the prefix of the fields' names."""
    model, owner = arena.mj_model, arena.layout.owner
    body = there[owner]
    joints = body[model.jnt_bodyid]
    width = np.where(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE, 7, 1)
    return {
        "body": body,
        "geom": body[model.geom_bodyid],
        "site": body[model.site_bodyid],
        "jnt": joints,
        "dof": body[model.dof_bodyid],
        "qpos0": np.repeat(joints, width),
        "qpos_spring": np.repeat(joints, width),
    }


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:`ranges.object_full_sizes` does not change")
def test_absent(impl):
    """What is there is the model that MuJoCo compiles without what is absent; the mean inertia gives the same solver."""
    arena = scene(impl)
    model = arena.put_model(impl)
    apply = drawn(arena, model, SCENE)
    gone = np.zeros(2)
    for key in jax.random.split(jax.random.key(4), 20):
        params, fields, valid = apply(key)
        assert valid
        there = np.append(np.concatenate([params.table_active, params.object_active]), True)
        gone += [(~there[:3]).sum(), (~there[3:]).sum()]
        twin = arena.compile(params)
        got, expected = (worlds.leaves(m) for m in (model.tree_replace(fields), mjx.put_model(twin, impl=impl)))
        rows, compared = kept_rows(arena, there), 0
        for name, want in expected.items():
            prefix = name if name.startswith("qpos") else name.split("_")[0]
            if (
                want.dtype.kind != "f"
                or name in STRUCTURE_MAY_DIFFER
                or name.startswith(("_impl", "actuator", "key", "sensor"))
            ):
                continue
            have = got[name][rows[prefix]] if prefix in rows else got[name]
            if name == "stat.meaninertia":
                have, want = have * model.nv, want * twin.nv
            assert have.shape == want.shape, name
            assert not off(twin, name, have, want).any(), (name, have, want)
            compared += 1
        assert compared > 90
    assert (gone > 10).all()


def heights(arena, qpos):
    return np.asarray(qpos)[:, arena.layout.object_qpos[:, 2]]


REST = 80  # steps: a fall by 5 mm takes 16


@pytest.mark.xslow
def test_scene_comes_to_rest(impl):
    """What is there rests on its table, where C MuJoCo takes the recompiled model; what is absent stays parked."""
    few = [
        o for o in every_type(impl) if impl == "warp" or o.name in ("cube", "ball", "wedge")
    ]  # pairs with meshes are slow on jax
    arena = mja.MultiTableArena(
        [[0, 0, 0.8], [1.4, 0, 0.7], [0, 1.4, 0.9]], objects=few, table_condim=6, table_priority=0
    )
    keys = jax.random.split(jax.random.key(6), 4)
    batch = arena.randomize(arena.put_model(impl), keys, SCENE._replace(object_full_sizes=None))
    assert batch.valid.all()
    assert jax.jit(jax.vmap(arena.place))(batch.params, keys).valid.all()
    start = mja.make_data(batch, keys)
    lift = np.zeros(arena.mj_model.nq, np.float32)
    lift[arena.layout.object_qpos[:, 2]] = 0.005
    start = start.replace(qpos=start.qpos + lift)
    data = mja.rollout(batch, start, REST)

    there = np.asarray(batch.params.object_active)
    assert 0.3 < there.mean() < 0.9
    assert np.isfinite(data.qpos).all()
    off = heights(arena, data.qpos) - np.asarray(jax.jit(jax.vmap(arena.rest_heights))(batch.params))
    assert np.abs(off[there]).max() < 1e-3
    dofs = np.concatenate([arena.mj_model.body(o.name).dofadr[0] + np.arange(6) for o in arena.objects])
    np.testing.assert_array_equal(np.asarray(data.qvel)[:, dofs][~np.repeat(there, 6, axis=1)], 0)
    for i in range(len(there)):
        rows = arena.layout.object_qpos[~there[i]].reshape(-1)
        renormalized = 2 * 2.0**-23  # of the quaternion, once
        np.testing.assert_allclose(data.qpos[i][rows], start.qpos[i][rows], rtol=0, atol=renormalized)

        params = batch.world(i)
        present = np.concatenate([params.table_active, there[i], [True]])
        model = arena.compile(params)
        twin = mujoco.MjData(model)
        twin.qpos = np.asarray(start.qpos)[i, kept_rows(arena, present)["qpos0"]]
        mujoco.mj_step(model, twin, REST)
        z = [model.joint(f"{o.name}_joint0").qposadr[0] + 2 for o, t in zip(arena.objects, there[i], strict=True) if t]
        np.testing.assert_allclose(heights(arena, data.qpos)[i, there[i]], twin.qpos[z], rtol=0, atol=2e-4)


@pytest.mark.xslow
@pytest.mark.slow
def test_thousands_of_scenes():
    """2,000 random scenes in C: what is there rests on its own table, and energy knows nothing of what is absent."""
    arena = scene("warp")
    keys = jax.random.split(jax.random.key(7), 2000)
    ranges = SCENE._replace(object_full_sizes=None)
    params = jax.jit(jax.vmap(lambda key: arena.sample_params(key, ranges)))(keys)
    assert np.asarray(jax.jit(jax.vmap(lambda p: arena.valid(p, ranges)))(params)).all()
    valid = np.asarray(jax.jit(jax.vmap(arena.place))(params, keys).valid)
    assert valid.mean() > 0.999
    batch = arena.c_batch(params, keys=keys)
    batch.step(nstep=60)  # what falls through is 7 cm down
    there = np.asarray(params.object_active)
    off = heights(arena, batch.qpos) - np.asarray(jax.jit(jax.vmap(arena.rest_heights))(params))
    assert np.abs(off[there & valid]).max() < 1e-3
    assert (heights(arena, batch.qpos)[~there] > 99).all()


def test_energy():
    """An absent object adds no energy; one that is there has its own. (MJX computes no energy.)"""
    arena = mja.TableArena(objects=[mja.Object("a"), mja.Object("b")])
    both = arena.nominal_params()
    alone = both._replace(object_active=jnp.array([True, False]))
    batch = arena.c_batch(jax.tree.map(lambda *x: jnp.stack(x), both, alone))
    energies = []
    for i in range(2):
        model, data = batch.get_model(i), batch.get_data(i)
        model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
        mujoco.mj_forward(model, data)
        energies.append(data.energy[0])
    np.testing.assert_allclose(energies, [2 * 0.125 * 9.81 * 0.825, 0.125 * 9.81 * 0.825], rtol=1e-5)


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_what_is_absent_does_not_touch(impl):
    """A ball where an absent table stands falls to the floor; an absent object that is moved into a table is not pushed out.

    An object on a table that is absent by hand is absent, too.
    """
    objects = [mja.Object("ball", "sphere", 0.1), mja.Object("cube", on=1)]
    arena = mja.MultiTableArena([[0, 0, 0.2], [1.5, 0, 0.2]], objects=objects)
    model = arena.put_model(impl)
    gone = arena.nominal_params()._replace(table_active=jnp.array([False, True]))
    gone = gone._replace(object_tables=jnp.array([1, 1]), object_active=jnp.array([True, False]))
    one = arena.apply(model, gone)
    data = arena.make_world_data(one, gone)
    inside = jnp.array([1.5, 0.0, 0.19])
    data = data.replace(qpos=data.qpos.at[:3].set(jnp.array([0.0, 0.0, 0.27])).at[7:10].set(inside))
    step = jax.jit(lambda m, d: jax.lax.scan(lambda d, _: (mjx.step(m, d), None), d, length=200)[0])
    qpos = step(one, data).qpos  # the fall takes 106 steps
    assert qpos[2] == pytest.approx(0.05, abs=2e-3)
    np.testing.assert_array_equal(qpos[7:10], inside)
    both = gone._replace(table_active=jnp.array([True, False]))
    data = arena.make_world_data(arena.apply(model, both), both)
    assert data.qpos[2] > 99
    assert arena.compile(both).nbody == 2


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_rays_pass_through_what_is_absent(impl):
    """A rangefinder that looks up to where absent tables and objects are finds nothing, as in the compiled world."""
    can = """<mujoco><asset><material name="m"/></asset><worldbody><body><geom size=".05" material="m"/></body></worldbody>
      </mujoco>"""
    lift = """<mujoco><worldbody><body name="lift"><joint type="slide"/><geom size=".01" contype="0" conaffinity="0"/>
      <site name="up" pos="0 0 .1"/></body></worldbody><sensor><rangefinder site="up"/></sensor></mujoco>"""
    objects = [mja.Object("cube", on=1), mja.Object("can", "mjcf", file=mujoco.MjSpec.from_string(can), on=1)]
    arena = mja.MultiTableArena([[0, 0, 0.8], [1.5, 0, 0.8]], objects=objects)
    arena.attach(lift, "r_")
    arena.spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT  # compiles faster
    nominal = arena.nominal_params()
    params = jax.tree.map(lambda x: jnp.stack([x] * 4), nominal)._replace(
        table_active=jnp.array([[True, True], [False, True], [False, True], [True, True]]),
        object_active=jnp.array([[True, True], [True, False], [False, False], [False, False]]),
    )
    batch = arena.batch(arena.put_model(impl), params)
    data = mja.step(batch, mja.make_data(batch))
    for i in range(4):
        model = arena.compile(batch.world(i))
        twin = mujoco.MjData(model)
        mujoco.mj_step(model, twin)
        np.testing.assert_allclose(data.sensordata[i], twin.sensordata, rtol=0, atol=1e-5)
    np.testing.assert_allclose(data.sensordata[:, 0], [0.65, -1, -1, 0.65], atol=1e-3)


SHELF = """<mujoco><worldbody><body><geom type="box" size=".2 .2 .01" mass="3"/></body></worldbody></mujoco>"""


@pytest.mark.slow
@pytest.mark.parametrize("objects", [(), (mja.Object("cube"),)])
def test_fixtures_of_absent_tables(impl, objects):
    """What is fixed on a table that is absent has no mass, as the table."""
    arena = mja.MultiTableArena([[0, 0, 0.8], [1.5, 0, 0.8]], objects=objects)
    frame = arena.spec.body("table1").add_frame(pos=(0, 0, 0.4))
    frame.attach_body(mujoco.MjSpec.from_string(SHELF).worldbody.first_body(), "shelf_", "")
    if not objects:
        slide = arena.spec.worldbody.add_body(name="slide")
        slide.add_joint(name="slide", type=mujoco.mjtJoint.mjJNT_SLIDE)
        slide.add_geom(size=(0.1, 0, 0), mass=1, contype=0, conaffinity=0)
    batch = arena.randomize(
        arena.put_model(impl), mja.world_keys(0, range(4)), mja.ArenaRanges(table_active=mja.Bernoulli([1.0, 0.5]))
    )
    there = np.asarray(batch.params.table_active)[:, 1]
    assert there.any()
    assert not there.all()
    for i in range(4):
        twin = arena.compile(batch.world(i))
        np.testing.assert_allclose(batch.model.body_subtreemass[i, 0], twin.body_subtreemass[0], rtol=1e-6)
        np.testing.assert_allclose(np.sum(batch.model.body_inertia[i]), twin.body_inertia.sum(), rtol=1e-5)
        np.testing.assert_allclose(batch.model.stat.meanmass[i], twin.stat.meanmass, rtol=1e-5)


def test_nominally_absent(impl):
    """`active=False` and `table_active` are the nominal world, which `put_model` gives; a range brings them back."""
    objects = [mja.Object("here"), mja.Object("gone", active=False), mja.Object("there", on=1)]
    arena = mja.MultiTableArena([[0, 0, 0.8], [1.5, 0, 0.8]], objects=objects, table_active=[True, False])
    model = arena.put_model(impl)
    assert arena.mj_model.nbody == 6
    assert "gone" not in arena.xml
    assert "table1" not in arena.xml
    assert model.body_mass[arena.layout.object_body].tolist() == [0.125, 0, 0]
    keys = jax.random.split(jax.random.key(0), 3)
    batch = arena.randomize(model, keys, mja.ArenaRanges(table_active=mja.Fixed(True), object_active=mja.Fixed(True)))
    np.testing.assert_allclose(np.asarray(batch.model.body_mass)[:, arena.layout.object_body], 0.125)
    again = arena.apply(model, arena.nominal_params())
    assert differing(arena.mj_model, worlds.leaves(again), worlds.leaves(model)) == set()


@pytest.mark.slow
def test_one_varying_presence(impl):
    """A batch in which only presence varies stores every leaf that follows from it."""
    arena = mja.MultiTableArena([[0, 0, 0.8], [1.5, 0, 0.8]], objects=[mja.Object("a"), mja.Object("b", on=1)])
    model = arena.put_model(impl)
    for ranges in (mja.ArenaRanges(table_active=mja.Count(1, 2)), mja.ArenaRanges(object_active=mja.Bernoulli(0.5))):
        batch = arena.randomize(model, jax.random.split(jax.random.key(1), 6), ranges)
        for i in range(6):
            one = model.tree_replace(
                {name: np.asarray(operator.attrgetter(name)(batch.model))[i] for name in batch.fields}
            )
            applied = worlds.leaves(arena.apply(model, batch.world(i)))
            assert differing(arena.mj_model, worlds.leaves(one), applied) == set()


def test_joints_that_are_tied():
    """Objects whose joints an equality ties to each other cannot be absent one by one."""
    slide = """<mujoco><worldbody><body><geom size=".02"/><body pos="0 0 .1"><joint name="up" type="slide"/><geom size=".02"/>
      </body></body></worldbody></mujoco>"""
    arena = mja.TableArena(objects=[mja.Object(n, "mjcf", file=mujoco.MjSpec.from_string(slide)) for n in ("a", "b")])
    tie = arena.spec.add_equality(name="tie", type=mujoco.mjtEq.mjEQ_JOINT)
    tie.name1, tie.name2 = "a_up", "b_up"
    with pytest.raises(ValueError, match=r"object 'a' can be absent, but equality 'tie' ties it"):
        arena.randomize(
            arena.put_model("jax"),
            jax.random.split(jax.random.key(0), 2),
            mja.ArenaRanges(object_active=mja.Bernoulli(0.5)),
        )


DRAWN = SCENE._replace(
    table_active=mja.Bernoulli(0.7), object_tables=mja.Choice([0, 1]), object_full_sizes=mja.Uniform(0.04, 0.08)
)


@functools.cache
def drawing(names):
    """Functions of keys: parameters, and, of parameters and keys, placements, of a scene with objects of these names."""
    order = "abcde"
    objects = [mja.Object(name, full_size=0.06, on=order.index(name) % 2) for name in names]
    arena = mja.MultiTableArena([[0, 0, 0.8], [1.5, 0, 0.8]], objects=objects, table_priority=0)
    return jax.jit(jax.vmap(lambda key: arena.sample_params(key, DRAWN))), jax.jit(jax.vmap(arena.place))


@functools.cache
def twenty(names):
    """Parameters of twenty worlds, and their keys."""
    keys = jax.random.split(jax.random.key(3), 20)
    return drawing(names)[0](keys), keys


@pytest.mark.slow
def test_one_more_object_moves_no_draw():
    """A scene's draws depend on the world, the quantity and the object's name: another object changes none of them."""
    few, more, moved = (twenty(names)[0] for names in ("abcd", "abcde", "eabcd"))
    for name in QUANTITIES:
        rows = slice(None) if name.startswith(("table", "has")) else slice(4)
        np.testing.assert_array_equal(getattr(few, name), getattr(more, name)[:, rows], err_msg=name)
        last = slice(None) if name.startswith(("table", "has")) else slice(1, None)
        np.testing.assert_array_equal(getattr(few, name), getattr(moved, name)[:, last], err_msg=name)
    few_placed, placed = (drawing(names)[1](*twenty(names)) for names in ("abcd", "abcde"))
    np.testing.assert_array_equal(few_placed.qpos, placed.qpos[:, :4])


@pytest.mark.slow
def test_same_scene_in_any_batch():
    """World i is the same alone and in a large batch, placement and layout included."""
    (params, keys), (sample, place) = twenty("abcd"), drawing("abcd")
    large, alone = (params, place(params, keys)), sample(keys[7:8])
    alone = alone, place(alone, keys[7:8])
    jax.tree.map(
        lambda a, b: np.testing.assert_allclose(a[7:8], b, rtol=0, atol=2.0**-21), large, alone
    )  # fused otherwise


@pytest.mark.slow
def test_layouts():
    """Tables stand inside the workspace and apart by the gap, by an independent routine; where they do not, a flag says so."""
    arena = mja.MultiTableArena([[2 * i, 0, 0.8] for i in range(4)])
    ranges = mja.ArenaRanges(
        table_rots=mja.Uniform(-3, 3),
        table_full_sizes=mja.Uniform([0.5, 0.5, 0.02], [0.9, 0.7, 0.1]),
        table_active=mja.Count(1, 4),
        workspace=mja.Workspace([-1.2, -0.8], [1.3, 1.0], gap=0.15),
    )
    keys = jax.random.split(jax.random.key(0), 500)
    params = jax.jit(jax.vmap(lambda key: arena.sample_params(key, ranges)))(keys)
    valid = np.asarray(jax.jit(jax.vmap(lambda p: arena.valid(p, ranges)))(params))
    params = jax.tree.map(np.asarray, params)
    assert 0.5 < valid.mean() < 1  # crowded
    right = np.array([keeps(worlds.take(params, i), [-1.2, -0.8], [1.3, 1.0], 0.15) for i in range(500)])
    np.testing.assert_array_equal(valid, right)
    everywhere = np.array([keeps(worlds.take(params, i), [-9, -9], [99, 9], 0.0) for i in range(500)])
    assert everywhere.all()  # never an overlap, not even where the flag is false


def keeps(params, low, high, gap):
    """Whether points along the edges of all tables that are there lie inside a rectangle and apart (NumPy)."""
    edge = np.linspace(-1, 1, 41)
    rim = np.concatenate(
        [np.stack([edge, np.full(41, s)], 1) for s in (-1, 1)] + [np.stack([np.full(41, s), edge], 1) for s in (-1, 1)]
    )
    there, rims = np.flatnonzero(params.table_active), {}
    for t in there:
        c, s = np.cos(params.table_rots[t]), np.sin(params.table_rots[t])
        local = rim * np.asarray(params.table_full_sizes)[t, :2] / 2
        rims[t] = local @ np.array([[c, s], [-s, c]]) + np.asarray(params.table_offsets)[t, :2]
        if (rims[t] < np.array(low) - 1e-5).any() or (rims[t] > np.array(high) + 1e-5).any():
            return False
    for a in there:
        for b in there:
            if a == b:
                continue
            c, s = np.cos(params.table_rots[b]), np.sin(params.table_rots[b])
            local = (rims[a] - np.asarray(params.table_offsets)[b, :2]) @ np.array([[c, -s], [s, c]])
            outside = np.maximum(np.abs(local) - np.asarray(params.table_full_sizes)[b, :2] / 2, 0)
            if np.hypot(*outside.T).min() < gap - 1e-5:
                return False
    return True


def test_object_moves_from_an_absent_table():
    """Drawn onto a table that is there, an object whose nominal table is absent is there, with its mass."""
    arena = mja.MultiTableArena(
        [[0, 0, 0.8], [1.5, 0, 0.8]], objects=[mja.Object("o", on=1)], table_active=[True, False]
    )
    keys = jax.random.split(jax.random.key(0), 2)
    batch = arena.randomize(arena.put_model("jax"), keys, mja.ArenaRanges(object_tables=mja.Choice([0, 1])))
    assert batch.params.object_active.all()
    np.testing.assert_allclose(np.asarray(batch.model.body_mass)[:, arena.layout.object_body[0]], 0.125, rtol=1e-6)
    np.testing.assert_array_equal(batch.model.geom_margin[:, arena.layout.primitive_geom], 0)


def test_tied_to_what_is_absent():
    """An equality or tendon between an object and something else: its absence is refused on the host, and flagged."""
    arena = mja.TableArena(objects=[mja.Object("o", pos=(0, 0)), mja.Object("p", pos=(0.2, 0))])
    weld = arena.spec.add_equality(name="w", objtype=mujoco.mjtObj.mjOBJ_BODY, name1="o", name2="p")
    weld.type, data = mujoco.mjtEq.mjEQ_WELD, np.zeros(len(weld.data))
    data[[6, 10]] = 1  # the same orientation, at the same place; weight of the torque
    weld.data = data
    model, nominal = arena.put_model("jax"), arena.nominal_params()
    keys = jax.random.split(jax.random.key(0), 2)
    with pytest.raises(ValueError, match="object 'o' can be absent, but equality 'w' ties it"):
        arena.randomize(model, keys, mja.ArenaRanges(object_active=mja.Bernoulli(0.5)))
    assert arena.valid(nominal)
    assert not arena.valid(nominal._replace(object_active=jnp.array([False, True])))


def test_condim():
    """That of an object, MJCF bodies included, reaches the tables, those of a scene too; a file keeps its own."""
    xml = """<mujoco><worldbody><body><geom name="g" size=".03" condim="4"/>
      <geom name="v" size=".03" contype="0" conaffinity="0" condim="1"/></body></worldbody></mujoco>"""
    desk = '<mujoco><worldbody><body name="t"><geom name="top" type="box" size=".5 .5 .1"/></body></worldbody></mujoco>'
    for condim, want in ((None, 4), (1, 3), (6, 6)):
        objects = [mja.Object("m", "mjcf", file=mujoco.MjSpec.from_string(xml), condim=condim)]
        one, adopted = (
            mja.TableArena(objects=objects).mj_model,
            mja.Arena.from_xml(desk, ["t"], objects=objects).mj_model,
        )
        assert one.geom("m_g").condim == adopted.geom("m_g").condim == (condim or 4)
        assert one.geom("m_v").condim == 1
        assert one.geom("table_collision").condim == adopted.geom("top").condim == want
    assert (
        mja.TableArena(objects=[mja.Object("c", condim=6)], table_condim=3).mj_model.geom("table_collision").condim == 3
    )


def test_mass_of_geoms_in_the_world_of_a_file():
    """`mass` is that of all that the file has, wherever it stands in it."""
    xml = """<mujoco><worldbody><geom type="box" size=".03 .03 .03" pos="0 0 .03"/>
      <body pos="0 0 .09"><geom type="box" size=".03 .03 .03"/></body></worldbody></mujoco>"""
    arena = mja.TableArena(objects=[mja.Object("m", "mjcf", file=mujoco.MjSpec.from_string(xml), mass=0.5)])
    assert arena.mj_model.body_subtreemass[0] == pytest.approx(0.5)
    assert arena.rest_heights(arena.nominal_params())[0] == pytest.approx(0.8, abs=1e-6)


def test_far_tables_move_the_statistics():
    """Statistics follow also where the nominal scene is larger than its tables."""
    walls = "".join(f'<geom type="box" size=".1 .1 .1" pos="{x} {y} 0"/>' for x in (-5, 5) for y in (-5, 5))
    arena = mja.TableArena(xml=f"<mujoco><worldbody>{walls}</worldbody></mujoco>", objects=[mja.Object("cube")])
    far = arena.nominal_params()._replace(table_offsets=jnp.array([[20.0, 0, 0.8]]))
    got = arena.apply(arena.put_model("jax"), far).stat
    expected = arena.compile(far).stat
    np.testing.assert_allclose(got.extent, expected.extent, rtol=1e-6)
    np.testing.assert_allclose(got.center, expected.center, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("target", ["cube", "table1"])
@pytest.mark.parametrize("kind", ["camera", "light"])
def test_aimed_at_what_is_absent(kind, target):
    """A world without the object or table that a camera or light aims at compiles; in MJX it looks at where that is parked."""
    arena = mja.MultiTableArena([[0, 0, 0.8], [2, 0, 0.8]], objects=[mja.Object("cube", on=1)])
    add = getattr(arena.spec.worldbody, f"add_{kind}")
    add(name="c", pos=(1, 0, 1), mode=mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY, targetbody=target)
    absent = "object_active" if target == "cube" else "table_active"
    params = arena.nominal_params()
    params = params._replace(**{absent: getattr(params, absent).at[-1].set(False)})
    model = arena.compile(params)
    assert target not in [model.body(b).name for b in range(model.nbody)]
    assert getattr(model, kind)("c").mode == mujoco.mjtCamLight.mjCAMLIGHT_FIXED
    if kind == "camera":
        one = arena.apply(arena.put_model("jax"), params)
        look = -jax.jit(mjx.camlight)(one, jax.jit(mjx.kinematics)(one, mjx.make_data(one))).cam_xmat[-1, :, 2]
        assert look[2] > 0.99  # up: high above


WALLS = """<mujoco><worldbody><geom name="wall" type="plane" size="0 0 .1" pos="15 0 0" zaxis="1 0 0"/>
  <geom name="ceiling" type="plane" size="0 0 .1" pos="0 0 3" zaxis="0 0 -1"/><geom name="hook" size=".1" pos="20 2 1"/>
  </worldbody></mujoco>"""


def behind_walls():
    """A table behind a wall and below a ceiling, with two objects that are parked on the other side of both, and pairs."""
    objects = [mja.Object("a", "sphere", 0.06, pos=(-0.2, 0)), mja.Object("b", "sphere", 0.06, pos=(0.2, 0))]
    arena = mja.MultiTableArena([[20, 0, 0.8], [22, 0, 0.8]], objects=objects, xml=WALLS)
    for other in ("wall", "ceiling", "hook", "b_g0", "table0_collision"):
        arena.spec.add_pair(name=f"a_{other}", geomname1="a_g0", geomname2=other)
    return arena


def absent_behind_walls():
    """Parameters of worlds of `behind_walls`: an object that is there, none, a table that is not."""
    params = jax.tree.map(lambda x: jnp.stack([x] * 4), behind_walls().nominal_params())
    return params._replace(
        object_active=jnp.array([[True, False], [False, True], [False, False], [True, True]]),
        table_active=jnp.array([[True, True], [True, True], [True, True], [False, True]]),
    )


@pytest.mark.xslow_on("jax")
@pytest.mark.slow_on("jax")
def test_absent_behind_walls(impl):
    """What is parked behind a wall and a ceiling stays there, touching nothing, explicit pairs included."""
    arena, params = behind_walls(), absent_behind_walls()
    batch = arena.batch(arena.put_model(impl), params)
    data = mja.make_data(batch)
    start = np.asarray(data.qpos).reshape(4, 2, 7)
    end = np.asarray(mja.rollout(batch, data, 20).qpos).reshape(4, 2, 7)
    there = np.array([[True, False], [False, True], [False, False], [False, False]])
    np.testing.assert_array_equal(end[~there], start[~there])
    np.testing.assert_allclose(end[there][:, 2], 0.83, atol=1e-3)


def test_absent_behind_walls_in_c():
    """The same in C: which contacts push."""
    batch = behind_walls().c_batch(absent_behind_walls())
    batch.step(nstep=20)
    touching = []
    for i in range(4):
        model, data = batch.get_model(i), batch.get_data(i)
        mujoco.mj_forward(model, data)
        pushing = [contact.geom for contact in data.contact if contact.efc_address >= 0]
        touching.append([{model.geom(g).name for g in pair} for pair in pushing])
    assert touching == [[{"a_g0", "table0_collision"}], [{"b_g0", "table0_collision"}], [], []]
