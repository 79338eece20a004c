"""What MuJoCo simulates and MJX leaves out, or does otherwise, without a word (host). What has no effect is no reason to refuse.

`tests/test_left_out.py` shows of each that MJX steps otherwise than C, and holds that nothing else of MJCF is left out.
"""

import copy
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import mujoco
import numpy as np

from mjx_arenas.named import put
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.sim.solver_numbers import BOTH, JAX, SOLVER, WARP, C, collides, disabled
from mjx_arenas.spec import names
from mjx_arenas.terms.attributes.joints import damped
from mjx_arenas.terms.attributes.poses import GEOM_WRAP


class LeftOut(NamedTuple):
    """An attribute of elements."""

    kind: str  # of the elements, as `MjModel` calls it
    attribute: str  # as MJCF calls it
    given: Callable[[mujoco.MjModel], np.ndarray]  # (N,) bool: which elements have it
    impls: tuple[str, ...]
    instead: str  # what to do


def _any(*fields: str, columns: slice = slice(None)) -> Callable[[mujoco.MjModel], np.ndarray]:
    """(N,) bool: which rows of fields have a number other than 0; (1,) for all, where MuJoCo has none, as no `springyield` before 4.0."""

    def given(model: mujoco.MjModel) -> np.ndarray:
        found = [np.asarray(getattr(model, name)) for name in fields if hasattr(model, name)]
        rows = [array.reshape(len(array), -1)[:, columns].any(axis=1) for array in found if len(array)]
        return np.any(rows, axis=0) if rows else np.zeros(1, bool)

    return given


def _of_dofs(field: str) -> Callable[[mujoco.MjModel], np.ndarray]:
    """A mask of the joints that have a degree of freedom whose row is not 0."""

    def given(model: mujoco.MjModel) -> np.ndarray:
        return np.isin(np.arange(model.njnt), model.dof_jntid[np.flatnonzero(_any(field)(model))])

    return given


def _yields(prefix: str) -> Callable[[mujoco.MjModel], np.ndarray]:
    """A mask of the joints or tendons that have a spring that gives way."""

    def given(model: mujoco.MjModel) -> np.ndarray:
        sprung = _any(f"{prefix}_stiffness", f"{prefix}_stiffnesspoly")(model) & (not disabled(model, "SPRING"))
        return _any(f"{prefix}_springyield")(model) & sprung

    return given


def _touching(field: str) -> Callable[[mujoco.MjModel], np.ndarray]:
    """A mask of the geoms that can have contacts and have a field."""

    def given(model: mujoco.MjModel) -> np.ndarray:
        return _any(field)(model) & collides(model)

    return given


def _sticky(model: mujoco.MjModel) -> np.ndarray:
    """A mask of the pairs of geoms that hold together."""
    return _any("pair_adhesion")(model) & (not disabled(model, "CONTACT"))


def _delayed(model: mujoco.MjModel) -> np.ndarray:
    """A mask of the sensors that tell what they measured before."""
    return _any("sensor_delay")(model) & (not disabled(model, "SENSOR"))


def _sampled(model: mujoco.MjModel) -> np.ndarray:
    """A mask of the sensors that measure at intervals: those that keep samples."""
    kept = _any("sensor_history", columns=slice(1))(model) & (not disabled(model, "SENSOR"))
    return _any("sensor_interval")(model) & kept


def _dragged(model: mujoco.MjModel) -> np.ndarray:
    """A mask of the geoms that a medium drags by their own shapes: those that can move."""
    moves = model.body_weldid[model.geom_bodyid] != 0
    return _any("geom_fluid", columns=slice(1))(model) & moves & _in_medium(model)


def _in_medium(model: mujoco.MjModel) -> bool:
    """Whether something drags; wind without a density or a viscosity does not."""
    return bool(model.opt.density or model.opt.viscosity)


