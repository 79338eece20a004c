"""Parts that stand on tables and on other parts: they follow in every world, as compiled, and are absent with what carries them."""

import dataclasses

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import oracle
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.record.elsewhere import elsewhere

U = mja.Uniform
SMALL = {"size": (0.2, 0.2), "heights": (0.06, 0.06), "thickness": 0.008, "openings": (0.05, 0)}
PARTS = (
    furniture.Bin("tray", pos=(0.1, -0.1, 0), rot=0.4, inner_size=(0.2, 0.15, 0.03), on=0),
    furniture.Shelf("rack", pos=(2, 0, 0), rot=0.5),
    furniture.Bin("crate", pos=(0.02, -0.1, 0), rot=-0.2, inner_size=(0.2, 0.3, 0.1), on="rack_board2"),
    furniture.Bin("cup", inner_size=(0.05, 0.05, 0.04), thickness=0.005, on="crate_bottom"),
    furniture.Drawers("cabinet", pos=(0.3, 0.3, 0), **SMALL, on="table1", stays=True),
)


@pytest.fixture(scope="module")
def arena():
    arena = mja.MultiTableArena([(0, 0, 0.8), (0, 2, 0.5)], table_full_sizes=(0.9, 0.9, 0.05))
    for part in PARTS:
        arena.add_part(part)
    arena.add_object(mja.Object("ball", "sphere", 0.04, on="cup_bottom"))
    arena.add_object(mja.Object("box", full_size=(0.05, 0.05, 0.03), on="cabinet_drawer0_bottom"))
    return arena


def test_frames(arena):
    """In C, a part's frame is where its numbers say in the frame of what it stands on."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    for far in (0.0, 0.4):
        numbers = [name for name in arena.quantities if not name.endswith("active")]
        p = elsewhere(nominal, arena.record.parts, [*nominal._fields[:4], *numbers], far)
        model, c = arena.c_world(p)

        def frame(body, geom=None, model=model, c=c):
            found = np.eye(4)
            found[:3, :3], found[:3, 3] = c.body(body).xmat.reshape(3, 3), c.body(body).xpos
            if geom is not None:
                found[:3, 3] = c.geom(geom).xpos + found[:3, 2] * model.geom(geom).size[2]
            return found

        for part, below in (
            ("tray", frame("table0", "table0_collision")),
            ("crate", frame("rack", "rack_board2")),
            ("cup", frame("crate", "crate_bottom")),
            ("cabinet", frame("table1", "table1_collision")),
        ):
            rot, pos = p.terms[f"{part}.rot"][0], p.terms[f"{part}.pos"][0]
            local = np.linalg.inv(below) @ frame(part)
            np.testing.assert_allclose(local[:3, 3], pos, atol=1e-6)
            np.testing.assert_allclose(local[:2, 0], [np.cos(rot), np.sin(rot)], atol=1e-6)


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_worlds_are_compiled(arena, impl):
    """Each quantity alone was proven when the arena was compiled; here all together: each field as in the recompiled model."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    template = arena.put_model(impl)
    numbers = [name for name in (*nominal._fields, *arena.quantities) if not name.endswith(("active", "terms"))]
    for far in (0.2, 0.1):
        params = elsewhere(nominal, arena.record.parts, numbers, far)
        assert (
            oracle.from_compiled(arena.apply(template, params), arena.compile(params))
            <= oracle.STRUCTURE_MAY_DIFFER.keys()
        )


