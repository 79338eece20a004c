"""Wrong ranges: which distribution, of which table or object, by which rule; and ranges that vary something in vain."""

import re
import warnings

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from idle import Idle
from refused import DATA, OFFSETS, arena, open_arena, told

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.rules.validation_ranges import absence_problems, ranges_problems


def keys_of(ranges, arena):
    """(path below `ranges`, index, rule) of each problem."""
    problems = ranges_problems(ranges, arena.drawing, arena.record.labels)
    return [(path.removeprefix("ranges."), index, rule) for path, index, rule in (p.key for p in problems)]


def found(given, arena):
    return keys_of(mja.ArenaRanges(**given), arena)


U = mja.Uniform
RANGES = [
    ({"table_rots": (0, 1)}, "table_rots", None, "distribution"),
    ({"has_legs": U(0, 1)}, "has_legs", None, "boolean"),
    ({"table_active": U(0, 1)}, "table_active", None, "boolean"),
    ({"has_legs": mja.Fixed(1, relative="add")}, "has_legs", None, "boolean_relative"),
    ({"table_rots": mja.Bernoulli(0.5)}, "table_rots", None, "not_boolean"),
    ({"table_rots": mja.Count(1, 2)}, "table_rots", None, "not_boolean"),
    ({"table_offsets": U(0, 1, tied=(True, False))}, "table_offsets.tied", None, "tied"),
    ({"table_offsets": U(0, 1, tied=([True], [True, False]))}, "table_offsets.tied", None, "tied"),
    ({"table_offsets": U(0, 1, tied="all")}, "table_offsets.tied", None, "tied"),
    ({"table_rots": U(0, 1, tied="axes")}, "table_rots.tied", None, "tied"),
    ({"table_full_sizes": mja.Choice([0.5], tied="axes")}, "table_full_sizes.tied", None, "tied"),
    ({"table_rots": U(None, 1)}, "table_rots.low", None, "numbers"),
    ({"has_legs": mja.Fixed(None)}, "has_legs.at", None, "numbers"),
    ({"object_tables": mja.Choice(None)}, "object_tables.values", None, "numbers"),
    ({"table_rots": U(1, -1)}, "table_rots.low", None, "ordered"),
    ({"table_active": mja.Count(2, 1)}, "table_active.low", None, "ordered"),
    ({"table_rots": U(0, np.nan)}, "table_rots.high", None, "finite"),
    ({"table_rots": U([0.1, 0.2], 0.4)}, "table_rots.low", None, "broadcast"),
    ({"table_rots": mja.Choice([0.1, 0.2], p=[[1, 0]])}, "table_rots.p", None, "broadcast"),
    ({"table_full_sizes": U([[1, 2], [3]], 2)}, "table_full_sizes.low", None, "numbers"),
    ({"table_frictions": mja.LogUniform(0, 1)}, "table_frictions.low", None, "positive"),
    ({"table_rots": mja.Normal(0, -1, -1, 1)}, "table_rots.std", None, "at_least_0"),
    ({"has_legs": mja.Bernoulli(1.5)}, "has_legs.p", None, "share"),
    ({"has_legs": mja.Fixed("yes")}, "has_legs.at", None, "truth"),
    ({"has_legs": mja.Choice([0, 2])}, "has_legs.values", None, "truth"),
    ({"has_legs": mja.Fixed(2)}, "has_legs.at", None, "truth"),
    ({"table_rots": mja.Choice([0.1, 0.2], p=[0.5, 0.6])}, "table_rots.p", None, "probabilities"),
    ({"table_rots": mja.Choice([])}, "table_rots.values", None, "empty"),
    ({"table_rots": mja.Choice(0.5)}, "table_rots.values", None, "values"),
    ({"object_active": mja.Count(0, 0.5)}, "object_active.low", None, "counts"),
    ({"object_active": mja.Count(1, 2, first="yes")}, "object_active.first", None, "truth"),
    ({"object_active": mja.Count(1, 5)}, "object_active.high", None, "count_high"),
    ({"table_full_sizes": U([0.3, 0.3, -0.01], [0.5, 0.5, 0.1])}, "table_full_sizes", "all", "reach_allowed"),
    ({"table_full_sizes": U(-0.1, 0, relative="add")}, "table_full_sizes", "all", "reach_allowed"),
    ({"table_frictions": mja.Normal(0.5, 0.1, -0.1, 1)}, "table_frictions", "all", "reach_allowed"),
    ({"table_rots": U(0, [0, 1e9, 0])}, "table_rots", 1, "reach_limits"),
    ({"table_offsets": U([0, 0, -0.79], 0, relative="add")}, "ranges", "all", "reach_legs"),
    ({"table_full_sizes": U(0.1, 2.0)}, "ranges", "all", "reach_legs"),
    ({"table_active": mja.Fixed(False)}, "table_active", None, "reach_no_table"),
    ({"object_masses": U(-0.1, 0.1)}, "object_masses", "cube", "reach_allowed"),
    ({"object_densities": U(0, 200)}, "object_densities", "cube", "reach_allowed"),
    ({"object_densities": U(1, 1e300)}, "object_densities", "cube", "reach_limits"),
    ({"object_rgba": U(0, 255)}, "object_rgba", "cube", "reach_allowed"),
    ({"object_full_sizes": U(-0.1, 0.1, relative="add")}, "object_full_sizes", "cube", "reach_allowed"),
    ({"object_masses": U(0.1, 0.2), "object_densities": U(1, 2)}, "ranges", None, "either"),
    ({"object_tables": mja.Choice([0, 3])}, "object_tables", None, "reach_table"),
    ({"object_tables": U(0, 2)}, "object_tables", None, "indices"),
    ({"object_tables": mja.Fixed(1, relative="add")}, "object_tables", None, "indices"),
    ({"object_tables": mja.Choice([0.7, 1])}, "object_tables.values", None, "whole_numbers"),
    ({"object_tables": mja.Fixed(0.5)}, "object_tables.at", None, "whole_numbers"),
    ({"object_tables": mja.Choice([0, 1, 2], p=[0.5, 0.5])}, "object_tables.p", None, "probabilities"),
    ({"workspace": ([-1, -1], [1, 1])}, "workspace", None, "workspace"),
    ({"workspace": mja.Workspace([1, 1], [-1, -1])}, "workspace.low", None, "corners"),
    ({"workspace": mja.Workspace([-1, -1], [1, 1], gap=-0.1)}, "workspace.gap", None, "workspace_gap"),
    ({"workspace": mja.Workspace((0, 0), (1, 1e30))}, "workspace.high", None, "limits"),
]


