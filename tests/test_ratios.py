"""Dampings that the compiler makes of a servo's `dampratio`: they follow from gains, gears, masses, armatures and tendons."""

import functools
import re

import jax
import mujoco
import numpy as np
import oracle
import pytest
import whole
import worlds

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.record.proof import written
from mjx_arenas.write import follows

ROBOT = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1" pos="0 0 -2"/>
<body name="trunk" pos="0 0 1"><freejoint/><geom name="trunk" type="box" size=".2 .1 .05"/><site name="s" pos=".1 0 .1"/>
<body name="leg" pos=".1 0 0"><joint name="hip" axis="0 1 0" armature=".01" damping=".1"/><geom name="leg" size=".05" pos=".2 0 0"/>
<body name="foot" pos=".3 0 0"><joint name="knee" axis="0 1 0" damping=".1"/><geom name="foot" size=".04" pos=".2 0 0"/>
<site name="f" pos=".1 0 .05"/></body></body></body>
<body name="lift" pos="2 0 1"><joint name="slide" type="slide" axis="0 0 1"/><geom name="lift" size=".1"/></body></worldbody>
<tendon><fixed name="fixed" armature=".05"><joint joint="hip" coef="2"/><joint joint="knee" coef="-.7"/></fixed>
<spatial name="string" springlength="0 1"><site site="s"/><site site="f"/></spatial></tendon>
<actuator><position name="hip" joint="hip" kp="30" dampratio=".8" gear="3"/><position name="knee" joint="knee" kp="20" kv=".3"/>
<position name="fixed" tendon="fixed" kp="20" dampratio="1.1" gear="-2"/><position name="string" tendon="string" kp="25" dampratio=".6"/>
<position name="lift" joint="slide" kp="50" dampratio="1" gear=".5"/></actuator></mujoco>"""


@functools.cache
def arena():
    made = mja.Arena.from_xml(ROBOT)
    made.vary(
        mass=dr.Term("body.mass"),
        kp=dr.Term("actuator.kp"),
        kv=dr.Term("actuator.kv", "knee"),
        ratio=dr.Term("actuator.dampratio", ["hip", "fixed", "lift"]),
        gear=dr.Term("actuator.gear", axes="first"),
        armature=dr.Term("joint.armature"),
        reflected=dr.Term("tendon.armature", "fixed"),
        end=dr.Term("site.pos", "f"),
    )
    return made


@pytest.mark.slow
def test_as_compiled(impl):
    """All at once, leaf by leaf; 0.3 % more of any damping is noticed."""
    whole.hold(arena(), impl)


@pytest.mark.parametrize("name", ["mass", "kp", "gear", "armature", "reflected", "end", "ratio"])
def test_each_is_followed(name):
    """What differs alone changes dampings, and is written: as in worlds that MuJoCo compiles."""
    key = mja.world_keys(0, [3])[0]
    draw = mja.Uniform(0.02, 0.05, relative="add") if name == "end" else mja.Uniform(0.5, 1.5, relative="scale")
    params = jax.tree.map(np.asarray, arena().sample_params(key, mja.ArenaRanges(terms={name: draw})))
    want = arena().compile(params).actuator_biasprm[:, 2]
    assert (np.abs(want / arena().mj_model.actuator_biasprm[:, 2] - 1) > 1e-3).any()
    np.testing.assert_allclose(written(arena().record.scene, params).actuator_biasprm[:, 2], want, rtol=1e-7)
    if name == "ratio":  # which decides them itself
        return
    touched = arena().record.scene.touched(frozenset({name}))
    (rule,) = (rule for rule in follows.RULES if rule.field == "actuator_biasprm")
    assert rule.differs(arena().record.scene, touched)


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_steps_as_in_c(impl):
    """Servos swing to their targets as in C."""
    ranges = mja.ArenaRanges(
        terms={n: mja.Uniform(0.5, 2.0, relative="scale") for n in ("mass", "kp", "armature", "reflected", "ratio")}
    )
    keys = mja.world_keys(0, range(3))
    batch = arena().randomize(arena().put_model(impl), keys, ranges)
    assert "actuator_biasprm" in batch.fields
    data = mja.make_data(batch)
    after = mja.rollout(batch, data.replace(ctrl=data.ctrl + 0.3), 30)
    for i in range(3):
        model, c = arena().c_world(batch.world(i))
        c.ctrl[:] = 0.3
        mujoco.mj_step(model, c, 30)
        np.testing.assert_allclose(after.qpos[i], c.qpos, atol=3e-5)


@pytest.mark.slow
def test_c_batch():
    """C's own batch has the dampings."""
    ranges = mja.ArenaRanges(terms={"mass": mja.Uniform(0.5, 2.0, relative="scale")})
    params = jax.vmap(lambda key: arena().sample_params(key, ranges))(mja.world_keys(0, range(2)))
    batch = arena().c_batch(params)
    for i in range(2):
        want = arena().compile(worlds.take(params, i)).actuator_biasprm
        np.testing.assert_allclose(batch.get_model(i).actuator_biasprm, want, rtol=2e-5)