@pytest.mark.slow
def test_absent_with_what_carries_it(arena):
    """A crate is gone with its board, a tray with its table, and with them all that stands in them; in C, too."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    board = {**nominal.terms, "rack.pieces_active": np.array([True, True, False, True])}
    gone = nominal._replace(terms=board, table_active=np.array([False, True]))
    compiled = arena.compile(gone)
    bodies = {compiled.body(b).name for b in range(compiled.nbody)}
    assert bodies.isdisjoint({"table0", "tray", "rack_board2", "crate", "cup", "ball"})
    assert bodies >= {"table1", "rack", "rack_board1", "cabinet", "box"}
    model = arena.apply(arena.put_model("jax"), gone)
    absent = [b for b in range(arena.mj_model.nbody) if arena.mj_model.body(b).name not in bodies]
    geoms = np.isin(arena.mj_model.geom_bodyid, absent)
    assert (np.asarray(model.geom_rgba)[geoms, 3] == 0).all()
    assert (np.asarray(model.geom_rgba)[~geoms, 3][arena.mj_model.geom_rgba[~geoms, 3] > 0] > 0).all()
    ranges = mja.ArenaRanges(terms={"rack.pieces_active": mja.Bernoulli(0.5)})
    drawn = jax.vmap(lambda k: arena.sample_params(k, ranges))(mja.world_keys(0, range(16)))
    np.testing.assert_array_equal(drawn.object_active[:, 0], drawn.terms["rack.pieces_active"][:, 2])


@pytest.mark.slow
def test_placed(arena):
    """Objects find places on what is carried, wherever it is, and touch nothing there in C."""
    terms = {"tray.pos": U([-0.1, -0.1, 0.0], [0.1, 0.1, 0.0]), "rack.rot": U(-3.0, 3.0), "crate.rot": U(-0.1, 0.1)}
    terms["rack.heights"] = U(-0.05, 0.05, relative="add")
    ranges = mja.ArenaRanges(table_offsets=U(-0.1, 0.1, relative="add"), table_rots=U(-3.0, 3.0), terms=terms)
    keys = mja.world_keys(0, range(8))
    params = jax.vmap(lambda k: arena.sample_params(k, ranges))(keys)
    assert jax.vmap(arena.valid)(params).all()
    assert jax.vmap(arena.place)(params, keys).valid.all()
    for w in range(8):
        p = jax.tree.map(lambda x, w=w: np.asarray(x)[w], params)
        model, c = arena.c_world(p, key=keys[w])
        for contact in c.contact:
            names = [model.geom(g).name for g in contact.geom]
            assert not {"ball_g0", "box_g0"} & set(names) or contact.dist > -1e-5, names


def test_files(arena, tmp_path):
    mja.save(tmp_path / "scene.yaml", arena, mja.ArenaRanges())
    again, _ = mja.load(tmp_path / "scene.yaml")
    assert again.record == arena.record


WRONG = {
    "unknown": (
        furniture.Bin("a", on="desk"),
        "Part 'a': `on` must be the index of a table, or one of 'table', 'unit_drawer0_bottom', 'unit_drawer1_bottom', 'unit_top', "
        "or None, got 'desk': furniture that carries it must be added first.",
    ),
    "an index": (furniture.Bin("a", on=1), "Part 'a': `on` must be the index of a table, or one of 'table'"),
    "what moves": (
        furniture.Bin("a", on="unit_drawer1_bottom"),
        "Part 'a': `on` must be what does not move, or None, got 'unit_drawer1_bottom'.",
    ),
    "always there on what goes": (
        furniture.Cupboard("a", on="rack_board1", stays=True),
        "Part 'a': `on` must be what is always there, as with Shelf('rack', stays=True), or None, got 'rack_board1'.",
    ),
    "a list": (furniture.Bin("a", on=["table"]), "Part 'a': `on` must be the index of a table"),
    "truth": (furniture.Bin("a", on=True), "Part 'a': `on` must be the index of a table"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong(case):
    part, says = WRONG[case]
    arena = mja.TableArena()
    arena.add_part(furniture.Drawers("unit", pos=(1, 1, 0), heights=(0.2, 0.2), openings=(0, 0)))
    if case == "always there on what goes":
        arena.add_part(furniture.Shelf("rack", pos=(2, 0, 0)))
    with pytest.raises(ValueError, match="on") as raised:
        arena.add_part(part)
    assert says in str(raised.value)


def test_what_cannot_be_absent(arena):
    """A table with a part on it that stays is always there."""
    ranges, template = mja.ArenaRanges(table_active=mja.Bernoulli(0.5)), arena.put_model("jax")
    with pytest.raises(ValueError, match="table 1 can be absent, but 'cabinet' is fixed on it"):
        arena.randomize(template, mja.world_keys(0, range(2)), ranges)
    params = arena.nominal_params()
    (problem,) = arena.problems(params._replace(table_active=jnp.array([True, False])))
    assert "'cabinet' is fixed on it" in problem


def test_things_rest(arena):
    """In C, what lies in the cup in the crate on the board stays there."""
    model, c = arena.c_world(jax.tree.map(np.asarray, arena.nominal_params()), key=mja.world_keys(0, [3])[0])
    before = c.body("ball").xpos.copy()
    for _ in range(300):
        mujoco.mj_step(model, c)
    np.testing.assert_allclose(c.body("ball").xpos, before, atol=1e-3)


POST = """<mujoco><worldbody>
  <geom name="post" type="box" size=".04 .05 .1" pos="0 0 .1"/>
  <body pos="0 0 .25"><joint name="turn" axis="0 0 1"/><geom size=".03" mass="1"/></body>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def manned():
    """A robot on a worktop that grows, and one beside a shelf, below which a ball may lie."""
    arena = mja.TableArena(objects=[mja.Object("cube", full_size=0.05)])
    arena.add_part(furniture.Counter("bench", pos=(1.5, -1.2, 0), rot=0.2, widths=(0.5, 0.4, 0.3), stays=True))
    arena.add_part(furniture.Shelf("rack", pos=(-1.5, 0, 0), rot=-0.4, stays=True))
    arena.add_part(
        furniture.Drawers("unit", pos=(0, 0, 0), size=(0.25, 0.25), heights=(0.1,), openings=(0.0,), on="bench_top2")
    )
    arena.attach(POST, "one_", pos=(0.1, 0.05, 0.02), on="bench_top1")
    arena.attach(POST, "two_", pos=(-0.4, 0.3, 0.0), on="rack")
    arena.add_object(mja.Object("ball", "sphere", 0.06, on="bench_top1"))
    return arena


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_robots_follow(manned, impl):
    """They are as compiled, on a top that moves as cabinets grow; and stand there in C, with the same distance to what carries them."""
    nominal = jax.tree.map(np.asarray, manned.nominal_params())
    template = manned.put_model(impl)
    numbers = [name for name in manned.quantities if not name.endswith("active")]
    assert not {"bench.active", "rack.active"} & set(manned.quantities)
    assert manned.mounts == ["one_mount", "two_mount"]
    params = elsewhere(nominal, manned.record.parts, numbers, 0.3)
    compiled = manned.compile(params)
    assert oracle.from_compiled(manned.apply(template, params), compiled) <= oracle.STRUCTURE_MAY_DIFFER.keys()
    for p, model in ((nominal, manned.mj_model), (params, compiled)):
        c = mujoco.MjData(model)
        mujoco.mj_kinematics(model, c)
        top, rot = c.geom("bench_top1"), p.terms["bench.rot"][0]
        turn = np.array([[np.cos(rot), -np.sin(rot), 0], [np.sin(rot), np.cos(rot), 0], [0, 0, 1]])
        above = top.xpos + model.geom("bench_top1").size * [0, 0, 1]
        np.testing.assert_allclose(c.body("one_mount").xpos, above + turn @ (0.1, 0.05, 0.02), atol=1e-6)
        rack = c.body("rack")
        local = rack.xmat.reshape(3, 3).T @ (c.body("two_mount").xpos - rack.xpos)
        np.testing.assert_allclose(local, (-0.4, 0.3, 0), atol=1e-6)


