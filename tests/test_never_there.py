"""Tasks whose object or goals are there in no world are refused; in worlds without them they report it, and never succeed."""

import functools
import types

import jax
import jax.numpy as jnp
import pytest

pytest.importorskip("mujoco_playground")

from worlds import elliptic

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.envs import Lift, PickAndPlace, Push, Transfer

WARP = {"impl": "warp"}
BOX = "`ranges.object_active` of object 'box' must be true in some world, as the task is about it, got "
NEVER = mja.ArenaRanges(object_active=mja.Bernoulli(0.0))
NO_FIRST, NO_SECOND = (mja.ArenaRanges(table_active=mja.Fixed([i != gone for i in range(3)])) for gone in (0, 1))


def tables(**box):
    """Three, with a box on the first, and an arm on the last."""
    offsets, sizes = [[0.42, -0.27, 0.8], [0.42, 0.27, 0.8], [0, 0, 0.8]], [(0.42, 0.44, 0.05)] * 2 + [(0.2, 0.2, 0.05)]
    return elliptic(mja.MultiTableArena(offsets, 0, sizes, objects=[mja.Object("box", full_size=0.05, **box)]))


def on_a_unit(active):
    """A box on a unit of drawers."""
    arena = mja.MultiTableArena([[0, 0, 0.8]], 0, (0.8, 0.8, 0.05))
    arena.add_part(furniture.Drawers("unit", pos=(1.0, 0.0, 0.0), active=active))
    arena.add_object(mja.Object("box", full_size=0.05, on="unit_top"))
    return elliptic(arena)


def on_a_bench():
    """A box on a bench beside the only table."""
    arena = mja.TableArena((0.8, 0.8, 0.05))
    arena.add_part(furniture.Counter("bench", pos=(1.0, 0.0, 0.0), widths=(0.6,), depth=0.5, height=0.8))
    arena.add_object(mja.Object("box", full_size=0.05, on="bench_top0"))
    return elliptic(arena)


