"""Making worlds: sampling and writing a batched model, against a copy of its bytes; placing objects."""

import functools
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks import measure, scene
from mjx_arenas import Object, TableArena


def randomize(impl: str, worlds: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Sampling and writing 3 tables, compiled; `call` is the same through the public function, not under a jit."""
    arena = scene.arena()
    model, ranges, compiled = scene.model(arena, impl), scene.ranges(), randomizer(impl)
    for n in worlds:
        keys = scene.keys(n)
        out = jax.block_until_ready(compiled(keys))
        nbytes = sum(x.nbytes for x in jax.tree.leaves(out))
        flat = jnp.zeros(nbytes // 4, jnp.float32)
        copy, copy_tree = jax.jit(jnp.copy), jax.jit(lambda tree: jax.tree.map(jnp.copy, tree))
        seconds = measure.interleaved(
            {
                "randomize": functools.partial(compiled, keys),
                "copy": functools.partial(copy, flat),
                "copy_by_leaf": functools.partial(copy_tree, out),
                "call": lambda keys=keys: scene.written(arena.randomize(model, keys, ranges)),
            }
        )
        row = {
            "worlds": n,
            "seconds": seconds["randomize"],
            "call_seconds": seconds["call"],
            "copy_seconds": seconds["copy"],
            "copy_by_leaf_seconds": seconds["copy_by_leaf"],
            "share": seconds["copy"] / seconds["randomize"],
            "bytes_per_world": nbytes / n,
            "accessed_bytes_per_world": measure.accessed(compiled, keys) / n,
            "written_gb_per_s": nbytes / seconds["randomize"] / 1e9,
            "copied_gb_per_s": nbytes / seconds["copy"] / 1e9,
            "arenas_per_second": n / seconds["randomize"],
        }
        if jax.default_backend() == "gpu":  # without the host, which launches the kernels
            busy, kernels = measure.on_device(functools.partial(compiled, keys))
            copied, _ = measure.on_device(functools.partial(copy, flat))
            row |= {
                "device_seconds": busy,
                "kernels": kernels,
                "device_copy_seconds": copied,
                "device_share": copied / busy,
            }
        yield row


@functools.cache
def randomizer(impl: str) -> Callable[[jax.Array], tuple[Any, ...]]:
    """From the keys of all worlds to all arrays that `randomize` writes, compiled as one function."""
    arena = scene.arena()
    model, ranges = scene.model(arena, impl), scene.ranges()
    return jax.jit(lambda keys: scene.written(arena.randomize(model, keys, ranges)))


def arenas_per_second(impl: str, worlds: Sequence[int]) -> float:
    """Of the best of some batch sizes."""
    calls = {n: functools.partial(randomizer(impl), scene.keys(n)) for n in worlds}
    return max(n / measure.interleaved({"randomize": call})["randomize"] for n, call in calls.items())


def placement(crowded: Sequence[int], crowded_worlds: int, worlds: int) -> Iterator[dict[str, Any]]:
    """How often and how fast every box finds a place: 10 cm boxes, and ten of 5 cm; a table of 0.8 m x 0.8 m."""
    for n, full_size, n_worlds in [(n, 0.1, crowded_worlds) for n in crowded] + [(10, 0.05, worlds)]:
        arena = TableArena(objects=[Object(f"box{i}", full_size=full_size) for i in range(n)])
        place = jax.jit(jax.vmap(functools.partial(arena.place, arena.nominal_params())))
        call = functools.partial(place, scene.keys(n_worlds))
        valid = np.asarray(call().valid)
        yield {
            "objects": n,
            "full_size": full_size,
            "worlds": n_worlds,
            "worlds_with_all_placed": float(valid.all(-1).mean()),
            "objects_placed": float(valid.mean()),
            "seconds": measure.interleaved({"place": call})["place"],
        }
