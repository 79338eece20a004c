"""One world seen from above, with its numbers (host)."""

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import mujoco
import numpy as np
from matplotlib import patches, patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from mjx_arenas import geometry
from mjx_arenas.problem import problem
from mjx_arenas.rules import validation
from mjx_arenas.spec.objects import COLOURS
from mjx_arenas.viz import plan_numbers
from mjx_arenas.viz.describe import Furnishing, Table, World
from mjx_arenas.viz.figures import OwnFigure

Circle: TypeAlias = tuple[Any, float]  # centre x, y and radius [m]

_REACH = (0.84, 0.37, 0.0)  # Okabe and Ito's vermillion
WOOD, _EDGE = (0.93, 0.88, 0.78), (0.55, 0.45, 0.3)  # of furniture
_HATCHES = ("", "////", "....", "xxxx", "++++")
_TURNS = np.linspace(0, 2 * np.pi, 48, endpoint=False)
_LETTER = 9  # width of a bold letter of 9.5 points, about [pixels]
_CIRCLE = np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=1)


def outline(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> np.ndarray | None:
    """(n, 2) corners of a geom's shadow under a light from straight above [m]; None of one without an end."""
    shape, size = mujoco.mjtGeom, model.geom_size[geom]
    kind, turn = shape(model.geom_type[geom]), data.geom_xmat[geom].reshape(3, 3)
    if kind in (shape.mjGEOM_SPHERE, shape.mjGEOM_ELLIPSOID):
        flat = (turn * (size[[0, 0, 0]] if kind == shape.mjGEOM_SPHERE else size))[:2]
        normals = _CIRCLE @ flat
        points = (normals / np.linalg.norm(normals, axis=1, keepdims=True)) @ flat.T
    elif kind == shape.mjGEOM_CAPSULE:
        points = np.concatenate([size[0] * _CIRCLE + end * turn[:2, 2] for end in (-size[1], size[1])])
    elif kind == shape.mjGEOM_CYLINDER:
        rim = size[0] * _CIRCLE @ turn[:2, :2].T
        points = np.concatenate([rim + end * turn[:2, 2] for end in (-size[1], size[1])])
    elif kind == shape.mjGEOM_BOX:
        points = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T * size @ turn[:2].T
    elif kind == shape.mjGEOM_MESH:
        mesh = model.mesh(model.geom_dataid[geom])
        points = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]] @ turn[:2].T
    else:
        return None
    if not np.isfinite(points).all() or not np.isfinite(data.geom_xpos[geom]).all():
        return None
    return data.geom_xpos[geom, :2] + points[ConvexHull(points).vertices]


def circles(
    reach: float | Sequence[Circle], mounts: dict[str, np.ndarray]
) -> tuple[dict[str, np.ndarray], list[tuple[np.ndarray, float]]]:
    """The points from which distances are measured, by name, and the circles to draw."""
    if validation.is_number(reach):
        centres = mounts or {"origin": np.zeros(2)}
        given: list[Any] = [(centre, reach) for centre in centres.values()]
    else:
        given = list(reach) if isinstance(reach, Sequence) else [reach]
        if not all(isinstance(circle, Sequence) and len(circle) == 2 for circle in given):
            raise validation.error([problem("reach", "circles", None, reach)])
        around = {f"circle {i}": np.asarray(centre) for i, (centre, _) in enumerate(given)}
        centres = mounts or around or {"origin": np.zeros(2)}
    problems = []
    for centre, radius in given:
        problems += validation.vector_problems("reach", centre, 2, "[m]")
        problems += validation.vector_problems("reach", radius, 0, "[m]")
        if not problems and radius <= 0:  # type: ignore[operator]
            problems.append(problem("reach", "radius", None, radius, unit="[m]"))
    validation.raise_all(problems, "plan")
    return centres, [(np.asarray(centre, float), float(radius)) for centre, radius in given]  # type: ignore[arg-type]


