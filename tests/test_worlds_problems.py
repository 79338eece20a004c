"""Worlds that cannot be: the flag of the device and the problems of the host are one table of rules."""

import functools
import itertools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds
from refused import DATA, host, told

import mjx_arenas as mja
from mjx_arenas import geometry
from mjx_arenas.params.params import QUANTITIES, named, on_host
from mjx_arenas.problems import messages
from mjx_arenas.rules import validation_worlds, world_rules
from mjx_arenas.sim import programs
from mjx_arenas.twin import twin

ROBOT = '<mujoco><worldbody><body name="base"><joint/><geom size=".1" pos="0 0 .2"/></body></worldbody></mujoco>'
OBJECTS = (
    mja.Object("cube"),
    mja.Object("ball", "sphere"),
    mja.Object("rod", "capsule", (0.12, 0.04, 0.04)),
    mja.Object("can", "cylinder", (0.06, 0.06, 0.12)),
    mja.Object("wedge", "mesh", 0.1, file=DATA / "wedge.obj"),
)
SPACE = mja.Workspace((-1, -2), (1, 2), 0.3)


@functools.cache
def arena():
    """Three tables, a robot on one of them, an object of each kind."""
    one = mja.MultiTableArena([[0, -1.3, 0.8], [0, 0, 0.8], [0, 1.3, 0.8]], objects=OBJECTS)
    one.attach(ROBOT, on=1)
    return one


def found(params, ranges=None):
    one = arena()
    return [p.key for p in validation_worlds.world_problems(params, validation_worlds.bound(one.record.rules, ranges))]


def with_row(name, index, value):
    """The nominal world with one row of a quantity changed."""
    values = np.array(getattr(host(arena()), name))
    values[index] = value
    return host(arena(), **{name: values})


DRAWN = mja.ArenaRanges()
IN_SPACE = mja.ArenaRanges(workspace=SPACE)
WORLDS = [
    ("table_offsets", (0, 0), np.nan, None, [("table_offsets", 0, "allowed")]),
    ("table_offsets", (0, 0), 1e7, None, [("table_offsets", 0, "limits")]),
    ("table_offsets", (2, 2), 0.02, None, [("table_offsets", 2, "legs")]),
    ("table_rots", 1, np.inf, None, [("table_rots", 1, "allowed")]),
    ("table_full_sizes", (1, 0), -1, None, [("table_full_sizes", 1, "allowed")]),
    ("table_frictions", slice(None), -1, None, [("table_frictions", "all", "allowed")]),
    ("object_masses", 0, -1, None, [("object_masses", "cube", "allowed")]),
    ("object_masses", 0, 1e11, None, [("object_masses", "cube", "limits")]),
    ("object_masses", 0, 1e-13, None, [("object_masses", "cube", "light")]),
    ("object_frictions", (1, 0), 1e7, None, [("object_frictions", "ball", "limits")]),
    ("object_rgba", (1, 0), 2, None, [("object_rgba", "ball", "allowed")]),
    ("object_tables", 0, 3, None, [("object_tables", "cube", "table_number")]),
    ("object_tables", 0, -1, None, [("object_tables", "cube", "table_number")]),
    ("object_full_sizes", 0, np.nan, None, [("object_full_sizes", "cube", "allowed")]),
    ("object_full_sizes", 1, np.nan, None, [("object_full_sizes", "ball", "allowed")]),
    ("object_full_sizes", 1, (0.1, 0.2, 0.1), None, [("object_full_sizes", "ball", "shape_sphere")]),
    ("object_full_sizes", 2, (0.1, 0.1, 0.1), None, [("object_full_sizes", "rod", "shape_capsule")]),
    ("object_full_sizes", 3, (0.1, 0.2, 0.1), None, [("object_full_sizes", "can", "shape_cylinder")]),
    ("object_full_sizes", 4, (0.2, 0.1, 0.1), None, [("object_full_sizes", "wedge", "as_in_file")]),
    ("object_full_sizes", 4, (0.1, 0.1, 0.11), None, [("object_full_sizes", "wedge", "as_in_file")]),
    ("object_full_sizes", 0, (0.9, 0.9, 0.1), None, [("objects", "cube", "larger")]),
    ("table_active", 1, False, None, [("params", 1, "absent")]),
    ("table_active", slice(None), False, DRAWN, [("params", 1, "absent"), ("params", None, "no_table")]),
    ("table_active", (0, 2), False, DRAWN, []),
    ("table_offsets", (0, 1), -0.6, None, [("params", (0, 1), "overlap")]),
    ("table_offsets", (2, 0), 0.7, IN_SPACE, [("params", 2, "outside")]),
    ("table_offsets", (0, 1), -1.0, IN_SPACE, [("params", (0, 1), "gap")]),
]


