"""The elements of a model that are those of a world compiled without what is absent in it, by name (host)."""

import dataclasses
from collections.abc import Hashable, Mapping, Sequence

import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.preflight import elements
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.terms.presence import MARGIN

OWNERS = {
    "body": "body_parentid",
    "geom": "geom_bodyid",
    "site": "site_bodyid",
    "jnt": "jnt_bodyid",
    "cam": "cam_bodyid",
}
FREE = ("pair", "eq", "tendon", "actuator")  # on no body
_POSITIONS = {mujoco.mjtJoint.mjJNT_FREE: 7, mujoco.mjtJoint.mjJNT_BALL: 4}
_DOFS = {mujoco.mjtJoint.mjJNT_FREE: 6, mujoco.mjtJoint.mjJNT_BALL: 3}
_PLACES = (
    "id",
    "adr",
    "num",
    "simple",
    "simplenum",
)  # what integers of a model say of its other elements, by how they end

_OTHERS = ("geom_dataid", "geom_matid"), ("pair_geom1", "pair_geom2", "pair_signature", "exclude_signature")
"""Fields that end so and say something else, and those that end otherwise and say the same."""


@dataclasses.dataclass(frozen=True)
class Kept:
    """The rows of a model that has everything, in the order of a compiled one that lacks something."""

    rows: dict[str, np.ndarray]  # by kind of element: "body", "dof", "qpos", ...
    n_dofs: tuple[int, int]  # of the model, and of the compiled one

    @classmethod
    def of(cls, model: mjx.Model, put: mjx.Model, margin: np.ndarray, of: str) -> "Kept":
        """Looks up all elements of `put`, the compiled world on MJX.

        Args:
            model: with everything.
            put: without what is absent.
            margin: (ngeom,) of the geoms of `model` in that world.
            of: which world it is, where there are several, as messages say it.

        Raises:
            ValueError: it has what the model lacks, or lacks what is there.
        """
        rows, bodies = {}, (_keys(model, "body"), _keys(put, "body"))
        for kind in (*OWNERS, *FREE):
            own, wanted = (_keys(one, kind, keys) for one, keys in zip((model, put), bodies, strict=True))
            index = {key: i for i, key in enumerate(own)}
            if more := [i for i, key in enumerate(wanted) if key not in index]:
                told = {"of": of, "element": elements.called(put, kind, more[0])}
                raise error([problem("compiled", "compiled_has", None, None, told)])
            rows[kind] = np.array([index[key] for key in wanted], int)
        gone = np.setdiff1d(np.arange(len(margin)), rows["geom"])
        if len(there := gone[margin[gone] > MARGIN / 2]):
            told = {"of": of, "element": elements.called(model, "geom", int(there[0]))}
            raise error([problem("compiled", "compiled_lacks", None, None, told)])
        joints = rows["jnt"]
        rows["dof"] = _entries(model.jnt_dofadr, model.jnt_type, joints, _DOFS)
        rows["qpos"] = _entries(model.jnt_qposadr, model.jnt_type, joints, _POSITIONS)
        return cls(rows, (int(model.nv), int(put.nv)))

    def of_both(self, fields: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Fields of the model and of the compiled one, those of the model without what is absent; of what has no names where none is."""
        both = {name: (self._left(name, x), y) for name, (x, y) in fields.items() if _compares(name, y)}
        return {name: (x, y) for name, (x, y) in both.items() if np.shape(x) == np.shape(y)}

    def _left(self, field: str, value: np.ndarray) -> np.ndarray:
        if field == "stat.meaninertia":  # the mean is over the model's degrees of freedom, as the sum is what MJX uses
            return value * (self.n_dofs[0] / self.n_dofs[1]) if self.n_dofs[1] else value
        kind = field.partition("_")[0].removesuffix("0")
        return value[self.rows[kind]] if kind in self.rows else value


def _compares(field: str, value: np.ndarray) -> bool:
    """Whether a field says something of its elements, not how many there are or which others they go with; nothing of MJX's own does."""
    counts = not field.startswith(("opt.", "stat.")) and np.ndim(value) == 0
    places = (field.endswith(_PLACES) and field not in _OTHERS[0]) or field in _OTHERS[1]
    return not (counts or places or field.startswith("_impl."))


def _keys(model: mjx.Model, kind: str, bodies: Sequence[Hashable] = ()) -> list[Hashable]:
    """What tells the elements of a kind apart: their names, or which of the nameless ones of their body they are."""
    found: list[Hashable] = []
    counts: dict[Hashable, int] = {}
    geoms = _keys(model, "geom", bodies) if kind == "pair" and model.npair else []
    for i, name in enumerate(elements.names(model, kind)):
        if name or (kind == "body" and i == 0):
            found.append(name)
            continue
        owner: Hashable = None
        if kind == "pair":
            owner = (geoms[model.pair_geom1[i]], geoms[model.pair_geom2[i]])
        elif kind in OWNERS:
            of = int(np.asarray(getattr(model, OWNERS[kind]))[i])
            owner = found[of] if kind == "body" else bodies[of]
        counts[owner] = counts.get(owner, 0) + 1
        found.append((owner, counts[owner]))
    return found


def _entries(adr: np.ndarray, kinds: np.ndarray, joints: np.ndarray, widths: dict[mujoco.mjtJoint, int]) -> np.ndarray:
    """The entries of some joints in a vector of positions or velocities."""
    found = [adr[j] + np.arange(widths.get(mujoco.mjtJoint(kinds[j]), 1)) for j in joints]
    return np.concatenate(found).astype(int) if found else np.zeros(0, int)
