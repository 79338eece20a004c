"""From nothing to the first step. As a program: times the stages of one process."""

import json
import pathlib
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from benchmarks import measure


def startup(runs: Sequence[tuple[str, str]], worlds: int) -> Iterator[dict[str, Any]]:
    """Seconds of each stage in a fresh process, with empty caches and with full ones.

    Args:
        runs: "tables", the scene of the other cases, or "arm", one on a table with objects; and the implementation of MJX.
        worlds: of the batch.
    """
    for of, impl in runs:
        yield from _cold_and_warm(of, impl, worlds)


def _cold_and_warm(of: str, impl: str, worlds: int) -> list[dict[str, Any]]:
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        env = {
            "JAX_COMPILATION_CACHE_DIR": str(pathlib.Path(folder, "jax")),
            "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
            "WARP_CACHE_PATH": str(pathlib.Path(folder, "warp")),
            "CUDA_CACHE_PATH": str(pathlib.Path(folder, "cuda")),
            "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
        }
        for caches in ("cold", "warm"):
            stages = measure.child("-m", "benchmarks.startup", of, impl, str(worlds), env=env)
            until_first_step = sum(s for name, s in stages.items() if not name.endswith("_run"))
            seconds = {f"{name}_seconds": s for name, s in {**stages, "total": until_first_step}.items()}
            rows.append({"scene": of, "impl": impl, "caches": caches, "worlds": worlds, **seconds})
    return rows


def main(of: str, impl: str, n_worlds: int) -> None:
    """Prints the seconds of each stage.

    `import_mjx` is of JAX and MJX, `import` of what mjx_arenas adds. Of a compiled function: `trace` to XLA's input,
    `compile` by XLA, `load` what the first run takes longer than the second (Warp builds and loads its kernels then),
    `run` the second run.
    """
    stages: dict[str, float] = {}
    began = time.perf_counter()

    def stage(name: str) -> None:
        nonlocal began
        now = time.perf_counter()
        stages[name], began = now - began, now

    import jax
    from mujoco import mjx  # noqa: F401 (what every program on MJX imports)

    stage("import_mjx")

    import mjx_arenas as mja
    from benchmarks import scene

    mja.MultiTableArena  # noqa: B018 (modules load when they are first used)
    stage("import")
    jax.block_until_ready(jax.numpy.zeros(1))
    stage("device")
    arena = scene.arena() if of == "tables" else scene.with_an_arm()
    arena.mj_model  # noqa: B018 (compiles)
    stage("arena")
    model = jax.block_until_ready(scene.model(arena, impl))
    stage("put_model")

    def timed(name: str, function: Callable[..., Any], *arguments: Any) -> Any:
        nonlocal began
        began = time.perf_counter()
        lowered = jax.jit(function).lower(*arguments)
        stage(f"{name}_trace")
        compiled = lowered.compile()
        stage(f"{name}_compile")
        result = jax.block_until_ready(compiled(*arguments))
        stage(f"{name}_load")
        result = jax.block_until_ready(compiled(*arguments))
        stage(f"{name}_run")
        stages[f"{name}_load"] = max(0.0, stages[f"{name}_load"] - stages[f"{name}_run"])
        return result

    keys = scene.keys(n_worlds)
    ranges = scene.ranges()
    batch = timed("randomize", lambda model, keys: arena.randomize(model, keys, ranges), model, keys)
    data = timed("make_data", mja.make_data, batch, keys)
    timed("step", mja.step, batch, data)
    print(json.dumps(stages))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
