"""Wrong uses of furniture, in Python and in files: one sentence each, and nothing is silent."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_furniture import furnished

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.furniture.part import LENGTH, Box, Part, whole

U = mja.Uniform
RACK = furniture.Shelf("rack", pos=(1.5, 0, 0))


@dataclasses.dataclass(frozen=True)
class Stool(Part):
    """Two boxes of one name."""

    height: float = 0.4

    @property
    def own(self):
        return {"height": whole(LENGTH, self.height)}

    def boxes(self, numbers):
        half = numbers["height"] / 2
        return [Box("leg", (x, 0.0, half), (0.02, 0.02, half)) for x in (-0.2, 0.2)]


class Empty(Part):
    """Says nothing of itself."""


@pytest.fixture(scope="module")
def arena():
    drawers = furniture.Drawers("drawers", pos=(2.5, 0, 0), stays=True)
    parts = (RACK, drawers, furniture.Cupboard("cupboard", pos=(3.5, 0, 0)))
    return furnished(*parts)


PARTS = {
    "a class": (
        lambda: furniture.Shelf,
        "`part` must be a part of `mjx_arenas.furniture`, such as Shelf('rack'), got <class",
    ),
    "many": (lambda: [RACK], "`part` must be a part of `mjx_arenas.furniture`, such as Shelf('rack'), got [Shelf("),
    "an object": (lambda: mja.Object("cube"), "`part` must be a part of `mjx_arenas.furniture`"),
    "None": (lambda: None, "`part` must be a part of `mjx_arenas.furniture`, such as Shelf('rack'), got None."),
    "a name that is no text": (lambda: furniture.Shelf(3), "`part.name` must be a non-empty string, got 3."),
    "two lines": (
        lambda: furniture.Shelf("a\nb"),
        r"`part.name` must be a string of characters that can be printed, got 'a\nb'.",
    ),
    "NUL": (
        lambda: furniture.Shelf("a\0b"),
        r"`part.name` must be a string of characters that can be printed, got 'a\x00b'.",
    ),
    "half a character": (
        lambda: furniture.Shelf("\ud800"),
        r"`part.name` must be a string of characters that can be printed, got '\ud800'.",
    ),
    "the world": (
        lambda: furniture.Shelf("world"),
        "`part.name` must be another one: there is a body 'world', got 'world'.",
    ),
    "no boards": (lambda: furniture.Shelf("a", heights=()), "Part 'a': `heights` must be at least one number, got ()."),
    "lists in a list": (
        lambda: furniture.Shelf("a", heights=[[0.1], [0.2]]),
        "Part 'a': `heights` must be a list of numbers, got ((0.1,), (0.2,)).",
    ),
    "different lengths": (
        lambda: furniture.Shelf("a", heights=[0.1, [0.2]]),
        "Part 'a': `heights` must be numbers in a regular array, got [0.1, [0.2]].",
    ),
    "numbers as text": (
        lambda: furniture.Shelf("a", heights=["0.1", "0.2"]),
        "Part 'a': `heights` must be numbers in a regular array, got ['0.1', '0.2'].",
    ),
    "infinite": (lambda: furniture.Shelf("a", size=(np.inf, 1)), "Part 'a': `size` must be finite, got (inf, 1)."),
    "huge": (
        lambda: furniture.Shelf("a", size=(1e7, 1)),
        "Part 'a': `size` must be between 1e-15 and 1e6 [m], got (10000000.0, 1.0).",
    ),
    "tiny": (
        lambda: furniture.Bin("a", thickness=1e-20),
        "Part 'a': `thickness` must be between 1e-15 and 1e6 [m], got 1e-20.",
    ),
    "NaN": (lambda: furniture.Bin("a", thickness=np.nan), "Part 'a': `thickness` must be a finite number, got nan."),
    "thin": (
        lambda: furniture.Bin("a", thickness="thin"),
        "Part 'a': `thickness` must be a finite number, got 'thin'.",
    ),
    "left out": (
        lambda: furniture.Bin("a", thickness=None),
        "Part 'a': `thickness` must be a finite number, got None.",
    ),
    "a place on a plane": (
        lambda: furniture.Bin("a", pos=(1, 2)),
        "Part 'a': `pos` must be 3 numbers: x, y, z, got (1.0, 2.0).",
    ),
    "a quaternion": (
        lambda: furniture.Bin("a", rot=(1, 0, 0, 0)),
        "Part 'a': `rot` must be one number, got (1.0, 0.0, 0.0, 0.0).",
    ),
    "one friction": (
        lambda: furniture.Bin("a", friction=1.0),
        "Part 'a': `friction` must be a list of numbers, got 1.0.",
    ),
    "sticky": (
        lambda: furniture.Bin("a", friction=(-1, 0, 0)),
        "Part 'a': `friction` must be >= 0 on every axis, got (-1.0, 0.0, 0.0).",
    ),
    "bytes": (
        lambda: furniture.Bin("a", rgba=(255, 0, 0, 255)),
        "Part 'a': `rgba` must be between 0 and 1, got (255.0, 0.0, 0.0, 255.0).",
    ),
    "no opacity": (
        lambda: furniture.Bin("a", rgba=(1, 0, 0)),
        "Part 'a': `rgba` must be 4 numbers: red, green, blue, alpha, got (1.0, 0.0, 0.0).",
    ),
    "a texture": (
        lambda: furniture.Bin("a", material=mja.textures.Wood()),
        "Part 'a': `material` must be the name of a material, or None, got Wood(",
    ),
    "away, and always there": (
        lambda: furniture.Drawers("a", active=False, stays=True),
        "Part 'a': `active` must be true, as what `stays` is always there, got False.",
    ),
    "a side of nothing": (
        lambda: furniture.Bin("a", side="back"),
        "Part 'a': `beside` must be given where there is a `side`, got None.",
    ),
    "friction of nothing": (
        lambda: furniture.Zone("a", friction=(2, 0, 0)),
        "Part 'a': `friction` must be left out, as a Zone touches nothing, got (2.0, 0.0, 0.0).",
    ),
    "colour of nothing": (
        lambda: furniture.Zone("a", rgba=(1, 0, 0, 1)),
        "Part 'a': `rgba` must be left out, as a Zone is not seen, got (1.0, 0.0, 0.0, 1.0).",
    ),
    "material of nothing": (
        lambda: furniture.Zone("a", material="oak"),
        "Part 'a': `material` must be left out, as a Zone is not seen, got 'oak'.",
    ),
    "one width": (lambda: furniture.Counter("a", widths=0.6), "Part 'a': `widths` must be a list of numbers, got 0.6."),
    "no widths": (
        lambda: furniture.Counter("a", widths=None),
        "Part 'a': `widths` must be numbers in a regular array, got None.",
    ),
    "a corner in truth": (
        lambda: furniture.Counter("a", corner=True),
        "Part 'a': `corner` must be None, the index of a cabinet, from 0 to 2, or two of them with another between them, got True.",
    ),
    "corners in words": (
        lambda: furniture.Counter("a", corner=("left", 2)),
        "Part 'a': `corner` must be None, the index of a cabinet, from 0 to 2, or two of them with another between them, got ('left', 2).",
    ),
    "no corner": (
        lambda: furniture.Counter("a", corner=(0, np.nan)),
        "Part 'a': `corner` must be None, the index of a cabinet, from 0 to 2, or two of them with another between them, got (0, nan).",
    ),
    "posts in each other": (
        lambda: furniture.Rail("a", length=0.01, n_posts=5),
        "Part 'a': `length` must be more than the posts are thick, so that they stand apart [m], got 0.01.",
    ),
    "a rail in the floor": (
        lambda: furniture.Rail("a", heights=(0.0, 0.5)),
        "Part 'a': `heights` must be between the floor and the tops of the posts [m], got (0.0, 0.5).",
    ),
    "a forest": (
        lambda: furniture.Rail("a", n_posts=10**6),
        "Part 'a': `n_posts` must be a whole number from 2 to 1000, got 1000000.",
    ),
    "where no window is": (
        lambda: furniture.Wall("a", window_at=(1, 1)),
        "Part 'a': `window` must be (length, height) where `window_at` is given, got None.",
    ),
    "a window of one number": (
        lambda: furniture.Wall("a", window=1),
        "Part 'a': `window` must be 2 numbers: length, height, got 1.",
    ),
    "no drawers": (
        lambda: furniture.Drawers("a", heights=None),
        "Part 'a': `heights` must be numbers in a regular array, got None.",
    ),
    "one opening": (
        lambda: furniture.Drawers("a", openings=0.1),
        "Part 'a': `openings` must be 3 numbers, one for each drawer, got 0.1.",
    ),
    "ragged openings": (
        lambda: furniture.Drawers("a", openings=[0, [1]]),
        "Part 'a': `openings` must be 3 numbers, one for each drawer, got [0, [1]].",
    ),
    "degrees": (
        lambda: furniture.Cupboard("a", opening=90),
        "Part 'a': `opening` must be between 0 and 1.9 [rad], got 90.0.",
    ),
    "boxes of one name": (
        lambda: Stool("a"),
        "`part` must be of boxes with different names, two are 'a_leg', got 'Stool'.",
    ),
    "no numbers": (lambda: Empty("a"), "`part`: Empty does not say which numbers it has: give it a property `own`."),
}


@pytest.mark.parametrize("case", PARTS)
def test_wrong_parts(case):
    """The arena is as before."""
    made, says = PARTS[case]
    arena = mja.TableArena()
    with pytest.raises((ValueError, NotImplementedError)) as raised:
        arena.add_part(made())
    assert str(raised.value).startswith(says)
    assert "\n" not in str(raised.value)
    assert arena.quantities == ()


@pytest.mark.parametrize("name", ["thickness", "heights"])
def test_traced(name):
    """A part is made on the host."""

    def add(x):
        mja.TableArena().add_part(furniture.Shelf("a", **{name: x}))

    with pytest.raises(ValueError, match=rf"^Part 'a': `{name}` must be .*number.*, got float32"):
        jax.jit(add)(jnp.array([0.1, 0.5]) if name == "heights" else 0.02)


def test_kinds_of_numbers():
    """What NumPy and JAX call numbers and truths is taken as Python's: parts are equal by them."""
    assert furniture.Shelf("a", heights=range(1, 4), active=np.bool_(False)) == furniture.Shelf(
        "a", heights=(1.0, 2.0, 3.0), active=False
    )
    assert furniture.Counter("a", widths=jnp.array([0.5, 0.25]), corner=np.int64(1)) == furniture.Counter(
        "a", widths=(0.5, 0.25), corner=1
    )
    assert furniture.Rail("a", n_posts=np.int32(4), length=np.float64(2)) == furniture.Rail("a", n_posts=4, length=2)
    arena = mja.TableArena()
    arena.add_part(furniture.Drawers("drawers", pos=(2, 0, 0), heights=(0.2, 0.3)))  # shut, however many they are
    np.testing.assert_array_equal(arena.nominal_params().terms["drawers.openings"], [0, 0])


