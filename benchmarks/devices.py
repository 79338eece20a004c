"""How world-steps a second grow with the devices of one host: `mjx-arenas bench devices --engine warp`.

The number of worlds on each device stays the same. Ways to use several devices (docs/scaling.md):

    mesh         one process, worlds spread over a mesh of all devices
    processes    one process for each device, each with its own worlds
    distributed  one process for each device, worlds spread over a mesh of the devices of all (`jax.distributed`)

Prints `devices.<impl>.<devices>.<way>.<metric> value`. Every measurement runs in child processes, which end at a time
limit, and starts when all of them have compiled.
"""

import argparse
import faulthandler
import json
import os
import pathlib
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

from benchmarks import measure
from mjx_arenas.parser import Parser

WAYS = ("mesh", "processes", "distributed")
METRICS = {"steps": "steps_per_s", "make": "worlds_made_per_s"}


def main() -> None:
    """Measures, prints, writes."""
    parser = Parser(
        prog="mjx-arenas bench devices", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--engine",
        "--impl",
        dest="impl",
        choices=("jax", "warp"),
        default="warp",
        help="implementation of MJX (default warp)",
    )
    parser.add_argument(
        "--devices", default="", help="how many, such as 2,4 (default: 2, 4, 8 as there are GPUs; 2 on CPU)"
    )
    parser.add_argument(
        "--ways", default="mesh,processes", help="of mesh,processes,distributed (default mesh,processes)"
    )
    parser.add_argument("--worlds-per-device", type=int, default=8192)
    parser.add_argument("--steps", type=int, default=100, help="of a rollout (default 100)")
    parser.add_argument("--repeats", type=int, default=7, help="the median of which counts (default 7)")
    parser.add_argument("--timeout", type=float, default=200.0, help="of one measurement [s] (default 200)")
    parser.add_argument("--json", type=pathlib.Path, help="file to write rows to")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        child(options, **json.loads(options.child))
        return
    gpus = visible_gpus()
    counts = [int(n) for n in options.devices.split(",") if n] or [n for n in (2, 4, 8) if n <= len(gpus)] or [2]
    ways = options.ways.split(",")
    if set(ways) - set(WAYS) or (gpus and max(counts) > len(gpus)):
        parser.error(f"--ways must be of {', '.join(WAYS)}, --devices at most {len(gpus)}, the GPUs that are visible.")
    with tempfile.TemporaryDirectory() as folder:
        rows = [measured(options, "processes", 1, gpus, pathlib.Path(folder))]
        report(options.impl, rows[0], rows[0])
        for n in counts:
            for way in ways:
                rows.append(measured(options, way, n, gpus, pathlib.Path(folder)))
                report(options.impl, rows[-1], rows[0])
    if options.json:
        result = {
            "command": "mjx-arenas bench devices " + " ".join(sys.argv[1:]),
            **measure.environment(),
            "impl": options.impl,
            "worlds_per_device": options.worlds_per_device,
            "steps": options.steps,
            "repeats": options.repeats,
            "rows": rows,
        }
        options.json.write_text(json.dumps(result, indent=2) + "\n")
    sys.exit(any("error" in row for row in rows))


def visible_gpus() -> list[str]:
    """What to put into CUDA_VISIBLE_DEVICES for each GPU; asks no CUDA, which would hold memory on them."""
    if os.environ.get("JAX_PLATFORMS", "").startswith("cpu") or not shutil.which("nvidia-smi"):
        return []
    if "CUDA_VISIBLE_DEVICES" in os.environ:
        return [gpu for gpu in os.environ["CUDA_VISIBLE_DEVICES"].split(",") if gpu]
    listed = subprocess.run(["nvidia-smi", "-L"], capture_output=True, text=True, timeout=60, check=False).stdout
    return [str(i) for i, line in enumerate(x for x in listed.splitlines() if x.startswith("GPU "))]


def report(impl: str, row: dict[str, Any], one: dict[str, Any]) -> None:
    """Prints a row, and how it compares with one device."""
    for name in METRICS.values():
        if name in row and name in one:
            row[f"speedup_{name}"] = row[name] / one[name]
    if row["devices"] > 1 and "speedup_steps_per_s" in row:
        print(f"devices.{impl}.{row['devices']}.{row['way']}.speedup {row['speedup_steps_per_s']:.3f}", flush=True)
    for name in (*METRICS.values(), "compile_s", "error"):
        if name in row:
            value = row[name] if name == "error" else f"{row[name]:.6g}"
            print(f"devices.{impl}.{row['devices']}.{row['way']}.{name} {value}", flush=True)


