"""Statistics of unusual models, as MuJoCo's compiler has them."""

import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas.write.kinematics import kinematics
from mjx_arenas.write.set_const import set_const
from mjx_arenas.write.statistics import Rows, Statistic, bounds, combine, statistic

RTOL = 1e-6  # of each number, or of its vector: it is the sum of a dozen numbers

FLEX = """<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>
  <body pos="0 0 1"><freejoint/><geom size=".1" pos=".1 0 0"/></body>
  <flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .2 .1" radius=".01" mass="1" dim="2" pos="0 0 .1">
    <edge equality="true"/><contact selfcollide="none"/></flexcomp>
  <flexcomp name="block" type="grid" count="2 3 2" dof="trilinear" spacing=".1 .3 .1" radius=".01" mass="1" dim="3"
    pos="1 0 .1"><contact selfcollide="none"/><elasticity young="100" poisson=".2"/></flexcomp></worldbody></mujoco>"""


def compare(got, want):
    for name in Statistic._fields:
        have, number = np.asarray(getattr(got, name)), np.asarray(getattr(want, name))
        np.testing.assert_allclose(have, number, rtol=0, atol=RTOL * np.linalg.norm(number), err_msg=name)


def test_flexes():
    """A flex makes its bodies as large as its edges, or as its nodes are apart."""
    m = mujoco.MjModel.from_xml_string(FLEX)
    got = statistic(mjx.put_model(m, impl="warp"))
    compare(got, m.stat)


WORLD_ONLY = {
    "nothing": "",
    "plane": '<geom type="plane" size="0 0 1"/>',
    "box": '<geom type="box" size="1 2 .05" pos="1 1 1"/><site pos="3 3 3"/>',
    "small ball": '<geom size=".001" pos="1 2 3"/>',
    "site": '<site pos="1 2 3"/>',
    "bodies in one plane": '<body pos="1 2 3" mocap="true"/><body pos="1 .5 3"/>',
}


@pytest.mark.parametrize("name", WORLD_ONLY)
def test_without_bodies_or_width(name, impl):
    """Where no body but the world is left, or no width, MuJoCo's defaults stay."""
    m = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{WORLD_ONLY[name]}</worldbody></mujoco>")
    stale = mjx.put_model(m, impl=impl).tree_replace({"stat.center": jnp.ones(3), "stat.extent": jnp.float32(7)})
    compare(set_const(stale).stat, m.stat)
    if m.nbody == 1:  # what is told by a mean size of 0
        low, high = bounds(stale, kinematics(stale), Rows.of(stale, np.ones(1, bool)))
        compare(combine(low, high, 0.0, 0.0, stale.stat.meaninertia), m.stat)


def test_all_tables_absent(impl):
    """The statistics of a world without tables are those of the world that is compiled without them."""
    arena = mja.TableArena()
    params = arena.nominal_params()._replace(table_active=jnp.zeros(1, bool))
    compare(arena.apply(arena.put_model(impl), params).stat, arena.compile(params).stat)
