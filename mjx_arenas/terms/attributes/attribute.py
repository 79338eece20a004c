"""What an attribute that can vary is, and the plain ones: those that a field of the model has as they are (host)."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import LARGEST, Quantity, Together

GEOM, JOINT = mujoco.mjtGeom, mujoco.mjtJoint
_TURNING = (int(JOINT.mjJNT_HINGE), int(JOINT.mjJNT_BALL))
LIGHTEST = mujoco.mjMINVAL


class Kind(NamedTuple):
    """A kind of MJCF element."""

    listed: str  # attribute of MjSpec that lists them
    prefix: str  # of its fields in the model
    width: str  # attribute of the model that counts them


KINDS = {
    "body": Kind("bodies", "body", "nbody"),
    "geom": Kind("geoms", "geom", "ngeom"),
    "site": Kind("sites", "site", "nsite"),
    "joint": Kind("joints", "jnt", "njnt"),
    "tendon": Kind("tendons", "tendon", "ntendon"),
    "actuator": Kind("actuators", "actuator", "nactuator"),
    "equality": Kind("equalities", "eq", "neq"),
    "pair": Kind("pairs", "pair", "npair"),
    "camera": Kind("cameras", "cam", "ncam"),
    "light": Kind("lights", "light", "nlight"),
    "material": Kind("materials", "mat", "nmat"),
    "option": Kind("", "opt", ""),
}


class Target(NamedTuple):
    """The place of the attribute in a field of the model."""

    field: str
    columns: tuple[int, ...] | None = None  # of an element's row; None: all
    made: Callable[[Array, mujoco.MjModel, np.ndarray], Array] | None = None  # from values (N, ...); None: they are it
    share: bool = False  # relative to the nominal number
    per_dof: bool = False  # a row for each degree of freedom of a joint
    free: bool = False  # entries of `qpos` of the free joint of a body, of those that have one
    at: Callable[[mujoco.MjModel, np.ndarray], np.ndarray] | None = (
        None  # (N, ...) places, where they are not the elements' rows
    )
    of: Callable[[mujoco.MjModel, np.ndarray], np.ndarray] | None = None  # (N,) bool: who has it there; None: all


class Attribute(NamedTuple):
    """An attribute that can vary."""

    quantity: Quantity
    targets: tuple[Target, ...]
    edit: Callable[[Any, np.ndarray, mujoco.MjModel, int], None]
    """Gives an element of a spec its number; after `prepare`. What is NaN stays as it is."""
    read: Callable[[mujoco.MjModel, np.ndarray], np.ndarray] | None = None
    """(N, ...) numbers of a compiled model."""
    told: Callable[[Any], float] | None = None
    """Instead of `read`, the number of an element of a spec, where no compiled model has it; after `prepare`."""
    limits: Callable[[mujoco.MjModel, np.ndarray], tuple[float, float]] | None = None
    """The limits of the numbers of these elements, where the model decides them."""
    prepare: Callable[[mujoco.MjSpec, Any, mujoco.MjModel, int], None] | None = None
    """Writes what the compiler found into the spec, so that one attribute can be set without the others."""
    ends_point: Callable[[Any], bool] | None = None
    """Whether another number of an element of a spec can end what MuJoCo takes its body for: one whose centre of mass is its origin."""
    used: Callable[[mujoco.MjModel, np.ndarray], np.ndarray] | None = None
    """(N, ...) bool: which of the numbers mean something for the element."""
    refused: Callable[[mujoco.MjModel, int], str] | None = None
    """Why it cannot vary for an element, a clause; "" if it can."""
    refused_in_spec: Callable[[mujoco.MjSpec, Any], str] | None = None
    """The same, for what only the spec says."""
    unseen_on_jax: Callable[[mujoco.MjModel, int], str] | None = None
    """Why MJX on JAX would not see it vary, a clause; "" where it does."""


def not_negative(x: Array) -> Array:
    """Elementwise."""
    return x >= 0


def positive(x: Array) -> Array:
    """Elementwise."""
    return x > 0


def number(kind: str, axes: str = "", unit: str = "", low: float = -LARGEST, high: float = LARGEST) -> Quantity:
    """Numbers between limits, as many as there are axes."""
    item = (len(axes.split(",")),) if axes else ()
    every = " on every axis" if axes else ""
    if low == 0 and high == LARGEST:
        return Quantity(kind, item, float, axes, not_negative, f">= 0{every} {unit}".rstrip(), (0.0, high))
    if low == LIGHTEST:
        return Quantity(kind, item, float, axes, positive, f"> 0{every} {unit}".rstrip(), (low, high))
    return Quantity(kind, item, float, axes, None, unit, (low, high))


RANGE = "low, high"


def between(kind: str, unit: str = "") -> Quantity:
    """A range: two numbers, the first below the second."""
    return Quantity(kind, (2,), float, RANGE, None, unit, together=BELOW)


def reference(kind: str) -> Quantity:
    """A `solref`."""
    return number(kind, "timeconst, dampratio")._replace(together=SIGNS)


def impedance(kind: str) -> Quantity:
    """A `solimp`."""
    return number(kind, "dmin, dmax, width, midpoint, power", "", 0.0)._replace(together=IMPEDANCE)


BELOW = Together("low_below_high", lambda x: x[:, 0] < x[:, 1], ordered=True)
AROUND_ZERO = Together("low_zero_high", lambda x: (x[:, 0] < x[:, 1]) & (x[:, 0] <= 0) & (x[:, 1] >= 0), ordered=True)
SPRING = Together("spring_length", lambda x: (x[:, 0] <= x[:, 1]) & ~((x[:, 0] == -1) & (x[:, 1] == -1)), ordered=True)
SHORTEST = 3e-7
"""Of a vector of which the compiler makes one of length 1."""
SOME = Together("no_length", lambda x: (x * x).sum(-1) > SHORTEST**2)
TRIANGLE = Together(
    "triangle",
    lambda x: 2 * x.max(-1) <= x.sum(-1),
    best=lambda low, high: np.maximum(low, np.minimum(high, np.sort(high, -1)[..., 1:2])),
)


SIGNS = Together("solref_signs", lambda x: (x[:, 0] > 0) == (x[:, 1] > 0))
IMPEDANCE = Together("impedance", lambda x: (x[:, 0] == x[:, 1]) | ((x[:, 0] < x[:, 1]) & (x[:, 2] > mujoco.mjMINVAL)))
"""What MuJoCo simulates as it is given, and MJX the same; MuJoCo mixes two that are right to one that is right."""


XYZ, RGBA, RGB = "x, y, z", "red, green, blue, alpha", "red, green, blue"
RPY = "roll, pitch, yaw"


def of_model(model: mujoco.MjModel, name: str) -> np.ndarray:
    """A field of a compiled model."""
    return np.asarray(getattr(model, name))


def setter(name: str, columns: Sequence[int] | None = None) -> Callable[[Any, np.ndarray, mujoco.MjModel, int], None]:
    """An edit that sets an attribute of a spec's element, or some of its numbers."""

    def edit(element: Any, value: np.ndarray, model: mujoco.MjModel, index: int) -> None:
        old = getattr(element, name)
        if columns is None and np.ndim(old) == 0:
            setattr(element, name, type(old)(value) if isinstance(old, bool) else float(value))
            return
        new = np.array(old, float)
        own = list(columns) if columns is not None else slice(None)
        new[own] = np.where(np.isnan(value), new[own], value)
        setattr(element, name, new)

    return edit