@pytest.mark.slow
def test_parts_that_grow_into_robots(manned):
    """A world is flagged if, and only if, the part reaches into the base of the robot beside it, by C's distances."""
    nominal, seen = jax.tree.map(np.asarray, manned.nominal_params()), set()
    for depth in np.linspace(0.3, 1.2, 7):
        params = nominal._replace(terms={**nominal.terms, "rack.size": np.array([[depth, 0.9]])})
        model, c = manned.c_world(params)
        boxes = [g for g in range(model.ngeom) if model.geom(g).name.startswith("rack_")]
        away = min(mujoco.mj_geomDistance(model, c, model.geom("two_post").id, g, 1.0, None) for g in boxes)
        assert manned.valid(params) == (away > 0) == (not manned.problems(params))
        assert all("Part 'rack'" in one and "'two_post'" in one for one in manned.problems(params))
        seen.add(away > 0)
    assert len(seen) == 2


@pytest.mark.slow
def test_objects_keep_clear_of_robots(manned):
    """Of their bases, wherever these are."""
    terms = {"bench.widths": U(0.35, 0.7), "bench.rot": U(-0.2, 0.2), "bench.height": U(0.7, 1.0)}
    keys = mja.world_keys(0, range(24))
    params = jax.vmap(lambda k: manned.sample_params(k, mja.ArenaRanges(terms=terms)))(keys)
    placed = jax.vmap(manned.place)(params, keys)
    assert placed.valid.all()
    nearest = np.inf
    for w in range(24):
        p = jax.tree.map(lambda x, w=w: np.asarray(x)[w], params)
        model, c = manned.c_world(p, key=keys[w])
        post = next(g for g in range(model.ngeom) if model.geom(g).name == "one_post")
        away = mujoco.mj_geomDistance(model, c, post, model.geom("ball_g0").id, 1.0, None)
        assert away > 0
        nearest = min(nearest, away)
    assert nearest < 0.05