def _early(model: mujoco.MjModel) -> np.ndarray:
    """A mask of the actuators that act by the next activation: those that have one."""
    return _any("actuator_actearly")(model) & (model.actuator_dyntype != mujoco.mjtDyn.mjDYN_NONE)


def _meeting(prefix: str) -> Callable[[mujoco.MjModel], np.ndarray]:
    """A mask of the joints or tendons that can be within the margins of both of their limits at once."""

    def given(model: mujoco.MjModel) -> np.ndarray:
        low, high = getattr(model, f"{prefix}_range").T
        margin, limited = getattr(model, f"{prefix}_margin"), getattr(model, f"{prefix}_limited") != 0
        one_axis = model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE) if prefix == "jnt" else True
        return limited & one_axis & (high - low < 2 * margin) & (not disabled(model, "LIMIT"))

    return given


def _in_stages(model: mujoco.MjModel) -> bool:
    """Whether a step has stages, at which the state is another one."""
    return model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4 and model.nv > 0


def _clocks(model: mujoco.MjModel) -> np.ndarray:
    return model.sensor_type == int(mujoco.mjtSensor.mjSENS_CLOCK)


_FRAMES = [int(getattr(mujoco.mjtSensor, f"mjSENS_FRAME{axis}")) for axis in ("POS", "QUAT", "XAXIS", "YAXIS", "ZAXIS")]
_BODY_OF = {
    int(mujoco.mjtObj.mjOBJ_GEOM): "geom_bodyid",
    int(mujoco.mjtObj.mjOBJ_SITE): "site_bodyid",
    int(mujoco.mjtObj.mjOBJ_CAMERA): "cam_bodyid",
}


def _stays(model: mujoco.MjModel, kinds: np.ndarray, ids: np.ndarray) -> np.ndarray:
    """(N,) bool: which objects of sensors no joint moves; those of id -1, too, which are none."""
    bodies = [
        max(i, 0) if kind not in _BODY_OF else getattr(model, _BODY_OF[kind])[i]
        for kind, i in zip(kinds.tolist(), ids.tolist(), strict=True)
    ]
    still = model.body_weldid[np.array(bodies, int)] == 0
    cameras = (ids >= 0) & (kinds == int(mujoco.mjtObj.mjOBJ_CAMERA))
    still[cameras] &= _looks_still(model)[ids[cameras]]
    return (ids < 0) | still


def _looks_still(model: mujoco.MjModel) -> np.ndarray:
    """(ncam,) bool: which cameras turn with nothing but their own body, and stay where it has them."""
    modes = [int(getattr(mujoco.mjtCamLight, f"mjCAMLIGHT_{mode}")) for mode in ("FIXED", "TRACK", "TARGETBODY")]
    at_rest = (model.cam_targetbodyid < 0) | (model.body_weldid[model.cam_targetbodyid] == 0)
    return np.isin(model.cam_mode, modes[:2]) | ((model.cam_mode == modes[2]) & at_rest)


def _measured(model: mujoco.MjModel) -> np.ndarray:
    """A mask of the sensors, beside clocks, that measure the state of a stage."""
    still = _stays(model, model.sensor_objtype, model.sensor_objid)
    still &= _stays(model, model.sensor_reftype, model.sensor_refid) & np.isin(model.sensor_type, _FRAMES)
    of_user = model.sensor_type == int(mujoco.mjtSensor.mjSENS_USER)
    return ~(still | of_user | _clocks(model)) & _in_stages(model) & (not disabled(model, "SENSOR"))


def _ticking(model: mujoco.MjModel) -> np.ndarray:
    """A mask of the clocks that tell the time of a stage."""
    return _clocks(model) & _in_stages(model) & (not disabled(model, "SENSOR"))


def _beside(model: mujoco.MjModel) -> np.ndarray:
    """A mask of the tendons that pass a geom whose `sidesite` is on another body."""
    sided = np.isin(model.wrap_type, GEOM_WRAP) & (model.wrap_prm >= 0)
    site = np.round(model.wrap_prm[sided]).astype(int)
    apart = np.flatnonzero(sided)[model.geom_bodyid[model.wrap_objid[sided]] != model.site_bodyid[site]]
    found = np.zeros(model.ntendon, bool)
    found[np.searchsorted(model.tendon_adr, apart, "right") - 1] = True
    return found


