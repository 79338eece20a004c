"""What goes wrong in worlds, step by step: the same rules for every engine.

W worlds, K objects. NumPy (C MuJoCo) or JAX (MJX): nothing raises, nothing goes to the host. Contacts that a step finds
are those of the state before it.
"""

import functools
import operator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas import geometry, primitives
from mjx_arenas.furniture.surfaces import Surfaces
from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import ArenaParams, each
from mjx_arenas.quaternions import quat_rotate
from mjx_arenas.sample import tops as grounds

# Penetration, as a share of the smaller half extent of the two geoms, that is deep. Bodies at rest sink by one to four
# hundredths; from 1 on the middle of one is inside the other, and contacts push it out of the wrong side.
DEEP = 0.25
# The solver gave up where an object does not accelerate as the forces of its constraints say, by more than half of both and
# a tenth of gravity, in steps in a row that add up to what gravity gives in 0.02 s [m/s]: limits of its iterations that
# training uses leave less open at an impact, for a step.
OPEN, LEAST, LOST = 0.5, 1.0, 0.2
NEVER = int(np.iinfo(np.int32).max)  # the step of what has not happened


NOTHING = grounds.Ground()
"""No surfaces beside tables."""


class Tops(NamedTuple):
    """The surface to which each object belongs."""

    pos: Array  # (W, K, 3) middle of its table's top, in the world [m]
    rot: Array  # (W, K) the table's yaw [rad]
    half: Array  # (W, K, 2) half sides of the top [m]
    there: Array  # (W, K) bool: the object is in this world
    center: Array  # (W, K, 3) middle of the object's extents, in its own frame [m]


class Now(NamedTuple):
    """What a step shows."""

    finite: Array  # (W,) bool
    dropped: Array  # (W,) bool: contacts were dropped
    needed: Array  # () room for contacts of a world that would have been enough
    share: Array  # (W,) largest penetration as a share of the smaller half extent
    depth: Array  # (W,) of the same contact [m]
    pair: Array  # (W, 2) its geoms
    outside: Array  # (W, K) how far the object's middle is outside its table's edges [m]
    below: Array  # (W, K) how far it is below its table's top [m]
    lost: Array | float = 0.0  # (W, K) velocity that the solver left it without, see `lost_velocity` [m/s]


class Seen(NamedTuple):
    """What was seen so far: steps count from 1, `NEVER` is what was not."""

    step: Array  # ()
    not_finite: Array  # (W,) first steps, as the next five
    dropped: Array  # (W,)
    deep: Array  # (W,)
    through: Array  # (W, K) through its table: below the top before it was outside the edges
    off: Array  # (W, K) off its table
    unsolved: Array  # (W, K) the solver gave up
    needed: Array  # () largest of all steps
    deep_pair: Array  # (W, 2) geoms of the contact that was first deep
    share: Array  # (W,) of the deepest contact of all steps, as the next three
    depth: Array  # (W,)
    pair: Array  # (W, 2)
    deepest: Array  # (W,) its step; 0 where there was none
    outside: Array  # (W, K) farthest, since it is off
    below: Array  # (W, K) farthest, since it is through
    lost: Array  # (W, K) velocity lost in the last steps in a row, as long as some is [m/s]
    most_lost: Array  # (W, K) largest of that


def tops(params: ArenaParams, center: np.ndarray, ground: grounds.Ground = NOTHING) -> Tops:
    """The surfaces to which the objects of worlds (W, ...) belong, or what carries them (host).

    The middles of the objects' extents are `center` (W, K, 3) or (K, 3) [m].
    """

    def one(p: ArenaParams) -> tuple[Surfaces, jax.Array]:
        return grounds.surfaces(p, ground).of(grounds.roots(p, ground)), grounds.present(p, ground)[1]

    below, there = jax.tree.map(np.asarray, jax.jit(jax.vmap(one))(each(jnp.asarray, params)))
    center = np.broadcast_to(np.asarray(center, below.top.dtype), below.top.shape)
    return Tops(below.top, below.rot, below.size / 2, there, center)


def is_finite(*values: Array) -> Array:
    """(W,) bool: no number of `values` (W, n) is NaN or beyond what MuJoCo calls bad."""
    return functools.reduce(operator.and_, ((abs(x) < mujoco.mjMAXVAL).all(-1) for x in values))


def half_extents(kind: np.ndarray, size: Array) -> Array:
    """(..., G) smallest half extent of geoms of types (G,) and sizes (..., G, 3) [m]; infinite for planes."""
    xp, mesh = array_module(size), kind == mujoco.mjtGeom.mjGEOM_MESH
    half = xp.where(mesh[:, None], size, primitives.around(kind, size)[0]).min(-1)
    return xp.where(mesh | np.isin(kind, primitives.PRIMITIVES), half, np.inf)


