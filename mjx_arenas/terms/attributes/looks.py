"""What is seen: cameras, lights and materials."""

from typing import Any

import mujoco
import numpy as np

from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import LARGEST, Quantity, whole
from mjx_arenas.spec import specs
from mjx_arenas.terms.attributes.attribute import (
    LIGHTEST,
    RGB,
    RGBA,
    SOME,
    XYZ,
    Attribute,
    Target,
    number,
    plain,
    reader,
    setter,
    unit,
)
from mjx_arenas.terms.attributes.poses import aimed, posed, poses


def _no_intrinsics(model: mujoco.MjModel, index: int) -> str:
    return "its `focal` and `sensorsize` decide: vary `camera.focal`" if model.cam_sensorsize[index].any() else ""


def _intrinsics(model: mujoco.MjModel, index: int) -> str:
    return "" if model.cam_sensorsize[index].all() else "it has no `sensorsize`: vary `camera.fovy`"


def _in_meters(spec: mujoco.MjSpec, element: Any, model: mujoco.MjModel, index: int) -> None:
    """Focal lengths and principal points as lengths, which pixels would overrule."""
    numbers = model.cam_intrinsic[index]
    specs.assign(
        element, focal_length=numbers[:2], focal_pixel=[0, 0], principal_length=numbers[2:], principal_pixel=[0, 0]
    )


def _fovy(values: Array, model: mujoco.MjModel, ids: np.ndarray) -> Array:
    """(N, 1) vertical field of view [degrees], as the compiler derives it from the focal length."""
    xp = array_module(values)
    height = xp.asarray(model.cam_sensorsize[ids, 1], values.dtype)
    return xp.rad2deg(2 * xp.arctan2(height, 2 * values[:, 1]))[:, None]


def _intrinsic(name: str, axes: str, columns: tuple[int, int], low: float, *more: Target) -> Attribute:
    return Attribute(
        number("camera", axes, "[m]", low),
        (Target("cam_intrinsic", columns), *more),
        setter(f"{name}_length"),
        reader("cam_intrinsic", columns, False),
        prepare=_in_meters,
        refused=_intrinsics,
    )


def _choice(kind: str, of: str, target: Target, edit: Any, read: Any) -> Attribute:
    """The index of a texture or a material that the model has, or -1 for none."""
    must = f"the `id` of a {of} (`arena.mj_model.{of}(name).id`), or -1 for none"
    quantity = Quantity(kind, (), float, "", whole, must, ids_of=of)
    count, one = {"texture": ("ntex", "tex"), "material": ("nmat", "mat")}[of]

    def refused(model: mujoco.MjModel, index: int) -> str:
        names = [getattr(model, one)(i).name for i in range(getattr(model, count))]
        if not names:
            return f"the arena has no {of}: add one by `arena.add_material`"
        return "" if all(names) else f"{of} {names.index('')} has no name: give it one"

    def limits(model: mujoco.MjModel, ids: np.ndarray) -> tuple[float, float]:
        return -1.0, getattr(model, count) - 1.0

    return Attribute(quantity, (target,), edit, read, limits=limits, refused=refused)


def _set_texture(element: Any, value: np.ndarray, model: mujoco.MjModel, index: int) -> None:
    names = list(element.textures)
    names[_RGB_ROLE] = model.tex(int(value)).name if value >= 0 else ""
    element.textures = names


def _set_material(element: Any, value: np.ndarray, model: mujoco.MjModel, index: int) -> None:
    element.material = model.mat(int(value)).name if value >= 0 else ""


_RGB_ROLE = int(mujoco.mjtTextureRole.mjTEXROLE_RGB)
CAMERA = {
    **poses("camera"),
    "camera.focal": _intrinsic("focal", "x, y", (0, 1), LIGHTEST, Target("cam_fovy", made=_fovy)),
    "camera.principal": _intrinsic("principal", "x, y", (2, 3), -LARGEST),
    "camera.fovy": plain("camera", "fovy", number("camera", "", "[degrees]", LIGHTEST, 179.0), refused=_no_intrinsics),
}
LIGHT = {
    **poses("light"),
    "light.dir": Attribute(
        number("light", XYZ)._replace(together=SOME),
        (Target("light_dir", made=unit),),
        setter("dir"),
        reader("light_dir", None, False),
        prepare=posed("light"),
        refused=aimed("light"),
    ),
    **{
        f"light.{name}": plain("light", name, number("light", RGB, "", 0.0, 1.0))
        for name in ("ambient", "diffuse", "specular")
    },
    "light.type": Attribute(
        Quantity("light", (), float, "", whole, "0 (spot), 1 (directional) or 2 (point)", (0, 2)),
        (Target("light_type"),),
        lambda element, value, model, index: setattr(element, "type", mujoco.mjtLightType(int(value))),
        reader("light_type", None, True),
    ),
    "light.attenuation": plain("light", "attenuation", number("light", "constant, linear, quadratic", "", 0.0)),
    "light.cutoff": plain("light", "cutoff", number("light", "", "[degrees]", 0.0, 180.0)),
    "light.exponent": plain("light", "exponent", number("light", "", "", 0.0)),
    **{f"light.{name}": plain("light", name, Quantity("light", (), bool)) for name in ("active", "castshadow")},
}
MATERIAL = {
    "material.texture": _choice(
        "material",
        "texture",
        Target("mat_texid", (_RGB_ROLE,)),
        _set_texture,
        lambda model, ids: np.array(model.mat_texid[ids, _RGB_ROLE], float),
    ),
    "material.rgba": plain("material", "rgba", number("material", RGBA, "", 0.0, 1.0)),
    **{
        f"material.{name}": plain("material", name, number("material", "", "", 0.0, high))
        for name, high in (("emission", LARGEST), ("specular", 1.0), ("shininess", 1.0))
    },
    "material.texrepeat": plain("material", "texrepeat", number("material", "x, y", "", LIGHTEST)),
    "material.texuniform": plain("material", "texuniform", Quantity("material", (), bool)),
}
SURFACE = {
    "geom.material": _choice("geom", "material", Target("geom_matid"), _set_material, reader("geom_matid", None, True)),
}
