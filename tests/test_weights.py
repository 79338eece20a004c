"""Inverse weights where float32 has few digits to lose: singular trees, bodies without mass, mass far from its body's origin."""

import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from mujoco import mjx
from oracle import off

import mjx_arenas as mja
from mjx_arenas.write.set_const import set_const
from mjx_arenas.write.weights import weights

FAST_COMPILE = {"xla_backend_optimization_level": 0}
RTOL = 1e-5  # of each number: some hundred roundings of float32, as many as a tree of few bodies takes
READ = "body_mass body_inertia body_ipos body_iquat body_pos body_quat qpos0 dof_armature jnt_axis jnt_pos site_pos"
DERIVED = ("dof_M0", "dof_invweight0", "body_invweight0", "tendon_invweight0", "actuator_acc0")


def model(xml, **edits):
    """A compiled model, edited, with nothing but float32 numbers in what constants are derived from."""
    m = mujoco.MjModel.from_xml_string(xml)
    for name, (rows, values) in edits.items():
        getattr(m, name)[rows] = values
    for name in READ.split():
        getattr(m, name)[:] = getattr(m, name).astype(np.float32)
    return m


@functools.cache
def derive():
    return jax.jit(set_const, compiler_options=FAST_COMPILE)


def compare(m):
    """What `set_const` makes of a model is what C makes of it, number by number."""
    got = derive()(mjx.put_model(m, impl="jax"))
    mujoco.mj_setConst(m, mujoco.MjData(m))
    for name in DERIVED:
        np.testing.assert_allclose(getattr(got, name), getattr(m, name), rtol=RTOL, atol=0, err_msg=name)


SINGULAR = """<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>
  <body quat=".9 .1 .2 .3"><joint name="a" axis="0 1 .3" armature="ARMATURE"/>
    <joint name="b" axis="0 1 .3" armature="ARMATURE"/><geom size=".1" pos="0 0 .5"/></body>
  <body pos="1 0 0"><joint name="c" axis="0 1 0"/><joint name="d" axis="1 0 0" pos="0 0 .1"/><geom size=".1" pos="0 0 .3"/></body>
  <body pos="2 0 0"><freejoint/><geom size=".1" pos="0 0 .3"/><site name="s"/></body></worldbody>
  <tendon><fixed><joint joint="c" coef="1"/></fixed><fixed><joint joint="a" coef="1"/></fixed></tendon>
  <actuator><motor joint="c"/><motor joint="a"/><motor site="s" gear="1 0 2 0 3 0"/></actuator></mujoco>"""


@pytest.mark.slow
@pytest.mark.parametrize("armature", ["1e-3", "1e-6", "0"])
def test_singular_tree(armature):
    """Two hinges in one place, which only their armatures hold, as in C, and none of it reaches other trees.

    Without armatures, C has the inverse of `mjMINVAL`.
    """
    compare(model(SINGULAR.replace("ARMATURE", armature)))


def test_no_number_stays_in_its_tree():
    """A mass that is no number makes nothing of other trees one."""
    m = model(SINGULAR.replace("ARMATURE", "1e-3"))
    mujoco.mj_setConst(m, mujoco.MjData(m))
    stale = mjx.put_model(m, impl="jax")
    got = derive()(stale.replace(body_mass=stale.body_mass.at[1].set(jnp.nan)))
    own = {
        "dof_M0": [0, 1],
        "dof_invweight0": [0, 1],
        "body_invweight0": [1],
        "tendon_invweight0": [1],
        "actuator_acc0": [1],
    }
    for name, rows in own.items():
        other = np.isin(np.arange(len(getattr(got, name))), rows, invert=True)
        assert np.isnan(getattr(got, name)[~other]).any()
        np.testing.assert_allclose(getattr(got, name)[other], getattr(m, name)[other], rtol=RTOL, err_msg=name)


BALLS = """<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody><body><freejoint/><geom size=".1"/></body>
  <body pos="1 0 0"><freejoint/><geom size=".1" pos="0 .2 0"/></body>
  <body pos="2 0 0"><freejoint/><geom size=".1" pos=".1 0 0"/><site name="s"/></body>
  <body pos="3 0 0"><freejoint/><geom size=".1"/><body pos=".2 0 0"><geom size=".1"/></body></body>
  <body pos="3 0 0"><joint axis="0 1 0"/><geom size=".1"/></body></worldbody>
  <actuator><motor site="s" gear="1 0 0 0 .1 0"/></actuator></mujoco>"""


NEITHER, NO_MASS = ("body_mass", "body_inertia"), ("body_mass",)
MASSLESS = [(bodies, NEITHER) for bodies in ([1], [2], [3], [4, 5], [6], [1, 2, 3, 4, 5, 6])]
# Of inertia without mass, what C makes of an offset is left to rounding.
MASSLESS += [(bodies, NO_MASS) for bodies in ([1], [6], [1, 6])]


