"""Gains of actuators by the shortcuts of MJCF: which one a compiled actuator was written by, and where its numbers are (host).

The compiler writes most of them more than once: `mjs_setToPosition` and the like in MuJoCo's `user_api.cc`.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np

from mjx_arenas.geometry import Array
from mjx_arenas.named import RATIO
from mjx_arenas.params.params import Quantity
from mjx_arenas.terms.attributes.attribute import (
    LIGHTEST,
    Attribute,
    Target,
    axis_joint,
    between,
    number,
    only_on_warp,
    setter,
)
from mjx_arenas.terms.attributes.joints import JOINT_TRN

_GAIN, _BIAS, _DYN = mujoco.mjtGain, mujoco.mjtBias, mujoco.mjtDyn
_MUSCLE = slice(0, 9)  # numbers of a muscle, the same in its gain and its bias


def shortcut(model: mujoco.MjModel, index: int) -> str:
    """The element of MJCF that compiles to an actuator's numbers; "general" where no other one does, "" where several do."""
    gain, bias = model.actuator_gainprm[index], model.actuator_biasprm[index]
    kinds = (model.actuator_gaintype[index], model.actuator_biastype[index])
    if kinds == (_GAIN.mjGAIN_FIXED, _BIAS.mjBIAS_NONE):
        return "adhesion" if model.actuator_trntype[index] == mujoco.mjtTrn.mjTRN_BODY else "motor"
    if kinds == (_GAIN.mjGAIN_SO3, _BIAS.mjBIAS_SO3):
        return "orientation" if gain[0] > 0 and bias[2] <= 0 else ""
    if kinds == (_GAIN.mjGAIN_MUSCLE, _BIAS.mjBIAS_MUSCLE):
        return "muscle" if (gain[_MUSCLE] == bias[_MUSCLE]).all() else "general"
    if kinds == (_GAIN.mjGAIN_AFFINE, _BIAS.mjBIAS_NONE) and not gain[:2].any():
        return "damper" if gain[2] <= 0 else "general"
    if kinds == (_GAIN.mjGAIN_FIXED, _BIAS.mjBIAS_AFFINE):
        return _servo(gain, bias, model.actuator_dyntype[index])
    if kinds == (_GAIN.mjGAIN_PID, _BIAS.mjBIAS_AFFINE):
        return "pid" if bias[1] < 0 and bias[2] <= 0 else ""
    return "general"


def _servo(gain: np.ndarray, bias: np.ndarray, dyntype: int) -> str:
    """The shortcut with a fixed gain and an affine bias."""
    if gain[0] > 0 and bias[0] == 0 and bias[1] == -gain[0] and bias[2] <= 0:
        return "position"
    if gain[0] > 0 and not bias[:2].any() and bias[2] == -gain[0] and dyntype == _DYN.mjDYN_NONE:
        return "velocity"
    if gain[0] == 0 and not bias[:2].any():
        return ""
    return "cylinder" if dyntype == _DYN.mjDYN_FILTER and gain[0] > 0 else "general"


class _Shortcut(NamedTuple):
    """What messages say of a shortcut."""

    called: str
    vary: str  # what to vary of it
    twice: bool = False  # whether the compiler writes a number both into the gain and into the bias


_SERVO = "`actuator.kp` and `actuator.kv`"
_SHORTCUTS = {
    "position": _Shortcut("a position servo", _SERVO, True),
    "orientation": _Shortcut("an orientation servo", _SERVO, True),
    "pid": _Shortcut("a PID controller", _SERVO),
    "velocity": _Shortcut("a velocity servo", "`actuator.kv`", True),
    "damper": _Shortcut("a damper", "`actuator.kv`"),
    "cylinder": _Shortcut("a cylinder", "`actuator.area`"),
    "muscle": _Shortcut("a muscle", "`actuator.force` or `actuator.scale`", True),
    "adhesion": _Shortcut("an `<adhesion>`", "`actuator.gain`"),
    "motor": _Shortcut("a motor", "`actuator.gainprm`"),
}


