"""Furniture: boxes that are where their numbers say, in every world as the compiler makes it, drawn, flagged, and out of objects' way."""

import dataclasses
import pathlib
import re

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import oracle
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture, geometry
from mjx_arenas.furniture import standing
from mjx_arenas.record.elsewhere import elsewhere

U = mja.Uniform
PARTS = (
    furniture.Shelf("rack", pos=(1.5, 0, 0), heights=(0.1, 0.5, 0.9)),
    furniture.Bin("crate", pos=(0.25, -0.2, 0.8), inner_size=(0.15, 0.2, 0.1)),
    furniture.Counter("kitchen", pos=(3, -1.2, 0), widths=(0.6, 0.5, 0.6, 0.4), corner=2),
    furniture.Counter("row", pos=(3, 2, 0)),
    furniture.Counter("horseshoe", pos=(-3, -6, 0), widths=(0.5, 0.5, 0.6, 0.7, 0.5, 0.4), corner=(1, 4)),
    furniture.Wall("wall", pos=(3.2, 0, 0)),
    furniture.Wall("window", pos=(3.2, 3.2, 0), window=(1, 0.8)),
    furniture.Wall("door", pos=(3.2, 6.4, 0), door=(0.9, 2)),
    furniture.Steps("stairs", pos=(-1.5, 1.5, 0)),
    furniture.Ramp("ramp", pos=(-2, -1.2, 0)),
    furniture.Shelf("single", pos=(-2.5, 4, 0), heights=(0.7,)),
    furniture.Counter("one", pos=(-2.5, 6, 0), widths=(0.7,)),
    furniture.Rail("fence", pos=(-2.5, 0, 0)),
)
"""One of each kind, apart from each other."""


def furnished(*parts, **kwargs):
    arena = mja.TableArena(objects=[mja.Object("cube", full_size=0.05)], **kwargs)
    for part in parts:
        arena.add_part(part)
    return arena


@pytest.fixture(scope="module")
def arena():
    return furnished(*PARTS)


def boxes(part, **numbers):
    """Corners (n, 2, 3) of the boxes of a part with these numbers, by name."""
    found = part.boxes({**part.nominal, **{name: np.asarray(x, float) for name, x in numbers.items()}})
    return {b.name: np.stack([np.array(b.pos, float) - b.half, np.array(b.pos, float) + b.half]) for b in found}


def test_shelf():
    """Boards' tops are at their heights, between sides and in front of a back that reach to the last one, all within depth and width."""
    found = boxes(furniture.Shelf("s"), size=(0.4, 1.0), heights=(0.2, 0.5, 0.8, 1.1), thickness=0.03)
    all_corners = np.array(list(found.values()))
    np.testing.assert_allclose(all_corners[:, 0].min(0), [-0.2, -0.5, 0], atol=1e-12)
    np.testing.assert_allclose(all_corners[:, 1].max(0), [0.2, 0.5, 1.1], atol=1e-12)
    for i, height in enumerate((0.2, 0.5, 0.8, 1.1)):
        board = found[f"board{i}"]
        np.testing.assert_allclose(board[:, 2], [height - 0.03, height], atol=1e-12)
        np.testing.assert_allclose(board[:, 1], [found["right"][1, 1], found["left"][0, 1]], atol=1e-12)
        np.testing.assert_allclose(board[1, 0], found["back"][0, 0], atol=1e-12)


def test_one_board_and_one_cabinet():
    """The only board is the upper edge of its shelf; the only cabinet begins at the frame, below a worktop of its own."""
    shelf = boxes(furniture.Shelf("s", heights=(1,)), size=(0.4, 1.0), heights=(0.7,), thickness=0.03)
    assert shelf.keys() == {"right", "left", "back", "board0"}
    np.testing.assert_allclose(shelf["board0"], [[-0.2, -0.47, 0.67], [0.17, 0.47, 0.7]])
    assert {box[1, 2] for box in shelf.values()} == {0.7}
    size = {"widths": (0.8,), "depth": 0.5, "height": 0.9, "thickness": 0.1, "overhang": 0.04}
    counter = boxes(furniture.Counter("c", widths=(1,)), **size)
    assert counter.keys() == {"top0", "cabinet0"}
    np.testing.assert_allclose(counter["top0"], [[-0.5, 0, 0.8], [0, 0.8, 0.9]], atol=1e-12)
    np.testing.assert_allclose(counter["cabinet0"], [[-0.46, 0, 0], [0, 0.8, 0.8]], atol=1e-12)


