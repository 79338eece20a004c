"""Objects go up to a goal that is higher than the arm lifts them where they stand: it draws them nearer first. So tasks do not warn."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

from test_arms import NOTHING, action, seen
from worlds import elliptic

import mjx_arenas as mja
from mjx_arenas.envs import PickAndPlace, arms

HIGHER, OVER = 0.42, 0.09  # [m] of the goal's table than the arm's, and of the tool on the way
NEARER = jnp.array([0.0, -0.3, 0.0])  # [m] where the object goes up, from the arm's base


def task():
    """An object that is far from the arm, on a table as low as its own, and a goal near it on a high one; warnings are errors here."""
    offsets = [[0.0, -0.46, 0.6], [0.3, 0.16, 0.6 + HIGHER], [0, 0, 0.6]]
    box = mja.Object("box", full_size=0.045, place=mja.Place(region=((-0.5, -0.5), (0.5, -0.2))))
    sizes = [(0.3, 0.34, 0.05), (0.16, 0.16, 0.05), (0.2, 0.2, 0.05)]
    arena = elliptic(mja.MultiTableArena(offsets, 0, sizes, objects=[box]))
    arena.spec.option.impratio = 10
    arm = dataclasses.replace(arms.small(), reach=(0.22, 0.52))
    return PickAndPlace(arena=arena, arm=arm, on=2, goals="table1", config_overrides={"impl": "warp"})


def carrying(env, obs, phase, waited):
    """Above, down, close, up, nearer, up, across, down, open, away."""
    tool, yaw, to, goal = seen(env, obs)
    above, high = to + jnp.array([0, 0, 0.1]), HIGHER + OVER
    lifted, nearer, up = jnp.array([0, 0, 0.06 - tool[2]]), NEARER.at[2].set(0.06) - tool, NEARER.at[2].set(high) - tool
    across, down = jnp.append(goal[:2], high - tool[2]), goal + jnp.array([0, 0, 0.03])
    move = jnp.stack([above, to, NOTHING, lifted, nearer, up, across, down, NOTHING, jnp.array([0, 0, 0.04])])[phase]
    done = [(jnp.abs(above) < 0.006).all() & (jnp.abs(yaw) < 0.05), (jnp.abs(to) < 0.006).all(), waited > 8]
    done += [(jnp.abs(one) < 0.02).all() for one in (lifted, nearer, up, across)]
    done += [down[2] > -0.008, waited > 8, False]
    grip = jnp.where((phase >= 2) & (phase < 8), -1.0, 1.0)
    return action(move, jnp.where(phase < 2, yaw, 0.0), grip), jnp.stack(done)[phase]


@pytest.mark.xslow
def test_a_script_carries_it_up():
    env = task()

    @jax.jit
    def run(key):
        def step(carry, _):
            state, phase, waited = carry
            actions, done = carrying(env, state.obs["state"], phase, waited)
            state = env.step(state, actions)
            return (state, phase + done, jnp.where(done, 0, waited + 1)), state.metrics

        first, zero = env.reset(key), jnp.zeros((), int)
        return first, jax.lax.scan(step, (first, zero, zero), length=140)[1]

    first, metrics = jax.device_get(run(jax.random.key(0)))
    episode, heights = first.info["episode"], env.foot.heights
    at = first.data.qpos[env.arena.layout.object_qpos[0, :3]] - env.foot.at(episode.params)
    rests = HIGHER + episode.task.above
    assert np.interp(np.linalg.norm(at[:2]), heights.distances, heights.high) < rests - 0.03
    assert episode.valid
    assert metrics["success"][-1] == 1
    assert not metrics["invalid_arena"].any()
