"""An environment whose steps compile fast: a robot of one slide above a table, for all tests of environments."""

import functools

import jax
import jax.numpy as jnp
import mujoco

import mjx_arenas as mja
from mjx_arenas.envs import ArenaEnv, env_config

RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.1, -0.1, -0.2], [0.1, 0.1, 0.2], relative="add"),
    table_rots=mja.Uniform(-0.5, 0.5),
    table_full_sizes=mja.Uniform([0.4, 0.4, 0.02], [0.8, 0.8, 0.1]),
    object_full_sizes=mja.Uniform(0.04, 0.08),
)
LENGTH, N = 3, 4  # steps of an episode, worlds
SLIDE = """
<mujoco>
  <worldbody>
    <body pos="0 0 3"><joint name="slide" type="slide" axis="1 0 0" damping="1"/>
      <geom size="0.02" mass="0.1" contype="0" conaffinity="0"/></body>
  </worldbody>
  <actuator><velocity joint="slide" kv="1" ctrlrange="-1 1"/></actuator>
</mujoco>
"""


BALL = (mja.Object("ball", "sphere", 0.06),)


class Slide(ArenaEnv):
    """A ball that lies on a table, and a robot far above that is to go to x = 0.3 m."""

    robot = SLIDE

    def __init__(self, impl="jax", ranges=RANGES, objects=BALL, touching=True, **config):
        arena = mja.TableArena(objects=objects)
        arena.attach(mujoco.MjSpec.from_string(self.robot))
        if not touching:
            arena.spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        arena.spec.option.iterations, arena.spec.option.ls_iterations = 1, 6  # one is no loop, which compiles faster
        super().__init__(arena, ranges, env_config(0.05, 0.005, LENGTH), {"impl": impl, **config})
        self.slide = self.arena.mj_model.joint("robot_slide").qposadr[0]

    def draw_task(self, key, params, qpos):
        return {}

    def observe(self, data, episode):
        state = jnp.stack([data.qpos[self.slide], data.qvel[self.slide]])
        return {"state": state, "privileged_state": state}

    def score(self, data, episode, action):
        off = jnp.abs(data.qpos[self.slide] - 0.3)
        return -off, jnp.zeros((), bool), {"success": (off < 0.1).astype(jnp.float32)}


@functools.cache
def slide(impl, touching=True):
    """An environment, and its compiled functions of all worlds; without contacts, on which not all depends, steps compile faster."""
    env = Slide(impl, touching=touching)
    return env, jax.jit(jax.vmap(env.reset)), jax.jit(jax.vmap(env.step))


def keys(n=N, seed=0):
    return jax.random.split(jax.random.PRNGKey(seed), n)
