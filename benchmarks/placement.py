"""How often and how fast `arena.place` finds a place for every object: `python benchmarks/placement.py`.

Prints a table and writes `benchmarks/results/placement_<device>.json`. The table top is 0.8 m x 0.8 m.
"""

import argparse
import datetime
import json
import pathlib
import statistics
import time
from collections.abc import Callable

import jax
import numpy as np

import mjx_arenas as mja

COUNTS = (5, 10, 15, 20, 25, 30)
REPEATS = 7


def arena(n: int, full_size: float) -> mja.TableArena:
    """Boxes on one table."""
    spread = np.linspace(-0.3, 0.3, n)
    return mja.TableArena(
        objects=[mja.Object(f"box{i}", full_size=full_size, pos=(x, 0)) for i, x in enumerate(spread)]
    )


def timed(place: Callable, keys: jax.Array) -> tuple[mja.Placement, float]:
    """The placements of all worlds, and the median of the seconds that they take once compiled."""
    jax.block_until_ready(place(keys))
    seconds = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        placed = jax.block_until_ready(place(keys))
        seconds.append(time.perf_counter() - begin)
    return placed, statistics.median(seconds)


def main() -> None:
    """Measures, prints, writes."""
    parser = argparse.ArgumentParser(prog="python benchmarks/placement.py", description=__doc__)
    parser.add_argument("--worlds", type=int, default=8192, help="worlds of the timed case (default 8192)")
    parser.add_argument("--crowded-worlds", type=int, default=2000, help="worlds of each count (default 2000)")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).parent / "results")
    options = parser.parse_args()
    rows = []
    cases = [(n, 0.1, options.crowded_worlds) for n in COUNTS] + [(10, 0.05, options.worlds)]
    for n, full_size, n_worlds in cases:
        scene = arena(n, full_size)
        params = scene.nominal_params()
        place = jax.jit(jax.vmap(lambda key, scene=scene, params=params: scene.place(params, key)))
        placed, seconds = timed(place, jax.random.split(jax.random.key(n), n_worlds))
        valid = np.asarray(placed.valid)
        rows.append(
            {
                "objects": n,
                "full_size": full_size,
                "worlds": n_worlds,
                "worlds_with_all_placed": float(valid.all(-1).mean()),
                "objects_placed": float(valid.mean()),
                "seconds": seconds,
            }
        )
        print(
            f"{n:3d} boxes of {100 * full_size:g} cm, {n_worlds:,} worlds: all placed in {valid.all(-1).mean():.2%} of worlds, "
            f"{valid.mean():.3%} of objects, {seconds:.3f} s"
        )
    device = jax.devices()[0]
    result = {
        "command": "python benchmarks/placement.py",
        "date": datetime.date.today().isoformat(),
        "device": device.device_kind if device.platform != "cpu" else "2 CPU cores",
        "jax": jax.__version__,
        "rows": rows,
    }
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / f"placement_{device.platform}.json"
    path.write_text(json.dumps(result, indent=2) + "\n")
    print(f"written to {path}")


if __name__ == "__main__":
    main()