@pytest.mark.parametrize(("given", "path", "index", "rule"), RANGES)
def test_ranges(given, path, index, rule):
    assert found(given, arena()) == [(path, index, rule)]


@pytest.mark.parametrize("wrong", [U(0, 1), None, 5, ["x"], "x"])
def test_terms_without_names(wrong):
    """One sentence, whatever stands there: a distribution alone was told in Python's words."""
    said = f"^`ranges.terms` must be a dictionary of distributions by the names of quantities, got {re.escape(repr(wrong))}\\.$"
    ranges = mja.ArenaRanges(terms=wrong)
    for check in (arena().check_ranges, lambda r: arena().valid(arena().nominal_params(), r)):
        with pytest.raises(ValueError, match=said):
            check(ranges)


@pytest.mark.parametrize("wrong", ["plus", True, ["add"], np.array(["add", "add"])])
def test_relative_is_refused_at_once(wrong):
    """Where the distribution is made; transformations make others of what was right, with whatever leaves."""
    with pytest.raises(ValueError, match=r"^`relative` of LogUniform must be 'add' or 'scale', or left out, got "):
        mja.LogUniform(0.8, 1.2, relative=wrong)
    leaves, kind = jax.tree.flatten(mja.LogUniform(0.8, 1.2, relative="scale"))
    assert len(leaves) == 2
    assert jax.tree.unflatten(kind, [object()] * 2).relative == "scale"


