"""Drawers that an arm does not reach, that are not there, or that are open already are told, and none that it may reach."""

import dataclasses
import functools
import types

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

from test_arm_heights import LINK, SHOULDER, WRIST

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.envs import OpenDrawer, arms
from mjx_arenas.envs.arms import heights, moves, unreached
from mjx_arenas.envs.arms.opening import thinnest
from mjx_arenas.envs.tasks import open_drawer

WARP = {"impl": "warp"}
AWAY, HIGH = 0.62, 0.55  # [m] of the unit from the arm, and of the arm


def anywhere(arm):
    return heights.anywhere(arm, moves.moves(arm, moves.checked(arm), "home"))


def test_all_places_to_which_an_arm_goes_count():
    """Of random angles of the small arm at which its tool points down; and few that are far from all of them do."""
    rng, found = np.random.default_rng(0), anywhere(arms.small())
    shoulder, elbow = rng.uniform([[-1.6], [-1.4]], [[1.9], [1.4]], (2, 200_000))
    down = np.abs(shoulder + elbow) <= 1.9  # the wrist, which takes both back
    out = np.abs(LINK * (np.sin(shoulder) + np.cos(shoulder + elbow)))[down]
    height = (SHOULDER + LINK * (np.cos(shoulder) - np.sin(shoulder + elbow)) - WRIST)[down]
    assert np.asarray(found.at(jnp.asarray(out), jnp.asarray(height))).all()
    for distance, high in ((0.75, 0.1), (0.3, 0.75), (0.3, -0.6), (0.6, 0.45), (5.0, 0.0), (0.3, 5.0), (0.3, -5.0)):
        assert np.hypot(out - distance, height - high).min() > 0.08
        assert not found.at(jnp.float32(distance), jnp.float32(high)), (distance, high)


@pytest.mark.slow
def test_what_an_arm_promises_counts():
    far = anywhere(dataclasses.replace(arms.small(), reach=(0.7, 0.75)))  # its links are 0.64 m
    assert far.at(jnp.float32(0.72), jnp.float32(0.1))
    assert not far.at(jnp.float32(0.72), jnp.float32(0.5))


@pytest.mark.slow
def test_an_arm_that_slides_goes_as_far_as_its_length():
    spec = mujoco.MjSpec.from_string(
        """<mujoco><worldbody><body name="base"><body name="rail"><joint name="rail" type="slide" axis="1 1 0" range="-1 1"/>
        <geom size=".1"/><site name="tool" pos="0 0 -.1" euler="180 0 0"/></body></body></worldbody></mujoco>"""
    )
    arms.servo(spec, "rail", 1.0, 4.0, 100)
    arms.ready(spec, {}, {})
    found = anywhere(arms.Arm(spec, "base", "tool", {}, 0.0))
    assert found.at(jnp.float32(1.0), jnp.float32(-0.1))  # ahead and to a side
    assert not found.at(jnp.float32(1.4), jnp.float32(-0.1))


def unit(away=AWAY, height=0.0, opening=0.08, **more):
    """As the task's own, at another place."""
    arena = mja.MultiTableArena([[0, 0, HIGH], [3.0, 0, 0.3]], 0, [(0.24, 0.24, 0.05), (1.0, 1.0, 0.05)])
    heights = (0.26 + height, 0.19, 0.15)
    place = {"pos": (away, 0.0, 0.0), "size": (0.37, 0.42), "heights": heights, "openings": (0.0, 0.0, opening)}
    arena.add_part(furniture.Drawers("unit", **{**place, **more}))
    return arena


def task(arena, **given):
    return OpenDrawer(arena=arena, on=0, config_overrides=WARP, **given)


@functools.cache
def nominal():
    """The task whose unit is where it is to be."""
    return task(unit())


SAYS = "`arena`: the arm does not reach behind the front of 'unit_drawer2' {}. That is {} it. `invalid_arena` reports such episodes. "
SAYS += "`on` and `pos` say where the arm stands."
NOMINAL, DRAWN = "in the nominal arena", "in all of 64 worlds that were drawn"


def moved(least, most):
    return mja.ArenaRanges(terms={"unit.pos": mja.Uniform([least, 0, 0], [most, 0, 0], relative="add")})


