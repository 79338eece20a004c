"""Objects that are one of several in each world: which one, and the numbers that are its own (NumPy or JAX, one world at a time).

K objects, V variants of one of them.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import ArenaParams

NUMBERS = {
    "object_full_sizes": "full_size",
    "object_masses": "mass",
    "object_frictions": "friction",
    "object_rgba": "rgba",
}
"""The quantities of objects whose numbers are those of the variant, and what a variant has of each."""


class Variants(NamedTuple):
    """What the variants of one object are, each as MuJoCo compiles it alone (host)."""

    object: int  # its index
    quantity: str  # name of the quantity that says which one is there
    names: tuple[str, ...]  # (V,)
    geoms: tuple[tuple[str, ...], ...]  # (V,) names of the geoms of each
    colours: tuple[np.ndarray, ...]  # (V,) of (n, 4), by which the object's colour is multiplied
    kind: np.ndarray  # (V,) types
    full_size: np.ndarray  # (V, 3) [m]
    center: np.ndarray  # (V, 3) middle of the extents, in the body's frame [m]
    density: np.ndarray  # (V,) [kg/m^3]
    friction: np.ndarray  # (V, 3)
    rgba: np.ndarray  # (V, 4)
    mass: np.ndarray  # (V,) [kg]
    ipos: np.ndarray  # (V, 3) centre of mass, in the body's frame [m]
    iquat: np.ndarray  # (V, 4) principal axes
    inertia: np.ndarray  # (V, 3) principal moments at this mass [kg m^2]

    @property
    def all_geoms(self) -> tuple[str, ...]:
        """Names of the geoms of all variants."""
        return tuple(name for names in self.geoms for name in names)


def which(one: Variants, terms: Mapping[str, Array]) -> Array:
    """() the index of the variant that is there; of a number that is none, the nearest."""
    return nearest(terms[one.quantity][0], len(one.names))


def nearest(number: Array, n: Array | int) -> Array:
    """(...) the nearest index of `n` things to a number."""
    xp = array_module(number, n)
    return xp.clip(xp.nan_to_num(xp.round(number)), 0, n - 1).astype(int)


def of_chosen(variants: Sequence[Variants], terms: Mapping[str, Array], name: str, others: Array) -> Array:
    """(K, ...) a number of every object: of those with variants that of the variant that is there, else of `others` (K, ...)."""
    if not variants:
        return others
    xp = array_module(others, *(terms[one.quantity] for one in variants))
    others = xp.asarray(others)
    rows, start = list(range(len(others))), len(others)
    for one in variants:
        rows[one.object] = start + which(one, terms)
        start += len(one.names)
    table = xp.concatenate([others, *(xp.asarray(getattr(one, name), others.dtype) for one in variants)])
    return table[xp.stack([xp.asarray(row) for row in rows])]


def there(variants: Sequence[Variants], terms: Mapping[str, Array]) -> list[Array]:
    """(V,) bool of each object with variants: which of them is there."""
    return [np.arange(len(one.names)) == which(one, terms) for one in variants]


def with_own_numbers(params: ArenaParams, variants: Sequence[Variants]) -> ArenaParams:
    """The parameters with the sizes, masses, frictions and colours of the variants that are there."""
    own = {
        quantity: of_chosen(variants, params.terms, name, getattr(params, quantity))
        for quantity, name in NUMBERS.items()
    }
    return params._replace(**own)
