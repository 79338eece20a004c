"""Objects on furniture: they stand where a part's surface is in each world, as compiled, apart from all else, and rest there."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import oracle
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.furniture import standing, surfaces
from mjx_arenas.record.elsewhere import elsewhere

U = mja.Uniform
PARTS = (
    furniture.Shelf("rack", pos=(1.5, 0, 0), rot=0.3, heights=(0.1, 0.5, 0.9)),
    furniture.Bin("crate", pos=(0.2, 0.1, 0.8), inner_size=(0.3, 0.25, 0.1)),
    furniture.Counter("kitchen", pos=(3.4, -1.2, 0), widths=(0.6, 0.5, 0.4), corner=1),
    furniture.Steps("stairs", pos=(-1.5, 1.5, 0)),
    furniture.Drawers("drawers", pos=(1.2, -1.8, 0), rot=-0.4, openings=(0.3, 0.0, 0.1)),
    furniture.Cupboard("cupboard", pos=(1.5, 2, 0.4), opening=1.2),
    furniture.Zone("spot", pos=(-1.5, -1, 0), rot=0.2, size=(0.6, 0.8)),
)
OBJECTS = (
    mja.Object("book", full_size=(0.2, 0.12, 0.03), on="rack_board1"),
    mja.Object("tin", "sphere", full_size=0.08, on="crate_bottom"),
    mja.Object("pan", full_size=(0.2, 0.2, 0.06), on="kitchen_top2"),
    mja.Object("cloth", full_size=(0.15, 0.1, 0.04), on="drawers_drawer0_bottom"),
    mja.Object("jar", "capsule", full_size=(0.12, 0.08, 0.08), on="cupboard_bottom"),
    mja.Object("case", full_size=(0.4, 0.2, 0.25), on="spot"),
)
RANGES = mja.ArenaRanges(
    table_offsets=U(-0.05, 0.05, relative="add"),
    object_full_sizes=U(0.9, 1.1, relative="scale"),
    terms={
        "rack.heights": U(-0.05, 0.05, relative="add"),
        "rack.pos": U([-0.05, -0.05, 0.0], 0.05, relative="add"),
        "rack.rot": U(-1.0, 1.0),
        "crate.pos": U([-0.03, -0.03, 0.05], [0.03, 0.03, 0.1], relative="add"),
        "kitchen.widths": U(0.4, 0.6),
        "kitchen.height": U(0.8, 1.0),
        "drawers.openings": U([0.2, 0.0, 0.0], [0.33, 0.05, 0.1]),
        "drawers.rot": U(-1.0, 1.0),
        "cupboard.opening": U(0.8, 1.9),
        "spot.pos": U([-0.2, -0.2, 0], [0.2, 0.2, 0], relative="add"),
        "spot.rot": U(-3.0, 3.0),
    },
)


def furnished(parts=PARTS, objects=OBJECTS):
    arena = mja.TableArena((0.8, 0.8, 0.05), objects=[mja.Object("cube")])
    for part in parts:
        arena.add_part(part)
    for obj in objects:
        arena.add_object(obj)
    return arena


@pytest.fixture(scope="module")
def arena():
    return furnished()


def drawn(arena, n, ranges=RANGES):
    keys = mja.world_keys(0, range(n))
    return keys, jax.jit(jax.vmap(lambda key: arena.sample_params(key, ranges)))(keys)


def worlds(params):
    return [jax.tree.map(lambda x, w=w: np.asarray(x)[w], params) for w in range(len(params.table_rots))]


def test_names(arena):
    """Tables come first; then each part has its surfaces, called like the boxes whose upper sides they are."""
    assert arena.surfaces[:5] == ["table", "rack_board0", "rack_board1", "rack_board2", "crate_bottom"]
    assert arena.surfaces[-1] == "spot"
    geoms = set(standing.names(PARTS))
    assert set(arena.surfaces[1:-1]) <= geoms
    assert [arena.surfaces[t] for t in arena.nominal_params().object_tables] == ["table", *(o.on for o in OBJECTS)]
    assert arena.describe(arena.nominal_params()).objects[1].table == "rack_board1"


def test_surfaces_are_upper_sides(arena):
    """In C of the world, with its joints where they start: each is level with the top of its box, within it, and turned like it."""
    _, params = drawn(arena, 4)
    for p in worlds(params):
        found = surfaces.surfaces(p, PARTS)
        model, c = arena.c_world(p)
        for name, top, rot, size in zip(arena.surfaces, found.top, found.rot, found.size, strict=True):
            if name == "spot":
                np.testing.assert_array_equal(top, p.terms["spot.pos"][0])
                continue
            geom = model.geom("table_collision" if name == "table" else name)
            axes, half = c.geom_xmat[geom.id].reshape(3, 3), geom.size
            np.testing.assert_allclose(axes[:, 0], [np.cos(rot), np.sin(rot), 0], atol=1e-6)
            local = axes.T @ (top - c.geom_xpos[geom.id])
            assert local[2] == pytest.approx(half[2], abs=1e-6), name
            assert (np.abs(local[:2]) + size / 2 <= half[:2] + 1e-6).all(), name
            assert (size >= 0.8 * 2 * half[:2]).all(), name


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_worlds_are_compiled(arena, impl):
    """All numbers of all parts and objects others than nominal, objects on the next surface: each field as in the recompiled model."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    template = arena.put_model(impl)
    numbers = [name for name in (*nominal._fields, *arena.quantities) if not name.endswith(("active", "terms"))]
    for far in (0.3, 0.1):
        params = elsewhere(nominal, arena.record.parts, numbers, far)
        assert (
            oracle.from_compiled(arena.apply(template, params), arena.compile(params))
            <= oracle.STRUCTURE_MAY_DIFFER.keys()
        )


