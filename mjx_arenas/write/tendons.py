"""Lengths of tendons at `qpos0` and their derivatives: `mj_tendon` in MuJoCo's `engine_core_smooth.c`."""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx
from mujoco.mjx._src import support

from mjx_arenas.quaternions import norm, normalize
from mjx_arenas.rows import dot, replace_rows
from mjx_arenas.write.motion import Motion
from mjx_arenas.write.trees import GEOM_WRAP

_WRAP = mujoco.mjtWrap
_WRAP_NEWTON = {  # as near to C's as float32 comes
    "wrap_inside_maxiter": 20,
    "wrap_inside_tolerance": 1e-6,
    "wrap_inside_z_init": 1 - 1e-6,
}


class Tendons(NamedTuple):
    """Lengths of tendons, or of pieces of them."""

    length: jax.Array  # (ntendon,) [m], or of fixed tendons in the units of their coefficients
    moment: jax.Array  # (ntendon, nv) its derivative, central


class _Path(NamedTuple):
    """A piece of a spatial tendon between two sites, straight or around a geom."""

    tendon: int
    share: float  # of its length in the tendon's: one over the divisor of the pulley before
    ends: tuple[int, int]  # sites
    around: tuple[int, int, int] | None  # wrap type, geom, site on the side to pass or -1


def tendons(model: mjx.Model, state: Motion) -> Tendons:
    """All tendons: `mj_tendon`."""
    coef, moment = np.zeros((model.ntendon, model.nq)), np.zeros((model.ntendon, model.nv))
    for tendon, wrap in _elements(model):
        if model.wrap_type[wrap] == _WRAP.mjWRAP_JOINT:
            joint = model.wrap_objid[wrap]
            coef[tendon, model.jnt_qposadr[joint]] = moment[tendon, model.jnt_dofadr[joint]] = model.wrap_prm[wrap]
    fixed = Tendons((jnp.asarray(coef) * model.qpos0[None]).sum(1), jnp.asarray(moment))
    paths = _paths(model)
    if not paths:
        return fixed

    body = np.asarray(model.site_bodyid)[np.array([path.ends for path in paths]).T]
    near = state.place(np.asarray(model.site_bodyid), model.site_pos)[np.array([path.ends for path in paths]).T]
    site = state.origin[body] + near
    length, moment = _straight(state, body, site, near)
    bent = np.array([i for i, path in enumerate(paths) if path.around is not None], int)
    if len(bent):
        wraps, around = _wrapped(
            model, state, body[:, bent], site[:, bent], near[:, bent], [paths[i].around for i in bent]
        )
        length = replace_rows(length, bent, jnp.where(wraps, around.length, length[bent]))
        moment = replace_rows(moment, bent, jnp.where(wraps[:, None], around.moment, moment[bent]))
    share = np.zeros((model.ntendon, len(paths)))
    share[[path.tendon for path in paths], np.arange(len(paths))] = [path.share for path in paths]
    return Tendons(fixed.length + dot("tp,p->t", share, length), fixed.moment + dot("tp,pd->td", share, moment))


def _elements(model: mjx.Model) -> list[tuple[int, int]]:
    """Tendon and wrap object of all elements of all tendons."""
    spans = zip(np.asarray(model.tendon_adr).tolist(), np.asarray(model.tendon_num).tolist(), strict=True)
    return [(tendon, wrap) for tendon, (adr, num) in enumerate(spans) for wrap in range(adr, adr + num)]


def _paths(model: mjx.Model) -> list[_Path]:
    """The pieces of all spatial tendons."""
    paths, before, share, around = [], None, 1.0, None  # before: the site from which the tendon continues
    for tendon, wrap in _elements(model):
        kind, target, parameter = model.wrap_type[wrap], int(model.wrap_objid[wrap]), float(model.wrap_prm[wrap])
        if wrap == model.tendon_adr[tendon]:
            before, share = None, 1.0
        if kind == _WRAP.mjWRAP_PULLEY:
            before, share = None, 1 / parameter
        elif kind == _WRAP.mjWRAP_SITE:
            if before is not None:
                paths.append(_Path(tendon, share, (before, target), around))
            before, around = target, None
        elif kind in GEOM_WRAP:
            around = (int(kind), target, round(parameter))
    return paths


def _straight(state: Motion, body: np.ndarray, point: jax.Array, near: jax.Array) -> Tendons:
    """Lines from points (2, n, 3) to points, on `body` (2, n); `near` are the same, relative to the zeros of their trees."""
    length = norm(point[1] - point[0])
    direction = normalize(point[1] - point[0])
    lin, _ = state.jacobian(body, near, np.arange(len(state.lin)))
    moment = ((lin[1] - lin[0]) * direction[:, None]).sum(-1)
    return Tendons(length, jnp.where((body[0] != body[1])[:, None], moment, 0.0))


def _wrapped(
    model: mjx.Model,
    state: Motion,
    body: np.ndarray,
    site: jax.Array,
    near: jax.Array,
    around: Sequence[tuple[int, int, int] | None],
) -> tuple[jax.Array, Tendons]:
    """Whether (n,) tendons between sites (2, n, 3) on `body` (2, n) touch their geoms, and their arcs if so."""
    kind, geom, side = np.array(around).T
    geom_body, side_body = np.asarray(model.geom_bodyid)[geom], np.asarray(model.site_bodyid)[side]
    pos, mat = (
        state.origin[geom_body] + state.place(geom_body, model.geom_pos[geom]),
        state.frame(geom_body, model.geom_quat[geom]),
    )
    radius, side_pos = model.geom_size[geom, 0], state.origin[side_body] + state.place(side_body, model.site_pos[side])

    def wrap(inside: bool) -> tuple[jax.Array, jax.Array, jax.Array]:
        arrays = (*site, pos, mat, radius, side_pos, (side >= 0)[:, None], kind == _WRAP.mjWRAP_SPHERE)
        arc, first, last = jax.vmap(functools.partial(support.wrap, is_wrap_inside=inside, **_WRAP_NEWTON))(*arrays)
        return arc.reshape(-1, 1), first, last

    inside = ((side >= 0) & (norm(side_pos - pos) < radius))[:, None]
    arc, first, last = (jnp.where(inside, a, b) for a, b in zip(wrap(True), wrap(False), strict=True))
    first_near, last_near = first - state.origin[geom_body], last - state.origin[geom_body]
    to = _straight(state, np.stack([body[0], geom_body]), jnp.stack([site[0], first]), jnp.stack([near[0], first_near]))
    off = _straight(state, np.stack([geom_body, body[1]]), jnp.stack([last, site[1]]), jnp.stack([last_near, near[1]]))
    return arc[:, 0] >= 0, Tendons(to.length + arc[:, 0] + off.length, to.moment + off.moment)
