"""Every world is the model that MuJoCo would have compiled for it."""

import functools
import operator

import jax
import mujoco
import numpy as np
import pytest
import worlds
from oracle import MAY_DIFFER, STRUCTURE_MAY_DIFFER, differing, from_compiled

import mjx_arenas as mja
from mjx_arenas.params.params import QUANTITIES, named

pytestmark = pytest.mark.slow_on("warp")


@functools.cache
def compared(n_tables, impl, n_worlds):
    """Names of the arrays that differ in any of so many random worlds; all frictions vary, far more than they may differ."""
    arena = worlds.arena(n_tables, table_condim=6)
    ranges = worlds.RANGES._replace(table_frictions=mja.LogUniform(0.001, 2.0))
    model = arena.put_model(impl)
    apply = jax.jit(lambda key: (params := arena.sample_params(key, ranges), arena.fields(model, params)))
    found = set()
    for key in jax.random.split(jax.random.key(n_tables), n_worlds):
        params, fields = apply(key)
        found |= from_compiled(model.tree_replace(fields), arena.compile(params))
    return found


@pytest.mark.parametrize("n_tables", [1, 4, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 8))])
def test_compile_oracle(n_tables, impl):
    """208 random worlds on each implementation: no leaf differs but those listed."""
    assert compared(n_tables, impl, 52) - STRUCTURE_MAY_DIFFER.keys() == MAY_DIFFER.keys()


def test_listed_structure_differs_somewhere(impl):
    """The list of structure holds nothing that does not differ."""
    assert "geom_sameframe" in compared(4, impl, 52) & STRUCTURE_MAY_DIFFER.keys()


@pytest.mark.parametrize("stale", ["geom_aabb", "geom_rbound", "site_pos", "body_quat", "geom_friction", "stat.extent"])
def test_oracle_notices(stale):
    """The oracle sees a writer that forgets a field."""
    arena = worlds.arena(2)
    model = arena.put_model("jax")
    params = arena.sample_params(jax.random.key(3), worlds.RANGES)
    fields = arena.fields(model, params)
    del fields[stale]
    assert stale in from_compiled(model.tree_replace(fields), arena.compile(params))


MORE = worlds.RANGES._replace(
    object_masses=mja.LogUniform(0.05, 2.0), object_frictions=mja.Uniform(0.1, 2.0), object_tables=mja.Choice([0, 1])
)
ALONE = sorted(set(QUANTITIES) - {"table_active", "object_active"})  # test_scenes has these


@functools.cache
def two_tables(impl):
    arena = worlds.arena(2)
    return arena, arena.put_model(impl)


@pytest.mark.filterwarnings("ignore:`ranges.object_frictions` has no effect on tables")
@pytest.mark.parametrize("quantity", ALONE)
def test_one_varying_quantity(quantity, impl):
    """A batch in which one quantity varies stores every leaf that follows from it."""
    arena, model = two_tables(impl)
    batch = arena.randomize(
        model, jax.random.split(jax.random.key(1), 4), mja.ArenaRanges(**{quantity: getattr(MORE, quantity)})
    )
    drawn = np.asarray(getattr(batch.params, quantity))
    assert (drawn != drawn[:1]).any()
    for i in range(4):
        one = model.tree_replace({name: np.asarray(operator.attrgetter(name)(batch.model))[i] for name in batch.fields})
        assert from_compiled(one, arena.compile(batch.world(i))) <= STRUCTURE_MAY_DIFFER.keys()


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_rope_between_two(impl):
    """A tendon of a given length at rest from one object to another, and to a table, whatever their sizes and places."""
    arena = mja.MultiTableArena(worlds.offsets(2), objects=[mja.Object("a"), mja.Object("b", on=1)])
    for body, pos in (("a", (0.02, 0, 0)), ("b", (0, 0.02, 0)), ("table1", (0.3, 0, 0))):
        arena.spec.body(body).add_site(name=f"at_{body}", pos=pos)
    for name, ends in {"one": ("at_a", "at_b"), "two": ("at_b", "at_table1")}.items():
        rope = arena.spec.add_tendon(name=name, stiffness=[50, 0, 0], springlength=[0, 0.3])
        for end in ends:
            rope.wrap_site(end)
    model = arena.put_model(impl)
    for ranges in (worlds.RANGES, mja.ArenaRanges(table_rots=mja.Uniform(-3, 3))):
        batch = arena.randomize(model, mja.world_keys(2, range(4)), ranges)
        for i in range(4):
            one = model.tree_replace(
                {name: np.asarray(operator.attrgetter(name)(batch.model))[i] for name in batch.fields}
            )
            compiled = arena.compile(batch.world(i))
            assert from_compiled(one, compiled) <= STRUCTURE_MAY_DIFFER.keys()
            assert abs(compiled.tendon_length0 - np.asarray(model.tendon_length0)).max() > 1e-3


