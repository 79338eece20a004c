"""The camera on the hand of an arm: it looks at what is before the tool, from the side on which least is in its way."""

import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas.envs import arms
from mjx_arenas.envs.arms import wrist_camera
from mjx_arenas.spec import specs

PLATE = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": (0.002, 0.1, 0.05), "contype": 0, "conaffinity": 0}


@pytest.mark.parametrize(("plates", "side"), [((), (-1, 0)), ((-1,), (1, 0)), ((-1, 1), (0, -1))])
def test_its_side(plates, side):
    """Behind the tool and beside it, with y of the picture along the tool, and nothing of the arm before the tool."""
    arm = arms.small()
    for x in plates:
        arm.spec.body("hand").add_geom(pos=(0.05 * x, 0, -0.04), **PLATE)
    arena = mja.TableArena()
    arena.attach(arm.spec, prefix="arm_", pos=(-0.2, 0.1, 1.0), quat=(0.9, 0, 0, 0.4))
    wrist_camera.add(arena, specs.compiled(arm.spec, "arm.spec"), "home", arm.tool, "arm_")
    model = arena.mj_model
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("arm_home").id)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    tool, camera = data.site("arm_tool"), data.cam(wrist_camera.NAME)
    mat, axes = tool.xmat.reshape(3, 3), camera.xmat.reshape(3, 3)
    eye = mat.T @ (camera.xpos - tool.xpos)
    np.testing.assert_allclose(eye, [0.09 * side[0], 0.09 * side[1], -0.08], atol=1e-6)
    ahead = mat @ [0, 0, 0.02] + tool.xpos - camera.xpos
    np.testing.assert_allclose(-axes[:, 2], ahead / np.linalg.norm(ahead), atol=1e-6)
    assert abs(axes[:, 0] @ mat[:, 2]) < 1e-6  # the horizon lies across the tool
    assert axes[:, 1] @ (mat @ [*side, 0]) < 0  # what is further off is higher
