"""The elements of a model that differ between worlds, and what that means for its bodies and trees (host)."""

import dataclasses
import functools

import mujoco
import numpy as np

from mjx_arenas.named import field as field_of
from mjx_arenas.spec.hanging import hangs_on
from mjx_arenas.write.trees import tendon_bodies, tree_roots

_WRAP = mujoco.mjtWrap


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
            return np.zeros(field_of(self.model, field).shape[0], bool)
        return np.asarray(mask.any(axis=tuple(range(1, mask.ndim))))

    @functools.cached_property
    def turned(self) -> np.ndarray:
        """(nbody,) bool: stands turned otherwise, itself or what carries it."""
        return self._carried(self.rows("body_quat"))

    @functools.cached_property
    def moved(self) -> np.ndarray:
        """(nbody,) bool: stands elsewhere, itself or what carries it."""
        return self._carried(self.rows("body_pos") | self.rows("body_quat"))

    @functools.cached_property
    def reshaped(self) -> np.ndarray:
        """(nbody,) bool: its geoms, its joints or its children's may reach elsewhere from its centre of mass."""
        model, found = self.model, self.rows("body_ipos")
        found[model.geom_bodyid[self.rows("geom_size") | self.rows("geom_pos")]] = True
        hinged = self.rows("jnt_pos")
        found[model.jnt_bodyid[hinged]] = True
        inner = self.rows("body_pos") | self.rows("body_quat")
        inner[model.jnt_bodyid[hinged]] = True
        found[model.body_parentid[inner]] = True
        return found

    def _carried(self, own: np.ndarray) -> np.ndarray:
        found, model = own.copy(), self.model
        found[model.jnt_bodyid[self._displaces]] = True
        return hangs_on(model, np.flatnonzero(found)) >= 0

    @functools.cached_property
    def _displaces(self) -> np.ndarray:
        """(njnt,) bool: puts its body elsewhere at `qpos0`: a free joint, or the nominal turn of a ball joint about its anchor."""
        model, qpos0 = self.model, self.rows("qpos0")
        free, ball = model.jnt_type == mujoco.mjtJoint.mjJNT_FREE, model.jnt_type == mujoco.mjtJoint.mjJNT_BALL
        ends = model.jnt_qposadr + np.where(free, 7, 4)
        placed = np.array([qpos0[start:end].any() for start, end in zip(model.jnt_qposadr, ends, strict=True)], bool)
        return (free & placed) | (ball & (placed | self.rows("jnt_pos")))

    def reroutes(self, tendon: int) -> bool:
        """Whether something on the path of a tendon stands elsewhere, or a geom on it is of another size."""
        model, first = self.model, self.model.tendon_adr[tendon]
        if self.moved[tendon_bodies(model)[tendon]].any():
            return True
        path = slice(first, first + model.tendon_num[tendon])
        kind, index = model.wrap_type[path], model.wrap_objid[path]
        sites, round_ = index[kind == _WRAP.mjWRAP_SITE], np.isin(kind, (_WRAP.mjWRAP_SPHERE, _WRAP.mjWRAP_CYLINDER))
        side = np.round(model.wrap_prm[path][round_]).astype(int)
        sites, geoms = np.concatenate([sites, side[side >= 0]]), index[round_]
        on_sites = self.rows("site_pos")[sites].any()
        return bool(on_sites or any(self.rows(f"geom_{name}")[geoms].any() for name in ("pos", "quat", "size")))

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
        turned = self._displaces & (model.jnt_type == mujoco.mjtJoint.mjJNT_BALL)
        own[model.jnt_bodyid[turned | self.rows("jnt_pos") | self.rows("jnt_axis")]] = True
        for tendon in np.flatnonzero(model.tendon_armature).tolist():  # what it reflects depends on where its path runs
            own[tendon_bodies(model)[tendon]] |= self.rows("tendon_armature")[tendon] or self.reroutes(tendon)
        return np.unique(root[own & (root >= 0)])
