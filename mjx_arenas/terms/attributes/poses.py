"""The positions and orientations of elements."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error
from mjx_arenas.quaternions import quat_mul
from mjx_arenas.spec import specs
from mjx_arenas.terms.attributes.attribute import (
    GEOM,
    KINDS,
    RPY,
    XYZ,
    Attribute,
    Target,
    carriers_of_flexes,
    number,
    of_flex,
    of_model,
    reader,
)
from mjx_arenas.terms.attributes.prepare import not_simple, weighs


def turned(field: str) -> Callable[[Array, mujoco.MjModel, np.ndarray], Array]:
    """Turns after the nominal one."""

    def made(values: Array, model: mujoco.MjModel, ids: np.ndarray) -> Array:
        base = array_module(values).asarray(of_model(model, field)[ids], values.dtype)
        return quat_mul(base, rpy_quat(values))

    return made


def rpy_quat(rpy: Array) -> Array:
    """Quaternions (..., 4) of turns by roll about x, then pitch about y, then yaw about z (..., 3) [rad], axes that stay."""
    xp = array_module(rpy)
    half = rpy / 2
    (cr, cp, cy), (sr, sp, sy) = ([f(half[..., i]) for i in range(3)] for f in (xp.cos, xp.sin))
    return xp.stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ],
        axis=-1,
    )


def in_mesh(model: mujoco.MjModel, kind: str, index: int) -> tuple[np.ndarray, np.ndarray]:
    """The frame of a mesh in that of its geom, as the compiler puts it; no shift and no turn for all else."""
    mesh = model.geom_dataid[index] if kind == "geom" else -1
    if mesh < 0 or model.geom_type[index] != GEOM.mjGEOM_MESH:
        return np.zeros(3), np.array([1.0, 0, 0, 0])
    return model.mesh_pos[mesh], model.mesh_quat[mesh]


def times(*quats: np.ndarray) -> np.ndarray:
    """The product of quaternions, in double precision."""
    product = np.array([1.0, 0, 0, 0])
    for quat in quats:
        mujoco.mju_mulQuat(product, product.copy(), np.asarray(quat, float))
    return product


def rotated(quat: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """A vector turned by a quaternion."""
    turned = np.zeros(3)
    mujoco.mju_rotVecQuat(turned, np.asarray(vector, float), np.asarray(quat, float))
    return turned


def put(element: Any, kind: str, model: mujoco.MjModel, index: int, pos: np.ndarray, quat: np.ndarray) -> None:
    """Gives an element the pose that it has in the compiled model."""
    shift, turn = in_mesh(model, kind, index)
    own = times(quat, turn * [1, -1, -1, -1])
    if hasattr(element, "quat"):
        element.quat = own
    element.pos = pos - rotated(own, shift)


def pose(element: Any, kind: str, model: mujoco.MjModel, index: int) -> tuple[np.ndarray, np.ndarray]:
    """The pose in the compiled model that an element has, after `prepare`."""
    shift, turn = in_mesh(model, kind, index)
    own = np.array(element.quat) if hasattr(element, "quat") else np.array([1.0, 0, 0, 0])
    return np.array(element.pos) + rotated(own, shift), times(own, turn)


def posed(kind: str) -> Callable[[mujoco.MjSpec, Any, mujoco.MjModel, int], None]:
    """How a spec is given the poses of a kind of element as the compiler found them."""

    def prepare(spec: mujoco.MjSpec, element: Any, model: mujoco.MjModel, index: int) -> None:
        """The pose by position and quaternion, in the frame of what the element hangs on."""
        specs.out_of_frames(element)
        if hasattr(element, "alt"):
            element.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        if hasattr(element, "fromto"):
            element.fromto = [np.nan] * 6
            element.size = of_model(model, f"{KINDS[kind].prefix}_size")[index]
        prefix = KINDS[kind].prefix
        quat = of_model(model, f"{prefix}_quat")[index] if hasattr(element, "quat") else np.array([1.0, 0, 0, 0])
        if kind == "light":
            element.dir = model.light_dir[index]
        if kind == "body" and _unweighed(model, np.array([index])).all():
            if element.explicitinertial:  # which cannot be told from the compiler's
                raise error([problem("arena.spec", "massless_inertial", None, Told(element.name))])
            not_simple(element)
        put(element, kind, model, index, of_model(model, f"{prefix}_pos")[index], quat)

    return prepare


def fitted(spec: mujoco.MjSpec, element: Any) -> str:
    """Why a geom cannot vary that is fitted to a mesh, which the compiled model does not say in all versions of MuJoCo."""
    fits = element.meshname and element.type not in (GEOM.mjGEOM_MESH, GEOM.mjGEOM_SDF)
    return "the compiler fits it to a mesh: use a primitive shape" if fits else ""


GEOM_WRAP = (int(mujoco.mjtWrap.mjWRAP_SPHERE), int(mujoco.mjtWrap.mjWRAP_CYLINDER))
WRAP_UNSEEN = "MJX decides once whether a tendon passes inside or outside of a geom"


def side_site(model: mujoco.MjModel, index: int) -> str:
    """Why MJX on JAX does not see a site move: it says on which side of a geom a tendon passes."""
    around = np.isin(model.wrap_type, GEOM_WRAP)
    return WRAP_UNSEEN if (np.round(model.wrap_prm[around]) == index).any() else ""


def aimed(kind: str) -> Callable[[mujoco.MjModel, int], str]:
    """Why the orientation of a camera or a light cannot vary."""
    modes = [int(mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY), int(mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODYCOM)]

    def refused(model: mujoco.MjModel, index: int) -> str:
        turns = of_model(model, f"{KINDS[kind].prefix}_mode")[index] in modes
        return f"it turns to its `target` in every state: vary `{kind}.pos`" if turns else ""

    return refused


def _unweighed(model: mujoco.MjModel, ids: np.ndarray) -> np.ndarray:
    """(N,) bool: bodies without an inertial. The compiler gives them one without mass, whose pose is, in numbers, the body's own."""
    same = (model.body_ipos == model.body_pos).all(-1) & (model.body_iquat == model.body_quat).all(-1)
    return (same & (model.body_mass == 0))[ids]


