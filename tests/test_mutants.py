"""A factor of 1.003 on any one element of any field that can be written is noticed by the oracle: the table of docs/mutants.md."""

import operator
import warnings
from typing import NamedTuple

import jax
import mujoco
import numpy as np
import pages
import pytest
import worlds
from mujoco import mjx
from oracle import allowed, mutants, off

import mjx_arenas as mja
from mjx_arenas.write import follows

pytestmark = pytest.mark.slow_on("warp")

AIM = mujoco.mjtCamLight
# A robot with a hinge, a ball joint, sites, tendons, and actuators of every kind that both implementations have.
ARM = """<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>
  <body name="base"><geom type="box" size=".05 .05 .05" mass="1"/><site name="low" pos=".02 .01 .1"/>
    <body name="upper" pos="0 0 .1"><joint name="hinge" axis="0 1 .2" armature=".01"/>
      <geom type="capsule" size=".02" fromto="0 0 0 .2 .01 0"/><light mode="trackcom" pos="0 0 1" dir="1 0 -1"/>
      <body name="lower" pos=".2 .01 0"><joint name="ball" type="ball"/><geom type="capsule" size=".02" fromto="0 0 0 .2 0 .05"/>
        <site name="tip" pos=".2 .01 0" quat=".9 .1 .2 .3"/><camera pos="0 .1 .1" quat=".9 .1 .3 0"/></body></body></body>
</worldbody><tendon><fixed name="fixed" armature=".02"><joint joint="hinge" coef="2"/></fixed>
  <spatial name="string" armature=".03"><site site="low"/><site site="tip"/></spatial></tendon>
<equality><weld body1="lower" body2="base"/><connect body1="upper" body2="lower" anchor=".1 .02 0"/></equality>
<actuator><motor joint="hinge"/><motor joint="ball" gear="1 2 3"/><motor jointinparent="ball" gear="1 -2 3"/>
  <motor site="tip" gear="1 0 2 0 3 0"/><motor site="tip" refsite="low" gear="1 2 0 0 0 1"/><motor tendon="string" gear="2"/>
</actuator></mujoco>"""
DRAWER = """<mujoco><asset><material name="wood" rgba=".6 .4 .2 1"/></asset><worldbody><body name="box">
  <inertial pos=".01 .02 .005" mass=".3" diaginertia=".001 .002 .0025"/><geom type="box" size=".05 .04 .03" material="wood"/>
  <body name="drawer" pos=".05 0 0"><joint name="pull" type="slide" axis="1 .1 0"/>
    <geom type="box" size=".02 .02 .02" contype="0" conaffinity="0" material="wood"/><site name="knob" pos=".03 .01 0"/>
    <camera name="inside" mode="track" pos="0 .01 .02"/></body></body></worldbody></mujoco>"""


