import ctypes
import gc
import importlib.metadata
import os
import pathlib
import resource
import runpy
import sys

ROOT = pathlib.Path(__file__).parent.parent
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(ROOT / ".cache" / "jax"))
# Most programs are small, and there are thousands; where in Python an operation comes from nobody reads here.
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
os.environ.setdefault("JAX_TRACEBACK_IN_LOCATIONS_LIMIT", "0")
os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")  # XLA warns of each program that it loads
os.environ.setdefault("WARP_CACHE_PATH", str(ROOT / ".cache" / "warp"))
# Four devices; and little optimization, since the tests compile far longer than they run.
FLAGS = "--xla_force_host_platform_device_count=4 --xla_backend_optimization_level=0 --xla_cpu_parallel_codegen_split_count=1"
if importlib.metadata.version("jaxlib").startswith("0.9."):  # the older emitters are fast there, and crash in 0.12
    FLAGS += " --xla_cpu_use_fusion_emitters=false"
os.environ.setdefault("XLA_FLAGS", FLAGS)

from mjx_arenas.viz import render  # noqa: E402

render.choose_gl()  # before MuJoCo is imported

import jax  # noqa: E402
import pytest  # noqa: E402
import worlds  # noqa: E402
from command import here, scenes  # noqa: E402

import mjx_arenas as mja  # noqa: E402

runpy.run_path(f"{worlds.CHILDREN}/sitecustomize.py")
gc.freeze()
gc.set_threshold(100_000, 50, 100)  # tracing makes many objects that live on


# Those that take longest come first, so that no worker waits for one at the end.
LONGEST = (
    "sharding",
    "culling",  # without Warp, whose kernels the other worker compiles meanwhile
    "scenes",
    "envs",
    "dr",
    "stepped",
    "pixels",
    "furniture_many",
    "notebooks",
    "arms",
    "variants",
    "physics",
    "attach",
    "train",
    "settled",
    "judged_in_c",
    "own_training",
    "vision",
    "woken",
    "furniture_moves",
    "setconst",
    "surfaces",
    "batch",
    "compile_oracle",
)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Marks come before `-m` chooses; the order comes after pytest has put those of each `impl` together."""
    for item in items:
        params = [p for p in item.callspec.params.values() if isinstance(p, str)] if hasattr(item, "callspec") else []
        for mark in ("slow", "xslow"):
            if any(on.args[0] in params for on in item.iter_markers(f"{mark}_on")):
                item.add_marker(mark)
    if config.option.markexpr and "xslow" not in config.option.markexpr:
        left_out = [item for item in items if item.get_closest_marker("xslow")]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if not item.get_closest_marker("xslow")]
    yield
    order = {f"test_{name}": i for i, name in enumerate(LONGEST)}
    items.sort(key=lambda item: (order.get(item.module.__name__, len(order)), item.path))


LIBC = ctypes.CDLL("libc.so.6") if sys.platform == "linux" else None
ROOM = 2.1e9  # bytes of a worker, above which it lets go of what is compiled between files: the next may take as much again
MOST = 2.4e9  # the same between two tests of a file, which share what is compiled


def resident():
    """Bytes of this process."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


KEPT = [0]  # bytes that were left when it last let go: what tests hold themselves


def let_go(above):
    """Frees what is compiled where there is much of it: workers stay under 3 GB."""
    if resident() > max(above, 1.3 * KEPT[0]):
        jax.clear_caches()
        gc.collect()
        if LIBC is not None:
            LIBC.malloc_trim(0)
        KEPT[0] = resident()


@pytest.fixture(autouse=True, scope="module")
def lean(request):
    """Between files, whose own caches hold arenas with their meshes."""
    yield
    for kept in vars(request.module).values():
        if hasattr(kept, "cache_clear"):
            kept.cache_clear()
    KEPT[0] = 0
    let_go(ROOM)


@pytest.fixture(autouse=True)
def leaner():
    """Between tests."""
    yield
    let_go(MOST)


LIMIT = 3e9  # bytes that a worker of the quick tests may ever have had
PEAKS = {}  # bytes that each worker has had at most


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    """Of xdist, where a worker is done."""
    if "peak" in getattr(node, "workeroutput", {}):
        PEAKS[node.gateway.id] = node.workeroutput["peak"]


def pytest_sessionfinish(session):
    """A worker says what it took; who started them fails where that was too much."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["peak"] = peak
        return
    PEAKS.update({} if PEAKS else {"main": peak})
    if session.config.option.markexpr == "not slow" and max(PEAKS.values()) > LIMIT and not session.exitstatus:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter):
    told = ", ".join(f"{name} {peak / 1e9:.2f} GB" for name, peak in sorted(PEAKS.items()))
    terminalreporter.write_line(f"Most memory of each worker ({LIMIT / 1e9:g} GB for `make test`): {told}")


@pytest.fixture(scope="session", params=["jax", "warp"])
def impl(request):
    """Each implementation of MJX."""
    return request.param


@pytest.fixture(scope="session")
def arena():
    """Three tables, far enough apart never to meet; a box, a sphere and a capsule on them."""
    return worlds.arena(3)


@pytest.fixture(scope="session")
def keys():
    return jax.random.split(jax.random.key(0), 12)


@pytest.fixture(scope="session")
def batch(arena, impl, keys):
    """Twelve random worlds of `arena`."""
    return arena.randomize(arena.put_model(impl), keys, worlds.RANGES)


@pytest.fixture
def optimized_rays(monkeypatch):
    """Warp's ray caster with optimization, for tests that draw millions of pixels: 6 s more to compile, a tenth of the time to draw."""
    module = pytest.importorskip("mujoco.mjx.third_party.mujoco_warp._src.render")
    build = getattr(module, "_build_megakernel", None)
    if build is not None:  # elsewhere it only takes longer

        def built(*args):
            kernel = build(*args)
            kernel.module.options["optimization_level"] = 1
            return kernel

        monkeypatch.setattr(module, "_build_megakernel", built)


__all__ = ["here", "mja", "scenes"]
