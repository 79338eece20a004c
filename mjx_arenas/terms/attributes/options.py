"""Options of the whole model."""

from typing import Any

import mujoco
import numpy as np

from mjx_arenas.params.params import LARGEST
from mjx_arenas.terms.attributes.attribute import LIGHTEST, XYZ, Attribute, Target, number


def _no_medium(model: mujoco.MjModel, index: int) -> str:
    medium = model.opt.density or model.opt.viscosity or model.opt.wind.any()
    why = "there is no medium, which MJX then leaves out: give the MJCF a density, a viscosity or a wind"
    return "" if medium else why


def _option(name: str, axes: str, unit: str, low: float = -LARGEST, refused: Any = None) -> Attribute:
    def read(model: mujoco.MjModel, ids: np.ndarray) -> np.ndarray:
        return np.array(getattr(model.opt, name), float)[None]

    def edit(element: Any, value: np.ndarray, model: mujoco.MjModel, index: int) -> None:
        setattr(element, name, np.where(np.isnan(value), getattr(element, name), value) if axes else float(value))

    return Attribute(number("option", axes, unit, low), (Target(f"opt.{name}"),), edit, read, refused=refused)


OPTIONS = {
    "option.timestep": _option("timestep", "", "[s]", LIGHTEST),
    "option.impratio": _option("impratio", "", "", LIGHTEST),
    "option.gravity": _option("gravity", XYZ, "[m/s^2]"),
    "option.wind": _option("wind", XYZ, "[m/s]", refused=_no_medium),
    "option.magnetic": _option("magnetic", XYZ, "[T]"),
    "option.density": _option("density", "", "[kg/m^3]", 0.0, _no_medium),
    "option.viscosity": _option("viscosity", "", "[Pa s]", 0.0, _no_medium),
}
