"""Frames in the order of what is in them (host): MuJoCo writes what a body has frame by frame, as they were added."""

from collections.abc import Sequence
from typing import Any

import mujoco

from mjx_arenas.spec import specs
from mjx_arenas.terms.attributes.attribute import KINDS

_OF_BODIES = tuple(
    kind.listed for name, kind in KINDS.items() if name in ("body", "geom", "site", "joint", "camera", "light")
)


def put_frames_in_order(spec: mujoco.MjSpec) -> None:
    """Gives elements of a spec frames of their own where its MJCF would list them in another order than the compiler does."""
    for body in spec.bodies:
        for listed in _OF_BODIES:
            elements = list(getattr(body, listed))
            if not _sorted([_path(body, element) for element in elements]):
                for element in elements:
                    _reframe(body, element)


def _frames(element: Any) -> list[Any]:
    """The frames in which an element is, from the outermost."""
    found, frame = [], element.frame
    while frame is not None:
        found.insert(0, frame)
        frame = frame.frame
    return found


def _path(body: Any, element: Any) -> tuple[int, ...]:
    """Which of its body's frames these are."""
    return tuple(body.frames.index(frame) for frame in _frames(element))


def _sorted(paths: Sequence[tuple[int, ...]]) -> bool:
    """Whether frames come in the order in which they were added, each with all that is in it at once; the rest is written where it is."""
    last: dict[tuple[int, ...], int] = {}
    before: tuple[int, ...] = ()
    for path in paths:
        for depth, index in enumerate(path):
            latest = last.get(path[:depth], -1)
            if index < latest or (index == latest and path[: depth + 1] != before[: depth + 1]):
                return False
            last[path[:depth]] = index
        before = path
    return True


def _reframe(body: Any, element: Any) -> None:
    """Puts an element into new frames like those in which it is, or into one that changes nothing."""
    new = None
    for frame in _frames(element) or [None]:
        new = body.add_frame() if new is None else body.add_frame(new)
        if frame is not None:
            new.pos, new.quat = frame.pos, specs.turn(frame)
            for name in ("scale", "scaling", "massscale"):
                if hasattr(frame, name):  # MuJoCo 3 has none
                    setattr(new, name, getattr(frame, name))
    element.set_frame(new)
