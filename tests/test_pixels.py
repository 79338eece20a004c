"""What cameras see on the device: C MuJoCo's renderer on the recompiled world is the oracle."""

import functools
import gc
import inspect
import operator
import os
import pathlib
import re

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import views
from brax.training.agents.ppo import train as ppo
from gl import needs_gl
from pictures import in_c, wrong

import mjx_arenas as mja
from mjx_arenas import dr, furniture
from mjx_arenas.envs.tasks import robots
from mjx_arenas.pixels.order import Order
from mjx_arenas.pixels.poses import poses
from mjx_arenas.pixels.renderer import Picture

MUTANTS = {
    "tables": ("geom_size", "body_pos", "cam_fovy", "light_diffuse", "geom_matid"),
    "looks": ("geom_size", "cam_pos", "mat_texid", "mat_rgba", "mat_specular", "light_active", "light_castshadow"),
}


@pytest.fixture(scope="module")
def arena():
    return views.arena("tables")


def differing(view, batch, data, file=None):
    """Of each world what differs from C's; with a file, of what `tests/draw.py` drew on another machine."""
    drawing = views.renderer(view)
    if file is None:
        pictures = jax.jit(drawing)(batch, data)
    else:
        saved = np.load(file)
        kinds = Picture._fields
        pictures = {c: Picture(*(saved[f"{view}.{c}.{kind}"] for kind in kinds)) for c in views.VIEWS[view].cameras}
    return compared(list(in_c(view, batch, data, drawing.labels)), pictures, drawing.labels)


def compared(theirs, pictures, known):
    """What differs in each world."""
    pictures = jax.device_get(pictures)
    return [wrong(one, jax.tree.map(lambda x, i=i: x[i], pictures), known) for i, one in enumerate(theirs)]


@pytest.mark.xslow_on("jax")
@needs_gl
@pytest.mark.slow
@pytest.mark.parametrize("view", views.VIEWS)
def test_as_in_c(view, impl, optimized_rays):
    """All that a view varies, in all worlds; three cameras."""
    n, file = (views.VIEWS[view].n, os.environ.get("MJX_ARENAS_DRAWN")) if impl == "warp" else (views.ON_JAX, None)
    assert differing(view, *views.worlds(view, impl, n), file) == [set()] * n


@pytest.fixture(scope="module")
def known_in_c():
    """A function of a view: four of its worlds, their data, and their pictures by C."""

    @functools.cache
    def known(view):
        batch, data = views.worlds(view, "warp", 4)
        return batch, data, list(in_c(view, batch, data, views.renderer(view).labels))

    return known


@needs_gl
@pytest.mark.slow
@pytest.mark.parametrize("view", views.VIEWS)
def test_mutants_are_noticed(view, known_in_c, optimized_rays):
    """Each field that varies, where the picture shows the nominal one, or another world's."""
    batch, data, theirs = known_in_c(view)
    drawing, nominal = views.renderer(view), views.arena(view).put_model("warp")
    draw = jax.jit(drawing)
    mutants = {field: views.stale(batch, **{field: getattr(nominal, field)}) for field in MUTANTS[view]}
    mutants["geom_rgba"] = views.stale(batch, geom_rgba=batch.model.geom_rgba[::-1])
    for field, mutant in mutants.items():
        assert any(compared(theirs, draw(mutant, data), drawing.labels)), field


@needs_gl
@pytest.mark.slow
def test_what_is_absent_is_hidden(known_in_c, optimized_rays):
    """Absent objects wait far away, so here they are put where a camera sees them: no alpha hides them."""
    batch, data, theirs = known_in_c("tables")
    made, drawing = views.arena("tables"), views.renderer("tables")
    draw, qpos = jax.jit(drawing), np.array(data.qpos)
    for i, k in np.argwhere(~np.asarray(batch.params.object_active)):
        qpos[i, made.layout.object_qpos[k, :3]] = 0.1 * k, -0.5, 1.3
    near, alpha = data.replace(qpos=jax.device_put(qpos)), np.array(batch.model.geom_rgba)
    there = np.asarray(made.put_model("warp").geom_rgba)[:, 3] > 0
    alpha[..., 3] = np.where(there, 1, alpha[..., 3])
    hidden, shown = draw(batch, near), draw(views.stale(batch, geom_rgba=alpha), near)
    assert compared(theirs, hidden, drawing.labels) == [set()] * len(theirs)
    assert "segmentation" in {what for one in compared(theirs, shown, drawing.labels) for _, what in one}


