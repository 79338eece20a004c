"""The heights at which arms reach what tasks ask of them, and what is told of things that are too high or too low."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

from test_reach import arm_of
from worlds import elliptic

import mjx_arenas as mja
from mjx_arenas.envs import Lift, PickAndPlace, arms
from mjx_arenas.envs.arms import heights, moves
from mjx_arenas.envs.tasks import lift, pick_and_place

WARP = {"impl": "warp"}
LINK, SHOULDER, WRIST = (
    0.32,
    0.14,
    0.145,
)  # [m] of upper arm and forearm, above the base, and of the wrist above the tool
NEAR = 0.002  # [m] of distances that count as one


DOCUMENTED = {"small": (38, 45), "yam": (24, 33), "panda": (18, 77)}  # [cm] below and above what carries the arm


def found(arm, keyframe="home"):
    return heights.heights(arm, moves.moves(arm, moves.checked(arm), keyframe))


@functools.cache
def all_angles():
    """(N,), (N,) distances, in order, and heights of the small arm's tool: of all angles at which it points down."""
    shoulder, elbow = np.meshgrid(np.linspace(-1.6, 1.9, 1751), np.linspace(-1.4, 1.4, 1401), indexing="ij")
    down = np.abs(shoulder + elbow) <= 1.9  # the wrist, which takes both back
    out = LINK * (np.sin(shoulder) + np.cos(shoulder + elbow))
    height = SHOULDER + LINK * (np.cos(shoulder) - np.sin(shoulder + elbow)) - WRIST
    order = np.argsort(out[down])
    return out[down][order], height[down][order]


def by_angles(distance):
    """Lowest and highest place of the small arm's tool at a distance."""
    out, height = all_angles()
    there = height[slice(*np.searchsorted(out, [distance - NEAR, distance + NEAR]))]
    assert np.diff(np.sort(there)).max() < NEAR  # all heights between them, too
    return there.min(), there.max()


def limits(distance):
    """(2,), (2,) between which the lowest place of the small arm's tool at a distance is, and the highest: by places beside it."""
    beside = np.array([by_angles(distance + off) for off in (-2 * NEAR, 0.0, 2 * NEAR)])
    return np.array([beside[1, 0], beside[:, 0].max()]), np.array([beside[:, 1].min(), beside[1, 1]])


@pytest.mark.slow
def test_heights_are_those_of_its_links():
    """The last height that is tried and reached is at most one step within the limit, and between two distances between theirs."""
    small = found(arms.small())
    assert np.diff(small.distances).max() <= heights.SPACING + 1e-9
    lowest, highest = np.swapaxes([limits(distance) for distance in small.distances], 0, 1)
    step = np.array([-moves.NEAR, heights.SPACING])  # below the lowest place, and above it
    for found_, (least, most) in ((small.low, (lowest + step).T), (-small.high, (-highest[:, ::-1] + step).T)):
        assert (least <= found_).all()
        assert (found_ <= most).all()
    between = small.distances[:-1] + np.diff(small.distances) / 2
    for i, distance in enumerate(
        between
    ):  # where limits are those of links, they go one way from a distance to the next
        low, high = limits(distance)
        assert lowest[i : i + 2, 0].min() - NEAR <= low[1] <= lowest[i : i + 2, 1].max() + NEAR
        assert highest[i : i + 2, 0].min() - NEAR <= high[0] <= highest[i : i + 2, 1].max() + NEAR
    raised = found(dataclasses.replace(arms.small(), rise=0.3))  # the same base, from which it counts
    np.testing.assert_allclose(raised.low, small.low, atol=heights.SPACING)
    np.testing.assert_allclose(raised.high, small.high, atol=heights.SPACING)


def test_what_an_arm_promises_counts():
    """Of an arm that goes nowhere at the distances of its `reach`, the heights of `moves.HEIGHTS` above what carries it, and no others."""
    short = found(dataclasses.replace(arms.small(), rise=0.1, reach=(0.7, 0.75)))  # its links are 0.64 m
    low, high = np.array(moves.HEIGHTS) - 0.1
    np.testing.assert_allclose(short.low, low)
    np.testing.assert_allclose(short.high, high)


