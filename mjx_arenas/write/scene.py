"""What the writer knows of a compiled model beside the terms: what may move, and what of it takes no computing (host)."""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import mujoco
import numpy as np

from mjx_arenas import scales, solids
from mjx_arenas.named import NOT_IN_MODEL, RATIO, WEIGHT
from mjx_arenas.named import field as field_of
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.solids import Solids
from mjx_arenas.spec.hanging import hangs_on
from mjx_arenas.terms.owned import Owned, element_name, owned_by
from mjx_arenas.terms.presence import Absent, BoundPresence, Groups, absent
from mjx_arenas.terms.term import Bound, Boxes, Depends, Term, places
from mjx_arenas.write.ratios import Ratios
from mjx_arenas.write.references import Heavy
from mjx_arenas.write.statistics import Rows
from mjx_arenas.write.touched import Touched

INERTIAL = ("body_mass", "body_ipos", "body_iquat", "body_inertia")
SAME = 1e-5  # of numbers in single precision, however they were computed, relative to themselves


class Given(NamedTuple):
    """What the MJCF says and the compiled model does not."""

    pinned: frozenset[str] = frozenset()
    """Names of the fields that it gives: they do not follow."""
    solids: Solids = solids.NONE
    """Geoms that vary on bodies without an inertial of their own, which follows from them."""
    placed: frozenset[str] = frozenset()
    """Names of the keyframes that have a `qpos` of their own; in the others all is at the world's `qpos0`."""
    led: frozenset[str] = frozenset()
    turned: frozenset[str] = frozenset()
    """Names of those that say where mocap bodies are, and how turned; in the others they stand as the world's bodies do."""
    ratios: tuple[int, ...] = ()
    """Ids of the position servos that have a `dampratio`."""