def described(model: mujoco.MjModel, index: int) -> str:
    """What messages call an actuator."""
    kind = _SHORTCUTS.get(shortcut(model, index))
    return kind.called if kind else "one of no shortcut of MJCF"


def written_twice(model: mujoco.MjModel, index: int) -> str:
    """Why the numbers of a gain or a bias cannot vary alone."""
    kind = _SHORTCUTS.get(shortcut(model, index))
    return f"it is {kind.called}: vary {kind.vary}" if kind and kind.twice else ""


class _Place(NamedTuple):
    """The place of a number of the actuators of some shortcuts."""

    name: str  # "gainprm" or "biasprm"
    columns: tuple[int, ...]
    shortcuts: tuple[str, ...]
    sign: float = 1.0

    @property
    def target(self) -> Target:
        """The same in a compiled model."""
        return Target(f"actuator_{self.name}", self.columns, _negative if self.sign < 0 else None, of=self.has)

    def has(self, model: mujoco.MjModel, ids: np.ndarray) -> np.ndarray:
        """(N,) bool: which actuators have it there."""
        return np.array([shortcut(model, int(i)) in self.shortcuts for i in ids], bool)


def _negative(values: Array, model: mujoco.MjModel, ids: np.ndarray) -> Array:
    return -values


def _attribute(
    name: str, quantity: Quantity, *places: _Place, idle: Callable[[np.ndarray], str] | None = None
) -> Attribute:
    """An attribute of actuators that have a number in one or more places; `idle` says of a gain why no step reads the number."""
    has = {kind for place in places for kind in place.shortcuts}

    def edit(element: Any, value: np.ndarray, model: mujoco.MjModel, index: int) -> None:
        for place in places:
            if shortcut(model, index) in place.shortcuts:
                setter(place.name, place.columns)(element, place.sign * value, model, index)

    def read(model: mujoco.MjModel, ids: np.ndarray) -> np.ndarray:
        found = np.zeros((len(ids), *quantity.item))
        for place in places:
            own = place.has(model, ids)
            values = getattr(model, f"actuator_{place.name}")[ids[own]][:, list(place.columns)]
            found[own] = place.sign * values.reshape(-1, *quantity.item) + 0.0  # no -0
        return found

    def refused(model: mujoco.MjModel, index: int) -> str:
        kind = shortcut(model, index)
        if kind in has:
            return idle(model.actuator_gainprm[index]) if idle else ""
        if not kind:
            return "its gain is 0, so its kind cannot be recognized: give it a small gain in the MJCF"
        if kind in _SHORTCUTS:
            return f"it is {_SHORTCUTS[kind].called}, which has no `{name}`: vary {_SHORTCUTS[kind].vary}"
        return f"its gain and bias are those of no shortcut of MJCF with a `{name}`: vary `actuator.gainprm` and `actuator.biasprm`"

    return Attribute(quantity, tuple(place.target for place in places), edit, read, refused=refused)


def _idle_force(gain: np.ndarray) -> str:
    given = gain[2] >= 0
    return (
        "" if given else "it is `scale` / `acc0`, as the MJCF gives none: vary `actuator.scale`, or give it a `force`"
    )


def _idle_scale(gain: np.ndarray) -> str:
    return "its `force` is given, and no step reads it: vary `actuator.force`" if gain[2] >= 0 else ""


def _of_muscles(
    name: str, quantity: Quantity, *columns: int, idle: Callable[[np.ndarray], str] | None = None
) -> Attribute:
    places = (_Place(where, columns, ("muscle",)) for where in ("gainprm", "biasprm"))
    return _attribute(name, quantity, *places, idle=idle)


def _beside_one(longer: bool) -> Quantity:
    """A length of a muscle, of which 1 is where it is strongest."""
    if longer:
        return number("actuator", "", "", 1.0)._replace(allowed=lambda x: x > 1, must="> 1")
    return number("actuator", "", "", 0.0, 1.0)._replace(allowed=lambda x: x < 1, must=">= 0 and < 1")


