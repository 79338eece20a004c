"""Names in messages: of geoms and bodies with and without one, of tables, and of quantities."""

import copy
import inspect
import pickle

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas.checks import watch_c
from mjx_arenas.spec import names
from mjx_arenas.terms.owned import element_name

SCENE = """<mujoco><worldbody><body name="counter" pos="0 0 .8">
    <geom name="top_left" type="box" size=".3 .4 .02" pos="-.4 0 0"/>
    <geom name="top_right" type="box" size=".3 .4 .02" pos=".4 0 0"/></body>
  <body name="shelf" pos="0 2 .5"><geom name="board" type="box" size=".4 .4 .02"/></body>
  <body pos="0 -2 .5"><geom name="nameless" type="box" size=".4 .4 .02"/></body>
  <body name="rack" pos="0 -4 .5"><geom type="box" size=".4 .4 .02"/><geom type="box" size=".4 .4 .02" pos="0 0 .3"/></body>
  </worldbody></mujoco>"""
WRONG = {
    ("shelf", "board"): "`tables`: 'shelf' and 'board' are one slab, of 'shelf', which can be one table only.",
    ("shelf", "shelf"): "`tables`: 'shelf' is there twice.",
    (
        "rack",
    ): "`tables`: 'rack' has 2 boxes that collide, and one must be its slab: give that geom's name. Its geoms: an unnamed box, "
    "an unnamed box.",
}


@pytest.mark.parametrize("tables", WRONG)
def test_tables_of_a_scene(tables):
    """Each sentence names what was given."""
    with pytest.raises(ValueError, match=r"^`tables`") as error:
        mja.Arena.from_xml(SCENE, list(tables))
    assert str(error.value) == WRONG[tables]


def test_table_by_its_slab():
    """What was given as a table's name is taken for an object's, and for a robot's, in merged arenas, too."""
    objects = [mja.Object("cup", on="top_right"), mja.Object("box", on="shelf"), mja.Object("can", on="board")]
    arena = mja.Arena.from_xml(SCENE, ["top_right", "shelf"], objects=objects)
    assert arena.nominal_params().object_tables.tolist() == [0, 1, 1]
    arena.attach('<mujoco><worldbody><body><geom size=".02"/></body></worldbody></mujoco>', "r_", on="board")
    merged = mja.TableArena().merge(arena, "m_", pos=(5, 0, 0))
    assert [o.on for o in merged.objects] == [1, 2, 2]
    body = merged.mj_model.body("m_r_mount")
    assert merged.mj_model.body(body.parentid[0]).name == "m_shelf"


NAMELESS = """<mujoco><worldbody><geom type="cylinder" size=".1 .1" pos="5 0 0"/>
  <body pos="5 0 1"><joint/><geom type="box" size=".1 .1 .1"/></body>
  <body name="arm" pos="5 0 2"><joint/><geom type="capsule" size=".1 .1"/></body></worldbody></mujoco>"""


def test_geoms_without_names():
    """They are called by what they are, and where."""
    arena = mja.TableArena(xml=NAMELESS)
    with pytest.raises(
        ValueError, match=r"geoms an unnamed cylinder of the world \(cylinder\) and an unnamed box of body \d"
    ):
        arena.put_model("jax")
    model = arena.mj_model
    kinds = watch_c.geom_names(model, np.array([model.body("arm").geomadr[0], 0]))
    assert kinds == ("an unnamed capsule of body 'arm'", "an unnamed cylinder of the world")
    wall = '<mujoco><worldbody><geom type="box" size=".1 .1 .1" pos="0 0 .8"/></worldbody></mujoco>'
    with pytest.warns(UserWarning, match="^Table 0 and an unnamed box of the world overlap"):
        arena = mja.TableArena(xml=wall, objects=[mja.Object("cube", pos=(0, 0))])
    with pytest.warns(
        UserWarning, match="^an unnamed box of the world and 'cube' start .* inside each other"
    ) as warned:
        arena.mj_model  # noqa: B018
    assert [w.filename for w in warned] == [__file__]


ELEMENTS = """<mujoco><worldbody><camera/><body name="a"><joint/><geom name="g" size=".1"/><site/></body>
  <body pos="3 0 0"><joint name="j" type="slide"/><geom name="h" size=".1"/><geom size=".1"/>
    <site name="s"/><site name="s2"/></body></worldbody>
  <contact><pair geom1="g" geom2="h"/></contact>
  <tendon><fixed><joint joint="j" coef="1"/></fixed><spatial><site site="s"/><site site="s2"/></spatial>
    <fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>
  <equality><connect body1="a" anchor="0 0 0"/><weld name="w" body1="a"/><joint joint1="j"/><tendon tendon1="t"/>
    <weld site1="s" site2="s2"/></equality>
  <actuator><motor joint="j"/><motor tendon="t"/></actuator></mujoco>"""
