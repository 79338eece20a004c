"""Bad input: each is answered on the host, by sentences that name what is wrong and what is allowed."""

import functools
import pathlib
import re

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds

import mjx_arenas as mja
from mjx_arenas import envs

OFFSETS = [[0, -1, 0.8], [0, 0, 0.8], [0, 1, 0.8]]


@functools.cache
def arena():
    return mja.MultiTableArena(OFFSETS, objects=[mja.Object("cube")])


def keys(n):
    return jax.random.split(jax.random.key(0), n)


def randomize(**ranges):
    return arena().randomize(arena().put_model("jax"), keys(2), mja.ArenaRanges(**ranges))


DATA = pathlib.Path(__file__).parent / "data"
GHOST = '<mujoco><worldbody><body><geom size=".1" contype="0" conaffinity="0"/></body></worldbody></mujoco>'
TWO_FRICTIONS = """<mujoco><worldbody><body><geom size=".1" friction=".1 0 0"/><geom size=".1" pos=".1 0 0"/></body>
  </worldbody></mujoco>"""
ROBOT = '<mujoco><worldbody><body name="base" pos="0 0 .2"><joint/><geom size=".1"/></body></worldbody></mujoco>'
FREE = '<mujoco><worldbody><body name="base"><freejoint/><geom size=".1"/></body></worldbody></mujoco>'
SCENE = """<mujoco><worldbody>
  <body name="desk"><geom name="desk_top" type="box" size=".5 .5 .1"/><geom name="desk_side" type="box" size=".5 .1 .5"/></body>
  <body name="round"><geom name="disc" type="cylinder" size=".5 .1"/></body>
  <body name="cart"><joint/><geom type="box" size=".5 .5 .1"/></body>
  <body name="ramp" euler="0 10 0"><geom type="box" size=".5 .5 .1"/></body></worldbody></mujoco>"""


def groups_later():
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.spec.compiler.inertiagrouprange = (1, 2)
    return arena


def open_arena():
    """Not compiled yet."""
    return mja.MultiTableArena(OFFSETS, objects=[mja.Object("cube")])


@functools.cache
def arena_in_use():
    arena = open_arena()
    arena.mj_model  # noqa: B018
    return arena


@functools.cache
def with_robot():
    arena = open_arena()
    arena.attach(ROBOT, on_table=1)
    return arena


def with_robot_again():
    arena = open_arena()
    for _ in range(2):
        arena.attach(ROBOT, "arm_")


@functools.cache
def drawer():
    """A table of a scene with a drawer."""
    xml = """<mujoco><worldbody><body name="desk"><geom name="top" type="box" size=".5 .5 .1"/>
      <body name="drawer" pos="0 0 -.3"><joint type="slide"/><geom size=".1"/></body></body></worldbody></mujoco>"""
    return mja.Arena.from_xml(xml, ["desk"])


def added_to(kind, **kwargs):
    """The cube with something added to its body."""
    arena = open_arena()
    getattr(arena.spec.body("cube"), f"add_{kind}")(**kwargs)
    return arena.mj_model


def paired():
    """A pair and a sensor that name the floor."""
    arena = open_arena()
    arena.spec.add_pair(name="p", geomname1="floor", geomname2="cube_g0")
    sensor = arena.spec.add_sensor(name="d", type=mujoco.mjtSensor.mjSENS_GEOMDIST, objname="cube_g0", refname="floor")
    sensor.objtype = sensor.reftype = mujoco.mjtObj.mjOBJ_GEOM
    arena.spec.compile()
    return arena


TOTAL = '<mujoco><compiler settotalmass="7"/><worldbody><body><geom size=".1"/></body></worldbody></mujoco>'
HEAVY = '<mujoco><compiler boundmass="1"/><worldbody><body><geom size=".1"/></body></worldbody></mujoco>'


@functools.cache
def rod():
    return mja.TableArena(objects=[mja.Object("rod", "capsule", (0.12, 0.04, 0.04))])


@functools.cache
def wedge():
    return mja.TableArena(objects=[mja.Object("wedge", "mesh", 0.1, file=DATA / "wedge.obj")])


@functools.cache
def ball():
    return mja.TableArena(objects=[mja.Object("ball", "sphere")])


TIED = mujoco.mjtEq.mjEQ_WELD


def tied(relpose=False, **kwargs):
    """Two boxes welded to each other."""
    objects = [mja.Object("a", pos=(0, 0)), mja.Object("b", pos=(0.2, 0))]
    arena = mja.MultiTableArena(OFFSETS, objects=objects, **kwargs)
    weld = arena.spec.add_equality(name="w", type=TIED, objtype=mujoco.mjtObj.mjOBJ_BODY, name1="a", name2="b")
    if relpose:
        weld.data = np.eye(len(weld.data))[[6, 10]].sum(0)
    return arena


def roped(**kwargs):
    """Two boxes with a rope between them, of the length that it has."""
    arena = mja.TableArena(objects=[mja.Object("a", pos=(0, 0)), mja.Object("b", pos=(0.2, 0))])
    for name in "ab":
        arena.spec.body(name).add_site(name=f"end_{name}")
    rope = arena.spec.add_tendon(name="rope", stiffness=[50, 0, 0], **kwargs)
    rope.wrap_site("end_a")
    rope.wrap_site("end_b")
    return arena


def others(**kwargs):
    """Nominal parameters with others."""
    return arena().nominal_params()._replace(**kwargs)


STALE = (
    "from where tables and objects stand, which would be stale in other worlds: give equalities and tendons explicit numbers "
    "(relpose, springlength), or keep them off these."
)


