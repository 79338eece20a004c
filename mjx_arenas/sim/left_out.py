"""What MuJoCo simulates and MJX leaves out without a word, whatever varies (host).

`tests/test_left_out.py` shows of each that MJX steps otherwise than C, and holds that nothing else of MJCF is left out.
"""

from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np

from mjx_arenas.spec import names
from mjx_arenas.terms.attributes.joints import damped

_BOTH, _JAX = ("jax", "warp"), ("jax",)
_C = "C MuJoCo (`c_world`, `c_batch`)"
_WARP = f"use impl='warp' or {_C}"


class LeftOut(NamedTuple):
    """An attribute of elements."""

    kind: str  # of the elements, as `MjModel` calls it
    attribute: str  # as MJCF calls it
    given: Callable[[mujoco.MjModel], np.ndarray]  # (N,) bool: which elements have it
    impls: tuple[str, ...]
    instead: str  # what to do


def _any(*fields: str, columns: slice = slice(None)) -> Callable[[mujoco.MjModel], np.ndarray]:
    """Which rows of fields have a number other than 0; MuJoCo before 4.0 has no `springyield`."""

    def given(model: mujoco.MjModel) -> np.ndarray:
        found = [np.asarray(getattr(model, name)) for name in fields if hasattr(model, name)]
        rows = [array.reshape(len(array), -1)[:, columns].any(axis=1) for array in found if len(array)]
        return np.any(rows, axis=0) if rows else np.zeros(0, bool)

    return given


def _of_dofs(field: str) -> Callable[[mujoco.MjModel], np.ndarray]:
    """Which joints have a degree of freedom whose row is not 0."""

    def given(model: mujoco.MjModel) -> np.ndarray:
        return np.isin(np.arange(model.njnt), model.dof_jntid[np.flatnonzero(_any(field)(model))])

    return given


def _sampled(model: mujoco.MjModel) -> np.ndarray:
    """Which sensors measure at intervals: those that keep samples."""
    return _any("sensor_interval")(model) & _any("sensor_history", columns=slice(1))(model)


def _dragged(model: mujoco.MjModel) -> np.ndarray:
    """Which geoms a medium drags by their own shapes."""
    medium = model.opt.density or model.opt.viscosity
    return _any("geom_fluid", columns=slice(1))(model) & bool(medium)


def _early(model: mujoco.MjModel) -> np.ndarray:
    """Which actuators act by the next activation: those that have one."""
    return _any("actuator_actearly")(model) & (model.actuator_dyntype != mujoco.mjtDyn.mjDYN_NONE)


def _has_disabled(model: mujoco.MjModel) -> bool:
    """Whether an actuator is of a group that is disabled; there are 31 groups that can be."""
    groups = model.actuator_group[(model.actuator_group >= 0) & (model.actuator_group <= 30)]
    return bool((model.opt.disableactuator & (1 << groups)).any())


_OWN = f"give its joint or tendon one, or use {_C}"
_DELAYED = f"use the `action_delay` of an ArenaEnv, or {_C}"
_SENSED = f"use the `observation_delay` of an ArenaEnv, or {_C}"
ELEMENTS = (
    LeftOut("actuator", "armature", _any("actuator_armature"), _BOTH, _OWN),
    LeftOut("actuator", "damping", damped, _JAX, "use impl='warp', or a joint's"),
    LeftOut("actuator", "delay", _any("actuator_delay"), _BOTH, _DELAYED),
    LeftOut("actuator", "actearly", _early, _JAX, _WARP),
    LeftOut("joint", "springyield", _any("jnt_springyield"), _BOTH, f"leave it at 0, or use {_C}"),
    LeftOut("tendon", "springyield", _any("tendon_springyield"), _BOTH, f"leave it at 0, or use {_C}"),
    LeftOut("joint", "stiffness", _any("jnt_stiffnesspoly"), _JAX, f"give it one number, or {_WARP}"),
    LeftOut("joint", "damping", _of_dofs("dof_dampingpoly"), _JAX, f"give it one number, or {_WARP}"),
    LeftOut("tendon", "stiffness", _any("tendon_stiffnesspoly"), _JAX, f"give it one number, or {_WARP}"),
    LeftOut("tendon", "damping", _any("tendon_dampingpoly"), _JAX, f"give it one number, or {_WARP}"),
    LeftOut("geom", "surfacevel", _any("geom_surfacevel"), _JAX, "use impl='warp'"),
    LeftOut("geom", "adhesion", _any("geom_adhesion"), _JAX, "use impl='warp'"),
    LeftOut("geom", "fluidshape", _dragged, _JAX, _WARP),
    LeftOut("pair", "adhesion", _any("pair_adhesion"), _JAX, "use impl='warp'"),
    LeftOut("sensor", "delay", _any("sensor_delay"), _BOTH, _SENSED),
    LeftOut("sensor", "interval", _sampled, _BOTH, _SENSED),
)
_FLAGS = int(mujoco.mjtDisableBit.mjDSBL_SPRING) | int(mujoco.mjtDisableBit.mjDSBL_DAMPER)
OPTIONS: tuple[tuple[Callable[[mujoco.MjModel], bool], tuple[str, ...], str], ...] = (
    (
        _has_disabled,
        _BOTH,
        f"leaves out the `actuatorgroupdisable` of <option>: delete these actuators, or use {_C}",
    ),
    (lambda model: model.opt.noslip_iterations > 0, _JAX, f"leaves out `noslip_iterations`: leave it at 0, or {_WARP}"),
    (
        lambda model: bool(model.opt.disableflags & _FLAGS),
        _JAX,
        f"takes the flags `spring` and `damper` for one, and leaves out gravity compensation and drag as well: {_WARP}",
    ),
)
"""Whether a model has it, where MJX does otherwise, and what MJX does."""
_PARTS = {"stiffness": "higher powers of the `stiffness`", "damping": "higher powers of the `damping`"}


def check(model: mujoco.MjModel, impl: str) -> None:
    """Refuses what an implementation of MJX would leave out.

    Raises:
        ValueError: the model has some of it.
    """
    for one in ELEMENTS:
        given = one.given(model) if impl in one.impls else np.zeros(0, bool)
        if given.any():
            powers = one.kind != "actuator" and one.attribute in _PARTS
            what = _PARTS[one.attribute] if powers else f"`{one.attribute}`"
            who = names.element(model, one.kind, int(np.argmax(given)))
            raise ValueError(f"impl={impl!r} of MJX leaves out the {what} of {who}: {one.instead}.")
    for has, impls, does in OPTIONS:
        if impl in impls and has(model):
            raise ValueError(f"impl={impl!r} of MJX {does}.")
