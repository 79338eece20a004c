"""The heights at which an arm's tool, pointing down, reaches places: found once for an arm by inverse kinematics."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas.envs.arms.arm import Arm
from mjx_arenas.envs.arms.graspable import SLACK
from mjx_arenas.envs.arms.moves import HEIGHTS, Moves, reached

SPACING = 0.02  # [m] of the heights and, at most, the distances that are tried
FURTHEST = 2.0  # [m] above and below the base
_FOUND: dict[bytes, "Heights"] = {}  # by all that decides them; a few numbers each


class Heights(NamedTuple):
    """Where the tool goes at distances from the arm's base, above the base [m] (host)."""

    distances: np.ndarray
    """(D,) horizontal, over the arm's `reach`."""
    low: np.ndarray
    """(D,) the lowest height."""
    high: np.ndarray
    """(D,) the highest."""

    def within(self, distance: jax.Array, height: jax.Array) -> jax.Array:
        """(...) bool: the tool goes to this height at this distance; a distance beyond all counts as the last one; jit, vmap."""
        low, high = (jnp.interp(distance, self.distances, x) for x in (self.low, self.high))
        return (height >= low - SLACK) & (height <= high + SLACK)


def heights(arm: Arm, moves: Moves) -> Heights:
    """The heights that an arm reaches, in a row from those that its `reach` promises (`moves.HEIGHTS`), which always count.

    Inverse kinematics go to places on the base's x axis, every 2 cm along it and in height, with the tool along or across it. Contacts and
    forces do not count. At these distances an arm reaches up to 2 cm more than what is found. Between them heights are interpolated.
    """
    key = b"|".join(np.asarray(x).tobytes() for x in (*moves.links[1:], *moves[1:], arm.reach, arm.rise))
    if key not in _FOUND:
        _FOUND[key] = _found(arm, moves)
    return _FOUND[key]


def _found(arm: Arm, moves: Moves) -> Heights:
    low, high = (height - arm.rise for height in HEIGHTS)
    distances = np.linspace(*arm.reach, int(np.ceil((arm.reach[1] - arm.reach[0]) / SPACING)) + 1)
    middle = (low + high) / 2
    count = int(np.ceil((min(_length(moves), FURTHEST) + abs(middle)) / SPACING))
    levels = middle + SPACING * np.arange(-count, count + 1)
    distance, height, yaw = (x.ravel() for x in np.meshgrid(distances, levels, (0.0, np.pi / 2), indexing="ij"))
    misses = moves.misses(np.stack([distance, np.zeros_like(distance), height], axis=-1), yaw)
    goes = reached(misses).reshape(len(distances), len(levels), 2).any(-1)
    goes |= (levels >= low) & (levels <= high)
    # How many levels there are in a row below the middle, and above it.
    down, up = (np.cumprod(x, axis=1).sum(1) for x in (goes[:, count - 1 :: -1], goes[:, count + 1 :]))
    return Heights(distances, np.minimum(levels[count - down], low), np.maximum(levels[count + up], high))


def _length(moves: Moves) -> float:
    """A distance from its base beyond which no tool goes, infinite with a slide that has no limits [m]."""
    links = moves.links
    bodies, anchors = (np.linalg.norm(x, axis=-1).sum() for x in (links.pos, links.anchor))
    slides = np.abs(moves.limits - links.zero).max(0)[~links.turns].sum()
    return float(bodies + 2 * anchors + slides)
