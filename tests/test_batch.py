"""Batches: what they store, what loops would give, and the conventions of others."""

import logging
import operator
import re

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds
from mujoco import mjx
from rounding import Rounding

import mjx_arenas as mja
from mjx_arenas.record import room
from mjx_arenas.sim import batch as batch_
from mjx_arenas.sim import data as data_


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_batch_equals_loop(arena, batch, impl):
    """Each world of a batch is the world alone, to the bit; all else is shared."""
    model = arena.put_model(impl)
    shared = worlds.leaves(model)
    apply = jax.jit(arena.apply)
    for i in (0, 5, 11):
        alone = worlds.leaves(apply(model, batch.world(i)))
        for name, value in worlds.leaves(batch.model).items():
            if name in batch.fields:
                np.testing.assert_allclose(
                    value[i], alone[name], rtol=2.0**-22, atol=2.0**-22, err_msg=name
                )  # fused otherwise
            else:
                np.testing.assert_array_equal(value, shared[name], err_msg=name)


@pytest.mark.parametrize(
    ("ranges", "fields"),
    [
        (mja.ArenaRanges(), ()),
        (mja.ArenaRanges(table_frictions=mja.Uniform(0.1, 1)), ("geom_friction",)),
        (
            mja.ArenaRanges(has_legs=mja.Bernoulli(0.5)),
            ("geom_size", "geom_pos", "geom_rbound", "geom_aabb", "geom_rgba"),
        ),
        (mja.ArenaRanges(table_rots=mja.Uniform(0, 1)), ("body_pos", "body_quat", "qpos0", "qpos_spring")),
    ],
)
def test_only_what_varies_is_batched(arena, ranges, fields, recwarn):
    """The batched leaves are those that follow from the ranges."""
    batch = arena.randomize(arena.put_model("jax"), jax.random.split(jax.random.key(0), 2), ranges)
    physical = tuple(name for name in batch.fields if not name.startswith(("stat", "cam", "light")))
    assert sorted(physical) == sorted(fields)
    axes = jax.tree_util.tree_leaves_with_path(batch.in_axes)
    assert {jax.tree_util.keystr(path)[1:] for path, axis in axes if axis == 0} == set(batch.fields)


def ball():
    """The arena that compiles fastest."""
    return mja.TableArena(objects=worlds.OBJECTS[1:2])


@pytest.mark.slow
def test_nothing_varies_steps():
    """A batch in which nothing varies steps all the same."""
    arena = ball()
    batch = arena.randomize(arena.put_model("jax"), jax.random.split(jax.random.key(0), 3), mja.ArenaRanges())
    data = mja.step(batch, mja.make_data(batch))
    assert data.qpos.shape == (3, arena.mj_model.nq)


@pytest.mark.slow
def test_one_trace():
    """One compiled step serves other parameters and other ranges of the same kind."""
    arena = ball()
    model = arena.put_model("warp")
    narrow = worlds.RANGES._replace(table_rots=mja.Uniform(-0.1, 0.1))
    batches = [
        arena.randomize(model, jax.random.split(jax.random.key(i), 2), r) for i, r in enumerate((worlds.RANGES, narrow))
    ]
    compiled = batch_._step, batch_._make_data
    before = [function._cache_size() for function in compiled]
    for batch in batches:
        mja.step(batch, mja.make_data(batch))
    assert [function._cache_size() - b for function, b in zip(compiled, before, strict=True)] == [1, 1]
    assert repr(batches[0]).startswith(
        "ArenaBatch(n_worlds=2, n_tables=1, n_objects=1, impl='warp', fields=(body_inertia, "
    )
    assert len(repr(batches[0])) < 1000


@pytest.mark.xslow_on("jax")
@pytest.mark.slow_on("jax")
@pytest.mark.slow
def test_rollout_is_steps(batch, keys):
    """A rollout of 3 steps is 3 steps, and records each."""
    data = mja.make_data(batch, keys)
    stepped = [data := mja.step(batch, data) for _ in range(3)]
    last, times = mja.rollout(batch, mja.make_data(batch, keys), 3, record=_time)
    np.testing.assert_allclose(last.qpos, stepped[-1].qpos, rtol=0, atol=1e-6)
    np.testing.assert_allclose(times, np.stack([d.time for d in stepped]))
    assert np.asarray(times).shape == (3, 12)


@pytest.mark.slow
def test_qpos_of_numpy(batch, keys):
    """An array of NumPy's in the data steps as one of JAX's."""
    data = mja.make_data(batch, keys)
    stepped = mja.step(batch, data.replace(qpos=np.asarray(data.qpos)))
    np.testing.assert_array_equal(stepped.qpos, mja.step(batch, data).qpos)


