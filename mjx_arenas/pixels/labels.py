"""What is told apart in pictures: tables, objects, robots, and single geoms of the world (host)."""

from typing import NamedTuple

import mujoco
import numpy as np


class Labels(NamedTuple):
    """Of a model."""

    names: tuple[str, ...]
    """(N,) of the bodies on the world, each with all that is on it, and of geoms of the world itself."""
    of_geoms: np.ndarray
    """(ngeom,) which of them each geom is."""


def of(model: mujoco.MjModel) -> Labels:
    """What is told apart in a model's pictures."""
    found: dict[str, int] = {}
    of_geoms = np.zeros(model.ngeom, np.int32)
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        while model.body_parentid[body]:
            body = int(model.body_parentid[body])
        own = model.body(body).name or f"body {body}" if body else model.geom(geom).name or f"geom {geom}"
        of_geoms[geom] = found.setdefault(own, len(found))
    return Labels(tuple(found), of_geoms)
