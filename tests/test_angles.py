"""Angles that look like degrees, and the units of joints, which follow from their types."""

import dataclasses
import re

import jax
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr, furniture
from mjx_arenas.furniture.part import whole
from mjx_arenas.params.params import QUANTITIES

XML = """<mujoco><compiler angle="radian"/><default><geom contype="0" conaffinity="0"/></default><worldbody>
<body name="base"><freejoint name="free"/><geom size=".1"/></body>
<body name="arm" pos="0 0 1"><joint name="hinge" range="-1 1" axis="1 0 0" damping="1"/>
<joint name="slide" type="slide" range="-1 1" damping="1"/><geom size=".1"/>
<body name="hand"><joint name="ball" type="ball" range="0 1" damping="1"/><geom size=".1"/>
<body name="screw"><joint name="screw" range="-20 20"/><geom size=".1"/><camera name="eye"/></body></body></body>
</worldbody></mujoco>"""
U = mja.Uniform


def scene(attribute, *elements, axes=None):
    """The quantity "varied" of some elements."""
    arena = mja.Arena.from_xml(XML)
    arena.vary(varied=dr.Term(attribute, list(elements) or None, axes=axes))
    return arena


def check(arena, dist):
    arena.check_ranges(mja.ArenaRanges(terms={"varied": dist}))


DEGREES = {
    "added to ranges": (("joint.range", "hinge"), U(-90, 90, relative="add")),
    "ranges": (("joint.range", "hinge"), U([-90, 10], [-45, 90])),
    "a ball's range": (("joint.range", "ball"), U(45, 90)),
    "one of two": (("joint.range", "hinge", "slide"), U([[-90, 0.5], [-1, 0.5]], [[-2, 1], [-0.5, 1]])),
    "starts": (("joint.qpos", "hinge"), U(-90, 90)),
    "springs": (("joint.springref", "hinge"), mja.Fixed(90)),
    "zero": (("joint.ref", "hinge"), mja.Choice([0, -90])),
    "turned bodies": (("body.rpy", "hand"), U([0, 0, -90], [0, 0, 90])),
    "a turned base": (("body.start_rpy", "base"), U([0, 0, -90], [0, 0, 90])),
    "a turned camera": (("camera.rpy", "eye"), mja.Normal(0, 30, -90, 90)),
}


@pytest.mark.parametrize("case", DEGREES)
def test_degrees(case):
    """Whatever is in radians."""
    said = "`ranges.terms.varied` has angles of up to 90 rad, more than a turn: angles are in radians (90 degrees are 1.571)."
    term, dist = DEGREES[case]
    with pytest.warns(UserWarning, match=f"^{re.escape(said)}$"):
        check(scene(*term), dist)


RADIANS = {
    "a turn": (("joint.qpos", "hinge"), U(-6.2832, 6.2832)),
    "scaled": (("joint.range", "hinge", "slide"), U(8, 10, relative="scale")),
    "a slide": (("joint.range", "slide"), U([-90, 10], [-45, 90])),
    "one of two": (("joint.range", "hinge", "slide"), U([[-1, 0.5], [-90, 0.5]], [[-0.5, 1], [-2, 1]])),
    "a screw": (("joint.range", "screw"), U([-30, 20], [-20, 30])),
    "speeds": (("joint.qvel", "hinge"), U(-90, 90)),
    "lenses": (("camera.fovy", "eye"), U(40, 90)),
    "forces": (("joint.damping", "hinge"), U(40, 90)),
}


@pytest.mark.parametrize("case", RADIANS)
def test_no_degrees(case):
    """A warning is an error here."""
    term, dist = RADIANS[case]
    check(scene(*term), dist)


@pytest.mark.parametrize(("other", "name"), [(mja.TableArena, "table_rots"), (lambda: mja.Arena.from_xml(XML), "rot")])
def test_merged(other, name):
    """One warning of what turns another arena, with its tables or without."""
    with pytest.warns(UserWarning, match=f"^`{name}` has angles of up to 90 rad, more than a turn: ") as told:
        mja.TableArena().merge(other(), "b_", pos=(0, 3, 0), rot=90)
    assert len(told) == 1


def test_only_what_varies():
    """Of angles about three axes those that do."""
    arena = scene("body.rpy", "hand", axes=["yaw"])
    with pytest.warns(UserWarning, match="up to 90 rad"):
        check(arena, U([0, 0, 1], [800, 0, 90]))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Tilted(furniture.Bin):
    """A bin with an angle of its own."""

    tilt: float = 30.0

    @property
    def own(self):
        return {**super().own, "tilt": whole(QUANTITIES["table_rots"]._replace(of="part"), self.tilt)}


def test_angles_of_parts():
    """Those of classes of a user's own, too."""
    with pytest.warns(UserWarning, match=r"^Part 'crate': `tilt` has angles of up to 30 rad"):
        mja.TableArena().add_part(Tilted("crate", pos=(2, 0, 0)))


UNITS = {
    "joint.damping": {"free": "[N m s] or [N s/m]", "hinge": "[N m s]", "slide": "[N s/m]", "ball": "[N m s]"},
    "joint.range": {"hinge": "[rad]", "slide": "[m]", "ball": "[rad]"},
    "joint.qvel": {"hinge": "[rad/s]", "slide": "[m/s]"},
    "joint.armature": {"hinge": "[kg m^2]", "slide": "[kg]"},
}


@pytest.mark.parametrize("attribute", UNITS)
def test_units_of_joints(attribute):
    """In one world and in many, each joint has its own; nothing else changes."""
    expected = UNITS[attribute]
    arena = scene(attribute, *expected)
    one = arena.describe()
    assert {s.element: s.unit for s in one.terms} == expected
    for element, unit in expected.items():
        assert re.search(rf"(?m)^varied {re.escape(unit)} +{element} ", str(one))
    params = jax.tree.map(lambda x: np.stack([x, x + (x.dtype == np.float32)]), arena.nominal_params())
    said = arena.describe(params)
    assert {r.item: r.unit for r in said.ranges if r.quantity == "varied"} == expected
    lines = [line for line in str(said).splitlines() if any(f" {element} " in line for element in expected)]
    title = ""
    for line, (element, unit) in zip(lines, expected.items(), strict=True):
        found = re.match(rf"(varied \S.*?)?  +{element} ", line)
        assert found
        title = found[1] or title
        assert title == f"varied {unit}"


def test_units_of_others():
    """Elements that are no joints have those of the quantity, and so has what rules say of a whole quantity."""
    arena = scene("body.rpy", "hand")
    assert [s.unit for s in arena.describe().terms] == ["[rad]"]
    with pytest.raises(ValueError, match=r"between -1e6 and 1e6 \[rad\] or \[m\]"):
        check(scene("joint.qpos", "hinge"), U(-1e7, 1e7))
