"""MuJoCo Warp's ray caster for the worlds of an arena (`mjx.render`): made once, then a function of batches and states."""

import dataclasses
import functools
import itertools
import operator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from mujoco import mjx

from mjx_arenas.params.params import ArenaParams
from mjx_arenas.pixels import contexts, given, memory
from mjx_arenas.pixels.contexts import Camera as Camera
from mjx_arenas.pixels.gradients import undifferentiated
from mjx_arenas.pixels.labels import Labels, Names, of
from mjx_arenas.pixels.order import Order
from mjx_arenas.pixels.poses import Poses, poses
from mjx_arenas.pixels.together import together
from mjx_arenas.record.record import Record
from mjx_arenas.sim import programs
from mjx_arenas.sim.batch import ArenaBatch
from mjx_arenas.sim.data import put_model
from mjx_arenas.sim.warp_notes import no_room_answered

_PLACES = itertools.count(
    1
)  # in programs: draws in one program share no tree, which one could refit before another has drawn


class Picture(NamedTuple):
    """Picture of one camera in a world, in rows from the upper left corner. Kinds that were not asked for are None."""

    rgb: jax.Array | None
    """(height, width, 3) uint8; for a batch (worlds, height, width, 3), and likewise for the others."""
    depth: jax.Array | None
    """(height, width) distance along the camera's axis [m]; 0 means that there is nothing."""
    segmentation: jax.Array | None
    """(height, width) int32, index into `Renderer.labels`; -1 means that there is nothing."""


