"""Tables and parts in what is fixed beside them, or below the floor: a warning of the nominal arena, a flag and a sentence of a world."""

import functools
import itertools
import warnings

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture

SCENE = """<mujoco><worldbody><geom name="floor" type="plane" size="0 0 .1"/>
  <geom name="pillar" type="cylinder" size=".15 1" pos="1.2 .6 1"/>
  <geom name="block" type="box" size=".2 .1 .3" pos="1.2 -.8 .3" euler="0 0 30"/>
  <geom name="ball" type="sphere" size=".2" pos="-.9 .2 .7"/>
  <geom name="paint" type="box" size=".2 .2 .3" pos="0 1.2 .3" contype="0" conaffinity="0"/></worldbody></mujoco>"""
ROBOT = """<mujoco><worldbody><body name="base"><geom name="foot" type="box" size=".06 .05 .05" pos="0 0 .05"/>
  <body pos="0 0 .1"><joint axis="0 0 1"/><geom size=".03" pos="0 0 .1"/></body></body></worldbody></mujoco>"""
FIXED = ("pillar", "block", "ball", "r_foot")
RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.3, -0.3, -0.1], [0.3, 0.3, 0.1], relative="add"),
    terms={
        "bin.pos": mja.Uniform([-0.25, -0.3, 0], [0.25, 0.3, 0]),
        "bin.rot": mja.Uniform(-3, 3),
        "rack.pos": mja.Uniform([0.7, -1, -0.01], [2.2, 0.8, 0.05]),
        "rack.rot": mja.Uniform(-3, 3),
        "rack.pieces_active": mja.Bernoulli(0.5),
    },
)


@functools.cache
def arena():
    arena = mja.TableArena((0.7, 0.9, 0.04), xml=SCENE)
    arena.add_part(furniture.Bin("bin", on="table", pos=(0.15, 0.2, 0), inner_size=(0.2, 0.15, 0.1)))
    arena.add_part(furniture.Shelf("rack", pos=(2.5, 0, 0), size=(0.3, 0.5), heights=(0.3, 0.7, 1.1)))
    arena.add_part(furniture.Zone("spot", pos=(-2, 0, 0)))
    arena.attach(ROBOT, "r_", on="table", pos=(-0.2, -0.2, 0))
    return arena


def rows(arena, model):
    """Names of the slab and of all boxes of parts that are in a model."""
    names = ["table_collision", *(model.geom(g).name for g in range(model.ngeom))]
    return [names[0], *(n for n in names if n.startswith(("bin_", "rack_")))]


def deepest(arena, params):
    """Of a world in C: the largest depth of a slab or box in what is fixed, but of the table in the base that stands on it."""
    model, c = arena.c_world(params)
    pairs = [p for p in itertools.product(rows(arena, model), FIXED) if p != ("table_collision", "r_foot")]
    found = [mujoco.mj_geomDistance(model, c, model.geom(a).id, model.geom(b).id, 0.01, None) for a, b in pairs]
    return -min(found)


@pytest.mark.slow
def test_flags_are_as_in_c():
    """Boxes, a cylinder, a sphere and a robot's base: the flag is what C's own distances between the geoms say."""
    one = arena()
    keys = mja.world_keys(0, range(120))
    params = jax.vmap(lambda key: one.sample_params(key, RANGES))(keys)
    flags = np.asarray(jax.jit(jax.vmap(one.valid))(params))
    host = jax.tree.map(np.asarray, params)
    agree = []
    for w in range(120):
        p = jax.tree.map(lambda x, w=w: x[w], host)
        problems = one.problems(p)
        assert flags[w] == (not problems)
        if any("below the floor" in text or "part 'rack' overlap" in text for text in problems):
            continue
        depth = deepest(one, p)
        ball = any("'ball'" in text for text in problems)  # the box around it counts in height
        if abs(depth) > 1e-4 and not ball:
            assert flags[w] == (depth < 0), (depth, problems)
            agree.append(bool(flags[w]))
    assert 15 < sum(agree) < len(agree) - 15


