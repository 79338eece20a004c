"""Layouts of parts: rows, along a wall, around a robot, in a grid, as a corridor (host).

Each function gives the same parts at other places, for `arena.add_part` one after the other. It decides x, y and yaw of each part, whatever
its own `pos` and `rot` say, and keeps its height z: a `Cupboard("c", pos=(0, 0, 1.4))` hangs 1.4 m above the foot of the wall. Heights
count from the z of the layout's `pos`, if it has one. Lengths are in [m], angles in [rad].

What does not fit is a `ValueError`, as is a part with a `beside` of its own. A part may have an `on` where it stands beside no other.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from mjx_arenas.furniture.part import Part
from mjx_arenas.furniture.standing import outline
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.problem import Problem, problem, under
from mjx_arenas.problems.arguments import is_whole, not_negative_problems, vector_problems
from mjx_arenas.problems.messages import raise_all


@with_known_arguments
def row(
    parts: Sequence[Part], pos: Sequence[float] = (0.0, 0.0, 0.0), rot: float = 0.0, gap: float = 0.0
) -> list[Part]:
    """A row of parts from right to left, seen from their fronts, with their backs in line. They stay `gap` apart if one of them grows.

    Args:
        parts: parts from right to left; the first stands at `pos`.
        pos: (3,) place of the frame of the first part; its own height is added to z.
        rot: yaw of the row.
        gap: distance between two parts, at least 0.
    """
    found = [*_list_problems("parts", parts), *vector_problems("pos", pos, 3, "[m]")]
    found += [*vector_problems("rot", rot, 0, "[rad]"), *not_negative_problems("gap", gap, "[m]")]
    raise_all(found, "`row`")
    x, y, z = pos
    first = dataclasses.replace(parts[0], pos=(x, y, z + parts[0].pos[2]), rot=rot)
    return _beside(first, parts, "left", gap)


@with_known_arguments
def along(wall: Part, parts: Sequence[Part], start: float = 0.0, gap: float = 0.0) -> list[Part]:
    """A row in front of a wall, from its right end on, with the backs against the wall. It follows the wall.

    Args:
        wall: a part that was added to the arena before; it need not be a `Wall`.
        parts: parts from right to left; their heights are above the wall's foot.
        start: distance from the wall's right end to the first part; below 0, it stands out to the right.
        gap: distance between two parts, at least 0.
    """
    found = _part_problems("wall", wall)
    found += _list_problems("parts", parts, None if found else wall)
    found += [*vector_problems("start", start, 0, "[m]"), *not_negative_problems("gap", gap, "[m]")]
    raise_all(found, "`along`")
    first = dataclasses.replace(parts[0], beside=wall.name, side="front", pos=(0.0, start, parts[0].pos[2]), rot=0.0)
    return _beside(first, parts, "left", gap)


@with_known_arguments
def ring(
    parts: Sequence[Part],
    radius: float,
    center: Sequence[float] = (0.0, 0.0),
    angles: Sequence[float] = (-np.pi / 2, np.pi / 2),
) -> list[Part]:
    """Parts around a robot, with their fronts towards it, at equal angles from the first to the last.

    Args:
        parts: parts in counter-clockwise order.
        radius: nominal distance from the centre to their fronts.
        center: (2,) place of the robot.
        angles: (2,) angles of the first and the last part, seen from the centre: 0 is along x, pi / 2 along y.
    """
    found = [*_list_problems("parts", parts, in_row=False), *_above_zero_problems("radius", radius)]
    found += [*vector_problems("center", center, 2, "[m]"), *vector_problems("angles", angles, 2, "[rad]")]
    raise_all(found, "`ring`")
    placed = []
    for part, angle in zip(parts, np.linspace(angles[0], angles[1], len(parts)), strict=True):
        front = outline(part, part.nominal)[0][0]
        x, y = np.asarray(center) + (radius - front) * np.array([np.cos(angle), np.sin(angle)])
        placed.append(dataclasses.replace(part, pos=(x, y, part.pos[2]), rot=angle))
    return placed


@with_known_arguments
def grid(
    parts: Sequence[Part],
    columns: int,
    spacing: Sequence[float],
    pos: Sequence[float] = (0.0, 0.0, 0.0),
    rot: float = 0.0,
) -> list[Part]:
    """Parts in rows of `columns` along y, one row behind the other along x.

    Args:
        parts: parts row by row.
        columns: number of parts in a row.
        spacing: (2,) distances between the frames of neighbours along x and y; below 0, the other way.
        pos: (3,) place of the first frame; the own height of each part is added to z.
        rot: yaw of the grid, and of each part in it.
    """
    found = _list_problems("parts", parts, in_row=False, solid=False)
    if not is_whole(columns, 1):
        found.append(problem("columns", "must", None, columns, must="a whole number >= 1"))
    found += [*vector_problems("spacing", spacing, 2, "[m]"), *vector_problems("pos", pos, 3, "[m]")]
    raise_all([*found, *vector_problems("rot", rot, 0, "[rad]")], "`grid`")
    cos, sin = np.cos(rot), np.sin(rot)
    placed = []
    for i, part in enumerate(parts):
        x, y = np.array(divmod(i, columns)) * spacing
        at = (pos[0] + cos * x - sin * y, pos[1] + sin * x + cos * y, pos[2] + part.pos[2])
        placed.append(dataclasses.replace(part, pos=tuple(map(float, at)), rot=rot))
    return placed


@with_known_arguments
def corridor(left: Sequence[Part], right: Sequence[Part], width: float, gap: float = 0.0) -> list[Part]:
    """Two rows along x that face each other, from the origin on. Their distance is the width of the corridor.

    Args:
        left: parts at y > 0, in the order in which one walks past them along x. May be empty if `right` is not.
        right: parts at y < 0, in the same order. May be empty if `left` is not.
        width: nominal distance between the fronts of the first parts.
        gap: distance between two parts of a row, at least 0.
    """
    rows = {"left": left, "right": right}
    rows = {name: parts for name, parts in rows.items() if not isinstance(parts, Sequence) or parts} or {"left": left}
    found = [one for name, parts in rows.items() for one in _list_problems(name, parts)]
    found += [*_above_zero_problems("width", width), *not_negative_problems("gap", gap, "[m]")]
    raise_all(found, "`corridor`")
    placed = []
    for parts, sign, side in ((left, 1, "right"), (right, -1, "left")):
        if not parts:
            continue
        (x0, y0), (_, y1) = outline(parts[0], parts[0].nominal)
        along_x = y1 if sign > 0 else -y0  # from the frame to the end of the part where one enters
        pos = (along_x, sign * (width / 2 - x0), parts[0].pos[2])
        first = dataclasses.replace(parts[0], pos=pos, rot=sign * np.pi / 2)
        placed += _beside(first, parts, side, gap)
    return placed


def _beside(first: Part, parts: Sequence[Part], side: str, gap: float) -> list[Part]:
    """A row of `parts`, of which the first is placed already: each abuts the one before it, at its own height."""
    placed, shift = [first], gap if side == "left" else -gap
    for before, part in itertools.pairwise(parts):
        pos = (0.0, shift, part.pos[2] - before.pos[2])
        placed.append(dataclasses.replace(part, beside=before.name, side=side, pos=pos, rot=0.0))
    return placed


def _list_problems(
    name: str, parts: object, wall: Part | None = None, in_row: bool = True, solid: bool = True
) -> list[Problem]:
    """What is wrong with the parts of a layout.

    Args:
        name: of the argument.
        parts: what it is.
        wall: what the first part stands beside, if anything.
        in_row: whether each of the others stands beside the one before it.
        solid: whether all need boxes, at whose sides others stand.
    """
    if not isinstance(parts, Sequence) or isinstance(parts, str) or not parts:
        return [problem(name, "must", None, parts, must="a list of parts of furniture, at least one")]
    found, before = [], wall
    for i, part in enumerate(parts):
        wrong = _part_problems(f"{name}[{i}]", part, solid)
        if not wrong and part.beside is not None:
            must = "None, as the layout decides where it stands"
            wrong = [problem(f"{name}[{i}].beside", "must", None, part.beside, must=must)]
        if not wrong and part.on is not None and before is not None:
            must = f"None, as it stands beside {before.name!r}"
            wrong = [problem(f"{name}[{i}].on", "must", None, part.on, must=must)]
        found, before = [*found, *wrong], part if in_row and isinstance(part, Part) else None
    return found


def _part_problems(path: str, part: object, solid: bool = True) -> list[Problem]:
    """What is wrong with one part."""
    if isinstance(part, Part) and type(part) is not Part:
        wrong = under(path, part.problems())
        if wrong or not solid or part.nominal_boxes:
            return wrong
    return [problem(path, "must", None, part, must="a part of furniture" + " with boxes" * solid)]


def _above_zero_problems(name: str, value: object) -> list[Problem]:
    """What is wrong with a distance [m]."""
    found = vector_problems(name, value, 0, "[m]")
    small = not found and np.asarray(value) <= 0
    return [problem(name, "must", None, value, must="> 0 [m]")] if small else found
