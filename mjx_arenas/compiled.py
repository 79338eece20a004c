"""What an arena is once it is compiled, and its worlds again in C MuJoCo (host)."""

import functools
from typing import Any

import jax
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.build import assemble, from_mjcf
from mjx_arenas.params.params import ArenaParams, ArenaRanges, present
from mjx_arenas.record import proof
from mjx_arenas.record.layout import Layout
from mjx_arenas.record.record import Record
from mjx_arenas.rules import validation, validation_ranges, validation_warnings
from mjx_arenas.sample.sampling import Nominal
from mjx_arenas.spec import calls, specs
from mjx_arenas.spec.objects import Object
from mjx_arenas.terms.parts import Parts
from mjx_arenas.twin import twin
from mjx_arenas.viz.shown import Shown


class Compiled(Shown):
    """The part of an arena that compiles it, and what needs no device."""

    spec: mujoco.MjSpec
    """Of the arena at its nominal parameters, with all tables and objects."""
    _parts: Parts
    _nominal: ArenaParams
    _calls: calls.Made
    _record: Record | None = None
    _checked: ArenaRanges | None = None  # the last ranges that were found right

    @property
    def bottom_pos(self) -> np.ndarray:
        """(3,) of the floor [m]."""
        return np.zeros(3)

    @property
    def n_tables(self) -> int:
        """T."""
        return len(self._parts.tables)

    @property
    def table_names(self) -> list[str]:
        """(T,) names of the tables' bodies."""
        return [t.body for t in self._parts.tables]

    @property
    def objects(self) -> tuple[Object, ...]:
        """(K,) the objects."""
        return self._parts.objects

    @functools.cached_property
    def mj_model(self) -> mujoco.MjModel:
        """The compiled nominal arena, with all tables and objects, those too that are nominally absent.

        Compiled on first use; neither it nor `spec` may change afterwards, but for options (`mj_model.opt`), which worlds take over
        until `put_model`.

        Raises:
            ValueError: the parameters would not decide the arena alone, because of what was added to `spec`.
        """
        model, self._pinned = proof.prove(self.spec, self._parts, self._nominal, type(self).__name__)
        self._compiled_xml = self.spec.to_xml()
        assemble.warn_of_nominal_places(model, self._parts, *present(self._nominal))
        return model

    @property
    def record(self) -> Record:
        """What is compiled, as one frozen record, with the options that `mj_model` has now."""
        model = self.mj_model
        if self._record is None or specs.options(self._record.mj_model.opt) != specs.options(model.opt):
            spec = self.spec.copy()
            specs.set_options(spec, model.opt)
            self._record = Record.of(model, spec, self._parts, self._nominal, self._pinned)
        return self._record

    @property
    def drawing(self) -> Nominal:
        """What draws start from."""
        return self._parts.drawing(self._nominal)

    @property
    def calls(self) -> calls.Made:
        """The calls that made the arena, which a file can hold; none where it was made in another way."""
        return self._calls

    @property
    def xml(self) -> str:
        """MJCF of the nominal arena."""
        spec = self.spec.copy()
        if "mj_model" in self.__dict__:  # its options hold
            specs.set_options(spec, self.mj_model.opt)
        assemble.remove_absent(spec, self._parts, *present(self._nominal))
        return assemble.world_xml(spec, self._parts)

    @property
    def layout(self) -> Layout:
        """Ids of the tables' and objects' elements in the compiled model."""
        return self.record.layout

    @property
    def mounts(self) -> list[str]:
        """Names of the bodies with which robots stand on tables."""
        return [m.body for m in self._parts.mounts]

    # One world again on the host.

    def compile(self, params: ArenaParams) -> mujoco.MjModel:
        """The world that MuJoCo's compiler makes of these parameters, without what is absent."""
        return twin.world_spec(self.unchanged(), params)[1]

    def to_xml(self, params: ArenaParams) -> str:
        """MJCF of the world with these parameters, without what is absent."""
        return twin.to_xml(self.unchanged(), params)

    def c_batch(self, params: ArenaParams, nthread: int = 0, keys: jax.Array | None = None) -> Any:
        """`mujoco.batch.Batch` of C MuJoCo with the same worlds, objects in place; needs MuJoCo 4.

        Args:
            params: (W, ...) of all worlds (`batch.params`).
            nthread: number of threads; 0: all cores.
            keys: (W,) that place the objects as `make_data` does; None: at their nominal places.
        """
        return twin.c_batch(self.record, params, nthread, keys)

    def c_world(
        self,
        params: ArenaParams,
        data: mjx.Data | mujoco.MjData | None = None,
        key: jax.Array | None = None,
        keyframe: str | None = None,
    ) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """One world in C MuJoCo: the model that `compile` gives and its data, after `mj_forward`.

        Args:
            params: of one world.
            data: whose state it takes over: of this world, on either implementation (`mja.take(data, i)` of many), or in C.
                None: objects rest on their tables, all else is at `qpos0` or as the keyframe has it.
            key: without data, places the objects as `make_data` does; None: at their nominal places.
            keyframe: without data, name of the keyframe that a robot starts in.
        """
        return twin.c_world(self.unchanged(), params, data, key, keyframe)

    # Checks.

    def unchanged(self) -> Record:
        """The record, if `spec` is still what was compiled.

        Raises:
            ValueError: it is not.
        """
        record = self.record
        if self.spec.to_xml() != self._compiled_xml:
            raise ValueError(
                "`arena.spec` changed after the arena was compiled: make all additions before the first use of the model."
            )
        return record

    def check_ranges(self, ranges: ArenaRanges, held: bool = False) -> None:
        """Refuses ranges that make no sense for this arena, and warns of those that have no effect.

        Args:
            ranges: what varies.
            held: also ranges that make absent what an equality would still pull at, which compiles the arena.

        Raises:
            TypeError, ValueError: all that is wrong with them.
        """
        nominal = self.drawing
        if ranges is not self._checked:
            check_type(ranges)
            problems = validation_ranges.ranges_problems(ranges, nominal, self._labels)
            carrying = self._parts.carrying(self.spec)
            problems = problems or validation_ranges.absence_problems(ranges, nominal, carrying, self._labels)
            validation.raise_all(problems, "`ranges`")
            validation_warnings.warn_of_idle(ranges, nominal, *self._parts.contacts(self.spec))
            moved = validation_ranges.moved_tables(ranges, nominal)
            if moved.any():
                validation_warnings.warn_of_left(from_mjcf.standing(self.spec, self._parts), moved, self.table_names)
            if not any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(ranges)):
                self._checked = ranges
        if held and ranges.varying & {"table_active", "object_active", "object_tables"}:
            found = validation_ranges.absence_problems(ranges, nominal, self.record.rules.held, self._labels)
            validation.raise_all(found, "`ranges`")

    @property
    def _labels(self) -> dict[str, list[Any]]:
        return validation.labels(self.n_tables, [o.name for o in self.objects])

    def _check_not_compiled(self, what: str) -> None:
        if "mj_model" in self.__dict__:
            raise ValueError(f"`{what}`: the arena is compiled already: {what} before the first use of the model.")


def check_type(ranges: object) -> None:
    """Refuses what are no ranges."""
    if not isinstance(ranges, ArenaRanges):
        raise TypeError(f"`ranges` must be an mjx_arenas.ArenaRanges, got {type(ranges).__name__}.")
