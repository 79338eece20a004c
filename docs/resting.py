"""Draws docs/resting.png, twelve worlds with objects in any pose in which they rest: `python docs/resting.py`."""

import pathlib

import mujoco

import mjx_arenas as mja
from mjx_arenas.viz import render

ROOT = pathlib.Path(__file__).parents[1]
HAMMER = """<mujoco><worldbody><body name="hammer">
<geom name="head" type="box" size=".02 .06 .025" density="7000" rgba=".45 .45 .5 1"/>
<geom name="handle" type="box" size=".1 .012 .015" pos=".12 0 0" density="700" rgba=".7 .5 .3 1"/></body></worldbody></mujoco>"""
OBJECTS = {
    "brick": (6, mja.Object("brick", full_size=(0.2, 0.1, 0.05), rgba=(0.75, 0.3, 0.2, 1), pose="resting")),
    "can": (3, mja.Object("can", "cylinder", (0.1, 0.1, 0.15), rgba=(0.3, 0.6, 0.4, 1), pose="resting")),
    "hammer": (6, mja.Object("hammer", "mjcf", file=mujoco.MjSpec.from_string(HAMMER), pose="resting")),
    "wedge": (
        5,
        mja.Object(
            "wedge", "mesh", full_size=(0.18, 0.12, 0.1), file=ROOT / "tests" / "data" / "wedge.obj", pose="resting"
        ),
    ),
}


def main() -> None:
    """One picture of twelve worlds."""
    objects = [one for _, one in OBJECTS.values()]
    arena = mja.TableArena((0.8, 0.8, 0.05), objects=objects)
    terms = {f"{name}.pose": mja.Choice(list(range(n)), p=[1 / n] * n) for name, (n, _) in OBJECTS.items()}
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance, camera.azimuth, camera.elevation = (0.0, 0.0, 0.8), 1.35, 30, -38
    pictures = []
    for key in mja.world_keys(3, range(12)):
        params = arena.sample_params(key, mja.ArenaRanges(terms=terms))
        data = arena.c_world(params, key=key)[1]
        pictures.append(arena.render(params, data=data, camera=camera, width=320, height=240))
    path = ROOT / "docs" / "resting.png"
    render.grid(pictures, [f"world {i}" for i in range(12)]).save(path, optimize=True)
    print(f"written to {path}")


if __name__ == "__main__":
    main()
