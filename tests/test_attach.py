"""Robots and other MJCF in arenas, arenas in arenas, and tables in scenes of one's own."""

import functools
import warnings

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds
from models import ROBOTS
from oracle import STRUCTURE_MAY_DIFFER, from_compiled

import mjx_arenas as mja

FILES = {
    "panda": "gym_hil/assets/panda.xml",  # Franka Panda with a Robotiq 2F-85
    "ur5e": "ogbench/manipspace/descriptions/universal_robots_ur5e/ur5e.xml",
    "yam": "mjlab/asset_zoo/robots/i2rt_yam/xmls/yam.xml",
}
FOLDED = "`robot`: geoms are inside each other: an unnamed mesh of body '.*link5'"  # the Panda, at `qpos0`
OBJECTS = (mja.Object("cube", pos=(0.3, 0.3)), mja.Object("ball", "sphere", 0.06, on=1, pos=(0.3, 0.3)))


def file(robot):
    path = ROBOTS / FILES[robot]
    if not path.is_file():
        raise FileNotFoundError(f"{path}: pip install --no-deps --target {ROBOTS} -r tests/robots.txt (make test does)")
    return path


def two_tables(**kwargs):
    return mja.MultiTableArena([[0, -0.7, 0.8], [0, 0.7, 0.8]], objects=OBJECTS, **kwargs)


@functools.lru_cache(1)  # robots with their meshes are large
def with_robot(name):
    """The robot on table 1, and again on the floor."""
    arena = two_tables()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", FOLDED)
        arena.attach(file(name), "r_", pos=(-0.2, 0.05, 0), quat=(0.9, 0, 0, 0.2), on=1)
        arena.attach(file(name), "floor_", pos=(-1.5, 0, 0))
    return arena


@pytest.mark.slow
@pytest.mark.parametrize("robot", [pytest.param(name, marks=[pytest.mark.xslow] * (name != "panda")) for name in FILES])
def test_robot_oracle(robot):
    """With a robot on a table and one on the floor, no leaf differs from the recompiled model's."""
    arena = with_robot(robot)
    ranges = worlds.RANGES._replace(table_full_sizes=mja.Uniform([0.8, 0.8, 0.01], [1.0, 1.0, 0.3]))
    model = arena.put_model("warp")
    for key in jax.random.split(jax.random.key(5), 4):
        params = arena.sample_params(key, ranges)
        assert from_compiled(arena.apply(model, params), arena.compile(params)) <= STRUCTURE_MAY_DIFFER.keys()


@pytest.mark.slow
@pytest.mark.parametrize("robot", [pytest.param(name, marks=[pytest.mark.xslow] * (name != "panda")) for name in FILES])
def test_everything_of_a_robot_survives(robot):
    """Actuators, sensors, tendons, equalities, meshes, keyframes and limits are those of the robot alone, twice."""
    model, alone = with_robot(robot).mj_model, mujoco.MjModel.from_xml_path(str(file(robot)))
    for count in ("nu", "nsensor", "ntendon", "neq", "nmesh", "nkey", "nexclude"):
        assert getattr(model, count) == 2 * getattr(alone, count), count
    assert model.opt.integrator == alone.opt.integrator
    for kind, fields in {
        "joint": ("range", "damping", "armature"),
        "actuator": ("gainprm", "biasprm", "ctrlrange", "forcerange"),
        "geom": ("size", "friction", "contype", "condim"),
        "body": ("mass", "inertia"),
    }.items():
        for i in range({"joint": alone.njnt, "actuator": alone.nu, "geom": alone.ngeom, "body": alone.nbody}[kind]):
            one = getattr(alone, kind)(i)
            if one.name and one.name != "world":
                for field in fields:
                    have = getattr(getattr(model, kind)(f"r_{one.name}"), field)
                    np.testing.assert_allclose(have, getattr(one, field), rtol=1e-12, err_msg=f"{one.name} {field}")


