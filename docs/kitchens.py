"""Draws docs/kitchens.png: `python docs/kitchens.py`."""

import pathlib

import mujoco

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.viz import render

PICTURES = 12
U = mja.Uniform


def kitchen() -> tuple[mja.Arena, mja.ArenaRanges]:
    """A table in an L of cabinets, below a window, between a shelf, drawers and a cupboard."""
    objects = [
        mja.Object("mug", "cylinder", full_size=(0.08, 0.08, 0.1)),
        mja.Object("cereal", full_size=(0.08, 0.19, 0.28)),
        mja.Object("orange", "sphere", full_size=0.08),
    ]
    arena = mja.TableArena((0.8, 1.2, 0.04), table_offset=(0.2, 0, 0.75), objects=objects)
    arena.add_material("oak", mja.textures.Wood(seed=1))
    plaster, oak = (0.9, 0.88, 0.82, 1), {"material": "oak", "rgba": (1, 1, 1, 1)}
    for part in (
        furniture.Wall("wall", pos=(2.4, -0.5, 0), full_size=(0.1, 4.4, 2.5), window=(1.2, 0.9), rgba=plaster),
        furniture.Counter("counter", pos=(2.34, -2.6, 0), widths=(0.6, 0.6, 0.6, 0.6)),
        furniture.Shelf("rack", pos=(1.5, 1.95, 0), rot=1.5708, heights=(0.3, 0.8, 1.3, 1.8), **oak),
        furniture.Drawers("drawers", pos=(0.6, 1.9, 0), rot=1.5708, heights=(0.25, 0.2, 0.15), **oak),
        furniture.Cupboard("cupboard", pos=(2.15, -1.9, 1.4)),
        furniture.Bin("crate", pos=(0.2, 0.35, 0.75), inner_size=(0.25, 0.18, 0.1), rgba=(0.3, 0.5, 0.7, 1)),
    ):
        arena.add_part(part)
    colour = U([0.3, 0.3, 0.3, 1], [0.9, 0.9, 0.9, 1])
    terms = {
        "counter.widths": U(0.4, 0.65),
        "counter.height": U(0.8, 1.0),
        "counter.rgba": colour,
        "cupboard.rgba": colour,
        "cupboard.hinge_left": mja.Bernoulli(0.5),
        "cupboard.opening": U(0.0, 1.6),
        "wall.window": U([0.6, 0.5], [1.6, 1.1]),
        "wall.window_at": U([0.1, 1.1], [0.8, 1.2]),
        "rack.heights": U(-0.12, 0.12, relative="add"),
        "rack.pieces_active": mja.Bernoulli(0.75),
        "rack.size": U([0.25, 0.6], [0.4, 1.0]),
        "drawers.openings": U(0.0, 0.25),
        "drawers.heights": U(0.12, 0.25),
        "crate.active": mja.Bernoulli(0.7),
        "crate.pos": U([-0.1, -0.2, 0], [0.1, 0.1, 0], relative="add"),
    }
    ranges = mja.ArenaRanges(table_offsets=U([-0.1, -0.1, 0], [0.1, 0.1, 0], relative="add"), terms=terms)
    return arena, ranges


def main() -> None:
    """Twelve of them."""
    arena, ranges = kitchen()
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance, camera.azimuth, camera.elevation = [1.1, -0.25, 0.75], 5.0, 20, -28
    pictures = []
    for key in mja.world_keys(1, range(PICTURES)):
        params = arena.sample_params(key, ranges)
        assert arena.valid(params, ranges), arena.problems(params, ranges)
        data = arena.c_world(params, key=key)[1]
        pictures.append(arena.render(params, data=data, camera=camera, width=360, height=270))
    path = pathlib.Path(__file__).parent / "kitchens.png"
    render.grid(pictures, [f"world {i}" for i in range(PICTURES)]).save(path, optimize=True)
    print(f"written to {path}")


if __name__ == "__main__":
    main()
