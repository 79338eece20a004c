"""An environment as others write them: in MuJoCo Playground's style, with its own model and data, knowing nothing of arenas."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from mujoco import mjx

import mjx_arenas as mja

mjx_env = pytest.importorskip("mujoco_playground._src.mjx_env")


def small_arena():
    """A ball on one table: MJX compiles it faster than a box."""
    arena = mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06)])
    arena.spec.option.timestep = 0.005
    arena.spec.option.iterations, arena.spec.option.ls_iterations = 4, 10
    return arena


class Rest(mjx_env.MjxEnv):
    """A ball that falls by a millimetre onto a table."""

    def __init__(self, mj_model, mjx_model, n_worlds=8):
        self._mj_model, self._mjx_model = mj_model, mjx_model
        self._room = {"naconmax": 8 * n_worlds, "njmax": 64} if mjx_model.impl.value == "warp" else {}

    def reset(self, rng):
        qpos = self._mjx_model.qpos0.at[2].add(0.001)
        data = mjx_env.make_data(self._mj_model, qpos=qpos, impl=self._mjx_model.impl.value, **self._room)
        return mjx_env.State(data, self._obs(data), jnp.zeros(()), jnp.zeros(()), {}, {"rng": rng})

    def step(self, state, action):
        data = mjx.step(self._mjx_model, state.data)
        return state.replace(data=data, obs=self._obs(data), reward=-jnp.square(action).sum())

    def _obs(self, data):
        return data.qpos[:3]

    action_size = 1
    observation_size = 3
    xml_path = ""
    mj_model = property(lambda self: self._mj_model)
    mjx_model = property(lambda self: self._mjx_model)


def heights(arena, worlds, n_steps):
    """(W,) heights of the ball in C MuJoCo, in recompiled worlds, after as many steps of the environment."""
    z = []
    for params in worlds:
        model = arena.compile(params)
        data = mujoco.MjData(model)
        data.qpos[2] += 0.001
        mujoco.mj_step(model, data, nstep=n_steps)
        z.append(data.qpos[2])
    return np.array(z)


def keys(n):
    """As Brax hands them out."""
    return jax.random.split(jax.random.PRNGKey(3), n)
