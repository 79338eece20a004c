"""What the tables and objects of a spec are (host)."""

import dataclasses

from mjx_arenas.objects import Measures, Object
from mjx_arenas.placement import Places


@dataclasses.dataclass(frozen=True)
class TableNames:
    """Names of a table's elements (robosuite's)."""

    body: str
    collision: str
    visual: str
    top: str
    legs: tuple[str, str, str, str]
    adopted: bool = False
    """Whether the body stands in a scene, with what carries it."""

    @classmethod
    def of(cls, body: str, first_leg: int, collision: str | None = None) -> "TableNames":
        """The names that go with a body's; robosuite numbers legs from 0 in one class and from 1 in the other."""
        legs = tuple(f"{body}_leg{first_leg + k}_visual" for k in range(4))
        return cls(body, collision or f"{body}_collision", f"{body}_visual", f"{body}_top", legs)  # type: ignore[arg-type]

    @property
    def geoms(self) -> tuple[str, ...]:
        """Names of the geoms, in the order of `geometry.Table`."""
        return (self.collision, self.visual, *self.legs)

    def prefixed(self, prefix: str) -> "TableNames":
        """The same with a prefix."""
        legs = tuple(prefix + leg for leg in self.legs)
        names = (prefix + name for name in (self.body, self.collision, self.visual, self.top))
        return TableNames(*names, legs, self.adopted)  # type: ignore[arg-type]


@dataclasses.dataclass(frozen=True)
class Mount:
    """What stands on a table without being an object: a robot's base."""

    body: str
    table: int
    height: float  # of its origin above the top [m]


@dataclasses.dataclass(frozen=True)
class Parts:
    """What the tables and objects of a spec are, beside the numbers that vary."""

    tables: tuple[TableNames, ...]
    mounts: tuple[Mount, ...]
    objects: tuple[Object, ...]
    measures: tuple[Measures, ...]
    places: Places
