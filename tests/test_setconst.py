"""`set_const` is C's `mj_setConst`, leaf by leaf, and what it derives is what the solver needs."""

import functools
import pathlib

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds
from mujoco import mjx
from rounding import EPS, Rounding

from mjx_arenas.write import kinematics, statistics
from mjx_arenas.write.references import Heavy, subtree_com
from mjx_arenas.write.set_const import set_const
from mjx_arenas.write.statistics import Statistic
from mjx_arenas.write.weights import weights

pytestmark = pytest.mark.slow_on("warp")

C4 = int(mujoco.__version__.split(".")[0]) >= 4  # before, `mj_setConst` makes damping of a positive `biasprm[2]`
BOUNDS = {"geom_aabb", "geom_rbound"}
FAST_COMPILE = {"xla_backend_optimization_level": 0}
RECOMPUTE = jax.jit(set_const, compiler_options=FAST_COMPILE)

ARM = """<mujoco><default><geom contype="0" conaffinity="0"/></default>
<worldbody><geom type="plane" size="0 0 1"/><light mode="targetbody" target="tool" pos="0 1 3"/>
  <camera mode="targetbody" target="tool" pos="2 0 1"/><camera pos="0 0 3" quat=".9 .1 .3 0"/><site pos="1 1 1"/>
  <body pos="1 0 .2"><geom type="cylinder" size=".1 .2"/><camera pos=".1 .2 .3"/>
    <body name="rail" pos="0 0 .3"><joint type="slide" axis="1 0 0" armature=".1"/><geom type="box" size=".2 .1 .1"/>
      <light mode="trackcom" pos="0 0 1" dir="1 0 -1"/>
      <body name="upper" pos="0 .1 .2"><joint axis="0 1 0" pos="0 .02 .01"/><joint type="slide" axis="0 1 1"/>
        <geom type="capsule" size=".05 .2" pos="0 0 .2"/><camera mode="track" pos="0 0 .2"/>
        <body pos="0 0 .4" quat=".9 .3 0 0"><geom size=".07"/>
          <body name="tool" pos=".1 0 0"><joint axis="1 1 0"/><geom type="ellipsoid" size=".1 .05 .08" pos=".05 0 0"/>
            <camera mode="targetbodycom" target="rail" pos="0 .1 0"/><light mode="track" pos="0 0 .1"/></body></body>
      </body></body></body>
  <body name="crate" pos="-2 1 1" quat=".9 0 .2 0"><freejoint/><geom type="box" size=".1 .2 .1" pos=".1 .05 0"/>
    <camera mode="trackcom" pos="0 0 1"/><body pos=".2 0 0"><geom size=".1"/></body>
    <body name="lid" pos="0 .3 0"><joint axis="0 0 1"/><geom type="capsule" size=".03 .1"/></body></body>
  <body mocap="true" pos="3 0 1" quat=".8 .1 0 .1"><geom size=".1"/><light mode="targetbodycom" target="rail"/></body>
</worldbody></mujoco>"""

FREE = """<mujoco><worldbody><body name="table"><geom type="box" size="1 1 .1" contype="0" conaffinity="0"/></body>
  <body name="a" pos="0 0 1"><freejoint/><geom size=".05"/></body>
  <body name="b" pos="1 0 1" quat=".9 .1 .2 .3"><freejoint/><geom type="box" size=".05 .06 .02" pos=".03 .02 .05"/></body>
  <body name="c" pos="-1 0 .5" quat=".9 0 .2 .3"><joint type="free" armature=".3"/>
    <geom type="cylinder" size=".03 .1" pos=".2 .02 0" contype="0" conaffinity="0"/></body>
  <body name="d" pos="0 .5 .3"><freejoint/><geom type="capsule" size=".03 .05" pos=".01 0 0"/><site name="d"/></body>
</worldbody><actuator><general site="d" gear="0 0 1 0 .1 0"/></actuator></mujoco>"""

