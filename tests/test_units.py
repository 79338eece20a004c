"""Numbers that are almost surely in another unit than they should be, and gravity that would pull sideways."""

import functools
import re
import warnings

import pytest

import mjx_arenas as mja
from mjx_arenas import dr, furniture

U = mja.Uniform
XML = """<mujoco><option density="1"/><worldbody><body pos="0 0 1"><geom name="ball" size=".05"/><camera name="eye" fovy="45"/>
<camera name="tele" fovy="2"/><light name="lamp" cutoff="45"/></body></worldbody></mujoco>"""


@functools.cache
def scene():
    arena = mja.Arena.from_xml(XML)
    arena.vary(
        gravity=dr.Term("option.gravity"),
        sideways=dr.Term("option.magnetic", axes=["x", "y"]),
        wind=dr.Term("option.wind"),
        step=dr.Term("option.timestep"),
        lens=dr.Term("camera.fovy", "eye"),
        tele=dr.Term("camera.fovy", "tele"),
        cutoff=dr.Term("light.cutoff"),
        size=dr.Term("geom.size", "ball"),
    )
    return arena


@functools.cache
def table():
    return mja.TableArena(objects=[mja.Object("box", full_size=0.05)])


def check(name, dist):
    ranges = {name: dist} if name.startswith(("object", "table")) else {"terms": {name: dist}}
    (scene() if "terms" in ranges else table()).check_ranges(mja.ArenaRanges(**ranges))


