"""Shelves: boards between two sides."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from mjx_arenas.furniture.part import (
    HEIGHT,
    LENGTH,
    Box,
    Condition,
    Parameter,
    Part,
    Surface,
    each,
    named,
    top,
    whole,
)
from mjx_arenas.geometry import Array
from mjx_arenas.params.params import Quantity
from mjx_arenas.problem import Problem, problem

_SHARE = Quantity("part", (), float, "", None, "", (0.01, 1.0))


@dataclasses.dataclass(frozen=True)
class Shelf(Part):
    """Boards between two sides, in front of a back. `pieces_active` says which boards are there.

    Args:
        size: (2,) depth and width.
        heights: (n,) heights of the tops of the boards, from the bottom up. Sides and back are as high as the last board, whether it is
            there or not.
        thickness: thickness of boards, sides and back.
        depths: (n,) depths of the boards, as shares of the depth in front of the back. None: all have that depth.
    """

    size: Sequence[float] = (0.35, 0.9)
    heights: Sequence[float] = (0.1, 0.6, 1.1, 1.6)
    thickness: float = 0.02
    depths: Sequence[float] | None = None

    @property
    def own(self) -> dict[str, Parameter]:
        size = LENGTH._replace(item=(2,), axes="depth, width")
        return {
            "size": whole(size, self.size),
            "heights": each(HEIGHT, self.heights, "board"),
            "thickness": whole(LENGTH, self.thickness),
            "depths": each(_SHARE, self.depths or (1.0,) * len(self.heights), "board"),
        }

    @property
    def pieces(self) -> tuple[str, ...]:
        return tuple(f"board{i}" for i in range(len(self.heights)))

    @property
    def conditions(self) -> tuple[Condition, ...]:
        def apart(numbers: Mapping[str, Array]) -> Array:
            h, thick = numbers["heights"], numbers["thickness"]
            return (h[1:] - h[:-1] > thick).all() & (h[0] >= thick)

        thin = "less than half of depth and width [m]"
        return (
            Condition(
                "heights",
                "from the bottom up, further apart than the boards are thick, and not below the floor [m]",
                apart,
                _why,
            ),
            Condition("thickness", thin, lambda numbers: (2 * numbers["thickness"] < numbers["size"]).all()),
        )

    def boxes(self, numbers: Mapping[str, Array]) -> list[Box]:
        depth, width = (numbers["size"][i] / 2 for i in range(2))  # half of them
        thick, height = numbers["thickness"] / 2, numbers["heights"][-1] / 2
        sides = [
            Box(name, (0.0, sign * (width - thick), height), (depth, thick, height))
            for name, sign in (("right", -1), ("left", 1))
        ]
        back = Box("back", (depth - thick, 0.0, height), (thick, width - 2 * thick, height))
        boards = []
        for i, name in enumerate(self.pieces):
            deep = (depth - thick) * numbers["depths"][i]  # half of it, from the back on
            at = (depth - 2 * thick - deep, 0.0, numbers["heights"][i] - thick)
            boards.append(Box(name, at, (deep, width - 2 * thick, thick), piece=name))
        return [*sides, back, *boards]

    def problems(self) -> list[Problem]:
        """Problems of this shelf."""
        n = len(self.heights) if isinstance(self.heights, tuple) else 0
        if n == 0 or self.depths is None or (isinstance(self.depths, tuple) and len(self.depths) == n):
            return super().problems()
        return [problem("depths", "must", None, self.depths, must=f"{n} number{'s' * (n > 1)}, one for each board")]

    def surfaces(self, numbers: Mapping[str, Array]) -> list[Surface]:
        return [top(board) for board in named(self.boxes(numbers), *self.pieces)]


def _why(numbers: Mapping[str, np.ndarray]) -> str:
    """What is wrong with heights that are in another order, too near to each other, or too low."""
    h, thick = numbers["heights"], float(numbers["thickness"])
    if h[0] < thick:
        return f"board0 is {thick:g} m thick, so it reaches {thick - h[0]:.3g} m below the floor"
    i = int(np.argmin(h[1:] - h[:-1]))
    if h[i + 1] <= h[i]:
        return f"board{i + 1} is not above board{i}"
    return f"board{i + 1} is {h[i + 1] - h[i]:.3g} m above board{i}, and the boards are {thick:g} m thick"
