"""What differs between worlds is written, whatever it follows from: small arenas, each with one kind of element that does."""

import copy
import operator

import mujoco
import numpy as np
import pytest
import worlds
from oracle import STRUCTURE_MAY_DIFFER, from_compiled

import mjx_arenas as mja
from mjx_arenas.build import assemble
from mjx_arenas.params.params import QUANTITIES
from mjx_arenas.record.elsewhere import elsewhere
from mjx_arenas.spec import comparing
from mjx_arenas.write import writer

JOINT, TENDON, SITE = (getattr(mujoco.mjtTrn, f"mjTRN_{kind}") for kind in ("JOINT", "TENDON", "SITE"))
TARGET = mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY
OFF_CENTRE = """<mujoco><worldbody><body name="b"><inertial pos=".05 .02 .03" mass=".3" diaginertia=".001 .002 .0025"/>
  <geom type="box" size=".05 .04 .03"/></body></worldbody></mujoco>"""
LIDDED = """<mujoco><worldbody><body name="b"><geom type="box" size=".05 .04 .03"/><body pos=".05 .02 .04">
  <joint name="lid" axis="0 1 1"/><geom type="capsule" size=".01" fromto="0 0 0 .1 0 .02"/><camera name="c"/><light name="l"/></body>
  </body></worldbody><actuator><motor joint="lid"/></actuator></mujoco>"""
ARM = """<mujoco><worldbody><body name="base"><site name="low" pos=".02 0 .1"/><geom size=".05" contype="0" conaffinity="0"/>
  <body pos="0 0 .1"><joint name="hinge" axis="0 1 0"/><geom type="capsule" size=".02" fromto="0 0 0 .2 0 0"/>
  <body pos=".2 0 0"><joint name="ball" type="ball"/><geom type="capsule" size=".02" fromto="0 0 0 .2 0 .05"/>
  <site name="tip" pos=".2 .01 0"/></body></body></body></worldbody><actuator>ACTUATORS</actuator></mujoco>"""
HINGE = """<mujoco><worldbody><body name="l" pos=".1 0 .2"><joint name="h" axis="0 1 0"/>
  <geom type="capsule" size=".02" fromto="0 0 0 .3 0 0" contype="0" conaffinity="0"/></body></worldbody>
  <tendon><fixed name="f"><joint joint="h" coef="2"/></fixed></tendon><actuator><motor joint="h"/></actuator></mujoco>"""


def two(*objects, robot=None):
    arena = mja.MultiTableArena([[0, 0, 0.8], [0, 1.5, 0.8]], objects=[*objects, mja.Object("k", "sphere", 0.1, on=1)])
    if robot is not None:
        arena.attach(robot, "r_", on=0, pos=(0.1, 0.2, 0))
    return arena


def motor(arena, target, kind, gear=(1, 0, 0, 0, 0, 0)):
    arena.spec.add_actuator(name=f"of_{target}", target=target, trntype=kind).gear = gear
    return arena


def mjcf(text):
    return mja.Object("o", "mjcf", file=mujoco.MjSpec.from_string(text))


def rope(arena, *ends, around=None, **kwargs):
    tendon = arena.spec.add_tendon(name="rope", springlength=[0, 1], **kwargs)
    tendon.wrap_site(ends[0])
    if around is not None:
        tendon.wrap_geom(around, "")
    tendon.wrap_site(ends[1])
    return arena


def at(arena, **places):
    """With sites, each on a body."""
    for body, pos in places.items():
        arena.spec.body(body).add_site(name=f"at_{body}", pos=pos)
    return arena


def around():
    """A tendon that the ball touches in other worlds alone."""
    arena = two()
    for name, x in (("left", -1), ("right", 1)):
        arena.spec.worldbody.add_site(name=name, pos=(x, 1.66, 0.9))
    return motor(rope(arena, "left", "right", around="k_g0"), "rope", TENDON)


def aimed():
    arena = two()
    arena.spec.body("table0").add_camera(name="c", pos=(0, 0, 1), mode=TARGET, targetbody="table1")
    arena.spec.worldbody.add_light(name="l", pos=(0, 0, 4), mode=TARGET, targetbody="k")
    arena.spec.body("table1").add_body(name="shelf", pos=(0.1, 0, 0.3)).add_geom(type=6, size=(0.1, 0.1, 0.01), mass=2)
    return arena


def arm(actuator):
    return two(robot=ARM.replace("ACTUATORS", actuator))