@pytest.mark.parametrize("name", ["Regal-ä", "das Regal", "a.b", "a/b", 'a"b<&'])
def test_unusual_names(name, tmp_path):
    """Any name that can be printed, in quantities, messages, files and MJCF."""
    arena = mja.TableArena()
    arena.add_part(furniture.Shelf(name, pos=(1.5, 0, 0), heights=(0.3, 0.6)))
    ranges = mja.ArenaRanges(terms={f"{name}.heights": U(-0.05, 0.05, relative="add")})
    mja.save(tmp_path / "arena.yaml", arena, ranges)
    again, same = mja.load(tmp_path / "arena.yaml")
    assert same == ranges
    assert again.quantities == arena.quantities
    arena.export(arena.nominal_params(), tmp_path / "world")
    nominal = arena.nominal_params()
    nan = nominal._replace(terms={**nominal.terms, f"{name}.heights": jnp.array([0.3, jnp.nan])})
    (says,) = [p for p in arena.problems(nan) if "finite" in p]
    assert says == f"`terms.{name}.heights` of part {f'{name} board 1'!r} must be finite [m], got nan."


WARNED = {
    "in a table": (
        lambda: furnished(furniture.Shelf("rack")),
        (
            "Table 0 and part 'rack' overlap, 'rack_back' by 0.245 m horizontally and 0.8 m vertically: this is taken to "
            "be intended in every world."
        ),
    ),
    "in a part": (
        lambda: furnished(RACK, furniture.Bin("crate", pos=(1.5, 0, 0))),
        (
            "Part 'rack' and part 'crate' overlap, 'rack_back' and 'crate_bottom' by 0.055 m horizontally and 0.01 m "
            "vertically: this is taken to be intended in every world."
        ),
    ),
    "degrees": (
        lambda: furnished(furniture.Bin("crate", pos=(2, 0, 0), rot=90)),
        "Part 'crate': `rot` has angles of up to 90 rad, more than a turn: angles are in radians (90 degrees are 1.571).",
    ),
    "degrees in ranges": (
        lambda: furnished(RACK).check_ranges(mja.ArenaRanges(terms={"rack.rot": U(-90, 90)})),
        "`ranges.terms.rack.rot` has angles of up to 90 rad, more than a turn: angles are in radians (90 degrees are 1.571).",
    ),
}


