"""Arms of other packages, found where they are installed: `mja.robots.load("panda")`, to `mja.simplify` and `arena.attach`."""

from mjx_arenas.robots.packages import Robot as Robot
from mjx_arenas.robots.packages import known as known
from mjx_arenas.robots.packages import load as load
from mjx_arenas.robots.simplify import FAST as FAST
from mjx_arenas.robots.speed import steps_per_second as steps_per_second
