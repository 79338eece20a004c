"""Draws the results that are there: `python -m benchmarks.plots [FOLDER]`."""

import json
import math
import pathlib
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from benchmarks.__main__ import RESULTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's colours, which colour-blind readers can tell apart; each also has a marker of its own.
STYLES = {
    "jax": ("#0072B2", "o", "impl='jax'"),
    "warp": ("#D55E00", "s", "impl='warp'"),
    "alone": ("#009E73", "^", "mujoco_warp alone"),
    "c": ("#000000", "D", "C MuJoCo, c_batch, all cores"),
    "randomize": ("#0072B2", "o", "randomize (compiled)"),
    "call": ("#56B4E9", "s", "arena.randomize(...), with its Python"),
    "copy": ("#000000", "", "roofline: device copy of the same bytes"),
}
Results = Mapping[str, Mapping[str, Any]]


def throughput(axes: "Axes", results: Results) -> None:
    """Steps against worlds, and the floor of each implementation."""
    rows = _rows(results, "throughput")
    for impl in dict.fromkeys(row["impl"] for row in rows):
        mine = [row for row in rows if row["impl"] == impl]
        _line(axes, impl, mine, "worlds", "steps_per_second")
        worlds, floor = zip(*((row["worlds"], row["floor_steps_per_second"]) for row in mine), strict=True)
        colour, _, label = STYLES[impl]
        axes.plot(worlds, floor, ":", color=colour, label=f"{label}: copy of what a step touches")
    _line(axes, "alone", _rows(results, "warp_alone"), "worlds", "alone_steps_per_second")
    _line(axes, "c", [r for r in _rows(results, "c_mujoco") if r["with"] == "c_batch"], "worlds", "steps_per_second")
    _scale(axes, "worlds", "world-steps a second", {row["worlds"] for row in rows})


def tables(axes: "Axes", results: Results) -> None:
    """Steps against tables, relative to the fewest."""
    for case in ("tables_jax", "tables_warp"):
        rows = _rows(results, case)
        for impl in dict.fromkeys(row["impl"] for row in rows):
            _line(axes, impl, rows, "tables", "steps_per_second", f", {rows[0]['worlds']:,} worlds")
    counts = {row["tables"] for case in ("tables_jax", "tables_warp") for row in _rows(results, case)}
    _scale(axes, "tables (three cubes on the first)", "world-steps a second", counts)


def randomize(axes: "Axes", results: Results) -> None:
    """Bytes written a second against worlds, under the roofline."""
    rows = [
        {**row, "call_gb_per_s": row["bytes_per_world"] * row["worlds"] / row["call_seconds"] / 1e9}
        for row in _rows(results, "randomize")
    ]
    _line(axes, "copy", rows, "worlds", "copied_gb_per_s")
    _line(axes, "randomize", rows, "worlds", "written_gb_per_s")
    _line(axes, "call", rows, "worlds", "call_gb_per_s")
    _scale(axes, "worlds of 3 tables", "bytes written a second [GB/s]", {row["worlds"] for row in rows})


PLOTS = {
    "throughput": (throughput, ("throughput",), "Steps of random worlds (3 tables, 3 cubes)"),
    "tables": (tables, ("tables_jax", "tables_warp"), "Steps with more and more tables"),
    "randomize": (randomize, ("randomize",), "Sampling and writing random worlds"),
}


def _rows(results: Results, case: str) -> list[dict[str, Any]]:
    return results.get(case, {}).get("rows", [])


def _line(axes: "Axes", style: str, rows: Sequence[Mapping[str, Any]], x: str, y: str, note: str = "") -> None:
    colour, marker, label = STYLES[style]
    if rows:
        line = "--" if style == "copy" else "-" if len(rows) > 1 else ""
        axes.plot([r[x] for r in rows], [r[y] for r in rows], line, marker=marker, color=colour, label=label + note)


def _scale(axes: "Axes", x: str, y: str, ticks: Iterable[int]) -> None:
    """Logarithmic axes: a tick at each measured x, whole decades of y."""
    from matplotlib.ticker import EngFormatter

    axes.set(xlabel=x, ylabel=y, xscale="log", yscale="log")
    axes.set_xticks(sorted(ticks), [f"{tick:,}" for tick in sorted(ticks)])
    axes.xaxis.minorticks_off()
    low, high = (math.log10(bound) for bound in axes.dataLim.intervaly)
    axes.set_ylim(10 ** math.floor(low), 10 ** math.ceil(high))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}" if value < 1000 else EngFormatter()(value))


def draw(folder: pathlib.Path) -> None:
    """One picture a plot and file of results."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    for path in (folder / "cpu.json", folder / "gpu.json"):
        results = json.loads(path.read_text()) if path.exists() else {}
        for name, (plot, cases, title) in PLOTS.items():
            present = [results[case] for case in cases if _rows(results, case)]
            if not present:
                continue
            figure, axes = pyplot.subplots(figsize=(7.5, 5), layout="constrained")
            plot(axes, results)
            first = present[0]
            device = first["device"] if first["platform"] != "cpu" else f"{first['cores']} cores, {first['cpu']}"
            axes.set_title(f"{title}\n{device}, {first['date']}", fontsize=11)
            axes.grid(alpha=0.3)
            figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=9)
            figure.savefig(folder / f"{path.stem}_{name}.png", dpi=110)
            pyplot.close(figure)


if __name__ == "__main__":
    draw(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else RESULTS)
