"""Posts and rails."""

import dataclasses
from collections.abc import Mapping, Sequence

from mjx_arenas.furniture.part import HEIGHT, LENGTH, Box, Condition, Parameter, Part, Surface, each, named, top, whole
from mjx_arenas.geometry import Array
from mjx_arenas.problem import Problem, problem

MOST = 1000  # posts


@dataclasses.dataclass(frozen=True)
class Rail(Part):
    """Posts in a row along y, at equal distances, with rails in front of them: a fence, a railing, a gantry.

    Robots can be on a rail, or under it, and objects on rails that are wide enough.

    Args:
        length: distance from the middle of the first post to that of the last.
        height: height of the posts.
        heights: (n,) heights of the rails' middles.
        thickness: thickness of posts and rails.
        n_posts: number of posts, at least two.
    """

    length: float = 2.0
    height: float = 1.0
    heights: Sequence[float] = (0.5, 0.95)
    thickness: float = 0.05
    n_posts: int = 3

    @property
    def conditions(self) -> tuple[Condition, ...]:
        def apart(numbers: Mapping[str, Array]) -> Array:
            return numbers["length"] > (self.n_posts - 1) * numbers["thickness"]

        def within(numbers: Mapping[str, Array]) -> Array:
            h, half = numbers["heights"], numbers["thickness"] / 2
            return ((h >= half) & (h <= numbers["height"])).all()

        return (
            Condition("length", "more than the posts are thick, so that they stand apart [m]", apart),
            Condition("heights", "between the floor and the tops of the posts [m]", within),
        )

    @property
    def own(self) -> dict[str, Parameter]:
        sizes = {name: whole(LENGTH, getattr(self, name)) for name in ("length", "height", "thickness")}
        return sizes | {"heights": each(HEIGHT, self.heights, "rail")}

    def problems(self) -> list[Problem]:
        if type(self.n_posts) is int and 2 <= self.n_posts <= MOST:
            return super().problems()
        return [problem("n_posts", "must", None, self.n_posts, must=f"a whole number from 2 to {MOST}")]

    def boxes(self, numbers: Mapping[str, Array]) -> list[Box]:
        length, height, thick = numbers["length"], numbers["height"], numbers["thickness"] / 2
        gap = length / (self.n_posts - 1)
        posts = [
            Box(f"post{i}", (0.0, i * gap - length / 2, height / 2), (thick, thick, height / 2))
            for i in range(self.n_posts)
        ]
        rails = [
            Box(f"rail{i}", (-2 * thick, 0.0, numbers["heights"][i]), (thick, length / 2 + thick, thick))
            for i in range(len(self.heights))
        ]
        return [*posts, *rails]

    def surfaces(self, numbers: Mapping[str, Array]) -> list[Surface]:
        return [top(box) for box in named(self.boxes(numbers), *(f"rail{i}" for i in range(len(self.heights))))]