@pytest.mark.parametrize("case", WARNED)
def test_hardly_meant(case):
    made, says = WARNED[case]
    with pytest.warns(UserWarning, match=r"overlap|radians") as caught:
        made()
    assert [str(one.message) for one in caught] == [says]


RANGES = {
    "too wide a door": (
        {"cupboard.opening": U(0, 4)},
        "`ranges.terms.cupboard.opening` of part 'cupboard_door' can reach 4.0: it must stay between 0 and 1.9 [rad].",
    ),
    "drawers that go": (
        {"drawers.active": mja.Bernoulli(0.5)},
        "`ranges.terms`: the arena has no quantity 'drawers.active': did you mean `drawers.size`?",
    ),
    "more boards than there are": (
        {"rack.pieces_active": mja.Count(2, 9)},
        "`ranges.terms.rack.pieces_active` (Count): `high` must be at most 4, got 9.",
    ),
    "too many truths": (
        {"rack.active": mja.Fixed([True, False])},
        "`ranges.terms.rack.active` (Fixed): `at` must be one number or of shape (1,), got shape (2,).",
    ),
    "truths of no shape": (
        {"rack.pieces_active": mja.Fixed([[True], [False]])},
        "`ranges.terms.rack.pieces_active` (Fixed): `at` must be one number or of shape (4,), got shape (2, 1).",
    ),
    "a number": (
        {"rack.heights": 0.5},
        "`ranges.terms.rack.heights` must be a distribution such as Uniform(low, high), or None, got 0.5.",
    ),
    "a part": (
        {"rack": U(0, 1)},
        "`ranges.terms`: the arena has no quantity 'rack': did you mean `rack.rot`?",
    ),
    "bright": (
        {"rack.rgba": U(0, 2)},
        "`ranges.terms.rack.rgba` of part 'rack' can reach [2.0, 2.0, 2.0, 2.0]: it must stay between 0 and 1.",
    ),
    "a side of truth": (
        {"cupboard.hinge_left": U(0, 1)},
        "`ranges.terms.cupboard.hinge_left` (Uniform): true and false need Bernoulli, Count, Choice or Fixed.",
    ),
    "NaN": ({"rack.heights": U(np.nan, 1)}, "`ranges.terms.rack.heights` (Uniform): `low` must be finite, got nan."),
    "slow": (
        {"drawers.damping": U(-1, 1)},
        "`ranges.terms.drawers.damping` of part 'drawers' can reach -1.0: it must stay >= 0 [N s/m].",
    ),
}


