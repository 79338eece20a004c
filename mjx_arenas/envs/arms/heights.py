"""The heights at which an arm's tool, pointing down, reaches places: found once for an arm by inverse kinematics."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas.envs.arms import chain
from mjx_arenas.envs.arms.arm import Arm
from mjx_arenas.envs.arms.graspable import SLACK
from mjx_arenas.envs.arms.moves import HEIGHTS, Moves, reached

SPACING = 0.02  # [m] of the heights and, at most, the distances that are tried
FURTHEST = 2.0  # [m] above and below the base
COARSE = 0.05  # [m] of the places of `Anywhere`
_FOUND: dict[bytes, "Heights"] = {}  # by all that decides them; a few numbers each
_ANYWHERE: dict[bytes, "Anywhere"] = {}  # likewise; a thousand truths each


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
    key = _key(arm, moves)
    if key not in _FOUND:
        _FOUND[key] = _found(arm, moves)
    return _FOUND[key]


class Anywhere(NamedTuple):
    """Where the tool may go at all, nearer and further than the arm's `reach`, too, about the base (host)."""

    goes: np.ndarray
    """(D, L) bool, every 5 cm, at distances from 0 on and heights from `lowest` on."""
    lowest: float
    beyond: bool
    """Whether it may go to other places than these."""

    def at(self, distance: jax.Array, height: jax.Array) -> jax.Array:
        """(...) bool: the tool may go to this height at this distance; jit, vmap."""
        i, j = (jnp.round(x / COARSE).astype(int) for x in (distance, height - self.lowest))
        inside = (i < len(self.goes)) & (j >= 0) & (j < self.goes.shape[1])
        return jnp.where(inside, jnp.asarray(self.goes)[i, j], self.beyond)  # indices outside are clipped


def anywhere(arm: Arm, moves: Moves) -> Anywhere:
    """The places that an arm reaches, or that are less than 7.5 cm beside such a place, or between two above each other.

    Inverse kinematics go to places ahead, behind and on both sides, every 5 cm, with the tool along or across the way there. All that its
    `reach` promises counts, too, and of an arm that slides all that its length allows.
    """
    key = _key(arm, moves)
    if key not in _ANYWHERE:
        _ANYWHERE[key] = _tried(arm, moves)
    return _ANYWHERE[key]


def _tried(arm: Arm, moves: Moves) -> Anywhere:
    length = chain.length(moves.links, moves.limits)
    count = int(np.ceil(min(length, FURTHEST) / COARSE)) + 1
    distances, levels = COARSE * np.arange(count + 1), COARSE * np.arange(-count, count + 1)
    places = np.meshgrid(distances, levels, np.arange(4) * np.pi / 2, (0.0, np.pi / 2), indexing="ij")
    distance, height, heading, turn = (x.ravel() for x in places)
    at = np.stack([distance * np.cos(heading), distance * np.sin(heading), height], axis=-1)
    goes = reached(moves.misses(at, heading + turn)).reshape(len(distances), len(levels), 8).any(-1)
    low, high = (height - arm.rise for height in HEIGHTS)
    promised = (distances >= arm.reach[0]) & (distances <= arm.reach[1])
    goes |= promised[:, None] & (levels >= low) & (levels <= high)
    goes = np.maximum.accumulate(goes, 1) & np.maximum.accumulate(goes[:, ::-1], 1)[:, ::-1]
    if not moves.links.turns.all():
        goes |= np.hypot(distances[:, None], levels) <= length
    wide = np.pad(goes, 1)
    goes = np.any([wide[i : i + len(distances), j : j + len(levels)] for i in range(3) for j in range(3)], axis=0)
    return Anywhere(goes, float(levels[0]), length > FURTHEST)


def _key(arm: Arm, moves: Moves) -> bytes:
    """All that decides where an arm goes."""
    return b"|".join(np.asarray(x).tobytes() for x in (*moves.links[1:], *moves[1:], arm.reach, arm.rise))


def _found(arm: Arm, moves: Moves) -> Heights:
    low, high = (height - arm.rise for height in HEIGHTS)
    distances = np.linspace(*arm.reach, int(np.ceil((arm.reach[1] - arm.reach[0]) / SPACING)) + 1)
    middle = (low + high) / 2
    count = int(np.ceil((min(chain.length(moves.links, moves.limits), FURTHEST) + abs(middle)) / SPACING))
    levels = middle + SPACING * np.arange(-count, count + 1)
    distance, height, yaw = (x.ravel() for x in np.meshgrid(distances, levels, (0.0, np.pi / 2), indexing="ij"))
    misses = moves.misses(np.stack([distance, np.zeros_like(distance), height], axis=-1), yaw)
    goes = reached(misses).reshape(len(distances), len(levels), 2).any(-1)
    goes |= (levels >= low) & (levels <= high)
    # How many levels there are in a row below the middle, and above it.
    down, up = (np.cumprod(x, axis=1).sum(1) for x in (goes[:, count - 1 :: -1], goes[:, count + 1 :]))
    return Heights(distances, np.minimum(levels[count - down], low), np.maximum(levels[count + up], high))