@pytest.mark.xslow
@pytest.mark.slow
def test_placed_apart(arena):
    """In C, objects of drawn places touch nothing and are as high above their surfaces as they should be, within the edges."""
    keys, params = drawn(arena, 32)
    placed = jax.jit(jax.vmap(arena.place))(params, keys)
    heights = np.asarray(jax.vmap(arena.rest_heights)(params))
    assert np.asarray(placed.valid).all()
    assert jax.vmap(arena.valid)(params).all()
    for w, p in enumerate(worlds(params)):
        model, c = arena.c_world(p, key=keys[w])
        free = {model.body(o.name).id for o in arena.objects}
        below = surfaces.surfaces(p, PARTS).of(p.object_tables)
        for contact in c.contact:
            mine = free & set(model.geom_bodyid[contact.geom].tolist())
            assert not mine or contact.dist > -1e-5, [model.geom(g).name for g in contact.geom]
        for k, obj in enumerate(arena.objects):
            pos = c.body(obj.name).xpos
            assert pos[2] == pytest.approx(heights[w, k], abs=1e-5)
            assert pos[2] == pytest.approx(below.top[k, 2] + p.object_full_sizes[k, 2] / 2, abs=1e-5)
            turn = below.rot[k]
            local = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) @ (pos - below.top[k])[:2]
            assert (np.abs(local) <= below.size[k] / 2 - p.object_full_sizes[k, :2].min() / 2 + 1e-5).all()


@pytest.mark.slow
def test_things_rest(arena):
    """In C, everything stays where it is put, drawers that are pulled out, too."""
    keys, params = drawn(arena, 3)
    for w, p in enumerate(worlds(params)):
        model, c = arena.c_world(p, key=keys[w])
        bodies = [model.body(o.name).id for o in arena.objects]
        before = c.xpos[bodies].copy()
        for _ in range(500):
            mujoco.mj_step(model, c)
        np.testing.assert_allclose(c.xpos[bodies], before, atol=1.5e-3)
        assert np.abs(c.qvel).max() < 1e-2


@pytest.mark.xslow
@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_steps(arena, impl):
    """MJX lets things rest as C does."""
    keys, params = drawn(arena, 2)
    batch = arena.randomize(arena.put_model(impl), keys, RANGES)
    data = mja.rollout(batch, mja.make_data(batch, keys), 60)
    for w, p in enumerate(worlds(params)):
        model, c = arena.c_world(p, key=keys[w])
        for _ in range(60):
            mujoco.mj_step(model, c)
        bodies = [model.body(o.name).id for o in arena.objects]
        np.testing.assert_allclose(np.asarray(data.xpos[w])[bodies], c.xpos[bodies], atol=5e-4)


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_a_drawer_takes_things_along(impl):
    """A drawer that is pushed in takes the cloth in it along, in C, and in MJX as far."""
    arena = furnished([PARTS[4]], [OBJECTS[3]])
    params, n = jax.tree.map(np.asarray, arena.nominal_params()), 250
    model, c = arena.c_world(params)
    joint = model.joint("drawers_drawer0")
    start, before = c.qpos[joint.qposadr[0]], c.body("cloth").xpos.copy()
    c.qfrc_applied[joint.dofadr[0]] = -8.0
    mujoco.mj_step(model, c, nstep=n)
    moved = c.qpos[joint.qposadr[0]] - start
    assert moved < -0.1
    pushed = c.body("cloth").xpos - before
    assert np.linalg.norm(pushed) == pytest.approx(-moved, rel=0.03)
    batch = arena.batch(arena.put_model(impl), jax.tree.map(lambda x: jnp.asarray(x)[None], params))
    data = mja.make_data(batch)
    data = data.replace(qfrc_applied=data.qfrc_applied.at[:, joint.dofadr[0]].set(-8.0))
    end = mja.rollout(batch, data, n)
    assert end.qpos[0, joint.qposadr[0]] - start == pytest.approx(moved, rel=0.01)
    got = np.asarray(end.xpos[0, model.body("cloth").id])
    np.testing.assert_allclose(got - before, pushed, atol=2e-3)


