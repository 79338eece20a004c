"""What all furniture has in common: numbers that vary, and boxes that follow from them by formulas for NumPy and JAX.

The frame of a part stands on the floor, in the middle of its footprint; its front is towards -x, where a robot at the origin that looks
along x meets it. Lengths are in [m], angles in [rad].
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.geometry import Array
from mjx_arenas.keywords import WithKnownArguments
from mjx_arenas.params.params import LARGEST, QUANTITIES, Quantity
from mjx_arenas.problem import Problem, problem
from mjx_arenas.spec import names
from mjx_arenas.spec.place import near_problems

_FRICTION = QUANTITIES["table_frictions"]
_COLOUR = QUANTITIES["object_rgba"]


def _above_zero(x: Array) -> Array:
    return x > 0


def _not_negative(x: Array) -> Array:
    return x >= 0


LENGTH = Quantity("part", (), float, "", _above_zero, "> 0 [m]", (mujoco.mjMINVAL, LARGEST))
"""A length, > 0 [m]. `LENGTH._replace(item=(3,), axes="depth, length, height")` is three of them."""
HEIGHT = Quantity("part", (), float, "", None, "[m]")
"""A height or another place, of either sign [m]."""
DAMPING = Quantity("part", (), float, "", _not_negative, ">= 0", (0.0, LARGEST))
"""The damping of a joint, >= 0: [N s/m] of a slide, [N m s/rad] of a hinge."""
LOSS = Quantity("part", (), float, "", _above_zero, "> 0", (mujoco.mjMINVAL, LARGEST))
"""The friction loss of a joint, > 0: [N] of a slide, [N m] of a hinge."""
SIDES = ("left", "right", "front", "back")
DENSITY = 600.0
"""The density of what moves [kg/m^3]: wood."""


class Parameter(NamedTuple):
    """Numbers of a part that may vary."""

    quantity: Quantity
    """The numbers' shape, unit and bounds."""
    nominal: np.ndarray
    """(N, ...) the nominal numbers."""
    items: tuple[str, ...] = ("",)
    """(N,) names of what each is of, such as "board 0"; "" for the part as a whole."""
    starts: bool = False
    """Whether they are the positions in which its joints (N,) start, [m] or [rad]."""


class Joint(NamedTuple):
    """A joint that moves a piece, in one world: numbers of NumPy or JAX."""

    piece: str
    """Name of the piece that it moves."""
    turns: bool
    """Whether it is a hinge; else it slides."""
    axis: Sequence[Array]
    """(3,) its axis, of length 1, in the part's frame."""
    pos: Sequence[Array]
    """(3,) its place in the part's frame [m]."""
    range: Sequence[Array]
    """(2,) its limits, [m] or [rad]."""
    damping: Array
    """The damping, [N s/m] or [N m s/rad]."""
    frictionloss: Array
    """The friction loss, [N] or [N m]."""


class Condition(NamedTuple):
    """A condition on several numbers of a part."""

    of: str
    """The parameter that messages name if the condition does not hold."""
    must: str
    """What the parameter must be, in words and with its unit."""
    holds: Callable[[Mapping[str, Array]], Array]
    """A function of the numbers that `boxes` takes: () bool, whether the condition holds."""
    why: Callable[[Mapping[str, np.ndarray]], str] | None = None
    """A function of the same numbers, if they break the condition: what is wrong, as a clause. None: messages do not say."""

    def told(self, numbers: Mapping[str, np.ndarray]) -> dict[str, str]:
        """What sentences say of numbers that break the condition."""
        return {"must": self.must, "why": f": {self.why(numbers)}" if self.why is not None else ""}


class Box(NamedTuple):
    """A box of a part, in one world: numbers of NumPy or JAX."""

    name: str
    """Name of its geom, after the part's."""
    pos: Sequence[Array]
    """(3,) its middle, in the part's frame [m]."""
    half: Sequence[Array]
    """(3,) half of its sides [m]."""
    tilt: Array | float = 0.0
    """Its turn about the part's y axis [rad]."""
    piece: str = ""
    """Name of the piece that it belongs to, which may be absent by itself or move; "" for the whole part."""

    @property
    def is_upright(self) -> bool:
        """Whether it never tilts."""
        return isinstance(self.tilt, float) and self.tilt == 0.0  # NumPy's numbers are floats, too


class Surface(NamedTuple):
    """A level rectangle of a part on which things can stand, in one world: numbers of NumPy or JAX."""

    name: str
    """Name after that of the part. The upper side of a box has the name of the box."""
    pos: Sequence[Array]
    """(3,) its middle, in the part's frame [m]."""
    half: Sequence[Array]
    """(2,) half of its sides [m]."""
    piece: str = ""
    """Name of the piece with which it is there, or moves; "" for the whole part."""


