"""Environments whose episodes have only so many arenas."""

import functools

import idle
import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas.envs import pools
from mjx_arenas.envs.evaluate import HELD_OUT, UNSEEN
from mjx_arenas.envs.tasks import configured

RANGES = mja.ArenaRanges(table_offsets=mja.Uniform([-0.2, -0.2, 0.7], [0.2, 0.2, 0.9]))
N_ARENAS = 3


@functools.cache
def env(**config):
    arena = mja.TableArena(objects=[mja.Object("cube", full_size=0.05, place=mja.Place())])
    arena.attach("<mujoco><worldbody><body pos='0 0 2'><joint name='j'/><geom size='.02'/></body></worldbody></mujoco>")
    arena.spec.option.disableflags |= (
        mujoco.mjtDisableBit.mjDSBL_CONTACT
    )  # only starts are looked at: steps compile faster
    return idle.Idle(arena, RANGES, ctrl_dt=0.02, sim_dt=0.004, length=3, num_arenas=N_ARENAS, **config)


def heights(one, n_worlds=32, n_episodes=3):
    """(E, W) of the tables, and places of the cubes (E, W, 3), in some episodes."""
    state = jax.jit(jax.vmap(one.reset))(jax.random.split(jax.random.key(0), n_worlds))
    step, seen = jax.jit(jax.vmap(one.step)), []
    for i in range(n_episodes):
        if i:
            state = step(state.replace(done=jnp.ones(n_worlds)), jnp.zeros((n_worlds, one.action_size)))
        episode = state.info["episode"]
        seen.append((episode.params.table_offsets[:, 0, 2], episode.qpos[:, one.arena.layout.object_qpos[0, :3]]))
    return [np.asarray(x) for x in zip(*seen, strict=True)]


@pytest.mark.slow
@pytest.mark.parametrize("arenas", ["every_episode", pytest.param("fixed", marks=pytest.mark.slow)])
def test_there_are_so_many(arenas):
    """Worlds share the arenas of `world_keys`, to the bit, and cubes stand elsewhere in every episode."""
    one = env(arenas=arenas)
    found, places = heights(one)
    draw = jax.jit(jax.vmap(lambda key: one.arena.sample_params(key, RANGES)))
    params = draw(mja.world_keys(0, range(N_ARENAS)))
    assert {*found.ravel().tolist()} == {*np.asarray(params.table_offsets)[:, 0, 2].tolist()}
    assert (np.ptp(found, axis=0) > 0).any() == (arenas == "every_episode")
    assert len(np.unique(places, axis=None)) > 60


def test_other_seeds_are_other_arenas():
    found, other = ({*one.pool.params.table_offsets[:, 0, 2].tolist()} for one in (env(), env(drawn_seed=1)))
    assert len(found) == len(other) == N_ARENAS
    assert found.isdisjoint(other)


def own(config_overrides=None):
    """A task of a user's own, whose episodes have few arenas."""
    arena = mja.TableArena(objects=[mja.Object("cube", full_size=0.05)])
    arena.attach("<mujoco><worldbody><body pos='0 0 2'><joint name='j'/><geom size='.02'/></body></worldbody></mujoco>")
    more = {"num_arenas": N_ARENAS, **(config_overrides or {})}
    return idle.Idle(arena, RANGES, ctrl_dt=0.02, sim_dt=0.004, **more)


@pytest.mark.slow
@pytest.mark.parametrize("task", ["push", f"{__name__}:own"])
def test_policies_are_judged_on_others(task):
    """Trainings on few arenas are judged on arenas without a limit, also where a task of one's own has the limit by itself."""
    env = {"config": {"num_arenas": N_ARENAS, "drawn_seed": 4}} if task == "push" else {}
    config = {"task": task, "impl": "jax", "sees": "numbers", "env": env, "ranges": None}
    training, judged = (configured.environment(config, where).config for where in ("training", "held_out"))
    assert (training.num_arenas, training.drawn_seed) == (N_ARENAS, 4 if task == "push" else 0)
    assert judged.num_arenas == 0
    asked = configured.environment(config, "held_out", {"num_arenas": 2})
    assert asked.config.num_arenas == 2


@pytest.mark.parametrize("seed", [0, HELD_OUT])
def test_policies_are_judged_in_other_worlds(monkeypatch, seed):
    """Trainings in worlds that are drawn once are judged in those of another seed."""
    drawn = []
    monkeypatch.setattr(pools, "pool", lambda *args: drawn.append(args[3].settled) or pools.Pool(None, None))
    config = {"task": "push", "impl": "jax", "env": {"config": {"settled": 4, "drawn_seed": seed}}, "eval_worlds": 9}
    seeds = [
        configured.environment(config, where).config.drawn_seed for where in ("training", "held_out", "out_of_range")
    ]
    assert seeds[0] == seed
    assert seeds[1] == seeds[2] != seed
    assert {*seeds[1:]} <= {*UNSEEN}
    assert drawn == [4, 9, 9]  # each once, and as many as are judged


def test_none_of_them_is_valid():
    """Arenas of which none is valid are refused, as nothing can be learned there; few are told."""
    arena = mja.TableArena(objects=[mja.Object("cube", full_size=0.05)])
    arena.attach("<mujoco><worldbody><body pos='0 0 2'><joint name='j'/><geom size='.02'/></body></worldbody></mujoco>")
    narrow = mja.ArenaRanges(table_full_sizes=mja.Uniform([0.01, 0.01, 0.05], [0.06, 0.06, 0.05]))
    config = {"ctrl_dt": 0.02, "sim_dt": 0.004, "length": 3}
    with pytest.raises(ValueError, match=r"^`ranges` gives no valid world: none of the 1 that were drawn is\. "):
        idle.Idle(arena, narrow, num_arenas=1, **config)
    with pytest.warns(match=r"^`ranges` gives few valid worlds: 2 of the 64 that were drawn\. "):
        idle.Idle(arena, narrow, num_arenas=64, **config)
