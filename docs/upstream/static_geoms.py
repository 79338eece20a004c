"""impl="warp": what is fixed to the world collides where the template has it, whatever `body_pos` of each world says."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

XML = """
<mujoco>
  <worldbody>
    <body name="table" pos="0 0 .5"><geom type="box" size=".5 .5 .1"/></body>
    <body pos="0 0 .71"><freejoint/><geom size=".1"/></body>
  </worldbody>
</mujoco>"""
LOWER = np.array([0.0, 0.1, 0.2])  # the table stands, in three worlds [m]
STEPS = 500


def expected() -> np.ndarray:
    """Heights of the ball at the end, of models of C that were compiled with the lower tables."""
    heights = []
    for lower in LOWER:
        spec = mujoco.MjSpec.from_string(XML)
        spec.body("table").pos[2] -= lower
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, STEPS)
        heights.append(data.qpos[2])
    return np.array(heights)


def seen(impl: str) -> np.ndarray:
    """The same of one batched model of MJX."""
    mj_model = mujoco.MjModel.from_xml_string(XML)
    model = mjx.put_model(mj_model, impl=impl)
    axes = jax.tree.map(lambda _: None, model).replace(body_pos=0)
    model = model.replace(body_pos=jnp.stack([model.body_pos.at[1, 2].add(-lower) for lower in LOWER]))
    data = jax.vmap(lambda _: mjx.make_data(mj_model, impl=impl, naconmax=64, njmax=64))(jnp.arange(len(LOWER)))
    step = jax.vmap(mjx.step, in_axes=(axes, 0))
    data = jax.jit(lambda m, d: jax.lax.fori_loop(0, STEPS, lambda _, d: step(m, d), d))(model, data)
    return np.asarray(data.qpos[:, 2])


print("the table is lower by       ", LOWER)
print("expected: the ball rests at ", expected().round(3))
print("seen, impl='jax'            ", seen("jax").round(3))
print("seen, impl='warp'           ", seen("warp").round(3))