FAR = "1.71 to 1.79 m from its base, seen from above, and 0.06 m above"
UNREACHED = {
    "2 m away": (2.0, 0.0, None, NOMINAL, FAR),
    "too high": (AWAY, 0.7, None, NOMINAL, FAR.replace("1.71 to 1.79", "0.33 to 0.44").replace("0.06", "0.76")),
    "in no world": (2.0, 0.0, moved(-0.1, 0.1), f"{NOMINAL}, and {DRAWN}", FAR),
    "moved away": (AWAY, 0.0, moved(1.0, 1.0), DRAWN, FAR.replace("1.71 to 1.79", "1.34 to 1.41")),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", UNREACHED)
def test_drawers_out_of_reach_are_told(case):
    """Once, when the task is made."""
    away, height, ranges, when, where = UNREACHED[case]
    with pytest.warns(UserWarning, match="^`arena`: the arm does not reach") as told:
        task(unit(away, height), ranges=ranges)
    assert [str(one.message) for one in told] == [SAYS.format(when, where)]


@pytest.mark.slow
def test_drawers_within_reach_are_not_told():
    """Nominally, or in half of the worlds; warnings are errors here. Those of the task's own ranges are all possible, see below."""
    nominal()
    task(unit(), ranges=moved(-0.05, 0.05))
    task(unit(2.0), ranges=moved(-1.7, -0.9))


def test_drawers_that_are_seldom_within_reach_are_told():
    """With the number of worlds in which they are not."""
    with pytest.warns(
        UserWarning, match=r"unit_drawer2' in the nominal arena, and in (3[3-9]|4\d|5\d|6[0-3]) of 64 worlds that"
    ):
        task(unit(2.0), ranges=moved(-1.5, 0.0))


def possible(env, opening=None, away=0.0, **values):
    """Whether a task is, with its unit further away and its drawer open."""
    params = env.arena.nominal_params()._replace(**values)
    terms = {**params.terms, "unit.pos": params.terms["unit.pos"].at[0, 0].add(away)}
    start = params.terms["unit.openings"][-1] if opening is None else opening
    qpos = jnp.asarray(env.mj_model.qpos0).at[env._slide].set(start)
    return bool(drawing(env)(jax.random.key(0), params._replace(terms=terms), qpos).possible)


@functools.cache
def drawing(env):
    return jax.jit(env.draw_task)


@pytest.mark.slow
def test_impossible_drawers_are_reported():
    """10 cm nearer, the front would come to the table of the arm before the goal: 0.335 - 0.252 m is less than 0.12."""
    env = nominal()
    for away, done in ((-0.1, False), (-0.05, True), (0.0, True), (0.1, True), (0.35, False), (2.0, False)):
        assert possible(env, away=away) == done, away
    assert possible(env, 0.2)
    assert not possible(env, 0.26)  # 1 cm from its limit, which would be a success from the start
    standing = task(
        unit(-2.4, heights=(0.1, 0.1, 0.1), on=1), ranges=mja.ArenaRanges(table_active=mja.Bernoulli([1.0, 0.5]))
    )
    assert possible(standing)
    assert not possible(standing, table_active=jnp.array([True, False]))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["training_ranges", "wider_ranges"])
def test_all_of_the_task_s_own_are_possible(kind):
    env = OpenDrawer(config_overrides=WARP)
    ranges = getattr(open_drawer, kind)()

    def world(key):
        params = env.arena.sample_params(key, ranges)
        qpos = jnp.asarray(env.mj_model.qpos0).at[env._slide].set(params.terms["unit.openings"][-1])
        return env.draw_task(key, params, qpos).possible

    assert jax.jit(jax.vmap(world))(mja.world_keys(0, range(512))).all()


SHUT = "`arena`: the gripper does not fit in behind the front of 'unit_drawer2' {}. The drawer starts 0.000 m open, and the thinnest part "
SHUT += "of the gripper fits in from 0.027 m on. `invalid_arena` reports such episodes. `openings` says how far drawers are open."


def open_by(least, most):
    return mja.ArenaRanges(terms={"unit.openings": mja.Uniform([0.0, 0.0, least], [0.0, 0.0, most])})


