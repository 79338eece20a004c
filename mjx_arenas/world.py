"""robosuite's empty world, into which an arena is merged (host)."""

import functools

import mujoco

from mjx_arenas.arena import Arena
from mjx_arenas.problem import problem
from mjx_arenas.robosuite import WithoutRobosuites
from mjx_arenas.rules import validation


class MujocoWorldBase(WithoutRobosuites):
    """An empty world with robosuite's physics options. `merge` an arena into it, add to its `spec`, then compile it."""

    def __init__(self) -> None:
        self.spec = mujoco.MjSpec()
        self._arena: Arena | None = None

    def merge(self, arena: Arena) -> None:
        """Takes in a copy of the arena's elements.

        Raises:
            TypeError: it is no arena.
            ValueError: the world already has an arena (robosuite: "repeated name 'floor'").
        """
        validation.check_type(
            "arena", arena, Arena, "an arena; robots and other MJCF are put into one by arena.attach(...)"
        )
        if self._arena is not None:
            raise validation.error([problem("arena", "second_arena")])
        self._arena = arena
        self.spec = arena.own_spec()
        option = self.spec.option
        option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 20
        option.density, option.viscosity = 1.2, 2e-5

    @functools.cached_property
    def mj_model(self) -> mujoco.MjModel:
        """The compiled world."""
        return self.spec.compile()
