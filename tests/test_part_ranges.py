"""Ranges of furniture that give what a part cannot be, or hardly what was meant: one sentence each."""

import warnings

import pytest
from test_furniture import furnished

import mjx_arenas as mja
from mjx_arenas import furniture

U = mja.Uniform
TRAVEL = 0.8 * (0.45 - 2 * 0.015)  # of drawers of the default depth and thickness


@pytest.fixture(scope="module")
def arena():
    return furnished(furniture.Shelf("rack", pos=(1.5, 0, 0)), furniture.Drawers("unit", pos=(2.5, 0, 0)))


def said(arena, terms):
    """What is warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        arena.check_ranges(mja.ArenaRanges(terms=terms))
    return [str(one.message) for one in caught]


REFUSED = {
    "pushed in": (U(-0.1, 0.1), "all parts", -0.1),
    "pulled out": (U([0, 0, 0], [0.3, 0.1, 0.9]), "part 'unit_drawer2'", 0.9),
    "added": (U(0, 0.5, relative="add"), "all parts", 0.5),
    "given": (mja.Fixed(-0.1), "all parts", -0.1),
}


@pytest.mark.parametrize("case", REFUSED)
def test_openings(arena, case):
    dist, of, got = REFUSED[case]
    with pytest.raises(ValueError, match="openings") as raised:
        arena.check_ranges(mja.ArenaRanges(terms={"unit.openings": dist}))
    assert str(raised.value) == (
        f"`ranges.terms.unit.openings` of {of} can reach {got}: it must stay from 0 to 0.8 of the depth inside [m]."
    )


@pytest.mark.parametrize(
    "terms",
    [
        {"unit.openings": U(0, TRAVEL)},
        {"unit.openings": U(0, 0.4), "unit.size": U([0.4, 0.5], [0.6, 0.5])},  # how far they reach varies
        {"rack.heights": U(-0.1, 0.1, relative="add")},
        {"rack.heights": U([0.1, 0.5, 1.0, 1.5], [0.3, 0.7, 1.2, 1.7])},
        {"rack.pos": U([-0.1, -0.1, 0], [0.1, 0.1, 0], relative="add")},
    ],
)
def test_nothing_said(arena, terms):
    assert said(arena, terms) == []


WARNED = {
    "boards that cross": (
        {"rack.heights": U(0.2, 1.2)},
        "`ranges.terms.rack.heights` of part 'rack' gives all pieces one range, from 0.2 to 1.2: most worlds will not be valid, as the "
        "numbers must be from the bottom up, further apart than the boards are thick, and not below the floor [m]. Give each its own "
        "range, or `relative='add'`.",
    ),
    "into the floor": (
        {"rack.pos": U(-0.1, 0.1, relative="add")},
        "`ranges.terms.rack.pos` of part 'rack' adds one range, from -0.1 to 0.1 m, to x, y and z, which moves it below z = 0: give "
        "three numbers.",
    ),
}


@pytest.mark.parametrize("case", WARNED)
def test_warned(arena, case):
    terms, says = WARNED[case]
    assert said(arena, terms) == [says]


def test_tops_without_size():
    """A board between sides that leave nothing of it is said to be of no size, and not of a negative one."""
    arena = mja.TableArena()
    arena.add_part(furniture.Shelf("rack", pos=(2, 0, 0)))
    arena.add_object(mja.Object("c", full_size=0.05, on="rack_board0"))
    nominal = arena.nominal_params()
    params = nominal._replace(terms={**nominal.terms, "rack.thickness": nominal.terms["rack.thickness"] + 0.5})
    found = [one for one in arena.problems(params) if "larger than" in one]
    assert found == ["Object 'c' is 0.05 x 0.05 m, larger than 'rack_board0', which is 0 x 0 m."]


def test_only_what_was_given_is_named():
    """What follows from other numbers is not told as an argument that is None."""
    with pytest.raises(ValueError, match="thickness") as raised:
        mja.TableArena().add_part(furniture.Drawers("d", thickness=0.3))
    assert str(raised.value) == "Part 'd': `thickness` must be small against depth, width and heights [m], got 0.3."