TENDONS = """<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>
  <geom name="ball" size=".12" pos="0 0 .3"/><site name="w0" pos="-.3 0 .35"/><site name="w1" pos="-.5 .2 .9"/>
  <site name="over" pos="0 .05 .6"/>
  <body pos=".3 0 .3"><joint name="j0" axis="0 1 0"/><joint name="j1" type="slide" axis="0 0 1"/>
    <geom type="capsule" size=".04 .1"/><site name="s0" pos=".05 .02 .03"/>
    <body pos=".3 0 0"><joint name="j2" axis="0 1 .2"/><geom name="rod" type="cylinder" size=".06 .1" pos=".1 0 0"
      quat=".7 .7 0 0"/><site name="side" pos=".1 0 .1"/><site name="s1" pos=".3 .02 .05"/><site name="in" pos=".11 0 .01"/>
      <body pos=".4 0 0"><joint name="j3" axis="0 1 0"/><geom size=".08" pos=".05 0 0"/><site name="s2" pos=".1 .05 .1"/>
      </body></body></body>
  <body pos="0 1 .5"><freejoint/><geom type="box" size=".1 .1 .2" pos=".02 0 0"/><site name="s3" pos="0 -.1 .1"/></body>
</worldbody><tendon>
  <fixed armature=".02"><joint joint="j0" coef="1.5"/><joint joint="j3" coef="-.5"/></fixed>
  <spatial armature=".3"><site site="w1"/><site site="s2"/><site site="s3"/></spatial>
  <spatial><site site="w0"/><geom geom="ball" sidesite="over"/><site site="s0"/><site site="s1"/></spatial>
  <spatial><site site="s0"/><geom geom="rod" sidesite="side"/><site site="s1"/><pulley divisor="2"/><site site="s1"/>
    <site site="s2"/><pulley divisor="3"/><site site="w1"/><site site="s2"/></spatial>
  <spatial><site site="s0"/><geom geom="rod" sidesite="in"/><site site="s2"/></spatial>
  <spatial><site site="s2"/><geom geom="ball"/><site site="s3"/></spatial>
</tendon></mujoco>"""

ACTUATORS = """<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody><site name="fixed" pos="1 0 1"/>
  <body pos="0 0 1"><freejoint name="free"/><geom type="box" size=".1 .2 .3" pos=".1 0 0"/><site name="a" pos=".1 0 .2"/>
    <body name="b" pos=".3 0 0"><joint name="ball" type="ball" pos="0 .1 0"/><geom type="capsule" size=".05 .2"/>
      <site name="b" pos=".1 .2 0" quat=".9 .1 .2 .3"/></body>
    <body pos="0 .3 0"><joint name="hinge" axis="1 0 .3"/><geom size=".1" pos="0 .1 .1"/><site name="c" pos="0 .2 .2"/>
    </body></body>
  <body pos="1 1 0"><joint name="slide" type="slide" axis="0 .3 1" armature=".2"/><geom size=".1"/><site name="d"/></body>
</worldbody><tendon><fixed name="t"><joint joint="hinge" coef="2"/><joint joint="slide" coef=".5"/></fixed></tendon>
<actuator><motor joint="hinge" gear="3"/><motor joint="slide"/><motor joint="ball" gear="1 2 3"/>
  <motor jointinparent="ball" gear="1 -2 3"/><motor joint="free" gear="1 2 3 4 5 6"/><motor jointinparent="free"
  gear="1 2 3 4 5 6"/><motor tendon="t" gear="2"/><motor site="a" gear="1 0 2 0 3 0"/>
  <motor site="b" refsite="c" gear="1 2 0 0 0 3"/><motor site="b" refsite="fixed" gear="0 2 1 1 0 3"/>
  <position joint="hinge" kp="20" dampratio=".7"/><position tendon="t" kp="3" dampratio="1"/>
  WARP</actuator></mujoco>"""
