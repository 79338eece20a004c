"""`mj_setConst` for `mjx.Model`: the fields that follow from masses, sizes and poses at `qpos0`, traced and batched.

The formulas are those of `setFixed` and `set0` in MuJoCo's `engine_setconst.c`, and of what they call in
`engine_core_smooth.c`. A tree is a moving body on the static world with all its descendants; the inertia matrix has
one block for each tree. The rows of Jacobians have `nv` columns.
"""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx
from mujoco.mjx._src import support

from mjx_arenas import derived
from mjx_arenas.derived import (
    BALL,
    FREE,
    HINGE,
    MINVAL,
    SLIDE,
    norm,
    quat_mul,
    quat_rotate,
    quat_to_mat,
    replace_rows,
)

_GEOM, _TRN, _WRAP, _EQ, _OBJ = mujoco.mjtGeom, mujoco.mjtTrn, mujoco.mjtWrap, mujoco.mjtEq, mujoco.mjtObj
_JOINT_TRN = (int(_TRN.mjTRN_JOINT), int(_TRN.mjTRN_JOINTINPARENT))
_SITE_TRN = (int(_TRN.mjTRN_SITE), int(_TRN.mjTRN_SLIDERCRANK))
_GEOM_WRAP = (int(_WRAP.mjWRAP_SPHERE), int(_WRAP.mjWRAP_CYLINDER))
_KNOWN = {
    "actuator_trntype": (_TRN, (*_JOINT_TRN, *_SITE_TRN, int(_TRN.mjTRN_TENDON), int(_TRN.mjTRN_BODY))),
    "wrap_type": (
        _WRAP,
        (*_GEOM_WRAP, *(int(k) for k in (_WRAP.mjWRAP_JOINT, _WRAP.mjWRAP_SITE, _WRAP.mjWRAP_PULLEY))),
    ),
}
_WELD_MARK = 11  # column of `eq_data` in which MuJoCo 4 marks welds whose pose is that of `qpos0`
_WRAP_NEWTON = {  # as near to C's as float32 comes
    "wrap_inside_maxiter": 20,
    "wrap_inside_tolerance": 1e-6,
    "wrap_inside_z_init": 1 - 1e-6,
}
_CONJUGATE = np.array([1, -1, -1, -1])


def set_const(model: mjx.Model) -> mjx.Model:
    """`model` with the fields that `mj_setConst` derives, as if it had been compiled with its other values.

    Call it after changes of `qpos0` or of masses, inertias, armatures, sizes, positions or orientations, inside `jit`
    and `vmap`, too. As in MuJoCo 3, the statistics follow, over those that the MJCF gives. Left alone are integers and
    the structure of the tree, which MJX shares between worlds; the fields of lights on `impl="jax"`, which neither
    reads them nor knows their bodies; and `actuator_armature`, which MJX does not simulate.

    Raises:
        NotImplementedError: for a model with flexes or, on Warp, ellipsoids in fluids; of an implementation other
            than "jax" and "warp"; or with a transmission or a tendon that MJX does not simulate.
    """
    _check(model)
    state = _state(model, derived.kinematics(model))
    tendon = _tendons(model, state)
    lone, groups = _trees(model, None)
    factors = [_factor(model, state, tendon, trees) for trees in groups]
    weight = _weights(model, state, lone, factors)
    values = {
        "body_subtreemass": derived.subtree_mass(model),
        **weight._asdict(),
        **_bounds(model),
        **_reference_fields(model, state),
    }
    if model.ntendon:
        values["tendon_length0"] = tendon.length
        values["tendon_invweight0"] = _row_sums([f.half_solve(tendon.moment) ** 2 for f in factors], model.ntendon)
    if len(model.actuator_trntype):
        moment = _moments(model, state, tendon)
        values["actuator_acc0"] = jnp.sqrt(_row_sums([f.solve(moment) ** 2 for f in factors], len(moment)))
    if model.neq:
        values["eq_data"] = _eq_data(model, state)

    stat = derived.statistic(_replace(model, values))
    reflected = (model.tendon_armature[:, None] * tendon.moment**2).sum() / max(model.nv, 1)
    stat = stat._replace(meaninertia=stat.meaninertia + reflected)
    return _replace(model, values | {f"stat.{name}": value for name, value in stat._asdict().items()})


