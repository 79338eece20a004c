"""Derivatives of the lengths of actuators at `qpos0`: `mj_transmission` in MuJoCo's `engine_core_smooth.c`."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.quaternions import conjugate, normalize, quat_rotate
from mjx_arenas.rows import replace_rows
from mjx_arenas.terms.attributes.joints import JOINT_TRN
from mjx_arenas.write.kinematics import BALL, FREE
from mjx_arenas.write.motion import Motion
from mjx_arenas.write.tendons import Tendons

_TRN = mujoco.mjtTrn


def moments(model: mjx.Model, state: Motion, tendon: Tendons) -> jax.Array:
    """(nactuator, nv) derivatives of the lengths of actuators, central: `mj_transmission`."""
    kinds = np.asarray(model.actuator_trntype)
    moment = jnp.zeros((len(kinds), model.nv))  # remains for adhesion: without contacts it moves nothing
    joint, site = np.isin(kinds, JOINT_TRN), kinds == _TRN.mjTRN_SITE
    crank, string = kinds == _TRN.mjTRN_SLIDERCRANK, kinds == _TRN.mjTRN_TENDON
    if joint.any():
        rows = state.central(_joint_moments(model, np.flatnonzero(joint)))
        moment = replace_rows(moment, np.flatnonzero(joint), rows)
    if site.any():
        moment = replace_rows(moment, np.flatnonzero(site), _site_moments(model, state, np.flatnonzero(site)))
    if crank.any():
        moment = replace_rows(moment, np.flatnonzero(crank), _crank_moments(model, state, np.flatnonzero(crank)))
    if string.any():
        rows = tendon.moment[np.asarray(model.actuator_trnid)[string, 0]] * model.actuator_gear[string, :1]
        moment = replace_rows(moment, np.flatnonzero(string), rows)
    return moment


def _joint_moments(model: mjx.Model, ids: np.ndarray) -> jax.Array:
    """(n, nv) of actuators `ids` on joints, original."""
    joint, gear = np.asarray(model.actuator_trnid)[ids, 0], model.actuator_gear[ids]
    kind = np.asarray(model.jnt_type)[joint]
    in_parent = np.asarray(model.actuator_trntype)[ids] == _TRN.mjTRN_JOINTINPARENT
    for turning, at in ((FREE, 3), (BALL, 0)):  # the place of the axis in the gear, and of the quaternion in qpos
        rows = np.flatnonzero(in_parent & (kind == turning))
        adr = np.asarray(model.jnt_qposadr)[joint[rows]] + at
        turn = conjugate(normalize(model.qpos0[adr[:, None] + np.arange(4)]))
        axis = quat_rotate(turn, gear[rows, at : at + 3])
        gear = replace_rows(gear, rows, jnp.concatenate([gear[rows, :at], axis, gear[rows, at + 3 :]], axis=1))
    index = np.arange(model.nv) - np.asarray(model.jnt_dofadr)[joint][:, None]
    own = (index >= 0) & (index < np.select([kind == FREE, kind == BALL], [6, 3], 1)[:, None])
    return jnp.where(own, gear[np.arange(len(ids))[:, None], np.clip(index, 0, 5)], 0.0)


def _site_moments(model: mjx.Model, state: Motion, ids: np.ndarray) -> jax.Array:
    """(n, nv) of actuators `ids` on sites, some relative to a reference site."""
    site, reference = np.asarray(model.actuator_trnid)[ids].T
    given = (reference >= 0)[:, None]
    base = np.where(reference >= 0, reference, site)  # the site in whose frame the gear is
    body = np.asarray(model.site_bodyid)
    gear, frame = model.actuator_gear[ids], state.frame(body[base], model.site_quat[base])
    push, twist = ((frame * gear[:, None, part]).sum(-1)[:, None] for part in (slice(0, 3), slice(3, 6)))

    def work(sites: np.ndarray, mask: np.ndarray) -> jax.Array:
        point = state.place(body[sites], model.site_pos[sites])
        lin, ang = state.jacobian(body[sites], point, np.arange(model.nv))
        return jnp.where(mask, (lin * push + ang * twist).sum(-1), 0.0)

    # What moves both does not change the one relative to the other.
    moves, moves_base = state.moved[body[site]], state.moved[body[base]] & given
    return work(site, moves & ~moves_base) - work(base, moves_base & ~moves)


def _crank_moments(model: mjx.Model, state: Motion, ids: np.ndarray) -> jax.Array:
    """(n, nv) of actuators `ids` that push a site through a rod, from a slider along the z axis of another."""
    sites = np.asarray(model.actuator_trnid)[ids].T
    body = np.asarray(model.site_bodyid)[sites]
    point = state.place(body, model.site_pos[sites])
    axis = state.frame(body[1], model.site_quat[sites[1]])[..., 2]
    vec = point[0] - point[1] + state.origin[body[0]] - state.origin[body[1]]
    along = (axis * vec).sum(-1, keepdims=True)
    square = along**2 + model.actuator_cranklength[ids][:, None] ** 2 - (vec * vec).sum(-1, keepdims=True)
    reaches = square > 0
    root = jnp.sqrt(jnp.where(reaches, square, 1.0))
    scale = jnp.where(reaches, 1 - along / root, 1.0)
    by_vec = axis * scale + jnp.where(reaches, vec / root, 0.0)
    lin, ang = state.jacobian(body, point, np.arange(model.nv))
    turn = (jnp.cross(ang[1], axis[:, None]) * (vec * scale)[:, None]).sum(-1)
    return (turn + ((lin[0] - lin[1]) * by_vec[:, None]).sum(-1)) * model.actuator_gear[ids, :1]
