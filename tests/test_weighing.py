"""What bodies weigh, by pseudo-inertias, payloads, and the masses and densities of their geoms; and what only cameras see."""

import re

import mujoco
import numpy as np
import pytest
import worlds
from mujoco import mjx
from whole import differing, elsewhere, hold

import mjx_arenas as mja
from mjx_arenas import dr

SCENE = """<mujoco><asset>
<texture name="squares" type="2d" builtin="checker" width="4" height="4"/>
<texture name="flat" type="2d" builtin="flat" width="4" height="4"/>
<material name="tiles" texture="squares"/><material name="plain"/></asset><worldbody><light name="lamp" pos="0 0 3"/>
<camera name="lens" pos="0 0 1" sensorsize=".02 .01" focal=".03 .031" principal=".001 .002" resolution="64 48"/>
<camera name="pixels" pos="0 0 1" sensorsize=".02 .01" focalpixel="30 31" resolution="64 48"/><camera name="plain" pos="1 0 1"/>
<geom name="floor" type="plane" size="1 1 1" material="tiles"/>
<body name="a" pos="0 0 1"><freejoint/><geom name="box" type="box" size=".1 .2 .3"/><geom name="ball" pos=".2 0 0" size=".1" mass="2"/>
<body name="b" pos="0 .5 0"><joint name="j"/><geom name="rod" type="capsule" size=".05 .2" euler="10 20 30"/>
<geom name="shell" type="box" shellinertia="true" size=".1 .1 .1" pos=".3 .1 0"/></body></body>
<body name="c" pos="2 0 1"><joint name="k"/>
<geom name="egg" type="ellipsoid" size=".1 .2 .3" contype="0" conaffinity="0" pos=".1 0 0"/></body>
<body name="d" pos="0 2 1"><joint name="l"/><inertial pos=".1 .2 .3" mass="2" fullinertia=".05 .06 .07 .01 .004 -.01"/>
<geom name="disc" size=".1"/></body></worldbody></mujoco>"""


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_densities_and_masses(impl):
    """Of solid, given and hollow geoms, while they are turned and of other sizes."""
    arena = mja.Arena.from_xml(SCENE)
    arena.vary(
        density=dr.Term("geom.density", ["box", "rod", "shell"]),
        mass=dr.Term("geom.mass", ["ball", "egg"]),
        size=dr.Term("geom.size", ["box", "ball", "rod", "egg"]),
        turn=dr.Term("geom.rpy", ["box", "rod", "shell", "egg"]),
        place=dr.Term("geom.pos", "ball"),
    )
    egg = 4 / 3 * np.pi * 0.1 * 0.2 * 0.3 * 1000
    np.testing.assert_allclose(arena.nominal_params().terms["mass"], [2.0, egg], rtol=1e-6)
    np.testing.assert_allclose(arena.nominal_params().terms["density"], [1000.0] * 3)
    hold(arena, impl)


@pytest.mark.slow
def test_masses_carry_their_inertia(impl):
    """Of a box and a ball, whose inertias are known, and of numbers in the MJCF: `body.mass_alone` leaves them."""
    xml = """<mujoco><worldbody><body name="a"><freejoint/><geom type="box" size=".1 .2 .3" density="500"/></body>
    <body name="b" pos="0 0 1"><joint/><inertial pos="0 0 0" mass="2" diaginertia=".01 .02 .025"/></body></worldbody></mujoco>"""
    box = 24.0 / 3 * np.array([0.2**2 + 0.3**2, 0.1**2 + 0.3**2, 0.1**2 + 0.2**2])[::-1]  # of 24 kg
    for attribute, share in (("body.mass", 1.7), ("body.mass_alone", 1.0)):
        arena = mja.Arena.from_xml(xml)
        arena.vary(mass=dr.Term(attribute))
        params = arena.nominal_params()._replace(terms={"mass": 1.7 * np.array([24.0, 2.0])})
        for model in (arena.apply(arena.put_model(impl), params), arena.compile(params)):
            np.testing.assert_allclose(model.body_mass[1:], [1.7 * 24, 1.7 * 2], rtol=1e-6)
            inertia = np.sort(np.asarray(model.body_inertia[1:]), axis=1)
            np.testing.assert_allclose(inertia, share * np.array([box, [0.01, 0.02, 0.025]]), rtol=1e-6)


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_geoms_that_weigh_by_their_group(impl):
    """An `inertiagrouprange` decides which geoms weigh, in all worlds alike."""
    arena = mja.Arena.from_xml("""<mujoco><compiler inertiagrouprange="1 5"/><worldbody><body name="a"><joint/>
    <geom name="shown" type="box" size=".1 .2 .3"/><geom name="heavy" group="1" size=".1" pos=".1 .2 0"/></body>
    <body name="b" pos="0 0 1"><joint/><geom group="4" type="capsule" size=".1 .2"/></body></worldbody></mujoco>""")
    arena.vary(
        mass=dr.Term("body.mass", "b"), size=dr.Term("geom.size", bodies="a"), load=dr.Term("geom.density", bodies="a")
    )
    assert arena.elements("load") == ("heavy",)
    hold(arena, impl)


