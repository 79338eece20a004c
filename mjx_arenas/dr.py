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
from mjx_arenas.problems.messages import error, warn
from mjx_arenas.spec import automatic, patterns, scaled, specs
from mjx_arenas.terms.attributes import ATTRIBUTES, KINDS, fields
from mjx_arenas.terms.attributes.fixed import constant
from mjx_arenas.terms.attributes.gains import shortcut
from mjx_arenas.terms.elements import ids_of, in_spec, names_of

__all__ = ["ATTRIBUTES", "Preset", "Term", "robot"]


@dataclasses.dataclass(frozen=True)
class Term(WithKnownArguments):
    """One attribute of some elements. Each element draws its own number unless the range is `tied`.

    Args:
        attribute: kind of element and its attribute, as MJCF calls them: "geom.friction", "body.mass". `dr.ATTRIBUTES` has all.
        elements: names, or regular expressions that match whole names, or a list of them. A regular expression skips elements that cannot
            vary. None: all elements of the kind that can vary, and are not decided by a table, an object or another term. Elements without
            a name are called "hand/geom0" and the like (docs/terms.md), and get this name when a term selects them.
        axes: names of the numbers of the attribute that vary, `("sliding",)` or "x"; None: all.
        bodies: names of bodies, or regular expressions, or a list of them: only geoms, joints, sites, cameras or lights that belong to one
            of these bodies, not to what is attached to it. None: of all bodies.
    """

    attribute: str
    elements: str | Sequence[str] | None = None
    axes: Sequence[str] | None = None
    bodies: str | Sequence[str] | None = None

    def __post_init__(self) -> None:
        for name in ("elements", "axes", "bodies"):
            if isinstance(getattr(self, name), list):
                object.__setattr__(self, name, tuple(getattr(self, name)))

    def problems(self) -> list[Problem]:
        """Problems of the term that do not depend on the arena."""
        given = str(self.attribute)
        meant = given if given in ATTRIBUTES else fields.attribute_of(given) or ""
        if fixed := constant(given) or constant(meant):
            return [problem("attribute", "fixed", None, self.attribute, {"why": fixed.why, "instead": fixed.instead})]
        if not isinstance(self.attribute, str) or given not in ATTRIBUTES:
            known = list(ATTRIBUTES)
            nearest = (meant, known) if meant in ATTRIBUTES else patterns.near(given, known)
            return [problem("attribute", "unknown_attribute", None, self.attribute, nearest=nearest)]
        for name in ("elements", "bodies"):
            if getattr(self, name) is not None and not patterns.are_texts(getattr(self, name)):
                return [problem(name, "names", None, getattr(self, name))]
        if self.bodies is not None and self._kind not in automatic.ON_BODIES:
            instead = ": give `elements`" if self._kind == "body" else ""
            return [problem("bodies", "no_bodies", None, self.bodies, attribute=self.attribute, instead=instead)]
        known = self._axes
        if self.axes is None:
            return []
        given = [self.axes] if isinstance(self.axes, str) else self.axes
        if not patterns.are_texts(given) or not set(given) <= set(known):
            rule = "axes" if known else "no_axes"
            return [problem("axes", rule, None, self.axes, names=[*map(repr, known)], attribute=self.attribute)]
        return []

    @property
    def chosen(self) -> tuple[bool, ...]:
        """Flags for the numbers of the attribute: whether each varies."""
        given = [self.axes] if isinstance(self.axes, str) else self.axes
        return tuple(given is None or axis in given for axis in self._axes)

    @property
    def _axes(self) -> list[str]:
        axes = ATTRIBUTES[self.attribute].quantity.axes
        return [axis.strip() for axis in axes.split(",")] if axes else []

    @property
    def _kind(self) -> str:
        return self.attribute.partition(".")[0]

    @property
    def _named_bodies(self) -> str:
        """What messages call the bodies."""
        named = [self.bodies] if isinstance(self.bodies, str) else self.bodies or ()
        return f"{'body' if len(named) == 1 else 'bodies'} {', '.join(map(repr, named))}"

    def select(self, spec: mujoco.MjSpec, model: mujoco.MjModel) -> tuple[tuple[str, ...], list[Problem]]:
        """Names of the elements that the term selects, in the model's order, or the reason why there are none.

        Args:
            spec: all of its elements have names (`automatic.give`).
            model: of this spec.
        """
        kind, why = self._kind, self.reasons(spec, model)
        if self.bodies is not None:
            own, told = self._on_bodies(model)
            if told:
                return (), told
            why = {name: reason for name, reason in why.items() if name in own}
            kind += f" of {self._named_bodies}"
        names = list(why)
        if self.elements is None:
            able = tuple(name for name in names if not why[name])
            why_not = next((f": {why[name]} ({name!r})" for name in names), "")
            what = {"kind": kind, "attribute": self.attribute, "why": why_not}
            return able, [] if able else [problem("elements", "none_can_vary", None, None, what)]
        found, problems = _found("elements", self.elements, kind, names)
        chosen = set[str]()
        for matched in found:
            chosen |= {name for name in matched if not why[name]} or matched  # a pattern leaves out what cannot vary
        for name in (name for name in names if name in chosen and why[name]):
            what = {"kind": self._kind, "name": name, "attribute": self.attribute, "why": why[name]}
            problems.append(problem("elements", "cannot_vary", None, None, what))
        return tuple(name for name in names if name in chosen), problems

    def reasons(self, spec: mujoco.MjSpec, model: mujoco.MjModel) -> dict[str, str]:
        """Why the attribute cannot vary, a clause, of each element of the kind by its name; "" if it can."""
        names = names_of(model, self._kind)
        return {
            name: self._why_not(spec, model, name, index)
            for index, name in enumerate(names)
            if name and (self._kind, name) != ("body", "world")
        }

    def _on_bodies(self, model: mujoco.MjModel) -> tuple[set[str], list[Problem]]:
        """Names of all elements of the bodies, or why there are none."""
        assert self.bodies is not None
        found, problems = _found("bodies", self.bodies, "body", names_of(model, "body"))
        bodies = getattr(model, f"{KINDS[self._kind].prefix}_bodyid")
        chosen = {model.body(name).id for matched in found for name in matched}
        own = {name for name, body in zip(names_of(model, self._kind), bodies, strict=True) if body in chosen}
        if not own and not problems:
            problems = [problem("bodies", "nothing_on_bodies", kind=self._kind, bodies=self._named_bodies)]
        return own, problems

    def _why_not(self, spec: mujoco.MjSpec, model: mujoco.MjModel, name: str, index: int) -> str:
        """Why the attribute of an element cannot vary, a clause; "" if it can."""
        attribute = ATTRIBUTES[self.attribute]
        why = attribute.refused(model, index) if attribute.refused else ""
        element = in_spec(spec, self._kind, name)
        if not why and attribute.refused_in_spec:
            why = attribute.refused_in_spec(spec, element)
        return why or scaled.why_scaled(spec, element)