class Weights(NamedTuple):
    """How hard degrees of freedom and bodies are to move at `qpos0`; in [kg], where something turns in [kg m^2]."""

    dof_M0: jax.Array  # (nv,) diagonal of the inertia matrix
    dof_invweight0: jax.Array  # (nv,) diagonal of its inverse, averaged over the axes of free and ball joints
    body_invweight0: jax.Array  # (nbody, 2) mean inverse inertia against pushes at the centre of mass and turns


def weights(model: mjx.Model, roots: np.ndarray) -> Weights:
    """The weights, recomputed for the trees whose first bodies are `roots` (n,), and as in `model` for the others.

    Raises:
        ValueError: if one of `roots` is not the first body of a tree.
    """
    state = _state(model, derived.kinematics(model))
    tendon = _tendons(model, state)
    lone, groups = _trees(model, roots)
    return _weights(model, state, lone, [_factor(model, state, tendon, trees) for trees in groups])


def _check(model: mjx.Model) -> None:
    """Refuses what cannot be derived."""
    if not isinstance(model, mjx.Model):
        raise TypeError(
            f"`model` must be an mjx.Model (of an MjModel: mujoco.mj_setConst), got {type(model).__name__}."
        )
    if model.impl.value not in ("jax", "warp"):
        raise NotImplementedError(f"`set_const` needs a model of impl 'jax' or 'warp', got {model.impl.value!r}.")
    if model.nflex:
        raise NotImplementedError(f"`set_const` does not derive the fields of flexes; the model has {model.nflex}.")
    if model.impl.value == "warp" and np.asarray(model.geom_fluid).reshape(model.ngeom, -1)[:, :1].any():
        raise NotImplementedError("`set_const` cannot derive `geom_fluid` of ellipsoids, which worlds share.")
    for name, (enum, known) in _KNOWN.items():
        for kind in set(np.asarray(getattr(model, name)).tolist()) - set(known):
            raise NotImplementedError(f"`set_const` does not know {name} {enum(kind).name}.")


def _replace(model: mjx.Model, values: dict[str, jax.Array]) -> mjx.Model:
    """`model` with these fields, in its own shapes and dtypes."""

    def like(name: str, value: jax.Array) -> jax.Array:
        old = getattr(model.stat, name[5:]) if name.startswith("stat.") else getattr(model, name)
        return value.reshape(old.shape).astype(old.dtype)

    return cast(mjx.Model, model.tree_replace({name: like(name, value) for name, value in values.items()}))


def _row_sums(blocks: Sequence[jax.Array], n: int) -> jax.Array:
    """(n,) sums of the rows of all blocks (n, ...)."""
    return sum((b.reshape(n, -1).sum(1) for b in blocks), jnp.zeros(n))


def _dot(spec: str, *operands: Any) -> jax.Array:
    """`einsum` in full float32: by default, a GPU rounds what it multiplies to ten bits of mantissa."""
    return jnp.einsum(spec, *operands, precision=jax.lax.Precision.HIGHEST)


# ---- Motion


class _State(NamedTuple):
    """Poses, and the velocity lin + ang x (point - anchor) of points that one degree of freedom moves at speed 1."""

    pos: jax.Array  # (nbody, 3)
    quat: jax.Array  # (nbody, 4)
    lin: jax.Array  # (nv, 3)
    ang: jax.Array  # (nv, 3)
    anchor: jax.Array  # (nv, 3)
    moved: np.ndarray  # (nbody, nv) bool: whether the degree of freedom moves the body

    def place(self, body: np.ndarray, local: jax.Array) -> jax.Array:
        """World positions (n, 3) of points (n, 3) in the frames of `body` (n,)."""
        return self.pos[body] + quat_rotate(self.quat[body], local)

    def frame(self, body: np.ndarray, local: jax.Array) -> jax.Array:
        """World orientations (n, 3, 3) of quaternions (n, 4) in the frames of `body` (n,)."""
        return quat_to_mat(quat_mul(self.quat[body], local))

    def jacobian(self, body: np.ndarray, point: jax.Array, dofs: np.ndarray) -> tuple[jax.Array, jax.Array]:
        """Velocities (..., k, 3) of points (..., 3) on `body` (...,), and of its rotation, by `dofs` (..., k)."""
        lin = self.lin[dofs] + jnp.cross(self.ang[dofs], point[..., None, :] - self.anchor[dofs])
        moved = self.moved[body[..., None], dofs][..., None]
        return jnp.where(moved, lin, 0.0), jnp.where(moved, self.ang[dofs], 0.0)


