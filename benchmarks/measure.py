"""Timing, and the record of where and with what it was done."""

import datetime
import functools
import importlib.metadata
import json
import math
import os
import pathlib
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from typing import Any

import mjx_arenas

ROOT = pathlib.Path(__file__).parent.parent
PACKAGES = ("mjx_arenas", "mujoco", "mujoco-mjx", "jax", "jaxlib", "warp-lang", "numpy")
MAX_CALLS = 50


class Skipped(Exception):
    """A case cannot run here; the message says why."""


def interleaved(
    functions: Mapping[str, Callable[[], Any]], repeats: int = 5, sample_seconds: float = 0.02
) -> dict[str, float]:
    """Median seconds of one call of each function, measured in turns: A, B, A, B, ...

    Args:
        functions: each returns what to wait for. Their first two calls, in which they compile, do not count.
        repeats: samples of each.
        sample_seconds: a sample is as many calls back to back as last this long [s], at most 50.
    """
    calls = {}
    for name, function in functions.items():
        _sample(function, 1)
        calls[name] = min(MAX_CALLS, max(1, math.ceil(sample_seconds / _sample(function, 1))))
    samples: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(repeats):
        for name, function in functions.items():
            samples[name].append(_sample(function, calls[name]))
    return {name: statistics.median(seconds) for name, seconds in samples.items()}


def _sample(function: Callable[[], Any], calls: int) -> float:
    import jax

    begin = time.perf_counter()
    for _ in range(calls):
        result = function()
    jax.block_until_ready(result)
    return (time.perf_counter() - begin) / calls


def on_device(function: Callable[[], Any], calls: int = 5) -> tuple[float, int]:
    """Seconds in which a GPU is busy with one call of a function that has compiled, and the number of its kernels and copies.

    Raises:
        Skipped: the profile has no GPU in it.
    """
    import jax

    jax.block_until_ready(function())
    with tempfile.TemporaryDirectory() as folder:
        with jax.profiler.trace(folder):
            for _ in range(calls):
                jax.block_until_ready(function())
        (profile,) = pathlib.Path(folder).rglob("*.xplane.pb")
        planes = jax.profiler.ProfileData.from_file(str(profile)).planes
        lines = [line for plane in planes if plane.name.startswith("/device:GPU") for line in plane.lines]
        spans = [event.duration_ns for line in lines if line.name.startswith("Stream") for event in line.events]
    if not spans:
        raise Skipped("the profile has no kernels of a GPU")
    return sum(spans) / calls * 1e-9, round(len(spans) / calls)


def accessed(function: Any, *arguments: Any) -> float:
    """Bytes that the kernels of a jitted function read and write, as XLA counts them."""
    costs = function.lower(*arguments).compile().cost_analysis()
    return float(costs["bytes accessed"])


@functools.cache
def copy_seconds_per_byte() -> float:
    """Seconds that a plain device copy of 1 GiB (256 MiB on a CPU) takes, a byte."""
    import jax
    import jax.numpy as jnp

    flat = jnp.ones(2**28 if jax.default_backend() != "cpu" else 2**26, jnp.float32)
    copy = jax.jit(jnp.copy)
    return interleaved({"copy": lambda: copy(flat)})["copy"] / flat.nbytes


def child(*arguments: str, env: Mapping[str, str] | None = None, timeout: float = 900) -> dict[str, Any]:
    """The last line that a Python process with these arguments prints, which is JSON.

    Raises:
        RuntimeError: it failed; the message ends with what it said last.
    """
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env={**os.environ, **(env or {})},
        timeout=timeout,
        capture_output=True,
        text=True,
    )
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if line.strip()] or ["it said nothing"]
        raise RuntimeError(f"exit code {done.returncode}: {lines[-1].strip()[:300]}")
    return json.loads(done.stdout.splitlines()[-1])


def environment() -> dict[str, Any]:
    """Device, processor, versions, commit and date.

    JAX is asked in a child process: this one must not hold the device's memory when a case starts children.
    """
    commit, dirty = _commit()
    return {
        **child("-m", "benchmarks.measure"),
        "cpu": _cpu(),
        "cores": len(os.sched_getaffinity(0)),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in PACKAGES},
        "commit": commit,
        "uncommitted_changes": dirty,
        "date": datetime.date.today().isoformat(),
    }


def _cpu() -> str:
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def version(name: str) -> str:
    """The version of an installed package, and of this folder."""
    if name == "mjx_arenas":  # what is measured is this folder, installed or not
        return mjx_arenas.__version__
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def _commit() -> tuple[str, bool | None]:
    """Commit of the code that is measured, and whether it was changed since; results do not count."""

    def git(*arguments: str) -> str:
        return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()

    if commit := os.environ.get("MJX_ARENAS_COMMIT"):
        return commit, None
    try:
        changed = git("status", "--porcelain", "--untracked-files=no", "--", ".", ":!benchmarks/results")
        return git("rev-parse", "HEAD"), bool(changed)
    except (OSError, subprocess.CalledProcessError):
        return "unknown", None


if __name__ == "__main__":
    import jax

    device = jax.devices()[0]
    print(json.dumps({"platform": device.platform, "device": device.device_kind, "devices": jax.device_count()}))
