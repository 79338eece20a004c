"""Names in messages: of geoms and bodies with and without one, of tables, and of quantities."""

import copy
import inspect
import pickle
import re

import jax
import mujoco
import numpy as np
import pytest
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas import keywords, strict
from mjx_arenas.checks import watch_c
from mjx_arenas.preflight import elements
from mjx_arenas.spec import automatic, names, objects
from mjx_arenas.terms.owned import element_name

SCENE = """<mujoco><worldbody><body name="counter" pos="0 0 .8">
    <geom name="top_left" type="box" size=".3 .4 .02" pos="-.4 0 0"/>
    <geom name="top_right" type="box" size=".3 .4 .02" pos=".4 0 0"/></body>
  <body name="shelf" pos="0 2 .5"><geom name="board" type="box" size=".4 .4 .02"/></body>
  <body pos="0 -2 .5"><geom name="nameless" type="box" size=".4 .4 .02"/></body>
  <body name="rack" pos="0 -4 .5"><geom type="box" size=".4 .4 .02"/><geom type="box" size=".4 .4 .02" pos="0 0 .3"/></body>
  </worldbody></mujoco>"""
WRONG = {
    (
        "shelf",
        "board",
    ): "`tables`: 'shelf' and 'board' name the same slab, that of 'shelf', which can be only one table.",
    ("shelf", "shelf"): "`tables`: 'shelf' is listed twice.",
    ("rack",): (
        "`tables`: 'rack' has 2 boxes that collide, and exactly one must be its slab: give that geom's name. Its "
        "geoms: an unnamed box, an unnamed box."
    ),
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
    box = r"an unnamed box of body 'world/body0' \(unnamed\)"
    with pytest.raises(ValueError, match=rf"geoms an unnamed cylinder of the world \(cylinder\) and {box}"):
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
    ("geom", 2): "an unnamed sphere of body 'world/body0' (unnamed)",
    ("body", 2): "body 'world/body0' (unnamed)",
}


def test_elements_without_names():
    """They are called by what they are in MJCF, and of what."""
    model = mujoco.MjModel.from_xml_string(ELEMENTS)
    assert {of: names.element(model, *of) for of in CALLED} == CALLED
    assert element_name(model, "eq_data", 2 * model.eq_data.shape[1]) == "eq_data of equality 2 (joint of joint 'j')"
    assert element_name(model, "qpos0", 1) == "qpos0 of joint 'j'"
    assert element_name(model, "dof_armature", 0) == "dof_armature of joint 0 (hinge of body 'a')"


UNNAMED_BODIES = """<mujoco><worldbody><body/><body name="a"><body name="a/body0"/><body/><body><body/></body></body>
  <body><body name="b"/><body/></body></worldbody></mujoco>"""


def test_bodies_without_names():
    """They are called by what they hang on, as a term that selects them calls them."""
    spec = mujoco.MjSpec.from_string(UNNAMED_BODIES)
    model = spec.compile()
    put = mjx.put_model(model)
    automatic.give(spec)
    given = [body.name for body in spec.bodies]
    assert given[:7] == ["world", "world/body0", "a", "a/body0", "a/body1", "a/body2", "a/body2/body0"]
    assert given[7:] == ["world/body1", "b", "world/body1/body0"]
    named = ("world", "a", "a/body0", "b")
    called = [repr(name) if name in named else f"{name!r} (unnamed)" for name in given]
    assert [names.element(model, "body", i) for i in range(model.nbody)] == [f"body {name}" for name in called]
    assert [elements.body(put, i) for i in range(model.nbody)] == called
    assert elements.called(put, "body", 1) == "body 'world/body0' (unnamed)"
    assert elements.number(put, "body_mass", (6,)) == "'a/body2/body0' (unnamed)"


