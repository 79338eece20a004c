"""What `simplify` is to make of which geom, from its arguments (host)."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from mjx_arenas.problem import Problem, problem
from mjx_arenas.problems.messages import raise_all
from mjx_arenas.robots.fitting import PRIMITIVES
from mjx_arenas.rules import validation
from mjx_arenas.rules.options import integer_problems, is_choice, numbered
from mjx_arenas.spec import patterns, specs

SHAPES = ("primitive", *PRIMITIVES, "hull", "mesh", "none")
"""What may become of a mesh that collides: "primitive" is the one of capsule, box and sphere that changes it least."""
LEAST_CORNERS = 4
_LEAST = {"timestep": (0, True), "impratio": (0, True), "iterations": (1, False), "ls_iterations": (1, False)}
"""The least number of an option, and whether it is itself too small. Other options have 0, which is allowed."""


class Rules(NamedTuple):
    """What is to become of the geoms and actuators of a robot."""

    shapes: Mapping[int, str]
    """One of `SHAPES` for each geom to change, by index."""
    kept: frozenset[int]
    """Geoms that stay as they are."""
    gone: tuple[int, ...]
    """Actuators, by index."""
    hull: int
    """Most corners of a hull."""
    options: Mapping[str, Any]
    """Options to set, by name."""
    self_collisions: bool = True
    visual: bool = True


def of(
    model: mujoco.MjModel,
    collision: Any,
    keep: Any,
    hull: Any,
    actuators: Any,
    options: Any,
) -> Rules:
    """The rules for a robot.

    Args:
        model: of the robot.
        collision: see `simplify`, as of all that follow.
        keep: patterns.
        hull: most corners.
        actuators: patterns, or None.
        options: by name.

    Raises:
        ValueError: all that is wrong with these.
    """
    names = {geom: _names(model, geom) for geom in range(model.ngeom)}
    problems: list[Problem] = []
    shapes: dict[int, str] = {}
    if collision in SHAPES if isinstance(collision, str) else _are_rules(collision):
        rules = {".*": collision} if isinstance(collision, str) else collision
        of_colliding = {geom: names[geom] for geom in colliding(model)}
        before: dict[str, set[int]] = {}
        for pattern, shape in rules.items():
            chosen = _chosen("collision", pattern, of_colliding, problems, named=not isinstance(collision, str))
            first = next((one for one, theirs in before.items() if chosen and theirs.issuperset(chosen)), None)
            if first is not None and rules[first] != shape:
                problems.append(problem("collision", "rule_before", None, pattern, first=first))
            before[pattern] = set(chosen)
            shapes = dict.fromkeys(chosen, shape) | shapes  # the first rule holds
    else:
        problems.append(problem("collision", "collision", None, collision, names=[repr(s) for s in SHAPES]))
    if not validation.is_whole(hull, LEAST_CORNERS):
        problems.append(problem("hull", "must", None, hull, must=f"a whole number >= {LEAST_CORNERS}"))
    kept = _all_chosen("keep", keep, names, problems)
    motors = {i: [name] if (name := model.actuator(i).name) else [] for i in range(len(model.actuator_trntype))}
    used = set(motors) if actuators is None else _all_chosen("actuators", actuators, motors, problems, "actuator")
    problems += _option_problems(options)
    raise_all(problems, "simplify")
    meshes = mujoco.mjtGeom.mjGEOM_MESH
    shapes = {
        geom: shape
        for geom, shape in sorted(shapes.items())
        if geom not in kept and shape != "mesh" and (model.geom_type[geom] == meshes or shape == "none")
    }
    return Rules(shapes, frozenset(kept), tuple(sorted(set(motors) - used)), hull, numbered(options))


def colliding(model: mujoco.MjModel) -> list[int]:
    """Geoms that may collide, by themselves or in an explicit pair."""
    paired = {*model.pair_geom1.tolist(), *model.pair_geom2.tolist()}
    masks = model.geom_contype | model.geom_conaffinity
    return [geom for geom in range(model.ngeom) if masks[geom] or geom in paired]


def _names(model: mujoco.MjModel, geom: int) -> list[str]:
    """What a geom answers to: its name, its mesh's and its body's."""
    mesh = int(model.geom_dataid[geom]) if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH else -1
    found = [
        model.geom(geom).name,
        model.mesh(mesh).name if mesh >= 0 else "",
        model.body(model.geom_bodyid[geom]).name,
    ]
    return [name for name in found if name]


def _are_rules(collision: Any) -> bool:
    return (
        isinstance(collision, Mapping)
        and all(isinstance(pattern, str) for pattern in collision)
        and all(isinstance(shape, str) and shape in SHAPES for shape in collision.values())
    )


def _all_chosen(
    path: str, given: Any, names: Mapping[int, Sequence[str]], problems: list[Problem], kind: str = "geom, mesh or body"
) -> set[int]:
    if isinstance(given, Sequence) and len(given) == 0:
        return set()
    if not patterns.are_texts(given):
        problems.append(problem(path, "names", None, given))
        return set()
    each: Iterable[str] = [given] if isinstance(given, str) else given
    return {geom for pattern in each for geom in _chosen(path, pattern, names, problems, kind=kind)}


def _chosen(
    path: str,
    pattern: str,
    names: Mapping[int, Sequence[str]],
    problems: list[Problem],
    named: bool = True,
    kind: str = "geom, mesh or body",
) -> list[int]:
    """The elements that a pattern is about; `named`: a problem where there is none."""
    if not named:
        return list(names)
    known = list(dict.fromkeys(name for own in names.values() for name in own))
    matched = patterns.matching(pattern, known)
    if not matched and (why := patterns.no_pattern(pattern)):
        problems.append(problem(path, "no_pattern", None, pattern, kind=kind, why=why))
    elif not matched:
        problems.append(problem(path, "no_element", None, pattern, kind=kind, nearest=patterns.near(pattern, known)))
    return [element for element, own in names.items() if not matched.isdisjoint(own)]


def _option_problems(options: Any) -> list[Problem]:
    if not isinstance(options, Mapping):
        return [problem("options", "must", None, options, must="a dictionary of MuJoCo's options by name")]
    trial, plain, found = mujoco.MjSpec().option, mujoco.MjSpec().option, []
    for name, value in numbered(options).items():
        if name not in specs.option_names():
            nearest = patterns.near(str(name), list(specs.option_names()))
            found.append(problem("options", "no_option", None, name, nearest=nearest))
            continue
        if is_choice(name):
            found += integer_problems(name, value, f"options[{name!r}]")
            continue
        try:
            setattr(trial, name, value)
        except (TypeError, ValueError):
            default = np.asarray(getattr(plain, name))
            must = f"{default.size} numbers" if default.ndim else "a number"
            must = "a whole number" if default.dtype.kind == "i" else must
            found.append(problem(f"options[{name!r}]", "must", None, value, must=must))
            continue
        if must := _must_be(value):
            found.append(problem(f"options[{name!r}]", "must", None, value, must=must))
            continue
        least, strictly = _LEAST.get(name, (0, False))
        if validation.is_number(value) and not (least < value < np.inf or (value == least and not strictly)):
            must = f"a number {'>' if strictly else '>='} {least}"
            found.append(problem(f"options[{name!r}]", "must", None, value, must=must))
    return found


def _must_be(value: Any) -> str:
    """What an option that MuJoCo's spec takes must be, if it is not: finite numbers, but no bool."""
    numbers = np.asarray(value)
    if numbers.dtype.kind == "b":
        return "a number"
    return "" if numbers.ndim == 0 or np.isfinite(numbers.astype(float)).all() else "finite numbers"
