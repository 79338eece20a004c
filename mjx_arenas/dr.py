"""Domain randomization of any element of an MJCF: what may vary, by MJCF's own names.

`arena.vary(finger_friction=dr.Term("geom.friction", ".*finger.*"))` makes a quantity of the arena, and
`ArenaRanges(terms={"finger_friction": Uniform(0.8, 1.2, relative="scale")})` draws it.
"""

import dataclasses
import re
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from mjx_arenas.keywords import WithKnownArguments
from mjx_arenas.params.distribution import Distribution
from mjx_arenas.params.distributions import Uniform
from mjx_arenas.problem import Problem, problem
from mjx_arenas.problems.messages import error
from mjx_arenas.spec import patterns, specs
from mjx_arenas.terms.attributes import ATTRIBUTES
from mjx_arenas.terms.attributes.fixed import FIXED
from mjx_arenas.terms.attributes.gains import shortcut
from mjx_arenas.terms.elements import ids_of, in_spec, names_of

__all__ = ["ATTRIBUTES", "Preset", "Term", "robot"]


@dataclasses.dataclass(frozen=True)
class Term(WithKnownArguments):
    """One attribute of some elements. Each element draws its own number unless the range is `tied`.

    Args:
        attribute: kind of element and its attribute, as MJCF calls them: "geom.friction", "body.mass". `dr.ATTRIBUTES` has all.
        elements: names, or regular expressions that match whole names, or a list of them. A regular expression skips elements that cannot
            vary. None: all elements of the kind that have a name, can vary, and are not decided by a table, an object or another term.
        axes: names of the numbers of the attribute that vary, `("sliding",)` or "x"; None: all.
    """

    attribute: str
    elements: str | Sequence[str] | None = None
    axes: Sequence[str] | None = None

    def __post_init__(self) -> None:
        for name in ("elements", "axes"):
            if isinstance(getattr(self, name), list):
                object.__setattr__(self, name, tuple(getattr(self, name)))

    def problems(self) -> list[Problem]:
        """Problems of the term that do not depend on the arena."""
        if isinstance(self.attribute, str) and self.attribute in FIXED:
            fixed = FIXED[self.attribute]
            return [problem("attribute", "fixed", None, self.attribute, {"why": fixed.why, "instead": fixed.instead})]
        if not isinstance(self.attribute, str) or self.attribute not in ATTRIBUTES:
            nearest = patterns.near(str(self.attribute), list(ATTRIBUTES))
            return [problem("attribute", "unknown_attribute", None, self.attribute, nearest=nearest)]
        if self.elements is not None and not patterns.are_texts(self.elements):
            return [problem("elements", "names", None, self.elements)]
        known = self._axes
        if self.axes is None:
            return []
        given = [self.axes] if isinstance(self.axes, str) else self.axes
        if not patterns.are_texts(given) or not set(given) <= set(known):
            rule = "axes" if known else "no_axes"
            return [problem("axes", rule, None, self.axes, names=known, attribute=self.attribute)]
        return []

    @property
    def chosen(self) -> tuple[bool, ...]:
        """For each number of the attribute, whether it varies."""
        given = [self.axes] if isinstance(self.axes, str) else self.axes
        return tuple(given is None or axis in given for axis in self._axes)

    @property
    def _axes(self) -> list[str]:
        axes = ATTRIBUTES[self.attribute].quantity.axes
        return [axis.strip() for axis in axes.split(",")] if axes else []

    def select(self, spec: mujoco.MjSpec, model: mujoco.MjModel) -> tuple[tuple[str, ...], list[Problem]]:
        """Names of the elements that the term selects in a spec and its model, in the model's order, or the reason why there are none."""
        kind = self.attribute.partition(".")[0]
        all_names = names_of(model, kind)
        names = [name for name in all_names if name and (kind, name) != ("body", "world")]
        why = {name: self._why_not(spec, model, name, all_names.index(name)) for name in names}
        if self.elements is None:
            able = tuple(name for name in names if not why[name])
            why_not = next((f": {why[name]} ({name!r})" for name in names), "")
            what = {"kind": kind, "attribute": self.attribute, "why": why_not}
            return able, [] if able else [problem("elements", "none_can_vary", None, None, what)]
        found, problems = set[str](), []
        for pattern in [self.elements] if isinstance(self.elements, str) else self.elements:
            matched = patterns.matching(pattern, names)
            if not matched and (why_not := patterns.no_pattern(pattern)):
                problems.append(problem("elements", "no_pattern", None, pattern, {"kind": kind, "why": why_not}))
            elif not matched:
                what = {"kind": kind, "nearest": patterns.near(pattern, names)}
                problems.append(problem("elements", "no_element", None, pattern, what))
            able = {name for name in matched if not why[name]}
            found |= able or matched  # a regular expression leaves out what cannot vary
        for name in (name for name in names if name in found and why[name]):
            what = {"kind": kind, "name": name, "attribute": self.attribute, "why": why[name]}
            problems.append(problem("elements", "cannot_vary", None, None, what))
        return tuple(name for name in names if name in found), problems

    def _why_not(self, spec: mujoco.MjSpec, model: mujoco.MjModel, name: str, index: int) -> str:
        """Why the attribute of an element cannot vary, a clause; "" if it can."""
        attribute, kind = ATTRIBUTES[self.attribute], self.attribute.partition(".")[0]
        why = attribute.refused(model, index) if attribute.refused else ""
        if not why and attribute.refused_in_spec:
            why = attribute.refused_in_spec(spec, in_spec(spec, kind, name))
        return why