@pytest.mark.parametrize("case", RANGES)
def test_wrong_ranges(arena, case):
    terms, says = RANGES[case]
    with pytest.raises(ValueError, match="ranges") as raised:
        arena.check_ranges(mja.ArenaRanges(terms=terms))
    assert str(raised.value) == says


VARIED = {
    "a part": ("body.active", "rack", "body 'rack' cannot vary, as 'rack' comes and goes by its own quantity."),
    "a part that stays": (
        "body.active",
        "drawers",
        "body 'drawers' cannot vary, as part 'drawers' is always there (`stays=True`).",
    ),
    "a drawer": (
        "body.active",
        "drawers_drawer1",
        "body 'drawers_drawer1' cannot vary, as part 'drawers' is always there (`stays=True`).",
    ),
    "a door": (
        "body.active",
        "cupboard_door",
        "body 'cupboard_door' cannot vary, as 'cupboard' comes and goes by its own quantity, and takes it along.",
    ),
    "a drawer moved": (
        "body.pos",
        "drawers_drawer1",
        "body 'drawers_drawer1' cannot vary, as it is of part 'drawers', whose own quantities say where it is.",
    ),
    "a board moved": (
        "body.pos",
        "rack_board1",
        "body 'rack_board1' cannot vary, as it is of part 'rack', whose own quantities say where it is.",
    ),
    "a board tilted": (
        "geom.rpy",
        "rack_board1",
        "geom 'rack_board1' cannot vary, as it is of part 'rack', whose own quantities say where it is.",
    ),
    "another zero": (
        "joint.ref",
        "drawers_drawer1",
        "joint 'drawers_drawer1' cannot vary, as it is of part 'drawers', whose own quantities say where it is.",
    ),
    "a slab": (
        "geom.pos",
        "table_collision",
        "geom 'table_collision' cannot vary, as it is of table 'table', whose own quantities say where it is.",
    ),
}


