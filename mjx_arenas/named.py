"""Fields of models by their names, which may have a dot: `opt.gravity`, `stat.extent` (host)."""

import operator
from typing import Any

import mujoco
import numpy as np

WEIGHT = "geom_weight"
"""No field of a model: what geoms weigh, relative to the compiled ones, on bodies whose inertials follow from their geoms."""


def field(model: Any, name: str) -> Any:
    """A field of a model of MuJoCo or MJX; a number of MuJoCo's as an array without axes."""
    if name == WEIGHT:
        return np.ones(model.ngeom)
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
