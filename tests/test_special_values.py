"""Numbers that MuJoCo's compiler takes for something else, such as "not given", and elements that it moves or fits itself."""

import re

import jax
import mujoco
import numpy as np
import pytest
import worlds
from mujoco import mjx
from whole import differing

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.params.params import with_values

SPRUNG = """<mujoco><worldbody><light name="l"/><site name="w" pos="0 0 2"/><body name="b" pos="0 0 1"><joint name="j" axis="0 1 0"/>
<geom size=".1" pos=".1 0 0"/><site name="s" pos=".3 .1 0"/></body></worldbody><tendon>
<fixed name="fixed" actuatorfrcrange="-1 1"><joint joint="j" coef="2"/></fixed>
<spatial name="spatial"><site site="w"/><site site="s"/></spatial></tendon></mujoco>"""
NONE_GIVEN = "the first number must not exceed the second, nor may both be -1, which MuJoCo takes for none"
AROUND = "the first number must be below the second, and 0 between them"


def exactly(text):
    """A pattern of this text alone."""
    return f"^{re.escape(text)}$"


def world(attribute, element, values, axes=None):
    """An arena in which an attribute varies, and the parameters with other numbers of these axes."""
    arena = mja.Arena.from_xml(SPRUNG)
    arena.vary(x=dr.Term(attribute, element, axes))
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    return arena, with_values(nominal, {"x": np.array([values], float)})


@pytest.mark.parametrize(
    ("attribute", "element", "values", "said"),
    [
        ("tendon.springlength", "fixed", [-1, -1], NONE_GIVEN),
        ("tendon.springlength", "spatial", [-1, -1], NONE_GIVEN),
        ("tendon.springlength", "fixed", [0.2, 0.1], NONE_GIVEN),
        ("tendon.actfrcrange", "fixed", [1, 2], AROUND),
        ("tendon.actfrcrange", "fixed", [-2, -1], AROUND),
    ],
)
def test_flagged(attribute, element, values, said):
    """A world with such a pair is not valid, and ranges that give nothing else are refused."""
    arena, params = world(attribute, element, values)
    whose = f"of tendon '{element}': {said}, got {np.array(values, float).tolist()}."
    assert arena.problems(params) == [f"`terms.x` {whose}"]
    assert not bool(arena.valid(params))
    with pytest.raises(ValueError, match=exactly(f"`ranges.terms.x` {whose}")):
        arena.sample_params(mja.world_keys(0, [0])[0], mja.ArenaRanges(terms={"x": mja.Fixed(values)}))


@pytest.mark.parametrize(
    ("attribute", "element", "values", "axes"),
    [
        ("tendon.springlength", "fixed", [-1, 0], None),
        ("tendon.springlength", "fixed", [-0.5, -0.5], None),
        ("tendon.springlength", "fixed", [-2, -1], None),
        ("tendon.springlength", "fixed", [-0.1, 0], ("low",)),
        ("tendon.actfrcrange", "fixed", [0, 2], None),
        ("light.dir", "l", [0, 0, -1e-6], None),
        ("joint.axis", "j", [1e-6, 0, 0], None),
    ],
)
def test_exact(attribute, element, values, axes):
    """Their neighbours are what MuJoCo compiles, those of one axis, too, where the compiler had measured both."""
    arena, params = world(attribute, element, values, axes)
    assert not arena.problems(params)
    compiled = arena.compile(params)
    got, want = arena.apply(arena.put_model("jax"), params), mjx.put_model(compiled, impl="jax")
    assert differing(compiled, worlds.leaves(got), worlds.leaves(want)) == set()


@pytest.mark.parametrize(("attribute", "element"), [("light.dir", "l"), ("joint.axis", "j")])
def test_short(attribute, element):
    """Vectors that are too short for the compiler."""
    arena, params = world(attribute, element, [0, 0, 1e-7])
    kind = attribute.partition(".")[0]
    assert arena.problems(params) == [f"`terms.x` of {kind} '{element}' must have a length, got [0.0, 0.0, 1e-07]."]
    arena, params = world(attribute, element, [0, 0, 4e-7])
    arena.compile(params)


