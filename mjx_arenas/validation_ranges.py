"""Answers to bad ranges (host); numbers that are being traced are left to the device's `valid` flag."""

import warnings

import jax
import numpy as np

from mjx_arenas.distributions import Bernoulli, Choice, Distribution, Fixed
from mjx_arenas.params import ArenaParams, ArenaRanges
from mjx_arenas.validation import of_tables, show


def ranges_problems(ranges: ArenaRanges, nominal: ArenaParams) -> list[str]:
    """What is wrong with the distributions, or could be with a draw."""
    problems, bounds = [], {}
    for quantity, dist in ranges._asdict().items():
        value = np.asarray(getattr(nominal, quantity))
        if dist is None:
            bounds[quantity] = (value, value)
            continue
        problems += _distribution_problems(quantity, dist, value)
        if not problems and not _traced(dist):
            bounds[quantity] = reach(dist, value)
    return problems or _reach_problems(bounds)


def reach(dist: Distribution, nominal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest value that a quantity, of `nominal`'s shape (T, ...), can take."""
    low, high = (np.broadcast_to(b, nominal.shape) for b in dist.support())
    if dist.relative == "add":
        return nominal + low, nominal + high
    if dist.relative == "scale":
        return np.minimum(nominal * low, nominal * high), np.maximum(nominal * low, nominal * high)
    return low, high


def warn_of_idle_friction(ranges: ArenaRanges, nominal: ArenaParams, condim: int) -> None:
    """Warns if torsional or rolling friction varies where contacts of dimension `condim` do not use it."""
    dist = ranges.table_frictions
    if dist is None or condim >= 6 or _traced(dist):
        return
    low, high = reach(dist, np.asarray(nominal.table_frictions))
    if np.any(low[:, 2 if condim == 4 else 1 :] != high[:, 2 if condim == 4 else 1 :]):
        idle = "rolling friction has" if condim == 4 else "torsional and rolling friction have"
        what = f"`ranges.table_frictions` varies more than has an effect: with table_condim={condim}, {idle} none."
        warnings.warn(what, stacklevel=4)


def _traced(dist: Distribution) -> bool:
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(dist))


def _distribution_problems(quantity: str, dist: object, nominal: np.ndarray) -> list[str]:
    where = f"`ranges.{quantity}`"
    if not isinstance(dist, Distribution):
        return [f"{where} must be a distribution such as Uniform(low, high), or None, got {dist!r}."]
    where += f" ({type(dist).__name__})"
    problems = _structure_problems(where, quantity, dist, nominal) or _number_problems(where, dist, nominal)
    if not problems and not _traced(dist):
        problems = [f"{where}: {problem}." for problem in dist.problems()]
    return problems


def _structure_problems(where: str, quantity: str, dist: Distribution, nominal: np.ndarray) -> list[str]:
    if quantity == "has_legs" and not isinstance(dist, (Bernoulli, Choice, Fixed)):
        return [f"{where}: true and false need Bernoulli, Choice or Fixed."]
    if quantity == "has_legs" and dist.relative is not None:
        return [f"{where}: true and false cannot be relative, got relative={dist.relative!r}."]
    if quantity != "has_legs" and isinstance(dist, Bernoulli):
        return [f"{where}: Bernoulli gives true or false; it serves `has_legs` only."]
    if dist.relative not in (None, "add", "scale"):
        return [f"{where}: `relative` must be None, 'add' or 'scale', got {dist.relative!r}."]
    tied = np.asarray(dist.tied)
    if tied.dtype != bool or tied.shape not in ((), nominal.shape[1:]) or (tied.ndim and dist.per_table):
        return [f"{where}: `tied` must be true, false or one of them per axis, got {dist.tied!r}."]
    return []


def _number_problems(where: str, dist: Distribution, nominal: np.ndarray) -> list[str]:
    problems = []
    shape = nominal.shape[1:] if dist.per_table else nominal.shape
    for path, leaf in jax.tree_util.tree_leaves_with_path(dist):
        name = path[0].name
        if len(path) > 1 or not (np.isscalar(leaf) or hasattr(leaf, "shape")):
            problems.append(f"{where}: `{name}` must be numbers in a regular array, got {show(getattr(dist, name))}.")
            continue
        given = np.shape(leaf)[1:] if dist.per_table else np.shape(leaf)
        if not isinstance(leaf, jax.core.Tracer):
            array = np.asarray(leaf)
            if array.dtype.kind not in "biuf":
                problems.append(f"{where}: `{name}` must be numbers, got {show(leaf)}.")
                continue
            if not np.all(np.isfinite(array)):
                problems.append(f"{where}: `{name}` must be finite, got {show(leaf)}.")
        if not (dist.per_table and name == "p") and not _fits(given, shape):
            problems.append(f"{where}: `{name}` must be {_allowed(dist, nominal.shape)}, got shape {np.shape(leaf)}.")
    return list(dict.fromkeys(problems))


def _allowed(dist: Distribution, shape: tuple[int, ...]) -> str:
    if dist.per_table:
        return f"(N,) or (N, {shape[1]})" if shape[1:] else "(N,)"
    return f"one number, {shape[1:]} or {shape}" if shape[1:] else f"one number or {shape}"


def _fits(shape: tuple[int, ...], target: tuple[int, ...]) -> bool:
    try:
        return np.broadcast_shapes(shape, target) == target
    except ValueError:
        return False


def _reach_problems(bounds: dict[str, tuple[np.ndarray, np.ndarray]]) -> list[str]:
    """What some draw could do wrong, by the bounds of each quantity that are known."""
    problems = []
    for quantity, must in (("table_full_sizes", "> 0 on every axis [m]"), ("table_frictions", ">= 0 on every axis")):
        if quantity in bounds:
            low = bounds[quantity][0]
            bad = (low <= 0 if quantity == "table_full_sizes" else low < 0).any(-1)
            for of, t in of_tables(np.flatnonzero(bad), low):
                problems.append(f"`ranges.{quantity}`{of} can reach {show(low[t].round(6))}: it must stay {must}.")
    if {"table_offsets", "table_full_sizes", "has_legs"} <= bounds.keys():
        low, thick = bounds["table_offsets"][0][:, 2], bounds["table_full_sizes"][1][:, 2]
        bad = bounds["has_legs"][1].astype(bool) & (low <= thick / 2)
        for of, t in of_tables(np.flatnonzero(bad), np.stack([low, thick], axis=1)):
            problems.append(
                f"`ranges` can put the top{of} at z = {low[t]:g} m with a slab {thick[t]:g} m thick, which leaves no room for legs: "
                f"keep z > thickness / 2, or give `has_legs` a distribution that is always false."
            )
    return problems