@pytest.mark.parametrize(("name", "index", "value", "ranges", "expected"), WORLDS)
def test_worlds(name, index, value, ranges, expected):
    assert found(with_row(name, index if index != (0, 2) else [0, 2], value), ranges) == expected


def test_right_worlds():
    """The nominal one; an object that is too large for its table and not there; a table that is not there, within another."""
    assert found(host(arena()), IN_SPACE) == []
    large, away = with_row("object_full_sizes", 0, 0.9), with_row("table_offsets", (0, 1), -0.5)
    assert found(large._replace(object_active=np.array([False, True, True, True, True]))) == []
    assert found(away._replace(table_active=np.array([False, True, True]))) == []


def test_what_follows_from_wrong_numbers_is_not_said():
    """A table of a wrong size is too small for nothing; two of them do not overlap."""
    wrong = with_row("table_full_sizes", 0, (-1, -1, 5))
    assert found(wrong, IN_SPACE) == [("table_full_sizes", 0, "allowed")]
    nowhere = with_row("object_tables", 1, 7)
    sizes = np.array(nowhere.object_full_sizes)
    sizes[1] = 3
    assert found(nowhere._replace(object_full_sizes=sizes)) == [("object_tables", "ball", "table_number")]


def wrong_worlds(n, seed=0):
    """Random worlds, about half of them wrong in one or two numbers."""
    rng, base = np.random.default_rng(seed), host(arena())
    values = [np.nan, np.inf, -np.inf, -1.0, 0.0, 1e-16, 1e-13, 1e7, 1e11, 0.02, 0.5, 0.9, 2.0]
    found = []
    for _ in range(n):
        params = {name: np.array(value) for name, value in named(base).items()}
        params["table_offsets"][:, :2] += rng.uniform(-0.2, 0.2, (3, 2))
        params["table_rots"] += rng.uniform(-0.3, 0.3, 3)
        params["object_full_sizes"][:4] *= rng.uniform(0.8, 1.2, (4, 1))
        for name in rng.choice(list(params), rng.integers(0, 3), replace=False):
            kind, array = QUANTITIES[name].kind, params[name]
            at = tuple(rng.integers(0, array.shape))
            if name == "object_full_sizes" and rng.random() < 0.5:
                array[at[0]] *= rng.uniform(5, 20)  # of the same shape
            elif kind is float:
                array[at] = rng.choice(values)
            else:
                array[at] = rng.integers(-1, 5) if kind is int else not array[at]
        if rng.random() < 0.1:
            params["table_active"] = rng.random(3) < 0.3
        found.append(
            mja.ArenaParams(*(np.asarray(v, np.float32 if v.dtype.kind == "f" else v.dtype) for v in params.values()))
        )
    return found


@pytest.mark.slow
def test_flags_and_problems_agree():
    """On random worlds `valid` is true where there are no problems, and `possible` where there are no refusals."""
    given = wrong_worlds(400)
    batch, rules = jax.tree.map(lambda *rows: jnp.stack(rows), *given), arena().record.rules
    seen = set()
    for ranges in (None, IN_SPACE):
        flags = jax.jit(jax.vmap(lambda p, ranges=ranges: validation_worlds.valid(p, rules, ranges)))(batch)
        bound = validation_worlds.bound(rules, ranges)
        problems = [validation_worlds.world_problems(on_host(p), bound) for p in given]
        np.testing.assert_array_equal(flags, [not found for found in problems])
        seen |= {p.rule.partition("_")[0] if "shape" in p.rule else p.rule for found in problems for p in found}
        assert 50 < np.sum(flags) < 350
    flags = jax.jit(jax.vmap(lambda p: validation_worlds.possible(p, rules)))(batch)
    np.testing.assert_array_equal(flags, [not validation_worlds.refusals(on_host(p), rules) for p in given])
    names = {rule.name for rule in world_rules.RULES} | {"limits"}
    elsewhere = {
        "order",
        "parts_overlap",
        "follow_short",
        "carried",
        "fixed_overlap",
        "below_floor",
        "out_of_reach",
        "limits_meet",
    }  # of ranges, of furniture, of what is fixed (test_fixed), of scenes (test_follow), of objects on objects, of reach (test_place),
    # of limits (test_left_out)
    assert seen == names - elsewhere