@pytest.mark.parametrize("name", ["small", *(pytest.param(name, marks=pytest.mark.slow) for name in ("yam", "panda"))])
def test_all_that_the_tasks_ask_for_counts(name):
    """Of the lowest and the highest table of `PickAndPlace` outside its ranges, and of boxes that `Lift` lifts from the arm's own."""
    arm = arm_of(name)
    goes = found(arm)
    offsets, boxes = pick_and_place.wider_ranges().table_offsets, pick_and_place.training_ranges().object_full_sizes
    low, high = np.array(offsets.low)[:, 2].min(), np.array(offsets.high)[:, 2].max() + boxes.high
    below, above = -goes.low.max() - arm.rise, goes.high.min() + arm.rise
    assert below >= -low
    assert above >= max(high, boxes.high + lift.HEIGHT)
    assert (int(100 * below), int(100 * above)) == DOCUMENTED[name]  # docs/arms.md
    if name == "small":
        np.testing.assert_allclose([-goes.low.min(), goes.high.max()], [0.425, 0.595])  # likewise


def tables(height, *objects):
    """Two, the first as much higher than the second [m]."""
    offsets = [[0.42, -0.27, 0.8 + height], [0.42, 0.27, 0.8]]
    return elliptic(mja.MultiTableArena(offsets, 0, (0.42, 0.44, 0.05), objects=objects))


def possible(env, away, above):
    """Whether a task is, with its object away from the arm's base, and with its table above it, by so much less than the object [m]."""
    nominal = env.arena.nominal_params()
    place = env.foot.at(nominal) + jnp.array([0.0, -away, above])
    params = nominal._replace(table_offsets=nominal.table_offsets.at[0, 2].set(place[2] - 0.025))
    at = env.arena.layout.object_qpos[0]
    qpos = jnp.zeros(env.mj_model.nq).at[at[:3]].set(place).at[at[3]].set(1.0)
    return bool(drawing(env)(jax.random.key(0), params, qpos).possible)


@functools.cache
def drawing(env):
    return jax.jit(env.draw_task)


@pytest.mark.parametrize("kind", [Lift, PickAndPlace])
def test_heights_of_objects_are_told(kind):
    """As high, and as low, as the arm goes at the object's distance, for `Lift` with the 10 cm by which it is lifted."""
    goals = {} if kind is Lift else {"goals": "table1"}
    env = kind(
        arena=tables(0.0, mja.Object("box", full_size=0.05)), on=1, pos=(0, -0.2, 0), config_overrides=WARP, **goals
    )
    up, heights = (lift.HEIGHT if kind is Lift else 0.0), env.foot.heights
    for i in (0, 3, 6):
        low, high, away = heights.low[i], heights.high[i] - up, heights.distances[i]
        for above, done in ((low - 0.001, False), (low + 0.001, True), (high - 0.001, True), (high + 0.001, False)):
            assert possible(env, away, above) == done, (i, above)
    assert not possible(env, 0.3, -0.5)


def test_goals_that_are_too_low_are_told():
    """On a table far below that of the arm, which lies at the same distance."""
    arena = tables(0.0, mja.Object("box", full_size=0.05, on=1))
    env = PickAndPlace(arena=arena, goals="table0", on=1, pos=(-0.1, -0.2, 0), config_overrides=WARP)
    nominal = env.arena.nominal_params()
    at = env.foot.at(nominal) + jnp.array([0.0, 0.3, 0.025])
    qpos = jnp.zeros(env.mj_model.nq).at[env.arena.layout.object_qpos[0, :3]].set(at)
    for height, done in ((0.0, True), (-0.3, True), (-0.5, False), (0.7, False)):
        params = nominal._replace(table_offsets=nominal.table_offsets.at[0, 2].add(height))
        assert bool(drawing(env)(jax.random.key(0), params, qpos).possible) == done, height


BOX = mja.Object("box", full_size=0.05)
OUT = "is out of the arm's reach in the nominal arena. It is on table 0, which is "
REACHES = "The tool goes to places 0.22 to 0.44 m away, and at some of these distances from 0.43 m below to 0.59 m above the base. "
LIFTED = "It must go 0.10 m higher than the object, too. "
WHERE = "`invalid_arena` reports such episodes. `on` and `pos` say where the arm stands."
UNREACHED = {
    "on the floor": (
        lambda: Lift(arena=elliptic(mja.TableArena((0.8, 0.6, 0.05), objects=[BOX])), config_overrides=WARP),
        f"`arena`: object 'box' {OUT}0.00 to 0.50 m from the arm's base, seen from above, and 0.80 m above the base. "
        + REACHES
        + LIFTED
        + WHERE,
    ),
    "beside": (
        lambda: Lift(arena=tables(0.0, BOX), pos=(0.42, 1.0, 0.8), config_overrides=WARP),
        f"`arena`: object 'box' {OUT}1.05 to 1.50 m from the arm's base, seen from above, and 0.00 m above the base. "
        + REACHES
        + LIFTED
        + WHERE,
    ),
    "a goal that is low": (
        lambda: PickAndPlace(
            arena=tables(-0.6, dataclasses.replace(BOX, on=1)), goals="table0", on=1, config_overrides=WARP
        ),
        f"`goals`: the goal {OUT}0.32 to 0.79 m from the arm's base, seen from above, and 0.60 m below the base. "
        + REACHES.replace("0.59", "0.54")  # at the distances of that table
        + WHERE,
    ),
}