WARP_ACTUATORS = """<general cranksite="c" slidersite="a" cranklength=".5" gear="2"/>
  <general cranksite="c" slidersite="a" cranklength=".01"/><adhesion body="b" ctrlrange="0 1"/>"""

JOINTS = """<mujoco><default><geom contype="0" conaffinity="0"/></default>
<asset><mesh name="m" vertex="0 0 0 .2 0 0 0 .3 0 0 0 .4"/>
  <hfield name="h" nrow="2" ncol="2" size="1 1 .3 .1" elevation="0 1 1 0"/></asset>
<worldbody><geom type="hfield" hfield="h" pos="0 0 -.5"/>
  <body name="a" pos="0 0 1"><joint type="slide" axis="1 0 0" pos="0 .1 0"/><joint type="ball" pos=".1 0 0"/>
    <geom type="box" size=".1 .1 .2"/><body name="b" pos="0 0 .5"><joint type="ball"/><geom size=".1" pos="0 0 .1"/>
      <body pos=".3 0 0"><joint axis="0 0 1"/><geom type="mesh" mesh="m"/></body></body></body>
  <body name="p" pos="2 0 0"><joint type="slide" axis="1 0 0" armature=".5"/><joint type="slide" axis="0 1 0"/>
    <joint type="slide" axis="0 0 1"/><geom size=".1"/></body>
  <body name="s" pos="3 0 1"><joint axis="0 0 1"/><geom size=".1"/></body>
</worldbody><equality><connect body1="b" anchor="0 0 .3"/><connect body1="a" body2="s" anchor="0 .1 .3"/>
  <weld body1="b" body2="s" anchor="0 .1 0"/><weld body1="b" body2="s" relpose="1 2 3 .6 .8 0 0"/></equality></mujoco>"""

HUMANOID = pathlib.Path(mujoco.__file__).parent / "mjx" / "test_data" / "humanoid" / "humanoid.xml"

MODELS = {"arm": ARM, "free": FREE, "tendons": TENDONS, "actuators": ACTUATORS, "joints": JOINTS, "humanoid": ""}


@functools.cache
def mjcf(name, impl):
    return MODELS[name].replace("WARP", WARP_ACTUATORS if impl == "warp" else "") or HUMANOID.read_text()


def change(m, seed=0):
    """Other masses, inertias, armatures, sizes, poses and `qpos0`."""
    rng = np.random.default_rng(seed)
    heavier = rng.uniform(0.5, 2, m.nbody)
    m.body_mass *= heavier
    m.body_inertia *= (heavier * rng.uniform(0.8, 1.2, m.nbody))[:, None]
    m.dof_armature += rng.uniform(0.01, 0.1, m.njnt)[m.dof_jntid] * m.dof_M0
    offset = (m.body_simple == 0) & (np.arange(m.nbody) > 0)  # C refuses offsets of other bodies
    m.body_ipos[offset] += rng.uniform(-0.01, 0.01, (offset.sum(), 3))
    m.body_pos[1:] += rng.uniform(-0.02, 0.02, (m.nbody - 1, 3))
    m.body_quat[1:] += rng.uniform(-0.1, 0.1, (m.nbody - 1, 4))
    m.body_quat /= np.linalg.norm(m.body_quat, axis=1, keepdims=True)
    m.geom_size *= rng.uniform(0.9, 1.1, (m.ngeom, 3))
    for kind, adr, body in zip(m.jnt_type, m.jnt_qposadr, m.jnt_bodyid, strict=True):
        if kind == kinematics.FREE:
            m.qpos0[adr : adr + 7] = [*(m.body_pos[body] + 0.1), *m.body_quat[body]]
        elif kind == kinematics.BALL:
            turn = rng.normal(size=4)
            m.qpos0[adr : adr + 4] = turn / np.linalg.norm(turn)
        else:
            m.qpos0[adr] += rng.uniform(-0.1, 0.1)
    return m