def reader(field: str, columns: tuple[int, ...] | None, scalar: bool) -> Callable[..., np.ndarray]:
    """A function that reads rows of a field, or some of their columns."""

    def read(model: mujoco.MjModel, ids: np.ndarray) -> np.ndarray:
        rows = of_model(model, field)[ids]
        rows = rows if columns is None or rows.ndim == 1 else rows[:, list(columns)]
        return np.array(rows.reshape(len(ids)) if scalar else rows, float)

    return read


def plain(
    kind: str,
    name: str,
    quantity: Quantity,
    field: str = "",
    columns: tuple[int, ...] | None = None,
    in_spec: tuple[int, ...] | None = None,
    **more: Any,
) -> Attribute:
    """An attribute that a field has as it is."""
    field = field or f"{KINDS[kind].prefix}_{name}"
    edit = setter(name, in_spec if in_spec is not None else columns)
    return Attribute(quantity, (Target(field, columns),), edit, reader(field, columns, not quantity.item), **more)


IDLE = "it is 0 in the MJCF, which leaves it out of the step"


def left_out(name: str) -> Callable[[mujoco.MjModel, int], str]:
    """Why MJX on JAX does not see a number that is 0 in the MJCF: it then has no part in the step, for good."""

    def unseen(model: mujoco.MjModel, index: int) -> str:
        values = np.asarray(of_model(model, name))
        own = values[model.jnt_dofadr[index] if name.startswith("dof_") else index]
        there = values.any() if name == "body_gravcomp" else own  # one body that has it is enough
        return "" if there else IDLE

    return unseen