@pytest.mark.slow
@pytest.mark.parametrize(("bodies", "fields"), MASSLESS)
def test_without_mass(bodies, fields):
    """Bodies without mass: C divides by `mjMINVAL`."""
    compare(model(BALLS, **dict.fromkeys(fields, (bodies, 0))))


BOX = '<geom type="box" size=".0025 .002 .003" pos="{0} .002 -.1"/>'
FAR = """<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>
  <body pos="0 0 1" quat=".9 .1 .2 .3"><freejoint/>{box}</body>
  <body pos="0 0 2" quat=".9 .1 -.2 .3"><joint type="free" armature="1e-6"/>{box}</body>
  <body pos="0 0 3" quat=".9 .1 -.2 .3"><freejoint/>{box}<site name="s" pos="{0} .004 -.1"/></body>
  <body pos="9 0 3" quat=".9 .1 .2 -.3"><freejoint/><body>{box}</body></body>
  <body pos="0 9 3" quat=".9 -.1 .2 .3"><joint name="free" type="free" armature="1e-6"/>{box}
    <body pos="{0} .008 -.1" quat=".8 .2 0 .1"><joint axis="0 .1 1" pos="0 0 .002"/><geom size=".002" pos=".003 0 0"/>
      <body pos=".004 0 0"><joint type="ball"/><geom type="capsule" size=".001 .002" pos="0 0 .003"/><site name="t"/>
  </body></body></body></worldbody>
  <tendon><spatial><site site="s"/><site site="t"/></spatial></tendon>
  <actuator><motor site="t" gear="1 0 0 0 1e-3 0"/><motor joint="free" gear="0 0 0 1 2 3"/></actuator></mujoco>"""


@pytest.mark.parametrize("offset", ["0", ".1", "3", "30"])
@pytest.mark.slow
def test_mass_far_from_the_origin(offset):
    """5 mm boxes up to 30 m off their bodies' origins: as exact as at the origin."""
    m = model(FAR.format(offset, box=BOX.format(offset)))
    compare(m)
    roots = np.flatnonzero(m.body_parentid[1:] == 0) + 1
    got = jax.jit(functools.partial(weights, roots=roots), compiler_options=FAST_COMPILE)(mjx.put_model(m, impl="jax"))
    for name, value in got._asdict().items():
        np.testing.assert_allclose(value, getattr(m, name), rtol=RTOL, atol=0, err_msg=name)


@pytest.mark.parametrize(
    ("field", "row", "step"), [("body_ipos", (8, 2), 1e-7), ("body_mass", 6, 1e-10), ("dof_armature", 28, 1e-11)]
)
@pytest.mark.slow
def test_gradients_are_those_of_c(field, row, step):
    """As C's differences have them: that trees are seen from their centres of mass leaves no trace."""

    def total(m, xp):
        return sum(xp.log(xp.where(x > 0, x, 1.0)).sum() for x in (getattr(m, name) for name in DERIVED))

    def beside(step):
        m = model(FAR.format(".1", box=BOX.format(".1")))
        getattr(m, field)[row] += step
        mujoco.mj_setConst(m, mujoco.MjData(m))
        return total(m, np)

    stale = mjx.put_model(model(FAR.format(".1", box=BOX.format(".1"))), impl="jax")
    slope = jax.grad(lambda value: total(set_const(stale.tree_replace({field: value})), jnp))
    slope = jax.jit(slope, compiler_options=FAST_COMPILE)(getattr(stale, field))
    assert slope[row] == pytest.approx((beside(step) - beside(-step)) / (2 * step), rel=1e-4)


@pytest.mark.slow
def test_yaw_alone_moves_acceleration():
    """An actuator along the parent's axes turns with no object: where yaws alone vary, `actuator_acc0` is the compiler's all the same."""
    arena = mja.TableArena(objects=[mja.Object("brick", "box", (0.1, 0.06, 0.04), rot=0.3)])
    motor = arena.spec.add_actuator(name="push", target="brick_joint0", trntype=mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    motor.gear = [0.1, 0.2, 0.3, 1, 2, 3]  # about the axes of the world, in which its moments depend on the yaw
    ranges, got = mja.ArenaRanges(table_rots=mja.Uniform(-3, 3)), []
    for key in mja.world_keys(0, range(3)):
        params = arena.sample_params(key, ranges)
        compiled = arena.compile(params)
        found = arena.apply(arena.put_model("jax"), params).actuator_acc0
        assert not off(compiled, "actuator_acc0", np.asarray(found), compiled.actuator_acc0).any()
        got.append(float(found[0]))
    assert np.ptp(got) > 0.01 * max(got)
