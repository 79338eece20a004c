"""Terms of any MJCF: whatever varies, each world is the model that MuJoCo compiles; on models that were not written for it."""

import functools
import re

import jax
import mujoco
import numpy as np
import pytest
import worlds
from models import FEW_ARMS, MJX, SUITE
from mujoco import mjx
from whole import differing, elsewhere, everything, held, otherwise, weighed, with_everything

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.params.params import with_values

pytestmark = pytest.mark.slow_on("warp")


@pytest.mark.parametrize("name", ["finger", "fish"])
@pytest.mark.slow
def test_everything_at_once(name, impl):
    """More than fifty attributes of all elements; a factor of 1.003 on one element of any field is noticed."""
    assert len(with_everything(name, impl).quantities) > 50
    held(name, impl)


@pytest.mark.xslow_on("jax")
@pytest.mark.parametrize("name", ["finger", "fish"])
@pytest.mark.slow
def test_all_that_weighs(name, impl):
    """Pseudo-inertias, payloads, masses and densities of geoms that are turned, moved and of another size."""
    assert len(with_everything(name, impl, weighed).quantities) > 4
    held(name, impl, weighed)


OTHERS = [name for name in (*SUITE, *MJX) if name not in ("finger", "fish")]
IN_TURNS = [
    pytest.param(name, impl, marks=[pytest.mark.xslow] * (i % 6 != 3 * k))
    for i, name in enumerate(OTHERS)
    for k, impl in enumerate(("jax", "warp"))
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "impl"), IN_TURNS, indirect=["impl"])
def test_everything_of_the_suite(name, impl):
    """The same of the other models of the control suite, and of some of MJX's own: every third one in `make test-slow`, in turns."""
    for terms in (everything, weighed, otherwise):
        held(name, impl, terms)


@pytest.mark.filterwarnings("ignore:Mesh .* has a coplanar face")  # of MJX on JAX
@pytest.mark.slow
@pytest.mark.xslow_on("jax")
@pytest.mark.parametrize("name", FEW_ARMS)
def test_everything_of_robots(name, impl):
    """The same of arms, hands and legs with meshes, all of which `put_model` takes on both implementations."""
    for terms in (everything, weighed, otherwise):
        held(name, impl, terms)


