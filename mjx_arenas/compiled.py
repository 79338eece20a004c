"""What an arena is once it is compiled, and its worlds again in C MuJoCo (host)."""

import copy
import functools
import threading
from collections.abc import Callable
from typing import Any, Concatenate, NoReturn, ParamSpec, Self, TypeVar

import jax
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import content
from mjx_arenas.build import aims, assemble, finish, from_mjcf, mjcf
from mjx_arenas.keywords import with_known_methods
from mjx_arenas.params.params import ArenaParams, ArenaRanges, Quantity, canonical
from mjx_arenas.problem import problem
from mjx_arenas.problems import messages
from mjx_arenas.record import proof
from mjx_arenas.record.layout import Layout
from mjx_arenas.record.record import Record
from mjx_arenas.rules import (
    angle_rules,
    footing_rules,
    friction_rules,
    meant_rules,
    part_ranges,
    reach_rules,
    validation,
    validation_ranges,
    validation_warnings,
)
from mjx_arenas.sample import tops
from mjx_arenas.sample.sampling import Nominal, world_keys
from mjx_arenas.sim import programs, starts
from mjx_arenas.spec import calls, comparing, specs
from mjx_arenas.spec.objects import Object
from mjx_arenas.terms.footing import footings
from mjx_arenas.terms.parts import Parts
from mjx_arenas.terms.rubbing import rubbing
from mjx_arenas.twin import twin
from mjx_arenas.viz.shown import Shown
from mjx_arenas.write.trees import pulled

_P = ParamSpec("_P")
_R = TypeVar("_R")


def one_at_a_time(method: Callable[Concatenate[Any, _P], _R]) -> Callable[Concatenate[Any, _P], _R]:
    """A method of an arena that one thread runs at a time, since a `MjSpec` is not for several."""

    @functools.wraps(method)
    def alone(self: "Compiled", *args: _P.args, **kwargs: _P.kwargs) -> _R:
        with self._lock:
            return method(self, *args, **kwargs)

    return alone


