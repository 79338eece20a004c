"""MuJoCo Warp's ray caster for the worlds of an arena (`mjx.render`): made once, then a function of batches and states."""

import copy
import importlib.metadata
import importlib.util
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.pixels import labels
from mjx_arenas.pixels.poses import Poses, poses
from mjx_arenas.record.record import Record
from mjx_arenas.sim import programs
from mjx_arenas.sim.batch import ArenaBatch, in_axes
from mjx_arenas.sim.data import put_model

RESOLUTION = (64, 64)
GROUPS = (0, 1, 2)  # of geoms, which MuJoCo draws, too, unless told otherwise
_SINCE = (3, 12)  # mujoco-mjx: before, `render` and `refit_bvh` could change places inside one jit
_BYTES = {"rgb": 4, "depth": 4, "segmentation": 8}  # of a pixel, in the renderer and in what it gives


class Picture(NamedTuple):
    """What one camera sees in W worlds, of H by B pixels from its upper left corner; None for what was not asked for."""

    rgb: jax.Array | None
    """(W, H, B, 3) uint8."""
    depth: jax.Array | None
    """(W, H, B) distance along the camera's axis [m]; 0 where there is nothing."""
    segmentation: jax.Array | None
    """(W, H, B) int32, index into `Renderer.labels`; -1 where there is nothing."""


