"""Furnished rooms that are drawn, placed and stepped in C: what falls, breaks or slides of what should rest."""

import time
from collections.abc import Iterator, Mapping
from typing import Any

import jax
import mujoco
import numpy as np

import mjx_arenas as mja
from benchmarks import kitchen
from mjx_arenas.sample import tops

ABOVE = 0.003  # [m] that objects start above their places
MOVED = 0.001  # [m] sideways, beyond which an object did not stay
DEPTH = 0.001  # [m] below its place, beyond which it went into something
HEIGHT = 0.001  # [m] above its place, beyond which it came to rest on something else


def dropped(worlds: Mapping[str, int], n_steps: int) -> Iterator[dict[str, Any]]:
    """A row for each room: an example of the package, or "benchmark", the kitchen of another case."""
    for name, n in worlds.items():
        arena, ranges = (kitchen.arena(), kitchen.ranges()) if name == "benchmark" else mja.load(name)
        yield {"example": name, "worlds": n, **_dropped(arena, ranges, n, n_steps)}


def _dropped(arena: mja.Arena, ranges: mja.ArenaRanges, worlds: int, n_steps: int) -> dict[str, Any]:
    """Each object is put 3 mm above its drawn place; after the steps it is counted where it is not finite, too low, too high, or moved."""
    ground = arena.layout.places.ground
    keys = mja.world_keys(0, range(worlds))

    @jax.jit
    @jax.vmap
    def draw(key: jax.Array) -> tuple[Any, ...]:
        params = arena.sample_params(key, ranges)
        there = tops.present(params, ground)[1]
        return params, arena.valid(params, ranges), arena.place(params, key), there

    params, valid, placed, there = jax.tree.map(np.asarray, draw(keys))
    counts = dict.fromkeys(("not_finite", "through", "above", "moved"), 0)
    objects, largest, begun = 0, 0.0, time.perf_counter()
    heights: list[float] = []
    possible = np.flatnonzero(valid & placed.valid.all(1))
    for w in possible.tolist():
        model = arena.compile(jax.tree.map(lambda x, w=w: x[w], params))
        c = mujoco.MjData(model)
        _start(arena, jax.tree.map(lambda x, w=w: x[w], params), c)
        here = np.flatnonzero(there[w])
        joints = [c.joint(arena.objects[k].joint) for k in here]
        goal = placed.qpos[w, here]
        for joint, pose in zip(joints, goal, strict=True):
            joint.qpos = pose + np.array([0, 0, ABOVE, 0, 0, 0, 0])
        mujoco.mj_step(model, c, n_steps)
        found = np.array([joint.qpos for joint in joints]).reshape(-1, 7)
        finite = np.isfinite(found).all(1)
        moved = np.linalg.norm((found - goal)[:, :2], axis=1)
        objects += len(here)
        counts["not_finite"] += int((~finite).sum())
        counts["through"] += int((found[:, 2] < goal[:, 2] - DEPTH).sum())
        counts["above"] += int((found[:, 2] > goal[:, 2] + HEIGHT).sum())
        counts["moved"] += int((moved > MOVED).sum())
        largest = max(largest, float(moved.max(initial=0.0)))
        heights += (found[:, 2] - goal[:, 2]).tolist()
    return {
        "stepped": len(possible),
        "objects": objects,
        **counts,
        "largest_move": largest,
        "lowest": min(heights, default=0.0),
        "highest": max(heights, default=0.0),
        "seconds": time.perf_counter() - begun,
    }


def _start(arena: mja.Arena, params: mja.ArenaParams, c: mujoco.MjData) -> None:
    """Drawers and doors where they start."""
    for name in arena.quantities:
        joints = arena.elements(name)
        if name.rpartition(".")[2] in ("openings", "opening"):
            for joint, value in zip(joints, params.terms[name], strict=True):
                c.joint(joint).qpos = value