def random_tables(n, seed=0):
    """Pairs of upright boxes (n, 2), in single precision: some apart, some in each other, some that touch."""
    rng = np.random.default_rng(seed)
    offsets = rng.uniform([-1, -1, 0.6], [1, 1, 0.9], (n, 2, 3))
    rots, sizes = rng.uniform(-4, 4, (n, 2)), rng.uniform([0.2, 0.2, 0.02], [1.2, 1.2, 0.3], (n, 2, 3))
    side = n // 10  # flush with each other
    rots[:side] = rots[:side, :1]
    c, s = np.cos(rots[:side, 0]), np.sin(rots[:side, 0])
    offsets[:side, 1] = offsets[:side, 0]
    apart = (sizes[:side, 0, 0] + sizes[:side, 1, 0]) / 2
    offsets[:side, 1, :2] += np.stack([c, s], axis=-1) * apart[:, None]
    return (x.astype(np.float32) for x in (offsets, rots, sizes))


def depth_by_axes(offset, rot, size):
    """How far two upright boxes are in each other, axis by axis in double precision."""
    half = size / 2
    middle = offset - half * [0, 0, 1]
    delta = middle[1] - middle[0]
    depths = [half[:, 2].sum() - abs(delta[2])]
    for yaw in (*rot, *(rot + np.pi / 2)):
        radii = (half[:, 0] * abs(np.cos(rot - yaw)) + half[:, 1] * abs(np.sin(rot - yaw))).sum()
        depths.append(radii - abs(delta[:2] @ [np.cos(yaw), np.sin(yaw)]))
    return min(depths)


@pytest.mark.slow
def test_depths():
    """Of 10,000 random worlds: on the device and on the host as axis by axis; flush tables only touch."""
    offsets, rots, sizes = random_tables(10_000)
    depth, touching = (np.asarray(x)[:, 0, 1] for x in jax.jit(jax.vmap(geometry.overlaps))(offsets, rots, sizes))
    wide = [x.astype(float) for x in (offsets, rots, sizes)]
    expected = np.array([depth_by_axes(*world) for world in zip(*wide, strict=True)])
    on_host = np.array([geometry.overlaps(*world)[0] for world in zip(*wide, strict=True)])
    np.testing.assert_allclose(on_host[:, 0, 1], expected, rtol=0, atol=1e-13)  # of sums of ten numbers of up to 4 m
    np.testing.assert_array_equal(on_host[:, 0, 1], on_host[:, 1, 0])
    assert (abs(depth - expected) < touching / 2).all()  # what is allowed for touching is twice what rounding does
    np.testing.assert_array_equal(depth > touching, expected > touching)
    assert not (depth > touching)[:1000].any()
    assert 2000 < (depth > touching).sum() < 8000


def test_how_far_tables_that_overlap_must_move():
    """Of random tables in each other: the least of what is told is their depth, and moved by it in height they are apart."""
    n = 0
    for offset, rot, size in itertools.islice(zip(*random_tables(2000, 1), strict=True), 200, 400):
        offset, rot, size = (np.asarray(x, float) for x in (offset, rot, size))
        depth = depth_by_axes(offset, rot, size)
        if depth > 0:
            p = on_host(arena().nominal_params())._replace(table_offsets=offset, table_rots=rot, table_full_sizes=size)
            far = world_rules.overlap_told(p, (0, 1))
            np.testing.assert_allclose(min(far.values()), depth, rtol=0, atol=1e-12)
            higher = int(np.argmax(offset[:, 2] - size[:, 2] / 2))
            offset[higher, 2] += far["height"]
            np.testing.assert_allclose(depth_by_axes(offset, rot, size), 0, rtol=0, atol=1e-12)
            n += far["across"] < far["height"]
    assert n > 10


def test_overlap_is_that_of_mujoco():
    """Two boxes overlap where MuJoCo's collision of them has a negative distance."""
    xml = "<mujoco><worldbody>{}</worldbody></mujoco>"
    box = '<body mocap="true"><geom type="box" size=".1 .1 .1"/></body>'
    model = mujoco.MjModel.from_xml_string(xml.format(2 * box))
    data, n = mujoco.MjData(model), 0
    for offset, rot, size in itertools.islice(zip(*random_tables(2000, 1), strict=True), 200, 400):
        depth, touching = (x[0, 1] for x in geometry.overlaps(offset, rot, size))
        if abs(depth) < 1e-4:
            continue
        model.geom_size[:] = size / 2
        model.geom_rbound[:] = np.linalg.norm(size / 2, axis=-1)
        data.mocap_pos[:] = offset - size / 2 * [0, 0, 1]
        data.mocap_quat[:] = geometry.yaw_quat(rot)
        mujoco.mj_kinematics(model, data)
        distance = mujoco.mj_geomDistance(model, data, 0, 1, 5.0, None)
        assert (distance < 0) == (depth > touching)
        n += distance < 0
    assert 40 < n < 160


