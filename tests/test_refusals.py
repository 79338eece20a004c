"""What else calls are refused for, each with one sentence: states, files, models, and what was added to an arena."""

import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from refused import arena, open_arena, told

import mjx_arenas as mja
from mjx_arenas import envs


@functools.cache
def batch():
    """Two nominal worlds."""
    one = arena()
    model, params = one.put_model("jax"), one.nominal_params()
    return mja.ArenaBatch(model, jax.tree.map(lambda x: jnp.stack([x, x]), params), jnp.ones(2, bool), (), one)


@functools.cache
def data():
    """Of one world."""
    return arena().make_world_data(arena().put_model("jax"), arena().nominal_params())


def roped(**kwargs):
    """Two boxes with a rope between them, of the length that it has."""
    one = mja.TableArena(objects=[mja.Object("a", pos=(0, 0)), mja.Object("b", pos=(0.2, 0))])
    for name in "ab":
        one.spec.body(name).add_site(name=f"end_{name}")
    rope = one.spec.add_tendon(name="rope", stiffness=[50, 0, 0], **kwargs)
    rope.wrap_site("end_a")
    rope.wrap_site("end_b")
    return one


def edited(edit):
    """Two tables and a cube, whose spec was edited."""
    one = open_arena()
    edit(one.spec)
    return one


def in_scene(inside, **kwargs):
    return mja.TableArena(xml=f"<mujoco>{inside}</mujoco>", **kwargs)


CUBE = [mja.Object("cube")]
STALE = "would be stale in other worlds"
HILLS = """<asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset>
  <worldbody><geom name="hills" type="hfield" hfield="h"/></worldbody>"""
POST = '<worldbody><geom name="post" type="cylinder" size=".1 .1"/></worldbody>'
ADHESION = """<mujoco><worldbody><body name="b" pos="0 0 3"><joint type="slide"/><geom size=".1"/></body></worldbody>
  <actuator><adhesion body="b" ctrlrange="0 1" gain="10"/></actuator></mujoco>"""
GONE = {
    "body 'cube'": lambda spec: spec.delete(spec.body("cube")),
    "joint 'cube_joint0'": lambda spec: spec.delete(spec.joint("cube_joint0")),
    "body 'table1'": lambda spec: setattr(spec.body("table1"), "name", "desk"),
    "geom 'table0_visual'": lambda spec: setattr(spec.geom("table0_visual"), "name", "slab"),
}


@pytest.mark.parametrize("what", GONE)
def test_what_is_gone(what):
    """A table or an object that was deleted or renamed is missed by all that reads the spec."""
    message = (
        f"`arena.spec`: {what} of a table, an object or a part is gone: do not delete or rename it (`table_active` "
        "and `active` of an object or a part make it absent)."
    )
    one = edited(GONE[what])
    for call in (
        lambda: one.check_ranges(mja.ArenaRanges()),
        lambda: one.attach(POST.join(("<mujoco>", "</mujoco>"))),
        lambda: one.merge(arena(), "b_"),
        lambda: one.xml,
        lambda: one.mj_model,
    ):
        with pytest.raises(ValueError, match="is gone") as raised:
            call()
        assert str(raised.value) == message


def test_edited_model():
    """Of the compiled model options and visual settings may change alone: worlds have nothing else of it."""
    one = open_arena()
    params = one.nominal_params()
    one.mj_model.opt.timestep, one.mj_model.vis.global_.offwidth = 0.001, 100
    assert one.compile(params).opt.timestep == 0.001
    one.mj_model.geom_friction[:] = 2
    for call in (
        lambda: one.compile(params),
        lambda: one.put_model("jax"),
        lambda: one.merge(arena(), "b_"),
        lambda: one.xml,
    ):
        with pytest.raises(ValueError, match="geom_friction") as raised:
            call()
        assert str(raised.value) == (
            "`arena.mj_model`: geom_friction changed after the arena was compiled, without effect on its worlds: edit "
            "`arena.spec` before the first use of the model (options, `mj_model.opt`, may change)."
        )


