"""Wrong arguments: which is refused, of which table or object, by which rule. The words are in test_messages.py."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from refused import DATA, OFFSETS, arena, host, open_arena, told

import mjx_arenas as mja
from mjx_arenas.rules import validation

NAN, INF = np.nan, np.inf
SIZE = (0.8, 0.8, 0.05)


def keys(n):
    return jax.random.split(jax.random.key(0), n)


TABLES = [
    ({"table_rots": [0, 1]}, "table_rots", None, "items"),
    ({"table_rots": [0, 1, 2, 3]}, "table_rots", None, "items"),
    ({"table_rots": [0]}, "table_rots", None, "items"),
    ({"table_rots": "north"}, "table_rots", None, "numbers"),
    ({"table_rots": [0, 0, INF]}, "table_rots", 2, "allowed"),
    ({"table_full_sizes": [SIZE]}, "table_full_sizes", None, "items"),
    ({"table_full_sizes": [SIZE] * 2}, "table_full_sizes", None, "items"),
    ({"table_full_sizes": 0.8}, "table_full_sizes", None, "items"),
    ({"table_full_sizes": [SIZE, (0.8, 0.8), SIZE]}, "table_full_sizes", None, "numbers"),
    ({"table_full_sizes": [SIZE, SIZE, (0.4, -0.1, 0.02)]}, "table_full_sizes", 2, "allowed"),
    ({"table_full_sizes": (0.8, 0.8, 0)}, "table_full_sizes", "all", "allowed"),
    ({"table_frictions": 1.0}, "table_frictions", None, "items"),
    ({"table_frictions": [[1, 1, 1]] * 2}, "table_frictions", None, "items"),
    ({"table_frictions": (-1, 0, 0)}, "table_frictions", "all", "allowed"),
    ({"table_frictions": [(1, 0, 0), (1e30, 0, 0), (1, 0, 0)]}, "table_frictions", 1, "limits"),
    ({"has_legs": "yes"}, "has_legs", None, "truth"),
    ({"has_legs": [True]}, "has_legs", None, "items"),
    ({"has_legs": [1, 0, 2]}, "has_legs", None, "truth"),
    ({"table_active": "none"}, "table_active", None, "truth"),
    ({"table_active": [True, False]}, "table_active", None, "items"),
    ({"table_offsets": []}, "table_offsets", None, "offsets"),
    ({"table_offsets": [0, 0, 0.8]}, "table_offsets", None, "offsets"),
    ({"table_offsets": [[0, 0], [1, 1]]}, "table_offsets", None, "offsets"),
    ({"table_offsets": [[0, 0, NAN]]}, "table_offsets", 0, "allowed"),
    ({"table_offsets": [[0, 0, 0.8], [0, NAN, 0.8]]}, "table_offsets", 1, "allowed"),
    ({"table_offsets": [[0, 0, 0.02]]}, "table_offsets", 0, "legs"),
    ({"table_priority": 1.5}, "table_priority", None, "integer"),
    ({"table_condim": 2}, "table_condim", None, "condim"),
    ({"table_condim": True}, "table_condim", None, "condim"),
    ({"objects": mja.Object("c")}, "objects", None, "one_object"),
    ({"objects": "cube"}, "objects", None, "objects"),
    ({"objects": ["cube"]}, "objects", 0, "object"),
    ({"objects": [mja.Object("c"), mja.Object("c")]}, "objects.name", "c", "named_twice"),
    ({"objects": [mja.Object("table0")]}, "objects.name", "table0", "taken"),
    ({"objects": [mja.Object("c", on=3)]}, "objects.on", "c", "table"),
    ({"objects": [mja.Object("c", on="desk")]}, "objects.on", "c", "table"),
    ({"objects": [mja.Object("c", full_size=0.9)]}, "objects", "c", "larger"),
    ({"objects": [mja.Object("c", full_size=0.9, active=False)]}, "objects", "c", "larger"),
]


@pytest.mark.parametrize(("given", "path", "index", "rule"), TABLES)
def test_tables(given, path, index, rule):
    assert told(lambda: mja.MultiTableArena(**{"table_offsets": OFFSETS} | given)) == [(path, index, rule)]


ONE_TABLE = [
    ({"table_full_size": (0.8, 0.8)}, "table_full_size", "item"),
    ({"table_full_size": (0.8, 0.8, -0.1)}, "table_full_size", "allowed"),
    ({"table_offset": (0, 0)}, "table_offset", "item"),
    ({"table_offset": "here"}, "table_offset", "numbers"),
    ({"table_offset": (0, 0, 0)}, "table_offset", "legs"),
    ({"table_offset": [(0, 0, 1), (1, 1, 1)]}, "table_offset", "item"),
    ({"table_offset": (0, 0, 1e30)}, "table_offset", "limits"),
    ({"table_friction": (1e30, 0, 0)}, "table_friction", "limits"),
    ({"xml": "<mujoco><worldbody><geom/></mujoco>"}, "xml", "unread"),
    ({"xml": "<mujoco><worldbody><table/></worldbody></mujoco>"}, "xml", "unread"),
    ({"xml": "<robot/>"}, "xml", "no_root"),
]


@pytest.mark.parametrize(("given", "path", "rule"), ONE_TABLE)
def test_one_table(given, path, rule):
    """By `TableArena`'s names, without an index."""
    assert told(lambda: mja.TableArena(**given)) == [(path, None, rule)]


