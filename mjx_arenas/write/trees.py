"""Trees: a moving body on the static world with all its descendants; the inertia matrix has one block for each."""

from typing import NamedTuple

import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.terms.attributes.joints import JOINT_TRN
from mjx_arenas.write.kinematics import FREE

_TRN, _WRAP = mujoco.mjtTrn, mujoco.mjtWrap
SITE_TRN = (int(_TRN.mjTRN_SITE), int(_TRN.mjTRN_SLIDERCRANK))
GEOM_WRAP = (int(_WRAP.mjWRAP_SPHERE), int(_WRAP.mjWRAP_CYLINDER))


class Trees(NamedTuple):
    """Trees with as many bodies and degrees of freedom as each other, on free joints or on others."""

    bodies: np.ndarray  # (trees, bodies)
    dofs: np.ndarray  # (trees, dofs)


def tree_roots(model: mjx.Model | mujoco.MjModel) -> np.ndarray:
    """(nbody,) the first body of the tree of each body that joints move, -1 of the others."""
    root = np.full(model.nbody, -1)
    for body in range(1, model.nbody):
        above = root[model.body_parentid[body]]
        root[body] = above if above >= 0 else body if model.body_dofnum[body] else -1
    return root


def trees_of(model: mjx.Model, roots: np.ndarray | None) -> tuple[Trees, list[Trees]]:
    """The trees with these first bodies, or all; apart, lone free bodies that no tendon and no actuator moves."""
    root = tree_roots(model)
    every = np.unique(root[root >= 0])
    chosen = every if roots is None else np.unique(roots)
    if unknown := sorted(set(chosen.tolist()) - set(every.tolist())):
        raise error([problem("roots", "roots", None, unknown, known=every.tolist())])
    driven, alike = set(root[pulled(model)].tolist()), {}
    for first in chosen:
        bodies = np.flatnonzero(root == first)
        dofs = np.flatnonzero(np.isin(model.dof_bodyid, bodies))
        free = model.jnt_type[model.body_jntadr[first]] == FREE
        lone = bool(free) and len(bodies) == 1 and first not in driven
        alike.setdefault((lone, bool(free), len(bodies), len(dofs)), []).append(Trees(bodies, dofs))
    groups = {key: Trees(*(np.stack(ids) for ids in zip(*trees, strict=True))) for key, trees in alike.items()}
    none = Trees(np.zeros((0, 1), int), np.zeros((0, 6), int))
    return groups.pop((True, True, 1, 6), none), list(groups.values())


def pulled(model: mjx.Model | mujoco.MjModel) -> np.ndarray:
    """Bodies that tendons pass and actuators move."""
    target, trn = np.asarray(model.actuator_trnid), np.asarray(model.actuator_trntype)
    wrapped, wrap = np.asarray(model.wrap_objid), np.asarray(model.wrap_type)
    joints = [target[np.isin(trn, JOINT_TRN), 0], wrapped[wrap == _WRAP.mjWRAP_JOINT]]
    sites = [target[np.isin(trn, SITE_TRN)].reshape(-1), wrapped[wrap == _WRAP.mjWRAP_SITE]]
    geoms = [wrapped[np.isin(wrap, GEOM_WRAP)]]
    owned = ((model.jnt_bodyid, joints), (model.site_bodyid, sites), (model.geom_bodyid, geoms))
    ids = [(np.asarray(owner), np.concatenate(parts).astype(int)) for owner, parts in owned]
    return np.concatenate([owner[part[part >= 0]] for owner, part in ids]).astype(int)


def tendon_bodies(model: mujoco.MjModel) -> list[list[int]]:
    """(ntendon,) the bodies that each tendon passes."""
    wraps = {mujoco.mjtWrap.mjWRAP_JOINT: model.jnt_bodyid, mujoco.mjtWrap.mjWRAP_SITE: model.site_bodyid}
    wraps |= {mujoco.mjtWrap.mjWRAP_SPHERE: model.geom_bodyid, mujoco.mjtWrap.mjWRAP_CYLINDER: model.geom_bodyid}
    found = []
    for first, n in zip(model.tendon_adr, model.tendon_num, strict=True):
        path = range(first, first + n)
        steps = [(wraps.get(mujoco.mjtWrap(model.wrap_type[w])), model.wrap_objid[w]) for w in path]
        found.append([int(bodies[i]) for bodies, i in steps if bodies is not None])
    return found
