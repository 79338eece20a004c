"""Gains of actuators by the shortcuts of MJCF: each world is the MJCF in which the drawn number was written (`<velocity kv="3.1"/>`)."""

import functools
import re

import jax
import mujoco
import numpy as np
import oracle
import pytest
import worlds
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.params.params import with_values

pytestmark = pytest.mark.slow_on("warp")

SERVO = {"kp": 30.0, "kv": 0.6}
MUSCLE = {"range": [0.8, 1.1], "lmin": 0.4, "lmax": 1.7, "vmax": 1.4, "fpmax": 1.2, "fvmax": 1.3}
SHORTCUTS = {
    "position": SERVO,
    "position_slow": {**SERVO, "timeconst": 0.1},
    "intvelocity": {**SERVO, "actrange": [-2, 2]},
    "velocity": {"kv": 0.7},
    "damper": {"kv": 0.5, "ctrlrange": [0, 1]},
    "damper_off": {"kv": 0.0, "ctrlrange": [0, 1]},
    "cylinder": {"area": 0.3, "timeconst": 0.05, "bias": [0.1, -0.2, -0.3]},
    "muscle": {**MUSCLE, "force": 4.0, "lengthrange": [-1, 1]},
    "muscle_weighed": {**MUSCLE, "scale": 5.0, "lengthrange": [-1, 1]},
    "muscle_plain": {"lengthrange": [-1, 1]},
}
"""Attributes of one actuator of each kind; what follows an underscore only tells two apart."""
ON_WARP = {"adhesion": {"gain": 5.0, "ctrlrange": [0, 1]}}
"""Those that MJX on JAX has not."""
IN_C = {"orientation": SERVO, "pid": {**SERVO, "ki": 2.0}}
"""Those that only C steps."""
WHERE = {"jax": SHORTCUTS, "warp": SHORTCUTS | ON_WARP, "c": SHORTCUTS | ON_WARP | IN_C}
VARIED = ("kp", "kv", "area", "gain", "force", "scale", "range", "lmin", "lmax", "vmax", "fpmax", "fvmax")


def written(numbers):
    """The MJCF with these numbers, by shortcuts."""
    bodies, actuators = "", ""
    for i, (name, own) in enumerate(numbers.items()):
        kind = name.partition("_")[0]
        joint = 'type="ball"' if kind == "orientation" else f'axis="0 1 {0.1 * i:g}"'
        where = f'body="{name}"' if kind == "adhesion" else f'joint="{name}"'
        where += f' gear="{1 + 0.1 * i:g}"' if name in SHORTCUTS else ""
        sticks = f'contype="0" conaffinity="{2 if kind == "adhesion" else 0}"'
        bodies += f'<body name="{name}" pos="{i} 0 .0495"><joint name="{name}" {joint} armature=".02" damping=".05"/>'
        bodies += f'<geom size=".05" pos=".15 0 0" mass="{0.3 + 0.01 * i:g}" {sticks}/></body>'
        given = "".join(f' {key}="{" ".join(map(repr, np.atleast_1d(x).tolist()))}"' for key, x in own.items())
        actuators += f'<{kind} name="{name}" {where} {given}/>'
    floor = '<geom type="plane" size="9 9 1" contype="2" conaffinity="0"/>'
    return f"<mujoco><worldbody>{floor}{bodies}</worldbody><actuator>{actuators}</actuator></mujoco>"


@functools.cache
def arena(impl):
    """Of all shortcuts that an implementation steps; all that can vary does."""
    made = mja.Arena.from_xml(written(WHERE[impl]))
    made.vary(**{name: dr.Term(f"actuator.{name}") for name in VARIED if impl != "jax" or name != "gain"})
    return made


def drawn(impl):
    """Parameters of another world, and the numbers of its shortcuts."""
    nominal = jax.tree.map(np.asarray, arena(impl).nominal_params())
    numbers = {name: dict(own) for name, own in WHERE[impl].items()}
    terms = {}
    for quantity, values in nominal.terms.items():
        share = 1 + 0.05 * np.sqrt(np.arange(2, 2 + len(values)))
        terms[quantity] = (np.where(values == 0, 0.4, values) * share.reshape(-1, *(1,) * (values.ndim - 1))).astype(
            np.float32
        )
        for name, value in zip(arena(impl).elements(quantity), terms[quantity], strict=True):
            numbers[name][quantity] = value.astype(float)
    return with_values(nominal, terms), numbers


