"""Draws docs/robots.png, arms as they look, what collides of them, and what collides of the simplified ones: `python docs/robots.py`."""

import pathlib
import re
import sys

import mujoco
import numpy as np

HERE = pathlib.Path(__file__).parent
sys.path.append(str(HERE.parent))

from benchmarks import robots  # noqa: E402
from mjx_arenas.spec import specs  # noqa: E402
from mjx_arenas.viz import render  # noqa: E402

WIDTH, HEIGHT = 300, 280
LOOKS = {"as it looks": ("as_it_is", False), "what collides": ("as_it_is", True), "simplified": ("fast", True)}
SKY = """<mujoco><visual><headlight ambient=".4 .4 .4" diffuse=".5 .5 .5"/></visual>
<asset><texture type="skybox" builtin="flat" rgb1=".95 .95 .95" rgb2=".95 .95 .95" width="32" height="32"/></asset>
<worldbody><light pos="1 1 3" dir="-.3 -.3 -1" diffuse=".4 .4 .4"/></worldbody></mujoco>"""
BLUE, ORANGE, TIPS = (0.45, 0.62, 0.78, 1), (0.84, 0.37, 0.0, 1), "r_.*(pad|finger|down)"


def standing(robot: mujoco.MjSpec) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """An arm at home, alone in the world."""
    spec = mujoco.MjSpec.from_string(SKY)
    specs.attach(spec, robot.copy(), "r_", spec.worldbody.add_frame(), "robot")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("r_home").id)
    mujoco.mj_forward(model, data)
    return model, data


def framed(data: mujoco.MjData) -> mujoco.MjvCamera:
    """A camera that sees all of an arm."""
    camera, points = mujoco.MjvCamera(), data.geom_xpos
    camera.lookat, camera.azimuth, camera.elevation = (points.min(0) + points.max(0)) / 2, 130, -18
    camera.lookat[2] += 0.03
    camera.distance = 1.15 * np.linalg.norm(np.ptp(points, axis=0)) + 0.3
    return camera


def picture(model: mujoco.MjModel, data: mujoco.MjData, camera: mujoco.MjvCamera, collision: bool) -> np.ndarray:
    """(HEIGHT, WIDTH, 3) uint8 of an arm, or of the shapes with which it collides: of meshes the convex hulls."""
    option = mujoco.MjvOption()
    if collision:
        option.geomgroup[:] = 1
        option.flags[mujoco.mjtVisFlag.mjVIS_CONVEXHULL] = 1
        hits = (model.geom_contype | model.geom_conaffinity) > 0
        tips = np.array([re.fullmatch(TIPS, model.body(b).name) is not None for b in model.geom_bodyid])
        model.geom_matid[:], model.geom_rgba[:] = -1, np.where(hits[:, None], BLUE, 0)
        model.geom_rgba[hits & tips] = ORANGE
    with render.Drawing(model, WIDTH, HEIGHT) as drawing:
        drawing.update(model, data, camera, option)
        return drawing.pixels()


def main() -> None:
    """A column for each arm."""
    cameras = {name: framed(standing(robots.made(name, "as_it_is")[0])[1]) for name in robots.FAST}
    pictures = [
        picture(*standing(robots.made(name, how)[0]), cameras[name], collision)
        for how, collision in LOOKS.values()
        for name in robots.FAST
    ]
    labels = [f"{name}: {look}" for look in LOOKS for name in robots.FAST]
    path = HERE / "robots.png"
    render.grid(pictures, labels, columns=len(robots.FAST)).save(path, optimize=True)
    print(f"written to {path}")


if __name__ == "__main__":
    main()
