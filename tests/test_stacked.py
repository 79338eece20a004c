"""Objects on top of other objects: they stand there wherever those are, and are absent with them; none carries itself."""

import functools

import jax
import mujoco
import numpy as np
import oracle
import pytest
from worlds import take

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.record.elsewhere import elsewhere

U = mja.Uniform
OBJECTS = (
    mja.Object("tray", full_size=(0.4, 0.3, 0.02), pos=(0.1, 0.1), rot=0.3),
    mja.Object("box", full_size=(0.1, 0.1, 0.06), on="tray"),
    mja.Object("cup", "cylinder", (0.05, 0.05, 0.08), on="box"),
    mja.Object("can", "cylinder", (0.1, 0.1, 0.1), pos=(-0.3, -0.3)),
    mja.Object("lid", "cylinder", (0.08, 0.08, 0.02), on="can"),
    mja.Object("brick", full_size=(0.12, 0.06, 0.04), on="tray", pose="resting"),
    mja.Object("ball", "sphere", 0.03, on="brick"),
)
NAMES = [o.name for o in OBJECTS]
CARRIERS = ["tray", "box", "can", "brick"]
RANGES = mja.ArenaRanges(
    table_offsets=U(-0.1, 0.1, relative="add"),
    table_rots=U(-3.0, 3.0),
    object_full_sizes=U(0.9, 1.1, relative="scale", tied="axes"),
    terms={"brick.pose": mja.Choice(list(range(6)))},
)


@functools.cache
def scene(cylinders=True):
    """MJX on JAX does not collide cylinders with boxes."""
    objects = [o for o in OBJECTS if cylinders or o.type != "cylinder"]
    return mja.TableArena((1.0, 1.0, 0.05), objects=objects)


def drawn(ranges, n):
    keys = mja.world_keys(0, range(n))
    return keys, jax.jit(jax.vmap(lambda key: scene().sample_params(key, ranges)))(keys)


def stands_on(model, c, name, below, atol):
    """Whether an object, a box, a cylinder or a ball, stands on the top of another one, in C: by its corners, or points of its rim."""
    geom, other = model.geom(f"{name}_g0"), model.geom(f"{below}_g0")
    if geom.type[0] == mujoco.mjtGeom.mjGEOM_BOX:
        local = np.stack(np.meshgrid(*([-x, x] for x in geom.size)), axis=-1).reshape(-1, 3)
    else:
        turn, height = np.linspace(0, 2 * np.pi, 360), geom.size[1] or geom.size[0]
        rim = np.stack([np.cos(turn), np.sin(turn)], axis=-1) * geom.size[0]
        local = np.concatenate([np.column_stack([rim, np.full(360, z)]) for z in (-height, height)])
    points = c.geom_xpos[geom.id] + local @ c.geom_xmat[geom.id].reshape(3, 3).T
    axes, size = c.geom_xmat[other.id].reshape(3, 3), other.size
    up = int(np.argmax(np.abs(axes[2])))
    assert abs(axes[2, up]) == pytest.approx(1, abs=1e-6)
    seen = (points - c.geom_xpos[other.id]) @ axes
    half = size[[0, 0, 1]] if other.type[0] == mujoco.mjtGeom.mjGEOM_CYLINDER else size
    assert (points[:, 2] - c.geom_xpos[other.id][2]).min() == pytest.approx(half[up], abs=atol), (name, below)
    flat = seen[:, [i for i in range(3) if i != up]]
    if other.type[0] == mujoco.mjtGeom.mjGEOM_CYLINDER:
        assert np.linalg.norm(flat, axis=1).max() <= size[0] + atol, (name, below)
    else:
        assert (np.abs(flat) <= half[[i for i in range(3) if i != up]] + atol).all(), (name, below)


def test_names():
    arena = scene()
    assert arena.surfaces == ["table", *CARRIERS]
    nominal = arena.nominal_params()
    assert [arena.surfaces[t] for t in nominal.object_tables] == [
        "table",
        "tray",
        "box",
        "table",
        "can",
        "tray",
        "brick",
    ]
    assert arena.describe(nominal).objects[2].table == "box"
    np.testing.assert_allclose(
        arena.rest_heights(nominal) - 0.8, [0.01, 0.05, 0.12, 0.05, 0.11, 0.04, 0.075], atol=1e-6
    )