def draw(
    world: World,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    skip: Sequence[str],
    boxes: Mapping[str, str],
    centres: dict[str, np.ndarray],
    circles: Sequence[Circle],
    lifted: Mapping[str, float],
    title: str,
) -> Figure:
    """The figure of `Arena.plan`.

    Args:
        world: what `model` and `data` hold, described.
        model: compiled for the world.
        data: with positions computed.
        skip: names of the tables' own geoms.
        boxes: of parts of furniture, the part of each by the name of the geom.
        centres: from where distances are measured, (2,) each.
        circles: centre (2,) and radius.
        lifted: objects that are above what they stand on, and how far [m].
        title: of the figure.
    """
    things = {int(data.body(o.name).id): k for k, o in enumerate(world.objects) if o.present}
    shadows = {g: points for g in range(model.ngeom) if (points := _shadow(model, data, g, skip, things)) is not None}
    tables = sorted((t for t in world.tables if t.present), key=lambda t: t.position[2])
    edges = [_corners(t) for t in tables] + [np.reshape(list(centres.values()), (-1, 2))]
    for floor in _floors(model, data, shadows, np.concatenate(edges), tables[0].position[2] if tables else 0.0):
        del shadows[floor]
    edges += [np.asarray(centre) + radius * np.array([[-1, -1], [1, 1]]) for centre, radius in circles]
    areas = {p.name: _area(p) for p in world.parts if p.present and p.name not in boxes.values()}
    edges += [*shadows.values(), *areas.values()]
    low, high = np.concatenate(edges).min(0), np.concatenate(edges).max(0)
    room = 0.08 * max(*(high - low), 0.5)
    words = plan_numbers.listed(world, data, centres, lifted)
    figure, axes = _sheet(low - room, high + room, words, title)
    parts = {g: boxes[model.geom(g).name] for g in shadows if model.geom(g).name in boxes}
    tops = {g: float(data.geom_xpos[g, 2] + abs(data.geom_xmat[g, 6:]) @ model.geom_size[g]) for g in parts}
    _draw_standing(axes, tables, [(top, shadows[g]) for g, top in tops.items()])
    of = {g: things.get(int(model.body_rootid[model.geom_bodyid[g]])) for g in shadows}
    for g, points in shadows.items():
        if g not in parts:
            k = of[g]
            _draw_shadow(axes, points, k, above=k is not None and world.objects[k].name in lifted)
    for corners in areas.values():
        axes.add_patch(patches.Polygon(corners, fill=False, ec=_EDGE, ls=":", lw=1.2, zorder=2))
    _draw_reach(axes, list(centres.values()), circles)

    outlines = {k: [points for g, points in shadows.items() if of[g] == k] for k in range(len(world.objects))}
    seen = {k: np.concatenate(own) for k, own in outlines.items() if own}
    outlined = {name: [shadows[g] for g in parts if parts[g] == name] for name in parts.values()}
    outlined |= {name: [corners] for name, corners in areas.items()}
    names = {k: plan_numbers.label(world.objects[k].name, lifted) for k in seen}
    _name(axes, {names[k]: points for k, points in seen.items()}, tables, outlined, centres, circles)
    return figure


def _shadow(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, skip: Sequence[str], things: dict[int, int]
) -> np.ndarray | None:
    """The outline of a geom that is to be seen and not to be skipped; all geoms of `things`, given by root bodies, are."""
    seen = int(model.body_rootid[model.geom_bodyid[geom]]) in things or model.geom_rgba[geom, 3] > 0
    return outline(model, data, geom) if seen and model.geom(geom).name not in skip else None


def _floors(
    model: mujoco.MjModel, data: mujoco.MjData, shadows: dict[int, np.ndarray], points: np.ndarray, top: float
) -> list[int]:
    """Geoms that are left out as planes are: fixed to the world, lower than `top`, and reaching around `points` and all else."""
    fixed = [g for g in shadows if model.body_weldid[model.geom_bodyid[g]] == 0 and data.geom_xpos[g, 2] < top]
    found: list[int] = []
    for g in sorted(fixed, key=lambda g: -np.ptp(shadows[g], axis=0).prod()):
        rest = np.concatenate([points, *(other for o, other in shadows.items() if o not in (g, *found))])
        if not _contains(shadows[g], rest):
            break
        found.append(g)
    return found