def test_boards_of_their_own_depth():
    """Each is as deep as its share says, from the back on, and things stand on it alone; other shares are answered."""
    part = furniture.Shelf("s", size=(0.42, 1.0), heights=(0.2, 0.5, 0.8), depths=(1, 0.5, 0.25))
    found = boxes(part)
    for i, deep in enumerate((0.4, 0.2, 0.1)):
        board = found[f"board{i}"]
        assert np.ptp(board[:, 0]) == pytest.approx(deep)
        assert board[1, 0] == pytest.approx(found["back"][0, 0])
        np.testing.assert_allclose(part.surfaces(part.nominal)[i].half, [deep / 2, 0.48])
    arena = furnished(dataclasses.replace(part, pos=(1.5, 0, 0)))
    nominal = arena.nominal_params()
    params = nominal._replace(terms={**nominal.terms, "s.depths": jnp.array([1.0, 1.25, 0.5])})
    assert not arena.valid(params)
    assert arena.problems(params) == ["`terms.s.depths` of part 's board 1' must be between 0.01 and 1, got 1.25."]


def test_bin():
    """The room inside is as large as it says, and closed at the corners."""
    found = boxes(furniture.Bin("b"), inner_size=(0.5, 0.3, 0.2), thickness=0.02)
    np.testing.assert_allclose(found["back"][0, 0] - found["front"][1, 0], 0.5)
    np.testing.assert_allclose(found["left"][0, 1] - found["right"][1, 1], 0.3)
    for wall in ("front", "back", "left", "right"):
        np.testing.assert_allclose(found[wall][:, 2], [0.02, 0.22])
    np.testing.assert_allclose(found["front"][:, 1], found["bottom"][:, 1])
    np.testing.assert_allclose(found["left"][:, 0], [found["front"][1, 0], found["back"][0, 0]], atol=1e-12)


@pytest.mark.parametrize("corner", [None, 0, 1, 3, (1, 4), (0, 2), (0, 5)])
def test_counter(corner):
    """Worktops abut whatever their widths, at one height; in an L and a U rows turn to the front, and no two overlap."""
    widths, depth = np.array([0.5, 0.9, 0.4, 0.7, 0.6, 0.8]), 0.65
    part = furniture.Counter("c", widths=[1] * 6, corner=corner)
    found = boxes(part, widths=widths, depth=depth, height=0.88)
    tops = [found[f"top{i}"] for i in range(6)]
    np.testing.assert_allclose([top[1, 2] for top in tops], 0.88)
    first, last = corner if isinstance(corner, tuple) else (0, 5 if corner is None else corner)
    row = np.arange(first, last + 1)
    corners = np.atleast_1d(-1 if corner is None else corner)
    ends = np.concatenate([[0], np.cumsum(np.where(np.isin(row, corners), depth, widths[row]))])
    for i, low, high in zip(row, ends, ends[1:], strict=False):
        np.testing.assert_allclose(tops[i][:, 1], [low, high])
        np.testing.assert_allclose(tops[i][:, 0], [-depth, 0], atol=1e-12)
    for indices, right in ((range(first)[::-1], 0), (range(last + 1, 6), ends[-1] - depth)):
        at = -depth
        for i in indices:
            np.testing.assert_allclose(tops[i][:, 0], [at - widths[i], at])
            np.testing.assert_allclose(tops[i][:, 1], [right, right + depth], atol=1e-12)
            at -= widths[i]
    for i, top in enumerate(tops):
        cabinet = found[f"cabinet{i}"]
        assert cabinet[0, 2] == pytest.approx(0)
        assert cabinet[1, 2] == pytest.approx(top[0, 2])
        shorter = np.array(
            [cabinet[0, :2] - top[0, :2], top[1, :2] - cabinet[1, :2]]
        )  # at the front and at the right, ...
        inside = np.argwhere(shorter > 1e-9).tolist()  # only at the side of the robot
        assert inside == ([] if i in corners else [[0, 0]] if i in row else [[1, 1]] if i < first else [[0, 1]])