def _state(model: mjx.Model, kin: derived.Kinematics) -> _State:
    moved = np.zeros((model.nbody, model.nv), bool)
    for body in range(1, model.nbody):
        moved[body] = moved[model.body_parentid[body]] | (model.dof_bodyid == body)
    joint = np.asarray(model.dof_jntid)
    kind = np.asarray(model.jnt_type)[joint]
    index = np.arange(model.nv) - np.asarray(model.jnt_dofadr)[joint]
    shift, spin = (kind == FREE) & (index < 3), (kind == BALL) | ((kind == FREE) & (index >= 3))
    axis, body_axis = kin.axis[joint], quat_to_mat(kin.quat)[model.dof_bodyid, :, index % 3]
    lin = jnp.where((kind == SLIDE)[:, None], axis, jnp.where(shift[:, None], jnp.eye(3)[index % 3], 0.0))
    ang = jnp.where((kind == HINGE)[:, None], axis, jnp.where(spin[:, None], body_axis, 0.0))
    return _State(kin.pos, kin.quat, lin, ang, kin.anchor[joint], moved)


# ---- Inertia


class _Trees(NamedTuple):
    """Trees with as many bodies and degrees of freedom as each other."""

    bodies: np.ndarray  # (trees, bodies)
    dofs: np.ndarray  # (trees, dofs)


def _trees(model: mjx.Model, roots: np.ndarray | None) -> tuple[_Trees, list[_Trees]]:
    """The trees with these first bodies, or all; apart, lone free bodies that no tendon and no actuator moves."""
    root = np.full(model.nbody, -1)
    for body in range(1, model.nbody):
        above = root[model.body_parentid[body]]
        root[body] = above if above >= 0 else body if model.body_dofnum[body] else -1
    every = np.unique(root[root >= 0])
    chosen = every if roots is None else np.unique(roots)
    if unknown := sorted(set(chosen.tolist()) - set(every.tolist())):
        raise ValueError(f"`roots` must be first moving bodies on the static world, {every.tolist()}; got {unknown}.")
    pulled, alike = set(root[_pulled(model)].tolist()), {}
    for first in chosen:
        bodies = np.flatnonzero(root == first)
        dofs = np.flatnonzero(np.isin(model.dof_bodyid, bodies))
        free = model.jnt_type[model.body_jntadr[first]] == FREE
        lone = bool(free) and len(bodies) == 1 and first not in pulled
        alike.setdefault((lone, len(bodies), len(dofs)), []).append(_Trees(bodies, dofs))
    groups = {key: _Trees(*(np.stack(ids) for ids in zip(*trees, strict=True))) for key, trees in alike.items()}
    none = _Trees(np.zeros((0, 1), int), np.zeros((0, 6), int))
    return groups.pop((True, 1, 6), none), list(groups.values())


def _pulled(model: mjx.Model) -> np.ndarray:
    """Bodies that tendons pass and actuators move."""
    target, trn = np.asarray(model.actuator_trnid), np.asarray(model.actuator_trntype)
    wrapped, wrap = np.asarray(model.wrap_objid), np.asarray(model.wrap_type)
    joints = [target[np.isin(trn, _JOINT_TRN), 0], wrapped[wrap == _WRAP.mjWRAP_JOINT]]
    sites = [target[np.isin(trn, _SITE_TRN)].reshape(-1), wrapped[wrap == _WRAP.mjWRAP_SITE]]
    geoms = [wrapped[np.isin(wrap, _GEOM_WRAP)]]
    owned = ((model.jnt_bodyid, joints), (model.site_bodyid, sites), (model.geom_bodyid, geoms))
    ids = [(np.asarray(owner), np.concatenate(parts).astype(int)) for owner, parts in owned]
    return np.concatenate([owner[part[part >= 0]] for owner, part in ids]).astype(int)


