"""Free trees, seen from their centres of mass.

A free body whose mass is far from its origin turns about a point far away: its inertia matrix is all but singular, and
float32 loses what makes it regular. Seen from the centre of mass it is not.
"""

from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.quaternions import conjugate, quat_rotate
from mjx_arenas.rows import replace_rows
from mjx_arenas.write.kinematics import FREE, Kinematics
from mjx_arenas.write.references import subtree_com, subtree_mass, subtrees

MINVAL = mujoco.mjMINVAL


class Centred(NamedTuple):
    """A model in which some free trees have their roots' origins at their centres of mass, and those at zero."""

    model: mjx.Model
    origin: jax.Array  # (nbody, 3) where in the world the zero of the body's tree is
    centre: jax.Array  # (nbody, 3) of centred roots, where their origins are now in their old frames


def centred(model: mjx.Model, kin: Kinematics, bodies: np.ndarray) -> Centred:
    """`model` with those of `bodies` (n,) centred that have a free joint; `kin` are its poses.

    The centre need not be exact: what is said of the tree is true of whatever point, and more digits near the centre.
    """
    joint = np.asarray(model.body_jntadr)[bodies]
    roots = bodies[(joint >= 0) & (np.asarray(model.jnt_type)[joint] == FREE)]
    zero = jnp.zeros_like(model.body_pos)
    if not len(roots):
        return Centred(model, zero, zero)
    heavy = (subtree_mass(model)[roots] > MINVAL)[:, None]
    arm = jnp.where(heavy, subtree_com(model, kin, roots) - kin.pos[roots], 0.0)
    local = jax.lax.stop_gradient(quat_rotate(conjugate(kin.quat[roots]), arm))

    offset = replace_rows(zero, roots, local)
    root = np.zeros(model.nbody, int)  # its place in `roots`
    member = subtrees(model)[roots]
    inside = member.sum(0) > 0
    root[inside] = member[:, inside].argmax(0)
    origin = jnp.where(inside[:, None], kin.place(roots, local)[root], 0.0)
    adr = np.asarray(model.jnt_qposadr)[np.asarray(model.body_jntadr)[roots]]
    place = (adr[:, None] + np.arange(3)).reshape(-1)
    moved: dict[str, Any] = {
        "qpos0": replace_rows(model.qpos0, place, jnp.zeros(place.shape)),
        "body_pos": model.body_pos - offset[model.body_parentid],
        "body_ipos": model.body_ipos - offset,
        "geom_pos": model.geom_pos - offset[model.geom_bodyid],
        "site_pos": model.site_pos - offset[model.site_bodyid],
    }
    return Centred(cast(mjx.Model, model.tree_replace(moved)), origin, offset)
