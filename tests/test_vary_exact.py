"""Terms of models where one number leads to another, each world leaf by leaf the compiled one; and what cannot be."""

import re

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import oracle
import pytest
import worlds
from mujoco import mjx
from whole import differing

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.params.params import with_values


def arena_of(xml, terms):
    arena = mja.Arena.from_xml(xml)
    arena.vary(**{name: term for name, (term, _) in terms.items()})
    return arena


def exact(xml, terms, impl):
    """Holds one world, in which each term's numbers are changed by a function, against the compiled one."""
    arena = arena_of(xml, terms)
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    params = with_values(nominal, {name: change(nominal.terms[name]) for name, (_, change) in terms.items()})
    assert not arena.problems(params)
    compiled = arena.compile(params)
    want = worlds.leaves(mjx.put_model(compiled, impl=impl))
    got = worlds.leaves(arena.apply(arena.put_model(impl), params))
    assert differing(compiled, got, want) == set()
    return arena, params, compiled


TIED = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="ja" axis="0 1 0"/><geom name="a" size=".1" pos=".1 0 0"/></body>
<body name="b" pos=".5 0 1"><freejoint/><geom name="b" size=".1"/></body>
<body name="p" pos="0 1 1"><joint name="jp"/><geom size=".1" pos=".1 0 0"/></body></worldbody>
<equality><connect name="c" body1="a" body2="b" anchor=".2 .1 0"/><weld name="w" body1="b" body2="p"/>
<joint name="t" joint1="ja" joint2="jp"/></equality></mujoco>"""
ROUND = """<mujoco><worldbody><site name="s0" pos="-1 .3 1"/>
<body name="post" pos="0 0 1"><geom name="post" type="cylinder" size=".2 .5" contype="0" conaffinity="0"/></body>
<body name="m" pos="1 .3 1"><joint name="j" type="slide" axis="1 0 0" range="-1 1"/>
<geom size=".1" contype="0" conaffinity="0"/><site name="s1"/></body></worldbody>
<tendon><spatial name="t" range="0 1" limited="true" springlength="0 1" frictionloss=".1"><site site="s0"/><geom geom="post"/>
<site site="s1"/></spatial></tendon><actuator><motor name="m" tendon="t"/></actuator></mujoco>"""
THRUST = """<mujoco><worldbody><site name="w" pos="0 0 2"/><body name="b" pos="0 0 1"><joint name="j" axis="0 1 0"/><joint axis="1 0 0"/>
<geom name="g" type="box" size=".1 .2 .3" pos=".2 0 0"/><site name="s" pos=".3 .1 0"/></body></worldbody>
<actuator><general name="m" site="s" {} gear="1 2 3 0 0 .5"/></actuator></mujoco>"""
CRANK = """<mujoco><worldbody><body name="b" pos="0 0 1"><joint name="j" axis="0 1 0"/>
<geom name="g" type="box" size=".1 .2 .3" pos=".2 0 0"/><site name="s" pos=".3 .1 0"/></body><site name="sl" pos=".1 0 .5"/></worldbody>
<actuator><general name="m" cranksite="s" slidersite="sl" cranklength=".8" gear="2"/></actuator></mujoco>"""
HEAVY = """<mujoco><worldbody><site name="w" pos="0 0 2"/><body name="b" pos="0 0 1"><joint name="j" axis="0 1 0"/>
<geom name="g" type="box" size=".1 .2 .3" pos=".2 0 0"/><site name="s" pos=".3 .1 0"/></body></worldbody>
<tendon>{}</tendon></mujoco>"""
SPATIAL = '<spatial name="t" armature=".1" springlength="0 1"><site site="w"/><site site="s"/></spatial>'
BODY = """<mujoco><worldbody><body name="b" pos="0 0 1">{}<geom name="g" type="box" size=".1 .2 .3" pos=".2 .1 0"/>{}</body></worldbody>
{}</mujoco>"""
HINGE = '<joint name="j" axis="0 1 0"/>'
FRAME = '<frame pos=".1 .2 .3" euler="30 40 50">{}</frame>'


def by(*numbers):
    return lambda nominal: nominal + np.array(numbers, float)


CASES = {
    "an anchor": (TIED, {"x": (dr.Term("equality.data", "c"), by(0.1, 0.2, -0.1, *[0] * 8))}),
    "a tie beside a body": (
        TIED,
        {"x": (dr.Term("equality.data", "t"), by(0.1, 0.2, *[0] * 9)), "y": (dr.Term("body.pos", "b"), by(0.3, 0.1, 0.2))},
    ),
    "all ties": (TIED, {"x": (dr.Term("equality.data"), lambda n: n * 1.3), "y": (dr.Term("body.rpy", "p"), by(0.3, 0.1, 0.2))}),
    "a post that tilts": (ROUND, {"x": (dr.Term("geom.rpy", "post"), by(1.2, 0.0, 0.0))}),
    "a post that grows": (ROUND, {"x": (dr.Term("geom.size", "post"), lambda n: n * np.array([2.2, 1, 1]))}),
    "a post that moves": (ROUND, {"x": (dr.Term("geom.pos", "post"), by(0.0, 0.15, 0.0))}),
    "a thruster that turns": (THRUST.format(""), {"x": (dr.Term("site.rpy", "s"), by(0.5, 0.3, 0.2))}),
    "a reference that turns": (THRUST.format('refsite="w"'), {"x": (dr.Term("site.rpy", "w"), by(0.5, 0.3, 0.2))}),
    "an armature": (HEAVY.format(SPATIAL), {"x": (dr.Term("tendon.armature"), lambda n: n * 2)}),
    "ends of an armature": (HEAVY.format(SPATIAL), {"x": (dr.Term("site.pos"), lambda n: n + 0.1)}),
    "a fixed armature": (
        HEAVY.format('<fixed name="t" armature=".1"><joint joint="j" coef="2"/></fixed>'),
        {"x": (dr.Term("tendon.armature"), lambda n: n * 2)},
    ),
    "one axis of an axis": (
        BODY.format('<joint name="j" axis="0 2 2"/>', "", ""),
        {"x": (dr.Term("joint.axis", axes="x"), by(0.5, 0.0, 0.0))},
    ),
    "an anchor in a frame": (
        BODY.format(FRAME.format('<joint name="j" axis="0 1 0" pos=".1 0 0"/>'), "", ""),
        {"x": (dr.Term("joint.pos"), by(0.1, 0.2, 0.3))},
    ),
    "an axis in a frame": (
        BODY.format(FRAME.format('<joint name="j" axis="0 1 0" pos=".1 0 0"/>'), "", ""),
        {"x": (dr.Term("joint.axis"), by(0.1, 0.2, 0.3))},
    ),
    "a lamp in a frame": (
        BODY.format(HINGE, FRAME.format('<light name="l" dir="0 0 -3"/>'), ""),
        {"x": (dr.Term("light.dir", axes="x"), by(0.5, 0, 0)), "y": (dr.Term("light.pos"), by(0.1, 0.2, 0.3))},
    ),
    "the first axis of two": (
        BODY.format('<joint name="j" axis="0 1 0"/><joint name="k" axis="1 0 0"/>', "", ""),
        {"x": (dr.Term("joint.axis", "j"), by(0.5, 0.2, 0.1))},
    ),
    "the first anchor of two": (
        BODY.format('<joint name="j" axis="0 1 0"/><joint name="k" axis="1 0 0"/>', "", ""),
        {"x": (dr.Term("joint.pos", "j"), by(0.1, 0.2, 0.3))},
    ),
    "a body without mass": (
        BODY.format(HINGE, '<body name="v"><geom name="v" size=".1" mass="0"/></body>', ""),
        {"x": (dr.Term("geom.size"), lambda n: n * 1.2)},
    ),
    "a range of a ball": (
        BODY.format('<joint name="j" type="ball" range="0 60"/>', "", ""),
        {"x": (dr.Term("joint.range"), by(0.0, 0.1))},
    ),
    "the joint of a body on one that stands still": (
        BODY.format("", '<body name="c" pos="0 0 .5"><joint name="j" axis="0 1 0"/><geom size=".02"/></body>', ""),
        {"x": (dr.Term("joint.pos"), by(0.1, 0.2, 0.3))},
    ),
    "a scene without joints": (
        BODY.format("", '<body name="c" pos="0 0 .5"><geom size=".02"/></body>', ""),
        {"x": (dr.Term("body.pos"), by(0.1, 0.2, 0.3))},
    ),
    "a slack spring": (
        BODY.format(HINGE, "", '<tendon><fixed stiffness="0"><joint joint="j" coef="2"/></fixed></tendon>'),
        {"x": (dr.Term("joint.ref"), by(0.2))},
    ),
    "a turn about a centre of mass, but for rounding": (
        BODY.format('<inertial pos=".2 .1 1e-7" quat="1 .1 0 0" mass="1" diaginertia="1 2 2.5"/>', "", "").replace(
            'size=".1 .2 .3"', 'size=".1 .2 .3" quat="1 .1 0 0"'
        ),
        {"x": (dr.Term("geom.rpy", "g"), by(0.3, 0.2, 0.1))},
    ),
}  # fmt: skip


@pytest.mark.slow_on("warp")
@pytest.mark.parametrize("case", CASES)
def test_exact(case, impl):
    """What follows from a number follows, in frames, too, and where a row has numbers of its own beside derived ones."""
    exact(*CASES[case], impl)


@pytest.mark.parametrize("order", [("end", "spring"), ("spring", "end")])
def test_a_tendon_that_gets_a_spring(order):
    """Its length where the ends stand is not taken for that of its spring, in whatever order the terms come; one in the MJCF is."""
    terms = {"end": dr.Term("site.pos", "s0"), "spring": dr.Term("tendon.stiffness", "t")}
    for given in ("", 'springlength=".5"'):
        arena = mja.Arena.from_xml(STRUNG.format(given))
        for name in order:
            arena.vary(**{name: terms[name]})
        if given:
            assert (arena.mj_model.tendon_lengthspring == 0.5).all()
        else:
            with pytest.raises(
                ValueError, match=r"tendon_lengthspring of tendon 't' would be stale .*: it follows from `end`"
            ):
                _ = arena.mj_model


@pytest.mark.slow
@pytest.mark.parametrize("name", ["site.pos", "site.rpy"])
def test_cranks(name):
    """Of sliders and cranks, which MJX has on Warp."""
    exact(CRANK, {"x": (dr.Term(name), lambda n: n + 0.07)}, "warp")


SPARSE = '<mujoco><option jacobian="sparse"/>' + BODY.removeprefix("<mujoco>").format(
    '<joint name="j" axis="0 1 0"/><joint name="k" axis="1 0 0"/><joint name="l" axis="0 0 1"/>',
    "",
    '<tendon><fixed name="t"><joint joint="j" coef="2"/><joint joint="k" coef="1"/></fixed></tendon>',
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("xml", "terms"),
    [
        (SPARSE, {"x": (dr.Term("joint.frictionloss"), by(0.5))}),
        (SPARSE, {"x": (dr.Term("tendon.frictionloss"), by(0.5))}),
        (BODY.format('<joint name="j" axis="0 1 0" frictionloss="0"/>', "", ""), {"x": (dr.Term("joint.frictionloss"), by(0.5))}),
        (BODY.format(HINGE, "", ""), {"x": (dr.Term("body.gravcomp"), by(0.8))}),
        (
            BODY.format(HINGE, "", '<tendon><fixed name="t"><joint joint="j" coef="2"/></fixed></tendon>'),
            {"x": (dr.Term("tendon.frictionloss"), by(0.5))},
        ),
    ],
)  # fmt: skip
def test_from_nothing_on_warp(xml, terms):
    """Numbers that are 0 in the MJCF have their effect on Warp; MJX on JAX would leave them out, and is refused."""
    arena, params, compiled = exact(xml, terms, "warp")
    batch = arena.batch(arena.put_model("warp"), jax.tree.map(lambda x: np.stack([x, x]), params))
    data = mja.make_data(batch)
    data = data.replace(qvel=data.qvel + 1.0)
    c = mujoco.MjData(compiled)
    c.qvel += 1.0
    mujoco.mj_step(compiled, c, 20)
    np.testing.assert_allclose(mja.rollout(batch, data, 20).qvel[1], c.qvel, rtol=1e-4, atol=1e-5)
    term = terms["x"][0].attribute
    with pytest.raises(ValueError, match=rf"^impl='jax' of MJX cannot vary '{term}' of .* as it is 0 in the MJCF"):
        arena.put_model("jax")
    with pytest.raises(ValueError, match=rf"^impl='jax' of MJX cannot vary '{term}' of"):
        arena.apply(mjx.put_model(arena.mj_model, impl="jax"), params)


COUPLED = """<mujoco><option integrator="discrete" timestep=".01"/><worldbody>
<body name="a"><joint name="a" axis="0 1 0" frictionloss=".1"/><geom size=".05" pos=".1 0 0" mass="1"/></body>
<body name="b" pos="0 1 0"><joint name="b" axis="0 1 0"/><geom size=".05" pos=".1 0 0" mass="2"/></body></worldbody>
<tendon><fixed name="t"><joint joint="a" coef="2"/><joint joint="b" coef="-1.5"/></fixed></tendon>
<actuator><general name="m" tendon="t" biastype="affine" biasprm="0 0 0"/></actuator></mujoco>"""
FROM_NOTHING = {
    "damping": (dr.Term("tendon.damping"), by(2.0)),
    "stiffness": (dr.Term("tendon.stiffness"), by(50.0)),
    "bias": (dr.Term("actuator.biasprm"), by(0, -20.0, -3.0, *[0] * 7)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FROM_NOTHING)
def test_coupled_from_nothing(name):
    """What couples joints under `integrator="discrete"` may be 0 in the MJCF, though Warp's template says then that nothing does."""
    arena, params, compiled = exact(COUPLED, {"x": FROM_NOTHING[name]}, "warp")
    model = arena.put_model("warp")
    assert not any(
        getattr(model._impl, f"has_{what}") for what in ("tendon_damping", "tendon_stiffness", "efm_actuator")
    )
    batch = arena.batch(model, jax.tree.map(lambda x, y: np.stack([x, y]), arena.nominal_params(), params))
    data = mja.make_data(batch)
    data = data.replace(qvel=data.qvel + jnp.array([1.0, 0.5]), ctrl=data.ctrl + 0.5)
    after = []
    for one in (arena.mj_model, compiled):
        c = mujoco.MjData(one)
        c.qvel[:], c.ctrl[:] = [1.0, 0.5], 0.5
        mujoco.mj_step(one, c, 20)
        after.append(np.array(c.qvel))
    assert np.abs(after[0] - after[1]).min() > 0.5
    np.testing.assert_allclose(mja.rollout(batch, data, 20).qvel, after, rtol=1e-4, atol=1e-4)