@pytest.mark.parametrize("case", VARIED)
def test_wrong_terms(case):
    """What stands on furniture follows its own quantities: what would move it otherwise, or take it away, is refused."""
    attribute, name, says = VARIED[case]
    drawers = furniture.Drawers("drawers", pos=(2.5, 0, 0), stays=True)
    arena = furnished(RACK, drawers, furniture.Cupboard("cupboard", pos=(3.5, 0, 0)))
    with pytest.raises(ValueError, match="vary") as raised:
        arena.vary(there=mja.dr.Term(attribute, name))
    assert str(raised.value) == f"`there.elements`: {attribute!r} of {says}"


PARAMS = {
    "three heights": ({"rack.heights": jnp.zeros(3)}, "`params.terms.rack.heights` must have shape (4,), got (3,)."),
    "no row": ({"rack.pos": jnp.zeros(3)}, "`params.terms.rack.pos` must have shape (1, 3), got (3,)."),
    "half there": ({"rack.active": jnp.array([0.5])}, "`params.terms.rack.active` must be true or false, got float32."),
    "one there": ({"rack.active": np.array([1])}, "`params.terms.rack.active` must be true or false, got int64."),
    "true heights": ({"rack.heights": jnp.ones(4, bool)}, "`params.terms.rack.heights` must be numbers, got bool."),
    "another quantity": (
        {"rack.colour": jnp.zeros(1)},
        "`params.terms` must have all quantities of `arena.vary` and `arena.add_part`, and no others: the arena has no rack.colour.",
    ),
}


