"""What cameras see on the device: C MuJoCo's renderer on the recompiled world is the oracle."""

import dataclasses
import functools
import gc
import inspect
import operator
import os
import pathlib
import re

import jax
import mujoco
import numpy as np
import pytest
from brax.training.agents.ppo import train as ppo
from gl import Drawing, needs_gl

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.envs import robots
from mjx_arenas.pixels.order import Order
from mjx_arenas.pixels.renderer import Picture
from mjx_arenas.viz import render

N = 200  # worlds
WIDTH, HEIGHT = 96, 72
CAMERAS = ("frontview", "agentview", "low")
DEPTH = 2e-3  # [m] within a surface
BENT = 0.02  # [1/m] by which the inverse of depth, which is even on a plane, bends from a pixel to the next at an edge
COLOUR = 1.5  # of 255, in the mean: the two shade alike, and round otherwise
OF_A_THING = (
    6  # of 255, in the mean over one thing, of which at least so many pixels are seen, as highlights fall on few:
)
FEW = 8
STEP = 12  # of 255, from a pixel to the next, where a texture has an edge: OpenGL blurs it, the ray caster does not


@pytest.fixture(scope="module")
def arena():
    return made()


def made():
    """An arena with all that can be told apart in a picture."""
    objects = [
        mja.Object("cube", full_size=0.12),
        mja.Object("brick", full_size=(0.1, 0.15, 0.2), on=1),
        mja.Object("ball", "sphere", 0.12, on=1),
        mja.Object("pill", "capsule", (0.2, 0.08, 0.08)),
    ]
    arena = mja.MultiTableArena(table_offsets=[[0, -0.5, 0.8], [0, 0.6, 0.8]], objects=objects)
    arena.spec.worldbody.add_camera(name="low", pos=[1.8, -1.5, 1.5], xyaxes=[0.64, 0.77, 0, -0.3, 0.25, 0.92], fovy=55)
    for (
        light
    ) in arena.spec.lights:  # OpenGL lights the corners of a face, the ray caster each pixel: alike for light from afar
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    arena.attach(robots.gripper(), prefix="robot_", pos=(0, 0, 0), on=0)
    for name, texture in TEXTURES.items():
        arena.add_material(name, texture, specular=0.0)
    arena.vary(
        joints=dr.Term("joint.qpos", "robot_[xyz]"),
        board=dr.Term("geom.material", "table._visual"),
        lens=dr.Term("camera.fovy", "frontview"),
        eye=dr.Term("camera.pos", "frontview"),
        gaze=dr.Term("camera.rpy", "low"),
        lamp=dr.Term("light.dir"),
        colour=dr.Term("light.diffuse"),
    )
    return arena


# Of texels not much smaller than pixels: OpenGL smooths finer ones, the ray caster takes the colour at a point.
TEXTURES = {
    "oak": mja.textures.Wood(rings=4, seed=1, size=16),
    "stone": mja.textures.Noise(size=16),
    "tiles": mja.textures.Checker(n=3, size=18),
}
RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.1, -0.1, -0.3], [0.1, 0.1, 0.2], relative="add"),
    table_rots=mja.Uniform(-1.0, 1.0),
    table_full_sizes=mja.Uniform([0.5, 0.5, 0.03], [0.9, 0.8, 0.2]),
    has_legs=mja.Bernoulli(0.5),
    table_active=mja.Bernoulli([1.0, 0.5]),
    object_active=mja.Count(1, 4),
    object_full_sizes=mja.Uniform(0.7, 1.4, relative="scale"),
    object_rgba=mja.Uniform([0, 0, 0, 1], 1.0),
    terms={
        "joints": mja.Uniform(-0.25, 0.1),
        "board": mja.Choice([1, 3, 4, 5]),  # materials: the tables' own, and the three
        "lens": mja.Uniform(0.8, 1.3, relative="scale"),
        "eye": mja.Uniform(-0.1, 0.1, relative="add"),
        "gaze": mja.Uniform(-0.2, 0.2),
        "lamp": mja.Uniform(-0.4, 0.4, relative="add"),
        "colour": mja.Uniform(
            0.02, 0.18
        ),  # together below 1, where OpenGL cuts light off before it is multiplied with textures
    },
)


def worlds(arena, impl, n):
    batch = rows(randomized(arena, impl), n)
    return batch, mja.make_data(batch, mja.world_keys(3, range(n)))


