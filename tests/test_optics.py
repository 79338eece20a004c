"""Shadows, cones of light and lenses on the device: C MuJoCo's renderer of the recompiled world is the oracle, as in `test_pixels`."""

import dataclasses
import functools
from typing import NamedTuple

import mujoco
import numpy as np
import pytest
from gl import needs_gl
from pictures import beside, label_of

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.viz import render

pytestmark = [needs_gl, pytest.mark.slow]

N, WIDTH, HEIGHT = 6, 192, 144
LIT = (
    24  # of 255, of a light where it counts: several times what rounding and OpenGL's faces from corner to corner leave
)
SCENE = """<mujoco><visual><headlight ambient=".3 .3 .3" diffuse="0 0 0" specular="0 0 0"/>
<quality shadowsize="8192" numquads="128" offsamples="0"/><map shadowclip="1.5" shadowscale="1"/></visual>
<worldbody><light name="lamp" {light} diffuse=".6 .6 .6" ambient="0 0 0" specular="0 0 0"/>
<camera name="eye" pos="0 -1.5 1.8" xyaxes="1 0 0 0 .68 .74" fovy="26"/>
<camera name="lens" pos="0 -1.5 1.8" xyaxes="1 0 0 0 .68 .74" resolution="192 144" sensorsize=".0048 .0036" focal=".007 .007"/>
<body name="desk" pos="0 0 .4"><geom type="box" size=".6 .5 .02" rgba=".8 .7 .6 1"/></body>
<body name="block" pos="-.15 .1 .6" euler="0 0 30"><freejoint/><geom type="box" size=".12 .14 .05" rgba=".3 .5 .8 1"/></body>
<body name="ball" pos=".25 -.1 .6"><freejoint/><geom size=".1" rgba=".3 .8 .4 1"/></body>
</worldbody></mujoco>"""
"""OpenGL lights the corners of a box's faces, of which there are so many that none is wider than a pixel or two."""


class Seen(NamedTuple):
    """By one renderer, of one world."""

    label: np.ndarray
    """(HEIGHT, WIDTH) what is seen where."""
    lit: np.ndarray
    """(HEIGHT, WIDTH) where the lamp lights, if nothing casts a shadow."""
    shadowed: np.ndarray
    """(HEIGHT, WIDTH) where of these something does."""


def seen(label, dark, bright, shaded):
    """Of colours without the lamp, with it, and with its shadows."""
    dark, bright, shaded = (x.astype(int).max(-1) for x in (dark, bright, shaded))
    return Seen(label, bright - dark > LIT, (bright - dark > LIT) & (bright - shaded > (bright - dark) / 2))


def on_device(arena, batch, data, shown=None):
    """`Seen` of all worlds; `shown` are those that are drawn in their place."""
    off = np.zeros(arena.mj_model.nlight, bool)
    draws = [arena.renderer({"eye": (WIDTH, HEIGHT)}, segmentation=True, shadows=x) for x in (False, True)]
    shown = shown or batch
    dark = dataclasses.replace(batch, model=batch.model.tree_replace({"light_active": off}))
    drawn = zip((draws[0], *draws), (dark, shown, shown), strict=True)
    dark, bright, shaded = (np.asarray(draw(these, data)["eye"].rgb) for draw, these in drawn)
    label = np.asarray(draws[0](batch, data)["eye"].segmentation)
    return [seen(*pictures) for pictures in zip(label, dark, bright, shaded, strict=True)], draws[0].labels


def draw_in_c(drawing, state, camera, shadows):
    drawing.update_scene(state, camera)
    for flag in ("SHADOW", "REFLECTION", "SKYBOX", "HAZE"):
        drawing.scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = shadows and flag == "SHADOW"
    return drawing.render().copy()


def labels_in_c(drawing, state, camera, label):
    drawing.enable_segmentation_rendering()
    geom, kind = np.moveaxis(draw_in_c(drawing, state, camera, False), -1, 0)
    drawing.disable_segmentation_rendering()
    return label[np.where(kind == mujoco.mjtObj.mjOBJ_GEOM, geom, -1)]


