"""Parts beside each other, and layouts of parts: where they stand in every world, by what C MuJoCo says of their geoms."""

import dataclasses
import re

import jax
import mujoco
import numpy as np
import oracle
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.furniture import layouts, standing
from mjx_arenas.params import params
from mjx_arenas.record.elsewhere import elsewhere

U = mja.Uniform
PARTS = (
    furniture.Wall("wall", pos=(2, -1, 0), rot=0.2, full_size=(0.1, 4, 2)),
    *layouts.along(
        furniture.Wall("wall"),
        [
            furniture.Counter("bench", widths=(0.5, 0.4)),
            furniture.Drawers("unit", heights=(0.2, 0.2), openings=(0.1, 0.0)),
            furniture.Shelf("rack", heights=(0.4, 0.9)),
        ],
        start=0.3,
        gap=0.05,
    ),
    furniture.Bin("crate", beside="bench", side="front", pos=(-0.2, 0.1, 0)),
    furniture.Ramp("ramp", beside="rack", side="front", rot=0.3),
    furniture.Cupboard("box", beside="wall", side="back", pos=(0.02, 0, 1), rot=0.5),
    furniture.Bin("side", beside="crate", side="right", pos=(0, -0.1, 0)),
)


def made(parts):
    arena = mja.TableArena((0.4, 0.4, 0.04), table_offset=(-2, 0, 0.6))
    for part in parts:
        arena.add_part(part)
    return arena


@pytest.fixture(scope="module")
def arena():
    return made(PARTS)


def outlines(model, frame):
    """Least and most x, y of the geoms of each part, at its joints' zero, in the axes of the body `frame`."""
    c = mujoco.MjData(model)
    mujoco.mj_kinematics(model, c)
    axes, found = c.body(frame).xmat.reshape(3, 3), {}
    for g in range(model.ngeom):
        part = model.body(model.body_rootid[model.geom_bodyid[g]]).name
        if model.geom_type[g] != mujoco.mjtGeom.mjGEOM_BOX:
            continue
        turn = axes.T @ c.geom_xmat[g].reshape(3, 3)
        half, middle = np.abs(turn) @ model.geom_size[g], axes.T @ c.geom_xpos[g]
        low, high = found.get(part, (np.full(3, np.inf), np.full(3, -np.inf)))
        found[part] = np.minimum(low, middle - half), np.maximum(high, middle + half)
    return found


@pytest.mark.parametrize("far", [0.0, 0.3, -0.2])
def test_abut(arena, far):
    """Whatever the sizes: the row in front of the wall has its backs on the wall, and gaps of 5 cm; the others abut as they say."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    sizes = [
        n
        for n in arena.quantities
        if n.split(".")[1] in ("full_size", "widths", "depth", "size", "inner_size", "thickness", "run")
    ]
    sizes += ["wall.pos", "wall.rot"]
    p = elsewhere(nominal, arena.record.parts, sizes, far)
    found = outlines(arena.compile(p), "wall")
    close = {"atol": 2e-6, "rtol": 0}
    wall, bench, unit, rack = (found[name] for name in ("wall", "bench", "unit", "rack"))
    np.testing.assert_allclose(bench[1][0], wall[0][0], **close)
    np.testing.assert_allclose(bench[0][1], wall[0][1] + 0.3, **close)
    np.testing.assert_allclose(unit[1][0], bench[1][0], **close)
    np.testing.assert_allclose(unit[0][1], bench[1][1] + 0.05, **close)
    np.testing.assert_allclose(rack[1][0], unit[1][0], **close)
    np.testing.assert_allclose(rack[0][1], unit[1][1] + 0.05, **close)
    crate, side = found["crate"], found["side"]
    np.testing.assert_allclose(crate[1][0], bench[0][0] - 0.2, **close)
    np.testing.assert_allclose(crate[0][1], bench[0][1] + 0.1, **close)
    np.testing.assert_allclose(side[1][1], crate[0][1] - 0.1, **close)
    np.testing.assert_allclose(side[1][0], crate[1][0], **close)
    np.testing.assert_allclose(found["box"][0][0], wall[1][0] + 0.02, **close)
    np.testing.assert_allclose(found["ramp"][1][0], rack[0][0], **close)


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_worlds_are_compiled(arena, impl):
    """All numbers of all parts others than nominal: each field as in the recompiled model."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    template = arena.put_model(impl)
    numbers = [name for name in arena.quantities if not name.endswith("active")]
    for far in (0.2, 0.1):
        params = elsewhere(nominal, arena.record.parts, numbers, far)
        assert (
            oracle.from_compiled(arena.apply(template, params), arena.compile(params))
            <= oracle.STRUCTURE_MAY_DIFFER.keys()
        )


