"""Free bodies of a user's scene as objects of the arena."""

import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from oracle import STRUCTURE_MAY_DIFFER, from_compiled

import mjx_arenas as mja
from mjx_arenas.problems.messages import problems_of

pytestmark = [
    pytest.mark.filterwarnings("ignore:`ranges.object_full_sizes` does not change"),
    pytest.mark.filterwarnings("ignore:`ranges.object_frictions` has no effect"),
]

SCENE = """<mujoco><compiler angle="degree"/><asset><material name="red" rgba="1 0 0 1"/></asset>
  <worldbody><geom name="floor" type="plane" size="0 0 .1"/>
  <body name="desk" pos="1 0 0" euler="0 0 30"><geom type="box" size=".6 .4 .02" pos="0 0 .72"/></body>
  <body name="bench" pos="-1 0 0"><geom name="seat" type="box" size=".6 .4 .02" pos="0 0 .38"/></body>
  <body name="cup" pos="1.3 .2 .79" euler="0 0 20"><freejoint/><geom type="box" size=".04 .04 .05" material="red"/></body>
  <body name="lying" pos="1 0 .76" euler="90 0 0"><freejoint name="lie"/><geom type="capsule" size=".02 .1"/></body>
  <body name="rod" pos="1 -.2 .765" euler="0 0 50"><freejoint/><geom name="r" type="capsule" fromto="-.1 0 0 .1 0 0" size=".025"/>
    <site name="tip" pos=".1 0 0"/></body>
  <frame pos="-1 0 0" euler="0 0 90"><body name="mug" pos=".1 .1 .4"><freejoint name="of_mug"/>
    <geom type="box" size=".05 .04 .03" pos=".01 .02 .03" mass=".2"/>
    <body name="lid" pos="0 0 .08"><joint name="hinge" axis="0 1 0"/><geom type="box" size=".03 .03 .005" mass=".01"/></body></body></frame>
  <body name="ball" pos="-1.3 .1 .45"><freejoint name="of_ball"/><geom name="b" size=".05" density="400" rgba="0 .5 1 1"/></body>
  </worldbody><keyframe><key name="home"
    qpos="0 0 1 1 0 0 0  0 1 1 1 0 0 0  0 2 1 1 0 0 0  0 3 1 1 0 0 0 .3  0 4 1 1 0 0 0"/></keyframe></mujoco>"""
OBJECTS = ("cup", "lying", "rod", mja.Object("new", on="bench", pos=(0.3, 0.2)), "mug", "ball")
RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.1, -0.1, -0.2], [0.1, 0.1, 0.2], relative="add"),
    table_rots=mja.Uniform(-1, 1),
    table_full_sizes=mja.Uniform(0.9, 1.2, relative="scale"),
    object_full_sizes=mja.Uniform(0.8, 1.2, relative="scale"),
    object_masses=mja.Uniform(0.5, 2, relative="scale"),
    object_frictions=mja.Uniform(0.5, 1.5, relative="scale"),
    object_rgba=mja.Uniform(0.2, 1),
    object_tables=mja.Choice([0, 1]),
)


@functools.cache
def arena():
    return mja.Arena.from_xml(SCENE, ["desk", "bench"], objects=OBJECTS)


def stands(xml):
    """A model, and its data at `qpos0`."""
    model = mujoco.MjModel.from_xml_string(xml) if isinstance(xml, str) else xml
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def test_nominally_the_scene():
    """Every body that the arena takes over has its names, stands where it stood and weighs what it weighed."""
    (before, then), (after, now) = stands(SCENE), stands(arena().mj_model)
    for name in ("cup", "lying", "rod", "mug", "lid", "ball"):
        np.testing.assert_allclose(now.body(name).xpos, then.body(name).xpos, rtol=0, atol=1e-12)
        np.testing.assert_allclose(now.body(name).xmat, then.body(name).xmat, rtol=0, atol=1e-12)
        np.testing.assert_allclose(after.body(name).mass, before.body(name).mass, rtol=1e-12)
        np.testing.assert_allclose(after.body(name).inertia, before.body(name).inertia, rtol=1e-9)
    np.testing.assert_allclose(now.site("tip").xpos, then.site("tip").xpos, rtol=0, atol=1e-12)
    assert [after.joint(name).bodyid[0] for name in ("lie", "of_mug", "of_ball")] == [
        after.body(name).id for name in ("lying", "mug", "ball")
    ]
    assert [o.type for o in arena().objects] == ["box", "mjcf", "capsule", "box", "mjcf", "sphere"]
    assert [o.on for o in arena().objects] == [0, 0, 0, "bench", 1, 1]
    nominal = arena().nominal_params()
    np.testing.assert_allclose(nominal.object_rgba[0], [1, 0, 0, 1])
    np.testing.assert_allclose(nominal.object_full_sizes[2], [0.25, 0.05, 0.05], atol=1e-7)