class _Factor(NamedTuple):
    """The inertia matrices M of some trees, factored; d, e count their degrees of freedom, g the trees."""

    trees: _Trees
    diagonal: jax.Array  # (g, d) of M, without the armature of tendons
    root: jax.Array  # (g, e, d) W with W'W = inverse of M
    jacobian: jax.Array  # (g, bodies, 2, d, 3) of the centres of mass and of rotation

    def half_solve(self, rows: jax.Array) -> jax.Array:
        """`rows` (k, nv) times W' (k, g, e): squared, they are in the metric of M's inverse."""
        return _dot("kgd,ged->kge", rows[:, self.trees.dofs], self.root)

    def solve(self, rows: jax.Array) -> jax.Array:
        """`rows` (k, nv) times the inverse of M (k, g, d)."""
        return _dot("kge,ged->kgd", self.half_solve(rows), self.root)


def _factor(model: mjx.Model, state: _State, tendon: "_Tendons", trees: _Trees) -> _Factor:
    bodies, dofs = trees
    com = state.place(bodies, model.body_ipos[bodies])
    lin, ang = state.jacobian(bodies, com, dofs[:, None])
    spin = _dot("gbdi,gbij->gbdj", ang, state.frame(bodies, model.body_iquat[bodies]))  # along the principal axes
    mass, inertia = model.body_mass[bodies], model.body_inertia[bodies]
    matrix = _dot("gbdi,gbei->gde", lin * mass[..., None, None], lin)
    matrix += _dot("gbdi,gbei->gde", spin * inertia[:, :, None], spin)
    matrix += jnp.eye(dofs.shape[1]) * model.dof_armature[dofs][:, None]
    diagonal = jnp.diagonal(matrix, axis1=1, axis2=2)
    if model.ntendon:
        # The matrix of C has no place for a coupling of two branches: it is dropped.
        above = state.moved[model.dof_bodyid[dofs][:, :, None], dofs[:, None]]
        moment = tendon.moment[:, dofs]
        reflected = _dot("tgd,tge->gde", moment * model.tendon_armature[:, None, None], moment)
        matrix += jnp.where(above | above.swapaxes(1, 2), reflected, 0.0)
    lower = jnp.linalg.cholesky(matrix)
    identity = jnp.broadcast_to(jnp.eye(dofs.shape[1], dtype=lower.dtype), lower.shape)
    root = jax.scipy.linalg.solve_triangular(lower, identity, lower=True)
    return _Factor(trees, diagonal, root, jnp.stack([lin, ang], axis=2))


def _weights(model: mjx.Model, state: _State, lone: _Trees, factors: Sequence[_Factor]) -> Weights:
    """The weights, recomputed for these trees."""
    found = [_dense_weights(model, f) for f in factors] + [_lone_weights(model, state, lone)]
    bodies, dofs = (
        np.concatenate([ids.reshape(-1) for ids in part])
        for part in zip(*(f.trees for f in factors), lone, strict=True)
    )
    diagonal, inverse, body = (jnp.concatenate(rows) for rows in zip(*found, strict=True))
    return Weights(
        replace_rows(model.dof_M0, dofs, diagonal),
        replace_rows(model.dof_invweight0, dofs, inverse),
        replace_rows(model.body_invweight0, bodies, body),
    )