@pytest.mark.slow
def test_drawn_places():
    """In C of each world: on top, within the edges, apart from all else; and a second later still there."""
    arena, (keys, params) = scene(), drawn(RANGES, 32)
    valid = np.asarray(jax.vmap(arena.valid)(params))
    placed = jax.jit(jax.vmap(arena.place))(params, keys)
    assert valid.mean() > 0.9
    assert np.asarray(placed.valid)[valid].all()
    heights = np.asarray(jax.vmap(arena.rest_heights)(params))
    np.testing.assert_allclose(heights[valid], placed.qpos[:, :, 2][valid], atol=2e-6)
    on = dict(zip(NAMES, ["", "tray", "box", "", "can", "tray", "brick"], strict=True))
    spread = []
    for w in np.flatnonzero(valid)[:8].tolist():
        model, c = arena.c_world(take(params, w), key=keys[w])
        assert min([contact.dist for contact in c.contact], default=0.0) > -1e-5
        for name, below in on.items():
            if below:
                stands_on(model, c, name, below, 1e-5)
        bodies = [model.body(name).id for name in NAMES]
        tray = c.body("tray")
        spread.append(tray.xmat.reshape(3, 3).T @ (c.body("box").xpos - tray.xpos))
        before = c.xpos[bodies].copy()
        for _ in range(500):
            mujoco.mj_step(model, c)
        assert (
            np.linalg.norm((c.xpos[bodies] - before)[:-1], axis=1).max() < 1e-3
        )  # half a millimetre for each that is below
        assert abs(c.xpos[bodies][-1, 2] - before[-1, 2]) < 1e-3  # a ball may roll
    assert (np.ptp(spread, axis=0)[:2] > 0.1).all()  # all over


def test_nominal_places():
    """In C of the nominal arena, the same; a stack of three, turned like what is below."""
    arena = scene()
    model, c = arena.c_world(jax.tree.map(np.asarray, arena.nominal_params()))
    for name, below in (("box", "tray"), ("cup", "box"), ("lid", "can"), ("ball", "brick")):
        stands_on(model, c, name, below, 1e-6)
    np.testing.assert_allclose(c.body("cup").xmat, c.body("tray").xmat, atol=1e-6)


@pytest.mark.slow_on("warp")
def test_worlds_are_compiled(impl):
    """Each field of worlds in which all numbers are others is that of the recompiled model: loads follow the sizes of what is below."""
    arena = scene(cylinders=False)
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    template = arena.put_model(impl)
    write = jax.jit(lambda p: arena.apply(template, p))
    numbers = [
        name
        for name in (*nominal._fields, *arena.quantities)
        if not name.endswith(("active", "terms", "object_tables"))
    ]
    for far in (0.3, -0.2):
        params = elsewhere(nominal, arena.record.parts, numbers, far)
        assert oracle.from_compiled(write(params), arena.compile(params)) <= oracle.STRUCTURE_MAY_DIFFER.keys()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["box", "cylinder"])