def in_c(arena, batch, data, i, known):
    """`Seen` of a world."""
    render.choose_gl()
    model, state = arena.c_world(batch.world(i), mja.take(data, i))
    with mujoco.Renderer(model, HEIGHT, WIDTH) as drawing:
        bright, shaded = (draw_in_c(drawing, state, "eye", shadows) for shadows in (False, True))
        label = labels_in_c(drawing, state, "eye", label_of(model, known))
        model.light_active[:] = False
        return seen(label, draw_in_c(drawing, state, "eye", False), bright, shaded)


def near_edges(*pictures):
    """Pixels up to 2 from where one of pictures changes."""
    changes = [np.roll(x, 1, axis) != x for x in pictures for axis in (0, 1)]
    return beside(beside(functools.reduce(np.logical_or, changes)))


def wrong(ours, theirs):
    """What of a world is seen otherwise, further from any edge than 2 pixels."""
    inside = ~near_edges(*ours, *theirs)
    return {name for name, a, b in zip(Seen._fields, ours, theirs, strict=True) if (a != b)[inside].any()}


LAMPS = {
    "sun": 'directional="true" pos="0 0 1" dir=".3 .2 -1"',
    "spot": 'pos=".2 -.1 2.2" dir="-.1 0 -1" cutoff="14" exponent="2"',
}
TERMS = {
    "sun": {"dir": mja.Uniform(-0.4, 0.4, relative="add")},
    "spot": {
        "pos": mja.Uniform(-0.15, 0.15, relative="add"),
        "dir": mja.Uniform(-0.05, 0.05, relative="add"),
        "cutoff": mja.Uniform(10.0, 18.0),
    },
}


def worlds(arena, terms):
    keys = mja.world_keys(0, range(N))
    batch = arena.randomize(arena.put_model("warp"), keys, mja.ArenaRanges(terms=terms))
    return batch, mja.make_data(batch, keys)


@pytest.mark.parametrize("lamp", [pytest.param(lamp, marks=[pytest.mark.xslow] * (lamp == "spot")) for lamp in LAMPS])
def test_light(lamp, optimized_rays):
    """A lamp lights, and things are in shadow, where they are in C; what stays nominal is noticed."""
    arena = mja.Arena.from_xml(SCENE.format(light=LAMPS[lamp]), tables=["desk"])
    arena.vary(**{name: dr.Term(f"light.{name}", "lamp") for name in TERMS[lamp]})
    batch, data = worlds(arena, TERMS[lamp])
    ours, labels = on_device(arena, batch, data)
    theirs = [in_c(arena, batch, data, i, labels) for i in range(N)]
    assert list(map(wrong, ours, theirs)) == [set()] * N
    inside = np.array([~near_edges(*one, *other) for one, other in zip(ours, theirs, strict=True)])
    lit, shadowed = (np.array([getattr(x, name) for x in theirs]) for name in ("lit", "shadowed"))
    assert min(x[inside].mean() for x in (lit, ~lit, shadowed)) > 0.02
    for name in TERMS[lamp]:
        mutant, _ = on_device(arena, batch, data, stale(arena, batch, f"light_{name}"))
        assert any(map(wrong, mutant, theirs)), name
    unlit = [x._replace(shadowed=np.zeros_like(x.shadowed)) for x in ours]
    assert all(map(wrong, unlit, theirs))


def stale(arena, batch, field, columns=slice(None)):
    """The batch with nominal numbers of a field, or of columns of it."""
    values = np.array(getattr(batch.model, field))
    values[..., columns] = getattr(arena.put_model("warp"), field)[..., columns]
    return dataclasses.replace(batch, model=batch.model.tree_replace({field: values}))


@pytest.mark.xslow
def test_lenses():
    """Focal lengths and principal points: the same things in all pixels but at edges."""
    arena = mja.Arena.from_xml(SCENE.format(light=LAMPS["sun"]), tables=["desk"])
    arena.vary(focal=dr.Term("camera.focal", "lens"), middle=dr.Term("camera.principal", "lens"))
    terms = {"focal": mja.Uniform(0.6, 1.5, relative="scale"), "middle": mja.Uniform(-0.0008, 0.0008)}
    batch, data = worlds(arena, terms)
    draw = arena.renderer({"lens": (WIDTH, HEIGHT)}, rgb=False, segmentation=True)
    theirs = []
    for i in range(N):
        model, state = arena.c_world(batch.world(i), mja.take(data, i))
        with mujoco.Renderer(model, HEIGHT, WIDTH) as drawing:
            theirs.append(labels_in_c(drawing, state, "lens", label_of(model, draw.labels)))

    def differing(batch):
        ours = np.asarray(draw(batch, data)["lens"].segmentation)
        return [((a != b) & ~near_edges(a, b)).any() for a, b in zip(ours, theirs, strict=True)]

    assert not any(differing(batch))
    assert np.mean([~near_edges(label) for label in theirs]) > 0.7
    for columns in (slice(0, 2), slice(2, 4)):  # the focal length, the principal point
        assert any(differing(stale(arena, batch, "cam_intrinsic", columns)))