FITTED = """<mujoco><asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset><worldbody><body name="b" pos="0 0 1"><joint/>
<geom name="g" type="box" mesh="m"/><geom name="own" size=".1"/><geom name="mesh" type="mesh" mesh="m"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("attribute", ["geom.pos", "geom.rpy", "geom.size"])
def test_fitted(attribute):
    """A geom that the compiler fits to a mesh; patterns leave it out."""
    why = "the compiler fits it to a mesh: use a primitive shape"
    with pytest.raises(ValueError, match=exactly(f"`x.elements`: '{attribute}' of geom 'g' cannot vary, as {why}.")):
        mja.Arena.from_xml(FITTED).vary(x=dr.Term(attribute, "g"))
    arena = mja.Arena.from_xml(FITTED)
    arena.vary(x=dr.Term(attribute))
    assert arena.mj_model.ngeom == 3
    assert arena.record.parts.varied[0].elements == (("own",) if attribute == "geom.size" else ("own", "mesh"))


ALIGNED = """<mujoco><compiler alignfree="{}"/><worldbody><body name="b" pos="0 0 1"><freejoint align="{}"/>
<geom name="g" type="box" size=".1 .2 .3" pos=".1 .2 .3" euler="10 20 30"/><geom name="h" size=".1"/><site name="s" pos=".1 0 0"/>
<camera name="c"/><light name="l"/></body></worldbody></mujoco>"""
ON_ALIGNED = {
    **dict.fromkeys(
        [
            "body.mass",
            "body.mass_alone",
            "body.inertia",
            "body.pos",
            "body.rpy",
            "body.ipos",
            "body.payload",
            "body.pseudo_inertia",
        ],
        "b",
    ),
    **dict.fromkeys(["geom.pos", "geom.rpy", "geom.size", "geom.density"], "g"),
    **{"site.pos": "s", "site.rpy": "s", "camera.pos": "c", "camera.rpy": "c", "light.pos": "l", "light.dir": "l"},
}


@pytest.mark.parametrize("attribute", ON_ALIGNED)
def test_aligned(attribute):
    """What has a place on a body that the compiler turns to its inertia, or moves that: by one sentence."""
    kind, name = attribute.partition(".")[0], ON_ALIGNED[attribute]
    for rules in (("false", "true"), ("true", "auto")):
        why = 'the body is free and aligned with its inertia: set `align="false"` of its free joint'
        with pytest.raises(
            ValueError, match=exactly(f"`x.elements`: '{attribute}' of {kind} '{name}' cannot vary, as {why}.")
        ):
            mja.Arena.from_xml(ALIGNED.format(*rules)).vary(x=dr.Term(attribute, name))
    arena = mja.Arena.from_xml(ALIGNED.format("true", "false"))
    arena.vary(x=dr.Term(attribute, name))


@pytest.mark.parametrize("attribute", ["body.gravcomp", "geom.friction", "body.start_pos"])
def test_not_of_the_frame(attribute):
    """What has no part in the frame of an aligned body varies."""
    arena = mja.Arena.from_xml(ALIGNED.format("false", "true"))
    arena.vary(x=dr.Term(attribute))
    assert isinstance(arena.mj_model, mujoco.MjModel)
    arena = mja.Arena.from_xml(
        ALIGNED.format("false", "true").replace("<light", '<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/><light')
    )
    arena.vary(x=dr.Term("geom.size"))
    assert isinstance(arena.mj_model, mujoco.MjModel)


FLEX = """<mujoco><worldbody><body name="own" pos="0 0 1"><joint name="own" damping=".1"/><geom size=".1"/></body>
<flexcomp name="f" type="grid" count="2 2 1" spacing=".1 .1 .1" radius=".01" mass="1" dim="2">
<edge equality="true"/></flexcomp></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("attribute", "part", "why"),
    [
        ("joint.damping", "f_0/joint0", "it moves a part of a flex, to which MuJoCo gives no damping of joints: "),
        ("joint.dampingpoly", "f_0/joint0", "it moves a part of a flex, to which MuJoCo gives no damping of joints: "),
        ("body.pos", "f_0", "it is a part of a flex, whose edges would be others: "),
        ("body.rpy", "f_0", "it is a part of a flex, whose edges would be others: "),
    ],
)
def test_flexes(attribute, part, why):
    """Joints and bodies of flexes, which MuJoCo makes: patterns leave them out, and a name is told why."""
    kind = attribute.partition(".")[0]
    said = f"`x.elements`: '{attribute}' of {kind} '{part}' cannot vary, as {why}"
    with pytest.raises(ValueError, match=f"^{re.escape(said)}"):
        mja.Arena.from_xml(FLEX).vary(x=dr.Term(attribute, part))
    arena = mja.Arena.from_xml(FLEX)
    arena.vary(x=dr.Term(attribute, ".*"))
    assert arena.record.parts.varied[0].elements == ("own",)


CARRIED = """<mujoco><worldbody><body name="own" pos="0 0 2"><geom size=".1"/></body><body name="base" pos="0 0 1">
<flexcomp name="f" type="grid" count="2 2 1" spacing=".1 .1 .1" radius=".01" mass="1" dim="2"><edge equality="true"/></flexcomp>
</body></worldbody></mujoco>"""


