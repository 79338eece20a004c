"""Where a size varies and the place does not, things float or sink: a warning says which, and how far, as in C."""

import re
import warnings

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.params.params import with_values

SCENE = """<mujoco><asset><mesh name="pyramid" vertex="-.1 -.1 0 .1 -.1 0 -.1 .1 0 .1 .1 0 0 0 .2"/></asset>
<worldbody><geom name="floor" type="plane" size="5 5 .1"/>
<geom name="board" type="box" size=".3 .2 .1" pos="0 0 .2"/>
<body name="cube" pos="0 0 .34"><freejoint/><geom name="cube" type="box" size=".04 .04 .04"/></body>
<body name="lying" pos="1 0 .05" euler="0 90 0"><freejoint/><geom name="lying" type="capsule" size=".05 .2"/></body>
<body name="post" pos="2 0 0"><geom name="post" type="cylinder" size=".05 .3" pos="0 0 .3"/></body>
<geom name="plinth" type="box" size=".2 .2 .05" pos="5 0 .5"/>
<body name="pyramid" pos="5 0 .55"><freejoint/><geom name="pyramid" type="mesh" mesh="pyramid"/></body>
<body name="swings" pos="3 0 .1"><joint axis="0 1 0"/><geom name="swings" size=".1"/></body>
<body name="high" pos="4 0 1"><freejoint/><geom name="high" size=".1"/></body>
<body name="ghost" pos="-1 0 .1"><freejoint/><geom name="ghost" size=".1" contype="0" conaffinity="0" mass="1"/></body>
</worldbody></mujoco>"""
SCALED = mja.Uniform(0.8, 1.3, relative="scale")
TOLD = {  # what varies of which geoms, how: who does what, and what places it
    "a cube": ("cube", None, SCALED, "cube", "board", (0.012, 0.008), "body.start_pos"),
    "what carries it": ("board", "third", mja.Uniform(0.1, 0.13), "cube", "board", (0.03, 0.0), "body.start_pos"),
    "what carries a mesh": (
        "plinth",
        "third",
        mja.Uniform(0.05, 0.06),
        "pyramid",
        "plinth",
        (0.01, 0.0),
        "body.start_pos",
    ),
    "a capsule that lies": ("lying", "first", SCALED, "lying", "floor", (0.015, 0.01), "body.start_pos"),
    "a post": ("post", None, SCALED, "post", "floor", (0.09, 0.06), "geom.pos"),
    "the worst of all": (None, None, SCALED, "post", "floor", (0.09, 0.06), "geom.pos"),
    "the other end": ("post", "second", mja.Fixed(0.25), "post", "floor", (0.0, 0.05), "geom.pos"),
}


def arena(name, axes, **more):
    made = mja.Arena.from_xml(SCENE)
    made.vary(size=dr.Term("geom.size", name, axes=axes), **more)
    return made


def gap(model, upper, lower):
    """How far one is above the other in C, at the start [m]."""
    c = mujoco.MjData(model)
    mujoco.mj_forward(model, c)
    return mujoco.mj_geomDistance(model, c, model.geom(upper).id, model.geom(lower).id, 1.0, None)


@pytest.mark.parametrize("case", TOLD)
def test_told(case):
    """With the numbers of the worlds at both ends, which C measures."""
    name, axes, dist, upper, lower, (sinks, floats), place = TOLD[case]
    made = arena(name, axes)
    does = [f"sink up to {sinks:.3g} m into '{lower}'"] * (sinks > 0)
    does += [f"float up to {floats:.3g} m above '{lower}'"] * (floats > 0)
    says = f"`ranges.terms.size` lets '{upper}' {' or '.join(does)}, on which it stands, as its place stays: vary its `{place}`, too, "
    says += "or make it an Object, which stands on what carries it."
    with pytest.warns(UserWarning, match="stands") as told:
        made.check_ranges(mja.ArenaRanges(terms={"size": dist}))
    assert [str(one.message) for one in told if "stands" in str(one.message)] == [says]
    nominal = jax.tree.map(np.asarray, made.nominal_params())
    values = nominal.terms["size"]
    least, most = (np.where(made.record.parts.varied[0].mask, x, values) for x in ends(dist, values))
    gaps = [gap(made.compile(with_values(nominal, {"size": x})), upper, lower) for x in (least, most)]
    np.testing.assert_allclose([-min(*gaps, 0.0), max(*gaps, 0.0)], [sinks, floats], atol=1e-6)


