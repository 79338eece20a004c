"""Elements without a name vary, under names that say what they belong to."""

import collections
import re

import jax
import mujoco
import numpy as np
import pytest
import whole
from models import ARMS

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.spec import automatic

HAND = """<mujoco><worldbody><light pos="0 0 3"/><geom type="plane" size="5 5 .1" pos="0 0 -1"/>
<body name="palm" pos="0 0 .5"><joint axis="0 1 0" damping=".2"/><geom type="box" size=".1 .1 .02"/><camera pos="0 0 .2"/>
<geom name="nail" size=".01" pos="0 0 .05"/><geom type="capsule" size=".01 .03" pos=".05 0 .05"/><site pos="0 0 .1"/>
<body pos=".15 0 0"><joint name="finger" axis="0 1 0" damping=".1"/><geom type="capsule" size=".01 .04" pos=".05 0 0"/>
<geom name="tip" size=".012" pos=".1 0 0"/></body>
<body pos="-.15 0 0"><joint name="thumb" axis="0 1 0" damping=".1"/><geom size=".02"/></body></body></worldbody>
<tendon><fixed stiffness="1"><joint joint="finger" coef="1"/><joint joint="thumb" coef="-1"/></fixed></tendon>
<equality><joint joint1="thumb" joint2="finger" polycoef="0 .5 0 0 0"/></equality>
<contact><pair geom1="tip" geom2="nail" margin=".01"/></contact>
<actuator><position joint="finger" kp="10"/><motor joint="thumb"/><position joint="finger" kp="5"/></actuator></mujoco>"""
SELECTED = {
    "body.mass": ("palm", "palm/body0", "palm/body1"),
    "geom.friction": ("world/geom0", "palm/geom0", "nail", "palm/geom1", "palm/body0/geom0", "tip", "palm/body1/geom0"),
    "joint.damping": ("palm/joint0", "finger", "thumb"),
    "site.pos": ("palm/site0",),
    "camera.fovy": ("palm/camera0",),
    "light.pos": ("world/light0",),
    "tendon.stiffness": ("finger/tendon0",),
    "actuator.kp": ("finger/actuator0", "finger/actuator1"),
    "equality.data": ("thumb/equality0",),
    "pair.margin": ("tip/pair0",),
}


def varied(arena, *attributes, **more):
    """The arena, in which these vary of all elements that can."""
    arena.vary(**{a.replace(".", "_"): dr.Term(a, **more) for a in attributes})
    return arena


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_all_kinds(impl):
    """Every kind has names by what its elements belong to, and varies as MuJoCo compiles it."""
    arena = varied(mja.Arena.from_xml(HAND), *SELECTED)
    assert {a: arena.elements(a.replace(".", "_")) for a in SELECTED} == SELECTED
    whole.hold(arena, impl)


def test_names_come_with_terms():
    """Elements that no term selects stay without a name, and numbers do not change when some have got theirs."""
    arena = mja.Arena.from_xml(HAND)
    arena.vary(x=dr.Term("geom.friction", "palm/geom1"))
    assert [g.name for g in arena.spec.geoms if g.name] == ["nail", "palm/geom1", "tip"]
    arena.vary(y=dr.Term("geom.friction"), z=dr.Term("geom.rgba"))
    assert arena.elements("y") == tuple(name for name in SELECTED["geom.friction"] if name != "palm/geom1")
    assert arena.elements("z") == SELECTED["geom.friction"]


def test_names_that_are_taken():
    """An element of the user's has such a name already: it is left out."""
    arena = varied(mja.Arena.from_xml(HAND.replace('name="nail"', 'name="palm/geom0"')), "geom.friction")
    assert arena.elements("geom_friction")[1:4] == ("palm/geom1", "palm/geom0", "palm/geom2")


@pytest.mark.parametrize(
    ("bodies", "elements", "found"),
    [
        ("palm", None, ("palm/geom0", "nail", "palm/geom1")),
        (["palm/.*"], None, ("palm/body0/geom0", "tip", "palm/body1/geom0")),
        ("world", None, ("world/geom0",)),
        (["palm/body1", "palm"], ".*geom0", ("palm/geom0", "palm/body1/geom0")),
    ],
)
def test_by_bodies(bodies, elements, found):
    arena = mja.Arena.from_xml(HAND)
    arena.vary(grip=dr.Term("geom.friction", elements, bodies=bodies))
    assert arena.elements("grip") == found


