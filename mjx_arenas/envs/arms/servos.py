"""What moves an arm and its gripper: position servos, whose controls are the positions that they are to bring about (host)."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.envs.arms import chain, grips
from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error, raise_all, warn
from mjx_arenas.rules.validation import check_type, is_number, not_negative_problems, vector_problems
from mjx_arenas.spec import patterns, specs
from mjx_arenas.terms.attributes.gains import described, shortcut
from mjx_arenas.terms.attributes.joints import JOINT_TRN

_DYN = mujoco.mjtDyn
_FOLLOWS = [int(kind) for kind in (_DYN.mjDYN_NONE, _DYN.mjDYN_FILTER, _DYN.mjDYN_FILTEREXACT)]
LARGEST = 10.0  # [m] of an arm
_SPARE = 1e-6  # [m] for the rounding of sums
_FAR = 3.0  # times its range, by which a finger is sent beyond
_ROUNDED = 0.01  # of a joint's range, by which a servo's may be less: files round both


def on(model: mujoco.MjModel, joint: int) -> list[int]:
    """Actuators of a joint, by index."""
    kinds = np.isin(model.actuator_trntype, JOINT_TRN)
    return np.flatnonzero(kinds & (model.actuator_trnid[:, 0] == joint)).tolist()


def targets(model: mujoco.MjModel, joints: Sequence[int], servos: np.ndarray) -> np.ndarray:
    """(2, n) least and most positions that servos can be told: those of their joints and their own; infinite without limits."""
    joint, servo = list(joints), servos
    of_joint = np.where(model.jnt_limited[joint, None], model.jnt_range[joint], [-np.inf, np.inf])
    own = np.where(model.actuator_ctrllimited[servo, None], model.actuator_ctrlrange[servo], [-np.inf, np.inf])
    return np.array([np.maximum(of_joint[:, 0], own[:, 0]), np.minimum(of_joint[:, 1], own[:, 1])])


def checked(arm: Any) -> chain.Chain:
    """The joints of an `arms.Arm`, from its base to its tool; refuses one whose joints or fingers go elsewhere than tasks tell them to.

    Raises:
        ValueError, TypeError: the first thing that is wrong.
    """
    _check_fields(arm)
    model = specs.compiled(arm.spec, "arm.spec")
    _check_keyframes(model)
    for name, kind, known in (("base", "body", arm.spec.bodies[1:]), ("tool", "site", arm.spec.sites)):
        given, names = getattr(arm, name), [one.name for one in known if one.name]
        if given not in names:
            told = {"kind": kind, "nearest": patterns.near(str(given), names)}
            raise error([problem(f"arm.{name}", "arm_lacks", None, given, told)])
    found, base = chain.chain(model, arm.base, arm.tool), model.body(arm.base).id
    if model.body_weldid[base] or model.body_mocapid[model.body_rootid[base]] >= 0:
        must = "the name of a body that no joint moves and that is not mocap"
        raise error([problem("arm.base", "must", None, arm.base, must=must)])
    _check_joints(model, found.joints)
    _check_fingers(arm, model, found.joints)
    _check_span(arm, model, found)
    return found


def _check_fields(arm: Any) -> None:
    """Refuses what is no controls and no numbers."""
    check_type("arm.fingers", arm.fingers, Mapping, "a dictionary of controls by the names of actuators; {} for none")
    found = vector_problems("arm.reach", arm.reach, 2, "[m]")
    if not found and not 0 <= arm.reach[0] < arm.reach[1]:
        must = "2 numbers >= 0, the first below the second [m]"
        found.append(problem("arm.reach", "must", None, arm.reach, must=must))
    for name in ("width", "rise"):
        found += not_negative_problems(f"arm.{name}", getattr(arm, name), "[m]")
    raise_all(found, "`arm`")
    if arm.fingers and not arm.width:
        raise error([problem("arm.width", "must", None, arm.width, must="> 0 [m], as there are fingers")])


def _check_keyframes(model: mujoco.MjModel) -> None:
    """Refuses keyframes in which not all is finite."""
    for name in ("qpos", "qvel", "act", "ctrl"):
        values = getattr(model, f"key_{name}")
        for key in np.flatnonzero(~np.isfinite(values).all(1)).tolist():
            must = f"finite numbers in keyframe {model.key(key).name!r}"
            got = Told(f"{values[key][~np.isfinite(values[key])][0]} in its `{name}`")
            raise error([problem("arm.spec", "has", None, got, must=must)])


def _check_span(arm: Any, model: mujoco.MjModel, links: chain.Chain) -> None:
    """Refuses distances to which no tool goes."""
    joints = [model.joint(name).id for name in links.joints]
    most = chain.length(links, targets(model, joints, np.array([on(model, i)[0] for i in joints])))
    for name, value in (("reach", arm.reach[1]), ("rise", arm.rise)):
        if value > LARGEST:
            raise error([problem(f"arm.{name}", "arm_large", None, getattr(arm, name), most=LARGEST)])
        if value > most + _SPARE:
            raise error([problem(f"arm.{name}", "arm_span", None, getattr(arm, name), most=most)])


def _check_joints(model: mujoco.MjModel, joints: Sequence[str]) -> None:
    """Refuses joints that are not each moved by one servo."""
    found = {joint: on(model, model.joint(joint).id) for joint in joints}
    missing = [joint for joint in joints if not found[joint]]
    if missing:
        raise error([problem("arm.spec", "servo_lacks", None, Told(", ".join(missing)))])
    for joint, own in found.items():
        why = _unlike_a_servo(model, own[0]) or _short(model, joint, own[0])
        if len(own) > 1:
            why = f"it has {' and '.join(repr(model.actuator(i).name) for i in own)}"
        if why:
            raise error([problem("arm.spec", "servo_alone", None, None, joint=joint, why=why)])


def _unlike_a_servo(model: mujoco.MjModel, index: int) -> str:
    """Why the control of a joint's actuator is no position of the joint."""
    gear, name = model.actuator_gear[index, 0], f"actuator {model.actuator(index).name!r}"
    if shortcut(model, index) != "position":
        return f"{name} is {described(model, index)}"
    if int(model.actuator_dyntype[index]) not in _FOLLOWS:
        return f"{name} takes velocities"
    return f"{name} has a gear of {gear:g} instead of 1" if gear != 1 else ""


