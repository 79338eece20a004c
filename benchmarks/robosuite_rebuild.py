"""Rebuilds robosuite's arena; run by the Python of an environment with `benchmarks/robosuite.txt`."""

import importlib.metadata
import json
import sys
import time

import mujoco
import numpy as np
from robosuite.models.arenas import MultiTableArena
from robosuite.models.world import MujocoWorldBase

OFFSETS = np.array([[0, 0, 0.8], [1.3, 0, 0.8], [0, 1.3, 0.8]])


def rebuild(rng: np.random.Generator) -> mujoco.MjModel:
    """One random arena without objects, from its XML to MuJoCo's model."""
    friction = np.exp(rng.uniform(np.log(0.2), 0, 3))
    arena = MultiTableArena(
        table_offsets=OFFSETS + rng.uniform([-0.05, -0.05, -0.3], [0.05, 0.05, 0.3], (3, 3)),
        table_rots=rng.uniform(-3.14, 3.14, 3),
        table_full_sizes=rng.uniform([0.4, 0.4, 0.02], [0.65, 0.65, 0.15], (3, 3)),
        table_frictions=np.stack([friction, np.full(3, 0.005), np.full(3, 0.0001)], axis=1),
        has_legs=list(rng.random(3) < 0.7),
    )
    world = MujocoWorldBase()
    world.merge(arena)
    return world.get_model(mode="mujoco")


if __name__ == "__main__":
    count, rng = int(sys.argv[1]), np.random.default_rng(0)
    rebuild(rng)
    begin = time.perf_counter()
    for _ in range(count):
        rebuild(rng)
    rate = count / (time.perf_counter() - begin)
    print(
        json.dumps(
            {
                "rebuilt_per_second": rate,
                "robosuite": importlib.metadata.version("robosuite"),
                "robosuite_mujoco": mujoco.__version__,
            }
        )
    )