@pytest.mark.slow
@pytest.mark.parametrize("n_tables", [2, 3, 4, 5])
def test_pairs_on_the_device(n_tables):
    """Each pair is looked at: one that overlaps is flagged by the device's pairs as by the host's, unless it may or one is absent."""
    (rule,) = (rule for rule in world_rules.RULES if rule.name == "overlap")
    host_params = mja.MultiTableArena([[3.0 * t, 0, 0.8] for t in range(n_tables)]).nominal_params()
    for a, b in itertools.combinations(range(n_tables), 2):
        offsets = np.array(host_params.table_offsets)
        offsets[b] = offsets[a] + [0.5, 0.1, 0]
        active = np.ones(n_tables, bool)
        over = host_params._replace(table_offsets=offsets)
        for intended, gone, holds in ((False, None, False), (True, None, True), (False, a, True), (False, b, True)):
            may = np.zeros((n_tables, n_tables), bool)
            may[a, b] = may[b, a] = intended
            rules = world_rules.Rules(n_tables, (), np.zeros(0, int), np.zeros((0, 3)), {}, overlapping=may)
            there = active & (np.arange(n_tables) != gone)
            params = over._replace(table_active=there)
            assert rule.holds(params, rules).all() == holds
            assert rule.holds(jax.tree.map(jnp.asarray, params), rules).all() == holds


def test_tables_that_come_to_overlap():
    """They are flagged, named and measured, but not refused: MuJoCo compiles them, and they can be seen."""
    pair = mja.MultiTableArena([[0, -0.6, 0.8], [0, 0.6, 0.8]], objects=[mja.Object("cube")])
    ranges = mja.ArenaRanges(table_offsets=mja.Uniform([0, -0.6, 0], [0, 0.6, 0], relative="add"))
    keys = mja.world_keys(0, range(64))
    params, valid, possible = programs.draw(pair.record, keys, ranges)
    gap = np.diff(params.table_offsets[..., 1], axis=1)[:, 0]
    np.testing.assert_array_equal(valid, abs(gap) > 0.8)
    assert possible.all()
    assert 4 <= (~valid).sum() <= 16
    for world in np.flatnonzero(~valid):
        (problem,) = validation_worlds.world_problems(on_host(worlds.take(params, world)), pair.record.rules)
        assert problem.key == ("params", (0, 1), "overlap")
        # Side by side they move apart by what is missing; one over the other, by the thickness.
        np.testing.assert_allclose(problem.numbers["across"], 0.8 - abs(gap[world]), atol=1e-6)
        np.testing.assert_allclose(problem.numbers["height"], 0.05, atol=1e-6)
        assert pair.problems(worlds.take(params, world)) == [
            f"Tables 0 and 1 overlap by {problem.numbers['across']:.3g} m horizontally and 0.05 m vertically: moving "
            "them apart by either distance ends this."
        ]
        assert pair.compile(worlds.take(params, world)).nbody == 4
    with pytest.warns(UserWarning, match="overlap by 0.2 m horizontally"):
        meant = mja.MultiTableArena([[0, -0.3, 0.8], [0, 0.3, 0.8]])
    assert programs.draw(meant.record, keys, ranges)[1].all()


def test_overlap_is_a_warning():
    """Overlapping tables are named, with how far; ones that touch or lie over each other are not."""
    for other, rots, far in (
        ((0.5, 0, 0.8), (0, 0), "0.3 m horizontally and 0.05 m"),
        ((0.78, 0, 0.81), (0, 0), "0.02 m horizontally and 0.04 m"),
        ((0.79, 0, 0.8), (0, 1e-9), "0.01 m horizontally and 0.05 m"),
    ):
        with pytest.warns(
            UserWarning, match=rf"^Tables 'table0' and 'table1' overlap by {far} vertically: moving them apart"
        ):
            mja.MultiTableArena([[0, 0, 0.8], other], table_rots=rots)
    with pytest.warns(UserWarning, match=r"overlap by 0\.0337 m horizontally"):  # a corner: 0.4 + 0.4 sqrt(2) - 0.932
        mja.MultiTableArena([[0, 0, 0.8], [0.932, 0, 0.8]], table_rots=[0, np.pi / 4])
    mja.MultiTableArena([[0, 0, 0.8], [0.8, 0, 0.8], [0, 0, 0.4]])


