"""Cameras that are added to an arena (host)."""

from collections.abc import Sequence
from typing import Any

import jax
import mujoco
import numpy as np

from mjx_arenas.problem import Problem, problem
from mjx_arenas.rules import unit_rules, validation
from mjx_arenas.spec import names, patterns, specs

NO_SIZE = (1, 1)
"""MuJoCo's `resolution` of a camera that has none of its own."""
WIDEST = 2**31 - 1
"""The largest `resolution` [pixels]: it is C's int."""
_UP = np.array([0.0, 0.0, 1.0])


def add(
    spec: mujoco.MjSpec,
    name: str,
    pos: Sequence[float],
    look_at: Sequence[float] | str | None,
    quat: Sequence[float] | None,
    fovy: float,
    on: str | None,
    resolution: tuple[int, int] | None,
) -> None:
    """Adds a camera to a spec; see `Arena.add_camera`."""
    validation.raise_all(_problems(spec, name, pos, look_at, quat, fovy, on, resolution), "`add_camera`")
    unit_rules.warn_of_radians("fovy", float(np.asarray(fovy)))
    given: dict[str, Any] = {"pos": np.asarray(pos, float), "fovy": float(np.asarray(fovy))}
    if quat is not None:
        given["quat"] = np.asarray(quat, float)
    if isinstance(look_at, str):
        given |= {"mode": mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY, "targetbody": look_at}
    elif look_at is not None:
        given["quat"] = looking(given["pos"], np.asarray(look_at, float))
    if resolution is not None:
        given["resolution"] = [int(n) for n in resolution]
    camera = (spec.worldbody if on is None else spec.body(on)).add_camera(name=name)
    try:
        specs.assign(camera, **given)
    except BaseException:
        spec.delete(camera)
        raise


def looking(pos: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(4,) the orientation of a camera at `pos` (3,) that looks at a point (3,), upright, or, if straight down or up, with y ahead."""
    back = (pos - at) / np.linalg.norm(pos - at)
    right = np.cross(_UP, back)
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-6 else np.array([1.0, 0.0, 0.0])
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.stack([right, np.cross(back, right), back], axis=1).reshape(-1))
    return quat


def _problems(
    spec: mujoco.MjSpec,
    name: Any,
    pos: Any,
    look_at: Any,
    quat: Any,
    fovy: Any,
    on: Any,
    size: Any,
) -> list[Problem]:
    wrong_pos = validation.vector_problems("pos", pos, 3, "[m]")
    found = wrong_pos + _fovy_problems(fovy)
    found += names.problems("name", name, {camera.name for camera in spec.cameras}, "camera")
    bodies = [body.name for body in spec.bodies if body.name]
    if on is not None and on not in bodies:
        found.append(_no_body("on", on, bodies, "the name of a body of the arena"))
    if look_at is not None and quat is not None:
        found.append(problem("quat", "must", None, quat, must="None where `look_at` says where the camera looks"))
    if isinstance(look_at, str):
        if look_at not in bodies:
            found.append(_no_body("look_at", look_at, bodies, "a point, or the name of a body of the arena"))
        elif look_at == (on or "world") and not wrong_pos and np.allclose(np.asarray(pos, float), 0):
            found.append(problem("look_at", "must", None, look_at, must="another body, as the camera is at its origin"))
    elif look_at is not None:
        wrong = validation.vector_problems("look_at", look_at, 3, "[m]")
        found += wrong
        if not wrong and not wrong_pos and np.allclose(np.asarray(look_at, float), np.asarray(pos, float)):
            found.append(problem("look_at", "must", None, look_at, must="another point than `pos`"))
    if quat is not None:
        wrong = validation.vector_problems("quat", quat, 4, "")
        if not wrong and np.linalg.norm(np.asarray(quat, float)) < mujoco.mjMINVAL:
            wrong = [problem("quat", "must", None, quat, must=f"of a length of {mujoco.mjMINVAL:g} at least")]
        found += wrong
    if size is None:
        return found
    wrong = size_problems("resolution", size)
    if not wrong and tuple(size) == NO_SIZE:
        wrong = [problem("resolution", "must", None, size, must=f"another than {NO_SIZE}, which MuJoCo takes for none")]
    return found + wrong


def size_problems(name: str, size: Any) -> list[Problem]:
    """What is no width and height of a picture."""
    listed = isinstance(size, (Sequence, np.ndarray, jax.Array)) and not isinstance(size, (str, jax.core.Tracer))
    numbers = [x.item() if hasattr(x, "item") and np.ndim(x) == 0 else x for x in size] if listed else []
    if len(numbers) != 2 or not all(validation.is_whole(x, 1) for x in numbers):
        return [problem(name, "must", None, size, must="(width, height), two whole numbers above 0")]
    return [] if max(numbers) <= WIDEST else [problem(name, "must", None, size, must="at most 2^31 - 1 either way")]


def _no_body(argument: str, given: Any, bodies: list[str], must: str) -> Problem:
    """Says which body may have been meant."""
    if not isinstance(given, str):
        return problem(argument, "must", None, given, must=must)
    return problem(argument, "no_body", None, given, must=must, nearest=patterns.near(given, bodies))


def _fovy_problems(fovy: Any) -> list[Problem]:
    found = validation.vector_problems("fovy", fovy, 0, "[degrees]")
    if found or 0 < float(np.asarray(fovy)) < 180:
        return found
    return [problem("fovy", "must", None, fovy, must="between 0 and 180 [degrees]")]