ARENAS = {
    "joint of an object off its centre": lambda: motor(two(mjcf(OFF_CENTRE)), "o_joint0", JOINT),
    "joint of an object with a lid": lambda: motor(two(mjcf(LIDDED)), "o_joint0", JOINT, (0, 0, 1, 0, 0, 0)),
    "turns of an object with a lid": lambda: motor(two(mjcf(LIDDED)), "o_joint0", JOINT, (0, 0, 0, 1, 0, 0)),
    "joint of a ball": lambda: motor(two(), "k_joint0", JOINT, (1, 2, 3, 1, 2, 3)),
    "site of an object": lambda: motor(at(two(), k=(0, 0.01, 0.02)), "at_k", SITE),
    "ball joint": lambda: arm('<motor joint="ball" gear="1 2 3"/>'),
    "ball joint in its parent": lambda: arm('<motor jointinparent="ball" gear="1 2 3"/>'),
    "site of a robot": lambda: arm('<motor site="tip" gear="1 0 0 0 0 0"/>'),
    "site relative to another": lambda: arm('<motor site="tip" refsite="low" gear="1 2 0 0 0 1"/>'),
    "adhesion": lambda: arm('<adhesion body="base" ctrlrange="0 1"/>'),
    "hinge on a table": lambda: two(robot=HINGE),
    "tendon": lambda: rope(at(two(), world=(0, 1.5, 2), k=(0, 0, 0)), "at_world", "at_k"),
    "tendon's actuator": lambda: motor(
        rope(at(two(), world=(0, 1.5, 2), k=(0, 0, 0)), "at_world", "at_k"), "rope", TENDON
    ),
    "tendon's armature": lambda: rope(at(arm(""), table0=(0.3, 0.1, 0.4)), "at_table0", "r_tip", armature=0.1),
    "tendon around an object": around,
    "cameras and lights": aimed,
}


@pytest.mark.parametrize("case", ARENAS)
def test_what_follows_is_written(case):
    """From each quantity alone, near and far."""
    arena = ARENAS[case]()
    record = arena.record
    for quantity in set(QUANTITIES) - {"table_active", "object_active"}:
        names = {*writer.field_names(record.scene, frozenset({quantity}))}
        for far in (1.0, -0.5, 0.13):
            params = elsewhere(record.nominal, record.parts, (quantity,), far)
            spec = record.spec.copy()
            assemble.set_params(spec, record.parts, params)
            differs = comparing.differing(record.mj_model, spec.compile())
            assert differs - names <= comparing.NOT_READ, (quantity, far)


TIED = """<mujoco><worldbody><body name="table"/><body name="p" pos="0 0.1 2"><freejoint/><geom size=".1"/></body></worldbody>
  <equality><weld body1="table" body2="p"/><connect body1="table" body2="p" anchor="0 0 1"/>
  </equality></mujoco>"""


@pytest.mark.slow
def test_ties_follow_what_they_tie(impl):
    """A weld and connects between a table, an object and a body of the scene hold them as they stand in each world."""
    spec = mujoco.MjSpec.from_string(TIED)
    arena = mja.TableArena(xml=spec.to_xml(), objects=[mja.Object("cube")])
    body = mujoco.mjtObj.mjOBJ_BODY
    tie = arena.spec.add_equality(name="tie", type=mujoco.mjtEq.mjEQ_CONNECT, objtype=body, name1="p", name2="cube")
    tie.data[:3] = [0.1, 0.2, 0]
    batch = arena.randomize(arena.put_model(impl), mja.world_keys(0, range(3)), worlds.RANGES)
    assert np.ptp(np.asarray(batch.model.eq_data), axis=0).any(-1).all()
    for i in range(3):
        one = batch.model.tree_replace(
            {name: np.asarray(operator.attrgetter(name)(batch.model))[i] for name in batch.fields}
        )
        assert from_compiled(one, arena.compile(batch.world(i))) <= STRUCTURE_MAY_DIFFER.keys()


def test_numbers_that_are_none_differ():
    """A NaN is no number's equal, and another NaN's."""
    one = worlds.arena(1).mj_model
    other, third = copy.copy(one), copy.copy(one)
    other.dof_M0[0] = third.dof_M0[0] = np.nan
    assert comparing.differing(one, other) == {"dof_M0"} == comparing.differing(other, one)
    assert comparing.differing(other, third) == set()
    other.jnt_limited[0] = not one.jnt_limited[0]
    assert comparing.differing(other, third) == {"jnt_limited"}