@pytest.mark.parametrize(
    ("on", "says"),
    [
        ("shelf", "`on` must be the index of a table, or one of 'table', 'rack_board0', 'rack_board1', "),
        ("rack", "`on` must be what is always there, as with Shelf('rack', stays=True), or None, got 'rack'."),
        (
            "rack_board1",
            "`on` must be what is always there, as with Shelf('rack', stays=True), or None, got 'rack_board1'.",
        ),
        ("unit_drawer0_bottom", "`on` must be what does not move, or None, got 'unit_drawer0_bottom'."),
    ],
)
def test_wrong_mounts(on, says):
    arena = mja.TableArena()
    arena.add_part(furniture.Shelf("rack", pos=(1.5, 0, 0)))
    arena.add_part(furniture.Drawers("unit", pos=(-1.5, 0, 0)))
    before = arena.spec.to_xml()
    with pytest.raises(ValueError, match="`on`") as raised:
        arena.attach(POST, "r_", on=on)
    assert str(raised.value).startswith(says)
    assert arena.spec.to_xml() == before


HUNG = (0, 1, 0, 0)  # upside down


@pytest.fixture(scope="module")
def hung():
    """Robots below a table and below a board, and one on a board, of a shelf that stays."""
    arena = mja.TableArena(objects=[mja.Object("cube", full_size=0.05)])
    rack = furniture.Shelf("rack", pos=(1.5, 0, 0), rot=0.3, heights=(0.1, 0.6, 1.1), depths=(1, 0.8, 1), stays=True)
    arena.add_part(rack)
    arena.attach(POST, "low_", pos=(0.1, 0.05, -0.01), quat=HUNG, on="table", under=True)
    arena.attach(POST, "hung_", pos=(0.05, 0.1, -0.02), quat=HUNG, on="rack_board1", under=True)
    arena.attach(POST, "high_", pos=(0.0, -0.2, 0.0), on="rack_board2")
    arena.add_object(mja.Object("tall", full_size=(0.06, 0.06, 0.35), on="rack_board0"))
    return arena