@pytest.mark.parametrize("case", PARAMS)
def test_wrong_params(arena, case):
    """By all that takes parameters."""
    terms, says = PARAMS[case]
    nominal = arena.nominal_params()
    params = nominal._replace(terms={**nominal.terms, **terms})
    for takes in (arena.valid, arena.problems, arena.compile, arena.describe):
        with pytest.raises(ValueError, match="params") as raised:
            takes(params)
        assert str(raised.value) == says


def test_no_params(arena):
    with pytest.raises(ValueError, match="params") as raised:
        arena.valid(arena.nominal_params()._replace(terms={}))
    assert str(raised.value) == (
        "`params.terms` must have all quantities of `arena.vary` and `arena.add_part`, and no others: it lacks cupboard.active, "
        "cupboard.damping, cupboard.friction, cupboard.frictionloss, cupboard.hinge_left, ...."
    )


def test_no_tables(arena):
    """A part is there on its own where no table is; in ranges that is answered."""
    nominal = arena.nominal_params()
    alone = nominal._replace(table_active=jnp.zeros(1, bool))
    assert not arena.problems(alone)
    model = arena.compile(alone)
    assert "rack" in [model.body(b).name for b in range(model.nbody)]
    with pytest.raises(ValueError, match=r"^`ranges.table_active` leaves no table in any world\.$"):
        arena.check_ranges(mja.ArenaRanges(table_active=mja.Fixed(False)))


def gone(spec):
    spec.delete(spec.joint("drawers_drawer0"))


def grown(spec):
    spec.geom("drawers_back").size = [1, 1, 1]


EDITED = {
    "a joint": (
        gone,
        (
            "`arena.spec`: joint 'drawers_drawer0' of a table, an object or a part is gone: do not delete or rename it "
            "(`table_active` and `active` of an object or a part make it absent)."
        ),
    ),
    "a size": (
        grown,
        "geom_size, stat.center, stat.extent, stat.meansize of a table, part or object was edited, which parameters ",
    ),
}


@pytest.mark.parametrize("case", EDITED)
def test_edited(case):
    edit, says = EDITED[case]
    arena = furnished(furniture.Drawers("drawers", pos=(2.5, 0, 0)))
    edit(arena.spec)
    with pytest.raises(ValueError, match="spec") as raised:
        _ = arena.mj_model
    assert says in str(raised.value)


MIXED = {
    "merged": (
        lambda: mja.TableArena().merge(furnished(RACK), "b_"),
        "`other` has quantities of `add_part` or `vary`, which cannot be merged: merge first, "
        "then vary, and add the parts to the merged arena, at their places there.",
    ),
    "a name of the other": (
        lambda: furnished(furniture.Shelf("b_table", pos=(4, 0, 0))).merge(mja.TableArena(), "b_", pos=(0, 3, 0)),
        "`other`: the arena already has body 'b_table': give another `prefix`.",
    ),
    "a name of a board": (
        lambda: furnished(RACK, furniture.Bin("rack_board0", pos=(4, 0, 0))),
        "`part.name` must be another one: there is a body 'rack_board0', got 'rack_board0'.",
    ),
    "a name of an object": (
        lambda: mja.TableArena(objects=[mja.Object("rack_top0")]).add_part(
            furniture.Counter("rack", widths=(0.6, 0.6), pos=(4, 0, 0))
        ),
        "`part.name` must be another one: there is an object 'rack_top0', got 'rack'.",
    ),
    "a name of a zone": (
        lambda: furnished(furniture.Zone("ck_top1"), furniture.Counter("ck", widths=(0.6, 0.6), pos=(4, 0, 0))),
        "`part.name` must be another one: there is a surface 'ck_top1', got 'ck'.",
    ),
    "a robot's name": (
        lambda: furnished(RACK).attach('<mujoco><worldbody><body name="ck"/></worldbody></mujoco>', "ra"),
        "`robot`: the arena already has body 'rack': give another `prefix`.",
    ),
    "a term's name": (
        lambda: furnished(RACK).vary(**{"rack.heights": mja.dr.Term("geom.solref", "rack_.*")}),
        "`rack.heights` must be a valid Python name, as it is the name of a quantity.",
    ),
}


