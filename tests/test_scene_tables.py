"""Tables that stand in a user's scene: slabs of the world, of nested bodies, of bodies in frames, and several of one body."""

import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from oracle import STRUCTURE_MAY_DIFFER, from_compiled
from worlds import forward

import mjx_arenas as mja
from mjx_arenas import dr

SCENE = """<mujoco><compiler angle="degree"/>
  <default><default class="wood"><geom friction=".7 .01 .001" rgba=".5 .3 .1 1"/></default></default>
  <worldbody><geom name="floor" type="plane" size="0 0 .1"/>
  <geom name="plinth" type="box" size=".3 .3 .2" pos="3 0 .2" euler="0 0 20"/>
  <body name="room" pos="10 3 0" euler="0 0 90"><geom name="wall" type="box" size=".05 2 1" pos="-2 0 1"/>
    <body name="upright" euler="90 0 0"><frame pos=".2 .1 0"><body name="desk" pos=".5 0 0" euler="0 10 0">
      <frame euler="0 0 0"><geom name="top" type="box" size=".6 .02 .4" pos="0 .72 0"/></frame>
      <frame pos="0 0 .1"><geom name="lamp" type="box" size=".02 .1 .02" pos="0 .84 0"/></frame></body></frame></body></body>
  <body name="rack" pos="-1 0 0" childclass="wood"><geom name="side" type="box" size=".01 .2 .6" pos=".41 0 .6"/>
    <geom name="low" type="box" size=".4 .2 .01" pos="0 0 .3"/><geom name="middle" type="box" size=".4 .2 .01" pos="0 0 .7"/>
    <frame pos="0 0 .5"><geom name="high" type="box" fromto="0 0 .6 0 0 .62" size=".3"/></frame></body>
  <body pos="0 5 .5"><geom name="nameless" type="box" size=".4 .4 .02"/></body>
  <body name="box" pos="-1.2 .1 .36"><freejoint/><geom name="of_box" type="box" size=".05 .05 .05"/></body>
  </worldbody><contact><pair geom1="middle" geom2="of_box"/></contact>
  <sensor><framepos objtype="geom" objname="low"/></sensor></mujoco>"""
RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.1, -0.1, -0.05], [0.1, 0.1, 0.05], relative="add"),
    table_rots=mja.Uniform(-0.1, 0.1, relative="add"),
    table_full_sizes=mja.Uniform(0.9, 1.2, relative="scale"),
)
SLABS = ("plinth", "top", "low", "middle", "high", "nameless")


@functools.cache
def arena():
    objects = ["box", mja.Object("cube", on="desk"), mja.Object("can", on="high")]
    return mja.Arena.from_xml(SCENE, SLABS, objects=objects)


def test_nominally_the_scene():
    """Every geom stands where it stood, with its friction; bodies of slabs that have none of their own are named after them."""
    before, after = mujoco.MjModel.from_xml_string(SCENE), arena().mj_model
    then, now = forward(before), forward(after)
    assert arena().table_names == ["plinth", "desk", "low", "middle", "high", "nameless"]
    for geom in range(before.ngeom):
        name = before.geom(geom).name
        np.testing.assert_allclose(now.geom(name).xpos, then.geom(name).xpos, rtol=0, atol=1e-12, err_msg=name)
        if name not in ("top", "high"):  # which lie on another side: a table's z axis points up
            np.testing.assert_allclose(now.geom(name).xmat, then.geom(name).xmat, rtol=0, atol=1e-12, err_msg=name)
        np.testing.assert_array_equal(after.geom(name).friction, before.geom(name).friction)
    params = arena().nominal_params()
    np.testing.assert_allclose(params.table_full_sizes[1], [0.8, 1.2, 0.04], atol=1e-7)
    np.testing.assert_allclose(params.table_offsets[1, 2], 0.84, atol=1e-7)
    np.testing.assert_allclose(params.table_offsets[4], [-1, 0, 1.12], atol=1e-6)
    assert (after.npair, after.nsensor) == (1, 1)
    np.testing.assert_array_equal(after.pair_geom1, after.geom("middle").id)