def _exactly(model: mujoco.MjModel) -> np.ndarray:
    """A mask of the actuators that have an activation that steps by an exponential."""
    kinds = [int(mujoco.mjtDyn.mjDYN_FILTEREXACT), int(mujoco.mjtDyn.mjDYN_DCMOTOR)]
    return np.isin(model.actuator_dyntype, kinds) & _in_stages(model)


def _one_flag(model: mujoco.MjModel) -> bool:
    """Whether the flag `spring` or `damper` makes MJX on JAX omit a force that acts, or damp a step of Euler's all the same."""
    off = [disabled(model, flag) for flag in ("SPRING", "DAMPER")]
    if not any(off):
        return False
    damped = any(
        _any(f"{kind}_{name}")(model).any() for kind in ("dof", "tendon") for name in ("damping", "dampingpoly")
    )
    others = any(
        _any(f"{kind}_{name}")(model).any() for kind in ("jnt", "tendon") for name in ("stiffness", "stiffnesspoly")
    )
    others = others or model.body_gravcomp.any() or _in_medium(model)
    return damped or (others and not all(off))


def _has_disabled(model: mujoco.MjModel) -> bool:
    """Whether an actuator is of a group that is disabled; there are 31 groups that can be."""
    groups = model.actuator_group[(model.actuator_group >= 0) & (model.actuator_group <= 30)]
    return bool((model.opt.disableactuator & (1 << groups)).any())


_OWN = f"give its joint or tendon one, or use {C}"
_DELAYED = f"use the `action_delay` of an ArenaEnv, or {C}"
_SENSED = f"use the `observation_delay` of an ArenaEnv, or {C}"
ELEMENTS = (
    LeftOut("actuator", "armature", _any("actuator_armature"), BOTH, _OWN),
    LeftOut("actuator", "damping", damped, JAX, "use impl='warp', or a joint's"),
    LeftOut("actuator", "delay", _any("actuator_delay"), BOTH, _DELAYED),
    LeftOut("actuator", "actearly", _early, JAX, WARP),
    LeftOut("joint", "springyield", _yields("jnt"), BOTH, f"leave it at 0, or use {C}"),
    LeftOut("tendon", "springyield", _yields("tendon"), BOTH, f"leave it at 0, or use {C}"),
    LeftOut("joint", "stiffness", _any("jnt_stiffnesspoly"), JAX, f"give it one number, or {WARP}"),
    LeftOut("joint", "damping", _of_dofs("dof_dampingpoly"), JAX, f"give it one number, or {WARP}"),
    LeftOut("tendon", "stiffness", _any("tendon_stiffnesspoly"), JAX, f"give it one number, or {WARP}"),
    LeftOut("tendon", "damping", _any("tendon_dampingpoly"), JAX, f"give it one number, or {WARP}"),
    LeftOut("geom", "surfacevel", _touching("geom_surfacevel"), JAX, "use impl='warp'"),
    LeftOut("geom", "adhesion", _touching("geom_adhesion"), JAX, "use impl='warp'"),
    LeftOut("geom", "fluidshape", _dragged, JAX, WARP),
    LeftOut("pair", "adhesion", _sticky, JAX, "use impl='warp'"),
    LeftOut("sensor", "delay", _delayed, BOTH, _SENSED),
    LeftOut("sensor", "interval", _sampled, BOTH, _SENSED),
)
_LIMITS = f"holds one limit of {{}} at a time, and its `margin` is more than half of its `range`: give it a smaller `margin`, or use {C}"
_STAGE = (
    "measures {} at the last stage of the integrator RK4, and MuJoCo at the first: use another integrator, leave out sensors by "
    f'<flag sensor="disable"/>, or use {C}'
)
_EXACT = (
    "steps the activation of {} otherwise than MuJoCo with the integrator RK4: use another integrator, impl='jax', "
    f"or {C}"
)
OTHERWISE: tuple[tuple[str, Callable[[mujoco.MjModel], np.ndarray], tuple[str, ...], str], ...] = (
    ("joint", _meeting("jnt"), BOTH, _LIMITS),
    ("tendon", _meeting("tendon"), BOTH, _LIMITS),
    ("sensor", _measured, BOTH, _STAGE),
    ("sensor", _ticking, JAX, _STAGE),
    ("tendon", _beside, JAX, f"takes the `sidesite` of {{}} for one of the geom's own body: put it there, or {WARP}"),
    ("actuator", _exactly, ("warp",), _EXACT),
    *SOLVER,
)
"""Elements that MJX leaves out or simulates differently, by kind, and what it does with one."""
OPTIONS: tuple[tuple[Callable[[mujoco.MjModel], bool], tuple[str, ...], str], ...] = (
    (
        _has_disabled,
        BOTH,
        f"leaves out the `actuatorgroupdisable` of <option>: delete these actuators, or use {C}",
    ),
    (
        lambda model: model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE,
        JAX,
        f"does not have the integrator `discrete`: use another one, or {WARP}",
    ),
    (lambda model: model.opt.noslip_iterations > 0, JAX, f"leaves out `noslip_iterations`: leave it at 0, or {WARP}"),
    (
        _one_flag,
        JAX,
        f"takes the flags `spring` and `damper` for one, and leaves out gravity compensation and drag as well: {WARP}",
    ),
)
"""Whether a model has it, where MJX does otherwise, and what MJX does."""
_PARTS = {"stiffness": "higher powers of the `stiffness`", "damping": "higher powers of the `damping`"}


