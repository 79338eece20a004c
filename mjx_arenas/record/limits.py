"""The joints and tendons whose ranges or margins vary (host)."""

from collections.abc import Sequence

import mujoco
import numpy as np

from mjx_arenas.rules.rule import NO_LIMITS, Limits
from mjx_arenas.spec import names
from mjx_arenas.terms.attributes import KINDS
from mjx_arenas.terms.elements import Elements, ids_of

_COLUMNS = {"range": slice(0, 2), "margin": slice(2, 3)}  # of lower limit, upper limit, margin


def limits(model: mujoco.MjModel, varied: Sequence[Elements]) -> Limits:
    """Those that have two limits, and the numbers that terms decide."""
    terms = [one for one in varied if one.kind in ("joint", "tendon") and one.attribute.partition(".")[2] in _COLUMNS]
    if not terms or model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_LIMIT:
        return NO_LIMITS
    found = sorted({(one.kind, int(i)) for one in terms for i in ids_of(model, one.kind, one.elements)})
    found = [(kind, i) for kind, i in found if _two(model, kind, i)]
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
    called = tuple(names.element(model, kind, i) for kind, i in found)
    return Limits(called, np.reshape(nominal, (-1, 3)), tuple(one.name for one in terms), places)


def _two(model: mujoco.MjModel, kind: str, index: int) -> bool:
    """Whether there are two limits; a ball joint has one."""
    if not _field(model, kind, "limited")[index]:
        return False
    return kind == "tendon" or model.jnt_type[index] >= int(mujoco.mjtJoint.mjJNT_SLIDE)


def _field(model: mujoco.MjModel, kind: str, name: str) -> np.ndarray:
    return getattr(model, f"{KINDS[kind].prefix}_{name}")
