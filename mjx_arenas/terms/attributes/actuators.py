"""Actuators and equalities."""

import mujoco
import numpy as np

from mjx_arenas.terms.attributes.attribute import (
    LIGHTEST,
    between,
    impedance,
    number,
    only_on_warp,
    plain,
    reference,
)
from mjx_arenas.terms.attributes.gains import GAINS, written_twice
from mjx_arenas.terms.attributes.joints import damped, limits


def _several(model: mujoco.MjModel, index: int) -> str:
    """Why nothing varies that a model has for each control or output of an actuator, where one has several."""
    several = many(model)
    if not len(several):
        return ""
    return f"actuator {model.actuator(several[0]).name!r} has several controls or outputs: take an actuator for each"


def many(model: mujoco.MjModel) -> np.ndarray:
    """Ids of the actuators that have several controls or outputs."""
    return np.flatnonzero((model.actuator_ctrlnum != 1) | (model.actuator_outnum != 1))


def _adds_damping(model: mujoco.MjModel, index: int) -> str:
    """Why the gear of an actuator cannot vary."""
    why = "its `damping` goes with the square of it: give that to the joint or the tendon in the MJCF"
    return _several(model, index) or (why if damped(model)[index] else "")


def _no_crank(model: mujoco.MjModel, index: int) -> str:
    crank = model.actuator_trntype[index] == mujoco.mjtTrn.mjTRN_SLIDERCRANK
    return "" if crank else "it has no `cranksite`: vary `actuator.gear`"


def _no_muscle(model: mujoco.MjModel, index: int) -> str:
    muscle = model.actuator_gaintype[index] == mujoco.mjtGain.mjGAIN_MUSCLE
    muscle |= model.actuator_biastype[index] == mujoco.mjtBias.mjBIAS_MUSCLE
    return _several(model, index) or ("" if muscle else "it is no muscle, and no step reads it: take muscles")


def _no_ctrlrange(model: mujoco.MjModel, index: int) -> str:
    assert _CTRLRANGE.refused is not None
    return _several(model, index) or _CTRLRANGE.refused(model, index)


_CTRLRANGE = limits("actuator", "ctrlrange", "actuator_ctrlrange", "actuator_ctrllimited", "")
_GEAR = "first, second, third, fourth, fifth, sixth"
_PRM = ", ".join(map(str, range(10)))
ACTUATOR = {
    **GAINS,
    "actuator.gear": plain("actuator", "gear", number("actuator", _GEAR), refused=_adds_damping),
    "actuator.cranklength": plain(
        "actuator",
        "cranklength",
        number("actuator", "", "[m]", LIGHTEST),
        refused=_no_crank,
        unseen_on_jax=only_on_warp,
    ),
    "actuator.forcerange": limits(
        "actuator", "forcerange", "actuator_forcerange", "actuator_forcelimited", "[N] or [N m]"
    ),
    "actuator.ctrlrange": _CTRLRANGE._replace(refused=_no_ctrlrange),
    "actuator.actrange": limits("actuator", "actrange", "actuator_actrange", "actuator_actlimited", ""),
    "actuator.lengthrange": plain("actuator", "lengthrange", between("actuator", "[m] or [rad]"), refused=_no_muscle),
    "actuator.gainprm": plain("actuator", "gainprm", number("actuator", _PRM), refused=written_twice),
    "actuator.biasprm": plain("actuator", "biasprm", number("actuator", _PRM), refused=written_twice),
    "actuator.dynprm": plain("actuator", "dynprm", number("actuator", _PRM)),
}


def _given_data(model: mujoco.MjModel, ids: np.ndarray) -> np.ndarray:
    """(N, 11) bool: the numbers of equalities that no pose at `qpos0` and no site decides, without quaternions, whose length is 1.

    Those that are not given have no place in MJCF: the last six of joints and tendons, and all but the anchor of connections.
    """
    kind, data = model.eq_type[ids], model.eq_data[ids]
    sites, bodies = (model.eq_objtype[ids] == one for one in (mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtObj.mjOBJ_BODY))
    connects, welds = kind == mujoco.mjtEq.mjEQ_CONNECT, kind == mujoco.mjtEq.mjEQ_WELD
    column = np.arange(11)
    pose, quat = (column >= 3) & (column < 10), (column >= 6) & (column < 10)
    posed = welds & bodies & (data[:, 11] != 0)  # as MuJoCo marks them
    not_given = [
        (connects, column >= 3),
        ((kind == mujoco.mjtEq.mjEQ_JOINT) | (kind == mujoco.mjtEq.mjEQ_TENDON), column >= 5),
        (posed, pose),
        (welds & bodies, quat),
        (welds & sites, column < 10),
    ]
    return ~np.any([which[:, None] & columns for which, columns in not_given], axis=0)


def _no_numbers(model: mujoco.MjModel, index: int) -> str:
    """Why an equality has no numbers."""
    if "FLEX" in mujoco.mjtEq(model.eq_type[index]).name:
        return "it holds a flex, and has no numbers of its own"
    sites = model.eq_objtype[index] == mujoco.mjtObj.mjOBJ_SITE
    connects = model.eq_type[index] == mujoco.mjtEq.mjEQ_CONNECT
    return "it connects sites, and has no numbers of its own: vary `site.pos`" if sites and connects else ""


EQUALITY = {
    "equality.solref": plain("equality", "solref", reference("equality")),
    "equality.solimp": plain("equality", "solimp", impedance("equality")),
    "equality.data": plain(
        "equality",
        "data",
        number("equality", ", ".join(map(str, range(11)))),
        "eq_data",
        tuple(range(11)),
        used=_given_data,
        refused=_no_numbers,
    ),
}
