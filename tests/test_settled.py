"""Episodes that start where everything that was dropped has come to rest."""

import functools
import re

import idle
import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.envs import pools

RANGES = mja.ArenaRanges(table_offsets=mja.Uniform([-0.2, -0.2, 0.7], [0.2, 0.2, 0.9]))
FINGER = """<mujoco><worldbody><body name="finger" pos="0 0 2"><joint name="slide" axis="1 0 0" damping="1"/><geom size=".02"/>
  </body></worldbody><actuator><velocity name="go" joint="slide" kv="1" ctrlrange="-1 1"/></actuator></mujoco>"""


def binful():
    arena = mja.TableArena((0.6, 0.6, 0.04))
    arena.add_part(furniture.Bin("bin", on="table", inner_size=(0.14, 0.12, 0.1)))
    for i in range(2):
        place = mja.Place(drop=True)
        arena.add_object(mja.Object(f"part{i}", full_size=(0.09, 0.08, 0.03), on="bin_bottom", place=place))
    arena.attach(FINGER, "r_")
    return arena


@functools.cache
def env(impl="jax"):
    return idle.Idle(binful(), RANGES, ctrl_dt=0.02, sim_dt=0.004, length=3, settled=12, impl=impl)


def moved(one, state):
    """(K,) how far objects of a world move in C in 0.2 s [m]."""
    params, _, start, *_ = jax.tree.map(np.asarray, state.info["episode"][:3])
    model, c = one.arena.c_world(params)
    c.qpos = start
    before = start[one.arena.layout.object_qpos[:, :3]]
    mujoco.mj_step(model, c, 50)
    return np.linalg.norm(c.qpos[one.arena.layout.object_qpos[:, :3]] - before, axis=-1)


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
@pytest.mark.parametrize("impl", ["jax", "warp"])
def test_episodes_start_at_rest(impl):
    """C keeps objects where they start, in the first episode and in the next ones, which are other worlds of the pool."""
    one = env(impl)
    state = jax.jit(jax.vmap(one.reset))(jax.random.split(jax.random.key(0), 8))
    step, starts = jax.jit(jax.vmap(one.step)), []
    for _ in range(3):
        for w in range(0, 8, 3):
            world = mja.take(state, w)
            assert world.info["episode"].valid
            assert moved(one, world).max() < 0.002  # at rest is what moves by less than 5 mm/s
        starts.append(np.asarray(state.info["episode"].qpos))
        offsets = state.info["episode"].params.table_offsets
        state = step(state.replace(done=jnp.ones(8)), jnp.zeros((8, 1)))
        assert state.metrics["invalid_arena"].sum() == 0
    assert len(np.unique(np.concatenate(starts), axis=0)) > 4
    assert np.ptp(offsets[:, 0, 2]) > 0.01


@pytest.mark.xslow
@pytest.mark.slow
def test_it_is_needed():
    """Without, they fall: a warning says so, and how to start otherwise."""
    with pytest.warns(UserWarning, match="episodes start before what is dropped"):
        one = idle.Idle(binful(), RANGES, ctrl_dt=0.02, sim_dt=0.004)
    assert moved(one, one.reset(jax.random.key(0))).max() > 0.004  # the gap between what falls is 5 mm


@pytest.mark.xslow
@pytest.mark.slow
def test_other_seeds_are_other_worlds():
    one, other = env(), idle.Idle(binful(), RANGES, ctrl_dt=0.02, sim_dt=0.004, settled=12, drawn_seed=1)
    heights = [{*np.asarray(e.pool.params.table_offsets)[:, 0, 2].tolist()} for e in (one, other)]
    assert heights[0].isdisjoint(heights[1])


LIFT = """<mujoco><worldbody><body name="plate" pos="-.2 0 .6"><joint name="up" type="slide" axis="0 0 1" damping="25"/>
  <geom type="box" size=".1 .3 .02" mass=".5" contype="2" conaffinity="2"/></body></worldbody>
  <actuator><position name="up" joint="up" kp="300" ctrlrange="0 .4"/></actuator>
  <keyframe><key name="low" qpos="0" ctrl=".35"/></keyframe></mujoco>"""


