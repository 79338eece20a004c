"""An arena: configured and compiled once on the host, varied in thousands of worlds on the device."""

import functools
import logging
import os
from collections.abc import Callable, Sequence
from typing import Any, Literal

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import (
    attach,
    build,
    calls,
    from_mjcf,
    geometry,
    layout,
    mesh,
    messages,
    overlaps,
    programs,
    proof,
    sampling,
    specs,
    starts,
    strict,
    twin,
    validation,
    validation_ranges,
    validation_warnings,
    validation_worlds,
)
from mjx_arenas import data as data_
from mjx_arenas.batch import ArenaBatch
from mjx_arenas.layout import Layout
from mjx_arenas.objects import Object
from mjx_arenas.params import ArenaParams, ArenaRanges, canonical, on_host, present
from mjx_arenas.parts import Parts
from mjx_arenas.placement import Placement
from mjx_arenas.record import Record
from mjx_arenas.sampling import Nominal
from mjx_arenas.viz.shown import Shown
from mjx_arenas.write import writer
from mjx_arenas.write.replace import replace

_log = logging.getLogger("mjx_arenas")


class Arena(Shown):
    """Tables and objects on a fixed topology. Use `MultiTableArena`, `TableArena` or `Arena.from_xml`.

    `attach` robots, and add what else you like to `spec` (sensors, cameras), until the model is first compiled, by
    `mj_model` or anything that needs it. Objects of one geom may get sites, cameras and lights, no geoms or bodies.
    """

    def __init__(self, spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams) -> None:
        self.spec = spec
        """`mujoco.MjSpec` of the arena at its nominal parameters, with all tables and objects."""
        self._parts = parts
        self._nominal = nominal
        self._record: Record | None = None
        self._checked: ArenaRanges | None = None  # the last ranges that were found right
        self._looked_at: tuple[object, Sequence[str]] = (None, ())  # the last template that was found right
        self._calls = calls.Made()
        names = tuple(o.name for o in parts.objects)
        validation.raise_all(validation_worlds.size_problems(nominal, names, parts.places.kind), "`objects`")
        build.set_params(spec, parts, nominal)
        proof.check_rules(spec, parts)
        model = proof.check_compiles(spec)
        overlaps.warn(overlaps.overlaps(model, "", self._passing), "The arena")
        validation_warnings.warn_of_overlaps(nominal, self.table_names)
        validation_warnings.warn_of_crowds(nominal)
        validation_warnings.warn_of_places(nominal, names, parts.places.pos)
        validation_warnings.warn_of_degrees("table_rots", nominal.table_rots)

    @classmethod
    def from_xml(
        cls, xml: str | os.PathLike, tables: Sequence[str], *, objects: Sequence[Object] = (), table_priority: int = 1
    ) -> "Arena":
        """An arena whose tables stand in an MJCF scene already.

        A table is a body of the scene that is fixed to the world and has a box on which things stand: that box is the
        slab whose size, friction and pose vary, and what else hangs on the body moves with the middle of the slab, as
        it is. Without legs of ours. The slab's `condim` is raised to the largest of the `objects`'.

        Args:
            xml: path of the MJCF, or MJCF text.
            tables: name of each table's body, or, where that has several boxes that collide, of the slab's geom.
            objects: free bodies on the tables, beside those that the scene has.
            table_priority: `priority` of the slabs' contacts, see `MultiTableArena`.

        Raises:
            ValueError: all problems of the call.
        """
        spec = specs.read(xml, "xml")
        names, table_params = from_mjcf.adopt_tables(spec, tables, table_priority)
        bodies, slabs = [n.body for n in names], [n.collision for n in names]
        problems, object_tables = validation.object_problems(objects, bodies, spec, slabs)
        problems += validation.table_option_problems(table_priority, None)
        validation.raise_all(problems, "from_xml")
        parts, nominal = build.add_objects(spec, names, table_params, objects, object_tables)
        build.raise_condim(spec, parts)
        arena = Arena(spec, parts, nominal)
        arena._calls = calls.Made([calls.of(Arena.from_xml, locals())])
        return arena

    # What the arena is (host).

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
        model, self._fields = proof.prove(self.spec, self._parts, self._nominal, type(self).__name__)
        self._compiled_xml = self.spec.to_xml()
        build.warn_of_nominal_places(model, self._parts, *present(self._nominal))
        return model

    @property
    def record(self) -> Record:
        """What is compiled, as one frozen record, with the options that `mj_model` has now."""
        model = self.mj_model
        if self._record is None or specs.options(self._record.mj_model.opt) != specs.options(model.opt):
            spec = self.spec.copy()
            specs.set_options(spec, model.opt)
            self._record = Record.of(model, spec, self._parts, self._nominal, self._fields)
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
        build.remove_absent(spec, self._parts, *present(self._nominal))
        return build.world_xml(spec, self._parts)

    @property
    def layout(self) -> Layout:
        """Ids of the tables' and objects' elements in the compiled model."""
        return self.record.layout

    def attach(
        self,
        robot: str | os.PathLike | mujoco.MjSpec,
        prefix: str = "robot_",
        pos: Sequence[float] = (0, 0, 0),
        quat: Sequence[float] = (1, 0, 0, 0),
        on_table: int | str | None = None,
        options: Literal["all", "solver"] | None = None,
    ) -> None:
        """Puts a robot, or any other MJCF, into the arena, with its actuators, sensors, tendons, defaults and keyframes.

        Args:
            robot: path of an MJCF file, MJCF text, or a spec, of which a copy is taken.
            prefix: of all its names.
            pos: (3,) where its origin stands: in the world, or in the frame of the table's top [m].
            quat: (4,) its orientation there.
            on_table: index or body name (or slab's name) of the table that it stands on and follows in every world. The table cannot be
                absent then.
            options: which of its `<option>`s are taken over where the arena has MuJoCo's defaults: "all", or "solver", which
                leaves out what changes all else in the arena: contacts and gravity that are switched off, other gravity,
                density, viscosity, wind and magnetic field, and overridden contact parameters. None: all, with a warning of these.

        Objects are not placed where a robot's geoms are that no joint moves, its base, on a table or in the world; where
        its arm is they are (see `place`).

        Raises:
            ValueError: names that the arena has already, a table that does not exist, what MuJoCo refuses. The arena is
                then as before.
        """
        self._check_not_compiled("attach")
        child = specs.read(robot, "robot")
        table = attach.check(child, prefix, pos, quat, on_table, options, self._parts.tables)
        parts, merged, inside = self._parts, attach.Options([], []), []
        for spec in (self.spec.copy(), self.spec):  # the second only where the first compiles
            parts = attach.attach(spec, self._parts, child.copy(), prefix, pos, quat, table)
            merged = attach.merge_options(spec, child, options)
            build.set_params(spec, parts, self._nominal)
            if spec is not self.spec:
                proof.check_rules(spec, parts)
                model = proof.check_compiles(spec)
                inside = overlaps.overlaps(model, prefix, self._passing)
        self._parts = parts
        if self._calls:
            self._calls = calls.Made([*self._calls, calls.of(Arena.attach, locals())])
        merged = merged if options is None else merged._replace(changed=[])
        tell = 'with options="solver" the arena keeps its own, with options="all" it takes these without a warning'
        attach.warn_of_options(merged, "robot", tell)
        overlaps.warn(inside, "`robot`")

    def merge(self, other: "Arena", prefix: str, pos: Sequence[float] = (0, 0, 0), rot: float = 0.0) -> "Arena":
        """A new arena with the tables, objects and all else of two.

        Args:
            other: the arena to put beside this one.
            prefix: of all its names. What stands directly in the world of both under one name (the floor, lights,
                cameras) is this arena's.
            pos: (3,) where the other's origin comes to stand [m].
            rot: its yaw there [rad].
        """
        if not isinstance(other, Arena):
            raise TypeError(f"`other` must be an arena, got {type(other).__name__}.")
        spec, parts, nominal = attach.merge(
            (self.spec, self._parts, self._nominal), (other.spec, other._parts, other._nominal), prefix, pos, rot
        )
        merged = Arena(spec, parts, nominal)
        if self._calls and other._calls:
            given = locals() | {"other": other._calls}
            merged._calls = calls.Made([*self._calls, calls.of(Arena.merge, given)])
        return merged

    @property
    def mounts(self) -> list[str]:
        """Names of the bodies with which robots stand on tables."""
        return [m.body for m in self._parts.mounts]

    # Vary (device, pure).

    @strict.own_constants
    def put_model(self, impl: str | None = None) -> mjx.Model:
        """`mjx.Model` of the nominal arena.

        Args:
            impl: "jax", "warp", or None for the best one here: Warp on an NVIDIA GPU where `warp-lang` is installed,
                else JAX. `model.impl` and the log ("mjx_arenas") say which.
        """
        model = data_.put_model(self.mj_model, impl)
        return model if np.concatenate(present(self._nominal)).all() else self.apply(model, self.nominal_params())

    @strict.own_constants
    def nominal_params(self) -> ArenaParams:
        """Parameters of the arena as it was configured."""
        return canonical(self._nominal)

    @strict.own_constants
    def sample_params(self, key: jax.Array, ranges: ArenaRanges) -> ArenaParams:
        """Draws the parameters of one world; jit, vmap.

        Args:
            key: of the world. Each quantity, and in it each table (by its index) and object (by its name), folds its
                own key from it, so that a draw does not depend on what else is drawn.
            ranges: what varies; the rest is nominal. May be traced.
        """
        self.check_ranges(ranges)
        validation.raise_all(validation.one_key_problems("key", key), "`key`")
        return programs.sample(self.drawing, key, ranges)

    @strict.own_constants
    def valid(self, params: ArenaParams, ranges: ArenaRanges | None = None) -> jax.Array:
        """() bool: this world can be; jit, vmap.

        MuJoCo would compile it, each object fits on its table and has the size that its file says, if it has one, nothing is
        absent that is tied to what is there or carries something that moves, and no two tables overlap that are apart nominally.

        Args:
            params: of one world.
            ranges: if given, also that a table stands, and that the tables keep to the ranges' `workspace`.
        """
        self._check_shapes(params)
        if ranges is not None:
            _check_type(ranges)
        return validation_worlds.valid(params, self.record.rules, ranges)

    def problems(
        self, params: ArenaParams, ranges: ArenaRanges | None = None, key: jax.Array | None = None
    ) -> list[str]:
        """Why one world cannot be, a sentence each; none where it can: what `valid` says, on the host.

        Of a batch: `{i: arena.problems(batch.world(i), ranges) for i in np.flatnonzero(~batch.valid)}`.

        Args:
            params: of one world.
            ranges: if given, also that a table stands, and that the tables keep to the ranges' `workspace`.
            key: of the world; if given, also which objects find no free place (`place`).
        """
        self._check_shapes(params)
        if ranges is not None:
            _check_type(ranges)
        rules = validation_worlds.bound(self.record.rules, ranges)
        problems = validation_worlds.world_problems(on_host(params), rules)
        if key is not None and not problems:
            found = np.asarray(self.place(params, key).valid)
            problems = validation_worlds.place_problems(found, self.record.object_names)
        return [messages.sentence(problem) for problem in problems]

    def fields(self, model: mjx.Model, params: ArenaParams) -> dict[str, jax.Array]:
        """Fields of `mjx.Model` that the parameters decide, with their values in one world; jit, vmap, grad."""
        self._check_shapes(params)
        self._check_model(model)
        return programs.fields(self.record, model, canonical(params))

    def apply(self, model: mjx.Model, params: ArenaParams) -> mjx.Model:
        """`model` with the parameters of one world; jit, vmap, grad.

        Args:
            model: of this arena. What the parameters do not decide stays as it is there. A model of another arena is
                refused where sizes or names differ; from another one with the same names it cannot be told, as all numbers
                of a template may be yours.
            params: of one world. Values are not checked (see `valid`), shapes are.
        """
        return replace(model, self.fields(model, params))

    @strict.own_constants
    def place(self, params: ArenaParams, key: jax.Array, margin: float = 0.0) -> Placement:
        """Places for all objects on the tables of one world, inside the edges and apart; jit, vmap.

        Clear of the tables' slabs and of the geoms that collide and are fixed, on a table (from its top up) or to the
        world: each is a rectangle seen from above. Not of planes, nor of what joints move, such as a robot's arm.

        Args:
            params: of one world.
            key: of the world. Each object folds its own key from it, by its name.
            margin: smallest distance to the table's edges [m].
        """
        self._check_shapes(params)
        validation.raise_all(validation.one_key_problems("key", key), "`key`")
        if not isinstance(margin, jax.core.Tracer):
            validation.raise_all(validation.length_problems("margin", margin), "place")
        return programs.place(self.record, canonical(params), key, margin)

    @strict.own_constants
    def rest_heights(self, params: ArenaParams) -> jax.Array:
        """(K,) heights [m] of the objects' origins in the world when they touch the tops of their tables; jit, vmap."""
        self._check_shapes(params)
        p = canonical(params)
        top = geometry.pick(p.table_offsets[:, 2], p.object_tables)
        return top + p.object_full_sizes[:, 2] / 2 - jnp.asarray(self.layout.places.center[:, 2], top.dtype)

    @strict.own_constants
    def make_world_data(
        self,
        model: mjx.Model,
        params: ArenaParams,
        key: jax.Array | None = None,
        n_worlds: int | None = None,
        keyframe: str | None = None,
        max_contacts: int | None = None,
    ) -> mjx.Data:
        """`mjx.Data` of one world at rest: objects on their tables, static geoms where `model` has them; jit, vmap.

        Args:
            model: of this world (`apply`).
            params: of this world.
            key: places the objects (`place`, which also says whether each found a free place; one that did not starts
                above the others); None: at their nominal places, which may coincide where `object_tables` varies.
            n_worlds: Warp keeps the contacts of all worlds together and needs to know how many there are. None:
                counts those that `jax.vmap` stands for, by what differs between them: if `model`, `params` and `key` are the
                same in all worlds, give the number.
            keyframe: name of the keyframe that a robot starts in; objects stand on their tables all the same.
            max_contacts: how many contacts a world has room for on Warp, where more are dropped (see `mja.capacity`). None:
                as many as can touch at once.
        """
        self._check_shapes(params)
        return starts.one_world(self.record, model, params, key, n_worlds, keyframe, max_contacts)

    @strict.own_constants
    def randomize(self, model: mjx.Model, keys: jax.Array, ranges: ArenaRanges) -> ArenaBatch:
        """A batch of worlds.

        Args:
            model: of this arena, nominal in what does not vary (see `apply`).
            keys: (W,) keys, one a world. Spread over a mesh, they spread the worlds (docs/scaling.md).
            ranges: what varies.
        """
        self.check_ranges(ranges, held=True)
        validation.raise_all(validation.key_problems("keys", keys), "`keys`")
        self._check_model(model)
        record = self.record
        names = writer.field_names(record.scene, ranges.varying)
        self._check_nominal(model, names)
        model, ranges = programs.beside(keys, model), mesh.beside(keys, ranges)
        values, params, valid = programs.randomized(record, model, keys, ranges)
        return ArenaBatch(replace(model, values), params, valid, names, record)

    def batch(self, model: mjx.Model, params: ArenaParams) -> ArenaBatch:
        """A batch of worlds with given parameters.

        Args:
            model: of this arena, one world.
            params: (W, ...) of all worlds.
        """
        validation.raise_all(validation.batch_shape_problems(params, self._labels), "`params`")
        self._check_model(model)
        params = canonical(params)
        model = programs.beside(params.table_rots, model)
        values, valid = programs.given(self.record, model, params)
        return ArenaBatch(replace(model, values), params, valid, tuple(values), self.record)

    def randomization_fn(self, ranges: ArenaRanges) -> Callable[[mjx.Model, jax.Array], tuple[mjx.Model, mjx.Model]]:
        """The `randomization_fn` of Brax's trainers and of Playground's wrappers (docs/training.md).

        Objects start where the world's tables are in `model.qpos0` of each world: an environment that sets `qpos`
        itself must put them there, or at places that `place` draws, not where the template has its tables. On
        impl="warp" its data must go through `mja.place_static` (`mjx_arenas.envs.static_geoms.StaticGeoms`).

        Args:
            ranges: what varies. Compiles the arena.

        Returns:
            `f(model, rng) -> (model_v, in_axes)`, for any number of calls and of worlds, with `rng` (W,) keys or (W, 2)
            raw ones. The worlds are those of `randomize` with keys folded from these, since Brax resets its
            environments with the very same keys. `in_axes` is a model of 0 where leaves are batched, and None.

        Raises:
            ValueError: what `randomize` says of the ranges, and ranges in which nothing varies.
        """
        self.check_ranges(ranges, held=True)
        if not ranges.varying:
            raise ValueError("`ranges` gives no quantity a distribution: there is nothing to randomize.")
        if jax.local_device_count() > 1:
            _log.warning(
                "randomization_fn: Brax's trainers give each of the %d devices here the same arenas, num_envs // devices "
                "different ones in all: for more, use environments that draw their arenas in reset.",
                jax.local_device_count(),
            )

        def randomize(model: mjx.Model, rng: jax.Array) -> tuple[mjx.Model, mjx.Model]:
            validation.raise_all(validation.key_problems("rng", rng), "`rng`")
            batch = self.randomize(model, sampling.trainers_keys(rng), ranges)
            return batch.model, batch.in_axes

        return randomize

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
            _check_type(ranges)
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
    def _passing(self) -> list[str]:
        """Bodies of which it does not matter what they touch: objects, which are placed elsewhere, and what is absent."""
        there = present(self._nominal)
        return [o.name for o in self.objects] + build.absent_names(self._parts, *there)

    @property
    def _labels(self) -> dict[str, list[Any]]:
        return validation.labels(self.n_tables, [o.name for o in self.objects])

    def _check_not_compiled(self, what: str) -> None:
        if "mj_model" in self.__dict__:
            raise ValueError(f"`{what}`: the arena is compiled already: {what} before the first use of the model.")

    def _check_model(self, model: mjx.Model) -> None:
        validation.raise_all(validation.model_problems(model, self.mj_model), "`model`")

    def _check_nominal(self, model: mjx.Model, written: Sequence[str]) -> None:
        """Refuses a template of another world, of which what is not written would stay, though parameters say nominal."""
        if self._looked_at[0] is model and self._looked_at[1] == written:
            return
        stale = layout.of_another_world(model, self.layout, np.concatenate(present(self._nominal)), written)
        if stale:
            raise ValueError(
                f"`model` must have the nominal parameters where `ranges` varies nothing, as from put_model(), got other {stale}: give "
                f"them to the arena, or as Fixed ranges."
            )
        self._looked_at = model, written

    def _check_shapes(self, params: ArenaParams) -> None:
        validation.raise_all(validation.shape_problems(params, self._labels), "`params`")


def _check_type(ranges: object) -> None:
    if not isinstance(ranges, ArenaRanges):
        raise TypeError(f"`ranges` must be an mjx_arenas.ArenaRanges, got {type(ranges).__name__}.")