@pytest.mark.xslow
@pytest.mark.slow
def test_robots_follow_their_tables():
    """A batch of robots, each on its own table, steps on Warp as C MuJoCo does in each recompiled world."""
    offsets = [[0, y, 0.8] for y in (-1.6, 0, 1.6)]
    arena = mja.MultiTableArena(offsets, objects=OBJECTS)
    for table, robot in enumerate(FILES):
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "`robot` has other options than the arena")
            warnings.filterwarnings("ignore", FOLDED)
            arena.attach(file(robot), f"{robot}_", pos=(-0.2, 0.05, 0), quat=(0.9, 0, 0, 0.2), on=table)
    keys = jax.random.split(jax.random.key(1), 3)
    ranges = worlds.RANGES._replace(table_full_sizes=mja.Uniform([0.8, 0.8, 0.01], [1.0, 1.0, 0.3]))
    batch = arena.randomize(arena.put_model("warp"), keys, ranges)
    data = mja.make_data(batch, keys)
    start, after = np.asarray(data.qpos), mja.rollout(batch, data, 5)
    mounts = [arena.mj_model.body(f"{robot}_mount").id for robot in FILES]
    for i in range(3):
        params = batch.world(i)
        model = arena.compile(params)
        twin = mujoco.MjData(model)
        twin.qpos = start[i]
        mujoco.mj_step(model, twin, 5)
        cos, sin, zero = np.cos(params.table_rots), np.sin(params.table_rots), np.zeros(3)
        turned = np.stack([cos * -0.2 - sin * 0.05, sin * -0.2 + cos * 0.05, zero], axis=1)
        np.testing.assert_allclose(twin.xpos[mounts], params.table_offsets + turned, atol=1e-6)
        np.testing.assert_allclose(after.xpos[i, mounts], twin.xpos[mounts], atol=1e-6)
        np.testing.assert_allclose(after.qpos[i], twin.qpos, rtol=0, atol=2e-3)  # contacts inside the grippers at rest


@pytest.mark.xslow
def test_robot_on_jax():
    """Where a shape has no collision function on jax, put_model says so; without it the robot steps as in C."""
    arena = two_tables()
    arena.attach(file("ur5e"), on=0)
    with pytest.raises(
        ValueError, match=r"^impl='jax' has no collision function for geoms .*\(cylinder\).*: use impl='warp'"
    ):
        arena.put_model("jax")
    spec = mujoco.MjSpec.from_file(str(file("ur5e")))
    for geom in spec.geoms:
        if geom.type == mujoco.mjtGeom.mjGEOM_CYLINDER:
            geom.type = mujoco.mjtGeom.mjGEOM_CAPSULE
    arena = mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06, pos=(0.3, 0.3))])
    arena.attach(spec, "r_", pos=(-0.2, 0, 0), on="table")
    keys = jax.random.split(jax.random.key(1), 2)
    ranges = mja.ArenaRanges(
        table_offsets=mja.Uniform([0, 0, -0.3], [0, 0, 0.3], relative="add"), table_rots=mja.Uniform(-3, 3)
    )
    batch = arena.randomize(arena.put_model("jax"), keys, ranges)
    data = mja.make_data(batch, keys, keyframe="r_home")
    home = arena.mj_model.key("r_home")
    np.testing.assert_allclose(data.qpos[:, :6], np.tile(home.qpos[:6], (2, 1)), rtol=1e-6)
    np.testing.assert_allclose(data.ctrl, np.tile(home.ctrl, (2, 1)), rtol=1e-6)
    np.testing.assert_allclose(data.qpos[:, 8], np.asarray(batch.params.table_offsets)[:, 0, 2] + 0.03, atol=1e-6)
    after = mja.rollout(batch, data, 20)
    for i in range(2):
        model = arena.compile(batch.world(i))
        twin = mujoco.MjData(model)
        twin.qpos, twin.ctrl = data.qpos[i], data.ctrl[i]
        mujoco.mj_step(model, twin, 20)
        np.testing.assert_allclose(after.qpos[i], twin.qpos, rtol=0, atol=2e-4)


