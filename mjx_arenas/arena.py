"""An arena: configured and compiled once on the host, varied in thousands of worlds on the device."""

import functools
import logging
import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import (
    attach,
    build,
    calls,
    cpu,
    fields,
    from_mjcf,
    geometry,
    mesh,
    messages,
    sampling,
    specs,
    template,
    validation,
    validation_ranges,
    validation_warnings,
    validation_worlds,
)
from mjx_arenas import data as data_
from mjx_arenas.batch import ArenaBatch, take
from mjx_arenas.files import export
from mjx_arenas.layout import Layout
from mjx_arenas.objects import Object
from mjx_arenas.params import ArenaParams, ArenaRanges, canonical, on_host, present
from mjx_arenas.parts import Parts
from mjx_arenas.placement import Placement, place_objects
from mjx_arenas.problems import Problem
from mjx_arenas.viz import describe as describe_
from mjx_arenas.viz import render as render_
from mjx_arenas.viz import tile as tile_

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL import Image

_log = logging.getLogger("mjx_arenas")


class Arena:
    """Tables and objects on a fixed topology. Use `MultiTableArena`, `TableArena` or `Arena.from_xml`.

    `attach` robots, and add what else you like to `spec` (sensors, cameras), until the model is first compiled, by
    `mj_model` or anything that needs it. Objects of one geom may get sites, cameras and lights, no geoms or bodies.
    """

    def __init__(self, spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams) -> None:
        self.spec = spec
        """`mujoco.MjSpec` of the arena at its nominal parameters, with all tables and objects."""
        self._parts = parts
        self._nominal = nominal
        self._checked: ArenaRanges | None = None  # the last ranges that were found right
        self._looked_at: tuple[object, Sequence[str]] = (None, ())  # the last template that was found right
        self._calls = calls.Made()
        names = tuple(o.name for o in parts.objects)
        validation.raise_all(validation_worlds.size_problems(nominal, names, parts.places.kind), "`objects`")
        build.set_params(spec, parts, nominal)
        template.compiled(spec, parts, nominal, type(self).__name__)
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
        problems, object_tables = validation.object_problems(objects, [n.body for n in names], spec)
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
        model, self._varying = template.compiled(self.spec, self._parts, self._nominal, type(self).__name__)
        self._compiled_xml = self.spec.to_xml()
        template.warn_of_nominal_places(model, self._parts, *present(self._nominal))
        return model

    @property
    def xml(self) -> str:
        """MJCF of the nominal arena."""
        spec = self._spec_copy()
        build.remove_absent(spec, self._parts, *present(self._nominal))
        return build.world_xml(spec, self._parts)

    @functools.cached_property
    def layout(self) -> Layout:
        """Ids of the tables' and objects' elements in the compiled model."""
        model = self.mj_model
        return Layout.of(model, self._parts, self._varying)

    def attach(
        self,
        robot: str | os.PathLike | mujoco.MjSpec,
        prefix: str = "robot_",
        pos: Sequence[float] = (0, 0, 0),
        quat: Sequence[float] = (1, 0, 0, 0),
        on_table: int | str | None = None,
    ) -> None:
        """Puts a robot, or any other MJCF, into the arena, with its actuators, sensors, tendons, defaults and keyframes.

        Its `<option>`s are taken over where the arena has MuJoCo's defaults.

        Args:
            robot: path of an MJCF file, MJCF text, or a spec, of which a copy is taken.
            prefix: of all its names.
            pos: (3,) where its origin stands: in the world, or in the frame of the table's top [m].
            quat: (4,) its orientation there.
            on_table: index or body name of the table that it stands on and follows in every world. The table cannot be
                absent then.

        Objects are not placed where a robot's geoms are that no joint moves, its base, on a table or in the world; where
        its arm is they are (see `place`).

        Raises:
            ValueError: names that the arena has already, a table that does not exist, what MuJoCo refuses. The arena is
                then as before.
        """
        self._check_not_compiled("attach")
        child = specs.read(robot, "robot")
        table = attach.check(child, prefix, pos, quat, on_table, self.table_names)
        parts, lost = self._parts, []
        for spec in (self.spec.copy(), self.spec):  # the second only where the first compiles
            parts = attach.attach(spec, self._parts, child.copy(), prefix, pos, quat, table)
            lost = attach.merge_options(spec, child)
            build.set_params(spec, parts, self._nominal)
            if spec is not self.spec:
                template.compiled(spec, parts, self._nominal, type(self).__name__)
        self._parts = parts
        if self._calls:
            self._calls = calls.Made([*self._calls, calls.of(Arena.attach, locals())])
        attach.warn_of_options(lost, "robot")

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

    def put_model(self, impl: str | None = None) -> mjx.Model:
        """`mjx.Model` of the nominal arena.

        Args:
            impl: "jax", "warp", or None for the best one here: Warp on an NVIDIA GPU where `warp-lang` is installed,
                else JAX. `model.impl` and the log ("mjx_arenas") say which.
        """
        model = data_.put_model(self.mj_model, impl)
        return model if np.concatenate(present(self._nominal)).all() else self.apply(model, self.nominal_params())

    def nominal_params(self) -> ArenaParams:
        """Parameters of the arena as it was configured."""
        return canonical(self._nominal)

    def sample_params(self, key: jax.Array, ranges: ArenaRanges) -> ArenaParams:
        """Draws the parameters of one world; jit, vmap.

        Args:
            key: of the world. Each quantity, and in it each table (by its index) and object (by its name), folds its
                own key from it, so that a draw does not depend on what else is drawn.
            ranges: what varies; the rest is nominal. May be traced.
        """
        self._check_ranges(ranges)
        validation.raise_all(validation.one_key_problems("key", key), "`key`")
        return sampling.sample_params(key, self._sampling, ranges)

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
            self._check_type(ranges)
        return validation_worlds.valid(params, self._rules, ranges)

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
            self._check_type(ranges)
        problems = validation_worlds.world_problems(on_host(params), validation_worlds.bound(self._rules, ranges))
        if key is not None and not problems:
            names = [o.name for o in self.objects]
            problems = validation_worlds.place_problems(np.asarray(self.place(params, key).valid), names)
        return [messages.sentence(problem) for problem in problems]

    def fields(self, model: mjx.Model, params: ArenaParams) -> dict[str, jax.Array]:
        """Fields of `mjx.Model` that the parameters decide, with their values in one world; jit, vmap, grad."""
        self._check_shapes(params)
        self._check_model(model)
        return self._write(model, canonical(params))

    def apply(self, model: mjx.Model, params: ArenaParams) -> mjx.Model:
        """`model` with the parameters of one world; jit, vmap, grad.

        Args:
            model: of this arena. What the parameters do not decide stays as it is there. A model of another arena is
                refused where sizes or names differ; from another one with the same names it cannot be told, as all numbers
                of a template may be yours.
            params: of one world. Values are not checked (see `valid`), shapes are.
        """
        return fields.replace(model, self.fields(model, params))

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
        return self._place(canonical(params), key, margin)

    def rest_heights(self, params: ArenaParams) -> jax.Array:
        """(K,) heights [m] of the objects' origins in the world when they touch the tops of their tables; jit, vmap."""
        self._check_shapes(params)
        p = canonical(params)
        top = geometry.pick(p.table_offsets[:, 2], p.object_tables)
        return top + p.object_full_sizes[:, 2] / 2 - jnp.asarray(self.layout.places.center[:, 2], top.dtype)

    def make_data(
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
        if self.mj_model.nv == 0:
            raise ValueError(
                "MJX cannot step a model without a degree of freedom: give the arena `objects=`, or add a joint to `arena.spec`."
            )
        if key is not None:
            validation.raise_all(validation.one_key_problems("key", key), "`key`")
        if n_worlds is not None:
            n_worlds = validation.whole("n_worlds", n_worlds, 1, must="None or a whole number >= 1")
        elif model.impl == data_.Impl.WARP:
            n_worlds, model, params, key = data_.world_count(model, params, key)
        data = data_.empty_data(self.mj_model, model.impl, n_worlds or 1, self._room(max_contacts))
        qpos = model.qpos0
        if keyframe is not None:
            values = data_.keyframe(self.mj_model, keyframe)
            free = np.setdiff1d(np.arange(self.mj_model.nq), self.layout.object_qpos)
            qpos = fields.replace_rows(qpos, free, values.pop("qpos")[free])
            data = data.replace(**values)
        return data_.place_static(model, data.replace(qpos=self._qpos(qpos, params, key)))

    def randomize(self, model: mjx.Model, keys: jax.Array, ranges: ArenaRanges) -> ArenaBatch:
        """A batch of worlds.

        Args:
            model: of this arena, nominal in what does not vary (see `apply`).
            keys: (W,) keys, one a world. Spread over a mesh, they spread the worlds (docs/scaling.md).
            ranges: what varies.
        """
        self._check_ranges(ranges)
        validation.raise_all(validation.key_problems("keys", keys), "`keys`")
        self._check_model(model)
        self._check_held(ranges)
        names = fields.field_names(self.layout, ranges.varying)
        self._check_nominal(model, names)
        model, ranges = self._beside(keys, model), mesh.beside(keys, ranges)
        values, params, valid = self._randomize(model, keys, ranges)
        return ArenaBatch(fields.replace(model, values), params, valid, names, self)

    def batch(self, model: mjx.Model, params: ArenaParams) -> ArenaBatch:
        """A batch of worlds with given parameters.

        Args:
            model: of this arena, one world.
            params: (W, ...) of all worlds.
        """
        validation.raise_all(validation.batch_shape_problems(params, self._labels), "`params`")
        self._check_model(model)
        params = canonical(params)
        model = self._beside(params.table_rots, model)
        values, valid = self._write_all(model, params)
        return ArenaBatch(fields.replace(model, values), params, valid, tuple(values), self)

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
        self._check_ranges(ranges)
        self._check_held(ranges)
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
        return self._world_spec(params)[1]

    def to_xml(self, params: ArenaParams) -> str:
        """MJCF of the world with these parameters, without what is absent."""
        return build.world_xml(self._world_spec(params)[0], self._parts)

    def c_batch(self, params: ArenaParams, nthread: int = 0, keys: jax.Array | None = None) -> Any:
        """`mujoco.batch.Batch` of C MuJoCo with the same worlds, objects in place; needs MuJoCo 4.

        Args:
            params: (W, ...) of all worlds (`batch.params`).
            nthread: number of threads; 0: all cores.
            keys: (W,) that place the objects as `make_data` does; None: at their nominal places.
        """
        validation.raise_all(validation.batch_shape_problems(params, self._labels), "`params`")
        nthread = validation.whole("nthread", nthread, 0)
        params, keys = mesh.gather((canonical(params), keys))
        if keys is not None:
            validation.raise_all(validation.key_problems("keys", keys, len(params.table_rots)), "`keys`")
        values, qpos, valid = self._write_c(params, keys)
        bad = np.flatnonzero(~np.asarray(valid))
        if len(bad):
            world = on_host(ArenaParams(*(p[bad[0]] for p in params)))
            validation.raise_all(validation_worlds.refusals_of(world, self._rules, int(bad[0])), "`params`")
        return cpu.c_batch(self.mj_model, values, qpos, nthread)

    def c_world(
        self,
        params: ArenaParams,
        data: mjx.Data | mujoco.MjData | None = None,
        key: jax.Array | None = None,
    ) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """One world in C MuJoCo: the model that `compile` gives and its data, after `mj_forward`.

        Args:
            params: of one world.
            data: whose state it takes over: of this world, on either implementation (`mja.take(data, i)` of many), or in C.
                None: objects rest on their tables, all else is at `qpos0`.
            key: without data, places the objects as `make_data` does; None: at their nominal places.
        """
        if data is not None and key is not None:
            raise ValueError("`key` must be None with `data`, in which the objects have their places.")
        model = self.compile(params)
        c = mujoco.MjData(model)
        tables, objects = present(on_host(params))
        if data is not None:
            cpu.set_state(c, data, self.layout, np.concatenate([tables, objects]))
            return model, c
        if key is not None and objects.any():
            placed = np.asarray(self.place(params, key).qpos)
            for k in np.flatnonzero(objects):
                c.joint(f"{self.objects[k].name}_joint0").qpos = placed[k]
        mujoco.mj_forward(model, c)
        return model, c

    # Seen and kept (host).

    def render(
        self,
        params: ArenaParams,
        data: mjx.Data | mujoco.MjData | None = None,
        camera: str | int | mujoco.MjvCamera | None = None,
        width: int = render_.WIDTH,
        height: int = render_.HEIGHT,
    ) -> np.ndarray:
        """Picture (height, width, 3) uint8 of one world as it is, without what is absent; needs no screen.

        Args:
            params: of one world (`batch.world(i)`).
            data: its state (`mja.take(data, i)`), on either implementation or in C. None: objects rest on their tables at
                their nominal places, not where a key would place them.
            camera: a camera's name or id, a `mujoco.MjvCamera`, or None for one that sees all that is there.
            width: of the picture [pixels].
            height: of the picture [pixels].

        Raises:
            ValueError: the world cannot be, with the reasons (`problems`): as in all that makes a world in C MuJoCo, `plan`,
                `view`, `export`, `c_world`, `compile` and `to_xml`. Tables that overlap or, with ranges, do not keep to a
                workspace, and objects without a free place are shown as they are.
            RuntimeError: there is no OpenGL here.
        """
        return render_.draw_worlds(self, [(params, data)], camera, width, height)[0]

    def contact_sheet(
        self,
        params: ArenaParams,
        data: mjx.Data | Sequence[mujoco.MjData] | None = None,
        labels: Sequence[str] | None = None,
        columns: int = 4,
        camera: str | int | mujoco.MjvCamera | None = None,
        width: int = render_.WIDTH,
        height: int = render_.HEIGHT,
    ) -> "Image.Image":
        """Pictures of many worlds in a grid, a `PIL.Image`; quicker than `render` for each.

        Args:
            params: (W, ...) of all worlds.
            data: of all worlds, or (W,) of each in C; None as for `render`.
            labels: (W,) what is written on each. Default: "world 0", ...
            columns: at most so many pictures side by side.
            camera: as for `render`.
            width: of each picture [pixels].
            height: of each picture [pixels].
        """
        worlds = self._worlds(params, data)
        labels = [f"world {i}" for i in range(len(worlds))] if labels is None else labels
        render_.check_grid(len(worlds), labels, columns)
        return render_.grid(render_.draw_worlds(self, worlds, camera, width, height), labels, columns)

    def plan(
        self,
        params: ArenaParams,
        data: mjx.Data | mujoco.MjData | None = None,
        reach: float | Sequence[tuple[Sequence[float], float]] = (),
        title: str = "",
    ) -> "Figure":
        """One world seen from above, a `matplotlib` figure: tables, objects and all else to scale, with names and numbers.

        An arrow in a table shows its x axis. What is absent is listed, not drawn. Distances are measured from the robots'
        mounts, if there are any, else from the middle of the circles of `reach`, else from the arena's origin.

        Args:
            params: of one world.
            data: its state, as for `render`.
            reach: circles to draw, ((x, y), radius) each, in the world [m]; or one radius around each of the mounts, or the
                origin.
            title: of the figure.
        """
        render_.extra("matplotlib")
        from mjx_arenas.viz import plan

        model, c = self.c_world(params, data)
        centres, circles = plan.circles(reach, {name: c.body(name).xpos[:2] for name in self.mounts})
        own = [name for table in self._parts.tables for name in table.geoms]
        world = self.describe(params)
        assert isinstance(world, describe_.World)
        return plan.draw(world, model, c, own, centres, circles, title)

    def tile(self, params: ArenaParams, data: mjx.Data | Sequence[mujoco.MjData] | None = None) -> tile_.Tiles:
        """Many worlds side by side in one model of C MuJoCo, as its viewer takes it; its names have prefixes "world0_", ...

        Level planes that stand in the world, floors, are there once, for all; keyframes are left out. Worlds do not touch
        each other, as long as nothing leaves its own by more than 0.5 m. A robot's numbers have six digits.

        Args:
            params: (W, ...) of all worlds.
            data: of all worlds, or (W,) of each in C, whose states are taken over; None as for `render`.
        """
        worlds = self._worlds(params, data)
        held = dict(self.spec.assets)
        return tile_.tile(
            [(mujoco.MjSpec.from_string(self.to_xml(p), assets=held), *self.c_world(p, d)) for p, d in worlds]
        )

    def view(self, params: ArenaParams, data: mjx.Data | mujoco.MjData | Sequence[mujoco.MjData] | None = None) -> None:
        """Opens MuJoCo's viewer on one world, or on many side by side, and returns when it is closed.

        Args:
            params: of one world, or (W, ...) as for `tile`.
            data: its or their state, as for `render`.

        Raises:
            RuntimeError: there is no screen here.
        """
        if not self._are_many(params):
            tile_.view(*self.c_world(params, data))
        else:
            tiles = self.tile(params, data)  # type: ignore[arg-type]
            tile_.view(tiles.model, tiles.data)

    def describe(self, params: ArenaParams) -> describe_.World | describe_.Worlds:
        """One world, or what many are, in words and numbers; made to be printed, and read by programs.

        Args:
            params: of one world, for its tables and objects; or (W, ...) of many, for the smallest, mean and largest value of
                each number in the worlds in which its table or object is, and the share of worlds in which that is.
        """
        names = self.table_names, [o.name for o in self.objects]
        if not self._are_many(params):
            self._check_shapes(params)
            return describe_.world(params, *names, [o.type for o in self.objects])
        validation.raise_all(validation.batch_shape_problems(params, self._labels), "`params`")
        return describe_.worlds(params, self._nominal, *names)

    def export(
        self,
        params: ArenaParams,
        folder: str | os.PathLike,
        data: mjx.Data | mujoco.MjData | None = None,
        format: Literal["xml", "mjb"] = "xml",
        seed: int | None = None,
        world: int | None = None,
    ) -> None:
        """Writes one world to a folder, so that a plain MuJoCo opens it anywhere; all of it or, if that fails, nothing.

        The folder gets `world.xml` with its meshes and textures under `assets`, or `world.mjb`, which has all in it and is
        for this version of MuJoCo; and `params.json` with the parameters, the names of tables and objects, and versions.
        MJCF has the numbers of tables, objects and keyframes in full, other ones with six digits.

        Args:
            params: of one world.
            folder: that does not exist yet, or is empty.
            data: its state as for `render`, which becomes the keyframe "state". None: no such keyframe.
            format: "xml" or "mjb".
            seed: that the world was drawn from, to be noted.
            world: its number there, to be noted.
        """
        noted = {"seed": seed, "world": world}
        must = "None or a whole number >= 0"
        noted |= {n: validation.whole(n, number, 0, must=must) for n, number in noted.items() if number is not None}
        if format not in ("xml", "mjb"):
            raise ValueError(f"`format` must be 'xml' or 'mjb', got {format!r}.")
        spec, model = self._world_spec(params)
        if data is not None:
            export.add_state(spec, self.c_world(params, data)[1])
            model = spec.compile()
        names = {"tables": self.table_names, "objects": [o.name for o in self.objects]}
        about = {**noted, **names}
        written = build.world_xml(spec, self._parts) if format == "xml" else model
        export.write(folder, written, dict(spec.assets), params, about)

    # Internals.

    def _worlds(
        self, params: ArenaParams, data: mjx.Data | Sequence[mujoco.MjData] | None
    ) -> list[tuple[ArenaParams, mjx.Data | mujoco.MjData | None]]:
        """Parameters and data of each of many worlds."""
        validation.raise_all(validation.batch_shape_problems(params, self._labels), "`params`")
        n_worlds, each = len(params.table_rots), on_host(params)
        rules = self._rules
        found = [p for i in range(n_worlds) for p in validation_worlds.refusals(take(each, i), rules, i)]
        validation.raise_all(found, "`params`")
        if isinstance(data, Sequence):
            if len(data) != n_worlds:
                raise ValueError(f"`data` must be of the {n_worlds} worlds of `params`, got {len(data)}.")
            return [(take(params, i), one) for i, one in enumerate(data)]
        if data is not None and data.qpos.shape[:-1] != (n_worlds,):
            raise ValueError(
                f"`data` must be of the {n_worlds} worlds of `params`, got qpos of shape {data.qpos.shape}."
            )
        return [(take(params, i), None if data is None else take(data, i)) for i in range(n_worlds)]

    def _room(self, max_contacts: int | None) -> data_.Room:
        """Contacts of one world that data has room for on Warp."""
        if max_contacts is None:
            return self._default_room
        room = validation.whole("max_contacts", max_contacts, 1, must="None or a whole number >= 1")
        return data_.room_for(self.mj_model, room)

    @functools.cached_property
    def _default_room(self) -> data_.Room:
        return data_.room(self.mj_model, self.layout.table_geom[:, 0])

    @functools.cached_property
    def _sampling(self) -> sampling.Nominal:
        names, densities = tuple(o.name for o in self.objects), [m.density for m in self._parts.measures]
        return sampling.Nominal(self._nominal, names, self._parts.places.kind, np.array(densities, float))

    @property
    def _labels(self) -> dict[str, list[str]]:
        return validation.labels(self.n_tables, [o.name for o in self.objects])

    @functools.cached_property
    def _held(self) -> dict[int, str]:
        return {i: f"{name!r} ties it" for i, name in self.layout.held().items()} | self._carrying()

    @functools.cached_property
    def _rules(self) -> validation_worlds.Rules:
        names, places = tuple(o.name for o in self.objects), self._parts.places
        sizes = self._nominal.object_full_sizes
        overlapping = validation_worlds.overlapping(self._nominal)
        return validation_worlds.Rules(self.n_tables, names, places.kind, sizes, self._held, overlapping=overlapping)

    def _qpos(self, qpos0: jax.Array, params: ArenaParams, key: jax.Array | None) -> jax.Array:
        """(nq,) positions with the objects in the places that a key draws, or at their nominal ones."""
        if key is None or not self.objects:
            return qpos0
        placed = self.place(params, key).qpos
        return fields.replace_rows(qpos0, self.layout.object_qpos.reshape(-1), placed.reshape(-1))

    @functools.cached_property
    def _write(self) -> Callable[[mjx.Model, ArenaParams], dict[str, jax.Array]]:
        everything = frozenset(ArenaParams._fields)
        return jax.jit(lambda model, params: fields.write_fields(model, self.layout, params, everything))

    @functools.cached_property
    def _place(self) -> Callable[[ArenaParams, jax.Array, float], Placement]:
        return jax.jit(lambda params, key, margin: place_objects(key, self.layout.places, params, margin))

    @functools.cached_property
    def _beside(self) -> Callable[[jax.Array, mjx.Model], mjx.Model]:
        return mesh.LastBeside()

    @functools.cached_property
    def _randomize(self) -> Callable[..., tuple[dict[str, jax.Array], ArenaParams, jax.Array]]:
        def one(
            model: mjx.Model, key: jax.Array, ranges: ArenaRanges
        ) -> tuple[dict[str, jax.Array], ArenaParams, jax.Array]:
            params = sampling.sample_params(key, self._sampling, ranges)
            params = jax.lax.optimization_barrier(params)  # or each field draws its numbers anew
            return (
                fields.write_fields(model, self.layout, params, ranges.varying),
                params,
                self.valid(params, ranges),
            )

        return data_.OfModel(jax.vmap(one, in_axes=(None, 0, None)))

    @functools.cached_property
    def _write_c(self) -> Callable[..., tuple[dict[str, jax.Array], jax.Array, jax.Array]]:
        model = cpu.blind_model(self.mj_model)

        def one(params: ArenaParams, key: jax.Array | None) -> tuple[dict[str, jax.Array], jax.Array, jax.Array]:
            values = self.fields(model, params)
            possible = validation_worlds.possible(params, self._rules)
            return values, self._qpos(values.get("qpos0", model.qpos0), params, key), possible

        return jax.jit(jax.vmap(one))

    @functools.cached_property
    def _draw(self) -> Callable[[jax.Array, ArenaRanges], tuple[ArenaParams, jax.Array, jax.Array]]:
        """Of keys (W,): parameters, whether these worlds can be, and whether they can be made and shown at least."""

        def one(key: jax.Array, ranges: ArenaRanges) -> tuple[ArenaParams, jax.Array, jax.Array]:
            params = sampling.sample_params(key, self._sampling, ranges)
            return params, self.valid(params, ranges), validation_worlds.possible(params, self._rules)

        return jax.jit(jax.vmap(one, in_axes=(0, None)))

    @functools.cached_property
    def _write_all(self) -> Callable[..., tuple[dict[str, jax.Array], jax.Array]]:
        def one(model: mjx.Model, params: ArenaParams) -> tuple[dict[str, jax.Array], jax.Array]:
            return self.fields(model, params), self.valid(params)

        return data_.OfModel(jax.vmap(one, in_axes=(None, 0)))

    def _world_spec(self, params: ArenaParams, checked: bool = True) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
        """The spec and the model of one world; not checked, of any that MuJoCo compiles."""
        self._check_shapes(params)
        params = on_host(params)
        if checked:
            validation.raise_all(validation_worlds.refusals(params, self._rules), "`params`")
        self.mj_model  # noqa: B018  # compiles it
        if self.spec.to_xml() != self._compiled_xml:
            raise ValueError(
                "`arena.spec` changed after the arena was compiled: make all additions before the first use of the model."
            )
        spec = self._spec_copy()
        build.set_params(spec, self._parts, params)
        build.place_in_keyframes(spec, self._parts, params, self.layout.object_qpos)
        build.remove_absent(spec, self._parts, *present(params))
        return spec, specs.compiled(spec, "params")

    def _spec_copy(self) -> mujoco.MjSpec:
        """The spec with the options that the model has, as `put_model` takes them, once it is compiled."""
        spec = self.spec.copy()
        if "mj_model" in self.__dict__:
            specs.set_options(spec, self.mj_model.opt)
        return spec

    def _check_not_compiled(self, what: str) -> None:
        if "mj_model" in self.__dict__:
            raise ValueError(f"`{what}`: the arena is compiled already: {what} before the first use of the model.")

    def _check_ranges(self, ranges: ArenaRanges) -> None:
        if ranges is self._checked:
            return
        self._check_type(ranges)
        problems = validation_ranges.ranges_problems(ranges, self._sampling, self._labels)
        problems = problems or self._absence_problems(ranges, self._carrying())
        validation.raise_all(problems, "`ranges`")
        slabs = [self.spec.geom(t.collision) for t in self._parts.tables]
        priority = max((g.priority for o in self.objects for g in self.spec.body(o.name).find_all("geom")), default=0)
        tables_decide = all(slab.priority > priority for slab in slabs)
        adopted = self.table_names if all(t.adopted for t in self._parts.tables) else []
        condim = min(slab.condim for slab in slabs)
        validation_warnings.warn_of_idle(ranges, self._sampling, condim, tables_decide, adopted)
        if not any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(ranges)):
            self._checked = ranges

    def _carrying(self) -> dict[int, str]:
        """The tables that cannot be absent for what moves on them, a robot or a body with joints, with the reason."""
        joints = [self.spec.body(name).find_all("joint") for name in self.table_names]
        moving = {t: found[0].parent.name or found[0].name or "a joint" for t, found in enumerate(joints) if found}
        moving |= {m.table: m.body for m in self._parts.mounts}
        return {t: f"{name!r} is fixed on it" for t, name in moving.items()}

    def _check_held(self, ranges: ArenaRanges) -> None:
        """Refuses to make absent what an equality would still pull at; compiles the arena."""
        if ranges.varying & (fields.PRESENCE | {"object_tables"}):
            validation.raise_all(self._absence_problems(ranges, self._held), "`ranges`")

    def _absence_problems(self, ranges: ArenaRanges, held: validation_worlds.Held) -> list[Problem]:
        return validation_ranges.absence_problems(ranges, self._sampling, held, self._labels)

    def _check_model(self, model: mjx.Model) -> None:
        validation.raise_all(validation.model_problems(model, self.mj_model), "`model`")

    def _check_nominal(self, model: mjx.Model, written: Sequence[str]) -> None:
        """Refuses a template of another world, of which what is not written would stay, though parameters say nominal."""
        if self._looked_at[0] is model and self._looked_at[1] == written:
            return
        stale = template.of_another_world(model, self.layout, np.concatenate(present(self._nominal)), written)
        if stale:
            raise ValueError(
                f"`model` must have the nominal parameters where `ranges` varies nothing, as from put_model(), got other {stale}: give "
                f"them to the arena, or as Fixed ranges."
            )
        self._looked_at = model, written

    @staticmethod
    def _check_type(ranges: object) -> None:
        if not isinstance(ranges, ArenaRanges):
            raise TypeError(f"`ranges` must be an mjx_arenas.ArenaRanges, got {type(ranges).__name__}.")

    @staticmethod
    def _are_many(params: object) -> bool:
        """Whether these are the parameters of many worlds; what are none, `_check_shapes` refuses."""
        return isinstance(params, ArenaParams) and np.ndim(params.table_rots) > 1

    def _check_shapes(self, params: ArenaParams) -> None:
        validation.raise_all(validation.shape_problems(params, self._labels), "`params`")