def test_where_worlds_are_refused():
    """By all that makes a world in C MuJoCo; of many, with their numbers."""
    one = arena()
    wrong = with_row("table_active", 1, False)
    absent = [("params", 1, "absent")]
    many = jax.tree.map(lambda *rows: np.stack(rows), host(one), wrong)
    for call in (
        lambda: one.compile(wrong),
        lambda: one.to_xml(wrong),
        lambda: one.plan(wrong),
        lambda: one.contact_sheet(many),
        lambda: one.tile(many),
    ):
        assert told(call) == absent
    assert not one.valid(wrong)
    with pytest.raises(ValueError, match=r"^World 1: `params`: table 1 is absent, but 'robot_mount' is fixed on it\.$"):
        one.contact_sheet(many)


@pytest.mark.slow
def test_c_batch_of_invalid_worlds():
    """Every world with a false flag has a sentence; those are refused that cannot be made."""
    one = arena()
    wrong, over = with_row("table_active", 1, False), with_row("table_offsets", (0, 1), -0.6)
    many = jax.tree.map(lambda *rows: np.stack(rows), over, wrong)
    with pytest.raises(ValueError, match=r"^World 1: `params`: table 1 is absent, but 'robot_mount' is fixed on it\.$"):
        one.c_batch(many)
    larger = jax.tree.map(lambda *rows: np.stack(rows), with_row("object_full_sizes", 0, (0.9, 0.9, 0.1)), over)
    assert one.c_batch(larger) is not None  # which MuJoCo compiles


def test_places():
    """An object that finds no free place."""
    pair = mja.MultiTableArena(
        [[0, 0, 0.8], [2, 0, 0.8]], objects=[mja.Object("cube"), mja.Object("tray", full_size=0.4)]
    )
    here, key = pair.nominal_params(), jax.random.key(0)
    assert pair.problems(here, key=key) == []
    full = here._replace(table_full_sizes=here.table_full_sizes * 0.501)  # one of them fits
    assert pair.problems(full, key=key) == ["Object 'tray' finds no free place, and starts above the other objects."]
    small = here._replace(table_full_sizes=here.table_full_sizes * 0.4)
    assert pair.problems(small, key=key) == [
        "Object 'tray' is 0.4 x 0.4 m, larger than table 0, which is 0.32 x 0.32 m."
    ]


def test_lightest_object():
    """The smallest mass that the host takes compiles in MuJoCo, and one below does not."""
    one = mja.TableArena(objects=[mja.Object("cube")])
    least = 6 * mujoco.mjMINVAL / 0.05**2
    for factor, right in ((1.001, True), (0.999, False)):
        params = host(one, object_masses=[factor * least])
        assert (one.problems(params) == []) == right
        try:
            compiled = bool(twin.world_spec(one.record, params, checked=False))
        except ValueError:
            compiled = False
        assert compiled == right


def test_what_rounding_breaks():
    """A world whose numbers are right on the host, and not once they are rounded as on the device."""
    (told,) = validation_worlds.refusals_of(host(arena()), arena().record.rules, 3)
    assert messages.sentence(told) == "World 3: `params` are invalid once rounded to single precision."


def test_crowds_and_places_are_warnings():
    """Objects that cover more than their table, or are off it; on an edge they are not off, and absent ones do not count."""
    pool = [mja.Object(f"o{i}", full_size=0.1) for i in range(10)]
    message = r"^The 10 objects on table 0 cover 0\.1 m\^2, more than its top of 0\.09 m\^2, so they do not all fit side by side\."
    with pytest.warns(UserWarning, match=message):
        mja.TableArena((0.3, 0.3, 0.05), objects=pool)
    pool = [mja.Object(f"o{i}", full_size=0.1, pos=(0, 0), active=i == 0) for i in range(10)]
    assert mja.TableArena((0.3, 0.3, 0.05), objects=pool).mj_model.nq == 70
    with pytest.warns(
        UserWarning, match=r"^Object 'far': `pos` \[3.0, 0.0\] is off table 0, whose top reaches 0\.4 m x 0"
    ):
        mja.TableArena(objects=[mja.Object("far", pos=(3, 0))])
    mja.TableArena(objects=[mja.Object("edge", pos=(0.4, 0)), mja.Object("gone", pos=(3, 0), active=False)])
    with pytest.warns(
        UserWarning, match=r"^`table_rots` has angles of up to 90 rad, more than a turn: angles are in rad"
    ):
        mja.MultiTableArena([[0, 0, 0.8]], table_rots=[90])
