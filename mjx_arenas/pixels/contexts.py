"""What MuJoCo Warp's ray caster keeps on the device for a number of worlds (host), and the order of its pixels."""

import copy
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.record.record import Record

_BLOCK = 8  # rays of 8 by 8 pixels stand beside each other: they meet the same things, which the GPU draws a fifth faster than rows
_NEVER = -1  # a group that no renderer draws


class Camera(NamedTuple):
    """A camera, and what its pictures give."""

    name: str
    width: int
    """[pixels]"""
    height: int
    """[pixels]"""
    rgb: bool
    depth: bool
    segmentation: bool


def context(record: Record, n: int, cameras: Sequence[Camera], settings: Mapping[str, Any]) -> Any:
    """Of `n` worlds."""
    made = mjx.create_render_context(
        mjm=_template(record),
        nworld=n,
        cam_res=[(c.width, c.height) for c in cameras],
        cam_active=[c.name for c in cameras],
        render_rgb=[c.rgb for c in cameras],
        render_depth=[c.depth for c in cameras],
        render_seg=[c.segmentation for c in cameras],
        use_precomputed_rays=not _lenses_vary(record),
        **settings,
    )
    if not _lenses_vary(record):
        pixels = [np.arange(c.width * c.height).reshape(c.height, c.width) for c in cameras]
        starts = np.cumsum([0, *(x.size for x in pixels)])
        order = np.concatenate([at + _in_blocks(x) for at, x in zip(starts, pixels, strict=False)])
        for rays in (made.ray, made.ray_offset):
            rays.assign(rays.numpy()[order])
    return made


def in_rows(record: Record, camera: Camera, pixels: jax.Array) -> jax.Array:
    """(H, B, ...) of what was drawn for a camera (H * B, ...)."""
    height, width, rest = camera.height, camera.width, pixels.shape[1:]
    if _lenses_vary(record):
        return pixels.reshape(height, width, *rest)
    rows, columns = _block(height, width)
    blocks = pixels.reshape(height // rows, width // columns, rows, columns, *rest)
    return blocks.swapaxes(1, 2).reshape(height, width, *rest)


def _in_blocks(pixels: np.ndarray) -> np.ndarray:
    """(H * B,) of what stands in rows (H, B)."""
    (height, width), (rows, columns) = pixels.shape, _block(*pixels.shape)
    return pixels.reshape(height // rows, rows, width // columns, columns).swapaxes(1, 2).reshape(-1)


def _block(height: int, width: int) -> tuple[int, int]:
    """Rows and columns of a block."""
    return math.gcd(height, _BLOCK), math.gcd(width, _BLOCK)


def _lenses_vary(record: Record) -> bool:
    """Then rays are computed in each world, in rows."""
    return any(owned.field in ("cam_fovy", "cam_intrinsic") for owned in record.scene.owned)


def _template(record: Record) -> mujoco.MjModel:
    """What a context is made of: without geoms that no world shows, and with lights that are as different as any world's.

    What all lights of the template have in common would be simplified away for all worlds.
    """
    model, owned = copy.copy(record.mj_model), record.scene.owned
    shown = model.geom_rgba[:, 3] != 0
    for term in owned:
        if term.field == "geom_rgba":
            shown[term.elements[term.elements % 4 == 3] // 4] = True
    model.geom_group[~shown] = _NEVER
    if model.nlight and {"light_attenuation", "light_type"} & {term.field for term in owned}:
        model.light_attenuation[0] = [1.0, 0.0, 1.0]
        model.light_type[0] = mujoco.mjtLightType.mjLIGHT_SPOT
    return model
