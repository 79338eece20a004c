"""Bad input: each is answered on the host, by sentences that name what is wrong and what is allowed."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import worlds

import mjx_arenas as mja

OFFSETS = [[0, -1, 0.8], [0, 0, 0.8], [0, 1, 0.8]]


@functools.cache
def arena():
    return mja.MultiTableArena(OFFSETS, objects=[mja.Object("cube")])


def keys(n):
    return jax.random.split(jax.random.key(0), n)


def randomize(**ranges):
    return arena().randomize(arena().put_model("jax"), keys(2), mja.ArenaRanges(**ranges))


CASES = {
    "rots short": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_rots=[0, 1]),
        "`table_rots` must be one value, or one such for each of the 3 tables, got shape (2,): [0, 1].",
    ),
    "rots long": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_rots=[0, 1, 2, 3]),
        "`table_rots` must be one value, or one such for each of the 3 tables, got shape (4,): [0, 1, 2, 3].",
    ),
    "rots one": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_rots=[0]),
        "`table_rots` must be one value, or one such for each of the 3 tables, got shape (1,): [0].",
    ),
    "rots str": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_rots="north"),
        "`table_rots` must be numbers in a regular array, got 'north'.",
    ),
    "sizes 13": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_full_sizes=[(0.8, 0.8, 0.05)]),
        "`table_full_sizes` must be (length, width, thickness), or one such for each of the 3 tables, got shape (1, 3): [[0.8, 0.8, 0.05]].",
    ),
    "sizes two": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_full_sizes=[(0.8, 0.8, 0.05)] * 2),
        "`table_full_sizes` must be (length, width, thickness), or one such for each of the 3 tables, got shape (2, 3): [[0.8, 0.8, 0.05], [0.8, 0.8, 0.05]].",
    ),
    "sizes scalar": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_full_sizes=0.8),
        "`table_full_sizes` must be (length, width, thickness), or one such for each of the 3 tables, got one number: 0.8.",
    ),
    "sizes ragged": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_full_sizes=[(0.8, 0.8, 0.05), (0.8, 0.8), (1, 1, 1)]),
        "`table_full_sizes` must be numbers in a regular array, got [(0.8, 0.8, 0.05), (0.8, 0.8), (1, 1, 1)].",
    ),
    "fric scalar": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_frictions=1.0),
        "`table_frictions` must be (sliding, torsional, rolling), or one such for each of the 3 tables, got one number: 1.0.",
    ),
    "fric 2": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_frictions=[[1, 1, 1]] * 2),
        "`table_frictions` must be (sliding, torsional, rolling), or one such for each of the 3 tables, got shape (2, 3): [[1, 1, 1], [1, 1, 1]].",
    ),
    "legs str": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, has_legs="yes"),
        "`has_legs` must be true or false, got 'yes'.",
    ),
    "legs short": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, has_legs=[True]),
        "`has_legs` must be one value, or one such for each of the 3 tables, got shape (1,): [True].",
    ),
    "legs num": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, has_legs=[1, 0, 2]),
        "`has_legs` must be true or false, got [1, 0, 2].",
    ),
    "off empty": (
        ValueError,
        lambda: mja.MultiTableArena([]),
        "`table_offsets` must be one (x, y, z) per table, at least one table, got shape (0,): [].",
    ),
    "off flat": (
        ValueError,
        lambda: mja.MultiTableArena([0, 0, 0.8]),
        "`table_offsets` must be one (x, y, z) per table, at least one table, got shape (3,): [0.0, 0.0, 0.8].",
    ),
    "off two": (
        ValueError,
        lambda: mja.MultiTableArena([[0, 0], [1, 1]]),
        "`table_offsets` must be one (x, y, z) per table, at least one table, got shape (2, 2): [[0, 0], [1, 1]].",
    ),
    "off nan": (
        ValueError,
        lambda: mja.MultiTableArena([[0, 0, 0.8], [0, np.nan, 0.8]]),
        "`table_offsets` of table 1 must be finite [m], got [0.0, nan, 0.8].",
    ),
    "rot inf": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_rots=[0, 0, np.inf]),
        "`table_rots` of table 2 must be finite [rad], got inf.",
    ),
    "size neg": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_full_sizes=[(0.8, 0.8, 0.05), (0.8, 0.8, 0.05), (0.4, -0.1, 0.02)]),
        "`table_full_sizes` of table 2 must be finite and > 0 on every axis [m], got [0.4, -0.1, 0.02].",
    ),
    "size zero": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_full_sizes=(0.8, 0.8, 0)),
        "`table_full_sizes` of all tables must be finite and > 0 on every axis [m], got [0.8, 0.8, 0.0].",
    ),
    "fric neg": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_frictions=(-1, 0, 0)),
        "`table_frictions` of all tables must be finite and >= 0 on every axis, got [-1.0, 0.0, 0.0].",
    ),
    "low": (
        ValueError,
        lambda: mja.MultiTableArena([[0, 0, 0.02]]),
        "`table_offsets` of table 0 puts the top at z = 0.02 m, which leaves no room for legs under a slab 0.05 m thick: with `has_legs`, z must be > 0.025.",
    ),
    "several": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_rots=[0, 1], table_frictions=(-1, 0, 0), has_legs="no"),
        "3 problems in MultiTableArena:\n- `table_rots` must be one value, or one such for each of the 3 tables, got shape (2,): [0, 1].\n- `has_legs` must be true or false, got 'no'.\n- `table_frictions` of all tables must be finite and >= 0 on every axis, got [-1.0, 0.0, 0.0].",
    ),
    "several2": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_full_sizes=(-1, 1, 1), table_frictions=(-1, 0, 0)),
        "2 problems in MultiTableArena:\n- `table_full_sizes` of all tables must be finite and > 0 on every axis [m], got [-1.0, 1.0, 1.0].\n- `table_frictions` of all tables must be finite and >= 0 on every axis, got [-1.0, 0.0, 0.0].",
    ),
    "one size": (
        ValueError,
        lambda: mja.TableArena(table_full_size=(0.8, 0.8)),
        "`table_full_size` must be (length, width, thickness), got shape (2,): [0.8, 0.8].",
    ),
    "one neg": (
        ValueError,
        lambda: mja.TableArena(table_full_size=(0.8, 0.8, -0.1)),
        "`table_full_size` must be finite and > 0 on every axis [m], got [0.8, 0.8, -0.1].",
    ),
    "one off": (
        ValueError,
        lambda: mja.TableArena(table_offset=(0, 0)),
        "`table_offset` must be (x, y, z), got shape (2,): [0, 0].",
    ),
    "one low": (
        ValueError,
        lambda: mja.TableArena(table_offset=(0, 0, 0)),
        "`table_offset` puts the top at z = 0 m, which leaves no room for legs under a slab 0.05 m thick: with `has_legs`, z must be > 0.025.",
    ),
    "one many": (
        ValueError,
        lambda: mja.TableArena(table_offset=[(0, 0, 1), (1, 1, 1)]),
        "`table_offset` must be (x, y, z), got shape (2, 3): [[0, 0, 1], [1, 1, 1]].",
    ),
    "prio": (ValueError, lambda: mja.TableArena(table_priority=1.5), "`table_priority` must be an integer, got 1.5."),
    "condim": (ValueError, lambda: mja.TableArena(table_condim=2), "`table_condim` must be 1, 3, 4 or 6, got 2."),
    "obj type": (
        ValueError,
        lambda: mja.TableArena(objects=["cube"]),
        "`objects[0]` must be an mjx_arenas.Object, got 'cube'.",
    ),
    "obj kind": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", "cone")]),
        "Object 'c': `type` must be one of box, sphere, capsule, got 'cone'.",
    ),
    "obj dup": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c"), mja.Object("c")]),
        "Two objects are named 'c': names must differ.",
    ),
    "obj taken": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("table")]),
        "Object 'table': the arena already has an element of that name.",
    ),
    "obj table": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", table="desk")]),
        "Object 'c': `table` must be 0 or 'table', got 'desk'.",
    ),
    "obj table9": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, objects=[mja.Object("c", table=3)]),
        "Object 'c': `table` must be an index from 0 to 2 or one of 'table0', 'table1', 'table2', got 3.",
    ),
    "obj size": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", full_size=(0.1, -0.1, 0.1))]),
        "Object 'c': `full_size` must be one number or 3 numbers, all > 0 [m], got [0.1, -0.1, 0.1].",
    ),
    "obj caps": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", "capsule", 0.1)]),
        "Object 'c': `full_size` of a capsule must be (length, diameter, diameter) with length > diameter, got 0.1.",
    ),
    "obj sph": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", "sphere", (0.1, 0.2, 0.1))]),
        "Object 'c': `full_size` of a sphere must have 3 equal extents, got [0.1, 0.2, 0.1].",
    ),
    "obj pos": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", pos=(0, 0, 1))]),
        "Object 'c': `pos` must be 2 finite numbers, got [0.0, 0.0, 1.0].",
    ),
    "obj dens": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", density=-1)]),
        "Object 'c': `density` must be > 0 [kg/m^3], got -1.0.",
    ),
    "obj name": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("")]),
        "An object's `name` must be a non-empty string, got ''.",
    ),
    "xml missing": (
        FileNotFoundError,
        lambda: mja.TableArena(xml="nowhere/base.xml"),
        "`xml`: there is no file 'nowhere/base.xml'.",
    ),
    "xml bad": (
        ValueError,
        lambda: mja.TableArena(xml="<mujoco><worldbody><geom/></mujoco>"),
        "`xml`: MuJoCo cannot read the MJCF text: XML parse error 14: Error=XML_ERROR_MISMATCHED_ELEMENT ErrorID=14 (0xe) Line number=1: XMLElement name=worldbody",
    ),
    "xml schema": (
        ValueError,
        lambda: mja.TableArena(xml="<mujoco><worldbody><table/></worldbody></mujoco>"),
        "`xml`: MuJoCo cannot read the MJCF text: XML Error: Schema violation: unrecognized element Element 'table', line 1",
    ),
    "xml fuse": (
        ValueError,
        lambda: mja.TableArena(xml='<mujoco><compiler fusestatic="true"/></mujoco>'),
        "`spec.compiler`: fusestatic and discardvisual would remove parts of the tables: switch them off.",
    ),
    "xml joint": (
        ValueError,
        lambda: mja.TableArena(
            xml='<mujoco><worldbody><body name="table"><freejoint/><geom size=".1"/></body></worldbody></mujoco>'
        ),
        "`xml`: body 'table' must be a fixed child of the world, without a frame, to serve as a table.",
    ),
    "d keys2": (
        ValueError,
        lambda: mja.make_data(
            arena().randomize(arena().put_model("jax"), keys(2), mja.ArenaRanges()), jax.random.key(0)
        ),
        "`keys` must be one key per world, shape (W,) or, of jax.random.PRNGKey, (W, 2), got shape ().",
    ),
    "legs u": (
        ValueError,
        lambda: randomize(has_legs=mja.Uniform(0, 1)),
        "`ranges.has_legs` (Uniform): true and false need Bernoulli, Choice or Fixed.",
    ),
    "objs": (
        ValueError,
        lambda: mja.TableArena(objects=mja.Object("c")),
        "`objects` must be a sequence of mjx_arenas.Object, got Object(name='c', type='box', full_size=0.05, table=0, pos=None, rot=0.0, density=1000.0, friction=(1.0, 0.005, 0.0001), condim=3, rgba=None).",
    ),
    "all": (
        ValueError,
        lambda: mja.MultiTableArena(
            OFFSETS, table_rots=[1], table_frictions=-1, objects=[mja.Object("c", "cone", table="x")], table_condim=2
        ),
        "5 problems in MultiTableArena:\n- `table_rots` must be one value, or one such for each of the 3 tables, got shape (1,): [1].\n- `table_frictions` must be (sliding, torsional, rolling), or one such for each of the 3 tables, got one number: -1.\n- Object 'c': `type` must be one of box, sphere, capsule, got 'cone'.\n- Object 'c': `table` must be an index from 0 to 2 or one of 'table0', 'table1', 'table2', got 'x'.\n- `table_condim` must be 1, 3, 4 or 6, got 2.",
    ),
    "xml dup": (
        ValueError,
        lambda: mja.TableArena(
            xml='<mujoco><worldbody><geom name="cube_g0" size=".1"/></worldbody></mujoco>', objects=[mja.Object("cube")]
        ),
        "Object 'cube': the arena already has an element of that name.",
    ),
    "hfield": (
        ValueError,
        lambda: mja.TableArena(
            xml='<mujoco><asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset><worldbody><geom name="hills" type="hfield" hfield="h"/></worldbody></mujoco>',
            objects=[mja.Object("cube")],
        ).put_model("jax"),
        "Geom 'hills' is a height field, whose collisions in MJX use the template's bounds: use a plane, boxes or a mesh.",
    ),
    "pair": (
        ValueError,
        lambda: mja.TableArena(
            xml='<mujoco><worldbody><geom name="post" type="cylinder" size=".1 .1"/></worldbody></mujoco>',
            objects=[mja.Object("cube")],
        ).put_model("jax"),
        "impl='jax' has no collision function for geoms 'post' (cylinder) and 'cube_g0' (box): use impl='warp', other shapes, or contype/conaffinity.",
    ),
    "impl": (ValueError, lambda: arena().put_model("cuda"), "`impl` must be 'jax', 'warp' or None, got 'cuda'."),
    "nodof": (
        ValueError,
        lambda: (lambda a: a.make_data(a.put_model("jax"), a.nominal_params()))(mja.TableArena()),
        "MJX cannot step a model without a degree of freedom: give the arena `objects=`, or add a joint to `arena.spec`.",
    ),
    "r type": (
        ValueError,
        lambda: randomize(table_rots=(0, 1)),
        "`ranges.table_rots` must be a distribution such as Uniform(low, high), or None, got (0, 1).",
    ),
    "r order": (
        ValueError,
        lambda: randomize(table_rots=mja.Uniform(1, -1)),
        "`ranges.table_rots` (Uniform): `low` must be <= `high`, got 1.0 and -1.0.",
    ),
    "r nan": (
        ValueError,
        lambda: randomize(table_rots=mja.Uniform(0, np.nan)),
        "`ranges.table_rots` (Uniform): `high` must be finite, got nan.",
    ),
    "r shape": (
        ValueError,
        lambda: randomize(table_full_sizes=mja.Uniform([0.1, 0.2], [0.3, 0.4])),
        "2 problems in `ranges`:\n- `ranges.table_full_sizes` (Uniform): `low` must be one number, (3,) or (3, 3), got shape (2,).\n- `ranges.table_full_sizes` (Uniform): `high` must be one number, (3,) or (3, 3), got shape (2,).",
    ),
    "r shape2": (
        ValueError,
        lambda: randomize(table_rots=mja.Uniform([0.1, 0.2], 0.4)),
        "`ranges.table_rots` (Uniform): `low` must be one number or (3,), got shape (2,).",
    ),
    "r size": (
        ValueError,
        lambda: randomize(table_full_sizes=mja.Uniform([0.3, 0.3, -0.01], [0.5, 0.5, 0.1])),
        "`ranges.table_full_sizes` of all tables can reach [0.3, 0.3, -0.01]: it must stay > 0 on every axis [m].",
    ),
    "r size add": (
        ValueError,
        lambda: randomize(table_full_sizes=mja.Uniform(-0.1, 0, relative="add")),
        "`ranges.table_full_sizes` of all tables can reach [0.7, 0.7, -0.05]: it must stay > 0 on every axis [m].",
    ),
    "r fric": (
        ValueError,
        lambda: randomize(table_frictions=mja.Normal(0.5, 0.1, -0.1, 1)),
        "`ranges.table_frictions` of all tables can reach [-0.1, -0.1, -0.1]: it must stay >= 0 on every axis.",
    ),
    "r legs": (
        ValueError,
        lambda: randomize(table_offsets=mja.Uniform([0, 0, -0.79], [0, 0, 0], relative="add")),
        "`ranges` can put the top of all tables at z = 0.01 m with a slab 0.05 m thick, which leaves no room for legs: keep z > thickness / 2, or give `has_legs` a distribution that is always false.",
    ),
    "r legs2": (
        ValueError,
        lambda: randomize(table_full_sizes=mja.Uniform(0.1, 2.0)),
        "`ranges` can put the top of all tables at z = 0.8 m with a slab 2 m thick, which leaves no room for legs: keep z > thickness / 2, or give `has_legs` a distribution that is always false.",
    ),
    "r log": (
        ValueError,
        lambda: randomize(table_frictions=mja.LogUniform(0, 1)),
        "`ranges.table_frictions` (LogUniform): `low` must be > 0, got 0.0.",
    ),
    "r std": (
        ValueError,
        lambda: randomize(table_rots=mja.Normal(0, -1, -1, 1)),
        "`ranges.table_rots` (Normal): `std` must be >= 0, got -1.",
    ),
    "r p": (
        ValueError,
        lambda: randomize(has_legs=mja.Bernoulli(1.5)),
        "`ranges.has_legs` (Bernoulli): `p` must be between 0 and 1, got 1.5.",
    ),
    "r bern": (
        ValueError,
        lambda: randomize(table_rots=mja.Bernoulli(0.5)),
        "`ranges.table_rots` (Bernoulli): Bernoulli gives true or false; it serves `has_legs` only.",
    ),
    "r rel": (
        ValueError,
        lambda: randomize(table_rots=mja.Uniform(0, 1, relative="times")),
        "`ranges.table_rots` (Uniform): `relative` must be None, 'add' or 'scale', got 'times'.",
    ),
    "r legrel": (
        ValueError,
        lambda: randomize(has_legs=mja.Fixed(1, relative="add")),
        "`ranges.has_legs` (Fixed): true and false cannot be relative, got relative='add'.",
    ),
    "r tied": (
        ValueError,
        lambda: randomize(table_offsets=mja.Uniform(0, 1, tied=(True, False))),
        "`ranges.table_offsets` (Uniform): `tied` must be true, false or one of them per axis, got (True, False).",
    ),
    "r choicep": (
        ValueError,
        lambda: randomize(table_rots=mja.Choice([0.1, 0.2], p=[0.5, 0.6])),
        "`ranges.table_rots` (Choice): `p` must be 2 probabilities that add up to 1, got [0.5, 0.6].",
    ),
    "r str": (
        ValueError,
        lambda: randomize(table_rots=mja.Uniform("a", "b")),
        "2 problems in `ranges`:\n- `ranges.table_rots` (Uniform): `low` must be numbers, got a.\n- `ranges.table_rots` (Uniform): `high` must be numbers, got b.",
    ),
    "r rag": (
        ValueError,
        lambda: randomize(table_full_sizes=mja.Uniform([[1, 2], [3]], 2)),
        "`ranges.table_full_sizes` (Uniform): `low` must be numbers in a regular array, got [[1, 2], [3]].",
    ),
    "r cls": (
        TypeError,
        lambda: arena().randomize(arena().put_model("jax"), keys(2), {"table_rots": 1}),
        "`ranges` must be an mjx_arenas.ArenaRanges, got dict.",
    ),
    "p batch": (
        ValueError,
        lambda: arena().compile(jax.tree.map(lambda x: jnp.stack([x, x]), arena().nominal_params())),
        "5 problems in `params`:\n- `params.table_offsets` must have shape (3, 3), got (2, 3, 3): take one world of a batch, batch.world(i).\n- `params.table_rots` must have shape (3,), got (2, 3): take one world of a batch, batch.world(i).\n- `params.table_full_sizes` must have shape (3, 3), got (2, 3, 3): take one world of a batch, batch.world(i).\n- `params.table_frictions` must have shape (3, 3), got (2, 3, 3): take one world of a batch, batch.world(i).\n- `params.has_legs` must have shape (3,), got (2, 3): take one world of a batch, batch.world(i).",
    ),
    "p val": (
        ValueError,
        lambda: arena().compile(arena().nominal_params()._replace(table_frictions=-np.ones((3, 3)))),
        "`table_frictions` of all tables must be finite and >= 0 on every axis, got [-1.0, -1.0, -1.0].",
    ),
    "p shape": (
        ValueError,
        lambda: arena().apply(arena().put_model("jax"), arena().nominal_params()._replace(table_rots=jnp.zeros(2))),
        "`params.table_rots` must have shape (3,), got (2,).",
    ),
    "d keys": (
        ValueError,
        lambda: mja.make_data(arena().randomize(arena().put_model("jax"), keys(2), mja.ArenaRanges()), keys(3)),
        "`keys` must be one for each of the 2 worlds, got 3.",
    ),
    "d key": (
        ValueError,
        lambda: arena().randomize(arena().put_model("jax"), jax.random.key(0), mja.ArenaRanges()),
        "`keys` must be one key per world, shape (W,) or, of jax.random.PRNGKey, (W, 2), got shape ().",
    ),
    "keys none": (
        ValueError,
        lambda: arena().randomize(arena().put_model("jax"), None, mja.ArenaRanges()),
        "`keys` must be an array of keys such as jax.random.split(key, n_worlds), got None.",
    ),
    "batched": (
        ValueError,
        lambda: arena().apply(randomize(table_rots=mja.Uniform(0, 1)).model, arena().nominal_params()),
        "`model` must be of one world, got one with batched leaves: randomize and apply start from put_model().",
    ),
    "nothing": (
        ValueError,
        lambda: arena().randomization_fn(mja.ArenaRanges())(arena().put_model("jax"), rng=keys(2)),
        "`ranges` gives no quantity a distribution: there is nothing to randomize.",
    ),
    "cb val": (
        ValueError,
        lambda: arena().c_batch(
            jax.tree.map(lambda x: jnp.stack([x, x]), arena().nominal_params())._replace(
                table_frictions=-jnp.ones((2, 3, 3))
            )
        ),
        "World 0: `table_frictions` of all tables must be finite and >= 0 on every axis, got [-1.0, -1.0, -1.0].",
    ),
    "cb keys": (
        ValueError,
        lambda: arena().c_batch(jax.tree.map(lambda x: jnp.stack([x, x]), arena().nominal_params()), keys=keys(3)),
        "`keys` must be one for each of the 2 worlds, got 3.",
    ),
    "xml type": (TypeError, lambda: mja.TableArena(xml=3), "`xml` must be a path or MJCF text, got 3."),
    "xml frame": (
        ValueError,
        lambda: mja.TableArena(
            xml='<mujoco><worldbody><frame pos="1 0 0"><body name="table"/></frame></worldbody></mujoco>'
        ),
        "`xml`: body 'table' must be a fixed child of the world, without a frame, to serve as a table.",
    ),
    "xml part": (
        ValueError,
        lambda: mja.TableArena(xml='<mujoco><worldbody><geom name="table_collision" size=".1"/></worldbody></mujoco>'),
        "`xml`: 'table_collision' must be on body 'table' to serve as a part of that table.",
    ),
    "xml weld": (
        ValueError,
        lambda: mja.TableArena(
            xml='<mujoco><worldbody><body name="table"/><body name="p" pos="0 0 2"><freejoint/><geom size=".1"/></body></worldbody><equality><weld body1="table" body2="p"/></equality></mujoco>'
        ),
        "MuJoCo derives eq_data from where tables and objects stand, which would be stale in other worlds: give equalities and tendons explicit numbers (relpose, springlength), or keep them off these.",
    ),
    "condim bool": (
        ValueError,
        lambda: mja.TableArena(table_condim=True),
        "`table_condim` must be 1, 3, 4 or 6, got True.",
    ),
    "many keys": (
        ValueError,
        lambda: arena().sample_params(keys(2), mja.ArenaRanges()),
        "`key` must be one key, of one world, got shape (2,): use jax.vmap, or randomize.",
    ),
    "mjmodel": (
        ValueError,
        lambda: arena().apply(arena().mj_model, arena().nominal_params()),
        "`model` must be an mjx.Model, from put_model(), got MjModel.",
    ),
    "not batch": (
        TypeError,
        lambda: mja.make_data(arena()),
        "`batch` must be an ArenaBatch, from arena.randomize() or arena.batch(), got MultiTableArena.",
    ),
    "one data": (
        ValueError,
        lambda: mja.step(
            randomize(table_rots=mja.Uniform(0, 1)),
            arena().make_data(arena().put_model("jax"), arena().nominal_params()),
        ),
        "`data` must be of the batch's 2 worlds, from make_data(batch), got data of one world.",
    ),
    "steps": (
        ValueError,
        lambda: mja.rollout(randomize(table_rots=mja.Uniform(0, 1)), None, 2.5),
        "`n_steps` must be a whole number >= 0, got 2.5.",
    ),
    "urdf": (
        ValueError,
        lambda: mja.TableArena(xml="<robot/>"),
        "`xml`: the text is not MJCF, whose root is <mujoco>.",
    ),
    "valid batch": (
        ValueError,
        lambda: arena().valid(randomize(table_rots=mja.Uniform(0, 1)).params),
        "5 problems in `params`:\n- `params.table_offsets` must have shape (3, 3), got (2, 3, 3): take one world of a batch, batch.world(i).\n- `params.table_rots` must have shape (3,), got (2, 3): take one world of a batch, batch.world(i).\n- `params.table_full_sizes` must have shape (3, 3), got (2, 3, 3): take one world of a batch, batch.world(i).\n- `params.table_frictions` must have shape (3, 3), got (2, 3, 3): take one world of a batch, batch.world(i).\n- `params.has_legs` must have shape (3,), got (2, 3): take one world of a batch, batch.world(i).",
    ),
    "slice": (
        IndexError,
        lambda: randomize(table_rots=mja.Uniform(0, 1)).world(slice(0, 2)),
        "`index` must be from 0 to 1, got slice(0, 2, None).",
    ),
    "other": (
        ValueError,
        lambda: mja.TableArena().apply(arena().put_model("jax"), mja.TableArena().nominal_params()),
        "`model` must come from this arena's put_model() (nbody 2, ngeom 7, nsite 1, nq 0, nv 0), got another model (nbody 5, ngeom 20, nsite 3, nq 7, nv 6).",
    ),
    "bnp": (
        ValueError,
        lambda: arena().batch(arena().put_model("jax"), arena().nominal_params()),
        "5 problems in `params`:\n- `params.table_offsets` must have shape (W, 3, 3), got (3).\n- `params.table_rots` must have shape (W, 3), got ().\n- `params.table_full_sizes` must have shape (W, 3, 3), got (3).\n- `params.table_frictions` must have shape (W, 3, 3), got (3).\n- `params.has_legs` must have shape (W, 3), got ().",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_input(case):
    """The exact message."""
    error, call, message = CASES[case]
    with pytest.raises(error) as raised:
        call()
    assert type(raised.value) is error
    assert str(raised.value) == message


GOOD = {
    "integers": lambda: mja.MultiTableArena([[0, 0, 1], [2, 0, 1]], table_rots=[0, 1], table_full_sizes=(1, 1, 1)),
    "tuples": lambda: mja.MultiTableArena(((0, 0, 1), (2, 0, 1)), (0, 1), has_legs=(1, 0)),
    "0-d arrays": lambda: mja.MultiTableArena(np.array([[0, 0, 1], [2, 0, 1]]), np.array(0.5), has_legs=np.array(True)),
    "JAX arrays": lambda: mja.MultiTableArena(jnp.array([[0.0, 0.0, 1.0]]), jnp.array([0.5])),
    "no legs, on the floor": lambda: mja.TableArena((1, 1, 0.1), table_offset=(0, 0, 0.05), has_legs=False),
}


@pytest.mark.parametrize("case", GOOD)
def test_good_input(case):
    """Integers, lists, tuples and 0-d arrays are fine."""
    assert GOOD[case]().mj_model.ngeom > 0


def test_overlap_is_a_warning():
    """Overlapping tables are named, with the depth; ones that touch or lie over each other are not."""
    with pytest.warns(UserWarning, match=r"^Tables 'table0' and 'table1' overlap by 0\.050 m\.$"):
        mja.MultiTableArena([[0, 0, 0.8], [0.5, 0, 0.8]])
    with pytest.warns(UserWarning, match=r"overlap by 0\.020 m"):
        mja.MultiTableArena([[0, 0, 0.8], [0.78, 0, 0.8]])
    with pytest.warns(UserWarning, match=r"overlap by 0\.034 m"):  # a corner: 0.4 + 0.4 sqrt(2) - 0.932
        mja.MultiTableArena([[0, 0, 0.8], [0.932, 0, 0.8]], table_rots=[0, np.pi / 4])
    mja.MultiTableArena([[0, 0, 0.8], [0.8, 0, 0.8], [0, 0, 0.4]])


def test_friction_without_effect_is_a_warning():
    """Torsional friction has no effect in contacts of dimension 3."""
    with pytest.warns(UserWarning, match="table_condim=3, torsional and rolling friction have none"):
        randomize(table_frictions=mja.Uniform(0.1, 0.2))


def test_ranges_of_legs_that_are_never_there():
    """Such tables may be as low as they like; with legs in one world of a thousand they may not."""
    low = mja.Uniform([0, 0, -0.79], [0, 0, 0], relative="add")
    assert randomize(table_offsets=low, has_legs=mja.Fixed(False)).valid.all()
    with pytest.raises(ValueError, match="leaves no room for legs"):
        randomize(table_offsets=low, has_legs=mja.Bernoulli(0.001))


def test_choice_of_numbers_serves_all_axes():
    """A choice of numbers for a quantity with axes gives each table one for all of them."""
    sizes = np.asarray(randomize(table_full_sizes=mja.Choice([0.1, 0.2])).params.table_full_sizes)
    assert np.isin(sizes, np.float32([0.1, 0.2])).all()
    assert (sizes == sizes[..., :1]).all()


def test_spec_is_closed_after_compiling():
    """Additions that come too late are refused, not forgotten."""
    late = mja.TableArena(objects=[mja.Object("cube")])
    late.put_model("jax")
    late.spec.worldbody.add_geom(name="late", size=(0.1, 0, 0))
    late.spec.compile()
    with pytest.raises(ValueError, match=r"^`arena\.spec` changed after the arena was compiled"):
        late.compile(late.nominal_params())


def test_world_index():
    """A world beyond the batch."""
    with pytest.raises(IndexError, match=r"^`index` must be from 0 to 1, got 2\.$"):
        randomize(table_rots=mja.Uniform(0, 1)).world(2)


@pytest.mark.skipif(worlds.HAS_C_BATCH, reason="this MuJoCo has mujoco.batch")
def test_c_batch_says_what_to_install():
    """On MuJoCo 3."""
    with pytest.raises(ImportError, match=r"^c_batch needs mujoco >= 4\.0 \(pip install -U mujoco\); this is 3\."):
        arena().c_batch(randomize().params)