GIVEN_NOTHING = Given()


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """A compiled model with the terms that vary it."""

    model: mujoco.MjModel
    terms: tuple[Bound, ...]
    owned: tuple[Owned, ...]
    presence: BoundPresence
    boxes: Boxes | None  # of the nominal arena: which elements closed forms cover
    all_there: bool  # nominally
    given: Given
    names: dict[Depends, tuple[str, ...]] = dataclasses.field(default_factory=dict)  # that were found for quantities

    @classmethod
    def of(
        cls,
        model: mujoco.MjModel,
        terms: Sequence[Term],
        presence: BoundPresence,
        nominal: ArenaParams,
        given: Given = GIVEN_NOTHING,
    ) -> "Scene":
        """The scene of a compiled model.

        Raises:
            ValueError: two terms decide one element, or how far one body reaches.
        """
        bound = tuple(term.bind(model) for term in terms)
        owned = owned_by(model, terms, bound, nominal)
        all_there = bool(presence.wanted(nominal).all())
        return cls(model, bound, tuple(owned), presence, Boxes.of(bound, nominal), all_there, given)

    @property
    def groups(self) -> Groups:
        """What may be absent."""
        return self.presence.groups

    @functools.cached_property
    def starting(self) -> tuple[Bound, ...]:
        """The terms that vary what worlds start with."""
        names = {owned.term for owned in self.owned if owned.field.startswith("data.")}
        return tuple(t for t in self.terms if getattr(t, "name", None) in names)

    @functools.cached_property
    def ratios(self) -> Ratios:
        """The servos whose damping follows from a `dampratio`."""
        width, owned = self.model.actuator_biasprm.shape[-1], {"actuator_biasprm": set[int](), RATIO: set[int]()}
        for one in (one for one in self.owned if one.field in owned):
            owned[one.field].update(one.elements.reshape(-1).tolist())
        given = {at // width for at in owned["actuator_biasprm"] if at % width == 2} - owned[RATIO]
        return Ratios.of(self.model, self.given.ratios, given, owned[RATIO])

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
        return (hangs_on(model, np.flatnonzero(found)) >= 0) | self._reshaped

    @functools.cached_property
    def _reshaped(self) -> np.ndarray:
        """(nbody,) bool: its own geoms, sites, joints or centre of mass may stand elsewhere in its frame in another world."""
        model, found = self.model, np.zeros(self.model.nbody, bool)
        of = {"geom_size": model.geom_bodyid, "geom_pos": model.geom_bodyid, "geom_quat": model.geom_bodyid}
        of |= {"site_pos": model.site_bodyid, "jnt_pos": model.jnt_bodyid, "body_ipos": np.arange(model.nbody)}
        covered = self._boxed.bodies
        for owned in self.owned:
            if owned.field in of:
                found[of[owned.field][np.unique(owned.elements // getattr(model, owned.field).shape[1])]] = True
        found[self.given.solids.bodies] = True
        found[covered] = False
        return found

    def rigid(self, touched: Touched) -> np.ndarray:
        """Ids of the bodies to which their own geoms and joints, and their children's joints, stand as in the template."""
        model, group = self.model, self.groups.body
        other = touched.reshaped.copy()
        other[np.concatenate([self._boxed.bodies, model.geom_bodyid[self.ball_geom]])] = True  # known in closed form
        parent = model.body_parentid[model.jnt_bodyid]
        other[parent[group[parent] != group[model.jnt_bodyid]]] = True
        return np.flatnonzero(~other[1:]) + 1

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
        centred &= ~self._shifted[body]
        alone = np.bincount(body, minlength=model.nbody)[body] == 1
        return np.flatnonzero(centred & alone & self.moves[body] & ~np.isin(body, self._boxed.bodies))

    @functools.cached_property
    def _shifted(self) -> np.ndarray:
        """(nbody,) bool: the centre of mass, or a geom, may be elsewhere in the body's frame."""
        model, found = self.model, np.zeros(self.model.nbody, bool)
        of = {"geom_pos": model.geom_bodyid, "body_ipos": np.arange(model.nbody)}
        for owned in self.owned:
            if owned.field in of:
                found[of[owned.field][np.unique(owned.elements // 3)]] = True
        found[self.given.solids.bodies] = True
        found[self._boxed.bodies] = False
        return found

    @functools.cached_property
    def _boxed(self) -> Boxes:
        none = np.zeros(0, int)
        return self.boxes or Boxes(none, none, none, np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))

    @functools.cached_property
    def rest(self) -> Rows:
        """What moves, beside what closed forms cover and `ball_geom`."""
        return self._beside_closed_forms(self.moves)

    @functools.cached_property
    def every(self) -> Rows:
        """Everything beside that."""
        return self._beside_closed_forms(np.ones(self.model.nbody, bool))

    def _beside_closed_forms(self, bodies: np.ndarray) -> Rows:
        rows, boxed = Rows.of(self.model, bodies), self._boxed
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
        return Heavy(ids, not (self.model.body_ipos[ids].any() or self._shifted[ids].any()))

    @functools.cached_property
    def granted(self) -> dict[str, np.ndarray]:
        """The elements, by field, that are taken as compiled in any template, beside those of terms.

        For closed forms of how far bodies reach, for centres of mass that are origins, and for tendons without armatures.
        """
        model, boxed = self.model, self._boxed
        centred = self.heavy.ids if self.heavy.centred else np.zeros(0, int)
        ids = {
            "body_ipos": np.concatenate([boxed.bodies, model.geom_bodyid[self.ball_geom], centred]),
            "body_mass": np.setdiff1d(np.arange(model.nbody), self.heavy.ids),
            "geom_pos": np.concatenate([boxed.geoms, self.ball_geom]),
            "site_pos": boxed.sites,
            "tendon_armature": np.arange(0 if self.reflects else model.ntendon),
        }
        found = {name: places(getattr(model, name).shape, rows).reshape(-1) for name, rows in ids.items()}
        for owned in self.owned:
            if owned.field in found:
                found[owned.field] = np.setdiff1d(found[owned.field], owned.elements)
        return found

    @functools.cached_property
    def aimed(self) -> dict[str, np.ndarray]:
        """The bodies of "cam" and "light": (n, 2) body, target body or -1."""
        model = self.model
        return {
            "cam": np.stack([model.cam_bodyid, model.cam_targetbodyid], axis=-1),
            "light": np.stack([model.light_bodyid, model.light_targetbodyid], axis=-1),
        }

    @functools.cached_property
    def reflects(self) -> bool:
        """Whether tendons have armatures, which `stat.meaninertia` counts."""
        return bool(self.model.tendon_armature.any())

    @functools.cached_property
    def _known(self) -> dict[Depends, Touched]:
        return {}

    def _reweighed(self, masks: dict[str, np.ndarray]) -> np.ndarray:
        """The bodies whose inertials follow from geoms that differ."""
        geom = self.given.solids.geom
        touched = np.zeros(len(geom), bool)
        for name in ("geom_size", "geom_pos", "geom_quat", WEIGHT):
            if name in masks:
                touched |= masks[name][geom] if masks[name].ndim == 1 else masks[name][geom].any(-1)
        return np.unique(self.given.solids.body[touched])

    def touched(self, varying: Depends) -> Touched:
        """What differs between worlds in which these quantities vary."""
        if varying not in self._known:
            self._known[varying] = self._touched(varying)
        return self._known[varying]

    def _touched(self, varying: Depends) -> Touched:
        masks: dict[str, np.ndarray] = {}

        def mark(field: str, elements: np.ndarray) -> None:
            masks.setdefault(field, np.zeros(field_of(self.model, field).size, bool))[elements.reshape(-1)] = True

        for owned in self.owned:
            if owned.depends & varying:
                mark(owned.field, owned.elements)
        comes_and_goes = bool(self.presence.quantities & varying)
        for field, rows in self.absent.items() if comes_and_goes else ():
            mark(field, rows.elements)
        shaped: dict[str, np.ndarray] = {
            name: mask.reshape(field_of(self.model, name).shape) for name, mask in masks.items()
        }
        if "geom_size" in shaped:
            sized = np.asarray(shaped["geom_size"].any(-1))
            shaped |= {"geom_rbound": sized, "geom_aabb": sized}
        heavy = self._reweighed(shaped)
        for name in INERTIAL if len(heavy) else ():
            mask = shaped.setdefault(name, np.zeros(getattr(self.model, name).shape, bool)).copy()
            mask[heavy] = True
            shaped[name] = mask
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
        elements = owned.elements
        if owned.field in scene.absent:
            gone = scene.absent[owned.field]
            elements = np.setdiff1d(elements, gone.elements[~there[gone.groups].all(-1)])
        own = owned.depends & varying or owned.field in NOT_IN_MODEL
        if not own and _differs(scene, model, owned.field, elements):
            found[owned.field] = None
    return list(found)


def other_than_compiled(scene: Scene, model: Any, quantities: Depends) -> tuple[str, str] | None:
    """An element of a template that these quantities decide and that is not as compiled, and the quantity."""
    for owned in scene.owned:
        own = owned.depends & quantities
        if own and owned.field not in NOT_IN_MODEL and _differs(scene, model, owned.field, owned.elements):
            one = next(e for e in owned.elements.tolist() if _differs(scene, model, owned.field, np.array([e])))
            return element_name(scene.model, owned.field, one), min(own)
    return None


def not_as_compiled(scene: Scene, model: Any, names: Sequence[str]) -> list[str]:
    """Names of the fields of a template that are not as compiled where that is taken for granted, if these `names` are written."""
    if not any(name.startswith("stat.") or name.endswith("poscom0") for name in names):
        return []
    return [name for name, elements in scene.granted.items() if _differs(scene, model, name, elements)]


def _differs(scene: Scene, model: Any, field: str, elements: np.ndarray) -> bool:
    """Whether elements of a field are not those of the compiled model; not, as far as can be seen, where they are traced."""
    value, nominal = field_of(model, field), field_of(scene.model, field)
    if isinstance(value, jax.core.Tracer):
        return False
    if nominal.dtype.kind != "f":
        return bool((np.asarray(jax.device_get(value)) != nominal).reshape(-1)[elements].any())
    size = scales.scale(scene.model, field, nominal).reshape(-1)[elements]
    off = np.abs(np.asarray(jax.device_get(value)).reshape(-1)[elements] - nominal.reshape(-1)[elements])
    return not (off <= SAME * size).all()
