"""An environment in which nothing is to be done, for tests of how episodes begin."""

import jax.numpy as jnp

from mjx_arenas.envs import ArenaEnv, env_config


class Idle(ArenaEnv):
    """Sees positions, and never succeeds."""

    def __init__(self, arena, ranges, ctrl_dt=0.01, sim_dt=0.002, length=10, impl="jax", keyframe=None, **more):
        super().__init__(arena, ranges, env_config(ctrl_dt, sim_dt, length), {"impl": impl, **more}, keyframe)

    def draw_task(self, key, params, qpos):
        return {}

    def observe(self, data, episode):
        return {"state": data.qpos, "privileged_state": data.qpos}

    def score(self, data, episode, action):
        return jnp.zeros(()), jnp.zeros((), bool), {"success": jnp.zeros(())}
