"""What stands on what in a nominal arena, where the size of one varies (host)."""

import mujoco
import numpy as np

from mjx_arenas import primitives
from mjx_arenas.rules.footing_rules import LEAST, Footing
from mjx_arenas.spec import specs
from mjx_arenas.terms.elements import Elements
from mjx_arenas.terms.parts import Parts

_PLANE = mujoco.mjtGeom.mjGEOM_PLANE
_PLACING = ("body.pos", "body.start_pos")


def footings(parts: Parts, compiled: mujoco.MjModel | None) -> list[Footing]:
    """One for each geom that stands freely and each of the two whose size varies.

    Args:
        parts: of the arena.
        compiled: model of the nominal arena; None: not compiled yet, it is that of the last `vary`.
    """
    sized = {
        name: (one, i) for one in parts.varied if one.attribute == "geom.size" for i, name in enumerate(one.elements)
    }
    if not sized:
        return []
    model: mujoco.MjModel = compiled or parts.varied[-1].base
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = []
    for upper, lower in _standing(model, data):
        placed_by = _placed_by(parts.varied, model, (upper, lower))
        free = model.body_dofnum[model.geom_bodyid[upper]] > 0
        names = specs.geom_name(model, upper), specs.geom_name(model, lower)
        for geom in (upper, lower):
            if model.geom(geom).name in sized:
                term, row = sized[model.geom(geom).name]
                turn = data.geom_xmat[geom].reshape(3, 3)
                place = "body.start_pos" if free else "geom.pos"
                found.append(Footing(term.name, row, int(model.geom_type[geom]), turn, *names, place, placed_by))
    return found


def _standing(model: mujoco.MjModel, data: mujoco.MjData) -> list[tuple[int, int]]:
    """Ids of geoms that collide: one that nothing but a free joint moves, and one that it touches from above."""
    (low, high), plane = _box(model, data), model.geom_type == _PLANE
    level = ~plane | (data.geom_xmat[:, 8] > 1 - 1e-6)
    solid = ((model.geom_contype | model.geom_conaffinity) != 0) & level
    high[plane, 2] = data.geom_xpos[plane, 2]
    uppers = np.flatnonzero(solid & ~plane & _stands_freely(model)[model.geom_bodyid])
    found = []
    for upper in uppers.tolist():
        body = model.geom_bodyid[upper]
        touches = solid & (np.abs(high[:, 2] - low[upper, 2]) < LEAST) & ((model.geom_bodyid != body) | (body == 0))
        touches &= ((low[:, :2] < high[upper, :2]) & (high[:, :2] > low[upper, :2])).all(-1)
        found += [(upper, lower) for lower in np.flatnonzero(touches).tolist()]
    return found


def _box(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
    """Corners (ngeom, 3) of boxes around geoms, along the axes of the world [m]; of planes without end."""
    turn = data.geom_xmat.reshape(-1, 3, 3)
    middle, half = np.split(model.geom_aabb[..., None], 2, axis=1)  # of a mesh the middle is not where the geom is
    center, reach = data.geom_xpos + (turn @ middle)[..., 0], (np.abs(turn) @ half)[..., 0]
    known = np.isin(model.geom_type, primitives.PRIMITIVES)
    reach[known] = primitives.reach(model.geom_type[known], model.geom_size[known], turn[known])
    reach[model.geom_type == _PLANE] = np.inf
    return center - reach, center + reach


def _stands_freely(model: mujoco.MjModel) -> np.ndarray:
    """(nbody,) bool: bodies that do not move, or have a free joint of their own."""
    free = np.zeros(model.nbody, bool)
    free[model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]] = True
    return free | (model.body_weldid == 0) & (model.body_mocapid < 0)


def _placed_by(varied: tuple[Elements, ...], model: mujoco.MjModel, geoms: tuple[int, int]) -> frozenset[str]:
    """Quantities that move one of the geoms, or what it hangs on."""
    names = {model.geom(geom).name for geom in geoms}
    bodies = set[str]()
    for body in (int(model.geom_bodyid[geom]) for geom in geoms):
        while body:
            bodies.add(model.body(body).name)
            body = int(model.body_parentid[body])
    return frozenset(
        one.name
        for one in varied
        if (one.attribute == "geom.pos" and not names.isdisjoint(one.elements))
        or (one.attribute in _PLACING and not bodies.isdisjoint(one.elements))
    )