@pytest.mark.slow_on("warp")
def test_robots_hang(hung, impl):
    """They follow the underside as it comes down, as compiled; there is no board that could leave one in the air."""
    nominal = jax.tree.map(np.asarray, hung.nominal_params())
    numbers = [name for name in (*nominal._fields, *hung.quantities) if not name.endswith(("active", "terms"))]
    assert not {"rack.active", "rack.pieces_active"} & set(hung.quantities)
    template = hung.put_model(impl)
    for far in (0.0, 0.3, -0.2):
        params = elsewhere(nominal, hung.record.parts, numbers, far)
        compiled = hung.compile(params)
        assert oracle.from_compiled(hung.apply(template, params), compiled) <= oracle.STRUCTURE_MAY_DIFFER.keys()
        c = mujoco.MjData(compiled)
        mujoco.mj_kinematics(compiled, c)
        for mount, geom, side, pos in (
            ("low_mount", "table_collision", -1, (0.1, 0.05, -0.01)),
            ("hung_mount", "rack_board1", -1, (0.05, 0.1, -0.02)),
            ("high_mount", "rack_board2", 1, (0.0, -0.2, 0.0)),
        ):
            slab = c.geom(geom)
            local = slab.xmat.reshape(3, 3).T @ (c.body(mount).xpos - slab.xpos)
            np.testing.assert_allclose(local, np.add(pos, (0, 0, side * compiled.geom(geom).size[2])), atol=1e-6)


@pytest.mark.slow
def test_objects_keep_clear_of_what_hangs(hung):
    """However thick the board is at which it hangs; and a world is not valid in which one is in a part."""
    terms = {"rack.thickness": U(0.02, 0.08), "rack.size": U([0.3, 0.5], [0.5, 0.7])}
    keys = mja.world_keys(0, range(24))
    params = jax.vmap(lambda k: hung.sample_params(k, mja.ArenaRanges(terms=terms)))(keys)
    placed = jax.vmap(hung.place)(params, keys)
    nearest, below = np.inf, []
    for w in np.flatnonzero(placed.valid.all(1)):
        model, c = hung.c_world(jax.tree.map(lambda x, w=w: np.asarray(x)[w], params), key=keys[w])
        away = mujoco.mj_geomDistance(model, c, model.geom("hung_post").id, model.geom("tall_g0").id, 1.0, None)
        assert away > 0
        nearest = min(nearest, away)
        below.append(c.geom("hung_post").xpos[2])
    assert placed.valid.mean() > 0.8
    assert nearest < 0.05
    assert np.ptp(below) > 0.04
    nominal = hung.nominal_params()
    for height in (0.5, 2.0):
        over = nominal._replace(table_offsets=jnp.array([[1.5, 0.05, height]]))
        assert ("'low_post'" in " ".join(hung.problems(over))) == (height == 0.5)
        assert hung.valid(over) == (height == 2.0)


PEG = """<mujoco><worldbody><geom name="peg" type="box" size=".01 .01 .015" pos="0 0 .015"/>
  <body pos="0 0 .041"><joint axis="0 0 1"/><geom size=".01" mass="1"/></body></worldbody></mujoco>"""
UNDER = {
    "rack_board1": (furniture.Shelf("rack", stays=True), (0.05, 0.1, -0.01)),
    "crate_bottom": (furniture.Bin("crate", stays=True), (-0.02, 0.03, -0.02)),
    "kitchen_top2": (furniture.Counter("kitchen", stays=True), (-0.285, 0.1, 0)),  # in front of the cabinet
    "unit_top": (furniture.Drawers("unit", stays=True), (0, 0.05, 0)),  # above the sides of the drawer
    "cupboard_bottom": (furniture.Cupboard("cupboard", stays=True), (0.1, 0, -0.01)),
    "stairs_step1": (furniture.Steps("stairs", stays=True), (0.1, 0, 0)),
    "gantry_rail0": (furniture.Rail("gantry", height=1.6, heights=(1.5,), stays=True), (0, 0.4, -0.03)),
}
"""Boxes below which a robot may hang, each with its part, and where."""


