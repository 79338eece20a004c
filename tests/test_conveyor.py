"""Surfaces of the base MJCF that move (`surfacevel`) or stick (`adhesion`): on Warp they do as in C; on JAX they are refused."""

import re

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr

BELT = """<mujoco><worldbody><geom name="floor" type="plane" size="3 3 .1"/>
<geom name="belt" type="box" size="1 .3 .4" pos="2 0 .4" surfacevel="0.3 0 0"/></worldbody></mujoco>"""


BALL = """<mujoco><option gravity="0 0 9.81"/><worldbody><geom name="roof" type="plane" size="3 3 .1"/>
<body name="ball" pos="0 0 .0999"><joint name="up" type="slide" axis="0 0 1"/><geom name="ball" size=".1" mass=".1" gap=".05" {}/></body>
</worldbody><contact>{}</contact></mujoco>"""
PAIR = '<pair name="glue" geom1="roof" geom2="ball" gap=".05" {}/>'
STICKING = {  # adhesion [N], of a geom or of a pair, which holds 0.98 N of weight
    "geom 'ball'": BALL.format('adhesion="5"', ""),
    "pair 'glue'": BALL.format("", PAIR.format('adhesion="5"')),
    "pair 0 (of geom 'roof' and geom 'ball')": BALL.format("", PAIR.replace('name="glue" ', "").format('adhesion="5"')),
}


def scene():
    return mja.TableArena((0.4, 0.4, 0.05), xml=BELT, objects=[mja.Object("cube", full_size=0.1)])


def test_refused_on_jax():
    with pytest.raises(
        ValueError, match=r"impl='jax' of MJX leaves out the `surfacevel` of geom 'belt': use impl='warp'."
    ):
        scene().put_model("jax")


@pytest.mark.xslow
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


@pytest.mark.parametrize("what", STICKING)
def test_sticking_refused_on_jax(what):
    sentence = f"impl='jax' of MJX leaves out the `adhesion` of {what}: use impl='warp'."
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        mja.Arena.from_xml(STICKING[what]).put_model("jax")


@pytest.mark.slow
@pytest.mark.parametrize("what", list(STICKING)[:2])
def test_sticks_on_warp(what):
    """Gravity pulls a ball off: where it sticks it hangs 0.5 mm deeper than at the start, as in C, in worlds of any mass; else it falls."""
    arena = mja.Arena.from_xml(STICKING[what])
    arena.vary(mass=dr.Term("body.mass"))
    params = jax.vmap(lambda _: arena.nominal_params())(np.arange(2))
    params = params._replace(terms={"mass": np.array([[0.1], [0.8]])})  # 0.98 N and 7.8 N, of which 5 N hold
    batch = arena.batch(arena.put_model("warp"), params)
    fallen = np.asarray(mja.rollout(batch, mja.make_data(batch), 50).qpos)[:, 0]
    for w in range(2):
        model, c = arena.c_world(batch.world(w))
        for _ in range(50):
            mujoco.mj_step(model, c)
        np.testing.assert_allclose(fallen[w], c.qpos[0], rtol=1e-3)
    assert fallen[0] < 0.002
    assert fallen[1] > 0.01