def test_ranges_of_tables_without_any():
    scene = mja.Arena.from_xml('<mujoco><worldbody><body><joint/><geom size=".1"/></body></worldbody></mujoco>')
    assert found({"table_rots": U(0, 1)}, scene) == [("table_rots", None, "no_tables")]


def test_several_numbers():
    """Each number of a distribution, and each of several distributions; what is right beside them is not said."""
    assert found(
        {"table_full_sizes": U([0.1, 0.2], [0.3, 0.4]), "table_rots": U("a", "b"), "has_legs": U(0, 1)}, arena()
    ) == [
        ("table_rots.low", None, "are_numbers"),
        ("table_rots.high", None, "are_numbers"),
        ("table_full_sizes.low", None, "broadcast"),
        ("table_full_sizes.high", None, "broadcast"),
        ("has_legs", None, "boolean"),
    ]
    assert found({"object_active": mja.Count(1, 5), "table_rots": U(1, 0)}, arena()) == [
        ("table_rots.low", None, "ordered"),
        ("object_active.high", None, "count_high"),
    ]


@pytest.mark.parametrize(
    ("dist", "said"),
    [
        (
            mja.Choice(["table2", "desk", "table0"]),
            "(Choice): `values` must be {}, which are 0 for 'table0', 2 for 'table2'",
        ),
        (mja.Fixed("table1"), "(Fixed): `at` must be {}, which are 1 for 'table1'"),
        (
            mja.Choice(["desk"]),
            "(Choice): `values` must be {}, which are 0 for 'table0', 1 for 'table1', 2 for 'table2'",
        ),
    ],
)
def test_names_of_surfaces(dist, said):
    """Files have names, arrays have indices: the sentence says which those of the names are, or else those that there are."""
    got = dist.at if isinstance(dist, mja.Fixed) else dist.values.tolist()
    with pytest.raises(ValueError, match="object_tables") as raised:
        arena().check_ranges(mja.ArenaRanges(object_tables=dist))
    assert str(raised.value) == f"`ranges.object_tables` {said.format('indices of `arena.surfaces`')}, got {got!r}."


def test_values_beside_shapes():
    """What is wrong with numbers is said beside what is wrong with shapes: of one distribution, and of several."""
    assert found(
        {
            "table_full_sizes": U([0.3, -0.2], 0.4),
            "table_frictions": U(-1, 1),
            "table_rots": U(1, 0, tied="x"),
            "object_frictions": mja.LogUniform([1, -2], 3),
            "object_full_sizes": (1, 2),
            "workspace": mja.Workspace([1, 1], [0, 0], gap=-1),
        },
        arena(),
    ) == [
        ("table_rots.tied", None, "tied"),
        ("table_rots.low", None, "ordered"),
        ("table_full_sizes.low", None, "broadcast"),
        ("table_full_sizes", None, "reach_allowed"),
        ("object_full_sizes", None, "distribution"),
        ("object_frictions.low", None, "broadcast"),
        ("object_frictions.low", None, "positive"),
        ("workspace.low", None, "corners"),
        ("workspace.gap", None, "workspace_gap"),
        ("table_frictions", "all", "reach_allowed"),
    ]
    assert found({"table_rots": U([0, 1], [2, 3, 4, 5])}, arena()) == [
        ("table_rots.low", None, "broadcast"),
        ("table_rots.high", None, "broadcast"),
    ]
    robot = open_arena()
    robot.attach('<mujoco><worldbody><body><joint/><geom size=".1" pos="0 0 .2"/></body></worldbody></mujoco>', on=1)
    both = mja.ArenaRanges(table_active=mja.Bernoulli(0.5), table_rots=U(1, 0))
    assert told(lambda: robot.check_ranges(both)) == [
        ("ranges.table_rots.low", None, "ordered"),
        ("ranges.table_active", 1, "can_be_absent"),
    ]


