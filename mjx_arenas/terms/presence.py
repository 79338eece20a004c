"""Presence: what is absent touches nothing, is not drawn and has no mass, whatever it is otherwise.

Absent tables, with all that hangs on them, and absent objects are out of reach, high above. Where an absent thing is moved all
the same, its contacts are off, by a negative margin (the margins of two geoms add up).
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from mjx_arenas.geometry import HIDDEN_RGBA, Array, array_module
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.sample.placement import parked
from mjx_arenas.spec.hanging import hangs_on
from mjx_arenas.terms.term import Depends, Row, places

LIFT = 1000.0  # [m], added to a fixed thing's height: far from the floor, whose plane has no other side
MARGIN = -1e4  # [m], less than these: behind a wall or above a ceiling, which are planes, too
ARMATURE = 1.0  # of a free body without mass: nothing moves it, and the solver has something to divide by. Others keep what `dof_M0` is.


class Groups(NamedTuple):
    """What may be absent: G bodies with all that hangs on them, and S variants of objects, which are geoms of one body."""

    roots: np.ndarray  # (G,) bodies
    free: np.ndarray  # (G,) bool: parked; fixed ones are lifted
    moving: np.ndarray  # (G,) bool: together with what moves on them; a table on which something moves is never absent
    body: np.ndarray  # (nbody,) the group of each body; -1: always there
    geom: np.ndarray  # (ngeom,) the group of the variant that each geom is of, from G on; -1: of none

    @classmethod
    def of(
        cls,
        model: mujoco.MjModel,
        roots: np.ndarray,
        free: np.ndarray,
        moving: np.ndarray,
        slots: Sequence[Sequence[str]],
    ) -> "Groups":
        """The groups of bodies, which may stand in each other, and of variants, by the names of their geoms."""
        geom = np.full(model.ngeom, -1)
        for index, names in enumerate(slots):
            geom[[model.geom(name).id for name in names]] = len(roots) + index
        return cls(roots, free, moving, hangs_on(model, roots), geom)

    @property
    def slots(self) -> bool:
        """Whether objects have variants."""
        return bool((self.geom >= 0).any())


@dataclasses.dataclass(frozen=True)
class Presence:
    """The term that takes things away: it decides no number of what is there."""

    bodies: tuple[str, ...]
    """(G,) names of those that may be absent, with all that hangs on them."""
    free: tuple[bool, ...]
    """(G,) which of them a free joint moves."""
    moving: tuple[bool, ...]
    """(G,) which of them can be absent together with what moves on them: all but tables."""
    slots: tuple[tuple[str, ...], ...]
    """(S,) names of the geoms of each variant of each object."""
    quantities: tuple[str, ...]
    wanted: Callable[[ArenaParams], Array]
    """(G + S,) bool of a world: what is to be there, unless it stands in something absent; NumPy or JAX."""
    name = "presence"

    def edit(self, spec: mujoco.MjSpec, params: ArenaParams) -> None:
        """Deletes what is absent, with all that refers to it and hangs on it."""
        self.remove(spec, np.asarray(self.wanted(params)))

    def gone(self, there: np.ndarray) -> tuple[list[str], list[str]]:
        """Names of the bodies and of the variants' geoms that are not `there`, (G + S,) bool."""
        n = len(self.bodies)
        bodies = [name for name, is_there in zip(self.bodies, there[:n], strict=True) if not is_there]
        slots = zip(self.slots, there[n:], strict=True)
        return bodies, [name for names, is_there in slots if not is_there for name in names]

    def remove(self, spec: mujoco.MjSpec, there: np.ndarray) -> None:
        """Deletes what is not `there`, (G + S,) bool, with all that refers to it and hangs on it."""
        names, geoms = self.gone(there)
        for pair in [p for p in spec.pairs if p.geomname1 in geoms or p.geomname2 in geoms]:
            spec.delete(pair)
        for name in geoms:
            spec.delete(spec.geom(name))
        gone = {body for name in names for body in with_all_on(spec, name)}
        for one in (*spec.cameras, *spec.lights):
            if one.targetbody in gone:
                one.mode, one.targetbody = mujoco.mjtCamLight.mjCAMLIGHT_FIXED if aims(one) else one.mode, ""
        for name in names:
            if (body := spec.body(name)) is not None:  # it was in another one that is gone
                spec.delete(body)

    def bind(self, model: mujoco.MjModel) -> "BoundPresence":
        """The same for a compiled model."""
        roots = np.array([model.body(name).id for name in self.bodies], int)
        groups = Groups.of(model, roots, np.array(self.free, bool), np.array(self.moving, bool), self.slots)
        within = np.zeros((len(roots), len(roots)), bool)
        for group, body in enumerate(roots):
            while body:
                within[group] |= roots == body
                body = model.body_parentid[body]
        return BoundPresence(groups, within, frozenset(self.quantities), self.wanted)


def with_all_on(spec: mujoco.MjSpec, name: str) -> set[str]:
    """Names of a body and of all that hangs on it."""
    return {body.name for body in (spec.body(name), *spec.body(name).find_all("body"))}


def aims(one: mujoco.MjsCamera | mujoco.MjsLight) -> bool:
    """Whether a camera or a light turns to a body."""
    modes = mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY, mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODYCOM
    return bool(one.targetbody) and one.mode in modes


