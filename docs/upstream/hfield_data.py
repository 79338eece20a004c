"""impl="warp": a batched `hfield_data` is taken, and every world has the height field of world 0."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

XML = """
<mujoco>
  <asset><hfield name="ground" nrow="8" ncol="8" size="1 1 .2 .1"/></asset>
  <worldbody>
    <geom type="hfield" hfield="ground"/>
    <body pos="0 0 .32"><freejoint/><geom size=".1"/></body>
  </worldbody>
</mujoco>"""
LEVELS = np.array([0.4, 1.0, 0.0])  # of the ground, level in each of three worlds, of 0.2 m
STEPS = 500


def model_of(level: float) -> mujoco.MjModel:
    """Of C, with the ground at one level."""
    model = mujoco.MjModel.from_xml_string(XML)
    model.hfield_data[:] = level
    return model


def expected() -> np.ndarray:
    """Heights of the ball at the end, of models of C with each ground."""
    heights = []
    for level in LEVELS:
        model = model_of(level)
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, STEPS)
        heights.append(data.qpos[2])
    return np.array(heights)


def seen(impl: str) -> np.ndarray:
    """The same of one batched model of MJX."""
    mj_model = model_of(LEVELS[0])
    model = mjx.put_model(mj_model, impl=impl)
    axes = jax.tree.map(lambda _: None, model).replace(hfield_data=0)
    model = model.replace(hfield_data=jnp.stack([jnp.full_like(model.hfield_data, level) for level in LEVELS]))
    data = jax.vmap(lambda _: mjx.make_data(mj_model, impl=impl, naconmax=64, njmax=64))(jnp.arange(len(LEVELS)))
    step = jax.vmap(mjx.step, in_axes=(axes, 0))
    data = jax.jit(lambda m, d: jax.lax.fori_loop(0, STEPS, lambda _, d: step(m, d), d))(model, data)
    return np.asarray(data.qpos[:, 2])


print("the ground is at            ", 0.2 * LEVELS)
print("expected: the ball rests at ", expected().round(3))
print("seen, impl='jax'            ", seen("jax").round(3))
print("seen, impl='warp'           ", seen("warp").round(3))
