"""Placement on every kind of surface: footprints against a plain loop, and in C MuJoCo objects stay where they were placed."""

import itertools

import jax
import mujoco
import numpy as np
import pytest
from test_surfaces import PARTS, RANGES

import mjx_arenas as mja
from mjx_arenas import furniture

pytestmark = pytest.mark.slow

SURFACES = {
    "table": "table",
    "board with another above": "rack_board1",
    "bin": "crate_bottom",
    "worktop": "kitchen_top2",
    "corner": "kitchen_top1",
    "step": "stairs_step1",
    "open drawer": "drawers_drawer0_bottom",
    "drawer unit": "drawers_top",
    "cupboard": "cupboard_bottom",
    "on a cupboard": "cupboard_top",
    "table of a scene": "scene_desk",
    "floor": "spot",
    "box": "tray",
    "cylinder": "drum",
    "rail": "gantry_rail0",
}
SHAPES = (("box", (0.1, 0.06, 0.05)), ("cylinder", (0.06, 0.06, 0.05)), ("capsule", (0.1, 0.04, 0.04)))
TRAY, DRUM, MASS = 0.5, 0.6, 0.1  # [kg] of what carries the others, and of each of those
WORLDS, RUN = 24, 4  # of which so many are stepped


SCENE = """<mujoco><worldbody><body name="room" pos=".1 0 0" euler="0 0 25"><body name="desk" pos="0 .2 .7">
  <geom name="slab" type="box" size=".35 .3 .02"/><geom name="lamp" type="cylinder" size=".05 .1" pos=".25 .2 .12"/>
  <geom name="leg" type="box" size=".03 .03 .34" pos="-.3 0 -.36"/></body></body></worldbody></mujoco>"""


def objects():
    """Three on each surface, after the two that carry some."""
    yield mja.Object("tray", full_size=(0.36, 0.3, 0.03), mass=TRAY)
    yield mja.Object("drum", "cylinder", full_size=(0.26, 0.26, 0.1), mass=DRUM, on="spot")
    for surface in SURFACES.values():
        for kind, size in SHAPES:
            yield mja.Object(f"{kind}_{surface}", kind, full_size=size, mass=MASS, on=surface)


@pytest.fixture(scope="module")
def worlds():
    """Of each world its parameters, model, data at the start, and where bodies are after a second."""
    arena = mja.TableArena((1.2, 1.2, 0.05), objects=[next(objects())])
    arena = arena.merge(mja.Arena.from_xml(SCENE, ["slab"]), "scene_", pos=(-3.5, 0, 0), rot=0.4)
    for part in (*PARTS, furniture.Rail("gantry", pos=(0.5, 3.5, 0), rot=0.5, thickness=0.2, heights=(0.6,))):
        arena.add_part(part)
    for obj in list(objects())[1:]:
        arena.add_object(obj)
    keys = mja.world_keys(0, range(WORLDS))
    params = jax.jit(jax.vmap(lambda key: arena.sample_params(key, RANGES)))(keys)
    placed = jax.jit(jax.vmap(arena.place))(params, keys)
    assert np.asarray(placed.valid).all(), (~placed.valid).sum(0)
    found = []
    for w in range(WORLDS):
        p = jax.tree.map(lambda x, w=w: np.asarray(x)[w], params)
        model, c = arena.c_world(p, key=keys[w])
        end = mujoco.MjData(model)
        mujoco.mj_copyData(end, model, c)
        mujoco.mj_step(model, end, nstep=round(1 / model.opt.timestep) if w < RUN else 0)
        found.append((p, model, c, end))
    return found


def footprint(model, c, name):
    """The corners (4, 2) of the rectangle within an object's outline, in order, its rounding, and its lowest height."""
    geom, at = model.geom(f"{name}_g0"), c.geom(f"{name}_g0")
    kind, turn = geom.type[0], at.xmat.reshape(3, 3)
    half, radius, along, up = geom.size[:2], 0.0, turn[:2, 0], geom.size[2]
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        half, radius, up = np.zeros(2), geom.size[0], geom.size[1]
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:  # lies along its own z
        half, radius, along, up = np.array([geom.size[1], 0.0]), geom.size[0], turn[:2, 2], geom.size[0]
    across = np.array([-along[1], along[0]])
    corners = [
        at.xpos[:2] + a * half[0] * along + b * half[1] * across for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))
    ]
    return np.array(corners), radius, at.xpos[2] - up


