"""Fixed geoms that terms move, turn or resize: the upright box around each in one world; NumPy or JAX.

M geoms, at most D frames between one and what it stands in: a table, a part, or the world.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import jax
import numpy as np

from mjx_arenas import geometry, primitives
from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.quaternions import quat_mul, quat_rotate, quat_to_mat
from mjx_arenas.rows import take

FIELDS = ("body_pos", "body_quat", "geom_pos", "geom_quat", "geom_size")
"""What decides where a fixed geom is, and how large."""


class Deciding(Protocol):
    """A term of a compiled model (`terms.term.Bound`)."""

    def rows(self, params: ArenaParams) -> Sequence[Any]:
        """The rows that it decides."""
        ...


class Moving(NamedTuple):
    """The geoms, in the frames in which they are (host)."""

    at: np.ndarray  # (M,) rows of `Fixed` that they are; -1: a level plane
    kinds: np.ndarray  # (M,) types
    points: tuple[np.ndarray | None, ...]  # (M,) corners (V, 3) of the hulls of meshes, in the geoms' frames
    numbers: np.ndarray  # (M * (7 * D + 3),) nominal positions (M, D, 3), quaternions (M, D, 4) and sizes (M, 3)
    source: np.ndarray  # of the same: where these and the terms' numbers, one after the other, have them
    terms: tuple[Deciding, ...]  # what decides them


class Boxes(NamedTuple):
    """Boxes around M geoms, as `Fixed` has them."""

    pose: Array  # (M, 3)
    half: Array  # (M, 2)
    z: Array  # (M, 2)


def deciding(term: Deciding, params: ArenaParams) -> list[Any]:
    """The rows of a term that decide where geoms are, and how large."""
    return [row for row in term.rows(params) if row.field in FIELDS]


def boxes(moving: Moving, params: ArenaParams) -> Boxes:
    """The boxes around them in one world, each turned like its geom's first axis."""
    xp, dtype = array_module(params.table_rots), params.table_rots.dtype
    decided = [row.values.reshape(-1).astype(dtype) for term in moving.terms for row in deciding(term, params)]
    every = take(xp.concatenate([xp.asarray(moving.numbers, dtype), *decided]), moving.source)
    m = len(moving.at)
    depth = (len(moving.numbers) // m - 3) // 7
    links, turns = every[: 3 * m * depth].reshape(m, depth, 3), every[3 * m * depth : 7 * m * depth]
    turns, size = turns.reshape(m, depth, 4), every[7 * m * depth :].reshape(m, 3)
    pos, quat = links[:, 0], turns[:, 0]
    for d in range(1, depth):
        pos, quat = pos + quat_rotate(quat, links[:, d]), quat_mul(quat, turns[:, d])
    axis = quat_rotate(quat, xp.asarray(np.tile([1.0, 0.0, 0.0], (m, 1)), dtype))
    yaw = xp.arctan2(axis[:, 1], axis[:, 0])
    axes = quat_to_mat(quat_mul(geometry.yaw_quat(-yaw), quat))
    reach = primitives.reach(moving.kinds, size, axes)
    low, high = -reach, reach
    for i, points in enumerate(moving.points):
        if points is not None:
            found = (axes[i][None] * xp.asarray(points, dtype)[:, None]).sum(-1)
            low, high = (geometry.with_row(x, i, y) for x, y in ((low, found.min(0)), (high, found.max(0))))
    middle = pos[:, :2] + geometry.rotate_yaw(yaw, (low + high)[:, :2] / 2)
    pose = xp.concatenate([middle, yaw[:, None]], axis=-1)
    found = Boxes(pose, (high - low)[:, :2] / 2, pos[:, 2:] + xp.stack([low[:, 2], high[:, 2]], axis=-1))
    return found if xp is np else jax.lax.optimization_barrier(found)  # or XLA computes it again wherever it is read