BASES = [
    ('<body name="table"><freejoint/><geom size=".1"/></body>', "table", "table_moves"),
    ('<frame pos="1 0 0"><body name="table"/></frame>', "table", "table_moves"),
    ('<geom name="table_collision" size=".1"/>', "table_collision", "table_part"),
]


@pytest.mark.parametrize(("inside", "index", "rule"), BASES)
def test_tables_of_a_base(inside, index, rule):
    """What a base has by the names of a table's elements serves as these, where it can."""
    xml = f"<mujoco><worldbody>{inside}</worldbody></mujoco>"
    assert told(lambda: mja.TableArena(xml=xml)) == [("xml", index, rule)]


def test_files():
    """What is no file or no MJCF has Python's own kind of error."""
    assert told(lambda: mja.TableArena(xml="nowhere/base.xml"), FileNotFoundError) == [("xml", None, "no_mjcf")]
    assert told(lambda: mja.TableArena(xml=3), TypeError) == [("xml", None, "mjcf")]
    geom = '<mujoco><worldbody><geom name="cube_g0" size=".1"/></worldbody></mujoco>'
    taken = [("objects.name", "cube", "taken")]
    assert told(lambda: mja.TableArena(xml=geom, objects=[mja.Object("cube")])) == taken


def test_all_problems_of_a_call():
    """In the order in which they are found; of one table, what its wrong numbers would make wrong is not said, too."""
    wrong = {"table_rots": [0, 1], "table_frictions": (-1, 0, 0), "has_legs": "no", "table_condim": 2}
    assert told(lambda: mja.MultiTableArena(OFFSETS, **wrong, objects=[mja.Object("c", pose="flat", on="x")])) == [
        ("table_rots", None, "items"),
        ("has_legs", None, "truth"),
        ("table_frictions", "all", "allowed"),
        ("objects.pose", "c", "must"),
        ("objects.on", "c", "table"),
        ("table_condim", None, "condim"),
    ]
    assert told(lambda: mja.MultiTableArena(OFFSETS, table_full_sizes=(-1, 1, 9), table_frictions=(-1, 0, 0))) == [
        ("table_full_sizes", "all", "allowed"),
        ("table_frictions", "all", "allowed"),
    ]


def test_values_beside_shapes():
    """Of the same argument, of others where the number of tables is not known, of one table, and of a robot's pose."""
    given = {"table_full_sizes": [(-1, 1, 1)] * 2, "table_rots": [1e9], "has_legs": [1]}
    assert told(lambda: mja.MultiTableArena(OFFSETS, **given)) == [
        ("table_rots", None, "items"),
        ("table_rots", None, "limits"),
        ("table_full_sizes", None, "items"),
        ("table_full_sizes", None, "allowed"),
        ("has_legs", None, "items"),
    ]
    given = {"table_full_sizes": (-1, 1, 1), "table_frictions": (1, 2), "table_rots": [0, 1], "has_legs": [1, 0]}
    assert told(lambda: mja.MultiTableArena([[0, NAN]], **given)) == [
        ("table_offsets", None, "offsets"),
        ("table_offsets", None, "allowed"),
        ("table_full_sizes", None, "allowed"),
        ("table_frictions", None, "items"),
    ]
    assert told(lambda: mja.TableArena((-1, 1), objects=[mja.Object("c", pose="flat")])) == [
        ("table_full_size", None, "item"),
        ("table_full_size", None, "allowed"),
        ("objects.pose", "c", "must"),
    ]
    assert told(lambda: open_arena().attach(ROBOT, pos=(0, 0), quat=(0, 0, 0, 0))) == [
        ("pos", None, "vector"),
        ("quat", None, "not_zero"),
    ]
    wrong = host(arena(), table_rots=np.zeros(2), object_tables=[0.7])
    assert [p.key for p in validation.shape_problems(wrong, arena()._labels)] == [
        ("params.table_rots", None, "shape"),
        ("params.object_tables", None, "dtype_int"),
    ]


