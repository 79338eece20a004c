"""Cameras that are added to an arena: they look where they should, and come back from files."""

import threading

import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr

ARM = """<mujoco><worldbody><body name="base" pos="0 0 .5"><joint name="j" axis="0 1 0"/>
<geom type="capsule" size=".03" fromto="0 0 0 .3 0 0"/></body></worldbody></mujoco>"""


def arena():
    made = mja.MultiTableArena(table_offsets=[[0, 0, 0.8]], objects=[mja.Object("cube")])
    made.attach(ARM, "arm_")
    return made


def seen(made, name, qpos=0.0):
    """Place and axes (right, up, back) of a camera, after the arm has turned."""
    data = mujoco.MjData(made.mj_model)
    data.joint("arm_j").qpos = qpos
    mujoco.mj_forward(made.mj_model, data)
    return data.camera(name).xpos, data.camera(name).xmat.reshape(3, 3).T


@pytest.mark.parametrize("pos", [(1.0, 2.0, 3.0), (-1.0, 0.2, 0.3), (0.1, 0.2, 4.0)])
def test_looks_at_a_point(pos):
    made = arena()
    made.add_camera("eye", pos, look_at=(0.1, 0.2, 0.3), fovy=50)
    at, (right, up, back) = seen(made, "eye")
    np.testing.assert_allclose(at, pos)
    way = np.array([0.1, 0.2, 0.3]) - pos
    np.testing.assert_allclose(back, -way / np.linalg.norm(way), atol=1e-12)
    assert abs(right[2]) < 1e-12, "upright"
    assert up[2] > -1e-12
    assert made.mj_model.camera("eye").fovy == 50


def test_on_a_hand():
    """It turns with the body, whose frame its numbers are in."""
    made = arena()
    made.add_camera("wrist", (0.1, 0, 0.2), look_at=(0.3, 0, 0), on="arm_base", resolution=(80, 60))
    at, (_, _, back) = seen(made, "wrist", np.pi / 2)  # about y: x goes down
    np.testing.assert_allclose(at, [0.2, 0, 0.4], atol=1e-12)
    way = np.array([0.0, 0.0, 0.2]) - at
    np.testing.assert_allclose(back, -way / np.linalg.norm(way), atol=1e-12)
    np.testing.assert_array_equal(made.mj_model.cam_resolution[made.mj_model.camera("wrist").id], [80, 60])


def test_looks_at_a_body():
    made = arena()
    made.add_camera("eye", (1, 1, 2), look_at="cube")
    data = mujoco.MjData(made.mj_model)
    data.qpos[made.layout.object_qpos[0, :3]] = [0.5, -0.3, 0.1]
    mujoco.mj_forward(made.mj_model, data)
    way = np.array([0.5, -0.3, 0.1]) - [1, 1, 2]
    np.testing.assert_allclose(-data.camera("eye").xmat.reshape(3, 3)[:, 2], way / np.linalg.norm(way), atol=1e-9)


@pytest.mark.parametrize(("axis", "moves"), [("roll", 1), ("pitch", 0), ("yaw", None)])
def test_look_at_noise(axis, moves):
    """As docs/pixels.md says: an angle moves the aim of a camera by its share of the distance, up or sideways, and yaw does not."""
    made, at, pos, angle = arena(), np.array([0, 0, 0.8]), np.array([1.7, 0, 1.7]), 0.05 / 1.92
    made.add_camera("eye", pos, look_at=at)
    made.vary(aim=dr.Term("camera.rpy", "eye", axis))
    _, nominal = seen(made, "eye")
    drawn = np.where(np.array(["roll", "pitch", "yaw"]) == axis, angle, 0.0)
    model = made.compile(made.nominal_params()._replace(terms={"aim": drawn[None]}))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    right, up, ahead = nominal @ -data.camera("eye").xmat.reshape(3, 3)[:, 2] * [1, 1, -1]
    off = np.array([right, up]) / ahead * np.linalg.norm(at - pos)  # where the line of sight passes the point
    want = np.zeros(2)
    if moves is not None:
        want[moves] = np.linalg.norm(at - pos) * np.tan(angle)
        assert abs(want[moves] - 0.05) < 2e-4
    np.testing.assert_allclose(np.abs(off), want, atol=1e-9)


