"""Wrong uses of cameras, renderers, pictures and visions: one sentence each, and nothing is changed by them."""

import dataclasses
import re

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.envs import Push, Vision
from mjx_arenas.envs.tasks import looks
from mjx_arenas.envs.vision import Eyes

KNOWN = "frontview, birdview, agentview, sideview"
PRINTED = "must be a string of characters that can be printed, got "
SIZE = "must be (width, height), two whole numbers above 0, got "


def made():
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.vary(board=dr.Term("geom.material", "table_visual"))
    return arena


@pytest.fixture(scope="module")
def arena():
    return made()


RENDERER = {
    "a dict of kinds": (
        {"cameras": ["agentview"], "depth": {"agentview": False}},
        "`depth` must be true, false, or names of cameras, got {'agentview': False}.",
    ),
    "a name in a list": (
        {"cameras": ["agentview"], "depth": [["agentview"]]},
        "`depth` must be names of the `cameras` agentview, got ['agentview'].",
    ),
    "a camera in a list": ({"cameras": [["agentview"]]}, f"`cameras` must be one of {KNOWN}, got ['agentview']."),
    "a camera twice": (
        {"cameras": ["agentview", "agentview"]},
        "`cameras` must be different, got 'agentview' twice.",
    ),
    "a slip": (
        {"cameras": ["agentveiw"]},
        "`cameras`: no camera of the arena is called 'agentveiw': did you mean `agentview`?",
    ),
    "nothing like it": (
        {"cameras": ["wrist"]},
        f"`cameras`: no camera of the arena is called 'wrist'; known are {KNOWN}.",
    ),
    "floats as a size": ({"cameras": {"agentview": np.array([8.0, 8.0])}}, f"`cameras['agentview']` {SIZE}[8.0, 8.0]."),
    "truths as a size": (
        {"cameras": {"agentview": np.array([True, True])}},
        f"`cameras['agentview']` {SIZE}[True, True].",
    ),
    "two sizes": ({"cameras": {"agentview": np.array([[8, 8]])}}, f"`cameras['agentview']` {SIZE}[[8, 8]]."),
    "unknown in a set": (
        {"cameras": {"agentview", "wrist"}},
        f"`cameras`: no camera of the arena is called 'wrist'; known are {KNOWN}.",
    ),
    "unknown in an array": (
        {"cameras": np.array(["agentview", "wrist"])},
        f"`cameras`: no camera of the arena is called 'wrist'; known are {KNOWN}.",
    ),
    "numbers in an array": ({"cameras": np.array([2])}, f"`cameras` must be one of {KNOWN}, got 2."),
    "one name in an array": (
        {"cameras": np.array("agentview")},
        "`cameras` must be names, or a dict of (width, height) by name, got 'agentview'.",
    ),
    "a group twice": ({"groups": [0, 0, 1]}, "`groups` must be different, got 0 twice."),
    "groups in a dict": (
        {"groups": {0: True}},
        "`groups` must be a list of whole numbers from 0 to 5, got {0: True}.",
    ),
    "one group in an array": (
        {"groups": np.array(1)},
        "`groups` must be a list of whole numbers from 0 to 5, got 1.",
    ),
    "large": (
        {"cameras": {"agentview": (2**40, 4)}},
        "`cameras['agentview']` must be at most 2^31 - 1 either way, got (1099511627776, 4).",
    ),
}


@pytest.mark.parametrize("case", RENDERER)
def test_renderer(arena, case):
    given, says = RENDERER[case]
    with pytest.raises(ValueError, match=r"`(cameras|depth|groups)") as raised:
        arena.renderer(**given)
    assert str(raised.value) == says


@pytest.mark.parametrize("kind", [np.array, set, frozenset, tuple, dict.fromkeys])
def test_names_in_any_collection(arena, kind):
    """And groups: whatever holds them, the renderer is the same."""
    names = ["frontview", "sideview"]
    want = arena.renderer(names, groups=[0, 1], depth=["sideview"])
    sizes = kind(names, (64, 64)) if kind == dict.fromkeys else kind(names)
    got = arena.renderer(
        sizes, groups=kind([1, 0]) if kind != dict.fromkeys else jnp.array([1, 0]), depth=set(names[1:])
    )
    assert got == want
    assert hash(got) == hash(want)
    assert all(type(camera.name) is str for camera in got.cameras)


def test_labels_that_are_not_there(arena):
    labels = arena.renderer().labels
    assert sorted(labels) == ["cube", "floor", "table"]
    for name, says in {
        "cubes": "`labels`: nothing in a segmentation is called 'cubes': did you mean `cube`?",
        "robot": f"`labels`: nothing in a segmentation is called 'robot'; known are {', '.join(labels)}.",
        3: f"`labels`: nothing in a segmentation is called 3; known are {', '.join(labels)}.",
    }.items():
        with pytest.raises(ValueError, match=r"^`labels`: nothing") as raised:
            labels.index(name)
        assert str(raised.value) == says
    assert [labels.index(name) for name in labels] == [0, 1, 2]


