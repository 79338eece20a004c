"""Elements of an MJCF that vary by one of their attributes: a term for each attribute and selection of elements."""

import dataclasses
import functools
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.named import field
from mjx_arenas.params.params import ArenaParams, Selected
from mjx_arenas.problem import Problem, problem
from mjx_arenas.terms.attributes import ATTRIBUTES, KINDS, Attribute, Target
from mjx_arenas.terms.term import Row, TermQuantity, numbers


@dataclasses.dataclass(frozen=True, eq=False)
class Elements:
    """N elements of one kind, of which one attribute varies."""

    name: str  # of the quantity, and of the term
    attribute: str  # in `ATTRIBUTES`
    elements: tuple[str, ...]  # (N,) names; of the options, "option"
    mask: np.ndarray  # (N, ...) bool: which of the attribute's numbers vary
    base: mujoco.MjModel  # compiled from the spec in which the elements were prepared
    nominal: np.ndarray  # (N, ...) numbers of the arena as it was configured
    made: tuple[str, ...] = ()  # elements whose numbers the compiler made of others, until they were prepared
    in_mjcf: np.ndarray | None = None  # (N, 3) places as of `Selected`, also of terms that turn elements

    @property
    def content(self) -> tuple[Any, ...]:
        """What makes two terms equal, beside the model of the arena."""
        return self.name, self.attribute, self.elements, self.mask, self.nominal

    @property
    def kind(self) -> str:
        """The kind of the elements."""
        return self.attribute.partition(".")[0]

    @property
    def quantities(self) -> tuple[str, ...]:
        """The one quantity."""
        return (self.name,)

    @property
    def _attribute(self) -> Attribute:
        return ATTRIBUTES[self.attribute]

    @functools.cached_property
    def numbers(self) -> tuple[TermQuantity, ...]:
        """The same, with what rules need to know of it."""
        quantity, limits = self._attribute.quantity, self._attribute.limits
        quantity = quantity._replace(limits=limits(self.base, self._ids(self.base))) if limits else quantity
        places = self.in_mjcf if self.attribute.endswith(".pos") else None
        selected = Selected(quantity, self.elements, self.mask, units=self._units, in_mjcf=places)
        return (TermQuantity(self.name, self.attribute, selected, self.nominal),)

    @property
    def _units(self) -> tuple[str, ...]:
        """(N,) units of joints, such as "[rad]" of hinges and "[m]" of slides; () where they are all the same."""
        units = self._attribute.quantity.unit
        turning, _, sliding = units.partition(" or ")
        if self.kind != "joint" or not sliding:
            return ()
        own = {mujoco.mjtJoint.mjJNT_SLIDE: sliding, mujoco.mjtJoint.mjJNT_FREE: units}
        return tuple(own.get(kind, turning) for kind in self.base.jnt_type[self._ids(self.base)].tolist())

    def edit(self, spec: mujoco.MjSpec, params: ArenaParams) -> None:
        """Gives the elements of a spec the numbers of one world."""
        values = params.terms[self.name]
        if self._attribute.quantity.kind is float:
            values = np.where(self.mask, values, np.nan)  # which stays as it is
        for name, index, value in zip(self.elements, self._ids(self.base), values, strict=True):
            self._attribute.edit(in_spec(spec, self.kind, name), np.asarray(value), self.base, int(index))

    def unseen_on_jax(self, model: mujoco.MjModel) -> list[Problem]:
        """The first element that MJX on JAX would not see vary."""
        unseen = self._attribute.unseen_on_jax
        for name, index in zip(self.elements, self._ids(model), strict=True) if unseen else ():
            assert unseen is not None
            if why := unseen(model, int(index)):
                or_else = ", or a small number in the MJCF" if why.startswith("it is 0") else ""
                what = {"attribute": self.attribute, "kind": self.kind, "name": name, "why": why, "or_else": or_else}
                return [problem("model", "unseen_on_jax", None, None, what)]
        return []

    def bind(self, model: mujoco.MjModel) -> "BoundElements":
        """The elements' ids."""
        return BoundElements(self.name, model, self._ids(model), self.mask, self._attribute.targets, self.nominal)

    def _ids(self, model: mujoco.MjModel) -> np.ndarray:
        return ids_of(model, self.kind, self.elements)


