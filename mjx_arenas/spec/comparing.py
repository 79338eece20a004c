"""How compiled models compare, number by number, in double precision (host)."""

import functools
import operator
from collections.abc import Iterable

import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import scales
from mjx_arenas.named import field as field_of
from mjx_arenas.solids import tensors

EXACT = 1e-9  # of numbers in double precision, relative to themselves
SINGLE = 2.0**-22  # of what the compiler derives from numbers in single precision: a camera's focal length
OPTIONS = ("timestep", "impratio", "gravity", "wind", "magnetic", "density", "viscosity")
STATISTICS = ("center", "extent", "meansize", "meanmass", "meaninertia")
# What C MuJoCo derives when it is told to, or uses as a short-cut, the `qpos` of keyframes that have none, and which equalities
# are active at the start, which `make_data` sees to; no step of MJX reads any of it (docs/exactness.md), but for `dof_length` where
# bodies may sleep (`data.check_awake`).
NOT_READ = frozenset(
    {
        "body_margin",
        "body_sameframe",
        "site_sameframe",
        "tree_sleep_policy",
        "bvh_aabb",
        "bvh_child",
        "bvh_nodeid",
        "dof_length",
        "geom_sameframe",
        "key_qpos",
        "key_mpos",
        "key_mquat",
        "actuator_length0",
        "eq_active0",
    }
)
UNDERIVED = frozenset(f"stat.{name}" for name in STATISTICS)  # which C's `mj_setConst` does not derive
TENSOR = ("body_inertia", "body_iquat")
_SMALL = 100_000  # bytes that are worth a copy


def fields() -> Iterable[str]:
    """Names of the arrays that MJX has, too."""
    return (
        name for name in mjx.Model.__dataclass_fields__ if isinstance(getattr(mujoco.MjModel, name, None), property)
    )


def differing(a: mujoco.MjModel, b: mujoco.MjModel) -> set[str]:
    """Names of the numbers in which two compiled models of one topology differ, `stat.` for those of the statistics."""
    names = _number_names()
    numbers = operator.attrgetter(*names)
    pairs = zip(names, numbers(a), numbers(b), strict=True)
    return {name for name, x, y in pairs if (name in TENSOR or not _same(x, y)) and differ(a, b, name)}


def _same(x: np.ndarray | float, y: np.ndarray | float) -> bool:
    """Whether all bits are, which most of hundreds of fields show fastest; what is nan or 0 in two ways is looked at again."""
    if isinstance(x, np.ndarray) and isinstance(y, np.ndarray):
        return x.shape == y.shape and (x.tobytes() == y.tobytes() if x.nbytes < _SMALL else bool((x == y).all()))
    return x == y


@functools.cache
def _number_names() -> tuple[str, ...]:
    """Names of all arrays of numbers of a compiled model, and of its statistics."""
    plain = mujoco.MjSpec().compile()
    arrays = {name: getattr(plain, name) for name in dir(plain) if not name.startswith("_")}
    numbers = [name for name, x in arrays.items() if isinstance(x, np.ndarray) and x.dtype.kind in "fiub"]
    numbers.remove("body_iquat")  # compared with `body_inertia`
    return (*(f"stat.{name}" for name in STATISTICS), *(f"opt.{name}" for name in OPTIONS), *numbers)


def differ(a: mujoco.MjModel, b: mujoco.MjModel, name: str) -> bool:
    """Whether numbers of two models differ by more than rounding."""
    x, y = array(a, name), array(b, name)
    if x.shape != y.shape:
        return True
    if (x == y).all():
        return False
    return x.dtype.kind != "f" or bool(far_apart(a, name, x, y).any())


def array(model: mujoco.MjModel, name: str) -> np.ndarray:
    """The numbers of a field by its name, (n, ...); of inertias the nine of each tensor."""
    if name in TENSOR:  # together: of symmetric bodies, rounding decides for their axes
        return tensors(model.body_iquat, model.body_inertia).reshape(-1, 9)
    return np.atleast_1d(field_of(model, name))


def far_apart(model: mujoco.MjModel, name: str, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A mask of the numbers that differ by more than rounding in double precision."""
    if a.dtype.kind != "f":
        return a != b
    if name == "body_invweight0":  # C's 0 is the square of what double precision rounds
        a, b = (np.where(x <= 2.0**-104 * x.max(-1, keepdims=True), 0.0, x) for x in (a, b))
    none = scales.nothing(model, name, 2.0**-50)
    if none.any():
        a, b = (np.where(np.abs(x) <= none, 0.0, x) for x in (a, b))
    off = np.abs(a - b)
    if not off.any():
        return off > 0
    size = (
        np.maximum(scales.scale(model, name, a), scales.scale(model, name, b))
        if a.shape == array(model, name).shape or name in TENSOR
        else None
    )
    size = np.maximum(np.abs(a), np.abs(b)) if size is None else size
    exact = SINGLE if name == "cam_fovy" else EXACT
    return ~((off <= exact * size) | (np.isnan(a) & np.isnan(b)))
