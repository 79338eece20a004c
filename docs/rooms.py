"""Draws docs/rooms/*.png, twelve worlds of each furnished example: `python docs/rooms.py [NAME ...]`."""

import pathlib
import sys

import mujoco

import mjx_arenas as mja
from mjx_arenas.viz import render

PICTURES = 12
ROOMS = ("kitchen", "warehouse", "bin_picking", "workshop", "living_room")
FALL = 1.5  # [s] that objects in bins fall


def main(names: list[str]) -> None:
    """One picture of each."""
    folder = pathlib.Path(__file__).parent / "rooms"
    folder.mkdir(exist_ok=True)
    for name in names or ROOMS:
        arena, ranges = mja.load(name)
        pictures = []
        for key in mja.world_keys(2, range(PICTURES)):
            params = arena.sample_params(key, ranges)
            assert arena.valid(params, ranges), arena.problems(params, ranges)
            model, data = arena.c_world(params, key=key)
            if any(o.place is not None and o.place.drop for o in arena.objects):
                mujoco.mj_step(model, data, int(FALL / model.opt.timestep))
            pictures.append(arena.render(params, data=data, camera="room", width=320, height=240))
        path = folder / f"{name}.png"
        render.grid(pictures, [f"world {i}" for i in range(PICTURES)]).save(path, optimize=True)
        print(f"written to {path}")


if __name__ == "__main__":
    main(sys.argv[1:])