def test_on_variants(kind, impl):
    """What stands on an object with variants is on top of the variant of its world, within its edges, and rests there; as compiled."""
    variants = [mja.Object("a", kind, (0.3, 0.3, 0.02)), mja.Object("b", kind, (0.2, 0.2, 0.1))]
    objects = [mja.Object("tray", variants=variants), mja.Object("cube", full_size=0.06, on="tray")]
    arena = mja.TableArena((1.0, 1.0, 0.05), objects=objects)
    ranges, keys = mja.ArenaRanges(terms={"tray.variant": mja.Choice([0, 1])}), mja.world_keys(0, range(12))
    params = jax.vmap(lambda key: arena.sample_params(key, ranges))(keys)
    assert jax.vmap(arena.place)(params, keys).valid.all()
    template, seen = arena.put_model(impl) if (kind, impl) != ("cylinder", "jax") else None, set()
    for w in range(12):
        p = take(jax.tree.map(np.asarray, params), w)
        name = "ab"[int(p.terms["tray.variant"][0])]
        model, c = arena.c_world(p, key=keys[w])
        geom, size = c.geom(f"tray_{name}_g0"), model.geom(f"tray_{name}_g0").size
        top = np.array([0, 0, size[2] if kind == "box" else size[1]])
        corners = [(x, y, -0.03) for x in (-0.03, 0.03) for y in (-0.03, 0.03)]
        cube = c.body("cube").xpos + corners @ c.body("cube").xmat.reshape(3, 3).T
        seen_from = (cube - geom.xpos) @ geom.xmat.reshape(3, 3) - top
        np.testing.assert_allclose(seen_from[:, 2], 0, atol=1e-6)
        reach = np.abs(seen_from[:, :2]) if kind == "box" else np.linalg.norm(seen_from[:, :2], axis=1)
        assert (reach <= size[0] + 1e-6).all()
        before = c.body("cube").xpos.copy()
        mujoco.mj_step(model, c, nstep=250)
        np.testing.assert_allclose(c.body("cube").xpos, before, atol=5e-4)
        if name not in seen and template is not None:
            compared, off = oracle.of_what_is_left(arena.apply(template, p), arena.mj_model, arena.compile(p))
            assert len(compared) > 40
            assert off == set()
        seen.add(name)
    assert seen == {"a", "b"}


def test_equal_tops():
    """A stack of cans and one of boxes, each as large as the one below."""
    can, box = mja.Object("can0", "cylinder", (0.07, 0.07, 0.1)), mja.Object("box0", full_size=0.08)
    arena = mja.TableArena(objects=[can, box])
    for i in (1, 2):
        arena.add_object(mja.Object(f"can{i}", "cylinder", (0.07, 0.07, 0.1), on=f"can{i - 1}"))
        arena.add_object(mja.Object(f"box{i}", full_size=0.08, on=f"box{i - 1}"))
    keys = mja.world_keys(0, range(16))
    placed = jax.jit(jax.vmap(lambda key: arena.place(arena.nominal_params(), key)))(keys)
    assert arena.problems(arena.nominal_params()) == []
    assert placed.valid.all()
    for kind in ("can", "box"):
        at = [[o.name for o in arena.objects].index(f"{kind}{i}") for i in range(3)]
        pos = np.asarray(placed.qpos)[:, at, :3]
        np.testing.assert_allclose(pos[:, 1:, :2], pos[:, :1, :2].repeat(2, axis=1), atol=1e-5)
        np.testing.assert_allclose(np.diff(pos[..., 2], axis=1), 0.1 if kind == "can" else 0.08, atol=1e-6)


CHOICE = mja.ArenaRanges(object_tables=mja.Choice([0, 1, 2, 3, 4]), object_active=mja.Bernoulli(0.8))


def test_absent_with_what_carries_it():
    """By a plain loop; and compiled worlds are without it."""
    arena, (_, params) = scene(), drawn(CHOICE, 200)
    carrier = [NAMES.index(name) for name in CARRIERS]
    on, active = np.asarray(params.object_tables), np.asarray(params.object_active)
    for w in range(200):
        for k in range(len(NAMES)):
            if on[w, k] > 0:
                assert carrier[on[w, k] - 1] < k
                assert not active[w, k] or active[w, carrier[on[w, k] - 1]]
    assert (on[:, 6] > 0).mean() > 0.4
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    gone = nominal._replace(object_active=np.array([n != "tray" for n in NAMES]))
    compiled = arena.compile(gone)
    assert {compiled.body(b).name for b in range(1, compiled.nbody)} == {"table", "can", "lid"}
    template = arena.put_model("warp")
    drawn_alpha = np.asarray(arena.apply(template, gone).geom_rgba)[:, 3]
    for name in NAMES:
        assert (drawn_alpha[arena.mj_model.geom(f"{name}_g0").id] > 0) == (name in ("can", "lid"))