def _inertial(spec: mujoco.MjSpec, element: Any) -> str:
    """Why a body without mass cannot move.

    The compiler gives one without an inertial another, whose pose is in numbers that of the body, in the body's <frame>.
    """
    if element.explicitinertial or any(map(weighs, element.geoms)) or not _moved(element.frame):
        return ""
    return "it has no mass and is in a <frame>, which `attach` makes of a pose: take it out of this, or give it a mass"


def _moved(frame: Any) -> bool:
    """Whether a frame, or one in which it is, has a pose."""
    if frame is None:
        return False
    turned = frame.alt.type != mujoco.mjtOrientation.mjORIENTATION_QUAT or np.any(frame.quat != [1, 0, 0, 0])
    return bool(turned or np.any(frame.pos)) or _moved(frame.frame)


def _edge(model: mujoco.MjModel, index: int) -> str:
    """Why a body cannot vary where it is: a flex is measured by its bodies."""
    return (
        "it is a part of a flex, whose edges would be others: make an arena for each" if of_flex(model, index) else ""
    )


def _under(model: mujoco.MjModel, index: int) -> str:
    """Why a body cannot turn: the compiler measures a flex along the axes of the world."""
    if why := _edge(model, index):
        return why
    below = index in carriers_of_flexes(model)
    return (
        "a flex is on it, whose size along the axes of the world would be another: make an arena for each"
        if below
        else ""
    )


def poses(kind: str) -> dict[str, Attribute]:
    """Position and turn of a kind of element."""
    prefix = KINDS[kind].prefix
    in_spec = {"geom": fitted, "body": _inertial}.get(kind)

    def place(element: Any, value: np.ndarray, model: mujoco.MjModel, index: int) -> None:
        pos, quat = pose(element, kind, model, index)
        put(element, kind, model, index, np.where(np.isnan(value), pos, value), quat)

    def turn(element: Any, value: np.ndarray, model: mujoco.MjModel, index: int) -> None:
        pos, _ = pose(element, kind, model, index)
        put(
            element,
            kind,
            model,
            index,
            pos,
            times(of_model(model, f"{prefix}_quat")[index], rpy_quat(np.nan_to_num(value))),
        )

    free = [Target(name, (0, 1, 2), free=True) for name in ("qpos0", "qpos_spring")] if kind == "body" else []
    massless = [Target("body_ipos", of=_unweighed), Target("body_iquat", made=turned("body_quat"), of=_unweighed)]
    shift, turns = ([one] for one in massless) if kind == "body" else ([], [])
    found = {
        f"{kind}.pos": Attribute(
            number(kind, XYZ, "[m]"),
            (Target(f"{prefix}_pos"), *free, *shift),
            place,
            reader(f"{prefix}_pos", None, False),
            prepare=posed(kind),
            refused=_edge if kind == "body" else None,
            refused_in_spec=in_spec,
            unseen_on_jax=side_site if kind == "site" else None,
        )
    }
    if kind != "light":
        found[f"{kind}.rpy"] = Attribute(
            number(kind, RPY, "[rad]"),
            (
                Target(f"{prefix}_quat", made=turned(f"{prefix}_quat")),
                *(Target(t.field, (3, 4, 5, 6), turned("body_quat"), free=True) for t in free),
                *turns,
            ),
            turn,
            lambda model, ids: np.zeros((len(ids), 3)),
            prepare=posed(kind),
            refused=aimed(kind) if kind == "camera" else _under if kind == "body" else None,
            refused_in_spec=in_spec,
        )
    return found