STALE = "varies the {} of geom '{}', which does not change the centre of mass and the inertia of body '{}', as `mass` varies its '{}'"


@pytest.mark.parametrize("how", ["at once", "mass first", "size first"])
@pytest.mark.parametrize("attribute", ["body.mass", "body.payload"])
def test_inertials_that_stay_are_told(how, attribute):
    """Once, whatever the order; and they do stay, while those of a density follow."""
    arena = mja.Arena.from_xml(SCENE)
    size, mass = {"size": dr.Term("geom.size", ["box", "rod"])}, {"mass": dr.Term(attribute, ["a", "d"])}
    *before, last = {"at once": [size | mass], "mass first": [mass, size], "size first": [size, mass]}[how]
    for terms in before:
        arena.vary(**terms)
    with pytest.warns(UserWarning, match="of mass and the inertia") as told:
        arena.vary(**last)
    assert [str(one.message) for one in told] == [
        f"`size` {STALE.format('size', 'box', 'a', attribute)}: if they should, vary 'geom.density' and not '{attribute}'."
    ]
    params, other = arena.nominal_params(), mja.Arena.from_xml(SCENE)
    other.vary(**size, density=dr.Term("geom.density", "box"))
    larger = {"size": params.terms["size"] * 1.2}
    fixed = arena.compile(params._replace(terms={**params.terms, **larger}))
    follows = other.compile(other.nominal_params()._replace(terms={**other.nominal_params().terms, **larger}))
    a = arena.mj_model.body("a").id
    np.testing.assert_allclose(fixed.body_inertia[a], arena.mj_model.body_inertia[a], rtol=1e-9)
    assert (follows.body_inertia[a] > 1.5 * arena.mj_model.body_inertia[a]).all()


def test_inertials_that_geoms_do_not_make(recwarn):
    """Of a body with an inertial of its own, of one whose geom weighs nothing, and of another body: nothing is told."""
    arena = mja.Arena.from_xml(SCENE.replace('name="rod"', 'name="rod" mass="0"'))
    arena.vary(mass=dr.Term("body.mass", ["b", "c", "d"]), size=dr.Term("geom.size", ["disc", "rod", "box"]))
    assert not recwarn


def pseudo_inertia(mass, center, inertia):
    """(4, 4) of a body in its own frame."""
    moments = np.trace(inertia) / 2 * np.eye(3) - inertia + mass * np.outer(center, center)
    return np.block([[moments, mass * center[:, None]], [mass * center[None], np.full((1, 1), mass)]])


def body(model, index):
    """Mass, centre and inertia along the axes of a body of a model."""
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, np.asarray(model.body_iquat[index], float))
    axes = axes.reshape(3, 3)
    inertia = axes @ np.diag(np.asarray(model.body_inertia[index], float)) @ axes.T
    return float(model.body_mass[index]), np.asarray(model.body_ipos[index], float), inertia


