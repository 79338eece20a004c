"""Absolute ranges that may have been meant otherwise."""

import functools
import re
import warnings

import pytest

import mjx_arenas as mja
from mjx_arenas import dr

U = mja.Uniform
XML = """<mujoco><worldbody><body name="arm" pos="0 .2 1"><joint name="hinge" damping="40"/>
<geom name="ball" size=".1" friction="1 .005 .0001"/><camera name="eye" pos="0 0 0"/></body>
<body name="lamp" pos="0 .5 1"><geom size=".1"/></body></worldbody>
<actuator><position name="servo" joint="hinge" kp="40"/></actuator></mujoco>"""


@functools.cache
def scene():
    """What an MJCF has, and a table with an object."""
    arena = mja.Arena.from_xml(XML)
    arena.vary(
        kp=dr.Term("actuator.kp", ["servo"]),
        damping=dr.Term("joint.damping", ["hinge"]),
        pos=dr.Term("body.pos", ["arm"]),
        height=dr.Term("body.pos", ["lamp"], axes="z"),
        friction=dr.Term("geom.friction", ["ball"]),
        eye=dr.Term("camera.pos", ["eye"]),
    )
    return arena


@functools.cache
def table():
    return mja.TableArena(objects=[mja.Object("box", full_size=0.05)])


def check(ranges):
    (table() if "terms" not in ranges else scene()).check_ranges(mja.ArenaRanges(**ranges))


FACTORS = {
    "gains": (
        {"terms": {"kp": U(0.8, 1.2)}},
        "`ranges.terms.kp` of actuator 'servo' is between 0.8 and 1.2, far from the nominal 40",
    ),
    "wide": (
        {"terms": {"damping": U(0.5, 2)}},
        "`ranges.terms.damping` of joint 'hinge' is between 0.5 and 2, far from the nominal 40",
    ),
    "sizes": (
        {"table_full_sizes": U(0.8, 1.2)},
        "`ranges.table_full_sizes` of table 0 is between 0.8 and 1.2, far from the nominal 0.05",
    ),
    "rolling friction": (
        {"terms": {"friction": U(0.5, 1.5)}},
        "`ranges.terms.friction` of geom 'ball' is between 0.5 and 1.5, far from the nominal 0.0001",
    ),
}


@pytest.mark.parametrize("case", FACTORS)
def test_factors(case):
    ranges, said = FACTORS[case]
    with pytest.warns(UserWarning, match=re.escape(f"{said}: `relative='scale'` may be meant.")):
        check(ranges)


def test_one_for_all_axes():
    said = "`ranges.terms.pos` gives x, y and z of a place one range, from 0.1 to 0.4 m: give three numbers, `axes` of the term, or"
    with pytest.warns(UserWarning, match=re.escape(said)):
        check({"terms": {"pos": U(0.1, 0.4)}})


PERCENT = {
    "percent": (
        {"object_masses": U(80, 120, relative="scale")},
        "`ranges.object_masses` of object 'box' multiplies by 80 to 120",
    ),
    "percent of a term": (
        {"terms": {"kp": mja.LogUniform(50, 200, relative="scale")}},
        "`ranges.terms.kp` of actuator 'servo' multiplies by 50 to 200",
    ),
    "shares of a place": (
        {"terms": {"pos": U(-0.1, 0.1, relative="scale")}},
        "`ranges.terms.pos` of body 'arm' multiplies by -0.1 to 0.1",
    ),
    "shares of a height": (
        {"terms": {"height": U(-0.05, 0.05, relative="scale")}},
        "`ranges.terms.height` of body 'lamp' multiplies by -0.05 to 0.05",
    ),
}


@pytest.mark.parametrize("case", PERCENT)
def test_percent(case, recwarn):
    """One warning of factors that are percent, or are 0 in their middle."""
    ranges, said = PERCENT[case]
    check(ranges)
    assert [str(one.message) for one in recwarn.list] == [
        f"{said}: factors are about 1 (10 % less to 10 % more are 0.9 to 1.1)."
    ]


