"""Pictures of a view's worlds by C MuJoCo's renderer, and what differs from them in the ray caster's."""

import mujoco
import numpy as np
import views
from gl import Drawing

import mjx_arenas as mja
from mjx_arenas.viz import render

DEPTH = 2e-3  # [m] within a surface
BENT = 0.02  # [1/m] by which the inverse of depth, which is even on a plane, bends from a pixel to the next at an edge
COLOUR = (
    1.5  # of 255, in the mean: at most 1 as OpenGL rounds and the ray caster cuts off, and what smoothed textures add
)
STEP = 12  # of 255, from a pixel to the next, where a texture has an edge: OpenGL smooths it, the ray caster does not
OF_A_THING = STEP / 2  # in the mean over one thing: two pixels that are smoothed into one are half a step from it
FEW = 8  # pixels of a thing, of which at least so many are seen, as highlights fall on few
LEFT = 0.3  # of a light, in its shadow, by the ray caster; OpenGL leaves nothing


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
    changes = [np.abs(np.roll(rgb, 1, axis).astype(float) - rgb).max(-1) > STEP for axis in (0, 1)]
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


def in_c(view, batch, data, known):
    """Of each world RGB, depth and labels of each camera, drawn by C MuJoCo."""
    render.choose_gl()
    option, arena = mujoco.MjvOption(), views.arena(view)
    option.sitegroup[:] = 0
    with Drawing(arena.mj_model, views.HEIGHT, views.WIDTH) as drawing:
        for i in range(batch.n_worlds):
            model, state = arena.c_world(batch.world(i), mja.take(data, i))
            drawing.of(model)
            label, shadows = label_of(model, known), views.VIEWS[view].shadows
            yield {c: seen_in_c(drawing, state, c, option, label, shadows) for c in views.VIEWS[view].cameras}


def seen_in_c(drawing, state, camera, option, label, shadows):
    """RGB, depth and labels of one camera; in a shadow with the light that the ray caster leaves there."""
    drawing.update_scene(state, camera, option)
    for flag in ("SHADOW", "REFLECTION", "SKYBOX", "HAZE"):
        drawing.scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = 0
    rgb = drawing.render().copy()
    if shadows:
        drawing.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 1
        rgb = LEFT * rgb + (1 - LEFT) * drawing.render()
    drawing.enable_depth_rendering()
    depth = drawing.render().copy()
    drawing.disable_depth_rendering()
    drawing.enable_segmentation_rendering()
    geom, kind = np.moveaxis(drawing.render(), -1, 0)
    drawing.disable_segmentation_rendering()
    geom = np.where(kind == mujoco.mjtObj.mjOBJ_GEOM, geom, -1)
    return rgb, depth, label[geom]


def wrong(theirs, ours, known):
    """What of a world's pictures differs from C's: names of cameras and of what they give."""
    found = set()
    for camera, (rgb, depth, label) in theirs.items():
        own = ours[camera]
        inside = ~edges(label)
        if (own.segmentation != label)[inside].any():
            found.add((camera, "segmentation"))
        flat = inside & (label >= 0) & (own.segmentation == label) & ~bends(depth) & ~bends(own.depth)
        if (np.abs(own.depth - depth)[flat] > DEPTH).any():
            found.add((camera, "depth"))
        even = inside & ~steps(rgb) & ~steps(own.rgb)
        off = np.abs(own.rgb - rgb.astype(float))
        if off[even].mean() > COLOUR:
            found.add((camera, "rgb"))
        for thing in np.unique(label[even]):
            if (here := even & (label == thing)).sum() >= FEW and off[here].mean() > OF_A_THING:
                found.add((camera, f"rgb of {known[thing]}"))
        if min(flat.mean(), even.mean()) < 0.05:
            found.add((camera, "too little"))
    return found
