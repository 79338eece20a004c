"""A belt of the base MJCF, a geom with a `surfacevel`: on Warp it carries what lies on it as in C; on JAX it is refused."""

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja

pytestmark = pytest.mark.skipif(not hasattr(mujoco.MjModel, "geom_surfacevel"), reason="MuJoCo is older")
BELT = """<mujoco><worldbody><geom name="floor" type="plane" size="3 3 .1"/>
<geom name="belt" type="box" size="1 .3 .4" pos="2 0 .4" surfacevel="0.3 0 0"/></worldbody></mujoco>"""


def scene():
    return mja.TableArena((0.4, 0.4, 0.05), xml=BELT, objects=[mja.Object("cube", full_size=0.1)])


def test_refused_on_jax():
    with pytest.raises(
        ValueError, match=r"impl='jax' of MJX leaves out the `surfacevel` of geom 'belt': use impl='warp'."
    ):
        scene().put_model("jax")


@pytest.mark.slow
def test_carried_on_warp():
    """In half a second by 15 cm, less what the cube slips, v^2 / (2 mu g) < 5 mm, at first; to a millimetre as in C."""
    arena = scene()
    keys = mja.world_keys(0, range(2))
    batch = arena.randomize(arena.put_model("warp"), keys, mja.ArenaRanges(object_masses=mja.Uniform(0.5, 2.0)))
    data = mja.make_data(batch, keys)
    at = arena.layout.object_qpos[0]
    data = data.replace(qpos=data.qpos.at[:, at[:3]].set(np.array([1.5, 0.0, 0.85])))
    moved = np.asarray(mja.rollout(batch, data, 250).qpos)[:, at[:3]]
    for w in range(2):
        model, c = arena.c_world(jax.tree.map(np.asarray, batch.world(w)))
        c.qpos[at[:3]] = 1.5, 0, 0.85
        for _ in range(250):
            mujoco.mj_step(model, c)
        assert 0.145 < c.qpos[at[0]] - 1.5 < 0.15
        np.testing.assert_allclose(moved[w], c.qpos[at[:3]], atol=1e-3)