@pytest.mark.slow
def test_oracle(impl):
    """What is of the scene varies exactly, whatever table it stands on."""
    model = arena().put_model(impl)
    apply = jax.jit(arena().apply)
    for key in jax.random.split(jax.random.key(1), 4):
        params = arena().sample_params(key, RANGES)
        assert from_compiled(apply(model, params), arena().compile(params)) <= STRUCTURE_MAY_DIFFER.keys()


def test_they_rest_in_c():
    """Placed by keys on tables that vary, what is there rests where C MuJoCo leaves it, in the pose that it had."""
    keys = jax.random.split(jax.random.key(2), 3)
    for key in keys:
        params = arena().sample_params(key, RANGES)._replace(object_tables=jnp.array([0, 1, 0, 1, 1, 0]))
        placed = arena().place(params, key)
        assert placed.valid.all()
        model, data = arena().c_world(params, key=key)
        start = data.qpos.copy()
        mujoco.mj_step(model, data, 150)
        rest = np.asarray(arena().rest_heights(params))
        for k, obj in enumerate(arena().objects):
            at = model.joint(obj.joint).qposadr[0]
            np.testing.assert_allclose(start[at : at + 7], placed.qpos[k], atol=1e-6)
            assert data.qpos[at + 2] == pytest.approx(rest[k], abs=1e-3)
        axis = data.body("lying").xmat.reshape(3, 3)[:, 2]
        assert abs(axis[2]) < 0.01


@pytest.mark.slow
def test_keyframes(impl):
    """Keyframes that the scene has start what no object is; the objects are placed."""
    keys = jax.random.split(jax.random.key(3), 2)
    batch = arena().randomize(arena().put_model(impl), keys, RANGES)
    data = mja.make_data(batch, keys, keyframe="home")
    model = arena().mj_model
    np.testing.assert_allclose(data.qpos[:, model.joint("hinge").qposadr[0]], 0.3, rtol=1e-6)
    for i, key in enumerate(keys):
        placed = arena().place(batch.world(i), key).qpos
        np.testing.assert_allclose(np.asarray(data.qpos)[i][arena().layout.object_qpos], placed, atol=1e-6)


@pytest.mark.slow
def test_they_come_and_go():
    """One that is absent, or whose table is, is not in the compiled world; the others rest as before."""
    params = (
        arena()
        .nominal_params()
        ._replace(table_active=jnp.array([True, False]), object_active=jnp.array([True, False, True, True, True, True]))
    )
    model = arena().compile(params)
    names = {model.body(b).name for b in range(model.nbody)}
    assert names == {"world", "desk", "cup", "rod"}
    batch = arena().batch(arena().put_model("jax"), jax.tree.map(lambda x: x[None], params))
    gone = [arena().mj_model.body(name).id for name in ("lying", "mug", "lid", "ball", "new")]
    assert not np.asarray(batch.model.body_mass)[0, gone].any()
    xml = arena().to_xml(params)
    assert mujoco.MjModel.from_xml_string(xml).nbody == model.nbody