def _dense_weights(model: mjx.Model, factor: _Factor) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Rows (gd,), (gd,), (g * bodies, 2) of `Weights`."""
    bodies, dofs = factor.trees
    joint = np.asarray(model.dof_jntid)[dofs]
    wide = np.isin(np.asarray(model.jnt_type)[joint], (FREE, BALL))
    index = dofs - np.asarray(model.jnt_dofadr)[joint]
    triple = np.where(wide, np.arange(dofs.shape[1]) - index % 3, np.arange(dofs.shape[1]))
    axes = triple[:, :, None] + np.where(wide[:, :, None], np.arange(3), 0)  # three of the joint, or three times one
    inverse = (factor.root**2).sum(1)[np.arange(len(dofs))[:, None, None], axes].mean(2)
    body = (_dot("gbxdi,ged->gbxie", factor.jacobian, factor.root) ** 2).sum((3, 4)) / 3

    # `mj_setConst` takes a body with nothing but slides along its axes for a point, and ignores armatures.
    point = np.asarray(model.body_simple) == 2
    light = 1 / jnp.where(model.body_mass > 0, model.body_mass, 1.0)
    inverse = jnp.where(point[model.dof_bodyid[dofs]], light[model.dof_bodyid[dofs]], inverse)
    as_point = jnp.stack([light, jnp.zeros_like(light)], axis=1)
    body = jnp.where(point[bodies][..., None], as_point[bodies], body)
    return factor.diagonal.reshape(-1), inverse.reshape(-1), body.reshape(-1, 2)


def _lone_weights(model: mjx.Model, state: _State, trees: _Trees) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Rows (6g,), (6g,), (g, 2) of `Weights`, by block elimination of each matrix.

    With mass m, centre of mass c, inertia I about it, armatures a of translation and b of rotation, and H = R [c]x,
    the matrix is [[m + a, -m H], [-m H', I + m H'H + b]]. All terms below are positive: no digits cancel.
    """
    body = trees.bodies[:, 0]
    mass, slow = model.body_mass[body][:, None], model.dof_armature[trees.dofs[:, :3]]
    principal, eye = quat_to_mat(model.body_iquat[body]), jnp.eye(3)
    inertia = _product(principal * model.body_inertia[body][:, None], principal.swapaxes(1, 2))
    arm = _product(quat_to_mat(state.quat[body]), jnp.cross(eye, model.body_ipos[body][:, None]))  # H or -H
    heavy, fast = mass + slow, model.dof_armature[trees.dofs[:, 3:]]

    def outer(scale: jax.Array) -> jax.Array:
        return _product(arm.swapaxes(1, 2) * scale[:, None], arm)

    inverse = _inverse(inertia + eye * fast[:, None] + outer(mass * slow / heavy))

    def mean(matrix: jax.Array) -> jax.Array:
        return (matrix * inverse).sum((1, 2)) / 3

    light, turn = (1 / heavy).mean(1), mean(eye[None])
    at_origin, at_com = light + mean(outer((mass / heavy) ** 2)), light + mean(outer((slow / heavy) ** 2))
    turned = jnp.diagonal(inertia + outer(jnp.broadcast_to(mass, heavy.shape)), axis1=1, axis2=2) + fast
    inverse_diagonal = jnp.stack([at_origin, turn], axis=1).repeat(3, axis=1)
    diagonal = jnp.concatenate([heavy, turned], axis=1)
    return diagonal.reshape(-1), inverse_diagonal.reshape(-1), jnp.stack([at_com, turn], axis=1)


def _product(a: jax.Array, b: jax.Array) -> jax.Array:
    """Matrix products (n, 3, 3), fused with what surrounds them."""
    return (a[..., None] * b[:, None]).sum(2)


def _inverse(matrix: jax.Array) -> jax.Array:
    """Inverses of positive definite matrices (n, 3, 3)."""
    scale = jnp.trace(matrix, axis1=1, axis2=2)[:, None, None]  # keeps the determinants of small bodies in range
    x, y, z = (matrix / scale).swapaxes(0, 1)
    adjugate = jnp.stack([jnp.cross(y, z), jnp.cross(z, x), jnp.cross(x, y)], axis=1)
    return adjugate / ((x * adjugate[:, 0]).sum(1)[:, None, None] * scale)


# ---- Tendons


class _Tendons(NamedTuple):
    length: jax.Array  # (ntendon,) [m], or of fixed tendons in the units of their coefficients
    moment: jax.Array  # (ntendon, nv) its derivative


class _Path(NamedTuple):
    """A piece of a spatial tendon between two sites, straight or around a geom."""

    tendon: int
    share: float  # of its length in the tendon's: one over the divisor of the pulley before
    ends: tuple[int, int]  # sites
    around: tuple[int, int, int] | None  # wrap type, geom, site on the side to pass or -1