def test_tied_to_others():
    """Ranges that make absent what a weld ties are refused, those of boards, too; an object that stands on no object never is."""
    arena = mja.TableArena(objects=[mja.Object("tray", full_size=0.2), mja.Object("lid", full_size=0.1)])
    arena.add_part(furniture.Shelf("rack", pos=(1.5, 0, 0), heights=(0.3, 0.8)))
    arena.add_object(mja.Object("book", full_size=0.1, on="rack_board1"))
    arena.add_object(mja.Object("egg", "sphere", 0.05, on="tray"))
    weld = arena.spec.add_equality(type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY)
    weld.name1, weld.name2, weld.data[10] = "tray", "book", 1
    assert arena.surfaces == ["table", "rack_board0", "rack_board1", "tray"]
    boards = mja.ArenaRanges(terms={"rack.pieces_active": mja.Bernoulli(0.5)})
    with pytest.raises(ValueError, match="object 'book' can be absent, but equality 0"):
        arena.check_ranges(boards, held=True)
    arena.check_ranges(mja.ArenaRanges(object_tables=mja.Choice([0, 3])), held=True)
    with pytest.raises(ValueError, match="object 'tray' can be absent, but equality 0"):
        arena.check_ranges(boards._replace(object_tables=mja.Choice([0, 1])), held=True)
    boards = boards._replace(object_tables=mja.Choice([0, 3]))
    arena.check_ranges(boards, held=True)
    keys = mja.world_keys(0, range(64))
    assert jax.jit(jax.vmap(lambda key: arena.sample_params(key, boards)))(keys).object_active[:, [0, 2]].all()


def test_as_likely_as_drawn():
    """On what is there, by the given probabilities: those of the second object by hand."""
    p = np.full((7, 3), [0.5, 0.25, 0.25])
    ranges = mja.ArenaRanges(object_tables=mja.Choice([0, 1, 2], p=p), object_active=mja.Bernoulli([0.7, *[1.0] * 6]))
    _, params = drawn(ranges, 4000)
    on, tray = np.asarray(params.object_tables), np.asarray(params.object_active[:, 0])
    assert (on[:, 0] == 0).all()
    assert (on[~tray, 1] == 0).all()  # the box does not stand on itself
    assert (on[tray, 1] == 1).mean() == pytest.approx(1 / 3, abs=0.03)
    assert (on[tray, 2] == 1).mean() == pytest.approx(1 / 4, abs=0.03)
    assert (on[~tray, 2] == 2).mean() == pytest.approx(1 / 3, abs=0.04)
    one = take(params, 3)
    again = scene().decode(
        scene().encode(one, ranges._replace(object_active=None)), ranges._replace(object_active=None)
    )
    np.testing.assert_array_equal(again.object_tables, one.object_tables)


def test_tied_choice():
    """One draw chooses for all, each among what it may stand on: as likely as the draws between the edges of all, by hand."""
    ranges = mja.ArenaRanges(object_tables=mja.Choice([0, 1, 2], tied=True))  # table, tray and box
    _, params = drawn(ranges, 100)
    worlds, first = np.unique(params.object_tables, axis=0, return_index=True)
    # The tray stands on the table, the box on the tray from a half on, and all else on the tray and on the box from one and two thirds on.
    by_hand = {(0, 0, 0): 1 / 3, (0, 0, 1): 1 / 6, (0, 1, 1): 1 / 6, (0, 1, 2): 1 / 3}
    assert {tuple(on[:3]) for on in worlds.tolist()} == by_hand.keys()
    for on, w in zip(worlds.tolist(), first.tolist(), strict=True):
        one = take(params, w)
        assert np.exp(scene().log_prob(one, ranges)) == pytest.approx(by_hand[tuple(on[:3])], rel=1e-5)
        np.testing.assert_array_equal(scene().decode(scene().encode(one, ranges), ranges).object_tables, on)


