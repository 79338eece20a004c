"""Free bodies whose frames the compiler puts where their mass is: what cannot vary on them (host)."""

from typing import Any

import mujoco

from mjx_arenas.spec import masses
from mjx_arenas.terms.attributes.attribute import Attribute

_POSES = ("pos", "rpy", "dir")
_OF_BODY = (*_POSES, "mass", "mass_alone", "inertia", "ipos", "payload", "pseudo_inertia")
_OF_WEIGHT = ("geom.size", "geom.density", "geom.mass")
WHY = 'the body is free and aligned with its inertia: set `align="false"` of its free joint'


def refused_on_aligned(attributes: dict[str, Attribute]) -> dict[str, Attribute]:
    """The attributes, of which those that have a place on a body, or move its centre of mass, cannot vary on aligned ones."""
    return {name: _refused(name, one) for name, one in attributes.items()}


def _refused(attribute: str, row: Attribute) -> Attribute:
    kind, _, name = attribute.partition(".")
    on_body = kind in ("geom", "site", "camera", "light") and name in _POSES
    if not on_body and not (kind == "body" and name in _OF_BODY) and attribute not in _OF_WEIGHT:
        return row
    other = row.refused_in_spec

    def refused(spec: mujoco.MjSpec, element: Any) -> str:
        body = element if kind == "body" else element.parent
        if masses.aligned(body) and (attribute not in _OF_WEIGHT or masses.inferred(body)):
            return WHY
        return other(spec, element) if other else ""

    return row._replace(refused_in_spec=refused)
