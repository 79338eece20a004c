"""What an arm can do, before a task is made with it (host)."""

import dataclasses
import math

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
        width: width of the largest object that it can grip [m].
    """

    reached: float
    worst_error: float
    promised: tuple[float, float]
    reach: tuple[float, float] | None
    heights: tuple[float, float]
    tilt: float
    width: float

    @property
    def ok(self) -> bool:
        """Whether it reaches 99 % of the places, and its tool points down at the start."""
        return self.reached >= 0.99 and self.tilt <= MOST_TILT

    def __str__(self) -> str:
        low, high = self.promised
        to = f"{100 * self.heights[0]:.0f} to {100 * self.heights[1]:.0f} cm"
        found = "at no distance does it reach all of them"
        if self.reach is not None:
            found = f"it reaches all of them from {self.reach[0]:.2f} to {self.reach[1]:.2f} m"
        advice = "" if self.reached >= 0.99 else ": give a `reach` within these, another `rise` or another keyframe"
        return "\n".join(
            [
                f"places reached with the tool pointing down: {self.reached:.1%}, {low:.2f} to {high:.2f} m from the base, {to} high",
                f"largest error there: {1000 * self.worst_error:.1f} mm",
                f"distances: {found}{advice}",
                f"tilt of the tool in the keyframe: {math.degrees(self.tilt):.1f} degrees",
                f"widest object: {100 * self.width:.1f} cm",
            ]
        )