@pytest.mark.slow
def test_absent_boards(arena):
    """What stands on a board that is absent is absent, in C, too; objects that may choose stand on boards that are there."""
    active = mja.ArenaRanges(terms={"rack.pieces_active": mja.Bernoulli(0.5), "crate.active": mja.Bernoulli(0.5)})
    _, params = drawn(arena, 32, active)
    np.testing.assert_array_equal(params.object_active[:, 1], params.terms["rack.pieces_active"][:, 1])
    np.testing.assert_array_equal(params.object_active[:, 2], params.terms["crate.active"][:, 0])
    assert params.object_active[:, 3:].all()
    gone = next(p for p in worlds(params) if not p.object_active[1])
    compiled = arena.compile(gone)
    assert mujoco.mj_name2id(compiled, mujoco.mjtObj.mjOBJ_BODY, "book") == -1
    nominal = arena.nominal_params()
    by_hand = nominal._replace(terms={**nominal.terms, "crate.active": jnp.zeros(1, bool)})
    assert mujoco.mj_name2id(arena.compile(by_hand), mujoco.mjtObj.mjOBJ_BODY, "tin") == -1

    index = [arena.surfaces.index(name) for name in ("rack_board0", "rack_board1", "rack_board2", "kitchen_top0")]
    choice = active._replace(object_tables=mja.Choice(index))
    _, params = drawn(arena, 64, choice)
    there = np.concatenate([params.terms["rack.pieces_active"], np.ones((64, 1), bool)], axis=1)
    chosen = np.asarray(params.object_tables)
    assert set(np.unique(chosen)) == set(index)
    assert all(there[w, index.index(t)] for w in range(64) for t in chosen[w])
    assert params.object_active.all()
    key = mja.world_keys(3, [5])[0]
    one = arena.sample_params(key, choice)
    again = arena.decode(arena.encode(one, choice), choice)
    np.testing.assert_array_equal(again.object_tables, one.object_tables)
    assert np.isfinite(arena.log_prob(one, choice))


@pytest.mark.slow
def test_no_room():
    """What is too tall for the room below the next board finds no place, and starts above all that stands."""
    rack = furniture.Shelf("rack", pos=(1, 0, 0), heights=(0.2, 0.5, 1.4))
    arena = furnished([rack], [mja.Object("crate", full_size=(0.1, 0.1, 0.32), on="rack_board0")])
    with pytest.warns(UserWarning, match="rack_board1") as warned:
        _ = arena.mj_model
    assert str(warned[0].message) == (
        "'rack_board1' and 'crate' start 0.040 m inside each other at their nominal places; there is no free place, with keys, too: "
        "'crate' starts above the others, as `place(params, key).valid` says."
    )
    params, key = arena.nominal_params(), mja.world_keys(0, [0])[0]
    placed = arena.place(params, key)
    assert placed.valid.tolist() == [True, False]
    assert placed.qpos[1, 2] > 1.4 + 0.15
    higher = params._replace(terms={**params.terms, "rack.heights": jnp.array([0.1, 0.5, 1.4])})
    assert arena.place(higher, key).valid.all()
    assert arena.problems(params, key=key) == [
        "Object 'crate' finds no free place, and starts above the other objects."
    ]


def test_zone_around_a_post():
    """What is fixed to the world in a zone keeps objects off it."""
    arena = mja.TableArena((0.4, 0.4, 0.05))
    arena.add_part(furniture.Zone("spot", pos=(2, 0, 0), size=(0.5, 0.5)))
    arena.spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=(0.1, 0.5, 0), pos=(2, 0, 0.5))
    arena.add_object(mja.Object("cube", full_size=0.1, pos=(0.18, 0.18), on="spot"))
    params, keys = arena.nominal_params(), mja.world_keys(0, range(100))
    placed = jax.vmap(lambda key: arena.place(params, key))(keys)
    assert placed.valid.all()
    assert np.linalg.norm(placed.qpos[:, 0, :2] - np.array([2.0, 0.0]), axis=-1).min() > 0.15


def test_files_and_copies(arena, tmp_path):
    """A file has the objects, and the same arena made anew is the same record."""
    choice = RANGES._replace(object_tables=mja.Choice([1, 2]))
    mja.save(tmp_path / "kitchen.yaml", arena, choice)
    again, same = mja.load(tmp_path / "kitchen.yaml")
    assert same == choice
    assert again.record == arena.record