def test_options_of_the_compiled_model():
    """What a user sets on `mj_model.opt`, as Playground's environments do, holds in MJX and in compiled worlds alike."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    option = arena.mj_model.opt
    option.timestep, option.gravity[:], option.disableflags = 0.01, (0, 0, -1), mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    compiled = arena.compile(arena.nominal_params())
    assert from_compiled(arena.put_model("jax"), compiled) <= STRUCTURE_MAY_DIFFER.keys()
    assert compiled.opt.timestep == 0.01
    assert mujoco.MjModel.from_xml_string(arena.xml).opt.timestep == 0.01


def test_sleeping_is_refused(impl):
    """Bodies would fall asleep by the template's `dof_length`, which worlds share; it follows from the objects' sizes."""
    sleep = mujoco.mjtEnableBit.mjENBL_SLEEP
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.spec.option.enableflags = sleep
    nominal = arena.nominal_params()
    larger = arena.compile(nominal._replace(object_full_sizes=2 * nominal.object_full_sizes))
    assert (larger.dof_length > arena.mj_model.dof_length).any()
    message = (
        "`arena.mj_model.opt.enableflags`: bodies can sleep in compiled worlds alone, not in many at once: clear the bit "
        "mjENBL_SLEEP, or leave `sleep` out of the MJCF's <flag>."
    )
    with pytest.raises(ValueError, match="sleep") as error:
        arena.put_model(impl)
    assert str(error.value) == message
    arena.mj_model.opt.enableflags = 0
    assert arena.put_model(impl).opt.enableflags == 0
    arena.mj_model.opt.enableflags |= sleep  # as it can be set after the arena is compiled, too
    with pytest.raises(ValueError, match="sleep"):
        arena.put_model(impl)
    with pytest.raises(ValueError, match="sleep") as error:
        arena.c_batch(jax.tree.map(lambda x: x[None], nominal))
    assert str(error.value) == message


def test_legs_at_the_edge_of_having_an_inset():
    """A side of 0.4 m is the same in both precisions."""
    arena = mja.MultiTableArena([[0, 0, 0.8]], table_full_sizes=(0.4, 0.8, 0.05), objects=[mja.Object("cube")])
    expected = arena.compile(arena.nominal_params())
    assert expected.geom("table0_leg0_visual").pos[0] == 0
    got = arena.apply(arena.put_model("jax"), arena.nominal_params())
    assert from_compiled(got, expected) <= STRUCTURE_MAY_DIFFER.keys()


def test_what_depends_on_two_tables():
    """A camera on one table that follows another stands where both say."""
    arena = worlds.arena(2, xml="<mujoco/>")
    mode = mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY
    arena.spec.body("table0").add_camera(name="c", pos=(0, 0, 0.5), mode=mode, targetbody="table1")
    arena.spec.body("table0").add_light(name="l", pos=(0, 0, 0.5), mode=mode, targetbody="table1")
    model = arena.put_model("jax")
    batch = arena.randomize(model, mja.world_keys(1, range(3)), worlds.TABLES)
    for i in range(3):
        one = model.tree_replace({name: np.asarray(operator.attrgetter(name)(batch.model))[i] for name in batch.fields})
        assert from_compiled(one, arena.compile(batch.world(i))) <= STRUCTURE_MAY_DIFFER.keys()


@pytest.mark.slow
def test_nominal_changes_nothing(impl):
    """The nominal parameters give the nominal model."""
    for arena in (worlds.arena(3), worlds.arena(2, has_legs=[True, False]), mja.TableArena(objects=worlds.OBJECTS)):
        model = arena.put_model(impl)
        again = arena.apply(model, arena.nominal_params())
        assert differing(arena.mj_model, worlds.leaves(again), worlds.leaves(model)) == set()


def test_user_additions(impl):
    """Cameras and lights on tables, pinned statistics, a base MJCF with bodies and defaults of its own."""
    xml = """<mujoco><statistic meansize="0.3"/><default><geom friction="0.7 0.1 0.1" condim="4"/></default>
      <worldbody><geom name="ground" type="plane" size="0 0 .1"/><light pos="0 0 3"/>
        <body name="post" pos="1 1 0"><geom type="capsule" size=".05 .4" pos="0 0 .4"/>
          <body name="arm" pos="0 0 .9"><joint name="hinge"/><geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/></body></body>
      </worldbody></mujoco>"""
    arena = worlds.arena(2, xml=xml)
    body = arena.spec.body("table1")
    body.add_camera(name="on_table", pos=(0.1, 0, 0.5), quat=(0.9, 0.1, 0.3, 0))
    body.add_light(name="lamp", pos=(0, 0.1, 0.5), dir=(0, 0.1, -1))
    body.add_site(name="mark", pos=(0.1, 0.2, 1.2))
    body.add_body(name="shelf", pos=(0, 0, 0.4), quat=(0.9, 0, 0, 0.2)).add_geom(
        type=6, size=(0.1, 0.1, 0.01), pos=(0, 0.1, 0)
    )
    arena.spec.body("cube1").add_camera(name="on_cube", pos=(0, 0, 0.3))
    model = arena.put_model(impl)
    for key in jax.random.split(jax.random.key(5), 4):
        params = arena.sample_params(key, worlds.RANGES)
        assert from_compiled(arena.apply(model, params), arena.compile(params)) <= STRUCTURE_MAY_DIFFER.keys()


def test_xml_is_the_same_world():
    """The MJCF of a world compiles to the model of that world, to rounding in double precision."""
    arena = worlds.arena(3)
    params = arena.sample_params(jax.random.key(11), worlds.RANGES)
    from_xml, compiled = mujoco.MjModel.from_xml_string(arena.to_xml(params)), arena.compile(params)
    names = [n for n in dir(compiled) if not n.startswith("_") and isinstance(getattr(compiled, n), np.ndarray)]
    assert len(names) > 300
    for name in names:
        a, b = getattr(from_xml, name), getattr(compiled, name)
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12 * max(1e-3, np.abs(b).max(initial=0)), err_msg=name)


@pytest.mark.slow
def test_batch_bytes():
    """What a world adds to the model, for the three tables with legs and three boxes of the measured prototype."""
    arena = mja.MultiTableArena(worlds.offsets(3), objects=[mja.Object(f"box{i}", on=i) for i in range(3)])
    keys = jax.random.split(jax.random.key(0), 2)
    batch = arena.randomize(arena.put_model("jax"), keys, worlds.TABLES._replace(has_legs=None))
    bytes_of = {name: np.asarray(operator.attrgetter(name)(batch.model))[0].nbytes for name in batch.fields}
    print("bytes a world:", batch.nbytes, bytes_of)
    assert batch.nbytes == sum(bytes_of.values()) <= 1900
    assert arena.randomize(arena.put_model("jax"), keys, worlds.TABLES).nbytes <= 2260


BASES = {
    "defaults that would hide, lift, turn and weigh": """<mujoco><default><geom contype="0" conaffinity="0" pos="0 0 .3"
        euler="0 0 45" mass="3" margin=".02" friction=".1 .1 .1" solref=".1 1" priority="4" group="3"/>
        <joint damping="5" armature="1"/><site pos="1 1 1" euler="0 90 0"/></default></mujoco>""",
    "degrees, aligned free joints, a table turned by euler": """<mujoco><compiler angle="degree" alignfree="true" eulerseq="zyx"/>
        <worldbody><body name="table1" euler="90 0 0" pos="1 2 3"><geom name="table1_visual" type="capsule"
        fromto="0 0 0 0 0 1" size=".1" contype="1"/><geom type="sphere" size=".1" mass="2" pos="0 0 .2"/></body></worldbody></mujoco>""",
    "a robot of hinges on the floor, inertia from geoms": """<mujoco><compiler inertiafromgeom="true"/>
        <worldbody><body name="b" pos="3 3 1"><joint axis="0 1 0"/><geom size=".1" contype="0" conaffinity="0"/>
        <site name="s" pos="0 0 .1"/></body></worldbody><actuator><motor joint="b_j" name="m" gear="3"/></actuator></mujoco>""".replace(
        "<joint axis", '<joint name="b_j" axis'
    ),
    "cameras and lights that aim at a table": """<mujoco><worldbody><camera name="c" pos="2 0 2" mode="targetbody" target="table0"/>
        <light pos="0 0 4" mode="targetbody" target="table1"/><body name="arm" pos="-2 0 1"><joint/><geom size=".1"/></body>
        </worldbody></mujoco>""",
}


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("objects", [worlds.OBJECTS, pytest.param((), marks=pytest.mark.slow)], ids=["objects", "none"])
def test_base_mjcf(base, objects):
    """Whatever the base MJCF says, tables and objects are the same, and their worlds are exact."""
    arena = worlds.arena(2, objects=objects, xml=BASES[base])
    model = arena.put_model("jax")
    for key in jax.random.split(jax.random.key(5), 3):
        params = arena.sample_params(key, worlds.RANGES if objects else worlds.TABLES)
        assert from_compiled(arena.apply(model, params), arena.compile(params)) <= STRUCTURE_MAY_DIFFER.keys()

    plain, ours = worlds.arena(2, objects=objects).mj_model, arena.mj_model
    for g in range(plain.ngeom):
        if plain.geom(g).name.startswith(("table", "cube", "ball", "rod")):
            a, b = plain.geom(g), ours.geom(plain.geom(g).name)
            for name in (
                "pos",
                "quat",
                "size",
                "type",
                "contype",
                "conaffinity",
                "condim",
                "friction",
                "priority",
                "margin",
                "solref",
                "group",
            ):
                np.testing.assert_allclose(getattr(b, name), getattr(a, name), atol=1e-12, err_msg=f"{a.name} {name}")
    for obj in arena.objects if "inertia" not in base else ():
        np.testing.assert_allclose(ours.body(obj.name).mass, plain.body(obj.name).mass)


def test_edits_of_what_parameters_decide_are_refused():
    """An edit through the element references would be undone by the first `apply`."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.table_collision.friction = (0.2, 0.005, 0.0001)
    with pytest.raises(ValueError, match=r"^`arena\.spec`: geom_friction of a table or object was edited"):
        arena.put_model("jax")


