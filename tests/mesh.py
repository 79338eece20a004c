"""Steps worlds that are spread over all devices of this machine, and each part of them on a device of its own.

python tests/mesh.py jax
python tests/mesh.py warp
"""

import os
import sys
import time
from collections.abc import Callable

os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")

import jax
import numpy as np
from jax.sharding import NamedSharding
from jax.sharding import PartitionSpec as P

import mjx_arenas as mja

EACH, STEPS = 1024, 20
BOUND = 1e-6  # [m], a few roundings of a metre


def main(impl: str) -> None:
    """Prints how far the two differ, and the seconds of each."""
    ball, rod = mja.Object("ball", "sphere", 0.06), mja.Object("rod", "capsule", (0.12, 0.04, 0.04))
    arena = mja.TableArena(objects=[ball, rod])
    density = mja.LogUniform(0.3, 3.0, relative="scale")
    ranges = mja.ArenaRanges(table_rots=mja.Uniform(-0.5, 0.5), object_densities=density)
    n = jax.device_count()
    keys = jax.random.split(jax.random.key(0), n * EACH)
    model = arena.put_model(impl=impl)

    def stepped(model: object, keys: jax.Array) -> tuple[np.ndarray, float]:
        batch = arena.randomize(model, keys, ranges)
        data = mja.step(batch, mja.make_data(batch, keys))
        return _timed(lambda: mja.rollout(batch, data, STEPS).qpos)

    spread = NamedSharding(jax.make_mesh((n,), ("worlds",)), P("worlds"))
    together, seconds = stepped(model, jax.device_put(keys, spread))
    parts = zip(jax.devices(), np.split(np.arange(len(keys)), n), strict=True)
    alone = [stepped(jax.device_put(model, device), jax.device_put(keys[i], device)) for device, i in parts]
    apart = np.abs(together - np.concatenate([qpos for qpos, _ in alone])).max()
    each = ", ".join(f"{s:.4f}" for _, s in alone)
    assert apart < BOUND
    print(f"{impl}, {n} x {jax.devices()[0].device_kind}, {EACH} worlds each: qpos differ by {apart:.1e};", end=" ")
    print(f"{STEPS} steps take {seconds:.4f} s together, {each} s alone")


def _timed(function: Callable[[], jax.Array]) -> tuple[np.ndarray, float]:
    """What a function returns, and the least of three times that it takes when it is compiled."""
    result, seconds = function().block_until_ready(), []
    for _ in range(3):
        begin = time.perf_counter()
        function().block_until_ready()
        seconds.append(time.perf_counter() - begin)
    return np.asarray(result), min(seconds)


if __name__ == "__main__":
    main(sys.argv[1])
