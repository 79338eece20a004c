"""The joints and tendons whose ranges or margins vary (host)."""

from collections.abc import Sequence

import mujoco
import numpy as np

from mjx_arenas.rules.rule import NO_LIMITS, Limits
from mjx_arenas.spec import names
from mjx_arenas.terms.attributes import KINDS
from mjx_arenas.terms.elements import Elements, ids_of
from mjx_arenas.terms.furniture import Furniture

_COLUMNS = {"range": slice(0, 2), "margin": slice(2, 3)}  # of lower limit, upper limit, margin


def limits(model: mujoco.MjModel, varied: Sequence[Elements], furniture: Sequence[Furniture]) -> Limits:
    """The joints and tendons that have two limits, and numbers that terms or the joints of parts decide."""
    terms = [one for one in varied if one.kind in ("joint", "tendon") and one.attribute.partition(".")[2] in _COLUMNS]
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_LIMIT:
        return NO_LIMITS
    found = sorted({(one.kind, int(i)) for one in terms for i in ids_of(model, one.kind, one.elements)})
    of_parts = [(term.part, [("joint", model.joint(name).id) for name in term.joints]) for term in furniture]
    found += [one for _, joints in of_parts for one in joints if model.jnt_margin[one[1]] and one not in found]
    found = [(kind, i) for kind, i in found if _two(model, kind, i)]
    if not found:
        return NO_LIMITS
    nominal = [(*_field(model, kind, "range")[i], _field(model, kind, "margin")[i]) for kind, i in found]
    places = np.arange(3 * len(found)).reshape(-1, 3)
    start = places.size
    for one in terms:
        numbers = start + np.arange(one.mask.size).reshape(len(one.elements), -1)
        for i, own, mask in zip(ids_of(model, one.kind, one.elements), numbers, one.mask, strict=True):
            if (one.kind, int(i)) in found:
                row = places[found.index((one.kind, int(i))), _COLUMNS[one.attribute.partition(".")[2]]]
                row[:] = np.where(mask, own, row)
        start += one.mask.size
    moving = [(part, joints) for part, joints in of_parts if set(joints) & set(found)]
    for _, joints in moving:
        for place, joint in enumerate(joints):
            if joint in found:
                places[found.index(joint), :2] = start + 2 * place + np.arange(2)
        start += 2 * len(joints)
    called = tuple(names.element(model, kind, i) for kind, i in found)
    quantities = tuple(one.name for one in terms)
    return Limits(called, np.reshape(nominal, (-1, 3)), quantities, places, tuple(part for part, _ in moving))


def _two(model: mujoco.MjModel, kind: str, index: int) -> bool:
    """Whether there are two limits; a ball joint has one."""
    if not _field(model, kind, "limited")[index]:
        return False
    return kind == "tendon" or model.jnt_type[index] >= int(mujoco.mjtJoint.mjJNT_SLIDE)


def _field(model: mujoco.MjModel, kind: str, name: str) -> np.ndarray:
    return getattr(model, f"{KINDS[kind].prefix}_{name}")
