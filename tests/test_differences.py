"""`mja.differences`: a wrong number is found and named, and one that rounding explains is small."""

import functools
import operator

import jax
import mujoco
import numpy as np
import pytest
import worlds
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas import dr, furniture

ROUNDED = 400 * 2.0**-24


@pytest.fixture(scope="module")
def arena():
    return worlds.arena(1)


@pytest.fixture(scope="module")
def batch(arena):
    return arena.randomize(arena.put_model("jax"), mja.world_keys(0, range(4)), worlds.RANGES)


@pytest.fixture(scope="module")
def compiled(arena, batch):
    return {i: arena.compile(batch.world(i)) for i in (1, 3)}


@pytest.mark.slow
def test_worlds_are_those_compiled(batch, compiled):
    assert max(mja.differences(batch.model, compiled).values()) < ROUNDED


@pytest.mark.slow
def test_one_world(arena, batch, compiled):
    one = arena.apply(arena.put_model("jax"), batch.world(3))
    assert max(mja.differences(one, compiled[3]).values()) < ROUNDED


@pytest.mark.parametrize("field", ["body_mass", "geom_size", "body_inertia", "body_pos", "geom_friction", "qpos0"])
def test_wrong_number_is_named(batch, compiled, field):
    """By one part in a thousand, in one world."""
    value = np.array(getattr(batch.model, field))
    value[3].reshape(-1)[np.abs(value[3]).argmax()] *= 1.001
    off = mja.differences(batch.model.tree_replace({field: jax.numpy.asarray(value)}), compiled)
    assert next(iter(off)) == field
    assert off[field] == pytest.approx(0.001, rel=0.4)  # of a vector its norm


def test_other_world(batch, compiled):
    off = mja.differences(batch.model, {1: compiled[3]})
    assert off["geom_friction"] > 0.01
    assert list(off.values()) == sorted(off.values(), reverse=True)


def test_integers_and_zeros(arena):
    model, compiled = arena.put_model("jax"), arena.mj_model
    assert max(mja.differences(model, compiled).values(), default=0.0) < ROUNDED
    group = model.tree_replace({"geom_margin": model.geom_margin.at[0].set(1e-9)})
    assert mja.differences(group, compiled)["geom_margin"] == np.inf
    other = model.tree_replace({"geom_matid": model.geom_matid + 1})
    assert mja.differences(other, compiled)["geom_matid"] == np.inf


def test_what_worlds_share():
    """Kinds of geoms, contacts' dimensions, and options: part of a model's structure, not of its leaves."""
    xml = (
        '<mujoco><option {}/><worldbody><body><joint/><geom type="{}" size=".1 .1 .1" {}/></body></worldbody></mujoco>'
    )
    model = mjx.put_model(mujoco.MjModel.from_xml_string(xml.format("", "box", "")), impl="jax")
    for option, kind, own, name in (
        ("", "ellipsoid", "", "geom_type"),
        ("", "box", 'condim="4"', "geom_condim"),
        ("", "box", 'priority="1"', "geom_priority"),
        ('cone="elliptic"', "box", "", "opt.cone"),
        ('iterations="7"', "box", "", "opt.iterations"),
    ):
        other = mujoco.MjModel.from_xml_string(xml.format(option, kind, own))
        assert mja.differences(model, other).get(name) == np.inf, name


OTHERS = mja.ArenaRanges(
    table_active=mja.Fixed([True, False]),
    object_active=mja.Bernoulli(0.5),
    object_tables=mja.Fixed(0),
    table_rots=mja.Uniform(-0.2, 0.2),
    terms={"thing.variant": mja.Choice([0, 1]), "rack.pieces_active": mja.Bernoulli(0.5)},
)