def test_comes_back_from_a_file(tmp_path):
    made = mja.MultiTableArena(table_offsets=[[0, 0, 0.8]], objects=[mja.Object("cube")])
    made.add_camera("eye", (1, 1, 2), look_at=(0, 0, 0.8), resolution=(80, 60))
    made.add_camera("chase", (1, 0, 2), look_at="cube", on="table0")
    mja.save(tmp_path / "arena.yaml", made, mja.ArenaRanges())
    again, _ = mja.load(tmp_path / "arena.yaml")
    for field in ("cam_pos", "cam_quat", "cam_mode", "cam_targetbodyid", "cam_bodyid", "cam_resolution", "cam_fovy"):
        np.testing.assert_array_equal(getattr(again.mj_model, field), getattr(made.mj_model, field))


BAD = {
    "name": ({"name": "frontview"}, "`name` must be a text that no camera of the arena has, got 'frontview'."),
    "no name": ({"name": ""}, "`name` must be a text that no camera of the arena has, got ''."),
    "pos": ({"pos": (1, 2)}, "`pos` must be 3 finite numbers [m], got (1, 2)."),
    "nan": ({"pos": (1, 2, np.nan)}, "`pos` must be 3 finite numbers [m], got (1, 2, nan)."),
    "on": (
        {"on": "cub"},
        "`on` must be the name of a body of the arena: no body is called 'cub': did you mean `cube`?",
    ),
    "look_at": (
        {"look_at": "cub"},
        "`look_at` must be a point, or the name of a body of the arena: no body is called 'cub': did you mean `cube`?",
    ),
    "itself": ({"look_at": (1, 1, 1)}, "`look_at` must be another point than `pos`, got (1, 1, 1)."),
    "its own body": (
        {"pos": (0, 0, 0), "on": "cube", "look_at": "cube"},
        "`look_at` must be another body, as the camera is at its origin, got 'cube'.",
    ),
    "both": (
        {"look_at": (0, 0, 0), "quat": (1, 0, 0, 0)},
        "`quat` must be None where `look_at` says where the camera looks, got (1, 0, 0, 0).",
    ),
    "quat": ({"quat": (0, 0, 0, 0)}, "`quat` must be of a length of 1e-15 at least, got (0, 0, 0, 0)."),
    "fovy": ({"fovy": 200}, "`fovy` must be between 0 and 180 [degrees], got 200."),
    "resolution": (
        {"resolution": (64, 0.5)},
        "`resolution` must be (width, height), two whole numbers above 0, got (64, 0.5).",
    ),
    "all at once": (
        {"pos": (1, 2), "fovy": 200, "on": 3, "resolution": 64},
        "4 problems in `add_camera`:\n- `pos` must be 3 finite numbers [m], got (1, 2).\n"
        "- `fovy` must be between 0 and 180 [degrees], got 200.\n- `on` must be the name of a body of the arena, got 3.\n"
        "- `resolution` must be (width, height), two whole numbers above 0, got 64.",
    ),
    "itself and more": (
        {"look_at": (1, 1, 1), "fovy": 0},
        "2 problems in `add_camera`:\n- `fovy` must be between 0 and 180 [degrees], got 0.\n"
        "- `look_at` must be another point than `pos`, got (1, 1, 1).",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_wrong_uses(case):
    """One sentence each, and the arena is as before."""
    made = arena()
    before = made.spec.to_xml()
    given, says = BAD[case]
    with pytest.raises(ValueError, match="must be") as raised:
        made.add_camera(**{"name": "eye", "pos": (1, 1, 1), **given})
    assert str(raised.value) == says
    assert made.spec.to_xml() == before


def test_waits_for_other_threads():
    """A spec is not for several threads: who has the arena's lock keeps others from adding to it."""
    made = arena()
    adding = threading.Thread(target=made.add_camera, args=("eye",))
    with made._lock:
        adding.start()
        adding.join(0.2)
        assert made.spec.camera("eye") is None
    adding.join()
    assert made.spec.camera("eye") is not None


def test_too_late():
    made = arena()
    _ = made.mj_model
    with pytest.raises(ValueError, match=r"^`add_camera`: the arena is compiled already: "):
        made.add_camera("eye")
