"""Furniture in one world, where its joints start: its boxes as upright slabs, and its surfaces, NumPy or JAX."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from mjx_arenas import geometry
from mjx_arenas.furniture.part import Box, Joint, Part, stacked
from mjx_arenas.geometry import Array
from mjx_arenas.params.params import ArenaParams


class Standing(NamedTuple):
    """N slabs, or as many surfaces."""

    top: Array  # (N, 3) middle of the upper side, in the world [m]
    rot: Array  # (N,) yaw [rad]
    full_size: Array  # (N, 3) [m]; of a surface (N, 2)
    there: Array  # (N,) bool


def numbers_of(part: Part, params: ArenaParams) -> dict[str, Array]:
    """The part's own numbers in a world, as `Part.boxes` takes them."""
    found = {}
    for name, one in part.parameters.items():
        value = params.terms[f"{part.name}.{name}"]
        found[name] = value[0] if one.items == ("",) else value
    return found


class Frame(NamedTuple):
    """The place of a part in one world."""

    pos: Array  # (3,) [m]
    rot: Array  # () yaw [rad]
    carried: Array  # () bool: what it stands on is there
    there: Array  # () bool: it is there itself


WORLD = Frame(np.zeros(3), np.zeros(()), np.True_, np.True_)


def frames(parts: Sequence[Part], params: ArenaParams) -> list[Frame]:
    """The places of the parts; what they stand on comes before them."""
    found: list[Frame] = []
    for part in parts:
        own = numbers_of(part, params)
        xp, pos, rot = geometry.array_module(own["pos"]), own["pos"], own["rot"]
        carried = xp.ones((), bool)
        if part.on is not None:
            top, below, carried = _carrying(part.on, parts, params, found)
            pos, rot = _within(top, below, pos), below + rot
        elif part.beside is not None:
            i = [one.name for one in parts].index(part.beside)
            shift = _abutting(part, parts[i], own, numbers_of(parts[i], params))
            pos, rot = _within(found[i].pos, found[i].rot, pos + shift), found[i].rot + rot
        there = carried if part.stays else carried & params.terms[f"{part.name}.active"][0]
        found.append(Frame(pos, rot, carried, there))
    return found


def _within(origin: Array, rot: Array, pos: Array) -> Array:
    """(3,) in the world of a place in an upright frame."""
    xy = origin[:2] + geometry.rotate_yaw(rot, pos[:2])
    return geometry.array_module(origin, pos).concatenate([xy, (origin[2] + pos[2])[None]])


def _abutting(part: Part, other: Part, own: Mapping[str, Array], others: Mapping[str, Array]) -> Array:
    """(3,) where the part's frame is in the other's, if they abut on this side of the other."""
    (low, high), (least, most) = outline(part, own, own["rot"]), outline(other, others)
    x = {"front": least[0] - high[0], "back": most[0] - low[0]}.get(part.side, most[0] - high[0])
    y = {"left": most[1] - low[1], "right": least[1] - high[1]}.get(part.side, least[1] - low[1])
    xp = geometry.array_module(x, y)
    return xp.stack([x, y, 0.0 * x])


def outline(part: Part, own: Mapping[str, Array], rot: Array | None = None) -> tuple[Array, Array]:
    """Lowest and highest x, y (2,) of a part's boxes, with all joints closed, in its frame; or where it is turned by a yaw."""
    boxes = part.boxes(own)
    xp, signs = geometry.array_module(own["pos"]), np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    middle = stacked([box.pos[:2] for box in boxes], own["pos"])
    half = stacked([_upright(box)[:2] for box in boxes], own["pos"])
    corners = (middle[:, None] + half[:, None] * xp.asarray(signs[None], half.dtype)).reshape(-1, 2)
    corners = corners if rot is None else geometry.rotate_yaw(rot, corners)
    return corners.min(0), corners.max(0)


def _carrying(
    on: int | str, parts: Sequence[Part], params: ArenaParams, frames: Sequence[Frame]
) -> tuple[Array, Array, Array]:
    """Middle (3,), yaw and presence of a table's top or of a surface."""
    if isinstance(on, int):
        return params.table_offsets[on], params.table_rots[on], params.table_active[on]
    i, _ = carrier(on, parts)
    top, rot, _, there = (x[_names(parts[i]).index(on)] for x in _surfaces(parts[i], params, frames[i]))
    return top, rot, there


def carrier(surface: str, parts: Sequence[Part]) -> tuple[int, str]:
    """The index of the part that has the surface of a name, and the surface's name within the part."""
    of = {}
    for i, part in enumerate(parts):
        of |= {name: (i, one.name) for name, one in zip(_names(part), part.nominal_surfaces, strict=True)}
    return of[surface]


def chain(part: Part, parts: Sequence[Part]) -> tuple[Part, ...]:
    """The parts that one stands on or abuts, and those that these do, before those that they carry."""
    if isinstance(part.on, str):
        other = parts[carrier(part.on, parts)[0]]
    elif part.beside is not None:
        other = next(one for one in parts if one.name == part.beside)
    else:
        return ()
    return (*chain(other, parts), other)


def standing(parts: Sequence[Part], params: ArenaParams) -> Standing:
    """The boxes of one part after the other; of one that is tilted the upright box around it."""
    pairs = zip(parts, frames(parts, params), strict=True)
    return _joined([_boxes(part, params, frame) for part, frame in pairs if part.nominal_boxes], params)


