"""`geom_dataid`, which mesh a geom has, cannot differ between worlds of `mjx.Model`, though mujoco_warp takes one for each world."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import warp as wp
from mujoco import mjx
from mujoco.mjx.third_party import mujoco_warp

CUBE = " ".join(f"{x} {y} {z}" for x in (-1, 1) for y in (-1, 1) for z in (-1, 1))
XML = f"""
<mujoco>
  <asset><mesh name="small" vertex="{CUBE}" scale=".1 .1 .1"/><mesh name="large" vertex="{CUBE}" scale=".2 .2 .2"/></asset>
  <worldbody>
    <geom type="plane" size="0 0 1"/>
    <body pos="0 0 .21"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/>
      <geom type="mesh" mesh="MESH"/></body>
  </worldbody>
</mujoco>"""
MESHES = ("small", "large")  # in two worlds
STEPS = 500

MODELS = [mujoco.MjModel.from_xml_string(XML.replace("MESH", mesh)) for mesh in MESHES]


def in_c() -> np.ndarray:
    """Heights of the cube at the end, of models of C with each mesh."""
    heights = []
    for model in MODELS:
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, STEPS)
        heights.append(data.qpos[2])
    return np.array(heights)


def in_mujoco_warp() -> np.ndarray:
    """The same of one model of mujoco_warp with a `geom_dataid` (worlds, geoms)."""
    with wp.ScopedDevice("cpu"):
        model = mujoco_warp.put_model(MODELS[0])
        data = mujoco_warp.make_data(MODELS[0], nworld=len(MODELS))
        model.geom_dataid = wp.array(np.stack([m.geom_dataid for m in MODELS]), dtype=int)
        model.geom_rbound = wp.array(np.stack([m.geom_rbound for m in MODELS]), dtype=float)
        bounds = np.stack([m.geom_aabb for m in MODELS]).reshape(len(MODELS), -1, 2, 3)
        model.geom_aabb = wp.array(bounds, dtype=wp.vec3)
        for _ in range(STEPS):
            mujoco_warp.step(model, data)
        return data.qpos.numpy()[:, 2]


def in_mjx(stack: Callable) -> np.ndarray:
    """The same of one batched model of MJX, whose rows `stack` puts together."""
    model = mjx.put_model(MODELS[0], impl="warp").replace(geom_dataid=stack([m.geom_dataid for m in MODELS]))
    axes = jax.tree.map(lambda _: None, model).replace(geom_rbound=0)
    model = model.replace(geom_rbound=jnp.stack([m.geom_rbound for m in MODELS]))
    data = jax.vmap(lambda _: mjx.make_data(MODELS[0], impl="warp", naconmax=64, njmax=64))(jnp.arange(len(MODELS)))
    step = jax.vmap(mjx.step, in_axes=(axes, 0))
    data = jax.jit(lambda m, d: jax.lax.fori_loop(0, STEPS, lambda _, d: step(m, d), d))(model, data)
    return np.asarray(data.qpos[:, 2])


print("expected: the cube rests at    ", in_c().round(3))
print("seen, mujoco_warp              ", in_mujoco_warp().round(3))
paths = [jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_leaves_with_path(mjx.put_model(MODELS[0]))]
print("is a leaf of mjx.Model, as others are:", {name: f".{name}" in paths for name in ("geom_dataid", "geom_matid")})
for array, stack in (("NumPy's", np.stack), ("JAX's", jnp.stack)):
    try:
        print(f"seen, MJX, {array} array ", in_mjx(stack).round(3))
    except (TypeError, AttributeError, ValueError) as error:
        print(f"seen, MJX, {array} array: {type(error).__name__}: {str(error).splitlines()[0]}")