SIDE = """<mujoco><worldbody><site name="s0" pos="-1 0 1"/><body name="c" pos="0 0 1">
<geom name="c" type="{}" size=".2 .3" contype="0" conaffinity="0"/><site name="side" pos="0 0 .3"/></body>
<body name="m" pos="1 0 1"><joint name="j" type="slide" axis="1 0 0"/><geom size=".1" contype="0" conaffinity="0"/><site name="s1"/></body>
</worldbody><tendon><spatial name="t" stiffness="100" springlength="0 1"><site site="s0"/><geom geom="c" sidesite="side"/><site site="s1"/>
</spatial></tendon></mujoco>"""
MESH = """<mujoco><asset><mesh name="t" vertex="0 0 0 .2 0 0 0 .2 0 0 0 .2"/></asset><worldbody>
<geom name="floor" type="plane" size="5 5 .1"/><body name="b" pos="0 0 .1"><freejoint/><geom name="g" type="mesh" mesh="t"/></body>
</worldbody></mujoco>"""
DAMPED = BODY.format(HINGE, "", '<actuator><motor name="m" joint="j" gear="3" damping="2"/></actuator>')
SERVO = BODY.format(
    '<joint name="j" range="-1 1"/>', "", '<actuator><position name="m" joint="j" kp="10" {}/></actuator>'
)
MUSCLE = """<mujoco><worldbody><site name="s0" pos="0 0 2"/><body name="a" pos="0 0 1"><joint name="a" axis="0 1 0" range="-60 60"/>
<geom size=".05" pos=".2 0 0"/><site name="s" pos=".2 0 .1"/></body></worldbody><tendon><spatial name="t"><site site="s0"/><site site="s"/>
</spatial></tendon><actuator><muscle name="m" tendon="t"/></actuator></mujoco>"""
TURNING = BODY.format(
    '<joint name="j" type="ball"/>', "", '<actuator><orientation name="o" joint="j" kp="3"/></actuator>'
)
ON_BALL = BODY.format(
    '<joint name="j" type="ball"/>', "", '<actuator><position name="m" joint="j" kp="3" dampratio="1"/></actuator>'
)
STRUNG = """<mujoco><worldbody><site name="s0" pos="0 0 .5"/><body><joint axis="0 1 0"/><geom size=".05" pos=".1 0 0"/>
<site name="s1" pos=".2 0 0"/></body></worldbody><tendon><spatial name="t" {}><site site="s0"/><site site="s1"/></spatial>
</tendon></mujoco>"""
REFUSED = {
    "a spring that bends": (
        STRUNG.format('stiffness="0 500 0"'), dr.Term("site.pos", "s0"), "warp",
        "`arena.spec`: tendon_lengthspring of tendon 't' would be stale in other worlds: it follows from `x` (of 'x'), and the compiler "
        "takes it from where the tendon's ends stand: give the tendon a `springlength`.",
    ),
    "a muscle's range": (
        MUSCLE, dr.Term("site.pos", "s"), "warp",
        "`arena.spec`: actuator_lengthrange of actuator 'm' would be stale in other worlds: it follows from `x` (of 'x'), and the compiler "
        "simulates it, or takes it from the limits of the joint: give the actuator a `lengthrange`.",
    ),
    "a damping on a ball": (
        ON_BALL, dr.Term("body.mass"), "warp",
        "`arena.spec`: actuator_biasprm of actuator 'm' would be stale in other worlds: it follows from `x` (of 'x'), and the compiler "
        "makes a damping of its `dampratio`: give it a `kv`.",
    ),
    "three outputs": (
        TURNING, dr.Term("body.mass"), "warp",
        "`arena.spec`: actuator 'o' has several controls or outputs, whose accelerations at rest would be stale in other worlds: take an "
        "actuator for each.",
    ),
    "three controls": (
        TURNING, dr.Term("actuator.ctrlrange", "o"), "warp",
        "`x.elements`: 'actuator.ctrlrange' of actuator 'o' cannot vary, as actuator 'o' has several controls or outputs: "
        "take an actuator for each.",
    ),
    "a side on jax": (
        SIDE.format("sphere"), dr.Term("site.pos", "side"), "jax",
        "impl='jax' of MJX cannot vary 'site.pos' of site 'side', as MJX decides once whether a tendon passes inside or outside of a geom: "
        "use impl='warp'.",
    ),
    "a cylinder with a side": (
        SIDE.format("cylinder"), dr.Term("site.pos", "side"), "warp",
        "`arena.spec`: in other worlds tendon 't' would pass geom 'c' elsewhere, and MJX computes the side of its `sidesite` differently "
        "from MuJoCo: wrap a sphere, or leave out the `sidesite`.",
    ),
    "margins of a mesh on jax": (
        MESH, dr.Term("geom.margin", "g"), "jax",
        "impl='jax' of MJX cannot vary 'geom.margin' of geom 'g', as MJX has no margins of contacts with meshes: use impl='warp'.",
    ),
    "gaps on jax": (
        MESH, dr.Term("geom.gap", "floor"), "jax",
        "impl='jax' of MJX cannot vary 'geom.gap' of geom 'floor', as MJX never reads it: use impl='warp'.",
    ),
    "damping of an actuator": (
        DAMPED, dr.Term("joint.damping", "j"), "warp",
        "`x.elements`: 'joint.damping' of joint 'j' cannot vary, as actuator 'm' adds a `damping` to it: "
        "give all of that to the joint or the tendon in the MJCF.",
    ),
    "gear of a damped actuator": (
        DAMPED, dr.Term("actuator.gear", "m"), "warp",
        "`x.elements`: 'actuator.gear' of actuator 'm' cannot vary, as its `damping` goes with the square of it: "
        "give that to the joint or the tendon in the MJCF.",
    ),
    "damping of an actuator on jax": (
        DAMPED, dr.Term("body.mass"), "jax",
        "impl='jax' of MJX leaves out the `damping` of actuator 'm': use impl='warp', or a joint's.",
    ),
    "numbers of a servo": (
        SERVO.format('kv="1"'), dr.Term("actuator.biasprm", "m"), "warp",
        "`x.elements`: 'actuator.biasprm' of actuator 'm' cannot vary, as it is a position servo: vary `actuator.kp` and `actuator.kv`.",
    ),
    "a range that is handed on": (
        SERVO.format('inheritrange="1"'), dr.Term("joint.range", "j"), "warp",
        "`arena.spec`: actuator_ctrlrange of actuator 'm' would be stale in other worlds: it follows from `x` (of 'x'), and the compiler "
        "takes it from the joint (`inheritrange`): give the actuator a `ctrlrange`.",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    """What MJX, or the compiler, would make otherwise."""
    xml, term, impl, sentence = REFUSED[case]
    arena = mja.Arena.from_xml(xml)

    def use():
        arena.vary(x=term)
        arena.put_model(impl)

    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        use()


def test_a_copy_of_another_term_is_no_proof():
    """A number that the compiler copies from one that varies may not vary beside it: the copies would agree in no world."""
    arena = mja.Arena.from_xml(SERVO.format('inheritrange="1"'))
    arena.vary(x=dr.Term("joint.range"), y=dr.Term("actuator.ctrlrange"))
    with pytest.raises(ValueError, match="actuator_ctrlrange of actuator 'm' would be stale"):
        arena.mj_model  # noqa: B018


@pytest.mark.parametrize(
    ("term", "xml", "value", "sentence"),
    [
        ("tendon.springlength", HEAVY.format(SPATIAL), [[0.5, 0.25]], "nor may both be -1, which MuJoCo takes for none, got [0.5, 0.25]."),
        ("joint.axis", BODY.format(HINGE, "", ""), [[0.0, 0, 0]], "must have a length, got [0.0, 0.0, 0.0]."),
        ("light.dir", BODY.format(HINGE, '<light name="l"/>', ""), [[0.0, 0, 0]], "must have a length, got [0.0, 0.0, 0.0]."),
        (
            "body.inertia",
            BODY.format(HINGE, "", ""),
            [[0.5, 0.125, 0.125]],
            "no moment of inertia may exceed the sum of the other two, got [0.5, 0.125, 0.125].",
        ),
    ],
)  # fmt: skip
def test_worlds_that_no_compiler_makes(term, xml, value, sentence):
    """Are flagged, and named."""
    arena = mja.Arena.from_xml(xml)
    arena.vary(x=dr.Term(term))
    params = with_values(jax.tree.map(np.asarray, arena.nominal_params()), {"x": np.array(value)})
    assert not arena.valid(params)
    (problem,) = arena.problems(params)
    assert problem.startswith("`terms.x` of ")
    assert problem.endswith(sentence)


KEYS = """<mujoco><worldbody><body name="mo" mocap="true" pos="0 0 1"><geom size=".1" contype="0" conaffinity="0"/></body>
<body name="b" pos="0 0 .5"><freejoint/><geom size=".1"/><body name="k"><joint name="j" ref="10"/><geom size=".1" pos=".2 0 0"/></body>
</body></worldbody><keyframe><key name="fast" qvel="1 0 0 0 0 0 1"/><key name="there" qpos="0 0 1 1 0 0 0 .3" mpos="1 1 1"/>
<key name="turned" mquat=".6 0 .8 0"/></keyframe>
</mujoco>"""


@pytest.mark.slow
@pytest.mark.parametrize("keyframe", ["fast", "there", "turned"])
@pytest.mark.filterwarnings("ignore:.*starts there in all worlds:UserWarning")
def test_keyframes_that_leave_places_out(keyframe, impl):
    """Begin where the world's bodies are; those that name places, there: as in the compiled world."""
    arena = mja.Arena.from_xml(KEYS)
    arena.vary(place=dr.Term("body.pos", ["b", "mo"]), turn=dr.Term("body.rpy", ["b", "mo"]), ref=dr.Term("joint.ref"))
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    params = with_values(nominal, {name: value + 0.3 for name, value in nominal.terms.items()})
    batch = arena.batch(arena.put_model(impl), jax.tree.map(lambda x: np.stack([x, x]), params))
    data, compiled = mja.make_data(batch, keyframe=keyframe), arena.compile(params)
    c = mujoco.MjData(compiled)
    mujoco.mj_resetDataKeyframe(compiled, c, compiled.key(keyframe).id)
    for name in ("qpos", "qvel", "mocap_pos", "mocap_quat"):
        np.testing.assert_allclose(getattr(data, name)[1], getattr(c, name), atol=1e-6, err_msg=name)


def test_written_files_are_exact(tmp_path):
    """MJCF of a world has all digits of what terms vary."""
    arena, params, compiled = exact(*CASES["a lamp in a frame"], "jax")
    arena.export(params, tmp_path / "world")
    for text in (arena.to_xml(params), (tmp_path / "world" / "world.xml").read_text()):
        again = mujoco.MjModel.from_xml_string(text)
        got, want = (worlds.leaves(mjx.put_model(m, impl="jax")) for m in (again, compiled))
        assert oracle.differing(compiled, got, want) - oracle.STRUCTURE_MAY_DIFFER.keys() == set()


def test_numbers_edited_afterwards():
    """Edits of `spec` come before `vary`."""
    arena = mja.Arena.from_xml(BODY.format(HINGE, "", ""))
    arena.vary(d=dr.Term("joint.damping"))
    arena.spec.joint("j").damping = [3.0, 0, 0]
    why = (
        "`arena.spec`: dof_damping of joint 'j' was edited after `arena.vary(d=...)` had read it: edit first, then "
        "call `vary`."
    )
    with pytest.raises(ValueError, match=f"^{re.escape(why)}$"):
        arena.mj_model  # noqa: B018


def test_all_that_can_vary_is_what_is_left():
    """Without `elements`, a term takes what no table, object or other term decides."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.attach(BODY.format(HINGE, "", ""), "r_", pos=(2, 0, 1))
    arena.vary(g=dr.Term("geom.friction", "floor"))
    arena.vary(f=dr.Term("geom.friction"), c=dr.Term("geom.rgba"))
    taken = {"table_collision", "cube_geom", "floor"}
    assert not taken & set(arena.elements("f"))
    assert "r_g" in arena.elements("f")
    arena.mj_model  # noqa: B018
