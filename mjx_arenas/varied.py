"""Worlds of an arena on the device: drawn, written, placed (pure)."""

import logging
import weakref
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

import jax
import numpy as np
from mujoco import mjx

from mjx_arenas import strict
from mjx_arenas.drawn import Drawn
from mjx_arenas.keywords import with_known_methods
from mjx_arenas.params.params import ArenaParams, ArenaRanges, canonical, on_host
from mjx_arenas.problem import Told, problem
from mjx_arenas.problems import messages
from mjx_arenas.record.record import Record
from mjx_arenas.rules import none_valid, validation, validation_worlds
from mjx_arenas.sample import sampling
from mjx_arenas.sample.placement import Placement
from mjx_arenas.sim import data as data_
from mjx_arenas.sim import devices, programs, starts
from mjx_arenas.sim.batch import ArenaBatch
from mjx_arenas.write import writer
from mjx_arenas.write.replace import replace
from mjx_arenas.write.scene import not_as_compiled, of_another_world, other_than_compiled

if TYPE_CHECKING:
    from mjx_arenas.pixels.renderer import Renderer

_log = logging.getLogger("mjx_arenas")


class Randomization(Protocol):
    """What Brax's trainers and Playground's wrappers call a `randomization_fn`."""

    def __call__(self, model: mjx.Model, rng: jax.Array) -> tuple[mjx.Model, mjx.Model]:
        """The models of all worlds, and the axes of their leaves."""
        ...


