"""Joints and tendons."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.spec import specs
from mjx_arenas.terms.attributes.attribute import (
    AROUND_ZERO,
    LIGHTEST,
    RANGE,
    SOME,
    SPRING,
    XYZ,
    Attribute,
    Target,
    axis_joint,
    between,
    free,
    impedance,
    left_out,
    number,
    of_angle,
    of_dofs,
    of_flex,
    of_model,
    only_on_warp,
    plain,
    qpos,
    reader,
    reference,
    setter,
    unit,
)
from mjx_arenas.terms.attributes.prepare import always

JOINT_TRN = int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)


def limited(flag: str, what: str) -> Callable[[mujoco.MjModel, int], str]:
    """A reason not to vary limits that are off."""
    return lambda model, index: (
        "" if of_model(model, flag)[index] else f"it has no {what} in force: give it a wide one in the MJCF"
    )


def stays_limited(flag: str) -> Callable[[mujoco.MjSpec, Any, mujoco.MjModel, int], None]:
    """Sets a flag in the spec that the compiler may have set because of the range."""

    def prepare(spec: mujoco.MjSpec, element: Any, model: mujoco.MjModel, index: int) -> None:
        setattr(element, flag, mujoco.mjtLimited.mjLIMITED_TRUE)

    return prepare


def limits(kind: str, name: str, field: str, flag: str, unit: str) -> Attribute:
    """A range that holds where a flag is set."""
    prepare = stays_limited(flag.partition("_")[2])
    return plain(kind, name, between(kind, unit), field, prepare=prepare, refused=limited(flag, f"`{name}`"))


def damped(model: mujoco.MjModel) -> np.ndarray:
    """(nu,) bool: actuators that have a damping of their own."""
    found = np.zeros(len(model.actuator_trntype), bool)
    for value in (model.actuator_damping, model.actuator_dampingpoly):
        if len(found) and len(value) == len(found):
            found |= value.reshape(len(found), -1).any(1)
    return found


def _dampable(model: mujoco.MjModel, index: int) -> str:
    """Why the damping of a joint cannot vary."""
    why = "it moves a part of a flex, to which MuJoCo gives no damping of joints: give the flex a damping in the MJCF"
    return why if of_flex(model, model.jnt_bodyid[index]) else _added_to(False)(model, index)


def _added_to(of_tendons: bool) -> Callable[[mujoco.MjModel, int], str]:
    """Why a damping cannot vary to which an actuator adds its own, which MJX sums when it puts the model."""
    transmissions = [mujoco.mjtTrn.mjTRN_TENDON] if of_tendons else JOINT_TRN

    def refused(model: mujoco.MjModel, index: int) -> str:
        on = np.isin(model.actuator_trntype, transmissions) & (model.actuator_trnid[:, 0] == index)
        found = np.flatnonzero(on & damped(model))
        if not len(found):
            return ""
        name = model.actuator(found[0]).name
        return f"actuator {name!r} adds a `damping` to it: give all of that to the joint or the tendon in the MJCF"

    return refused


HIGHER = "quadratic, cubic"


def _of_powers(kind: str, name: str, field: str, **more: Any) -> Attribute:
    """What a stiffness or a damping has beyond its first number."""
    return plain(kind, name, number(kind, HIGHER), field, in_spec=(1, 2), unseen_on_jax=only_on_warp, **more)


def _ball_limits(model: mujoco.MjModel, ids: np.ndarray) -> np.ndarray:
    """(N, 2) bool: a ball joint's range begins at 0."""
    return (model.jnt_type[ids] != mujoco.mjtJoint.mjJNT_BALL)[:, None] | np.array([False, True])


def _along(spec: mujoco.MjSpec, element: Any, model: mujoco.MjModel, index: int) -> None:
    """Anchor and axis as the compiler found them, in no frame but the body's."""
    specs.out_of_frames(element)
    specs.assign(element, pos=model.jnt_pos[index], axis=model.jnt_axis[index])