def test_keyframes_of_a_world():
    """In a world that MuJoCo compiles a robot starts in its keyframe, and objects on their tables, as in the batch."""
    robot = """<mujoco><worldbody><body name="base"><joint name="j"/><geom size=".05" contype="0" conaffinity="0"/></body>
      </worldbody><keyframe><key name="home" qpos=".3" time="1.5"/></keyframe></mujoco>"""
    arena = two_tables()
    arena.attach(robot, "r_", pos=(0, 0, 0.2), on=0)
    model, params = arena.put_model("jax"), arena.nominal_params()
    params = params._replace(table_offsets=params.table_offsets.at[:, 2].set(jnp.array([1.1, 0.5])))
    params = params._replace(table_rots=jnp.array([0.3, -0.4]))
    make = jax.jit(arena.make_world_data, static_argnames="keyframe")
    data = make(arena.apply(model, params), params, keyframe="r_home")
    assert data.time == 1.5
    home = arena.compile(params).key("r_home")
    np.testing.assert_allclose(home.qpos, data.qpos, rtol=0, atol=1e-6)
    assert home.time == 1.5
    alone = arena.compile(params._replace(object_active=jnp.array([False, True]))).key("r_home")
    np.testing.assert_allclose(alone.qpos, np.delete(data.qpos, arena.layout.object_qpos[0]), rtol=0, atol=1e-6)
    loaded = mujoco.MjModel.from_xml_string(arena.to_xml(params))
    np.testing.assert_allclose(loaded.key("r_home").qpos, home.qpos, rtol=0, atol=1e-9)