@pytest.mark.slow
def test_pseudo_inertias(impl):
    """J becomes U J U', as in the paper; an arrow of huge numbers is still a body that MuJoCo compiles."""
    arena = mja.Arena.from_xml(SCENE)
    arena.vary(inertia=dr.Term("body.pseudo_inertia"))
    hold(arena, impl)
    values = np.random.default_rng(0).uniform(-1.5, 1.5, (4, 10))
    params = arena.nominal_params()._replace(terms={"inertia": values})
    got, compiled = arena.apply(arena.put_model(impl), params), arena.compile(params)
    for i, name in enumerate("abcd"):
        alpha, d1, d2, d3, s12, s13, s23, t1, t2, t3 = values[i]
        e = np.exp
        u = e(alpha) * np.array([[e(d1), s12, s13, t1], [0, e(d2), s23, t2], [0, 0, e(d3), t3], [0, 0, 0, 1]])
        want = u @ pseudo_inertia(*body(arena.mj_model, arena.mj_model.body(name).id)) @ u.T
        for model, off in ((compiled, 1e-12), (got, 3e-6)):
            made = pseudo_inertia(*body(model, arena.mj_model.body(name).id))
            assert np.abs(made - want).max() < off * np.abs(want).max()


@pytest.mark.slow
def test_payloads(impl):
    """As a body of its own that is welded on, but for its rotational inertia, which a point has none of."""
    arena = mja.Arena.from_xml(SCENE)
    arena.vary(load=dr.Term("body.payload"))
    hold(arena, impl)
    values = np.array([[1.5, 0.1, 0.2, -0.3], [0.0, 1, 1, 1], [0.2, 0, 0, 0.4], [3.0, -0.2, 0, 0]])
    got = arena.apply(arena.put_model(impl), arena.nominal_params()._replace(terms={"load": values}))
    spec = arena.spec.copy()
    for (mass, *place), name in zip(values, "abcd", strict=True):
        point = spec.body(name).add_body(name=f"{name}_load", pos=place)
        point.explicitinertial, point.mass, point.inertia, point.ipos = (
            True,
            max(mass, 1e-14),
            np.full(3, 1e-14),
            np.zeros(3),
        )
    spec.compiler.fusestatic = False
    apart = spec.compile()
    for name in "abcd":
        index, point = arena.mj_model.body(name).id, apart.body(f"{name}_load").id
        one = [pseudo_inertia(*body(apart, i)) for i in (apart.body(name).id, point)]
        shift = np.eye(4)
        shift[:3, 3] = apart.body_pos[point]
        want = one[0] + shift @ one[1] @ shift.T
        np.testing.assert_allclose(pseudo_inertia(*body(got, index)), want, atol=3e-6 * np.abs(want).max())


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_what_is_seen(impl):
    """Intrinsics, in pixels, too; textures, materials and kinds of light by choice."""
    arena = mja.Arena.from_xml(SCENE)
    arena.vary(
        focal=dr.Term("camera.focal"),
        principal=dr.Term("camera.principal"),
        fovy=dr.Term("camera.fovy"),
        texture=dr.Term("material.texture"),
        material=dr.Term("geom.material", ["floor", "box"]),
        light=dr.Term("light.type"),
    )
    hold(arena, impl)
    squares, flat = (arena.mj_model.texture(name).id for name in ("squares", "flat"))
    np.testing.assert_array_equal(arena.nominal_params().terms["texture"], [squares, -1])
    ranges = mja.ArenaRanges(terms={"texture": mja.Choice([squares, flat]), "light": mja.Choice([0, 1, 2])})
    batch = arena.randomize(arena.put_model(impl), mja.world_keys(0, range(16)), ranges)
    assert batch.valid.all()
    role = int(mujoco.mjtTextureRole.mjTEXROLE_RGB)
    assert set(np.asarray(batch.model.mat_texid)[:, 0, role]) == {squares, flat}
    for i in range(3):
        want = mjx.put_model(arena.compile(batch.world(i)), impl=impl)
        got = arena.apply(arena.put_model(impl), batch.world(i))
        assert differing(arena.compile(batch.world(i)), worlds.leaves(got), worlds.leaves(want)) == set()


