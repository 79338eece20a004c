"""Shadows of tables, legs, objects and robots that differ between worlds: C MuJoCo's renderer of the recompiled world is the oracle."""

import dataclasses

import jax
import mujoco
import numpy as np
import pytest
import views
from gl import needs_gl
from pictures import label_of
from test_optics import draw_in_c, labels_in_c, near_edges, seen

import mjx_arenas as mja
from mjx_arenas.viz import render

pytestmark = [needs_gl, pytest.mark.slow]

N, WIDTH, HEIGHT = 6, 192, 144
LAMP = 0  # the light of the arena that casts shadows
CAMERAS = views.VIEWS["tables"].cameras
RANGES = views.OF_TABLES._replace(
    terms={**views.OF_TABLES.terms, "colour": mja.Uniform([[0.5], [0.05]], [[0.6], [0.1]])}
)


def worlds(arena):
    keys = mja.world_keys(5, range(N))
    batch = arena.randomize(arena.put_model("warp"), keys, RANGES)
    return batch, mja.make_data(batch, keys)


def on_device(arena):
    """A function of worlds, of those that are shown in their place, and of data: what is seen of each by camera."""
    sizes = dict.fromkeys(CAMERAS, (WIDTH, HEIGHT))
    plain, shading = (jax.jit(arena.renderer(sizes, segmentation=True, shadows=x)) for x in (False, True))

    def see(batch, shown, data):
        active = np.array(batch.model.light_active) & (np.arange(arena.mj_model.nlight) != LAMP)
        dark = dataclasses.replace(batch, model=batch.model.tree_replace({"light_active": active}))
        drawn = [
            jax.tree.map(np.asarray, draw(these, data))
            for draw, these in ((plain, dark), (plain, shown), (shading, shown))
        ]
        return [
            {c: seen(drawn[1][c].segmentation[i], *(pictures[c].rgb[i] for pictures in drawn)) for c in CAMERAS}
            for i in range(N)
        ]

    return see


def in_c(arena, batch, data, i, known):
    """The same of a world."""
    model, state = arena.c_world(batch.world(i), mja.take(data, i))
    model.vis.quality.shadowsize, model.vis.quality.offsamples = 8192, 0
    label, found = label_of(model, known), {}
    with mujoco.Renderer(model, HEIGHT, WIDTH) as drawing:
        for camera in CAMERAS:
            model.light_active[LAMP] = True
            bright, shaded = (draw_in_c(drawing, state, camera, shadows) for shadows in (False, True))
            labels = labels_in_c(drawing, state, camera, label)
            model.light_active[LAMP] = False
            found[camera] = seen(labels, draw_in_c(drawing, state, camera, False), bright, shaded)
    return found


def wrong(ours, theirs):
    """Cameras in whose pictures, away from edges, something else is seen, or is in shadow where the lamp would light it."""
    found = set()
    for camera, one in ours.items():
        other = theirs[camera]
        inside = ~near_edges(*one, *other)
        differ = (one.label != other.label) | (one.lit & other.lit & (one.shadowed != other.shadowed))
        if (differ & inside).any():
            found.add(camera)
    return found


@pytest.mark.xslow
def test_as_in_c(optimized_rays):
    """The same is in shadow; a stale size or lamp, and pictures without shadows, are noticed."""
    arena = views.tables()
    render.choose_gl()
    batch, data = worlds(arena)
    see, known = on_device(arena), arena.renderer(list(CAMERAS), segmentation=True).labels
    ours, theirs = see(batch, batch, data), [in_c(arena, batch, data, i, known) for i in range(N)]
    assert list(map(wrong, ours, theirs)) == [set()] * N
    for camera in CAMERAS:
        inside = np.array([~near_edges(*one[camera], *other[camera]) for one, other in zip(ours, theirs, strict=True)])
        assert inside.mean() > 0.7, camera
        assert (np.array([other[camera].shadowed for other in theirs]) & inside).sum() > 300, camera
    plain = [{c: x._replace(shadowed=np.zeros_like(x.shadowed)) for c, x in one.items()} for one in ours]
    assert any(map(wrong, plain, theirs)), "no shadow"
    nominal = arena.put_model("warp")
    mutants = {
        "size": {"geom_size": nominal.geom_size},
        "lamp": {"light_dir": nominal.light_dir},
    }
    for name, fields in mutants.items():
        stale = {k: np.broadcast_to(x, getattr(batch.model, k).shape) for k, x in fields.items()}
        shown = dataclasses.replace(batch, model=batch.model.tree_replace(stale))
        shadows = [
            {c: one[c]._replace(label=right[c].label) for c in CAMERAS}  # that things themselves differ does not count
            for one, right in zip(see(batch, shown, data), ours, strict=True)
        ]
        assert any(map(wrong, shadows, theirs)), name