def test_what_carries_a_flex():
    """It may not turn, as the compiler measures the flex along the axes of the world; patterns leave it out."""
    why = "a flex is on it, whose size along the axes of the world would be another: make an arena for each"
    with pytest.raises(ValueError, match=exactly(f"`x.elements`: 'body.rpy' of body 'base' cannot vary, as {why}.")):
        mja.Arena.from_xml(CARRIED).vary(x=dr.Term("body.rpy", "base"))
    for elements in (None, ".*"):
        arena = mja.Arena.from_xml(CARRIED)
        arena.vary(x=dr.Term("body.rpy", elements))
        assert arena.elements("x") == ("own",)
        assert isinstance(arena.mj_model, mujoco.MjModel)


@pytest.mark.parametrize(("count", "dim"), [("2 2 1", 2), ("3 3 3", 3), ("5 1 1", 1)])
def test_what_carries_a_flex_moves(count, dim):
    """The compiler rounds shares of a flex's extents otherwise elsewhere, which was taken for another flex."""
    arena = mja.Arena.from_xml(CARRIED.replace("2 2 1", count).replace('dim="2"', f'dim="{dim}"'))
    arena.vary(x=dr.Term("body.pos", "base"))
    params = with_values(jax.tree.map(np.asarray, arena.nominal_params()), {"x": np.array([[0.1, 0.2, 1.3]])})
    compiled = arena.compile(params)
    got, want = arena.apply(arena.put_model("warp"), params), mjx.put_model(compiled, impl="warp")
    assert differing(compiled, worlds.leaves(got), worlds.leaves(want)) == set()


TIED = """<mujoco><worldbody><site name="w" pos="0 0 1"/><body name="b" pos="0 0 1"><freejoint/><geom size=".1"/>
<site name="s" pos=".1 0 0" euler="10 20 30"/></body></worldbody><equality>{}</equality></mujoco>"""
SITES = '<weld name="e" site1="s" site2="w"/>'
GIVEN = '<weld name="e" body1="b" relpose=".1 .2 .3 1 .2 0 0"/>'


@pytest.mark.parametrize(("weld", "own"), [(SITES, [10]), (GIVEN, [0, 1, 2, 3, 4, 5, 10])])
def test_welds(weld, own):
    """Of welds, neither what sites decide varies nor the quaternion, which the compiler makes one of length 1."""
    arena = mja.Arena.from_xml(TIED.format(weld))
    arena.vary(x=dr.Term("equality.data", "e"))
    assert np.flatnonzero(arena.record.parts.varied[0].mask[0]).tolist() == own
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    params = with_values(nominal, {"x": nominal.terms["x"] * 1.3 + 0.1})
    compiled = arena.compile(params)
    got, want = arena.apply(arena.put_model("warp"), params), mjx.put_model(compiled, impl="warp")
    assert differing(compiled, worlds.leaves(got), worlds.leaves(want)) == set()
    said = "`x.axes` must be axes of 'equality.data' that one of its elements has, got ('6',)."
    with pytest.raises(ValueError, match=exactly(said)):
        mja.Arena.from_xml(TIED.format(weld)).vary(x=dr.Term("equality.data", "e", ("6",)))


UNUSED = {
    '<joint name="e" joint1="j" joint2="k"/>': [0, 1, 2, 3, 4],
    '<connect name="e" body1="b" body2="c" anchor=".1 0 0"/>': [0, 1, 2],
    '<tendon name="e" tendon1="t"/>': [0, 1, 2, 3, 4],
}


@pytest.mark.parametrize("equality", UNUSED)
def test_numbers_that_no_equality_reads(equality):
    """They stay as they are, as MJCF has no place for them: a world can be written and read back."""
    bodies = "".join(
        f'<body name="{b}"><joint name="{j}"/><geom size=".1" pos="{x} 0 0"/></body>' for b, j, x in ("bj1", "ck2")
    )
    tendon = '<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>'
    arena = mja.Arena.from_xml(
        f"<mujoco><worldbody>{bodies}</worldbody>{tendon}<equality>{equality}</equality></mujoco>"
    )
    arena.vary(x=dr.Term("equality.data", "e"))
    assert np.flatnonzero(arena.record.parts.varied[0].mask[0]).tolist() == UNUSED[equality]
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    params = with_values(nominal, {"x": nominal.terms["x"] + 0.1})
    again = mujoco.MjModel.from_xml_string(arena.to_xml(params))
    np.testing.assert_allclose(again.eq_data, arena.compile(params).eq_data, rtol=1e-9)


def test_connected_sites():
    """A connection of sites has no numbers."""
    why = "it connects sites, and has no numbers of its own: vary `site.pos`"
    said = f"`x.elements`: 'equality.data' of equality 'e' cannot vary, as {why}."
    with pytest.raises(ValueError, match=exactly(said)):
        mja.Arena.from_xml(TIED.format('<connect name="e" site1="s" site2="w"/>')).vary(x=dr.Term("equality.data", "e"))