def test_all_elements_are_found():
    """Every actuator by each of its numbers, and none by another's."""
    found = {name: arena("c").elements(name) for name in VARIED}
    every, muscles = WHERE["c"], ("muscle", "muscle_weighed", "muscle_plain")
    for name in ("kp", "kv", "area", "gain"):
        assert found[name] == tuple(kind for kind, own in every.items() if name in own)
    assert found["force"] == ("muscle",)
    assert found["scale"] == ("muscle_weighed", "muscle_plain")
    for name in ("range", "lmin", "lmax", "vmax", "fpmax", "fvmax"):
        assert found[name] == muscles


def test_as_written_by_the_shortcut(impl):
    """Leaf by leaf; 0.3 % more of any number is noticed, in the gain and in the bias."""
    params, numbers = drawn(impl)
    compiled = mujoco.MjModel.from_xml_string(written(numbers))
    recompiled = arena(impl).compile(params)
    for field in ("actuator_gainprm", "actuator_biasprm", "actuator_dynprm"):
        np.testing.assert_array_equal(getattr(recompiled, field), getattr(compiled, field))
    model = arena(impl).put_model(impl)
    want, got = (worlds.leaves(m) for m in (mjx.put_model(compiled, impl=impl), arena(impl).apply(model, params)))
    assert oracle.differing(compiled, got, want) - oracle.STRUCTURE_MAY_DIFFER.keys() == set()
    fields = arena(impl).fields(model, params)
    assert {f for f in fields if not f.startswith("stat.")} == {"actuator_gainprm", "actuator_biasprm"}
    for field in ("actuator_gainprm", "actuator_biasprm"):
        there = want[field] != 0
        assert oracle.off(compiled, field, oracle.mutants(compiled, field, got[field]), want[field])[there].all()


def test_those_that_only_c_steps():
    """Worlds of C are those of the shortcuts."""
    params, numbers = drawn("c")
    compiled, recompiled = mujoco.MjModel.from_xml_string(written(numbers)), arena("c").compile(params)
    for field in ("actuator_gainprm", "actuator_biasprm"):
        np.testing.assert_array_equal(getattr(recompiled, field), getattr(compiled, field))


@pytest.mark.slow
def test_steps_as_in_c(impl):
    """Twenty steps under random controls, as in C of the shortcut's MJCF, and not as in the nominal world."""
    params, numbers = drawn(impl)
    compiled = mujoco.MjModel.from_xml_string(written(numbers))
    batch = arena(impl).batch(arena(impl).put_model(impl), jax.tree.map(lambda x: np.asarray(x)[None], params))
    data = mja.make_data(batch)
    ctrl = np.random.default_rng(0).uniform(0.2, 1, compiled.nu).astype(np.float32)
    after = mja.rollout(batch, data.replace(ctrl=data.ctrl + ctrl, qvel=data.qvel + np.float32(0.3)), 20)
    ends = []
    for model in (compiled, arena(impl).mj_model):
        c = mujoco.MjData(model)
        c.ctrl[:], c.qvel[:] = ctrl, np.float32(0.3)
        mujoco.mj_step(model, c, 20)
        ends.append(c.qvel.copy())
    np.testing.assert_allclose(after.qvel[0], ends[0], atol=3e-5)
    assert (np.abs(ends[1] - ends[0]) > 1e-4).all()


def test_a_diameter_is_an_area():
    """As `<cylinder diameter>` is compiled."""
    made = mja.Arena.from_xml(written({"cylinder": {"diameter": 0.5}}))
    made.vary(wide=dr.Term("actuator.diameter"))
    nominal = jax.tree.map(np.asarray, made.nominal_params())
    np.testing.assert_allclose(nominal.terms["wide"], 0.5, rtol=1e-6)
    params = with_values(nominal, {"wide": np.array([0.7], np.float32)})
    want = mujoco.MjModel.from_xml_string(written({"cylinder": {"diameter": float(np.float32(0.7))}}))
    np.testing.assert_allclose(made.compile(params).actuator_gainprm, want.actuator_gainprm, rtol=1e-15)
    got = made.apply(made.put_model("jax"), params).actuator_gainprm
    np.testing.assert_allclose(got, want.actuator_gainprm, rtol=4 * oracle.EPS)


