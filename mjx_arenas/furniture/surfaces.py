"""What objects can stand on beside each other: tops of tables, then surfaces of furniture, NumPy or JAX. S surfaces, K objects."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mjx_arenas import geometry
from mjx_arenas.furniture import standing
from mjx_arenas.furniture.part import Part
from mjx_arenas.geometry import Array
from mjx_arenas.params.params import ArenaParams


class Surfaces(NamedTuple):
    """Level rectangles in one world, S, or those of K objects."""

    top: Array  # (S, 3) their middles, in the world [m]
    rot: Array  # (S,) yaw [rad]
    size: Array  # (S, 2) [m]
    there: Array  # (S,) bool
    round: Array  # (S,) bool: a disc of this size

    def of(self, index: Array) -> "Surfaces":
        """The surfaces with these indices (K,)."""
        return Surfaces(*(geometry.pick(x, index) for x in self))


def surfaces(params: ArenaParams, furniture: Sequence[Part]) -> Surfaces:
    """All of a world."""
    size, xp = params.table_full_sizes[:, :2], geometry.array_module(params.table_rots)
    found = [params.table_offsets, params.table_rots, size, params.table_active]
    if count(furniture):
        found = [xp.concatenate(pair) for pair in zip(found, standing.surfaces(furniture, params), strict=True)]
    top, rot, size, there = found
    return Surfaces(top, rot, size, there, xp.zeros(rot.shape, bool))


def count(furniture: Sequence[Part]) -> int:
    """How many surfaces there are beside tables."""
    return len(standing.surface_names(furniture))


def moving(furniture: Sequence[Part]) -> np.ndarray:
    """(S,) bool: a joint moves the surface of furniture."""
    return np.array([one.piece in part.moving for part in furniture for one in part.nominal_surfaces], bool)


def names(tables: Sequence[str], furniture: Sequence[Part]) -> list[str]:
    """(S,) of the tables' bodies and of the surfaces of furniture."""
    return [*tables, *standing.surface_names(furniture)]


def label(index: int, tables: Sequence[int], furniture: Sequence[Part]) -> str:
    """What messages call one of them; `tables` as they call these (`problem.numbered`)."""
    n = len(tables)
    return f"table {tables[index]}" if index < n else repr(standing.surface_names(furniture)[index - n])


def boxes(furniture: Sequence[Part]) -> np.ndarray:
    """The index of the box whose upper side each surface of furniture is; -1: none."""
    index = {name: i for i, name in enumerate(standing.names(furniture))}
    return np.array([index.get(name, -1) for name in standing.surface_names(furniture)], int)


def deciding(furniture: Sequence[Part]) -> frozenset[str]:
    """Names of the quantities that decide where the surfaces of furniture are."""
    return frozenset().union(*(placing(part, furniture) for part in furniture if part.nominal_surfaces))


def placing(part: Part, furniture: Sequence[Part]) -> frozenset[str]:
    """Names of the quantities that decide where a part's surfaces are."""
    own = frozenset(f"{part.name}.{name}" for name in part.parameters if name not in ("friction", "rgba"))
    return own | below(part, furniture)


def below(part: Part, furniture: Sequence[Part]) -> frozenset[str]:
    """Names of the quantities that decide where that is on which a part stands."""
    if part.beside is not None:
        (other,) = (one for one in furniture if one.name == part.beside)
        return placing(other, furniture) | {f"{part.name}.{name}" for name in (*part.own, "rot")}
    if part.on is None:
        return frozenset()
    if isinstance(part.on, str):
        return placing(furniture[standing.carrier(part.on, furniture)[0]], furniture)
    return frozenset({"table_offsets", "table_rots"})


def presence(furniture: Sequence[Part]) -> frozenset[str]:
    """Names of the quantities that decide which of them are there."""
    found = [f"{part.name}.active" for part in furniture if not part.stays]
    found += ["table_active"] * any(isinstance(part.on, int) for part in furniture)
    return frozenset([*found, *(f"{part.name}.pieces_active" for part in furniture if part.coming)])