LEFT_OUT = "leave `{}` out of the MJCF's <flag>, or "
UNTAKEN = [  # options that neither implementation takes: what else to do, and what each of them says
    ('solver="PGS"/>', "", "mjtSolver.mjSOL_PGS", "mjSOL_PGS is unsupported"),
    (
        '><flag override="enable"/></option>',
        LEFT_OUT.format("override"),
        "mjtEnableBit.mjENBL_OVERRIDE",
        "mjENBL_OVERRIDE is unsupported",
    ),
]
MODELS = {
    "table with a joint": (
        lambda: edited(lambda spec: spec.body("table0").add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE)).put_model("jax"),
        r"`arena\.spec`: body 'table0' must be a fixed child of the world, without a frame, to serve as a table\.$",
    ),
    "adhesion": (
        lambda: (lambda a: (a.attach(ADHESION), a.put_model("jax")))(open_arena()),
        r"impl='jax' of MJX does not simulate what is in the arena, .*BODY.* not supported: use impl='warp' or C MuJoCo",
    ),
    **{
        f"{setting} on {impl}": (
            lambda setting=setting, impl=impl: in_scene(f"<option {setting}").put_model(impl),
            rf"^impl='{impl}' of MJX does not simulate what is in the arena, {told}: {flag}use C MuJoCo \(`c_world`, `c_batch`\)\.$",
        )
        for setting, flag, on_jax, on_warp in UNTAKEN
        for impl, told in (("jax", on_jax), ("warp", on_warp))
    },
    "rope": (
        lambda: roped().mj_model,
        rf"`arena\.spec`: tendon_lengthspring of tendon 'rope' {STALE}: .* give the tendon a `spr",
    ),
    "rope's armature": (
        lambda: roped(springlength=[0, 0.3], armature=0.1).mj_model,
        "`arena.spec`: the armature of tendon 'rope'.* inverse weights stale in other worlds: leave it at 0",
    ),
    "pixels": (
        lambda: (
            edited(lambda spec: spec.add_texture(name="t", width=1, height=1, nchannel=3, data=list(b"abc"))).mj_model
        ),
        r"^`arena\.spec`: texture 't' has its pixels in `data`, which MJCF cannot hold: write them into a file, and give the texture",
    ),
    "fusestatic": (lambda: in_scene('<compiler fusestatic="true"/>'), "`spec.compiler`: fusestatic .* remove bodies"),
    "boundmass": (
        lambda: in_scene('<compiler boundmass=".5" boundinertia=".1"/>', objects=CUBE),
        "`spec.compiler`: boundmass, boundinertia would change the masses of objects",
    ),
    "a box on a height field": (
        lambda: in_scene(HILLS, objects=CUBE).put_model("jax"),
        r"impl='jax' of MJX loses contacts of geom 'cube_g0' \(box\) with height field 'hills': use impl='warp', spheres",
    ),
    "a ball on a height field": (
        lambda: in_scene(HILLS, objects=[mja.Object("ball", "sphere", 0.1)]).put_model("jax"),
        r"impl='jax' of MJX cannot vary the size of geom 'ball_g0' \(`object_full_sizes`\), as it tests height field 'hills' only as far",
    ),
    "no collision function": (
        lambda: in_scene(POST, objects=CUBE).put_model("jax"),
        r"impl='jax' has no collision function for geoms 'post' \(cylinder\) and 'cube_g0' \(box\): use impl='warp'",
    ),
    "cylinder": (
        lambda: mja.TableArena(objects=[mja.Object("c", "cylinder", (0.1, 0.1, 0.3))]).put_model("jax"),
        r"impl='jax' has no collision function for geoms 'c_g0' \(cylinder\) and 'table_collision' \(box\)",
    ),
    "no degree of freedom": (
        lambda: (lambda a: a.make_world_data(a.put_model("jax"), a.nominal_params()))(mja.TableArena()),
        "MJX cannot step a model without a degree of freedom: give the arena `objects=`",
    ),
}