def test_without_gain():
    """A servo that has a ratio and no gain has no damping, in no world."""
    made = mja.Arena.from_xml(ROBOT.replace('kp="50" dampratio="1"', 'kp="0" dampratio="1"'))
    made.vary(mass=dr.Term("body.mass"))
    nominal = jax.tree.map(np.asarray, made.nominal_params())
    params = nominal._replace(terms={"mass": nominal.terms["mass"] * 1.4})
    want = made.compile(params).actuator_biasprm[:, 2]
    assert want[4] == 0
    np.testing.assert_allclose(written(made.record.scene, params).actuator_biasprm[:, 2], want, rtol=1e-7)


@pytest.mark.parametrize("gear", [0.0, 1e-9, 1.0])
def test_without_gear(gear):
    """A servo that has a ratio and a gear of nearly 0 has no damping in that world; it was infinite."""
    made = mja.Arena.from_xml(ROBOT)
    made.vary(gear=dr.Term("actuator.gear", ["hip", "fixed", "lift"], axes="first"))
    nominal = jax.tree.map(np.asarray, made.nominal_params())
    params = nominal._replace(terms={"gear": np.full_like(nominal.terms["gear"], gear)})
    want = made.compile(params).actuator_biasprm[:, 2]
    assert (want[[0, 2, 4]] == 0).all() == (gear < 1)
    np.testing.assert_allclose(written(made.record.scene, params).actuator_biasprm[:, 2], want, rtol=1e-7)


def as_in_mjcf(params, quantities):
    """The model of the MJCF in which the drawn numbers were written, by shortcuts."""
    xml, names = ROBOT, {"ratio": "dampratio", "kp": "kp"}
    for quantity in quantities:
        for servo, value in zip(arena().elements(quantity), params.terms[quantity], strict=True):
            before, found, after = xml.partition(f'<position name="{servo}"')
            after, n = re.subn(rf'(\b{names[quantity]}=)"[^"]*"', rf'\1"{float(value)!r}"', after, count=1)
            assert n == 1
            xml = before + found + after
    return mujoco.MjModel.from_xml_string(xml)