@pytest.mark.parametrize("make", [mja.ArenaRanges, mja.ArenaRanges()._replace])
def test_quantities_that_there_are_not(make):
    """A wrong name is answered with the nearest, or with all that there are."""
    with pytest.raises(
        TypeError, match=r"^'table_offset' is no quantity of ArenaRanges: did you mean 'table_offsets'\?$"
    ):
        make(table_offset=mja.Fixed(1))
    others = ", ".join(name for name in mja.ArenaRanges._fields if name != "terms")
    with pytest.raises(
        TypeError,
        match=r"^'table_heights' is no quantity of ArenaRanges: heights of tables are the z of 'table_offsets'\.$",
    ):
        mja.ArenaRanges(table_heights=mja.Uniform(0.7, 0.9))
    given = r"one of `vary` is given as terms=\{'gravity': \.\.\.\}, and the others are "
    with pytest.raises(TypeError, match=rf"^'gravity' is no quantity of ArenaRanges: {given}{others}\.$"):
        make(gravity=mja.Fixed(1))
    with pytest.raises(TypeError, match=r"^'table_rot' is no quantity of ArenaParams: did you mean 'table_rots'\?$"):
        mja.TableArena().nominal_params()._replace(table_rot=1)


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("body.weight", "body.mass"),
        ("geom.color", "geom.rgba"),
        ("material.colour", "material.rgba"),
        ("light.color", "light.diffuse"),
        ("body.position", "body.pos"),
        ("site.location", "site.pos"),
        ("body.rotation", "body.rpy"),
        ("camera.orientation", "camera.rpy"),
        ("body.velocity", "body.start_vel"),
        ("joint.velocity", "joint.qvel"),
        ("joint.angle", "joint.qpos"),
        ("body.com", "body.ipos"),
        ("light.direction", "light.dir"),
        ("actuator.stiffness", "actuator.kp"),
    ],
)
def test_attributes_in_other_words(given, meant):
    """A term's attribute is found by what others call it."""
    with pytest.raises(ValueError, match=rf": did you mean `{re.escape(meant)}`\?$"):
        mja.TableArena().vary(x=mja.dr.Term(given))


PUBLIC = [name for name in mja.__all__ if inspect.isfunction(getattr(mja, name))]


@pytest.mark.parametrize("name", PUBLIC)
def test_unknown_arguments_of_functions(name):
    """Each public function answers one with the names that it has."""
    with pytest.raises(TypeError, match=f"^{name} has no argument 'zzz'; there (is|are) "):
        getattr(mja, name)(zzz=0)