OBJECTS = [
    ({"type": "scene"}, "type", "one_of"),
    ({"full_size": (0.1, -0.1, 0.1)}, "full_size", "extents"),
    ({"full_size": 1e-30}, "full_size", "limits"),
    ({"type": "capsule", "full_size": 0.1}, "full_size", "capsule"),
    ({"type": "sphere", "full_size": (0.1, 0.2, 0.1)}, "full_size", "sphere"),
    ({"type": "cylinder", "full_size": (0.1, 0.2, 0.3)}, "full_size", "cylinder"),
    ({"pos": (0, 0, 1)}, "pos", "vector"),
    ({"pos": (1e30, 0)}, "pos", "limits"),
    ({"rot": "north"}, "rot", "number"),
    ({"density": -1}, "density", "must"),
    ({"mass": -0.1}, "mass", "must"),
    ({"mass": 1e300}, "mass", "limits"),
    ({"mass": "0.3"}, "mass", "number"),
    ({"mass": True}, "mass", "number"),
    ({"rgba": (0, 0, 2, 1)}, "rgba", "must"),
    ({"condim": 2}, "condim", "condim"),
    ({"active": "yes"}, "active", "truth"),
    ({"file": "box.obj"}, "file", "file_without_use"),
    ({"type": "mesh"}, "file", "file"),
    ({"type": "mesh", "file": "mug.obj"}, "file", "no_file"),
    ({"type": "mjcf", "file": "mug.xml"}, "file", "no_file"),
    ({"type": "mjcf", "file": DATA / "drawer.xml", "full_size": 0.2}, "full_size", "of_file"),
    ({"type": "mjcf", "file": DATA / "drawer.xml", "density": 300}, "density", "density_of_file"),
]


@pytest.mark.parametrize(("given", "field", "rule"), OBJECTS)
def test_objects(given, field, rule):
    assert [p.key for p in mja.Object("c", **given).problems()] == [(f"objects.{field}", "c", rule)]


@pytest.mark.parametrize("wrong", ["cone", "Box", None, ["box"]])
def test_types_are_refused_at_once(wrong):
    """Where the object is made."""
    assert told(lambda: mja.Object("c", wrong)) == [("objects.type", "c", "one_of")]


def test_objects_as_a_whole():
    assert [p.key for p in mja.Object("").problems()] == [("objects.name", "", "object_name")]
    assert [p.key for p in mja.Object("c", mass=0.1, density=500).problems()] == [("objects", "c", "either")]


BODY = "<mujoco>{}<worldbody><body>{}</body></worldbody></mujoco>"
BODIES = [
    (BODY.format('<compiler settotalmass="7"/>', '<geom size=".1"/>'), "mass_rules"),
    (BODY.format('<compiler boundmass="1"/>', '<geom size=".1"/>'), "mass_rules"),
    (BODY.format("", '<geom size=".1" contype="0" conaffinity="0"/>'), "ghost"),
    (BODY.format("", '<geom size=".1" friction=".1 0 0"/><geom size=".1" pos=".1 0 0"/>'), "frictions"),
]


@pytest.mark.parametrize(("xml", "rule"), BODIES)
def test_bodies_of_files(xml, rule):
    body = mja.Object("m", "mjcf", file=mujoco.MjSpec.from_string(xml))
    assert told(lambda: mja.TableArena(objects=[body])) == [("objects.file", "m", rule)]


@pytest.mark.parametrize(("kind", "file"), [("mesh", "drawer.xml"), ("mjcf", "wedge.obj")])
def test_files_of_another_kind(kind, file):
    broken = mja.Object("m", kind, file=DATA / file)
    assert told(lambda: mja.TableArena(objects=[broken])) == [("objects", "m", "uncompiled")]


