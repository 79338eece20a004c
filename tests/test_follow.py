"""Geoms of a scene that follow the slab of a table: legs that reach the floor, sides that keep to an edge."""

import functools

import jax
import mujoco
import numpy as np
import pytest
from oracle import STRUCTURE_MAY_DIFFER, from_compiled
from worlds import forward

import mjx_arenas as mja
from mjx_arenas.problems.messages import problems_of

SCENE = """<mujoco><compiler angle="degree"/><worldbody><geom name="floor" type="plane" size="0 0 .1"/>
  <body name="desk" pos="1 0 .75" euler="0 0 30"><geom name="top" type="box" size=".6 .4 .02"/>
    <geom name="round" type="cylinder" fromto=".55 .35 -.02 .55 .35 -.75" size=".025" contype="0" conaffinity="0"/>
    <geom name="pill" type="capsule" fromto="-.55 .35 -.045 -.55 .35 -.725" size=".025"/>
    <frame pos="0 -.35 0"><geom name="square" type="box" size=".02 .02 .365" pos=".55 0 -.385"/></frame>
    <geom name="panel" type="box" size=".01 .36 .2" pos="-.55 0 -.22"/>
    <geom name="wall" type="box" size=".4 .01 .6" pos="0 .39 .05" euler="0 90 0"/>
    <geom name="knob" size=".02" pos=".62 0 0"/><geom name="lid" type="box" size=".6 .4 .01" pos="0 0 -.03"/></body>
  <body name="rack" pos="-1 0 0"><geom name="side" type="box" size=".01 .2 .4" pos=".41 0 .4"/>
    <geom name="low" type="box" size=".4 .2 .01" pos="0 0 .3"/><geom name="high" type="box" size=".4 .2 .01" pos="0 0 .7"/></body>
  <body name="cart" pos="5 0 .5"><joint name="roll" type="slide"/><geom name="box" type="box" size=".1 .1 .1"/></body>
  <body name="odd" pos="5 5 1" euler="10 20 30"><geom name="turned" type="box" size=".1 .1 .1"/></body>
  </worldbody></mujoco>"""
FOLLOW = (
    mja.Follow("round", x="+", y="+", z="floor"),
    mja.Follow("pill", x="-", y="+", z="floor"),
    mja.Follow("square", x="+", y="-", z="floor"),
    mja.Follow("panel", x="-", y="both", z="-"),
    mja.Follow("wall", x="both", y="+", z="+"),
    mja.Follow("knob", x="+"),
    mja.Follow("lid", x="both", y="both", z="both"),
    mja.Follow("side", x="+", y="both", z="floor", table="high"),
)
RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.1, -0.1, -0.2], [0.1, 0.1, 0.25], relative="add"),
    table_rots=mja.Uniform(-0.1, 0.1, relative="add"),
    table_full_sizes=mja.Uniform(0.8, 1.3, relative="scale"),
)
TABLES = ("top", "low", "high")


@functools.cache
def arena():
    objects = [mja.Object("cube", full_size=0.1), mja.Object("can", on="high")]
    return mja.Arena.from_xml(SCENE, TABLES, objects=objects, follow=FOLLOW)


def drawn(seed, n):
    return [arena().sample_params(key, RANGES) for key in jax.random.split(jax.random.key(seed), n)]


def ends(model, data, geom, table):
    """Lowest and highest coordinates of a geom in the frame of a table's slab, and the slab's half size."""
    index, slab = model.geom(geom).id, model.geom(table).id
    axes = data.geom_xmat[slab].reshape(3, 3)
    turn, size = np.abs(axes.T @ data.geom_xmat[index].reshape(3, 3)), model.geom_size[index]
    kind = mujoco.mjtGeom(model.geom_type[index])
    reach = turn @ size if kind == mujoco.mjtGeom.mjGEOM_BOX else size[0] + turn[:, 2] * size[1]
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        reach = np.array([size[0], size[0], size[1]])
    middle = axes.T @ (data.geom_xpos[index] - data.geom_xpos[slab])
    return middle - reach, middle + reach, model.geom_size[slab]