WRONG = {
    "kind": (
        dr.Term("actuator.kp", bodies="palm"),
        "`x.bodies` must be None for 'actuator.kp', as only geoms, joints, sites, cameras and lights belong to a body, got 'palm'.",
    ),
    "body": (
        dr.Term("body.mass", bodies="palm"),
        "`x.bodies` must be None for 'body.mass', as only geoms, joints, sites, cameras and lights belong to a body, got 'palm': "
        "give `elements`.",
    ),
    "type": (
        dr.Term("geom.size", bodies=3),
        "`x.bodies` must be a name, a regular expression or a list of them, got 3.",
    ),
    "unknown": (
        dr.Term("geom.size", bodies="plam"),
        "`x.bodies`: no body is called 'plam', as a name or a regular expression: did you mean `palm`?",
    ),
    "pattern": (
        dr.Term("geom.size", bodies="("),
        "`x.bodies`: no body is called '(', nor is it a valid regular expression: missing ), unterminated subpattern at position 0.",
    ),
    "nothing": (dr.Term("camera.fovy", bodies="palm/body0"), "`x.bodies`: no camera belongs to body 'palm/body0'."),
    "nothing on some": (
        dr.Term("camera.fovy", bodies=["palm/body0", "palm/body1"]),
        "`x.bodies`: no camera belongs to bodies 'palm/body0', 'palm/body1'.",
    ),
    "none can": (
        dr.Term("geom.size", bodies="world"),
        "`x.elements`: the arena has no geom of body 'world' whose 'geom.size' can vary: it is a plane, whose size MJX shares "
        "between worlds: use a primitive shape ('world/geom0').",
    ),
    "elsewhere": (
        dr.Term("geom.size", "tip", bodies=["palm"]),
        "`x.elements`: no geom of body 'palm' is called 'tip', as a name or a regular expression; known are palm/geom0, nail, "
        "palm/geom1.",
    ),
    "near": (
        dr.Term("geom.size", "palm/geom2"),
        "`x.elements`: no geom is called 'palm/geom2', as a name or a regular expression: did you mean `palm/geom1`?",
    ),
    "cannot": (
        dr.Term("actuator.kp", "thumb/actuator0"),
        "`x.elements`: 'actuator.kp' of actuator 'thumb/actuator0' cannot vary, as it is a motor, which has no `kp`: vary "
        "`actuator.gainprm`.",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong(case):
    """One sentence each, and the arena stays as it was."""
    term, sentence = WRONG[case]
    arena = mja.Arena.from_xml(HAND)
    before = arena.xml
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        arena.vary(x=term)
    assert arena.xml == before


QUANTITIES = ("geom.friction", "body.mass", "joint.damping", "light.pos", "actuator.kp", "tendon.stiffness")
RANGES = {a.replace(".", "_"): mja.Uniform(0.5, 1.5, relative="scale") for a in QUANTITIES}


def draws(arena):
    """(name of an element, quantity) -> its numbers in one world, of the arena in which all varies."""
    drawn = arena.sample_params(mja.world_keys(4, [1])[0], mja.ArenaRanges(terms=RANGES)).terms
    return {
        (name, quantity): tuple(np.ravel(row).tolist())
        for quantity, rows in drawn.items()
        for name, row in zip(arena.elements(quantity), rows, strict=True)
    }


def attached(*prefixes, change=lambda spec: None, first=""):
    """Numbers of hands on a floor, in whose MJCF something was changed."""
    arena = mja.Arena.from_xml(f"<mujoco><worldbody>{first}</worldbody></mujoco>")
    for x, prefix in enumerate(prefixes):
        hand = mujoco.MjSpec.from_string(HAND)
        if prefix == "b_":
            change(hand)
        arena.attach(hand, prefix, pos=(0, 0, 0) if prefix == "b_" else (x + 1, 0, 0))
    return draws(varied(arena, *QUANTITIES))


def test_draws_do_not_depend_on_what_else_is_there():
    """Neither another robot, nor other things of the world, nor an element of another body changes the draw of one."""
    both = attached("a_", "b_", first='<light/><geom type="plane" size="1 1 .1"/>')
    alone = attached("b_")
    assert ("b_world/geom0", "geom_friction") in alone
    assert ("b_world/light0", "light_pos") in alone
    assert ("b_finger/tendon0", "tendon_stiffness") in alone
    assert {who: both[who] for who in alone} == alone
    assert (
        len({both[name.replace("b_", "a_", 1), q] == x for (name, q), x in alone.items() if q == "geom_friction"}) == 1
    )

    def without(spec):
        spec.delete(spec.body("palm").geoms[0])

    less = attached("b_", change=without)
    gone = {("b_palm/geom1", "geom_friction")}  # the last of that body
    of_body = {("b_palm/geom0", "geom_friction"), ("b_palm", "body_mass")}  # whose nominal numbers are others
    assert alone.keys() - less.keys() == gone
    assert {who: x for who, x in less.items() if who not in of_body} == {
        who: x for who, x in alone.items() if who not in of_body | gone
    }


def test_the_same_from_a_file(tmp_path):
    """The arena of a file, of its MJCF and of a spec draws the same worlds, and so do arenas merged under a prefix."""
    arena = varied(mja.Arena.from_xml(HAND), *QUANTITIES)
    want = draws(arena)
    saved = varied(mja.Arena.from_xml(HAND), *QUANTITIES)
    saved.vary(soft=dr.Term("geom.solref", bodies=["palm/.*"]))
    mja.save(tmp_path / "hand.yaml", saved, mja.ArenaRanges(terms=RANGES))
    again, _ = mja.load(tmp_path / "hand.yaml")
    assert again.record == saved.record
    assert again.elements("soft") == ("palm/body0/geom0", "tip", "palm/body1/geom0")
    saved.export(saved.nominal_params(), tmp_path / "world")
    found = mujoco.MjModel.from_xml_path(str(tmp_path / "world" / "world.xml"))
    assert found.geom("palm/body1/geom0").id == saved.mj_model.geom("palm/body1/geom0").id
    world = arena.to_xml(arena.nominal_params())
    assert draws(varied(mja.Arena.from_xml(mujoco.MjSpec.from_string(HAND)), *QUANTITIES)) == want
    some = mja.Arena.from_xml(HAND)
    some.vary(x=dr.Term("geom.friction", ".*geom1"), y=dr.Term("body.mass", "palm/body1"))
    for xml in (world, some.to_xml(some.nominal_params())):
        found = draws(varied(mja.Arena.from_xml(xml), *QUANTITIES))
        assert found.keys() == want.keys()
        for who, numbers in found.items():
            np.testing.assert_allclose(numbers, want[who], rtol=1e-5, atol=1e-12)


def test_merged():
    """The other arena's elements have its prefix, those of its world, too."""
    merged = mja.Arena.from_xml(HAND).merge(mja.Arena.from_xml(HAND), "b_", pos=(3, 0, 0))
    found, alone = draws(varied(merged, *QUANTITIES)), attached("b_")
    same = [who for who in alone if who[1] != "light_pos"]  # which moved
    assert ("world/geom0", "geom_friction") in found
    assert {who: found[who] for who in same} == {who: alone[who] for who in same}


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_objects(impl):
    """Geoms without a name of an object's file vary in what the object does not decide, and are those that MuJoCo compiles."""
    file = mujoco.MjSpec.from_string(
        """<mujoco><worldbody><geom type="box" size=".04 .04 .02"/><body name="lid" pos="0 0 .03"><geom size=".01"/>
        <geom size=".01" pos=".02 0 0"/></body></worldbody></mujoco>"""
    )
    arena = mja.TableArena(objects=[mja.Object("pot", "mjcf", file=file)])
    arena.vary(soft=dr.Term("geom.solref", "pot_.*"), lid=dr.Term("geom.solimp", bodies="pot_lid"))
    assert arena.elements("soft") == ("pot_world/geom0", "pot_lid/geom0", "pot_lid/geom1")
    assert arena.elements("lid") == ("pot_lid/geom0", "pot_lid/geom1")
    whole.hold(arena, impl)


STANDS = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/><body name="base"><geom name="base" size=".1"/>
<body name="arm" pos="0 0 .2"><joint name="arm" axis="0 1 0" damping="1"/><geom name="arm" type="capsule" fromto="0 0 0 0 0 .3" size=".02"/>
</body></body><body name="door" pos="1 0 .5"><joint name="door" damping="2"/><geom name="door" size=".1"/></body></worldbody>
<actuator><motor name="arm" joint="arm"/></actuator></mujoco>"""


def test_a_preset_is_of_what_actuators_move():
    """Not of tables, objects and doors; a base that never moves has a friction, and no mass that matters."""
    arena = mja.MultiTableArena(table_offsets=[(0, 2, 0.8)], objects=[mja.Object("cube")])
    arena.attach(STANDS)
    terms = dr.robot(arena.spec).terms
    assert {name: term.elements for name, term in terms.items()} == dict.fromkeys(
        ("mass", "com", "damping", "motor", "friction"), ("robot_arm",)
    )
    named = dr.robot(mja.Arena.from_xml(STANDS.replace('name="base"', 'name="arm_base"')).spec, "arm").terms
    assert named["armmass"].elements == ("arm",)
    assert set(named["armfriction"].elements) == {"arm", "arm_base"}


def test_a_preset_of_a_hand():
    """The fingers of a hand whose geoms have no names get other frictions in each world."""
    arena = mja.Arena.from_xml(ARMS["shadow_hand"])
    preset = dr.robot(arena.spec)
    arena.vary(**preset.terms)
    names, model = arena.elements("friction"), arena.mj_model
    fingers = [name for name in names if "distal" in name]
    touches, moves = model.geom_contype | model.geom_conaffinity, model.body_weldid[model.geom_bodyid] > 0
    assert len(names) == np.count_nonzero(touches * moves) > np.count_nonzero(touches) - 3  # not the forearm's
    assert len(fingers) == 5
    keys = mja.world_keys(0, range(8))
    drawn = jax.vmap(lambda key: arena.sample_params(key, mja.ArenaRanges(terms=preset.ranges)))(keys).terms
    sliding = drawn["friction"][..., 0] / arena.nominal_params().terms["friction"][:, 0]
    assert np.unique(sliding).size == sliding.size
    assert 0.7 <= sliding.min() < 0.75
    assert 1.25 < sliding.max() <= 1.3


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:`robot`. geoms are inside each other")
def test_two_hands():
    """The same robot twice: each has its own friction of fingers, and the worlds are those that MuJoCo compiles."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    for x, prefix in ((-1, "left_"), (1, "right_")):
        arena.attach(ARMS["shadow_hand"], prefix, pos=(x, 0, 1))
    presets = [dr.robot(arena.spec, prefix) for prefix in ("left_", "right_")]
    for preset in presets:
        arena.vary(**preset.terms)
    left, right = (arena.elements(f"{prefix}friction") for prefix in ("left_", "right_"))
    assert [name.replace("left_", "right_", 1) for name in left] == list(right)
    ranges = mja.ArenaRanges(terms=presets[0].ranges | presets[1].ranges)
    drawn = arena.sample_params(mja.world_keys(0, [0])[0], ranges).terms
    both = np.concatenate([drawn["left_friction"][:, 0], drawn["right_friction"][:, 0]])
    assert np.unique(both).size == 60
    whole.hold(arena, "warp")


def test_a_preset_leaves_out_much():
    """Numbers that are 0 cannot be scaled, and friction of geoms that are only seen has no effect: nothing is amiss."""
    link = '<body name="link"><joint name="hinge" damping="1"/><geom size=".1" contype="0" conaffinity="0"/></body>'
    motor = '<actuator><motor joint="hinge"/></actuator>'
    arena = mja.Arena.from_xml(f"<mujoco><worldbody>{link}</worldbody>{motor}</mujoco>")
    assert list(dr.robot(arena.spec).terms) == ["mass", "com", "damping", "motor"]


def test_a_preset_says_what_cannot_vary():
    """A mass that the robot has, and that follows from its geoms for good."""
    arena = mja.Arena.from_xml(ARMS["ant"])
    said = '`spec`: the preset leaves out mass and com, as the compiler takes it from the geoms: set `inertiafromgeom="auto"` '
    with pytest.warns(UserWarning, match=f"^{re.escape(said)}") as warned:
        assert list(dr.robot(arena.spec).terms) == ["armature", "damping", "motor", "friction"]
    assert str(warned[0].message).endswith("(body 'torso').")


EVERY = {
    "body": "body.pos",
    "geom": "geom.rgba",
    "light": "light.diffuse",
    "actuator": "actuator.gear",
    "equality": "equality.data",
}
"""Attributes that all elements of a kind have."""
UNNAMED = {
    "panda": {"geom": (83, 87), "equality": (3, 3)},
    "yam": {"geom": (19, 56), "equality": (1, 1)},
    "go1": {"geom": (13, 43), "light": (1, 1)},
    "g1": {"geom": (35, 68), "light": (1, 1)},
    "2f85": {"geom": (24, 28), "equality": (3, 3)},
    "ur5e": {"geom": (29, 29)},
    "shadow_hand": {"geom": (62, 62)},
    "ant": {"body": (4, 13), "actuator": (8, 8), "light": (1, 1)},
}
"""How many elements robots have without a name, and how many in all."""


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS)
def test_all_of_robots(name):
    """All vary. `test_dr.test_everything_of_robots` holds them against the compiler."""
    spec = mujoco.MjSpec.from_file(str(ARMS[name]))
    given = collections.Counter(kind for kind, _ in automatic.give(spec))
    model = spec.compile()
    found = {kind: (n, len(dr.Term(EVERY[kind]).select(spec, model)[0])) for kind, n in given.items()}
    assert found == UNNAMED[name]