CAMERA = {
    "large": ({"resolution": (2**40, 4)}, "`resolution` must be at most 2^31 - 1 either way, got (1099511627776, 4)."),
    "none of its own": (
        {"resolution": (1, 1)},
        "`resolution` must be another than (1, 1), which MuJoCo takes for none, got (1, 1).",
    ),
    "NUL": ({"name": "a\0b"}, f"`name` {PRINTED}'a\\x00b'."),
    "half a character": ({"name": "a\ud800"}, f"`name` {PRINTED}'a\\ud800'."),
    "short": ({"quat": (1e-200, 0, 0, 0)}, "`quat` must be of a length of 1e-15 at least, got (1e-200, 0, 0, 0)."),
}


@pytest.mark.parametrize("case", CAMERA)
def test_camera(case):
    arena = made()
    before, (given, says) = arena.spec.to_xml(), CAMERA[case]
    with pytest.raises(ValueError, match="must be") as raised:
        arena.add_camera(**{"name": "eye", "pos": (0, 0, 2), **given})
    assert str(raised.value) == says
    assert arena.spec.to_xml() == before


def test_a_camera_that_mujoco_refuses(monkeypatch):
    """Whatever it refuses, the arena is as before."""
    arena = made()
    before = arena.spec.to_xml()
    monkeypatch.setattr("mjx_arenas.build.cameras.looking", lambda pos, at: "nowhere")
    with pytest.raises(TypeError, match="incompatible function arguments"):
        arena.add_camera("eye", (0, 0, 2), look_at=(0, 0, 0))
    assert arena.spec.to_xml() == before


NAMES = {
    "object": (lambda name: mja.TableArena(objects=[mja.Object(name)]), "`objects.name`"),
    "material": (lambda name: made().add_material(name), "`name`"),
    "robot": (lambda name: made().attach("<mujoco/>", prefix=name), "`prefix`"),
    "scene": (lambda name: mja.TableArena().merge(mja.TableArena(), name), "`prefix`"),
}


@pytest.mark.parametrize("case", NAMES)
def test_names(case):
    """MuJoCo would end the name at NUL."""
    call, argument = NAMES[case]
    with pytest.raises(ValueError, match=f"{re.escape(PRINTED)}'a.x00b'") as raised:
        call("a\0b")
    assert argument.strip("`") in str(raised.value)


@pytest.mark.parametrize("array", [np.array, jnp.array])
def test_numbers_of_numpy(array, tmp_path):
    """Arrays of whole numbers are sizes, NumPy's truths are truths, and pictures of JAX are pictures."""
    arena = made()
    arena.add_camera("eye", (0, 0, 2), resolution=array([8, 6]))
    arena.add_material("tiles", array(np.full((2, 2, 3), 7, np.uint8)))
    drawing = arena.renderer({"eye": array([8, 6])}, depth=np.True_, rgb=np.False_, shadows=np.True_, textures=np.True_)
    assert drawing == arena.renderer(["eye"], depth=True, rgb=False, shadows=True)
    assert hash(drawing) == hash(arena.renderer(["eye"], depth=True, rgb=False, shadows=True))
    with pytest.raises(ValueError, match=r"add_material\.texture` has pixels of its own"):
        mja.save(tmp_path / "arena.yaml", arena)
    assert (arena.mj_model.tex_data[arena.mj_model.texture("tiles").adr[0] :][:12] == 7).all()


def test_a_picture_of_another_kind_says_its_kind():
    with pytest.raises(ValueError, match=r"rows and columns, got float32 of shape \(2, 2, 3\)\.$"):
        made().add_material("tiles", jnp.zeros((2, 2, 3)))


def test_shadows_that_vary_must_be_drawn():
    arena = mja.TableArena()
    arena.vary(casts=dr.Term("light.castshadow"))
    arena.renderer(shadows=True)
    with pytest.raises(
        ValueError, match=r"^`shadows` is false, but 'casts' varies which lights cast them: set it true\.$"
    ):
        arena.renderer()


BYTES = jnp.full((4, 4, 3), 128.0)
CALLS = {
    "brightness": lambda image: mja.images.brightness(image, 0.9),
    "contrast": lambda image: mja.images.contrast(image, 0.9),
    "blur": lambda image: mja.images.blur(image, 1.0),
    "noise": lambda image: mja.images.noise(jax.random.key(0), image, 0.1),
    "background": lambda image: mja.images.background(image, jnp.zeros((4, 4)), (0.0, 0.0, 0.0)),
}


@pytest.mark.parametrize("case", CALLS)
def test_bytes_as_floats(case):
    """They would be cut off at 1, and what is below 0 there; those of a program are not known."""
    call = CALLS[case]
    one_nan = BYTES.at[1, 2, 0].set(jnp.nan) / 255
    for image, got in ((BYTES, 128), (np.asarray(BYTES), 128), (BYTES / 255 - 1, "-0.498039"), (one_nan, "nan")):
        with pytest.raises(ValueError, match="must be") as raised:
            call(image)
        assert str(raised.value) == (
            f"`image` must be from 0 to 1 where it is of floats (bytes are uint8; distances are no colours), got one with {got}."
        )
    assert jax.eval_shape(call, BYTES).shape == BYTES.shape
    assert call(jnp.ones((4, 4, 3))).shape == BYTES.shape


