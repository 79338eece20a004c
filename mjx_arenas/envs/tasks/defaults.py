"""What a task of an arm has of its own."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import mujoco

from mjx_arenas.arena import Arena
from mjx_arenas.envs.arms.arm import Arm
from mjx_arenas.params.params import ArenaRanges
from mjx_arenas.rules.validation import check_takes, check_type


class Defaults(NamedTuple):
    """What a task of an arm has of its own; arena, ranges and place of the arm only where no arena is given."""

    arena: Callable[[Arm], Arena]
    """Makes its arena, for an arm whose reach it may ask for."""
    ranges: Callable[[], ArenaRanges]
    """Makes its ranges."""
    on: int | str | None = 0
    """The table that carries the arm, by index or name; None: the arm stands in the world."""
    pos: Sequence[float] = (0.0, 0.0, 0.0)
    """(3,) place of the foot of the arm there [m]."""
    marks: Callable[[mujoco.MjSpec], None] = lambda spec: None
    """Adds the marker of the goal to any arena."""
    does: str = ""
    """Verb for what the task does to the arena's first object, such as "lift", in messages; "": it needs no object."""
    grips: bool = True
    """Whether its gripper holds the object, which must then be narrow enough, and must not slip by its friction cone."""
    max_contacts: int = 48
    """Number for one world. By default an arena has room for contacts of any two parts, which is slow."""


def check(defaults: Any) -> None:
    """Refuses what are no defaults of a task.

    Raises:
        TypeError: they are not.
    """
    check_type("defaults", defaults, Defaults, "Defaults(...), what the task has of its own")
    for name, arguments in (("arena", ("arm",)), ("ranges", ()), ("marks", ("spec",))):
        of = f"a function of ({', '.join(arguments)})"
        check_type(f"defaults.{name}", getattr(defaults, name), Callable, of)  # type: ignore[arg-type]
        check_takes(f"defaults.{name}", getattr(defaults, name), arguments)
    check_type("defaults.does", defaults.does, str, 'a verb such as "lift", or ""')
    check_type("defaults.grips", defaults.grips, bool, "True or False")