AXES = ": give three numbers, `axes` of the term, or `relative='add'`."
WRONG = {
    "gravity": (("gravity", U(-10, -9)), "`ranges.terms.gravity` gives x, y and z one range, from -10 to -9 m/s^2" + AXES),
    "a gravity": (("gravity", mja.Fixed(-9.81)), "`ranges.terms.gravity` gives x, y and z one range, from -9.81 to -9.81 m/s^2" + AXES),
    "what was to be added": (("gravity", U(-1, 1)), "`ranges.terms.gravity` gives x, y and z one range, from -1 to 1 m/s^2" + AXES),
    "wind": (("wind", U(0, 3)), "`ranges.terms.wind` gives x, y and z one range, from 0 to 3 m/s" + AXES),
    "a lens in radians": (
        ("lens", U(0.5, 1.0)),
        "`ranges.terms.lens` of camera 'eye' has angles of at most 1 degrees: these angles are in degrees (1 rad are 57.3).",
    ),
    "a lamp in radians": (("cutoff", mja.Fixed(0.5)), "`ranges.terms.cutoff` of light 'lamp' has angles of at most 0.5 degrees"),
    "milliseconds": (("step", U(2, 5)), "is up to 5 s: time steps are in seconds (2 ms are 0.002)."),
    "milliseconds more": (
        ("step", U(0, 2, relative="add")),
        "`ranges.terms.step` is up to 2.002 s: time steps are in seconds (2 ms are 0.002).",
    ),
    "centimetres more": (
        ("size", U(0, 10, relative="add")),
        "`ranges.terms.size` of geom 'ball' is up to 10.05 m, 201 times the nominal 0.05 m: lengths are in metres (5 cm are 0.05).",
    ),
    "centimetres": (
        ("size", U(4, 6)),
        "`ranges.terms.size` of geom 'ball' is up to 6 m, 120 times the nominal 0.05 m: lengths are in metres (5 cm are 0.05).",
    ),
    "millimetres": (
        ("object_full_sizes", U(40, 60)),
        "`ranges.object_full_sizes` of object 'box' is up to 60 m, 1,200 times the nominal 0.05 m: lengths are in metres",
    ),
    "a place in millimetres": (
        ("table_offsets", U([0, 0, 150], [0, 0, 250], relative="add")),
        "`ranges.table_offsets` of table 0 is up to 250.8 m away: lengths are in metres (200 mm are 0.2).",
    ),
    "a place behind in millimetres": (
        ("table_offsets", U([-250, 0, 0], [-150, 0, 0], relative="add")),
        "`ranges.table_offsets` of table 0 is up to 250 m away: lengths are in metres (200 mm are 0.2).",
    ),
    "grams": (
        ("object_masses", U(40, 60)),
        "`ranges.object_masses` of object 'box' is up to 60 kg, 480 times the nominal 0.125 kg: masses are in kilograms "
        "(50 g are 0.05).",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_wrong(case):
    """One warning, which says what may have been meant."""
    given, said = WRONG[case]
    with pytest.warns(UserWarning, match=re.escape(said)) as caught:
        check(*given)
    assert len(caught) == 1


RIGHT = {
    "three numbers": ("gravity", U([0, 0, -10], [0, 0, -9])),
    "added": ("gravity", U(-1, 1, relative="add")),
    "no gravity": ("gravity", mja.Fixed(0)),
    "two axes": ("sideways", U(0.1, 0.2)),
    "wind from all sides": ("wind", U(-2, 2)),
    "a lens": ("lens", U(3, 60)),
    "one that is narrow in the MJCF, too": ("tele", U(1.5, 2.5)),
    "a long step": ("step", U(0.002, 0.1)),
    "large": ("size", U(0.01, 5)),
    "larger": ("size", U(0, 4, relative="add")),
    "wider": ("lens", U(-2, 2, relative="add")),
}


@pytest.mark.parametrize("case", RIGHT)
def test_right(case):
    """A warning is an error here."""
    check(*RIGHT[case])


def test_cameras():
    """Those that are added, too; a telescope has 3 degrees at least."""
    arena = mja.TableArena()
    said = "`fovy` has angles of at most 0.8 degrees: these angles are in degrees (0.8 rad are 45.8)."
    with pytest.warns(UserWarning, match=f"^{re.escape(said)}$"):
        arena.add_camera("eye", pos=(1, 1, 2), look_at=(0, 0, 0), fovy=0.8)
    arena.add_camera("tele", pos=(1, 1, 2), look_at=(0, 0, 0), fovy=3)


def test_units_of_what_is_made():
    """Of nominal numbers, too: once each."""
    said = r"^Object 'cube': `mass` is 50 kg, and the density 400,000 kg/m\^3, more than that of any metal: masses are"
    with pytest.warns(UserWarning, match=said) as caught:
        arena = mja.TableArena(
            objects=[mja.Object("cube", full_size=0.05, mass=50), mja.Object("tin", full_size=0.05, mass=0.9)]
        )
    assert len(caught) == 1
    arena.add_object(mja.Object("ball", "sphere", 0.05))
    with pytest.warns(
        UserWarning, match=r"^`table_offsets` of table '?table'? is up to 800 m away: lengths are in metres"
    ) as caught:
        mja.TableArena(table_offset=(0, 0, 800))
    assert len(caught) == 1


def test_centimetres_of_parts():
    """Places and lengths of parts; walls, ramps and rails may be long."""
    arena = mja.TableArena()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        arena.add_part(furniture.Shelf("r", pos=(150, 0, 0), size=(30, 80), heights=(30, 80, 120)))
        arena.add_part(furniture.Counter("c", pos=(3, -30, 0), widths=(0.9,) * 30))
        arena.add_part(furniture.Drawers("d", pos=(4, 0, 0), heights=(9, 11)))
        arena.add_part(furniture.Wall("w", pos=(80, 0, 0), full_size=(0.1, 20, 2)))
    assert [str(one.message) for one in caught] == [
        "Part 'r': `pos` is up to 150 m away: lengths are in metres (200 mm are 0.2).",
        "Part 'r': `heights` is up to 120 m: lengths are in metres (30 cm are 0.3).",
        "Part 'd': `heights` is up to 11 m: lengths are in metres (30 cm are 0.3).",
    ]


def test_centimetres_of_tables():
    """Of a table with legs, which has no room for them, and of one without; a table of 10 m may be."""
    said = (
        "`table_offset` puts the top at z = 0.8 m. A slab 5 m thick leaves no room for legs there: lengths are in metres "
        "(5 cm are 0.05)."
    )
    with pytest.raises(ValueError, match=f"^{re.escape(said)}$"):
        mja.TableArena((80, 80, 5))
    with pytest.warns(
        UserWarning, match=r"^`table_full_sizes` of table '?table'? is up to 80 m: lengths are in metres"
    ) as caught:
        mja.TableArena((80, 80, 5), has_legs=False)
    assert len(caught) == 1
    mja.TableArena((10, 2, 0.05))
    with pytest.raises(ValueError, match=r"no room for legs there: with `has_legs`, z must be > 1\.$"):
        mja.TableArena((2, 2, 2))


def test_widest_lens():
    """The sentence says no number that nobody would take."""
    said = "`ranges.terms.lens` of camera 'eye' can reach 190.0: it must stay > 0 and at most 179 [degrees]."
    with pytest.raises(ValueError, match=f"^{re.escape(said)}$"):
        check("lens", U(60, 190))
