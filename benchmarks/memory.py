"""Bytes of a world, and how many worlds fit on a device. As a program: tries one number of worlds."""

import json
import sys
import time
from collections.abc import Iterator, Sequence
from typing import Any

import jax
import numpy as np
from mujoco import mjx

import mjx_arenas as mja
from benchmarks import measure, scene

CAUSES = ("state", "contacts", "rows", "rest")


def bytes_per_world(impls: Sequence[str], worlds: int) -> Iterator[dict[str, Any]]:
    """By cause, from shapes and types: batched leaves of the model, state and kinematics, contacts, rows, the rest."""
    for impl in impls:
        arena = scene.arena()
        batch = arena.randomize(scene.model(arena, impl), scene.keys(worlds), scene.ranges())
        split = _split(jax.eval_shape(mja.make_data, batch, scene.keys(worlds)))
        row = {"model": batch.nbytes, **{cause: split[cause] / worlds for cause in CAUSES}}
        yield {"impl": impl, **{f"{cause}_bytes": n for cause, n in row.items()}, "total_bytes": sum(row.values())}


def _split(data: mjx.Data) -> dict[str, int]:
    """Bytes of data by cause; all public fields count as state."""
    split = dict.fromkeys(CAUSES, 0)
    for path, leaf in jax.tree_util.tree_leaves_with_path(data):
        name = jax.tree_util.keystr(path)
        private = "rows" if "efc" in name else "contacts" if "contact" in name else "rest"
        split[private if "_impl" in name else "state"] += leaf.size * leaf.dtype.itemsize
    return split


def touched(batch: mja.ArenaBatch, data: mjx.Data) -> float:
    """Bytes of model and data that a step touches: of contacts and rows on Warp those in use, on JAX all."""
    split, impl = _split(data), data._impl
    if batch.model.impl.value == "warp":
        split["contacts"] *= int(impl.nacon.max()) / impl.naconmax
        split["rows"] *= float(impl.nefc.mean()) / impl.njmax
    return batch.nbytes * batch.n_worlds + sum(split.values())


def most_worlds(impl: str, start: int, limit: int, bisections: int, seconds: float) -> Iterator[dict[str, Any]]:
    """Doubles while worlds can be made and stepped, then bisects; each try is a process of its own.

    Args:
        impl: of MJX.
        start: worlds of the first try.
        limit: no more worlds than this.
        bisections: tries after the first that fails.
        seconds: no new try after this time [s].
    """
    begin, tries = time.perf_counter(), 0
    fits, too_many, reason, peak = 0, None, "", 0
    n = start
    while time.perf_counter() - begin < seconds:
        tries += 1
        try:
            peak, fits = _try_in_child(impl, n), n
        except RuntimeError as error:
            too_many, reason = n, str(error)
        if too_many is None and 2 * n <= limit:
            n *= 2
        elif too_many is None or not fits or bisections == 0:
            break
        else:
            bisections -= 1
            n = (fits + too_many) // 2
    if not fits:
        raise RuntimeError(f"{start} worlds do not fit: {reason}")
    yield {
        "impl": impl,
        "worlds": fits,
        "too_many": too_many,
        "why": reason,
        "tries": tries,
        "peak_bytes_per_world": peak / fits,
    }


def _try_in_child(impl: str, n_worlds: int) -> int:
    # The rest is for Warp, which takes the memory of its CUDA graphs beside XLA's.
    memory = {"XLA_PYTHON_CLIENT_PREALLOCATE": "true", "XLA_PYTHON_CLIENT_MEM_FRACTION": "0.65"}
    return measure.child("-m", "benchmarks.memory", impl, str(n_worlds), env=memory)["peak_bytes"]


def main(impl: str, n_worlds: int) -> None:
    """Makes worlds, steps them until the cubes lie, and checks that they do."""
    batch, data = scene.start(scene.arena(), impl, n_worlds)
    start = np.asarray(data.qpos)
    data = mja.rollout(batch, data, n_steps=10)
    fallen = start - np.asarray(data.qpos)
    if not np.isfinite(fallen).all() or np.abs(fallen).max() > 2 * scene.DROP:
        raise RuntimeError("the cubes do not lie on their tables")
    peak = (jax.devices()[0].memory_stats() or {}).get("peak_bytes_in_use", 0)
    print(json.dumps({"peak_bytes": peak}))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