def _tendons(model: mjx.Model, state: _State) -> _Tendons:
    """All tendons: `mj_tendon`."""
    coef, moment = np.zeros((model.ntendon, model.nq)), np.zeros((model.ntendon, model.nv))
    for tendon, wrap in _elements(model):
        if model.wrap_type[wrap] == _WRAP.mjWRAP_JOINT:
            joint = model.wrap_objid[wrap]
            coef[tendon, model.jnt_qposadr[joint]] = moment[tendon, model.jnt_dofadr[joint]] = model.wrap_prm[wrap]
    fixed = _Tendons((jnp.asarray(coef) * model.qpos0).sum(1), jnp.asarray(moment))
    paths = _paths(model)
    if not paths:
        return fixed

    body = np.asarray(model.site_bodyid)[np.array([path.ends for path in paths]).T]
    site = state.place(np.asarray(model.site_bodyid), model.site_pos)[np.array([path.ends for path in paths]).T]
    length, moment = _straight(state, body, site)
    bent = np.array([i for i, path in enumerate(paths) if path.around is not None], int)
    if len(bent):
        wraps, around = _wrapped(model, state, body[:, bent], site[:, bent], [paths[i].around for i in bent])
        length = replace_rows(length, bent, jnp.where(wraps, around.length, length[bent]))
        moment = replace_rows(moment, bent, jnp.where(wraps[:, None], around.moment, moment[bent]))
    share = np.zeros((model.ntendon, len(paths)))
    share[[path.tendon for path in paths], np.arange(len(paths))] = [path.share for path in paths]
    return _Tendons(fixed.length + _dot("tp,p->t", share, length), fixed.moment + _dot("tp,pd->td", share, moment))


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
        elif kind in _GEOM_WRAP:
            around = (int(kind), target, round(parameter))
    return paths


def _straight(state: _State, body: np.ndarray, point: jax.Array) -> _Tendons:
    """Lines from points (2, n, 3) to points, on `body` (2, n)."""
    length = norm(point[1] - point[0])
    direction = jnp.where(length[:, None] > 2 * MINVAL, (point[1] - point[0]) / length[:, None], jnp.eye(3)[0])
    lin, _ = state.jacobian(body, point, np.arange(len(state.lin)))
    moment = ((lin[1] - lin[0]) * direction[:, None]).sum(-1)
    return _Tendons(length, jnp.where((body[0] != body[1])[:, None], moment, 0.0))


def _wrapped(
    model: mjx.Model, state: _State, body: np.ndarray, site: jax.Array, around: Sequence[tuple[int, int, int] | None]
) -> tuple[jax.Array, _Tendons]:
    """Whether (n,) tendons between sites (2, n, 3) on `body` (2, n) touch their geoms, and their arcs if so."""
    kind, geom, side = np.array(around).T
    geom_body, side_body = np.asarray(model.geom_bodyid)[geom], np.asarray(model.site_bodyid)[side]
    pos, mat = state.place(geom_body, model.geom_pos[geom]), state.frame(geom_body, model.geom_quat[geom])
    radius, side_pos = model.geom_size[geom, 0], state.place(side_body, model.site_pos[side])

    def wrap(inside: bool) -> tuple[jax.Array, jax.Array, jax.Array]:
        arrays = (*site, pos, mat, radius, side_pos, (side >= 0)[:, None], kind == _WRAP.mjWRAP_SPHERE)
        arc, first, last = jax.vmap(functools.partial(support.wrap, is_wrap_inside=inside, **_WRAP_NEWTON))(*arrays)
        return arc.reshape(-1, 1), first, last

    inside = ((side >= 0) & (norm(side_pos - pos) < radius))[:, None]
    arc, first, last = (jnp.where(inside, a, b) for a, b in zip(wrap(True), wrap(False), strict=True))
    to = _straight(state, np.stack([body[0], geom_body]), jnp.stack([site[0], first]))
    off = _straight(state, np.stack([geom_body, body[1]]), jnp.stack([last, site[1]]))
    return arc[:, 0] >= 0, _Tendons(to.length + arc[:, 0] + off.length, to.moment + off.moment)


# ---- Actuators


