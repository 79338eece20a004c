"""Robots that step faster: simpler shapes that collide, and less of what costs time (host)."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco

from mjx_arenas.robots import edits, rules
from mjx_arenas.robots.report import SimplifyReport
from mjx_arenas.spec import specs

FAST: Mapping[str, Any] = {"iterations": 10, "ls_iterations": 20}
"""Options with which no world keeps all others of a batch waiting for its solver."""


def simplify(
    robot: str | os.PathLike | mujoco.MjSpec,
    collision: str | Mapping[str, str] = "primitive",
    keep: str | Sequence[str] = (),
    *,
    hull: int = 32,
    self_collisions: bool = True,
    visual: bool = True,
    actuators: str | Sequence[str] | None = None,
    options: Mapping[str, Any] = FAST,
) -> tuple[mujoco.MjSpec, SimplifyReport]:
    """A robot that steps faster, for `arena.attach`: simpler shapes collide in the place of its meshes.

    MuJoCo fits the shapes. Names, masses, inertias, joints and keyframes stay as they are; bodies whose geoms change keep their
    inertials explicitly. Of a mesh that is drawn itself a copy is drawn on. Bodies that the new shapes put inside each other at `qpos0` or
    in a keyframe get an `<exclude>`.

    Patterns are names or regular expressions that match whole names: of a geom, of its mesh, or of its body.

    Args:
        robot: path of an MJCF file, MJCF text, or a spec, of which a copy is taken.
        collision: what collides in the place of a mesh: "capsule", "box", "sphere", "primitive" (the one of these that changes it least),
            "hull" (a convex hull of at most `hull` corners), "mesh" (as it is) or "none" (nothing). Or a dictionary of these by pattern, of
            which the first holds that matches a geom; meshes that none matches stay. Primitives stay, too, but for "none".
        keep: patterns of what stays as it is: fingertips, for one.
        hull: most corners of a hull, >= 4.
        self_collisions: False leaves out all contacts of the robot with itself but those of bodies that both have geoms to `keep`.
        visual: False leaves out geoms that do not collide and that nothing refers to, and their meshes.
        actuators: names or regular expressions of the actuators that stay; None: all. Sensors of the others go with them.
        options: of the solver and the like, as `spec.option` has them; {}: as they are.

    Returns:
        The new spec, and a report of what was changed. Its `change` of a geom is the Hausdorff distance between the convex hull of its
        mesh, with which MuJoCo collides, and the new shape [m]: how far a point of either can be from the other.

    Raises:
        FileNotFoundError, TypeError, ValueError: all problems of the call.
    """
    spec = specs.read(robot, "robot")
    specs.assign(spec.compiler, fusestatic=False, discardvisual=False)  # or names would go
    model = specs.compiled(spec, "robot")
    asked = rules.of(model, collision, keep, hull, actuators, options)
    asked = asked._replace(self_collisions=bool(self_collisions), visual=bool(visual))
    return edits.simplified(spec, model, asked)