def test_ranges_of_other_arenas():
    """Without objects, and with a capsule."""
    plain = mja.TableArena()
    assert found({"object_masses": U(0.1, 0.2)}, plain) == [("object_masses", None, "no_objects")]
    rod = mja.TableArena(objects=[mja.Object("rod", "capsule", (0.12, 0.04, 0.04))])
    assert found({"object_full_sizes": U(0.02, 0.1)}, rod) == [("object_full_sizes", "rod", "reach_capsule")]
    assert found({"object_full_sizes": U(0.8, 1.2, relative="scale", tied="axes")}, rod) == []


@pytest.mark.filterwarnings("ignore:Object 'grain'. `mass` is")
def test_density_that_nobody_gave():
    """Of an object with a mass it decides nothing: only a range that scales it is refused for it."""
    dense = mja.TableArena(objects=[mja.Object("grain", full_size=1e-4, mass=0.5)])
    assert found({}, dense) == found({"object_masses": U(0.1, 0.2)}, dense) == []
    scaled = {"object_densities": U(0.5, 2, relative="scale")}
    assert set(found(scaled, dense)) == {("object_densities", "grain", "reach_limits")}


def test_ranges_of_legs_that_are_never_there():
    """Such tables may be as low as they like; with legs in one world of a thousand they may not."""
    low = U([0, 0, -0.79], 0, relative="add")
    assert found({"table_offsets": low, "has_legs": mja.Fixed(False)}, arena()) == []
    assert found({"table_offsets": low, "has_legs": mja.Bernoulli(0.001)}, arena()) == [("ranges", "all", "reach_legs")]


def absent(ranges, held):
    one = arena()
    return [p.key for p in absence_problems(ranges, one.drawing, held, one.record.labels)]


def test_what_can_be_absent():
    """A table that carries something, and an object on any table that can be absent."""
    table, cube = {1: "it must stay"}, {3: "it must stay"}
    some = mja.Bernoulli([1, 0.5, 1])
    assert absent(mja.ArenaRanges(table_active=some), table) == [("ranges.table_active", 1, "can_be_absent")]
    assert absent(mja.ArenaRanges(table_active=mja.Bernoulli([0.5, 1, 1])), table) == []
    assert absent(mja.ArenaRanges(table_active=mja.Count(2, 3)), table)
    assert absent(mja.ArenaRanges(table_active=mja.Count(2, 3, first=True)), table) == []
    assert absent(mja.ArenaRanges(table_active=mja.Count(1, 3, first=True)), table)
    assert absent(mja.ArenaRanges(object_active=mja.Bernoulli(0.5)), cube) == [("ranges", "cube", "can_be_absent")]
    anywhere = mja.ArenaRanges(table_active=some, object_tables=mja.Choice([0, 1]))
    assert absent(anywhere, cube) == [("ranges", "cube", "can_be_absent")]
    assert absent(mja.ArenaRanges(table_active=some), cube) == []
    sure = {"object_tables": mja.Choice([0, 1]), "object_active": mja.Bernoulli(1.0), "table_active": mja.Fixed(True)}
    assert absent(mja.ArenaRanges(**sure), cube | table) == []


def tied():
    """Two boxes welded to each other."""
    one = mja.MultiTableArena(OFFSETS, objects=[mja.Object("a", pos=(0, 0)), mja.Object("b", pos=(0.2, 0))])
    body = mujoco.mjtObj.mjOBJ_BODY
    weld = one.spec.add_equality(name="w", type=mujoco.mjtEq.mjEQ_WELD, objtype=body, name1="a", name2="b")
    weld.data = np.eye(len(weld.data))[[6, 10]].sum(0)
    return one