JOINTS = {
    "joint.damping": of_dofs(
        "damping", "dof_damping", number("joint", "", "[N m s] or [N s/m]", 0.0), (0,), refused=_dampable
    ),
    "joint.armature": of_dofs("armature", "dof_armature", number("joint", "", "[kg m^2] or [kg]", 0.0)),
    "joint.frictionloss": of_dofs(
        "frictionloss",
        "dof_frictionloss",
        number("joint", "", "[N m] or [N]", 0.0),
        unseen_on_jax=left_out("dof_frictionloss"),
    ),
    "joint.stiffness": plain("joint", "stiffness", number("joint", "", "[N m] or [N/m]", 0.0), in_spec=(0,)),
    "joint.stiffnesspoly": _of_powers("joint", "stiffness", "jnt_stiffnesspoly"),
    "joint.dampingpoly": of_dofs(
        "damping",
        "dof_dampingpoly",
        number("joint", HIGHER),
        (1, 2),
        refused=_dampable,
        unseen_on_jax=only_on_warp,
    ),
    "joint.solref_friction": of_dofs("solref_friction", "dof_solref", reference("joint")),
    "joint.solimp_friction": of_dofs("solimp_friction", "dof_solimp", impedance("joint")),
    "joint.solref_limit": plain("joint", "solref_limit", reference("joint"), "jnt_solref"),
    "joint.solimp_limit": plain("joint", "solimp_limit", impedance("joint"), "jnt_solimp"),
    "joint.margin": plain("joint", "margin", number("joint", "", "", 0.0)),
    "joint.pos": plain("joint", "pos", number("joint", XYZ, "[m]"), prepare=_along, ends_point=always, refused=free),
    "joint.axis": Attribute(
        number("joint", XYZ)._replace(together=SOME),
        (Target("jnt_axis", made=unit),),
        setter("axis"),
        reader("jnt_axis", None, False),
        prepare=_along,
        ends_point=always,
        refused=axis_joint,
    ),
    "joint.range": of_angle(
        "range",
        between("joint", "[rad] or [m]"),
        Target("jnt_range"),
        reader("jnt_range", None, False),
        prepare=stays_limited("limited"),
        used=_ball_limits,
        refused=limited("jnt_limited", "`range`"),
    ),
    "joint.actfrcrange": limits("joint", "actfrcrange", "jnt_actfrcrange", "jnt_actfrclimited", "[N m] or [N]"),
    "joint.ref": of_angle(
        "ref",
        number("joint", "", "[rad] or [m]"),
        Target("qpos0"),
        lambda model, ids: np.array(model.qpos0[qpos(model, ids)]),
        refused=axis_joint,
    ),
    "joint.springref": of_angle(
        "springref",
        number("joint", "", "[rad] or [m]"),
        Target("qpos_spring"),
        lambda model, ids: np.array(model.qpos_spring[qpos(model, ids)]),
        refused=axis_joint,
    ),
}


def _measured(spec: mujoco.MjSpec, element: Any, model: mujoco.MjModel, index: int) -> None:
    """The length of a spring as a number where the compiler measures it."""
    element.springlength = model.tendon_lengthspring[index]


_TENDON_FORCES = limits("tendon", "actfrcrange", "tendon_actfrcrange", "tendon_actfrclimited", "[N]")
TENDON = {
    "tendon.damping": plain(
        "tendon", "damping", number("tendon", "", "[N s/m]", 0.0), in_spec=(0,), refused=_added_to(True)
    ),
    "tendon.stiffness": plain("tendon", "stiffness", number("tendon", "", "[N/m]", 0.0), in_spec=(0,)),
    "tendon.stiffnesspoly": _of_powers("tendon", "stiffness", "tendon_stiffnesspoly"),
    "tendon.dampingpoly": _of_powers("tendon", "damping", "tendon_dampingpoly", refused=_added_to(True)),
    "tendon.frictionloss": plain(
        "tendon", "frictionloss", number("tendon", "", "[N]", 0.0), unseen_on_jax=left_out("tendon_frictionloss")
    ),
    "tendon.armature": plain(
        "tendon",
        "armature",
        number("tendon", "", "[kg]", LIGHTEST),
        refused=lambda model, index: (
            ""
            if model.tendon_armature[index]
            else "it is 0, for which the inertia matrix has no room: give it a small one in the MJCF"
        ),
    ),
    "tendon.range": limits("tendon", "range", "tendon_range", "tendon_limited", "[m]"),
    "tendon.margin": plain("tendon", "margin", number("tendon", "", "[m]", 0.0)),
    "tendon.springlength": plain(
        "tendon",
        "springlength",
        number("tendon", RANGE, "[m]")._replace(together=SPRING),
        "tendon_lengthspring",
        prepare=_measured,
    ),
    "tendon.actfrcrange": _TENDON_FORCES._replace(quantity=_TENDON_FORCES.quantity._replace(together=AROUND_ZERO)),
    "tendon.solref_limit": plain("tendon", "solref_limit", reference("tendon"), "tendon_solref_lim"),
    "tendon.solimp_limit": plain("tendon", "solimp_limit", impedance("tendon"), "tendon_solimp_lim"),
    "tendon.solref_friction": plain("tendon", "solref_friction", reference("tendon"), "tendon_solref_fri"),
    "tendon.solimp_friction": plain("tendon", "solimp_friction", impedance("tendon"), "tendon_solimp_fri"),
}