def test_other_words_offer_what_is_there():
    """An object's rotation is `rot`, a body's `rpy`; of what has neither, there is the most alike, or none."""
    kinds = (mja.Object, mja.dr.Term, mja.Uniform, mja.Normal, mja.Fixed, mja.Choice)
    arguments = [name for one in kinds for name in inspect.signature(one).parameters]
    known = {*arguments, *(name.rpartition(".")[2] for name in mja.dr.ATTRIBUTES), "Arena.from_xml", *objects.TYPES}
    assert {meant for word in keywords.ALSO_CALLED for meant in keywords.ALSO_CALLED[word]} <= known
    assert keywords.nearest("rotation", ["name", "rot"]) == "rot"
    assert keywords.nearest("weight", ["name", "rot"]) is None
    assert keywords.nearest("Weight", ["weights", "mass"]) == "mass"


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: mja.Object("cube", weight=0.1), "Object has no argument 'weight': did you mean 'mass'?"),
        (lambda: mja.Object("cube", color="red"), "Object has no argument 'color': did you mean 'rgba'?"),
        (lambda: mja.Object("cube", size=0.1), "Object has no argument 'size': did you mean 'full_size'?"),
        (lambda: mja.Place(regions=0), "Place has no argument 'regions': did you mean 'region'?"),
        (lambda: mja.furniture.Shelf("rack", height=1), "Shelf has no argument 'height': did you mean 'heights'?"),
        (lambda: mja.dr.Term("body.mass", names="a"), "Term has no argument 'names': did you mean 'elements'?"),
        (lambda: mja.dr.Term("body.mass", axis="x"), "Term has no argument 'axis': did you mean 'axes'?"),
        (lambda: mja.Workspace(lo=0, high=1), "Workspace has no argument 'lo': did you mean 'low'?"),
        (
            lambda: mja.Normal(mean=0, zzz=1),
            "Normal has no argument 'zzz'; there are mean, std, low, high, relative, tied.",
        ),
        (
            lambda: mja.MultiTableArena(table_offset=[[0, 0, 1]]),
            "MultiTableArena has no argument 'table_offset': did you mean 'table_offsets'?",
        ),
        (
            lambda: mja.Arena.from_xml("", zzz=()),
            "from_xml has no argument 'zzz'; there are xml, tables, objects, table_priority, follow.",
        ),
        (lambda: mja.Normal(mean=0, sigma=1), "Normal has no argument 'sigma': did you mean 'std'?"),
        (lambda: mja.Normal(std=1), "Normal must be given 'mean', 'low' and 'high'."),
        (lambda: mja.Normal(0, 1), "Normal must be given 'low' and 'high'."),
        (
            lambda: mja.Uniform(0, 1, None, False, 3),
            "Uniform takes at most 4 without a name (low, high, relative, tied), got 5.",
        ),
        (lambda: mja.Arena.from_xml(), "from_xml must be given 'xml'."),
        (lambda: mja.TableArena().sample_params(), "sample_params must be given 'key' and 'ranges'."),
        (lambda: mja.TableArena().sample_params(ranges=0), "sample_params must be given 'key'."),
        (
            lambda: mja.TableArena().sample_params(1, 2, 3),
            "sample_params takes at most 2 without a name (key, ranges), got 3.",
        ),
        (lambda: mja.TableArena().randomize(0, 1, rang=2), "randomize has no argument 'rang': did you mean 'ranges'?"),
        (lambda: mja.TableArena().describe(parms=0), "describe has no argument 'parms': did you mean 'params'?"),
        (
            lambda: mja.TableArena().vary(3),
            "vary takes arguments by name alone, as in vary(a=...), got 1 without a name.",
        ),
        (lambda: mja.TableArena().add_camera(pos=(0, 0, 1)), "add_camera must be given 'name'."),
        (lambda: mja.TableArena().compile(), "compile must be given 'params'."),
        (lambda: mja.TableArena().unchanged(0), "unchanged takes no arguments, got 1."),
        (lambda: mja.TableArena().unchanged(of=0), "unchanged has no arguments, got 'of'."),
        (lambda: mja.Arena.from_xml("", table=()), "from_xml has no argument 'table': did you mean 'tables'?"),
        (
            lambda: mja.TableArena().add_camera("c", lookat=(0, 0, 0)),
            "add_camera has no argument 'lookat': did you mean 'look_at'?",
        ),
    ],
)
def test_arguments_that_there_are_not(make, said):
    """So are names of arguments, and those that are left out: no message names an inner class."""
    with pytest.raises(TypeError, match=f"^{re.escape(said)}$"):
        make()


def test_errors_within_a_function_stay():
    """A TypeError that comes from inside is passed on as it is, through decorators that take anything, too."""

    @keywords.with_known_arguments
    @strict.own_constants
    def nothing(one):
        return (lambda two: two)(three=one)

    with pytest.raises(TypeError, match=r"unexpected keyword argument 'three'$"):
        nothing(1)
    with pytest.raises(
        TypeError,
        match=r"^nothing has no argument 'two'; there is one\.$",
    ):
        nothing(two=1)


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
        ValueError,
        match=r"no quantity 'mass'; it has no quantities at all: `arena.vary` and `arena.add_part` make them\.$",
    ):
        arena.check_ranges(ranges)
    several = mja.ArenaRanges(terms=dict.fromkeys(("mass", "com", "kp"), mja.Fixed(1.0)))
    with pytest.raises(
        ValueError, match=r"^`ranges.terms`: the arena has no quantities 'mass', 'com' and 'kp'; it has no"
    ):
        arena.check_ranges(several)
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


DESKS = """<mujoco><worldbody><geom name="floor" type="plane" size="9 9 .1"/><geom name="pillar" type="box" size=".1 .1 .5" pos="3 3 .5"/>
<body name="desk" pos="0 0 .7"><geom name="top" type="box" size=".4 .4 .02"/>
<geom name="leg" type="box" size=".02 .02 .33" pos="0 0 -.35"/></body>
<body name="bench" pos="2 0 .5"><geom name="seat" type="box" size=".3 .3 .02"/></body></worldbody></mujoco>"""
BASE = '<mujoco><worldbody><body name="base"><joint/><geom size=".05" pos="0 0 .06"/></body></worldbody></mujoco>'