def _contains(corners: np.ndarray, points: np.ndarray) -> bool:
    """Whether all points (m, 2) are within a convex outline (n, 2), counter-clockwise."""
    (along_x, along_y), (x, y) = (np.roll(corners, -1, 0) - corners).T, (points[:, None] - corners).transpose(2, 0, 1)
    return bool((along_x * y - along_y * x >= 0).all())


def stacks(tables: Sequence[Table]) -> list[list[Table]]:
    """Tables in groups of those that stand above each other, where the middle of each is within the other; in their order."""
    found: list[list[Table]] = []
    for table in tables:
        for stack in found:
            if all(
                _contains(_corners(a), np.array([b.position[:2]])) for a, b in ((table, stack[0]), (stack[0], table))
            ):
                stack.append(table)
                break
        else:
            found.append([table])
    return found


def _sheet(low: np.ndarray, high: np.ndarray, words: str, title: str) -> tuple[Figure, Axes]:
    """A figure with a map from `low` to `high` (2,) [m], and words beside it or, where it is wide, below; without waste."""
    wide, tall = (high - low).tolist()
    lines = words.splitlines()
    text = 0.09 * max(map(len, lines), default=0), 0.17 * len(lines)  # of monospaced letters of 9.5 points [inch]
    scale = min(6.5 / wide, 6.0 / tall)
    box = np.array([wide * scale, tall * scale])
    left, below, above, gap, right = 0.75, 0.6, 0.45 if title else 0.15, 0.3, 0.15
    beside = wide <= 1.6 * tall
    if beside:
        size = (left + box[0] + gap + text[0] + right, below + max(box[1], text[1]) + above)
        corner, at = (left, size[1] - above - box[1]), (left + box[0] + gap, size[1] - above)
    else:
        size = (max(left + box[0] + right, left + text[0] + right), text[1] + gap + below + box[1] + above)
        corner, at = (left, size[1] - above - box[1]), (left, text[1] + 0.1)
    figure = OwnFigure(figsize=size)
    axes = figure.add_axes((corner[0] / size[0], corner[1] / size[1], box[0] / size[0], box[1] / size[1]))
    notes = figure.add_axes((0, 0, 1, 1))
    notes.axis("off")
    notes.text(at[0] / size[0], at[1] / size[1], words, va="top", family="monospace", size=9.5)
    axes.set(
        xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x [m]", ylabel="y [m]", aspect="equal", title=title
    )
    axes.grid(color="0.85", lw=0.5)
    axes.set_axisbelow(True)
    return figure, axes


