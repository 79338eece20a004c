"""An arena: configured and compiled once on the host, varied in thousands of worlds on the device."""

import functools
import os
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import build, cpu, fields, validation, validation_ranges
from mjx_arenas import data as data_
from mjx_arenas.batch import ArenaBatch
from mjx_arenas.layout import Layout, TableNames
from mjx_arenas.objects import Object
from mjx_arenas.params import ArenaParams, ArenaRanges, canonical, in_order, sample_params
from mjx_arenas.placement import Placement, footprints, place

DEFAULT_FULL_SIZE = (0.8, 0.8, 0.05)
DEFAULT_FRICTION = (1, 0.005, 0.0001)


class Arena:
    """Tables and objects on a fixed topology. Use `MultiTableArena` or `TableArena`.

    `spec` may be added to (a robot, sensors, cameras) until the model is first compiled, by `mj_model` or anything
    that needs it.
    """

    def __init__(
        self,
        arguments: validation.Arguments,
        nominal: ArenaParams,
        name_tables: Callable[[int], TableNames],
        objects: Sequence[Object],
        xml: str | os.PathLike | None,
        table_priority: int,
        table_condim: int | None,
    ) -> None:
        self.spec = build.load_spec(xml)
        """`mujoco.MjSpec` of the arena at its nominal parameters."""
        offsets = nominal.table_offsets
        tables = None if offsets is None else [name_tables(i) for i in range(len(offsets))]
        names = None if tables is None else [t.body for t in tables]
        taken = {e.name for e in (*self.spec.bodies, *self.spec.geoms, *self.spec.joints)} | set(names or ())
        problems, self._object_tables = validation.object_problems(objects, names, taken)
        problems += validation.table_option_problems(table_priority, table_condim)
        validation.raise_all(arguments.problems + problems, type(self).__name__)
        assert tables is not None
        assert names is not None
        self.objects = tuple(objects)
        self._tables = tuple(tables)
        self._nominal = nominal
        self._table_condim = max([3, *(o.condim for o in self.objects)]) if table_condim is None else table_condim
        build.add_tables(self.spec, self._tables, table_priority, self._table_condim)
        build.add_objects(self.spec, self.objects)
        self._set_params(self.spec, nominal)
        self._compile_checked()
        validation.warn_of_overlaps(nominal, names)

    # What the arena is (host).

    @property
    def bottom_pos(self) -> np.ndarray:
        """(3,) of the floor [m]."""
        return np.zeros(3)

    @property
    def n_tables(self) -> int:
        """T."""
        return len(self._tables)

    @functools.cached_property
    def mj_model(self) -> mujoco.MjModel:
        """The compiled nominal arena. Compiled on first use; neither it nor `spec` may change afterwards.

        Raises:
            ValueError: the parameters would not decide the arena alone, because of what was added to `spec`.
        """
        model, self._varying = self._compile_checked()
        self._compiled_xml = self.spec.to_xml()
        build.warn_of_nominal_places(model, self.objects)
        return model

    @property
    def xml(self) -> str:
        """MJCF of the nominal arena."""
        spec = self.spec.copy()
        spec.compile()
        return build.world_xml(spec, self._tables, self.objects)

    @functools.cached_property
    def layout(self) -> Layout:
        """Ids of the tables' and objects' elements in the compiled model."""
        model = self.mj_model
        present = frozenset(fields.FIELDS) & self._varying
        return Layout.of(model, present, self._tables, self.objects, self._object_tables)

    # Vary (device, pure).

    def put_model(self, impl: str | None = None) -> mjx.Model:
        """`mjx.Model` of the nominal arena.

        Args:
            impl: "jax", "warp", or None for the best one here: Warp on an NVIDIA GPU where `warp-lang` is installed,
                else JAX. `model.impl` and the log ("mjx_arenas") say which.
        """
        return data_.put_model(self.mj_model, impl)

    def nominal_params(self) -> ArenaParams:
        """Parameters of the arena as it was configured."""
        return canonical(self._nominal)

    def sample_params(self, key: jax.Array, ranges: ArenaRanges) -> ArenaParams:
        """Draws the parameters of one world; jit, vmap.

        Args:
            key: of the world. Each quantity and each table folds its own key from it, so that a draw does not depend
                on what else is drawn.
            ranges: what varies; the rest is nominal. May be traced.
        """
        self._check_ranges(ranges)
        if key.ndim != (0 if jnp.issubdtype(key.dtype, jax.dtypes.prng_key) else 1):
            raise ValueError(f"`key` must be one key, of one world, got shape {key.shape}: use jax.vmap, or randomize.")
        return sample_params(key, self.nominal_params(), ranges)

    def valid(self, params: ArenaParams) -> jax.Array:
        """() bool: MuJoCo would compile this world; jit, vmap. On the device, where nothing can raise."""
        self._check_shapes(params)
        p = canonical(params)
        finite = jnp.all(jnp.array([jnp.isfinite(x).all() for x in p[:4]]))
        stands = ~p.has_legs | (p.table_offsets[:, 2] > p.table_full_sizes[:, 2] / 2)
        return finite & (p.table_full_sizes > 0).all() & (p.table_frictions >= 0).all() & stands.all()

    def fields(self, model: mjx.Model, params: ArenaParams) -> dict[str, jax.Array]:
        """Fields of `mjx.Model` that the parameters decide, with their values in one world; jit, vmap, grad."""
        self._check_shapes(params)
        self._check_model(model)
        return fields.write_fields(model, self.layout, params, frozenset(ArenaParams._fields))

    def apply(self, model: mjx.Model, params: ArenaParams) -> mjx.Model:
        """`model` with the parameters of one world; jit, vmap, grad.

        Args:
            model: of this arena. What the parameters do not decide stays as it is there.
            params: of one world. Values are not checked (see `valid`), shapes are.
        """
        return fields.replace(model, self.fields(model, params))

    def place(self, params: ArenaParams, key: jax.Array) -> Placement:
        """Places for all objects on the tables of one world, inside the edges and apart; jit, vmap."""
        self._check_shapes(params)
        return place(key, self.layout, footprints(self.objects), params)

    def rest_heights(self, params: ArenaParams) -> jax.Array:
        """(K,) heights [m] of the objects' origins in the world when they touch the tops of their tables; jit, vmap."""
        self._check_shapes(params)
        top = canonical(params).table_offsets[self.layout.object_table, 2]
        return top + jnp.asarray(self.layout.object_half_size[:, 2], top.dtype)

    def make_data(
        self, model: mjx.Model, params: ArenaParams, key: jax.Array | None = None, n_worlds: int | None = None
    ) -> mjx.Data:
        """`mjx.Data` of one world at rest: objects on their tables, static geoms where `model` has them; jit, vmap.

        Args:
            model: of this world (`apply`).
            params: of this world.
            key: places the objects (`place`, which also says whether each found a free place; one that did not starts
                above the others); None: at their nominal places.
            n_worlds: Warp keeps the contacts of all worlds together and needs to know how many there are. None:
                counts those that `jax.vmap` stands for.
        """
        if self.mj_model.nv == 0:
            raise ValueError(
                "MJX cannot step a model without a degree of freedom: give the arena `objects=`, or add a joint to `arena.spec`."
            )
        if n_worlds is None and model.impl == data_.Impl.WARP:
            n_worlds, model, params, key = data_.world_count(model, params, key)
        data = data_.empty_data(self.mj_model, model.impl, n_worlds or 1)
        return data_.place_static(model, data.replace(qpos=self._qpos(model.qpos0, params, key)))

    def randomize(self, model: mjx.Model, keys: jax.Array, ranges: ArenaRanges) -> ArenaBatch:
        """A batch of worlds.

        Args:
            model: of this arena, one world.
            keys: (W,) keys, one a world.
            ranges: what varies.
        """
        self._check_ranges(ranges)
        validation.raise_all(validation.key_problems("keys", keys), "`keys`")
        self._check_model(model)
        names = fields.field_names(self.layout, ranges.varying)
        model = data_.replicate_beside(keys, model)
        values, params, valid = self._randomize(model, keys, ranges)
        return ArenaBatch(fields.replace(model, values), params, valid, names, self)

    def batch(self, model: mjx.Model, params: ArenaParams) -> ArenaBatch:
        """A batch of worlds with given parameters.

        Args:
            model: of this arena, one world.
            params: (W, ...) of all worlds.
        """
        validation.raise_all(validation.batch_shape_problems(params, self.n_tables), "`params`")
        self._check_model(model)
        model = data_.replicate_beside(params.table_offsets, model)
        values, valid = self._write_all(model, params)
        return ArenaBatch(fields.replace(model, values), params, valid, tuple(values), self)

    def randomization_fn(self, ranges: ArenaRanges) -> Callable[[mjx.Model, jax.Array], tuple[mjx.Model, mjx.Model]]:
        """Brax's and Playground's `randomization_fn(model, rng) -> (model_v, in_axes)`, for any number of worlds."""
        self._check_ranges(ranges)

        def randomize(model: mjx.Model, rng: jax.Array) -> tuple[mjx.Model, mjx.Model]:
            validation.raise_all(validation.key_problems("rng", rng), "`rng`")
            batch = self.randomize(model, rng, ranges)
            if not batch.fields:
                raise ValueError("`ranges` gives no quantity a distribution: there is nothing to randomize.")
            return batch.model, batch.in_axes

        return randomize

    # One world again on the host.

    def compile(self, params: ArenaParams) -> mujoco.MjModel:
        """The world that MuJoCo's compiler makes of these parameters."""
        return self._world_spec(params)[1]

    def to_xml(self, params: ArenaParams) -> str:
        """MJCF of the world with these parameters."""
        return build.world_xml(self._world_spec(params)[0], self._tables, self.objects)

    def c_batch(self, params: ArenaParams, nthread: int = 0, keys: jax.Array | None = None) -> Any:
        """`mujoco.batch.Batch` of C MuJoCo with the same worlds, objects in place; needs MuJoCo 4.

        Args:
            params: (W, ...) of all worlds (`batch.params`).
            nthread: number of threads; 0: all cores.
            keys: (W,) that place the objects as `make_data` does; None: at their nominal places.
        """
        validation.raise_all(validation.batch_shape_problems(params, self.n_tables), "`params`")
        bad = np.flatnonzero(~np.asarray(jax.vmap(self.valid)(params)))
        if len(bad):
            world = ArenaParams(*(np.asarray(p[bad[0]]) for p in params))
            problems = validation.params_problems(world, self.n_tables)
            validation.raise_all((f"World {bad[0]}: {p}" for p in problems), "`params`")
        if keys is not None:
            validation.raise_all(validation.key_problems("keys", keys, len(params.table_rots)), "`keys`")
        model = cpu.blind_model(self.mj_model)

        def one(params: ArenaParams, key: jax.Array | None) -> tuple[dict[str, jax.Array], jax.Array]:
            values = self.fields(model, params)
            return values, self._qpos(values.get("qpos0", model.qpos0), params, key)

        values, qpos = jax.jit(jax.vmap(one))(params, keys)
        return cpu.c_batch(self.mj_model, values, qpos, nthread)

    # Internals.

    def _qpos(self, qpos0: jax.Array, params: ArenaParams, key: jax.Array | None) -> jax.Array:
        """(nq,) positions with the objects in the places that a key draws, or at their nominal ones."""
        if key is None or not self.objects:
            return qpos0
        placed = self.place(params, key).qpos
        return fields.replace_rows(qpos0, self.layout.object_qpos.reshape(-1), placed.reshape(-1))

    @functools.cached_property
    def _randomize(self) -> Callable[..., tuple[dict[str, jax.Array], ArenaParams, jax.Array]]:
        def one(
            model: mjx.Model, key: jax.Array, ranges: ArenaRanges
        ) -> tuple[dict[str, jax.Array], ArenaParams, jax.Array]:
            params = sample_params(key, self.nominal_params(), ranges)
            return (
                fields.write_fields(model, self.layout, params, ranges.varying),
                params,
                self.valid(params) & in_order(ranges),
            )

        return jax.jit(jax.vmap(one, in_axes=(None, 0, None)))

    @functools.cached_property
    def _write_all(self) -> Callable[..., tuple[dict[str, jax.Array], jax.Array]]:
        def one(model: mjx.Model, params: ArenaParams) -> tuple[dict[str, jax.Array], jax.Array]:
            return self.fields(model, params), self.valid(params)

        return jax.jit(jax.vmap(one, in_axes=(None, 0)))

    def _set_params(self, spec: mujoco.MjSpec, params: ArenaParams) -> None:
        build.set_params(spec, self._tables, self.objects, self._object_tables, params)

    def _world_spec(self, params: ArenaParams) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
        params = ArenaParams(
            *(np.asarray(p, bool if name == "has_legs" else float) for name, p in params._asdict().items())
        )
        validation.raise_all(validation.params_problems(params, self.n_tables), "`params`")
        model = self.mj_model
        if self.spec.to_xml() != self._compiled_xml:
            raise ValueError(
                "`arena.spec` changed after the arena was compiled: make all additions before the first use of the model."
            )
        spec = self.spec.copy()
        self._set_params(spec, params)
        model = spec.compile()
        return spec, model

    def _compile_checked(self) -> tuple[mujoco.MjModel, set[str]]:
        """The nominal model, and what in it differs from another world's: no more than this library writes."""
        if self.spec.compiler.fusestatic or self.spec.compiler.discardvisual:
            raise ValueError(
                "`spec.compiler`: fusestatic and discardvisual would remove parts of the tables: switch them off."
            )
        try:
            model = self.spec.compile()
            again, other = self.spec.copy(), self.spec.copy()
            self._set_params(again, self._nominal)
            self._set_params(other, build.elsewhere(self._nominal))
            edited = build.differing(model, again.compile())
            varying = build.differing(model, other.compile())
        except ValueError as error:
            raise ValueError(f"MuJoCo cannot compile the arena: {' '.join(str(error).split())}") from None
        if edited:
            raise ValueError(
                f"`arena.spec`: {', '.join(sorted(edited))} of a table or object was edited, which parameters decide: "
                f"give it as an argument of {type(self).__name__} or Object."
            )
        foreign = varying - fields.FIELDS.keys() - build.DERIVED_IN_C
        if foreign:
            raise ValueError(
                f"MuJoCo derives {', '.join(sorted(foreign))} from where tables and objects stand, which would be stale in other worlds: "
                f"give equalities and tendons explicit numbers (relpose, springlength), or keep them off these."
            )
        return model, varying

    def _check_ranges(self, ranges: ArenaRanges) -> None:
        if not isinstance(ranges, ArenaRanges):
            raise TypeError(f"`ranges` must be an mjx_arenas.ArenaRanges, got {type(ranges).__name__}.")
        validation.raise_all(validation_ranges.ranges_problems(ranges, self._nominal), "`ranges`")
        validation_ranges.warn_of_idle_friction(ranges, self._nominal, self._table_condim)

    def _check_model(self, model: mjx.Model) -> None:
        validation.raise_all(validation.model_problems(model, self.mj_model), "`model`")

    def _check_shapes(self, params: ArenaParams) -> None:
        validation.raise_all(validation.shape_problems(params, self.n_tables), "`params`")


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
        table_priority: `priority` of the tables' collision geoms. 1: a contact has the table's friction (and `solref`,
            `solimp`). 0: MuJoCo's rule, the larger friction of table and object (robosuite).
        table_condim: `condim` of the tables' contacts: 3 uses sliding friction only, 4 torsional too, 6 rolling too.
            Default: the largest of the objects', at least 3.

    Raises:
        ValueError: all problems of the call.
    """

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
        table_priority: int = 1,
        table_condim: int | None = None,
    ) -> None:
        arguments = validation.Arguments(singular=False)
        nominal = arguments.params(table_offsets, table_rots, table_full_sizes, table_frictions, has_legs)

        def names(i: int) -> TableNames:
            return TableNames.of(f"table{i}", first_leg=0)

        super().__init__(arguments, nominal, names, objects, xml, table_priority, table_condim)

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
        """(T, 3) half of that."""
        return self._nominal.table_full_sizes / 2

    @property
    def table_frictions(self) -> np.ndarray:
        """(T, 3) sliding, torsional, rolling."""
        return self._nominal.table_frictions

    @property
    def has_legs(self) -> list[bool]:
        """(T,)."""
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
        xml, objects, table_priority, table_condim: as in `MultiTableArena`.

    Raises:
        ValueError: all problems of the call.
    """

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
        nominal = arguments.params(table_offset, 0.0, table_full_size, table_friction, has_legs)
        validation.raise_all(arguments.problems, "TableArena")

        def names(i: int) -> TableNames:
            return TableNames.of("table", first_leg=1)

        super().__init__(arguments, nominal, names, objects, xml, table_priority, table_condim)

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
        """(3,) half of that."""
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
