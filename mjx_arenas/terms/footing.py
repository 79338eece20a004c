"""What stands on what in a nominal arena, where the size of one varies, or the place of the lower (host)."""

import functools

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
    """One for each geom that stands freely, and each quantity that decides the size of one of the two, or the height of the lower alone.

    Args:
        parts: of the arena.
        compiled: model of the nominal arena; None: not compiled yet, it is that of the last `vary`.
    """
    sized = {
        name: (one, i) for one in parts.varied if one.attribute == "geom.size" for i, name in enumerate(one.elements)
    }
    if not sized and not any(one.attribute in ("geom.pos", *_PLACING) for one in parts.varied):
        return []
    model: mujoco.MjModel = compiled or parts.varied[-1].base
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = []
    for upper, lower in _standing(model, data):
        placed_by = _placed_by(parts.varied, model, (upper, lower))
        free = model.body_dofnum[model.geom_bodyid[upper]] > 0
        place = "body.start_pos" if free else "geom.pos"
        names = specs.geom_name(model, upper), specs.geom_name(model, lower)
        above = _placed_by(parts.varied, model, (upper,))
        for name, row in _raised_by(parts.varied, model, data, lower):
            if name not in above:
                found.append(Footing(name, row, _heights, *names, place, placed_by - {name}))
        for geom in (upper, lower):
            if model.geom(geom).name in sized:
                term, row = sized[model.geom(geom).name]
                turn = data.geom_xmat[geom].reshape(3, 3)
                overlap = functools.partial(_halves, int(model.geom_type[geom]), turn)
                found.append(Footing(term.name, row, overlap, *names, place, placed_by))
    return found


def _halves(kind: int, turn: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """(n,) half heights in the world of geoms of sizes (n, 3), with axes `turn` (3, 3)."""
    return primitives.reach(np.full(len(sizes), kind), sizes, np.broadcast_to(turn, (len(sizes), 3, 3)))[:, 2]


def _heights(places: np.ndarray) -> np.ndarray:
    return places[:, 2]


def _raised_by(
    varied: tuple[Elements, ...], model: mujoco.MjModel, data: mujoco.MjData, geom: int
) -> list[tuple[str, int]]:
    """Quantities that place a geom, or what it hangs on, in a frame whose z axis is the world's, with the row of what they place."""
    body = int(model.geom_bodyid[geom])
    places = {("geom.pos", model.geom(geom).name): body}
    while body:
        parent = int(model.body_parentid[body])
        places |= {(attribute, model.body(body).name): parent for attribute in _PLACING}
        body = parent
    return [
        (one.name, i)
        for one in varied
        for i, name in enumerate(one.elements)
        if (frame := places.get((one.attribute, name))) is not None and data.xmat[frame, 8] > 1 - 1e-6
    ]


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


def _placed_by(varied: tuple[Elements, ...], model: mujoco.MjModel, geoms: tuple[int, ...]) -> frozenset[str]:
    """Quantities that move one of some geoms, or what it hangs on."""
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