@pytest.mark.parametrize("case", MIXED)
def test_with_other_things(case):
    made, says = MIXED[case]
    with pytest.raises(ValueError, match="`") as raised:
        made()
    assert str(raised.value) == says


def test_merging_into_a_furnished_arena():
    """Its parts stay, with their quantities."""
    merged = furnished(RACK).merge(mja.TableArena(), "b_", pos=(0, 3, 0))
    assert "rack.heights" in merged.quantities
    assert merged.mj_model.body("b_table").id > 0


HEAD = "arena:\n  type: TableArena\n  then:\n"
PART = "    - add_part: {part: {Shelf: {name: rack, pos: [2, 0, 0]}}}\nranges:\n"
FILES = {
    "heights": (
        "    - add_part:\n        part:\n          Shelf:\n            name: rack\n            heights: [0.5, 0.2]\n",
        "8: `arena.then[0].add_part.part.Shelf.heights` of part 'rack' must be from the bottom up, further apart than the boards are "
        "thick, and not below the floor [m], got (0.5, 0.2): board1 is not above board0.",
    ),
    "kind": (
        "    - add_part: {part: {Shelves: {name: rack}}}\n",
        "4: `arena.then[0].add_part.part.Shelves` is not a part: did you mean `Shelf`?",
    ),
    "argument": (
        "    - add_part: {part: {Shelf: {name: rack, height: 1}}}\n",
        "4: `arena.then[0].add_part.part.Shelf.height` is not an argument of Shelf: did you mean `heights`?",
    ),
    "no name": (
        "    - add_part: {part: {Shelf: {size: [1, 1]}}}\n",
        "4: `arena.then[0].add_part.part.Shelf` lacks `name`.",
    ),
    "null": (
        "    - add_part: {part: {Shelf: {name: rack, size: null}}}\n",
        "4: `arena.then[0].add_part.part.Shelf.size` is null: give it a value, or leave it out.",
    ),
    "quotes": (
        "    - add_part: {part: {Shelf: {name: rack, thickness: '0.02'}}}\n",
        "4: `arena.then[0].add_part.part.Shelf.thickness` of part 'rack' must be a finite number, got '0.02'.",
    ),
    "two in one": (
        "    - add_part: {part: {Shelf: {name: rack}, Bin: {name: crate}}}\n",
        "4: `arena.then[0].add_part.part` must be a part such as {Bin: ...}, got "
        '{"Shelf": {"name": "rack"}, "Bin": {"name": "crate"}}.',
    ),
    "twice": (
        PART.replace("ranges:\n", "    - add_part: {part: {Bin: {name: rack, pos: [4, 0, 0]}}}\n"),
        "5: `arena.then[1].add_part.part.Bin.name` must be another one: there is a body 'rack', got 'rack'.",
    ),
    "a quantity's name": (
        PART + "  terms:\n    rack.height: {Uniform: [0, 1]}\n",
        "7: `ranges.terms`: the arena has no quantity 'rack.height': did you mean `rack.heights`?",
    ),
    "not under terms": (
        PART + "  rack.heights: {Uniform: [0, 1]}\n",
        "6: `ranges.rack.heights` must stand under `ranges.terms`, as all quantities of furniture do.",
    ),
    "reach": (
        PART + "  terms:\n    rack.thickness: {Uniform: [-1, 1]}\n",
        "7: `ranges.terms.rack.thickness` of part 'rack' can reach -1.0: it must stay > 0 [m].",
    ),
}


@pytest.mark.parametrize("case", FILES)
def test_wrong_files(case, tmp_path):
    """With the line of what is wrong."""
    text, says = FILES[case]
    file = tmp_path / "arena.yaml"
    file.write_text(HEAD + text)
    with pytest.raises(ValueError, match=file.name) as raised:
        mja.load(file)
    assert str(raised.value) == f"{file}:{says}"
