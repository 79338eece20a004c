"""What policies see, and how it looks from episode to episode, in the tasks that come along."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas import dr
from mjx_arenas.arena import Arena
from mjx_arenas.envs.arms import wrist_camera
from mjx_arenas.envs.vision import Vision, altered
from mjx_arenas.params.distributions import Uniform
from mjx_arenas.params.params import ArenaRanges
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error

CAMERA = "policy"
_COLOUR = Uniform([0.2, 0.2, 0.2, 1.0], [0.9, 0.9, 0.9, 1.0])
_LOOKS = {
    "table_look": (dr.Term("material.rgba", "table_ceramic"), _COLOUR),
    "floor_look": (dr.Term("material.rgba", "floorplane"), _COLOUR),
    "lamps": (dr.Term("light.diffuse"), Uniform(0.3, 0.7)),
    "lamps_at": (dr.Term("light.pos"), Uniform(-1.0, 1.0, relative="add")),
    "lamps_to": (dr.Term("light.dir"), Uniform(-0.3, 0.3, relative="add")),
    "eye": (dr.Term("camera.pos", CAMERA), Uniform(-0.03, 0.03, relative="add")),
    "gaze": (dr.Term("camera.rpy", CAMERA), Uniform(-0.03, 0.03)),
    "lens": (dr.Term("camera.fovy", CAMERA), Uniform(0.95, 1.05, relative="scale")),
}
"""What varies beside the arena where the policy sees pictures."""
_CARRIED = ([0.5, 0.0, 0.0, 1.0], [1.0, 0.5, 1.0, 1.0])  # warm or violet: never the goal's green
_OTHERS = ([0.0, 0.1, 0.4, 1.0], [0.2, 0.4, 0.9, 1.0])  # blue


def default_vision(wrist: bool = False) -> Vision:
    """Vision of the task's own camera, and of that on the hand of an arm, 64 by 64 pixels each."""
    cameras = (CAMERA, wrist_camera.NAME) if wrist else (CAMERA,)
    return Vision(dict.fromkeys(cameras, (64, 64)), textures=False, alter=altered)


def check(arena: Arena, arm: mujoco.MjSpec, tool: str) -> None:
    """Refuses an arena that has cameras of the names of a task's, and an arm on which the camera on the hand cannot be."""
    if taken := [camera.name for camera in arena.spec.cameras if camera.name in (CAMERA, wrist_camera.NAME)]:
        raise error([problem("arena", "task_camera", None, taken[0])])
    if not arm.site(tool).parent.name:
        raise error([problem("arm.spec", "tool_body", None, None, tool=tool)])


def add_camera(arena: Arena, pos: Sequence[float], look_at: Sequence[float], on: str | None = None) -> None:
    """Adds the task's camera to an arena of ours, in the world or on a body, and the terms of all looks."""
    arena.add_camera(CAMERA, pos=pos, look_at=look_at, fovy=60, on=on)
    arena.vary(**{name: term for name, (term, _) in _LOOKS.items()})


def with_looks(ranges: ArenaRanges, n_objects: int, wrist: bool = False) -> ArenaRanges:
    """Ranges, and what is seen, where they do not have it: colours, lamps, the camera, and that on a hand.

    The first object is warm or violet, others blue, the goal always green.
    """
    looks = _LOOKS | (wrist_camera.LOOKS if wrist else {})
    terms: dict[str, Any] = {**{name: varies for name, (_, varies) in looks.items()}, **ranges.terms}
    if not n_objects or ranges.object_rgba is not None:
        return ranges._replace(terms=terms)
    low, high = (np.array([first, *[other] * (n_objects - 1)]) for first, other in zip(_CARRIED, _OTHERS, strict=True))
    return ranges._replace(object_rgba=Uniform(low, high), terms=terms)