def _time(data):
    return data.time


@pytest.mark.slow
def test_make_data(arena, batch, keys, impl):
    """Objects touch their tables from above, and static geoms stand where each world has them."""
    data = mja.make_data(batch, keys)
    z = np.asarray(data.qpos)[:, arena.layout.object_qpos[:, 2]]
    np.testing.assert_allclose(z, worlds.rest_heights(arena, batch.params), rtol=0, atol=1e-6)
    forward = jax.jit(jax.vmap(mjx.kinematics, in_axes=(batch.in_axes, 0))) if impl == "jax" else None
    expected = forward(batch.model, data) if forward else None
    for i in (0, 7):
        import mujoco

        model = arena.compile(batch.world(i))
        c = mujoco.MjData(model)
        c.qpos = data.qpos[i]
        mujoco.mj_kinematics(model, c)
        static = np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0)
        np.testing.assert_allclose(data.geom_xpos[i][static], c.geom_xpos[static], rtol=0, atol=1e-5)
        np.testing.assert_allclose(data.geom_xmat[i][static].reshape(-1, 9), c.geom_xmat[static], rtol=0, atol=1e-5)
        if expected is not None:
            np.testing.assert_allclose(expected.geom_xpos[i], c.geom_xpos, rtol=0, atol=1e-5)


def test_nominal_places_follow_their_table(arena, keys):
    """Without keys, objects stand at their nominal places of each world's tables."""
    batch = arena.randomize(arena.put_model("jax"), keys, worlds.RANGES)
    data = mja.make_data(batch)
    np.testing.assert_array_equal(data.qpos, batch.model.qpos0)
    expected = arena.compile(batch.world(1)).qpos0
    np.testing.assert_allclose(data.qpos[1], expected, atol=1e-6)


@pytest.mark.parametrize("impl", ["warp"], indirect=True)
def test_capacity_follows_vmap(arena, batch, keys):
    """Under `vmap`, data on Warp makes room for the contacts of all worlds; data made for one world is no surprise later."""
    vmapped = jax.vmap(arena.make_world_data, in_axes=(batch.in_axes, 0, 0))
    one = arena.make_world_data(arena.put_model("warp"), arena.nominal_params())._impl.naconmax
    assert one > 0
    for made in (vmapped, jax.jit(vmapped)):
        assert jax.eval_shape(made, batch.model, batch.params, keys)._impl.naconmax == 12 * one
    assert mja.make_data(batch, keys)._impl.naconmax == 12 * one
    only_model = jax.vmap(lambda m: arena.make_world_data(m, arena.nominal_params()), in_axes=(batch.in_axes,))
    assert jax.eval_shape(only_model, batch.model)._impl.naconmax == 12 * one
    frictions = mja.ArenaRanges(table_frictions=mja.LogUniform([0.1, 0.005, 0.0001], [1, 0.005, 0.0001]))
    slippery = arena.randomize(arena.put_model("warp"), keys, frictions)
    without_keys = jax.vmap(arena.make_world_data, in_axes=(slippery.in_axes, 0))
    assert jax.eval_shape(without_keys, slippery.model, slippery.params)._impl.naconmax == 12 * one
    with pytest.raises(ValueError, match=r"Write jax\.jit\(jax\.vmap"):
        jax.vmap(jax.jit(arena.make_world_data), in_axes=(slippery.in_axes, 0))(slippery.model, slippery.params)
    with pytest.raises(
        ValueError,
        match=r"Write jax\.jit\(jax\.vmap\(make_world_data\)\), not jax\.vmap\(jax\.jit\(make_world_data\)\)",
    ):
        jax.vmap(jax.jit(arena.make_world_data), in_axes=(batch.in_axes, 0, 0))(batch.model, batch.params, keys)


@pytest.mark.slow
@pytest.mark.parametrize("impl", ["warp"], indirect=True)
def test_no_contact_is_dropped(arena, batch, keys):
    """Warp reports no overflow with every object on the floor's and the tables' edges."""
    data = mja.make_data(batch, keys)
    pile = np.asarray(data.qpos).copy()
    pile[:, arena.layout.object_qpos[:, :3]] = np.asarray(batch.params.table_offsets)[
        :, :1
    ]  # all in one place, in the slab
    data = mja.step(batch, data.replace(qpos=jnp.asarray(pile)))
    assert int(data._impl.nacon[0]) > 12 * 10
    assert int(data._impl.nacon[0]) <= data._impl.naconmax
    assert (np.asarray(data._impl.nefc) <= data._impl.njmax).all()


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_randomization_fn(arena, impl):
    """Brax's and Playground's convention, for any number of worlds and both kinds of keys."""
    model = arena.put_model(impl)
    fn = arena.randomization_fn(worlds.RANGES)
    for n, key in ((2, jax.random.PRNGKey(0)), (5, jax.random.key(0))):
        model_v, in_axes = fn(model, rng=jax.random.split(key, n))
        shapes = jax.vmap(lambda m: m.geom_size, in_axes=[in_axes])(model_v).shape
        assert shapes == (n, arena.mj_model.ngeom, 3)
    with pytest.raises(ValueError, match=r"`rng` must be one key per world, .* got shape \(2,\)\."):
        fn(model, jax.random.PRNGKey(0))