@with_known_methods
class Compiled(Shown):
    """The part of an arena that compiles it, and what needs no device."""

    spec: mujoco.MjSpec
    """The MJCF of the arena at its nominal parameters, with all tables and objects."""
    _parts: Parts
    _nominal: ArenaParams
    _calls: calls.Made
    _lock: threading.RLock
    _model: mujoco.MjModel | None = None
    _record: Record | None = None  # of the model as it was compiled, with the options that were set last
    _put: Record | None = None  # of the last template
    _checked: ArenaRanges | None = None  # the last ranges that were found right

    def __repr__(self) -> str:
        """What is in it, in a line."""
        parts = self._parts
        counted = (
            (len(parts.tables), "table", "tables"),
            (len(parts.objects), "object", "objects"),
            (len(parts.furniture), "part of furniture", "parts of furniture"),
            (len(self.quantities), "quantity", "quantities"),
        )
        said = [f"{n} {one if n == 1 else more}" for n, one, more in counted if n]
        return f"<{type(self).__name__}: {', '.join(said) or 'nothing'}>"

    @property
    def bottom_pos(self) -> np.ndarray:
        """(3,) of the floor [m]."""
        return np.zeros(3)

    @property
    def n_tables(self) -> int:
        """The number of tables, T."""
        return len(self._parts.tables)

    @property
    def table_names(self) -> list[str]:
        """(T,) names of the tables' bodies."""
        return [t.body for t in self._parts.tables]

    @property
    def surfaces(self) -> list[str]:
        """(S,) names of what objects can stand on: tables, then surfaces of furniture. `object_tables` has indices into these."""
        return self._parts.surfaces

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the quantities that `vary` and `add_part` made."""
        return tuple(one.name for one in self._parts.more)

    def elements(self, quantity: str) -> tuple[str, ...]:
        """(N,) names of the elements of a quantity of `quantities`, in the order of its numbers.

        Raises:
            ValueError: there is no such quantity.
        """
        selected = self._parts.selected
        if quantity not in selected:
            rule = "no_quantity" if selected else "no_quantities"
            raise messages.error([problem("quantity", rule, None, quantity, names=[repr(name) for name in selected])])
        return selected[quantity].elements

    @property
    def rules_of_quantities(self) -> dict[str, Quantity]:
        """What there is to know of every quantity, by name; does not compile the arena."""
        return self._parts.quantities

    @property
    def objects(self) -> tuple[Object, ...]:
        """(K,) the objects."""
        return self._parts.objects

    @property
    def is_compiled(self) -> bool:
        """Whether the arena is compiled. If so, `spec` must not be changed."""
        return self._model is not None

    @property
    @one_at_a_time
    def mj_model(self) -> mujoco.MjModel:
        """The compiled nominal arena. It also contains tables and objects that are nominally absent.

        It is compiled on first use. Afterwards neither it nor `spec` may change, except options (`mj_model.opt`) and visual settings.
        Worlds have the options that are set when they are made. Templates, and batches of them, have those of their `put_model`.

        Raises:
            ValueError: an addition to `spec` would make a world depend on more than its parameters.
        """
        if self._model is None:
            finish.finished(self.spec, self._parts.varied)
            model, given = proof.prove(self.spec, self._parts, self._nominal, type(self).__name__)
            self._compiled_xml = self._xml_of_spec()
            self._record = Record.of(model, self.spec, self._parts, self._nominal, given)
            start = mujoco.MjData(model)
            starts.vary_c(self._record, self._nominal, start)
            wanted = self._parts.wanted(self._nominal)
            assemble.warn_of_nominal_places(model, start, self._parts, wanted, self._crowded)
            places = self._record.layout.places
            away = reach_rules.nominal_problems(
                self._nominal, self._record.rules, places, self.objects, self.table_names
            )
            for one in away:
                messages.warn(one)
            self._model = model
        return self._model

    def _crowded(self) -> list[str]:
        """Names of the objects that find no free place in the nominal arena, with several keys."""
        assert self._record is not None
        with jax.ensure_compile_time_eval():  # numbers, while a caller is traced, too
            place = functools.partial(programs.place, self._record, canonical(self._nominal), margin=0.0)
            found = np.asarray(jax.vmap(lambda key: place(key=key).valid)(world_keys(0, range(4))))
        return [o.name for o, free in zip(self.objects, np.atleast_1d(found.any(0)), strict=True) if not free]

    @property
    @one_at_a_time
    def record(self) -> Record:
        """What is compiled, as one frozen record, with the options that `mj_model` has now."""
        option = self.mj_model.opt
        assert self._record is not None
        if specs.options(self._record.mj_model.opt) != specs.options(option):
            changed = specs.other_options(option, self._record.mj_model.opt)
            for term in (t for t in self._parts.varied if t.kind == "option" and t.attribute[7:] in changed):
                raise validation.error(
                    [problem(f"arena.mj_model.opt.{term.attribute[7:]}", "varied_option", name=term.name)]
                )
            self._record = self._record.with_options(option)
            others = {} if self._put is None else specs.other_options(option, self._put.mj_model.opt)
            if others:
                messages.warn(problem("arena.mj_model.opt", "options_since", names=list(others)))
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
        """MJCF of the nominal arena; a `ValueError` says what MJCF would lose of it."""
        spec = self.own_spec()
        self._parts.presence.edit(spec, self._nominal)
        return mjcf.proven(spec, specs.compiled(spec.copy(), "arena.spec"), "arena.spec")

    @one_at_a_time
    def own_spec(self) -> mujoco.MjSpec:
        """A copy of `spec`, with the options that `mj_model` has, if it is compiled.

        Raises:
            ValueError: a table or an object is gone, or what is compiled was changed since.
        """
        if self.is_compiled:
            return self.unchanged().spec.copy()
        validation.raise_all(self._parts.problems(self.spec), "`arena.spec`")
        return finish.finished(self.spec.copy(), self._parts.varied)

    def __copy__(self) -> Self:
        return self.__deepcopy__({})

    @one_at_a_time
    def __deepcopy__(self, memo: object) -> Self:
        """An equal arena, which shares the record, and with that what is compiled; the rest is never changed in place."""
        other = object.__new__(type(self))
        own = {"spec": self.spec.copy(), "_model": copy.copy(self._model), "_lock": threading.RLock()}
        other.__dict__.update(self.__dict__ | own)
        return other

    def __reduce__(self) -> NoReturn:
        raise messages.error([problem("arena", "arena_pickled")], kind=TypeError)

    @property
    def layout(self) -> Layout:
        """Ids of the tables' and objects' elements in the compiled model."""
        return self.record.layout

    @property
    def mounts(self) -> list[str]:
        """Names of the bodies with which robots stand on tables."""
        return self._parts.robots

    # One world again on the host.

    def compile(self, params: ArenaParams) -> mujoco.MjModel:
        """The world that MuJoCo's compiler makes of these parameters, without what is absent.

        Args:
            params: parameters of one world. They carry no reference to their arena, so those of another arena with as many tables and
                objects are accepted without an error.
        """
        return twin.world_spec(self.unchanged(), params)[1]

    def to_xml(self, params: ArenaParams) -> str:
        """MJCF of the world with these parameters, without what is absent; a `ValueError` says what MJCF would lose of it."""
        return twin.to_xml(self.unchanged(), params)

    def c_batch(self, params: ArenaParams, nthread: int = 0, keys: jax.Array | None = None) -> Any:
        """`mujoco.batch.Batch` of C MuJoCo with the same worlds, objects in place.

        Args:
            params: (W, ...) parameters of all worlds (`batch.params`).
            nthread: number of threads; 0: all cores.
            keys: (W,) keys, which place the objects as `make_data` does. None: objects are at their nominal places.
        """
        return twin.c_batch(self.unchanged(), params, nthread, keys)

    def c_world(
        self,
        params: ArenaParams,
        data: mjx.Data | mujoco.MjData | None = None,
        key: jax.Array | None = None,
        keyframe: str | None = None,
    ) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """One world in C MuJoCo: the model that `compile` gives and its data, after `mj_forward`.

        Args:
            params: parameters of one world.
            data: the state to take over: data of this world, on either implementation (`mja.take(data, i)` of many), or in C.
                None: objects rest on their tables, and everything else is at `qpos0` or in the keyframe.
            key: places the objects as `make_data` does, if there is no `data`. None: objects are at their nominal places.
            keyframe: name of the keyframe that a robot starts in, if there is no `data`.
        """
        return twin.c_world(self.unchanged(), params, data, key, keyframe)

    # Checks.

    @one_at_a_time
    def unchanged(self) -> Record:
        """The record, if `spec` and `mj_model` are still what was compiled.

        Raises:
            ValueError: it is not.
        """
        record = self.record
        if self._xml_of_spec() != self._compiled_xml:
            raise messages.error([problem("arena.spec", "spec_changed")])
        if content.of_model(record.mj_model).tobytes() != content.of_model(self.mj_model).tobytes():
            edited = comparing.differing(record.mj_model, self.mj_model)
            if edited:
                raise messages.error([problem("arena.mj_model", "mj_model_changed", None, None, names=sorted(edited))])
        return record

    def _xml_of_spec(self) -> str:
        """The spec as MJCF; of a copy, as of the spec MuJoCo would repeat each time what it said when something was attached to it."""
        return self.spec.copy().to_xml()

    @one_at_a_time
    def check_ranges(self, ranges: ArenaRanges, held: bool = False) -> None:
        """Refuses ranges that make no sense for this arena, and warns of those that have no effect.

        Args:
            ranges: what varies.
            held: whether to refuse also ranges that make something absent to which an equality is attached. This compiles the arena.

        Raises:
            TypeError, ValueError: all that is wrong with them.
        """
        nominal = self.drawing
        if ranges is not self._checked:
            validation.check_ranges_type(ranges)
            validation.raise_all(self._parts.problems(self.spec), "`arena.spec`")
            problems = validation_ranges.ranges_problems(ranges, nominal, self._labels)
            carrying = self._parts.carrying(self.spec)
            problems = problems or part_ranges.reach_problems(ranges, nominal, self._labels)
            if not any(p.path.startswith(validation_ranges.of_presence(nominal)) for p in problems):
                problems += validation_ranges.absence_problems(ranges, nominal, carrying, self._labels)
            validation.raise_all(problems, "`ranges`")
            for one in validation_ranges.gone_problems(ranges, nominal, self.table_names):
                messages.warn(one)
            contacts = self._parts.contacts(self.spec)
            angle_rules.warn_of_ranges(ranges, nominal, self._labels)
            meant_rules.warn_of_ranges(ranges, nominal, self._labels)
            part_ranges.warn_of_ranges(ranges, nominal, self._labels)
            validation_warnings.warn_of_idle(ranges, nominal, *contacts)
            rubs = rubbing(self.spec, self._parts)
            friction_rules.warn_of_idle(ranges, nominal, rubs, decided=bool(contacts[1]))
            friction_rules.warn_of_spin(ranges, nominal, rubs)
            footing_rules.warn_of_gaps(ranges, nominal, footings(self._parts, self._model))
            aims.warn_of_absent(self.spec, self._parts, ranges, nominal)
            moved = validation_ranges.moved_tables(ranges, nominal)
            if moved.any():
                model = self._model or specs.compiled(self.spec.copy(), "arena.spec")
                for kind, bodies in from_mjcf.standing(model, self._parts, pulled(model))._asdict().items():
                    validation_warnings.warn_of_left(kind, bodies, moved, self.table_names)
            if not any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(ranges)):
                self._checked = ranges
        if held and ranges.varying & tops.deciding(nominal.ground):
            found = validation_ranges.absence_problems(ranges, nominal, self.record.rules.held, self._labels)
            validation.raise_all(found, "`ranges`")

    @property
    def _labels(self) -> validation.Labels:
        names = [o.name for o in self.objects]
        return validation.labels(self.table_names, names, self._parts.selected, self._parts.surfaces)
