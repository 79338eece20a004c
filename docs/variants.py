"""Draws docs/variants.png: `python docs/variants.py`."""

import pathlib
import tempfile

import mujoco
import numpy as np

import mjx_arenas as mja
from mjx_arenas.viz import render

PICTURES = 12
MUG = """<mujoco><asset><material name="clay" rgba=".2 .45 .6 1"/></asset><worldbody><body name="mug">{walls}
<geom type="cylinder" size=".036 .004" pos="0 0 -.046" material="clay"/>
<geom type="capsule" size=".006" fromto=".04 0 .025 .065 0 .02" material="clay"/>
<geom type="capsule" size=".006" fromto=".065 0 .02 .065 0 -.02" material="clay"/>
<geom type="capsule" size=".006" fromto=".04 0 -.025 .065 0 -.02" material="clay"/></body></worldbody></mujoco>"""
WALL = '<geom type="box" size=".004 .016 .05" pos="{x:.4f} {y:.4f} 0" euler="0 0 {angle}" material="clay"/>'
PYRAMID = """v .06 .06 -.04
v -.06 .06 -.04
v -.06 -.06 -.04
v .06 -.06 -.04
v 0 0 .06
f 1 4 3
f 1 3 2
f 1 2 5
f 2 3 5
f 3 4 5
f 4 1 5"""


def things(folder: pathlib.Path) -> tuple[mja.Arena, mja.ArenaRanges]:
    """Three objects, each of which is a mug, a box, a ball, a can, a rod or a pyramid."""
    turned = [(a, 0.04 * np.cos(np.radians(a)), 0.04 * np.sin(np.radians(a))) for a in range(0, 360, 36)]
    walls = "".join(WALL.format(x=x, y=y, angle=a) for a, x, y in turned)
    (folder / "mug.xml").write_text(MUG.format(walls=walls))
    (folder / "pyramid.obj").write_text(PYRAMID)
    variants = [
        mja.Object("mug", "mjcf", file=folder / "mug.xml"),
        mja.Object("cereal", "box", (0.08, 0.15, 0.2), density=300, rgba=(0.84, 0.37, 0.0, 1)),
        mja.Object("orange", "sphere", 0.09, density=700, rgba=(0.9, 0.62, 0.0, 1)),
        mja.Object("can", "cylinder", (0.07, 0.07, 0.12), rgba=(0.0, 0.62, 0.45, 1)),
        mja.Object("rod", "capsule", (0.2, 0.04, 0.04), rgba=(0.8, 0.47, 0.65, 1)),
        mja.Object("pyramid", "mesh", file=folder / "pyramid.obj", rgba=(0.34, 0.71, 0.91, 1)),
    ]
    arena = mja.TableArena((0.7, 0.7, 0.04), objects=[mja.Object(f"thing{k}", variants=variants) for k in range(3)])
    terms = {f"thing{k}.variant": mja.Choice(list(range(len(variants)))) for k in range(3)}
    return arena, mja.ArenaRanges(object_masses=mja.LogUniform(0.5, 2.0, relative="scale"), terms=terms)


def main() -> None:
    """Twelve worlds of one compiled model."""
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance, camera.azimuth, camera.elevation = [0, 0, 0.83], 1.15, 35, -32
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        arena, ranges = things(pathlib.Path(folder))
        for key in mja.world_keys(3, range(PICTURES)):
            params = arena.sample_params(key, ranges)
            assert arena.valid(params, ranges), arena.problems(params, ranges)
            data = arena.c_world(params, key=key)[1]
            pictures.append(arena.render(params, data=data, camera=camera, width=360, height=270))
    path = pathlib.Path(__file__).parent / "variants.png"
    render.grid(pictures, [f"world {i}" for i in range(PICTURES)]).save(path, optimize=True)
    print(f"written to {path}")


if __name__ == "__main__":
    main()