def only_on_warp(model: mujoco.MjModel, index: int) -> str:
    """Why MJX on JAX does not see a number that only Warp reads."""
    return "MJX has it on Warp alone"


def nowhere(*fields: str) -> Callable[[mujoco.MjModel, int], str]:
    """Why an attribute cannot vary that Warp leaves out for good where all numbers of these fields are 0."""

    def refused(model: mujoco.MjModel, index: int) -> str:
        there = any(of_model(model, name).any() for name in fields)
        left = "no element of the MJCF has any, so MJX leaves it out of the step: give one element a small number"
        return "" if there else left

    return refused


def of_dofs(
    name: str, field: str, quantity: Quantity, in_spec: tuple[int, ...] | None = None, **more: Any
) -> Attribute:
    """An attribute of a joint that each of its degrees of freedom has."""

    def read(model: mujoco.MjModel, ids: np.ndarray) -> np.ndarray:
        return np.array(of_model(model, field)[model.jnt_dofadr[ids]], float)

    return Attribute(quantity, (Target(field, per_dof=True),), setter(name, in_spec), read, **more)


def of_angle(name: str, quantity: Quantity, target: Target, read: Callable[..., np.ndarray], **more: Any) -> Attribute:
    """An attribute of a joint that MJCF may have in degrees."""
    plain = setter(name)

    def edit(element: Any, value: np.ndarray, model: mujoco.MjModel, index: int) -> None:
        turns = int(model.jnt_type[index]) in _TURNING
        in_degrees = turns and element.compiler.degree
        plain(element, np.rad2deg(value) if in_degrees else value, model, index)

    return Attribute(quantity, (target,), edit, read, **more)


def free(model: mujoco.MjModel, index: int) -> str:
    """Why a joint cannot vary where it is: a free one."""
    return "it is free: vary `body.pos` or `body.start_pos`" if model.jnt_type[index] == JOINT.mjJNT_FREE else ""


def axis_joint(model: mujoco.MjModel, index: int) -> str:
    """Why a joint cannot vary that has no axis."""
    kind = int(model.jnt_type[index])  # free, ball, slide, hinge
    why = "it is no hinge and no slide: vary `body.start_rpy` or `body.start_angvel`"
    return "" if kind >= int(JOINT.mjJNT_SLIDE) else why


def of_flex(model: mujoco.MjModel, body: int) -> bool:
    """Whether a body is a vertex or a node of a flex."""
    return body in model.flex_vertbodyid or body in model.flex_nodebodyid


def carriers_of_flexes(model: mujoco.MjModel) -> set[int]:
    """Bodies that are vertices or nodes of flexes, and those that carry such."""
    found = {body for body in (*model.flex_vertbodyid.tolist(), *model.flex_nodebodyid.tolist()) if body > 0}
    for body in range(model.nbody - 1 if found else 0, 0, -1):  # parents come before
        found |= {int(model.body_parentid[body])} if body in found else set()
    return found


def qpos(model: mujoco.MjModel, ids: np.ndarray) -> np.ndarray:
    """Entries of `qpos` of hinges and slides."""
    return model.jnt_qposadr[ids]


def unit(values: Array, model: mujoco.MjModel, ids: np.ndarray) -> Array:
    """Vectors of length 1, as the compiler makes them."""
    xp = array_module(values)
    return values / xp.sqrt((values * values).sum(-1, keepdims=True))
