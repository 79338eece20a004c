"""Counters: rows of cabinets that abut, below worktops."""

import dataclasses
from collections.abc import Mapping, Sequence

from mjx_arenas.furniture.part import LENGTH, Box, Condition, Parameter, Part, Surface, each, named, top, whole
from mjx_arenas.geometry import Array
from mjx_arenas.problem import Problem, problem


@dataclasses.dataclass(frozen=True)
class Counter(Part):
    """Cabinets in a row, each below a worktop of its own. If a cabinet grows, those to its left move along.

    The frame stands at the right end of the row along the wall, below the back of its worktops. That row goes along y. With one `corner` it
    is an L: the row turns to the front behind the corner cabinet. With two it is a U: the cabinets before the first corner are the row on
    the right, the first of them at its front end. `pieces_active` says which cabinets are there; where one is absent, a gap stays.

    Args:
        widths: (n,) widths of the cabinets.
        depth: depth of the worktops, from the wall.
        height: height of their tops.
        thickness: thickness of the worktops.
        overhang: length by which the worktops reach over the cabinets in front.
        corner: index of the corner cabinet, or (2,) of both. Its width is the depth of the row; `widths` is ignored for it. None: the row
            is straight.
    """

    widths: Sequence[float] = (0.6, 0.6, 0.6)
    depth: float = 0.6
    height: float = 0.9
    thickness: float = 0.04
    overhang: float = 0.03
    corner: int | Sequence[int] | None = None

    def __post_init__(self) -> None:
        """Indices are whole numbers again."""
        super().__post_init__()
        if isinstance(self.corner, tuple):
            indices = (int(i) if isinstance(i, float) and i.is_integer() else i for i in self.corner)
            object.__setattr__(self, "corner", tuple(indices))

    @property
    def own(self) -> dict[str, Parameter]:
        return {
            "widths": each(LENGTH, self.widths, "cabinet"),
            **{name: whole(LENGTH, getattr(self, name)) for name in ("depth", "height", "thickness", "overhang")},
        }

    @property
    def pieces(self) -> tuple[str, ...]:
        return tuple(f"cabinet{i}" for i in range(len(self.widths)))

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
        both = corner if isinstance(corner, tuple) else ()
        if len(both) == 2 and all(type(i) is int for i in both) and 0 <= both[0] < both[1] - 1 < n - 1:
            return super().problems()
        must = f"None, the index of a cabinet, from 0 to {n - 1}, or two of them with another between them"
        return [problem("corner", "must", None, corner, must=must)]

    def boxes(self, numbers: Mapping[str, Array]) -> list[Box]:
        depth, height, thick, over = (numbers[name] for name in ("depth", "height", "thickness", "overhang"))
        widths, below = numbers["widths"], (height - thick) / 2
        right, row, left, corners = self._rows
        found: dict[int, tuple[Box, Box]] = {}

        def add(i: int, x: Array, y: Array, half: tuple[Array, Array], shift: tuple[Array, Array]) -> None:
            """A worktop, and the cabinet that is less deep by twice the shift."""
            piece, (long, wide) = self.pieces[i], half
            body = (long - abs(shift[0]), wide - abs(shift[1]), below)
            found[i] = (
                Box(f"top{i}", (x, y, height - thick / 2), (long, wide, thick / 2), piece=piece),
                Box(f"cabinet{i}", (x + shift[0], y + shift[1], below), body, piece=piece),
            )

        along: Array | float = 0.0  # where the next cabinet begins
        for i in row:
            width = depth if i in corners else widths[i]
            add(i, -depth / 2, along + width / 2, (depth / 2, width / 2), (0.0 if i in corners else over / 2, 0.0))
            along = along + width
        for side, indices in ((-1, right), (1, left)):  # towards the front, with their fronts towards each other
            y, ahead = depth / 2 if side < 0 else along - depth / 2, depth
            for i in indices:
                add(i, -(ahead + widths[i] / 2), y, (widths[i] / 2, depth / 2), (0.0, side * over / 2))
                ahead = ahead + widths[i]
        return [box for i in range(len(found)) for box in found[i]]

    def surfaces(self, numbers: Mapping[str, Array]) -> list[Surface]:
        tops = (f"top{i}" for i in range(len(self.widths)))
        return [top(box) for box in named(self.boxes(numbers), *tops)]

    @property
    def _rows(self) -> tuple[range, range, range, tuple[int, ...]]:
        """Cabinets of the row on the right, from its corner on, of that along the wall, and of that on the left; and the corners."""
        n = len(self.widths)
        if self.corner is None:
            return range(0), range(n), range(0), ()
        corners = (self.corner,) if isinstance(self.corner, int) else tuple(self.corner)
        first = corners[0] if len(corners) == 2 else 0
        return range(first - 1, -1, -1), range(first, corners[-1] + 1), range(corners[-1] + 1, n), corners
