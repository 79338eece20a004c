"""Attributes of MJCF elements that can vary: where the model has them, and how a spec takes them (host).

One row an attribute, by MJCF's own names: a new one is one row more, and the proof of the arena that uses it holds it against
MuJoCo's compiler. N elements of one kind are selected at a time.
"""

from mjx_arenas.terms.attributes.actuators import ACTUATOR, EQUALITY
from mjx_arenas.terms.attributes.aligned import refused_on_aligned
from mjx_arenas.terms.attributes.attribute import KINDS, Attribute, Target
from mjx_arenas.terms.attributes.bodies import BODY
from mjx_arenas.terms.attributes.flexed import refused_on_vertices
from mjx_arenas.terms.attributes.geoms import GEOMS, PAIR
from mjx_arenas.terms.attributes.joints import JOINTS, TENDON
from mjx_arenas.terms.attributes.looks import CAMERA, LIGHT, MATERIAL, SURFACE
from mjx_arenas.terms.attributes.options import OPTIONS
from mjx_arenas.terms.attributes.poses import poses
from mjx_arenas.terms.attributes.states import PRESENCE, STARTS

__all__ = ["ATTRIBUTES", "KINDS", "Attribute", "Target"]

_ROWS: dict[str, Attribute] = {
    **BODY,
    **GEOMS,
    **SURFACE,
    **PAIR,
    **JOINTS,
    **TENDON,
    **ACTUATOR,
    **EQUALITY,
    **poses("site"),
    **CAMERA,
    **LIGHT,
    **MATERIAL,
    **OPTIONS,
    **STARTS,
    **PRESENCE,
}
ATTRIBUTES = refused_on_vertices(refused_on_aligned(_ROWS))
"""Every attribute that can vary, by its kind of element and its name: `sorted(dr.ATTRIBUTES)` lists them. docs/terms.md describes them."""