@dataclasses.dataclass(frozen=True)
class BoundElements:
    """The elements in a compiled model."""

    name: str
    model: mujoco.MjModel
    ids: np.ndarray  # (N,)
    mask: np.ndarray  # (N, ...) which numbers vary
    targets: tuple[Target, ...]
    nominal: np.ndarray  # (N, ...)

    def rows(self, params: ArenaParams) -> list[Row]:
        """The attribute's numbers where the model has them."""
        rows = [self._row(target, params.terms[self.name]) for target in self.targets]
        return [row for row in rows if row.elements.size]

    @functools.cached_property
    def _dofs(self) -> tuple[np.ndarray, np.ndarray]:
        """Degrees of freedom of the joints, and which of them each is of."""
        of = self.model.dof_jntid
        dofs = np.flatnonzero(np.isin(of, self.ids))
        place = {int(joint): n for n, joint in enumerate(self.ids)}
        return dofs, np.array([place[int(j)] for j in of[dofs]], int)

    def _row(self, target: Target, values: Any) -> Row:
        rows, owner = (self.ids, np.arange(len(self.ids)))
        if target.at is not None:
            return self._at(target, target.at(self.model, self.ids), values)
        if target.per_dof:
            rows, owner = self._dofs
        elif target.free:
            return self._free_row(target, values)
        elif target.field.startswith(("qpos", "data.qpos")):
            rows = self.model.jnt_qposadr[self.ids]
        elif target.of is not None:
            owner = np.flatnonzero(target.of(self.model, self.ids))
            rows = self.ids[owner]
        array = field(self.model, target.field)
        array = array.reshape(1, -1) if target.field.startswith("opt.") else array
        every = np.arange(array.size).reshape(len(array), -1)[rows]
        return self._at(target, every if target.columns is None else every[:, list(target.columns)], values, owner)

    def _at(self, target: Target, at: np.ndarray, values: Any, owner: Any = slice(None)) -> Row:
        """The row at places (n, ...), each of which belongs to the element `owner` (n,)."""
        made = values if target.made is None else target.made(values, self.model, self.ids)
        if target.share:
            made = made / self.nominal.astype(made.dtype)
        source = numbers(made).reshape(len(self.ids), -1)[owner]
        kept = self.mask.reshape(len(self.ids), -1)[owner] if target.made is None else np.ones(at.shape, bool)
        return Row(target.field, at[kept], made, source[kept], frozenset({self.name}))

    def _free_row(self, target: Target, values: Any) -> Row:
        """Entries of `qpos` of the bodies that have a free joint."""
        model = self.model
        joint = model.body_jntadr[self.ids]
        free = np.flatnonzero(joint >= 0)
        free = free[model.jnt_type[joint[free]] == mujoco.mjtJoint.mjJNT_FREE]
        at = model.jnt_qposadr[joint[free]][:, None] + np.array(target.columns, int)
        made = values if target.made is None else target.made(values, model, self.ids)
        source, kept = numbers(made)[free], np.ones(at.shape, bool) if target.made else self.mask[free]
        return Row(target.field, at[kept], made, source[kept], frozenset({self.name}))


def in_spec(spec: mujoco.MjSpec, kind: str, name: str) -> Any:
    """An element of a spec; of the options, the options."""
    if kind == "option":
        return spec.option
    found = getattr(spec, kind, None)
    if found is not None:
        return found(name)
    return next(e for e in getattr(spec, KINDS[kind].listed) if e.name == name)


def names_of(model: mujoco.MjModel, kind: str) -> list[str]:
    """Names of all elements of a kind, "" of those that have none."""
    if kind == "option":
        return ["option"]
    return [getattr(model, kind)(i).name for i in range(getattr(model, KINDS[kind].width))]


def ids_of(model: mujoco.MjModel, kind: str, names: tuple[str, ...]) -> np.ndarray:
    """(N,) ids of elements by their names."""
    if kind == "option":
        return np.zeros(len(names), int)
    element = getattr(model, kind)
    return np.array([element(name).id for name in names], int)