def measured(options: argparse.Namespace, way: str, n: int, gpus: list[str], folder: pathlib.Path) -> dict[str, Any]:
    """A row: what children measured on n devices, or the error of the first that failed."""
    here = pathlib.Path(tempfile.mkdtemp(dir=folder))
    n_processes = 1 if way == "mesh" else n
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    children = []
    row: dict[str, Any] = {"devices": n, "way": way}
    deadline = time.monotonic() + options.timeout
    try:
        for rank in range(n_processes):
            mine = gpus[:n] if way == "mesh" else gpus[rank : rank + 1]
            call = {"way": way, "n": n, "rank": rank, "folder": str(here), "port": port}
            command = [sys.executable, "-m", "benchmarks.devices", *sys.argv[1:], "--child", json.dumps(call)]
            with (here / f"log.{rank}").open("w") as log:
                env = environment(mine, n if way == "mesh" else 1, folder)
                children.append(subprocess.Popen(command, stdout=log, stderr=log, env=env, cwd=measure.ROOT))
        for file in ("ready", "result"):
            while len(list(here.glob(f"{file}.*"))) < n_processes:
                for rank, process in enumerate(children):
                    if process.poll() not in (None, 0):
                        log = (here / f"log.{rank}").read_text(errors="replace")
                        raise RuntimeError(f"process {rank} ended with {process.returncode}: {log[-2000:]}")
                if time.monotonic() > deadline:
                    raise TimeoutError(f"not {file} after {options.timeout:g} s")
                time.sleep(0.01)
            (here / "go").touch()
        results = [json.loads((here / f"result.{rank}").read_text()) for rank in range(n_processes)]
        for name in results[0]:
            values = [result[name] for result in results]
            row[name] = max(values) if name == "compile_s" else values[0] if name == "device" else sum(values)
    except (RuntimeError, TimeoutError) as error:
        row["error"] = str(error)
    finally:
        for process in children:
            if "error" in row:
                process.kill()
            try:
                process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                process.kill()
    return row


def environment(gpus: list[str], n: int, folder: pathlib.Path) -> dict[str, str]:
    """Of a child that sees some GPUs, or else n devices of the host."""
    env = {"JAX_COMPILATION_CACHE_DIR": str(folder / "jax"), **os.environ}  # all children compile much the same
    if gpus:
        return {**env, "CUDA_VISIBLE_DEVICES": ",".join(gpus)}
    flags = f"{env.get('XLA_FLAGS', '')} --xla_force_host_platform_device_count={n}"
    return {**env, "JAX_PLATFORMS": "cpu", "XLA_FLAGS": flags}


def child(options: argparse.Namespace, way: str, n: int, rank: int, folder: str, port: int) -> None:
    """Measures in one process and writes a file with rates; those of a mesh over processes are this process' share."""
    faulthandler.dump_traceback_later(options.timeout + 10, exit=True)
    import jax
    from jax.sharding import NamedSharding
    from jax.sharding import PartitionSpec as P

    import mjx_arenas as mja
    from benchmarks import scene

    if way == "distributed":
        jax.distributed.initialize(f"127.0.0.1:{port}", n, rank)
    n_worlds = n * options.worlds_per_device
    if way == "processes":
        keys = jax.random.split(jax.random.key(0), n_worlds)[rank * options.worlds_per_device :]
        keys = keys[: options.worlds_per_device]
    else:
        sharding = NamedSharding(jax.make_mesh((n,), ("worlds",)), P("worlds"))
        keys = jax.jit(lambda: jax.random.split(jax.random.key(0), n_worlds), out_shardings=sharding)()

    arena, ranges = scene.arena(), scene.ranges()
    model = scene.model(arena, options.impl)

    def make() -> tuple:
        batch = arena.randomize(model, keys, ranges)
        return batch, mja.make_data(batch, keys)

    begin = time.perf_counter()
    batch, data = jax.block_until_ready(make())
    jax.block_until_ready(mja.rollout(batch, data, options.steps))
    seconds = {"compile_s": time.perf_counter() - begin}
    here = pathlib.Path(folder)
    (here / f"ready.{rank}").touch()
    while not (here / "go").exists():
        time.sleep(0.001)
    share = n_worlds if way == "mesh" else options.worlds_per_device
    result: dict[str, Any] = {**seconds, "device": jax.local_devices()[0].device_kind}
    result["worlds_made_per_s"] = share / median_seconds(make, options.repeats)
    rolled = median_seconds(lambda: mja.rollout(batch, data, options.steps), options.repeats)
    result["steps_per_s"] = share * options.steps / rolled
    temporary = here / f"writing.{rank}"
    temporary.write_text(json.dumps(result))
    temporary.rename(here / f"result.{rank}")


def median_seconds(function: Callable[[], Any], repeats: int) -> float:
    """Of a call that is compiled already, until its results are there."""
    import jax

    seconds = []
    for _ in range(repeats):
        begin = time.perf_counter()
        jax.block_until_ready(function())
        seconds.append(time.perf_counter() - begin)
    return statistics.median(seconds)


if __name__ == "__main__":
    main()