def test_walls():
    """A wall without its hole is covered once, and the hole is where it should be."""
    window = furniture.Wall("w", window=(1, 1))
    found = boxes(window, full_size=(0.2, 4, 2.5), window=(1.2, 0.7), window_at=(0.3, 1.0))
    np.testing.assert_allclose(found["right"][:, 1], [-2, -0.3])
    np.testing.assert_allclose(found["left"][:, 1], [0.9, 2])
    np.testing.assert_allclose(found["below"][:, 2], [0, 1.0])
    np.testing.assert_allclose(found["above"][:, 2], [1.7, 2.5])
    area = sum(np.prod((b[1] - b[0])[1:]) for b in found.values())
    assert area == pytest.approx(4 * 2.5 - 1.2 * 0.7)
    door = boxes(furniture.Wall("d", door=(1, 2)), full_size=(0.2, 4, 2.5), door=(0.9, 2.1), door_at=-0.5)
    assert sum(np.prod((b[1] - b[0])[1:]) for b in door.values()) == pytest.approx(4 * 2.5 - 0.9 * 2.1)
    assert "below" not in door
    np.testing.assert_allclose(boxes(furniture.Wall("p"))["wall"], [[-0.05, -1.5, 0], [0.05, 1.5, 2.4]])


def test_steps_and_ramp():
    """Steps rise by their rises; a ramp's upper side goes from its lower edge to its rise."""
    found = boxes(furniture.Steps("s"), rises=(0.1, 0.2, 0.15), run=0.3)
    np.testing.assert_allclose([found[f"step{i}"][1, 2] for i in range(3)], [0.1, 0.3, 0.45])
    np.testing.assert_allclose([found[f"step{i}"][0, 0] for i in range(3)], [0, 0.3, 0.6], atol=1e-12)
    ramp = furniture.Ramp("r")
    (box,) = ramp.boxes({**ramp.nominal, "run": np.float64(0.8), "rise": np.float64(0.6), "thickness": np.float64(0.1)})
    cos, sin = np.cos(box.tilt), np.sin(box.tilt)
    turn = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    edges = [turn @ (sign * box.half[0], 0, box.half[2]) + box.pos for sign in (-1, 1)]
    np.testing.assert_allclose(edges, [[0, 0, 0], [0.8, 0, 0.6]], atol=1e-12)