BRIGHT = 1  # of 255, in the mean over a thing: half for each of two pictures, which one renderer rounds and the other cuts off
OF_IT = 0.01  # the same in shares of the light, which OpenGL computes at corners
LIGHT = 'pos=".2 -.1 2.2" dir="-.1 0 -1" cutoff="25" exponent="1"'
KINDS = {
    "kind": mja.Choice(
        [int(getattr(mujoco.mjtLightType, f"mjLIGHT_{kind}")) for kind in ("SPOT", "DIRECTIONAL", "POINT")]
    ),
    "fading": mja.Uniform([0.7, 0.0, 0.0], [1.0, 0.3, 0.3]),
}


def light_on_things(label, dark, bright, edges):
    """{what: (3,)} of what the lamp adds to its colour in the mean, in pixels away from edges."""
    added = bright.astype(int) - dark
    return {int(k): added[here].mean(0) for k in np.unique(label) if (here := (label == k) & ~edges).sum() > 50}


@pytest.mark.xslow
def test_kinds_of_light_and_how_it_fades(optimized_rays):
    """Spots, suns and bulbs, with all three numbers of attenuation: things are as bright as in C; what stays nominal is noticed."""
    arena = mja.Arena.from_xml(SCENE.format(light=LIGHT), tables=["desk"])
    arena.vary(kind=dr.Term("light.type", "lamp"), fading=dr.Term("light.attenuation", "lamp"))
    batch, data = worlds(arena, KINDS)
    assert len(set(np.ravel(batch.model.light_type).tolist())) == 3
    draw = arena.renderer({"eye": (WIDTH, HEIGHT)}, segmentation=True)
    unlit = np.zeros(arena.mj_model.nlight, bool)
    dark = dataclasses.replace(batch, model=batch.model.tree_replace({"light_active": unlit}))
    theirs = []
    render.choose_gl()
    for i in range(N):
        model, state = arena.c_world(batch.world(i), mja.take(data, i))
        if (
            model.light_type[0] == mujoco.mjtLightType.mjLIGHT_POINT
        ):  # which MuJoCo's OpenGL leaves out: a spot to all sides
            model.light_type[0], model.light_cutoff[0], model.light_exponent[0] = (
                mujoco.mjtLightType.mjLIGHT_SPOT,
                180,
                0,
            )
            mujoco.mj_forward(model, state)
        with mujoco.Renderer(model, HEIGHT, WIDTH) as drawing:
            label = labels_in_c(drawing, state, "eye", label_of(model, draw.labels))
            lit = draw_in_c(drawing, state, "eye", False)
            model.light_active[:] = False
            theirs.append((label, draw_in_c(drawing, state, "eye", False), lit))
    ours_dark = np.asarray(draw(dark, data)["eye"].rgb)

    def differing(shown):
        seen = draw(shown, data)["eye"]
        found = []
        for i, (label, off, on) in enumerate(theirs):
            lit = [(b.astype(int) - a).max(-1) > LIT for a, b in ((off, on), (ours_dark[i], np.asarray(seen.rgb)[i]))]
            edges = near_edges(label, np.asarray(seen.segmentation)[i], *lit)
            one = light_on_things(label, ours_dark[i], np.asarray(seen.rgb)[i], edges)
            other = light_on_things(label, off, on, edges)
            found.append(any((np.abs(one[k] - other[k]) > BRIGHT + OF_IT * other[k]).any() for k in other))
        return found

    assert differing(batch) == [False] * N
    for field, columns in (("light_type", slice(None)), *(("light_attenuation", [k]) for k in range(3))):
        assert any(differing(stale(arena, batch, field, columns))), (field, columns)
