"""What is told apart in pictures: tables, objects, furniture, robots, and single geoms of the world (host)."""

import sys
from collections.abc import Collection
from typing import NamedTuple, SupportsIndex

import mujoco
import numpy as np

from mjx_arenas.problem import problem
from mjx_arenas.rules import validation
from mjx_arenas.spec import patterns


class Names(tuple[str, ...]):
    """Names of what is told apart."""

    def index(self, value: object, start: SupportsIndex = 0, stop: SupportsIndex = sys.maxsize, /) -> int:
        """The number of the first with this name.

        Raises:
            ValueError: none has it.
        """
        if value not in self:
            near = patterns.near(str(value), self)
            raise validation.error([problem("labels", "no_label", None, value, nearest=near)])
        return super().index(value, start, stop)


class Labels(NamedTuple):
    """The labels of a model."""

    names: Names
    """(N,) of the bodies on the world and on tables, each with all that is on it, such as a shelf with its boards, and of geoms
    of the world itself."""
    of_geoms: np.ndarray
    """(ngeom,) which of them each geom is."""


def of(model: mujoco.MjModel, tables: Collection[int]) -> Labels:
    """What is told apart in a model's pictures; what hangs on one of the bodies `tables` is not the table."""
    found: dict[tuple[str, int], int] = {}
    of_geoms = np.zeros(model.ngeom, np.int32)
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        while body not in tables and model.body_parentid[body] and model.body_parentid[body] not in tables:
            body = int(model.body_parentid[body])
        of_geoms[geom] = found.setdefault(("body", body) if body else ("geom", geom), len(found))
    names: list[str] = []
    for kind, index in found:
        name = getattr(model, kind)(index).name or f"{kind} {index}"
        names.append(name if name not in names else f"{name} ({kind})")
    return Labels(Names(names), of_geoms)