def _short(model: mujoco.MjModel, joint: str, index: int) -> str:
    """Why a servo does not reach all of its joint's range."""
    own, whole = model.actuator_ctrlrange[index], model.joint(joint).range
    if not (model.actuator_ctrllimited[index] and model.jnt_limited[model.joint(joint).id]):
        return ""
    slack = _ROUNDED * np.ptp(whole)
    if own[0] <= whole[0] + slack and own[1] >= whole[1] - slack:
        return ""
    least, most = (f"({low:g}, {high:g})" for low, high in (own, whole))
    return f"actuator {model.actuator(index).name!r} has a `ctrlrange` of {least}, less than the joint's range {most}"


def _check_fingers(arm: Any, model: mujoco.MjModel, joints: Sequence[str]) -> None:
    """Refuses controls of fingers that do not open and close a gripper; warns of those that are meant in another unit."""
    names = [model.actuator(i).name for i in range(model.nu)]
    check_controls("arm.fingers", arm.fingers, model, {names[i] for j in joints for i in on(model, model.joint(j).id)})
    hand = _behind(model, model.joint(joints[-1]).bodyid[0])
    lacks = [name for i, name in enumerate(names) if i in hand and name not in arm.fingers]
    if arm.fingers and lacks:
        raise error([problem("arm.fingers", "fingers_lack", None, Told(" and ".join(map(repr, lacks))))])
    _warn_of_far(arm.fingers, model)


def _warn_of_far(fingers: Mapping[str, tuple[float, float]], model: mujoco.MjModel) -> None:
    """Warns of controls that send what they move far beyond its range."""
    found = grips.grips(model, fingers)
    for name, controls, index, moved, unit in zip(fingers, fingers.values(), *found[:2], found.unit, strict=True):
        travel = grips.travel(model, int(index))
        if travel is None or not model.actuator_biasprm[index, 1]:
            continue
        low, high = travel
        beyond, target = max((max(low - at, at - high), at) for at in (unit * control for control in controls))
        if beyond > _FAR * (high - low):
            told = {"moved": moved, "target": target, "least": low, "most": high}
            warn(problem(f"arm.fingers[{name!r}]", "fingers_far", None, controls, told))


def check_controls(path: str, fingers: Any, model: mujoco.MjModel, of_arm: Collection[str] = ()) -> None:
    """Refuses what are no controls (closed, open) of actuators by their names, and actuators `of_arm`."""
    check_type(path, fingers, Mapping, "a dictionary of controls by the names of actuators; {} for none")
    names = [model.actuator(i).name for i in range(model.nu)]
    might = [name for i, name in enumerate(names) if grips.joints_of(model, i)]
    wrong = [name for name in fingers if name not in might]
    if wrong and wrong[0] not in names:
        near = patterns.near(str(wrong[0]), [name for name in might if name not in of_arm])
        raise error([problem(path, "no_finger", None, wrong[0], nearest=near)])
    if wrong:
        raise error([problem(path, "fingers_names", None, wrong[0])])
    for name, controls in fingers.items():
        if name in of_arm:
            raise error([problem(path, "fingers_of_arm", None, name)])
        if must := _must_be(model, names.index(name), controls):
            raise error([problem(f"{path}[{name!r}]", "must", None, controls, must=must)])


def _must_be(model: mujoco.MjModel, index: int, controls: object) -> str:
    """What the controls of a finger must be, if they are not."""
    pair = isinstance(controls, (tuple, list, np.ndarray)) and len(controls) == 2 and all(map(is_number, controls))
    if not pair or not np.isfinite(controls).all() or controls[0] == controls[1]:  # type: ignore[index, arg-type]
        return "two different controls, (closed, open)"
    low, high = model.actuator_ctrlrange[index]
    slack = _ROUNDED * (high - low)
    within = low - slack <= min(controls) and max(controls) <= high + slack  # type: ignore[call-overload]
    if model.actuator_ctrllimited[index] and not within:
        return f"controls within the actuator's `ctrlrange`, {low:g} to {high:g}"
    return ""


def _behind(model: mujoco.MjModel, body: int) -> set[int]:
    """Actuators whose joints all hang on a body."""
    hanging = {int(body)}
    for i in range(model.nbody):  # parents come first
        if int(model.body_parentid[i]) in hanging:
            hanging.add(i)
    joints = {j for j in range(model.njnt) if int(model.jnt_bodyid[j]) in hanging - {int(body)}}
    moved = [{joint for joint, _ in grips.joints_of(model, i)} for i in range(model.nu)]
    return {i for i, own in enumerate(moved) if own and own <= joints}
