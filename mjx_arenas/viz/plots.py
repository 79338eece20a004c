"""Plots of what varies between worlds (host)."""

import itertools
import pathlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mjx_arenas import geometry
from mjx_arenas.files.output import whole
from mjx_arenas.furniture.part import Part
from mjx_arenas.furniture.standing import Standing, owners, standing
from mjx_arenas.params.params import ArenaParams, canonical, each, on_host
from mjx_arenas.record.record import Record
from mjx_arenas.spec.objects import COLOURS
from mjx_arenas.viz.describe import Column
from mjx_arenas.viz.samples import Sample

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINES = ("-", "--", ":", "-.", (0, (5, 1)), (0, (1, 1)))
PAIRS = 6  # numbers in a pair plot, at most
CELLS = 160  # of a heat map's longer side
DRAWN = 10_000  # worlds, at most


def write(folder: pathlib.Path, record: Record, columns: Sequence[Column], drawn: Sample) -> list[str]:
    """Writes histograms.png, coverage.png and, where two numbers vary, pairs.png; makes the folder.

    Args:
        folder: in one that exists.
        record: of the arena.
        columns: `tables.columns` of them.
        drawn: the worlds, of which the first `DRAWN` are drawn.

    Returns:
        The paths of the files.
    """
    valid, n_worlds = drawn.valid[:DRAWN], len(drawn.valid)
    columns = [c._replace(values=c.values[:DRAWN], there=c.there[:DRAWN]) for c in columns]
    params = each(lambda p: p[:DRAWN], drawn.params)
    of = f"{n_worlds:,} worlds" if n_worlds <= DRAWN else f"the first {DRAWN:,} of {n_worlds:,} worlds"
    of = f"{of}, {valid.sum():,} valid"
    figures = {}
    parts = [term.part for term in record.parts.furniture]
    if record.table_names or parts:
        figures["coverage"] = coverage(params, on_host(canonical(record.nominal)), record.table_names, of, parts=parts)
    if any(c.varies for c in columns):
        figures["histograms"] = histograms(columns, of)
    if sum(c.varies and c.rule.kind is float for c in columns) > 1:
        figures["pairs"] = pairs(columns, valid, of)
    folder.mkdir(exist_ok=True)
    for name, figure in figures.items():
        with whole(folder / f"{name}.png") as unfinished:
            figure.savefig(unfinished)
    return [str(folder / f"{name}.png") for name in figures]