@pytest.mark.slow
def test_places_drawn_with_tables():
    """Every object that is there finds a place where it was drawn to stand, or is flagged; in C nothing is inside anything."""
    arena, (keys, params) = scene(), drawn(CHOICE, 32)
    valid = np.asarray(jax.vmap(arena.valid)(params))
    placed = jax.jit(jax.vmap(arena.place))(params, keys)
    found, on = np.asarray(placed.valid), np.asarray(params.object_tables)
    assert valid.sum() > 10
    seen = 0
    for w in np.flatnonzero(valid).tolist():
        p = take(params, w)
        model, c = arena.c_world(p, key=keys[w])
        assert min([contact.dist for contact in c.contact], default=0.0) > -1e-5
        for k, name in enumerate(NAMES):
            if p.object_active[k] and on[w, k] and found[w, k]:
                stands_on(model, c, name, CARRIERS[on[w, k] - 1], 1e-5)
                seen += 1
    assert seen > 20


@pytest.mark.slow
def test_checked():
    """`check` finds nothing: what stands on others is not off its table."""
    report = mja.check(scene(), RANGES._replace(object_full_sizes=None), n_worlds=6, n_steps=40, engine="c")
    assert report.ok, str(report)


@pytest.mark.xslow
@pytest.mark.slow
def test_replayed(tmp_path):
    """What finds no place on a tray, in the pose in which it lies there, finds none in the bundle; all else does.

    So does the variant that stands on a drum, and would not if it were not round.
    """
    arena = mja.TableArena(
        objects=[mja.Object("tray", full_size=(0.2, 0.2, 0.02)), mja.Object("a", full_size=0.12, on="tray")]
    )
    arena.add_object(mja.Object("pole", full_size=(0.03, 0.03, 0.18), on="tray", pose="resting"))
    pots = [mja.Object("cube"), mja.Object("pot", "cylinder", (0.1, 0.1, 0.05))]
    arena.add_object(mja.Object("drum", "cylinder", (0.11, 0.11, 0.1)))
    arena.add_object(mja.Object("thing", variants=pots, on="drum"))
    ranges = mja.ArenaRanges(terms={"pole.pose": mja.Fixed(2), "thing.variant": mja.Fixed(1)})
    report = mja.check(arena, ranges, n_worlds=2, n_steps=10, engine="c")
    found = report.failures["invalid_placement"]
    assert all("pole" in one.what for one in found)
    report.save_bundle(tmp_path / "bundle", found[0].world)
    replay = mja.replay(tmp_path / "bundle")
    assert replay.reproduced
    assert set(replay.found) == set(report.of(found[0].world))


def test_files_and_merged(tmp_path):
    arena = scene()
    mja.save(tmp_path / "scene.yaml", arena, RANGES)
    again, _ = mja.load(tmp_path / "scene.yaml")
    assert again.record == arena.record
    text = (
        (tmp_path / "scene.yaml")
        .read_text()
        .replace("ranges:", "ranges:\n  object_tables: {Choice: [table, tray, box]}", 1)
    )
    (tmp_path / "named.yaml").write_text(text)
    assert np.asarray(mja.load(tmp_path / "named.yaml")[1].object_tables.values).tolist() == [0, 1, 2]
    own = mja.TableArena(objects=[mja.Object("plate", full_size=0.2), mja.Object("egg", "sphere", 0.05, on="plate")])
    both = own.merge(scene(), prefix="b_", pos=(3, 0, 0))
    assert both.surfaces == ["table", "b_table", "plate", *(f"b_{name}" for name in CARRIERS)]
    names = {o.name: both.surfaces[t] for o, t in zip(both.objects, both.nominal_params().object_tables, strict=True)}
    assert names["egg"] == "plate"
    assert names["b_cup"] == "b_box"
    assert both.mj_model is not None


def test_parts_after_objects():
    """Surfaces of furniture that comes later stand before tops of objects in `surfaces`; what stands on these stays there."""
    arena = mja.TableArena(objects=[mja.Object("plate", full_size=0.2), mja.Object("egg", "sphere", 0.05, on="plate")])
    arena.add_part(furniture.Shelf("rack", pos=(1.5, 0, 0), heights=(0.3, 0.8)))
    assert arena.surfaces == ["table", "rack_board0", "rack_board1", "plate"]
    arena.add_object(mja.Object("crate", full_size=(0.2, 0.2, 0.1), on="rack_board1"))
    arena.add_object(mja.Object("jar", "sphere", 0.05, on="crate"))
    nominal = arena.nominal_params()
    assert [arena.surfaces[t] for t in nominal.object_tables] == ["table", "plate", "rack_board1", "crate"]
    ranges = mja.ArenaRanges(terms={"rack.pieces_active": mja.Bernoulli(0.5)})
    params = jax.vmap(lambda key: arena.sample_params(key, ranges))(mja.world_keys(0, range(16)))
    np.testing.assert_array_equal(params.object_active[:, 3], params.terms["rack.pieces_active"][:, 1])
    with pytest.raises(
        ValueError,
        match=r"Part 'bin': `on` must be the index of a table, or one of 'table', 'rack_board0', 'rack_board1', or None",
    ):
        arena.add_part(furniture.Bin("bin", on="plate"))


