"""MJCF as one rigid body: all its geoms in one frame (host)."""

import mujoco
import numpy as np

from mjx_arenas.problem import Item, problem
from mjx_arenas.problems.messages import error
from mjx_arenas.spec import specs

_MOVING = {
    "joints": "joint",
    "actuators": "actuator",
    "sensors": "sensor",
    "equalities": "equality",
    "tendons": "tendon",
}
_MOVING |= {"pairs": "pair", "flexes": "flex", "skins": "skin"}
_SEEN = ("sites", "cameras", "lights")
_KEPT = (
    *(
        "contype",
        "conaffinity",
        "condim",
        "group",
        "priority",
        "friction",
        "solmix",
        "solref",
        "solimp",
        "margin",
        "gap",
    ),
    *("fluid_ellipsoid", "fluid_coefs", "material", "rgba", "type", "meshname", "hfieldname", "surfacevel", "adhesion"),
    *(["castshadow"] if hasattr(mujoco.MjsGeom, "castshadow") else []),  # of MuJoCo 4
)
_MESH = mujoco.mjtGeom.mjGEOM_MESH


def flatten(spec: mujoco.MjSpec, item: Item) -> None:
    """Puts all geoms of a spec directly into its world, where they are, and takes away its bodies, sites, cameras and lights.

    Raises:
        ValueError: it has joints, or what belongs to no one body.
    """
    counts = {name: len(getattr(spec, name)) for name in _MOVING}
    moving = [
        f"{n} {name if n > 1 else one}" for (name, one), n in zip(_MOVING.items(), counts.values(), strict=True) if n
    ]
    if moving:
        raise error([problem("objects.file", "variant_moves", item, names=moving)])
    for name in _SEEN:
        for element in list(getattr(spec, name)):
            spec.delete(element)
    model = specs.compiled(spec.copy(), "objects.file", item)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = []
    for g, geom in enumerate(spec.geoms):
        kept = {name: getattr(geom, name) for name in _KEPT} | {"name": geom.name or f"geom{g}"}
        kept = {name: np.array(x) if isinstance(x, np.ndarray) else x for name, x in kept.items()}
        pos, quat, size = np.array(data.geom_xpos[g]), np.zeros(4), np.array(model.geom_size[g])
        mujoco.mju_mat2Quat(quat, data.geom_xmat[g])
        if geom.type == _MESH:  # its own frame is where its inertia's is, which the compiler sees to
            pos, quat = _before_centring(model, int(model.geom_dataid[g]), pos, quat)
        elif geom.meshname:
            kept["meshname"] = ""
        found.append((kept, pos, quat, size))
    for geom in list(spec.geoms):
        spec.delete(geom)
    for body in list(spec.worldbody.bodies):
        spec.delete(body)
    for kept, pos, quat, size in found:
        geom = specs.add_geom(spec.worldbody, kept.pop("name"), kept["type"])
        specs.assign(geom, **kept, pos=pos, quat=quat, size=size, mass=0)


def _before_centring(
    model: mujoco.MjModel, mesh: int, pos: np.ndarray, quat: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The pose of a mesh's file, from that of the mesh as it is compiled, about its centre and along its axes."""
    back, turn, shift = np.zeros(4), np.zeros(4), np.zeros(3)
    mujoco.mju_negQuat(back, model.mesh_quat[mesh])
    mujoco.mju_mulQuat(turn, quat, back)
    mujoco.mju_rotVecQuat(shift, model.mesh_pos[mesh], turn)
    return pos - shift, turn


def inertial(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centre of mass (3,), principal axes (4,) and moments (3,) of all bodies of a model as one, in the frame of the first."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    if model.nbody == 2:
        return model.body_ipos[1].copy(), model.body_iquat[1].copy(), model.body_inertia[1].copy()
    frame, origin = data.xmat[1].reshape(3, 3), data.xpos[1]
    mass, places = model.body_mass[1:], (data.xipos[1:] - origin) @ frame
    middle = mass @ places / mass.sum()
    tensor = np.zeros((3, 3))
    for b in range(1, model.nbody):
        axes, arm = frame.T @ data.ximat[b].reshape(3, 3), places[b - 1] - middle
        tensor += axes @ np.diag(model.body_inertia[b]) @ axes.T
        tensor += mass[b - 1] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    moments, axes, quat = np.zeros(3), np.zeros(9), np.zeros(4)
    mujoco.mju_eig3(moments, axes, quat, tensor.reshape(-1))
    return middle, quat, moments