def test_rail():
    found = boxes(furniture.Rail("r", n_posts=4), length=3.0, heights=(0.3, 0.8), thickness=0.04)
    np.testing.assert_allclose([found[f"post{i}"].mean(0)[1] for i in range(4)], [-1.5, -0.5, 0.5, 1.5])
    np.testing.assert_allclose([found[f"rail{i}"].mean(0)[2] for i in range(2)], [0.3, 0.8])
    assert found["rail0"][1, 0] == pytest.approx(found["post0"][0, 0])  # in front of the posts


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_worlds_are_compiled(arena, impl):
    """All numbers of all parts others than nominal: each field as in the recompiled model."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    record = arena.record
    template = arena.put_model(impl)
    numbers = [name for name in arena.quantities if not name.endswith("active")]
    for far in (1.0, -0.5, 0.3):
        params = elsewhere(nominal, record.parts, numbers, far)
        assert all((params.terms[name] != nominal.terms[name]).any() for name in numbers)
        assert (
            oracle.from_compiled(arena.apply(template, params), arena.compile(params))
            <= oracle.STRUCTURE_MAY_DIFFER.keys()
        )


@pytest.mark.slow_on("warp")
def test_what_is_absent(arena, impl):
    """Boards and parts that are not there touch nothing and are not drawn; what is left is as compiled without them."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    gone = {"rack.pieces_active": np.array([True, False, True]), "crate.active": np.zeros(1, bool)}
    gone |= dict.fromkeys(("single.pieces_active", "one.pieces_active"), np.zeros(1, bool))
    params = nominal._replace(terms={**nominal.terms, **gone})
    compiled = arena.compile(params)
    names = {compiled.geom(i).name for i in range(compiled.ngeom)}
    absent = {"rack_board1", *(f"crate_{b}" for b in ("bottom", "front", "back", "left", "right"))}
    absent |= {"single_board0", "one_top0", "one_cabinet0"}
    everything = {arena.mj_model.geom(i).name for i in range(arena.mj_model.ngeom)}
    assert names == everything - absent
    model = arena.apply(arena.put_model(impl), params)
    for name in everything:
        geom = arena.mj_model.geom(name).id
        if name in absent:
            assert model.geom_rgba[geom, 3] == 0
            assert model.body_pos[arena.mj_model.geom(name).bodyid[0], 2] > 500
        else:
            np.testing.assert_allclose(model.geom_size[geom], compiled.geom(name).size, rtol=1e-6)


def test_draws_keep_the_key_contract(arena):
    """A part's numbers depend on the world's key and its name alone; boards of one shelf differ."""
    ranges = mja.ArenaRanges(
        terms={"rack.heights": U(-0.05, 0.05, relative="add"), "rack.pos": U([0.0] * 3, [1.0] * 3)}
    )
    key = mja.world_keys(3, [7])[0]
    drawn = arena.sample_params(key, ranges).terms
    alone = furnished(PARTS[0]).sample_params(key, ranges).terms
    for name in ranges.terms:
        np.testing.assert_array_equal(drawn[name], alone[name])
    assert len(np.unique(drawn["rack.heights"] - jnp.asarray(PARTS[0].heights))) == 3


@pytest.mark.slow
def test_objects_keep_clear(arena):
    """Objects on the table touch no box of the bin that stands on it, wherever it is."""
    ranges = mja.ArenaRanges(terms={"crate.pos": U([-0.25, -0.25, 0.8], [0.25, 0.25, 0.8]), "crate.rot": U(-1.5, 1.5)})
    keys = mja.world_keys(0, range(64))
    params = jax.vmap(lambda key: arena.sample_params(key, ranges))(keys)
    place = jax.jit(jax.vmap(lambda key, p: arena.place(p, key)))(keys, params)
    assert place.valid.all()
    crates = jax.jit(jax.vmap(lambda p: standing.standing(PARTS[1:2], p)))(params)
    cube = np.asarray(place.qpos[:, 0])
    yaw = 2 * np.arctan2(cube[:, 6], cube[:, 3])
    own = geometry.slabs(cube[:, :3] + [0, 0, 0.025], yaw, np.full((64, 3), 0.05))
    theirs = geometry.slabs(*(np.asarray(x) for x in crates[:3]))
    depth, touching = geometry.overlap(jax.tree.map(lambda x: x[:, None], own), theirs)
    assert (depth <= touching).all()
    nearest = depth.max()
    assert nearest > -0.02  # some come close
    nominal = jax.tree.map(lambda x: jnp.broadcast_to(x, (64, *x.shape)), arena.nominal_params())
    assert (jax.vmap(lambda k, p: arena.place(p, k))(keys, nominal).qpos != place.qpos).any()