@dataclasses.dataclass(frozen=True)
class Part(WithKnownArguments):
    """A piece of furniture.

    Args:
        name: name of its body, and prefix of the names of its elements.
        pos: (3,) place of its frame in the world, or in the frame of the surface that it is `on`.
        rot: its yaw there.
        friction: (3,) sliding, torsional, rolling.
        rgba: (4,) its colour. A material is multiplied by it.
        material: name of a material of the arena; None: a plain colour.
        active: whether it is there nominally. A part that `stays` is always there.
        near: name of a body that no joint moves and that is not mocap, such as a robot's base, or (2,) a point of the floor [m].
        distance: (2,) smallest and largest horizontal distance [m] from `near` to the nearest point of the part. A world in which the part
            is closer or farther is invalid.
        stays: whether all of it is always there, so that it can carry robots. `active` and `pieces_active` then do not vary.
        on: the table (index or body name) or the surface of another part (name) on which it stands, and which it follows. None: the world.
        beside: name of another part that this one touches and follows; `pos` shifts it from there.
        side: side of that part, seen from its front: "left", "right", "front" or "back". At "left" and "right" the backs are in line; at
            "front" and "back" the right ends are in line.
    """

    name: str
    _: dataclasses.KW_ONLY
    pos: Sequence[float] = (0.0, 0.0, 0.0)
    rot: float = 0.0
    friction: Sequence[float] = (1.0, 0.005, 0.0001)
    rgba: Sequence[float] = (0.72, 0.6, 0.45, 1.0)
    material: str | None = None
    active: bool = True
    on: int | str | None = None
    beside: str | None = None
    side: str = "left"
    near: str | Sequence[float] | None = None
    distance: Sequence[float] = (0.0, LARGEST)
    stays: bool = False

    def __post_init__(self) -> None:
        """Numbers of whatever kind are Python's own, and lists and arrays of them tuples, so that parts are equal by their numbers."""
        for field in dataclasses.fields(self):
            given = getattr(self, field.name)
            if isinstance(given, np.bool_):
                object.__setattr__(self, field.name, bool(given))
            elif isinstance(given, np.integer):
                given = int(given)
                object.__setattr__(self, field.name, given)
            if _is_numbers(given) and (np.ndim(given) or isinstance(field.default, float)):
                object.__setattr__(self, field.name, _tuple(np.asarray(given, float).tolist()))

    @property
    def own(self) -> dict[str, Parameter]:
        """The numbers that this kind of furniture has, by name."""
        raise NotImplementedError(
            f"`part`: {type(self).__name__} does not say which numbers it has: give it a property `own`."
        )

    @property
    def pieces(self) -> tuple[str, ...]:
        """Names of the pieces that may be absent by themselves, if the part does not stay."""
        return ()

    @property
    def coming(self) -> tuple[str, ...]:
        """Names of the pieces that come and go by themselves; none if the part stays."""
        return () if self.stays else self.pieces

    def joints(self, numbers: Mapping[str, Array]) -> Sequence[Joint]:
        """Joints that move its pieces; `numbers` as for `boxes`."""
        del numbers
        return ()

    @functools.cached_property
    def moving(self) -> tuple[str, ...]:
        """Names of the pieces that move."""
        return tuple(joint.piece for joint in self.joints(self.nominal))

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Conditions that involve several of its numbers."""
        return ()

    def boxes(self, numbers: Mapping[str, Array]) -> Sequence[Box]:
        """Boxes of the part, in one world.

        Args:
            numbers: numbers by name: (N, ...) for a parameter of N pieces, (...) for a parameter of the whole part.
        """
        raise NotImplementedError(
            f"`part`: {type(self).__name__} does not say where its boxes are: give it a method `boxes`."
        )

    def surfaces(self, numbers: Mapping[str, Array]) -> Sequence[Surface]:
        """Surfaces on which, or in which, things can stand or lie; `numbers` as for `boxes`."""
        del numbers
        return ()

    @functools.cached_property
    def parameters(self) -> dict[str, Parameter]:
        """All numbers that may vary, by name, except presence."""
        return {
            "pos": whole(QUANTITIES["table_offsets"]._replace(of="part"), self.pos),
            "rot": whole(QUANTITIES["table_rots"]._replace(of="part"), self.rot),
            "friction": whole(_FRICTION._replace(of="part"), self.friction),
            "rgba": whole(_COLOUR._replace(of="part"), self.rgba),
            **self.own,
        }

    @functools.cached_property
    def nominal(self) -> dict[str, np.ndarray]:
        """The nominal numbers, as `boxes` takes them."""
        return {name: one.nominal[0] if one.items == ("",) else one.nominal for name, one in self.parameters.items()}

    @functools.cached_property
    def nominal_boxes(self) -> Sequence[Box]:
        """The boxes of the nominal part."""
        return self.boxes(self.nominal)

    @functools.cached_property
    def nominal_surfaces(self) -> Sequence[Surface]:
        """The surfaces of the nominal part."""
        return self.surfaces(self.nominal)

    def problems(self) -> list[Problem]:
        """Problems of this part."""
        found = names.problems("name", self.name)
        if not isinstance(self.active, bool):
            found.append(problem("active", "truth", None, self.active))
        if not isinstance(self.stays, bool):
            found.append(problem("stays", "truth", None, self.stays))
        if self.side not in SIDES:
            found.append(problem("side", "must", None, self.side, must=f"one of {', '.join(map(repr, SIDES))}"))
        elif self.side != Part.side and self.beside is None:
            found.append(problem("beside", "must", None, None, must="given where there is a `side`"))
        if self.material is not None and not isinstance(self.material, str):
            found.append(problem("material", "must", None, self.material, must="the name of a material, or None"))
        found += near_problems(self.near, self.distance)
        for field in dataclasses.fields(self):
            given: Any = getattr(self, field.name)
            default: Any = field.default
            left_out = given is None and default is None
            if field.name in _JUDGED or left_out:
                continue
            if isinstance(default, bool):
                found += [] if isinstance(given, bool) else [problem(field.name, "truth", None, given)]
            elif not _is_numbers(given):
                found.append(_no_numbers(field.name, given, isinstance(default, float)))
            elif default is not None and np.asarray(given).ndim != np.asarray(default).ndim:
                must = "a list of numbers" if np.asarray(default).ndim else "one number"
                found.append(problem(field.name, "must", None, given, must=must))
        found = found or [one for name in self.parameters for one in self._wrong(name)]
        if found:
            return found
        if self.stays and not self.active:
            return [problem("active", "must", None, self.active, must="true, as what `stays` is always there")]
        broken = [c for c in self.conditions if not c.holds(self.nominal)]
        broken = [
            c for c in broken if getattr(self, c.of) is not None
        ] or broken  # what is left out follows from the others
        return [problem(c.of, "condition", None, getattr(self, c.of), c.told(self.nominal)) for c in broken]

    def _wrong(self, name: str) -> list[Problem]:
        quantity, values = self.parameters[name][:2]
        given = getattr(self, name)
        if values.shape[1:] != quantity.item:
            return [problem(name, "must", None, given, must=f"{np.prod(quantity.item):.0f} numbers: {quantity.axes}")]
        if quantity.right(values).all():
            return []
        may = quantity.allowed is None or quantity.allowed(values).all()
        return [problem(name, "must", None, given, must=quantity.between if may else quantity.must)]


_JUDGED = ("name", "material", "active", "on", "beside", "side", "near", "distance", "stays")
"""Arguments of which `problems` says more than whether they are numbers."""


def top(box: Box, front: Array = 0.0, back: Array = 0.0, right: Array = 0.0, left: Array = 0.0) -> Surface:
    """The upper side of a box, without margins [m] at its sides."""
    (x, y, z), (long, wide, high) = box.pos, box.half
    pos = (x + (front - back) / 2, y + (right - left) / 2, z + high)
    return Surface(box.name, pos, (long - (front + back) / 2, wide - (right + left) / 2), box.piece)


def named(boxes: Sequence[Box], *names: str) -> list[Box]:
    """The boxes of these names, in the order of the names."""
    of = {box.name: box for box in boxes}
    return [of[name] for name in names]


def whole(quantity: Quantity, value: Any) -> Parameter:
    """A parameter with one number, or one vector of numbers, for the part as a whole."""
    return Parameter(quantity, np.asarray(value, quantity.kind)[None])


def each(quantity: Quantity, values: Sequence[Any], of: str) -> Parameter:
    """A parameter with a number for each thing of which a part has several, called "board 0", "board 1", ... if `of` is "board"."""
    array = np.asarray(values, quantity.kind)
    return Parameter(quantity, array, tuple(f"{of} {i}" for i in range(len(array))))


def stacked(rows: Sequence[Sequence[Array]], like: Array) -> Array:
    """(n, m) of rows of numbers, some of which may be plain ones; in the library and precision of `like`."""
    xp = geometry.array_module(like)
    if xp is np:
        return np.array(rows, like.dtype)  # many times as fast as stacking
    return xp.stack([xp.stack([xp.asarray(x, like.dtype) for x in row]) for row in rows])


def _tuple(numbers: Any) -> Any:
    return tuple(map(_tuple, numbers)) if isinstance(numbers, list) else numbers


def _no_numbers(name: str, given: Any, one: bool) -> Problem:
    """What is wrong with what is not one finite number, or not a list of them."""
    if one:
        return problem(name, "number", None, given, unit="")
    if isinstance(given, Sequence) and not isinstance(given, str) and not given:
        return problem(name, "must", None, given, must="at least one number")
    return problem(name, "finite" if _is_numbers(given, finite=False) else "numbers", None, given)


def _is_numbers(value: Any, finite: bool = True) -> bool:
    try:
        array = np.asarray(value)
    except (ValueError, TypeError):  # of lists of different lengths, and of what is being traced
        return False
    return array.dtype.kind in "fiu" and array.size > 0 and bool(np.isfinite(array).all() or not finite)