@pytest.mark.slow
def test_merged_and_written():
    """In a merged arena, in files and in MJCF they are what they were."""
    thing = mja.Object("thing", variants=[mja.Object("cube"), mja.Object("ball", type="sphere", full_size=0.07)])
    merged = mja.TableArena(objects=[thing]).merge(arena(), "m_", pos=(5, 0, 0))
    _, now = stands(merged.mj_model)
    _, then = stands(SCENE)
    for name in ("lying", "mug", "rod", "lid"):
        np.testing.assert_allclose(now.body(f"m_{name}").xpos, then.body(name).xpos + np.array([5, 0, 0]), atol=1e-9)
        np.testing.assert_allclose(now.body(f"m_{name}").xmat, then.body(name).xmat, atol=1e-9)
    assert [o.joint for o in merged.objects][-2:] == ["m_of_mug", "m_of_ball"]
    params = merged.with_variants(merged.nominal_params(), thing="ball")
    world, compiled = jax.jit(merged.apply)(merged.put_model("jax"), params), merged.compile(params)
    assert compiled.nbody == merged.mj_model.nbody
    for field in ("body_mass", "body_inertia", "body_pos", "body_ipos"):
        np.testing.assert_allclose(getattr(world, field), getattr(compiled, field), rtol=1e-5, atol=1e-7, err_msg=field)
    for name in ("thing_ball_g0", "r", "b"):
        named = name if name.startswith("thing") else f"m_{name}"
        size = world.geom_size[merged.mj_model.geom(named).id]
        np.testing.assert_allclose(size, compiled.geom(named).size, rtol=1e-6)
    params = arena().sample_params(jax.random.key(5), RANGES)
    again, want = mujoco.MjModel.from_xml_string(arena().to_xml(params)), arena().compile(params)
    for field in ("body_pos", "body_quat", "geom_size", "qpos0", "body_mass"):
        np.testing.assert_allclose(getattr(again, field), getattr(want, field), atol=1e-6, err_msg=field)


def test_in_a_file(tmp_path):
    """`{name: mug, type: scene}` in a file is the mug of the scene."""
    (tmp_path / "scene.xml").write_text(SCENE)
    one = mja.Arena.from_xml(tmp_path / "scene.xml", ["desk", "bench"], objects=OBJECTS)
    mja.save(tmp_path / "arena.yaml", one, mja.ArenaRanges(table_offsets=RANGES.table_offsets))
    assert "{name: mug, type: scene}" in (tmp_path / "arena.yaml").read_text()
    again, _ = mja.load(tmp_path / "arena.yaml")
    assert again.mj_model.names == one.mj_model.names
    np.testing.assert_array_equal(again.mj_model.qpos0, one.mj_model.qpos0)


def test_what_is_asked_for():
    """Mass, friction, colour and presence of a body of the scene may be said."""
    mug = mja.Object(
        "mug", "scene", on="seat", mass=0.5, friction=(0.3, 0.01, 0.001), rgba=(1, 1, 1, 0.5), active=False
    )
    one = mja.Arena.from_xml(SCENE, ["bench"], objects=[mug])
    nominal = one.nominal_params()
    assert nominal.object_masses[0] == 0.5
    np.testing.assert_allclose(nominal.object_frictions[0], [0.3, 0.01, 0.001])
    assert not nominal.object_active[0]
    assert "mug" not in one.xml
    there = one.compile(nominal._replace(object_active=jnp.array([True])))
    assert there.body("mug").subtreemass[0] == pytest.approx(0.5)
    assert there.geom_rgba[there.body("mug").geomadr[0], 3] == 0.5