@pytest.mark.slow_on("warp")
def test_oracle(impl):
    """Tables on bodies that stand turned, far from the origin, vary exactly, and stand where their parameters say."""
    model, apply = arena().put_model(impl), jax.jit(arena().apply)
    for key in jax.random.split(jax.random.key(1), 4):
        params = arena().sample_params(key, RANGES)
        twin = arena().compile(params)
        assert from_compiled(apply(model, params), twin) <= STRUCTURE_MAY_DIFFER.keys()
        data = forward(twin)
        for t, slab in enumerate(SLABS):
            top = data.geom(slab).xpos + np.array([0, 0, twin.geom(slab).size[2]])
            np.testing.assert_allclose(top, params.table_offsets[t], atol=1e-6)
            assert data.geom(slab).xmat[8] == pytest.approx(1)


def test_inertials_of_geoms():
    """Where the compiler makes them all of geoms, tables stay tables, and all else weighs what it weighed."""
    xml = """<mujoco><compiler inertiafromgeom="true"/><worldbody>
      <body name="desk" pos="0 0 .5"><geom name="top" type="box" size=".4 .4 .02"/>
      <geom name="leg" type="box" size=".02 .02 .1" pos=".1 0 -.3" contype="0" conaffinity="0"/></body>
      <body name="one" pos="2 0 1"><freejoint/><inertial pos=".5 0 0" mass="9" diaginertia="1 1 1"/><geom size=".05" mass=".4"/></body>
      <body name="two" pos="3 0 1"><freejoint/><inertial pos=".5 0 0" mass="9" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
    before, after = mujoco.MjModel.from_xml_string(xml), mja.Arena.from_xml(xml, ["desk"]).mj_model
    for name in ("one", "two"):
        for field in ("mass", "ipos", "inertia"):
            np.testing.assert_array_equal(getattr(after.body(name), field), getattr(before.body(name), field))


def test_what_rests_on_them():
    """Objects fall onto nested slabs, in C MuJoCo, and rest at the heights of the formula."""
    key = jax.random.key(3)
    params = arena().sample_params(key, RANGES)
    assert arena().place(params, key).valid.all()
    model, data = arena().c_world(params, key=key)
    mujoco.mj_step(model, data, 200)
    rest = np.asarray(arena().rest_heights(params))
    z = [data.body(o.name).xpos[2] for o in arena().objects]
    np.testing.assert_allclose(z, rest, atol=1e-3)


@pytest.mark.slow_on("warp")
def test_absent(impl):
    """What is absent is high above, whichever way its carrier is turned, and the rest stays."""
    params = arena().nominal_params()._replace(table_active=jnp.array([True, False, True, False, True, True]))
    model = arena().compile(params)
    bodies = {model.body(b).name for b in range(model.nbody)}
    assert {"room", "rack", "low", "high"} <= bodies
    assert bodies.isdisjoint({"desk", "middle", "cube"})
    batch = arena().batch(arena().put_model(impl), jax.tree.map(lambda x: x[None], params))
    z = np.asarray(mja.make_data(batch).geom_xpos)[0, :, 2]  # static geoms are placed
    ids = {name: arena().mj_model.geom(name).id for name in ("top", "lamp", "middle", "low", "side", "wall")}
    assert (z[[ids["top"], ids["lamp"], ids["middle"]]] > 900).all()
    np.testing.assert_allclose(z[[ids["low"], ids["side"], ids["wall"]]], [0.3, 0.6, 1], atol=1e-5)


def test_merged():
    """A nested table of a merged arena stands where its parameters say, with what carries it."""
    merged = mja.TableArena().merge(arena(), "m_", pos=(1, 2, 0), rot=0.5)
    params = merged.nominal_params()
    model = merged.mj_model
    data = forward(model)
    np.testing.assert_allclose(data.geom("m_top").xpos + np.array([0, 0, 0.02]), params.table_offsets[2], atol=1e-6)
    turn = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
    np.testing.assert_allclose(data.body("m_room").xpos[:2], turn @ [10, 3] + [1, 2], atol=1e-9)


@pytest.mark.parametrize("attribute", ["body.pos", "body.rpy", "body.active"])
def test_what_carries_tables_stays(attribute):
    """What a table hangs on cannot vary: parameters say where the table is."""
    one = mja.Arena.from_xml(SCENE, SLABS)
    with pytest.raises(ValueError, match=rf"'{attribute}' of body 'room' cannot vary, as table 'desk' hangs on it\."):
        one.vary(x=dr.Term(attribute, "room"))


def test_what_carries_tables_was_moved():
    """Nor may it be edited afterwards."""
    one = mja.Arena.from_xml(SCENE, SLABS)
    one.spec.body("room").pos = (0, 0, 0)
    with pytest.raises(ValueError, match=r"body 'upright', on which table 'desk' hangs, was moved since `from_xml`"):
        one.mj_model  # noqa: B018


WRONG = {
    "moves": (
        '<body name="cart"><joint name="roll" type="slide"/><body name="tray"><geom type="box" size=".1 .1 .1"/></body></body>',
        ["tray"],
        "`tables`: table 'tray' must be fixed to the world, but joint 'roll' of body 'cart' moves it.",
    ),
    "mocap": (
        '<body name="hand" mocap="true"><geom type="box" size=".1 .1 .1"/></body>',
        ["hand"],
        "`tables`: table 'hand' must be fixed to the world, but body 'hand', which is a mocap body, moves it.",
    ),
    "on a table": (
        '<body name="a"><geom type="box" size="1 1 .1"/><body name="b" pos="0 0 1"><geom type="box" size=".1 .1 .1"/></body></body>',
        ["b", "a"],
        (
            "`tables`: 'b' is attached to body 'a', which belongs to the table 'a' and would move it: leave out one of the "
            "two."
        ),
    ),
    "unknown": (
        '<body name="a"><body name="b"><geom type="box" size=".1 .1 .1"/></body></body>',
        ["c"],
        "`tables`: 'c' is neither a body nor a geom of the scene; known are a, b.",
    ),
    "unknown, but near": (
        '<body name="bench"><geom name="bench_top" type="box" size=".1 .1 .1"/></body>',
        ["bench_to"],
        "`tables`: 'bench_to' is neither a body nor a geom of the scene: did you mean `bench_top`?",
    ),
    "tilted": (
        '<body name="a" euler="20 0 0"><geom name="g" type="box" size=".1 .1 .1"/></body>',
        ["a"],
        "`tables`: the slab 'g' is tilted; one of its sides must point up.",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_wrong(what):
    """Each is answered by one sentence."""
    inside, tables, sentence = WRONG[what]
    with pytest.raises(ValueError, match="tables") as error:
        mja.Arena.from_xml(f"<mujoco><worldbody>{inside}</worldbody></mujoco>", tables)
    assert str(error.value) == sentence


def test_looks_move():
    """A slab is seen as `{body}_visual`, which has its colour; what stands for legs is neither seen nor touched."""
    before, after = mujoco.MjModel.from_xml_string(SCENE), arena().mj_model
    for slab, table in zip(SLABS, arena().table_names, strict=True):
        drawn, collides = after.geom(f"{table}_visual"), after.geom(slab)
        np.testing.assert_array_equal(drawn.rgba, before.geom(slab).rgba)
        np.testing.assert_array_equal(drawn.size, collides.size)
        assert (collides.rgba[3], drawn.contype[0], drawn.conaffinity[0]) == (0, 0, 0)
        legs = [after.geom(f"{table}_leg{i}_visual") for i in range(4)]
        assert {(*leg.rgba[3:], *leg.contype, *leg.conaffinity) for leg in legs} == {(0, 0, 0)}
        assert max(leg.size.max() for leg in legs) < 2e-4