def test_what_holds_tables_and_objects():
    """A robot, what moves on a table of a scene, and an equality, wherever ranges are taken."""
    half, key = mja.ArenaRanges(table_active=mja.Bernoulli(0.5)), jax.random.key(0)
    robot = open_arena()
    robot.attach('<mujoco><worldbody><body><joint/><geom size=".1" pos="0 0 .2"/></body></worldbody></mujoco>', on=1)
    assert told(lambda: robot.sample_params(key, half)) == [("ranges.table_active", 1, "can_be_absent")]
    xml = """<mujoco><worldbody><body name="desk"><geom name="top" type="box" size=".5 .5 .1"/>
      <body name="drawer" pos="0 0 -.3"><joint type="slide"/><geom size=".1"/></body></body></worldbody></mujoco>"""
    scene = mja.Arena.from_xml(xml, ["desk"])
    assert told(lambda: scene.sample_params(key, half)) == [("ranges.table_active", 0, "can_be_absent")]
    one, both = tied(), [("ranges", "a", "can_be_absent"), ("ranges", "b", "can_be_absent")]
    loose = mja.ArenaRanges(object_active=mja.Bernoulli(0.5))
    assert told(lambda: mja.check(one, loose, 1, engine="c")) == both
    assert told(lambda: Idle(tied(), loose)) == both
    assert told(lambda: one.randomize(one.put_model("jax"), mja.world_keys(0, [0]), loose)) == both


def test_two_ties_of_one_name():
    """An equality and a tendon may have one, and none."""
    one = tied()
    rope = one.spec.add_tendon(name="w")
    for name in ("here", "there"):
        one.spec.body("table0").add_site(name=name)
        rope.wrap_site(name)
    assert one.layout.held() == {3: "equality 'w'", 4: "equality 'w'"}
    two = tied()
    two.spec.equalities[0].name = ""
    assert two.layout.held() == dict.fromkeys((3, 4), "equality 0 (weld of body 'a' and body 'b')")