@pytest.mark.slow
def test_shut_drawers_are_told():
    """Nominally, and in more than half of 64 worlds; and reported: fingers are 12 mm thick, and the panel 15 mm behind the unit's edge."""
    with pytest.warns(UserWarning, match="^`arena`: the gripper does not fit in") as told:
        env = task(unit(opening=0.0))
    assert [str(one.message) for one in told] == [SHUT.format(NOMINAL)]
    assert [possible(env, x) for x in (0.0, 0.0265, 0.0275, 0.08)] == [False, False, True, True]

    def warned(ranges):
        return unreached.warn_of_drawer(env.arena, ranges, "unit_drawer2", env._nearest, ranges.varying)

    with pytest.warns(UserWarning, match="^`arena`: the gripper") as told:
        warned(open_by(0.0, 0.02))
    assert [str(one.message) for one in told] == [SHUT.format(f"{NOMINAL}, and {DRAWN}")]
    with pytest.warns(
        UserWarning, match=r"nominal arena, and in (3[3-9]|4\d|5\d|6[0-3]) of 64 worlds that were drawn\. The"
    ):
        warned(open_by(0.0, 0.04))
    warned(open_by(0.02, 0.08))  # in half of the worlds it is not


def test_walls_in_the_way_of_a_drawer_are_told():
    """The front is 18.5 cm before the middle of the unit, and 8 cm further at first; it must come 6 cm further still, to be opened by 8."""
    arena = unit()
    before = AWAY - 0.185 - 0.08 - 0.003 - 0.01  # 3 mm, and half of the wall
    arena.add_part(furniture.Wall("wall", pos=(before, 0, 0), full_size=(0.02, 0.3, 0.5)))
    with pytest.warns(UserWarning, match="in the way") as told:
        env = task(arena)
    says = f"`arena`: a table or a part of furniture stands in the way of the front of 'unit_drawer2' {NOMINAL}. "
    assert [str(one.message) for one in told] == [says + "`invalid_arena` reports such episodes."]
    params, nearest = env.arena.nominal_params(), jax.jit(env._nearest)
    for away, clear in ((0.0, False), (0.056, False), (0.058, True), (-0.5, True)):
        moved = {**params.terms, "wall.pos": params.terms["wall.pos"].at[0, 0].add(-away)}
        assert nearest(params._replace(terms=moved)).clear == clear, away
    assert not possible(env)
    gone = {**params.terms, "wall.active": jnp.array([False])}
    assert nearest(params._replace(terms=gone)).clear


def thin(**values):
    """Of the small arm, with other numbers of its fingers' geoms."""
    spec = arms.small().spec
    for finger in ("left", "right"):
        for name, value in values.items():
            setattr(spec.geom(finger), name, value)
    return thinnest(spec.compile(), "home", "tool")


def test_how_thin_a_gripper_is():
    """Of what collides at the tool: fingers, turned and round ones too; 0 without any."""
    assert thin() == pytest.approx(0.012)
    assert thin(quat=(np.cos(0.25), 0, 0, np.sin(0.25))) == pytest.approx(0.012)
    assert thin(type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=(0.008, 0.02, 0)) == pytest.approx(0.016)
    assert thin(pos=(0, 0, 0.2)) == 0
    assert thin(contype=0, conaffinity=0) == 0


def test_a_drawer_that_is_open_already_is_no_success():
    """Nor is its reward nan, where it cannot be opened further."""
    env = nominal()
    model, data = env.mj_model, mujoco.MjData(env.mj_model)
    for opening, done in ((0.08, True), (float(env._most(env.arena.nominal_params())), False)):
        data.qpos[env._slide] = opening
        params, qpos = env.arena.nominal_params(), jnp.asarray(data.qpos)
        drawn = drawing(env)(jax.random.key(0), params, qpos)
        assert drawn.possible == done
        data.qpos[env._slide] = drawn.goal
        mujoco.mj_forward(model, data)
        fields = {name: jnp.asarray(getattr(data, name)) for name in ("qpos", "qvel", "ctrl", "xpos")}
        seen = types.SimpleNamespace(**fields, xmat=jnp.asarray(data.xmat.reshape(-1, 3, 3)))
        reward, _, metrics = env.score(seen, types.SimpleNamespace(task=drawn, params=params), jnp.zeros(5))
        assert metrics["success"] == done
        assert jnp.isfinite(reward)


@pytest.mark.slow
def test_drawers_that_are_never_there_are_refused():
    says = "^`unit` must be a part of the arena that is there in some world, got 'unit'.$"
    with pytest.raises(ValueError, match=says):
        task(unit(active=False))
    with pytest.raises(ValueError, match=says):
        task(unit(0.0, on=1), ranges=mja.ArenaRanges(table_active=mja.Fixed([True, False])))