def said(make):
    """The warnings of a call."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        made = make()
    return made, [str(w.message) for w in caught]


def with_part(part, xml=SCENE):
    arena = mja.TableArena((0.7, 0.9, 0.04), xml=xml)
    arena.add_part(part)
    return arena


NOMINAL = {
    "a part in a pillar": (
        lambda: with_part(furniture.Bin("bin", pos=(1.2, 0.6, 0))),
        "Part 'bin' ('bin_bottom') and 'pillar' overlap by 0.01 m: this is taken to be intended in every world.",
    ),
    "a table in a pillar": (
        lambda: mja.TableArena(table_offset=(1.2, 0.6, 0.8), xml=SCENE),
        "Table 0 and 'pillar' overlap by 0.15 m: this is taken to be intended in every world.",
    ),
    "a part below the floor": (
        lambda: with_part(furniture.Shelf("rack", pos=(2, -2, -0.3))),
        "Part 'rack' stands 0.3 m below the floor: this is taken to be intended in every world.",
    ),
    "a zone below the floor": (
        lambda: with_part(furniture.Zone("spot", pos=(2, -2, -0.1))),
        "Part 'spot' stands 0.1 m below the floor: this is taken to be intended in every world.",
    ),
}


@pytest.mark.parametrize("case", NOMINAL)
def test_nominal(case):
    """One warning when it is made; from then on it is intended, and nothing is said of its worlds."""
    make, says = NOMINAL[case]
    arena, told = said(make)
    assert told == [says]
    assert arena.valid(arena.nominal_params())
    assert arena.problems(arena.nominal_params()) == []


def test_not_said():
    """Of what stands beside or on something, of what touches nothing, without a floor, and of a robot's base in a slab."""
    floorless = "<mujoco><worldbody><light pos='0 0 3'/></worldbody></mujoco>"
    for part, xml in (
        (furniture.Bin("bin", pos=(0, 1.2, 0)), SCENE),  # in geoms that are paint
        (furniture.Shelf("rack", pos=(2, 0, -0.3)), floorless),
        (furniture.Ramp("ramp", pos=(2, -2, 0)), SCENE),
    ):
        assert said(lambda part=part, xml=xml: with_part(part, xml))[1] == []
    arena = mja.TableArena()
    assert said(lambda: arena.attach(ROBOT, "r_", pos=(0.3, 0, 0.76)))[1] == []
    adopted = SCENE.replace(
        "</worldbody>", '<body name="desk" pos="1.2 .6 .5"><geom type="box" size=".3 .3 .02"/></body></worldbody>'
    )
    assert said(lambda: mja.Arena.from_xml(adopted, ["desk"]))[1] == []


def test_robots_in_parts():
    """When they are attached, in the world and on the table on which the part stands."""
    arena = mja.TableArena()
    arena.add_part(furniture.Bin("bin", on="table", pos=(0.1, 0.1, 0)))
    _, told = said(lambda: arena.attach(ROBOT, "r_", on="table", pos=(0.1, 0.1, 0)))
    assert told == [
        "Part 'bin' ('bin_bottom') and 'r_foot' overlap by 0.01 m: this is taken to be intended in every world."
    ]
    _, told = said(lambda: arena.attach(ROBOT, "s_", on="table", pos=(-0.2, -0.2, 0)))
    assert told == []


MOVED = {
    "a bin onto a robot's base": (
        {"bin.pos": [[-0.2, -0.2, 0]]},
        "Part 'bin' ('bin_bottom') and 'r_foot' overlap by 0.01 m.",
    ),
    "a shelf into a pillar": (
        {"rack.pos": [[1.2, 0.6, 0]]},
        "Part 'rack' ('rack_back') and 'pillar' overlap by 0.02 m.",
    ),
    "a shelf below the floor": ({"rack.pos": [[2.5, 0, -0.02]]}, "Part 'rack' stands 0.02 m below the floor."),
    "a zone below the floor": ({"spot.pos": [[-2, 0, -0.02]]}, "Part 'spot' stands 0.02 m below the floor."),
}


@pytest.mark.parametrize("case", MOVED)
def test_moved(case):
    change, says = MOVED[case]
    one, nominal = arena(), arena().nominal_params()
    params = nominal._replace(terms={**nominal.terms, **{name: jnp.asarray(x) for name, x in change.items()}})
    assert one.valid(nominal)
    assert not one.valid(params)
    assert says in one.problems(params)