@pytest.mark.parametrize("case", MODELS)
def test_models(case):
    call, message = MODELS[case]
    with pytest.raises(ValueError, match=f"^{message}"):
        call()


TWO = "`batch` and `data` must be an ArenaBatch and its mjx.Data, got str and str."
OF_TWO = "`data` must be of the 2 worlds of the batch, got one world."
RANGES = "`ranges` must be an mjx_arenas.ArenaRanges, got int."
CALLS = {
    "impl": (ValueError, lambda: arena().put_model("cuda"), "`impl` must be 'jax', 'warp' or None, got 'cuda'."),
    "data and key": (
        ValueError,
        lambda: arena().c_world(arena().nominal_params(), data(), jax.random.key(0)),
        "`key` must be None with `data`, in which the objects have their places.",
    ),
    "step, data of one": (ValueError, lambda: mja.step(batch(), data()), OF_TWO),
    "capacity, data of one": (ValueError, lambda: mja.capacity(batch(), data()), OF_TWO),
    "step swapped": (TypeError, lambda: mja.step("data", "batch"), TWO),
    "capacity swapped": (TypeError, lambda: mja.capacity("data", "batch"), TWO),
    "rollout swapped": (TypeError, lambda: mja.rollout("data", "batch", 1), TWO),
    "film swapped": (TypeError, lambda: mja.video("data", "batch", "a.mp4"), TWO),
    "record": (
        TypeError,
        lambda: mja.rollout(batch(), data(), 1, record="qpos"),
        "`record` must be a function of the data, such as lambda d: d.qpos, or None, got 'qpos'.",
    ),
    "progress": (
        TypeError,
        lambda: mja.check(arena(), mja.ArenaRanges(), 1, progress=True),
        "`progress` must be None or a function of two numbers, the finished and the total work, got True.",
    ),
    "take of a batch": (
        ValueError,
        lambda: mja.take(batch(), 0),
        "`worlds` must be of many worlds, (W, ...) with the same W in all arrays, got an ArenaBatch: take its `world(i)`.",
    ),
    "world": (
        IndexError,
        lambda: batch().world(2),
        "`index` must be one number from -2 to 1, a list of them or a slice, got 2.",
    ),
    "worlds": (
        IndexError,
        lambda: batch().world(slice(2, 2)),
        "`index` must be one number from -2 to 1, a list of them or a slice, got slice(2, 2, None).",
    ),
    "traced world": (
        TypeError,
        lambda: jax.jit(lambda i: batch().world(i))(0),
        "`index` must be known numbers, got traced ones: inside of jax.jit, index each array, as in "
        "jax.tree.map(lambda x: x[i], batch.params).",
    ),
    "traced worlds": (
        TypeError,
        lambda: jax.jit(lambda i: mja.take(batch(), [i, 1]))(0),
        "`index` must be known numbers, got traced ones: inside of jax.jit, index each array, as in "
        "jax.tree.map(lambda x: x[i], batch.params).",
    ),
    "data of what": (
        TypeError,
        lambda: mja.make_data(arena()),
        "`batch` must be an ArenaBatch, from arena.randomize() or arena.batch(), got MultiTableArena.",
    ),
    "ranges": (TypeError, lambda: arena().sample_params(jax.random.key(0), 5), RANGES),
    "valid's ranges": (TypeError, lambda: arena().valid(arena().nominal_params(), 5), RANGES),
    "nothing varies": (
        ValueError,
        lambda: arena().randomization_fn(mja.ArenaRanges()),
        "`ranges` gives no quantity a distribution: there is nothing to randomize.",
    ),
    "attach late": (
        ValueError,
        lambda: (arena().mj_model, arena().attach("<mujoco/>")),
        "`attach`: the arena is compiled already: attach before the first use of the model.",
    ),
    "merge": (TypeError, lambda: arena().merge("arena.xml", "b_"), "`other` must be an arena, got str."),
    "keyframe": (
        ValueError,
        lambda: arena().make_world_data(arena().put_model("jax"), arena().nominal_params(), keyframe="home"),
        "`keyframe` must be None, as the arena has no keyframes, got 'home'.",
    ),
    "set_const": (
        TypeError,
        lambda: mja.set_const(arena().mj_model),
        "`model` must be an mjx.Model (of an MjModel: mujoco.mj_setConst), got MjModel.",
    ),
    "replay": (TypeError, lambda: mja.replay(5), "`bundle` must be a path, got int."),
    "save": (TypeError, lambda: mja.save(arena(), "a.yaml"), "`path` must be a path, got MultiTableArena."),
    "export": (TypeError, lambda: arena().export(arena().nominal_params(), 5), "`folder` must be a path, got int."),
    "robot's name": (
        FileNotFoundError,
        lambda: mja.simplify("panda"),
        "`robot`: there is no file 'panda'. `mja.robots.load` finds robots of installed packages by their names.",
    ),
    "flag": (
        ValueError,
        lambda: mja.simplify("<mujoco/>", self_collisions="no"),
        "`self_collisions` must be true or false, got 'no'.",
    ),
    "arena": (
        TypeError,
        lambda: mja.Arena("scene.xml"),
        "Arena is made by TableArena(...), MultiTableArena(...), Arena.from_xml(...) or mja.load(...).",
    ),
    "traced": (
        TypeError,
        lambda: jax.jit(arena().to_xml)(arena().nominal_params()),
        "`params` must be numbers, got traced ones: what MuJoCo makes of them is outside jax.jit and jax.vmap.",
    ),
}