WAKES = frozenset(
    {
        *("jnt_stiffness", "jnt_stiffnesspoly", "dof_damping", "dof_dampingpoly"),
        *("dof_frictionloss", "tendon_frictionloss"),
        *("tendon_stiffness", "tendon_stiffnesspoly", "tendon_damping", "tendon_dampingpoly"),
        *("body_gravcomp", "opt.density", "opt.viscosity"),
    }
)
"""Fields with which something has an effect that it lacks where they are 0: what varies in them is not 0 in some world.

`tests/test_woken.py` goes through all fields that the rules read and worlds may differ in.
"""


def check(model: mujoco.MjModel, impl: str, varied: Iterable[tuple[str, np.ndarray]] = ()) -> None:
    """Refuses what an implementation of MJX would leave out or do otherwise, in any world.

    Args:
        model: nominal.
        impl: of MJX.
        varied: fields with the places, in the flattened field, of the numbers that vary.

    Raises:
        ValueError: the model has some of it.
    """
    woken = [(field, places) for field, places in varied if field in WAKES]
    if woken:
        model = copy.copy(model)
        for field, places in woken:
            put(model, field, places, np.ones(np.shape(places)))
    for does in _differences(model, impl):
        raise error([problem("impl", "otherwise", None, impl, does=does)])


def _differences(model: mujoco.MjModel, impl: str) -> Iterator[str]:
    """What an implementation of MJX does otherwise with what is in a model, of each kind the first element."""
    for one in ELEMENTS:
        given = one.given(model) if impl in one.impls else np.zeros(0, bool)
        if given.any():
            powers = one.kind != "actuator" and one.attribute in _PARTS
            what = _PARTS[one.attribute] if powers else f"`{one.attribute}`"
            who = names.element(model, one.kind, int(np.argmax(given)))
            yield f"leaves out the {what} of {who}: {one.instead}"
    for kind, differs, impls, does in OTHERWISE:
        found = differs(model) if impl in impls else np.zeros(0, bool)
        if found.any():
            yield does.format(names.element(model, kind, int(np.argmax(found))))
    for has, impls, does in OPTIONS:
        if impl in impls and has(model):
            yield does