@pytest.mark.slow
@pytest.mark.parametrize("quantities", [("ratio",), ("ratio", "kp")])
def test_a_ratio_that_varies(quantities):
    """Dampings are those of `<position dampratio>` with the drawn numbers; 0.3 % more of a ratio is noticed."""
    nominal = jax.tree.map(np.asarray, arena().nominal_params())
    np.testing.assert_allclose(nominal.terms["ratio"], [0.8, 1.1, 1.0])
    factors = 1 + 0.1 * np.sqrt(np.arange(2, 7))
    terms = {q: (nominal.terms[q] * factors[: len(nominal.terms[q])]).astype(np.float32) for q in quantities}
    params = nominal._replace(terms={**nominal.terms, **terms})
    want = as_in_mjcf(params, quantities).actuator_biasprm
    np.testing.assert_allclose(arena().compile(params).actuator_biasprm, want, rtol=1e-7)
    np.testing.assert_allclose(written(arena().record.scene, params).actuator_biasprm, want, rtol=1e-7)
    got = np.asarray(arena().apply(arena().put_model("jax"), params).actuator_biasprm)
    off = np.abs(got - want) > oracle.FACTORED * oracle.EPS * np.abs(want)
    assert not off.any()
    terms["ratio"] = terms["ratio"] * np.float32(1.003)
    other = as_in_mjcf(params._replace(terms={**params.terms, **terms}), quantities).actuator_biasprm
    assert (np.abs(got - other) > oracle.FACTORED * oracle.EPS * np.abs(other)).sum() == len(terms["ratio"])


RATED = {
    "knee": "it has none in the MJCF: vary `actuator.kv`",
    "motor": "it is no position servo: vary `actuator.kv` or `actuator.gainprm`",
    "ball": "it is on no hinge, slide or tendon: give it a `kv`, and vary `actuator.kv`",
}


@pytest.mark.parametrize("name", RATED)
def test_no_ratio(name):
    made = '<motor name="motor" joint="hip"/><position name="ball" site="f" gear="0 0 1 0 0 0" kp="3" dampratio="1"/></actuator>'
    says = f"`x.elements`: 'actuator.dampratio' of actuator '{name}' cannot vary, as {RATED[name]}."
    with pytest.raises(ValueError, match=f"^{re.escape(says)}$"):
        mja.Arena.from_xml(ROBOT.replace("</actuator>", made)).vary(x=dr.Term("actuator.dampratio", name))


ELSEWHERE = {
    "site": 'site="f" gear="0 0 1 0 0 0"',
    "site of another": 'site="f" refsite="s" gear="0 0 1 0 .2 0"',
    "free": 'joint="free" gear="0 0 1 0 0 0"',
    "free, along x": 'joint="free"',
    "ball": 'joint="ball" gear="0 1 0"',
    "ball, about x": 'jointinparent="ball"',
    "crank": 'cranksite="f" slidersite="s" cranklength="2"',
}


@pytest.mark.parametrize("transmission", ELSEWHERE.values(), ids=ELSEWHERE)
@pytest.mark.parametrize("attribute", ["body.mass", "actuator.kp", "geom.friction"])
def test_other_transmissions(attribute, transmission):
    """A damping that does not follow is refused, with what to do, where it would be another one; and is the compiler's elsewhere."""
    xml = ROBOT.replace("<freejoint/>", '<freejoint name="free"/>', 1).replace(
        'joint="hip" kp="30"', f'{transmission} kp="30"'
    )
    xml = xml.replace('name="knee" axis="0 1 0"', 'name="ball" type="ball"').replace(
        '<joint joint="knee" coef="-.7"/>', ""
    )
    xml = xml.replace('<position name="knee" joint="knee" kp="20" kv=".3"/>', "").replace(' gear="3"/>', "/>")
    made = mja.Arena.from_xml(xml)
    made.vary(x=dr.Term(attribute))
    if attribute != "geom.friction":
        said = "actuator_biasprm of actuator 'hip' would be stale in other worlds: .*dampratio`: give it a `kv`"
        with pytest.raises(ValueError, match=said):
            made.record  # noqa: B018
        return
    nominal = jax.tree.map(np.asarray, made.nominal_params())
    params = nominal._replace(terms={"x": nominal.terms["x"] * 1.4})
    want = made.compile(params).actuator_biasprm[:, 2]
    assert want[0] < 0
    np.testing.assert_allclose(written(made.record.scene, params).actuator_biasprm[:, 2], want, rtol=1e-7)