def test_objects_keep_clear_of_a_base():
    """No object is placed where a robot's base stands, on whatever table."""
    robot = '<mujoco><worldbody><body name="base"><geom type="box" size=".15 .1 .2" pos="0 0 .2"/></body></worldbody></mujoco>'
    arena = two_tables()
    arena.attach(robot, pos=(0.1, 0, 0), on=1)
    params = arena.sample_params(jax.random.key(0), mja.ArenaRanges(table_rots=mja.Uniform(-3, 3)))
    placed = jax.vmap(lambda key: arena.place(params, key))(jax.random.split(jax.random.key(1), 500))
    assert placed.valid.all()
    yaw, center = float(params.table_rots[1]), np.asarray(params.table_offsets[1])[:2]
    local = (np.asarray(placed.qpos)[:, 1, :2] - center) @ np.array(
        [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    )
    away = np.maximum(np.abs(local - [0.1, 0]) - [0.15, 0.1], 0)
    assert np.hypot(*away.T).min() > 0.03


@pytest.mark.slow
def test_objects_keep_clear_of_what_is_fixed_to_the_world():
    """No object is placed into a pillar or a robot in the world; one below the table's top is not in the way."""
    robot = """<mujoco><worldbody><body name="base"><geom name="box" type="box" size=".1 .05 .2" pos=".05 0 .2"/>
      <body name="arm" pos="0 0 .5"><joint/><geom size=".05"/></body></body></worldbody></mujoco>"""
    scene = """<mujoco><worldbody><geom name="floor" type="plane" size="0 0 1"/>
      <geom name="pillar" type="box" size=".2 .05 1" pos="-.2 .2 1" euler="0 0 40"/>
      <geom name="pipe" type="capsule" size=".04 .4" pos="0 -.25 .85" euler="90 0 0"/>
      <geom name="low" type="box" size=".4 .4 .3" pos="0 0 .3"/></worldbody></mujoco>"""
    objects = [mja.Object(f"o{i}", full_size=(0.12, 0.05, 0.1)) for i in range(4)]
    with pytest.warns(UserWarning, match="Table 0 and 'pillar' overlap|Table 0 and 'pipe' overlap"):
        arena = mja.TableArena(xml=scene, objects=objects)
    arena.attach(robot, "r_", pos=(0.2, 0.2, 0.8), quat=(0.9, 0, 0, 0.3))
    with pytest.warns(UserWarning, match="start"):
        model = arena.mj_model
    params, keys = arena.nominal_params(), jax.random.split(jax.random.key(1), 200)
    placed = jax.jit(jax.vmap(lambda key: arena.place(params, key)))(keys)
    valid, data = np.asarray(placed.valid), mujoco.MjData(model)
    assert valid.mean() > 0.99
    solids = [model.geom(name).id for name in ("pillar", "pipe", "r_box")]
    for i in range(200):
        data.qpos[arena.layout.object_qpos] = placed.qpos[i]
        mujoco.mj_kinematics(model, data)
        for k, obj in enumerate(objects):
            for solid in solids:
                at = model.geom(f"{obj.name}_g0").id
                assert not valid[i, k] or mujoco.mj_geomDistance(model, data, at, solid, 0.5, np.zeros(6)) > 0
    wide = '<mujoco><worldbody><geom type="box" size=".3 .3 1.5" pos="0 0 1.5"/></worldbody></mujoco>'
    with pytest.warns(UserWarning, match="Table 0 and an unnamed box of the world overlap"):
        full = mja.TableArena((0.5, 0.5, 0.05), xml=wide, objects=[mja.Object("o", pos=(0, 0))])
    with pytest.warns(UserWarning, match="start"):
        found = full.place(full.nominal_params(), jax.random.key(0))
    assert not found.valid.any()
    assert found.qpos[0, 2] >= 3.0


@pytest.mark.slow
def test_attach_clash_leaves_the_arena_as_it_was():
    """After a refused attachment the arena is what it was before."""
    arena = two_tables()
    arena.attach(file("ur5e"), "r_")
    before = arena.spec.to_xml()
    with pytest.raises(ValueError, match="the arena already has body 'r_base'"):
        arena.attach(file("ur5e"), "r_", pos=(1, 1, 0))
    assert arena.spec.to_xml() == before
    arena.attach(file("ur5e"), "s_", pos=(1, 1, 0))
    assert arena.mj_model.nu == 12


@pytest.mark.parametrize("robot", ["<mujoco/>", "<mujoco><option timestep='0.01'/></mujoco>"])
def test_a_robot_has_something(robot):
    arena = mja.TableArena()
    with pytest.raises(ValueError, match=r"^`robot` must be an MJCF with a body or a geom, got none\.$"):
        arena.attach(robot)
    assert not arena.mj_model.nu


def test_option_of_a_robot():
    """Options that the arena leaves at MuJoCo's default are the robot's; others stay, with a warning."""
    arena = two_tables()
    arena.attach(file("ur5e"), "r_")
    assert arena.spec.option.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    arena = two_tables()
    arena.spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    with pytest.warns(
        UserWarning,
        match=r"^`robot` has other options than the arena. The arena's are used: integrator=implicitfast \(arena: rk4\)",
    ):
        arena.attach(file("ur5e"), "r_")
    assert arena.spec.compile().opt.integrator == mujoco.mjtIntegrator.mjINT_RK4


def test_merged_arenas(impl):
    """Two arenas in one: both sets of tables and objects vary, and no leaf differs from the recompiled model's."""
    one = mja.TableArena(objects=[mja.Object("cube")])
    two = mja.MultiTableArena(
        [[0, 0, 0.7], [1, 0, 0.9]],
        [0.3, 0],
        objects=[mja.Object("cube", on=1), mja.Object("rod", "capsule", (0.1, 0.03, 0.03))],
    )
    two.spec.worldbody.add_geom(name="post", type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.1, 0.1, 0.5), pos=(0.5, 1, 0.5))
    arena = one.merge(two, "b_", pos=(2, 1, 0.1), rot=np.pi / 2)
    assert arena.table_names == ["table", "b_table0", "b_table1"]
    assert [o.name for o in arena.objects] == ["cube", "b_cube", "b_rod"]
    assert [o.on for o in arena.objects] == [0, 2, 1]
    nominal = arena.nominal_params()
    np.testing.assert_allclose(nominal.table_offsets, [[0, 0, 0.8], [2, 1, 0.8], [2, 2, 1.0]], atol=1e-6)
    np.testing.assert_allclose(nominal.table_rots, [0, 0.3 + np.pi / 2, np.pi / 2], atol=1e-6)
    assert nominal.object_tables.tolist() == [0, 2, 1]
    planes = np.flatnonzero(arena.mj_model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
    floors = [arena.mj_model.geom(g).name for g in planes]
    assert floors == ["floor"]
    model = arena.mj_model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.geom("b_post").xpos, [1, 1.5, 0.6], atol=1e-9)
    put = arena.put_model(impl)
    for key in jax.random.split(jax.random.key(5), 3):
        params = arena.sample_params(key, worlds.RANGES)
        assert from_compiled(arena.apply(put, params), arena.compile(params)) <= STRUCTURE_MAY_DIFFER.keys()