def _moments(model: mjx.Model, state: _State, tendon: _Tendons) -> jax.Array:
    """(nactuator, nv) derivatives of the lengths of actuators: `mj_transmission`."""
    kinds = np.asarray(model.actuator_trntype)
    moment = jnp.zeros((len(kinds), model.nv))  # remains for adhesion: without contacts it moves nothing
    joint, site = np.isin(kinds, _JOINT_TRN), kinds == _TRN.mjTRN_SITE
    crank, string = kinds == _TRN.mjTRN_SLIDERCRANK, kinds == _TRN.mjTRN_TENDON
    if joint.any():
        moment = replace_rows(moment, np.flatnonzero(joint), _joint_moments(model, np.flatnonzero(joint)))
    if site.any():
        moment = replace_rows(moment, np.flatnonzero(site), _site_moments(model, state, np.flatnonzero(site)))
    if crank.any():
        moment = replace_rows(moment, np.flatnonzero(crank), _crank_moments(model, state, np.flatnonzero(crank)))
    if string.any():
        rows = tendon.moment[np.asarray(model.actuator_trnid)[string, 0]] * model.actuator_gear[string, :1]
        moment = replace_rows(moment, np.flatnonzero(string), rows)
    return moment


def _joint_moments(model: mjx.Model, ids: np.ndarray) -> jax.Array:
    """(n, nv) of actuators `ids` on joints."""
    joint, gear = np.asarray(model.actuator_trnid)[ids, 0], model.actuator_gear[ids]
    kind = np.asarray(model.jnt_type)[joint]
    in_parent = np.asarray(model.actuator_trntype)[ids] == _TRN.mjTRN_JOINTINPARENT
    for turning, at in ((FREE, 3), (BALL, 0)):  # the place of the axis in the gear, and of the quaternion in qpos
        rows = np.flatnonzero(in_parent & (kind == turning))
        adr = np.asarray(model.jnt_qposadr)[joint[rows]] + at
        turn = derived.normalize(model.qpos0[adr[:, None] + np.arange(4)]) * _CONJUGATE
        axis = quat_rotate(turn, gear[rows, at : at + 3])
        gear = replace_rows(gear, rows, jnp.concatenate([gear[rows, :at], axis, gear[rows, at + 3 :]], axis=1))
    index = np.arange(model.nv) - np.asarray(model.jnt_dofadr)[joint][:, None]
    own = (index >= 0) & (index < np.select([kind == FREE, kind == BALL], [6, 3], 1)[:, None])
    return jnp.where(own, gear[np.arange(len(ids))[:, None], np.clip(index, 0, 5)], 0.0)


def _site_moments(model: mjx.Model, state: _State, ids: np.ndarray) -> jax.Array:
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


def _crank_moments(model: mjx.Model, state: _State, ids: np.ndarray) -> jax.Array:
    """(n, nv) of actuators `ids` that push a site through a rod, from a slider along the z axis of another."""
    sites = np.asarray(model.actuator_trnid)[ids].T
    body = np.asarray(model.site_bodyid)[sites]
    point = state.place(body, model.site_pos[sites])
    axis, vec = state.frame(body[1], model.site_quat[sites[1]])[..., 2], point[0] - point[1]
    along = (axis * vec).sum(-1, keepdims=True)
    square = along**2 + model.actuator_cranklength[ids][:, None] ** 2 - (vec * vec).sum(-1, keepdims=True)
    reaches = square > 0
    root = jnp.sqrt(jnp.where(reaches, square, 1.0))
    scale = jnp.where(reaches, 1 - along / root, 1.0)
    by_vec = axis * scale + jnp.where(reaches, vec / root, 0.0)
    lin, ang = state.jacobian(body, point, np.arange(model.nv))
    turn = (jnp.cross(ang[1], axis[:, None]) * (vec * scale)[:, None]).sum(-1)
    return (turn + ((lin[0] - lin[1]) * by_vec[:, None]).sum(-1)) * model.actuator_gear[ids, :1]


# ---- Geoms, equalities, cameras and lights


