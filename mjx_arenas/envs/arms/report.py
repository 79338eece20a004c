"""What an arm can do, before a task is made with it (host)."""

import dataclasses
import math

import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas.build import keyframes
from mjx_arenas.envs.arms import chain, opening
from mjx_arenas.envs.arms.arm import HOME, Arm
from mjx_arenas.envs.arms.moves import HEIGHTS, checked, moves, reached, restless
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.spec import specs

HEADINGS = (-0.9, 0.9)  # [rad] of the places that are tried
SPACING = 0.02  # [m] of their distances
MOST_TILT = 0.1  # [rad] of the tool at the start


@dataclasses.dataclass(frozen=True)
class ArmReport:
    """What `arms.check` found. `str(report)` says it in lines, and `report.ok` whether tasks can be done with the arm.

    Args:
        reached: share of the places at `promised` distances that the tool reaches pointing down.
        worst_error: the largest distance by which it misses one of them, along an axis [m].
        promised: (least, most) distance from the base, as the arm's `reach` has it [m].
        reach: (least, most) distance at which it reaches all places around it; None: there is no such distance [m].
        heights: (least, most) height of the places above what carries the arm [m].
        tilt: angle between the tool and straight down in the keyframe "home" [rad].
        width: width of the largest object that it can grip, as the arm has it [m].
        opening: how far the open fingers are apart, as C MuJoCo moves them; infinite where nothing is on both sides of the tool, None of an
            arm without fingers or one that does not stay [m].
        restless: what still moves a second after the keyframe "home", and how fast, in words; "": the arm stays there.
    """

    reached: float
    worst_error: float
    promised: tuple[float, float]
    reach: tuple[float, float] | None
    heights: tuple[float, float]
    tilt: float
    width: float
    opening: float | None
    restless: str = ""

    @property
    def ok(self) -> bool:
        """Whether it reaches 99 % of the places, its tool points down at the start, and it stays there."""
        return self.reached >= 0.99 and self.tilt <= MOST_TILT and not self.restless

    def __str__(self) -> str:
        low, high = self.promised
        to = f"{100 * self.heights[0]:.0f} to {100 * self.heights[1]:.0f} cm"
        found = "at no distance does it reach all of them"
        if self.reach is not None:
            found = f"it reaches all of them from {self.reach[0]:.2f} to {self.reach[1]:.2f} m"
        up = self.tilt > math.pi / 2
        within = "" if self.reach is None else "a `reach` within these, "
        advice = ": turn the site of the tool first" if up else f": give {within}another `rise` or another keyframe"
        turned = ", so its z axis points up: turn the site, whose z axis must point away from the hand" if up else ""
        widest = "not measured, as the arm does not stay" if self.restless else "none, as there are no `fingers`"
        if self.opening is not None:
            apart = f"{100 * self.opening:.1f} cm" if math.isfinite(self.opening) else "further than can be seen"
            widest = f"{100 * self.width:.1f} cm by `width`; the open fingers are {apart} apart"
        return "\n".join(
            [
                f"places reached with the tool pointing down: {self.reached:.1%}, {low:.2f} to {high:.2f} m from the base, {to} high",
                f"largest error there: {1000 * self.worst_error:.1f} mm",
                f"distances: {found}{advice if self.reached < 0.99 else ''}",
                f"tilt of the tool in the keyframe: {math.degrees(self.tilt):.1f} degrees{turned}",
                f"widest object: {widest}",
                *([f"rest: within a second of the keyframe {self.restless}"] if self.restless else []),
            ]
        )


def check(arm: Arm) -> ArmReport:
    """What an arm can do, before a task is made with it: inverse kinematics go to places like those that tasks need.

    The places are up to 0.9 rad to either side of the base's x axis and 2 to 25 cm above what carries the arm. The tool is along and across
    the direction from the base. They are from half of the least distance of the arm's `reach` to one and a half times the most. Contacts
    and forces do not count. C MuJoCo moves the open fingers, and lets the servos hold the arm in its keyframe "home" for a second, at the
    time step of its MJCF. After it, a joint is at rest if within an action of 40 ms it would go no further than 0.05 rad, or 5 mm, by which
    the tool may miss a place: up to 1.25 rad/s or 0.125 m/s. `print(check(arm))` says all in five lines, and in a sixth what is not.

    Warns:
        UserWarning: the arm does not stay in its keyframe, a keyframe puts joints outside of their ranges, fingers open along another line
            than the tool's y axis, or controls send them far beyond their range.

    Raises:
        ValueError, TypeError: the arm is one that tasks refuse, or has no keyframe "home".
    """
    links = checked(arm)
    if HOME not in (key.name for key in arm.spec.keys):
        raise error(
            [problem("arm.spec", "must", None, None, must=f"a spec with a keyframe {HOME!r}: envs.arms.ready adds it")]
        )
    model = specs.compiled(arm.spec, "arm.spec")
    still_moves = restless(model, links.joints)
    keyframes.warn_of_ranges(model, "`arm.spec`")
    (near, far), (low, high) = arm.reach, HEIGHTS
    distances = np.union1d(np.arange(near / 2, 1.5 * far, SPACING), arm.reach)
    places = np.meshgrid(distances, np.linspace(*HEADINGS, 7), np.linspace(low, high, 5), (0, np.pi / 2), indexing="ij")
    distance, heading, height, turn = (x.ravel() for x in places)
    pos = np.stack([distance * np.cos(heading), distance * np.sin(heading), height - arm.rise], axis=-1)
    joints = moves(arm, links, HOME)
    away, _ = misses = joints.misses(pos, heading + turn)
    found, asked = reached(misses), (near <= distance) & (distance <= far)
    down = np.clip(-float(chain.tool(links, jnp.array(joints.start)).mat[2, 2]), -1, 1)
    return ArmReport(
        float(found[asked].mean()),
        float(away[asked].max()),
        (near, far),
        _longest(distances, np.asarray(found.reshape(len(distances), -1).all(1))),
        HEIGHTS,
        float(np.arccos(down)),
        arm.width,
        None if still_moves else _opening(arm, model),
        still_moves,
    )


def _opening(arm: Arm, model: mujoco.MjModel) -> float | None:
    """How far the open fingers are apart [m]; None: there are none."""
    opened = {name: controls[1] for name, controls in arm.fingers.items()}
    return opening.gap(model, opening.moved(model, HOME, opened), arm.tool) if opened else None


def _longest(distances: np.ndarray, good: np.ndarray) -> tuple[float, float] | None:
    """First and last of the most distances in a row that are good."""
    runs = np.split(np.arange(len(good)), np.flatnonzero(np.diff(good)) + 1)
    best = max((run for run in runs if good[run[0]]), key=len, default=None)
    return None if best is None else (float(distances[best[0]]), float(distances[best[-1]]))
