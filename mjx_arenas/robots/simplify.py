"""Robots that step faster: simpler shapes that collide, and less of what costs time (host)."""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.problem import problem
from mjx_arenas.robots import edits, rules, speed
from mjx_arenas.robots.report import SimplifyReport
from mjx_arenas.rules import validation
from mjx_arenas.spec import masses, specs

FAST: Mapping[str, Any] = {"iterations": 10, "ls_iterations": 20}
"""Options with which no world keeps all others of a batch waiting for its solver."""


@with_known_arguments
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
    measure: bool = False,
) -> tuple[mujoco.MjSpec, SimplifyReport]:
    """A robot that steps faster, for `arena.attach`: simpler shapes collide in place of its meshes.

    MuJoCo fits the shapes. Names, masses, inertias, joints and keyframes stay as they are. Bodies whose geoms change keep their inertials
    explicitly. If a replaced mesh was visible, a visible copy of it remains. Bodies that the new shapes put inside each other at `qpos0` or
    in a keyframe get an `<exclude>`.

    Patterns are names or regular expressions that match whole names: of a geom, of its mesh, or of its body.

    Args:
        robot: path of an MJCF file, MJCF text, or a spec, which is copied.
        collision: shape that collides in place of a mesh: "capsule", "box", "sphere", "primitive" (the one of these that changes it least),
            "hull" (a convex hull of at most `hull` corners), "mesh" (as it is) or "none" (nothing). It may be a dictionary of these by
            pattern. The first pattern that matches a geom counts, so ".*" stands last; meshes without a match stay. Primitives stay, too,
            except with "none".
        keep: patterns of geoms whose shapes and contacts stay as they are, such as fingertips.
        hull: largest number of corners of a hull, >= 4.
        self_collisions: False leaves out all contacts of the robot with itself, except those of bodies that both have geoms to `keep`.
        visual: False leaves out geoms that do not collide and that nothing refers to, and their meshes. What is left is then drawn:
            geoms that collide, those to `keep` too, move to group 0 from groups that MuJoCo hides.
        actuators: names or regular expressions of the actuators that stay; None: all. Sensors of the other actuators are removed with them.
        options: options of the solver and the like, as `spec.option` has them, or by MJCF's names, as {"cone": "elliptic"}; {}: as they
            are.
        measure: whether the report has steps per second before and after, of the robot alone from its first keyframe on, as
            `robots.steps_per_second` measures them. This takes two seconds.

    Returns:
        The new spec, and a report of what was changed. Its `change` of a geom is the Hausdorff distance [m] between the convex hull of its
            mesh, with which MuJoCo collides, and the new shape. It says how far a point of either can be from the other.

    Raises:
        OSError, TypeError, ValueError: all problems of the call; FileNotFoundError where there is no file.
    """
    flags = {"self_collisions": self_collisions, "visual": visual, "measure": measure}
    unclear = [problem(n, "truth", None, x) for n, x in flags.items() if not isinstance(x, (bool, np.bool_))]
    validation.raise_all(unclear, "`simplify`")
    spec = specs.read(robot, "robot")
    specs.assign(spec.compiler, fusestatic=False, discardvisual=False)  # or names would go
    model = specs.compiled(spec, "robot")
    masses.allow_inertials(spec)
    validation.raise_all([problem("robot", "bodiless")] if model.nbody == 1 else [], "`simplify`")
    asked = rules.of(model, collision, keep, hull, actuators, options)
    asked = asked._replace(self_collisions=bool(self_collisions), visual=bool(visual))
    spec, report = edits.simplified(spec, model, asked)
    if measure:
        report = dataclasses.replace(report, speeds=speed.compared(model, specs.compiled(spec, "robot")))
    return spec, report