@pytest.mark.parametrize("kind", ["geom", "body"])
def test_additions_to_the_body_of_an_object(kind):
    """No geom and no body, which would not follow its parameters."""
    one = open_arena()
    getattr(one.spec.body("cube"), f"add_{kind}")(name="more")
    assert told(lambda: one.mj_model) == [("arena.spec", "cube", "added")]


ROBOT = '<mujoco><worldbody><body name="base"><joint/><geom size=".1" pos="0 0 .2"/></body></worldbody></mujoco>'
FREE = ROBOT.replace("<joint/>", "<freejoint/>")
ATTACHED = [
    ({"robot": "<mujoco><robot/></mujoco>"}, "robot", "unread"),
    ({"prefix": None}, "prefix", "text"),
    ({"on": 7}, "on", "carrier"),
    ({"robot": FREE, "on": 0}, "on", "free_joint"),
    (
        {"robot": BODY.format("", '<geom size=".1"/>').replace("<body", '<body mocap="true"'), "on": 0},
        "on",
        "mocap_body",
    ),
    ({"pos": (0, 0)}, "pos", "vector"),
    ({"pos": (0, 0, 1e30)}, "pos", "limits"),
    ({"quat": (0, 0, 0, 0)}, "quat", "not_zero"),
    ({"quat": (1e7, 0, 0, 0)}, "quat", "limits"),
]


@pytest.mark.parametrize(("given", "path", "rule"), ATTACHED)
def test_attached(given, path, rule):
    assert told(lambda: open_arena().attach(**{"robot": ROBOT} | given)) == [(path, None, rule)]


def test_attached_files():
    one = open_arena()
    assert told(lambda: one.attach("robot.xml"), FileNotFoundError) == [("robot", None, "no_mjcf")]
    assert told(lambda: one.attach(3), TypeError) == [("robot", None, "mjcf")]
    one.attach(ROBOT, "arm_", on=0)
    assert told(lambda: one.attach(ROBOT, "arm_")) == [("robot", None, "clash")]
    assert told(lambda: one.attach(ROBOT, "arm_", on=1)) == [("robot", None, "clash")]


def test_merged():
    one, other = open_arena(), open_arena()
    assert told(lambda: one.merge(other, "")) == [("prefix", None, "text")]
    assert told(lambda: one.merge(other, "b_", rot=1e7)) == [("rot", None, "limits")]
    other.spec.add_pair(name="p", geomname1="floor", geomname2="cube_g0")
    sensor = other.spec.add_sensor(name="d", type=mujoco.mjtSensor.mjSENS_GEOMDIST, objname="cube_g0", refname="floor")
    sensor.objtype = sensor.reftype = mujoco.mjtObj.mjOBJ_GEOM
    assert told(lambda: one.merge(other, "b_")) == 2 * [("other", None, "shared_name")]


SCENE = """<mujoco><worldbody>
  <body name="desk"><geom name="desk_top" type="box" size=".5 .5 .1"/><geom name="desk_side" type="box" size=".5 .1 .5"/></body>
  <body name="round"><geom name="disc" type="cylinder" size=".5 .1"/></body>
  <body name="cart"><joint/><geom type="box" size=".5 .5 .1"/></body>
  <body name="ramp" euler="0 10 0"><geom type="box" size=".5 .5 .1"/></body>
  <body name="ghost"><geom type="box" size=".5 .5 .1" contype="2" conaffinity="4"/></body>
  <body><geom name="nameless" type="box" size=".5 .5 .1"/></body>
  <frame><body name="framed"><geom type="box" size=".5 .5 .1"/><body name="inner" pos="0 0 1"><geom type="box" size=".5 .5 .1"/></body>
  </body></frame></worldbody></mujoco>"""
ADOPTED = [
    ("desk", None, "adopted"),
    (["desc"], "desc", "adopted_unknown"),
    (["round"], "round", "adopted_boxes"),
    (["desk"], "desk", "adopted_boxes"),
    (["disc"], "disc", "adopted_kind"),
    (["cart"], "cart", "adopted_moves"),
    (["ramp"], "ramp_collision", "adopted_tilted"),
    (["ghost"], "ghost", "adopted_masks"),
    (["desk_top", "desk_top"], "desk", "adopted_again"),
    (["framed", "inner"], "inner", "adopted_inside"),
]


@pytest.mark.parametrize(("names", "index", "rule"), ADOPTED)
def test_tables_of_a_scene(names, index, rule):
    assert told(lambda: mja.Arena.from_xml(SCENE, names)) == [("tables", index, rule)]