def desks():
    """Two tables of a scene, with a robot on one of them, and a shelf."""
    things = [mja.Object("cube", full_size=0.05), mja.Object("plate", full_size=(0.1, 0.1, 0.02), on="bench")]
    arena = mja.Arena.from_xml(DESKS, ["top", "bench"], objects=things, follow=[mja.Follow("leg", z="floor")])
    arena.attach(BASE, "r_", on="bench", pos=(0.2, 0.2, 0))
    arena.add_part(mja.furniture.Shelf("rack", pos=(-2, 0, 0)))
    return arena


WORLDS = {
    "in each other": ({"table_offsets": [[2, 0, 0.5], [2, 0, 0.5]]}, "Tables 'desk' and 'bench' overlap by 0.7 m"),
    "in a pillar": ({"table_offsets": [[3, 3, 0.5], [2, 0, 0.5]]}, "Table 'desk' and 'pillar' overlap by 0.5 m."),
    "in a part": (
        {"table_offsets": [[-2, 0, 0.5], [2, 0, 0.5]]},
        "Table 'desk' and part 'rack' overlap, 'rack_back' by 0.245 m",
    ),
    "too low": ({"table_offsets": [[0, 0, 0.01], [2, 0, 0.5]]}, "Geom 'leg', which follows table 'desk' (`follow`),"),
    "no size": ({"table_full_sizes": [[0.8, 0.8, 0.04], [-1, 1, 1]]}, "`table_full_sizes` of table 'bench' must be "),
    "too small": (
        {"table_full_sizes": [[0.8, 0.8, 0.04], [0.01, 0.6, 0.04]]},
        "Object 'plate' is 0.1 x 0.1 m, larger than table 'bench', which is 0.01 x 0.6 m.",
    ),
    "absent": ({"table_active": [True, False]}, "`params`: table 'bench' is absent, but 'r_mount' is fixed on it."),
}


@pytest.mark.slow
def test_tables_of_scenes_have_names(tmp_path):
    """Sentences about a table that has a name of its own call it by that; of worlds, ranges, warnings and bundles."""
    arena = desks()
    nominal = arena.nominal_params()
    for change, says in WORLDS.values():
        told = arena.problems(nominal._replace(**{name: np.array(x) for name, x in change.items()}))
        assert told[0].startswith(says)
    with pytest.raises(ValueError, match=r"^`ranges.table_active`: table 'bench' can be absent, but 'r_mount' is"):
        arena.check_ranges(mja.ArenaRanges(table_active=mja.Bernoulli(0.5)))
    low = mja.ArenaRanges(table_offsets=mja.Fixed([[3, 3, 0.5], [2, 0, 0.5]]))
    report = mja.check(arena, low, 1, n_steps=2, engine="c")
    report.save_bundle(tmp_path / "bundle", 0)
    found = mja.replay(tmp_path / "bundle").found["invalid_arena"].what
    assert found == report.of(0)["invalid_arena"].what
    assert "Table 'desk' and 'pillar' overlap" in found
    for given, says in (
        ({"pos": (1, 1)}, r"^Object 'x': `pos` \[1.0, 1.0\] is off table 'desk', whose top"),
        ({"full_size": 2.0}, "^Object 'x' is 2 x 2 m, larger than table 'desk'"),
    ):
        with pytest.warns(UserWarning, match=says) if "pos" in given else pytest.raises(ValueError, match=says):
            mja.Arena.from_xml(DESKS, ["top"], objects=[mja.Object("x", **given)])
    merged = mja.MultiTableArena([(0, 0, 0.8)]).merge(mja.Arena.from_xml(DESKS, ["top"]), "m_", pos=(5, 5, 0))
    here = np.tile([0, 0, 0.8], (2, 1))
    (told,) = [p for p in merged.problems(merged.nominal_params()._replace(table_offsets=here)) if "Tables" in p]
    assert told.startswith("Tables 0 and 'm_desk' overlap")
