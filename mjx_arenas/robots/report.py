"""What `simplify` has changed, and what the robot costs before and after."""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple


class Reshaped(NamedTuple):
    """A geom with another shape."""

    geom: str
    """Its name; of one without a name, what it was and of which body."""
    was: str
    """Kind of shape that it had: "mesh", or a primitive's."""
    now: str
    """Kind of shape: "mesh", "capsule", ..., or "none" if it no longer collides."""
    change: float
    """Hausdorff distance of the convex hulls of both [m]: how far a point of either can be from the other; 0 for "none"."""


class Cost(NamedTuple):
    """What decides how fast a robot steps."""

    pairs: int
    """Pairs of its own geoms whose contacts are searched."""
    colliding: int
    """Geoms that collide."""
    vertices: int
    """Corners of the convex hulls of meshes that collide."""
    drawn: int
    """Geoms that do not collide."""


@dataclasses.dataclass(frozen=True)
class SimplifyReport:
    """Report of `simplify`; `print` it."""

    before: Cost
    after: Cost
    reshaped: tuple[Reshaped, ...]
    """Geoms whose shapes have changed, in the order of the robot's geoms."""
    excluded: tuple[tuple[str, str], ...]
    """Pairs of bodies whose contacts are left out."""
    actuators: tuple[str, ...]
    """Actuators that were removed."""
    sensors: tuple[str, ...]
    """Sensors that were removed with them."""
    options: Mapping[str, tuple[Any, Any]]
    """Options by name, before and after."""
    speeds: tuple[float, float] | None = None
    """Steps per second of the robot alone in C MuJoCo on one core, before and after; None unless `simplify` was to `measure`."""

    @property
    def largest_change(self) -> float:
        """Largest change of the shape of a geom that collides [m]."""
        return max((one.change for one in self.reshaped), default=0.0)

    def __str__(self) -> str:
        lines = [
            f"{what}: {getattr(self.before, name):,} -> {getattr(self.after, name):,}"
            for name, what in _WORDS.items()
            if getattr(self.before, name) or getattr(self.after, name)
        ]
        if self.speeds is not None:
            before, after = self.speeds
            lines.append(
                f"steps per second in C MuJoCo: {before:,.0f} -> {after:,.0f}, {after / before:.2f} times as many"
            )
        changed = [one for one in self.reshaped if one.now != "none"]
        if changed:
            worst = max(changed, key=lambda one: one.change)
            lines.append(f"largest change of shape: {1e3 * worst.change:.1f} mm, of {worst.geom} as a {worst.now}")
        kinds = dict.fromkeys((one.was, one.now) for one in self.reshaped)
        for was, now in kinds:
            n = sum((one.was, one.now) == (was, now) for one in self.reshaped)
            lines.append(f"{n} x {was} -> {now}" if now != "none" else f"{n} x {was} that collides no more")
        if self.excluded:
            lines.append(f"contacts left out: {_few([f'{one} and {other}' for one, other in self.excluded])}")
        for name in ("actuators", "sensors"):
            if gone := getattr(self, name):
                lines.append(f"{name} that are gone: {_few(gone)}")
        if self.options:
            lines.append(f"options: {', '.join(f'{name} {a} -> {b}' for name, (a, b) in self.options.items())}")
        return "\n".join(lines)


_WORDS = {
    "pairs": "pairs of geoms that may collide",
    "colliding": "geoms that collide",
    "vertices": "corners of their meshes",
    "drawn": "geoms that are drawn only",
}
_SHOWN = 6


def _few(names: Any) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(name or "one without a name" for name in names[:_SHOWN]) + more