def ends(dist, values):
    low, high = dist.support()
    return (values * low, values * high) if dist.relative == "scale" else (low + 0 * values, high + 0 * values)


QUIET = {
    "its length along the floor": ("lying", "second", {}),
    "its width": ("cube", ("first", "second"), {}),
    "what swings": ("swings", None, {}),
    "what stands on nothing": ("high", None, {}),
    "what touches nothing": ("ghost", None, {}),
    "with its place": ("post", None, {"place": dr.Term("geom.pos", "post", axes="z")}),
    "with the place of its body": ("cube", None, {"place": dr.Term("body.start_pos", "cube", axes="z")}),
}


@pytest.mark.parametrize("case", QUIET)
def test_not_told(case):
    """What does not float or sink, and what is placed anew."""
    name, axes, more = QUIET[case]
    made = arena(name, axes, **more)
    ranges = mja.ArenaRanges(terms={"size": SCALED, **{n: mja.Uniform(0, 0.01, relative="add") for n in more}})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made.check_ranges(ranges)
    if more:  # and is not, where the place could vary and does not
        with pytest.warns(UserWarning, match=re.escape("as its place stays")):
            made.check_ranges(mja.ArenaRanges(terms={"size": SCALED}))


RAISED = mja.Uniform([0, 0, -0.03], [0, 0, 0.02], relative="add")
STACK = """<mujoco><worldbody><geom name="floor" type="plane" size="3 3 .1"/><body name="shelf" pos="0 0 .5" euler="{0} 0 0">
<geom name="top" type="box" size=".3 .3 .02" euler="-{0} 0 0"/></body><body name="cube" pos="0 0 .57"><freejoint/><geom name="cube"
type="box" size=".05 .05 .05"/></body></worldbody></mujoco>"""
MOVED = {
    "its body": (0, {"x": dr.Term("body.pos", "shelf")}, True),
    "itself": (0, {"x": dr.Term("geom.pos", "top")}, True),
    "in the plane": (0, {"x": dr.Term("geom.pos", "top", axes=("x", "y"))}, False),
    "both at once": (0, {"x": dr.Term("geom.pos", ["top", "cube"])}, False),
    "with what stands there": (0, {"x": dr.Term("body.pos", "shelf"), "y": dr.Term("body.start_pos", "cube")}, False),
    "what stands there": (0, {"y": dr.Term("body.start_pos", "cube")}, False),
    "along a tilted axis": (90, {"x": dr.Term("geom.pos", "top")}, False),
}


@pytest.mark.parametrize("case", MOVED)
def test_what_is_moved_from_below(case):
    """What stands on a place that rises or sinks without it, as C measures."""
    turned, terms, told = MOVED[case]
    made = mja.Arena.from_xml(STACK.format(turned))
    made.vary(**terms)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        made.check_ranges(mja.ArenaRanges(terms=dict.fromkeys(terms, RAISED)))
    says = "`ranges.terms.x` lets 'cube' sink up to 0.02 m into 'top' or float up to 0.03 m above 'top', on which it stands"
    assert [str(one.message).startswith(says) for one in found] == [True] * told
    if told:
        nominal = jax.tree.map(np.asarray, made.nominal_params())
        places = [with_values(nominal, {"x": nominal.terms["x"] + [0, 0, z]}) for z in (-0.03, 0.02)]
        gaps = [gap(made.compile(one), "cube", "top") for one in places]
        np.testing.assert_allclose(gaps, [0.03, -0.02], atol=1e-6)


def test_what_came_later():
    """What was added after `vary` carries, too."""
    made = mja.Arena.from_xml(SCENE)
    made.vary(size=dr.Term("geom.size", "high"))
    made.attach(
        '<mujoco><worldbody><geom name="under" type="box" size=".2 .2 .05" pos="4 0 .85"/></worldbody></mujoco>'
    )
    made.mj_model  # noqa: B018
    with pytest.warns(UserWarning, match="lets 'high' sink up to 0.03 m into 'robot_under' or float"):
        made.check_ranges(mja.ArenaRanges(terms={"size": SCALED}))
