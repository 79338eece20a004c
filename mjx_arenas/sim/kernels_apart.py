"""Warp's kernels compiled by several processes, into the cache that all share. As a program: one of those that help."""

import contextlib
import json
import logging
import os
import pathlib
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from typing import Any

import mujoco

from mjx_arenas.sim import launched

_log = logging.getLogger("mjx_arenas")


# The kernels that take NVIDIA's compiler longest, the longest first: of 47 s of a scene of boxes 21, 7, 5, 5 and 3 s (two CPU cores).
_LONG = ("ccd_kernel", "_update_gradient_cholesky", "_src.smooth", "_src.passive", "_src.forward")


def compile_together(
    mj_model: mujoco.MjModel,
    sizes: tuple[int, int, int],
    fields: Sequence[str],
    on: Any,
    needed: Sequence[tuple[Any, int]],
    n_processes: int,
) -> None:
    """Compiles the kernels of a step with the help of so many processes; waits until all are done.

    Each takes the longest that nobody has begun with. This process needs no time to start, so it has the very longest. A process that fails
    leaves its kernels to whoever needs them.

    Args:
        mj_model: the template.
        sizes: as of `launched.Sizes`.
        fields: last names of those that each world has its own of.
        on: the device of Warp.
        needed: as of `launched.of_step`, of the same model.
        n_processes: that help.
    """
    import warp as wp

    with tempfile.TemporaryDirectory() as folder:
        mujoco.mj_saveModel(mj_model, f"{folder}/model.mjb")
        asked = {"sizes": sizes, "fields": list(fields), "device": on.alias}
        pathlib.Path(folder, "asked.json").write_text(json.dumps(asked))
        cache = os.path.dirname(str(wp.config.kernel_cache_dir))  # Warp adds its version
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "WARP_CACHE_PATH": cache}
        command = [sys.executable, "-m", __name__, folder]
        with contextlib.ExitStack() as stack:
            for _ in range(n_processes):
                quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
                stack.enter_context(_ended(subprocess.Popen(command, env=env, **quiet)))
            _take_turns(pathlib.Path(folder), needed, on)


def _take_turns(folder: pathlib.Path, needed: Sequence[tuple[Any, int]], on: Any) -> None:
    """Compiles what no other process has begun with; who begins with a kernel leaves a file of its number."""

    def rank(index: int) -> int:
        name = needed[index][0].name
        return next((i for i, part in enumerate(_LONG) if part in name), len(_LONG))

    for index in sorted(range(len(needed)), key=rank):
        with contextlib.suppress(FileExistsError):
            (folder / str(index)).touch(exist_ok=False)
            launched.load(*needed[index], on)


@contextlib.contextmanager
def _ended(process: subprocess.Popen) -> Any:
    """Waits for a process at the end; where something else ends it all, it is stopped."""
    try:
        yield
        if process.wait():
            _log.debug("a process that compiles kernels ended with code %s", process.returncode)
    finally:
        process.kill()
        process.wait()


def main(folder: pathlib.Path) -> None:
    """Helps with what is asked for in a folder."""
    import warp as wp

    asked = json.loads((folder / "asked.json").read_text())
    model, on = mujoco.MjModel.from_binary_path(str(folder / "model.mjb")), wp.get_device(asked["device"])
    _take_turns(folder, launched.of_step(model, launched.Sizes(*asked["sizes"]), asked["fields"], on), on)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