def surfaces(parts: Sequence[Part], params: ArenaParams) -> Standing:
    """The surfaces of one part after the other."""
    pairs = zip(parts, frames(parts, params), strict=True)
    return _joined([_surfaces(part, params, frame) for part, frame in pairs if part.nominal_surfaces], params)


def names(parts: Sequence[Part]) -> list[str]:
    """(N,) of the geoms."""
    return [f"{part.name}_{box.name}" for part in parts for box in part.nominal_boxes]


def surface_names(parts: Sequence[Part]) -> list[str]:
    """(N,) of the surfaces: a box has the name of its upper side."""
    return [name for part in parts for name in _names(part)]


def owners(parts: Sequence[Part]) -> list[int]:
    """(N,) of which part each box is."""
    return [i for i, part in enumerate(parts) for _ in part.nominal_boxes]


def surface_owners(parts: Sequence[Part]) -> list[int]:
    """(N,) of which part each surface is."""
    return [i for i, part in enumerate(parts) for _ in _names(part)]


def _names(part: Part) -> tuple[str, ...]:
    return tuple("_".join(filter(None, (part.name, one.name))) for one in part.nominal_surfaces)


def _joined(found: Sequence[Standing], params: ArenaParams) -> Standing:
    xp = geometry.array_module(params.table_rots)
    if not found:
        none = xp.zeros(0, params.table_rots.dtype)
        return Standing(none.reshape(0, 3), none, none.reshape(0, 3), xp.zeros(0, bool))
    return Standing(*map(xp.concatenate, zip(*found, strict=True)))


def size(part: Part, params: ArenaParams) -> Array:
    """(3,) of the box around it, along the axes of its frame, shut [m]; of what has no boxes, around its surfaces."""
    own = numbers_of(part, params)
    boxes = [(box.pos, _upright(box)) for box in part.boxes(own)]
    boxes = boxes or [(one.pos, (*one.half, 0.0)) for one in part.surfaces(own)]
    middle, half = stacked([pos for pos, _ in boxes], own["pos"]), stacked([half for _, half in boxes], own["pos"])
    return (middle + half).max(0) - (middle - half).min(0)


def _boxes(part: Part, params: ArenaParams, frame: Frame) -> Standing:
    own, half, tops = numbers_of(part, params), [], []
    for box in part.boxes(own):
        half.append(_upright(box))
        tops.append((box.piece, (box.pos[0], box.pos[1], box.pos[2] + half[-1][2])))
    return _placed(part, params, frame, tops, half)


def _upright(box: Box) -> Sequence[Array]:
    """(3,) half of the sides of the upright box around it."""
    x, y, z = box.half
    if box.is_upright:
        return x, y, z
    xp = geometry.array_module(box.tilt)
    cos, sin = xp.abs(xp.cos(box.tilt)), xp.abs(xp.sin(box.tilt))
    return cos * x + sin * z, y, sin * x + cos * z


def _surfaces(part: Part, params: ArenaParams, frame: Frame) -> Standing:
    found = part.surfaces(numbers_of(part, params))
    return _placed(part, params, frame, [(one.piece, one.pos) for one in found], [one.half for one in found])


def _placed(
    part: Part,
    params: ArenaParams,
    frame: Frame,
    tops: Sequence[tuple[str, Sequence[Array]]],
    half: Sequence[Sequence[Array]],
) -> Standing:
    """Pieces of a part, and the middles of upper sides, moved from the part's frame into the world."""
    joints, like = _starting(part, numbers_of(part, params)), frame.pos
    moved = [_moved(pos, *joints[piece]) if piece in joints else (pos, 0.0) for piece, pos in tops]
    local, yaw = stacked([pos for pos, _ in moved], like), stacked([[turn] for _, turn in moved], like)[:, 0]
    xp = geometry.array_module(local, like)
    xy = frame.pos[None, :2] + geometry.rotate_yaw(frame.rot, local[:, :2])
    top = xp.concatenate([xy, (frame.pos[2] + local[:, 2])[:, None]], axis=-1)
    pieces = {piece: i for i, piece in enumerate(part.coming)}
    there = [
        frame.there & params.terms[f"{part.name}.pieces_active"][pieces[piece]] if piece in pieces else frame.there
        for piece, _ in tops
    ]
    return Standing(top, frame.rot + yaw, 2 * stacked(half, like), xp.stack(there))


def _starting(part: Part, own: Mapping[str, Array]) -> dict[str, tuple[Joint, Array]]:
    """The joint of each piece that moves, and the position in which it starts."""
    starts = [own[name] for name, one in part.parameters.items() if one.starts]
    joints = part.joints(own)
    return {joint.piece: (joint, starts[0][i] if starts[0].ndim else starts[0]) for i, joint in enumerate(joints)}


def _moved(pos: Sequence[Array], joint: Joint, start: Array) -> tuple[Sequence[Array], Array | float]:
    """A place of a piece whose joint starts there, and by how much it is turned; hinges are upright."""
    if not joint.turns:
        return tuple(x + start * along for x, along in zip(pos, joint.axis, strict=True)), 0.0
    xp, yaw = geometry.array_module(start), start * joint.axis[2]
    cos, sin = xp.cos(yaw), xp.sin(yaw)
    x, y = pos[0] - joint.pos[0], pos[1] - joint.pos[1]
    return (joint.pos[0] + cos * x - sin * y, joint.pos[1] + sin * x + cos * y, pos[2]), yaw
