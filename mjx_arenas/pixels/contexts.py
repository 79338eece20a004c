"""What MuJoCo Warp's ray caster keeps on the device for a number of worlds (host)."""

import copy
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
from mujoco import mjx

from mjx_arenas.pixels.order import Order
from mjx_arenas.record.record import Record

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


def context(record: Record, n: int, cameras: Sequence[Camera], order: Order, settings: Mapping[str, Any]) -> Any:
    """The render context of `n` worlds."""
    made = mjx.create_render_context(
        mjm=template(record),
        nworld=n,
        cam_res=[(c.width, c.height) for c in cameras],
        cam_active=[c.name for c in cameras],
        render_rgb=[c.rgb for c in cameras],
        render_depth=[c.depth for c in cameras],
        render_seg=[c.segmentation for c in cameras],
        use_precomputed_rays=not order.lenses_vary,
        **settings,
    )
    if not order.lenses_vary:
        drawn = order.drawn((c.width, c.height) for c in cameras)
        for rays in (made.ray, made.ray_offset):
            rays.assign(rays.numpy()[drawn])
    return made


def template(record: Record) -> mujoco.MjModel:
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
