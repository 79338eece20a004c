"""robosuite's arenas."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.arena import Arena
from mjx_arenas.build import assemble
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.rules import validation, validation_objects
from mjx_arenas.spec import calls
from mjx_arenas.spec.objects import Object
from mjx_arenas.terms.parts import Parts, TableNames

DEFAULT_FULL_SIZE = (0.8, 0.8, 0.05)
DEFAULT_FRICTION = (1, 0.005, 0.0001)


def _assemble(
    arguments: validation.Arguments,
    given: Mapping[str, np.ndarray | None],
    name_table: Callable[[int], TableNames],
    objects: Sequence[Object],
    xml: str | os.PathLike | None,
    priority: int,
    condim: int | None,
) -> tuple[mujoco.MjSpec, Parts, ArenaParams]:
    """Spec, parts and nominal parameters of an arena, or all problems of the call."""
    spec = assemble.load_spec(xml)
    offsets = given["table_offsets"]
    tables = None if offsets is None else [name_table(i) for i in range(len(offsets))]
    names = None if tables is None else [t.body for t in tables]
    problems, object_tables = validation_objects.object_problems(objects, names, spec)
    problems = arguments.problems + problems + validation.table_option_problems(priority, condim)
    validation.raise_all(problems, "TableArena" if arguments.singular else "MultiTableArena")
    assert tables is not None
    assemble.add_tables(spec, tables, priority, 3 if condim is None else condim)
    parts, nominal = assemble.with_objects(spec, tables, given, objects, object_tables, priority)
    if condim is None:
        assemble.raise_condim(spec, parts)
    return spec, parts, nominal


class MultiTableArena(Arena):
    """Any number of tables; robosuite's `MultiTableArena`.

    Args:
        table_offsets: (T, 3) centre of each table's top surface [m].
        table_rots: one yaw or (T,) [rad].
        table_full_sizes: (3,) or (T, 3) length, width, thickness [m].
        table_frictions: (3,) or (T, 3) sliding, torsional, rolling.
        has_legs: one or (T,).
        xml: path of a base MJCF, or MJCF text. Default: floor, lights and robosuite's four cameras.
        objects: free bodies on the tables.
        table_active: one or (T,), whether a table is there, nominally.
        table_priority: `priority` of the tables' collision geoms, and of furniture's. 1: a contact has the table's friction (and
            `solref`, `solimp`). 0: MuJoCo's rule, the larger friction of table and object (robosuite).
        table_condim: `condim` of the tables' contacts: 3 uses sliding friction only, 4 torsional too, 6 rolling too.
            Default: the largest of the objects', at least 3.

    Raises:
        ValueError: all problems of the call.
    """

    @with_known_arguments
    def __init__(
        self,
        table_offsets: Any,
        table_rots: Any = 0,
        table_full_sizes: Any = DEFAULT_FULL_SIZE,
        table_frictions: Any = DEFAULT_FRICTION,
        has_legs: Any = True,
        xml: str | os.PathLike | None = None,
        *,
        objects: Sequence[Object] = (),
        table_active: Any = True,
        table_priority: int = 1,
        table_condim: int | None = None,
    ) -> None:
        arguments = validation.Arguments(singular=False)
        given = arguments.table_params(
            table_offsets=table_offsets,
            table_rots=table_rots,
            table_full_sizes=table_full_sizes,
            table_frictions=table_frictions,
            has_legs=has_legs,
            table_active=table_active,
        )

        def name(i: int) -> TableNames:
            return TableNames.of(f"table{i}", first_leg=0)

        super().__init__(*_assemble(arguments, given, name, objects, xml, table_priority, table_condim))
        self._calls = calls.Made([calls.of(MultiTableArena, locals())])

    @property
    def table_offsets(self) -> np.ndarray:
        """(T, 3) centres of the top surfaces [m]."""
        return self._nominal.table_offsets

    @property
    def table_rots(self) -> np.ndarray:
        """(T,) yaws [rad]."""
        return self._nominal.table_rots

    @property
    def table_full_sizes(self) -> np.ndarray:
        """(T, 3) length, width, thickness [m]."""
        return self._nominal.table_full_sizes

    @property
    def table_half_sizes(self) -> np.ndarray:
        """(T, 3) half of `table_full_sizes` [m]."""
        return self._nominal.table_full_sizes / 2

    @property
    def table_frictions(self) -> np.ndarray:
        """(T, 3) sliding, torsional, rolling."""
        return self._nominal.table_frictions

    @property
    def has_legs(self) -> list[bool]:
        """(T,) whether each table has legs."""
        return self._nominal.has_legs.tolist()

    @property
    def center_pos(self) -> np.ndarray:
        """(T, 3) centres of the slabs [m]."""
        return self.bottom_pos + self.table_offsets - self.table_half_sizes * [0, 0, 1]

    @property
    def table_top_abs(self) -> np.ndarray:
        """(T, 3) centres of the top surfaces in the world [m]."""
        return self.bottom_pos + self.table_offsets


class TableArena(Arena):
    """One table; robosuite's `TableArena`.

    Args:
        table_full_size: (3,) length, width, thickness [m].
        table_friction: (3,) sliding, torsional, rolling.
        table_offset: (3,) centre of the top surface [m].
        has_legs: whether the table has legs.
        xml: path of a base arena, as in `MultiTableArena`.
        objects: free bodies on the table.
        table_priority: as in `MultiTableArena`.
        table_condim: as in `MultiTableArena`.

    Raises:
        ValueError: all problems of the call.
    """

    @with_known_arguments
    def __init__(
        self,
        table_full_size: Any = DEFAULT_FULL_SIZE,
        table_friction: Any = DEFAULT_FRICTION,
        table_offset: Any = (0, 0, 0.8),
        has_legs: Any = True,
        xml: str | os.PathLike | None = None,
        *,
        objects: Sequence[Object] = (),
        table_priority: int = 1,
        table_condim: int | None = None,
    ) -> None:
        arguments = validation.Arguments(singular=True)
        given = arguments.table_params(
            table_offsets=table_offset,
            table_rots=0.0,
            table_full_sizes=table_full_size,
            table_frictions=table_friction,
            has_legs=has_legs,
            table_active=True,
        )

        def name(i: int) -> TableNames:
            return TableNames.of("table", first_leg=1)

        super().__init__(*_assemble(arguments, given, name, objects, xml, table_priority, table_condim))
        self._calls = calls.Made([calls.of(TableArena, locals())])

    @property
    def table_offset(self) -> tuple[float, ...]:
        """(3,) centre of the top surface [m]."""
        return tuple(self._nominal.table_offsets[0].tolist())

    @property
    def table_full_size(self) -> np.ndarray:
        """(3,) length, width, thickness [m]."""
        return self._nominal.table_full_sizes[0]

    @property
    def table_half_size(self) -> np.ndarray:
        """(3,) half of `table_full_size` [m]."""
        return self.table_full_size / 2

    @property
    def table_friction(self) -> tuple[float, ...]:
        """(3,) sliding, torsional, rolling."""
        return tuple(self._nominal.table_frictions[0].tolist())

    @property
    def has_legs(self) -> bool:
        """Whether the table has legs."""
        return bool(self._nominal.has_legs[0])

    @property
    def center_pos(self) -> np.ndarray:
        """(3,) centre of the slab [m]."""
        return self.bottom_pos + self.table_offset - self.table_half_size * [0, 0, 1]

    @property
    def table_top_abs(self) -> np.ndarray:
        """(3,) centre of the top surface in the world [m]."""
        return self.bottom_pos + self.table_offset

    @property
    def table_body(self) -> mujoco.MjsBody:
        """The table's body in `spec`."""
        return self.spec.body("table")

    @property
    def table_collision(self) -> mujoco.MjsGeom:
        """The slab that collides, in `spec`."""
        return self.spec.geom("table_collision")

    @property
    def table_visual(self) -> mujoco.MjsGeom:
        """The slab that is drawn, in `spec`."""
        return self.spec.geom("table_visual")

    @property
    def table_top(self) -> mujoco.MjsSite:
        """The site at the centre of the top surface, in `spec`."""
        return self.spec.site("table_top")
