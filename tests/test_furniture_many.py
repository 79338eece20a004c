"""One to eight of each part in one arena: each world as the compiler makes it, whatever is there, and things rest on all of them."""

import functools

import jax
import mujoco
import numpy as np
import oracle
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.furniture import layouts
from mjx_arenas.record.elsewhere import elsewhere
from mjx_arenas.record.room import all_contacts

pytestmark = pytest.mark.slow

NEAR = 5e-4  # [m] what soft contacts leave between float32 and float64
ON = {
    furniture.Shelf: "board1",
    furniture.Bin: "bottom",
    furniture.Counter: "top1",
    furniture.Drawers: "drawer2_bottom",
    furniture.Cupboard: "top",
    furniture.Steps: "step1",
    furniture.Zone: None,
}
"""Parts on which a thing stands, and where."""
NOTHING_ON = (furniture.Wall, furniture.Ramp, furniture.Rail)


@functools.cache
def many(n):
    """An arena with `n` of each part, and a box on each that has a surface."""
    kinds = [*ON, *NOTHING_ON]
    parts = [kind(f"{kind.__name__.lower()}{i}") for i in range(n) for kind in kinds]
    arena = mja.TableArena(objects=[mja.Object("cube")])
    for part in layouts.grid(parts, len(kinds), (6.0, 6.0), pos=(3, 0, 0)):
        arena.add_part(part)
    for i in range(n):
        for kind, where in ON.items():
            name = f"{kind.__name__.lower()}{i}"
            surface = f"{name}_{where}" if where else name
            arena.add_object(mja.Object(f"on_{name}", full_size=(0.06, 0.05, 0.04), on=surface))
    return arena


@functools.cache
def template(n, impl):
    return many(n).put_model(impl)


@pytest.mark.parametrize(
    ("n", "impl"),
    [
        (1, "jax"),
        (1, "warp"),
        *(
            pytest.param(n, impl, marks=pytest.mark.xslow)
            for n, impl in ((2, "jax"), (4, "jax"), (8, "jax"), (8, "warp"))
        ),
    ],
    indirect=["impl"],
)
def test_worlds_are_compiled(n, impl):
    """All numbers of all parts others than nominal: each field as in the recompiled model.

    Both implementations get the same numbers, so on Warp the fewest and the most show that its fields are written, too.
    """
    arena = many(n)
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    numbers = [name for name in arena.quantities if not name.endswith("active") and "opening" not in name]
    assert len(numbers) > 30 * n
    model = template(n, impl)
    write = jax.jit(lambda p: arena.apply(model, p))
    for far in (1.0, -0.5):
        params = elsewhere(nominal, arena.record.parts, numbers, far)
        assert oracle.from_compiled(write(params), arena.compile(params)) <= oracle.STRUCTURE_MAY_DIFFER.keys()


@pytest.mark.parametrize(
    ("n", "draws", "impl"),
    [
        (1, 60, "jax"),
        (1, 20, "warp"),
        *(pytest.param(*row, marks=pytest.mark.xslow) for row in ((4, 20, "jax"), (8, 8, "jax"), (8, 8, "warp"))),
    ],
    indirect=["impl"],
)
def test_presence(n, draws, impl):
    """With each part, board, cabinet and drawer there or not, by chance, what is there is as compiled, and the rest is parked."""
    arena = many(n)
    active = [name for name in arena.quantities if name.endswith("active")]
    assert len([name for name in active if name.endswith("pieces_active")]) == 3 * n
    hold_presence(arena, template(n, impl), active, draws)


def hold_presence(arena, mjx_model, active, draws):
    """Draws which parts and pieces are there, and holds the rest against the worlds compiled without what is not."""
    ranges = mja.ArenaRanges(terms=dict.fromkeys(active, mja.Bernoulli(0.5)))
    full, seen = arena.mj_model, set()
    write = jax.jit(lambda p: arena.apply(mjx_model, p))
    chain = np.arange(full.nbody)  # of each body, itself or what carries it
    chains = [chain := full.body_parentid[chain] if i else chain for i in range(4)]
    assert not chain.any()
    for key in mja.world_keys(4, range(draws)):
        params = jax.tree.map(np.asarray, arena.sample_params(key, ranges))
        model, compiled = write(params), arena.compile(params)
        compared, off = oracle.of_what_is_left(model, full, compiled)
        assert len(compared) > 40
        assert off == set()
        bodies = [full.body(compiled.body(i).name).id for i in range(compiled.nbody)]
        gone = ~np.isin(np.arange(full.nbody), bodies)
        parked = np.any([(np.asarray(model.body_pos)[ids, 2] > 500) for ids in chains], axis=0)
        free = full.body_dofnum == 6  # an absent object is parked by its state
        assert (parked[gone] | free[gone]).all()
        assert not parked[~gone].any()
        assert (np.asarray(model.geom_rgba)[gone[full.geom_bodyid], 3] == 0).all()
        seen |= {name for name in active if not np.all(params.terms[name])}
    assert seen == set(active)


