"""Worlds in words and numbers are what the parameters say."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import worlds

import mjx_arenas as mja
from mjx_arenas import dr, furniture


def pair():
    """Two tables, a box and a ball."""
    objects = [mja.Object("cube", mass=0.5), mja.Object("ball", "sphere", 0.06, on=1)]
    return mja.MultiTableArena([[0, -0.7, 0.8], [0, 0.7, 0.85]], [0.5, 0], objects=objects, has_legs=[True, False])


def test_one_world():
    """As printed: what is absent is said to be, and an object on an absent table, too."""
    arena = pair()
    params = arena.nominal_params()._replace(table_active=jnp.array([True, False]))
    said = arena.describe(params)
    assert str(said) == (
        "table           middle of its top [m]  size [m]               yaw [deg]        friction\n"
        "table0          0.000, -0.700, 0.800   0.800 x 0.800 x 0.050  28.6       legs  1, 0.005, 0.0001\n"
        "table1  absent  0.000, 0.700, 0.850    0.800 x 0.800 x 0.050  0.0              1, 0.005, 0.0001\n"
        "\n"
        "object          type    on      size [m]               mass [kg]  friction\n"
        "cube            box     table0  0.050 x 0.050 x 0.050  0.5        1, 0.005, 0.0001\n"
        "ball    absent  sphere  table1  0.060 x 0.060 x 0.060  0.1131     1, 0.005, 0.0001"
    )
    np.testing.assert_allclose(said.tables[0].yaw, np.degrees(0.5), rtol=1e-6)
    assert [t.present for t in said.tables] == [True, False]
    assert [(o.present, o.table) for o in said.objects] == [(True, "table0"), (False, "table1")]
    np.testing.assert_allclose(said.objects[0].mass, 0.5)
    plain = mja.TableArena()
    assert "object" not in str(plain.describe())
    assert str(plain.describe()) == str(plain.describe(plain.nominal_params()))


def test_many_worlds():
    """Ranges are those of the parameters of the worlds in which the table or object is."""
    arena = pair()
    ranges = worlds.TABLES._replace(
        table_offsets=mja.Uniform([0, 0, -0.1], [0, 0, 0.1], relative="add"),
        table_active=mja.Bernoulli([1.0, 0.6]),
        object_tables=mja.Choice([0, 1]),
        object_active=mja.Bernoulli([1.0, 0.5]),
    )
    params = jax.jit(jax.vmap(lambda key: arena.sample_params(key, ranges)))(jax.random.split(jax.random.key(0), 50))
    said = arena.describe(params)
    found = {(r.item, r.quantity, r.axis): r for r in said.ranges}
    p = jax.tree.map(np.asarray, params)
    assert said.n_worlds == 50
    there = p.table_active[:, 1]
    assert 0 < there.mean() < 1
    for (quantity, axis), values in {
        ("table_offsets", "z"): p.table_offsets[there, 1, 2],
        ("table_rots", ""): p.table_rots[there, 1],
        ("table_full_sizes", "width"): p.table_full_sizes[there, 1, 1],
        ("table_frictions", "sliding"): p.table_frictions[there, 1, 0],
        ("has_legs", ""): p.has_legs[there, 1],
    }.items():
        expected = values.min(), values.mean(), values.max()
        np.testing.assert_allclose(found["table1", quantity, axis][5:8], expected, rtol=1e-5, err_msg=quantity)
    assert found["table1", "table_active", ""].mean == np.float64(there.mean())
    assert found["table1", "table_offsets", "z"][3:5] == ("[m]", 0.85)
    here = p.object_active[:, 1] & np.take_along_axis(p.table_active, p.object_tables, 1)[:, 1]
    assert found["ball", "object_active", ""].mean == here.mean()
    share = (p.object_tables[here, 1] == 0).mean()
    np.testing.assert_allclose(found["ball", "object_tables", "table0"].mean, share)
    assert not found["table0", "table_active", ""].varies
    assert not found["table1", "table_offsets", "x"].varies
    assert said.varying == tuple(r for r in said.ranges if r.varies)
    lines = [re.split(r"\s{2,}", line) for line in str(said).splitlines()]
    assert lines[0] == ["quantity", "of", "axes", "nominal", "least", "mean", "most"]
    assert ["table_active", "table1", "yes", "no", f"yes in {there.mean():.1%}", "yes"] in lines
    assert ["ball", "table0", "no", "no", f"yes in {share:.1%}", "yes"] in [line[-6:] for line in lines]
    assert ["", "table1", "yes", "no", f"yes in {1 - share:.1%}", "yes"] in lines  # a line for each table, however many


@pytest.mark.slow
def test_absent():
    """What is switched off in every world is named: tables with what stands on them, objects, parts, boards, bodies."""
    arena = mja.MultiTableArena(
        [[0, -0.7, 0.8], [0, 0.7, 0.8]],
        objects=[mja.Object("box"), mja.Object("ball", on=1), mja.Object("off", active=False), mja.Object("cube")],
    )
    for name, x in (("rack", 3), ("rest", 5), ("here", 7)):
        arena.add_part(furniture.Shelf(name, pos=(x, 0, 0), heights=(0.3, 0.6)))
    arena.attach('<mujoco><worldbody><body name="lamp" pos="0 3 0"><geom size=".1"/></body></worldbody></mujoco>', "a_")
    arena.vary(lamp=dr.Term("body.active", "a_lamp"))
    ranges = mja.ArenaRanges(
        table_active=mja.Fixed([True, False]),
        object_active=mja.Bernoulli([1, 1, 0, 0.5]),
        terms={
            "rack.active": mja.Fixed(False),
            "rest.pieces_active": mja.Fixed([True, False]),
            "here.active": mja.Bernoulli(0.5),
            "lamp": mja.Fixed(False),
        },
    )
    with pytest.warns(UserWarning, match="leaves object 'ball' in no world, as nothing"):
        params = jax.vmap(lambda key: arena.sample_params(key, ranges))(mja.world_keys(0, range(20)))
    said = arena.describe(params)
    assert said.absent == ("table1", "ball", "off", "rack", "rest_board1", "a_lamp")
    assert str(said).endswith("\n\nin no world: table1, ball, off, rack, rest_board1, a_lamp")
    assert arena.describe(jax.tree.map(lambda x: x[:1], params)).absent[:2] == ("table1", "ball")
    everything = jax.tree.map(lambda x: jnp.stack([x, x]), pair().nominal_params())
    assert str(pair().describe(everything)) == "nothing varies"


def test_never_there():
    """What is in no world has no numbers, and one world varies in nothing."""
    arena = pair()
    params = arena.nominal_params()._replace(table_active=jnp.array([True, False]))
    said = arena.describe(jax.tree.map(lambda x: x[None], params))
    found = {(r.item, r.quantity, r.axis): r for r in said.ranges}
    assert np.isnan(found["table1", "table_offsets", "x"].mean)
    assert not said.varying
    assert str(said) == "one world: nothing to compare it with"