def test_apply_keeps_other_edits(arena, impl):
    """Fields that somebody else has changed stay changed where the arena does not decide them."""
    model = arena.put_model(impl)
    floor = arena.mj_model.geom("floor").id
    edited = model.replace(geom_friction=model.geom_friction.at[floor, 0].set(0.3), dof_damping=model.dof_damping + 2)
    one = arena.apply(edited, arena.nominal_params())
    assert one.geom_friction[floor, 0] == np.float32(0.3)
    np.testing.assert_array_equal(one.dof_damping, edited.dof_damping)


def test_given_params(arena):
    """A batch of given parameters is the batch that was drawn with them."""
    model = arena.put_model("jax")
    drawn = arena.randomize(model, jax.random.split(jax.random.key(4), 12), worlds.RANGES)
    given = arena.batch(model, drawn.params)
    assert given.valid.all()
    for name in drawn.fields:
        a, b = (operator.attrgetter(name)(x.model) for x in (drawn, given))
        np.testing.assert_allclose(a, b, rtol=0, atol=2.0**-22)


def test_best_implementation_says_which(arena, caplog, monkeypatch):
    """`put_model()` chooses, and says so in the log."""
    with caplog.at_level(logging.INFO, logger="mjx_arenas"):
        chosen = arena.put_model()
    assert [record.levelname for record in caplog.records] == ["INFO"]
    assert f"put_model: impl={chosen.impl.value!r} on" in caplog.text
    assert chosen.impl.value == "jax"  # on a CPU
    monkeypatch.setattr(data_, "warp_installed", lambda: False)
    with pytest.raises(ValueError, match=r"^impl='warp' needs warp-lang: pip install 'mjx_arenas\[warp\]'\.$"):
        arena.put_model("warp")


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 12])
def test_moved_batch(arena, impl, n):
    """README's call for a batch whose tables move: static geoms go where freshly made data has them, and it steps; a batch of one too."""
    arena = ball() if n == 1 else arena
    model = arena.put_model(impl)
    first, batch = (arena.randomize(model, jax.random.split(jax.random.key(seed), n), worlds.RANGES) for seed in (6, 7))
    data = mja.make_data(first, jax.random.split(jax.random.key(6), n))
    if n == 1:
        batch = arena.batch(model, batch.params)
    moved = jax.vmap(mja.place_static, in_axes=(batch.in_axes, 0))(batch.model, data)
    static = np.flatnonzero(arena.mj_model.body_weldid[arena.mj_model.geom_bodyid] == 0)
    fresh = mja.make_data(batch)
    assert np.abs(np.asarray(data.geom_xpos - fresh.geom_xpos)[:, static]).max() > 0.01
    np.testing.assert_allclose(
        np.asarray(moved.geom_xpos)[:, static], np.asarray(fresh.geom_xpos)[:, static], rtol=0, atol=1e-5
    )
    np.testing.assert_allclose(
        np.asarray(moved.geom_xmat)[:, static], np.asarray(fresh.geom_xmat)[:, static], rtol=0, atol=1e-5
    )
    stepped = mja.step(batch, moved)
    assert np.isfinite(np.asarray(stepped.qpos)).all()
    np.testing.assert_allclose(
        np.asarray(stepped.geom_xpos)[:, static], np.asarray(fresh.geom_xpos)[:, static], rtol=0, atol=1e-5
    )


CHAIN = """<mujoco><compiler angle="radian"/><worldbody>
  <body name="a" pos="1 0 .2" euler=".1 .2 .3"><geom size=".1"/>
    <body name="b" pos=".3 .1 0" euler="0 .4 0"><geom size=".1" pos=".1 0 0"/>
      <body name="c" pos=".2 0 .3" euler=".5 0 1"><geom type="box" size=".1 .2 .1" pos="0 .1 0" euler=".3 0 0"/>
        <body name="d" pos="0 .2 .1" euler="0 0 .7"><geom size=".1"/>
          <body name="e" pos=".1 .1 .1" euler="1 .2 0"><geom type="capsule" size=".02 .1" euler="0 .6 .1"/></body></body>
        <body name="arm" pos="0 0 .2"><joint axis="0 1 0"/><geom type="capsule" size=".02 .1"/></body></body></body></body>
  <geom name="floor" type="plane" size="2 2 .1"/>
</worldbody></mujoco>"""