@with_known_methods
class Varied(Drawn):
    """The part of an arena that varies it: functions of one world, for `jax.vmap`, and of batches."""

    _simulated: frozenset = frozenset()  # the implementations that simulate the arena as MuJoCo does
    _drawn: frozenset = frozenset()  # structures of ranges and numbers of worlds for which flags were looked at
    _looked_at: tuple[weakref.ref | None, frozenset] = (
        None,
        frozenset(),
    )  # the last template, and for what it was found right

    @strict.own_constants
    def put_model(self, impl: str | None = None) -> mjx.Model:
        """`mjx.Model` of the nominal arena.

        Args:
            impl: "jax", "warp", or None for the best one here: Warp on an NVIDIA GPU if `warp-lang` is installed,
                otherwise JAX. `model.impl` and the log ("mjx_arenas") say which.
        """
        self._put = None
        record = self.unchanged()
        model = data_.put_model(record.mj_model, impl, record.varied)
        self._simulated |= {model.impl}
        self._check_model(model)
        self._put = record
        return model if self._parts.wanted(self._nominal).all() else self.apply(model, self.nominal_params())

    @strict.own_constants
    def valid(self, params: ArenaParams, ranges: ArenaRanges | None = None) -> jax.Array:
        """() bool: whether this world is valid. Works in `jit` and `vmap`.

        A world is valid if

        - MuJoCo would compile it,
        - each object fits on its table, and has the size of its file if it has one,
        - nothing is absent that is tied to something present, or that carries something that moves,
        - no two tables or parts of furniture overlap that are apart nominally,
        - no joint or tendon whose `range` or `margin` varies has a margin of more than half of its range, and
        - no contact whose friction a parameter decides has a sliding friction below 1e-5, where its `condim` is not 1.

        Args:
            params: parameters of one world.
            ranges: if given, `valid` also checks that at least one table is there, and that all tables are inside the ranges'
                `workspace`.
        """
        self._check_shapes(params)
        if ranges is not None:
            validation.check_ranges_type(ranges)
        return programs.valid(self.unchanged(), canonical(params), ranges)

    def problems(
        self, params: ArenaParams, ranges: ArenaRanges | None = None, key: jax.Array | None = None
    ) -> list[str]:
        """Reasons why a world is not `valid`, one sentence each; an empty list if it is. Runs on the host.

        For a batch: `{i: arena.problems(batch.world(i), ranges) for i in np.flatnonzero(~batch.valid)}`.

        Args:
            params: parameters of one world.
            ranges: if given, also whether at least one table is there, and whether all tables are inside the ranges' `workspace`.
            key: key of the world; if given, also which objects find no free place (`place`).
        """
        self._check_shapes(params)
        if ranges is not None:
            validation.check_ranges_type(ranges)
        record = self.unchanged()
        problems = validation_worlds.world_problems(on_host(params), validation_worlds.bound(record.rules, ranges))
        if key is not None and not problems:
            found = np.asarray(self.place(params, key).valid)
            problems = validation_worlds.place_problems(found, record.object_names)
        return [messages.sentence(problem) for problem in problems]

    def fields(self, model: mjx.Model, params: ArenaParams) -> dict[str, jax.Array]:
        """Fields of `mjx.Model` that the parameters decide, with their values in one world; jit, vmap, grad."""
        self._check_shapes(params)
        self._check_model(model)
        self._check_nominal(model, self.record.everything)
        return programs.fields(self.record, model, canonical(params))

    def apply(self, model: mjx.Model, params: ArenaParams) -> mjx.Model:
        """`model` with the parameters of one world; jit, vmap, grad.

        Args:
            model: a model of this arena. What the parameters do not decide stays as it is in the model. The exceptions are margins,
                colours, materials and armatures of tables and objects, which are nominal if these are there. You may change all other
                numbers, except centres of mass and what else closed formulas rely on (`Scene.granted`); change these in the
                worlds, and call `mja.set_const`. A model of another arena is refused if sizes or names differ. A model of another
                arena with the same names cannot be detected.
            params: parameters of one world. Their shapes are checked, their values are not (see `valid`).
        """
        return replace(model, self.fields(model, params))

    @strict.own_constants
    def place(self, params: ArenaParams, key: jax.Array, margin: float = 0.0) -> Placement:
        """Finds places for all objects on the tables of one world, inside the edges and apart; jit, vmap.

        Objects are placed clear of tables' slabs and of fixed collision geoms, on a table (from its top up) or in the world. Each of
        these counts as a rectangle, seen from above. Objects are not placed clear of planes, nor of what joints move, such as a
        robot's arm.

        Args:
            params: parameters of one world.
            key: key of the world. Each object folds its own key from it, by its name.
            margin: smallest distance to the table's edges [m].
        """
        self._check_shapes(params)
        validation.raise_all(validation.one_key_problems("key", key), "`key`")
        if not isinstance(margin, jax.core.Tracer):
            validation.raise_all(validation.not_negative_problems("margin", margin, "[m]"), "place")
        return programs.place(self.unchanged(), canonical(params), key, margin)

    @strict.own_constants
    def rest_heights(self, params: ArenaParams) -> jax.Array:
        """(K,) heights [m] of the objects' origins in the world when they touch the tops of their tables or surfaces; jit, vmap."""
        self._check_shapes(params)
        return programs.rest_heights(self.unchanged(), canonical(params))

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
            model: the model of this world (`apply`).
            params: the parameters of this world.
            key: places the objects (see `place`, which also says whether each found a free place; one that did not starts
                above the others). None: they are at their nominal places, which may coincide if `object_tables` varies.
            n_worlds: the number of worlds; Warp keeps the contacts of all worlds together and needs it. None: the number is found
                from the batch axes of `model`, `params` and `key`. If all three are the same in all worlds, give the number.
            keyframe: name of the keyframe that a robot starts in. Objects still stand on their tables.
            max_contacts: room for contacts in each world on Warp, which drops further ones (see `mja.capacity`). None:
                room for all that can touch at once.
        """
        self._check_shapes(params)
        return starts.one_world(self.record, model, params, key, n_worlds, keyframe, max_contacts)

    @strict.own_constants
    def randomize(self, model: mjx.Model, keys: jax.Array, ranges: ArenaRanges) -> ArenaBatch:
        """Draws a batch of worlds. The first call with ranges of a kind warns if of at least eight worlds fewer than half are valid.

        Args:
            model: a model of this arena, nominal in what does not vary (see `apply`).
            keys: (W,) keys, one for each world. Keys that are spread over a mesh spread the worlds (docs/scaling.md).
            ranges: what varies.
        """
        self.check_ranges(ranges, held=True)
        validation.raise_all(validation.key_problems("keys", keys), "`keys`")
        self._check_model(model)
        record = self.record
        self._check_nominal(model, ranges.varying)
        self._check_relative(model, ranges)
        model, ranges = programs.beside(keys, model), devices.beside(keys, ranges)
        values, params, valid = programs.randomized(record, model, keys, ranges)
        self._look_once(record, params, valid, ranges)
        return ArenaBatch(replace(model, values), params, valid, tuple(sorted(values)), record)

    def batch(self, model: mjx.Model, params: ArenaParams) -> ArenaBatch:
        """Makes a batch of worlds with given parameters.

        Args:
            model: a model of this arena, for one world.
            params: (W, ...) parameters of all worlds, of this arena (see `compile`).
        """
        validation.raise_all(validation.batch_shape_problems(params, self._labels), "`params`")
        self._check_model(model)
        self._check_nominal(model, self.record.everything)
        params = canonical(params)
        model = programs.beside(params.table_rots, model)
        values, valid = programs.given(self.record, model, params)
        return ArenaBatch(replace(model, values), params, valid, tuple(sorted(values)), self.record)

    def renderer(
        self,
        cameras: Collection[str] | Mapping[str, tuple[int, int]] | None = None,
        *,
        rgb: bool | Collection[str] = True,
        depth: bool | Collection[str] = False,
        segmentation: bool | Collection[str] = False,
        shadows: bool = False,
        textures: bool = True,
        groups: Collection[int] = (0, 1, 2),
        background: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> "Renderer":
        """Makes a renderer, which draws what cameras see in all worlds, on the device: `pictures = arena.renderer()(batch, data)`.

        Make it once. It is a pure function for jit and scan. It needs MuJoCo Warp, but also draws states of `impl="jax"`.

        Args:
            cameras: names of cameras, or (width, height) of the pictures [pixels] by name. None: all cameras. Without a size of its own
                a camera has the `resolution` of the MJCF, else 64 by 64.
            rgb: True, False, or the names of the cameras whose pictures get colours.
            depth: the same for distances.
            segmentation: the same for the things that are seen.
            shadows: whether lights cast shadows. It costs one more ray for each light and pixel. It must be true if `light.castshadow`
                varies.
            textures: whether materials have their textures.
            groups: groups of geoms that are drawn.
            background: red, green and blue from 0 to 1 where there is nothing.

        Raises:
            ValueError, TypeError: an argument is wrong, or nothing would be seen.
            RuntimeError: MuJoCo Warp is missing.
        """
        from mjx_arenas.pixels import asked

        kinds = {"rgb": rgb, "depth": depth, "segmentation": segmentation}
        return asked.renderer(self.unchanged(), cameras, shadows, textures, groups, background, **kinds)

    def randomization_fn(self, ranges: ArenaRanges) -> Randomization:
        """Makes the `randomization_fn` of Brax's trainers and of Playground's wrappers (docs/training.md).

        `model.qpos0` of each world puts objects on that world's tables. An environment that sets `qpos` itself must put them there, or
        at places that `place` draws, not on the template's tables. On impl="warp" its data must go through `mja.place_static`
        (`mjx_arenas.envs.static_geoms.StaticGeoms`).

        Args:
            ranges: what varies. Compiles the arena.

        Returns:
            `f(model, rng) -> (model_v, in_axes)`, for any number of calls and of worlds, with `rng` (W,) keys or (W, 2) raw ones. The
                worlds are those of `randomize` with keys folded from these, since Brax resets its environments with the very same keys.
                `in_axes` is a model of 0 where leaves are batched, and None.

        Raises:
            ValueError: what `randomize` says of the ranges, and ranges in which nothing varies.
        """
        self.check_ranges(ranges, held=True)
        if not ranges.varying:
            raise messages.error([problem("ranges", "nothing_varies")])
        starts.warn_of_left(self.record, ranges.varying)
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

    # Checks.

    def _look_once(self, record: Record, params: ArenaParams, valid: jax.Array, ranges: ArenaRanges) -> None:
        """Warns where fewer than half of many worlds are valid: at the first call of a kind, which compiles, as it waits for the device."""
        kind = jax.tree.structure(ranges), len(valid)
        here = not isinstance(valid, jax.core.Tracer) and valid.is_fully_addressable
        if here and kind not in self._drawn:
            self._drawn |= {kind}
            none_valid.warn(valid, params, record.rules, ranges, record.drawing, record.labels)

    def _check_model(self, model: mjx.Model) -> None:
        validation.raise_all(validation.model_problems(model, self.mj_model), "`model`")
        if model.impl == data_.Impl.JAX:
            validation.raise_all(self.record.unseen_on_jax, "`model`")
        if model.impl not in self._simulated:  # of `mjx.put_model`, which says nothing
            data_.check_simulated(self.mj_model, model.impl.value, self.record.varied)
            self._simulated |= {model.impl}

    def _found_right(self, model: mjx.Model) -> frozenset:
        """The checks that a template has passed before."""
        last, right = self._looked_at
        return right if last is not None and last() is model else frozenset()

    def _check_nominal(self, model: mjx.Model, varying: frozenset[str]) -> None:
        """Refuses a template of another world, of which what is not written would stay, though parameters say nominal."""
        if varying in self._found_right(model):
            return
        there, scene = np.append(self.record.layout.presence.there(self._nominal), True), self.record.scene
        stale = ", ".join(of_another_world(scene, model, varying, there))
        if stale:
            raise messages.error([problem("model", "stale_model", None, Told(stale))])
        other = ", ".join(not_as_compiled(scene, model, writer.field_names(scene, varying)))
        if other:
            raise messages.error([problem("model", "other_model", None, Told(other))])
        self._looked_at = weakref.ref(model), self._found_right(model) | {varying}

    def _check_relative(self, model: mjx.Model, ranges: ArenaRanges) -> None:
        """Refuses a template of which numbers were edited that ranges are relative to: draws start from the arena's own."""
        relative = frozenset(name for name, dist in ranges.given_terms.items() if dist.relative)
        if ("relative", relative) in self._found_right(model):
            return
        found = other_than_compiled(self.record.scene, model, relative)
        if found:
            raise messages.error([problem("model", "other_nominal", None, None, {"what": found[0], "name": found[1]})])
        self._looked_at = weakref.ref(model), self._found_right(model) | {("relative", relative)}
