"""What hangs on what in a compiled model (host)."""

import mujoco
import numpy as np


def hangs_on(model: mujoco.MjModel, roots: np.ndarray) -> np.ndarray:
    """(nbody,) which of some bodies (n,) each body hangs on, the nearest, or is itself; -1: none of them."""
    found = np.full(model.nbody, -1)
    found[roots] = np.arange(len(roots))
    for body in range(1, model.nbody):  # parents come first
        if found[body] < 0:
            found[body] = found[model.body_parentid[body]]
    return found