class Pair:
    """A changed model in MJX, stale and as C derives it, and the largest rounding errors between the two."""

    def __init__(self, name, impl, seed=0):
        self.c = change(mujoco.MjModel.from_xml_string(mjcf(name, impl)), seed)
        self.stale = mjx.put_model(self.c, impl=impl)
        mujoco.mj_setConst(self.c, mujoco.MjData(self.c))
        self.want = worlds.leaves(mjx.put_model(self.c, impl=impl))
        self.data = d = mujoco.MjData(self.c)
        d.qpos = self.c.qpos0
        mujoco.mj_fwdPosition(self.c, d)

    @functools.cached_property
    def tolerance(self):
        rounding = Rounding(self.c, self.data)
        tolerances = rounding.weights() | rounding.places() | rounding.statistics(self.c.stat)
        shapes = {name: value.shape for name, value in self.want.items()}
        return {
            name: np.broadcast_to(
                np.reshape(value, shapes[name]) if np.size(value) == np.prod(shapes[name]) else value, shapes[name]
            )
            for name, value in tolerances.items()
            if name in shapes
        }

    def differing(self, got):
        """Names of the leaves that differ by more than rounding."""
        found = set()
        for name, want in self.want.items():
            tolerance = self.tolerance.get(name)
            same = np.array_equal(got[name], want)
            if not (same if tolerance is None or not want.size else np.all(np.abs(got[name] - want) <= tolerance)):
                found.add(name)
        return found


@functools.cache
def pair(name, impl):
    return Pair(name, impl)


@functools.cache
def recomputed(name, impl):
    """What `set_const` makes of a changed model."""
    return RECOMPUTE(pair(name, impl).stale)


def may_differ(impl):
    """Leaves that may differ, and why that cannot matter."""
    names = {"body_sameframe", "geom_sameframe", "site_sameframe"}  # shortcuts of C's kinematics, which MJX ignores
    names |= {"_impl.dof_length"}  # read where bodies may sleep only, which `put_model` refuses
    names |= {"_impl.geom_rbound_hfield"}  # read for height fields only, whose bounds MJX cannot change
    names |= {f"stat.{n}" for n in Statistic._fields}  # compared in test_statistics
    return names | {"light_pos0", "light_poscom0", "light_dir0"} if impl == "jax" else names  # MJX never reads them


@pytest.mark.parametrize("name", MODELS)
def test_is_mj_set_const(name, impl):
    """No leaf differs from C's, and those that C derives were stale before."""
    found = pair(name, impl)
    assert found.differing(worlds.leaves(recomputed(name, impl))) <= may_differ(impl)
    stale = found.differing(worlds.leaves(found.stale))
    assert stale >= STALE["all"] | STALE[name]


SCALE = 1.003  # by which each number is wrong, or by MOVE of its vector's length where it is small or 0
MOVE = 1e-4
VECTORS = {"body_invweight0": 1, "geom_aabb": 3, "eq_data": 1, "stat.center": 3} | dict.fromkeys(
    ("cam_pos0", "cam_poscom0", "cam_mat0", "light_pos0", "light_poscom0", "light_dir0"), 3
)


@pytest.mark.parametrize("name", MODELS)
def test_what_is_wrong_is_noticed(name, impl):
    """By 3 per mille, in any element of any derived field."""
    found, derived, looked_at = pair(name, impl), worlds.leaves(recomputed(name, impl)), set()
    for field, tolerance in found.tolerance.items():
        want = found.want[field]
        if field in may_differ(impl) or not want.size:
            continue
        vector = want.reshape(-1, VECTORS.get(field, 1))
        length = np.broadcast_to(np.linalg.norm(vector, axis=1, keepdims=True), vector.shape).reshape(want.shape)
        small = np.abs(want) < MOVE / (SCALE - 1) * length
        wrong = np.where(small, derived[field] + MOVE * length, SCALE * derived[field])
        noticed = np.abs(wrong - want) > tolerance
        looked_at.update({field} if noticed.any() else ())
        assert (noticed | (length == 0)).all(), (
            field,
            np.argwhere(~noticed)[:3],
            want[~noticed][:3],
            tolerance[~noticed][:3],
        )
    assert looked_at >= {"body_subtreemass", "dof_M0", "body_invweight0"}