@pytest.mark.slow
def test_fixed_bodies_on_fixed_bodies():
    """Five deep, each of which is elsewhere in each world, stand as in the recompiled world; what a joint moves is left as it is."""
    arena = mja.Arena.from_xml(CHAIN)
    arena.vary(pos=mja.dr.Term("body.pos"), turn=mja.dr.Term("body.rpy"))
    ranges = mja.ArenaRanges(
        terms={name: mja.Uniform(-size, size, relative="add") for name, size in (("pos", 0.3), ("turn", 1.0))}
    )
    batch = arena.randomize(arena.put_model(), jax.random.split(jax.random.key(0), 4), ranges)
    data = mja.make_data(batch)
    data = data.replace(geom_xpos=jnp.full_like(data.geom_xpos, 7.0), geom_xmat=jnp.full_like(data.geom_xmat, 7.0))
    moved = jax.vmap(mja.place_static, in_axes=(batch.in_axes, 0))(batch.model, data)
    for i in range(4):
        model = arena.compile(batch.world(i))
        c = mujoco.MjData(model)
        mujoco.mj_kinematics(model, c)
        rounding, body = Rounding(model, c), model.geom_bodyid
        still = np.flatnonzero(model.body_weldid[body] == 0)
        assert len(still) == 6
        error = rounding.chain[body[still], None]
        assert (np.abs(moved.geom_xpos[i] - c.geom_xpos)[still] <= error * rounding.reach[body[still], None]).all()
        assert (np.abs(moved.geom_xmat[i].reshape(-1, 9) - c.geom_xmat)[still] <= error).all()
        arm = np.delete(np.arange(model.ngeom), still)
        assert (moved.geom_xpos[i][arm] == 7.0).all()
        assert (moved.geom_xmat[i][arm] == 7.0).all()


def heap(n, impl="warp"):
    """Boxes on one another: more contacts than a few slots hold; two worlds."""
    arena = mja.TableArena(objects=[mja.Object(f"box{i}", full_size=0.06, pos=(0.1 * i, 0)) for i in range(n)])
    batch = arena.batch(arena.put_model(impl), jax.tree.map(lambda p: jnp.stack([p, p]), arena.nominal_params()))
    place = np.array([[0, 0, 0.8 + 0.03 + 0.0595 * i, 1, 0, 0, 0] for i in range(n)]).reshape(-1)
    return arena, batch, jnp.asarray(np.stack([place, place]), jnp.float32)


@pytest.mark.slow
def test_dropped_contacts_are_reported():
    """Too small a capacity says which worlds lost contacts, and which one would have been enough; that one is."""
    arena, batch, place = heap(3)
    few = mja.rollout(batch, mja.make_data(batch, max_contacts=2).replace(qpos=place), 2)
    report = mja.capacity(batch, few)
    assert report.overflowed.all()
    needed = int(report.needed)
    enough = mja.rollout(batch, mja.make_data(batch, max_contacts=needed).replace(qpos=place), 2)
    full = mja.rollout(batch, mja.make_data(batch).replace(qpos=place), 2)
    assert 12 <= int(mja.capacity(batch, full).needed) <= arena.record.room(None).contacts <= needed
    short = mja.rollout(batch, mja.make_data(batch, max_contacts=11).replace(qpos=place), 2)
    assert mja.capacity(batch, short).overflowed.all()
    exact = int(mja.capacity(batch, full).needed)
    exactly = mja.rollout(batch, mja.make_data(batch, max_contacts=exact).replace(qpos=place), 2)
    for data in (enough, full, exactly):
        assert not mja.capacity(batch, data).overflowed.any()
    np.testing.assert_allclose(enough.qpos, full.qpos, rtol=0, atol=1e-6)
    assert np.abs(few.qpos - full.qpos).max() > 1e-5
    # Later steps that need less do not hide it.
    apart = mja.rollout(batch, few.replace(qpos=place.at[:, 2::7].add(jnp.arange(3) + 1.0)), 1)
    assert int(mja.capacity(batch, apart).needed) < 12
    assert mja.capacity(batch, apart).overflowed.all()