@pytest.mark.xslow
@pytest.mark.slow
def test_nothing_hangs_in_the_air():
    """A robot lifts what is above it while that settles, and is put back: such worlds are no starts, and the others are."""
    arena = mja.TableArena((0.6, 0.6, 0.04))
    arena.add_object(mja.Object("cube", full_size=0.05, place=mja.Place(drop=True)))
    arena.attach(LIFT, "r_")
    arena.spec.geom("cube_g0").contype = arena.spec.geom("cube_g0").conaffinity = 3
    one = idle.Idle(arena, mja.ArenaRanges(), ctrl_dt=0.02, sim_dt=0.004, keyframe="r_low", settled=12)
    assert len(one.pool.objects) > 7
    for start in np.asarray(one.pool.objects):
        model, c = one.arena.c_world(one.arena.nominal_params(), keyframe="r_low")
        c.joint("cube_joint0").qpos = start[0]
        mujoco.mj_step(model, c, 10)
        assert np.abs(c.joint("cube_joint0").qpos[:3] - start[0, :3]).max() < 0.002


WRONG = {
    "fixed arenas": (
        {"arenas": "fixed", "settled": 4},
        RANGES,
        "`config.settled` must be 0 where `config.arenas` is 'fixed': an arena has a single start in which objects rest.",
    ),
    "a curriculum": (
        {"settled": 4},
        lambda level: RANGES,
        "`config.settled` must be 0 where `ranges` is a function of a level: what is drawn once is drawn when no level is known yet.",
    ),
    "less than none": ({"settled": -1}, RANGES, "`config.settled` must be a whole number from 0 to 1,048,576, got -1."),
    "arenas of a curriculum": (
        {"num_arenas": 4},
        lambda level: RANGES,
        "`config.num_arenas` must be 0 where `ranges` is a function of a level: what is drawn once is drawn when no level is known yet.",
    ),
    "arenas of one": (
        {"num_arenas": 4, "arenas": "nominal"},
        RANGES,
        "`config.num_arenas` must be 0 where `config.arenas` is 'nominal', as there is one arena.",
    ),
    "a long seed": (
        {"drawn_seed": 2**32},
        RANGES,
        "`config.drawn_seed` must be a whole number from 0 to 2^32 - 1, got 4294967296.",
    ),
    "arenas of these": (
        {"settled": 4, "num_arenas": 4},
        RANGES,
        "`config.num_arenas` must be 0 where `config.settled` is not, as episodes then start in those worlds alone.",
    ),
    "fewer arenas than none": (
        {"num_arenas": -1},
        RANGES,
        "`config.num_arenas` must be a whole number from 0 to 1,048,576, got -1.",
    ),
    "worlds beyond memory": (
        {"settled": 2**20 + 1},
        RANGES,
        "`config.settled` must be a whole number from 0 to 1,048,576, got 1048577.",
    ),
    "arenas beyond memory": (
        {"num_arenas": 10**9},
        RANGES,
        "`config.num_arenas` must be a whole number from 0 to 1,048,576, got 1000000000.",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong(case):
    more, ranges, says = WRONG[case]
    with pytest.raises(ValueError, match=f"^{re.escape(says)}$"):
        idle.Idle(binful(), ranges, ctrl_dt=0.02, sim_dt=0.004, **more)


@pytest.mark.xslow
@pytest.mark.slow
@pytest.mark.parametrize(
    ("ranges", "why"),
    [
        (RANGES, ""),
        (
            RANGES._replace(object_full_sizes=mja.Fixed([0.3, 0.3, 0.03])),
            " (2 are not valid: mjx_arenas.check says why)",
        ),
    ],
)
def test_none_rests(monkeypatch, ranges, why):
    """Where none of the worlds has come to rest, the environment is refused; where none is valid, it says so."""
    monkeypatch.setattr(pools, "SECONDS", 0.04)
    says = f"`config.settled`: no world of 2 is valid and at rest after 0.04 s{why}: raise `config.settled`, or drop fewer objects."
    with pytest.raises(ValueError, match=f"^{re.escape(says)}$"):
        idle.Idle(binful(), ranges, ctrl_dt=0.02, sim_dt=0.004, settled=2)
