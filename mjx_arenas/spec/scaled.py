"""Frames that scale what is in them, which MuJoCo has since 3.16 (host).

The compiler scales what such a frame holds, and what refers to that, but no number of the spec. Compiled numbers that are written
into the spec would be scaled again, and what comes out of the frame would keep its own.
"""

from typing import Any

import mujoco
import numpy as np

from mjx_arenas.problem import Item, problem
from mjx_arenas.problems.messages import error

_IN_FRAMES = ("bodies", "geoms", "sites", "joints", "cameras", "lights")
_REFER = (mujoco.MjsTendon, mujoco.MjsActuator, mujoco.MjsEquality, mujoco.MjsPair)


def why_scaled(spec: mujoco.MjSpec, element: Any) -> str:
    """Why numbers of an element may not be those that MuJoCo compiles, a clause; "" if they are."""
    if not any(map(_scales, spec.frames)):
        return ""
    if isinstance(element, _REFER):
        return "a <frame> with a `scale` or `massscale` may scale it, too"
    return "it is in a <frame> with a `scale` or `massscale`" if _is_scaled(element) else ""


def refuse(spec: mujoco.MjSpec, path: str, item: Item | None = None) -> None:
    """Refuses a spec of which something is in such a frame; `path` is that of the argument that it comes from.

    Raises:
        ValueError: what is, by its name.
    """
    if any(map(_scales, spec.frames)):
        for element in (e for listed in _IN_FRAMES for e in getattr(spec, listed)):
            if _is_scaled(element):
                kind = type(element).__name__.removeprefix("Mjs").lower()
                raise error([problem(path, "scaled", item, kind=kind, name=element.name)])


def _is_scaled(element: Any) -> bool:
    """Whether a body, or an element of one, is in such a frame, or hangs on what is."""
    frame = getattr(element, "frame", None)
    while frame is not None:
        if _scales(frame):
            return True
        frame = frame.frame
    return getattr(element, "parent", None) is not None and _is_scaled(element.parent)


def _scales(frame: mujoco.MjsFrame) -> bool:
    size, mass = getattr(frame, "scale", 1.0), getattr(frame, "massscale", 0.0)
    return bool(np.any(np.array(size) != 1)) or mass not in (0.0, 1.0)  # 0: as the volume