FLAGGED = {
    "boards that cross": (
        {"rack.heights": [0.1, 0.9, 0.5]},
        "`terms.rack.heights` must be from the bottom up, further apart than the boards are thick, and not below the floor [m], "
        "got [0.1, 0.9, 0.5]: board2 is not above board1.",
    ),
    "a window above the wall": (
        {"window.window_at": [[0, 2.0]]},
        "`terms.window.window` must be a hole within the wall's edges [m]",
    ),
    "a worktop thicker than high": (
        {"row.thickness": [2.0]},
        "`terms.row.thickness` must be less than the height [m], got 2.0.",
    ),
    "a length below 0": (
        {"fence.length": [-1.0]},
        "`terms.fence.length` of part 'fence' must be finite and > 0 [m], got -1.",
    ),
    "parts in each other": (
        {"rack.pos": [[3.0, -0.5, 0]]},
        "Part 'rack' and part 'kitchen' overlap, 'rack_right' and 'kitchen_top0' by 0.175 m horizontally and 0.04 m vertically; "
        "other pieces of them may overlap by more.",
    ),
    "a part in the table": ({"fence.pos": [[-0.3, 0.0, 0]]}, "Table 0 and part 'fence' overlap, 'fence_post1' by"),
}


@pytest.mark.parametrize("case", FLAGGED)
def test_wrong_worlds_are_flagged(arena, case):
    """On the device by `valid`, on the host in a sentence."""
    change, says = FLAGGED[case]
    nominal = arena.nominal_params()
    params = nominal._replace(terms={**nominal.terms, **{name: jnp.asarray(x) for name, x in change.items()}})
    assert arena.valid(nominal)
    assert not arena.valid(params)
    problems = arena.problems(params)
    assert says in problems[0]


