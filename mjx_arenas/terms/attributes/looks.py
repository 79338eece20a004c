"""What is seen: cameras, lights and materials."""

import mujoco

from mjx_arenas.params.params import LARGEST, Quantity
from mjx_arenas.terms.attributes.attribute import (
    LIGHTEST,
    RGB,
    RGBA,
    XYZ,
    Attribute,
    Target,
    number,
    plain,
    reader,
    setter,
    unit,
)
from mjx_arenas.terms.attributes.poses import poses


def _no_intrinsics(model: mujoco.MjModel, index: int) -> str:
    return "its `focal` and `sensorsize` decide" if model.cam_sensorsize[index].any() else ""


CAMERA = {
    **poses("camera"),
    "camera.fovy": plain("camera", "fovy", number("camera", "", "[degrees]", LIGHTEST, 179.0), refused=_no_intrinsics),
}
LIGHT = {
    **poses("light"),
    "light.dir": Attribute(
        number("light", XYZ), (Target("light_dir", made=unit),), setter("dir"), reader("light_dir", None, False)
    ),
    **{
        f"light.{name}": plain("light", name, number("light", RGB, "", 0.0, 1.0))
        for name in ("ambient", "diffuse", "specular")
    },
    "light.attenuation": plain("light", "attenuation", number("light", "constant, linear, quadratic", "", 0.0)),
    "light.cutoff": plain("light", "cutoff", number("light", "", "[degrees]", 0.0, 180.0)),
    "light.exponent": plain("light", "exponent", number("light", "", "", 0.0)),
    **{f"light.{name}": plain("light", name, Quantity("light", (), bool)) for name in ("active", "castshadow")},
}
MATERIAL = {
    "material.rgba": plain("material", "rgba", number("material", RGBA, "", 0.0, 1.0)),
    **{
        f"material.{name}": plain("material", name, number("material", "", "", 0.0, high))
        for name, high in (("emission", LARGEST), ("specular", 1.0), ("shininess", 1.0))
    },
}