LEGS = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/><body name="trunk" pos="0 0 .5"><freejoint name="root"/>
<geom name="trunk" type="box" size=".1 .1 .05"/><body name="leg_a" pos=".1 0 0"><joint name="hip_a" axis="0 1 0" damping=".1"/>
<geom name="shin_a" type="capsule" size=".02" fromto="0 0 0 0 0 -.2"/></body><body name="leg_b" pos="-.1 0 0">
<joint name="hip_b" axis="0 1 0" damping=".1"/><geom name="shin_b" type="capsule" size=".02" fromto="0 0 0 0 0 -.2"/></body></body>
</worldbody><actuator><position name="a" joint="hip_a" kp="10" kv="1"/><motor name="b" joint="hip_b"/></actuator></mujoco>"""


@functools.cache
def legs():
    """A scene without tables, of which some varies."""
    arena = mja.Arena.from_xml(LEGS)
    arena.vary(
        mass=dr.Term("body.mass", "leg_.*"),
        grip=dr.Term("geom.friction", "floor", axes=("sliding",)),
        kp=dr.Term("actuator.kp", "a"),
        gravity=dr.Term("option.gravity"),
    )
    return arena


RANGES = mja.ArenaRanges(
    terms={
        "mass": mja.Uniform(0.8, 1.2, relative="scale"),
        "grip": mja.Uniform(1.1, 1.8),
        "kp": mja.LogUniform(5, 20),
        "gravity": mja.Uniform([0, 0, -1], [0, 0, 1], relative="add"),
    }
)


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_a_scene_without_tables(impl, tmp_path):
    """It is an arena like any other: drawn, stepped, compiled, saved and described. `test_not_ours.py` does more."""
    arena, keys = legs(), mja.world_keys(0, range(4))
    batch = arena.randomize(arena.put_model(impl), keys, RANGES)
    assert batch.valid.all()
    data = mja.rollout(batch, mja.make_data(batch, keys), 3)
    assert np.isfinite(data.qpos).all()
    model, c = arena.c_world(batch.world(2))
    mujoco.mj_step(model, c, nstep=3)
    np.testing.assert_allclose(data.qpos[2], c.qpos, atol=2e-5)
    mja.save(tmp_path / "legs.yaml", arena, RANGES)
    again, ranges = mja.load(tmp_path / "legs.yaml")
    assert again.record == arena.record
    assert ranges == RANGES
    shown = str(arena.describe(batch.params))
    assert [line.split()[0] for line in shown.splitlines()[1:]] == ["mass", "leg_b", "grip", "kp", "gravity"]


@pytest.mark.filterwarnings("ignore:.*torsional and rolling friction have no effect")
def test_draws_depend_on_the_element_alone():
    """Not on what else is selected, on what the quantity is called, nor on other axes."""
    one, two = mja.Arena.from_xml(LEGS), mja.Arena.from_xml(LEGS)
    one.vary(x=dr.Term("geom.friction", ["shin_a", "shin_b"]))
    two.vary(y=dr.Term("geom.friction", "shin_b", axes="torsional"), z=dr.Term("joint.damping"))
    draw = mja.Uniform(0.1, 0.9)
    for key in mja.world_keys(0, range(3)):
        a = one.sample_params(key, mja.ArenaRanges(terms={"x": draw})).terms["x"]
        b = two.sample_params(key, mja.ArenaRanges(terms={"y": draw})).terms["y"]
        assert a[1, 1] == b[0, 1]
        assert np.unique(a).size == 6
        np.testing.assert_allclose(b[0, [0, 2]], [1.0, 0.0001], rtol=1e-6)


def test_axes_of_one_element_are_apart():
    """Two terms may share an element, each with axes of its own; not the same axis."""
    arena = mja.Arena.from_xml(LEGS)
    arena.vary(
        a=dr.Term("geom.friction", "floor", axes="sliding"), b=dr.Term("geom.friction", "floor", axes=("torsional",))
    )
    with pytest.raises(
        ValueError, match=r"^Terms 'a' and 'c' both decide geom_friction of geom 'floor': leave it to one of them\.$"
    ):
        arena.vary(c=dr.Term("geom.friction", "floor|trunk"))
    assert arena.quantities == ("a", "b")
    table = mja.TableArena()
    with pytest.raises(
        ValueError,
        match=r"^Term 'slab' must leave out geom_friction of geom 'table_collision', which is of the arena's tables: they vary by ",
    ):
        table.vary(slab=dr.Term("geom.friction", "table_.*"))


@pytest.mark.parametrize(
    ("attribute", "field", "instead"),
    [
        ("body.inertia", "body_inertia", "it follows from their masses and sizes"),
        ("body.pos", "body_pos", "`make_data` places them by keys"),
        ("body.rpy", "body_quat", "`make_data` places them by keys"),
        ("body.mass", "body_mass", "they vary by ArenaRanges(object_...=...)"),
    ],
)
def test_a_number_of_an_object(attribute, field, instead):
    """The sentence says what decides it."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    sentence = f"Term 'of_cube' must leave out {field} of body 'cube', which is of the arena's objects: {instead}"
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}"):
        arena.vary(of_cube=dr.Term(attribute, "cube"))


def test_a_name_that_an_earlier_term_has():
    """The sentence says what has it, and offers one that is free."""
    arena = mja.Arena.from_xml(LEGS)
    arena.vary(look=dr.Term("geom.rgba"), look_2=dr.Term("body.gravcomp"))
    said = "`look` is taken, as an earlier `vary` gave it to 'geom.rgba': give the term another name, such as `look_3`."
    with pytest.raises(ValueError, match=f"^{re.escape(said)}$"):
        arena.vary(look=dr.Term("joint.damping"))


def test_values_are_those_of_the_compiled_model_ever_after():
    """`scale` and `add` start from the MJCF's number in each draw, never from the last one."""
    arena, key = legs(), mja.world_keys(0, [0])[0]
    twice = mja.ArenaRanges(terms={"mass": mja.Fixed(2.0, relative="scale")})
    first = arena.sample_params(key, twice)
    model = arena.apply(arena.put_model("jax"), first)
    np.testing.assert_array_equal(arena.apply(model, arena.sample_params(key, twice)).body_mass, model.body_mass)