class Renderer:
    """Draws the worlds of an arena; a pure function of a batch and its states, for jit and scan.

    It draws the state `data.qpos`, whatever was computed from it before: no `mjx.forward` is needed, and the picture is not one step
    late. States of `impl="jax"` are drawn, too: their worlds are written anew for Warp, which costs as much as `arena.batch`.
    """

    def __init__(
        self,
        record: Record,
        n_worlds: int,
        cameras: Sequence[str] | Mapping[str, tuple[int, int]] | None,
        *,
        rgb: bool | Collection[str],
        depth: bool | Collection[str],
        segmentation: bool | Collection[str],
        shadows: bool,
        textures: bool,
        groups: Sequence[int],
        background: Sequence[float],
    ) -> None:
        _check_versions()
        model = record.mj_model
        sizes = _resolutions(model, cameras)
        outputs = {
            "rgb": _asked("rgb", rgb, sizes),
            "depth": _asked("depth", depth, sizes),
            "segmentation": _asked("segmentation", segmentation, sizes),
        }
        _check(record, model, n_worlds, outputs, textures, groups)
        self.n_worlds = n_worlds
        """W."""
        self.cameras = dict(sizes)
        """Width and height of each camera's picture [pixels]."""
        self.labels = labels.names(model)
        """What the numbers of `Picture.segmentation` stand for: tables, objects, robots, and geoms of the world."""
        self._record, self._outputs = record, outputs
        self._label_of = labels.of_geoms(model)
        varied = {owned.field for owned in record.scene.owned}
        self._context = mjx.create_render_context(
            mjm=_template(model, varied),
            nworld=n_worlds,
            cam_res=list(sizes.values()),
            cam_active=list(sizes),
            render_rgb=[name in outputs["rgb"] for name in sizes],
            render_depth=[name in outputs["depth"] for name in sizes],
            render_seg=[name in outputs["segmentation"] for name in sizes],
            use_precomputed_rays=not varied & {"cam_fovy", "cam_intrinsic"},
            use_textures=textures,
            use_shadows=shadows,
            enabled_geom_groups=list(groups),
            background_color=(*background, 1.0),
        )
        self._model = put_model(model, "warp")
        self._data = mjx.make_data(model, impl="warp", naconmax=1, njmax=1)

    def __call__(self, batch: ArenaBatch, data: mjx.Data) -> dict[str, Picture]:
        """The pictures of all cameras, by their names.

        Args:
            batch: of `n_worlds` worlds of the arena.
            data: their states.

        Raises:
            ValueError: another number of worlds, or worlds of another arena.
        """
        self._check_worlds(batch, data)
        model, axes = batch.model, batch.in_axes
        drawn: Any = model
        drawn_axes = axes
        if model.impl.value != "warp":
            fields = jax.vmap(lambda params: programs.fields(self._record, self._model, params))(batch.params)
            drawn = self._model.tree_replace(fields)
            drawn_axes = in_axes(self._model, tuple(fields))

        def seen(model: mjx.Model, drawn: mjx.Model, data: mjx.Data) -> tuple[jax.Array, jax.Array, jax.Array]:
            return self._rays(drawn, poses(self._record.mj_model, model, drawn, data))

        rgb, depth, segmentation = jax.vmap(seen, in_axes=(axes, drawn_axes, 0))(model, drawn, data)
        return self._unpacked(rgb, depth, segmentation)

    def _rays(self, model: mjx.Model, where: Poses) -> tuple[jax.Array, jax.Array, jax.Array]:
        """Packed pixels of one world."""
        own, of_warp = where._asdict(), ("light_xpos", "light_xdir")
        data: Any = self._data.tree_replace(
            {(f"_impl.{name}" if name in of_warp else name): value for name, value in own.items()}
        )
        key = self._context.pytree()
        data = mjx.refit_bvh(model, data, key)
        if self._outputs["segmentation"]:
            rgb, depth, segmentation, _ = mjx.render_with_segmentation(model, data, key)
            return rgb, depth, segmentation
        rgb, depth, _ = mjx.render(model, data, key)
        return rgb, depth, jnp.zeros((0, 2), jnp.int32)

    def _unpacked(self, rgb: jax.Array, depth: jax.Array, segmentation: jax.Array) -> dict[str, Picture]:
        found, at = {}, dict.fromkeys(self._outputs, 0)
        packed = {"rgb": rgb, "depth": depth, "segmentation": segmentation}
        for name, (width, height) in self.cameras.items():
            pixels: dict[str, jax.Array | None] = dict.fromkeys(packed)
            for kind, of_all in packed.items():
                if name in self._outputs[kind]:
                    flat = of_all[:, at[kind] : at[kind] + width * height]
                    pixels[kind] = flat.reshape(len(flat), height, width, *flat.shape[2:])
                    at[kind] += width * height
            if pixels["rgb"] is not None:
                channels = jax.lax.bitcast_convert_type(pixels["rgb"], jnp.uint8)  # blue, green, red, alpha
                pixels["rgb"] = channels[..., 2::-1]
            if pixels["segmentation"] is not None:
                geom = pixels["segmentation"][..., 0]
                pixels["segmentation"] = jnp.where(geom < 0, -1, jnp.asarray(self._label_of)[geom])
            found[name] = Picture(**pixels)
        return found

    def _check_worlds(self, batch: ArenaBatch, data: mjx.Data) -> None:
        if not isinstance(batch, ArenaBatch):
            raise TypeError(f"`batch` must be an ArenaBatch, got {type(batch).__name__}.")
        if batch.record != self._record:
            raise ValueError("`batch` is of another arena than the renderer.")
        for name, n in (("batch", batch.n_worlds), ("data", len(data.qpos) if data.qpos.ndim > 1 else 1)):
            if n != self.n_worlds:
                raise ValueError(
                    f"`{name}` must be of the renderer's {self.n_worlds} worlds, got {n}: arena.renderer({n}, ...) draws so many."
                )


def _template(model: mujoco.MjModel, varied: set[str]) -> mujoco.MjModel:
    """What the context is made of: lights that may vary are not simplified away, which it would for all worlds."""
    if model.nlight and varied & {"light_attenuation", "light_type"}:
        model = copy.copy(model)
        model.light_attenuation[0] = [1.0, 0.0, 1.0]
        model.light_type[0] = mujoco.mjtLightType.mjLIGHT_SPOT
    return model


def _check_versions() -> None:
    if importlib.util.find_spec("warp") is None:
        raise RuntimeError("Pictures on the device need MuJoCo Warp: pip install 'mjx_arenas[warp]'.")
    version = importlib.metadata.version("mujoco-mjx")
    if tuple(int(x) for x in re.findall(r"\d+", version)[:2]) < _SINCE:
        raise RuntimeError(
            f"Pictures on the device need mujoco-mjx 3.12 or newer, this is {version}: before, pictures could be of the last state."
        )