@pytest.fixture(scope="module")
def pegged():
    """A robot under each, a metre above the floor."""
    arena = mja.TableArena()
    for i, (on, (part, pos)) in enumerate(UNDER.items()):
        arena.add_part(dataclasses.replace(part, pos=(3 + 3 * (i % 4), 3 * (i // 4), 1), rot=0.4 * i))
        arena.attach(PEG, f"{part.name}_", pos=pos, quat=HUNG, on=on, under=True)
    return arena


@pytest.mark.slow
def test_robots_hang_under_every_part(pegged, impl):
    """Each follows the height and the thickness of its box, as compiled."""
    arena = pegged
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    assert arena.problems(nominal) == []
    numbers = [name for name in arena.quantities if "opening" not in name]
    template, seen = arena.put_model(impl), []
    for far in (0.3, -0.2):
        params = elsewhere(nominal, arena.record.parts, numbers, far)
        compiled = arena.compile(params)
        assert oracle.from_compiled(arena.apply(template, params), compiled) <= oracle.STRUCTURE_MAY_DIFFER.keys()
        c = mujoco.MjData(compiled)
        mujoco.mj_kinematics(compiled, c)
        for on, (part, pos) in UNDER.items():
            box, mount = c.geom(on), c.body(f"{part.name}_mount").xpos
            local = box.xmat.reshape(3, 3).T @ (mount - box.xpos)
            behind = (
                params.terms["cupboard.thickness"][0] / 2 if part.name == "cupboard" else 0
            )  # the back is no surface
            np.testing.assert_allclose(local, np.subtract(pos, (behind, 0, compiled.geom(on).size[2])), atol=1e-6)
        seen.append([c.body(f"{part.name}_mount").xpos[2] for part, _ in UNDER.values()])
    assert (np.ptp(seen, axis=0) > 0.01).all()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:'gantry_rail1' and 'tall' start")
def test_things_stand_on_rails():
    """A robot on a rail, and a thing on another, which keeps clear of the rail above."""
    arena = mja.TableArena()
    arena.add_part(furniture.Rail("gantry", pos=(2, 0, 0), heights=(0.4, 0.6, 0.9), thickness=0.08, stays=True))
    arena.attach(PEG, "arm_", pos=(0, 0.5, 0), on="gantry_rail2")
    arena.add_object(mja.Object("box", full_size=(0.06, 0.06, 0.1), on="gantry_rail1"))
    arena.add_object(mja.Object("tall", full_size=(0.06, 0.06, 0.15), on="gantry_rail0"))
    assert arena.surfaces[1:] == ["gantry_rail0", "gantry_rail1", "gantry_rail2"]
    model, c = arena.c_world(arena.nominal_params(), key=mja.world_keys(0, [1])[0])
    assert c.body("arm_mount").xpos[2] == pytest.approx(0.9 + 0.04)
    assert c.body("box").xpos[2] == pytest.approx(0.6 + 0.04 + 0.05, abs=1e-6)
    (fits, not_) = arena.place(arena.nominal_params(), mja.world_keys(0, [1])[0]).valid
    assert fits
    assert not not_
    model.opt.gravity[:] = (0, 0, -9.81)
    mujoco.mj_step(model, c, 100)
    assert c.body("box").xpos[2] == pytest.approx(0.6 + 0.04 + 0.05, abs=5e-4)


@pytest.mark.parametrize(
    ("on", "says"),
    [
        (
            None,
            "`on` must be a table, or a surface that is the upper side of a box, where it is `under` that, got None.",
        ),
        *(
            (
                on,
                f"`on` must be a table, or a surface that is the upper side of a box, where it is `under` that, got {on!r}.",
            )
            for on in ("rack", "wall", "ramp", "spot")
        ),
    ],
)
def test_nothing_to_hang_at(hung, on, says):
    arena = mja.TableArena()
    parts = (furniture.Shelf("rack"), furniture.Wall("wall"), furniture.Ramp("ramp"), furniture.Zone("spot"))
    for i, part in enumerate(parts):
        arena.add_part(dataclasses.replace(part, pos=(1.5, 3 * i, 0), stays=True))
    with pytest.raises(ValueError, match="`on`") as raised:
        arena.attach(POST, "r_", on=on, under=True)
    assert str(raised.value) == says
