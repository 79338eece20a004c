"""What is told apart in pictures: tables, objects, robots, and single geoms of the world (host)."""

import mujoco
import numpy as np


def of_geoms(model: mujoco.MjModel) -> np.ndarray:
    """(ngeom,) the label of each geom."""
    return _labelled(model)[1]


def names(model: mujoco.MjModel) -> tuple[str, ...]:
    """(N,) the names of the labels: of the bodies on the world with all that is on them, and of geoms of the world itself."""
    return _labelled(model)[0]


def _labelled(model: mujoco.MjModel) -> tuple[tuple[str, ...], np.ndarray]:
    found: dict[str, int] = {}
    of = np.zeros(model.ngeom, np.int32)
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        while model.body_parentid[body]:
            body = int(model.body_parentid[body])
        own = model.body(body).name or f"body {body}" if body else model.geom(geom).name or f"geom {geom}"
        of[geom] = found.setdefault(own, len(found))
    return tuple(found), of
