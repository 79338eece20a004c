"""Free bodies of a user's scene as objects: what they are, as they stand there (host)."""

import dataclasses
from typing import NamedTuple

import mujoco
import numpy as np

from mjx_arenas.problem import Problem
from mjx_arenas.spec import objects
from mjx_arenas.spec.extents import extents
from mjx_arenas.spec.objects import Measures, Object

SCENE = "scene"  # type of an `Object` that asks for a body of the scene
UPRIGHT = 1e-6  # sine of the largest tilt that is taken for none
_PLAIN = (1.0, 0.0, 0.0, 0.0)
_MEASURES = Measures(np.zeros(3), np.zeros(3), 0.0, 0.0, np.zeros(3), np.zeros(4))


@dataclasses.dataclass(frozen=True)
class SceneObject(Object):
    """An object that the scene has already; `type` is what it is: a primitive shape whose size may vary, else "mjcf"."""

    own_joint: str = ""
    own_geom: str = ""  # of a primitive shape
    own_tilt: tuple[float, float, float, float] = _PLAIN
    measures: Measures = dataclasses.field(default=_MEASURES, compare=False)

    @property
    def joint(self) -> str:
        """Name of its free joint."""
        return self.own_joint

    @property
    def geom(self) -> str:
        """Name of its one geom, of a primitive shape."""
        return self.own_geom

    @property
    def tilt(self) -> tuple[float, float, float, float]:
        """Quaternion: how it stands before its yaw."""
        return self.own_tilt

    def prefixed(self, prefix: str) -> "SceneObject":
        """The same, whose names have a prefix."""
        joint, geom = prefix + self.own_joint, prefix + self.own_geom
        return dataclasses.replace(self, name=prefix + self.name, own_joint=joint, own_geom=geom)

    def problems(self) -> list[Problem]:
        """None: it was found right."""
        return []


class Stance(NamedTuple):
    """How a body stands in the compiled scene."""

    yaw: float  # [rad]
    tilt: np.ndarray  # (4,) quaternion before the yaw
    low: (
        np.ndarray
    )  # (3,) lowest coordinates of what collides, from the body's origin, along axes that the yaw turned [m]
    high: np.ndarray  # (3,) highest

    @property
    def is_upright(self) -> bool:
        """Whether the body's z axis points up."""
        return not self.tilt[1:].any()


def stance(model: mujoco.MjModel, data: mujoco.MjData, body: int, geoms: np.ndarray) -> Stance:
    """How a body stands whose `geoms` (ngeom,) bool collide.

    The yaw of one that does not stand upright is the heading of that of its axes about which the rectangle around it is the smallest.
    """
    turn, pos = data.xmat[body].reshape(3, 3), data.xpos[body]
    upright = np.hypot(*turn[:2, 2]) <= UPRIGHT and turn[2, 2] > 0
    found = []
    for axis in turn.T[:1] if upright else turn.T:
        if np.hypot(*axis[:2]) > 0.1:
            yaw = float(np.arctan2(axis[1], axis[0]))
            cos, sin = np.cos(yaw), np.sin(yaw)
            axes = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
            low, high = extents(model, data, geoms, pos, axes)
            found.append((np.prod((high - low)[:2]), yaw, low, high))
    _, yaw, low, high = min(found, key=lambda one: round(one[0], 9))
    tilt = np.array(_PLAIN)
    if not upright:
        mujoco.mju_mulQuat(tilt, np.array([np.cos(yaw / 2), 0, 0, -np.sin(yaw / 2)]), data.xquat[body])
    return Stance(yaw, tilt, low, high)


def primitive(spec: mujoco.MjSpec, model: mujoco.MjModel, name: str, upright: bool) -> str:
    """The type of a body of one primitive shape that is centred and turned as those of objects are; else "mjcf"."""
    body = spec.body(name)
    if not upright or body.explicitinertial or len(body.geoms) != 1 or len(body.bodies):
        return "mjcf"
    geom = body.geoms[0]
    index, turn = model.geom(geom.name).id, np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[index])
    x, y, z = np.abs(turn.reshape(3, 3).T) > 1 - UPRIGHT**2  # which of the body's axes each of the geom's is along
    aligned = {"sphere": True, "capsule": z[0], "cylinder": z[2], "box": x[0] and y[1] and z[2]}
    kind = next((kind for kind, of in objects.GEOM_TYPES.items() if of == geom.type), "mjcf")
    solid = geom.typeinertia == mujoco.mjtGeomInertia.mjINERTIA_VOLUME and not geom.fluid_ellipsoid
    centred = np.abs(model.geom_pos[index]).max() <= UPRIGHT * model.geom_rbound[index]
    return kind if aligned.get(kind, False) and solid and centred else "mjcf"