def histograms(columns: Sequence[Column], of: str) -> "Figure":
    """How each number that varies is distributed over the worlds in which it is: a panel for each quantity, axis and unit.

    Args:
        columns: of W worlds.
        of: the worlds in words.
    """
    panels: dict[tuple[str, str, str], list[Column]] = {}
    for column in columns:
        if column.varies:
            panels.setdefault((column.quantity, column.axis, column.rule.unit), []).append(column)
    side = min(4, len(panels))
    rows = -(-len(panels) // side)
    figure, axes = _subplots(rows, side, (3.4 * side, 2.6 * rows + 0.6))
    for axis, ((quantity, name, unit), group) in zip(axes.flat, panels.items(), strict=False):
        _histogram(axis, group)
        axis.set_xlabel(" ".join(filter(None, (quantity.replace("_", " "), name, unit))))
        axis.set_ylabel("share of worlds")
    for axis in axes.flat[len(panels) :]:
        axis.set_visible(False)
    figure.suptitle(f"What varies between {of}")
    return figure


def _histogram(axis: Any, group: list[Column]) -> None:
    """The values of some items: a line for each, or, where there are too many to tell apart, one for all."""
    if group[0].rule.kind is not float:
        _shares(axis, group)
        return
    if len(group) > len(LINES):
        lines = [(f"all {len(group)}", np.concatenate([c.seen for c in group]))]
    else:
        lines = [(c.item, c.seen) for c in group]
    low, high = min(v.min() for _, v in lines), max(v.max() for _, v in lines)
    for (label, values), colour, line in zip(lines, COLOURS, LINES, strict=False):
        weights = np.full(len(values), 1 / len(values))
        own = (values.min(), values.max()) if values.max() > values.min() else (low, high)
        axis.hist(
            values,
            np.linspace(*own, 16),
            weights=weights,
            histtype="step",
            color=colour,
            linestyle=line,
            lw=1.6,
            label=label,
        )
    axis.set_ylim(0, 1.35 * axis.get_ylim()[1])
    axis.legend(fontsize=7, frameon=False, ncols=2, loc="upper right")


def _shares(axis: Any, group: list[Column]) -> None:
    """How often each item is true, or, for indices, has each value."""
    if group[0].rule.kind is bool:
        axis.bar([c.item for c in group], [c.seen.mean() for c in group], 0.6, color=COLOURS[0])
        axis.set_ylim(0, 1)
    else:
        values = np.unique(np.concatenate([c.seen for c in group]))
        width = 0.8 / len(group)
        for k, column in enumerate(group):
            shares = [(column.seen == value).mean() for value in values]
            hatch = ("", "//", "..", "xx")[k // len(COLOURS) % 4]
            left = np.arange(len(values)) + width * (k + 0.5) - 0.4
            axis.bar(left, shares, width, color=COLOURS[k % len(COLOURS)], hatch=hatch, label=column.item)
        axis.set_xticks(range(len(values)), [str(int(value)) for value in values])
        axis.set_ylim(0, 1.35 * axis.get_ylim()[1])
        axis.legend(fontsize=7, frameon=False, ncols=3)
    if max(len(c.item) for c in group) * len(group) > 24:
        axis.tick_params(axis="x", rotation=60)
    axis.tick_params(axis="x", labelsize=8)


def coverage(
    params: ArenaParams, nominal: ArenaParams, names: Sequence[str], of: str, parts: Sequence[Part] = ()
) -> "Figure":
    """Seen from above, in how many of the worlds a table or a part covers each place; dashed, where they are nominally.

    Args:
        params: (W, ...) of W worlds.
        nominal: of the arena.
        names: (T,) of the tables.
        of: the worlds in words.
        parts: of furniture.
    """
    n_worlds = len(params.table_rots)
    slabs = [_slabs(each(lambda p, i=i: p[i], params), parts) for i in range(n_worlds)]
    corners = np.concatenate([geometry.corners(*one[:3]).reshape(-1, 2) for one in slabs])
    low, high = corners.min(0) - 0.1, corners.max(0) + 0.1
    step = float((high - low).max()) / CELLS
    x, y = (np.arange(low[i], high[i] + step, step) for i in (0, 1))
    grid = np.stack(np.meshgrid(x[:-1] + step / 2, y[:-1] + step / 2), axis=-1)
    share = np.zeros(grid.shape[:2])
    for one in slabs:
        share += _covered(grid, one)
    share /= n_worlds

    wide, tall = 6.4, 6.4 * float((high - low)[1] / (high - low)[0])
    figure, axes = _subplots(1, 1, (wide + 1.4, min(max(tall, 3.0), 10.0) + 1.0))
    axis = axes[0, 0]
    image = axis.pcolormesh(x, y, share, cmap="cividis", vmin=0, vmax=1)
    what = "a table or part" if parts else "a table"
    figure.colorbar(image, ax=axis, label=f"share of worlds with {what} here")
    outlines = geometry.corners(*_slabs(nominal, parts)[:3])
    labels: dict[tuple[float, float], list[str]] = {}
    for outline in outlines:
        closed = np.vstack([outline, outline[:1]])
        axis.plot(*closed.T, color="white", lw=2.4 if not parts else 1.4)
        axis.plot(*closed.T, color="black", lw=1.2 if not parts else 0.7, ls="--")
    of_slabs, names = (
        np.array([*range(len(names)), *(len(names) + i for i in owners(parts))]),
        [*names, *(p.name for p in parts)],
    )
    for i in dict.fromkeys(of_slabs.tolist()):
        own, name = outlines[of_slabs == i].reshape(-1, 2), names[i]
        x, y = ((own.min(0) + own.max(0)) / 2).round(6).tolist()
        labels.setdefault((x, y), []).append(name)
    boxed = {"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1.5}
    for place, called in labels.items():
        axis.text(*place, "\n".join(called), ha="center", va="center", bbox=boxed, fontsize=9)
    axis.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axis.set_title(f"Where tables {'and furniture ' * bool(parts)}stand in {of}\n(dashed: nominal)", fontsize=11)
    return figure


def pairs(columns: Sequence[Column], valid: np.ndarray, of: str) -> "Figure":
    """Pairs of the numbers that vary, a point for each world in which both are; crosses are worlds that are not valid.

    Args:
        columns: of W worlds, of which some that vary are drawn: from every quantity, of one table or object.
        valid: (W,) bool.
        of: the worlds in words.
    """
    varying = [c for c in columns if c.varies and c.rule.kind is float]
    shown = _of_every_quantity(varying)
    size = len(shown)
    figure, axes = _subplots(size, size, (2.1 * size + 0.8, 2.1 * size + 0.8), sharex="col")
    for (i, row), (j, column) in itertools.product(enumerate(shown), enumerate(shown)):
        axis = axes[i, j]
        if i == j:
            axis.hist(column.seen, 24, color=COLOURS[5], edgecolor="white", lw=0.3)
            axis.set_yticks([])
        else:
            there = row.there & column.there
            good, bad = ([c.values[there & which] for c in (column, row)] for which in (valid, ~valid))
            axis.scatter(*good, s=6, alpha=min(1.0, 300 / len(valid) + 0.1), color=COLOURS[0], lw=0)
            axis.scatter(*bad, s=18, marker="x", color=COLOURS[4], lw=1)
        axis.tick_params(labelsize=7, labelleft=j == 0 and i > 0)
        if i == size - 1:
            axis.set_xlabel(_label(column), fontsize=8)
        if j == 0:
            axis.set_ylabel(_label(row), fontsize=8)
    which = f"{size} of the {len(varying)} numbers that vary" if size < len(varying) else "the numbers that vary"
    crosses = "" if valid.all() else "; crosses: not valid"
    figure.suptitle(f"Pairs of {which},\nin {of}{crosses}", fontsize=min(11, 4 + 3 * size))
    return figure


def _of_every_quantity(varying: list[Column]) -> list[Column]:
    """The columns to plot, in their order: first one number of each quantity's first item, then a second, then those of the second item."""
    items: dict[str, dict[str, list[Column]]] = {}
    for column in varying:
        items.setdefault(column.quantity, {}).setdefault(column.item, []).append(column)
    rounds = itertools.zip_longest(*(by_item.values() for by_item in items.values()), fillvalue=())
    chosen = [c for groups in rounds for axes in itertools.zip_longest(*groups) for c in axes if c is not None]
    return sorted(chosen[:PAIRS], key=varying.index)


def _label(column: Column) -> str:
    name = " ".join(filter(None, (column.quantity.replace("_", " "), column.axis)))
    return f"{name} {column.rule.unit}\n{column.item}"


def _subplots(rows: int, columns: int, size: tuple[float, float], **options: Any) -> tuple["Figure", Any]:
    """A figure of its own, which needs no screen and is not kept by pyplot."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained", dpi=130)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def _slabs(world: ArenaParams, parts: Sequence[Part]) -> Standing:
    """The tables of one world, and the boxes of its furniture."""
    tables = Standing(world.table_offsets, world.table_rots, world.table_full_sizes, world.table_active)
    if not parts:
        return tables
    return Standing(*map(np.concatenate, zip(tables, standing(parts, world), strict=True)))


def _covered(grid: np.ndarray, slabs: Standing) -> np.ndarray:
    """Whether a slab of one world that is there covers each point (Y, X, 2) of a grid along x and y."""
    found, lines = np.zeros(grid.shape[:2], bool), (grid[0], grid[:, 0])
    outlines = geometry.corners(*slabs[:3])
    for t in np.flatnonzero(slabs.there):
        low, high, offset = outlines[t].min(0), outlines[t].max(0), slabs.top[t, :2]
        columns, rows = (slice(*np.searchsorted(line[:, i], (low[i], high[i]))) for i, line in enumerate(lines))
        # Turning is linear: what a point becomes is the sum of what its x and its y become.
        x, y = ((lines[i][part] - offset) * np.eye(2)[i] for i, part in enumerate((columns, rows)))
        x, y = (geometry.rotate_yaw(-slabs.rot[t], part) for part in (x, y))
        near = abs(x + y[:, None]) <= slabs.full_size[t, :2] / 2
        found[rows, columns] |= near[..., 0] & near[..., 1]
    return found