SCENE = """<mujoco><compiler angle="degree"/>
  <default><default class="wood"><geom rgba=".5 .3 .1 1" friction=".7 .01 .001"/></default></default>
  <asset><material name="oak" rgba=".6 .4 .2 1"/></asset>
  <worldbody><geom name="ground" type="plane" size="0 0 .1"/><light pos="0 0 3"/>
    <body name="desk" pos="1 0 0" euler="0 0 30" childclass="wood">
      <geom name="desk_top" type="box" size=".6 .4 .02" pos="0 .1 .72" euler="0 0 10" material="oak"/>
      <geom name="drawers" type="box" size=".2 .35 .2" pos=".35 .1 .5" contype="0" conaffinity="0"/>
      <site name="edge" pos="0 .5 .74"/>
      <body name="lamp" pos="-.4 .3 .74"><geom type="capsule" size=".02 .2" pos="0 0 .22"/></body></body>
    <body name="shelf" pos="-1 0 0"><geom type="box" size=".3 .2 .015" pos="0 0 .4"/></body>
    <body name="robot" pos="0 -1 0"><joint name="turn"/><geom type="capsule" size=".05 .3" pos="0 0 .4"/></body>
  </worldbody><actuator><motor joint="turn"/></actuator></mujoco>"""


@functools.cache
def office():
    return mja.Arena.from_xml(
        SCENE,
        ["desk", "shelf"],
        objects=[mja.Object("cube"), mja.Object("can", "capsule", (0.1, 0.04, 0.04), on="shelf")],
    )


def test_from_xml_keeps_the_scene():
    """At nominal parameters every geom, site and light of the scene stands where it stood."""
    before, after = mujoco.MjModel.from_xml_string(SCENE), office().mj_model
    then, now = mujoco.MjData(before), mujoco.MjData(after)
    mujoco.mj_forward(before, then)
    mujoco.mj_forward(after, now)
    for kind, n in (("geom", before.ngeom), ("site", before.nsite)):
        for i in range(n):
            name = getattr(before, kind)(i).name
            if name:
                np.testing.assert_allclose(getattr(now, kind)(name).xpos, getattr(then, kind)(name).xpos, atol=1e-9)
                np.testing.assert_allclose(getattr(now, kind)(name).xmat, getattr(then, kind)(name).xmat, atol=1e-9)
    lamp = after.body("lamp").id
    np.testing.assert_allclose(now.xpos[lamp], then.xpos[before.body("lamp").id], atol=1e-9)
    p = office().nominal_params()
    np.testing.assert_allclose(p.table_rots, np.deg2rad([40, 0]), atol=1e-6)
    np.testing.assert_allclose(p.table_full_sizes, [[1.2, 0.8, 0.04], [0.6, 0.4, 0.03]], atol=1e-6)
    np.testing.assert_allclose(p.table_offsets[:, 2], [0.74, 0.415], atol=1e-6)
    np.testing.assert_allclose(p.table_frictions[0], [0.7, 0.01, 0.001], atol=1e-6)
    visual = after.geom("desk_visual")
    assert after.mat(visual.matid[0]).name == "oak"


