"""Other worlds, to hold an arena against: parameters that are all others (host)."""

import zlib
from collections.abc import Sequence

import numpy as np

from mjx_arenas import geometry, shapes
from mjx_arenas.params.params import ArenaParams, with_values
from mjx_arenas.spec import follow
from mjx_arenas.terms.parts import Parts
from mjx_arenas.terms.term import TermQuantity


def elsewhere(params: ArenaParams, parts: Parts, quantities: Sequence[str], far: float) -> ArenaParams:
    """Another world, in which these parameters of every table and object are others, and tables have legs that had none, where these fit.

    Each changes by numbers of its own: what follows from the difference of two would stay, if they changed alike.
    """
    kinds = parts.places.kind
    table, thing = (far * (1 + 0.37 * np.sqrt(np.arange(2, 2 + n))) for n in (len(params.table_rots), len(kinds)))
    sizes = params.table_full_sizes * (1 + 0.1 * table[:, None] * np.array([1.0, 1.3, 0.7]))
    offsets = params.table_offsets + table[:, None] * np.array([0.11, 0.07, 0.05])
    offsets[:, 2] = np.maximum(offsets[:, 2], np.maximum(sizes, params.table_full_sizes)[:, 2])
    grow = np.where(np.isin(kinds, shapes.PRIMITIVES), 1 + 0.1 * thing, 1.0)[:, None]
    other = params._replace(
        table_offsets=offsets,
        table_rots=params.table_rots + 0.3 * table,
        table_full_sizes=sizes,
        table_frictions=params.table_frictions * 1.1 + 0.01,
        has_legs=~params.has_legs,
        object_full_sizes=params.object_full_sizes * grow,
        object_masses=params.object_masses * (1 + 0.3 * thing),
        object_frictions=params.object_frictions * 1.1 + 0.01,
        object_rgba=params.object_rgba * 0.9,
        object_tables=(params.object_tables + 1) % len(parts.surfaces),
    )
    terms = {term.name: _other(params.terms[term.name], term, far) for term in parts.more}
    others = other._asdict() | terms
    world = _long_enough(with_values(params, {name: others[name] for name in quantities}), params, parts)
    fit = geometry.legs_fit(world.table_offsets, world.table_full_sizes, world.has_legs)
    sizes = world.table_full_sizes.copy()
    sizes[~fit, 2] = params.table_full_sizes[~fit, 2]
    return world._replace(has_legs=np.where(fit, world.has_legs, params.has_legs), table_full_sizes=sizes)


def _long_enough(world: ArenaParams, nominal: ArenaParams, parts: Parts) -> ArenaParams:
    """The world with tables nearer to the nominal ones where what follows them would be shorter than nothing."""
    while parts.follows and not (right := follow.long_enough(parts.follows, world)).all():
        short = sorted({one.table for one, is_right in zip(parts.follows, right, strict=True) if not is_right})
        tables = {name: getattr(world, name).copy() for name in ("table_offsets", "table_full_sizes")}
        for name, values in tables.items():
            values[short] = (values[short] + getattr(nominal, name)[short]) / 2
        world = world._replace(**tables)
    return world


def _other(values: np.ndarray, term: TermQuantity, far: float) -> np.ndarray:
    """Other numbers of N elements, within the limits: each changes by a share of its own, as no other quantity does."""
    quantity, mask = term.selected.quantity, term.selected.mask
    if quantity.kind is bool:
        return ~values
    if quantity.counts:  # the next one, or the one before
        step = np.where(quantity.right(values + np.sign(far)), np.sign(far), -np.sign(far))
        return np.where(mask, values + step, values)
    own = zlib.crc32(f"{term.name} {term.attribute}".encode()) / 2**32
    share = (0.1 + 0.037 * np.sqrt(np.arange(2, 2 + len(values)) + 3 * own)).reshape(-1, *(1,) * (values.ndim - 1))
    axes = 1 + 0.3 * ((np.arange(int(np.prod(values.shape[1:]))) * 0.618 + own) % 1).reshape(values.shape[1:])
    together = quantity.together
    if together is not None and together.ordered:  # wider, about another middle; never narrower than nothing
        width = values[:, 1:] - values[:, :1]
        width = np.where(width > 0, width, 0.3 * np.abs(values[:, 1:]) + 0.03)
        other = values + width * abs(far) * share * (1 + 0.3 * own) * np.array([-0.3, 1.0])
        return np.where(mask, other, values)

    def moved(by: np.ndarray) -> np.ndarray:
        step = np.where(values == 0, 0.3 * by * min(1.0, quantity.limits[1]), values * by)
        return np.where(mask, np.where(quantity.right(values + step), values + step, values - 0.5 * step), values)

    other = moved(far * share * axes)
    if quantity.together is None:
        return other
    right = quantity.together.holds(other)
    return np.where(
        right.reshape(-1, *(1,) * (values.ndim - 1)), other, moved(np.broadcast_to(far * share, values.shape))
    )
