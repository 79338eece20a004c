"""Every world is the model that MuJoCo would have compiled for it."""

import functools

import jax
import numpy as np
import pytest
import worlds
from mujoco import mjx

import mjx_arenas as mja

EPS = 2.0**-24  # relative rounding of one float32 operation

# Leaves that may differ from the recompiled model's, each with the reason why it cannot matter.
MAY_DIFFER = {}
# Arrays of the tree's structure that may: shared by all worlds, as a fixed topology demands.
STRUCTURE_MAY_DIFFER = {
    "geom_sameframe": "a shortcut of C MuJoCo's kinematics; neither implementation of MJX reads it",
    "_impl.geom_rbound_hfield": "read for height fields only, which put_model refuses",
    "_impl.dof_length": "read for sleeping bodies only, which MJX does not have",
}


def tolerance(name, expected, scale):
    """Largest rounding error: so many float32 operations on numbers up to `scale` [m]."""
    operations = 32 if name.startswith(("stat", "cam", "light")) else 8
    return operations * EPS * max(scale, float(np.abs(expected[np.abs(expected) < 1e6]).max(initial=0.0)))


def differing(got, expected, scale):
    """Names of the arrays that differ by more than rounding."""
    assert got.keys() == expected.keys()
    found = set()
    for name, want in expected.items():
        have = got[name]
        assert have.shape == want.shape, name
        atol = tolerance(name, want, scale) if want.dtype.kind == "f" else 0
        if not np.allclose(have, want, rtol=0, atol=atol):
            found.add(name)
    return found


@functools.cache
def compared(n_tables, impl, n_worlds):
    """Names of the arrays that differ in any of so many random worlds."""
    arena = worlds.arena(n_tables)
    model = arena.put_model(impl)
    apply = jax.jit(lambda key: (params := arena.sample_params(key, worlds.RANGES), arena.fields(model, params)))
    found = set()
    for key in jax.random.split(jax.random.key(n_tables), n_worlds):
        params, fields = apply(key)
        expected = mjx.put_model(arena.compile(params), impl=impl)
        scale = float(np.abs(params.table_offsets).max()) + 1.5
        found |= differing(worlds.leaves(model.tree_replace(fields)), worlds.leaves(expected), scale)
    return found


@pytest.mark.parametrize("n_tables", range(1, 9))
def test_compile_oracle(n_tables, impl):
    """208 random worlds on each implementation: no leaf differs but those listed."""
    assert compared(n_tables, impl, 26) - STRUCTURE_MAY_DIFFER.keys() == MAY_DIFFER.keys()


def test_listed_structure_differs_somewhere(impl):
    """The list of structure holds nothing that does not differ."""
    assert "geom_sameframe" in compared(3, impl, 26) & STRUCTURE_MAY_DIFFER.keys()


@pytest.mark.parametrize("stale", ["geom_aabb", "geom_rbound", "site_pos", "body_quat", "geom_friction", "stat.extent"])
def test_oracle_notices(stale):
    """The oracle sees a writer that forgets a field."""
    arena = worlds.arena(2)
    model = arena.put_model("jax")
    params = arena.sample_params(jax.random.key(3), worlds.RANGES)
    fields = arena.fields(model, params)
    del fields[stale]
    expected = worlds.leaves(mjx.put_model(arena.compile(params), impl="jax"))
    assert stale in differing(worlds.leaves(model.tree_replace(fields)), expected, 3.0)


@pytest.mark.parametrize("quantity", mja.ArenaParams._fields)
def test_one_varying_quantity(quantity, impl):
    """A batch in which one quantity varies stores every leaf that follows from it."""
    arena = worlds.arena(2)
    ranges = mja.ArenaRanges(**{quantity: getattr(worlds.RANGES, quantity)})
    model = arena.put_model(impl)
    batch = arena.randomize(model, jax.random.split(jax.random.key(1), 4), ranges)
    for i in range(4):
        one = model.tree_replace({name: mja.batch._leaf(batch.model, name)[i] for name in batch.fields})
        expected = mjx.put_model(arena.compile(batch.world(i)), impl=impl)
        assert differing(worlds.leaves(one), worlds.leaves(expected), 3.5) <= STRUCTURE_MAY_DIFFER.keys()