def test_in_a_follower():
    """A part that comes into a leg of a scene that follows its table."""
    scene = """<mujoco><worldbody><body name="desk" pos="0 0 .7"><geom name="slab" type="box" size=".5 .4 .02"/>
      <geom name="side" type="box" size=".02 .4 .34" pos=".48 0 -.36"/></body></worldbody></mujoco>"""
    arena = mja.Arena.from_xml(scene, ["slab"], follow=[mja.Follow("side", x="+", z="floor")])
    arena.add_part(furniture.Bin("bin", pos=(0.75, 0, 0), inner_size=(0.3, 0.2, 0.1)))
    nominal = arena.nominal_params()
    assert arena.valid(nominal)
    longer = nominal._replace(table_full_sizes=jnp.array([[1.3, 0.8, 0.04]]))
    assert not arena.valid(longer)
    assert arena.problems(longer) == ["Part 'bin' ('bin_bottom') and 'side' overlap by 0.01 m."]


def test_bundles(tmp_path):
    """`check` reports such worlds, and their bundles say it again without the arena."""
    ranges = mja.ArenaRanges(terms={"rack.pos": mja.Fixed([[1.2, 0.6, -0.1]])})
    report = mja.check(arena(), ranges, 1, n_steps=1, engine="c")
    assert set(report.failures) == {"invalid_arena"}
    assert "'pillar' overlap" in report.of(0)["invalid_arena"].what
    assert "Part 'rack' stands 0.1 m below the floor." in report.of(0)["invalid_arena"].what
    report.save_bundle(tmp_path / "bundle", 0)
    assert mja.replay(tmp_path / "bundle").found == report.of(0)


@pytest.mark.parametrize("actuator", ["", '<actuator><motor joint="hinge"/></actuator>'])
def test_tables_in_what_has_a_door(actuator):
    """A cabinet whose door nothing drives is no robot: a table that reaches into it is told, which a robot's base is not."""
    scene = f"""<mujoco><worldbody><body name="desk" pos="0 0 .7"><geom type="box" size=".5 .4 .02"/></body>
      <body name="cabinet" pos="1.2 0 .5"><geom name="side" type="box" size=".3 .3 .5"/><body name="door" pos="0 -.35 0">
      <joint name="hinge"/><geom type="box" size=".3 .02 .4"/></body></body></worldbody>{actuator}</mujoco>"""
    arena = mja.Arena.from_xml(scene, tables=["desk"])
    params = arena.nominal_params()
    moved = params._replace(table_offsets=params.table_offsets + np.array([0.6, 0, 0], np.float32))
    assert bool(arena.valid(moved)) == bool(actuator)
    told = [] if actuator else ["Table 'desk' and 'side' overlap by 0.2 m."]
    assert arena.problems(moved) == told


def test_what_stays_on_a_table_is_told():
    """A fixed body that stands on a table which moves, also one with a lid; no wall behind it, no robot, and nothing in its body."""
    box = '<geom type="box" size=".05 .05 .05"/>'
    scene = f"""<mujoco><worldbody><body name="desk" pos="0 0 .7"><geom name="top" type="box" size=".5 .4 .02"/>
      <body name="own" pos="-.3 0 .07">{box}</body></body>
      <body name="stand" pos=".2 0 .77">{box}<body pos="0 0 .1"><joint/>{box}</body></body>
      <body name="arm" pos="0 .2 .77">{box}<body pos="0 0 .1"><joint name="turn"/>{box}</body></body>
      <body name="wall" pos="0 .6 .5"><geom type="box" size="1 .05 .5"/></body></worldbody>
      <actuator><motor joint="turn"/></actuator></mujoco>"""
    arena = mja.Arena.from_xml(scene, tables=["top"])
    with pytest.warns(UserWarning, match="^`ranges` varies table") as told:
        arena.check_ranges(mja.ArenaRanges(table_offsets=mja.Uniform([0, 0, -0.1], [0, 0, 0.1], relative="add")))
    assert [str(one.message) for one in told] == [
        "`ranges` varies table 'desk', on which the fixed body 'stand' of the scene stays where it is: put it into the <body> of the "
        "table, with which its children move."
    ]
    arena.check_ranges(mja.ArenaRanges(table_active=mja.Fixed(True)))
