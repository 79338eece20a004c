"""Frames that scale what is in them, which MuJoCo has since 3.16 (host).

The compiler scales what such a frame holds, and what refers to that, but no number of the spec. Compiled numbers that are written
into the spec would be scaled again, and what comes out of the frame would keep its own.
"""

from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.problem import Item, problem
from mjx_arenas.problems.messages import error

_OBJ, _TRN, _EQ = mujoco.mjtObj, mujoco.mjtTrn, mujoco.mjtEq
_DRIVEN = {
    _TRN.mjTRN_JOINT: "joint",
    _TRN.mjTRN_JOINTINPARENT: "joint",
    _TRN.mjTRN_TENDON: "tendon",
    _TRN.mjTRN_BODY: "body",
}
_HELD = {_EQ.mjEQ_JOINT: "joint", _EQ.mjEQ_TENDON: "tendon"}


def why_scaled(spec: mujoco.MjSpec, element: Any) -> str:
    """Why numbers of an element are not those that MuJoCo compiles, a clause; "" if they are."""
    if not any(map(_scales, spec.frames)):
        return ""
    if any(map(_is_scaled, _referred(spec, element))):
        return "it refers to what is in a <frame> with a `scale` or `massscale`"
    return "it is in a <frame> with a `scale` or `massscale`" if _is_scaled(element) else ""


def refuse(spec: mujoco.MjSpec, elements: Iterable[Any], path: str, item: Item | None = None) -> None:
    """Refuses elements of bodies, or bodies, of which one is in such a frame; `path` is that of the argument that they come from.

    Raises:
        ValueError: one is, by its name.
    """
    for element in elements if any(map(_scales, spec.frames)) else ():
        if _is_scaled(element):
            kind = type(element).__name__.removeprefix("Mjs").lower()
            name = f"{kind} {element.name!r}" if element.name else f"a {kind} of body {element.parent.name!r}"
            raise error([problem(path, "scaled", item, name=name)])


def of_body(body: mujoco.MjsBody) -> list[Any]:
    """A body and its geoms, and those of all that hangs on it."""
    return [body, *body.find_all("body"), *body.find_all("geom")]


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


def _referred(spec: mujoco.MjSpec, element: Any) -> list[Any]:
    """The elements of bodies, and the bodies, to which a tendon, an actuator, an equality or a contact pair refers."""
    if isinstance(element, mujoco.MjsTendon):
        return [wrap.target for wrap in element.path if wrap.target is not None]
    if isinstance(element, mujoco.MjsPair):
        kind, names = "geom", [element.geomname1, element.geomname2]
    elif isinstance(element, mujoco.MjsActuator):
        kind, names = _DRIVEN.get(element.trntype, "site"), [element.target, element.refsite, element.slidersite]
    elif isinstance(element, mujoco.MjsEquality):
        kind, names = _HELD.get(element.type, "site" if element.objtype == _OBJ.mjOBJ_SITE else "body"), []
        names = [element.name1, element.name2]
    else:
        return []
    found = [one for name in names if name and (one := getattr(spec, kind)(name) or spec.site(name)) is not None]
    return [x for one in found for x in (_referred(spec, one) if isinstance(one, mujoco.MjsTendon) else [one])]