class _Labels:
    """Names beside what they are of, where they cover no other name, and other objects as little as can be.

    The nearest such place is taken; one that is farther away has a line to what it is of.
    """

    def __init__(self, axes: Axes, objects: Sequence[np.ndarray]) -> None:
        self.axes = axes
        corners = [axes.transData.transform(points) for points in objects]
        self.objects = np.reshape([[*pixels.min(0), *pixels.max(0)] for pixels in corners], (-1, 4))
        self.canvas = FigureCanvasAgg(axes.get_figure(root=True))
        self.taken = np.zeros((0, 4))  # boxes: left, bottom, right, top [pixels]
        self.frame = axes.get_window_extent()

    def add(self, points: np.ndarray, text: str, **style: Any) -> None:
        """Adds the label of what is within points (n, 2) [m]."""
        pixels = self.axes.transData.transform(points)
        middle, half = (pixels.min(0) + pixels.max(0)) / 2, (pixels.max(0) - pixels.min(0)) / 2
        sides = np.array([[0, 1], [0, -1], [1, 0], [-1, 0], [1, 1], [-1, 1], [1, -1], [-1, -1]])
        near = [(middle + side * (half + 3), side) for side in sides]
        far = [(middle + side * (half + away), side) for away in (14, 28, 48, 72, 100) for side in sides]
        self._put(text, near + far, middle, len(near), style)

    def add_along(self, corners: np.ndarray, names: Sequence[str], **style: Any) -> None:
        """Adds names to an outline with corners (n, 2) [m], from the top down: outside its upper and lower edges, or inside them."""
        pixels = self.axes.transData.transform(corners)
        low, high = pixels.min(0), pixels.max(0)
        shares = (0.5, 0.2, 0.8, 0.35, 0.65)
        edges = [(high[1] + 3, 1), (low[1] - 3, -1), (high[1] - 3, -1), (low[1] + 3, 1)]
        places = [
            (np.array([low[0] + s * (high - low)[0], y]), np.array([0, side])) for y, side in edges for s in shares
        ]
        text = _over(names, int(0.9 * self.frame.width / _LETTER))
        self._put(text, places, (low + high) / 2, len(places), style)

    def _put(self, text: str, places: list, middle: np.ndarray, near: int, style: dict[str, Any]) -> None:
        halo = patheffects.withStroke(linewidth=2.5, foreground="white")
        made = self.axes.text(0, 0, text, ha="left", va="bottom", path_effects=[halo], zorder=9, ma="center", **style)
        box = made.get_window_extent(self.canvas.get_renderer())
        size = np.array([box.width, box.height])
        boxes = np.array(
            [np.concatenate([at - size * (1 - side) / 2, at + size * (1 + side) / 2]) for at, side in places]
        )
        if len(places) == near:  # along an edge
            beyond = (self.frame.x0 + 2 - boxes[:, 0]).clip(0) - (boxes[:, 2] - self.frame.x1 + 2).clip(0)
            boxes[:, ::2] += beyond[:, None]
        inside = (boxes[:, :2] > [self.frame.x0, self.frame.y0]).all(1) & (
            boxes[:, 2:] < [self.frame.x1, self.frame.y1]
        ).all(1)
        covered, hidden = _overlap(boxes, self.taken).sum(1), _overlap(boxes, self.objects)
        own = ((self.objects[:, :2] <= middle) & (middle <= self.objects[:, 2:])).all(1)
        hidden = (hidden * ~own).max(1, initial=0) > 0.1 * size.prod()
        index = int(np.lexsort((np.arange(len(boxes)), hidden, covered, ~inside))[0])
        self.taken = np.vstack([self.taken, boxes[index]])
        to_data = self.axes.transData.inverted().transform
        made.set_position(tuple(to_data(boxes[index, :2])))
        if index >= near:
            ends = to_data(np.stack([middle, (boxes[index, :2] + boxes[index, 2:]) / 2]))
            self.axes.plot(*ends.T, color="0.25", lw=0.7, zorder=8)


def _over(names: Sequence[str], letters: int) -> str:
    """Names of what stands above each other, in lines of at most so many letters, if none is longer."""
    text, line = names[0], len(names[0])
    for name in names[1:]:
        broken = line + len(f" over {name}") > letters
        text += f"{chr(10) if broken else ' '}over {name}"
        line = len(f"over {name}") + (0 if broken else line + 1)
    return text


def _corners(table: Table) -> np.ndarray:
    """(4, 2) of a slab, counter-clockwise."""
    return geometry.corners(np.array(table.position), np.radians(table.yaw), np.array(table.size))


def _area(part: Furnishing) -> np.ndarray:
    """(4, 2) of a part that has no boxes, such as a zone of the floor."""
    return geometry.corners(np.array(part.position), np.radians(part.yaw), np.array(part.size))