class Preset(NamedTuple):
    """Terms for `arena.vary(**preset.terms)`, and the distributions of their quantities for `ArenaRanges(terms=preset.ranges)`."""

    terms: dict[str, Term]
    ranges: dict[str, Distribution]


_ROBOT = {
    "mass": ("body.mass", None, (0.9, 1.1)),
    "com": ("body.ipos", None, 0.005),
    "armature": ("joint.armature", None, (1.0, 1.05)),
    "friction_loss": ("joint.frictionloss", None, (0.5, 2.0)),
    "damping": ("joint.damping", None, (0.8, 1.2)),
    "kp": ("actuator.kp", None, (0.8, 1.2)),
    "kv": ("actuator.kv", None, (0.8, 1.2)),
    "motor": ("actuator.gainprm", ("0",), (0.9, 1.1)),
    "friction": ("geom.friction", ("sliding",), (0.7, 1.3)),
}


def robot(spec: mujoco.MjSpec, prefix: str = "", strength: float = 1.0) -> Preset:
    """Usual ranges for sim-to-real randomization of a robot, for all of its elements that can vary.

    | quantity | attribute | at strength 1 | from |
    |---|---|---|---|
    | mass | `body.mass`, with the inertia | 0.9 to 1.1 times | Playground's Go1 and LEAP hand |
    | com | `body.ipos` | 5 mm either way on each axis | the cube of Playground's LEAP hand |
    | armature | `joint.armature` | 1 to 1.05 times | Playground's Go1 and LEAP hand |
    | friction_loss | `joint.frictionloss` | 0.5 to 2 times | Playground's LEAP hand |
    | damping | `joint.damping` | 0.8 to 1.2 times | Playground's LEAP hand |
    | kp, kv | `actuator.kp`, `actuator.kv` of servos and dampers | 0.8 to 1.2 times | Playground's LEAP hand |
    | motor | `actuator.gainprm` of motors, their strength | 0.9 to 1.1 times | Margolis and Agrawal 2022, "Walk these ways" |
    | friction | `geom.friction`, sliding | 0.7 to 1.3 times | OpenAI et al. 2018, "Learning dexterous in-hand manipulation", table 1 |

    Playground: `mujoco_playground/_src/locomotion/go1/randomize.py` and `_src/manipulation/leap_hand/reorient.py`, version 0.2.
    Walk these ways: `go1_gym/envs/go1/go1_config.py`.

    Args:
        spec: `arena.spec`, with the robot in it.
        prefix: prefix of the names of the robot's elements; it is also the prefix of the quantities' names.
        strength: factor from 0 to 1 on how far each range reaches from the compiled value.

    Raises:
        ValueError: nothing with this prefix can vary, or `strength` is not between 0 and 1.
    """
    if isinstance(strength, bool) or not isinstance(strength, (int, float)) or not 0 <= strength <= 1:
        raise error([problem("strength", "must", None, strength, must="a number from 0 to 1")])
    if not isinstance(spec, mujoco.MjSpec) or not isinstance(prefix, str):
        raise error([problem("spec", "must", None, spec, must="`arena.spec`, and `prefix` a string")], kind=TypeError)
    model = specs.compiled(spec.copy(), "arena.spec")
    terms, ranges = {}, {}
    for name, (attribute, axes, reach) in _ROBOT.items():
        able, _ = Term(attribute).select(spec, model)
        own = [element for element in able if element.startswith(prefix) and _counts(model, attribute, element)]
        if not isinstance(reach, float) and own:  # what is 0 stays so
            read = ATTRIBUTES[attribute].read
            assert read is not None
            numbers = read(model, ids_of(model, attribute.partition(".")[0], tuple(own)))
            own = [element for element, number in zip(own, numbers, strict=True) if np.any(number)]
        if not own:
            continue
        terms[prefix + name] = Term(attribute, tuple(map(re.escape, own)), axes)
        if isinstance(reach, float):
            ranges[prefix + name] = Uniform(-strength * reach, strength * reach, relative="add")
        else:
            low, high = (1 + strength * (bound - 1) for bound in reach)
            ranges[prefix + name] = Uniform(low, high, relative="scale")
    if not terms:
        raise error([problem("prefix", "no_robot", None, prefix)])
    return Preset(terms, ranges)


def _counts(model: mujoco.MjModel, attribute: str, element: str) -> bool:
    """Whether it is part of a robot: no geom of the world itself, such as the floor; and of gains, whether it is a motor's."""
    if attribute == "actuator.gainprm":
        return shortcut(model, model.actuator(element).id) == "motor"
    return not attribute.startswith("geom.") or bool(model.geom(element).bodyid[0])