CASES = {
    "weld of two": (ValueError, lambda: tied().mj_model, f"MuJoCo derives eq_data {STALE}"),
    "rope of two": (
        ValueError,
        lambda: roped().mj_model,
        f"MuJoCo derives tendon_lengthspring {STALE}",
    ),
    "env tied": (
        ValueError,
        lambda: envs.ArenaEnv(
            tied(relpose=True), mja.ArenaRanges(object_active=mja.Bernoulli(0.5)), envs.env_config(0.05, 0.005, 9)
        ),
        "2 problems in `ranges`:\n- `ranges`: object 'a' can be absent, but 'w' ties it.\n"
        "- `ranges`: object 'b' can be absent, but 'w' ties it.",
    ),
    "check tied": (
        ValueError,
        lambda: mja.check(
            tied(relpose=True),
            mja.ArenaRanges(object_tables=mja.Choice([0, 1]), table_active=mja.Bernoulli([1, 0.5, 1])),
            1,
            engine="c",
        ),
        "2 problems in `ranges`:\n- `ranges`: object 'a' can be absent, but 'w' ties it.\n"
        "- `ranges`: object 'b' can be absent, but 'w' ties it.",
    ),
    "p index float": (
        ValueError,
        lambda: arena().problems(others(object_tables=np.array([0.7]))),
        "`params.object_tables` must be whole numbers, got float64.",
    ),
    "p legs float": (
        ValueError,
        lambda: arena().valid(others(has_legs=np.array([0.5, 0.2, 1]))),
        "`params.has_legs` must be true or false, got float64.",
    ),
    "p words": (
        ValueError,
        lambda: arena().compile(others(table_rots=np.array(["0", "1", "2"]))),
        "`params.table_rots` must be numbers, got <U1.",
    ),
    "p of a batch": (
        ValueError,
        lambda: arena().describe(randomize()),
        "`params` must be an mjx_arenas.ArenaParams, got ArenaBatch: give its `params`.",
    ),
    "key rbg": (
        ValueError,
        lambda: arena().sample_params(jax.random.key(0, impl="rbg"), mja.ArenaRanges()),
        "`key` must be of JAX's threefry2x32, with which a world does not depend on the others, got rbg.",
    ),
    "keys rbg": (
        ValueError,
        lambda: arena().randomize(
            arena().put_model("jax"), jax.random.split(jax.random.key(0, impl="rbg"), 2), mja.ArenaRanges()
        ),
        "`keys` must be of JAX's threefry2x32, with which a world does not depend on the others, got rbg.",
    ),
    "keys a model": (
        ValueError,
        lambda: arena().randomize(keys(2), arena().put_model("jax"), mja.ArenaRanges()),
        "`keys` must be an array of keys such as jax.random.split(key, n_worlds), got mujoco.mjx._src.types.Model.",
    ),
    "n_worlds": (
        ValueError,
        lambda: arena().make_world_data(arena().put_model("jax"), arena().nominal_params(), n_worlds=0),
        "`n_worlds` must be None or a whole number >= 1, got 0.",
    ),
    "c nthread": (
        ValueError,
        lambda: arena().c_batch(randomize().params, nthread=-3),
        "`nthread` must be a whole number >= 0, got -3.",
    ),
    "c data and key": (
        ValueError,
        lambda: arena().c_world(arena().nominal_params(), mja.take(mja.make_data(randomize()), 0), keys(1)[0]),
        "`key` must be None with `data`, in which the objects have their places.",
    ),
    "capacity of another": (
        ValueError,
        lambda: mja.capacity(randomize(), mja.take(mja.make_data(randomize()), 0)),
        "`data` must be of the batch's 2 worlds, from make_data(batch), got data of one world.",
    ),
    "margin text": (
        ValueError,
        lambda: arena().place(arena().nominal_params(), keys(1)[0], margin="0.1"),
        "`margin` must be a finite number [m], got '0.1'.",
    ),
    "check progress": (
        TypeError,
        lambda: mja.check(arena(), mja.ArenaRanges(), 1, progress=True),
        "`progress` must be a function of how much is done and of how much, or None, got True.",
    ),
    "keys many": (
        ValueError,
        lambda: mja.world_keys(0, range(10**10)),
        "`worlds` must be at most 1,073,741,824 numbers, got 10,000,000,000.",
    ),
    "take of a batch": (
        ValueError,
        lambda: mja.take(randomize(), 0),
        "`worlds` must be of many worlds, (W, ...) with the same W in all arrays, got an ArenaBatch: take its `world(i)`.",
    ),
    "offset nan": (
        ValueError,
        lambda: mja.MultiTableArena([[0, 0, np.nan]]),
        "`table_offsets` of table 0 must be finite [m], got [0.0, 0.0, nan].",
    ),
    "obj mjcf total mass": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("m", "mjcf", file=mujoco.MjSpec.from_string(TOTAL))]),
        "Object 'm': settotalmass of its file would change the mass that parameters decide: switch it off.",
    ),
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
        "Object 'c': `type` must be one of box, sphere, capsule, cylinder, mesh, mjcf, got 'cone'.",
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
        "`ranges.has_legs` (Uniform): true and false need Bernoulli, Count, Choice or Fixed.",
    ),
    "objs": (
        ValueError,
        lambda: mja.TableArena(objects=mja.Object("c")),
        "`objects` must be a sequence of mjx_arenas.Object, got the one object 'c'.",
    ),
    "all": (
        ValueError,
        lambda: mja.MultiTableArena(
            OFFSETS, table_rots=[1], table_frictions=-1, objects=[mja.Object("c", "cone", table="x")], table_condim=2
        ),
        "5 problems in MultiTableArena:\n- `table_rots` must be one value, or one such for each of the 3 tables, got shape (1,): [1].\n- `table_frictions` must be (sliding, torsional, rolling), or one such for each of the 3 tables, got one number: -1.\n- Object 'c': `type` must be one of box, sphere, capsule, cylinder, mesh, mjcf, got 'cone'.\n- Object 'c': `table` must be an index from 0 to 2 or one of 'table0', 'table1', 'table2', got 'x'.\n- `table_condim` must be 1, 3, 4 or 6, got 2.",
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
        lambda: (lambda a: a.make_world_data(a.put_model("jax"), a.nominal_params()))(mja.TableArena()),
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
        "`ranges.table_rots` (Bernoulli): Bernoulli gives true or false; it serves `has_legs`, `table_active`, `object_active`.",
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
        "`ranges.table_offsets` (Uniform): `tied` must be true, false, one of them per axis, or 'axes', got (True, False).",
    ),
    "r choicep": (
        ValueError,
        lambda: randomize(table_rots=mja.Choice([0.1, 0.2], p=[0.5, 0.6])),
        "`ranges.table_rots` (Choice): `p` must be 2 probabilities that add up to 1, got [0.5, 0.6].",
    ),
    "r str": (
        ValueError,
        lambda: randomize(table_rots=mja.Uniform("a", "b")),
        "2 problems in `ranges`:\n- `ranges.table_rots` (Uniform): `low` must be numbers, got 'a'.\n- `ranges.table_rots` (Uniform): `high` must be numbers, got 'b'.",
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
        "`params` must be of one world, got 2 worlds: take one, batch.world(i), or use jax.vmap.",
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
    "xml type": (
        TypeError,
        lambda: mja.TableArena(xml=3),
        "`xml` must be a path, MJCF text or a mujoco.MjSpec, got 3.",
    ),
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
    "rope with an armature": (
        ValueError,
        lambda: roped(springlength=[0, 0.3], armature=0.1).mj_model,
        "`arena.spec`: the armature of tendon 'rope', which ends where a table or an object stands, would make inverse weights stale in other worlds: leave it at 0.",
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
            arena().make_world_data(arena().put_model("jax"), arena().nominal_params()),
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
        "`params` must be of one world, got 2 worlds: take one, batch.world(i), or use jax.vmap.",
    ),
    "slice": (
        IndexError,
        lambda: randomize(table_rots=mja.Uniform(0, 1)).world(slice(0, 2)),
        "`index` must be one number from 0 to 1, or a list of them, got slice(0, 2, None).",
    ),
    "other": (
        ValueError,
        lambda: mja.TableArena().apply(arena().put_model("jax"), mja.TableArena().nominal_params()),
        "`model` must come from this arena's put_model() (nbody 2, ngeom 7, nsite 1, nq 0, nv 0), got another model (nbody 5, ngeom 20, nsite 3, nq 7, nv 6).",
    ),
    "no key": (
        ValueError,
        lambda: arena().randomize(arena().put_model("jax"), keys(0), mja.ArenaRanges()),
        "`keys` must be at least one key, of one world, got none.",
    ),
    "no world": (
        ValueError,
        lambda: arena().batch(
            arena().put_model("jax"), jax.tree.map(lambda p: np.zeros((0, *p.shape)), arena().nominal_params())
        ),
        "`params` must be of at least one world, got none.",
    ),
    "other names": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("cup")]).randomize(
            mja.TableArena(objects=[mja.Object("mug")]).put_model("jax"), keys(2), mja.ArenaRanges()
        ),
        "`model` must come from this arena's put_model(), got another model, which has 'mug' for 'cup'.",
    ),
    "bnp": (
        ValueError,
        lambda: arena().batch(arena().put_model("jax"), arena().nominal_params()),
        "`params` must be of many worlds, (W, ...), got one: jax.tree.map(lambda x: x[None], params) adds the axis.",
    ),
    "obj mesh missing": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("mug", "mesh", file="mug.obj")]),
        "Object 'mug': there is no file 'mug.obj'.",
    ),
    "obj mesh no file": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("mug", "mesh")]),
        "Object 'mug': `file` must be the path of its mesh, got None.",
    ),
    "obj mjcf missing": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("mug", "mjcf", file="mug.xml")]),
        "Object 'mug': there is no file 'mug.xml'.",
    ),
    "obj mjcf size": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("drawer", "mjcf", 0.2, file=DATA / "drawer.xml")]),
        "Object 'drawer': `full_size` is what the file says, for an MJCF body, got 0.2.",
    ),
    "obj mjcf density": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("drawer", "mjcf", density=300, file=DATA / "drawer.xml")]),
        "Object 'drawer': `density` is what the file says, for an MJCF body, got 300.0: give `mass`.",
    ),
    "obj condim": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", condim=2)]),
        "Object 'c': `condim` must be 1, 3, 4 or 6, got 2.",
    ),
    "obj file of box": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("box", file="box.obj")]),
        "Object 'box': `file` is for type 'mesh' or 'mjcf', got 'box.obj'.",
    ),
    "obj mesh broken": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("m", "mesh", file=DATA / "drawer.xml")]),
        f"Object 'm': MuJoCo cannot compile it: Error: no decoder found for mesh file '{DATA}/drawer.xml' Element name 'm_mesh', id 0",
    ),
    "obj mjcf broken": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("m", "mjcf", file=DATA / "wedge.obj")]),
        f"Object 'm': MuJoCo cannot compile it: Error: mesh with file '{DATA}/wedge.obj' has no name: an asset is named after its file only by the XML parser, set its name explicitly Element name '', id 0",
    ),
    "obj mjcf ghost": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("m", "mjcf", file=mujoco.MjSpec.from_string(GHOST))]),
        "Object 'm': no geom of its file collides, so that it cannot stand on a table.",
    ),
    "obj mjcf frictions": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("m", "mjcf", file=mujoco.MjSpec.from_string(TWO_FRICTIONS))]),
        "Object 'm': the geoms of its file differ in friction: give the object one `friction`.",
    ),
    "obj cylinder": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", "cylinder", (0.1, 0.2, 0.3))]),
        "Object 'c': `full_size` of a cylinder must be (diameter, diameter, height), got [0.1, 0.2, 0.3].",
    ),
    "obj cylinder on jax": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", "cylinder", (0.1, 0.1, 0.3))]).put_model("jax"),
        "impl='jax' has no collision function for geoms 'c_g0' (cylinder) and 'table_collision' (box): use impl='warp', other shapes, or contype/conaffinity.",
    ),
    "obj mass negative": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", mass=-0.1)]),
        "Object 'c': `mass` must be > 0 [kg], got -0.1.",
    ),
    "obj mass and density": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", mass=0.1, density=500)]),
        "Object 'c': give `mass` or `density`, not both.",
    ),
    "obj active": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", active="yes")]),
        "Object 'c': `active` must be true or false, got 'yes'.",
    ),
    "obj larger than table": (
        ValueError,
        lambda: mja.TableArena((0.4, 0.4, 0.05), objects=[mja.Object("crate", full_size=0.5)]),
        "Object 'crate' is 0.5 x 0.5 m, larger than table 0, which is 0.4 x 0.4 m.",
    ),
    "table_active str": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_active="none"),
        "`table_active` must be true or false, got 'none'.",
    ),
    "table_active short": (
        ValueError,
        lambda: mja.MultiTableArena(OFFSETS, table_active=[True, False]),
        "`table_active` must be one value, or one such for each of the 3 tables, got shape (2,): [True, False].",
    ),
    "r no active table": (
        ValueError,
        lambda: randomize(table_active=mja.Fixed(False)),
        "`ranges.table_active` leaves no table in any world.",
    ),
    "r active uniform": (
        ValueError,
        lambda: randomize(table_active=mja.Uniform(0, 1)),
        "`ranges.table_active` (Uniform): true and false need Bernoulli, Count, Choice or Fixed.",
    ),
    "r count": (
        ValueError,
        lambda: randomize(table_active=mja.Count(2, 1)),
        "`ranges.table_active` (Count): `low` must be <= `high`, got 2.0 and 1.0.",
    ),
    "r count half": (
        ValueError,
        lambda: randomize(object_active=mja.Count(0, 0.5)),
        "`ranges.object_active` (Count): `low` and `high` must be whole numbers >= 0, got 0.0 and 0.5.",
    ),
    "r count of numbers": (
        ValueError,
        lambda: randomize(table_rots=mja.Count(1, 2)),
        "`ranges.table_rots` (Count): Count gives true or false; it serves `has_legs`, `table_active`, `object_active`.",
    ),
    "r masses negative": (
        ValueError,
        lambda: randomize(object_masses=mja.Uniform(-0.1, 0.1)),
        "`ranges.object_masses` of object 'cube' can reach -0.1: it must stay > 0 [kg].",
    ),
    "r masses and densities": (
        ValueError,
        lambda: randomize(object_masses=mja.Uniform(0.1, 0.2), object_densities=mja.Uniform(100, 200)),
        "`ranges`: give `object_masses` or `object_densities`, not both.",
    ),
    "r densities": (
        ValueError,
        lambda: randomize(object_densities=mja.Uniform(0, 200)),
        "`ranges.object_densities` of object 'cube' can reach 0.0: it must stay > 0 [kg/m^3].",
    ),
    "r rgba": (
        ValueError,
        lambda: randomize(object_rgba=mja.Uniform(0, 255)),
        "`ranges.object_rgba` of object 'cube' can reach [255.0, 255.0, 255.0, 255.0]: it must stay between 0 and 1.",
    ),
    "r sizes of objects": (
        ValueError,
        lambda: randomize(object_full_sizes=mja.Uniform(-0.1, 0.1, relative="add")),
        "`ranges.object_full_sizes` of object 'cube' can reach [-0.05, -0.05, -0.05]: it must stay > 0 on every axis [m].",
    ),
    "r capsule": (
        ValueError,
        lambda: rod().randomize(
            rod().put_model("jax"), keys(2), mja.ArenaRanges(object_full_sizes=mja.Uniform(0.02, 0.1))
        ),
        "`ranges.object_full_sizes` of object 'rod' can reach a length of 0.02 m and a diameter of 0.1 m: a capsule must be longer than thick.",
    ),
    "r object_tables far": (
        ValueError,
        lambda: randomize(object_tables=mja.Choice([0, 3])),
        "`ranges.object_tables` must be indices from 0 to 2, got 0 to 3.",
    ),
    "r object_tables uniform": (
        ValueError,
        lambda: randomize(object_tables=mja.Uniform(0, 2)),
        "`ranges.object_tables` (Uniform): indices of tables need Choice or Fixed, which cannot be relative.",
    ),
    "r object_tables half": (
        ValueError,
        lambda: randomize(object_tables=mja.Choice([0.7, 1])),
        "`ranges.object_tables` (Choice): `values` must be whole numbers, got [0.7, 1.0].",
    ),
    "r object_tables fixed half": (
        ValueError,
        lambda: randomize(object_tables=mja.Fixed(0.5)),
        "`ranges.object_tables` (Fixed): `at` must be whole numbers, got 0.5.",
    ),
    "place margin": (
        ValueError,
        lambda: arena().place(arena().nominal_params(), jax.random.key(0), margin=-0.1),
        "`margin` must be >= 0 [m], got -0.1.",
    ),
    "place margins": (
        ValueError,
        lambda: arena().place(arena().nominal_params(), jax.random.key(0), margin=(0.1, 0.1)),
        "`margin` must be a finite number [m], got (0.1, 0.1).",
    ),
    "r object_tables p": (
        ValueError,
        lambda: randomize(object_tables=mja.Choice([0, 1, 2], p=[0.5, 0.5])),
        "`ranges.object_tables` (Choice): `p` must be 3 probabilities that add up to 1, got [0.5, 0.5].",
    ),
    "r no objects": (
        ValueError,
        lambda: mja.TableArena().sample_params(jax.random.key(0), mja.ArenaRanges(object_masses=mja.Uniform(0.1, 0.2))),
        "`ranges.object_masses`: the arena has no objects.",
    ),
    "r workspace type": (
        ValueError,
        lambda: randomize(workspace=([-1, -1], [1, 1])),
        "`ranges.workspace` must be a Workspace(low, high, gap), or None, got ([-1, -1], [1, 1]).",
    ),
    "r workspace order": (
        ValueError,
        lambda: randomize(workspace=mja.Workspace([1, 1], [-1, -1])),
        "`ranges.workspace`: `low` and `high` must be (x, y) with low < high, got [1.0, 1.0] and [-1.0, -1.0].",
    ),
    "r workspace gap": (
        ValueError,
        lambda: randomize(workspace=mja.Workspace([-1, -1], [1, 1], gap=-0.1)),
        "`ranges.workspace`: `gap` must be one number >= 0 [m], got -0.1.",
    ),
    "p object table": (
        ValueError,
        lambda: arena().compile(arena().nominal_params()._replace(object_tables=np.array([3]))),
        "`object_tables` of object 'cube' must be from 0 to 2, got 3.",
    ),
    "p object mass": (
        ValueError,
        lambda: arena().compile(arena().nominal_params()._replace(object_masses=np.array([-1.0]))),
        "`object_masses` of object 'cube' must be finite and > 0 [kg], got -1.0.",
    ),
    "p object shape": (
        ValueError,
        lambda: ball().compile(ball().nominal_params()._replace(object_full_sizes=np.array([[0.1, 0.2, 0.1]]))),
        "`object_full_sizes` of object 'ball' must be 3 equal extents (a sphere), got [0.1, 0.2, 0.1].",
    ),
    "p table of a robot": (
        ValueError,
        lambda: with_robot().compile(
            with_robot().nominal_params()._replace(table_active=np.array([True, False, True]))
        ),
        "`params`: table 1 is absent, but 'robot_mount' is fixed on it.",
    ),
    "p table with a drawer": (
        ValueError,
        lambda: drawer().compile(drawer().nominal_params()._replace(table_active=np.array([False]))),
        "`params`: table 0 is absent, but 'drawer' is fixed on it.",
    ),
    "p object larger than table": (
        ValueError,
        lambda: arena().compile(arena().nominal_params()._replace(object_full_sizes=np.array([[0.9, 0.9, 0.1]]))),
        "Object 'cube' is 0.9 x 0.9 m, larger than table 0, which is 0.8 x 0.8 m.",
    ),
    "p size of a mesh": (
        ValueError,
        lambda: wedge().compile(wedge().nominal_params()._replace(object_full_sizes=np.array([[0.2, 0.1, 0.1]]))),
        "`object_full_sizes` of object 'wedge' must be [0.1, 0.1, 0.1], as in its file, got [0.2, 0.1, 0.1].",
    ),
    "p tuple": (
        ValueError,
        lambda: arena().compile((1, 2, 3)),
        "`params` must be an mjx_arenas.ArenaParams, got tuple.",
    ),
    "attach missing": (
        FileNotFoundError,
        lambda: open_arena().attach("robot.xml"),
        "`robot`: there is no file 'robot.xml'.",
    ),
    "attach broken": (
        ValueError,
        lambda: open_arena().attach("<mujoco><robot/></mujoco>"),
        "`robot`: MuJoCo cannot read the MJCF text: XML Error: Schema violation: unrecognized element Element 'robot', line 1",
    ),
    "attach type": (
        TypeError,
        lambda: open_arena().attach(3),
        "`robot` must be a path, MJCF text or a mujoco.MjSpec, got 3.",
    ),
    "attach clash": (
        ValueError,
        lambda: with_robot_again(),
        "`robot`: the arena already has body 'arm_base': give another `prefix`.",
    ),
    "attach prefix": (
        ValueError,
        lambda: open_arena().attach(ROBOT, prefix=None),
        "`prefix` must be a non-empty string, got None.",
    ),
    "attach table": (
        ValueError,
        lambda: open_arena().attach(ROBOT, on_table=7),
        "`on_table` must be an index from 0 to 2 or one of 'table0', 'table1', 'table2', or None, got 7.",
    ),
    "attach pos": (
        ValueError,
        lambda: open_arena().attach(ROBOT, pos=(0, 0)),
        "`pos` must be 3 finite numbers [m], got (0, 0).",
    ),
    "attach quat": (ValueError, lambda: open_arena().attach(ROBOT, quat=(0, 0, 0, 0)), "`quat` must not be zero."),
    "attach large quat": (
        ValueError,
        lambda: open_arena().attach(ROBOT, quat=(1e7, 0, 0, 0)),
        "`quat` must be between -1e6 and 1e6, got [10000000.0, 0.0, 0.0, 0.0].",
    ),
    "merge large rot": (
        ValueError,
        lambda: open_arena().merge(open_arena(), "b_", rot=1e7),
        "`rot` must be between -1e6 and 1e6 [rad], got 10000000.0.",
    ),
    "attach free on table": (
        ValueError,
        lambda: open_arena().attach(FREE, on_table=0),
        "`on_table`: body 'base' has a free joint and would not follow the table: make it an Object of type 'mjcf', or attach it to the world.",
    ),
    "attach late": (
        ValueError,
        lambda: arena_in_use().attach(ROBOT),
        "`attach`: the arena is compiled already: attach before the first use of the model.",
    ),
    "attach on absent": (
        ValueError,
        lambda: with_robot().sample_params(jax.random.key(0), mja.ArenaRanges(table_active=mja.Bernoulli(0.5))),
        "`ranges.table_active`: table 1 can be absent, but 'robot_mount' is fixed on it.",
    ),
    "merge type": (TypeError, lambda: open_arena().merge("arena.xml", "b_"), "`other` must be an arena, got str."),
    "merge clash": (
        ValueError,
        lambda: open_arena().merge(open_arena(), ""),
        "`prefix` must be a non-empty string, got ''.",
    ),
    "merge pair": (
        ValueError,
        lambda: open_arena().merge(paired(), "b_"),
        "2 problems in merge:\n- `other`: pair 'p' refers to geom 'floor', of which this arena's is kept: remove it, or give that geom another name.\n- `other`: sensor 'd' refers to geom 'floor', of which this arena's is kept: remove it, or give that geom another name.",
    ),
    "from_xml masks": (
        ValueError,
        lambda: mja.Arena.from_xml(SCENE.replace("<geom type", '<geom contype="2" conaffinity="4" type'), ["ramp"]),
        "`tables`: 'ramp': its slab has contype 2 and conaffinity 4, and no object stands on it unless one of them has the bit 1.",
    ),
    "from_xml ghost": (
        ValueError,
        lambda: mja.Arena.from_xml(SCENE.replace('"desk_top"', '"desk_top" contype="0" conaffinity="0"'), ["desk_top"]),
        "`tables`: 'desk_top': its slab has contype 0 and conaffinity 0, and no object stands on it unless one of them has the bit 1.",
    ),
    "from_xml missing": (
        FileNotFoundError,
        lambda: mja.Arena.from_xml("scene.xml", ["desk"]),
        "`xml`: there is no file 'scene.xml'.",
    ),
    "from_xml unknown": (
        ValueError,
        lambda: mja.Arena.from_xml(SCENE, ["desc"]),
        "`tables`: 'desc' is neither a body nor a geom of the scene; its bodies: 'desk', 'round', 'cart', 'ramp'.",
    ),
    "from_xml round": (
        ValueError,
        lambda: mja.Arena.from_xml(SCENE, ["round"]),
        "`tables`: 'round' has no box that collides, and one must be its slab: give that geom's name. Its geoms: cylinder 'disc'.",
    ),
    "from_xml geom": (
        ValueError,
        lambda: mja.Arena.from_xml(SCENE, ["disc"]),
        "`tables`: 'disc' is a cylinder, and the slab of a table must be a box.",
    ),
    "from_xml two boxes": (
        ValueError,
        lambda: mja.Arena.from_xml(SCENE, ["desk"]),
        "`tables`: 'desk' has 2 boxes that collide, and one must be its slab: give that geom's name. Its geoms: box 'desk_top', box 'desk_side'.",
    ),
    "from_xml moving": (
        ValueError,
        lambda: mja.Arena.from_xml(SCENE, ["cart"]),
        "`tables`: 'cart': body 'cart' must be a fixed child of the world to serve as a table.",
    ),
    "from_xml tilted": (
        ValueError,
        lambda: mja.Arena.from_xml(SCENE, ["ramp"]),
        "`tables`: the slab 'ramp_collision' is tilted; its z axis must point up.",
    ),
    "from_xml none": (
        ValueError,
        lambda: mja.Arena.from_xml(SCENE, []),
        "`tables` must be a list of names of bodies or geoms, at least one, got [].",
    ),
    "from_xml twice": (
        ValueError,
        lambda: mja.Arena.from_xml(SCENE, ["desk_top", "desk_side"]),
        "`tables`: 'desk_top' and 'desk_side' are of one body, 'desk', which can be one table only.",
    ),
    "keyframe": (
        ValueError,
        lambda: arena().make_world_data(arena().put_model("jax"), arena().nominal_params(), keyframe="home"),
        "`keyframe` must be None, as the arena has no keyframes, got 'home'.",
    ),
    "r count too high": (
        ValueError,
        lambda: randomize(object_active=mja.Count(1, 5)),
        "`ranges.object_active` (Count): `high` must be at most 1, got 5.",
    ),
    "from_xml drawer absent": (
        ValueError,
        lambda: drawer().sample_params(jax.random.key(0), mja.ArenaRanges(table_active=mja.Bernoulli(0.5))),
        "`ranges.table_active`: table 0 can be absent, but 'drawer' is fixed on it.",
    ),
    "set_const of C": (
        TypeError,
        lambda: mja.set_const(arena().mj_model),
        "`model` must be an mjx.Model (of an MjModel: mujoco.mj_setConst), got MjModel.",
    ),
    "spec geom on object": (
        ValueError,
        lambda: added_to("geom", name="handle", size=(0.01, 0, 0)),
        "Object 'cube': `arena.spec` has geom 'handle' on its body, which must keep its one geom (sites, cameras and lights may be added): give an Object of type 'mjcf'.",
    ),
    "spec body on object": (
        ValueError,
        lambda: added_to("body", name="lid", mass=0.1, inertia=(0.1, 0.1, 0.1), explicitinertial=True),
        "Object 'cube': `arena.spec` has body 'lid' on its body, which must keep its one geom (sites, cameras and lights may be added): give an Object of type 'mjcf'.",
    ),
    "spec boundmass": (
        ValueError,
        lambda: mja.TableArena(
            xml='<mujoco><compiler boundmass=".5" boundinertia=".1"/></mujoco>', objects=[mja.Object("cube")]
        ),
        "`spec.compiler`: boundmass, boundinertia would change the masses of objects, which parameters decide: switch them off, and give the bodies of the MJCF that they are for an <inertial>.",
    ),
    "spec inertia groups": (
        ValueError,
        lambda: groups_later().mj_model,
        "`spec.compiler`: inertiagrouprange would change the masses of objects, which parameters decide: switch them off, and give the bodies of the MJCF that they are for an <inertial>.",
    ),
    "obj mjcf boundmass": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("m", "mjcf", file=mujoco.MjSpec.from_string(HEAVY))]),
        "Object 'm': boundmass of its file would change the mass that parameters decide: switch it off.",
    ),
    "step swapped": (
        TypeError,
        lambda: mja.step("data", "batch"),
        "`batch` and `data` must be an ArenaBatch and its mjx.Data, got str and str.",
    ),
    "capacity swapped": (
        TypeError,
        lambda: mja.capacity("data", "batch"),
        "`batch` and `data` must be an ArenaBatch and its mjx.Data, got str and str.",
    ),
    "far": (
        ValueError,
        lambda: mja.TableArena(table_offset=(0, 0, 1e30)),
        "`table_offset` must be between -1e6 and 1e6 [m], got [0.0, 0.0, 1e+30].",
    ),
    "slippery": (
        ValueError,
        lambda: mja.TableArena(table_friction=(1e30, 0, 0)),
        "`table_friction` must be between 0 and 1e6, got [1e+30, 0.0, 0.0].",
    ),
    "heavy": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", mass=1e300)]),
        "Object 'c': `mass` must be between 1e-15 and 1e10 [kg], got 1e+300.",
    ),
    "object far": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", pos=(1e30, 0))]),
        "Object 'c': `pos` must be between -1e6 and 1e6 [m], got [1e+30, 0.0].",
    ),
    "object small": (
        ValueError,
        lambda: mja.TableArena(objects=[mja.Object("c", full_size=1e-30)]),
        "Object 'c': `full_size` must be between 1e-15 and 1e6 [m], got 1e-30.",
    ),
    "robot far": (
        ValueError,
        lambda: open_arena().attach(ROBOT, pos=(0, 0, 1e30)),
        "`pos` must be between -1e6 and 1e6 [m], got [0.0, 0.0, 1e+30].",
    ),
    "range far": (
        ValueError,
        lambda: randomize(object_densities=mja.Uniform(1, 1e300)),
        "`ranges.object_densities` of object 'cube' can reach 1e+300: it must stay between 1e-15 and 1e10 [kg/m^3].",
    ),
    "workspace far": (
        ValueError,
        lambda: randomize(workspace=mja.Workspace((0, 0), (1, 1e30))),
        "`ranges.workspace`: `high` must be between -1e6 and 1e6 [m], got [1.0, 1e+30].",
    ),
    "too light": (
        ValueError,
        lambda: arena().compile(arena().nominal_params()._replace(object_masses=np.array([1e-13]))),
        "`object_masses` of object 'cube', 1e-13 kg, is too small for its size: an inertia must be >= 1e-15 kg m^2.",
    ),
    "seed as key": (
        ValueError,
        lambda: arena().sample_params(5, mja.ArenaRanges()),  # type: ignore[arg-type]
        "`key` must be a key such as jax.random.key(5), got 5.",
    ),
    "seed as key of places": (
        ValueError,
        lambda: arena().c_world(arena().nominal_params(), key=7),  # type: ignore[arg-type]
        "`key` must be a key such as jax.random.key(7), got 7.",
    ),
    "numbers as key": (
        ValueError,
        lambda: arena().place(arena().nominal_params(), np.zeros(3)),
        "`key` must be a key such as jax.random.key(0), got numbers of shape (3,).",
    ),
    "described": (
        ValueError,
        lambda: arena().describe(5),  # type: ignore[arg-type]
        "`params` must be an mjx_arenas.ArenaParams, got int.",
    ),
    "tiled": (
        ValueError,
        lambda: arena().tile([arena().nominal_params()]),  # type: ignore[arg-type]
        "`params` must be an mjx_arenas.ArenaParams, got list.",
    ),
    "valid ranges": (
        TypeError,
        lambda: arena().valid(arena().nominal_params(), 5),  # type: ignore[arg-type]
        "`ranges` must be an mjx_arenas.ArenaRanges, got int.",
    ),
    "replayed": (TypeError, lambda: mja.replay(5), "`bundle` must be a path, got int."),  # type: ignore[arg-type]
    "saved": (TypeError, lambda: mja.save(arena(), "a.yaml"), "`path` must be a path, got MultiTableArena."),  # type: ignore[arg-type]
    "exported": (
        TypeError,
        lambda: arena().export(arena().nominal_params(), 5),  # type: ignore[arg-type]
        "`folder` must be a path, got int.",
    ),
    "filmed": (
        TypeError,
        lambda: mja.video(5, 5, "a.mp4"),  # type: ignore[arg-type]
        "`batch` and `data` must be an ArenaBatch and its mjx.Data, got int and int.",
    ),
    "rollout swapped": (
        TypeError,
        lambda: mja.rollout("data", "batch", 1),
        "`batch` and `data` must be an ArenaBatch and its mjx.Data, got str and str.",
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


def test_additions_to_objects():
    """Sites, cameras and lights may be added to an object's body, and rules of masses are fine without objects."""
    arena = open_arena()
    for kind in ("site", "camera", "light"):
        getattr(arena.spec.body("cube"), f"add_{kind}")(name="added")
    assert arena.mj_model.nsite == 4
    assert mja.TableArena(xml='<mujoco><compiler boundmass=".5"/></mujoco>').mj_model.nbody == 2


def test_overlap_is_a_warning():
    """Overlapping tables are named, with the depth; ones that touch or lie over each other are not."""
    with pytest.warns(UserWarning, match=r"^Tables 'table0' and 'table1' overlap by 0\.050 m\.$"):
        mja.MultiTableArena([[0, 0, 0.8], [0.5, 0, 0.8]])
    with pytest.warns(UserWarning, match=r"overlap by 0\.020 m"):
        mja.MultiTableArena([[0, 0, 0.8], [0.78, 0, 0.8]])
    with pytest.warns(UserWarning, match=r"overlap by 0\.034 m"):  # a corner: 0.4 + 0.4 sqrt(2) - 0.932
        mja.MultiTableArena([[0, 0, 0.8], [0.932, 0, 0.8]], table_rots=[0, np.pi / 4])
    mja.MultiTableArena([[0, 0, 0.8], [0.8, 0, 0.8], [0, 0, 0.4]])


def test_crowd_is_a_warning():
    """Objects that cover more than their table are named; those that are not there nominally do not count."""
    pool = [mja.Object(f"o{i}", full_size=0.1) for i in range(10)]
    message = r"^The 10 objects on table 0 cover 0\.1 m\^2, more than its top of 0\.09 m\^2: with `active=False` an"
    with pytest.warns(UserWarning, match=message):
        mja.TableArena((0.3, 0.3, 0.05), objects=pool)
    pool = [mja.Object(f"o{i}", full_size=0.1, pos=(0, 0), active=i == 0) for i in range(10)]
    assert mja.TableArena((0.3, 0.3, 0.05), objects=pool).mj_model.nq == 70


def test_what_params_cannot_be():
    """On the device a flag says what is a sentence on the host."""
    robot, larger, size = with_robot(), arena(), wedge()
    nominal = robot.nominal_params()
    assert robot.valid(nominal)
    assert robot.valid(nominal._replace(table_active=np.array([False, True, True])))
    assert not robot.valid(nominal._replace(table_active=np.array([True, False, True])))
    assert not drawer().valid(drawer().nominal_params()._replace(table_active=np.array([False])))
    nominal = larger.nominal_params()._replace(object_full_sizes=np.array([[0.9, 0.9, 0.1]]))
    assert not larger.valid(nominal)
    assert larger.valid(nominal._replace(object_active=np.array([False])))
    nominal = size.nominal_params()
    assert size.valid(nominal)
    assert not size.valid(nominal._replace(object_full_sizes=np.array([[0.1, 0.1, 0.11]])))


def test_reasons():
    """Each world that is not valid has its reasons, as seen from the numbers; the others have none."""
    pair = mja.MultiTableArena(
        [[0, 0, 0.8], [2, 0, 0.8]], objects=[mja.Object("cube"), mja.Object("tray", full_size=0.4)]
    )
    here = pair.nominal_params()
    inside = mja.ArenaRanges(workspace=mja.Workspace((-0.5, -0.5), (2.5, 0.5), 0.3))
    assert pair.problems(here) == pair.problems(here, inside) == []
    for params, ranges, reasons in (
        (
            here._replace(table_full_sizes=here.table_full_sizes * 0.4),
            None,
            ["tray' is 0.4 x 0.4 m, larger than table 0"],
        ),
        (here._replace(table_active=np.zeros(2, bool)), mja.ArenaRanges(), ["No table is there."]),
        (
            here._replace(table_offsets=np.array([[0, 0, 0.8], [1, 0.2, 0.8]])),
            inside,
            [
                "Table 1 is not inside the workspace, [-0.5, -0.5] to [2.5, 0.5] m.",
                "Tables 0 and 1 are not apart by the",
            ],
        ),
    ):
        assert not pair.valid(params, ranges)
        found = pair.problems(params, ranges)
        assert len(found) == len(reasons)
        assert all(reason in sentence for reason, sentence in zip(reasons, found, strict=True))
    full = here._replace(table_full_sizes=here.table_full_sizes * 0.501)  # one of them fits
    (reason,) = pair.problems(full, key=jax.random.key(0))
    assert reason == "'tray' finds no free place and starts above the others."
    assert pair.problems(here, key=jax.random.key(0)) == []


def test_pictures_of_what_cannot_be():
    """All worlds of a sheet that cannot be are named, with the reasons, before anything is drawn."""
    worlds = jax.tree.map(lambda x: jnp.stack([x, x]), arena().nominal_params())
    worlds = worlds._replace(table_full_sizes=worlds.table_full_sizes.at[1, 2, 0].set(-1))
    with pytest.raises(ValueError, match=r"^World 1: `table_full_sizes` of table 2 must be finite and > 0"):
        arena().contact_sheet(worlds)
    with pytest.raises(ValueError, match=r"^`table_full_sizes` of table 2 must be finite and > 0"):
        arena().plan(mja.take(worlds, 1))


def test_lightest_object():
    """The smallest mass that the host takes compiles in MuJoCo, and one below does not."""
    side = arena().nominal_params().object_full_sizes[0, 0]
    least = 6 * mujoco.mjMINVAL / float(side) ** 2
    here = arena().nominal_params()
    for factor, right in ((1.001, True), (0.999, False)):
        params = here._replace(object_masses=np.array([factor * least]))
        assert (arena().problems(params) == []) == right
        try:
            compiled = bool(arena()._world_spec(params, checked=False))
        except ValueError:
            compiled = False
        assert compiled == right


def test_ranges_are_equal_by_value():
    """Where all their numbers are, whatever holds them."""

    def ranges(high):
        return mja.ArenaRanges(
            table_offsets=mja.Uniform([0, 0, 0.0], [0, 0, high], relative="add"),
            table_active=mja.Bernoulli(0.5),
            workspace=mja.Workspace(np.zeros(2), [1.0, high]),
        )

    assert ranges(0.1) == ranges(0.1)
    assert ranges(0.1) != ranges(0.2)
    assert mja.Uniform(0, 1) != mja.LogUniform(0, 1)
    assert mja.Uniform(0, 1) != mja.Uniform(0, 1, tied=True)
    assert len({ranges(0.1), ranges(0.1)}) == 1


@pytest.mark.skipif(not worlds.HAS_C_BATCH, reason="mujoco.batch came with MuJoCo 4.0")
def test_c_batch_of_invalid_worlds():
    """Every world with a false flag has a sentence."""
    params = jax.tree.map(lambda x: jnp.stack([x, x]), with_robot().nominal_params())
    params = params._replace(table_active=params.table_active.at[1, 1].set(False))
    with pytest.raises(ValueError, match=r"^World 1: `params`: table 1 is absent, but 'robot_mount' is fixed on it\.$"):
        with_robot().c_batch(params)
    sizes = jnp.tile(jnp.array([[0.9, 0.9, 0.1]]), (2, 1, 1))
    with pytest.raises(ValueError, match=r"^World 0: Object 'cube' is 0\.9 x 0\.9 m, larger than table 0"):
        arena().c_batch(
            jax.tree.map(lambda x: jnp.stack([x, x]), arena().nominal_params())._replace(object_full_sizes=sizes)
        )


def test_friction_without_effect_is_a_warning():
    """Torsional friction has no effect in contacts of dimension 3."""
    with pytest.warns(UserWarning, match="table_condim=3, torsional and rolling friction have none"):
        randomize(table_frictions=mja.Uniform(0.1, 0.2))


def test_friction_of_objects_on_tables_is_a_warning():
    """Tables of a higher priority decide the friction of what stands on them."""
    ranges = mja.ArenaRanges(object_frictions=mja.Uniform(0.1, 0.2))
    with pytest.warns(UserWarning, match=r"^`ranges\.object_frictions` has no effect on tables, .* table_priority=0"):
        arena().sample_params(jax.random.key(0), ranges)
    mja.TableArena(objects=[mja.Object("cube")], table_priority=0).sample_params(jax.random.key(0), ranges)


def test_objects_off_their_table_are_a_warning():
    """By their nominal place; on an edge they are not off, nor are those that are not there."""
    message = (
        r"^Object 'far': `pos` \[3.0, 0.0\] is off table 0, whose top reaches 0\.4 m x 0\.4 m from its middle: without"
    )
    with pytest.warns(UserWarning, match=message):
        mja.TableArena(objects=[mja.Object("far", pos=(3, 0))])
    mja.TableArena(objects=[mja.Object("edge", pos=(0.4, 0)), mja.Object("gone", pos=(3, 0), active=False)])


def test_degrees_are_a_warning():
    """Yaws of more than a turn, nominal or drawn."""
    with pytest.warns(UserWarning, match=r"^`table_rots` has yaws of up to 90 rad, more than a turn: they are not in"):
        mja.MultiTableArena([[0, 0, 0.8]], table_rots=[90])
    with pytest.warns(UserWarning, match=r"^`ranges\.table_rots` has yaws of up to 30 rad"):
        arena().sample_params(jax.random.key(0), mja.ArenaRanges(table_rots=mja.Uniform(-30, 10)))


def test_factors_of_nothing_are_a_warning():
    """A range that scales a quantity that is nominally 0."""
    ranges = mja.ArenaRanges(table_rots=mja.Uniform(0.5, 1.5, relative="scale"))
    with pytest.warns(UserWarning, match=r"^`ranges\.table_rots` scales what is nominally 0, so nothing varies: relat"):
        arena().sample_params(jax.random.key(0), ranges)


def test_data_of_wrong_shapes():
    """Arrays that a user puts into data, before anything is compiled; a function that is none; a missing vmap."""
    batch = randomize(table_rots=mja.Uniform(0, 1))
    data = mja.make_data(batch)
    for name, value in {"qpos": data.qpos[:, :4], "ctrl": None, "mocap_pos": jnp.zeros((2, 1, 3))}.items():
        with pytest.raises(ValueError, match=rf"^`data\.{name}` must have shape \(2, .*\), got [(N]"):
            mja.step(batch, data.replace(**{name: value}))
    with pytest.raises(TypeError, match=r"^`record` must be a function of the data, .* got 'qpos'\.$"):
        mja.rollout(batch, data, 1, record="qpos")
    with pytest.raises(ValueError, match=r"^`place_static` takes one world: jax\.vmap"):
        mja.place_static(batch.model, data)


def test_environments_say_what_to_install(monkeypatch):
    """Where the extra is not installed."""

    def missing(name):
        raise ModuleNotFoundError("No module named 'ml_collections'", name="ml_collections")

    monkeypatch.setattr(envs, "_getattr", missing)
    with pytest.raises(ImportError, match=r"^mjx_arenas\.envs\.Push needs ml_collections: pip install 'mjx_arenas\[t"):
        envs.__getattr__("Push")  # as `envs.Push`, which lazy-loader may have kept


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


def test_misspelt_name():
    """Python says "Did you mean: 'Uniform'?" if it knows where the name was looked for."""
    with pytest.raises(AttributeError, match=r"^module 'mjx_arenas' has no attribute 'Unifrom'$") as error:
        mja.Unifrom  # noqa: B018
    assert (error.value.name, error.value.obj) == ("Unifrom", mja)


def test_template_of_another_world():
    """What ranges leave as it is would be that world's, though parameters say nominal."""
    one, model = arena(), arena().put_model("jax")
    other = one.apply(model, one.nominal_params()._replace(table_frictions=np.full((3, 3), 0.5), table_rots=np.ones(3)))
    keys = mja.world_keys(0, [0, 1])
    heights = mja.ArenaRanges(table_offsets=mja.Uniform([0, 0, 0.7], [0, 0, 0.9]))
    with pytest.raises(
        ValueError, match=r"^`model` must have the nominal .*, got other body_quat, geom_friction: give them"
    ):
        one.randomize(other, keys, heights)
    turns = mja.ArenaRanges(table_rots=mja.Uniform(0, 1), table_frictions=mja.Fixed(0.3))
    batch = one.randomize(other, keys, turns)
    np.testing.assert_array_equal(batch.model.geom_friction[:, one.layout.table_geom[:, 0]], np.float32(0.3))


def test_traced_probabilities():
    """Those that are none are flagged."""
    one, model, keys = arena(), arena().put_model("jax"), mja.world_keys(0, [0, 1])

    @jax.jit
    def valid(legs, table):
        ranges = mja.ArenaRanges(has_legs=mja.Bernoulli(legs), object_tables=mja.Choice(np.arange(3), p=table))
        return one.randomize(model, keys, ranges).valid

    alike = jnp.full(3, 1 / 3)
    assert valid(0.5, alike).all()
    for legs, table in ((7.0, alike), (-0.1, alike), (0.5, alike / 2), (0.5, alike.at[0].add(0.5))):
        assert not valid(legs, table).any()


def test_arrays_of_distributions_stay():
    """A range is checked once."""
    low = np.zeros(3)
    ranges = mja.ArenaRanges(table_rots=mja.Uniform(low, np.ones(3)))
    low[...] = 5
    assert (ranges.table_rots.low == 0).all()
    with pytest.raises(ValueError, match="read-only"):
        ranges.table_rots.low[...] = 5


def test_many_problems():
    """An error lists the first ones."""
    with pytest.raises(ValueError, match=r"^100 problems in MultiTableArena:\n") as error:
        mja.MultiTableArena([[np.nan, i, 1] for i in range(100)])
    assert str(error.value).endswith("\n- and 70 more")


def test_tracing_what_is_of_the_host():
    one = arena()
    with pytest.raises(
        TypeError, match=r"^`params` must be numbers, got traced ones: what MuJoCo makes of them is outside"
    ):
        jax.jit(one.to_xml)(one.nominal_params())


def test_what_is_tied_and_stays():
    """Ranges in which it is always there are right."""
    one = tied(relpose=True)
    sure = mja.ArenaRanges(
        object_tables=mja.Choice([0, 1]), object_active=mja.Bernoulli(1.0), table_active=mja.Fixed(True)
    )
    assert one.randomize(one.put_model("jax"), keys(2), sure).valid.all()


def test_two_ties_of_one_name():
    """An equality and a tendon may have one."""
    one = tied(relpose=True)
    rope = one.spec.add_tendon(name="w")
    for name in ("here", "there"):
        one.spec.body("table0").add_site(name=name)
        rope.wrap_site(name)
    assert one.layout.held() == {3: "w", 4: "w"}


def test_parameters_of_numpy():
    """Of a file, say."""
    one = arena()
    params = jax.tree.map(lambda x: np.asarray(x)[None], one.nominal_params())
    batch = one.batch(one.put_model("jax"), params)
    assert jax.tree.all(jax.tree.map(lambda x: isinstance(x, jax.Array), batch.params))
    assert mja.make_data(batch).qpos.shape == (1, one.mj_model.nq)


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
    with pytest.raises(IndexError, match=r"^`index` must be one number from 0 to 1, or a list of them, got 2\.$"):
        randomize(table_rots=mja.Uniform(0, 1)).world(2)


@pytest.mark.skipif(worlds.HAS_C_BATCH, reason="this MuJoCo has mujoco.batch")
def test_c_batch_says_what_to_install():
    """On MuJoCo 3."""
    with pytest.raises(ImportError, match=r"^c_batch needs mujoco >= 4\.0 \(pip install -U mujoco\); this is 3\."):
        arena().c_batch(randomize().params)


def test_sizes_that_are_no_numbers():
    """Of a box, too, which has no rule about its extents beyond that."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    params = arena.nominal_params()._replace(object_full_sizes=np.full((1, 3), np.nan))
    assert arena.problems(params) == [
        "`object_full_sizes` of object 'cube' must be finite and > 0 on every axis [m], got [nan, nan, nan]."
    ]


@pytest.mark.parametrize("value", ["0.3", True])
def test_numbers_of_an_object_are_numbers(value):
    """Text and truth values are no numbers, even where NumPy and MuJoCo would take them."""
    with pytest.raises(ValueError, match=re.escape(f"`mass` must be a finite number, got {value!r}.")):
        mja.TableArena(objects=[mja.Object("cube", mass=value)])