def test_a_neighbour_may_be_absent(arena):
    """A part stays where it is without the one beside which it stands."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    p = nominal._replace(terms={**nominal.terms, "bench.active": np.zeros(1, bool)})
    with_, without = outlines(arena.compile(nominal), "wall"), outlines(arena.compile(p), "wall")
    assert without.keys() == with_.keys() - {"bench"}
    for name in without:
        np.testing.assert_array_equal(without[name], with_[name])


def test_layouts():
    """Rings face their middle, grids keep their spacing, corridors their width, in C."""
    shelves = [furniture.Shelf(f"s{i}", size=(0.3, 0.5)) for i in range(5)]
    model = made(layouts.ring(shelves, 1.2, center=(0.5, 0.2))).mj_model
    c = mujoco.MjData(model)
    mujoco.mj_kinematics(model, c)
    for i in range(5):
        front = c.body(f"s{i}").xmat.reshape(3, 3) @ (-0.15, 0, 0) + c.body(f"s{i}").xpos
        to_middle = np.array([0.5, 0.2]) - front[:2]
        assert np.linalg.norm(to_middle) == pytest.approx(1.2)
        np.testing.assert_allclose(c.body(f"s{i}").xmat.reshape(3, 3)[:2, 0], -to_middle / 1.2, atol=1e-9)

    bins = layouts.grid([furniture.Bin(f"b{i}") for i in range(5)], 2, (0.8, 0.6), pos=(1, -1, 0.1), rot=0.3)
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    for i, part in enumerate(bins):
        np.testing.assert_allclose(part.pos[:2], (1, -1) + turn @ (0.8 * (i // 2), 0.6 * (i % 2)), atol=1e-12)
    assert {part.rot for part in bins} == {0.3}

    ways = made(layouts.corridor(shelves[:3], [*shelves[3:], furniture.Bin("b")], 1.4, gap=0.1))
    found = outlines(ways.mj_model, "world")
    np.testing.assert_allclose([found[f"s{i}"][0][1] for i in range(3)], 0.7, atol=1e-9)
    np.testing.assert_allclose([found[f"s{i}"][1][1] for i in (3, 4)], -0.7, atol=1e-9)
    np.testing.assert_allclose([found[f"s{i}"][0][0] for i in range(3)], [0, 0.6, 1.2], atol=1e-9)
    np.testing.assert_allclose([found[name][0][0] for name in ("s3", "s4", "b")], [0, 0.6, 1.2], atol=1e-9)


CUPBOARD = furniture.Cupboard("c", pos=(9, 9, 1.4), rot=2.0)
RACK = furniture.Shelf("s", pos=(9, 9, 0.1), rot=2.0)
BOX = furniture.Bin("b", pos=(9, 9, 0.7), rot=2.0)
HUNG = {
    "row": lambda parts: layouts.row(parts, pos=(1, 2, 0.3), rot=0.5, gap=0.1),
    "along": lambda parts: layouts.along(furniture.Wall("wall", pos=(3, 0, 0.3)), parts),
    "ring": lambda parts: layouts.ring(parts, 2.0),
    "grid": lambda parts: layouts.grid(parts, 2, (1.5, 1.5), pos=(1, 2, 0.3), rot=0.5),
    "corridor, left": lambda parts: layouts.corridor(parts, [furniture.Ramp("r")], 2.0),
    "corridor, right": lambda parts: layouts.corridor([], parts, 2.0),
}


@pytest.mark.parametrize("case", HUNG)
def test_layouts_keep_heights(case):
    """Above the layout's own; x, y and yaw of the parts have no say. In C."""
    own = [CUPBOARD, RACK, BOX]
    base = 0.3 if case in ("row", "along", "grid") else 0.0
    wall = [furniture.Wall("wall", pos=(3, 0, 0.3))] * (case == "along")
    bare = [dataclasses.replace(part, pos=(0, 0, part.pos[2]), rot=0.0) for part in own]
    placed = HUNG[case](own)
    assert placed == HUNG[case](bare)
    model = made([*wall, *placed]).mj_model
    c = mujoco.MjData(model)
    mujoco.mj_kinematics(model, c)
    for part in own:
        assert c.body(part.name).xpos[2] == pytest.approx(base + part.pos[2], abs=1e-12)


