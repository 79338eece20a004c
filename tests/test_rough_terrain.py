"""Playground's Go1 on its rough terrain, of which the package ships everything but what is only seen of the robot."""

import functools
import importlib.util
import pathlib

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from mujoco import mjx
from rounding import Rounding
from whole import elsewhere, hold

import mjx_arenas as mja
from mjx_arenas import dr

STEPS, FAR = 20, 5
pytestmark = pytest.mark.filterwarnings("ignore:The arena. geoms are inside")  # the robot and the ground, at `qpos0`
ATTRIBUTES = (
    "body.mass", "body.ipos", "body.gravcomp", "joint.damping", "joint.armature", "joint.frictionloss", "actuator.kp",
    "actuator.kv", "actuator.forcerange", "option.gravity", "option.impratio", "geom.friction", "geom.solref", "geom.solimp", "geom.solmix",
    "site.pos", "site.rpy", "camera.pos",
)  # fmt: skip
UNSEEN = ("body.gravcomp", "joint.frictionloss")
"""Which are 0 in the MJCF, and which MJX on JAX then leaves out."""


@functools.cache
def arena(impl):
    """The scene without meshes, which come from elsewhere; the ground moves and turns, too."""
    spec_of = importlib.util.find_spec("mujoco_playground")
    assert spec_of is not None
    assert spec_of.submodule_search_locations is not None
    folder = pathlib.Path(spec_of.submodule_search_locations[0]) / "_src" / "locomotion" / "go1" / "xmls"
    spec = mujoco.MjSpec.from_file(str(folder / "scene_mjx_feetonly_rough_terrain.xml"))
    for element in [*(geom for geom in spec.geoms if geom.meshname), *spec.meshes]:
        spec.delete(element)
    spec.meshdir = spec.texturedir = str(folder)
    made = mja.Arena.from_xml(spec)
    terms = {a.replace(".", "_"): dr.Term(a) for a in ATTRIBUTES if impl == "warp" or a not in UNSEEN}
    made.vary(**terms, ground=dr.Term("geom.pos", "floor"), slope=dr.Term("geom.rpy", "floor"))
    return made


def standing(model):
    """(nq,) in the keyframe "home", so low that a foot is half a millimetre in the ground."""
    c = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, c, model.key("home").id)
    for _ in range(4000):
        mujoco.mj_forward(model, c)
        if c.ncon and c.contact.dist.min() < -5e-4:
            break
        c.qpos[2] -= 2.5e-4
    return np.array(c.qpos)


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_as_compiled(impl):
    """Leaf by leaf; a factor of 1.003 on an element of any field is noticed."""
    hold(arena(impl), impl)


@pytest.mark.xslow
def test_steps_are_those_of_the_compiled_model(impl):
    """The nominal world and two others, with contacts on the ground of each; the reference is MJX, as C finds contacts otherwise."""
    made = arena(impl)
    params = [jax.tree.map(np.asarray, made.nominal_params()), elsewhere(made, 0.1), elsewhere(made, -0.1)]
    models = [made.compile(one) for one in params]
    qpos = np.array([standing(model) for model in models], np.float32)
    batch = made.batch(made.put_model(impl), jax.tree.map(lambda *x: np.stack(x), *params))
    ctrl = jnp.asarray(models[0].key("home").ctrl, jnp.float32)
    data = mja.make_data(batch)
    data = data.replace(qpos=jnp.asarray(qpos), ctrl=jnp.broadcast_to(ctrl, data.ctrl.shape))
    got = mja.rollout(batch, data, STEPS)
    step = jax.jit(mjx.step)
    for i, model in enumerate(models):
        alone, room = mjx.put_model(model, impl=impl), {"naconmax": 200, "njmax": 900} if impl == "warp" else {}
        one = mjx.make_data(model, impl=impl, **room).replace(qpos=jnp.asarray(qpos[i]), ctrl=ctrl)
        for _ in range(STEPS):
            one = step(alone, one)
        assert np.abs(one.qvel).max() > 1
        error = FAR * Rounding(model, mujoco.MjData(model)).error  # as in test_stepped.py
        for name in ("qpos", "qvel"):
            want = np.asarray(getattr(one, name))
            np.testing.assert_allclose(getattr(got, name)[i], want, rtol=0, atol=error * np.abs(want).max())
    assert np.abs(got.qpos[1] - got.qpos[0]).max() > 1e-3
