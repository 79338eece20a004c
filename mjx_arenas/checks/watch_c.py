"""Rollouts in C MuJoCo that are watched (host). W worlds."""

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import mujoco
import numpy as np

from mjx_arenas.checks import watch
from mjx_arenas.checks.watch import Now, Seen, Tops
from mjx_arenas.progress import Tell, silent
from mjx_arenas.spec import specs
from mjx_arenas.twin import cpu
from mjx_arenas.twin.cpu import STATE

GROUP = 32  # worlds that are looked at together
FULL = (mujoco.mjtWarning.mjWARN_CONTACTFULL, mujoco.mjtWarning.mjWARN_CNSTRFULL)

State = dict[str, np.ndarray]  # by the names of MjData
Pairs = tuple[tuple[str, str], tuple[str, str]]  # geoms of the contact that was first deep, and of the deepest


class Rolled(NamedTuple):
    """What was seen of W worlds."""

    seen: Seen
    start: list[State]  # (W,)
    kept: list[State]  # (W,) last state before anything went wrong
    pairs: list[Pairs]  # (W,)
    kept_step: np.ndarray  # (W,) the step of `kept`
    contacts: np.ndarray  # (W,) most at once


def state(c: mujoco.MjData) -> State:
    """What a rollout can start from again."""
    return {name: np.array(getattr(c, name)) for name in STATE}


def set_state(c: mujoco.MjData, values: State) -> None:
    """Gives a world a state of `state`."""
    for name, value in values.items():
        setattr(c, name, value)


