"""The kernels that a step launches on impl="warp", told by a step of one world whose launches are written down and not made."""

import contextlib
import math
import threading
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import mujoco

_LOCK = threading.Lock()
# Of these fields kernels know how many there are. Others would only need memory.
_COUNTED = ("geom_aabb", "geom_rbound", "geom_margin", "geom_gap", "pair_margin", "pair_gap", "geom_dataid")
_BLOCK = 256  # Warp's threads a block where nothing else is said


class Sizes(NamedTuple):
    """Sizes of data on impl="warp"; they decide which kernels are compiled."""

    n_worlds: int
    naconmax: int
    njmax: int


def of_step(mj_model: mujoco.MjModel, sizes: Sizes, fields: Iterable[str], on: Any) -> list[tuple[Any, int]]:
    """The modules (`warp.Module`) of all kernels that a step launches on a device of Warp, each with the size of its blocks.

    A module stands there once for each size with which its kernels are launched: Warp compiles it as often.

    Args:
        mj_model: the template.
        sizes: of the data.
        fields: last names of those that each world has its own of.
        on: the device.
    """
    import mujoco.mjx.third_party.mujoco_warp as mjw
    import warp as wp

    with _LOCK, wp.ScopedDevice(on):
        model = mjw.put_model(mj_model, {name: sizes.n_worlds for name in fields if name in _COUNTED})
        model.opt.warn_overflow = 0  # as `warp_notes.quiet` has it
        state = mjw.make_data(mj_model, nworld=1, naconmax=sizes.naconmax, njmax=sizes.njmax)
        found = {(wp.get_module("mujoco.mjx.warp.ffi"), 1 if on.is_cpu else _BLOCK)}
        with _written_down(found, on):
            mjw.step(model, state)
    return sorted(found, key=lambda one: (one[0].name, one[1]))


def load(module: Any, block_dim: int, on: Any) -> None:
    """Loads a module (`warp.Module`) for a size of blocks, and compiles it first if that is not done."""
    import warp as wp

    wp.force_load(on, [module], block_dim=block_dim)


@contextlib.contextmanager
def _written_down(found: set[tuple[Any, int]], on: Any) -> Iterator[None]:
    """Meanwhile this thread launches nothing; `found` gets the module of each kernel, and the size of its blocks.

    Others, in which XLA still runs steps that were begun before, launch as ever.
    """
    import warp as wp

    this = threading.get_ident()

    def launch(kernel: Any, dim: Any, *_: Any, block_dim: int | None = None, **__: Any) -> None:
        if math.prod(dim if hasattr(dim, "__len__") else [dim]):
            found.add((kernel.module, 1 if on.is_cpu else block_dim or _BLOCK))

    def block_size(kernel: Any, device: Any = None) -> tuple[int, int]:
        block = kernel.module.options.get("block_dim", _BLOCK)  # the one that Warp loads to answer
        found.add((kernel.module, 1 if on.is_cpu else block))
        return block, 1

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
