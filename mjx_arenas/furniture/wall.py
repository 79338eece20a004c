"""Walls, with or without a hole for a window or a door."""

import dataclasses
from collections.abc import Mapping, Sequence

from mjx_arenas.furniture.part import HEIGHT, LENGTH, Box, Condition, Parameter, Part, whole
from mjx_arenas.geometry import Array
from mjx_arenas.problem import Problem, problem


@dataclasses.dataclass(frozen=True)
class Wall(Part):
    """A wall along y.

    Args:
        full_size: (3,) thickness, length, height.
        window: (2,) length and height of a hole; None: none.
        window_at: (2,) middle of the hole along y, and height of its lower edge.
        door: (2,) length and height of a hole that begins at the floor; None: none. A wall has at most one hole.
        door_at: middle of the door along y.
    """

    full_size: Sequence[float] = (0.1, 3.0, 2.4)
    window: Sequence[float] | None = None
    window_at: Sequence[float] = (0.0, 0.9)
    door: Sequence[float] | None = None
    door_at: float = 0.0

    @property
    def own(self) -> dict[str, Parameter]:
        hole = LENGTH._replace(item=(2,), axes="length, height")
        found = {"full_size": whole(LENGTH._replace(item=(3,), axes="thickness, length, height"), self.full_size)}
        if self.window is not None:
            at = HEIGHT._replace(item=(2,), axes="y, height")
            found |= {"window": whole(hole, self.window), "window_at": whole(at, self.window_at)}
        if self.door is not None:
            found |= {"door": whole(hole, self.door), "door_at": whole(HEIGHT, self.door_at)}
        return found

    @property
    def conditions(self) -> tuple[Condition, ...]:
        def inside(numbers: Mapping[str, Array]) -> Array:
            _, length, height = (numbers["full_size"][i] for i in range(3))
            right, left, low, top = self._hole(numbers)
            above_floor = True if self.window is None else low > 0
            return (right > -length / 2) & (left < length / 2) & (top < height) & above_floor

        if self.window is None and self.door is None:
            return ()
        return (Condition("door" if self.window is None else "window", "a hole within the wall's edges [m]", inside),)

    def problems(self) -> list[Problem]:
        if self.window is not None and self.door is not None:
            return [problem("door", "must", None, self.door, must="None where there is a window: a wall has one hole")]
        for hole, at in (("window", "window_at"), ("door", "door_at")):
            if getattr(self, hole) is None and getattr(self, at) != getattr(Wall, at):
                return [problem(hole, "must", None, None, must=f"(length, height) where `{at}` is given")]
        return super().problems()

    def boxes(self, numbers: Mapping[str, Array]) -> list[Box]:
        thick, length, height = (numbers["full_size"][i] for i in range(3))
        if self.window is None and self.door is None:
            return [Box("wall", (0.0, 0.0, height / 2), (thick / 2, length / 2, height / 2))]
        right, left, low, top = self._hole(numbers)

        def box(name: str, y0: Array, y1: Array, z0: Array, z1: Array) -> Box:
            return Box(name, (0.0, (y0 + y1) / 2, (z0 + z1) / 2), (thick / 2, (y1 - y0) / 2, (z1 - z0) / 2))

        found = [
            box("right", -length / 2, right, 0.0, height),
            box("left", left, length / 2, 0.0, height),
            box("above", right, left, top, height),
        ]
        return found if self.window is None else [*found, box("below", right, left, 0.0, low)]

    def _hole(self, numbers: Mapping[str, Array]) -> tuple[Array, Array, Array, Array]:
        """Its ends along y, and its lower and upper edge."""
        hole = numbers["door" if self.window is None else "window"]
        at, low = (numbers["door_at"], 0.0) if self.window is None else numbers["window_at"]
        return at - hole[0] / 2, at + hole[0] / 2, low, low + hole[1]
