"""What a term is: the definition of what varies on the host, and the rows of the model that it pushes on the device.

A term has its definition once, as an edit of the `MjSpec` in double precision, and the same numbers a second time as rows of
`mjx.Model`, from formulas that serve NumPy and JAX alike. The two are held against each other when an arena is compiled
(`record.proof`). What follows from the rows is no term's concern: `write.follows` has it.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol, TypeAlias, runtime_checkable

import mujoco
import numpy as np

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import ArenaParams, Quantity, Selected

Depends: TypeAlias = frozenset[str]


class Row(NamedTuple):
    """Elements of one field of `mjx.Model` in one world, and the numbers that they take."""

    field: str
    elements: np.ndarray  # (...) places in the flattened field
    values: Array  # (...) numbers, NumPy's or JAX's
    source: np.ndarray  # (...) for each element the place of its number in the flattened values
    depends: Depends  # names of the quantities from which the numbers follow


class Boxes(NamedTuple):
    """Closed forms of how far bodies reach: quicker than the points and spheres of which MuJoCo makes its statistics."""

    bodies: np.ndarray  # (n,) whose origins, centres of mass, sites and geoms are all covered
    sites: np.ndarray  # (m,) covered
    geoms: np.ndarray  # (g,) covered
    low: Array  # (n, 3) corners of the boxes around the spheres around their geoms [m]
    high: Array  # (n, 3)
    reach: Array  # (n,) from the centre of mass to the far end of the spheres [m]

    @classmethod
    def of(cls, terms: Sequence["Bound"], params: ArenaParams) -> "Boxes | None":
        """The boxes of all terms that know how far their bodies reach, in one world; None if none does."""
        found = [term.boxes(params) for term in terms if isinstance(term, Boxed)]
        if len(found) < 2:
            return found[0] if found else None
        bodies, sites, geoms, *reaches = zip(*found, strict=True)
        ids = [np.concatenate(one) for one in (bodies, sites, geoms)]
        return cls(*ids, *(array_module(*one).concatenate(one) for one in reaches))


class TermQuantity(NamedTuple):
    """A quantity of a term, beside those of tables and objects."""

    name: str
    attribute: str  # whose name folds the keys of draws; "body.active": its elements are bodies that come and go
    selected: Selected  # what rules need to know of it
    nominal: np.ndarray  # (N, ...)

    @classmethod
    def of(
        cls, name: str, attribute: str, elements: Sequence[str], quantity: Quantity, nominal: np.ndarray, part: str = ""
    ) -> "TermQuantity":
        """One all of whose numbers vary, of N elements by their names; `part` names the part of furniture that has it."""
        return cls(name, attribute, Selected(quantity, tuple(elements), np.ones(nominal.shape, bool), part), nominal)

    @property
    def elements(self) -> tuple[str, ...]:
        """(N,) names of what each is of; of presence those of the bodies."""
        return self.selected.elements


class Bound(Protocol):
    """A term of one compiled model: names have become ids."""

    def rows(self, params: ArenaParams) -> list[Row]:
        """All rows that the term decides in one world; NumPy or JAX."""
        ...


@runtime_checkable
class Boxed(Protocol):
    """A bound term that knows how far its bodies reach."""

    def boxes(self, params: ArenaParams) -> Boxes:
        """The boxes in one world; NumPy or JAX."""
        ...


class Term(Protocol):
    """What varies (host)."""

    @property
    def name(self) -> str:
        """What messages call it."""
        ...

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the parameters that are its own."""
        ...

    def edit(self, spec: mujoco.MjSpec, params: ArenaParams) -> None:
        """Gives the elements of a spec of the nominal arena the numbers of one world, as a user would, in double precision."""
        ...

    def bind(self, model: mujoco.MjModel) -> Bound:
        """The same for a compiled model."""
        ...


class Numbered(Protocol):
    """A term that has quantities beside those of tables and objects."""

    @property
    def numbers(self) -> tuple[TermQuantity, ...]:
        """These quantities, with their nominal numbers."""
        ...


def places(
    shape: Sequence[int], ids: np.ndarray, columns: Sequence[int] | np.ndarray | slice = slice(None)
) -> np.ndarray:
    """Places (n, c) of some columns of the rows `ids` (n,) in a flattened array of a shape (N, C), or (n,) in one of shape (N,)."""
    every = np.arange(int(np.prod(shape))).reshape(shape)
    return every[ids] if every.ndim == 1 else every[ids][:, columns]


def row(field: str, elements: np.ndarray, values: Array, depends: Depends, source: np.ndarray | None = None) -> Row:
    """A row whose elements take the numbers in order, or those at the places `source`, which broadcast."""
    found = np.arange(values.size).reshape(values.shape) if source is None else source
    return Row(field, elements, values, np.broadcast_to(found, elements.shape), depends)


def numbers(values: Array) -> np.ndarray:
    """The places (...) of the numbers of an array, to choose a `source` from."""
    return np.arange(values.size).reshape(values.shape)