VISION = {
    "kind in a list": ({"kind": ["rgb"]}, "`vision.kind` must be one of 'rgb', 'gray', 'depth', 'rgbd', got ['rgb']."),
    "rare": (
        {"every": 1000},
        "`vision.every` must be at most 120, the steps of an episode (`config.episode_length`), got 1000.",
    ),
    "many": (
        {"frames": 121},
        "`vision.frames` must be at most 120, the steps of an episode (`config.episode_length`), got 121.",
    ),
    **{
        kind: (
            {"kind": kind, "alter": looks.default_vision().alter},
            f"`vision.alter` must be None, or a function of your own, for kind {kind!r}, as the default one clips distances at 1 m, got ",
        )
        for kind in ("depth", "rgbd")
    },
}


@pytest.mark.parametrize("case", VISION)
def test_vision(arena, case):
    given, says = VISION[case]
    with pytest.raises(ValueError, match=r"`vision\.") as raised:
        Eyes(arena, Vision({"agentview": (8, 8)}, **given), 120)
    assert str(raised.value).startswith(says)


def test_arguments_of_vision():
    with pytest.raises(TypeError, match=r"^Vision has no argument 'frame': did you mean 'frames'\?$"):
        Vision(["agentview"], frame=2)  # pyright: ignore[reportCallIssue]
    assert dataclasses.replace(looks.default_vision(), frames=2).frames == 2


def test_vision_among_overrides():
    says = r"^`config_overrides` must not have a Vision, got one as 'vision': give it as the argument `vision=`\.$"
    with pytest.raises(ValueError, match=says):
        Push(config_overrides={"vision": Vision(["policy"])})


def test_what_names_of_materials_are(arena):
    with pytest.raises(ValueError, match="must be") as raised:
        arena.check_ranges(mja.ArenaRanges(terms={"board": mja.Choice(["table_ceramic"])}))
    assert str(raised.value) == (
        "`ranges.terms.board` (Choice): `values` must be the `id` of a material (`arena.mj_model.material(name).id`), or -1 for none, got "
        "['table_ceramic']."
    )
    assert arena.mj_model.material("table_ceramic").id >= 0


@pytest.mark.filterwarnings("ignore:flex 'cloth' is not rigid")
def test_flexes_are_not_drawn():
    cloth = """<mujoco><worldbody><camera name="above" pos="0 0 2"/><body><freejoint/><geom size=".1"/></body>
      <flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" radius=".01" mass="1" dim="2"/></worldbody></mujoco>"""
    with pytest.raises(ValueError, match=r"^The renderer does not draw flexes, of which the arena has 1\.$"):
        mja.Arena.from_xml(cloth).renderer(["above"])


@pytest.mark.slow
def test_policies_that_see_are_not_judged_in_c():
    env = Push(config_overrides={"vision": True, "impl": "warp"})
    with pytest.raises(
        ValueError,
        match=r"^`env` must be one whose policies see numbers, as C MuJoCo draws no pictures for `engine='c'`\.$",
    ):
        mja.evaluate(lambda obs, key: (jnp.zeros((2, env.action_size)), {}), env, 2, engine="c")


@pytest.mark.parametrize("name", ["look_at", "target"])
def test_where_cameras_look(name):
    with pytest.raises(ValueError, match="cannot vary") as raised:
        mja.TableArena().vary(gaze=dr.Term(f"camera.{name}"))
    assert str(raised.value).endswith("vary `camera.rpy` for where it looks, and `camera.pos` for where it is.")


@pytest.mark.parametrize(("kind", "turn"), [("camera", "rpy"), ("light", "dir")])
def test_what_turns_to_a_body(kind, turn):
    """Its orientation has no effect, so that only its place varies; a pattern leaves it out."""
    made, at = mja.TableArena(objects=[mja.Object("cube")]), mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY
    add = getattr(made.spec.worldbody, f"add_{kind}")
    add(name="chase", pos=(1, 0, 2), mode=at, targetbody="cube")
    add(name="still", pos=(1, 0, 2))
    with pytest.raises(ValueError, match="cannot vary") as raised:
        made.vary(gaze=dr.Term(f"{kind}.{turn}", "chase"))
    says = (
        f"`gaze.elements`: '{kind}.{turn}' of {kind} 'chase' cannot vary, as it turns to its `target` in every state: "
    )
    says += f"vary `{kind}.pos`."
    assert str(raised.value) == says
    made.vary(gaze=dr.Term(f"{kind}.{turn}", "chase|still"), eye=dr.Term(f"{kind}.pos", "chase"))
    assert made.elements("gaze") == ("still",)
