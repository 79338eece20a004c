"""Bodies: their masses, and where they stand."""

from typing import Any

import mujoco
import numpy as np

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import Quantity
from mjx_arenas.terms.attributes.attribute import (
    LIGHTEST,
    TRIANGLE,
    XYZ,
    Attribute,
    Target,
    left_out,
    number,
    plain,
    positive,
    reader,
)
from mjx_arenas.terms.attributes.inertials import INERTIAL, has_mass
from mjx_arenas.terms.attributes.poses import poses
from mjx_arenas.terms.attributes.prepare import always, always_inferred, weighed


def _with_inertia(element: Any, value: np.ndarray, model: mujoco.MjModel, index: int) -> None:
    element.inertia = model.body_inertia[index] * (float(value) / model.body_mass[index])
    element.mass = float(value)


def _scaled_inertia(values: Array, model: mujoco.MjModel, ids: np.ndarray) -> Array:
    base = model.body_inertia[ids] / model.body_mass[ids][:, None]
    return values[:, None] * array_module(values).asarray(base, values.dtype)


def _lightest(model: mujoco.MjModel, ids: np.ndarray) -> tuple[float, float]:
    """Between which masses inertias that go along stay above what MuJoCo takes for one."""
    per_mass = (model.body_inertia[ids].min(-1) / model.body_mass[ids]).min()
    return max(LIGHTEST, LIGHTEST / per_mass), mujoco.mjMAXVAL


_WEIGHED: Any = {"prepare": weighed, "refused": has_mass, "refused_in_spec": always_inferred}
_MASS = Quantity("body", (), float, "", positive, "> 0 [kg]", (LIGHTEST, mujoco.mjMAXVAL))
BODY = {
    **poses("body"),
    "body.mass": Attribute(
        _MASS,
        (Target("body_mass"), Target("body_inertia", made=_scaled_inertia)),
        _with_inertia,
        reader("body_mass", None, True),
        limits=_lightest,
        **_WEIGHED,
    ),
    "body.mass_alone": plain("body", "mass", _MASS, **_WEIGHED),
    "body.inertia": plain(
        "body",
        "inertia",
        number("body", "first, second, third", "[kg m^2]", LIGHTEST, mujoco.mjMAXVAL)._replace(together=TRIANGLE),
        **_WEIGHED,
    ),
    "body.ipos": plain("body", "ipos", number("body", XYZ, "[m]"), ends_point=always, **_WEIGHED),
    **INERTIAL,
    "body.gravcomp": plain("body", "gravcomp", number("body", "", "", 0.0), unseen_on_jax=left_out("body_gravcomp")),
}