def test_merged():
    """Tables that come in count before furniture: objects stay on their boards."""
    one = furnished([PARTS[0]], [mja.Object("book", full_size=(0.2, 0.12, 0.03), on="rack_board2")])
    two = mja.MultiTableArena([(3, 0, 0.8), (3, 2, 0.7)], objects=[mja.Object("cup", on=1)])
    both = one.merge(two, "far_")
    on = dict(zip((o.name for o in both.objects), both.nominal_params().object_tables, strict=True))
    assert {name: both.surfaces[t] for name, t in on.items()} == {
        "cube": "table",
        "book": "rack_board2",
        "far_cup": "far_table1",
    }
    assert both.c_world(both.nominal_params())[1].body("book").xpos[2] == pytest.approx(0.9 + 0.015)


def test_condim():
    """What carries an object with torsional friction has it, too, whichever came first."""
    obj = mja.Object("peg", condim=4, on="rack_board1")
    arena = furnished([PARTS[0]], [obj])
    assert (arena.mj_model.geom_condim[arena.mj_model.geom("rack_board1").id]) == 4
    arena = mja.TableArena(objects=[mja.Object("peg", condim=4)])
    arena.add_part(PARTS[0])
    assert (arena.mj_model.geom_condim[arena.mj_model.geom("rack_board1").id]) == 4


WRONG = {
    "no such surface": (
        mja.Object("a", on="rack_board7"),
        "Object 'a': `on` must be an index from 0 to 3 or one of 'table', 'rack_board0', 'rack_board1', 'rack_board2', "
        "got 'rack_board7': furniture that carries it "
        "must be added first, by `add_part`, and the object then by `add_object`.",
    ),
    "no such index": (mja.Object("a", on=4), "`on` must be an index from 0 to 3 or one of 'table', 'rack_board0'"),
    "a box that is no surface": (mja.Object("a", on="rack_back"), "`on` must be an index from 0 to 3"),
    "a name that is taken": (mja.Object("rack"), "Object 'rack': the arena already has an element of that name."),
    "an object twice": (mja.Object("cube"), "Object 'cube': the arena already has an element of that name."),
    "larger than its board": (
        mja.Object("a", full_size=(0.5, 0.5, 0.1), on="rack_board1"),
        "Object 'a' is 0.5 x 0.5 m, larger than 'rack_board1', which is 0.33 x 0.86 m.",
    ),
    "no object": ("mug", "`obj` must be an mjx_arenas.Object, got 'mug'."),
    "a size": (mja.Object("a", full_size=-1), "Object 'a': `full_size` must be"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_objects(case):
    """One sentence, and the arena is as before."""
    obj, says = WRONG[case]
    arena = furnished([PARTS[0]], [])
    before, calls = arena.spec.to_xml(), len(arena.calls)
    with pytest.raises((ValueError, TypeError)) as raised:
        arena.add_object(obj)
    assert says in str(raised.value)
    assert arena.spec.to_xml() == before
    assert len(arena.objects) == 1
    assert len(arena.calls) == calls


def test_wrong_use(arena):
    _ = arena.mj_model
    with pytest.raises(ValueError, match="`add_object`: the arena is compiled already"):
        arena.add_object(mja.Object("late"))
    most = len(arena.surfaces) - 1
    with pytest.raises(ValueError, match=f"`ranges.object_tables` must be indices from 0 to {most}, got 0 to 99"):
        arena.check_ranges(mja.ArenaRanges(object_tables=mja.Choice([0, 99])))
    params = arena.nominal_params()
    (problem,) = arena.problems(params._replace(object_tables=params.object_tables.at[1].set(99)))
    assert problem == f"`object_tables` of object 'book' must be from 0 to {most}, got 99."
    sizes = params.object_full_sizes.at[1].set(jnp.array([0.5, 0.5, 0.1]))
    (problem,) = arena.problems(params._replace(object_full_sizes=sizes))
    assert problem.startswith("Object 'book' is 0.5 x 0.5 m, larger than 'rack_board1', which is 0.33 x 0.86 m.")
    assert not arena.valid(params._replace(object_full_sizes=sizes))
    with pytest.warns(UserWarning, match=r"off 'rack_board0', whose top reaches 0.165 m x 0.43 m from its middle"):
        furnished([PARTS[0]], [mja.Object("far", pos=(0.5, 0), on="rack_board0")])
    small = furniture.Shelf("rack", pos=(1.5, 0, 0), size=(0.2, 0.3))
    boxes = [mja.Object(f"o{i}", full_size=0.1, on="rack_board0") for i in range(5)]
    with pytest.warns(UserWarning, match="The 5 objects on 'rack_board0' cover"):
        furnished([small], boxes)