@pytest.mark.slow_on("warp")
def test_from_xml_oracle(impl):
    """The tables of a user's scene vary exactly."""
    arena = office()
    model = arena.put_model(impl)
    for key in jax.random.split(jax.random.key(5), 4):
        params = arena.sample_params(key, worlds.RANGES._replace(has_legs=None))
        assert from_compiled(arena.apply(model, params), arena.compile(params)) <= STRUCTURE_MAY_DIFFER.keys()


def test_from_xml_without_a_table():
    """An absent table of a scene takes along what hangs on it."""
    arena = office()
    params = arena.nominal_params()._replace(table_active=jnp.array([False, True]))
    model = arena.compile(params)
    names = [model.body(b).name for b in range(model.nbody)]
    assert "lamp" not in names
    assert "cube" not in names
    assert "shelf" in names


@pytest.mark.slow
def test_xml_of_a_robot_arena():
    """The MJCF of a world with a robot, meshes and all, compiles to the model of that world."""
    arena = with_robot("ur5e")
    params = arena.sample_params(jax.random.key(3), worlds.RANGES)
    from_xml, compiled = mujoco.MjModel.from_xml_string(arena.to_xml(params)), arena.compile(params)
    for name in (
        "body_pos",
        "body_quat",
        "geom_size",
        "geom_pos",
        "qpos0",
        "body_mass",
        "actuator_gainprm",
        "key_qpos",
    ):
        np.testing.assert_allclose(getattr(from_xml, name), getattr(compiled, name), rtol=2e-6, atol=2e-6, err_msg=name)


def test_from_xml_of_an_arena_of_ours():
    """Elements of the scene that have the names of ours stay as they are."""
    before = mja.TableArena().mj_model
    after = mja.Arena.from_xml(mja.TableArena().xml, ["table"]).mj_model
    for leg in range(1, 5):
        name = f"table_leg{leg}_visual"
        np.testing.assert_allclose(after.geom(name).size, before.geom(name).size, atol=1e-6)


@pytest.mark.slow
def test_objects_keep_clear_of_what_stands_on_a_table_of_a_scene():
    """No object is placed into the lamp on the desk."""
    arena = office()
    lamp = arena.mj_model.body("lamp").id
    data = mujoco.MjData(arena.mj_model)
    mujoco.mj_forward(arena.mj_model, data)
    params = arena.nominal_params()
    placed = jax.jit(jax.vmap(lambda key: arena.place(params, key)))(jax.random.split(jax.random.key(1), 500))
    assert placed.valid.all()
    away = np.asarray(placed.qpos)[:, 0, :2] - data.xpos[lamp, :2]
    assert np.hypot(*away.T).min() > 0.02 + 0.025
    covered = """<mujoco><worldbody><body name="t"><geom name="top" type="box" size=".5 .5 .1"/>
      <geom type="box" size=".5 .5 .1" pos="0 0 .2"/></body></worldbody></mujoco>"""
    full = mja.Arena.from_xml(covered, ["top"], objects=[mja.Object("cube")])
    with pytest.warns(UserWarning, match="start"):
        full.layout  # noqa: B018
    assert not full.place(full.nominal_params(), jax.random.key(0)).valid.any()


def test_tendon_armature_counts():
    """A tendon's armature is part of the mean inertia, in worlds of other masses, too."""
    robot = """<mujoco><worldbody><body><joint name="hinge" axis="0 1 0"/><geom type="box" size=".05 .05 .2"/></body></worldbody>
      <tendon><fixed armature="5"><joint joint="hinge" coef="2"/></fixed></tendon></mujoco>"""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.attach(robot, pos=(2, 0, 1))
    params = arena.nominal_params()
    for heavier in (1.0, 3.0):
        world = params._replace(object_masses=params.object_masses * heavier)
        got = jax.jit(arena.apply)(arena.put_model("jax"), world).stat.meaninertia
        np.testing.assert_allclose(got, arena.compile(world).stat.meaninertia, rtol=1e-5)
    assert got > 2.5