@functools.cache
def coming_and_going(impl):
    """Worlds in which tables, objects, boards and variants are absent, and what MuJoCo compiles without them; some have no name."""
    variants = [mja.Object("block", full_size=0.06), mja.Object("ball", "sphere", 0.05)]
    arena = mja.MultiTableArena(
        [[0, 0, 0.8], [2, 0, 0.8]], objects=[mja.Object("thing", variants=variants), mja.Object("cube")]
    )
    arena.add_part(furniture.Shelf("rack", pos=(0, 2, 0)))
    arena.attach(
        '<mujoco><worldbody><body><geom size=".1"/><body><joint/><geom size=".05" pos="0 0 .2"/></body></body></worldbody></mujoco>',
        pos=(-2, 0, 1),
    )
    batch = arena.randomize(arena.put_model(impl), mja.world_keys(0, range(4)), OTHERS)
    return batch, {i: arena.compile(batch.world(i)) for i in range(4)}


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
@pytest.mark.parametrize("impl", ["jax", pytest.param("warp", marks=pytest.mark.slow)])
def test_what_is_there_is_compared_by_name(impl):
    batch, compiled = coming_and_going(impl)
    assert len({(twin.nbody, twin.ngeom) for twin in compiled.values()}) > 2
    assert max(mja.differences(batch.model, compiled).values()) < ROUNDED


@pytest.mark.slow
@pytest.mark.parametrize(
    ("field", "row", "noticed"),
    [
        ("geom_size", ("geom", "table0_collision"), True),
        ("geom_size", ("geom", "table1_collision"), False),
        ("body_pos", ("body", "rack"), True),
        ("body_pos", ("body", "table1"), False),
        ("dof_damping", ("dof", -1), True),  # of a body without a name
        ("geom_rgba", ("geom", -1), True),
        ("stat.extent", None, True),
    ],
)
def test_what_is_wrong_there_is_named(field, row, noticed):
    """One number of what is there in world 2; not of what is absent."""
    batch, compiled = coming_and_going("jax")
    value = np.array(operator.attrgetter(field)(batch.model))
    value = value if field in batch.fields else np.broadcast_to(value, (4, *value.shape)).copy()
    model = batch.record.mj_model
    at = () if row is None else (row[1] if isinstance(row[1], int) else getattr(model, row[0])(row[1]).id,)
    value[(2, *at)] += 0.01
    off = mja.differences(batch.model.tree_replace({field: jax.numpy.asarray(value)}), compiled)
    assert (next(iter(off)) == field) == noticed
    assert noticed or max(off.values()) < ROUNDED


@pytest.mark.parametrize(
    ("given", "error", "says"),
    [
        (lambda batch, compiled: (batch, compiled), TypeError, "`model` must be an mjx.Model, got ArenaBatch."),
        (
            lambda batch, compiled: (batch.model, [compiled[1]]),
            TypeError,
            "`compiled` must be a mujoco.MjModel, or a dict of them by the numbers of worlds, got list.",
        ),
        (
            lambda batch, compiled: (batch.model, compiled[1]),
            ValueError,
            "`compiled` must be a dict by the numbers of worlds: `model` has 4; got one model.",
        ),
        (
            lambda batch, compiled: (batch.model, {True: compiled[1]}),
            ValueError,
            "`compiled` must be by the numbers of worlds, got True.",
        ),
        (
            lambda batch, compiled: (batch.model, {4: compiled[1]}),
            ValueError,
            "`compiled`: world 4 is none of 4 worlds, 0 to 3.",
        ),
        (
            lambda batch, compiled: (batch.model, {0: mujoco.MjModel.from_xml_string("<mujoco/>")}),
            ValueError,
            "`compiled`: world 0 lacks geom 'floor', which is there in `model`.",
        ),
        (
            lambda batch, compiled: (
                batch.model,
                {0: mujoco.MjModel.from_xml_string('<mujoco><worldbody><body name="a"/></worldbody></mujoco>')},
            ),
            ValueError,
            "`compiled`: world 0 has body 'a', which `model` lacks: it is another arena's.",
        ),
        (
            lambda batch, compiled: (batch.model, {}),
            ValueError,
            "`compiled` must have a model at least, got an empty dict.",
        ),
        (
            lambda batch, compiled: (batch.model, compiled | {2: batch.params}),
            TypeError,
            "`compiled[2]` must be a mujoco.MjModel, got ArenaParams.",
        ),
    ],
)
def test_bad_input(batch, compiled, given, error, says):
    with pytest.raises(error) as raised:
        mja.differences(*given(batch, compiled))
    assert str(raised.value) == says