SHELF, SPOT = furniture.Shelf("a"), furniture.Zone("z")
PARTS_TOLD = "must be a list of parts of furniture, at least one"
SOLID = "must be a part of furniture with boxes"
WRONG_LAYOUTS = {
    "nothing in a row": (lambda: layouts.row([]), f"`parts` {PARTS_TOLD}, got []."),
    "nothing along a wall": (lambda: layouts.along(SHELF, []), f"`parts` {PARTS_TOLD}, got []."),
    "nothing around": (lambda: layouts.ring([], 1.0), f"`parts` {PARTS_TOLD}, got []."),
    "no list": (lambda: layouts.row(SHELF), f"`parts` {PARTS_TOLD}, got Shelf"),
    "text": (lambda: layouts.row("abc"), f"`parts` {PARTS_TOLD}, got 'abc'."),
    "an object": (
        lambda: layouts.grid([mja.Object("o")], 1, (1, 1)),
        "`parts[0]` must be a part of furniture, got Object",
    ),
    "names": (lambda: layouts.ring([SHELF, "b"], 1.0), f"`parts[1]` {SOLID}, got 'b'."),
    "the class of all": (lambda: layouts.row([furniture.part.Part("p")]), f"`parts[0]` {SOLID}, got Part"),
    "a wall's name": (lambda: layouts.along("w", [SHELF]), f"`wall` {SOLID}, got 'w'."),
    "a zone for a wall": (lambda: layouts.along(SPOT, [SHELF]), f"`wall` {SOLID}, got Zone"),
    "a zone in a row": (lambda: layouts.row([SHELF, SPOT]), f"`parts[1]` {SOLID}, got Zone"),
    "a zone around": (lambda: layouts.ring([SPOT], 2.0), f"`parts[0]` {SOLID}, got Zone"),
    "a zone in a corridor": (lambda: layouts.corridor([SPOT], [], 1.0), f"`left[0]` {SOLID}, got Zone"),
    "a corridor of no lists": (
        lambda: layouts.corridor(SHELF, RACK, 1.0),
        "2 problems in `corridor`:\n- `left` must be a list of parts of furniture, at least one, got Shelf",
    ),
    "a corridor of nothing": (lambda: layouts.corridor([], [], 1.0), f"`left` {PARTS_TOLD}, got []."),
    "a wrong part": (
        lambda: layouts.ring([furniture.Bin("b", thickness=-1.0)], 2.0),
        "`parts[0].thickness` must be > 0 [m], got -1.0.",
    ),
    "beside another": (
        lambda: layouts.row([furniture.Bin("b", beside="a")]),
        "`parts[0].beside` must be None, as the layout decides where it stands, got 'a'.",
    ),
    "a table under the second": (
        lambda: layouts.row([SHELF, furniture.Bin("b", on="table")]),
        "`parts[1].on` must be None, as it stands beside 'a', got 'table'.",
    ),
    "a table before a wall": (
        lambda: layouts.along(SHELF, [furniture.Bin("b", on="table")]),
        "`parts[0].on` must be None, as it stands beside 'a', got 'table'.",
    ),
    "half columns": (lambda: layouts.grid([SHELF], 1.5, (1, 1)), "`columns` must be a whole number >= 1, got 1.5."),
    "no columns": (lambda: layouts.grid([SHELF], 0, (1, 1)), "`columns` must be a whole number >= 1, got 0."),
    "fewer": (lambda: layouts.grid([SHELF], -1, (1, 1)), "`columns` must be a whole number >= 1, got -1."),
    "a columns' truth": (
        lambda: layouts.grid([SHELF], True, (1, 1)),
        "`columns` must be a whole number >= 1, got True.",
    ),
    "one spacing": (lambda: layouts.grid([SHELF], 1, 1.0), "`spacing` must be 2 finite numbers [m], got 1.0."),
    "a radius below 0": (lambda: layouts.ring([SHELF], -1), "`radius` must be > 0 [m], got -1."),
    "a radius in words": (lambda: layouts.ring([SHELF], "1 m"), "`radius` must be a finite number [m], got '1 m'."),
    "one angle": (lambda: layouts.ring([SHELF], 1, angles=1.0), "`angles` must be 2 finite numbers [rad], got 1.0."),
    "a center in space": (
        lambda: layouts.ring([SHELF], 1, center=(0, 0, 0)),
        "`center` must be 2 finite numbers [m], got (0, 0, 0).",
    ),
    "a corridor of no width": (lambda: layouts.corridor([SHELF], [], -1), "`width` must be > 0 [m], got -1."),
    "a place on the plane": (lambda: layouts.row([SHELF], (1, 2)), "`pos` must be 3 finite numbers [m], got (1, 2)."),
    "a yaw that is none": (lambda: layouts.row([SHELF], rot=np.nan), "`rot` must be a finite number [rad], got nan."),
    "a gap below 0": (lambda: layouts.row([SHELF], gap=-0.1), "`gap` must be >= 0 [m], got -0.1."),
    "a start in words": (
        lambda: layouts.along(SHELF, [RACK], start="left"),
        "`start` must be a finite number [m], got 'left'.",
    ),
    "an argument that it has not": (
        lambda: layouts.row([SHELF], gaps=1),
        "row has no argument 'gaps': did you mean 'gap'?",
    ),
}


