"""The worlds in which episodes start: drawn anew, or from a pool of arenas, in which everything that was dropped may have come to rest."""

import logging
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from mujoco import mjx

from mjx_arenas.arena import Arena
from mjx_arenas.envs import refusals
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.rules import none_valid
from mjx_arenas.sample.sampling import world_keys
from mjx_arenas.sim.batch import make_data
from mjx_arenas.sim.rollouts import rollout
from mjx_arenas.sim.settle import resting, settle

SECONDS = 2.0  # in which objects fall
_log = logging.getLogger("mjx_arenas")


class Pool(NamedTuple):
    """N arenas that are drawn once, with the places (N, K, 7) in which all objects rest; None: objects are placed in every episode."""

    params: ArenaParams
    objects: jax.Array | None


class Start(NamedTuple):
    """The start of an episode, in one world."""

    params: ArenaParams
    objects: jax.Array  # (K, 7)
    valid: jax.Array  # () bool: the arena is possible, and each object found a free place


def start(
    arena: Arena, ranges: ArenaRanges, keys: Sequence[jax.Array], params: ArenaParams | None, pool: Pool | None
) -> Start:
    """Draws a start; jit, vmap.

    Args:
        arena: of the worlds.
        ranges: from which its parameters are drawn.
        keys: (2,) of the arena, and of the places of its objects.
        params: of the arena, instead of drawing some.
        pool: from which the start is drawn, if there is one.
    """
    if pool is not None:
        index = jax.random.randint(keys[0], (), 0, len(pool.params.table_offsets))
        own = jax.tree.map(lambda x: x[index], pool)
        if own.objects is not None:
            return Start(own.params, own.objects, jnp.ones((), bool))
        params = own.params if params is None else params
    params = arena.sample_params(keys[0], ranges) if params is None else params
    placement = arena.place(params, keys[1])
    return Start(params, placement.qpos, arena.valid(params, ranges) & placement.valid.all())


def drawn(arena: Arena, ranges: ArenaRanges, keys: jax.Array) -> tuple[ArenaParams, jax.Array]:
    """Arenas (N,) of keys (N,), and whether each is valid (host).

    Raises:
        ValueError: none is, so that nothing can be learned on them.
    """

    def judged(key: jax.Array) -> tuple[ArenaParams, jax.Array]:
        params = arena.sample_params(key, ranges)
        return params, arena.valid(params, ranges)

    params, valid = jax.jit(jax.vmap(judged))(keys)
    if not valid.any():
        record = arena.record
        args = record.rules, ranges, record.drawing, record.labels
        raise error([none_valid.found(params, jax.device_get(valid), *args)])
    return params, valid


def pool(arena: Arena, model: mjx.Model, ranges: ArenaRanges, config: Any, keyframe: str | None) -> Pool | None:
    """Draws arenas; or worlds, lets their objects fall, and keeps those that are valid and in which all objects rest.

    Meanwhile robots and doors move. They are put back to where episodes start, and all objects must rest there as well: what had come to
    rest on a robot would hang in the air.

    Args:
        arena: of the worlds.
        model: its template.
        ranges: from which the worlds are drawn.
        config: the environment's: `num_arenas` or `settled` says how many are drawn. Without `settled`, a warning names what falls.
        keyframe: in which robots start.

    Raises:
        ValueError: there is no such world, or no arena is valid.
    """
    n_arenas, n_worlds, seed = (config.get(name, 0) for name in ("num_arenas", "settled", "drawn_seed"))
    if not n_worlds:
        refusals.warn_of_falling(arena)
        if not n_arenas:
            return None
        (params, valid), record = drawn(arena, ranges, world_keys(seed, range(n_arenas))), arena.record
        none_valid.warn(valid, params, record.rules, ranges, record.drawing, record.labels)
        return Pool(params, None)
    _log.info(
        "settled: %d worlds are drawn, in which objects fall for %g s; this compiles and takes a while",
        n_worlds,
        SECONDS,
    )
    keys = world_keys(seed, range(n_worlds))
    batch = arena.randomize(model, keys, ranges)
    data = make_data(batch, keys, keyframe, config.get("max_contacts"))
    n_steps = max(10, round(SECONDS / arena.mj_model.opt.timestep))
    after = settle(batch, data, n_steps)
    ids = arena.layout.object_qpos
    back = data.replace(qpos=data.qpos.at[:, ids].set(after.data.qpos[:, ids]))
    rests = after.rests & resting(batch, back, rollout(batch, back, n_steps // 10), n_steps // 10)
    free = jax.vmap(arena.place)(batch.params, keys).valid.all(-1)
    kept = np.flatnonzero(np.asarray(batch.valid & free & rests.all(-1)))
    if not len(kept):
        invalid = n_worlds - int(np.asarray(batch.valid & free).sum())
        why = f" ({invalid} are not valid: mjx_arenas.check says why)" if invalid else ""
        raise error([problem("config.settled", "none_settled", None, n_worlds, n=n_worlds, seconds=SECONDS, why=why)])
    _log.info("settled: in %d of %d worlds all objects rest", len(kept), n_worlds)
    return Pool(jax.tree.map(lambda x: jnp.asarray(x)[kept], batch.params), after.data.qpos[kept][:, ids])