REFUSED = {
    "density of a given mass": (dr.Term("geom.density", "ball"), "it has a `mass`: vary `geom.mass`"),
    "of the world": (dr.Term("geom.mass", "floor"), "the world has no mass: take geoms of other bodies"),
    "of an inertial": (dr.Term("geom.density", "disc"), "body 'd' has an inertial of its own: vary `body.mass`"),
    "size of a shell": (
        dr.Term("geom.size", "shell"),
        "its body's inertia follows from its surface (`shellinertia`): give the body an <inertial>",
    ),
    "no lens": (dr.Term("camera.focal", "plain"), "it has no `sensorsize`: vary `camera.fovy`"),
    "a lens": (dr.Term("camera.fovy", "lens"), "its `focal` and `sensorsize` decide: vary `camera.focal`"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    """Where an attribute decides nothing, with the reason."""
    term, why = REFUSED[case]
    kind, name = term.attribute.partition(".")[0], term.elements
    sentence = f"`x.elements`: {term.attribute!r} of {kind} {name!r} cannot vary, as {why}."
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        mja.Arena.from_xml(SCENE).vary(x=term)


def test_one_term_may_overrule_another():
    """A mass of a body leaves nothing to decide for its geoms: said in the order of either."""
    why = "`load.elements`: 'geom.density' of geom 'box' cannot vary, as for another term body 'a' has an inertial of its own: "
    why = f"^{re.escape(why + 'vary `body.mass`.')}$"
    arena = mja.Arena.from_xml(SCENE)
    with pytest.raises(ValueError, match=why):
        arena.vary(load=dr.Term("geom.density", "box"), mass=dr.Term("body.mass", "a"))
    arena.vary(load=dr.Term("geom.density", "box"))
    with pytest.raises(ValueError, match=why):
        arena.vary(mass=dr.Term("body.mass", "a"))
    with pytest.raises(
        ValueError, match=r"^Terms 'm' and 'p' both decide body_mass of body 'b': leave it to one of them\.$"
    ):
        arena.vary(m=dr.Term("body.mass", "b"), p=dr.Term("body.payload", "b"))


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        (
            "load",
            [-1.0, 0, 0, 0],
            "`terms.load` of body 'd' must be finite and >= 0 in its mass, got [-1.0, 0.0, 0.0, 0.0].",
        ),
        ("texture", 2.0, "`terms.texture` of material 'plain' must be between -1 and 1, got 2.0."),
        (
            "texture",
            0.5,
            "`terms.texture` of material 'plain' must be finite and the `id` of a texture (`arena.mj_model.texture(name).id`), or "
            "-1 for none, got 0.5.",
        ),
    ],
)
def test_worlds_that_cannot_be(name, value, sentence):
    """Flagged on the device, told on the host."""
    arena = mja.Arena.from_xml(SCENE)
    arena.vary(load=dr.Term("body.payload"), texture=dr.Term("material.texture"))
    terms = {key: np.array(x) for key, x in arena.nominal_params().terms.items()}
    terms[name][-1] = value
    params = arena.nominal_params()._replace(terms=terms)
    assert not arena.valid(params)
    assert arena.problems(params) == [sentence]


def test_choices_are_no_intervals():
    """An index cannot be drawn between two."""
    arena = mja.Arena.from_xml(SCENE)
    arena.vary(texture=dr.Term("material.texture"))
    with pytest.raises(
        ValueError,
        match=r"^`ranges\.terms\.texture` \(Uniform\): indices need Choice or Fixed, which cannot be relative\.$",
    ):
        arena.check_ranges(mja.ArenaRanges(terms={"texture": mja.Uniform(0, 1)}))
    with pytest.raises(ValueError, match=r"`ranges\.terms\.texture`.* can reach 7"):
        arena.check_ranges(mja.ArenaRanges(terms={"texture": mja.Choice([0, 7])}))


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_far_away_parameters_stay_exact(impl):
    """Heavy bodies become light ones, and small ones large."""
    arena = mja.Arena.from_xml(SCENE)
    arena.vary(density=dr.Term("geom.density", ["box", "rod"]), size=dr.Term("geom.size", ["box", "rod"]))
    for far in (3.0, -2.0):
        params = elsewhere(arena, far)
        compiled = arena.compile(params)
        got = worlds.leaves(arena.apply(arena.put_model(impl), params))
        assert differing(compiled, got, worlds.leaves(mjx.put_model(compiled, impl=impl))) == set()
