"""Counters: rows of cabinets that abut, below worktops."""

import dataclasses
from collections.abc import Mapping, Sequence

from mjx_arenas.furniture.part import LENGTH, Box, Condition, Parameter, Part, Surface, each, named, top, whole
from mjx_arenas.geometry import Array
from mjx_arenas.problem import Problem, problem


@dataclasses.dataclass(frozen=True)
class Counter(Part):
    """Cabinets in a row, each below a worktop of its own. If a cabinet grows, those to its left move along.

    The frame stands at the right end of the row, below the back of its worktops. The row goes along y. With `corner` it is an L: the row
    turns to the front behind the corner cabinet.

    Args:
        widths: (n,) widths of the cabinets.
        depth: depth of the worktops, from the wall.
        height: height of their tops.
        thickness: thickness of the worktops.
        overhang: length by which the worktops reach over the cabinets in front.
        corner: index of the corner cabinet. Its width is the depth of the row; `widths` is ignored for it. None: the row is straight.
    """

    widths: Sequence[float] = (0.6, 0.6, 0.6)
    depth: float = 0.6
    height: float = 0.9
    thickness: float = 0.04
    overhang: float = 0.03
    corner: int | None = None

    @property
    def own(self) -> dict[str, Parameter]:
        return {
            "widths": each(LENGTH, self.widths, "cabinet"),
            **{name: whole(LENGTH, getattr(self, name)) for name in ("depth", "height", "thickness", "overhang")},
        }

    @property
    def conditions(self) -> tuple[Condition, ...]:
        return (
            Condition("thickness", "less than the height [m]", lambda n: n["thickness"] < n["height"]),
            Condition("overhang", "less than the depth [m]", lambda n: n["overhang"] < n["depth"]),
        )

    def problems(self) -> list[Problem]:
        n, corner = len(self.widths) if isinstance(self.widths, tuple) else 0, self.corner
        if corner is None or n == 0 or (type(corner) is int and 0 <= corner < n):
            return super().problems()
        return [problem("corner", "must", None, corner, must=f"None or the index of a cabinet, from 0 to {n - 1}")]

    def boxes(self, numbers: Mapping[str, Array]) -> list[Box]:
        depth, height, thick, over = (numbers[name] for name in ("depth", "height", "thickness", "overhang"))
        below, found = (height - thick) / 2, []
        along, ahead = 0.0, 0.0  # where the next cabinet begins
        turned = False
        for i in range(len(self.widths)):
            in_corner = i == self.corner
            width = depth if in_corner else numbers["widths"][i]
            if turned:  # towards the front, with its front towards the right
                x, y = -(ahead + width / 2), along - depth / 2
                top, body = (width / 2, depth / 2), (width / 2, (depth - over) / 2)
                shift = (0.0, over / 2)
                ahead = ahead + width
            else:
                x, y = -depth / 2, along + width / 2
                front = 0.0 if in_corner else over
                top, body = (depth / 2, width / 2), ((depth - front) / 2, width / 2)
                shift = (front / 2, 0.0)
                along = along + width
                if in_corner:
                    turned, ahead = True, depth
            found.append(Box(f"top{i}", (x, y, height - thick / 2), (*top, thick / 2)))
            found.append(Box(f"cabinet{i}", (x + shift[0], y + shift[1], below), (*body, below)))
        return found

    def surfaces(self, numbers: Mapping[str, Array]) -> list[Surface]:
        tops = (f"top{i}" for i in range(len(self.widths)))
        return [top(box) for box in named(self.boxes(numbers), *tops)]