RIGHT = {
    "large factors": {"terms": {"kp": U(10, 50, relative="scale")}},
    "hundreds": {"terms": {"kp": U(100, 400, relative="scale")}},
    "either side": {"terms": {"pos": U(-1, 1, relative="scale")}},
    "a smaller place": {"terms": {"pos": U(0.1, 0.5, relative="scale")}},
    "hundreds that are added": {"terms": {"kp": U(80, 120, relative="add")}},
    "factors": {"terms": {"kp": U(0.8, 1.2, relative="scale")}},
    "near": {"terms": {"kp": U(11, 50)}},
    "not about 1": {"terms": {"kp": U(2, 4)}},
    "the mass of what has the usual density": {"object_masses": U(0.8, 1.2)},
    "three": {"terms": {"pos": U([0.1, 0.1, 0.4], [0.2, 0.2, 0.9])}},
    "one axis": {"terms": {"height": U(0.1, 0.4)}},
    "what is added": {"terms": {"pos": U(-0.1, 0.1, relative="add")}},
    "a place of 0, to which it is added": {"terms": {"eye": U(-0.1, 0.1)}},
    "one number": {"terms": {"kp": mja.Fixed(1)}},
}


@pytest.mark.parametrize("case", RIGHT)
def test_right(case, recwarn):
    check(RIGHT[case])
    assert not recwarn.list


FRAMED = """<mujoco><asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset><worldbody>
  <frame pos="1 0 0"><body name="a" pos="0 0 1"><freejoint/><geom name="g" type="mesh" mesh="m"/></body>
  <site name="s" pos="0 1 1"/></frame>
  <body name="b" pos="0 3 1"><frame pos="0 0 1"><joint name="j"/></frame>
  <geom name="h" type="capsule" size=".1" fromto="0 0 0 0 0 1"/></body></worldbody></mujoco>"""
NEAR = [-0.1, -0.1, 0.9], [0.1, 0.1, 1.1]
TURNED = {"r": dr.Term("body.rpy", "a")}
PLACES = {
    "a body in a frame": ("body.pos", "a", mja.Uniform(*NEAR), "body 'a'", "[0.0, 0.0, 1.0]", "[1.0, 0.0, 1.0]"),
    "fixed": ("site.pos", "s", mja.Fixed([0, 1, 1]), "site 's'", "[0.0, 1.0, 1.0]", "[1.0, 1.0, 1.0]"),
    "a mesh": (
        "geom.pos",
        "g",
        mja.Uniform([-0.1] * 3, [0.1] * 3),
        "geom 'g'",
        "[0.0, 0.0, 0.0]",
        "[0.25, 0.25, 0.25]",
    ),
    "a joint": (
        "joint.pos",
        "j",
        mja.Uniform([-0.1] * 3, [0.1] * 3),
        "joint 'j'",
        "[0.0, 0.0, 0.0]",
        "[0.0, 0.0, 1.0]",
    ),
    "where it is": ("body.pos", "a", mja.Uniform([0.9, -0.1, 0.9], [1.1, 0.1, 1.1]), "", "", ""),
    "added": ("body.pos", "a", mja.Uniform(*NEAR, relative="add"), "", "", ""),
    "in no frame": ("body.pos", "b", mja.Uniform([-0.1, 2.9, 0.9], [0.1, 3.1, 1.1]), "", "", ""),
    "between two points": ("geom.pos", "h", mja.Uniform([-0.1, -0.1, 0.4], [0.1, 0.1, 0.6]), "", "", ""),
}


@pytest.mark.parametrize("case", PLACES)
@pytest.mark.parametrize("turned", [(), ("first",), ("together",)])
def test_places_of_the_mjcf(case, turned):
    """A range around the numbers of the MJCF, where the compiled model has others, was meant for these; terms that turn it, too."""
    attribute, name, dist, what, told, compiled = PLACES[case]
    arena = mja.Arena.from_xml(FRAMED)
    if "first" in turned:
        arena.vary(**TURNED)
    arena.vary(q=dr.Term(attribute, name), **(TURNED if "together" in turned else {}))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        arena.check_ranges(mja.ArenaRanges(terms={"q": dist}))
    said = [str(one.message) for one in caught if "in the MJCF" in str(one.message)]
    assert len(said) == bool(what)
    if what:
        assert said[0].startswith(f"`ranges.terms.q` of {what} is around its place in the MJCF, {told}, which")
        assert f"In the compiled model it is at {compiled}:" in said[0]
