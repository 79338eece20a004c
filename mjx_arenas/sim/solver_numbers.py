"""What MJX does otherwise with a contact's, limit's or equality's numbers for the solver (host): rows of `left_out.OTHERWISE`."""

from collections.abc import Callable

import mujoco
import numpy as np
from mujoco.mjx._src import collision_driver

from mjx_arenas.rules.sliding_rules import LEAST
from mjx_arenas.terms.attributes import ATTRIBUTES
from mjx_arenas.terms.attributes.attribute import IMPEDANCE, KINDS, SIGNS

BOTH, JAX = ("jax", "warp"), ("jax",)
C = "C MuJoCo (`c_world`, `c_batch`)"
WARP = f"use impl='warp' or {C}"


def disabled(model: mujoco.MjModel, flag: str) -> bool:
    """Whether the model has something disabled."""
    return bool(model.opt.disableflags & int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}")))


def collides(model: mujoco.MjModel) -> np.ndarray:
    """A mask of the geoms that can have contacts."""
    found = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    found[np.concatenate([model.pair_geom1, model.pair_geom2])] = True
    return found & (not disabled(model, "CONTACT"))


def _acts(model: mujoco.MjModel, kind: str, name: str) -> np.ndarray:
    """A mask, or one for all: where an attribute of a kind has an effect, in some world."""
    if kind == "geom":
        return collides(model)
    prefix = KINDS[kind].prefix
    if name.endswith("_limit"):
        return (getattr(model, f"{prefix}_limited") != 0) & (not disabled(model, "LIMIT"))
    if name.endswith("_friction"):
        rubs = model.tendon_frictionloss > 0
        if kind == "joint":
            rubs = np.isin(np.arange(model.njnt), model.dof_jntid[model.dof_frictionloss > 0])
        return rubs & (not disabled(model, "FRICTIONLOSS"))
    return np.array(not disabled(model, "EQUALITY" if kind == "equality" else "CONTACT"))


def _not(name: str, holds: Callable[[np.ndarray], np.ndarray]) -> Callable[[mujoco.MjModel], np.ndarray]:
    """A mask of the elements of whose numbers something does not hold, where they have an effect."""
    kind, _, attribute = name.partition(".")
    read = ATTRIBUTES[name].read
    assert read is not None

    def found(model: mujoco.MjModel) -> np.ndarray:
        rows = np.arange(getattr(model, KINDS[kind].width))
        return ~holds(read(model, rows)) & _acts(model, kind, attribute)

    return found


def _slips(of_pairs: bool) -> Callable[[mujoco.MjModel], np.ndarray]:
    """A mask of the geoms or pairs that have contacts with less sliding friction than MuJoCo gives any; of two geoms the first."""

    def found(model: mujoco.MjModel) -> np.ndarray:
        if of_pairs:
            return (model.pair_friction[:, 0] < LEAST) & (model.pair_dim > 1) & (not disabled(model, "CONTACT"))
        slips, low = np.zeros(model.ngeom, bool), model.geom_friction[:, 0] < LEAST
        for one, other, pair in collision_driver.geom_pairs(model) if low.any() else ():
            both = sorted((one, other), key=lambda geom: model.geom_priority[geom])
            both = both[1:] if model.geom_priority[both[0]] < model.geom_priority[both[1]] else both
            slides = model.geom_condim[both].max() > 1 and model.geom_friction[both, 0].max() < LEAST
            slips[both[0]] |= pair < 0 and slides
        return slips & (not disabled(model, "CONTACT"))

    return found


def _rising(solimp: np.ndarray) -> np.ndarray:
    """(N,) bool: the impedance does not fall with the distance."""
    return solimp[:, 0] <= solimp[:, 1]


_SIGNS = (
    "takes the `{}` of {{}} as it is, though one number is > 0 and the other is not, and MuJoCo takes its default: make both > 0, or "
    f"neither, or use {C}"
)
_FALLS = (
    f"computes the `{{}}` of {{{{}}}} otherwise than MuJoCo, as its dmin is above its dmax: exchange them, or use {C}"
)
_STEEP = (
    "computes the `{}` of {{}} otherwise than MuJoCo, as its width is 0: give dmin and dmax their mean, which MuJoCo takes then, or "
    f"{WARP}"
)
_SLIPS = (
    "has contacts of {} with a sliding friction below 1e-5, which MuJoCo takes for 1e-5: give it 1e-5 and the model an elliptic cone, or "
    f"{WARP}"
)
_SOLVED = (
    (SIGNS, SIGNS.holds, BOTH, _SIGNS),
    (IMPEDANCE, _rising, BOTH, _FALLS),
    (IMPEDANCE, IMPEDANCE.holds, JAX, _STEEP),
)
SOLVER = (
    ("geom", _slips(False), JAX, _SLIPS),
    ("pair", _slips(True), JAX, _SLIPS),
    *(
        (name.partition(".")[0], _not(name, holds), impls, does.format(name.partition(".")[2]))
        for together, holds, impls, does in _SOLVED
        for name, row in ATTRIBUTES.items()
        if row.quantity.together is together
    ),
)
"""Kind, mask of the elements, implementations, and what these do with one."""