@pytest.mark.parametrize("case", CALLS)
def test_calls(case):
    error, call, message = CALLS[case]
    with pytest.raises(error) as raised:
        call()
    assert (type(raised.value), str(raised.value)) == (error, message)


def test_keys_and_steps_of_a_batch():
    keys = jax.random.split(jax.random.key(0), 3)
    assert told(lambda: mja.make_data(batch(), keys)) == [("keys", None, "one_each")]
    assert told(lambda: mja.make_data(batch(), keys[0])) == [("keys", None, "keys_shape")]
    assert told(lambda: mja.rollout(batch(), None, 2.5)) == [("n_steps", None, "must")]
    assert told(lambda: arena().describe(batch())) == [("params", None, "params_of")]
    assert told(lambda: arena().valid(batch().params)) == [("params", None, "one_world")]


def test_data_of_wrong_shapes():
    """Arrays that a user puts into data, before anything is compiled; a missing vmap."""
    two = jax.tree.map(lambda x: jnp.stack([x, x]), data())
    for name, value in {"qpos": two.qpos[:, :4], "ctrl": None, "mocap_pos": jnp.zeros((2, 1, 3))}.items():
        with pytest.raises(ValueError, match=rf"^`data\.{name}` must have shape \(2, .*\), got [(N]"):
            mja.step(batch(), two.replace(**{name: value}))
    with pytest.raises(ValueError, match=r"^`place_static` takes one world: jax\.vmap"):
        mja.place_static(batch().model, two)


GOOD = {
    "integers": lambda: mja.MultiTableArena([[0, 0, 1], [2, 0, 1]], table_rots=[0, 1], table_full_sizes=(1, 1, 1)),
    "tuples": lambda: mja.MultiTableArena(((0, 0, 1), (2, 0, 1)), (0, 1), has_legs=(1, 0)),
    "0-d arrays": lambda: mja.MultiTableArena(np.array([[0, 0, 1], [2, 0, 1]]), np.array(0.5), has_legs=np.array(True)),
    "JAX arrays": lambda: mja.MultiTableArena(jnp.array([[0.0, 0.0, 1.0]]), jnp.array([0.5])),
    "no legs, on the floor": lambda: mja.TableArena((1, 1, 0.1), table_offset=(0, 0, 0.05), has_legs=False),
}


