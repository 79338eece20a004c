"""How large the number is that an element of a model belongs to: what a relative error is relative to (host).

A quaternion, a vector and the moments of an inertia tensor are one number each, whose elements share its norm: rounding turns
a vector, it does not know the axes. Everything else is a number of its own.
"""

import mujoco
import numpy as np

_VECTORS = frozenset(
    (
        *("body_pos", "body_quat", "body_ipos", "body_iquat", "body_inertia", "geom_pos", "geom_quat", "geom_size"),
        *(
            "site_pos",
            "site_quat",
            "cam_pos",
            "cam_quat",
            "cam_pos0",
            "light_pos",
            "light_dir",
            "light_pos0",
            "light_dir0",
        ),
        *("jnt_pos", "jnt_axis", "eq_data"),
    )
)
_SEEN_FROM_AFAR = frozenset(("cam_poscom0", "light_poscom0", "stat.center"))  # differences of places in the whole scene


def scale(model: mujoco.MjModel, field: str, values: np.ndarray) -> np.ndarray:
    """The size of the number that each element belongs to, in the shape of `values`.

    Args:
        model: compiled; says what the entries of `qpos0` are, and how large the scene is.
        field: of `mjx.Model`, `stat.` before the name of a statistic.
        values: of that field, in MuJoCo's own shape.
    """
    values = np.abs(np.asarray(values, float))
    if field in ("qpos0", "qpos_spring"):
        return _of_positions(model, values)
    if field in _SEEN_FROM_AFAR:
        return _norms(values) + model.stat.extent
    if field == "geom_aabb":
        boxes = values.reshape(-1, 2, 3)
        return np.broadcast_to(_norms(boxes).max(1, keepdims=True), boxes.shape).reshape(values.shape)
    if field == "cam_mat0":
        return np.ones_like(values)
    return _norms(values) if field in _VECTORS else values


def _norms(values: np.ndarray) -> np.ndarray:
    return np.broadcast_to(np.linalg.norm(values, axis=-1, keepdims=True), values.shape)


def _of_positions(model: mujoco.MjModel, values: np.ndarray) -> np.ndarray:
    """The scales of entries of `qpos`: of places and turns of free joints, of turns of ball joints, and of each hinge and slide alone."""
    found = values.copy()
    for kind, adr in zip(model.jnt_type, model.jnt_qposadr, strict=True):
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            found[adr : adr + 3] = np.linalg.norm(values[adr : adr + 3])
            found[adr + 3 : adr + 7] = np.linalg.norm(values[adr + 3 : adr + 7])
        elif kind == mujoco.mjtJoint.mjJNT_BALL:
            found[adr : adr + 4] = np.linalg.norm(values[adr : adr + 4])
    return found
