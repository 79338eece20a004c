"""Vertices of flexes, whose edges the compiler weighs: what cannot vary on them (host)."""

import mujoco
import numpy as np

from mjx_arenas.terms.attributes.attribute import KINDS, Attribute

_WEIGHING = {
    "body": ("mass", "mass_alone", "inertia", "ipos", "pseudo_inertia", "payload"),
    "geom": ("pos", "rpy", "size", "density", "mass"),
    "joint": ("pos", "axis"),
}
"""Attributes of which, or of what a spec needs before they can be set, the weights of edges follow."""


def refused_on_vertices(attributes: dict[str, Attribute]) -> dict[str, Attribute]:
    """The attributes, of which those from which the weights of edges follow cannot vary on vertices of a flex."""
    return {name: _refused(name, one) for name, one in attributes.items()}


def _refused(attribute: str, row: Attribute) -> Attribute:
    kind, _, name = attribute.partition(".")
    if name not in _WEIGHING.get(kind, ()):
        return row
    other = row.refused

    def refused(model: mujoco.MjModel, index: int) -> str:
        body = index if kind == "body" else int(getattr(model, f"{KINDS[kind].prefix}_bodyid")[index])
        if body in _vertices(model):
            return "the edges of a flex would have other weights: make an arena for each"
        return other(model, index) if other else ""

    return row._replace(refused=refused)


def _vertices(model: mujoco.MjModel) -> set[int]:
    """Bodies that move and are vertices of flexes; not those of rigid ones, whose edges have no weights."""
    soft = np.repeat(model.flex_rigid == 0, model.flex_vertnum)
    return {body for body in model.flex_vertbodyid[soft].tolist() if body > 0 and model.body_weldid[body]}
