"""How far the fingers of an arm are apart, closed and open, as C MuJoCo moves them, and how thin they are (host)."""

from collections.abc import Mapping

import mujoco
import numpy as np

from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error, warn

SECONDS = 1.0  # until fingers are where their controls send them
_FLIES = 1e3  # [rad/s] or [m/s] of an arm that shakes apart, from which on MuJoCo would soon begin anew
SLACK = 0.002  # [m] by which fingers may give way to an object
_ASIDE = 10.0  # [degrees] from the tool's y axis, of the line along which fingers open
_LEAST, _AXIS = 1e-3, 4.0  # [m] of a way that shows a direction; times the squares of the ways across it
_TURNS = np.linspace(0, np.pi, 24, endpoint=False)  # [rad] of lines through the tool
_ALONG = (-0.02, -0.01, 0.0, 0.01)  # [m] of points on the tool's axis
_GEOM = mujoco.mjtGeom
_AS_BOXES = (_GEOM.mjGEOM_SPHERE, _GEOM.mjGEOM_CAPSULE, _GEOM.mjGEOM_ELLIPSOID, _GEOM.mjGEOM_CYLINDER, _GEOM.mjGEOM_BOX)
"""Shapes that are nowhere thinner than the box around them."""


def check(
    model: mujoco.MjModel, keyframe: str | None, tool: str, fingers: Mapping[str, tuple[float, float]], width: float
) -> None:
    """Refuses fingers whose controls are given the other way round, and an object that is wider than they open.

    Raises:
        ValueError: one of the two.

    Warns:
        UserWarning: they open along another line than the tool's y axis.
    """
    shut, wide = (moved(model, keyframe, {name: each[i] for name, each in fingers.items()}) for i in (0, 1))
    closed, opened = (gap(model, data, tool) for data in (shut, wide))
    if closed > opened:
        apart = {"closed": _metres(closed), "opened": _metres(opened)}
        raise error([problem("arm.fingers", "fingers_swapped", None, dict(fingers), apart)])
    if width > SLACK + opened:
        told = {"opened": round(opened, 4), "most": round(opened + SLACK, 4), "slack": SLACK}
        raise error([problem("arm.width", "arm_width", None, Told(f"{width:g}"), told)])
    turn = aside(model, shut, wide, tool)
    if turn is not None and abs(turn) > _ASIDE:
        warn(problem("arm.tool", "fingers_aside", None, tool, away=abs(turn), turn=turn))


def moved(model: mujoco.MjModel, keyframe: str | None, controls: Mapping[str, float]) -> mujoco.MjData:
    """Where an arm is from a keyframe on, once its fingers are where some controls send them, or when it shakes apart."""
    data = mujoco.MjData(model)
    if keyframe is not None:
        mujoco.mj_resetDataKeyframe(model, data, model.key(keyframe).id)
    for name, control in controls.items():
        data.ctrl[model.actuator(name).id] = control
    for _ in range(round(SECONDS / model.opt.timestep)):
        mujoco.mj_step(model, data)
        if not np.abs(data.qvel).max() < _FLIES:
            break
    return data


def gap(model: mujoco.MjModel, data: mujoco.MjData, tool: str) -> float:
    """The least distance [m] between geoms on the two sides of a tool, on lines across it; infinite where there are none."""
    site, geom, found = data.site(tool), np.zeros(1, np.int32), np.inf
    mat = site.xmat.reshape(3, 3)
    for along in _ALONG:
        point = site.xpos + along * mat[:, 2]
        for turn in _TURNS:
            across = mat @ [np.cos(turn), np.sin(turn), 0.0]
            sides = [mujoco.mj_ray(model, data, point, sign * across, None, 1, -1, geom, None) for sign in (1, -1)]
            if min(sides) >= 0:
                found = min(found, sum(sides))
    return found


def aside(model: mujoco.MjModel, closed: mujoco.MjData, opened: mujoco.MjData, tool: str) -> float | None:
    """How far the tool must turn about its z axis for fingers to open along its y axis [degrees], from -90 to 90.

    None: they open along no line, as three fingers about the tool do.
    """
    at = [(data.geom_xpos - data.site(tool).xpos) @ data.site(tool).xmat.reshape(3, 3) for data in (closed, opened)]
    ways = (at[1] - at[0])[:, :2]
    squares, axes = np.linalg.eigh(ways.T @ ways)
    if squares[1] < _LEAST**2 or squares[1] < _AXIS * squares[0]:
        return None
    x, y = axes[:, 1] * (1.0 if axes[1, 1] >= 0 else -1.0)
    return float(np.degrees(np.arctan2(-x, y)))


def thinnest(model: mujoco.MjModel, keyframe: str, tool: str) -> float:
    """At most the thickness of the thinnest geom with which an arm can hook in at its tool [m].

    These are geoms of the hand that collide and may come as far along the tool's axis as the tool. It is 0 if there is none, or a mesh.
    """
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(keyframe).id)
    mujoco.mj_kinematics(model, data)
    site = data.site(tool)
    along = (data.geom_xpos - site.xpos) @ site.xmat.reshape(3, 3)[:, 2]
    hand = np.arange(model.nbody) == model.body_weldid[model.site_bodyid[site.id]]
    for i, parent in enumerate(model.body_parentid):  # parents come first
        hand[i] |= hand[parent]
    there = hand[model.geom_bodyid] & ((model.geom_contype | model.geom_conaffinity) != 0)
    there &= along + model.geom_rbound >= 0
    sides = np.where(np.isin(model.geom_type, _AS_BOXES), 2 * model.geom_aabb[:, 3:].min(1), 0.0)
    return float(sides[there].min(initial=np.inf)) if there.any() else 0.0


def _metres(gap: float) -> str:
    return f"{round(gap, 4):g} m" if np.isfinite(gap) else "further than can be seen"