def test_a_scene_and_its_slab():
    assert told(lambda: mja.Arena.from_xml("scene.xml", ["desk"]), FileNotFoundError) == [("xml", None, "no_mjcf")]
    masks = SCENE.replace('"desk_top"', '"desk_top" contype="0" conaffinity="0"')
    assert told(lambda: mja.Arena.from_xml(masks, ["desk_top"])) == [("tables", "desk_top", "adopted_masks")]


def wide(**values):
    """Nominal parameters of two worlds, with others."""
    return jax.tree.map(lambda x: np.stack([x, x]), host(arena()))._replace(**values)


PARAMS = [
    (lambda: (1, 2, 3), "params", "params"),
    (lambda: 5, "params", "params"),
    (lambda: wide(), "params", "one_world"),
    (lambda: host(arena(), table_rots=np.zeros(2)), "params.table_rots", "shape"),
    (lambda: host(arena(), object_tables=[0.7]), "params.object_tables", "dtype_int"),
    (lambda: host(arena(), has_legs=[0.5, 0.2, 1]), "params.has_legs", "dtype_bool"),
    (lambda: host(arena(), table_rots=["0", "1", "2"]), "params.table_rots", "dtype_float"),
]


@pytest.mark.parametrize(("params", "path", "rule"), PARAMS)
def test_parameters_of_one_world(params, path, rule):
    assert [p.key for p in validation.shape_problems(params(), arena()._labels)] == [(path, None, rule)]


class Batch:
    """Something with parameters."""

    params = None


MANY = [
    (lambda: host(arena()), "params", "of_many_worlds"),
    (lambda: jax.tree.map(lambda x: x[:0], wide()), "params", "no_world"),
    (lambda: wide(table_rots=np.zeros((3, 3))), "params", "same_worlds"),
    (lambda: wide(terms={"extra": np.zeros(())}), "params.terms", "other_terms"),
    (lambda: wide(terms=5), "params.terms", "terms_mapping"),
    (lambda: wide(table_rots=np.zeros((2, 2))), "params.table_rots", "shape"),
    (lambda: wide(object_tables=np.full((2, 1), 0.7)), "params.object_tables", "dtype_int"),
    (lambda: Batch(), "params", "params_of"),
    (lambda: arena().nominal_params, "params", "params_called"),
    (lambda: [host(arena())], "params", "params"),
]


@pytest.mark.parametrize(("params", "path", "rule"), MANY)
def test_parameters_of_many_worlds(params, path, rule):
    (problem,) = validation.batch_shape_problems(params(), arena()._labels)
    assert problem.key == (path, None, rule)
    assert rule != "shape" or (problem.numbers["want"], problem.numbers["shape"]) == (("W", 3), ("W", 2))


KEYS = [
    (lambda: None, None, "keys"),
    (lambda: arena(), None, "keys"),
    (lambda: jax.random.key(0), None, "keys_shape"),
    (lambda: jax.random.key(0), 2, "keys_shape"),
    (lambda: keys(3), 2, "one_each"),
    (lambda: keys(0), None, "no_key"),
    (lambda: np.zeros((2, 3), np.uint32), None, "raw_keys"),
    (lambda: jax.random.split(jax.random.key(0, impl="rbg"), 2), None, "key_impl"),
]


@pytest.mark.parametrize(("given", "n_worlds", "rule"), KEYS)
def test_keys(given, n_worlds, rule):
    assert [p.key for p in validation.key_problems("keys", given(), n_worlds)] == [("keys", None, rule)]


ONE_KEY = [
    (lambda: 5, "key"),
    (lambda: np.zeros(3), "key_numbers"),
    (lambda: keys(2), "one_key"),
    (lambda: jax.random.key(0, impl="rbg"), "key_impl"),
]


@pytest.mark.parametrize(("given", "rule"), ONE_KEY)
def test_one_key(given, rule):
    assert [p.key for p in validation.one_key_problems("key", given())] == [("key", None, rule)]


def test_right_keys():
    """Typed ones and raw ones."""
    raw = jax.random.PRNGKey(0)
    assert not validation.one_key_problems("key", raw) + validation.one_key_problems("key", keys(1)[0])
    assert not validation.key_problems("keys", jnp.stack([raw, raw]), 2) + validation.key_problems("keys", keys(2), 2)


