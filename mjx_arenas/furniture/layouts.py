"""Where parts stand together: rows, along a wall, around a robot, in a grid, as a corridor (host).

Each function gives the same parts at other places, for `arena.add_part` one after the other. Lengths are in [m], angles in [rad].
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from mjx_arenas.furniture.part import Part
from mjx_arenas.furniture.standing import outline


def row(
    parts: Sequence[Part], pos: Sequence[float] = (0.0, 0.0, 0.0), rot: float = 0.0, gap: float = 0.0
) -> list[Part]:
    """A row of parts from right to left, seen from their fronts, with their backs in line. They stay `gap` apart if one of them grows.

    Args:
        parts: parts from right to left; the first stands at `pos`.
        pos: (3,) place of the frame of the first part.
        rot: yaw of the row.
        gap: distance between two parts.
    """
    first, *others = parts
    found = [dataclasses.replace(first, pos=tuple(pos), rot=rot)]
    for part in others:
        found.append(dataclasses.replace(part, beside=found[-1].name, side="left", pos=(0.0, gap, 0.0), rot=0.0))
    return found


def along(wall: Part, parts: Sequence[Part], start: float = 0.0, gap: float = 0.0) -> list[Part]:
    """A row in front of a wall, from its right end on, with the backs against the wall. It follows the wall.

    Args:
        wall: a part that was added to the arena before; it need not be a `Wall`.
        parts: parts from right to left.
        start: distance from the wall's right end to the first part.
        gap: distance between two parts.
    """
    first, *others = row(parts, gap=gap)
    return [dataclasses.replace(first, beside=wall.name, side="front", pos=(0.0, start, 0.0), rot=0.0), *others]


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
    found = []
    for part, angle in zip(parts, np.linspace(angles[0], angles[1], len(parts)), strict=True):
        front = outline(part, part.nominal)[0][0]
        x, y = np.asarray(center) + (radius - front) * np.array([np.cos(angle), np.sin(angle)])
        found.append(dataclasses.replace(part, pos=(x, y, part.pos[2]), rot=angle))
    return found


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
        spacing: (2,) distances between the frames of neighbours along x and y.
        pos: (3,) place of the first frame.
        rot: yaw of the grid, and of each part in it.
    """
    cos, sin = np.cos(rot), np.sin(rot)
    found = []
    for i, part in enumerate(parts):
        x, y = np.array(divmod(i, columns)) * spacing
        at = (pos[0] + cos * x - sin * y, pos[1] + sin * x + cos * y, pos[2])
        found.append(dataclasses.replace(part, pos=tuple(map(float, at)), rot=rot))
    return found


def corridor(left: Sequence[Part], right: Sequence[Part], width: float, gap: float = 0.0) -> list[Part]:
    """Two rows along x that face each other, from the origin on. Their distance is the width of the corridor.

    Args:
        left: parts at y > 0, in the order in which one walks past them along x.
        right: parts at y < 0, in the same order.
        width: nominal distance between the fronts of the first parts.
        gap: distance between two parts of a row.
    """
    found = []
    for parts, sign in ((left, 1), (right, -1)):
        if not parts:
            continue
        (x0, y0), (_, y1) = outline(parts[0], parts[0].nominal)
        along_x = y1 if sign > 0 else -y0  # from the frame to the end of the part where one enters
        pos = (along_x, sign * (width / 2 - x0), parts[0].pos[2])
        first, *others = parts
        found.append(dataclasses.replace(first, pos=pos, rot=sign * np.pi / 2))
        for part in others:
            side = "right" if sign > 0 else "left"
            found.append(
                dataclasses.replace(part, beside=found[-1].name, side=side, pos=(0.0, -sign * gap, 0.0), rot=0.0)
            )
    return found
