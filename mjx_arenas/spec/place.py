"""The places on its surface where an object may be put (host)."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.keywords import WithKnownArguments
from mjx_arenas.params.params import LARGEST
from mjx_arenas.problem import Item, Problem, Told, problem
from mjx_arenas.spec import specs


@dataclasses.dataclass(frozen=True)
class Place(WithKnownArguments):
    """Restricts where on its table or surface `arena.place` puts an object. A key draws one of the free places there.

    Args:
        region: (2, 2) two corners, (least x, least y) and (most x, most y), of the part of the surface in which the object stays. The edges
            of the surface are at -1 and 1.
        margin: smallest distance to the edges of the surface [m].
        near: name of a body that no joint moves and that is not mocap, such as a robot's base, or (2,) a point of the floor [m].
        distance: (2,) smallest and largest horizontal distance [m] from `near` to the object's middle, such as the reach of a robot.
        rot: (2,) least and most yaw [rad], relative to what it stands on, as `Object.rot`; the same twice: that one. None: any.
        drop: whether it falls onto the things on the surface, as into a bin; elsewhere nothing keeps it from rolling over the edge. It
            starts 5 mm above everything below its outline, including objects that were dropped there before it; the order is that of the
            objects. `mja.settle` lets it come to rest. Without keys objects start at their nominal places, each above all that were
            dropped there before it.
    """

    region: Sequence[Sequence[float]] = ((-1.0, -1.0), (1.0, 1.0))
    margin: float = 0.0
    near: str | Sequence[float] | None = None
    distance: Sequence[float] = (0.0, LARGEST)
    rot: Sequence[float] | None = None
    drop: bool = False

    def __post_init__(self) -> None:
        """What is given as a list or an array is a tuple, so that places are equal by their numbers."""
        for name in ("region", "near", "distance", "rot"):
            value: Any = getattr(self, name)
            if isinstance(value, (list, tuple, np.ndarray)):
                object.__setattr__(self, name, _tuple(value))

    @property
    def yaws(self) -> tuple[float, float]:
        """Least and most yaw [rad], the least from -pi to pi; a full turn apart if there is no `rot`."""
        if self.rot is None:
            return -np.pi, np.pi
        least, most = self.rot
        turns = 2 * np.pi * np.round(least / (2 * np.pi))
        return float(least - turns), float(most - turns)

    def moved(self, prefix: str, shift: np.ndarray, turn: float) -> "Place":
        """The place for an arena whose names got a prefix, and that was turned by a yaw [rad] and moved by (3,) [m]."""
        if self.near is None:
            return self
        if isinstance(self.near, str):
            return dataclasses.replace(self, near=prefix + self.near)
        at = geometry.rotate_yaw(np.float64(turn), np.asarray(self.near)) + shift[:2]
        return dataclasses.replace(self, near=tuple(at.tolist()))

    def problems(self) -> list[Problem]:
        """Problems of this place."""
        found = []
        region = _numbers(self.region, (2, 2))
        if region is None or (np.abs(region) > 1).any() or (region[0] >= region[1]).any():
            must = "two corners (least x, least y), (most x, most y), from -1 to 1"
            found.append(problem("region", "must", None, self.region, must=must))
        margin = _numbers(self.margin, ())
        if margin is None or margin < 0:
            found.append(problem("margin", "must", None, self.margin, must="one number >= 0 [m]"))
        found += near_problems(self.near, self.distance)
        rot = _numbers((0.0, 0.0) if self.rot is None else self.rot, (2,))
        if rot is None or rot[0] > rot[1] or max(rot[1] - rot[0], *np.abs(rot)) > 6.284:
            must = (
                "the least and the most yaw, from -6.284 to 6.284 and at most a full turn apart [rad], or None for any"
            )
            found.append(problem("rot", "must", None, self.rot, must=must))
        if not isinstance(self.drop, (bool, np.bool_)):
            found.append(problem("drop", "truth", None, self.drop))
        return found


def near_problems(near: Any, distance: Any) -> list[Problem]:
    """Problems of what something stays near, and of how far it is from there."""
    found = []
    if near is not None and not isinstance(near, str) and _numbers(near, (2,)) is None:
        found.append(problem("near", "must", None, near, must="the name of a body, 2 numbers x, y [m], or None"))
    least_most = _numbers(distance, (2,))
    if least_most is None or least_most[0] < 0 or least_most[0] >= least_most[1]:
        must = "2 numbers >= 0, the first below the second [m]"
        found.append(problem("distance", "must", None, distance, must=must))
    elif near is None and tuple(distance) != (0.0, LARGEST):
        found.append(problem("near", "must", None, None, must="given where there is a `distance`"))
    elif near is not None and not found and tuple(distance) == (0.0, LARGEST):
        found.append(problem("distance", "must", None, Told("nothing"), must="given where there is `near`"))
    return found


STILL = "the name of a body that no joint moves and that is not mocap, a point x, y [m], or None"


def moving_problems(path: str, item: Item | None, near: Any, spec: mujoco.MjSpec) -> list[Problem]:
    """What something cannot stay near, as it moves; bodies that the spec lacks may still come."""
    body = spec.body(near) if isinstance(near, str) else None
    moves = body is not None and any(len(one.joints) or one.mocap for one in specs.ancestors(body))
    return [problem(path, "must", item, near, must=STILL)] if moves else []


def _numbers(value: object, shape: tuple[int, ...]) -> np.ndarray | None:
    try:
        array = np.asarray(value)
    except ValueError:
        return None
    right = array.dtype.kind in "fiu" and array.shape == shape and bool(np.isfinite(array).all())
    return array.astype(float) if right else None


def _tuple(value: Any) -> Any:
    if isinstance(value, (list, tuple, np.ndarray)):
        return tuple(map(_tuple, value))
    return float(value) if isinstance(value, (int, float, np.number)) and not isinstance(value, bool) else value