@needs_gl
@pytest.mark.slow
def test_cameras_that_stay_behind_are_noticed(known_in_c, monkeypatch, optimized_rays):
    """Cameras on a hand and on an object, which see what they would see at the start: the others are right."""
    batch, data, theirs = known_in_c("looks")
    start = views.arena("looks").mj_model.qpos0

    def behind(layout, params, model, drawn, data):
        now, then = (
            poses(layout, params, model, drawn, state) for state in (data, data.replace(qpos=jnp.asarray(start)))
        )
        return now._replace(cam_xpos=then.cam_xpos, cam_xmat=then.cam_xmat)

    monkeypatch.setattr("mjx_arenas.pixels.renderer.poses", behind)
    drawing = views.renderer("looks")
    draw = jax.jit(lambda *given: drawing(*given))  # another function than the renderer, which was traced before
    found = compared(theirs, draw(batch, data), drawing.labels)
    assert all({camera for camera, what in one if what == "segmentation"} == {"wrist", "rider"} for one in found)
    assert not any(camera == "frontview" for one in found for camera, _ in one)


@pytest.mark.xslow
@pytest.mark.slow
def test_of_the_state_that_is_given(small):
    """Not of the last step's: pictures after a step are those of its positions, in jit and scan, on both implementations."""
    n = 2
    drawing = small.renderer({"agentview": (32, 24)})
    pictures = {}
    for impl in ("jax", "warp"):
        batch, data = small_worlds(small, n, impl)
        fresh = drawing(batch, data)["agentview"].rgb
        thrown = data.replace(
            qvel=data.qvel.at[:, :3].set([0.0, 20.0, 20.0])
        )  # which the step after the last would show

        def step(data, _, batch=batch):
            data = mja.step(batch, data)
            return data, drawing(batch, data)["agentview"].rgb

        end, frames = jax.jit(lambda data: jax.lax.scan(step, data, length=3))(thrown)
        assert all((np.asarray(one) != other).any() for one, other in zip(frames, (fresh, *frames[:-1]), strict=True))
        np.testing.assert_array_equal(frames[-1], drawing(batch, end)["agentview"].rgb)
        again = data.replace(geom_xpos=data.geom_xpos + 1.0)  # what a step would compute anew
        np.testing.assert_array_equal(drawing(batch, again)["agentview"].rgb, fresh)
        assert fresh.shape == (n, 24, 32, 3)
        assert fresh.dtype == np.uint8
        pictures[impl] = np.asarray(fresh, int)
    assert np.abs(pictures["jax"] - pictures["warp"]).mean() < 0.5