ON_DESK = """<mujoco><worldbody><geom type="plane" size="0 0 .1"/>
  <body name="desk" pos="1 0 0" euler="0 0 30"><geom type="box" size=".6 .4 .02" pos="0 0 .72"/></body>
  <body name="bench" pos="-1 0 0"><geom type="box" size=".6 .4 .02" pos="0 0 .38"/></body>
  <body name="cup" pos="1.3 .2 .79"><freejoint/><geom type="cylinder" size=".04 .05"/></body>
  <body name="lying" pos="1 0 .765" euler="90 0 0"><freejoint/><geom type="capsule" size=".02 .1"/></body>
  <body name="hanging" pos="1 0 .9"><freejoint/><geom size=".05"/></body>
  <body name="beside" pos=".4 .5 .79"><freejoint/><geom size=".05"/></body>
  <body name="ghost" pos="1 0 .79"><freejoint/><geom size=".05" contype="0" conaffinity="0"/></body>
  <body pos="-1.2 .1 .45"><freejoint/><geom type="box" size=".05 .05 .05"/></body>
</worldbody></mujoco>"""
LEFT = {
    "desk": "`ranges` varies table 'desk', on which the free bodies 'cup', 'lying' of the scene stay where they are: name each "
    "among the `objects` of from_xml, which follow their table.",
    "bench": "`ranges` varies table 'bench', on which the free body 'world/body0' (unnamed) of the scene stays where it "
    "is: name it among the `objects` of from_xml, which follow their table.",
}


@pytest.mark.parametrize(
    ("ranges", "left"),
    [
        ({"table_offsets": mja.Uniform([[0, 0, -0.1], [0, 0, 0]], [[0, 0, 0.1], [0, 0, 0]], relative="add")}, ["desk"]),
        ({"table_offsets": mja.Uniform([[0, 0, 0], [0.1, 0, 0]], [[0, 0, 0], [0.2, 0, 0]], relative="add")}, ["bench"]),
        ({"table_rots": mja.Uniform(-0.5, 0.5)}, ["desk", "bench"]),
        ({"table_full_sizes": mja.Uniform([0.5, 1, 1], [1.5, 1, 1], relative="scale")}, ["desk", "bench"]),
        ({"table_active": mja.Bernoulli([1, 0.5])}, ["bench"]),
        ({"workspace": mja.Workspace((-3, -3), (3, 3))}, ["desk", "bench"]),
        ({"table_full_sizes": mja.Uniform([1, 1, 0.5], [1, 1, 2], relative="scale")}, []),  # tops stay
        ({"table_frictions": mja.Uniform([0.2, 0.005, 0.0001], [1, 0.005, 0.0001])}, []),
    ],
)
def test_free_bodies_of_a_scene_do_not_follow_its_tables(ranges, left):
    """What stands on a table that varies and is no object is warned of by name, and nothing else."""
    objects = [mja.Object("cube", on="desk", pos=(-0.3, 0)), mja.Object("book", on="bench")]
    arena = mja.Arena.from_xml(ON_DESK, ["desk", "bench"], objects=objects)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        arena.sample_params(jax.random.key(0), mja.ArenaRanges(**ranges))
    assert [str(warning.message) for warning in found] == [LEFT[table] for table in left]
    assert all(warning.filename == __file__ for warning in found)


def test_ranges_are_looked_at_again():
    """What is attached to a table keeps that from being absent, in ranges that were right before, too."""
    arena = mja.MultiTableArena([[0, 0, 0.8], [0, 1.5, 0.8]], objects=[mja.Object("cube")])
    ranges = mja.ArenaRanges(table_active=mja.Bernoulli(0.5))
    arena.sample_params(jax.random.key(0), ranges)
    arena.attach("<mujoco><worldbody><body><geom size='.05'/></body></worldbody></mujoco>", on=0)
    with pytest.raises(ValueError, match=r"^`ranges.table_active`: table 0 can be absent, but 'robot_mount' is fixed"):
        arena.sample_params(jax.random.key(0), ranges)
