"""Warp's kernels of a step, compiled side by side before the step runs.

Warp compiles a module when one of its kernels is launched first, so a first step compiles thirty of them one after the other: on a GPU
that is most of the time from nothing to the first step. Which kernels a step launches follows from the model; here a step of one world
is run whose launches are written down and not made.
"""

import concurrent.futures
import contextlib
import itertools
import logging
import math
import os
import threading
from collections.abc import Iterable, Iterator
from typing import Any

import jax
import mujoco
from mujoco import mjx

from mjx_arenas.sim import devices

_log = logging.getLogger("mjx_arenas")
_LOCK = threading.Lock()
# Of these fields kernels know how many there are. Others would only need memory.
_COUNTED = ("geom_aabb", "geom_rbound", "geom_margin", "geom_gap", "pair_margin", "pair_gap", "geom_dataid")
_WORKERS = 16  # at once; each needs some 300 MB


def compile_side_by_side(mj_model: mujoco.MjModel, data: mjx.Data, fields: Iterable[str]) -> None:
    """Compiles and loads the kernels that a step of these worlds will launch, as far as they are not; host, may be traced.

    Args:
        mj_model: the template.
        data: of W worlds on impl="warp", whose room for contacts decides which kernels there are.
        fields: that each world has its own of.
    """
    import warp as wp

    on = wp.device_from_jax(devices.own_device() or jax.local_devices()[0])
    try:
        needed = of_step(mj_model, data, fields, on)
    except Exception as error:  # Warp then compiles them itself: later, and one after the other
        _log.debug("kernels are not compiled side by side: %s: %s", type(error).__name__, error)
        return

    def load(module: Any, block_dims: list[int]) -> None:
        for block_dim in block_dims:
            wp.force_load(on, [module], block_dim=block_dim)

    workers = min(os.cpu_count() or 1, _WORKERS)
    if workers > 1:
        with concurrent.futures.ThreadPoolExecutor(workers) as pool:
            for done in [pool.submit(load, *one) for one in needed]:
                done.result()


def of_step(mj_model: mujoco.MjModel, data: mjx.Data, fields: Iterable[str], on: Any) -> list[tuple[Any, list[int]]]:
    """The modules (`warp.Module`) of all kernels that a step launches on a device of Warp, each with the sizes of its blocks."""
    import mujoco.mjx.third_party.mujoco_warp as mjw
    import warp as wp

    with _LOCK, wp.ScopedDevice(on):
        names = (name.rpartition(".")[2] for name in fields)
        model = mjw.put_model(mj_model, {name: len(data.qpos) for name in names if name in _COUNTED})
        model.opt.warn_overflow = 0  # as `warp_notes.quiet` has it
        sizes = {"naconmax": data._impl.naconmax, "njmax": data._impl.njmax}
        state = mjw.make_data(mj_model, nworld=1, **{name: int(value) for name, value in sizes.items()})
        found = {(wp.get_module("mujoco.mjx.warp.ffi"), 1 if on.is_cpu else 256)}
        with _written_down(found, on):
            mjw.step(model, state)
    by_name = sorted(found, key=lambda one: (one[0].name, one[1]))
    return [(module, [dim for _, dim in ones]) for module, ones in itertools.groupby(by_name, key=lambda one: one[0])]


@contextlib.contextmanager
def _written_down(found: set[tuple[Any, int]], on: Any) -> Iterator[None]:
    """Meanwhile this thread launches nothing; `found` gets the module of each kernel, and the size of its blocks.

    Others, in which XLA still runs steps that were begun before, launch as ever.
    """
    import warp as wp

    this = threading.get_ident()

    def launch(kernel: Any, dim: Any, *_: Any, block_dim: int = 256, **__: Any) -> None:
        if math.prod(dim if hasattr(dim, "__len__") else [dim]):
            found.add((kernel.module, 1 if on.is_cpu else block_dim))

    def block_size(kernel: Any, device: Any) -> tuple[int, int]:
        found.add((kernel.module, 1 if on.is_cpu else 256))
        return 256, 1

    def once(condition: Any, while_body: Any, **arguments: Any) -> None:
        while_body(**arguments)

    def both(condition: Any, on_true: Any = None, on_false: Any = None, **arguments: Any) -> None:
        for branch in (on_true, on_false):
            if callable(branch):
                branch(**arguments)

    instead = {"launch": launch, "launch_tiled": launch, "capture_while": once, "capture_if": both}
    instead["get_suggested_block_size"] = block_size
    before = {name: getattr(wp, name) for name in instead}

    def here(name: str) -> Any:
        def call(*args: Any, **kwargs: Any) -> Any:
            return (instead if threading.get_ident() == this else before)[name](*args, **kwargs)

        return call

    try:
        for name in instead:
            setattr(wp, name, here(name))
        yield
    finally:
        for name, function in before.items():
            setattr(wp, name, function)