@pytest.mark.parametrize("case", UNREACHED)
def test_tasks_that_are_never_possible_are_told(case):
    """Once, when they are made."""
    make, says = UNREACHED[case]
    with pytest.warns(UserWarning, match="^`") as told:
        make()
    assert [str(one.message) for one in told] == [says]


def test_what_is_possible_at_times_is_not_told():
    """Where ranges bring the object within reach, or one of several goals is; warnings are errors here."""
    offsets = mja.Uniform([[0, -0.1, 0], [0, 0, 0]], [[0, 0.5, 0], [0, 0, 0]], relative="add")
    far = tables(0.0, BOX), {"pos": (0.42, 0.4, 0.8), "config_overrides": WARP}
    env = Lift(arena=far[0], ranges=mja.ArenaRanges(table_offsets=offsets), **far[1])
    params = jax.vmap(lambda key: env.arena.sample_params(key, env.ranges))(mja.world_keys(0, range(64)))
    nearest = 0.4 - 0.22 - np.asarray(params.table_offsets)[:, 0, 1]
    assert 0.5 < (nearest < 0.44).mean() < 1
    box = dataclasses.replace(BOX, on=1)
    PickAndPlace(arena=tables(-0.6, box), goals=["table0", "table1"], on=1, pos=(0.1, -0.1, 0), config_overrides=WARP)


def test_what_is_seldom_possible_is_told():
    """Where more than half of the worlds are not possible: with their number, and where the table is in those."""
    offsets = mja.Uniform([[0, -2.0, 0], [0, 0, 0]], [[0, 0.1, 0], [0, 0, 0]], relative="add")
    given = {"on": 1, "pos": (0, -0.2, 0), "ranges": mja.ArenaRanges(table_offsets=offsets), "config_overrides": WARP}
    with pytest.warns(UserWarning, match="out of the arm's reach") as told:
        env = Lift(arena=tables(0.0, BOX), **given)
    params = jax.vmap(lambda key: env.arena.sample_params(key, env.ranges))(mja.world_keys(0, range(64)))
    foot = np.asarray(env.foot.at(env.arena.nominal_params()))
    out = foot[1] - np.asarray(params.table_offsets)[:, 0, 1] - 0.22 > 0.44
    assert 32 < out.sum() < 64
    says = (
        f"`arena`: object 'box' is out of the arm's reach in {out.sum()} of 64 worlds that were drawn. It is on table 0"
    )
    assert str(told[0].message).startswith(says)


def test_the_middle_is_taken():
    """A box whose origin is 30 cm above it, on a table 0.6 m below the arm's: the arm goes to its origin, but not to its middle."""
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body><geom type="box" size=".03 .03 .03" pos="0 0 -.3"/></body></worldbody></mujoco>'
    )
    hung = mja.Object("hung", "mjcf", file=spec)
    with pytest.warns(UserWarning, match=r"^`arena`: object 'hung' is out of the arm's reach in the nominal arena\."):
        env = Lift(arena=tables(-0.6, hung), on=1, pos=(0, -0.2, 0), config_overrides=WARP)
    height = env.arena.mj_model.qpos0[env.arena.layout.object_qpos[0, 2]]
    origin = float(height - env.foot.at(env.arena.nominal_params())[2])
    assert origin == pytest.approx(-0.6 + 0.03 + 0.3, abs=1e-6)
    assert [possible(env, 0.3, above) for above in (origin, origin + 0.3)] == [False, True]


