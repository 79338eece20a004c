"""MJCFs that were not written for this library: from MuJoCo Playground and from packages of robots (tests/robots.txt)."""

import importlib.util
import os
import pathlib

import mujoco
import pytest

from mjx_arenas.spec.quick import unpainted

ROBOTS = pathlib.Path(os.environ.get("MJX_ARENAS_ROBOTS", pathlib.Path(__file__).parent.parent / ".venv" / "robots"))


def _suite():
    """The control suite's models as Playground has them."""
    spec = importlib.util.find_spec("mujoco_playground")
    assert spec is not None
    assert spec.submodule_search_locations is not None
    folder = pathlib.Path(spec.submodule_search_locations[0]) / "_src" / "dm_control_suite" / "xmls"
    names = "acrobot ball_in_cup cartpole finger fish hopper humanoid pendulum point_mass reacher swimmer walker"
    return {name: folder / f"{name}.xml" for name in names.split()}


def _of_mjx(*parts):
    """A model that MJX's own tests step."""
    spec = importlib.util.find_spec("mujoco.mjx")
    assert spec is not None
    assert spec.submodule_search_locations is not None
    return pathlib.Path(spec.submodule_search_locations[0]).joinpath("test_data", *parts)


SUITE = _suite()
ARMS = {  # with meshes, which MJX steps on Warp
    "panda": ROBOTS / "gym_hil" / "assets" / "panda.xml",
    "yam": ROBOTS / "mjlab" / "asset_zoo" / "robots" / "i2rt_yam" / "xmls" / "yam.xml",
    "go1": ROBOTS / "mjlab" / "asset_zoo" / "robots" / "unitree_go1" / "xmls" / "go1.xml",
    "g1": ROBOTS / "mjlab" / "asset_zoo" / "robots" / "unitree_g1" / "xmls" / "g1.xml",
    "2f85": ROBOTS / "ogbench" / "manipspace" / "descriptions" / "robotiq_2f85" / "2f85.xml",
    "ur5e": ROBOTS / "ogbench" / "manipspace" / "descriptions" / "universal_robots_ur5e" / "ur5e.xml",
    "shadow_hand": _of_mjx("shadow_hand", "right_hand.xml"),
    "ant": ROBOTS / "ogbench" / "online_locomotion" / "assets" / "ant.xml",
}
FEW = ("shadow_hand", "ant")  # one with tendons, one that walks
FEW_ARMS = [pytest.param(name, marks=[pytest.mark.xslow] * (name not in FEW)) for name in ARMS]
MJX = {  # small ones, with pairs, ranges of forces, armatures of tendons and muscles
    "mjx_humanoid": _of_mjx("humanoid", "humanoid.xml"),
    "force_clamp": _of_mjx("actuator", "tendon_force_clamp.xml"),
    "arm21": _of_mjx("actuator", "arm21.xml"),
    "armature": _of_mjx("tendon", "armature.xml"),
}


def spec_of(name):
    """A model's spec, which compiles fast."""
    return unpainted(mujoco.MjSpec.from_file(str((SUITE | ARMS | MJX)[name])))