def test_seeds():
    for seed, worlds, path, rule in (
        (-1, [0], "seed", "seed"),
        (2**32, [0], "seed", "seed"),
        (True, [0], "seed", "seed"),
        (0, [-1], "worlds", "worlds"),
        (0, [0.5], "worlds", "worlds"),
        (0, 4, "worlds", "worlds_counted"),
        (0, -4, "worlds", "worlds"),
        (0, "4", "worlds", "worlds"),
        (0, range(10**10), "worlds", "many_worlds"),
    ):
        assert told(lambda seed=seed, worlds=worlds: mja.world_keys(seed, worlds)) == [(path, None, rule)]


def test_whole_numbers():
    for value in (-3, 2.5, True, None, "1"):
        assert told(lambda value=value: validation.whole("n_steps", value, 0)) == [("n_steps", None, "must")]
    assert validation.whole("n_steps", np.int32(2), 0) == 2
    assert told(lambda: arena().c_batch(wide(), nthread=-3)) == [("nthread", None, "must")]
    model = arena().put_model("jax")
    assert told(lambda: arena().make_world_data(model, arena().nominal_params(), n_worlds=0)) == [
        ("n_worlds", None, "must")
    ]


def test_margins():
    for margin, rule in ((-0.1, "not_negative"), ((0.1, 0.1), "number"), ("0.1", "number"), (1e30, "limits")):
        assert [p.key for p in validation.not_negative_problems("margin", margin, "[m]")] == [("margin", None, rule)]


def test_where_they_are_asked_for():
    """The calls that take keys, parameters, margins and models ask these rules, each by the name of its argument."""
    one, nominal, none = arena(), arena().nominal_params(), mja.ArenaRanges()
    model, key = one.put_model("jax"), keys(1)[0]
    for call, found in (
        (lambda: one.sample_params(5, none), ("key", None, "key")),
        (lambda: one.place(nominal, 5), ("key", None, "key")),
        (lambda: one.place(nominal, key, margin=-1), ("margin", None, "not_negative")),
        (lambda: one.c_world(nominal, key=7), ("key", None, "key")),
        (lambda: one.make_world_data(model, nominal, 5), ("key", None, "key")),
        (lambda: one.randomize(model, None, none), ("keys", None, "keys")),
        (lambda: one.c_batch(wide(), keys=keys(3)), ("keys", None, "one_each")),
        (lambda: one.randomization_fn(mja.ArenaRanges(table_rots=mja.Fixed(1)))(model, rng=5), ("rng", None, "keys")),
        (lambda: one.valid(5), ("params", None, "params")),
        (lambda: one.problems(5), ("params", None, "params")),
        (lambda: one.describe(5), ("params", None, "params")),
        (lambda: one.apply(model, 5), ("params", None, "params")),
        (lambda: one.compile(wide()), ("params", None, "one_world")),
        (lambda: one.tile([nominal]), ("params", None, "params")),
        (lambda: one.batch(model, nominal), ("params", None, "of_many_worlds")),
        (lambda: one.apply(one.mj_model, nominal), ("model", None, "model")),
    ):
        assert told(call) == [found]


def test_models():
    """Of another kind, batched, of other sizes, and of other names."""
    one, model = arena(), arena().put_model("jax")
    other, named = mja.TableArena(), mja.MultiTableArena(OFFSETS, objects=[mja.Object("mug")])
    batched = model.tree_replace({"body_pos": jnp.stack([model.body_pos, model.body_pos])})
    for given, of, rule in (
        (one.mj_model, one, "model"),
        (batched, one, "batched_model"),
        (model, other, "other_sizes"),
        (model, named, "other_names"),
    ):
        assert [p.key for p in validation.model_problems(given, of.mj_model)] == [("model", None, rule)]
    assert not validation.model_problems(model, one.mj_model)


def test_models_of_equal_sizes():
    """What differs is named, not the sizes that do not."""
    first, second = (mja.TableArena(objects=[mja.Object("a", kind)]) for kind in ("box", "sphere"))
    told = r"\(geom (\d+) is a sphere of body 2\), got the model of another arena \(geom \1 is a box of body 2\)\.$"
    with pytest.raises(ValueError, match=told):
        second.apply(first.put_model("jax"), second.nominal_params())


def test_lists_of_keys():
    """Keys in a list are no array of keys, and are told as what they are."""
    keys = list(mja.world_keys(0, range(2)))
    with pytest.raises(ValueError, match=r"^`keys` must be an array of keys such as .*, got \[a key, a key\]\.$"):
        arena().randomize(arena().put_model("jax"), keys, mja.ArenaRanges())