TRAY = '<mujoco><worldbody><geom type="box" size=".1 .1 .01"/></worldbody></mujoco>'
CUP = mja.Object("cup", full_size=0.04, on="tray")
WRONG = {
    "later": (
        [CUP, mja.Object("tray", full_size=0.2)],
        "Object 'cup': `on`: 'tray' must come before it in the list, as an object stands on objects before it alone.",
    ),
    "itself": ([mja.Object("cup", on="cup")], "Object 'cup': `on` must be 0 or 'table', got 'cup'."),
    "on furniture that is not there yet": (
        [mja.Object("cup", on="rack_board1")],
        "Object 'cup': `on` must be 0 or 'table', got 'rack_board1': furniture that carries it must be added first, by `add_part`, and the "
        "object then by `add_object`.",
    ),
    "a ball": (
        [mja.Object("tray", "sphere", 0.2), CUP],
        "Object 'cup': `on` must name something with a level top, a box or an upright cylinder; 'tray' is a sphere.",
    ),
    "a body": (
        [mja.Object("tray", "mjcf", file=mujoco.MjSpec.from_string(TRAY)), CUP],
        "Object 'cup': `on` must name something with a level top, a box or an upright cylinder; 'tray' is an MJCF body.",
    ),
    "variants": (
        [mja.Object("tray", variants=[mja.Object("a"), mja.Object("b", "cylinder")]), CUP],
        "Object 'cup': `on` must name something with a level top, a box or an upright cylinder; 'tray' has variants, which are not all "
        "boxes or all cylinders.",
    ),
    "variants in any pose": (
        [mja.Object("tray", variants=[mja.Object("a"), mja.Object("b")], pose="resting"), CUP],
        "Object 'cup': `on` must name something with a level top, a box or an upright cylinder; 'tray' has variants in any resting pose.",
    ),
    "any pose": (
        [mja.Object("tray", "cylinder", (0.2, 0.2, 0.1), pose="resting"), CUP],
        (
            "Object 'cup': `on` must name something with a level top, a box or an upright cylinder; 'tray' is a cylinder "
            "in any resting pose."
        ),
    ),
    "dropped": (
        [mja.Object("tray", full_size=0.2, place=mja.Place(drop=True)), CUP],
        "Object 'cup': `on`: 'tray' is dropped (`place.drop`), so nothing can stand on it.",
    ),
    "too large": (
        [mja.Object("tray", full_size=0.03), CUP],
        "Object 'cup' is 0.04 x 0.04 m, larger than object 'tray', which is 0.03 x 0.03 m.",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong(case):
    objects, says = WRONG[case]
    with pytest.raises(ValueError, match="cup") as raised:
        mja.TableArena(objects=objects)
    assert str(raised.value).startswith(says)


def test_wrong_numbers():
    """A tray on a box on the tray; nothing that computes with it fails, and it is flagged."""
    arena = scene()
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    on = nominal.object_tables.copy()
    on[0] = 2
    circle = nominal._replace(object_tables=on)
    assert not arena.valid(circle)
    assert arena.problems(circle) == [
        (
            "`object_tables` of object 'tray': an object can stand on a table, a surface or an object before it, got 2, "
            "which is object 'box'."
        )
    ]
    placed = arena.place(circle, mja.world_keys(0, [0])[0])
    assert np.isfinite(placed.qpos).all()
    with pytest.raises(ValueError, match="an object before it"):
        arena.compile(circle)