def test_nominally_the_scene():
    """What follows stands where it stood."""
    before, after = mujoco.MjModel.from_xml_string(SCENE), arena().mj_model
    then, now = forward(before), forward(after)
    for geom in range(before.ngeom):
        name = before.geom(geom).name
        np.testing.assert_allclose(now.geom(name).xpos, then.geom(name).xpos, rtol=0, atol=1e-12, err_msg=name)
        np.testing.assert_allclose(now.geom(name).xmat, then.geom(name).xmat, rtol=0, atol=1e-12, err_msg=name)
        np.testing.assert_allclose(after.geom(name).size, before.geom(name).size, rtol=0, atol=1e-12, err_msg=name)


def test_ends():
    """In every world each end keeps its distance from what it follows: an edge, the underside, the floor."""
    nominal, then = arena().mj_model, forward(arena().mj_model)
    for params in drawn(1, 4):
        model = arena().compile(params)
        data = forward(model)
        for f in FOLLOW:
            table = f.table or "top"
            low, high, half = ends(model, data, f.geom, table)
            low0, high0, half0 = ends(nominal, then, f.geom, table)
            grown = half - half0
            for axis, how in enumerate((f.x, f.y, f.z)):
                by = {"-": (-1, -1), "+": (1, 1), "both": (-1, 1), "floor": (None, -1), None: (0, 0)}[how]
                assert high[axis] - high0[axis] == pytest.approx(by[1] * grown[axis], abs=1e-7)
                if by[0] is None:
                    floor, floor0 = (d.geom(table).xpos[2] + x[2] for d, x in ((data, low), (then, low0)))
                    assert floor == pytest.approx(floor0, abs=1e-7)
                else:
                    assert low[axis] - low0[axis] == pytest.approx(by[0] * grown[axis], abs=1e-7)


@pytest.mark.slow_on("warp")
def test_oracle(impl):
    """What follows varies exactly."""
    model, apply = arena().put_model(impl), jax.jit(arena().apply)
    for params in drawn(2, 4):
        assert from_compiled(apply(model, params), arena().compile(params)) <= STRUCTURE_MAY_DIFFER.keys()


def test_objects_keep_clear():
    """Objects are placed clear of a wall that stands at another edge in every world."""
    place = jax.jit(jax.vmap(arena().place))
    params = jax.tree.map(lambda *x: np.stack(x), *drawn(3, 20))
    placed = place(params, jax.random.split(jax.random.key(4), 20))
    assert placed.valid.all()
    near = 0
    for i in range(20):
        one = jax.tree.map(lambda x, i=i: np.asarray(x)[i], params)
        model = arena().compile(one)
        data = mujoco.MjData(model)
        data.joint("cube_joint0").qpos = placed.qpos[i, 0]
        mujoco.mj_forward(model, data)
        touching = {frozenset(model.geom(g).name for g in contact.geom) for contact in data.contact}
        assert frozenset(("cube_g0", "wall")) not in touching
        axes = data.geom("top").xmat.reshape(3, 3)
        near += (axes.T @ (data.body("cube").xpos - data.geom("top").xpos))[1] > model.geom("top").size[1] - 0.12
    assert near > 0


def test_too_low():
    """A world in which a leg would be shorter than nothing is no valid one, and is refused in words."""
    params = arena().nominal_params()
    low = params._replace(table_offsets=params.table_offsets.at[0, 2].set(0.06))
    assert arena().valid(params)
    assert not arena().valid(low)
    with pytest.raises(
        ValueError, match=r"'pill', which follows table 'desk' .*, would have a negative length: raise or enl"
    ) as error:
        arena().compile(low)
    assert len(problems_of(error.value)) == 1