def _overlap(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n, m) areas that boxes (n, 4) and (m, 4) share."""
    shared = np.minimum(a[:, None, 2:], b[:, 2:]) - np.maximum(a[:, None, :2], b[:, :2])
    return shared.clip(0).prod(-1)


def _draw_table(axes: Axes, table: Table) -> None:
    corners, middle = _corners(table), np.array(table.position[:2])
    axes.add_patch(patches.Polygon(corners, fc="0.94", ec="0.3", lw=1.2, zorder=2))
    along = (corners[1] - corners[0]) / 2
    small = min(table.size[:2])
    head = {"head_width": 0.06 * small, "head_length": 0.08 * small, "length_includes_head": True}
    axes.arrow(*middle, *along, fc="0.55", ec="0.55", lw=1, zorder=3, **head)


def _draw_standing(axes: Axes, tables: Sequence[Table], boxes: Sequence[tuple[float, np.ndarray]]) -> None:
    """Tables, and boxes of furniture with the heights of their tops and their outlines, the lower first."""
    drawings: list[tuple[float, Callable[[], None]]] = [
        *((t.position[2], functools.partial(_draw_table, axes, t)) for t in tables),
        *((top, functools.partial(_draw_box, axes, points)) for top, points in boxes),
    ]
    for _, drawing in sorted(drawings, key=lambda one: one[0]):
        drawing()


def _name(
    axes: Axes,
    seen: Mapping[str, np.ndarray],
    tables: Sequence[Table],
    outlined: Mapping[str, Sequence[np.ndarray]],
    centres: Mapping[str, np.ndarray],
    circles: Sequence[Circle],
) -> None:
    """Names of objects, of where distances are measured from, of tables and parts, and of circles, by their outlines."""
    labels = _Labels(axes, list(seen.values()))
    for name, points in seen.items():
        labels.add(points, name, size=8.5)
    for name, centre in centres.items():
        labels.add(centre[None], name, size=8.5)
    _name_standing(labels, tables, outlined)
    for centre, radius in circles:
        labels.add_along(
            centre + radius * np.array([[0, 1], [1, 0], [0, -1], [-1, 0]]),
            [f"reach {radius:.3g} m"],
            size=8.5,
            color=_REACH,
        )


def _name_standing(labels: "_Labels", tables: Sequence[Table], parts: Mapping[str, Sequence[np.ndarray]]) -> None:
    """Names of tables, those above each other together, and of parts of furniture by the outlines of their boxes."""
    for stack in stacks(tables[::-1]):
        corners = np.concatenate([_corners(table) for table in stack])
        labels.add_along(corners, [table.name for table in stack], size=9.5, weight="bold")
    for name, own in parts.items():
        labels.add_along(np.concatenate(own), [name], size=8.5, weight="bold", color=_EDGE)


def _draw_reach(axes: Axes, centres: Sequence[np.ndarray], circles: Sequence[Circle]) -> None:
    for centre, radius in circles:
        axes.add_patch(patches.Circle(centre, radius, fill=False, ec=_REACH, ls="--", lw=1.5, zorder=6))
    for centre in centres:
        axes.plot(*centre, "+", color="black", ms=10, mew=1.5, zorder=7)


def _draw_box(axes: Axes, points: np.ndarray) -> None:
    """Draws a box of a part of furniture; what is below shows through."""
    axes.add_patch(patches.Polygon(points, fc=(*WOOD, 0.6), ec=_EDGE, lw=0.7, zorder=2))


def _draw_shadow(axes: Axes, points: np.ndarray, k: int | None, above: bool) -> None:
    """Draws the shadow of object k, only its outline if it is above what it stands on, or of what else stands there."""
    if k is None:
        axes.add_patch(patches.Polygon(points, fc="0.5", ec="none", alpha=0.35, zorder=4))
    elif above:
        edge = {"ec": COLOURS[k % len(COLOURS)], "ls": "--", "lw": 1.6}
        axes.add_patch(patches.Polygon(points, fill=False, zorder=5.5, **edge))
    else:
        hatch = _HATCHES[k // len(COLOURS) % len(_HATCHES)]
        axes.add_patch(patches.Polygon(points, fc=COLOURS[k % len(COLOURS)], ec="black", lw=0.6, hatch=hatch, zorder=5))