OTHERS = """<mujoco><worldbody><body name="b"><joint name="j" armature=".1"/><geom size=".1"/></body></worldbody><actuator>
<motor name="motor" joint="j"/><general name="general" joint="j" gainprm="3" biastype="affine" biasprm="1 -2 -.5"/>
<velocity name="velocity" joint="j" kv="2"/><velocity name="nothing" joint="j" kv="0"/>
<damper name="damper" joint="j" kv="0" ctrlrange="0 1"/>
<position name="position" joint="j" kp="3"/><cylinder name="cylinder" joint="j" area="2"/>
<muscle name="weighed" joint="j" lengthrange="0 1"/><muscle name="forced" joint="j" lengthrange="0 1" force="3"/>
<general name="half" joint="j" lengthrange="0 1" gaintype="muscle" gainprm=".75 1.05 -1 200 .5 1.6 1.5 1.3 1.2"/>
</actuator></mujoco>"""
GENERAL = "vary `actuator.gainprm` and `actuator.biasprm`"
NOTHING = "its gain is 0, so its kind cannot be recognized: give it a small gain in the MJCF"
REFUSED = {
    ("kp", "motor"): "it is a motor, which has no `kp`: vary `actuator.gainprm`",
    ("kv", "motor"): "it is a motor, which has no `kv`: vary `actuator.gainprm`",
    ("kp", "general"): f"its gain and bias are those of no shortcut of MJCF with a `kp`: {GENERAL}",
    ("kp", "velocity"): "it is a velocity servo, which has no `kp`: vary `actuator.kv`",
    ("kp", "cylinder"): "it is a cylinder, which has no `kp`: vary `actuator.area`",
    ("kv", "nothing"): NOTHING,
    ("kp", "nothing"): NOTHING,
    ("area", "position"): "it is a position servo, which has no `area`: vary `actuator.kp` and `actuator.kv`",
    ("gain", "motor"): "it is a motor, which has no `gain`: vary `actuator.gainprm`",
    ("force", "weighed"): "it is `scale` / `acc0`, as the MJCF gives none: vary `actuator.scale`, or give it a `force`",
    ("scale", "forced"): "its `force` is given, and no step reads it: vary `actuator.force`",
    ("vmax", "half"): f"its gain and bias are those of no shortcut of MJCF with a `vmax`: {GENERAL}",
    ("gainprm", "position"): "it is a position servo: vary `actuator.kp` and `actuator.kv`",
    ("biasprm", "velocity"): "it is a velocity servo: vary `actuator.kv`",
    ("gainprm", "weighed"): "it is a muscle: vary `actuator.force` or `actuator.scale`",
}


@pytest.mark.parametrize(("attribute", "name"), REFUSED)
def test_refused(attribute, name):
    """With what to do instead, which is taken, where it is another attribute."""
    why = REFUSED[attribute, name]
    made = mja.Arena.from_xml(OTHERS)
    says = f"`x.elements`: 'actuator.{attribute}' of actuator '{name}' cannot vary, as {why}."
    with pytest.raises(ValueError, match=f"^{re.escape(says)}$"):
        made.vary(x=dr.Term(f"actuator.{attribute}", name))
    instead = [a for a in re.findall(r"`(actuator\.\w+)`", why) if (a.partition(".")[2], name) not in REFUSED]
    for i, other in enumerate(instead):
        made.vary(**{f"x{i}": dr.Term(other, name)})
    assert instead or "a small gain" in why


def test_a_preset_knows_servos_and_motors():
    """Velocity servos by their `kv`, motors by their strength; what is neither is left alone."""
    robot = OTHERS.replace('kv="0"', 'kv="1"').replace('kp="3"', 'kp="3" kv="1"')
    made = mja.Arena.from_xml(robot)
    preset = dr.robot(made.spec)
    made.vary(**preset.terms)
    assert made.elements("kp") == ("position",)
    assert made.elements("kv") == ("velocity", "nothing", "damper", "position")
    assert made.elements("motor") == ("motor",)
    for key in mja.world_keys(0, range(3)):
        params = jax.tree.map(np.asarray, made.sample_params(key, mja.ArenaRanges(terms=preset.ranges)))
        compiled = made.compile(params)
        assert 0.9 <= compiled.actuator("motor").gainprm[0] <= 1.1
        kv = compiled.actuator("velocity").gainprm[0]
        assert 1.6 <= kv <= 2.4
        assert (compiled.actuator("velocity").biasprm == [0, 0, -kv, *[0] * 7]).all()
        assert (compiled.actuator("general").gainprm == made.mj_model.actuator("general").gainprm).all()


def test_a_preset_says_that_it_knows_no_gain():
    """In one clause, of an actuator that is none of the three."""
    made = mja.Arena.from_xml(re.sub("<(motor|velocity|damper|position|cylinder) .*?/>", "", OTHERS))
    said = "`spec`: the preset leaves out kp, kv and motor, as no actuator is a servo, a damper or a motor (actuator 'general')."
    with pytest.warns(UserWarning, match=f"^{re.escape(said)}$"):
        assert not {"kp", "kv", "motor"} & dr.robot(made.spec).terms.keys()