STALE = {
    "all": {"body_subtreemass", "dof_M0", "dof_invweight0", "body_invweight0", *BOUNDS},
    "arm": {"cam_pos0", "cam_poscom0", "cam_mat0"},
    "free": {"actuator_acc0"},
    "tendons": {"tendon_length0", "tendon_invweight0"},
    "actuators": {"actuator_acc0"},
    "joints": {"eq_data"},
    "humanoid": {"actuator_acc0"},
}


def recompiled(name, impl):
    """The changed model, compiled with the changed values."""
    m, spec = pair(name, impl).c, mujoco.MjSpec.from_string(mjcf(name, impl))
    spec.compile()
    for body in spec.bodies[1:]:
        i = body.id
        body.pos, body.quat, body.explicitinertial = m.body_pos[i], m.body_quat[i], True
        body.mass, body.inertia, body.ipos, body.iquat = (
            m.body_mass[i],
            m.body_inertia[i],
            m.body_ipos[i],
            m.body_iquat[i],
        )
    for joint in spec.joints:
        joint.armature = m.dof_armature[m.jnt_dofadr[joint.id]]
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            joint.parent.pos = m.qpos0[m.jnt_qposadr[joint.id] :][:3]
    for geom in spec.geoms:
        geom.size = m.geom_size[geom.id]
    return spec.compile()


@pytest.mark.parametrize("name", ["arm", "free", "tendons"])
def test_statistics(name, impl):
    """They are those of the model compiled with the changed values."""
    found = pair(name, impl)
    got, stale = worlds.leaves(recomputed(name, impl)), worlds.leaves(found.stale)
    compiled = recompiled(name, impl)
    # A compiled joint has one armature for all its axes.
    compiled.stat.meaninertia += (found.c.dof_armature - compiled.dof_armature).mean()
    for field in Statistic._fields:
        have, want = got[f"stat.{field}"], np.asarray(getattr(compiled.stat, field))
        np.testing.assert_allclose(have, want, rtol=0, atol=found.tolerance[f"stat.{field}"].max(), err_msg=field)
    assert not np.allclose(stale["stat.meaninertia"], compiled.stat.meaninertia, rtol=0.01)


@pytest.mark.slow
def test_vmap():
    """A batch of changed models becomes what each of them becomes."""
    pairs = [Pair("free", "jax", seed) for seed in range(1, 4)]
    flat, structure = zip(*(jax.tree.flatten(p.stale) for p in pairs), strict=True)
    batch = jax.tree.unflatten(structure[0], [jnp.stack(leaves) for leaves in zip(*flat, strict=True)])
    batch = jax.jit(jax.vmap(set_const), compiler_options=FAST_COMPILE)(batch)
    for i, found in enumerate(pairs):
        assert found.differing(worlds.leaves(jax.tree.map(lambda x, i=i: np.asarray(x)[i], batch))) <= may_differ("jax")


def test_weights_of_some_trees(impl):
    """Rows of other trees stay as they are."""
    found = pair("free", impl)
    chosen = np.array([found.c.body(name).id for name in ("b", "d")])
    got = jax.jit(functools.partial(weights, roots=chosen), compiler_options=FAST_COMPILE)(found.stale)
    dofs = np.isin(found.c.dof_bodyid, chosen)
    rows = {"dof_M0": dofs, "dof_invweight0": dofs, "body_invweight0": np.isin(np.arange(found.c.nbody), chosen)}
    for name, new in rows.items():
        np.testing.assert_array_equal(getattr(got, name)[~new], getattr(found.stale, name)[~new])
        tolerance = np.broadcast_to(found.tolerance[name], found.want[name].shape)[new]
        assert (np.abs(getattr(got, name)[new] - found.want[name][new]) <= tolerance).all()
    with pytest.raises(ValueError, match=r"^`roots` must be first moving bodies on the static world, \[2, 3, 4, 5\]"):
        weights(found.stale, np.array([1, 3]))