def _found(path: str, given: str | Sequence[str], kind: str, names: list[str]) -> tuple[list[set[str]], list[Problem]]:
    """The names that each pattern matches, and problems of patterns that match none."""
    found, problems = [], []
    for pattern in [given] if isinstance(given, str) else given:
        matched = patterns.matching(pattern, names)
        found.append(matched)
        if not matched and (why_not := patterns.no_pattern(pattern)):
            problems.append(problem(path, "no_pattern", None, pattern, {"kind": kind, "why": why_not}))
        elif not matched:
            what = {"kind": kind, "nearest": patterns.near(pattern, names)}
            problems.append(problem(path, "no_element", None, pattern, what))
    return found, problems


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
_GAINS = "kp", "kv"


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

    Numbers that are 0 stay 0, and the friction of geoms that are only seen stays as it is. A warning says which of these quantities
    the robot has and cannot vary, and why; of `kp`, `kv` and `motor` a robot needs only one.

    Playground: `mujoco_playground/_src/locomotion/go1/randomize.py` and `_src/manipulation/leap_hand/reorient.py`, version 0.2.
    Walk these ways: `go1_gym/envs/go1/go1_config.py`.

    Args:
        spec: `arena.spec`, with the robot in it.
        prefix: prefix of the names of the robot's elements; it is also the prefix of the quantities' names.
            Elements without a name are called after what they belong to (docs/terms.md), so they have it, too.
            "": the kinematic trees that actuators move, so no tables, objects or doors. Without actuators: everything.
        strength: factor from 0 to 1 on how far each range reaches from the compiled value.

    Raises:
        ValueError: nothing with this prefix can vary, or `strength` is not between 0 and 1.
    """
    if isinstance(strength, bool) or not isinstance(strength, (int, float)) or not 0 <= strength <= 1:
        raise error([problem("strength", "must", None, strength, must="a number from 0 to 1")])
    if not isinstance(spec, mujoco.MjSpec) or not isinstance(prefix, str):
        raise error([problem("spec", "must", None, spec, must="`arena.spec`, and `prefix` a string")], kind=TypeError)
    spec = spec.copy()
    automatic.give(spec)
    model = specs.compiled(spec.copy(), "arena.spec")
    terms, ranges, left = dict[str, Term](), dict[str, Distribution](), dict[str, tuple[str, str]]()
    for name, (attribute, axes, reach) in _ROBOT.items():
        own, why = _of_robot(spec, model, attribute, prefix, scaled=not isinstance(reach, float))
        if not own:
            left |= {name: why} if why is not None else {}
            continue
        terms[prefix + name] = Term(attribute, tuple(map(re.escape, own)), axes)
        if isinstance(reach, float):
            ranges[prefix + name] = Uniform(-strength * reach, strength * reach, relative="add")
        else:
            low, high = (1 + strength * (bound - 1) for bound in reach)
            ranges[prefix + name] = Uniform(low, high, relative="scale")
    if not terms:
        raise error([problem("prefix", "no_robot", None, prefix)])
    gains = {name: left.pop(name) for name in _GAINS if name in left}
    by_why = {why: [name for name in left if left[name] == why] for why in left.values()}
    said = [f"{' and '.join(names)}, as {why} ({first})" for (why, first), names in by_why.items()]
    if len(gains) == len(_GAINS) and prefix + "motor" not in terms:
        said.append(f"kp, kv and motor, as no actuator is a servo, a damper or a motor ({gains['kp'][1]})")
    if said:
        warn(problem("spec", "left_out_of_preset", left="; ".join(said)))
    return Preset(terms, ranges)


def _of_robot(
    spec: mujoco.MjSpec, model: mujoco.MjModel, attribute: str, prefix: str, scaled: bool
) -> tuple[list[str], tuple[str, str] | None]:
    """The robot's elements whose attribute acts and can vary, and is not 0 where it is to be `scaled`.

    If there are none, because none can vary: why not, and the first of them.
    """
    kind, read = attribute.partition(".")[0], ATTRIBUTES[attribute].read
    reasons = Term(attribute).reasons(spec, model)
    trees = set() if prefix else _actuated(model)
    own = {
        name: reasons[name]
        for name in reasons
        if name.startswith(prefix) and _is_part(model, kind, name, trees) and _acts(model, attribute, name)
    }
    able = [name for name, why in own.items() if not why]
    if not able:
        return [], next(((why, f"{kind} {name!r}") for name, why in own.items()), None)
    assert read is not None
    numbers = read(model, ids_of(model, kind, tuple(able)))
    return [name for name, number in zip(able, numbers, strict=True) if np.any(number) or not scaled], None


def _actuated(model: mujoco.MjModel) -> set[int]:
    """Kinematic trees that actuators move."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    dofs = [data.moment_colind[at : at + n] for at, n in zip(data.moment_rowadr, data.moment_rownnz, strict=True)]
    return set(model.dof_treeid[np.concatenate([np.zeros(0, int), *dofs]).astype(int)].tolist())


def _is_part(model: mujoco.MjModel, kind: str, element: str, trees: set[int]) -> bool:
    """Whether it is part of a robot: of one of some trees, if there are any, and no geom of the world itself, like the floor."""
    if kind == "actuator":
        return True
    found = getattr(model, kind)(element)
    body = found.id if kind == "body" else found.bodyid[0]
    return bool(model.body_treeid[body] in trees if trees else kind != "geom" or body)


def _acts(model: mujoco.MjModel, attribute: str, element: str) -> bool:
    """Whether it is what the preset varies: no mass of what never moves, no friction of what is only seen, a motor's strength as gain."""
    if attribute == "actuator.gainprm":
        return shortcut(model, model.actuator(element).id) == "motor"
    if attribute.startswith("body."):
        return bool(model.body_weldid[model.body(element).id])
    if attribute != "geom.friction":
        return True
    geom = model.geom(element)
    return bool(geom.contype[0] or geom.conaffinity[0] or geom.id in (*model.pair_geom1, *model.pair_geom2))
