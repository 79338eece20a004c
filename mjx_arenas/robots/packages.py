"""Arms that other packages bring along, found without importing them (host)."""

import dataclasses
import importlib.util
import pathlib

import mujoco

from mjx_arenas.build import attach
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.spec import patterns, specs


@dataclasses.dataclass(frozen=True)
class Robot:
    """An arm of another package."""

    what: str
    package: str
    """Name under which Python imports it."""
    install: str
    """Command that installs it."""
    licence: str
    file: str
    """Path of its MJCF in the package's folder."""
    body: str = ""
    """Name of the arm's first body, if the file is a scene with more in it."""
    hand: str = ""
    """Path in the package's folder of the MJCF of a gripper, which the arm carries at its site `attachment_site`."""


def _pip(name: str, version: str) -> str:
    return f"pip install --no-deps {name}=={version}"


_UR5E = "manipspace/descriptions/universal_robots_ur5e/ur5e.xml"
_ROBOTS = {
    "panda": Robot(
        "Franka Panda with a Robotiq 2F-85, 7 motors and a gripper",
        "gym_hil",
        _pip("gym-hil", "0.1.14"),
        "Apache-2.0",
        "assets/panda.xml",
    ),
    "ur5e": Robot(
        "Universal Robots UR5e without a gripper, 6 position servos",
        "ogbench",
        _pip("ogbench", "1.2.2"),
        "MIT, the model BSD-3-Clause",
        _UR5E,
    ),
    "ur5e_2f85": Robot(
        "UR5e with a Robotiq 2F-85, names of which begin with 2f85_, 6 position servos and a gripper",
        "ogbench",
        _pip("ogbench", "1.2.2"),
        "MIT, the models BSD-3-Clause and BSD-2-Clause",
        _UR5E,
        hand="manipspace/descriptions/robotiq_2f85/2f85.xml",
    ),
    "yam": Robot(
        "I2RT YAM with two fingers, without actuators, which mjlab adds in Python",
        "mjlab",
        _pip("mjlab", "1.6.0"),
        "Apache-2.0",
        "asset_zoo/robots/i2rt_yam/xmls/yam.xml",
    ),
    "xarm7": Robot(
        "UFACTORY xArm7 with its gripper, out of a scene, 2 motors of the gripper alone",
        "gym_xarm",
        _pip("gym-xarm", "0.1.1"),
        "Apache-2.0",
        "tasks/assets/reach.xml",
        body="link0",
    ),
}


def known() -> dict[str, Robot]:
    """Arms that `load` finds, by name. Each has a description, its package, its licence and a command that installs it."""
    return dict(_ROBOTS)


def load(name: str) -> mujoco.MjSpec:
    """Loads the MJCF of an arm from an installed package, as a spec for `simplify` and `arena.attach`.

    The package is not imported. None of it is part of this library, and its licence applies.

    Args:
        name: one of `known()`.

    Raises:
        ValueError: there is no arm of that name.
        ModuleNotFoundError: its package is not installed; the message says how to install it.
        FileNotFoundError: the package is installed, in a version without the file.
    """
    if not isinstance(name, str) or name not in _ROBOTS:
        raise error([problem("name", "no_robot_known", None, name, nearest=patterns.near(str(name), list(_ROBOTS)))])
    robot = _ROBOTS[name]
    spec = specs.read(_found(name, robot, robot.file), "name")
    if robot.body:
        _alone(spec, robot.body)
    if robot.hand:
        site, hand = spec.site("attachment_site"), specs.read(_found(name, robot, robot.hand), "name")
        attach.merge_options(spec, hand)
        frame = site.parent.add_frame(pos=site.pos, quat=site.quat)
        specs.attach(spec, hand, f"{pathlib.Path(robot.hand).stem}_", frame, "name")
    return spec


def _found(name: str, robot: Robot, file: str) -> pathlib.Path:
    """The path of a file of the package of a robot."""
    told = {"package": robot.package, "install": robot.install, "file": file}
    package = importlib.util.find_spec(robot.package)
    if package is None:
        raise error([problem("name", "no_package", None, name, told)], kind=ModuleNotFoundError)
    paths = [pathlib.Path(folder) / file for folder in package.submodule_search_locations or ()]
    for path in paths:
        if path.is_file():
            return path
    raise error([problem("name", "no_robot_file", None, name, told)], kind=FileNotFoundError)


def _alone(spec: mujoco.MjSpec, body: str) -> None:
    """Leaves one body of a scene, at its origin, with what hangs on it and belongs to it."""
    world, kept = spec.worldbody, spec.body(body)
    others = [one for one in world.bodies if one.name != body]
    lost = {below.name for one in others for below in (one, *one.find_all("body"))}
    for equality in [one for one in spec.equalities if {one.name1, one.name2} & lost]:
        spec.delete(equality)
    for element in (*others, *world.geoms, *world.sites, *world.lights, *world.cameras):
        spec.delete(element)
    kept.pos = (0, 0, 0)