@functools.cache
def randomized(arena, impl):
    """As many worlds as any test has, of which others take the first: another number would be another program."""
    return arena.randomize(arena.put_model(impl), mja.world_keys(3, range(N if impl == "warp" else 24)), RANGES)


def rows(batch, n):
    """The first `n` worlds."""
    first = {name: operator.attrgetter(name)(batch.model)[:n] for name in batch.fields}
    params = jax.tree.map(lambda x: x[:n], batch.params)
    return dataclasses.replace(batch, model=batch.model.tree_replace(first), params=params, valid=batch.valid[:n])


def renderer(arena):
    return arena.renderer(dict.fromkeys(CAMERAS, (WIDTH, HEIGHT)), depth=True, segmentation=True)


def beside(found):
    """The same pixels, and those around them."""
    for axis in (0, 1):
        found = found | np.roll(found, 1, axis) | np.roll(found, -1, axis)
    return found


def edges(labels):
    """Pixels beside which another label begins."""
    return beside(sum(np.roll(labels, 1, axis) != labels for axis in (0, 1)) > 0)


def bends(depth):
    """Pixels beside which a surface ends or bends."""
    inverse = 1 / np.where(depth > 0, depth, np.inf)
    curved = [np.abs(np.roll(inverse, 1, a) - 2 * inverse + np.roll(inverse, -1, a)) > BENT for a in (0, 1)]
    return beside(curved[0] | curved[1])


def steps(rgb):
    """Pixels beside which a colour ends."""
    changes = [np.abs(np.roll(rgb, 1, axis).astype(int) - rgb).max(-1) > STEP for axis in (0, 1)]
    return beside(changes[0] | changes[1])


def label_of(model, known):
    """(ngeom + 1,) labels of the geoms of a compiled world, by names, and of nothing."""
    tops = [b for b in range(1, model.nbody) if not model.body_parentid[b]]
    found = []
    for geom in range(model.ngeom):
        chain = [int(model.geom_bodyid[geom])]
        while model.body_parentid[chain[-1]]:
            chain.append(int(model.body_parentid[chain[-1]]))
        robot = [b for b in chain if model.body(b).name.startswith("robot_")]
        own = robot[-1] if robot else chain[-1]
        assert chain[-1] in (0, *tops)
        found.append(known.index(model.body(own).name if own else model.geom(geom).name))
    return np.array([*found, -1])


def in_c(arena, batch, data, known):
    """Of each world RGB, depth and labels of each camera, drawn by C MuJoCo."""
    render.choose_gl()
    option = mujoco.MjvOption()
    option.sitegroup[:] = 0
    with Drawing(arena.mj_model, HEIGHT, WIDTH) as drawing:
        for i in range(batch.n_worlds):
            model, state = arena.c_world(batch.world(i), mja.take(data, i))
            drawing.of(model)
            label = label_of(model, known)
            yield {camera: seen_in_c(drawing, state, camera, option, label) for camera in CAMERAS}


def seen_in_c(drawing, state, camera, option, label):
    """RGB, depth and labels of one camera."""
    drawing.update_scene(state, camera, option)
    for flag in ("SHADOW", "REFLECTION", "SKYBOX", "HAZE"):
        drawing.scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = 0
    rgb = drawing.render().copy()
    drawing.enable_depth_rendering()
    depth = drawing.render().copy()
    drawing.disable_depth_rendering()
    drawing.enable_segmentation_rendering()
    geom, kind = np.moveaxis(drawing.render(), -1, 0)
    drawing.disable_segmentation_rendering()
    geom = np.where(kind == mujoco.mjtObj.mjOBJ_GEOM, geom, -1)
    return rgb, depth, label[geom]


def wrong(theirs, pictures, i, known):
    """What of a world's pictures differs from C's: names of cameras and of what they give."""
    found = set()
    for camera, (rgb, depth, label) in theirs.items():
        ours = jax.tree.map(lambda x, i=i: np.asarray(x)[i], pictures[camera])
        inside = ~edges(label)
        if (ours.segmentation != label)[inside].any():
            found.add((camera, "segmentation"))
        flat = inside & (label >= 0) & (ours.segmentation == label) & ~bends(depth) & ~bends(ours.depth)
        if (np.abs(ours.depth - depth)[flat] > DEPTH).any():
            found.add((camera, "depth"))
        even = inside & ~steps(rgb) & ~steps(ours.rgb)
        off = np.abs(ours.rgb.astype(int) - rgb)
        if off[even].mean() > COLOUR:
            found.add((camera, "rgb"))
        for thing in np.unique(label[even]):
            if (here := even & (label == thing)).sum() >= FEW and off[here].mean() > OF_A_THING:
                found.add((camera, f"rgb of {known[thing]}"))
        if min(flat.mean(), even.mean()) < 0.05:
            found.add((camera, "too little"))
    return found