def test_nominal_changes_nothing(impl):
    """The nominal parameters give the nominal model."""
    for arena in (worlds.arena(3), worlds.arena(2, has_legs=[True, False]), mja.TableArena(objects=worlds.OBJECTS)):
        model = arena.put_model(impl)
        again = arena.apply(model, arena.nominal_params())
        assert differing(worlds.leaves(again), worlds.leaves(model), 1.0) == set()


def test_user_additions(impl):
    """Cameras and lights on tables, pinned statistics, a base MJCF with bodies and defaults of its own."""
    xml = """<mujoco><statistic meansize="0.3"/><default><geom friction="0.7 0.1 0.1" condim="4"/></default>
      <worldbody><geom name="ground" type="plane" size="0 0 .1"/><light pos="0 0 3"/>
        <body name="post" pos="1 1 0"><geom type="capsule" size=".05 .4" pos="0 0 .4"/>
          <body name="arm" pos="0 0 .8"><joint name="hinge"/><geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/></body></body>
      </worldbody></mujoco>"""
    arena = worlds.arena(2, xml=xml)
    body = arena.spec.body("table1")
    body.add_camera(name="on_table", pos=(0.1, 0, 0.5), quat=(0.9, 0.1, 0.3, 0))
    body.add_light(name="lamp", pos=(0, 0.1, 0.5), dir=(0, 0.1, -1))
    body.add_site(name="mark", pos=(0.1, 0.2, 1.2))
    body.add_body(name="shelf", pos=(0, 0, 0.4), quat=(0.9, 0, 0, 0.2)).add_geom(
        type=6, size=(0.1, 0.1, 0.01), pos=(0, 0.1, 0)
    )
    arena.spec.body("cube1").add_camera(name="on_cube", pos=(0, 0, 0.3))
    model = arena.put_model(impl)
    for key in jax.random.split(jax.random.key(5), 4):
        params = arena.sample_params(key, worlds.RANGES)
        expected = mjx.put_model(arena.compile(params), impl=impl)
        got = differing(worlds.leaves(arena.apply(model, params)), worlds.leaves(expected), 3.5)
        assert got <= STRUCTURE_MAY_DIFFER.keys()


def test_xml_is_the_same_world():
    """The MJCF of a world compiles to the model of that world, in full precision."""
    arena = worlds.arena(3)
    params = arena.sample_params(jax.random.key(11), worlds.RANGES)
    import mujoco

    from_xml, compiled = mujoco.MjModel.from_xml_string(arena.to_xml(params)), arena.compile(params)
    for name in (
        "body_pos",
        "body_quat",
        "geom_size",
        "geom_pos",
        "geom_quat",
        "geom_friction",
        "site_pos",
        "qpos0",
        "geom_rgba",
    ):
        np.testing.assert_allclose(getattr(from_xml, name), getattr(compiled, name), rtol=0, atol=1e-7, err_msg=name)


def test_batch_bytes():
    """What a world adds to the model, for the three tables with legs and three boxes of the measured prototype."""
    arena = mja.MultiTableArena(worlds.offsets(3), objects=[mja.Object(f"box{i}", table=i) for i in range(3)])
    keys = jax.random.split(jax.random.key(0), 2)
    batch = arena.randomize(arena.put_model("jax"), keys, worlds.RANGES._replace(has_legs=None))
    bytes_of = {name: mja.batch._leaf(batch.model, name)[0].nbytes for name in batch.fields}
    print("bytes a world:", batch.nbytes, bytes_of)
    assert batch.nbytes == sum(bytes_of.values()) <= 1900
    assert arena.randomize(arena.put_model("jax"), keys, worlds.RANGES).nbytes <= 2260