def everything():
    """An arena with some of each kind of element that follows from the parameters."""
    objects = [*worlds.OBJECTS, mja.Object("box", "mjcf", file=mujoco.MjSpec.from_string(DRAWER), on=1)]
    arena = mja.MultiTableArena(worlds.offsets(2), table_condim=6, objects=objects)
    arena.attach(ARM, on=0, pos=(0.1, 0.2, 0))
    spec, table = arena.spec, arena.spec.body("table1")
    table.add_camera(name="on_table", pos=(0.1, 0, 0.5), quat=(0.9, 0.1, 0.3, 0))
    table.add_light(name="lamp", pos=(0, 0.1, 0.5), dir=(0, 0.1, -1))
    table.add_site(name="hook", pos=(0.1, 0.2, 0.6))
    spec.worldbody.add_camera(name="watch", pos=(2, 0, 2), mode=AIM.mjCAMLIGHT_TARGETBODYCOM, targetbody="box")
    spec.worldbody.add_light(name="spot", pos=(1, 0, 2), mode=AIM.mjCAMLIGHT_TARGETBODY, targetbody="table0")
    spec.body("table0").add_site(name="post", pos=(0.3, 0.1, 0.4))
    for name, *ends, armature in (("rope", "hook", "box_knob", 0), ("brace", "post", "robot_tip", 0.1)):
        tendon = spec.add_tendon(name=name, springlength=[0, 0.3], armature=armature)
        for end in ends:
            tendon.wrap_site(end)
    for name, joint in (("lift", "cube_joint0"), ("push", "box_joint0"), ("slide", "box_pull")):
        motor = spec.add_actuator(name=name, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.gear = [1, 2, 3, 0.1, 0.2, 0.3]
    spec.add_actuator(name="reel", target="rope", trntype=mujoco.mjtTrn.mjTRN_TENDON)
    spec.add_pair(geomname1="table0_collision", geomname2="cube_g0", margin=0.01, condim=3)
    spec.add_pair(geomname1="ball_g0", geomname2="cube_g0", margin=0.002, condim=3)
    return arena


def writable(scene):
    """Names of all fields that can be written; `test_ratios.py` holds the damping that a `dampratio` means."""
    owned, derived = {rows.field for rows in scene.owned}, {rule.field for rule in follows.RULES}
    assert not scene.given.ratios
    return owned | {"geom_rbound", "geom_aabb"} | scene.absent.keys() | derived - {"actuator_biasprm"}


class Nearest(NamedTuple):
    """Of a field the element whose change is noticed the least: its change, the error that is allowed, and how many elements there are."""

    elements: int
    change: float
    allowed: float


def nearest(compiled, name, got, want):
    changed, name = np.atleast_1d(mutants(compiled, name, got)), name.removeprefix("_impl.")
    change, most = np.abs(changed.astype(float) - got), np.broadcast_to(allowed(compiled, name, want), changed.shape)
    least = np.unravel_index(np.argmin(np.where(most > 0, change / np.where(most > 0, most, 1), np.inf)), change.shape)
    return Nearest(change.size, float(change[least]), float(most[least]))


def noticed(impl):
    """{field: `Nearest`} of the last of some worlds, in all of which each number is right and each change of one is noticed."""
    arena = everything()
    model = arena.put_model(impl)
    for key in mja.world_keys(8, range(4)):
        params = arena.sample_params(key, worlds.RANGES)
        compiled, fields = arena.compile(params), arena.fields(model, params)
        expected = mjx.put_model(compiled, impl=impl)
        assert fields.keys() == writable(arena.record.scene)
        found = {}
        for name, value in fields.items():
            got, want = np.asarray(value), np.asarray(operator.attrgetter(name)(expected))
            assert not off(compiled, name, got, want).any(), name
            assert off(compiled, name, mutants(compiled, name, got), want).all(), name
            found[name.removeprefix("_impl.")] = nearest(compiled, name, got, want)
    return found


def table(found):
    """The rows of docs/mutants.md."""
    for name, one in sorted(found.items()):
        times = one.change / one.allowed if one.allowed else np.inf
        told = f"{times:.{0 if times >= 10 else 1}f}" if one.allowed else "-"
        yield f"| `{name}` | {one.elements} | {one.change:.1e} | {one.allowed:.1e} | {told} |"


@pytest.mark.filterwarnings("ignore:`ranges.object_full_sizes` does not change 'box'")
def test_mutants_are_noticed(impl):
    """Of every element of every field, in an arena in which all fields are written; docs/mutants.md has the same table of both."""
    found = noticed(impl)
    (text,) = pages.tables("docs/mutants.md")
    documented, now = ([line.split("|")[1:-1] for line in rows] for rows in (text.splitlines()[2:], table(found)))
    assert [row[:2] for row in documented] == [row[:2] for row in now]
    times, now = (np.array([float(row[4].replace(" - ", "inf")) for row in rows]) for rows in (documented, now))
    np.testing.assert_allclose(now, times, rtol=0.1)  # of two digits


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:`ranges.object_full_sizes` does not change 'box'")
def test_everything_in_c_batch():
    """Every number of every simulation is the recompiled model's, those that MJX has not, too; statistics are shared."""
    arena = everything()
    params = jax.vmap(lambda key: arena.sample_params(key, worlds.RANGES))(mja.world_keys(8, range(2)))
    batch, differ = arena.c_batch(params), set()
    for i in range(2):
        got, compiled = batch.get_model(i), arena.compile(worlds.take(params, i))
        arrays = {name: getattr(compiled, name) for name in dir(compiled) if not name.startswith("_")}
        for name, want in arrays.items():
            if isinstance(want, np.ndarray) and want.size and want.dtype.kind in "fiu":
                single = want.astype(np.float32) if want.dtype.kind == "f" else want
                assert not off(compiled, name, getattr(got, name), single).any(), name
                differ |= {name} if (getattr(arena.mj_model, name) != want).any() else set()
    assert differ >= {"dof_length", "actuator_length0", "bvh_aabb"}


if __name__ == "__main__":  # prints the rows of docs/mutants.md
    warnings.simplefilter("ignore")  # of a size that does not change "box"
    print(*table(noticed("jax")), sep="\n")
