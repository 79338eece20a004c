"""Randomizes an arm with mjlab's `dr` and derives what follows; run by the Python of an environment with `benchmarks/mjlab.txt`."""

import importlib.metadata
import json
import pathlib
import statistics
import sys
import time
import types
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import mujoco
import torch
from mjlab.actuator import XmlActuatorCfg
from mjlab.entity import EntityArticulationInfoCfg, EntityCfg
from mjlab.envs.mdp import dr
from mjlab.managers.event_manager import RecomputeLevel
from mjlab.managers.scene_entity_config import SceneEntityCfg
from mjlab.scene import Scene, SceneCfg
from mjlab.sim import Simulation, SimulationCfg

REPEATS = 15
SCALED = {"ranges": (0.9, 1.1), "operation": "scale"}
LITTLE, TILT = {"ranges": (-0.005, 0.005), "operation": "add"}, (-0.05, 0.05)
SERVOS = {"actuator_names": (".*",)}
JOINTS, GEOMS, CAMERA = {"joint_names": (".*",)}, {"geom_names": (".*",)}, {"camera_names": ("wrist",)}
TERMS: dict[str, tuple[Mapping[str, Any], Mapping[str, Any]]] = {
    "body_mass": ({"body_names": ("link.*", "finger.")}, SCALED),
    "body_com_offset": ({"body_names": ("link.*",)}, LITTLE),
    "joint_armature": (JOINTS, SCALED),
    "joint_damping": (JOINTS, SCALED),
    "joint_friction": (JOINTS, SCALED),
    "joint_stiffness": ({"joint_names": ("joint.*",)}, SCALED),
    "joint_limits": (JOINTS, SCALED),
    "pd_gains": (SERVOS, {"kp_range": (0.9, 1.1), "kd_range": (0.9, 1.1)}),
    "effort_limits": (SERVOS, {"effort_limit_range": (0.9, 1.1)}),
    "geom_friction": (GEOMS, SCALED),
    "geom_rgba": (GEOMS, {"ranges": (0.0, 1.0)}),
    "site_pos": ({"site_names": ("hand",)}, LITTLE),
    "cam_pos": (CAMERA, {"ranges": (-0.01, 0.01), "operation": "add"}),
    "cam_quat": (CAMERA, {"roll_range": TILT, "pitch_range": TILT, "yaw_range": TILT}),
    "cam_fovy": (CAMERA, SCALED),
}
"""Names of functions of `dr`, what each is about, and its other arguments."""


class Ungraphed(Simulation):
    """Without CUDA graphs of steps: none is taken here, and their kernels take long to compile."""

    def create_graph(self) -> None:
        self.step_graph = self.forward_graph = self.reset_graph = self.sense_graph = None


def main(n_worlds: int, mjcf: str) -> None:
    """Prints the median seconds of one randomization of all worlds, with and without what mjlab derives then."""
    warnings.simplefilter("ignore")  # that inertias stay
    device = "cuda:0" if torch.cuda.is_available() else "cpu"
    servos = EntityArticulationInfoCfg(actuators=(XmlActuatorCfg(target_names_expr=(".*",)),))
    arm = EntityCfg(spec_fn=lambda: mujoco.MjSpec.from_string(mjcf), articulation=servos)
    scene = Scene(SceneCfg(num_envs=n_worlds, entities={"arm": arm}), device)
    sim = Ungraphed(n_worlds, SimulationCfg(), scene.compile(), device)
    scene.initialize(sim.mj_model, sim.model, sim.data)
    env: Any = types.SimpleNamespace(scene=scene, sim=sim, num_envs=n_worlds, device=device)
    terms = [(getattr(dr, name), _chosen(scene, names), arguments) for name, (names, arguments) in TERMS.items()]
    sim.expand_model_fields(tuple(dict.fromkeys(field for function, *_ in terms for field in function.model_fields)))
    level = max(function.recompute for function, *_ in terms)  # as mjlab's event manager chooses it
    assert level == RecomputeLevel.set_const

    def randomize() -> None:
        for function, chosen, arguments in terms:
            function(env, None, asset_cfg=chosen, **arguments)

    def randomize_and_recompute() -> None:
        randomize()
        sim.recompute_constants(level)

    wait = torch.cuda.synchronize if device != "cpu" else (lambda: None)
    derived, alone = medians([randomize_and_recompute, randomize], wait)
    versions = {name: importlib.metadata.version(name) for name in ("mjlab", "mujoco-warp", "warp-lang", "torch")}
    seconds = {"mjlab_seconds": derived, "mjlab_without_recompute_seconds": alone}
    print(json.dumps({"terms": list(TERMS), **seconds, "dofs": sim.mj_model.nv, **versions}))


def _chosen(scene: Scene, names: Mapping[str, Any]) -> SceneEntityCfg:
    chosen = SceneEntityCfg("arm", **names)
    chosen.resolve(scene)
    return chosen


def medians(functions: list[Callable[[], None]], wait: Callable[[], None]) -> list[float]:
    """Seconds of one call of each and of what it started, measured in turns; the first two calls do not count."""
    seconds: list[list[float]] = [[] for _ in functions]
    for _ in range(2 + REPEATS):
        for function, found in zip(functions, seconds, strict=True):
            wait()
            begin = time.perf_counter()
            function()
            wait()
            found.append(time.perf_counter() - begin)
    return [statistics.median(found[2:]) for found in seconds]


if __name__ == "__main__":
    main(int(sys.argv[1]), pathlib.Path(sys.argv[2]).read_text() if len(sys.argv) > 2 else sys.stdin.read())
