"""Room for contacts and constraint rows on Warp: what can touch at once in one world (host)."""

import collections
from collections.abc import Callable, Iterator
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco.mjx._src import collision_driver

# Contacts that a pair of geoms can have at most, where it is not the four that mujoco_warp keeps.
_SPHERE, _CAPSULE, _BOX = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_BOX
_PAIR_CONTACTS = {
    frozenset({_SPHERE}): 1,
    frozenset({_SPHERE, mujoco.mjtGeom.mjGEOM_PLANE}): 1,
    frozenset({_SPHERE, _CAPSULE}): 1,
    frozenset({_SPHERE, _BOX}): 1,
    frozenset({_CAPSULE}): 2,
    frozenset({_CAPSULE, mujoco.mjtGeom.mjGEOM_PLANE}): 2,
    frozenset({_CAPSULE, _BOX}): 2,
}
_MAX_PAIR_CONTACTS = 4
_BOXES_CONTACTS = 8  # of two boxes without native collision detection
_FACE_CONTACTS = 64  # of two bodies that touch face to face, whatever number of geoms they have there
_NARROW = 32  # degrees of freedom up to which rows of a Jacobian are filled up to fours
_PADDED = 32  # by how much wider rows are filled up at most
_TABLES = 4  # tops side by side meet in fours
_PIECES = (
    6  # of furniture that a body touches: a corner of a shelf has three, and where two parts abut are twice as many
)
_NEIGHBOURS = 6  # touching pairs a body in the densest heap of balls: each of twelve neighbours is shared by two


class Room(NamedTuple):
    """What one world is given room for on Warp."""

    contacts: int
    pairs: int
    """Pairs of geoms whose contacts are searched at once; Warp keeps 3 kB for each."""


def _pairs(mj_model: mujoco.MjModel) -> Iterator[tuple[int, int, int]]:
    """Pairs of geoms that may collide, each with the contacts that it can have."""
    boxes = _BOXES_CONTACTS if mj_model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_NATIVECCD else _MAX_PAIR_CONTACTS
    of = {**_PAIR_CONTACTS, frozenset({_BOX}): boxes}
    for a, b, _ in collision_driver.geom_pairs(mj_model):
        kind = frozenset({mujoco.mjtGeom(mj_model.geom_type[a]), mujoco.mjtGeom(mj_model.geom_type[b])})
        yield a, b, of.get(kind, _MAX_PAIR_CONTACTS)


def all_contacts(mj_model: mujoco.MjModel) -> int:
    """Contacts of all pairs of geoms that may collide, as if all touched."""
    return max(1, sum(contacts for _, _, contacts in _pairs(mj_model)))


def room_for(mj_model: mujoco.MjModel, n_contacts: int) -> Room:
    """Room for a number of contacts, of whatever pairs they are."""
    return Room(n_contacts, max(1, sum(1 for _ in _pairs(mj_model))))


def at_once(mj_model: mujoco.MjModel, slabs: np.ndarray, pieces: np.ndarray, variants: np.ndarray) -> Room:
    """What one world is given room for: what can touch at once.

    A body may touch four of the tables, six pieces of furniture, all else that is fixed, and in a heap others at six pairs a body. One body
    may also touch all pieces of furniture, at a face of each, like a plank that lies across a row of counters. More is possible in theory
    (a body across five tables, two long planks, a heap of small bodies on a large one): `capacity` tells.

    Args:
        mj_model: the arena.
        slabs: geoms of tables on which things stand.
        pieces: geoms of furniture.
        variants: (ngeom,) the variant that each geom is of, of which a body has one at a time; -1: of none.
    """
    few = _Few(frozenset(slabs.tolist()), frozenset(pieces.tolist()))
    return Room(_sum(mj_model, few, variants, lambda contacts: contacts), _sum(mj_model, few, variants, lambda _: 1))


class _Few(NamedTuple):
    """Fixed geoms of which a body touches few at once."""

    slabs: frozenset[int]
    pieces: frozenset[int]


def _sum(mj_model: mujoco.MjModel, few: _Few, variants: np.ndarray, weight: Callable[[int], int]) -> int:
    """Sum of `weight` of the contacts of each pair of geoms, over the pairs that can touch at once."""
    fixed = mj_model.body_weldid[mj_model.geom_bodyid] == 0
    on_slabs: dict[int, list[int]] = collections.defaultdict(list)  # of each body, on each slab
    on_pieces: dict[int, list[int]] = collections.defaultdict(list)
    between: collections.Counter = collections.Counter()  # bodies that move
    total = 0
    of_each: dict[tuple[int, int], collections.Counter] = collections.defaultdict(collections.Counter)
    for a, b, contacts in _pairs(mj_model):
        first, second = sorted((a, b), key=lambda g: not fixed[g])  # what is fixed, if anything is, comes first
        bodies = mj_model.geom_bodyid[[first, second]]
        other = int(first) if fixed[first] else -1 - int(bodies[0])  # a fixed geom, or a body that moves
        chosen = tuple(sorted(variants[[first, second]].tolist()))
        of_each[other, int(bodies[1])][chosen] += weight(contacts)
    for (other, body), counts in of_each.items():
        # What is of no variant, and the pair of variants that has most.
        most = counts.pop((-1, -1), 0) + max(counts.values(), default=0)
        if other in few.slabs:
            on_slabs[body].append(min(most, _FACE_CONTACTS))
        elif other in few.pieces:
            on_pieces[body].append(min(most, _FACE_CONTACTS))
        elif other >= 0:
            total += most
        else:
            between[tuple(sorted((-1 - other, body)))] += most
    moving = {body for pair in between for body in pair}
    total += sum(sum(sorted(counts)[-_TABLES:]) for counts in on_slabs.values())
    total += sum(sum(sorted(counts)[-_PIECES:]) for counts in on_pieces.values())
    face = weight(_MAX_PAIR_CONTACTS)
    total += max((sum(min(count, face) for count in sorted(c)[:-_PIECES]) for c in on_pieces.values()), default=0)
    heap = sorted((min(count, _FACE_CONTACTS) for count in between.values()), reverse=True)
    return max(1, total + sum(heap[: _NEIGHBOURS * len(moving)]))


def max_rows(mj_model: mujoco.MjModel, n_contacts: int) -> int:
    """Constraint rows that one world can have, with `n_contacts` contacts."""
    per_contact, other = rows_each(mj_model)
    return n_contacts * per_contact + other


def most_contacts(mj_model: mujoco.MjModel, n_worlds: int) -> int:
    """The most contacts for which each of so many worlds can have room: Warp counts all contacts, and the bytes of a Jacobian, in int32."""
    most, (per_contact, other) = np.iinfo(np.int32).max, rows_each(mj_model)
    width = -(-mj_model.nv // 4) * 4 if mj_model.nv <= _NARROW else mj_model.nv + _PADDED + 1  # of a row, filled up
    rows = most // (4 * max(width, 1)) - _PADDED
    return int(max(min(most // n_worlds, (rows - other) // per_contact), 0))


def rows_each(mj_model: mujoco.MjModel) -> tuple[int, int]:
    """Constraint rows of a contact, and of all else in one world."""
    condim = int(max(mj_model.geom_condim.max(initial=3), mj_model.pair_dim.max(initial=3)))
    per_contact = 2 * (condim - 1) if mj_model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL and condim > 1 else condim
    return per_contact, 6 * mj_model.neq + 2 * mj_model.njnt + mj_model.nv + 3 * mj_model.ntendon