def roll(
    make: Callable[[int], mujoco.MjData],
    tops: Tops,
    names: Sequence[str],
    n_steps: int,
    progress: Tell = silent,
    before: int = 0,
) -> Rolled:
    """`n_steps` steps of W worlds on all cores.

    Args:
        make: gives a world, by its index, at its start: data of the model that was compiled for it. MuJoCo's automatic
            reset is switched off there.
        tops: where the objects belong.
        names: (K,) of the objects; those that are absent are in no model.
        n_steps: number of steps.
        progress: called from the threads, in turn.
        before: number of steps that come first, in which nothing is watched.
    """
    lock, done, n_groups = threading.Lock(), 0, -(-len(tops.there) // GROUP)

    def tick() -> None:
        nonlocal done
        with lock:
            done += 1
            progress(done, n_groups * (before + n_steps))

    def group(first: int) -> Rolled:
        rows = slice(first, first + GROUP)
        mine = Tops(tops.pos[rows], tops.rot[rows], tops.half[rows], tops.there[rows], tops.center[rows])
        with lock:
            worlds = [make(first + i) for i in range(len(mine.there))]
        return _roll(worlds, mine, names, n_steps, before, tick)

    with cpu.silent(), ThreadPoolExecutor(os.cpu_count()) as threads:
        rolled = list(threads.map(group, range(0, len(tops.there), GROUP)))
    return Rolled(*(_joined(column) for column in zip(*rolled, strict=True)))  # type: ignore[arg-type]


def _joined(parts: Sequence[Any]) -> Any:
    """What was seen in groups of worlds, as of all worlds."""
    if isinstance(parts[0], Seen):
        return Seen(*(_joined(column) for column in zip(*parts, strict=True)))
    if isinstance(parts[0], list):
        return [item for part in parts for item in part]
    return np.concatenate(parts) if np.ndim(parts[0]) else np.max(parts)


def _roll(
    worlds: Sequence[mujoco.MjData],
    tops: Tops,
    names: Sequence[str],
    n_steps: int,
    before: int,
    tick: Callable[[], None],
) -> Rolled:
    for c in worlds:
        c.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    for _ in range(before):
        for c in worlds:
            _step(c)
        tick()
    half = [watch.half_extents(c.model.geom_type, c.model.geom_size) for c in worlds]
    qpos = np.zeros((len(worlds), len(names), 7), int)  # an absent object's entries are not used
    for w, c in enumerate(worlds):
        for k in np.flatnonzero(tops.there[w]).tolist():
            qpos[w, k] = c.model.jnt_qposadr[c.model.body(names[k]).jntadr[0]] + np.arange(7)
    bodies = [
        np.array([c.model.body(name).id if there else -1 for name, there in zip(names, on, strict=True)], int)
        for c, on in zip(worlds, tops.there, strict=True)
    ]
    seen = watch.nothing(len(worlds), len(names))
    start = [state(c) for c in worlds]
    kept, kept_step, contacts = list(start), np.zeros(len(worlds), int), np.zeros(len(worlds), int)
    for step in range(1, n_steps + 1):
        for w, c in enumerate(worlds):
            if seen.not_finite[w] == watch.NEVER:
                _step(c)
                contacts[w] = max(contacts[w], c.ncon)
        seen, good = watch.update(seen, _look(worlds, tops, half, qpos, bodies), tops.there)
        for w in np.flatnonzero(good).tolist():
            kept[w] = state(worlds[w])
        kept_step[good] = step
        tick()
    pairs = [pairs_of(seen, w, c.model) for w, c in enumerate(worlds)]
    return Rolled(seen, start, kept, pairs, kept_step, contacts)


def _step(c: mujoco.MjData) -> None:
    try:
        mujoco.mj_step(c.model, c)
    except mujoco.FatalError as error:
        raise ValueError(f"C MuJoCo cannot step a world: {specs.one_line(error)}") from None


def pairs_of(seen: Seen, world: int, model: mujoco.MjModel) -> Pairs:
    """Names of the geoms of a world's contacts."""
    first, deepest = np.sort([seen.deep_pair[world], seen.pair[world]])  # so that those of the same two are equal
    return geom_names(model, first), geom_names(model, deepest)


def geom_names(model: mujoco.MjModel, pair: np.ndarray) -> tuple[str, str]:
    """Names of two geoms, or what they are and of which bodies where they have none."""
    first, second = (model.geom(int(g)).name or specs.geom_name(model, g) for g in pair)
    return first, second


def _poses(worlds: Sequence[mujoco.MjData], qpos: np.ndarray) -> np.ndarray:
    return np.stack(
        [c.qpos[rows] if len(c.qpos) else np.zeros(rows.shape) for c, rows in zip(worlds, qpos, strict=True)]
    )


def _look(
    worlds: Sequence[mujoco.MjData],
    tops: Tops,
    half: Sequence[np.ndarray],
    qpos: np.ndarray,
    bodies: Sequence[np.ndarray],
) -> Now:
    finite = np.array([watch.is_finite(c.qpos, c.qvel, c.qacc) for c in worlds])
    dropped = np.array([any(c.warning[kind].number for kind in FULL) for c in worlds])
    deepest = [_deepest(c, sizes) for c, sizes in zip(worlds, half, strict=True)]
    share, depth, pair = (np.array(column) for column in zip(*deepest, strict=True))
    poses = _poses(worlds, qpos)
    needed = np.int32(max(c.ncon for c in worlds))
    lost = np.stack([_lost_velocity(c, ids) for c, ids in zip(worlds, bodies, strict=True)])
    placed = watch.out_of_place(tops, poses[..., :3], poses[..., 3:])
    return Now(finite, dropped, needed, share, depth, pair, *placed, lost)


def _lost_velocity(c: mujoco.MjData, bodies: np.ndarray) -> np.ndarray:
    """(K,), of the objects that are one rigid body and are there; in C only what ends at the limit of iterations is open."""
    model, there = c.model, bodies >= 0
    if max(c.solver_niter, default=0) < model.opt.iterations or not there.any():
        return np.zeros(len(bodies))
    dof = np.where(there, model.body_dofadr[bodies], 0)[:, None] + np.arange(6)
    mass = np.where(there & watch.rigid(model, bodies), model.body_subtreemass[bodies], 0.0)
    gained, force = (c.qacc - c.qacc_smooth)[dof], c.qfrc_constraint[dof[:, :3]]
    arm = (c.subtree_com - c.xpos)[bodies]
    return watch.lost_velocity(c.xquat[bodies], arm, mass, gained, force, model.opt.timestep)


def _deepest(c: mujoco.MjData, half: np.ndarray) -> tuple[float, float, tuple[int, int]]:
    """Share, depth [m] and geoms of the deepest contact; zeros where there is none."""
    if not c.ncon:
        return 0.0, 0.0, (0, 0)
    dist, geom = c.contact.dist, c.contact.geom
    share = np.where((geom >= 0).all(1), -dist / half[geom].min(1), 0.0)
    i = int(share.argmax())
    return (float(share[i]), float(-dist[i]), tuple(geom[i].tolist())) if share[i] > 0 else (0.0, 0.0, (0, 0))