@pytest.mark.parametrize("case", GOOD)
def test_good_input(case):
    """Integers, lists, tuples and 0-d arrays are fine."""
    assert GOOD[case]().mj_model.ngeom > 0


def test_additions_to_objects():
    """Sites, cameras and lights may be added to an object's body, and rules of masses are fine without objects."""
    one = open_arena()
    for kind in ("site", "camera", "light"):
        getattr(one.spec.body("cube"), f"add_{kind}")(name="added")
    assert one.mj_model.nsite == 4
    assert mja.TableArena(xml='<mujoco><compiler boundmass=".5"/></mujoco>').mj_model.nbody == 2


def test_environments_say_what_to_install(monkeypatch):
    """Where the extra is not installed."""

    def missing(name):
        raise ModuleNotFoundError("No module named 'ml_collections'", name="ml_collections")

    monkeypatch.setattr(envs, "_getattr", missing)
    with pytest.raises(ImportError, match=r"^mjx_arenas\.envs\.Push needs ml_collections: pip install 'mjx_arenas\[t"):
        envs.__getattr__("Push")  # as `envs.Push`, which lazy-loader may have kept


def test_misspelt_name():
    """Python says "Did you mean: 'Uniform'?" if it knows where the name was looked for."""
    with pytest.raises(AttributeError, match=r"^module 'mjx_arenas' has no attribute 'Unifrom'$") as error:
        mja.Unifrom  # noqa: B018
    assert (error.value.name, error.value.obj) == ("Unifrom", mja)


def test_template_of_another_world():
    """What ranges leave as it is would be that world's, though parameters say nominal."""
    one, model = arena(), arena().put_model("jax")
    other = one.apply(model, one.nominal_params()._replace(table_frictions=np.full((3, 3), 0.5), table_rots=np.ones(3)))
    keys = mja.world_keys(0, [0, 1])
    heights = mja.ArenaRanges(table_offsets=mja.Uniform([0, 0, 0.7], [0, 0, 0.9]))
    with pytest.raises(
        ValueError, match=r"^`model` must have the nominal .*, got other body_quat, geom_friction: give them"
    ):
        one.randomize(other, keys, heights)
    turns = mja.ArenaRanges(table_rots=mja.Uniform(0, 1), table_frictions=mja.Fixed(0.3))
    made = one.randomize(other, keys, turns)
    np.testing.assert_array_equal(made.model.geom_friction[:, one.layout.table_geom[:, 0]], np.float32(0.3))


def test_template_that_is_a_little_other():
    """Any element that a term decides, however small its number; what was edited on the compiled model, too."""
    one = mja.TableArena(objects=[mja.Object("crumb", full_size=0.001)])
    model, ranges, keys = one.put_model("jax"), mja.ArenaRanges(table_rots=mja.Uniform(-1, 1)), mja.world_keys(0, [0])
    body, geom = one.layout.object_body[0], one.layout.primitive_geom[0]
    assert 0 < one.nominal_params().object_masses[0] < 2e-6
    for name, row in {
        "body_mass": body,
        "body_inertia": body,
        "geom_size": geom,
        "geom_friction": geom,
        "geom_rgba": geom,
    }.items():
        other = model.replace(**{name: getattr(model, name).at[row].multiply(1.003)})
        with pytest.raises(ValueError, match=f", got other {name}: give them to the arena"):
            one.randomize(other, keys, ranges)
    assert one.randomize(model, keys, ranges).valid.all()
    one.mj_model.body_mass[body] *= 3
    with pytest.raises(ValueError, match=r"^`arena\.mj_model`: body_mass changed after the arena was compiled"):
        one.randomize(one.put_model("jax"), keys, ranges)


