"""Furniture in one world: its boxes as upright slabs, NumPy or JAX."""

from collections.abc import Sequence
from typing import NamedTuple

from mjx_arenas import geometry
from mjx_arenas.furniture.part import Part, stacked
from mjx_arenas.geometry import Array
from mjx_arenas.params.params import ArenaParams


class Standing(NamedTuple):
    """N boxes of parts; of one that is tilted the upright box around it."""

    top: Array  # (N, 3) middle of the upper side, in the world [m]
    rot: Array  # (N,) yaw [rad]
    full_size: Array  # (N, 3) [m]
    there: Array  # (N,) bool


def numbers_of(part: Part, params: ArenaParams) -> dict[str, Array]:
    """The part's own numbers in a world, as `Part.boxes` takes them."""
    found = {}
    for name, one in part.parameters.items():
        value = params.terms[f"{part.name}.{name}"]
        found[name] = value[0] if one.items == ("",) else value
    return found


def standing(parts: Sequence[Part], params: ArenaParams) -> Standing:
    """The boxes of one part after the other."""
    return Standing(
        *map(geometry.array_module(params.table_rots).concatenate, zip(*(_of(p, params) for p in parts), strict=True))
    )


def names(parts: Sequence[Part]) -> list[str]:
    """(N,) of the geoms."""
    return [f"{part.name}_{box.name}" for part in parts for box in part.boxes(part.nominal)]


def owners(parts: Sequence[Part]) -> list[int]:
    """(N,) of which part each box is."""
    return [i for i, part in enumerate(parts) for _ in part.boxes(part.nominal)]


def _of(part: Part, params: ArenaParams) -> Standing:
    own = numbers_of(part, params)
    xp, boxes = geometry.array_module(own["pos"]), part.boxes(own)
    half = []
    for x, y, z, tilt in ((*box.half, box.tilt) for box in boxes):
        if isinstance(tilt, float):
            half.append((x, y, z))
        else:
            cos, sin = xp.abs(xp.cos(tilt)), xp.abs(xp.sin(tilt))
            half.append((cos * x + sin * z, y, sin * x + cos * z))
    size = stacked(half, own["pos"])
    local = stacked([box.pos for box in boxes], own["pos"])
    xy = own["pos"][:2] + geometry.rotate_yaw(own["rot"], local[:, :2])
    top = own["pos"][2] + local[:, 2] + size[:, 2]
    rot = xp.broadcast_to(own["rot"], top.shape)
    wanted = xp.ones((), bool) if part.moving else params.terms[f"{part.name}.active"][0]
    pieces = {piece: i for i, piece in enumerate(part.pieces)}
    there = [
        wanted & params.terms[f"{part.name}.pieces_active"][pieces[box.piece]] if box.piece in pieces else wanted
        for box in boxes
    ]
    return Standing(xp.concatenate([xy, top[:, None]], axis=-1), rot, 2 * size, xp.stack(there))