def _bounds(model: mjx.Model) -> dict[str, jax.Array]:
    """Boxes and spheres around primitive geoms, and sizes of height fields; what else is bounded, MJX cannot change."""
    kind, size = np.asarray(model.geom_type), model.geom_size
    radius, length = size[:, 0], size[:, 1]

    def around(height: jax.Array) -> jax.Array:
        return jnp.stack([radius, radius, height], axis=1)

    bounds = {  # of each type: half sizes of the box, radius of the sphere
        _GEOM.mjGEOM_SPHERE: (around(radius), radius),
        _GEOM.mjGEOM_CAPSULE: (around(radius + length), radius + length),
        _GEOM.mjGEOM_CYLINDER: (around(length), norm(size[:, :2])),
        _GEOM.mjGEOM_ELLIPSOID: (size, size.max(1)),
        _GEOM.mjGEOM_BOX: (size, norm(size)),
    }
    aabb, rbound = model.geom_aabb.reshape(-1, 6), model.geom_rbound
    for of_kind, (half, sphere) in bounds.items():
        rbound = jnp.where(kind == of_kind, sphere, rbound)
        aabb = jnp.where((kind == of_kind)[:, None], jnp.concatenate([0 * half, half], axis=1), aabb)
    field = np.flatnonzero(kind == _GEOM.mjGEOM_HFIELD)
    x, y, top, bottom = np.asarray(model.hfield_size)[np.asarray(model.geom_dataid)[field]].T
    size = replace_rows(size, field, jnp.stack([x, y, top / 4 + bottom / 2], axis=1))
    return {"geom_size": size, "geom_aabb": aabb, "geom_rbound": rbound}


def _eq_data(model: mjx.Model, state: _State) -> jax.Array:
    """`eq_data` with the anchors of connected bodies, and the poses of welds that MuJoCo marks as derived."""
    kind, of_bodies = np.asarray(model.eq_type), np.asarray(model.eq_objtype) == _OBJ.mjOBJ_BODY
    first, second = np.asarray(model.eq_obj1id), np.asarray(model.eq_obj2id)
    connects = np.flatnonzero(of_bodies & (kind == _EQ.mjEQ_CONNECT))
    welds = np.flatnonzero(of_bodies & (kind == _EQ.mjEQ_WELD))

    def relative(ids: np.ndarray, given: np.ndarray, other: np.ndarray) -> tuple[jax.Array, jax.Array]:
        """In the frames of bodies `other`: anchors that are in the frames of `given`, and these frames."""
        inverse = state.quat[other[ids]] * _CONJUGATE
        anchor = state.place(given[ids], model.eq_data[ids, :3]) - state.pos[other[ids]]
        return quat_rotate(inverse, anchor), quat_mul(inverse, state.quat[given[ids]])

    data = model.eq_data
    anchor, _ = relative(connects, first, second)
    old = data[connects]
    data = replace_rows(data, connects, jnp.concatenate([old[:, :3], anchor, old[:, 6:]], axis=1))
    if data.shape[1] > _WELD_MARK:
        anchor, turn = relative(welds, second, first)
        old = data[welds]
        new = jnp.concatenate([old[:, :3], anchor, turn, old[:, 10:]], axis=1)
        data = replace_rows(data, welds, jnp.where(old[:, _WELD_MARK, None] != 0, new, old))
    return data


def _reference_fields(model: mjx.Model, state: _State) -> dict[str, jax.Array]:
    """Reference poses of cameras, and of lights where the model knows their bodies."""
    fields, kin = {}, derived.kinematics(model)
    if model.ncam:
        body, target = np.asarray(model.cam_bodyid), np.asarray(model.cam_targetbodyid)
        com = derived.subtree_com(model, kin, np.where(target >= 0, target, body))
        cam = derived.references(kin, body, model.cam_pos, com)
        fields |= {"cam_pos0": cam.pos0, "cam_poscom0": cam.poscom0, "cam_mat0": state.frame(body, model.cam_quat)}
    if model.nlight and model.impl.value == "warp":
        body, target = np.asarray(model._impl.light_bodyid), np.asarray(model._impl.light_targetbodyid)
        com = derived.subtree_com(model, kin, np.where(target >= 0, target, body))
        light = derived.references(kin, body, model.light_pos, com)
        direction = derived.normalize(quat_rotate(state.quat[body], model.light_dir))
        fields |= {"light_pos0": light.pos0, "light_poscom0": light.poscom0, "light_dir0": direction}
    return fields
