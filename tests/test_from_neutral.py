"""Attributes that are neutral in the MJCF and not in the worlds: MJX must not choose its steps by the template's numbers."""

import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.params.params import with_values

STEPS = 15
RIGHT = 2e-3  # how exactly an effect is C's, relative to itself
QVEL = [1.0, -0.5, 0.8, 0.4, 0.3, 0, 0, 0.5]
NEUTRAL = """<mujoco><option {option}/><worldbody><geom name="floor" type="plane" size="9 9 .1"/>
<body name="a" pos="0 0 2"><joint name="a" axis="0 1 0" limited="true" range="-60 10"/>
<geom name="a" type="box" size=".1 .05 .02" pos=".1 0 0"/><body name="b" pos=".3 0 0"><joint name="b" axis="0 1 0"/>
<geom name="b" size=".05" pos=".1 0 0"/></body></body>
<body name="x" pos="0 2 2"><joint name="x" type="slide" axis="1 0 0"/><geom name="x" size=".1"/></body>
<body name="e" pos="0 3 2"><joint name="e" type="slide" axis="1 0 0"/><geom name="e" size=".1"/></body>
<body name="f" pos="0 4 2"><joint name="f" type="slide" axis="1 0 0"/><geom name="f" size=".1"/></body>
<body name="near" pos="2 0 .11"><joint name="near" type="slide" axis="0 0 1"/><geom name="near" size=".1"/></body>
<body name="paired" pos="6 0 .11"><joint name="paired" type="slide" axis="0 0 1"/><geom name="paired" size=".1"/></body>
<body name="slow" pos="8 0 1"><joint name="slow" type="slide" axis="1 0 0"/><geom name="slow" size=".1"/></body></worldbody>
<contact><pair name="p" geom1="paired" geom2="floor"/></contact>
<tendon><fixed name="t"><joint joint="a" coef="1"/><joint joint="x" coef="-1"/></fixed></tendon>
<equality><joint name="eq" joint1="e" joint2="f" polycoef="0 1 0 0 0"/></equality>
<actuator><general name="m" joint="slow" biastype="affine" gaintype="affine"/></actuator></mujoco>"""


def number(value, *axes):
    """A change of all numbers, or of those of some axes."""

    def change(nominal):
        new = np.array(nominal, float)
        new[..., list(axes) if axes else slice(None)] = value
        return new

    return change


CASES = {
    "damping": ("joint.damping", "a", number(0.05)),
    "stiffness": ("joint.stiffness", "a", number(2.0)),
    "armature": ("joint.armature", "b", number(0.02)),
    "frictionloss": ("joint.frictionloss", "x", number(2.0)),
    "stiffnesspoly": ("joint.stiffnesspoly", "a", number(60.0)),
    "dampingpoly": ("joint.dampingpoly", "a", number(0.05)),
    "limit": ("joint.margin", "a", number(0.17)),
    "tendon damping": ("tendon.damping", "t", number(1.5)),
    "tendon stiffness": ("tendon.stiffness", "t", number(300.0)),
    "tendon stiffnesspoly": ("tendon.stiffnesspoly", "t", number(1e5)),
    "tendon dampingpoly": ("tendon.dampingpoly", "t", number(4.0)),
    "tendon frictionloss": ("tendon.frictionloss", "t", number(0.3)),
    "gravcomp": ("body.gravcomp", "b", number(1.0)),
    "margin": ("geom.margin", "near", number(0.02)),
    "pair margin": ("pair.margin", "p", number(0.02)),
    "equality": ("equality.data", "eq", number(0.02, 0)),
    "gain": ("actuator.gainprm", "m", number(20.0, 0)),
    "gain by speed": ("actuator.gainprm", "m", number(-40.0, 2)),
    "bias": ("actuator.biasprm", "m", number(-30.0, 2)),
    "centre": ("body.ipos", "b", number(0.05, 1, 2)),
}


@functools.cache
def arena(option, impl):
    """The arena, and the cases that it can have."""
    made, terms = mja.Arena.from_xml(NEUTRAL.format(option=option)), {}
    spec, model = made.spec, made.spec.copy().compile()
    for attribute, element, _ in CASES.values():
        unseen = dr.ATTRIBUTES[attribute].unseen_on_jax
        index = getattr(model, attribute.partition(".")[0])(element).id
        if dr.Term(attribute, element).select(spec, model)[1] or (impl == "jax" and unseen and unseen(model, index)):
            continue
        quantity = attribute.replace(".", "_")
        terms.setdefault(quantity, dr.Term(attribute, element))
    made.vary(**terms)
    return made, [name for name, (attribute, *_) in CASES.items() if attribute.replace(".", "_") in terms]


OPTIONS = ('jacobian="sparse"', 'cone="elliptic" integrator="implicitfast"')
ROWS = [("warp", option) for option in ("", *OPTIONS)]
ROWS += [pytest.param("jax", option, marks=pytest.mark.xslow) for option in ("", *OPTIONS)]


@pytest.mark.slow
@pytest.mark.parametrize(("impl", "option"), ROWS, indirect=["impl"])
def test_effects_are_those_of_c(impl, option):
    """What each attribute alone does to 15 steps."""
    made, names = arena(option, impl)
    assert len(names) == (len(CASES) - (7 if impl == "jax" else 0))
    nominal = jax.tree.map(np.asarray, made.nominal_params())
    params = [nominal]
    for name in names:
        attribute, _, change = CASES[name]
        quantity = attribute.replace(".", "_")
        params.append(with_values(nominal, {quantity: change(nominal.terms[quantity])}))
    batch = made.batch(made.put_model(impl), jax.tree.map(lambda *x: np.stack(x), *params))
    data = mja.make_data(batch)
    data = data.replace(qvel=data.qvel + jnp.asarray(QVEL, jnp.float32), ctrl=data.ctrl + 0.5)
    got, want = np.asarray(mja.rollout(batch, data, STEPS).qvel, float), []
    for one in params:
        model = made.compile(one)
        c = mujoco.MjData(model)
        c.qvel[:], c.ctrl[:] = QVEL, 0.5
        mujoco.mj_step(model, c, STEPS)
        want.append(c.qvel.copy())
    want = np.array(want)
    effect, off = np.abs(want[1:] - want[0]).max(1), np.abs((got[1:] - got[0]) - (want[1:] - want[0])).max(1)
    assert (effect > 5e-3).all(), dict(zip(names, effect, strict=True))
    wrong = {n: (o, e) for n, o, e in zip(names, off, effect, strict=True) if o > max(RIGHT * e, 1e-5)}
    assert not wrong, wrong