WRONG = {
    "not a part": (
        lambda: "shelf",
        "`part` must be a part of `mjx_arenas.furniture`, such as Shelf('rack'), got 'shelf'.",
    ),
    "no kind": (lambda: furniture.Part("x"), "`part` must be a part of `mjx_arenas.furniture`, such as Shelf('rack')"),
    "a number for a list": (
        lambda: furniture.Shelf("a", heights=0.5),
        "Part 'a': `heights` must be a list of numbers, got 0.5.",
    ),
    "a list for a number": (
        lambda: furniture.Bin("a", thickness=[1, 2]),
        "Part 'a': `thickness` must be one number, got (1.0, 2.0).",
    ),
    "no name": (lambda: furniture.Shelf(""), "`part.name` must be a non-empty string, got ''."),
    "a name twice": (
        lambda: furniture.Bin("table"),
        "`part.name` must be another one: there is a body 'table', got 'table'.",
    ),
    "heights": (
        lambda: furniture.Shelf("a", heights=(0.2, 0.5, 0.51)),
        "Part 'a': `heights` must be from the bottom up, further apart than the boards are thick, and not below the floor [m], "
        "got (0.2, 0.5, 0.51): board2 is 0.01 m above board1, and the boards are 0.02 m thick.",
    ),
    "a board in the floor": (
        lambda: furniture.Shelf("a", heights=(0.005, 0.5)),
        "Part 'a': `heights` must be from the bottom up, further apart than the boards are thick, and not below the floor [m], "
        "got (0.005, 0.5): board0 is 0.02 m thick, so it reaches 0.015 m below the floor.",
    ),
    "text": (
        lambda: furniture.Shelf("a", size="wide"),
        "Part 'a': `size` must be numbers in a regular array, got 'wide'.",
    ),
    "another number of depths": (
        lambda: furniture.Shelf("a", depths=(1, 0.5)),
        "Part 'a': `depths` must be 4 numbers, one for each board, got (1.0, 0.5).",
    ),
    "deeper than its shelf": (
        lambda: furniture.Shelf("a", heights=(0.2, 0.4), depths=(1, 1.5)),
        "Part 'a': `depths` must be between 0.01 and 1, got (1.0, 1.5).",
    ),
    "two numbers": (
        lambda: furniture.Shelf("a", size=(1, 2, 3)),
        "Part 'a': `size` must be 2 numbers: depth, width, got (1.0, 2.0, 3.0).",
    ),
    "negative": (lambda: furniture.Bin("a", thickness=-1), "Part 'a': `thickness` must be > 0 [m]"),
    "corner": (
        lambda: furniture.Counter("a", corner=3),
        "Part 'a': `corner` must be None, the index of a cabinet, from 0 to 2, or two of them with another between them, got 3.",
    ),
    "corners": (lambda: furniture.Counter("a", corner=(1, 2)), "or two of them with another between them, got (1, 2)."),
    "half a corner": (
        lambda: furniture.Counter("a", corner=(0, 1.5)),
        "or two of them with another between them, got (0, 1.5).",
    ),
    "two holes": (
        lambda: furniture.Wall("a", window=(1, 1), door=(1, 2)),
        "Part 'a': `door` must be None where there is a window: a wall has one hole, got (1.0, 2.0).",
    ),
    "a hole too wide": (
        lambda: furniture.Wall("a", window=(4, 1)),
        "Part 'a': `window` must be a hole within the wall's edges [m], got (4.0, 1.0).",
    ),
    "one post": (
        lambda: furniture.Rail("a", n_posts=1),
        "Part 'a': `n_posts` must be a whole number from 2 to 1000, got 1.",
    ),
    "material": (
        lambda: furniture.Shelf("a", material="oak"),
        "Part 'a': `material` must be a material of the arena, of ",
    ),
    "nan": (lambda: furniture.Shelf("a", pos=(0, 0, np.nan)), "Part 'a': `pos` must be finite, got (0, 0, nan)."),
    "active": (lambda: furniture.Shelf("a", active=1), "Part 'a': `active` must be true or false, got 1."),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_parts(case):
    """One sentence, and the arena is as before."""
    made, says = WRONG[case]
    arena = mja.TableArena()
    before = arena.spec.to_xml()
    with pytest.raises((ValueError, TypeError)) as raised:
        arena.add_part(made())
    assert says in str(raised.value)
    assert arena.spec.to_xml() == before
    assert arena.quantities == ()


def test_too_late(arena):
    _ = arena.mj_model
    with pytest.raises(ValueError, match="`add_part`: the arena is compiled already"):
        arena.add_part(furniture.Shelf("other"))


def test_files(tmp_path):
    """A file has the parts, and ranges of their numbers."""
    arena = furnished(*PARTS[:3])
    ranges = mja.ArenaRanges(terms={"rack.heights": U(-0.05, 0.05, relative="add")})
    mja.save(tmp_path / "kitchen.yaml", arena, ranges)
    again, same = mja.load(tmp_path / "kitchen.yaml")
    assert same == ranges
    assert again.record == arena.record


def test_template_is_not_edited(arena):
    """Two equal arenas are equal records; another number is another."""
    assert furnished(*PARTS).record == arena.record
    assert furnished(*PARTS[:-1], furniture.Rail("fence", pos=(-2.5, 0, 0), length=2.1)).record != arena.record


def test_things_rest_on_boards(arena):
    """A ball on each board, in C of the world: it rests on the board's top as drawn."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    heights = np.array([0.15, 0.6, 0.82])
    params = nominal._replace(terms={**nominal.terms, "rack.heights": heights})
    for height in heights:
        model = arena.compile(params)
        data = mujoco.MjData(model)
        adr = model.joint("cube_joint0").qposadr[0]
        data.qpos[adr : adr + 7] = [1.45, 0, height + 0.03, 1, 0, 0, 0]
        for _ in range(400):
            mujoco.mj_step(model, data)
        assert data.qpos[adr + 2] == pytest.approx(height + 0.025, abs=1e-3)


@pytest.mark.xslow
@pytest.mark.slow
def test_documented():
    """The code of docs/furniture.md as it stands; its table has every part, and all that varies."""
    text = (pathlib.Path(__file__).parent.parent / "docs" / "furniture.md").read_text()
    first, together, walls, corner, galley, own = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    names = {"__name__": "documented"}
    exec(compile(first, "docs/furniture.md", "exec"), names)
    assert names["batch"].params.terms["rack.heights"].shape == (4, 4)
    assert names["batch"].valid.all()
    exec(compile(together, "docs/furniture.md", "exec"), names)
    assert {"sink.widths", "unit.heights", "rack.size"} <= set(names["arena"].quantities)
    assert names["arena"].valid(names["arena"].nominal_params())
    exec(compile(walls, "docs/furniture.md", "exec"), names)
    inwards = {name: names["arena"].mj_model.body(name).quat for name in ("sink", "unit", "rack")}
    assert inwards["sink"] == pytest.approx([1, 0, 0, 0])
    assert inwards["unit"] == pytest.approx([np.sqrt(0.5), 0, 0, np.sqrt(0.5)], abs=1e-4)
    assert (inwards["rack"] == inwards["unit"]).all()
    assert names["arena"].valid(names["arena"].nominal_params())
    exec(compile(corner, "docs/furniture.md", "exec"), names)
    wider = {"kitchen.widths": names["arena"].nominal_params().terms["kitchen.widths"] + 0.1}
    params = names["arena"].nominal_params()
    assert names["arena"].valid(params._replace(terms={**params.terms, **wider}))
    exec(compile(galley, "docs/furniture.md", "exec"), names)
    drawn = jax.vmap(lambda key: names["arena"].sample_params(key, names["ranges"]))(mja.world_keys(0, range(200)))
    assert jax.vmap(lambda p: names["arena"].valid(p, names["ranges"]))(drawn).all()
    assert drawn.terms["galley.pieces_active"].mean(0).min() < 1
    kinds = {
        name: kind for name, kind in vars(furniture).items() if isinstance(kind, type) and kind is not furniture.Part
    }
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", text, flags=re.MULTILINE))
    assert rows.keys() == kinds.keys()
    extra = {"Wall": [kinds["Wall"]("w", window=(1, 1)), kinds["Wall"]("w", door=(1, 1))]}
    for name, kind in kinds.items():
        for part in extra.get(name, [kind("part")]):
            assert all(f"`{quantity}`" in rows[name] for quantity in part.own), name
    exec(compile(own, "docs/furniture.md", "exec"), names)
    assert "bench.size" in names["arena"].quantities


def test_surfaces_documented():
    """The table in docs/placement.md has every part, with the names of all of its surfaces."""
    text = (pathlib.Path(__file__).parent.parent / "docs" / "placement.md").read_text()
    rows = re.findall(r'^\| `((\w+)\(".*\))` \| (.*) \|$', text, flags=re.MULTILINE)
    kinds = {n for n, kind in vars(furniture).items() if isinstance(kind, type) and kind is not furniture.Part}
    assert {kind for _, kind, _ in rows} == kinds
    for call, _, names in rows:
        assert standing.surface_names([eval(call, vars(furniture).copy())]) == re.findall(r"`(\w+)`", names), call


@pytest.mark.parametrize(
    ("ranges", "says"),
    [
        (
            {"rack.height": U(0, 1)},
            "`ranges.terms`: the arena has no quantity 'rack.height': did you mean `rack.heights`?",
        ),
        (
            {"rack.heights": U([0, 0], 1.0)},
            "`ranges.terms.rack.heights` (Uniform): `low` must be one number or of shape (3,), got shape (2,).",
        ),
        (
            {"rack.thickness": U(-1, 1)},
            "`ranges.terms.rack.thickness` of part 'rack' can reach -1.0: it must stay > 0 [m].",
        ),
        (
            {"rack.pieces_active": U(0, 1)},
            "`ranges.terms.rack.pieces_active` (Uniform): true and false need Bernoulli, Count, Choice or Fixed.",
        ),
    ],
)
def test_wrong_ranges(arena, ranges, says):
    with pytest.raises(ValueError, match="ranges") as raised:
        arena.check_ranges(mja.ArenaRanges(terms=ranges))
    assert str(raised.value) == says


def test_two_terms(arena):
    """What a part decides is left to it; what it does not decide may vary beside it."""
    other = furnished(PARTS[0])
    with pytest.raises(ValueError, match="Terms 'rack' and 'size' both decide geom_size of geom 'rack_board0'"):
        other.vary(size=mja.dr.Term("geom.size", "rack_board0"))
    other.vary(soft=mja.dr.Term("geom.solref", "rack_.*"))
    assert len(other.elements("soft")) == 6