def test_merged():
    """In a merged arena legs reach the floor of their own scene."""
    merged = mja.TableArena(objects=[mja.Object("cube")]).merge(arena(), "m_", pos=(5, 0, 0.1), rot=0.3)
    params = merged.nominal_params()
    params = params._replace(table_offsets=params.table_offsets.at[1, 2].add(0.2))
    model = merged.compile(params)
    data = forward(model)
    for leg, at in (("round", 1), ("square", 2)):
        assert data.geom(f"m_{leg}").xpos[2] - model.geom(f"m_{leg}").size[at] == pytest.approx(0.1, abs=1e-6)


def test_in_a_file(tmp_path):
    """What follows is written, and read again."""
    (tmp_path / "scene.xml").write_text(SCENE)
    one = mja.Arena.from_xml(tmp_path / "scene.xml", TABLES, follow=FOLLOW)
    mja.save(tmp_path / "arena.yaml", one, RANGES)
    assert "follow:" in (tmp_path / "arena.yaml").read_text()
    again, _ = mja.load(tmp_path / "arena.yaml")
    params = drawn(5, 1)[0]._replace(**{name: getattr(one.nominal_params(), name) for name in params_of_objects()})
    np.testing.assert_array_equal(again.compile(params).geom_size, one.compile(params).geom_size)


def params_of_objects():
    return [name for name in mja.ArenaParams._fields if name.startswith("object_")]


F = mja.Follow
WRONG = {
    "one, no list": (F("panel", x="+"), "`follow` must be a sequence of mjx_arenas.Follow, got "),
    "a name": (["panel"], "`follow` must be a sequence of mjx_arenas.Follow, got 'panel'."),
    "no geom": (
        [F("pannel", x="+")],
        "`follow`: the scene has no geom 'pannel': did you mean 'panel'?",
    ),
    "nothing like a geom": (
        [F("chandelier", x="+")],
        "`follow`: the scene has no geom 'chandelier'; on the bodies of tables are: ",
    ),
    "no name": ([F("", x="+")], "`follow.geom` must be a non-empty string, got ''."),
    "another edge": (
        [F("panel", x="left")],
        "`follow.x` of geom 'panel' must be one of '-', '+', 'both', got 'left'.",
    ),
    "a floor at the side": (
        [F("panel", y="floor")],
        "`follow.y` of geom 'panel' must be one of '-', '+', 'both', got 'floor'.",
    ),
    "twice": ([F("panel", x="+"), F("panel", y="+")], "`follow`: geom 'panel' is listed twice."),
    "the slab": ([F("top", x="+")], "`follow`: geom 'top' is the slab of a table itself."),
    "the floor": ([F("floor", x="+", table="desk")], "`follow`: geom 'floor' is a plane, which has no ends."),
    "what moves": (
        [F("box", table="desk")],
        "`follow`: geom 'box' must be fixed to the world to follow a table, but joint 'roll' of body 'cart' moves it",
    ),
    "on no table": (
        [F("side", x="+")],
        "`follow`: geom 'side' is on no table's body: give the `table` that it follows, one of 'desk', ",
    ),
    "no such table": (
        [F("side", x="+", table="dask")],
        "give the `table` that it follows, one of 'desk', 'low', 'high'.",
    ),
    "nothing": ([F("panel")], "`follow`: geom 'panel' already moves with table 'desk': give the `x`, `y` or `z`"),
    "a ball that grows": (
        [F("knob", x="both")],
        "geom 'knob', a sphere, cannot grow along the slab's x axis: its size stays.",
    ),
    "a thicker leg": (
        [F("round", x="both")],
        "geom 'round', a cylinder, cannot grow along the slab's x axis: that is not its own axis.",
    ),
    "a turned box": (
        [F("turned", y="both", table="desk")],
        "geom 'turned', a box, cannot grow along the slab's y axis: it is turned.",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_wrong(what):
    """Each is answered by one sentence."""
    follow, sentence = WRONG[what]
    with pytest.raises(ValueError, match="follow") as error:
        mja.Arena.from_xml(SCENE, TABLES, follow=follow)
    assert sentence in str(error.value)
    assert len(problems_of(error.value)) == 1