BAD = {
    "camera": (
        {"cameras": ["wrist"]},
        "`cameras`: no camera of the arena is called 'wrist'; known are frontview, birdview, agentview, sideview, low.",
    ),
    "one name": ({"cameras": "low"}, "`cameras` must be names, or a dict of (width, height) by name, got 'low'."),
    "a number": ({"cameras": 4}, "`cameras` must be names, or a dict of (width, height) by name, got 4."),
    "no camera": (
        {"cameras": []},
        "`cameras` must name one camera at least, of frontview, birdview, agentview, sideview, low.",
    ),
    "size": (
        {"cameras": {"low": (64, 0)}},
        "`cameras['low']` must be (width, height), two whole numbers above 0, got (64, 0).",
    ),
    "one size": (
        {"cameras": {"low": 64}},
        "`cameras['low']` must be (width, height), two whole numbers above 0, got 64.",
    ),
    "nothing": ({"rgb": False}, "`rgb`, `depth` and `segmentation` are all false: the renderer would give nothing."),
    "depth": (
        {"cameras": ["low"], "depth": ["frontview"]},
        "`depth` must be names of the `cameras` low, got 'frontview'.",
    ),
    "depth of one": ({"depth": "low"}, "`depth` must be true, false, or names of cameras, got 'low'."),
    "colour": ({"rgb": 1}, "`rgb` must be true, false, or names of cameras, got 1."),
    "group": ({"groups": [7]}, "`groups` must be a list of whole numbers from 0 to 5, got 7."),
    "one group": ({"groups": 3}, "`groups` must be a list of whole numbers from 0 to 5, got 3."),
    "empty group": ({"groups": [4]}, "`groups` must be groups that have a geom, of 0, 1, got [4]."),
    "shadows": ({"shadows": "yes"}, "`shadows` must be true or false, got 'yes'."),
    "textures": ({"textures": None}, "`textures` must be true or false, got None."),
    "background": ({"background": (1, 2)}, "`background` must be 3 finite numbers, got (1, 2)."),
    "bright background": (
        {"background": (1, 2, 0)},
        "`background` must be red, green and blue within 0 and 1, got (1, 2, 0).",
    ),
    "two things": (
        {"shadows": 1, "groups": [9]},
        "2 problems in `renderer`:\n- `shadows` must be true or false, got 1.\n"
        "- `groups` must be a list of whole numbers from 0 to 5, got 9.",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_wrong_uses(arena, case):
    given, says = BAD[case]
    with pytest.raises((ValueError, TypeError)) as raised:
        arena.renderer(**given)
    assert str(raised.value) == says


def test_cube_textures_are_refused():
    xml = """<mujoco><asset><texture name="dice" type="cube" builtin="flat" width="8" height="8" rgb1="1 0 0"/>
    <material name="die" texture="dice"/></asset>
    <worldbody><camera name="c"/><body name="b"><geom size=".1 .1 .1" type="box" material="die"/></body></worldbody></mujoco>"""
    arena = mja.Arena.from_xml(xml)
    with pytest.raises(
        ValueError, match=r"^Material 'die' has the cube texture 'dice', which the renderer draws wrong: "
    ):
        arena.renderer()


def test_textures_that_vary_must_be_drawn():
    arena = mja.TableArena()
    arena.vary(look=dr.Term("material.texture", "floorplane"))
    with pytest.raises(ValueError, match=r"^`textures` is false, but 'look' varies textures: set it true\.$"):
        arena.renderer(textures=False)


@pytest.fixture(scope="module")
def small():
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT  # compiles faster; nothing here is to touch
    return arena


def small_worlds(arena, n, impl="warp"):
    batch = views.rows(small_randomized(arena, impl), n)
    return batch, mja.make_data(batch, mja.world_keys(0, range(n)))


@functools.cache
def small_randomized(arena, impl):
    sizes = mja.ArenaRanges(table_full_sizes=mja.Uniform([0.5, 0.5, 0.03], [0.8, 0.8, 0.06]))
    return arena.randomize(arena.put_model(impl), mja.world_keys(0, range(8)), sizes)


@pytest.mark.slow
def test_wrong_worlds(small):
    drawing = small.renderer({"agentview": (16, 12)})
    batch, data = small_worlds(small, 3)
    with pytest.raises(ValueError, match=r"^`data` must be of the 3 worlds of the batch, got one world\.$"):
        drawing(batch, mja.take(data, 0))
    with pytest.raises(ValueError, match=r"^`data` must be of the 3 worlds of the batch, got 2 worlds\.$"):
        drawing(batch, mja.take(data, [0, 1]))
    with pytest.raises(ValueError, match=r"^`data` must have the model's impl='warp', got impl='jax'\.$"):
        drawing(batch, small_worlds(small, 3, "jax")[1])
    with pytest.raises(ValueError, match=r"^`data.qpos` must have shape \(3, 7\), got \(3, 14\)\.$"):
        drawing(batch, data.replace(qpos=np.zeros((3, 14))))
    with pytest.raises(ValueError, match=r"^`batch` is of another arena than the renderer\.$"):
        drawing(*views.worlds("tables", "warp", 3))
    with pytest.raises(
        TypeError, match=r"^`batch` and `data` must be an ArenaBatch and its mjx.Data, got Model and Data\.$"
    ):
        drawing(batch.model, data)


@pytest.mark.slow
def test_however_it_is_mapped(small):
    """One world, a batch, batches of batches, with any of them equal: always all worlds with a context of their number."""
    batch, data = small_worlds(small, 4)
    drawing = small.renderer({"agentview": (16, 12)}, segmentation=True)
    want = np.asarray(drawing(batch, data)["agentview"].rgb)
    assert len({x.tobytes() for x in want}) == 4
    one = mja.take(data, 0)

    def of(model, params, qpos):
        return drawing.of_world(model, params, one.replace(qpos=qpos))["agentview"].rgb

    axes = batch.in_axes, 0, 0
    for i in range(2):
        model = small.apply(small.put_model("warp"), batch.world(i))
        np.testing.assert_array_equal(of(model, batch.world(i), data.qpos[i]), want[i])

    def two(tree):
        return jax.tree.map(lambda x: x.reshape(2, 2, *x.shape[1:]), tree)

    batched = {name: operator.attrgetter(name)(batch.model) for name in batch.fields}
    halves = batch.model.tree_replace(two(batched)), two(batch.params), two(data.qpos)
    nested = jax.vmap(jax.vmap(of, in_axes=axes), in_axes=axes)(*halves)
    np.testing.assert_array_equal(nested, two(want))
    states = jax.vmap(lambda qpos: jax.vmap(of, in_axes=(batch.in_axes, 0, None))(batch.model, batch.params, qpos))
    each = states(data.qpos[:2])  # (2, 4): the states of two worlds in all worlds
    np.testing.assert_array_equal(each[0, 0], want[0])
    np.testing.assert_array_equal(each[1, 1], want[1])
    assert (np.asarray(each[0, 1]) != want[1]).any()


@pytest.mark.parametrize("lenses_vary", [False, True])
def test_order(lenses_vary):
    """Each pixel is drawn once, and comes back to its place; in blocks of 8 by 8 where the picture has whole ones."""
    sizes, order = [(16, 24), (12, 6), (7, 5)], Order(lenses_vary)
    drawn = order.drawn(sizes)
    for width, height in sizes:
        start, drawn = drawn[: width * height], drawn[width * height :]
        want = start.min() + np.arange(width * height).reshape(height, width)
        np.testing.assert_array_equal(order.picture(width, height, start), want)
        np.testing.assert_array_equal(order.picture(width, height, np.stack([start, start], -1))[..., 1], want)
    assert drawn.size == 0
    rows = np.unravel_index(order.drawn(sizes[:1])[:64], (24, 16))[0]
    assert rows.max() == (3 if lenses_vary else 7)


@pytest.mark.slow
def test_order_of_pixels(small):
    """Rays stand in blocks where lenses are the same in all worlds, in rows elsewhere, which C's pictures prove: the same pictures."""
    sizes = {"agentview": (33, 20), "frontview": (40, 24), "sideview": (7, 5)}
    rows = mja.TableArena(objects=[mja.Object("cube")])
    rows.vary(lens=dr.Term("camera.fovy"))
    kinds = {"depth": True, "segmentation": ["frontview", "sideview"]}
    one, other = (arena.renderer(sizes, **kinds)(*small_worlds(arena, 2)) for arena in (small, rows))
    for name, (width, height) in sizes.items():
        assert one[name].rgb.shape == (2, height, width, 3)
        assert np.abs(np.asarray(one[name].rgb, int) - other[name].rgb).max() <= 1
        np.testing.assert_allclose(one[name].depth, other[name].depth, rtol=1e-5)
        assert (one[name].segmentation is None) == (name == "agentview")
        if name != "agentview":
            np.testing.assert_array_equal(one[name].segmentation, other[name].segmentation)


@pytest.mark.slow
def test_what_is_invisible_may_be_shown(small):
    """A geom without colour is not drawn, unless a term gives it one."""
    shown = mja.TableArena(objects=[mja.Object("cube")])
    shown.vary(boards=dr.Term("geom.rgba", "table_(visual|collision)"))
    colours = mja.Fixed([[1.0, 0, 0, 1], [1, 1, 1, 0]])
    batch = shown.randomize(shown.put_model("warp"), mja.world_keys(0, [0]), mja.ArenaRanges(terms={"boards": colours}))
    drawing = shown.renderer({"agentview": (32, 24)}, segmentation=True)
    picture = drawing(batch, mja.make_data(batch))["agentview"]
    table = np.asarray(picture.segmentation == drawing.labels.index("table"))
    assert table.mean() > 0.1
    red, green, _ = np.asarray(picture.rgb)[table].T
    assert (red > 40).mean() > 0.9
    assert (green < 10).mean() > 0.9


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
@pytest.mark.parametrize("impl", ["jax", "warp"])
def test_two_draws_in_one_program(small, impl):
    """Of two states, and of one after the other in a loop: neither draws with the other's tree."""
    batch, data = small_worlds(small, 8, impl)
    moved = data.replace(qpos=data.qpos.at[:, small.layout.object_qpos[0, 1]].add(0.15))
    drawing = small.renderer({"agentview": (24, 18)}, segmentation=True)
    want = [np.asarray(drawing(batch, state)["agentview"].segmentation) for state in (data, moved)]
    assert (want[0] != want[1]).any()

    @jax.jit
    def both(batch, one, other):
        seen = [drawing(batch, state)["agentview"].segmentation for state in (one, other)]
        again = jax.lax.scan(lambda state, _: (state, drawing(batch, state)["agentview"].segmentation), one, length=2)[
            1
        ]
        return *seen, again[1]

    for _ in range(5):
        for got, right in zip(both(batch, data, moved), (*want, want[0]), strict=True):
            np.testing.assert_array_equal(got, right)


BASE = """<mujoco><worldbody><body name="base"><geom name="foot" size=".05"/><body name="link" pos="0 0 .2"><joint name="lift"/>
<geom name="tip" size=".04"/></body></body></worldbody></mujoco>"""


def test_labels():
    """A robot on a table is itself; a body and a geom of the same name are two."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.spec.worldbody.add_geom(name="cube", size=[0.1, 0, 0], pos=[2, 2, 0.1])
    arena.attach(robots.pusher(), on=0)
    assert arena.renderer(segmentation=True).labels == ("floor", "cube", "table", "robot_mount", "cube (body)")


def test_labels_of_robots():
    """By where they stand, as docs/pixels.md says: on a table, in the world, and on a part, whose label is theirs."""
    arena = mja.TableArena(has_legs=False)
    arena.add_part(furniture.Bin("plinth", pos=(2, 0, 0), inner_size=(0.5, 0.5, 0.1), stays=True))
    for prefix, where in (("a_", {"on": 0}), ("b_", {"pos": (0, 3, 0)}), ("c_", {"on": "plinth_bottom"})):
        arena.attach(BASE, prefix=prefix, **where)
    assert arena.renderer(segmentation=True).labels == ("floor", "table", "a_mount", "plinth", "b_base")


def test_what_is_not_drawn_is_refused(small):
    with pytest.raises(
        ValueError, match=r"^`rgb`, `depth` and `segmentation` leave out camera 'birdview', which would give"
    ):
        small.renderer(["frontview", "birdview"], rgb=["frontview"])
    xml = """<mujoco><asset><texture name="dice" type="cube" builtin="flat" width="8" height="8" rgb1="1 0 0"/>
    <texture name="plain" type="2d" builtin="flat" width="8" height="8" rgb1="1 0 0"/><material name="die" texture="plain"/></asset>
    <worldbody><camera name="c"/><body name="b"><geom size=".1 .1 .1" type="box" material="die"/></body></worldbody></mujoco>"""
    arena = mja.Arena.from_xml(xml)
    arena.vary(look=dr.Term("material.texture", "die"))
    with pytest.raises(
        ValueError, match=r"^'look' may choose the cube texture 'dice', which the renderer draws wrong: "
    ):
        arena.renderer()
    arena = mja.TableArena()
    arena.vary(look=dr.Term("geom.material", "table_visual"))
    with pytest.raises(ValueError, match=r"^`textures` is false, but 'look' varies textures: set it true\.$"):
        arena.renderer(textures=False)


@pytest.mark.slow
def test_renderers_that_are_gone(small):
    """What is compiled keeps what it draws with; equal renderers share it."""
    batch, data = small_worlds(small, 2)
    drawing = small.renderer({"agentview": (16, 12)})
    draw = jax.jit(lambda batch, data: small.renderer({"agentview": (16, 12)})(batch, data)["agentview"].rgb)
    first = draw(batch, data)
    assert drawing == small.renderer({"agentview": (16, 12)}) != small.renderer({"agentview": (16, 13)})
    del drawing
    gc.collect()
    np.testing.assert_array_equal(draw(batch, data), first)


@pytest.mark.xslow
@pytest.mark.slow
def test_documented(monkeypatch):
    """The code of docs/pixels.md, as it stands, one block after the other; its training takes these arguments, and is not run."""
    names, signature = {}, inspect.signature(ppo.train)

    def train(**given):
        signature.bind(**given)
        env = given["environment"]
        given["network_factory"](env.observation_size, env.action_size)
        return None, None, {}

    monkeypatch.setattr(ppo, "train", train)
    text = (pathlib.Path(__file__).parent.parent / "docs" / "pixels.md").read_text()
    for block in re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL):
        exec(compile(block, "docs/pixels.md", "exec"), names)
    picture, state = names["picture"], names["state"]
    assert picture.rgb.shape == names["seen"].shape == (4, 48, 64, 3)
    assert names["pictures"].shape == (3, 4, 48, 64, 3)
    assert 0 < np.asarray(names["cube"]).mean() < 0.1
    assert state.obs["pixels/view_0"].shape == (2, 32, 32, 8)