class BoundPresence(NamedTuple):
    """What may be absent in a compiled model."""

    groups: Groups
    within: np.ndarray  # (G, G) bool: in which of the groups each of them is, itself among them
    quantities: Depends
    wanted: Callable[[ArenaParams], Array]

    def rows(self, params: ArenaParams) -> list[Row]:
        """None: it changes the rows of others (`absent`)."""
        return []

    def there(self, params: ArenaParams) -> Array:
        """(G + S,) bool: what is there in a world; NumPy or JAX. What stands in something absent is absent, too."""
        wanted, n = self.wanted(params), len(self.within)
        if not (self.within.sum(1) > 1).any():
            return wanted
        inner = (wanted[:n][None] | ~self.within).all(1)
        return array_module(wanted).concatenate([inner, wanted[n:]])


class Absent(NamedTuple):
    """What a field's elements become where their group is absent: `scale` times themselves plus `shift`."""

    elements: np.ndarray  # (n,) places in the flattened field
    groups: np.ndarray  # (n, g) of which all must be there; -1: nothing
    scale: np.ndarray  # (n,)
    shift: np.ndarray  # (n,)


def absent(model: mujoco.MjModel, groups: Groups) -> dict[str, Absent]:
    """What absence makes of each field of the compiled model."""
    geom_group = np.stack([groups.body[model.geom_bodyid], *([groups.geom] * groups.slots)], axis=-1)
    geoms, dof_group = np.flatnonzero((geom_group >= 0).any(-1)), groups.body[model.dof_bodyid]
    dofs = np.flatnonzero(_of(groups.moving, dof_group))
    armature = np.where(_of(groups.free, dof_group), ARMATURE, model.dof_M0)[dofs]
    fixed, free = groups.roots[~groups.free], groups.roots[groups.free]
    found = {
        "geom_margin": _rows(model.geom_margin, geoms, geom_group[geoms], 0.0, MARGIN),
        "geom_rgba": _rows(model.geom_rgba, geoms, geom_group[geoms], 0.0, np.array(HIDDEN_RGBA)),
        "dof_armature": _rows(model.dof_armature, dofs, dof_group[dofs], 0.0, armature),
        **_masses(model, groups),
    }
    seen = geoms[model.geom_matid[geoms] >= 0]  # rays pass through what has neither material nor colour
    found["geom_matid"] = _rows(model.geom_matid, seen, geom_group[seen], 0, -1)
    of_lights = groups.body[model.light_bodyid]
    lights = np.flatnonzero(of_lights >= 0)
    found["light_active"] = _rows(model.light_active, lights, of_lights[lights], 0, 0)
    pair = np.concatenate([geom_group[model.pair_geom1], geom_group[model.pair_geom2]], axis=-1)
    pairs = np.flatnonzero((pair >= 0).any(-1))
    found["pair_margin"] = _rows(model.pair_margin, pairs, pair[pairs], 0.0, MARGIN)

    lift = _rows(model.body_pos, fixed, groups.body[fixed], 1.0, LIFT * _up(model, fixed))
    spots = parked(len(free))
    found["body_pos"] = _joined(lift, _rows(model.body_pos, free, groups.body[free], 0.0, spots))
    adr = model.jnt_qposadr[model.body_jntadr[free]]
    entries = (adr[:, None] + np.arange(3)).reshape(-1)
    for name in ("qpos0", "qpos_spring"):
        found[name] = _rows(getattr(model, name), entries, np.repeat(groups.body[free], 3), 0.0, spots.reshape(-1))
    return {name: rows for name, rows in found.items() if len(rows.elements)}


def _up(model: mujoco.MjModel, bodies: np.ndarray) -> np.ndarray:
    """(n, 3) the world's z axis in the frames of what some bodies hang on."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return data.xmat[model.body_parentid[bodies]].reshape(-1, 3, 3)[:, 2]


def _masses(model: mujoco.MjModel, groups: Groups) -> dict[str, Absent]:
    """None: else the centre of mass of what is there would be far from it, and with it the precision of its steps."""
    gone = (model.body_weldid == 0) & (groups.body >= 0) | _of(groups.moving, groups.body)
    bodies = np.flatnonzero(gone & (model.body_mass > 0))
    fields = ("body_mass", "body_inertia")
    return {name: _rows(getattr(model, name), bodies, groups.body[bodies], 0.0, 0.0) for name in fields}


def _of(which: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Whether groups, -1 for none, are among `which`, (G,) bool."""
    return (group >= 0) & np.append(which, False)[group]


def _rows(field: np.ndarray, ids: np.ndarray, group: np.ndarray, scale: float, shift: float | np.ndarray) -> Absent:
    elements = places(field.shape, ids)
    group = group if group.ndim == 2 else group[:, None]
    shifts = np.broadcast_to(np.asarray(shift, float), elements.shape)
    if elements.ndim > 1:
        group = np.repeat(group, elements.shape[1], axis=0)
    return Absent(elements.reshape(-1), group, np.full(elements.size, scale), shifts.reshape(-1))


def _joined(a: Absent, b: Absent) -> Absent:
    return Absent(*(np.concatenate(pair) for pair in zip(a, b, strict=True)))