BOX = """<mujoco><option timestep=".004" iterations="5" ls_iterations="8"/><worldbody><geom type="plane" size="0 0 1"/>
  <body pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" density="DENSITY"/></body></worldbody></mujoco>"""


@pytest.mark.slow
def test_heavier_box_rests_as_deep(impl):
    """A box of ten times the mass sinks 0.1 mm into the floor, as its recompiled twin does; with stale weights 0.6 mm."""
    box, heavy_box = (mujoco.MjModel.from_xml_string(BOX.replace("DENSITY", d)) for d in ("100", "1000"))
    light, twin = mjx.put_model(box, impl=impl), mjx.put_model(heavy_box, impl=impl)
    heavy = light.tree_replace({"body_mass": light.body_mass * 10, "body_inertia": light.body_inertia * 10})
    sizes = (16, 64) if impl == "warp" else (None, None)
    data = mjx.make_data(box, impl=impl, naconmax=sizes[0], njmax=sizes[1])

    def rest_depth(model):
        rest = jax.lax.fori_loop(0, 100, lambda _, d: mjx.step(model, d), data)
        return 1e3 * (0.1 - rest.qpos[2])  # [mm]

    depth = jax.jit(rest_depth, compiler_options=FAST_COMPILE)
    expected = float(depth(twin))
    assert 0.10 < expected < 0.12
    # The depth is the end of a float32 simulation of a height of 100 mm: five hundred roundings of that.
    assert abs(float(depth(RECOMPUTE(heavy))) - expected) < 500 * 100 * EPS
    assert 0.6 < float(depth(heavy)) < 0.7


DAMPED = """<mujoco><worldbody><body><joint name="j" axis="0 1 0"/><geom name="g" size=".1" pos="0 0 .3" mass="MASS"/></body>
</worldbody><actuator><position joint="j" kp="20" dampratio=".7"/></actuator></mujoco>"""


@pytest.mark.slow
def test_dampratio_is_the_compilers(impl):
    """Neither C nor `set_const` makes damping of a `dampratio` again, nor, as C before 4.0, of one that is written."""
    m, heavier = (mujoco.MjModel.from_xml_string(DAMPED.replace("MASS", mass)) for mass in ("1", "4"))
    assert heavier.actuator_biasprm[0, 2] == pytest.approx(2 * m.actuator_biasprm[0, 2], rel=1e-9)
    m.body_mass *= 4
    m.body_inertia *= 4
    for written in (m.actuator_biasprm[0, 2], 0.7)[: 1 + C4]:
        m.actuator_biasprm[0, 2] = written
        got = set_const(mjx.put_model(m, impl=impl))
        mujoco.mj_setConst(m, mujoco.MjData(m))
        assert m.dof_M0 == pytest.approx(heavier.dof_M0)
        assert m.actuator_biasprm[0, 2] == written
        np.testing.assert_array_equal(got.actuator_biasprm, m.actuator_biasprm.astype(np.float32))


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_ranks_are_explicit(name, impl):
    """Nothing is broadcast over axes that it does not have."""
    model = pair(name, impl).stale
    everything = np.ones(model.nbody, bool)
    rows, bodies = statistics.Rows.of(model, everything), np.arange(1, model.nbody)

    def others(model, present):
        kin = kinematics.kinematics(model, compiled=True)
        yield statistics.bounds(model, kin, rows, present)
        yield statistics.sizes(model, kin, rows, bodies, present)
        yield subtree_com(model, kin, bodies, Heavy(bodies, False))

    with jax.numpy_rank_promotion("raise"):
        jax.eval_shape(set_const, model)
        jax.eval_shape(lambda model, present: tuple(others(model, present)), model, jnp.asarray(everything))