def out_of_place(tops: Tops, pos: Array, quat: Array) -> tuple[Array, Array]:
    """(W, K), (W, K) how far the middles of objects are outside their tables' edges and below the tops [m].

    Args:
        tops: where the objects belong.
        pos: (W, K, 3) of their origins.
        quat: (W, K, 4) their orientations.
    """
    middle = pos + quat_rotate(quat, tops.center)
    outside = geometry.beyond(tops.pos, tops.rot, 2 * tops.half, middle[..., :2]).max(-1)
    return outside, tops.pos[..., 2] - middle[..., 2]


def rigid(model: mujoco.MjModel, bodies: np.ndarray) -> np.ndarray:
    """(K,) bool: nothing that hangs on a free body has a joint (host)."""
    root = model.body_rootid[model.dof_bodyid]
    return (root == np.asarray(bodies)[:, None]).sum(1) == 6


def lost_velocity(quat: Array, arm: Array, mass: Array, gained: Array, force: Array, timestep: Array | float) -> Array:
    """(...) velocity [m/s] that rigid free bodies should have got in a step from their constraints, or should not.

    The solver has come to an end where these accelerate a body as their forces do. Counted is what is wide of that.

    Args:
        quat: (..., 4) orientations.
        arm: (..., 3) from their origins to their centres of mass, in the world [m].
        mass: (...) [kg]; of what is absent, 0.
        gained: (..., 6) what constraints add to the acceleration of their free joints.
        force: (..., 3) sum of the forces of their constraints, in the world [N].
        timestep: [s].
    """
    xp = array_module(quat, gained, force)
    got = gained[..., :3] + xp.cross(quat_rotate(quat, gained[..., 3:]), arm)
    due = force / xp.where(mass > 0, mass, 1.0)[..., None]
    error, *sizes = (((x * x).sum(-1)) ** 0.5 for x in (got - due, got, due))
    wide = (mass > 0) & (error > OPEN * xp.maximum(*sizes)) & (error > LEAST)
    return xp.where(wide, error * timestep, 0.0)


def nothing(n_worlds: int, n_objects: int, dtype: np.dtype | type = float) -> Seen:
    """Before the first step (host)."""
    worlds, objects = (n_worlds,), (n_worlds, n_objects)
    never, nevers = np.full(worlds, NEVER, np.int32), np.full(objects, NEVER, np.int32)
    zero, zeros, none = np.zeros(worlds, dtype), np.zeros(objects, dtype), np.int32(0)
    pair, step = np.zeros((n_worlds, 2), np.int32), np.zeros(worlds, np.int32)
    contacts = (pair, zero, zero, pair, step)
    return Seen(none, never, never, never, nevers, nevers, nevers, none, *contacts, zeros, zeros, zeros, zeros)


def update(seen: Seen, now: Now, there: Array) -> tuple[Seen, Array]:
    """What is seen after one more step, and (W,) bool: nothing has gone wrong so far.

    What happens after numbers were not finite means nothing, and is not counted.
    """
    xp = array_module(now.depth, now.below)
    step = seen.step + np.int32(1)

    def first(before: Array, happens: Array) -> Array:
        return xp.where((before == NEVER) & happens, step, before)

    going = seen.not_finite == NEVER  # the state before this step, whose contacts are these
    not_finite = first(seen.not_finite, ~now.finite)
    dropped = first(seen.dropped, going & now.dropped)
    deeper = going & (now.share > seen.share)
    deep = first(seen.deep, going & (now.share > DEEP))

    on = (seen.off == NEVER) & (seen.through == NEVER) & there & (not_finite == NEVER)[:, None]
    off = first(seen.off, on & (now.outside > 0))
    through = first(seen.through, on & (now.outside <= 0) & (now.below > 0))
    judged = (not_finite == NEVER)[:, None]
    outside = xp.where(judged & (off != NEVER), xp.maximum(seen.outside, now.outside), seen.outside)
    below = xp.where(judged & (through != NEVER), xp.maximum(seen.below, now.below), seen.below)

    lost = xp.where(judged & there & (now.lost > 0), seen.lost + now.lost, xp.zeros_like(seen.lost))
    unsolved = first(seen.unsolved, lost > LOST)

    good = (not_finite == NEVER) & (dropped == NEVER) & (deep == NEVER)
    good &= ((off == NEVER) & (through == NEVER) & (unsolved == NEVER)).all(-1)
    share, depth = xp.where(deeper, now.share, seen.share), xp.where(deeper, now.depth, seen.depth)
    pair, deepest = xp.where(deeper[:, None], now.pair, seen.pair), xp.where(deeper, step, seen.deepest)
    deep_pair = xp.where((deep == step)[:, None], now.pair, seen.deep_pair)
    needed = xp.maximum(seen.needed, now.needed)
    found = (step, not_finite, dropped, deep, through, off, unsolved, needed)
    contacts = (deep_pair, share, depth, pair, deepest)
    return Seen(*found, *contacts, outside, below, lost, xp.maximum(seen.most_lost, lost)), good
