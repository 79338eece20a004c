"""Draws docs/rooms/*.png, twelve worlds of each furnished example, and docs/rooms.png, two of each: `python docs/rooms.py [NAME ...]`.

The name "galley" stands for the counter with two corners of docs/furniture.md.
"""

import pathlib
import re
import sys
from typing import Any

import mujoco
import numpy as np
from PIL import Image

import mjx_arenas as mja
from mjx_arenas.viz import render

PICTURES, WIDTH, HEIGHT = 12, 320, 240
ROOMS = ("kitchen", "warehouse", "bin_picking", "workshop", "living_room")
GALLEY = "galley"
FALL = 1.5  # [s] that objects in bins fall


def main(names: list[str]) -> None:
    """One picture of each."""
    folder = pathlib.Path(__file__).parent / "rooms"
    folder.mkdir(exist_ok=True)
    for name in names or (*ROOMS, GALLEY):
        arena, ranges = galley() if name == GALLEY else mja.load(name)
        pictures = []
        for key in mja.world_keys(2, range(PICTURES)):
            params = arena.sample_params(key, ranges)
            assert arena.valid(params, ranges), arena.problems(params, ranges)
            model, data = arena.c_world(params, key=key)
            if any(o.place is not None and o.place.drop for o in arena.objects):
                mujoco.mj_step(model, data, int(FALL / model.opt.timestep))
            pictures.append(arena.render(params, data=data, camera="room", width=WIDTH, height=HEIGHT))
        path = folder / f"{name}.png"
        render.grid(pictures, [f"world {i}" for i in range(PICTURES)]).save(path, optimize=True)
        print(f"written to {path}")
    sheet(folder)


def galley() -> tuple[mja.Arena, mja.ArenaRanges]:
    """The counter with two corners, as docs/furniture.md has it, before a camera."""
    text = (pathlib.Path(__file__).parent / "furniture.md").read_text()
    (code,) = (block for block in re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL) if GALLEY in block)
    names: dict[str, Any] = {"mja": mja, "furniture": mja.furniture}
    exec(compile(code, "docs/furniture.md", "exec"), names)
    arena, ranges = names["arena"], names["ranges"]
    arena.add_camera("room", pos=(-3.0, 0, 3.2), look_at=(0.4, 0, 0.5))
    return arena, ranges


def sheet(folder: pathlib.Path) -> None:
    """One picture of all: a column for each example, cut out of its own picture."""
    rows: list[list[np.ndarray]] = [[], []]
    for name in ROOMS:
        whole = np.asarray(Image.open(folder / f"{name}.png").convert("RGB"))
        gap = (whole.shape[1] - 4 * WIDTH) // 5
        for i, row in enumerate(rows):
            left = gap + i * (WIDTH + gap)
            row.append(whole[gap : gap + HEIGHT, left : left + WIDTH])
    pictures = [picture for row in rows for picture in row]
    titles = [name.replace("_", " ") for name in ROOMS] + [""] * len(ROOMS)
    render.grid(pictures, titles, columns=len(ROOMS)).save(folder.parent / "rooms.png", optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
