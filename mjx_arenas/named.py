"""Fields of models by their names, which may have a dot: `opt.gravity`, `stat.extent` (host)."""

import operator
from typing import Any

import mujoco
import numpy as np

WEIGHT = "geom_weight"
"""What geoms weigh, relative to the compiled ones, on bodies whose inertials follow from their geoms."""
RATIO = "actuator_dampratio"
"""Damping ratios of servos, relative to the compiled ones."""
NOT_IN_MODEL: dict[str, tuple[str, Any]] = {
    WEIGHT: ("ngeom", 1.0),
    RATIO: ("nactuator", 1.0),
    "data.qpos": ("nq", 0.0),
    "data.turn": ("nq", 0.0),
    "data.qvel": ("nv", 0.0),
    "data.eq_active": ("neq", False),
}
"""The numbers that terms decide and no model has: how many there are, and their nominal ones.

`data.qpos` and `data.qvel` are added to a start; `data.turn` turns its quaternions, which have the same places as in `qpos`.
"""


ON_WARP = frozenset({"geom_surfacevel", "geom_adhesion", "pair_adhesion", "mat_texrepeat", "mat_texuniform"})
"""What MJX has on Warp alone, in a part of its model for that."""


def field(model: Any, name: str) -> Any:
    """A field of a model of MuJoCo or MJX; a number of MuJoCo's as an array without axes."""
    if name in NOT_IN_MODEL:
        count, nominal = NOT_IN_MODEL[name]
        return np.full(getattr(model, count), nominal)
    if name in ON_WARP:
        model = getattr(model, "_impl", model)
    value = operator.attrgetter(name)(model)
    return np.asarray(value) if isinstance(value, (int, float)) else value


def put(model: mujoco.MjModel, name: str, elements: np.ndarray, values: np.ndarray) -> None:
    """Gives elements of a flattened field of a model of MuJoCo other values."""
    array = field(model, name)
    if array.ndim:
        array.reshape(-1)[elements] = values
        return
    owner, _, own = name.rpartition(".")
    if np.size(values):
        setattr(operator.attrgetter(owner)(model), own, float(np.reshape(values, -1)[-1]))
