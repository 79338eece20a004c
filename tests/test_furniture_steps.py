"""Parts in steps on Warp, as in C: balls fall where a part or a piece is absent, and things rest on eight of each."""

import jax
import mujoco
import numpy as np
import pytest
from test_furniture_many import NEAR, ON, rest_as_in_c

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.furniture import layouts

RADIUS, ABOVE, STEPS = 0.02, 0.01, 100
PARTS = {
    "shelf_board1": (furniture.Shelf("shelf"), "shelf.pieces_active"),
    "bin_bottom": (furniture.Bin("bin", pos=(0, 0, 1)), "bin.active"),
    "counter_top1": (furniture.Counter("counter"), "counter.pieces_active"),
    "drawers_drawer2_bottom": (furniture.Drawers("drawers", openings=(0, 0, 0.3)), "drawers.pieces_active"),
    "cupboard_top": (furniture.Cupboard("cupboard", pos=(0, 0, 1)), "cupboard.active"),
    "wall_above": (furniture.Wall("wall", window=(1, 0.8)), "wall.active"),
    "steps_step2": (furniture.Steps("steps"), "steps.active"),
    "ramp_plate": (furniture.Ramp("ramp", pos=(0, 0, 1), rise=0.02, thickness=0.04), "ramp.active"),
    "rail_rail1": (furniture.Rail("rail"), "rail.active"),
}
"""Boxes over which a ball is let go, each with its part, and what says whether it is there."""


@pytest.fixture(scope="module")
def arena():
    """One of each part that has boxes, and as many balls, which are on the table nominally."""
    parts = layouts.grid([part for part, _ in PARTS.values()], 3, (4.0, 4.0), pos=(4, 0, 0))
    balls = [mja.Object(f"ball_{name}", "sphere", 2 * RADIUS) for name in PARTS]
    arena = mja.TableArena(objects=balls)
    for part in parts:
        arena.add_part(part)
    return arena


def worlds_of(arena):
    """(3, ...) parameters: everything is there, nothing is, and of parts with pieces all but those over which there is a ball."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    parts = {part.name for part, _ in PARTS.values()}
    nothing = {f"{name}.active": np.zeros(1, bool) for name in parts}
    some = {}
    for box, (part, name) in PARTS.items():
        if name.endswith("pieces_active"):
            piece = next(one.piece for one in part.nominal_boxes if f"{part.name}_{one.name}" == box)
            some[name] = np.array([one != piece for one in part.coming])
    assert len(some) == 3
    each = [nominal._replace(terms={**nominal.terms, **gone}) for gone in ({}, nothing, some)]
    return each, [set(), set(PARTS), {box for box, (_, name) in PARTS.items() if name in some}]


@pytest.mark.xslow
def test_balls_fall_where_nothing_is(arena):
    """What is there holds its ball, and what is absent lets it fall freely; on Warp as in C."""
    each, gone = worlds_of(arena)
    nominal, place = arena.c_world(each[0])
    start = np.array([place.geom(box).xpos for box in PARTS])
    start[:, 2] += [nominal.geom(box).size[2] + RADIUS + ABOVE for box in PARTS]
    at = arena.layout.object_qpos[:, :3]
    batch = arena.batch(arena.put_model("warp"), jax.tree.map(lambda *x: np.stack(x), *each))
    data = mja.make_data(batch)
    data = data.replace(qpos=data.qpos.at[:, at].set(start.astype(np.float32)))
    end = np.asarray(mja.rollout(batch, data, STEPS).qpos, float)[:, at]
    for w, params in enumerate(each):
        model, c = arena.c_world(params)
        for k, box in enumerate(PARTS):
            adr = model.joint(f"ball_{box}_joint0").qposadr[0]
            c.qpos[adr : adr + 3] = start[k]
        mujoco.mj_step(model, c, STEPS)
        for k, box in enumerate(PARTS):
            adr = model.joint(f"ball_{box}_joint0").qposadr[0]
            np.testing.assert_allclose(end[w, k], c.qpos[adr : adr + 3], rtol=0, atol=NEAR, err_msg=f"{w} {box}")
            fallen, time = start[k, 2] - end[w, k, 2], STEPS * model.opt.timestep
            free = 9.81 * time * (time + model.opt.timestep) / 2  # as Euler's steps have it
            assert fallen == pytest.approx(free, abs=NEAR) if box in gone[w] else fallen < 2 * ABOVE, (w, box)


@pytest.mark.xslow
@pytest.mark.parametrize("kind", ON, ids=lambda kind: kind.__name__)
def test_things_rest_on_eight(kind):
    """Each of eight parts has a size of its own, and its thing stays where it is put on it; on Warp as in C."""
    name = kind.__name__.lower()
    arena = mja.TableArena()
    for part in layouts.grid([kind(f"{name}{i}") for i in range(8)], 4, (3.0, 3.0), pos=(3, 0, 0)):
        arena.add_part(part)
    for i in range(8):
        on = f"{name}{i}_{ON[kind]}" if ON[kind] else f"{name}{i}"
        arena.add_object(mja.Object(f"thing{i}", full_size=(0.06, 0.05, 0.04), on=on))
    sizes = [
        one for one in arena.quantities if one.split(".")[1] in ("height", "heights", "inner_size", "rises", "size")
    ]
    assert len(sizes) >= 8
    ranges = mja.ArenaRanges(terms=dict.fromkeys(sizes, mja.Uniform(0.9, 1.0, relative="scale")))
    keys = mja.world_keys(0, range(2))
    batch = arena.randomize(arena.put_model("warp"), keys, ranges)
    assert batch.valid.all()
    start = mja.make_data(batch, keys)
    end = mja.rollout(batch, start, 60)
    for rest in rest_as_in_c(arena, batch, keys, end):
        assert kind in (furniture.Bin, furniture.Zone) or len(np.unique(rest)) == 8