def along_one(model: mujoco.MjModel, index: int) -> bool:
    """Whether an actuator is on a hinge, a slide or a tendon, which have one inverse weight."""
    kind, target = int(model.actuator_trntype[index]), int(model.actuator_trnid[index, 0])
    return kind == mujoco.mjtTrn.mjTRN_TENDON or (kind in JOINT_TRN and not axis_joint(model, target))


def _rated(spec: mujoco.MjSpec, element: Any) -> str:
    """Why a servo has no `dampratio`, which a spec has as a positive damping."""
    return "" if element.biasprm[2] > 0 else "it has none in the MJCF: vary `actuator.kv`"


def _followed(model: mujoco.MjModel, index: int) -> str:
    """Why the damping of a servo does not follow from its ratio."""
    if shortcut(model, index) != "position":
        return "it is no position servo: vary `actuator.kv` or `actuator.gainprm`"
    along = along_one(model, index)
    return "" if along else "it is on no hinge, slide or tendon: give it a `kv`, and vary `actuator.kv`"


def _nominal_damping(values: Array, model: mujoco.MjModel, ids: np.ndarray) -> Array:
    """Times the ratio: with the nominal gain, gear and weight, from which the damping follows (`write.ratios`)."""
    return values * model.actuator_biasprm[ids, 2].astype(values.dtype)


def _area(values: Array, model: mujoco.MjModel, ids: np.ndarray) -> Array:
    """The area of a circle with a diameter, as the compiler computes it."""
    return np.pi / 4 * values * values


_SERVOS = ("position", "orientation")
_ANY = number("actuator", "", "", 0.0)
_POSITIVE = number("actuator", "", "", LIGHTEST)
_CYLINDER = _attribute("area", number("actuator", "", "[m^2]", LIGHTEST), _Place("gainprm", (0,), ("cylinder",)))
GAINS = {
    "actuator.kp": _attribute(
        "kp", _POSITIVE, _Place("gainprm", (0,), _SERVOS), _Place("biasprm", (1,), (*_SERVOS, "pid"), -1.0)
    ),
    "actuator.kv": _attribute(
        "kv",
        _ANY,
        _Place("gainprm", (0,), ("velocity",)),
        _Place("gainprm", (2,), ("damper",), -1.0),
        _Place("biasprm", (2,), (*_SERVOS, "pid", "velocity"), -1.0),
    ),
    "actuator.dampratio": Attribute(
        _ANY,
        (Target("actuator_biasprm", (2,), _nominal_damping, share=True), Target(RATIO, share=True)),
        setter("biasprm", (2,)),
        told=lambda element: float(element.biasprm[2]),
        refused=_followed,
        refused_in_spec=_rated,
    ),
    "actuator.area": _CYLINDER,
    "actuator.diameter": Attribute(
        number("actuator", "", "[m]", LIGHTEST),
        (Target("actuator_gainprm", (0,), _area),),
        lambda element, value, model, index: setter("gainprm", (0,))(element, np.pi / 4 * value * value, model, index),
        lambda model, ids: np.sqrt(4 / np.pi * model.actuator_gainprm[ids, 0]),
        refused=_CYLINDER.refused,
    ),
    "actuator.gain": _attribute("gain", _ANY, _Place("gainprm", (0,), ("adhesion",)))._replace(
        unseen_on_jax=only_on_warp
    ),
    "actuator.range": _of_muscles("range", between("actuator"), 0, 1),
    "actuator.force": _of_muscles("force", number("actuator", "", "[N]", 0.0), 2, idle=_idle_force),
    "actuator.scale": _of_muscles("scale", _POSITIVE, 3, idle=_idle_scale),
    "actuator.lmin": _of_muscles("lmin", _beside_one(longer=False), 4),
    "actuator.lmax": _of_muscles("lmax", _beside_one(longer=True), 5),
    "actuator.vmax": _of_muscles("vmax", _POSITIVE, 6),
    "actuator.fpmax": _of_muscles("fpmax", _POSITIVE, 7),
    "actuator.fvmax": _of_muscles("fvmax", _POSITIVE, 8),
}
"""The attributes of actuators, by MJCF's names, except those that a field has as they are."""
