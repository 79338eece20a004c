"""Warp's kernels of a step, compiled side by side before the step runs.

Warp compiles a module when one of its kernels is launched first, so a first step compiles thirty of them one after the other: on a GPU
that is most of the time from nothing to the first step. Which kernels a step launches follows from the model (`launched`). On the CPU
threads compile them; for a GPU processes do (`kernels_apart`), as NVIDIA's compiler does one thing at a time in each process.
"""

import concurrent.futures
import logging
import os
import pathlib
from collections.abc import Iterable
from typing import Any

import jax
import mujoco
from mujoco import mjx

from mjx_arenas.sim import devices, kernels_apart, launched

_log = logging.getLogger("mjx_arenas")
_WORKERS, _CHILDREN = 16, 8  # at once; each needs some 300 MB


def compile_side_by_side(mj_model: mujoco.MjModel, data: mjx.Data, fields: Iterable[str]) -> None:
    """Compiles and loads the kernels that a step of these worlds will launch, as far as they are not; host, may be traced.

    Args:
        mj_model: the template.
        data: of W worlds on impl="warp".
        fields: that each world has its own of.
    """
    import warp as wp

    on = wp.device_from_jax(devices.own_device() or jax.local_devices()[0])
    sizes = launched.Sizes(len(data.qpos), int(data._impl.naconmax), int(data._impl.njmax))
    names = sorted(name.rpartition(".")[2] for name in fields)
    try:
        needed = launched.of_step(mj_model, sizes, names, on)
        missing = [one for one in needed if not _in_cache(*one)]
        if on.is_cuda and len(missing) > 1:
            helpers = min(_cores() // 2, len(missing) - 1, _CHILDREN)
            kernels_apart.compile_together(mj_model, sizes, names, on, needed, helpers)
    except Exception as error:  # Warp then compiles them itself: later, and one after the other
        _log.debug("kernels are not compiled side by side: %s: %s", type(error).__name__, error)
        return

    if _cores() > 1:
        with concurrent.futures.ThreadPoolExecutor(min(_cores(), _WORKERS)) as pool:
            for done in [pool.submit(launched.load, *one, on) for one in needed]:
                done.result()


def _cores() -> int:
    return os.cpu_count() or 1


def _in_cache(module: Any, block_dim: int) -> bool:
    """Whether Warp has compiled a module before; for which device is not looked at."""
    import warp as wp

    return pathlib.Path(str(wp.config.kernel_cache_dir), module.get_module_identifier(block_dim)).exists()