def test_template_with_other_centres_of_mass():
    """Closed forms take them for the origins: refused where a field that is written follows from them, and as good as new."""
    one = mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06)])
    one.spec.worldbody.add_camera(name="c", pos=(2, 0, 2), mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM)
    model, keys = one.put_model("jax"), mja.world_keys(0, [0])
    ball = one.layout.object_body[0]
    other = model.replace(body_ipos=model.body_ipos.at[ball, 2].set(0.02))
    message = r"^`model` has another body_ipos than put_model\(\) gave, .*: change it in the randomized model, and"
    sizes = mja.ArenaRanges(object_full_sizes=mja.Uniform(0.05, 0.07))
    params = jax.tree.map(lambda x: x[None], one.nominal_params())
    for call in (
        lambda: one.apply(other, one.nominal_params()),
        lambda: one.batch(other, params),
        lambda: one.randomize(other, keys, sizes),
    ):
        with pytest.raises(ValueError, match=message):
            call()
    colours = mja.ArenaRanges(object_rgba=mja.Uniform(0, 1))
    assert one.randomize(other, keys, colours).model.body_ipos[ball, 2] == np.float32(0.02)
    heavy = model.replace(body_mass=model.body_mass.at[one.layout.table_body[0]].set(1.0))
    with pytest.raises(ValueError, match=r"^`model` has another body_mass than put_model"):
        one.apply(heavy, one.nominal_params())


def test_parameters_of_numpy():
    """Of a file, say."""
    one = arena()
    params = jax.tree.map(lambda x: np.asarray(x)[None], one.nominal_params())
    made = one.batch(one.put_model("jax"), params)
    assert jax.tree.all(jax.tree.map(lambda x: isinstance(x, jax.Array), made.params))
    assert mja.make_data(made).qpos.shape == (1, one.mj_model.nq)


def test_spec_is_closed_after_compiling(tmp_path):
    """Additions that come too late are refused, not forgotten, by everything that is not given a template."""
    late = mja.TableArena(objects=CUBE)
    template, params, key = late.put_model("jax"), late.nominal_params(), mja.world_keys(0, [0])[0]
    many, ranges = jax.tree.map(lambda x: x[None], params), mja.ArenaRanges(table_offsets=mja.Fixed([0, 0, 0.8]))
    late.merge(mja.TableArena(), prefix="b_", pos=(3, 0, 0))
    late.spec.worldbody.add_geom(name="late", size=(0.1, 0, 0))
    late.spec.compile()
    calls = {
        "put_model": lambda: late.put_model("jax"),
        "xml": lambda: late.xml,
        "save": lambda: mja.save(tmp_path / "late.yaml", late, ranges),
        "check": lambda: mja.check(late, ranges, n_worlds=2, n_steps=2),
        "merge": lambda: late.merge(mja.TableArena(), prefix="b_", pos=(3, 0, 0)),
        "renderer": lambda: late.renderer(["frontview"]),
        "c_batch": lambda: late.c_batch(many),
        "sample_params": lambda: late.sample_params(key, ranges),
        "place": lambda: late.place(params, key),
        **{name: lambda name=name: getattr(late, name)(params, ranges) for name in ("encode", "log_prob")},
        "decode": lambda: late.decode(np.zeros(0), ranges),
        **{
            name: lambda name=name: getattr(late, name)(params)
            for name in (
                "compile",
                "to_xml",
                "c_world",
                "describe",
                "plan",
                "render",
                "valid",
                "problems",
                "rest_heights",
            )
        },
    }
    for call in calls.values():
        with pytest.raises(ValueError, match=r"^`arena\.spec` changed after the arena was compiled"):
            call()
    late.apply(template, params)
    mja.make_data(late.batch(template, many))