@dataclasses.dataclass(frozen=True)
class Renderer:
    """Draws the worlds of an arena: pure functions of worlds and their states, for `jit`, `vmap` and `scan`.

    It draws the state `data.qpos` and ignores what was computed from it before. So no `mjx.forward` is needed, and the picture is not one
    step late. States of `impl="jax"` are drawn as well: their worlds are written again for Warp, which costs as much as `arena.batch`.

    The ray caster's buffers on the device are allocated for each number of worlds and each call in a compiled program. They live as long as
    the renderer or that program. One thread at a time may draw with them. A copy is the renderer itself.
    """

    record: Record = dataclasses.field(repr=False)
    """Record of the arena."""
    cameras: tuple[Camera, ...]
    shadows: bool
    textures: bool
    groups: tuple[int, ...]
    """Groups of the geoms that are drawn."""
    background: tuple[float, float, float]
    """Red, green and blue, from 0 to 1, where there is nothing."""
    _contexts: dict[tuple[int, int], Any] = dataclasses.field(
        default_factory=dict, init=False, compare=False, repr=False
    )

    @functools.cached_property
    def labels(self) -> Names:
        """Meanings of the numbers of `Picture.segmentation`: tables, objects, furniture, robots, and geoms of the world. A tuple."""
        return self._labels.names

    @functools.cached_property
    def _labels(self) -> Labels:
        return of(self.record.mj_model, self.record.layout.table_body)

    def __call__(self, batch: ArenaBatch, data: mjx.Data) -> dict[str, Picture]:
        """The pictures of all cameras by their names, of all worlds.

        Args:
            batch: W worlds of the arena.
            data: their states.

        Raises:
            ValueError, TypeError: worlds of another arena, states of other worlds, more pictures than memory holds, or a gradient.
        """
        given.check_batch(self.record, batch, data)
        return jax.vmap(self.of_world, in_axes=(batch.in_axes, 0, 0))(batch.model, batch.params, data)

    def of_world(self, model: mjx.Model, params: ArenaParams, data: mjx.Data) -> dict[str, Picture]:
        """Pictures of all cameras by their names, of one world; jit, vmap (all worlds are drawn together).

        Model, parameters and state must be of the same world. All are numbers of the same shapes in all worlds, so this is not checked.

        Args:
            model: model of this world, as `arena.apply` gives it, not the template.
            params: parameters from which the model was written.
            data: state of the world.

        Raises:
            ValueError, TypeError: an argument is not of one world of the arena, or a gradient is taken.
        """
        given.check_world(self.record, self._nominal[0], model, params, data)
        return _of_world(self, next(_PLACES) if _is_staged(data.qpos) else 0, model, params, data)

    def __copy__(self) -> "Renderer":
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> "Renderer":
        return self  # nothing of it changes, and what Warp holds cannot be copied

    @functools.cached_property
    def _order(self) -> Order:
        return Order.of(self.record)

    @functools.cached_property
    def _nominal(self) -> tuple[mjx.Model, mjx.Data]:
        """The nominal model and its data on Warp."""
        model = self.record.mj_model
        with jax.ensure_compile_time_eval():  # it outlives what is traced just now
            return put_model(model, "warp"), mjx.make_data(model, impl="warp", naconmax=1, njmax=1)

    def _context(self, n: int, place: int) -> Any:
        """What the ray caster needs for `n` worlds at a place of a program."""
        if (n, place) not in self._contexts:
            memory.check(n, memory.of_world(self.record, self.cameras, self.groups))
            settings = {
                "use_textures": self.textures,
                "use_shadows": self.shadows,
                "enabled_geom_groups": list(self.groups),
                "background_color": (*self.background, 1.0),
            }
            with no_room_answered():
                made = contexts.context(self.record, n, self.cameras, self._order, settings)
            self._contexts[n, place] = made
        return self._contexts[n, place]

    def _rays(self, place: int, n: int, model: tuple[mjx.Model, mjx.Model], where: Poses) -> tuple[jax.Array, ...]:
        """Packed pixels of `n` worlds."""
        key = self._context(n, place).pytree()

        def one(model: mjx.Model, where: Poses) -> tuple[jax.Array, ...]:
            of_warp = ("light_xpos", "light_xdir")
            single = {k: x.astype(jnp.float32) for k, x in where._asdict().items()}  # as Warp has it
            placed = {f"_impl.{k}" if k in of_warp else k: x for k, x in single.items()}
            data: Any = self._nominal[1].tree_replace(placed)
            data = mjx.refit_bvh(model, data, key)
            if any(c.segmentation for c in self.cameras):
                return mjx.render_with_segmentation(model, data, key)[:3]
            return mjx.render(model, data, key)[:2]

        return jax.vmap(one, in_axes=(model[1], 0))(model[0], where)

    def _unpacked(self, rgb: jax.Array, depth: jax.Array, segmentation: Any = None) -> dict[str, Picture]:
        """The pictures of one world, taken out of the packed ones."""
        packed = {"rgb": rgb, "depth": depth, "segmentation": segmentation}
        found, at = {}, dict.fromkeys(packed, 0)
        for camera in self.cameras:
            pixels: dict[str, Any] = dict.fromkeys(packed)
            for kind, of_all in packed.items():
                if getattr(camera, kind):
                    end = at[kind] + camera.width * camera.height
                    pixels[kind] = self._order.picture(camera.width, camera.height, of_all[at[kind] : end])
                    at[kind] = end
            if camera.rgb:
                channels = jax.lax.bitcast_convert_type(pixels["rgb"], jnp.uint8)  # blue, green, red, alpha
                pixels["rgb"] = channels[..., 2::-1]
            if camera.segmentation:
                geom = pixels["segmentation"][..., 0]
                pixels["segmentation"] = jnp.where(geom < 0, -1, jnp.asarray(self._labels.of_geoms)[geom])
            found[camera.name] = Picture(**pixels)
        return found


@functools.partial(jax.jit, static_argnums=(0, 1))  # it keeps the renderer, and so what the compiled program draws with
def _of_world(
    renderer: Renderer, place: int, model: mjx.Model, params: ArenaParams, data: mjx.Data
) -> dict[str, Picture]:
    model, params, data = undifferentiated((model, params, data))
    drawn: Any = model
    if model.impl.value != "warp":
        nominal = renderer._nominal[0]
        fields = programs.fields(renderer.record, nominal, params)
        drawn = nominal.tree_replace({k: x.astype(operator.attrgetter(k)(nominal).dtype) for k, x in fields.items()})
    where = poses(renderer.record.layout, params, model, drawn, data)
    return renderer._unpacked(*together(functools.partial(renderer._rays, place), drawn, where))


def _is_staged(x: Any) -> bool:
    """Whether a program is traced, beneath what `jax.vmap` does."""
    while type(x).__name__ == "BatchTracer":
        x = x.val
    return isinstance(x, jax.core.Tracer)