def test_more_contacts_than_there_can_be(monkeypatch):
    """More than int32 counts, in all worlds together or as bytes of one world's Jacobian, and more than memory holds."""
    _, batch, _ = heap(3)
    width = mja.make_data(batch, max_contacts=8)._impl.efc__J.shape[-1]
    with pytest.raises(ValueError, match=r"^`max_contacts` must be at most") as error:
        mja.make_data(batch, max_contacts=10**9)
    most = int(
        re.findall(r"at most ([\d,]+), as Warp's sizes for 2 worlds are int32, got 1000000000\.$", str(error.value))[
            0
        ].replace(",", "")
    )
    assert 0.9999 * 2**31 < most * 4 * 4 * width < 2**31  # four rows each
    mj_model = batch.record.mj_model
    assert room.most_contacts(mj_model, 2**20) == 2**11 - 1  # all worlds together

    def full(*args, **kwargs):
        raise RuntimeError("Failed to allocate 24000000000 bytes on device 'cpu'")

    monkeypatch.setattr(data_.mjx, "make_data", full)
    says = r"^`max_contacts` must be so small that data of 2 worlds fit into memory, got 1000000\."
    with pytest.raises(ValueError, match=says):
        mja.make_data(batch, max_contacts=10**6)


def test_room_for_a_body_of_many_feet():
    """An object that stands on eight boxes has room for the contacts of all."""
    feet = "".join(f'<geom type="box" size=".02 .02 .02" pos="{0.06 * i} {y} 0"/>' for i in range(4) for y in (0, 0.1))
    rack = mujoco.MjSpec.from_string(f"<mujoco><worldbody><body>{feet}</body></worldbody></mujoco>")
    arena = mja.TableArena(objects=[mja.Object("rack", "mjcf", file=rack)], xml="<mujoco/>")
    _, data = arena.c_world(arena.nominal_params())
    data.qpos[2] -= 1e-3
    mujoco.mj_forward(arena.mj_model, data)
    assert data.ncon == 32 <= arena.record.room(None).contacts


def test_room_for_what_can_touch_at_once():
    """A heap of boxes in a corner of four tables fits; more tables elsewhere need no more room."""
    objects = [mja.Object(f"box{i}", full_size=0.1, pos=(0.12 * i - 0.3, 0)) for i in range(6)]
    tables = [[x, y, 0.8] for x in (-0.4, 0.4) for y in (-0.4, 0.4)]
    arena = mja.MultiTableArena(tables, table_full_sizes=[(0.8, 0.8, 0.05)] * 4, objects=objects)
    many = mja.MultiTableArena(
        tables + [[3 + i, 0, 0.8] for i in range(12)], table_full_sizes=[(0.8, 0.8, 0.05)] * 16, objects=objects
    )
    assert many.record.room(None) == arena.record.room(None)
    data = mujoco.MjData(arena.mj_model)
    size, most = 0.1, 0
    for k, qpos in enumerate(arena.layout.object_qpos):
        layer, row = divmod(k, 4) if k < 4 else (1, k - 4)
        xy = np.array([(-1, -1), (1, -1), (-1, 1), (1, 1)][row]) * (0.0495 if layer == 0 else 0.02)
        data.qpos[qpos] = [*xy, 0.8 + size / 2 + layer * 0.0995 - 0.0005, 1, 0, 0, 0]
    for _ in range(50):
        mujoco.mj_step(arena.mj_model, data)
        most = max(most, data.ncon)
    assert 20 < most <= arena.record.room(None).contacts


def test_data_of_others():
    """Of the other implementation, and of an arena with another camera: one sentence, whatever takes it."""
    keys = jax.random.split(jax.random.key(0), 2)

    def made(impl, cameras=0):
        arena = mja.TableArena(objects=[mja.Object("box")])
        for i in range(cameras):
            arena.add_camera(f"eye{i}")
        batch = arena.randomize(arena.put_model(impl), keys, mja.ArenaRanges())
        return batch, mja.make_data(batch)

    (warp, on_warp), (plain, on_jax), (_, more) = made("warp"), made("jax"), made("jax", cameras=1)
    for call in (mja.step, mja.capacity, lambda batch, data: mja.rollout(batch, data, 1)):
        with pytest.raises(ValueError, match=r"^`data` must have the model's impl='warp', got impl='jax'\.$"):
            call(warp, on_jax)
        with pytest.raises(ValueError, match=r"^`data` must have the model's impl='jax', got impl='warp'\.$"):
            call(plain, on_warp)
        with pytest.raises(ValueError, match=r"^`data.cam_xpos` must have shape \(2, 4, 3\), got \(2, 5, 3\)\."):
            call(plain, more)
