"""What the writer knows of a compiled model beside the terms: what may move, and what of it takes no computing (host)."""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import jax
import mujoco
import numpy as np

from mjx_arenas import scales
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.terms.presence import Absent, Groups, absent
from mjx_arenas.terms.term import Bound, Boxed, Boxes, Depends, Term
from mjx_arenas.write.references import Heavy
from mjx_arenas.write.statistics import Rows
from mjx_arenas.write.trees import tendon_bodies, tree_roots

SAME = 1e-5  # of numbers in single precision, however they were computed, relative to themselves


@dataclasses.dataclass(frozen=True)
class Owned:
    """Elements that a term decides, and the quantities from which they follow."""

    term: str
    field: str
    elements: np.ndarray
    depends: Depends


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """A compiled model with the terms that vary it."""

    model: mujoco.MjModel
    terms: tuple[Bound, ...]
    owned: tuple[Owned, ...]
    groups: Groups
    boxes: Boxes | None  # of the nominal arena: which elements closed forms cover
    presence: Depends  # quantities that decide what is there
    all_there: bool  # nominally
    pinned: frozenset[str]  # fields that the MJCF gives: they do not follow
    names: dict[Depends, tuple[str, ...]] = dataclasses.field(default_factory=dict)  # that were found for quantities

    @classmethod
    def of(
        cls,
        model: mujoco.MjModel,
        terms: Sequence[Term],
        nominal: ArenaParams,
        groups: Groups,
        presence: Depends,
        all_there: bool,
        pinned: frozenset[str] = frozenset(),
    ) -> "Scene":
        """The scene of a compiled model.

        Raises:
            ValueError: two terms decide one element.
        """
        bound = tuple(term.bind(model) for term in terms)
        owned, boxes = [], []
        for term, one in zip(terms, bound, strict=True):
            rows = one.rows(nominal)
            owned += [Owned(term.name, row.field, row.elements.reshape(-1), row.depends) for row in rows]
            boxes += [one.boxes(nominal)] if isinstance(one, Boxed) else []
        assert len(boxes) < 2, "closed forms of two terms"
        _check_disjoint(model, owned)
        return cls(model, bound, tuple(owned), groups, boxes[0] if boxes else None, presence, all_there, pinned)

    @functools.cached_property
    def absent(self) -> dict[str, Absent]:
        """What absence makes of each field."""
        return absent(self.model, self.groups)

    @functools.cached_property
    def moves(self) -> np.ndarray:
        """(nbody,) bool: may stand elsewhere in another world."""
        model, found = self.model, self.groups.body >= 0
        for owned in self.owned:
            if owned.field in ("body_pos", "body_quat"):
                found[np.unique(owned.elements // getattr(model, owned.field).shape[1])] = True
        for b in range(1, model.nbody):  # parents come first
            found[b] |= found[model.body_parentid[b]]
        return found

    @functools.cached_property
    def moving_body(self) -> np.ndarray:
        """Ids of the bodies that may stand elsewhere in another world."""
        return np.flatnonzero(self.moves)

    @functools.cached_property
    def still(self) -> Rows:
        """What does not move."""
        return Rows.of(self.model, ~self.moves)

    @functools.cached_property
    def ball_geom(self) -> np.ndarray:
        """Geoms of moving bodies whose centres, origins and centres of mass are one: most objects'."""
        model = self.model
        body = model.geom_bodyid
        centred = ~model.geom_pos.any(1) & ~model.body_ipos[body].any(1) & (model.geom_rbound > 0)
        alone = np.bincount(body, minlength=model.nbody)[body] == 1
        return np.flatnonzero(centred & alone & self.moves[body] & ~np.isin(body, self._boxed.bodies))

    @functools.cached_property
    def _boxed(self) -> Boxes:
        none = np.zeros(0, int)
        return self.boxes or Boxes(none, none, none, np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))

    @functools.cached_property
    def rest(self) -> Rows:
        """What moves, beside what closed forms cover and `ball_geom`."""
        rows, boxed = Rows.of(self.model, self.moves), self._boxed
        known = np.concatenate([boxed.bodies, self.model.geom_bodyid[self.ball_geom]])
        return Rows(
            np.setdiff1d(rows.body, known),
            np.setdiff1d(rows.com, known),
            rows.joint,
            np.setdiff1d(rows.site, boxed.sites),
            np.setdiff1d(rows.geom, np.concatenate([boxed.geoms, self.ball_geom])),
        )

    @functools.cached_property
    def heavy(self) -> Heavy:
        """The bodies that have mass."""
        ids = np.flatnonzero(self.model.body_mass)
        return Heavy(ids, not self.model.body_ipos[ids].any())

    @functools.cached_property
    def aimed(self) -> dict[str, np.ndarray]:
        """Of "cam" and "light": (n, 2) body, target body or -1."""
        model = self.model
        return {
            "cam": np.stack([model.cam_bodyid, model.cam_targetbodyid], axis=-1),
            "light": np.stack([model.light_bodyid, model.light_targetbodyid], axis=-1),
        }

    @functools.cached_property
    def reflected_inertia(self) -> float:
        """What tendons with an armature add to `stat.meaninertia`, whose moments at `qpos0` no parameter changes."""
        model = self.model
        return float(model.stat.meaninertia - model.dof_M0.mean()) if model.tendon_armature.any() else 0.0

    @functools.cached_property
    def _known(self) -> dict[Depends, "Touched"]:
        return {}

    def touched(self, varying: Depends) -> "Touched":
        """What differs between worlds in which these quantities vary."""
        if varying not in self._known:
            self._known[varying] = self._touched(varying)
        return self._known[varying]

    def _touched(self, varying: Depends) -> "Touched":
        masks: dict[str, np.ndarray] = {}

        def mark(field: str, elements: np.ndarray) -> None:
            masks.setdefault(field, np.zeros(getattr(self.model, field).size, bool))[elements.reshape(-1)] = True

        for owned in self.owned:
            if owned.depends & varying:
                mark(owned.field, owned.elements)
        comes_and_goes = bool(self.presence & varying)
        for field, rows in self.absent.items() if comes_and_goes else ():
            mark(field, rows.elements)
        shaped: dict[str, np.ndarray] = {
            name: mask.reshape(getattr(self.model, name).shape) for name, mask in masks.items()
        }
        if "geom_size" in shaped:
            sized = np.asarray(shaped["geom_size"].any(-1))
            shaped |= {"geom_rbound": sized, "geom_aabb": sized}
        return Touched(self.model, shaped, comes_and_goes)


def of_another_world(scene: Scene, model: Any, varying: Depends, there: np.ndarray) -> list[str]:
    """Names of the fields of a template that are not nominal in elements that terms decide, and that are not written.

    Args:
        scene: of the arena.
        model: `mjx.Model`; of traced numbers nothing is said.
        varying: quantities that are written.
        there: (G + 1,) bool, the groups that nominally are, and true: what is not is moved away.
    """
    found: dict[str, None] = {}
    for owned in scene.owned:
        value, nominal = getattr(model, owned.field), getattr(scene.model, owned.field)
        if owned.depends & varying or isinstance(value, jax.core.Tracer):
            continue
        elements = owned.elements
        if owned.field in scene.absent:
            gone = scene.absent[owned.field]
            elements = np.setdiff1d(elements, gone.elements[~there[gone.groups].all(-1)])
        size = scales.scale(scene.model, owned.field, nominal).reshape(-1)[elements]
        off = np.abs(np.asarray(value).reshape(-1)[elements] - nominal.reshape(-1)[elements])
        if not (off <= SAME * size).all():
            found[owned.field] = None
    return list(found)


def _check_disjoint(model: mujoco.MjModel, owned: Sequence[Owned]) -> None:
    """Refuses two terms, or two rows of one, that decide the same element."""
    deciding: dict[str, np.ndarray] = {}
    for index, rows in enumerate(owned):
        taken = deciding.setdefault(rows.field, np.full(getattr(model, rows.field).size, -1))
        twice = rows.elements[taken[rows.elements] >= 0]
        if len(twice):
            other = owned[int(taken[twice[0]])].term
            where = element_name(model, rows.field, int(twice[0]))
            raise ValueError(f"Terms {other!r} and {rows.term!r} both decide {where}: leave it to one of them.")
        taken[rows.elements] = index


_KINDS = {
    "body": "body",
    "geom": "geom",
    "site": "site",
    "jnt": "joint",
    "cam": "camera",
    "light": "light",
    "mat": "material",
}
_KINDS |= {"actuator": "actuator", "tendon": "tendon", "eq": "equality", "pair": "pair", "key": "key"}


def element_name(model: mujoco.MjModel, field: str, element: int) -> str:
    """What messages call an element of a flattened field: its field and the name of what it belongs to."""
    array = getattr(model, field)
    index = element // max(1, array.size // max(1, array.shape[0]))
    kind = _KINDS.get(field.partition("_")[0])
    name = getattr(model, kind)(index).name if kind else ""
    return f"{field} of {kind} {name!r}" if name else f"{field}[{index}]"


@dataclasses.dataclass(frozen=True)
class Touched:
    """The elements that differ between worlds."""

    model: mujoco.MjModel
    masks: dict[str, np.ndarray]  # by field, in its shape; of bounds (ngeom,)
    comes_and_goes: bool  # what is there differs

    def any(self, *fields: str) -> bool:
        """Whether anything of these fields differs."""
        return any(name in self.masks and self.masks[name].any() for name in fields)

    def rows(self, field: str) -> np.ndarray:
        """(N,) bool, the rows of a field that differ."""
        mask = self.masks.get(field)
        if mask is None:
            return np.zeros(getattr(self.model, field).shape[0], bool)
        return np.asarray(mask.any(axis=tuple(range(1, mask.ndim))))

    @functools.cached_property
    def turned(self) -> np.ndarray:
        """(nbody,) bool: stands turned otherwise, itself or what carries it."""
        return self._carried(self.rows("body_quat"))

    @functools.cached_property
    def moved(self) -> np.ndarray:
        """(nbody,) bool: stands elsewhere, itself or what carries it."""
        return self._carried(self.rows("body_pos") | self.rows("body_quat"))

    def _carried(self, own: np.ndarray) -> np.ndarray:
        found, model = own.copy(), self.model
        found[model.jnt_bodyid] |= np.array([self._joint_moves(j) for j in range(model.njnt)], bool)
        for b in range(1, model.nbody):
            found[b] |= found[model.body_parentid[b]]
        return found

    def _joint_moves(self, joint: int) -> bool:
        """Whether a joint puts its body elsewhere: by its axis, its anchor, or a ball joint's nominal turn."""
        adr, kind = self.model.jnt_qposadr[joint], self.model.jnt_type[joint]
        qpos = self.rows("qpos0")[adr : adr + 4].any() and kind == mujoco.mjtJoint.mjJNT_BALL
        return bool(qpos or self.rows("jnt_pos")[joint] or self.rows("jnt_axis")[joint])

    @functools.cached_property
    def heavier_roots(self) -> np.ndarray:
        """First bodies of the trees whose inertia matrices differ.

        How a whole tree stands in the world does not matter, only how its bodies stand to each other.
        """
        model = self.model
        root = tree_roots(model)
        own = self.rows("body_mass") | self.rows("body_inertia") | self.rows("body_ipos") | self.rows("body_iquat")
        own[model.dof_bodyid[self.rows("dof_armature")]] = True
        inner = root != np.arange(model.nbody)
        own |= (self.rows("body_pos") | self.rows("body_quat")) & inner
        own[model.jnt_bodyid] |= self.rows("jnt_pos") | self.rows("jnt_axis")
        for tendon in np.flatnonzero(model.tendon_armature):  # what it reflects depends on where its ends stand
            bodies = tendon_bodies(model)[tendon]
            own[bodies] |= self.moved[bodies].any()
        return np.unique(root[own & (root >= 0)])