def test_presence_of_corners():
    """Cabinets around a corner, a wall with a window behind them, and drawers beside: there or not."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.add_part(furniture.Counter("l", pos=(2, 0, 0), widths=(0.6, 0.5, 0.4, 0.5), corner=1))
    arena.add_part(furniture.Wall("wall", pos=(2.6, 0, 0), full_size=(0.1, 3.0, 2.5), window=(1.0, 0.8)))
    arena.add_part(furniture.Drawers("unit", beside="l"))
    arena.add_object(mja.Object("cup", full_size=0.06, on="l_top2"))
    active = [name for name in arena.quantities if name.endswith("active")]
    assert set(active) == {"l.active", "l.pieces_active", "wall.active", "unit.active", "unit.pieces_active"}
    hold_presence(arena, arena.put_model("jax"), active, 12)


@pytest.mark.xslow
def test_things_rest_on_eight_of_each():
    """In C, in a world with sizes of its own for each part: half a second later each thing is where it was put, on its surface."""
    arena = many(8)
    sizes = ("height", "heights", "inner_size", "rises")
    names = [name for name in arena.quantities if name.split(".")[1] in sizes and not name.startswith("rail")]
    assert len(names) == 8 * 5
    ranges = mja.ArenaRanges(terms=dict.fromkeys(names, mja.Uniform(0.9, 1.1, relative="scale")))
    (key,) = mja.world_keys(0, range(1))
    params = jax.tree.map(np.asarray, arena.sample_params(key, ranges))
    assert arena.valid(params)
    rest = np.asarray(arena.rest_heights(params))
    model, c = arena.c_world(params, key=key)
    start = {o.name: c.body(o.name).xpos.copy() for o in arena.objects}
    assert len(start) == 1 + 8 * len(ON)
    mujoco.mj_step(model, c, nstep=round(0.5 / model.opt.timestep))
    for k, (name, before) in enumerate(start.items()):
        assert c.body(name).xpos[2] == pytest.approx(rest[k], abs=NEAR), name
        np.testing.assert_allclose(c.body(name).xpos[:2], before[:2], atol=NEAR, err_msg=name)


def rest_as_in_c(arena, batch, keys, end):
    """(W, K) heights of what stands on furniture; after 60 steps it is there, and where it is in C."""
    found = []
    for w in range(len(keys)):
        params = jax.tree.map(np.asarray, batch.world(w))
        found.append(np.asarray(arena.rest_heights(params)))
        model, c = arena.c_world(params, key=keys[w])
        mujoco.mj_step(model, c, 60)
        for rest, at, obj in zip(found[-1], arena.layout.object_qpos, arena.objects, strict=True):
            assert c.body(obj.name).xpos[2] == pytest.approx(rest, abs=NEAR), obj.name
            got = np.asarray(end.qpos[w])[at[:3]]
            np.testing.assert_allclose(got, c.body(obj.name).xpos, rtol=0, atol=NEAR, err_msg=obj.name)
    return np.array(found)


@pytest.mark.xslow
@pytest.mark.xslow_on("jax")
def test_things_rest(impl):
    """On each part a thing stays where it is put, at the height of its surface; in MJX as in C."""
    arena = many(1)
    keys = mja.world_keys(0, range(2))
    names = [name for name in arena.quantities if name.split(".")[1] in ("height", "heights", "inner_size", "rises")]
    assert len(names) >= 4
    ranges = mja.ArenaRanges(terms=dict.fromkeys(names, mja.Uniform(0.9, 1.1, relative="scale")))
    batch = arena.randomize(template(1, impl), keys, ranges)
    assert batch.valid.all()
    start = mja.make_data(batch, keys)
    data = mja.rollout(batch, start, 60)
    rest_as_in_c(arena, batch, keys, data)


def test_room_for_what_touches_at_once():
    """More furniture elsewhere needs room for one body alone on Warp; a heap in a bin has enough of it."""

    def room(n_counters):
        objects = [mja.Object(f"box{i}", full_size=0.05) for i in range(5)]
        arena = mja.TableArena(objects=objects)
        for i in range(n_counters):
            arena.add_part(furniture.Counter(f"counter{i}", pos=(2 + i, 0, 0), widths=(0.5, 0.5, 0.5, 0.5)))
        return np.array(arena.record.room(None))

    pieces = 4 * 2 * 2  # of two counters
    np.testing.assert_array_equal(room(4) - room(2), [4 * pieces, pieces])
    arena, ranges = mja.load("bin_picking")
    draw, most = jax.jit(lambda key: arena.sample_params(key, ranges)), 0
    for key in jax.random.split(jax.random.key(0), 4):
        model = arena.compile(draw(key))
        data = mujoco.MjData(model)
        for _ in range(300):
            mujoco.mj_step(model, data)
            most = max(most, data.ncon)
    assert 20 < most <= arena.record.room(None).contacts < 0.8 * all_contacts(arena.mj_model)


ROW = furniture.Counter("row", pos=(0, 4, 0), widths=(0.3,) * 12)
RACK = furniture.Shelf("rack", pos=(4, 0, 0), heights=tuple(0.2 * (i + 1) for i in range(10)))


@pytest.mark.parametrize(
    ("part", "size", "tops", "side"),
    [(ROW, (0.1, 3.6, 0.04), "row_top{}", 2), (RACK, (0.1, 0.1, 2.2), "rack_board{}", 0)],
)
def test_room_for_one_that_touches_all(part, size, tops, side):
    """A plank lies across twelve cabinets; a tall box is pushed against ten boards."""
    arena = mja.TableArena((5, 5, 0.05), objects=[mja.Object("thing", full_size=size)])
    arena.add_part(part)
    model, n = arena.mj_model, 12 if part is ROW else 10
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geoms = [data.geom(tops.format(i)) for i in range(n)]
    at = np.mean([geom.xpos for geom in geoms], axis=0)
    at[side] += model.geom(geoms[0].id).size[side] + size[side] / 2 - 1e-3
    data.qpos[:3] = at
    mujoco.mj_forward(model, data)
    assert {geom.id for geom in geoms} <= set(data.contact.geom.ravel().tolist())
    assert max(4 * n, data.ncon) <= arena.record.room(None).contacts
    assert n <= arena.record.room(None).pairs