def _resolutions(
    model: mujoco.MjModel, cameras: Sequence[str] | Mapping[str, tuple[int, int]] | None
) -> dict[str, tuple[int, int]]:
    """Width and height of each camera's picture."""
    known = [model.camera(i).name for i in range(model.ncam)]
    if cameras is None:
        cameras = known
    if isinstance(cameras, str) or not isinstance(cameras, Sequence | Mapping):
        raise TypeError(f"`cameras` must be names, or a dict of (width, height) by name, got {cameras!r}.")
    if not len(cameras):
        raise ValueError(f"`cameras` must name one camera at least, of {', '.join(known) or 'none: arena.add_camera'}.")
    found = {}
    for name in cameras:
        if name not in known:
            raise ValueError(f"`cameras`: there is no camera {name!r}; there are {', '.join(known) or 'none'}.")
        own = tuple(int(x) for x in model.cam_resolution[model.camera(name).id])
        size = cameras[name] if isinstance(cameras, Mapping) else own if own != (1, 1) else RESOLUTION
        whole = isinstance(size, Sequence | np.ndarray) and all(isinstance(x, int | np.integer) and x > 0 for x in size)
        if not whole or len(size) != 2:
            raise ValueError(f"`cameras[{name!r}]` must be (width, height), two whole numbers above 0, got {size!r}.")
        found[name] = (int(size[0]), int(size[1]))
    return found


def _asked(kind: str, given: bool | Collection[str], cameras: Collection[str]) -> frozenset[str]:
    """The cameras that give something."""
    if isinstance(given, bool):
        return frozenset(cameras if given else ())
    if isinstance(given, str) or not isinstance(given, Collection):
        raise TypeError(f"`{kind}` must be true, false, or names of cameras, got {given!r}.")
    for name in given:
        if name not in cameras:
            raise ValueError(f"`{kind}` names {name!r}, which is none of the `cameras` {', '.join(cameras)}.")
    return frozenset(given)


def _check(
    record: Record,
    model: mujoco.MjModel,
    n_worlds: int,
    outputs: Mapping[str, frozenset[str]],
    textures: bool,
    groups: Sequence[int],
) -> None:
    if not isinstance(n_worlds, int | np.integer) or isinstance(n_worlds, bool) or n_worlds < 1:
        raise ValueError(f"`n_worlds` must be a whole number above 0, got {n_worlds!r}.")
    if not any(outputs.values()):
        raise ValueError("`rgb`, `depth` and `segmentation` are all false: the renderer would give nothing.")
    wrong = [g for g in groups if g not in range(mujoco.mjNGROUP)]
    if wrong:
        raise ValueError(f"`groups` must be numbers from 0 to {mujoco.mjNGROUP - 1}, got {wrong[0]!r}.")
    visible = np.isin(model.geom_group, list(groups))
    if not visible.any():
        there = sorted({int(g) for g in model.geom_group})
        raise ValueError(f"`groups` {list(groups)} have no geom; the arena's geoms are in {there}.")
    if not textures:
        for owned in record.scene.owned:
            if owned.field in ("mat_texid", "mat_texrepeat"):
                raise ValueError(f"`textures` is false, but {owned.term!r} varies textures: set it true.")
        return
    used = {int(m) for m in model.geom_matid[visible] if m >= 0}
    for owned in record.scene.owned:
        if owned.field in ("mat_texid", "geom_matid"):
            used |= set(range(model.nmat))
    for material in sorted(used):
        for texture in {int(t) for t in model.mat_texid[material] if t >= 0}:
            if model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_CUBE:
                raise ValueError(
                    f"Material {model.material(material).name!r} has the cube texture {model.texture(texture).name!r}, which the renderer "
                    'draws wrong: give the texture type="2d", or the renderer textures=False.'
                )