def test_nothing_is_transferred(impl):
    """A compiled call stays on the device."""
    recomputed("free", impl)
    with jax.transfer_guard("disallow"):
        jax.block_until_ready(RECOMPUTE(pair("free", impl).stale))


CHANGED = (
    "body_mass body_inertia body_ipos body_iquat body_pos body_quat qpos0 dof_armature geom_pos geom_size site_pos"
)
CHANGED += " site_quat jnt_axis jnt_pos actuator_gear actuator_cranklength tendon_armature cam_pos eq_data"


@pytest.mark.xslow
@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["joints", *(pytest.param(name, marks=pytest.mark.xslow) for name in ("actuators", "free"))]
)  # tendons pass geoms, through MJX's own `wrap`
def test_gradients_are_numbers(name):
    """Even where a length, a moment or an armature is 0."""
    model = pair(name, "warp").stale

    def total(fields):
        got = set_const(model.tree_replace(fields))
        derived = [getattr(got, field) for field in sorted(STALE["all"] | STALE[name])]
        return sum(jnp.log1p(jnp.abs(x)).sum() for x in (*derived, *got.stat.__dict__.values()))

    fields = {field: getattr(model, field) for field in CHANGED.split()}
    for field, slope in jax.jit(jax.grad(total), compiler_options=FAST_COMPILE)(fields).items():
        assert np.isfinite(slope).all(), field


def test_refusals():
    """What cannot be derived is named."""
    flex = """<mujoco><worldbody><body><freejoint/><geom size=".1"/></body><flexcomp name="f" type="grid" count="3 3 1"
      spacing=".1 .1 .1" radius=".01" mass="1" dim="2"/></worldbody></mujoco>"""
    with pytest.raises(
        NotImplementedError, match=r"^`set_const` does not derive the fields of flexes; the model has 1"
    ):
        set_const(mjx.put_model(mujoco.MjModel.from_xml_string(flex), impl="warp"))
    with pytest.raises(NotImplementedError, match=r"^`set_const` needs a model of impl 'jax' or 'warp', got 'cpp'\.$"):
        set_const(mjx.put_model(mujoco.MjModel.from_xml_string("<mujoco/>"), impl="cpp"))
    fluid = BOX.replace('density="DENSITY"', 'fluidshape="ellipsoid"').replace(
        "<option", '<option density="1" viscosity="1"'
    )
    with pytest.raises(NotImplementedError, match=r"^`set_const` cannot derive `geom_fluid` of ellipsoids"):
        set_const(mjx.put_model(mujoco.MjModel.from_xml_string(fluid), impl="warp"))
    model = pair("actuators", "jax").stale
    unknown = model.replace(actuator_trntype=np.full_like(model.actuator_trntype, mujoco.mjtTrn.mjTRN_UNDEFINED))
    with pytest.raises(NotImplementedError, match=r"^`set_const` does not know actuator_trntype mjTRN_UNDEFINED"):
        set_const(unknown)


@pytest.mark.slow
def test_many_worlds():
    """A model with an axis of worlds is refused outside of `vmap`, by the first field that has one, whichever it is."""
    model = pair("actuators", "jax").stale
    for name in ("body_mass", "dof_armature", "tendon_stiffness", "qpos0", "cam_pos"):
        worlds = jnp.stack([getattr(model, name)] * 2)
        said = rf"^`set_const` takes one world, got `{name}` of many: jax\.vmap\(mja\.set_const, in_axes="
        with pytest.raises(ValueError, match=said):
            set_const(model.replace(**{name: worlds}))
    axes = jax.tree.map(lambda _: None, model).replace(body_mass=0)
    many = jax.jit(jax.vmap(set_const, in_axes=(axes,)))(model.replace(body_mass=jnp.stack([model.body_mass] * 2)))
    assert many.body_subtreemass.shape == (2, model.nbody)
