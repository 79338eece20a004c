"""How many lines Warp prints in a rollout, and in how many worlds the data notes what they would say."""

import ctypes
import functools
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
from mujoco import mjx
from mujoco.mjx.third_party import mujoco_warp

import mjx_arenas as mja
from benchmarks import scene, terms


def lines(worlds: int, n_steps: int) -> Iterator[dict[str, Any]]:
    """An arm whose solver has five iterations goes to random postures: a rollout of the library, and a plain loop of MJX."""
    one = terms.arena()
    keys = scene.keys(worlds)
    batch = one.randomize(scene.model(one, "warp"), keys, terms.ranges(heavy=True))
    data = mja.make_data(batch, keys)
    data = data.replace(ctrl=jax.random.uniform(jax.random.key(1), data.ctrl.shape, minval=-2.0, maxval=2.0))
    here = jax.tree.map(jnp.copy, data)
    data, ours = _printed(lambda: mja.rollout(batch, data, n_steps))
    _, plain = _printed(lambda: _plain(batch, here, n_steps))
    noted = mja.capacity(batch, data)
    yield {
        "worlds": worlds,
        "steps": n_steps,
        "lines": ours,
        "plain_lines": plain,
        "worlds_at_solver_limits": int(noted.solver_limits.sum()),
        "worlds_without_room": int(noted.overflowed.sum()),
    }


@functools.partial(jax.jit, static_argnames="n_steps")
def _plain(batch: mja.ArenaBatch, data: mjx.Data, n_steps: int) -> mjx.Data:
    every = int(mujoco_warp.OverflowType.ALL)  # as MJX makes a model; the library's says nothing
    loud, axes = (model.tree_replace({"opt._impl.warn_overflow": every}) for model in (batch.model, batch.in_axes))
    step = jax.vmap(mjx.step, in_axes=(axes, 0))
    return jax.lax.scan(lambda data, _: (step(loud, data), None), data, length=n_steps)[0]


def _printed(function: Callable[[], Any]) -> tuple[Any, int]:
    """What a function returns, and the number of lines that it and native code write to stdout meanwhile."""
    sys.stdout.flush()
    stdout = os.dup(1)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 1)
        try:
            result = jax.block_until_ready(function())
            ctypes.CDLL(None).fflush(None)
        finally:
            os.dup2(stdout, 1)
            os.close(stdout)
        file.seek(0)
        return result, file.read().count(b"\n")
