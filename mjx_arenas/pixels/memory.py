"""What pictures take of a device's memory, and what it has of it (host).

The numbers of the ray caster are those of mujoco_warp's `create_render_context` and of Warp's `Bvh`, on a GPU.
"""

import os
from collections.abc import Collection, Sequence
from typing import NamedTuple

import jax
import numpy as np

from mjx_arenas.pixels import contexts
from mjx_arenas.pixels.contexts import Camera
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.record.record import Record
from mjx_arenas.sim.data import on_nvidia

_PICTURES = {"rgb": 4 + 3, "depth": 4 + 4, "segmentation": 8 + 8 + 4}  # a pixel: as it is drawn, and as it is given
_BOX = 12 + 12 + 4  # a geom that is drawn: its corners, and its world
_TREE = 2 * (16 + 16 + 4 + 4) + 4  # the same: two nodes with corners, a parent and a count; and an index
_WORLD = 4 + 4 + 12  # two roots, and a pixel that no picture has
_BUILT = {"rgb": 4, "depth": 4}  # a pixel, until the tree is built
_POSED = 4 + 12 + 12 + 36  # a geom, until the tree is built: mesh, size, place, orientation


class Bytes(NamedTuple):
    """The memory [bytes] that one world needs."""

    pictures: int
    """What JAX holds of them."""
    kept: int
    """What the ray caster holds for each place in a program that draws."""
    made: int
    """The same while it is made."""


class Memory(NamedTuple):
    """The free memory of a device [bytes]."""

    jax: float
    """What JAX may still take."""
    beside: float | None
    """What is free for Warp beside what JAX holds; None where both take from the same."""
    unused: float = float("inf")
    """What JAX holds already and does not use: beyond it, what it takes is no longer free for Warp."""


def of_world(record: Record, cameras: Sequence[Camera], groups: Collection[int]) -> Bytes:
    """What pictures of a world need."""
    template = contexts.template(record)
    n_drawn = int(np.isin(template.geom_group, list(groups)).sum())
    pixels = {kind: sum(c.width * c.height for c in cameras if getattr(c, kind)) for kind in _PICTURES}
    kept = n_drawn * (_BOX + _TREE) + _WORLD + 8 * max(1, pixels["segmentation"])
    made = kept + template.ngeom * _POSED + sum(_BUILT[kind] * pixels[kind] for kind in _BUILT)
    return Bytes(sum(_PICTURES[kind] * pixels[kind] for kind in _PICTURES), kept, made)


def check(n: int, each: Bytes) -> None:
    """Refuses pictures of more worlds than memory holds, of which Warp would draw wrong ones.

    Args:
        n: worlds.
        each: what one of them needs.
    """
    has = memory()
    shared = has.beside is None
    if (need := n * (each.pictures + (each.made if shared else 0))) > has.jax:
        raise error([problem("batch", "room_for_pictures", None, n, n=n, need=need / 1e9, has=has.jax / 1e9)])
    grown = max(n * each.pictures - has.unused, 0.0)
    if has.beside is not None and (need := n * each.made + grown) > has.beside:
        raise error([problem("batch", "room_for_rays", None, n, n=n, need=need / 1e9, has=has.beside / 1e9)])


def memory() -> Memory:
    """The free memory of the device that draws."""
    if on_nvidia():
        import warp

        stats = jax.local_devices()[0].memory_stats() or {}
        device = warp.get_device()
        used, limit = stats.get("bytes_in_use", 0), stats.get("bytes_limit") or device.total_memory
        return Memory(limit - used, device.free_memory, stats.get("pool_bytes", limit) - used)
    return Memory(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"), None)