def warned(arena, **given):
    """Rules of the warnings that ranges get."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        arena.check_ranges(mja.ArenaRanges(**given))
    return [(p.path.removeprefix("ranges."), p.rule) for w in caught for p in w.message.__dict__["problems"]]


def test_what_varies_in_vain():
    one, xml = (
        arena(),
        '<mujoco><worldbody><body name="desk" pos="0 0 .7"><geom type="box" size=".5 .5 .1"/></body></worldbody></mujoco>',
    )
    slow, scene = mja.TableArena(table_condim=4), mja.Arena.from_xml(xml, ["desk"])
    spun = [0.3, 0.005, 0.0001], [0.3, 0.01, 0.0001]
    rolled = [0.3, 0.005, 0.0001], [0.3, 0.005, 0.001]
    even = mja.TableArena(objects=[mja.Object("cube", friction=(1.5, 0.005, 1e-4))], table_priority=0)
    rolls = mja.TableArena(objects=[mja.Object("cube", friction=(1.5, 0.005, 1e-4), condim=4)], table_priority=0)

    def grippier(ends):
        return [[1.5, *end[1:]] for end in ends]

    def pads(axes):
        found = mja.Arena.from_xml(
            '<mujoco><worldbody><geom size="1 1 1" type="plane"/>'
            '<body pos="0 0 1"><joint/><geom name="pad" size=".1"/></body></worldbody></mujoco>'
        )
        found.vary(pad=mja.dr.Term("geom.friction", "pad", axes=axes))
        return found

    wedge = mja.TableArena(objects=[mja.Object("wedge", "mesh", 0.1, file=DATA / "wedge.obj")])
    for of, given, expected in (
        (one, {"table_frictions": U(0.1, 0.2)}, [("table_frictions", "idle_friction")]),
        (one, {"table_frictions": U(*spun)}, [("table_frictions", "idle_friction")]),
        (one, {"table_frictions": U([0.1, 0.005, 0.0001], [0.2, 0.005, 0.0001])}, []),
        (slow, {"table_frictions": U(*spun)}, []),
        (slow, {"table_frictions": U(*rolled)}, [("table_frictions", "idle_rolling")]),
        (mja.TableArena(table_condim=6), {"table_frictions": U(*rolled)}, []),
        (one, {"table_rots": U(-30, 10)}, [("table_rots", "degrees")]),
        (one, {"table_rots": U(-6, 6)}, []),
        (one, {"table_rots": U(0.5, 1.5, relative="scale")}, [("table_rots", "idle_scale")]),
        (one, {"object_frictions": U(0.1, 0.2)}, [("object_frictions", "idle_objects")]),
        (mja.TableArena(objects=[mja.Object("cube")], table_priority=0), {"object_frictions": U(1.1, 1.2)}, []),
        (even, {"object_frictions": U(*grippier(spun))}, [("object_frictions", "idle_spin")]),
        (even, {"object_frictions": U([1.4, 0.005, 1e-4], [1.6, 0.005, 1e-4])}, []),
        (rolls, {"object_frictions": U(*grippier(spun))}, []),
        (even, {"object_frictions": mja.Choice([1.4, 1.5, 1.6])}, []),
        (even, {"object_frictions": mja.Choice(grippier([*spun, *rolled]))}, [("object_frictions", "idle_spin")]),
        (rolls, {"object_frictions": U(*grippier(rolled))}, [("object_frictions", "idle_spin")]),
        (pads("torsional"), {"terms": {"pad": U(0.1, 0.2)}}, [("terms.pad", "idle_spin")]),
        (pads("sliding"), {"terms": {"pad": U(1.1, 1.2)}}, []),
        (pads(None), {"terms": {"pad": U(1.1, 1.2)}}, []),
        (wedge, {"object_full_sizes": U(0.5, 1, relative="scale")}, [("object_full_sizes", "idle_sizes")]),
        (scene, {"has_legs": mja.Bernoulli(0.5)}, [("has_legs", "idle_legs")]),
        (mja.TableArena(has_legs=False), {"has_legs": mja.Bernoulli(0.5)}, []),
    ):
        assert warned(of, **given) == expected


def test_yaws_in_degrees():
    """Of tables and of objects, by name."""
    with pytest.warns(UserWarning, match="more than a turn") as caught:
        mja.MultiTableArena(
            [[0, 0, 0.8]], 45, objects=[mja.Object("mug", rot=90), mja.Object("cup", rot=-6, pos=(0.2, 0.2))]
        )
    more = "more than a turn: angles are in radians (90 degrees are 1.571)."
    assert [str(w.message) for w in caught] == [
        f"`table_rots` has angles of up to 45 rad, {more}",
        f"Object 'mug': `rot` has angles of up to 90 rad, {more}",
    ]


def test_legs_under_the_tables_of_a_scene():
    """As the warning says: they are drawn, and touch nothing."""
    xml = """<mujoco><worldbody><body name="desk" pos="0 0 .7"><geom type="box" size=".5 .5 .1"/></body></worldbody></mujoco>"""
    scene = mja.Arena.from_xml(xml, ["desk"])
    model = scene.compile(scene.nominal_params()._replace(has_legs=np.array([True])))
    legs = [model.geom(f"desk_leg{i}_visual") for i in range(4)]
    assert all(leg.rgba[3] == 1 and leg.size[1] > 0.3 and leg.contype == leg.conaffinity == 0 for leg in legs)


def test_ranges_are_equal_by_value():
    """Where all their numbers are, whatever holds them."""

    def ranges(high):
        return mja.ArenaRanges(
            table_offsets=U([0, 0, 0.0], [0, 0, high], relative="add"),
            table_active=mja.Bernoulli(0.5),
            workspace=mja.Workspace(np.zeros(2), [1.0, high]),
        )

    assert ranges(0.1) == ranges(0.1)
    assert ranges(0.1) != ranges(0.2)
    assert U(0, 1) != mja.LogUniform(0, 1)
    assert U(0, 1) != U(0, 1, tied=True)
    assert len({ranges(0.1), ranges(0.1)}) == 1


def test_arrays_of_distributions_stay():
    """A range is checked once."""
    low = np.zeros(3)
    ranges = mja.ArenaRanges(table_rots=U(low, np.ones(3)))
    low[...] = 5
    assert (ranges.table_rots.low == 0).all()
    with pytest.raises(ValueError, match="read-only"):
        ranges.table_rots.low[...] = 5


def test_choice_of_numbers_serves_all_axes():
    """A choice of numbers for a quantity with axes gives each table one for all of them."""
    ranges = mja.ArenaRanges(table_full_sizes=mja.Choice([0.1, 0.2]))
    sizes = np.stack([arena().sample_params(key, ranges).table_full_sizes for key in mja.world_keys(0, range(4))])
    assert np.isin(sizes, np.float32([0.1, 0.2])).all()
    assert (sizes == sizes[..., :1]).all()
    assert len(np.unique(sizes)) == 2


def test_traced_numbers():
    """Bounds in the wrong order and probabilities that are none are flagged where only the device knows them."""
    one, nominal = arena(), arena().nominal_params()

    @jax.jit
    def valid(low, legs, table):
        ranges = mja.ArenaRanges(
            table_rots=U(low, 1.0), has_legs=mja.Bernoulli(legs), object_tables=mja.Choice(np.arange(3), p=table)
        )
        return one.valid(nominal, ranges)

    alike = jnp.full(3, 1 / 3)
    assert valid(0.0, 0.5, alike)
    for low, legs, table in (
        (1.5, 0.5, alike),
        (0.0, 7.0, alike),
        (0.0, -0.1, alike),
        (0.0, 0.5, alike / 2),
        (0.0, 0.5, alike.at[0].add(0.5)),
    ):
        assert not valid(low, legs, table)
    assert one.problems(nominal, mja.ArenaRanges(table_rots=U(1.5, 1.0))) == [
        "`ranges` has a lower bound above its upper bound, or invalid probabilities."
    ]


ON_RACK = {"object_tables": mja.Choice([1, 2])}
NO_BOARD = "nothing on which it can stand is ever there: 'rack_board0', 'rack_board1'."
GONE = {
    "boards": (
        {**ON_RACK, "terms": {"rack.pieces_active": mja.Fixed(False)}},
        dict.fromkeys(["cube", "lid", "ball"], NO_BOARD),
    ),
    "a shelf": (
        {**ON_RACK, "terms": {"rack.active": mja.Fixed(False)}},
        dict.fromkeys(["cube", "lid", "ball"], NO_BOARD),
    ),
    "the first board": ({**ON_RACK, "terms": {"rack.pieces_active": mja.Fixed([False, True])}}, {}),
    "one board or the other": ({**ON_RACK, "terms": {"rack.pieces_active": mja.Count(1, 1)}}, {}),
    "by chance": ({**ON_RACK, "terms": {"rack.pieces_active": mja.Bernoulli(0.2)}}, {}),
    "what is on another": (
        {"object_active": mja.Fixed([False, True, True])},
        {"lid": "nothing on which it can stand is ever there: 'cube'."},
    ),
    "nothing of presence": ({"object_masses": U(0.1, 0.2)}, {}),
}
"""Ranges, and what is told of the objects that they leave in no world."""


def test_gone_from_every_world():
    """As many draws show, of those cases whose draws have programs of their own."""
    cube, lid = mja.Object("cube", full_size=0.1), mja.Object("lid", full_size=0.05, on="cube")
    arena = mja.TableArena(objects=[cube, lid, mja.Object("ball", "sphere", 0.04)])
    arena.add_part(furniture.Shelf("rack", pos=(2, 0, 0), heights=(0.3, 0.8)))
    for case, (given, says) in GONE.items():
        ranges = mja.ArenaRanges(**given)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            arena.check_ranges(ranges)
        told = [f"`ranges` leaves object {name!r} in no world, as {why}" for name, why in says.items()]
        assert [str(w.message) for w in caught] == told, case
        if case not in ("boards", "the first board", "what is on another"):
            continue
        draws = jax.vmap(lambda key, ranges=ranges: arena.sample_params(key, ranges))(mja.world_keys(0, range(40)))
        never = {o.name for o, there in zip(arena.objects, draws.object_active.any(0), strict=True) if not there}
        assert never - ({"cube"} if case == "what is on another" else set()) == says.keys(), case
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        arena.check_ranges(mja.ArenaRanges(object_active=mja.Fixed([True, True, False])))  # that is meant
