"""Randomizes tables with mjlab's `dr`; run by the Python of an environment with `benchmarks/mjlab.txt`."""

import importlib.metadata
import json
import statistics
import sys
import time
import types
from collections.abc import Callable

import mujoco
import torch
from mjlab.entity import EntityCfg
from mjlab.envs.mdp import dr
from mjlab.managers.event_manager import RecomputeLevel
from mjlab.managers.scene_entity_config import SceneEntityCfg
from mjlab.scene import Scene, SceneCfg
from mjlab.sim import Simulation, SimulationCfg

REPEATS = 5


def spec() -> mujoco.MjSpec:
    """Three tables without legs; a slab that collides and one that is drawn, each."""
    made = mujoco.MjSpec()
    root = made.worldbody.add_body(name="tables")
    for t, (x, y) in enumerate(((0, 0), (1.3, 0), (0, 1.3))):
        body = root.add_body(name=f"table{t}", pos=(x, y, 0.775))
        for name, on in (("collision", 1), ("visual", 0)):
            geom = body.add_geom(name=f"table{t}_{name}", type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.3, 0.3, 0.025))
            geom.contype = geom.conaffinity = on
    return made


def cube() -> mujoco.MjSpec:
    """A free body."""
    made = mujoco.MjSpec()
    body = made.worldbody.add_body(name="cube", pos=(0, 0, 0.83))
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.025, 0.025, 0.025))
    return made


def main(n_worlds: int) -> None:
    """Prints the median seconds of one randomization of all worlds, with and without what mjlab derives then."""
    device = "cuda:0" if torch.cuda.is_available() else "cpu"
    entities = {"arena": EntityCfg(spec_fn=spec), "cube": EntityCfg(spec_fn=cube)}
    scene = Scene(SceneCfg(num_envs=n_worlds, entities=entities), device)
    sim = Simulation(n_worlds, SimulationCfg(), scene.compile(), device)
    scene.initialize(sim.mj_model, sim.model, sim.data)
    env = types.SimpleNamespace(scene=scene, sim=sim, num_envs=n_worlds, device=device)
    sim.expand_model_fields(("body_pos", "body_quat", "geom_size", "geom_rbound", "geom_aabb", "geom_friction"))
    bodies = SceneEntityCfg("arena", body_names=("table[0-9]",))
    geoms = SceneEntityCfg("arena", geom_names=(".*",))
    slabs = SceneEntityCfg("arena", geom_names=(".*_collision",))
    for chosen in (bodies, geoms, slabs):
        chosen.resolve(scene)

    def randomize() -> None:
        dr.body_pos(env, None, {0: (-0.05, 0.05), 1: (-0.05, 0.05), 2: (-0.3, 0.3)}, bodies)
        dr.body_quat(env, None, yaw_range=(-3.14, 3.14), asset_cfg=bodies)
        dr.geom_size(env, None, {0: (0.66, 1.08), 1: (0.66, 1.08), 2: (0.4, 3.0)}, geoms)
        dr.geom_friction(env, None, (0.2, 1.0), slabs, distribution="log_uniform")
        if device != "cpu":
            torch.cuda.synchronize()

    def randomize_and_recompute() -> None:
        randomize()
        sim.recompute_constants(RecomputeLevel.set_const_0)  # as mjlab's event manager does
        if device != "cpu":
            torch.cuda.synchronize()

    seconds = {"mjlab_seconds": median(randomize_and_recompute), "mjlab_without_recompute_seconds": median(randomize)}
    print(json.dumps({**seconds, "mjlab": importlib.metadata.version("mjlab")}))


def median(function: Callable[[], None]) -> float:
    """Seconds of one call; the first does not count."""
    function()
    seconds = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        function()
        seconds.append(time.perf_counter() - begin)
    return statistics.median(seconds)


if __name__ == "__main__":
    main(int(sys.argv[1]))