BODY = '<body name="{}" pos="{}"><freejoint/><geom type="box" size=".05 .05 .05" {}/>{}</body>'
ODD = SCENE.replace(
    "</worldbody>",
    BODY.format("high", "-1 0 .5", "", "")
    + BODY.format("floor_box", "0 3 .05", "", "")
    + BODY.format("ghost", "-1 0 .45", 'contype="0" conaffinity="0"', "")
    + BODY.format("other", "-1 0 .45", 'contype="2" conaffinity="2"', "")
    + BODY.format("rough", "-1 0 .45", "", '<geom friction="2" size=".01"/>')
    + "</worldbody>",
)
NEW = mja.Object
WRONG = {
    "no body": (["mag"], "Object 'mag': the scene has no body of that name; its free bodies: 'cup', 'lying', 'rod', "),
    "no free body": (
        ["desk"],
        "Object 'desk': the body has no free joint, which an object must have; the free bodies of the scene: ",
    ),
    "part of a free body": (["lid"], "Object 'lid': the body has no free joint"),
    "in the air": (
        ["high"],
        (
            "Object 'high' stands on none of `tables`: below the middle of its lowest side, at (-1, 0, 0.45), is table "
            "'bench', whose top is 0.05 m below that."
        ),
    ),
    "on the floor": (["floor_box"], "at (0, 3, 0), is no table."),
    "of nothing that collides": (
        ["ghost"],
        "Object 'ghost': none of its geoms collides, so it cannot stand on a table.",
    ),
    "falls through": (
        ["other"],
        "Object 'other' would fall through table 'bench', as none of its geoms collides with the slab",
    ),
    "of two frictions": (["rough"], "Object('rough', 'scene', friction=...)"),
    "twice": (["mug", "mug"], "Two objects are named 'mug': names must differ."),
    "a new one of that name": (["mug", NEW("mug")], "Two objects are named 'mug': names must differ."),
    "taken": ([NEW("mug")], "Object 'mug': the arena already has an element of that name."),
    "another table": (
        [NEW("mug", "scene", on="desk")],
        "Object 'mug': `on` must be 'bench', on which it stands in the scene",
    ),
    "a size": (
        [NEW("mug", "scene", 0.1)],
        "Object 'mug': `full_size` cannot be given for a body of the scene, as the scene decides it, got 0.1.",
    ),
    "a place": ([NEW("mug", "scene", pos=(0, 0))], "Object 'mug': `pos` cannot be given for a body of the scene"),
    "a yaw": ([NEW("mug", "scene", rot=1)], "Object 'mug': `rot` cannot be given for a body of the scene"),
    "variants": (
        [NEW("mug", "scene", variants=[NEW("a"), NEW("b")])],
        "Object 'mug': `variants` must be None, as a body of the scene is the same in every world: only objects that the arena",
    ),
    "a file": ([NEW("mug", "scene", file="mug.xml")], "Object 'mug': `file` cannot be given for a body of the scene"),
    "a density": (
        [NEW("mug", "scene", density=100)],
        "Object 'mug': `density` cannot be given for a body of the scene",
    ),
    "no mass": ([NEW("mug", "scene", mass=-1)], "Object 'mug': `mass` must be"),
    "a name, no list": ("mug", "`objects` must be a list of mjx_arenas.Object, got 'mug'."),
    "no text": ([3], "`objects[0]` must be an mjx_arenas.Object, got 3."),
}


@pytest.mark.parametrize("what", WRONG)
def test_wrong(what):
    """Each is answered by one sentence."""
    objects, sentence = WRONG[what]
    with pytest.raises(ValueError, match="bject") as error:
        mja.Arena.from_xml(ODD, ["desk", "bench"], objects=objects)
    assert sentence in str(error.value)
    assert len(problems_of(error.value)) == 1


def test_only_of_scenes():
    """Other arenas have no bodies to take over."""
    with pytest.raises(ValueError, match=r"^Object 'mug': `type` must be one of .*, got 'scene'\.$"):
        mja.TableArena(objects=[mja.Object("mug", "scene")])
    with pytest.raises(ValueError, match=r"^Object 'jug': `type` must be one of .*, got 'scene'\.$"):
        mja.Arena.from_xml(SCENE, ["bench"]).add_object(mja.Object("jug", "scene"))


@pytest.mark.parametrize(
    "given",
    [
        lambda cup: mja.TableArena(objects=[cup]),
        lambda cup: mja.TableArena().add_object(cup),
        lambda cup: mja.Arena.from_xml(SCENE, ["desk"], objects=[cup]),
    ],
)
def test_of_one_arena(given):
    """What an arena took over is no object of another."""
    with pytest.raises(
        ValueError, match=r"^Object 'cup' is a body of another arena's scene: give its name to "
    ) as error:
        given(arena().objects[0])
    assert len(problems_of(error.value)) == 1
