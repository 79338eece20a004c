"""Geoms and contact pairs."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from mujoco.mjx._src import collision_driver

from mjx_arenas.named import WEIGHT
from mjx_arenas.primitives import SIZES
from mjx_arenas.spec import masses, weighed
from mjx_arenas.terms.attributes.attribute import (
    GEOM,
    LIGHTEST,
    RGBA,
    Attribute,
    Target,
    impedance,
    nowhere,
    number,
    only_on_warp,
    plain,
    reader,
    reference,
    setter,
)
from mjx_arenas.terms.attributes.poses import GEOM_WRAP, WRAP_UNSEEN, fitted, posed, poses
from mjx_arenas.terms.attributes.prepare import shared, weighs


def _sized(model: mujoco.MjModel, ids: np.ndarray) -> np.ndarray:
    count = np.array([SIZES.get(mujoco.mjtGeom(kind), 0) for kind in model.geom_type[ids]], int)
    return np.arange(3) < count[:, None]


def _has_size(model: mujoco.MjModel, index: int) -> str:
    kind = mujoco.mjtGeom(model.geom_type[index])
    name = kind.name[7:].lower()
    return "" if kind in SIZES else f"it is a {name}, whose size MJX shares between worlds: use a primitive shape"


def _explicit_size(spec: mujoco.MjSpec, element: Any, model: mujoco.MjModel, index: int) -> None:
    if np.isfinite(element.fromto[0]):
        posed("geom")(spec, element, model, index)
    element.size = model.geom_size[index]


def _margin_unseen(kind: str) -> Callable[[mujoco.MjModel, int], str]:
    """Why MJX on JAX has no margin of a geom, or of a pair: it may meet a mesh or a height field."""

    def unseen(model: mujoco.MjModel, index: int) -> str:
        without = {int(GEOM.mjGEOM_MESH): "meshes", int(GEOM.mjGEOM_HFIELD): "height fields"}
        for one, other, pair in (
            collision_driver.geom_pairs(model) if np.isin(model.geom_type, list(without)).any() else ()
        ):
            met = [without[one_kind] for one_kind in model.geom_type[[one, other]].tolist() if one_kind in without]
            if met and (pair == index if kind == "pair" else index in (one, other)):
                return f"MJX has no margins of contacts with {met[0]}"
        return ""

    return unseen


def never_read(model: mujoco.MjModel, index: int) -> str:
    """Why MJX on JAX does not see a gap vary."""
    return "MJX never reads it"


def _wrap_unseen(model: mujoco.MjModel, index: int) -> str:
    """Why MJX on JAX does not see a geom move: a tendon goes through it, or round it on the side of a site."""
    on_path = np.isin(model.wrap_type, GEOM_WRAP) & (model.wrap_objid == index) & (model.wrap_prm >= 0)
    return WRAP_UNSEEN if on_path.any() else ""


def _contacts(kind: str) -> dict[str, Attribute]:
    return {
        f"{kind}.solref": plain(kind, "solref", reference(kind)),
        f"{kind}.solimp": plain(kind, "solimp", impedance(kind)),
        f"{kind}.margin": plain(kind, "margin", number(kind, "", "[m]", 0.0), unseen_on_jax=_margin_unseen(kind)),
        f"{kind}.gap": plain(kind, "gap", number(kind, "", "[m]", 0.0), unseen_on_jax=never_read),
    }


def _adhesion(kind: str) -> Attribute:
    return plain(
        kind,
        "adhesion",
        number(kind, "", "[N]", 0.0),
        refused=nowhere("geom_adhesion", "pair_adhesion"),
        unseen_on_jax=only_on_warp,
    )


def _weighs(spec: mujoco.MjSpec, element: Any) -> str:
    """Why a body does not feel what a geom weighs."""
    if element.parent.name == "world":
        return "the world has no mass: take geoms of other bodies"
    if not masses.weighs(element):
        return "its group is outside `inertiagrouprange`: vary `body.mass`"
    own = f"body {element.parent.name!r} has an inertial of its own: vary `body.mass`"
    return "" if masses.inferred(element.parent) else own


def _has_density(spec: mujoco.MjSpec, element: Any) -> str:
    """Why a geom's density cannot vary."""
    return _weighs(spec, element) or (
        "it has a `mass`: vary `geom.mass`" if not np.isnan(element.mass) else _none(element.density)
    )


def _has_mass(spec: mujoco.MjSpec, element: Any) -> str:
    """Why a geom's mass cannot vary."""
    return _weighs(spec, element) or _none(element.density if np.isnan(element.mass) else element.mass)


def _none(number: float) -> str:
    return "" if number else "it weighs nothing: give it a small number in the MJCF"


def _explicit_mass(spec: mujoco.MjSpec, element: Any, model: mujoco.MjModel, index: int) -> None:
    found = weighed.of(spec, [element.name])
    element.mass = float(found.mass[found.geom == index][0])


def _resized(spec: mujoco.MjSpec, element: Any) -> str:
    """Why a geom's size cannot vary that a mesh decides, or whose mass is on its surface."""
    if why := fitted(spec, element):
        return why
    hollow = element.typeinertia != mujoco.mjtGeomInertia.mjINERTIA_VOLUME and not _weighs(spec, element)
    return "its body's inertia follows from its surface (`shellinertia`): give the body an <inertial>" if hollow else ""


_WEIGHT = (Target(WEIGHT, share=True),)
GEOMS = {
    **{name: row._replace(unseen_on_jax=_wrap_unseen, ends_point=weighs) for name, row in poses("geom").items()},
    "geom.size": Attribute(
        number("geom", "first, second, third", "[m], half sizes", LIGHTEST),
        (Target("geom_size"),),
        setter("size"),
        reader("geom_size", None, False),
        prepare=_explicit_size,
        ends_point=shared,
        used=_sized,
        refused=_has_size,
        refused_in_spec=_resized,
        unseen_on_jax=_wrap_unseen,
    ),
    "geom.density": Attribute(
        number("geom", "", "[kg/m^3]", LIGHTEST),
        _WEIGHT,
        setter("density"),
        told=lambda element: element.density,
        ends_point=shared,
        refused_in_spec=_has_density,
    ),
    "geom.mass": Attribute(
        number("geom", "", "[kg]", LIGHTEST, mujoco.mjMAXVAL),
        _WEIGHT,
        setter("mass"),
        told=lambda element: element.mass,
        prepare=_explicit_mass,
        ends_point=shared,
        refused_in_spec=_has_mass,
    ),
    "geom.friction": plain("geom", "friction", number("geom", "sliding, torsional, rolling", "", 0.0)),
    "geom.rgba": plain("geom", "rgba", number("geom", RGBA, "", 0.0, 1.0)),
    "geom.solmix": plain("geom", "solmix", number("geom", "", "", 0.0)),
    **_contacts("geom"),
    "geom.surfacevel": plain(
        "geom",
        "surfacevel",
        number("geom", "x, y, z, about x, about y, about z", "[m/s] and [rad/s]"),
        refused=nowhere("geom_surfacevel"),
        unseen_on_jax=only_on_warp,
    ),
    "geom.adhesion": _adhesion("geom"),
}
PAIR = {
    "pair.friction": plain(
        "pair", "friction", number("pair", "sliding, sliding across, torsional, rolling, rolling across", "", 0.0)
    ),
    "pair.solreffriction": plain("pair", "solreffriction", reference("pair")),
    **_contacts("pair"),
    "pair.adhesion": _adhesion("pair"),
}
