"""One world seen from above, with its numbers (host)."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import mujoco
import numpy as np
from matplotlib import patches, patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from mjx_arenas import geometry, validation
from mjx_arenas.describe import Table, World, columns
from mjx_arenas.objects import PALETTE

Circle: TypeAlias = tuple[Any, float]  # centre x, y and radius [m]

_REACH = (0.84, 0.37, 0.0)  # Okabe and Ito's vermillion
_HATCHES = ("", "////", "....", "xxxx", "++++")
_TURNS = np.linspace(0, 2 * np.pi, 48, endpoint=False)
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
        corners = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T * size
        points = corners @ turn[:2].T
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
    """From where distances are measured, by name, and the circles to draw."""
    if isinstance(reach, (int, float)):
        centres = mounts or {"origin": np.zeros(2)}
        given = [(centre, reach) for centre in centres.values()]
    else:
        given = list(reach) if isinstance(reach, Sequence) else [reach]
        if not all(isinstance(circle, Sequence) and len(circle) == 2 for circle in given):
            raise ValueError(f"`reach` must be one radius, or ((x, y), radius) for each circle [m], got {reach!r}.")
        around = {f"circle {i}": np.asarray(centre) for i, (centre, _) in enumerate(given)}
        centres = mounts or around or {"origin": np.zeros(2)}
    problems = []
    for centre, radius in given:
        problems += validation.vector_problems("reach", centre, 2, "[m]")
        problems += validation.vector_problems("reach", radius, 0, "[m]")
        if not problems and radius <= 0:  # type: ignore[operator]
            problems.append(f"`reach` must have radii > 0 [m], got {radius}.")
    validation.raise_all(problems, "plan")
    return centres, [(np.asarray(centre, float), float(radius)) for centre, radius in given]  # type: ignore[arg-type]


def draw(
    world: World,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    skip: Sequence[str],
    centres: dict[str, np.ndarray],
    circles: Sequence[Circle],
    title: str,
) -> Figure:
    """The figure of `Arena.plan`.

    Args:
        world: what `model` and `data` hold, described.
        model: compiled for the world.
        data: with positions computed.
        skip: names of the tables' own geoms.
        centres: from where distances are measured, (2,) each.
        circles: centre (2,) and radius.
        title: of the figure.
    """
    figure = Figure(figsize=(12.5, 6.5), layout="constrained")
    axes, notes = figure.subplots(1, 2, width_ratios=(1, 1))
    things = {int(data.body(o.name).id): k for k, o in enumerate(world.objects) if o.present}
    for table in world.tables:
        if table.present:
            _draw_table(axes, table)
    shadows: dict[int, list[np.ndarray]] = {}  # of each object
    for g in range(model.ngeom):
        k, points = things.get(int(model.body_rootid[model.geom_bodyid[g]])), None
        if model.geom(g).name not in skip and (k is not None or model.geom_rgba[g, 3] > 0):
            points = outline(model, data, g)
        if points is not None:
            _draw_shadow(axes, points, k)
        if points is not None and k is not None:
            shadows.setdefault(k, []).append(points)
    for k, points in shadows.items():
        middle, top = np.concatenate(points).mean(0), np.concatenate(points).max(0)[1]
        _label(axes, (middle[0], top), world.objects[k].name, size=8)
    for centre, radius in circles:
        axes.add_patch(patches.Circle(centre, radius, fill=False, ec=_REACH, ls="--", lw=1.5, zorder=6))
        _label(axes, (centre[0], centre[1] + radius), f"reach {radius:.3g} m", size=8, color=_REACH)
    for name, centre in centres.items():
        axes.plot(*centre, "+", color="black", ms=10, mew=1.5, zorder=7)
        _label(axes, centre, name, size=8)
    edges = [_corners(t) for t in world.tables if t.present] + [np.reshape(list(centres.values()), (-1, 2))]
    edges += [np.asarray(centre) + radius * np.array([[-1, -1], [1, 1]]) for centre, radius in circles]
    edges += [p for points in shadows.values() for p in points]
    low, high = np.concatenate(edges).min(0), np.concatenate(edges).max(0)
    room = 0.08 * max(*(high - low), 0.5)
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + 1.5 * room))
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title=title)
    axes.grid(color="0.85", lw=0.5)
    axes.set_axisbelow(True)
    notes.axis("off")
    notes.text(0, 1, _numbers(world, data, centres), va="top", family="monospace", size=9.5, transform=notes.transAxes)
    return figure


def _corners(table: Table) -> np.ndarray:
    """(4, 2) of a slab, counter-clockwise."""
    x, y = np.array(table.size[:2]) / 2
    turned = geometry.rotate_yaw(np.radians(table.yaw), np.array([[-x, -y], [x, -y], [x, y], [-x, y]]))
    return np.array(table.position[:2]) + turned


def _draw_table(axes: Axes, table: Table) -> None:
    corners, middle = _corners(table), np.array(table.position[:2])
    axes.add_patch(patches.Polygon(corners, fc="0.94", ec="0.3", lw=1.2, zorder=2))
    along = (corners[1] - corners[0]) / 2
    head = {"head_width": 0.03, "head_length": 0.04, "length_includes_head": True}
    axes.arrow(*middle, *along, fc="0.55", ec="0.55", lw=1, zorder=3, **head)
    _label(axes, (middle[0], corners[:, 1].max()), table.name, size=9, weight="bold")


def _draw_shadow(axes: Axes, points: np.ndarray, k: int | None) -> None:
    """Of object k, or of what else stands there."""
    if k is None:
        axes.add_patch(patches.Polygon(points, fc="0.5", ec="none", alpha=0.35, zorder=4))
    else:
        hatch = _HATCHES[k // len(PALETTE) % len(_HATCHES)]
        axes.add_patch(patches.Polygon(points, fc=PALETTE[k % len(PALETTE)], ec="black", lw=0.6, hatch=hatch, zorder=5))


def _label(axes: Axes, at: Sequence[float] | np.ndarray, text: str, **style: Any) -> None:
    """Text just above a point, legible on whatever is there."""
    halo = patheffects.withStroke(linewidth=2.5, foreground="white")
    axes.annotate(
        text,
        (at[0], at[1]),
        (0, 2),
        textcoords="offset points",
        ha="center",
        va="bottom",
        path_effects=[halo],
        zorder=8,
        **style,
    )


def _numbers(world: World, data: mujoco.MjData, centres: dict[str, np.ndarray]) -> str:
    head = ("table", "size [m]", "yaw [deg]", "top at z [m]", "")
    rows = [
        (t.name, f"{t.size[0]:.3f} x {t.size[1]:.3f}", f"{t.yaw:.1f}", f"{t.position[2]:.3f}", "legs" if t.legs else "")
        if t.present
        else (t.name, "absent", "", "", "")
        for t in world.tables
    ]
    shown = columns([head, *rows])
    if not world.objects:
        return shown
    head = ("object", "on", "size [m]", f"from {next(iter(centres)) if len(centres) == 1 else 'nearest +'} [m]")
    rows = []
    for o in world.objects:
        if o.present:
            away = min(np.linalg.norm(data.body(o.name).xpos[:2] - centre) for centre in centres.values())
            rows.append((o.name, o.table, " x ".join(f"{x:.3f}" for x in o.size), f"{away:.3f}"))
        else:
            rows.append((o.name, "absent", "", ""))
    return f"{shown}\n\n{columns([head, *rows])}"
