"""What may stand on a table: free bodies of one geom."""

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

GEOM_TYPES = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
}


@dataclasses.dataclass(frozen=True)
class Object:
    """A free body on a table.

    In the model it is the body `name` with the joint `{name}_joint0` and the geom `{name}_g0` (robosuite's names).
    """

    name: str
    type: str = "box"
    """"box", "sphere" or "capsule"; a capsule lies on its side, along its x axis."""
    full_size: float | Sequence[float] = 0.05
    """(3,) extents along x, y, z [m]: box edges; sphere (d, d, d); capsule (length with its caps, d, d). One number:
    all three."""
    table: int | str = 0
    """Index or body name of the table it stands on."""
    pos: Sequence[float] | None = None
    """(2,) nominal place [m] in the frame of the table's top. Default: spread over the table with its other objects."""
    rot: float = 0.0
    """Nominal yaw [rad] relative to the table."""
    density: float = 1000.0
    """[kg/m^3]"""
    friction: Sequence[float] = (1.0, 0.005, 0.0001)
    """(3,) sliding, torsional, rolling."""
    condim: int = 3
    rgba: Sequence[float] | None = None
    """(4,) colour. Default: one of a colour-blind safe palette."""

    def problems(self) -> list[str]:
        """What is wrong with this object, a sentence each."""
        where = f"Object {self.name!r}"
        if not isinstance(self.name, str) or not self.name:
            return [f"An object's `name` must be a non-empty string, got {self.name!r}."]
        out = []
        if self.type not in GEOM_TYPES:
            out.append(f"{where}: `type` must be one of {', '.join(GEOM_TYPES)}, got {self.type!r}.")
        size = _floats(self.full_size)
        if size is None or size.shape not in ((), (3,)) or not np.all(np.isfinite(size)) or not np.all(size > 0):
            out.append(
                f"{where}: `full_size` must be one number or 3 numbers, all > 0 [m], got {_show(self.full_size)}."
            )
        elif self.type == "sphere" and np.ptp(size) > 0:
            out.append(f"{where}: `full_size` of a sphere must have 3 equal extents, got {_show(self.full_size)}.")
        elif self.type == "capsule" and (size.ndim == 0 or size[1] != size[2] or size[0] <= size[1]):
            out.append(
                f"{where}: `full_size` of a capsule must be (length, diameter, diameter) with length > diameter, "
                f"got {_show(self.full_size)}."
            )
        for field, shape in (("pos", (2,)), ("rot", ()), ("density", ()), ("friction", (3,)), ("rgba", (4,))):
            value = getattr(self, field)
            if value is None and field in ("pos", "rgba"):
                continue
            array = _floats(value)
            if array is None or array.shape != shape or not np.all(np.isfinite(array)):
                kind = f"{shape[0]} finite numbers" if shape else "a finite number"
                out.append(f"{where}: `{field}` must be {kind}, got {_show(value)}.")
            elif field == "density" and np.any(array <= 0):
                out.append(f"{where}: `density` must be > 0 [kg/m^3], got {_show(value)}.")
            elif field == "friction" and np.any(array < 0):
                out.append(f"{where}: `friction` must be >= 0 on every axis, got {_show(value)}.")
            elif field == "rgba" and (np.any(array < 0) or np.any(array > 1)):
                out.append(f"{where}: `rgba` must be between 0 and 1, got {_show(value)}.")
        if self.condim not in (1, 3, 4, 6):
            out.append(f"{where}: `condim` must be 1, 3, 4 or 6, got {self.condim!r}.")
        return out

    @property
    def half_size(self) -> np.ndarray:
        """(3,) half extents [m]."""
        return np.broadcast_to(np.asarray(self.full_size, float) / 2, (3,))

    @property
    def geom_size(self) -> np.ndarray:
        """(3,) MuJoCo's `geom_size` of this type."""
        x, y, z = self.half_size
        return np.array({"box": (x, y, z), "sphere": (z, 0, 0), "capsule": (z, x - z, 0)}[self.type])

    @property
    def geom_quat(self) -> np.ndarray:
        """(4,) orientation of the geom in the body: a capsule's axis is the body's x axis."""
        return np.array([np.sqrt(0.5), 0, np.sqrt(0.5), 0]) if self.type == "capsule" else np.array([1.0, 0, 0, 0])


def _floats(value: object) -> np.ndarray | None:
    try:
        return np.asarray(value, float)
    except (TypeError, ValueError):
        return None


def _show(value: object) -> str:
    array = _floats(value)
    return repr(value) if array is None else str(array.tolist())