LIFTED = """<mujoco><worldbody><body name="b" pos="0 0 1" gravcomp="{}"><joint/><geom size=".1"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("names", [("warp", 0, 1), ("warp", 1, 0), ("jax", 1, 0)])
def test_compensated(names):
    """Whether any body has a `gravcomp` is no difference where the step reads the numbers themselves."""
    impl, model, world = names
    arena = mja.Arena.from_xml(LIFTED.format(model))
    arena.vary(lift=mja.dr.Term("body.gravcomp"))
    params = arena.nominal_params()._replace(terms={"lift": np.full(1, float(world))})
    off = mja.differences(arena.apply(arena.put_model(impl), params), arena.compile(params))
    assert max(off.values(), default=0.0) < ROUNDED


def test_compensated_without():
    """On JAX a model without any leaves it out of the step."""
    models = [mujoco.MjModel.from_xml_string(LIFTED.format(x)) for x in (0, 1)]
    off = mja.differences(mjx.put_model(models[0], impl="jax"), models[1])
    assert off == {"flg_gravcomp": np.inf, "body_gravcomp": 1.0}


BEHIND = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 .1"/><body name="goes" pos="3 0 1"><geom size=".1"/></body>
<body name="a" pos="0 0 1"><freejoint/><geom name="a" size=".1"/></body><body name="b" pos="1 0 1"><freejoint/><geom name="b" size=".1"/>
</body></worldbody><contact><pair name="p" geom1="a" geom2="b"/><exclude body1="a" body2="b"/></contact></mujoco>"""


@pytest.mark.parametrize("impl", ["jax", "warp"])
def test_shifted(impl):
    """Pairs and exclusions of what comes behind something absent have other numbers in the compiled world, and are the same."""
    arena = mja.Arena.from_xml(BEHIND)
    arena.vary(there=mja.dr.Term("body.active", "goes"))
    params = arena.nominal_params()._replace(terms={"there": np.zeros(1, bool)})
    assert (
        max(mja.differences(arena.apply(arena.put_model(impl), params), arena.compile(params)).values(), default=0.0)
        < ROUNDED
    )


@pytest.mark.parametrize("coef", [0.0, 1e-3])
def test_tendons_that_no_joint_makes_longer(coef):
    """What rounding leaves of their inverse weights is nothing; a joint that does a little is noticed."""
    xml = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint axis="0 1 0"/><geom size=".03" pos=".2 0 0"/>
    <body name="b" pos=".3 .1 0" euler="10 20 30"><joint name="j" axis="0 1 0"/><geom size=".03" pos=".2 0 0"/><site name="e" pos="{} 0 0"/>
    <body name="c" pos=".1 .02 .3" euler="30 20 10"><geom size=".01"/><site name="r" pos=".1 .03 .05"/></body></body></body>
    </worldbody><tendon><spatial name="t"><site site="e"/><site site="r"/></spatial>
    <fixed name="f"><joint joint="j" coef="{}"/></fixed></tendon></mujoco>"""
    for name in ("q0", "q1", "q2", "q3"):  # whose worlds in the proof, in double precision, are others
        turned = mja.Arena.from_xml(xml.format(0.1, coef))
        turned.vary(**{name: dr.Term("body.rpy", "b")})
        assert turned.mj_model.ntendon == 2
    arena = mja.Arena.from_xml(xml.format(0.1, coef))
    arena.vary(mass=dr.Term("geom.mass"), turn=dr.Term("body.rpy", "b"))
    params = jax.tree.map(np.asarray, arena.nominal_params())
    params = params._replace(
        terms={"mass": params.terms["mass"] * [0.7, 1.3, 2.0], "turn": np.array([[0.3, 0.2, 0.1]])}
    )
    model, compiled = arena.apply(arena.put_model("warp"), params), arena.compile(params)
    assert mja.differences(model, compiled).get("tendon_invweight0", 0.0) < 2e-5
    other = mujoco.MjModel.from_xml_string(xml.format(0.1, coef + 1e-5))
    assert mja.differences(arena.put_model("warp"), other)["tendon_invweight0"] > 3e-3
