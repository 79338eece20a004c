"""What a spec is given before one attribute of an element can be set without the others (host)."""

from typing import Any

import mujoco
import numpy as np

from mjx_arenas.spec import masses, specs


def not_simple(body: Any) -> None:
    """No short-cut for bodies whose centre of mass is their origin: worlds would differ in the layout of matrices."""
    if body.name != "world":
        body.simple = 0


def always(element: Any) -> bool:
    """What moves the centre of mass of a body, its axes of inertia, or its joints."""
    return True


def shared(geom: Any) -> bool:
    """Of the size or the weight of a geom: a body has the centre of mass and the axes of its only geom that weighs, and else a mean."""
    weighing = [one for one in geom.parent.geoms if weighs(one)]
    return geom in weighing and len(weighing) > 1


def weighs(geom: Any) -> bool:
    """Whether the compiler makes an inertial of the geom."""
    return masses.inferred(geom.parent) and masses.makes_inertial(geom)


def always_inferred(spec: mujoco.MjSpec, element: Any) -> str:
    """Why a body cannot be given an inertial of its own."""
    rule = element.compiler.inertiafromgeom
    always = rule == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    return 'the compiler takes it from the geoms: set `inertiafromgeom="auto"`' if always else ""


def weighed(spec: mujoco.MjSpec, element: Any, model: mujoco.MjModel, index: int) -> None:
    """The inertial as the compiler found it, whatever the geoms are from now on."""
    specs.assign(element, explicitinertial=True, mass=model.body_mass[index], inertia=model.body_inertia[index])
    specs.assign(element, ipos=model.body_ipos[index], iquat=model.body_iquat[index], fullinertia=[np.nan] + [0] * 5)
    element.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