def differing(arena, batch, data, n, file=None):
    """Of each world what differs from C's; with a file, of what `tests/draw.py` drew on another machine."""
    drawing = renderer(arena)
    if file is None:
        pictures = jax.jit(drawing)(batch, data)
    else:
        saved = np.load(file)
        pictures = {c: Picture(*(saved[f"{c}.{kind}"] for kind in Picture._fields)) for c in CAMERAS}
    theirs = in_c(arena, batch, data, drawing.labels)
    return [wrong(one, pictures, i, drawing.labels) for i, one in zip(range(n), theirs, strict=True)]


@pytest.mark.xslow_on("jax")
@needs_gl
@pytest.mark.slow
def test_as_in_c(arena, impl, optimized_rays):
    """Tables, legs, presence, sizes, colours, cameras and lights of all worlds; three cameras."""
    n, file = (N, os.environ.get("MJX_ARENAS_DRAWN")) if impl == "warp" else (24, None)
    batch, data = worlds(arena, impl, n)
    assert differing(arena, batch, data, n, file) == [set()] * n


@needs_gl
@pytest.mark.slow
def test_mutants_are_noticed(arena, optimized_rays):
    """A size, a pose, an absent object, a lens, a lamp and a texture that the picture does not follow."""
    n = 4
    batch, data = worlds(arena, "warp", n)
    drawing = renderer(arena)
    draw, nominal = jax.jit(drawing), arena.put_model("warp")
    theirs = list(in_c(arena, batch, data, drawing.labels))

    def stale(**fields):
        model = batch.model.tree_replace(
            {name: np.broadcast_to(value, getattr(batch.model, name).shape) for name, value in fields.items()}
        )
        return dataclasses.replace(batch, model=model)

    mutants = {
        "size": stale(geom_size=nominal.geom_size),
        "pose": stale(body_pos=nominal.body_pos),
        "lens": stale(cam_fovy=nominal.cam_fovy),
        "colour": stale(geom_rgba=batch.model.geom_rgba[::-1]),
        "lamp": stale(light_diffuse=nominal.light_diffuse),
        "texture": stale(geom_matid=nominal.geom_matid),
    }
    for name, mutant in mutants.items():
        pictures = draw(mutant, data)
        found = [wrong(one, pictures, i, drawing.labels) for i, one in enumerate(theirs)]
        assert any(found), name
    # Absent objects wait far away, so here they are put where a camera sees them: no alpha hides them.
    qpos = np.array(data.qpos)
    for i, k in np.argwhere(~np.asarray(batch.params.object_active)):
        qpos[i, arena.layout.object_qpos[k, :3]] = 0.1 * k, -0.5, 1.3
    near, alpha = data.replace(qpos=jax.device_put(qpos)), np.array(batch.model.geom_rgba)
    alpha[..., 3] = np.where(np.asarray(nominal.geom_rgba)[:, 3] > 0, 1, alpha[..., 3])
    hidden, shown = draw(batch, near), draw(stale(geom_rgba=alpha), near)
    assert [wrong(one, hidden, i, drawing.labels) for i, one in enumerate(theirs)] == [set()] * n
    assert "segmentation" in {what for i, one in enumerate(theirs) for _, what in wrong(one, shown, i, drawing.labels)}


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
    batch = rows(small_randomized(arena, impl), n)
    return batch, mja.make_data(batch, mja.world_keys(0, range(n)))


@functools.cache
def small_randomized(arena, impl):
    sizes = mja.ArenaRanges(table_full_sizes=mja.Uniform([0.5, 0.5, 0.03], [0.8, 0.8, 0.06]))
    return arena.randomize(arena.put_model(impl), mja.world_keys(0, range(8)), sizes)


@pytest.mark.slow
def test_wrong_worlds(small, arena):
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
        drawing(*worlds(arena, "warp", 3))
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


def test_labels():
    """A robot on a table is itself; a body and a geom of the same name are two."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.spec.worldbody.add_geom(name="cube", size=[0.1, 0, 0], pos=[2, 2, 0.1])
    arena.attach(robots.pusher(), on=0)
    assert arena.renderer(segmentation=True).labels == ("floor", "cube", "table", "robot_mount", "cube (body)")


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