WRONG = {
    "attribute": (
        {"x": dr.Term("geom.fricton")},
        "`x.attribute`: no attribute 'geom.fricton' can vary: did you mean `geom.friction`?",
    ),
    "another word": (
        {"x": dr.Term("body.weight")},
        "`x.attribute`: no attribute 'body.weight' can vary: did you mean `body.mass`?",
    ),
    "term": ({"x": "geom.friction"}, "`x` must be a dr.Term, got 'geom.friction'."),
    "name": (
        {"table_rots": dr.Term("geom.rgba")},
        "`table_rots` is taken, as ArenaRanges(table_rots=...) has it: give the term another name, such as `table_rots_2`.",
    ),
    "no name": ({"a.b": dr.Term("geom.rgba")}, "`a.b` must be a valid Python name, as it is the name of a quantity."),
    "element": (
        {"x": dr.Term("body.mass", "leg")},
        "`x.elements`: no body is called 'leg', as a name or a regular expression: did you mean `leg_b`?",
    ),
    "pattern": (
        {"x": dr.Term("body.mass", "(")},
        (
            "`x.elements`: no body is called '(', nor is it a valid regular expression: missing ), unterminated subpattern "
            "at position 0."
        ),
    ),
    "kinds": (
        {"x": dr.Term("body.mass", 3)},
        "`x.elements` must be a name, a regular expression or a list of them, got 3.",
    ),
    "axes": (
        {"x": dr.Term("geom.friction", axes=("rolling", "x"))},
        "`x.axes` must be some of 'sliding', 'torsional', 'rolling', the axes of 'geom.friction', got ('rolling', 'x').",
    ),
    "no axes": (
        {"x": dr.Term("body.mass", axes="x")},
        "`x.axes` must be None, as 'body.mass' is one number, got 'x'.",
    ),
    "plane": (
        {"x": dr.Term("geom.size", "floor")},
        "`x.elements`: 'geom.size' of geom 'floor' cannot vary, as it is a plane, whose size MJX shares between worlds: "
        "use a primitive shape.",
    ),
    "world": (
        {"x": dr.Term("body.mass", "world")},
        "`x.elements`: no body is called 'world', as a name or a regular expression; known are trunk, leg_a, leg_b.",
    ),
    "servo": (
        {"x": dr.Term("actuator.kp", "b")},
        "`x.elements`: 'actuator.kp' of actuator 'b' cannot vary, as it is a motor, which has no `kp`: vary `actuator.gainprm`.",
    ),
    "range": (
        {"x": dr.Term("joint.range", "hip_a")},
        "`x.elements`: 'joint.range' of joint 'hip_a' cannot vary, as it has no `range` in force: give it a wide one in the MJCF.",
    ),
    "free": (
        {"x": dr.Term("joint.pos", "root")},
        "`x.elements`: 'joint.pos' of joint 'root' cannot vary, as it is free: vary `body.pos` or `body.start_pos`.",
    ),
    "medium": (
        {"x": dr.Term("option.wind")},
        "`x.elements`: the arena has no option whose 'option.wind' can vary: there is no medium, which MJX then leaves out: "
        "give the MJCF a density, a viscosity or a wind ('option').",
    ),
    "none": (
        {"x": dr.Term("tendon.damping")},
        "`x.elements`: the arena has no tendon whose 'tendon.damping' can vary.",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_terms(case):
    """Each is answered with one sentence, and the arena stays as it was."""
    terms, sentence = WRONG[case]
    arena = mja.Arena.from_xml(LEGS)
    before = arena.xml
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        arena.vary(**terms)
    assert arena.xml == before
    assert not arena.quantities


WRONG_RANGES = {
    "of a task's arm": (
        {"arm_mass": mja.Fixed(1.0)},
        "`ranges.terms`: the arena has no quantity 'arm_mass'. The arm of a task is there once the task has attached it: its quantities "
        "belong under `ranges` of the training's file, or into the task's argument `ranges`.",
    ),
    "unknown": ({"mas": mja.Fixed(1.0)}, "`ranges.terms`: the arena has no quantity 'mas': did you mean `mass`?"),
    "no distribution": (
        {"mass": 1.0},
        "`ranges.terms.mass` must be a distribution such as Uniform(low, high), or None, got 1.0.",
    ),
    "limits": (
        {"mass": mja.Uniform(-1, 1)},
        "`ranges.terms.mass` of all bodies can reach -1.0: it must stay > 0 [kg].",
    ),
    "shape": ({"gravity": mja.Uniform([0, 1], 2)}, "`ranges.terms.gravity` (Uniform): `low`"),
}


@pytest.mark.parametrize("case", WRONG_RANGES)
def test_wrong_ranges(case):
    """Ranges of terms are refused like those of tables."""
    terms, sentence = WRONG_RANGES[case]
    with pytest.raises((ValueError, TypeError)) as error:
        legs().check_ranges(mja.ArenaRanges(terms=terms))
    assert str(error.value).startswith(sentence)


def test_worlds_out_of_limits_are_flagged():
    """A number that a term must not have is found on the device as on the host."""
    arena = legs()
    params = jax.tree.map(np.asarray, arena.nominal_params())
    bad = with_values(params, {"mass": np.array([0.1, -1.0])})
    assert arena.valid(params)
    assert not arena.valid(bad)
    assert arena.problems(bad) == ["`terms.mass` of body 'leg_b' must be finite and > 0 [kg], got -1.0."]
    with pytest.raises(ValueError, match=r"^`params`: quantities of `arena\.vary`|`params\.terms`"):
        arena.compile(params._replace(terms={}))


def test_a_preset_for_robots():
    """All that the robot has and can vary, of nothing else, and by as much as is asked for."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.attach(LEGS, "r_")
    half = dr.robot(arena.spec, "r_", strength=0.5)
    assert list(half.terms) == ["r_mass", "r_com", "r_damping", "r_kp", "r_kv", "r_motor", "r_friction"]
    arena.vary(**half.terms)
    keys = mja.world_keys(0, range(64))
    drawn = jax.vmap(lambda key: arena.sample_params(key, mja.ArenaRanges(terms=half.ranges)))(keys).terms
    nominal = arena.nominal_params().terms
    for name, low, high in (("r_mass", 0.95, 1.05), ("r_damping", 0.9, 1.1), ("r_friction", 0.85, 1.15)):
        share = (drawn[name] / nominal[name])[..., 0] if name == "r_friction" else drawn[name] / nominal[name]
        assert low <= share.min() < 0.5 * low + 0.5
        assert 0.5 * high + 0.5 < share.max() <= high
    np.testing.assert_array_equal(
        drawn["r_friction"][..., 1:], np.broadcast_to(nominal["r_friction"][:, 1:], (64, 3, 2))
    )
    with pytest.raises(
        ValueError, match=r"^`prefix`: the arena has nothing that can vary whose name begins with 'arm_'\.$"
    ):
        dr.robot(arena.spec, "arm_")
    with pytest.raises(ValueError, match=r"^`strength` must be a number from 0 to 1, got 2\.$"):
        dr.robot(arena.spec, "r_", 2)


def test_ranges_that_turn_over():
    """A range whose ends have changed places is flagged on the device and named on the host."""
    arena = mja.Arena.from_xml(LEGS.replace('name="hip_a"', 'name="hip_a" range="0 40"'))
    arena.vary(range=dr.Term("joint.range"))
    params = jax.tree.map(np.asarray, arena.nominal_params())
    assert arena.valid(params)
    np.testing.assert_allclose(params.terms["range"], [[0, np.deg2rad(40)]], rtol=1e-6)
    bad = with_values(params, {"range": np.array([[0.5, 0.25]])})
    assert not arena.valid(bad)
    assert arena.problems(bad) == [
        "`terms.range` of joint 'hip_a': the first number must be below the second, got [0.5, 0.25]."
    ]


CHAIN = """<mujoco>{compiler}<worldbody><light name="lamp"/><body name="a" pos="0 0 1"><joint name="ja" axis="0 1 0"/>
<geom name="a" type="box" size=".1 .05 .03"/><body name="b" pos=".3 0 0"><joint name="jb" axis="0 1 0"/>
<geom name="b" type="box" size=".1 .05 .03"/></body></body></worldbody><equality><joint name="tie" joint1="ja" joint2="jb"/></equality>
</mujoco>"""
ALONE = {
    "a size": {"x": dr.Term("geom.size", "a")},  # a body reaches to its children's joints
    "axes apart": {"x": dr.Term("geom.friction", axes="sliding"), "y": dr.Term("geom.friction", axes="rolling")},
    "places apart": {"x": dr.Term("body.pos", "b", axes="x"), "y": dr.Term("body.pos", "b", axes="z")},
    "gravity apart": {"x": dr.Term("option.gravity", axes="x"), "y": dr.Term("option.gravity", axes="z")},
    "a lamp": {"x": dr.Term("light.active"), "y": dr.Term("geom.friction")},
    "a tie": {"x": dr.Term("equality.data", axes=("0", "1"))},
    "a turn": {"x": dr.Term("body.rpy", "a")},
}


@pytest.mark.slow
@pytest.mark.parametrize("case", ALONE)
def test_terms_alone(case):
    """Few terms, as a user would: written when all vary, and when one of them does."""
    arena = mja.Arena.from_xml(CHAIN.format(compiler=""))
    arena.vary(**ALONE[case])
    model = arena.put_model("jax")
    params = elsewhere(arena, 0.5)
    compiled = arena.compile(params)
    got = worlds.leaves(arena.apply(model, params))
    assert differing(compiled, got, worlds.leaves(mjx.put_model(compiled, impl="jax"))) == set()
    if len(arena.quantities) > 1:
        arena.randomize(
            model, mja.world_keys(0, [0]), mja.ArenaRanges(terms={"y": mja.Uniform(0.001, 0.002, relative="add")})
        )


def test_inertias_that_the_geoms_decide():
    """`inertiafromgeom="true"` overrules an inertial: it cannot vary."""
    arena = mja.Arena.from_xml(CHAIN.format(compiler='<compiler inertiafromgeom="true"/>'))
    with pytest.raises(
        ValueError, match=r"can vary: the compiler takes it from the geoms: set `inertiafromgeom=\"auto\"` \('a'\)\.$"
    ):
        arena.vary(m=dr.Term("body.mass"), p=dr.Term("geom.pos"))


def test_options_that_vary_are_set_before():
    """An option of the compiled model that a term varies cannot be another."""
    arena = mja.Arena.from_xml(CHAIN.format(compiler=""))
    arena.vary(g=dr.Term("option.gravity"))
    arena.mj_model.opt.gravity[2] = -1.6
    with pytest.raises(
        ValueError, match=r"^`arena\.mj_model\.opt\.gravity`: `g` varies this option, starting from the value that"
    ):
        arena.put_model("jax"), arena.record


def test_masses_that_the_compiler_shares_out():
    """A `boundmass` would change masses behind the term's back."""
    arena = mja.Arena.from_xml(LEGS.replace("<mujoco>", '<mujoco><compiler boundmass="0.01"/>'))
    arena.vary(mass=dr.Term("body.mass", "leg_a"))
    with pytest.raises(
        ValueError, match=r"^`spec\.compiler`: boundmass would make the masses of all bodies follow from `mass`: s"
    ):
        arena.mj_model  # noqa: B018


def test_terms_come_before_the_model():
    """After the first use of the model they are refused, and so is merging an arena that has some."""
    arena = legs()
    arena.mj_model  # noqa: B018
    with pytest.raises(
        ValueError, match=r"^`vary`: the arena is compiled already: vary before the first use of the model\.$"
    ):
        arena.vary(x=dr.Term("geom.rgba"))
    with pytest.raises(
        ValueError,
        match=r"^`other` has quantities of .*: merge first, then vary, and add the parts to",
    ):
        mja.TableArena().merge(arena, "b_")


def test_templates_with_other_numbers():
    """An environment that writes gains of its own into its compiled model: draws would start from the arena's, and are refused."""
    arena = legs()
    model = arena.put_model("jax")
    edited = model.replace(actuator_gainprm=model.actuator_gainprm * 2)
    keys = mja.world_keys(0, [0, 1])
    where = "actuator_gainprm of actuator 'a'"
    why = f"`model` has another {where} than the arena. `ranges.terms.kp` is relative to the arena's number: set the same "
    why += "number in the arena's MJCF."
    why = f"^{re.escape(why)}$"
    scaled = mja.ArenaRanges(terms={"kp": mja.Uniform(0.8, 1.2, relative="scale")})
    for _ in range(2):
        with pytest.raises(ValueError, match=why):
            arena.randomize(edited, keys, scaled)
        with pytest.raises(ValueError, match=why):
            arena.randomization_fn(scaled)(edited, keys)
    absolute = mja.ArenaRanges(terms={"kp": mja.Uniform(5.0, 6.0)})
    assert (arena.randomize(edited, keys, absolute).model.actuator_gainprm[:, 0, 0] < 6).all()
    assert (arena.randomize(model, keys, scaled).model.actuator_gainprm[:, 0, 0] > 8).all()


@pytest.mark.slow
def test_who_is_who():
    """Rows of parameters by the names of their elements, and the worlds that a trainer's keys stand for."""
    arena = legs()
    assert arena.elements("mass") == ("leg_a", "leg_b")
    with pytest.raises(
        ValueError,
        match=r"^`quantity` must be one of 'mass', 'grip', 'kp', 'gravity', the quantities of `vary`, got 'mas'\.$",
    ):
        arena.elements("mas")
    keys = jax.random.split(jax.random.key(1), 3)
    model_v, _ = arena.randomization_fn(RANGES)(arena.put_model("jax"), rng=keys)
    params = jax.vmap(lambda key: arena.sample_params(key, RANGES))(mja.trainers_keys(keys))
    np.testing.assert_allclose(model_v.body_mass[:, 2:], params.terms["mass"], rtol=1e-6)


def test_an_element_that_was_renamed():
    arena = mja.Arena.from_xml('<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/></worldbody></mujoco>')
    arena.vary(grip=dr.Term("geom.friction", "floor"))
    arena.spec.geom("floor").name = "ground"
    says = r"^`arena.spec`: geom 'floor' is gone, but `arena\.vary\(grip=\.\.\.\)` varies it: do not delete or rename it\.$"
    with pytest.raises(ValueError, match=says):
        _ = arena.mj_model


def test_an_attribute_that_is_no_text():
    arena = mja.Arena.from_xml("<mujoco/>")
    with pytest.raises(ValueError, match=r"no attribute \['body.mass', 'upper'\] can vary"):
        arena.vary(mass=dr.Term(["body.mass", "upper"]))


@pytest.mark.parametrize(
    ("attribute", "dist", "rule"),
    [
        ("joint.range", mja.Uniform([1, -1], [2, -0.5]), "low_below_high"),
        ("joint.range", mja.Fixed([0.5, 0.5]), "low_below_high"),
        ("joint.axis", mja.Fixed(0.0), "no_length"),
        ("light.dir", mja.Fixed(0.0), "no_length"),
        ("body.inertia", mja.Fixed([0.001, 0.001, 0.1]), "triangle"),
    ],
)
def test_ranges_that_no_draw_makes_right(attribute, dist, rule):
    xml = """<mujoco><worldbody><light name="l"/><body name="b"><joint name="j" axis="0 1 0" range="-1 1"/><geom size=".1"/>
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
    arena = mja.Arena.from_xml(xml)
    arena.vary(x=dr.Term(attribute))
    with pytest.raises(ValueError, match=r"^`ranges.terms.x` of .*(must have|first number|moment) ") as raised:
        arena.check_ranges(mja.ArenaRanges(terms={"x": dist}))
    assert [p.rule for p in raised.value.problems] == [rule]
    if rule == "low_below_high":
        arena.check_ranges(
            mja.ArenaRanges(terms={"x": mja.Uniform([-1, -0.5], [0.5, 1])})
        )  # some draws are right: a flag


def test_what_others_leave():
    """A term without elements takes what the others of the same call leave, whichever comes first."""
    mass, trunk = dr.Term("body.mass"), dr.Term("body.mass", "trunk")
    for terms in ({"mass": mass, "trunk": trunk}, {"trunk": trunk, "mass": mass}):
        arena = mja.Arena.from_xml(
            '<mujoco><worldbody><body name="trunk"><freejoint/><geom size=".1"/><body name="leg"><joint/><geom size=".1"/></body></body>'
            "</worldbody></mujoco>"
        )
        arena.vary(**terms)
        assert arena.quantities == tuple(terms)
        assert arena.elements("trunk") == ("trunk",)
        assert arena.elements("mass") == ("leg",)