@pytest.mark.parametrize("case", WRONG_LAYOUTS)
def test_wrong_layouts(case):
    call, says = WRONG_LAYOUTS[case]
    with pytest.raises((ValueError, TypeError)) as raised:
        call()
    assert str(raised.value).startswith(says)


WRONG = {
    "no such part": (
        {"beside": "desk"},
        "Part 'a': `beside`: there is no part 'desk' with boxes, which must be added before this one; known are rack.",
    ),
    "itself": (
        {"beside": "a"},
        "Part 'a': `beside`: there is no part 'a' with boxes, which must be added before this one; known are rack.",
    ),
    "a zone": (
        {"beside": "spot"},
        "Part 'a': `beside`: there is no part 'spot' with boxes, which must be added before this one; known are rack.",
    ),
    "both": ({"beside": "rack", "on": "table"}, "Part 'a': `on` must be None where there is `beside`, got 'table'."),
    "a side": (
        {"beside": "rack", "side": "north"},
        "Part 'a': `side` must be one of 'left', 'right', 'front', 'back', got 'north'.",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong(case):
    given, says = WRONG[case]
    arena = made([furniture.Shelf("rack", pos=(1.5, 0, 0)), furniture.Zone("spot")])
    before = arena.spec.to_xml()
    with pytest.raises(ValueError, match=r"[Pp]art") as raised:
        arena.add_part(furniture.Bin("a", **given))
    assert str(raised.value) == says
    assert arena.spec.to_xml() == before


def test_beside_zones_alone():
    arena = made([furniture.Zone("spot")])
    for name in ("spot", "later"):
        says = rf"^Part 'a': `beside`: there is no part '{name}' with boxes, which must be added before this one; known are none\.$"
        with pytest.raises(ValueError, match=says):
            arena.add_part(furniture.Bin("a", beside=name))


def test_wider_than_what_carries_it():
    """A part that is longer and wider than its table or surface is told; one that is longer alone is not."""
    arena = mja.TableArena()
    arena.add_part(furniture.Bin("long", on="table", inner_size=(2, 0.2, 0.2), pos=(0, -0.2, 0)))
    says = "Part 'wide' is 2.02 x 2.02 m, seen from above, larger than table 0, on which it stands, and which is 0.8 x 0.8 m: this is "
    with pytest.warns(UserWarning, match=f"^{re.escape(says)}"):
        arena.add_part(furniture.Bin("wide", on="table", inner_size=(2, 2, 0.2), pos=(0, 0, 0.5)))
    arena.add_part(furniture.Shelf("rack", pos=(2, 0, 0)))
    with pytest.warns(UserWarning, match="larger than 'rack_board3', on which it stands"):
        arena.add_part(furniture.Bin("tray", on="rack_board3", inner_size=(1, 1, 0.1)))


def test_files(arena, tmp_path):
    mja.save(tmp_path / "scene.yaml", arena, mja.ArenaRanges())
    again, _ = mja.load(tmp_path / "scene.yaml")
    assert again.record == arena.record


def test_a_ramp_is_as_wide_on_both_sides():
    """What is tilted has the same outline on the host and on the device."""
    arena = made([furniture.Ramp("ramp", run=0.8, rise=0.5, thickness=0.2)])
    on_host = standing.standing(arena.layout.places.furniture, on_host_params(arena))
    parts = arena.layout.places.furniture
    on_device = jax.jit(lambda p: standing.standing(parts, p))(arena.nominal_params())
    for host, device in zip(on_host, on_device, strict=True):
        np.testing.assert_allclose(host, device, rtol=1e-6, atol=1e-7)
    found = outlines(arena.mj_model, "world")["ramp"]
    np.testing.assert_allclose(on_host.full_size[0], found[1] - found[0], rtol=1e-6)


def on_host_params(arena):
    return jax.tree.map(np.asarray, params.on_host(arena.nominal_params()))