def to_side(point, start, end):
    """The distance of a point from a side."""
    along = end - start
    share = np.clip((point - start) @ along / max(along @ along, 1e-12), 0, 1)
    return np.linalg.norm(point - start - share * along)


def cross(one, other):
    """Whether sides of two rectangles cross, or one lies in the other: no direction of a side separates them."""
    sides = [(corners[1] - corners[0], corners[2] - corners[1]) for corners in (one, other)]
    for along in itertools.chain(*sides):
        a, b = one @ along, other @ along
        if a.max() <= b.min() or b.max() <= a.min():
            return False
    return True


def gap(one, other):
    """Between two rounded rectangles, a corner and a side at a time."""
    (a, rounding, _), (b, others, _) = one, other
    pairs = [(point, rim[i - 1], rim[i]) for points, rim in ((a, b), (b, a)) for point in points for i in range(4)]
    nearest = min(to_side(*pair) for pair in pairs)
    return (-nearest if cross(a, b) else nearest) - rounding - others


def below(kind, p, model, c):
    """Middle (3,) of a surface's upper side, its axes (2, 2), and half of its sides (2,), or of a disc its radius."""
    if kind == "floor":
        top, rot, size = (p.terms[f"spot.{name}"][0] for name in ("pos", "rot", "size"))
        return top, np.array([[np.cos(rot), -np.sin(rot)], [np.sin(rot), np.cos(rot)]]), size / 2
    name = {"table": "table_collision", "table of a scene": "scene_slab", "box": "tray_g0", "cylinder": "drum_g0"}.get(
        kind, SURFACES[kind]
    )
    at, size = c.geom(name), model.geom(name).size
    half, up = (size[0], size[1]) if kind == "cylinder" else (size[:2], size[2])
    return at.xpos + np.array([0, 0, up]), at.xmat.reshape(3, 3)[:2, :2], half


@pytest.mark.parametrize("kind", SURFACES)
def test_footprints(worlds, kind):
    """Inside the edges of the surface, level with it, and apart from everything else there; all over it in many worlds."""
    names, spread = [f"{shape}_{SURFACES[kind]}" for shape, _ in SHAPES], []
    beside = {"table": ["tray"], "floor": ["drum"]}.get(kind, [])
    for p, model, c, _ in worlds:
        top, turn, half = below(kind, p, model, c)
        prints = {name: footprint(model, c, name) for name in [*names, *beside]}
        for corners, radius, bottom in prints.values():
            assert bottom == pytest.approx(top[2], abs=1e-5)
            local = (corners - top[:2]) @ turn
            reach = np.abs(local) if np.ndim(half) else np.linalg.norm(local, axis=1)
            assert (reach + radius <= half + 1e-5).all()
            spread.append(local.mean(0) / half)
        assert min(gap(*pair) for pair in itertools.combinations(prints.values(), 2)) > -1e-5
        bodies = {model.body(name).id for name in names}
        for contact in c.contact:  # walls, boards above, and parts that stand there
            assert contact.dist > -1e-5 or not bodies & set(model.geom_bodyid[contact.geom].tolist())
    assert (np.std(spread, axis=0) > 0.15).all()


@pytest.mark.parametrize("kind", SURFACES)
def test_rest(worlds, kind):
    """A second later each is where it was, but for what soft contacts give way under it and under what carries it.

    At rest (1 - d) g / d = k depth, with k = d / (most time)^2 and an impedance d between `least` and `most`.
    """
    load = {"box": TRAY, "cylinder": DRUM}.get(kind)
    for _, model, start, end in worlds[:RUN]:
        assert np.isfinite(end.qpos).all()
        for shape, _ in SHAPES:
            name = f"{shape}_{SURFACES[kind]}"
            time, (least, most) = model.geom(f"{name}_g0").solref[0], model.geom(f"{name}_g0").solimp[:2]
            sinks = (1 - least) * 9.81 * (most * time / least) ** 2
            allowed = sinks * (1 if load is None else 1 + (load + len(SHAPES) * MASS) / load)
            moved = end.body(name).xpos - start.body(name).xpos
            assert -allowed <= moved[2] <= 1e-5
            assert np.abs(moved[:2]).max() <= allowed
