"""Carrying a box between tables can be done, by a script, in random worlds on both implementations."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mjx_arenas import render

GL = render.choose_gl()
pytest.importorskip("mujoco_playground")

from mjx_arenas import envs  # noqa: E402
from mjx_arenas.envs import robots  # noqa: E402

SCRIPTED, IDLE = 16, 4
ABOVE, DOWN, CLOSE, LIFT, CARRY, LOWER, OPEN, RETREAT = range(8)
CRUISE = 1.08  # [m] height of the tip, above all tables


def script(memory, obs):
    """Action for an observation (26,) of the policy's; `memory` is the phase and the steps spent in it."""
    phase, steps = memory
    tip, turned, box, goal = obs[:3], obs[8:10], obs[10:13], obs[16:19]
    yaw = jnp.arctan2(turned[0], turned[1]) / 4
    to_goal = goal + box - tip * 0  # from the tip, if the box stays where it is in the hand
    on_box, off_box = box, box + jnp.array([0, 0, 0.12])
    up = jnp.array([0.0, 0.0, CRUISE - tip[2]])
    over_goal = jnp.append(goal[:2], CRUISE - tip[2])
    down = jnp.append(goal[:2], goal[2] + 0.024)
    away = jnp.array([0.0, 0.0, to_goal[2] + 0.2])
    still = jnp.zeros(3)
    targets = jnp.stack([off_box, on_box, still, up, over_goal, down, still, away])
    error = targets[phase]
    near = jnp.abs(error) < jnp.array([0.008, 0.008, 0.02])
    reached = jnp.stack(
        [
            near.all() & (jnp.abs(yaw) < 0.05),
            jnp.abs(error[2]) < 0.006,
            steps > 8,
            jnp.abs(error[2]) < 0.02,
            near[:2].all(),
            error[2] > -0.004,
            steps > 8,
            jnp.array(False),
        ]
    )[phase]
    grip = jnp.where((phase >= CLOSE) & (phase < OPEN), -1.0, 1.0)
    rate = jnp.where(phase <= DOWN, 6 * yaw / robots.TURN, 0.0)
    action = jnp.concatenate([6 * error / robots.SPEED, jnp.stack([rate, grip])])
    return (phase + reached, jnp.where(reached, 0, steps + 1)), jnp.clip(action, -1, 1)


@functools.cache
def rollout(impl):
    """An episode of scripted worlds and idle ones: (steps, worlds) success, reward, done, phase; the last state."""
    env = envs.Transfer(config_overrides={"impl": impl})
    idle = jnp.arange(SCRIPTED + IDLE) >= SCRIPTED

    @jax.jit
    def run(keys):
        def step(carry, _):
            state, memory = carry
            memory, actions = jax.vmap(script)(memory, state.obs["state"])
            state = jax.vmap(env.step)(state, jnp.where(idle[:, None], 0.0, actions))
            return (state, memory), (state.metrics, state.reward, state.done, memory[0], state.obs["state"])

        zero = jnp.zeros(len(idle), int)
        carry = jax.vmap(env.reset)(keys), (zero, zero)
        return jax.lax.scan(step, carry, length=env._config.episode_length)

    (state, _), log = run(jax.random.split(jax.random.key(5), len(idle)))
    return env, state, jax.tree.map(np.asarray, log)