CALLED = {
    ("equality", 0): "equality 0 (connect of body 'a' and body 'world')",
    ("equality", 1): "equality 'w'",
    ("equality", 2): "equality 2 (joint of joint 'j')",
    ("equality", 3): "equality 3 (tendon of tendon 't')",
    ("equality", 4): "equality 4 (weld of site 's' and site 's2')",
    ("tendon", 0): "tendon 0 (fixed, of joint 'j')",
    ("tendon", 1): "tendon 1 (spatial, from site 's')",
    ("actuator", 0): "actuator 0 (of joint 'j')",
    ("actuator", 1): "actuator 1 (of tendon 't')",
    ("pair", 0): "pair 0 (of geom 'g' and geom 'h')",
    ("joint", 0): "joint 0 (hinge of body 'a')",
    ("site", 0): "site 0 (of body 'a')",
    ("camera", 0): "camera 0 (of body 'world')",
    ("geom", 2): "an unnamed sphere of body 2, which has no name",
    ("body", 2): "body 2",
}


def test_elements_without_names():
    """They are called by what they are in MJCF, and of what."""
    model = mujoco.MjModel.from_xml_string(ELEMENTS)
    assert {of: names.element(model, *of) for of in CALLED} == CALLED
    assert element_name(model, "eq_data", 2 * model.eq_data.shape[1]) == "eq_data of equality 2 (joint of joint 'j')"
    assert element_name(model, "qpos0", 1) == "qpos0 of joint 'j'"
    assert element_name(model, "dof_armature", 0) == "dof_armature of joint 0 (hinge of body 'a')"


@pytest.mark.parametrize("make", [mja.ArenaRanges, mja.ArenaRanges()._replace])
def test_quantities_that_there_are_not(make):
    """A wrong name is answered with the nearest, or with all that there are."""
    with pytest.raises(
        TypeError, match=r"^'table_offset' is no quantity of ArenaRanges: did you mean 'table_offsets'\?$"
    ):
        make(table_offset=mja.Fixed(1))
    known = ", ".join(mja.ArenaRanges._fields)
    with pytest.raises(
        TypeError,
        match=r"^'table_heights' is no quantity of ArenaRanges: heights of tables are the z of 'table_offsets'\.$",
    ):
        mja.ArenaRanges(table_heights=mja.Uniform(0.7, 0.9))
    with pytest.raises(TypeError, match=rf"^'gravity' is no quantity of ArenaRanges, whose names are {known}\.$"):
        make(gravity=mja.Fixed(1))


def test_ranges_are_a_named_tuple():
    """As one they are copied, pickled, traced and described."""
    ranges = mja.ArenaRanges(mja.Uniform(0, 1), has_legs=mja.Bernoulli(0.5))
    for same in (copy.deepcopy(ranges), pickle.loads(pickle.dumps(ranges)), jax.tree.map(lambda x: x, ranges)):
        assert isinstance(same, mja.ArenaRanges)
        assert same == ranges
    assert list(inspect.signature(mja.ArenaRanges).parameters) == list(mja.ArenaRanges._fields)


def test_where_there_are_none():
    """An arena without quantities of `vary` says what makes them."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    ranges = mja.ArenaRanges(terms={"mass": mja.Fixed(1.0)})
    with pytest.raises(
        ValueError, match=r"no quantity 'mass', nor any other: `arena.vary` and `arena.add_part` make them\.$"
    ):
        arena.check_ranges(ranges)
    with pytest.raises(
        ValueError, match=r"^`quantity` must be a quantity of `vary`, of which the arena has none, got 'mass'\.$"
    ):
        arena.elements("mass")


def test_in_a_line():
    """An arena prints what is in it, without being compiled."""
    arena = mja.TableArena(objects=[mja.Object("cube"), mja.Object("ball", "sphere", 0.06)])
    assert repr(arena) == "<TableArena: 1 table, 2 objects>"
    arena.add_part(mja.furniture.Bin("bin", pos=(2, 0, 0)))
    arena.vary(colour=mja.dr.Term("geom.rgba", "floor"))
    n = len(arena.quantities)
    assert repr(arena) == f"<TableArena: 1 table, 2 objects, 1 part of furniture, {n} quantities>"
    assert not arena.is_compiled
    assert repr(mja.Arena.from_xml("<mujoco/>")) == "<Arena: nothing>"