GOALS = "`goals` must be a surface that is there in some world while object 'box' stands on another, got "
CASES = {
    "absent": (
        lambda: Lift(arena=tables(active=False), on=2, config_overrides=WARP),
        "Object 'box': `active` must be true, or vary (`object_active`), as the task is about it, got False.",
    ),
    "lift": (lambda: Lift(ranges=NEVER, config_overrides=WARP), BOX + "Bernoulli(p=0.0, tied=False)."),
    "pick": (
        lambda: PickAndPlace(ranges=NEVER._replace(object_active=mja.Fixed(False)), config_overrides=WARP),
        BOX + "Fixed(at=False, relative=None).",
    ),
    "push": (
        lambda: Push(ranges=NEVER._replace(object_active=mja.Choice([False])), config_overrides=WARP),
        BOX + "Choice(values=array([False]), p=None, relative=None, tied=False).",
    ),
    "transfer": (
        lambda: Transfer(ranges=NEVER._replace(object_active=mja.Count(0, 0)), config_overrides=WARP),
        BOX + "Count(low=0, high=0, first=False).",
    ),
    "at no level": (lambda: Lift(ranges=lambda _: NEVER, config_overrides=WARP), BOX + "Bernoulli(p=0.0, tied=False)."),
    "goal": (
        lambda: PickAndPlace(arena=tables(), on=2, ranges=NO_SECOND, config_overrides=WARP),
        GOALS + "none, which stands for the second surface, 'table1'.",
    ),
    "its own table": (
        lambda: PickAndPlace(arena=tables(), on=2, goals="table0", config_overrides=WARP),
        GOALS + "['table0'].",
    ),
    "goal of a transfer": (
        lambda: Transfer(arena=tables(), ranges=NO_SECOND, goals="table1", config_overrides=WARP),
        GOALS + "['table1'].",
    ),
    "no goal of a transfer": (
        lambda: Transfer(arena=on_a_bench(), config_overrides=WARP),
        GOALS + "none, which stands for the second surface, 'bench_top0'.",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_what_is_never_there_is_refused(case):
    make, says = CASES[case]
    with pytest.raises(ValueError, match="must be") as raised:
        make()
    assert str(raised.value) == says


@pytest.mark.filterwarnings("ignore:`ranges` leaves object 'box' in no world")
def test_objects_without_anything_below_are_refused():
    """Where nothing on which they can stand is ever there: by the ranges, or by the arena alone."""
    says = r"must have a world with something on which object 'box' can stand, as the task is about it, got none with '{}'\.$"
    with pytest.raises(ValueError, match="^`ranges` " + says.format("table0")):
        Lift(arena=tables(), on=2, ranges=NO_FIRST, config_overrides=WARP)
    with pytest.raises(ValueError, match="^`arena` " + says.format("unit_top")):
        Lift(arena=on_a_unit(False), on=0, config_overrides=WARP)


def test_what_is_there_at_times_is_not_refused():
    """In some worlds, or at some level of a curriculum; or a goal where the box stands at times."""
    often = mja.ArenaRanges(object_active=mja.Bernoulli(0.5))
    for ranges in (often, lambda level: often._replace(object_active=mja.Bernoulli(level))):
        Lift(ranges=ranges, config_overrides=WARP)
    either = mja.ArenaRanges(object_tables=mja.Choice([0, 1]))
    Transfer(arena=tables(), ranges=either, goals="table0", config_overrides=WARP)
    Lift(ranges=NEVER, config_overrides={**WARP, "arenas": "nominal"})


@functools.cache
def seldom(kind):
    """A task whose object is there in half of the worlds."""
    return kind(ranges=mja.ArenaRanges(object_active=mja.Bernoulli(0.5)), config_overrides=WARP)


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", [Push, pytest.param(Transfer, marks=pytest.mark.slow)]
)  # test_arms_wrong.py has those of arms
def test_worlds_without_the_object_are_reported(kind):
    env = seldom(kind)
    keys = jax.random.split(jax.random.key(0), 16)
    episodes = jax.jit(jax.vmap(lambda key: env._draw(env.mjx_model, key, jnp.zeros(()), None)))(keys)
    active = episodes.params.object_active[:, 0]
    assert 0 < active.sum() < 16
    assert (episodes.valid == active).all()


def test_goals_of_push_are_away_from_the_box():
    """By three times the radius of success, wherever the box is."""
    env = seldom(Push)
    keys, n = jax.random.split(jax.random.key(4), 3), 4096
    params = env.arena.nominal_params()
    rows = env.arena.layout.object_qpos[0, :2]
    boxes = jax.random.uniform(keys[0], (n, 2), minval=-0.3, maxval=0.3)
    starts = jnp.asarray(env.mj_model.qpos0, jnp.float32) + jnp.zeros((n, 1))
    starts = starts.at[:, rows].set(boxes)
    draw = jax.jit(jax.vmap(lambda key, qpos: env.draw_task(key, params, qpos).pos[:2]))
    goals = draw(jax.random.split(keys[1], n), starts)
    assert jnp.linalg.norm(goals - boxes, axis=-1).min() >= 0.15 - 1e-6
    assert jnp.abs(goals.mean(0)).max() < 0.02
    assert (goals.std(0) > 0.14).all()  # 0.275 / sqrt(3) is 0.159, on all of the table


def test_a_box_that_is_parked_above_its_goal_is_not_there():
    env = seldom(Push)
    qpos, box = jnp.asarray(env.mj_model.qpos0), env.arena.layout.object_qpos[0]
    for active in (True, False):
        params = env.arena.nominal_params()._replace(object_active=jnp.array([active]))
        task = env.draw_task(jax.random.key(0), params, qpos)
        at = qpos.at[box[:3]].set(task.pos + jnp.array([0.0, 0.0, 0.04 if active else 100.0]))
        data = types.SimpleNamespace(qpos=at, qvel=jnp.zeros(env.mj_model.nv))
        _, ends, metrics = env.score(data, types.SimpleNamespace(task=task, params=params), jnp.zeros(3))
        assert metrics["success"] == active
        assert not ends
