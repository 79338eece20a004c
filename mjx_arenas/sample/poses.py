"""The poses in which objects rest: which one is there, and how large the object is as it lies (NumPy or JAX, one world at a time).

K objects, V variants of one of them (1 of an object without), P poses of that which has the most.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from mjx_arenas import geometry, shapes
from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.distributions import Choice
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.sample.variants import Variants, nearest, of_chosen, which

RESTING = "resting"
UPRIGHT = "upright"


class Poses(NamedTuple):
    """The poses in which one object rests, for each of its variants (host)."""

    object: int  # its index
    quantity: str  # name of the quantity that says which one is there
    kind: np.ndarray  # (V,) types
    n_poses: np.ndarray  # (V,) how many poses there are
    share: np.ndarray  # (V, P) how likely each is, nominally
    quat: np.ndarray  # (V, P, 4) how the object is turned from upright, before its yaw
    center: np.ndarray  # (V, P, 3) middle of the extents from the object's origin, along axes that this turned [m]
    full_size: np.ndarray  # (V, P, 3) extents along these axes, of what has one size [m] ...
    axes: np.ndarray  # (V, P, 3, 3) ... plus these rows times the object's own extents
    outline: np.ndarray  # (V, P) the shape whose footprint it has


class Pose(NamedTuple):
    """A pose in which an object rests."""

    share: float
    """Probability of this pose after a toss, at the nominal size."""
    quat: np.ndarray
    """(4,) quaternion from upright to this pose, before the yaw of the object."""
    full_size: np.ndarray
    """(3,) nominal extents of the object along axes that `quat` turned [m]."""


class Lying(NamedTuple):
    """How objects lie in one world."""

    tilt: Array  # (K, 4) quaternions: how they are turned from upright, before their yaws
    full_size: Array  # (K, 3) extents along axes that this turned [m]
    center: Array  # (K, 3) middles of these from the objects' origins [m]
    half: Array  # (K, 2) half sides of the rectangles with rounded corners that objects cover [m]
    radius: Array  # (K,) of the corners [m]


def lying(
    poses: Sequence[Poses],
    variants: Sequence[Variants],
    params: ArenaParams,
    kind: np.ndarray,
    tilt: Array,
    center: Array,
) -> Lying:
    """How the objects lie.

    Args:
        poses: of the objects that have some.
        variants: of the objects that have some.
        params: of one world.
        kind: (K,) types.
        tilt: (K, 4) of the others.
        center: (K, 3) of the others.
    """
    sizes = params.object_full_sizes
    center = of_chosen(variants, params.terms, "center", center)
    half, radius = shapes.footprint(kind, sizes)
    for one in variants:
        own = shapes.footprint(one.kind, np.asarray(one.full_size))
        chosen = which(one, params.terms)
        half, radius = (
            geometry.with_row(x, one.object, array_module(x, chosen).asarray(part, sizes.dtype)[chosen])
            for x, part in zip((half, radius), own, strict=True)
        )
    found = Lying(tilt, sizes, center, half, radius)
    for one in poses:
        found = Lying(
            *(geometry.with_row(x, one.object, row) for x, row in zip(found, _lies(one, variants, params), strict=True))
        )
    return found


def sizes(poses: Sequence[Poses], variants: Sequence[Variants], params: ArenaParams) -> Array:
    """(K, 3) extents of the objects as they lie [m]."""
    found = params.object_full_sizes
    for one in poses:
        found = geometry.with_row(found, one.object, _lies(one, variants, params)[1])
    return found


def listed(one: Poses, variant: int, full_size: np.ndarray) -> tuple[Pose, ...]:
    """The poses of one variant, whose own extents are (3,) (host)."""
    rows = range(int(one.n_poses[variant]))
    size = one.full_size[variant] + one.axes[variant] @ full_size
    return tuple(Pose(float(one.share[variant, i]), one.quat[variant, i].copy(), size[i]) for i in rows)


def of_variant(one: Poses, variant: int) -> Poses:
    """The poses of an object that is this variant and no other (host)."""
    return Poses(one.object, one.quantity, *(x[[variant]] for x in one[2:]))


def _lies(one: Poses, variants: Sequence[Variants], params: ArenaParams) -> tuple[Array, Array, Array, Array, Array]:
    """The numbers of `Lying` of one object."""
    size = params.object_full_sizes[one.object]
    xp, n = array_module(size), one.quat.shape[1]
    index = _variant(one, variants, params.terms) * n + pose(one, variants, params.terms)

    def chosen(values: np.ndarray) -> Array:
        values = np.asarray(values.reshape(-1, *values.shape[2:]), size.dtype if values.dtype.kind == "f" else None)
        return geometry.pick(xp.asarray(values), xp.asarray(index)[None])[0]

    extents = chosen(one.full_size) + (chosen(one.axes) * size[None]).sum(-1)
    outlines, code = np.unique(one.outline, return_inverse=True)
    half, radius = shapes.footprint(outlines, xp.broadcast_to(extents[None], (len(outlines), 3)))
    is_this = np.arange(len(outlines)) == chosen(code.reshape(one.outline.shape))
    half, radius = (is_this[:, None] * half).sum(0), (is_this * radius).sum(0)
    return chosen(one.quat), extents, chosen(one.center), half, radius


def _variant(one: Poses, variants: Sequence[Variants], terms: Mapping[str, Array]) -> Array | int:
    """() index of the variant that is there."""
    return next((which(v, terms) for v in variants if v.object == one.object), 0)


def _count(one: Poses, variants: Sequence[Variants], terms: Mapping[str, Array]) -> Array:
    """() how many poses the object has."""
    variant = _variant(one, variants, terms)
    return array_module(variant).asarray(one.n_poses)[variant]


def pose(one: Poses, variants: Sequence[Variants], terms: Mapping[str, Array]) -> Array:
    """() index of the pose that is there; of a number that is none, the nearest."""
    return nearest(terms[one.quantity][0], _count(one, variants, terms))


def right(one: Poses, variants: Sequence[Variants], terms: Mapping[str, Array]) -> Array:
    """() bool: the object, or its variant that is there, has such a pose."""
    return terms[one.quantity][0] < _count(one, variants, terms)


def shares(one: Poses, variants: Sequence[Variants], params: ArenaParams) -> Array:
    """(P,) how likely each pose is at the size that the object has."""
    variant, size = _variant(one, variants, params.terms), params.object_full_sizes[one.object]
    xp = array_module(size)
    if len(one.kind) > 1 or one.kind[0] not in shapes.RESTS:
        return xp.asarray(one.share, size.dtype)[variant]
    return shapes.rest_shares(str(one.kind[0]), size)


def tossed(
    ranges: ArenaRanges, poses: Sequence[Poses], variants: Sequence[Variants], params: ArenaParams
) -> ArenaRanges:
    """The ranges with the probabilities of poses in this world.

    A `Choice` without `p` takes the share of each pose as its probability. Values that are no pose of the variant get 0.
    """
    terms: dict[str, Any] = {}
    for one in poses:
        dist = ranges.terms.get(one.quantity)
        if isinstance(dist, Choice):
            values = jnp.asarray(dist.values, float)
            index = nearest(values, one.quat.shape[1])
            p = jnp.asarray(shares(one, variants, params))[index] if dist.p is None else jnp.asarray(dist.p)
            possible = p * (values < _count(one, variants, params.terms))
            total = possible.sum()
            p = jnp.where(total > 0, possible / jnp.where(total > 0, total, 1.0), 1 / len(values))
            terms[one.quantity] = dataclasses.replace(dist, p=p)
    return ranges._replace(terms={**ranges.terms, **terms}) if terms else ranges
