"""Warns where something hangs so low over a surface that an arm hardly gets under it, as its tool points down (host)."""

from collections.abc import Sequence

import mujoco
import numpy as np

from mjx_arenas.arena import Arena
from mjx_arenas.params.params import on_host
from mjx_arenas.problem import numbered, problem
from mjx_arenas.problems.messages import warn
from mjx_arenas.sample import tops
from mjx_arenas.spec.hanging import hangs_on

ROOM = 0.4  # [m] that hands and wrists take above an object


def warn_of_covers(arena: Arena, base: str, path: str, what: str, surfaces: Sequence[int]) -> None:
    """Warns of surfaces (by index) with something fixed less than 0.4 m above their middles in the nominal arena.

    Args:
        arena: of the task.
        base: name of the body that carries the arm, which does not count, nor does what moves.
        path: the argument that names the surfaces.
        what: what is to be on one of them.
        surfaces: their indices.
    """
    model, every = arena.mj_model, tops.surfaces(on_host(arena.nominal_params()), arena.layout.places.ground)
    low, high = _extents(model)
    still = (model.body_weldid == 0) & (model.body_mocapid[model.body_rootid] < 0)
    still &= hangs_on(model, np.array([model.body(base).id])) < 0
    fixed = still[model.geom_bodyid] & ((model.geom_contype | model.geom_conaffinity) != 0)
    found = []
    for i in surfaces:
        top = np.asarray(every.top[i])
        above = fixed & ((low[:, :2] < top[:2]) & (high[:, :2] > top[:2])).all(1) & (low[:, 2] > top[2] + 1e-3)
        room = np.where(above, low[:, 2] - top[2], np.inf)
        if room.min() < ROOM:
            surface = tops.label(i, numbered(arena.table_names), arena.layout.places.ground)
            found.append(f"{surface} ({room.min():.2f} m below {model.geom(room.argmin()).name!r})")
    if found:
        warn(problem(path, "covered", None, None, what=what, surfaces=", ".join(found)))


def _extents(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """The least and the greatest coordinates (ngeom, 3) of boxes around geoms, in the world [m]."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    turn, box = data.geom_xmat.reshape(-1, 3, 3), model.geom_aabb.reshape(-1, 2, 3)
    middle = data.geom_xpos + np.einsum("gij,gj->gi", turn, box[:, 0])
    half = np.einsum("gij,gj->gi", np.abs(turn), box[:, 1])
    return middle - half, middle + half