FAR = mja.Place(near="arm_base", distance=(0.6, 0.9))
CLOSE = mja.Place(near="arm_base", distance=(0.2, 0.4))
BESIDE = mja.Place(near=(0.3, 0), distance=(0, 0.2))  # of a point 0.8 m from the foot
AROUND = mja.Place(near=(-0.5, 0.1), distance=(0.6, 1.0))  # 0.1 m from it
APART = {
    "where its place is": (
        lambda: (mja.TableArena((1.4, 1.2, 0.05), objects=[mja.Object("box", full_size=0.04, place=FAR)]), None),
        {"on": 0, "pos": (-0.5, 0, 0)},
        "in the nominal arena. It is on table 0, which is 0.60 to 0.90 m from the arm's base, seen from above, and 0.00 m above",
    ),
    "where its place is beside a point": (
        lambda: (mja.TableArena((1.4, 1.2, 0.05), objects=[mja.Object("box", full_size=0.04, place=BESIDE)]), None),
        {"on": 0, "pos": (-0.5, 0, 0)},
        "in the nominal arena. It is on table 0, which is 0.60 to 1.00 m from the arm's base, seen from above, and 0.00 m above",
    ),
    "where its place is around a point": (
        lambda: (mja.TableArena((1.4, 1.2, 0.05), objects=[mja.Object("box", full_size=0.04, place=AROUND)]), None),
        {"on": 0, "pos": (-0.5, 0, 0)},
        "in the nominal arena. It is on table 0, which is 0.50 to 1.10 m from the arm's base, seen from above, and 0.00 m above",
    ),
    "where no place is as near": (
        lambda: (mja.TableArena((0.4, 0.4, 0.05), objects=[mja.Object("box", full_size=0.04, place=CLOSE)]), None),
        {"pos": (-3, 0, 0.8)},
        "in the nominal arena. It is on table 0, which is 2.80 to 3.21 m from the arm's base, seen from above, and 0.00 m above",
    ),
    "where tables move": (
        lambda: (
            tables(0.0, BOX),
            mja.ArenaRanges(
                table_offsets=mja.Uniform([[0, -2, 0], [0, 0, 0]], [[0, -1, 0], [0, 0, 0]], relative="add")
            ),
        ),
        {"on": 1, "pos": (0, -0.2, 0)},
        "in all of 64 worlds that were drawn. It is on table 0, which is ",
    ),
    "where tables are chosen": (
        lambda: (
            mja.MultiTableArena([[0, 0, 0.8], [0, 2, 0.8]], 0, (0.8, 0.8, 0.05), objects=[BOX]),
            mja.ArenaRanges(object_tables=mja.Fixed(1)),
        ),
        {"on": 0, "pos": (-0.3, 0, 0)},
        "in all of 64 worlds that were drawn. It is on table 1, which is ",
    ),
}


@pytest.mark.filterwarnings("ignore:Object 'box' finds no free place")
@pytest.mark.parametrize("case", APART)
def test_what_is_out_of_reach_in_all_worlds_is_told(case):
    make, given, says = APART[case]
    arena, ranges = make()
    arena.spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    with pytest.warns(UserWarning, match="out of the arm's reach") as told:
        Lift(arena=arena, ranges=ranges, config_overrides=WARP, **given)
    (out,) = (str(one.message) for one in told if "out of the arm's reach" in str(one.message))
    assert f"`arena`: object 'box' is out of the arm's reach {says}" in out


@pytest.mark.filterwarnings("ignore:Object 'box' finds no free place")
@pytest.mark.parametrize("turn", [0.0, np.pi])
def test_points_to_which_objects_stay_near_do_not_turn(turn):
    """They are the world's, and the arm on a table turns with it, away from the point and what stays near that."""
    close = mja.Object("box", full_size=0.04, place=mja.Place(near=(-0.5, 0), distance=(0.25, 0.4)))
    arena = elliptic(mja.MultiTableArena([[0, 0, 0.8]], turn, (1.4, 1.2, 0.05), objects=[close]))
    given = {"on": 0, "pos": (-0.5, 0, 0), "config_overrides": WARP}
    if not turn:
        Lift(arena=arena, **given)
        return
    with pytest.warns(UserWarning, match="0.60 to 1.34 m from the arm's base"):
        Lift(arena=arena, **given)


def test_how_many_worlds_were_drawn_is_told():
    """Where ranges vary, none of some worlds is possible, which is not to say that none can be."""
    offsets = mja.Uniform([[0, -3, 0], [0, 0, 0]], [[0, -2, 0], [0, 0, 0]], relative="add")
    says = "is out of the arm's reach in the nominal arena, and in all of 64 worlds that were drawn. It is on table 0"
    with pytest.warns(UserWarning, match=says):
        Lift(
            arena=tables(0.0, BOX),
            pos=(0.42, 1.0, 0.8),
            ranges=mja.ArenaRanges(table_offsets=offsets),
            config_overrides=WARP,
        )
