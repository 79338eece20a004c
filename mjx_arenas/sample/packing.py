"""Rounded rectangles at random places, one after the other: inside their regions, apart from each other.

Random sequential placement for one world at a time; callers `vmap`. Shapes and the number of tries are static. Lengths
are in [m], angles in [rad].
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

from mjx_arenas.params.distribution import DRAWN

CANDIDATES = 4  # tried in a round
ROUNDS = 128  # tried for a solid
FULL_TURN = 6.28  # [rad] from the least yaw to the most, or more: a solid may have any
SNUG = 32  # from this round on candidates touch a neighbour or an edge: what room is left in a crowd is tight


class Solids(NamedTuple):
    """Upright prisms over rounded rectangles: a box has no rounding, a disc no sides, a lying capsule one side."""

    pose: jax.Array  # (n, 3) x, y, yaw in the world
    half: jax.Array  # (n, 2) half sides of the rectangle, without the rounding
    radius: jax.Array  # (n,) of the rounding
    bottom: jax.Array  # (n,) z in the world
    top: jax.Array  # (n,)
    present: jax.Array  # (n,) bool; an absent one is no obstacle


class Region(NamedTuple):
    """Rectangles to stay inside of."""

    pose: jax.Array  # (n, 3) x, y, yaw in the world, or in the frame of what carries it
    half: jax.Array  # (n, 2) half sides
    on: jax.Array | None = None  # (n,) the solid, placed before, that carries it; -1: none
    radius: jax.Array | None = (
        None  # (n,) of the disc about the middle of that solid in which it must be, too; infinite: none
    )


class Rings(NamedTuple):
    """How far middles of solids are from points."""

    center: jax.Array  # (n, 2) in the world
    least: jax.Array  # (n,)
    most: jax.Array  # (n,)


def pack(
    keys: jax.Array,
    solids: Solids,
    regions: Region,
    obstacles: Solids,
    ignore: jax.Array,
    rots: jax.Array | None = None,
    gap: jax.Array | float = 0.0,
    margin: jax.Array | float = 0.0,
    rings: Rings | None = None,
) -> tuple[jax.Array, jax.Array]:
    """Draws a pose for each solid, in order: the first candidate inside its region and clear of all that stands.

    The yaw is uniform among those with which the solid fits into its region, the place among those which the yaw
    leaves, until `SNUG` rounds found nothing. A solid's draws depend on its own key alone. Distances are exact but for
    rounding, which never lets solids come closer than `gap`, and at an edge never keeps out what fits exactly.

    Args:
        keys: (n,) one for each solid.
        solids: (n,) to place; their poses are not read.
        regions: (n,) where each stays, rounding included.
        obstacles: (m,) that stand already.
        ignore: (n, m) bool, which obstacles do not count for a solid. Solids whose z intervals do not overlap never
            count for each other.
        rots: (n, 2) least and most yaw, in the frame of the region; any if they are a full turn apart, and by default.
        gap: Smallest distance between solids and to obstacles.
        margin: () or (n,) smallest distance to the edge of the region.
        rings: (n,) in which their middles must be; None: anywhere.

    Returns:
        Poses (n, 3), always finite, and (n,) bool whether the solid found a place: one that did not is no obstacle to
        those after it. One that is absent always does.
    """
    solids, regions, obstacles, rots, gap, margin = jax.lax.stop_gradient(
        (solids, regions, obstacles, rots, jnp.asarray(gap), jnp.asarray(margin))
    )
    n = len(solids.radius)
    if n == 0:
        return jnp.zeros((0, 3), solids.radius.dtype), jnp.zeros(0, bool)
    crowd = _crowd(keys, solids, regions, obstacles, ignore, rots, gap, margin, rings)
    index, one_round = jnp.arange(len(crowd.every.radius)), ~(fit(solids, regions, margin, rots) & solids.present)

    def attempt(state: tuple[jax.Array, jax.Array, _Frames, jax.Array]) -> tuple:
        k, turn, placed, there = state
        candidates, free = _tried(crowd, k, turn, placed, there)
        first = jnp.argmax(free)
        placed = jax.tree.map(lambda new, old: jnp.where(index == k, new[first], old), candidates, placed)
        there = jnp.where(index == k, free[first] & solids.present[k], there)
        done = free[first] | one_round[k] | (turn == ROUNDS - 1)
        return k + done, jnp.where(done, 0, turn + 1), placed, there

    # One loop over the rounds of all solids: in a batch, a world waits for the others at the end, not at each solid.
    there = jnp.concatenate([jnp.zeros(n, bool), obstacles.present])
    start = jnp.int32(0), jnp.int32(0), _frames(crowd.every.pose), there
    _, _, placed, there = jax.lax.while_loop(lambda state: state[0] < n, attempt, start)
    return jnp.stack([placed.x, placed.y, placed.yaw], axis=-1)[:n], there[:n] | ~solids.present


class _Crowd(NamedTuple):
    """What is to be placed, n solids, and all N that it must keep clear of: these, and the obstacles."""

    keys: jax.Array  # (n,)
    solids: Solids  # (n,)
    regions: Region  # (n,)
    areas: "_Frames"  # (n,) of the regions
    every: Solids  # (N,)
    counts: jax.Array  # (n, N) bool, which count for which
    need: jax.Array  # (n, N) how far their rectangles must be apart
    touch: jax.Array  # (n, N) how far they are where they touch
    inner: jax.Array  # (n, 2) what a rectangle without its rounding has of its region
    blur: jax.Array  # (n,) by which rounding may move it
    room: jax.Array | None  # (n,) radius of the disc in which each must be
    rots: jax.Array | None  # (n, 2) least and most yaw in the regions
    rings: Rings | None  # (n,)


def _crowd(
    keys: jax.Array,
    solids: Solids,
    regions: Region,
    obstacles: Solids,
    ignore: jax.Array,
    rots: jax.Array | None,
    gap: jax.Array,
    margin: jax.Array,
    rings: Rings | None,
) -> _Crowd:
    """The distances to keep, from the arguments of `pack`."""
    n, eps = len(solids.radius), jnp.finfo(solids.radius.dtype).eps
    every = Solids(*(jnp.concatenate(pair) for pair in zip(solids, obstacles, strict=True)))
    counts = (solids.top[:, None] > every.bottom[None]) & (solids.bottom[:, None] < every.top[None])
    counts &= jnp.concatenate([jnp.ones((n, n), bool), ~ignore], axis=1)
    inner, blur, room = _room(solids, regions, margin)
    size = every.half.sum(-1) + every.radius
    slack = 16 * eps * (size[:n, None] + size[None] + gap)
    need = solids.radius[:, None] + every.radius[None] + gap + slack
    touch = need + slack + blur[:, None]
    areas = _frames(regions.pose)
    return _Crowd(keys, solids, regions, areas, every, counts, need, touch, inner, blur, room, rots, rings)


def _room(solids: Solids, regions: Region, margin: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array | None]:
    """`inner`, `blur` and `room` of a `_Crowd`."""
    # Rounding moves a place by less than 4 eps of its coordinates, a distance by less than 16 eps of the sizes.
    blur = 4 * jnp.finfo(solids.radius.dtype).eps * (jnp.abs(regions.pose[:, :2]) + regions.half).sum(-1)
    if regions.on is not None:
        blur = jnp.where(regions.on < 0, blur, 2 * blur.max())
    inner = regions.half - (solids.radius + margin)[:, None]
    return inner, blur, None if regions.radius is None else regions.radius - margin + blur


def fit(solids: Solids, regions: Region, margin: jax.Array, rots: jax.Array | None = None) -> jax.Array:
    """(n,) bool: a solid fits into its region where nothing else is, at the one yaw that it may have or, if it may have more, at some.

    Arguments are those of `pack`.
    """
    half, (inner, blur, room) = solids.half, _room(solids, regions, margin)
    available = inner + blur[:, None]
    fits = _fits(half, available)
    if rots is not None:
        turned = _frames(regions.pose.at[:, 2].add(rots[:, 0]))
        at_one = jnp.all(_spread(turned, _frames(regions.pose), half) <= available, axis=-1)
        fits = jnp.where(rots[:, 0] == rots[:, 1], at_one, fits)
    if room is not None:
        fits &= jnp.hypot(*half.T) + solids.radius <= room
    return fits


def _tried(
    crowd: _Crowd, k: jax.Array, turn: jax.Array, placed: "_Frames", there: jax.Array
) -> tuple["_Frames", jax.Array]:
    """Candidates (C,) of the k-th solid in a round, and (C,) bool, those that are inside its region and clear of all that is `there`."""
    solids, regions, every, rings = crowd.solids, crowd.regions, crowd.every, crowd.rings
    area, half, count = jax.tree.map(lambda a: a[k], crowd.areas), solids.half[k], crowd.counts[k] & there
    carrier, carried = area, jnp.array(False)
    if regions.on is not None:
        carried, count = regions.on[k] >= 0, count & (jnp.arange(len(every.radius)) != regions.on[k])
        on = regions.on[k]
        carrier = jax.tree.map(lambda a: a[on], placed)
        area = jax.tree.map(lambda a, b: jnp.where(carried, a, b), _composed(carrier, area), area)
    draw = jax.random.uniform(jax.random.fold_in(crowd.keys[k], turn), (CANDIDATES, 4), DRAWN, -1.0)
    outline = every.half + crowd.touch[k, :, None]
    rots = None if crowd.rots is None else crowd.rots[k]
    inner, snug = crowd.inner[k], turn >= SNUG
    candidates = _candidates(draw.astype(inner.dtype), snug, area, inner, half, placed, outline, count, rots)
    local = jnp.abs(_into(area, candidates.x, candidates.y))
    free = jnp.all(local <= inner[None] - _spread(candidates, area, half) + crowd.blur[k], axis=-1)
    one, others = jax.tree.map(lambda a: a[:, None], candidates), jax.tree.map(lambda a: a[None], placed)
    clear = _clear(one, half, others, every.half[None], crowd.need[None, k])
    free &= jnp.all(clear | ~count[None], axis=-1)
    if regions.on is not None:
        free &= ~carried | there[regions.on[k]]
    if crowd.room is not None:
        middle = jnp.abs(_into(candidates, carrier.x, carrier.y)) + half[None]
        free &= ~carried | (jnp.hypot(middle[:, 0], middle[:, 1]) + solids.radius[k] <= crowd.room[k])
    if rings is not None:
        away = jnp.hypot(candidates.x - rings.center[k, 0], candidates.y - rings.center[k, 1])
        free &= (away >= rings.least[k]) & (away <= rings.most[k])
    return candidates, free


def in_place(solids: Solids, regions: Region, gap: jax.Array | float = 0.0) -> tuple[jax.Array, jax.Array]:
    """Whether solids stand as `pack` would have placed them, by their poses.

    Args:
        solids: (n,) that stand.
        regions: (n,) where each must stay.
        gap: smallest distance.

    Returns:
        (n,) bool, inside the region, and (n, n) bool, apart; what is absent is both.
    """
    frames, areas = _frames(solids.pose), _frames(regions.pose)
    eps = jnp.finfo(solids.radius.dtype).eps
    blur = 8 * eps * (jnp.abs(regions.pose[:, :2]) + regions.half).sum(-1)
    room = regions.half - solids.radius[:, None] - _spread(frames, areas, solids.half) + blur[:, None]
    inside = jnp.all(jnp.abs(_into(areas, frames.x, frames.y)) <= room, axis=-1)
    clear = apart(solids, solids, gap) | jnp.eye(len(solids.radius), dtype=bool)
    return inside | ~solids.present, clear | ~(solids.present[:, None] & solids.present[None])


def apart(solids: Solids, others: Solids, gap: jax.Array | float = 0.0) -> jax.Array:
    """(n, m) bool: solids (n,) are farther than `gap` from others (m,), seen from above; presence and heights do not count."""
    frames, theirs = _frames(solids.pose), _frames(others.pose)
    need = solids.radius[:, None] + others.radius[None] + gap

    def clear(one: _Frames, half: jax.Array, need: jax.Array) -> jax.Array:
        return _clear(jax.tree.map(lambda a: a[None], one), half, theirs, others.half, need)

    return jax.vmap(clear)(frames, solids.half, need)


class _Frames(NamedTuple):
    """Places and directions in the world."""

    x: jax.Array  # (...)
    y: jax.Array
    yaw: jax.Array
    c: jax.Array  # cosine of the yaw
    s: jax.Array


def _frames(pose: jax.Array) -> _Frames:
    """Frames (...) of poses (..., 3)."""
    x, y, yaw = jnp.moveaxis(pose, -1, 0)
    return _Frames(x, y, yaw, jnp.cos(yaw), jnp.sin(yaw))


def _composed(frame: _Frames, local: _Frames) -> _Frames:
    """A frame that is given in another one, in the world."""
    yaw = frame.yaw + local.yaw
    return _Frames(*_out(frame, local.x, local.y), yaw, jnp.cos(yaw), jnp.sin(yaw))


def _out(frame: _Frames, x: jax.Array, y: jax.Array) -> tuple[jax.Array, jax.Array]:
    """World coordinates (...) of points of a frame."""
    return frame.x + (frame.c * x - frame.s * y), frame.y + (frame.s * x + frame.c * y)


def _into(frame: _Frames, x: jax.Array, y: jax.Array) -> jax.Array:
    """Points (..., 2) of the world in a frame."""
    x, y = x - frame.x, y - frame.y
    return jnp.stack([frame.c * x + frame.s * y, frame.c * y - frame.s * x], axis=-1)


def _candidates(
    draw: jax.Array,
    snug: jax.Array,
    area: _Frames,
    inner: jax.Array,
    half: jax.Array,
    placed: _Frames,
    outline: jax.Array,
    count: jax.Array,
    rots: jax.Array | None,
) -> _Frames:
    """Candidates (C,) of a solid.

    Those that are snug touch the region's edge, or the neighbour nearest to a random point. They are parallel to what they touch if
    `rots` allow it.

    Args:
        draw: (C, 4) uniform in [-1, 1).
        snug: () bool.
        area: () the region.
        inner: (2,) its half sides, for the rectangle without its rounding.
        half: (2,) half sides of the rectangle.
        placed: (N,) other solids.
        outline: (N, 2) their half sides, grown by the distance to keep.
        count: (N,) bool, which of them count.
        rots: (2,) least and most yaw in the region.
    """
    spot, angle, choice = draw[:, :2], draw[:, 2], draw[:, 3]
    x, y = _out(area, *(spot * inner[None]).T)
    dx, dy = placed.x[None] - x[:, None], placed.y[None] - y[:, None]
    nearest = jnp.argmin(jnp.where(count[None], dx * dx + dy * dy, jnp.inf), axis=-1)
    beside = snug & count[nearest] & (choice < 0)
    base = jax.tree.map(lambda other, own: jnp.where(beside, other[nearest], own), placed, area)
    turn = jnp.pi * jnp.where(snug, jnp.floor(2 * angle) / 2, angle)
    yaw = jnp.remainder(base.yaw + turn + jnp.pi, 2 * jnp.pi) - jnp.pi
    if rots is not None:
        width = rots[1] - rots[0]
        eps = 16 * jnp.finfo(draw.dtype).eps
        past = jnp.remainder(yaw - area.yaw - rots[0] + eps, 2 * jnp.pi)
        parallel = snug & (width > 0) & (past <= width + 2 * eps)
        yaw = jnp.where((width >= FULL_TURN) | parallel, yaw, area.yaw + rots[0] + width * (angle + 1) / 2)
    turned = base._replace(yaw=yaw, c=jnp.cos(yaw), s=jnp.sin(yaw))

    # In the base's frame: anywhere in the region's room, or moved along a ray to its edge or the neighbour's outline.
    spread = _spread(turned, base, half)
    reach = jnp.where(beside[:, None], outline[nearest] + spread, jnp.maximum(inner[None] - spread, 0))
    tiny = jnp.finfo(draw.dtype).tiny
    spot = jnp.where(beside[:, None], _into(base, x, y) / jnp.maximum(reach, tiny), spot)
    spot = jnp.where(snug, spot / jnp.maximum(jnp.abs(spot).max(-1, keepdims=True), tiny), spot)
    x, y = _out(base, *(spot * reach).T)
    return turned._replace(x=x, y=y)


def _spread(turned: _Frames, base: _Frames, half: jax.Array) -> jax.Array:
    """Half extents (..., 2) along the axes of a base of rectangles (..., 2) that are turned."""
    c = jnp.abs(turned.c * base.c + turned.s * base.s)[..., None]
    s = jnp.abs(turned.s * base.c - turned.c * base.s)[..., None]
    half = half[(None,) * (c.ndim - half.ndim)]
    return c * half + s * half[..., ::-1]


def _fits(half: jax.Array, room: jax.Array) -> jax.Array:
    """Whether rectangles fit into others (n,) at some yaw (Carver 1957).

    Args:
        half: (n, 2) of the rectangles.
        room: (n, 2) of the others.
    """
    p, q, a, b = half.max(-1), half.min(-1), room.max(-1), room.min(-1)
    square = p * p + q * q
    diagonal = b * square >= 2 * p * q * a + (p * p - q * q) * jnp.sqrt(jnp.maximum(square - a * a, 0))
    return (q <= b) & ((p <= a) | diagonal)


def _clear(one: _Frames, half: jax.Array, others: _Frames, halves: jax.Array, need: jax.Array) -> jax.Array:
    """Whether a rectangle at some places is farther from others than `need`, (..., n).

    Two rectangles are as far apart as the other's centre is from the octagon that is the sum of the two around the
    one's. A pair of its sides runs along each of the four axes; the nearest is one that faces the centre.

    Args:
        one: (..., 1)
        half: (2,) half sides of the rectangle.
        others: (..., n)
        halves: (..., n, 2) half sides of the others.
        need: (..., n)
    """
    (a, b), (p, q) = half, (halves[..., 0], halves[..., 1])
    c, s = one.c * others.c + one.s * others.s, one.c * others.s - one.s * others.c  # of the others' turn
    dx, dy = others.x - one.x, others.y - one.y
    u, v = one.c * dx + one.s * dy, one.c * dy - one.s * dx
    w, z = others.c * dx + others.s * dy, others.c * dy - others.s * dx
    sign = jnp.where((c < 0) == (s < 0), 1, -1)  # parallel axes: their two sides make one, each has the other's rest
    c, s = jnp.abs(c), jnp.abs(s)

    def side(across: jax.Array, along: jax.Array, reach: jax.Array, middle: jax.Array, length: jax.Array) -> tuple:
        """Distance (n,) past a facing side's line, and squared to the side."""
        past = jnp.abs(across) - reach
        beside = jnp.maximum(jnp.abs(jnp.where(across < 0, -along, along) - middle) - length, 0)
        return past, past * past + beside * beside

    sides = (
        side(u, v, a + c * p + s * q, sign * (s * p - c * q), b),
        side(v, u, b + s * p + c * q, sign * (c * p - s * q), a),
        side(w, z, p + c * a + s * b, sign * (c * b - s * a), q),
        side(z, w, q + s * a + c * b, sign * (s * b - c * a), p),
    )
    past, square = zip(*sides, strict=True)
    return (functools.reduce(jnp.maximum, past) > 0) & (functools.reduce(jnp.minimum, square) > need * need)