def test_parameters_of_any_kind(impl):
    """Integers, lists and NumPy's doubles are the same world."""
    arena = mja.TableArena(objects=worlds.OBJECTS)
    model = arena.put_model(impl)
    exact = arena.nominal_params()._replace(
        table_offsets=[[0.0, 0.0, 2.0]],
        table_rots=[0.0],
        table_full_sizes=[[1.0, 2.0, 1.0]],
        table_frictions=[[1.0, 0.0, 0.0]],
        object_masses=[1.0, 2.0, 3.0],
        object_rgba=[[1.0, 0.0, 0.0, 1.0]] * 3,
    )
    expected = worlds.leaves(arena.apply(model, exact))
    kinds = (np.array, lambda x: np.array(x, int), lambda x: np.array(x, np.float64))
    given = [name for name, value in named(exact).items() if isinstance(value, list)]
    for kind in kinds:
        params = exact._replace(**{name: kind(getattr(exact, name)) for name in given})
        for name, value in worlds.leaves(arena.apply(model, params)).items():
            np.testing.assert_array_equal(value, expected[name], err_msg=name)
        np.testing.assert_allclose(arena.rest_heights(params), [2.025, 2.03, 2.02], atol=1e-6)
        np.testing.assert_allclose(arena.place(params, jax.random.key(0)).qpos[:, 2], [2.025, 2.03, 2.02], atol=1e-6)
        assert arena.valid(params)
