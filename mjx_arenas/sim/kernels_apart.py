"""Warp's kernels compiled by processes of their own, into the cache that all share. As a program: one of these processes."""

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

_log = logging.getLogger("mjx_arenas")


def compile_apart(
    mj_model: mujoco.MjModel, sizes: tuple[int, int, int], fields: Sequence[str], device: str, n_processes: int
) -> None:
    """Has so many processes compile the kernels of a step, as `kernels.of_step` finds them, in turns; waits until they are done.

    A process that fails leaves its kernels to whoever needs them.

    Args:
        mj_model: the template.
        sizes: as of `kernels.Sizes`.
        fields: last names of those that each world has its own of.
        device: of Warp, its alias.
        n_processes: at once.
    """
    import warp as wp

    with tempfile.TemporaryDirectory() as folder:
        mujoco.mj_saveModel(mj_model, f"{folder}/model.mjb")
        asked = {"sizes": sizes, "fields": list(fields), "device": device}
        pathlib.Path(folder, "asked.json").write_text(json.dumps(asked))
        cache = os.path.dirname(str(wp.config.kernel_cache_dir))  # Warp adds its version
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "WARP_CACHE_PATH": cache}
        command = [sys.executable, "-m", __name__, folder]
        with contextlib.ExitStack() as stack:
            for _ in range(n_processes):
                quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
                stack.enter_context(_ended(subprocess.Popen(command, env=env, **quiet)))


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
    """Compiles what no other process has begun with."""
    import warp as wp

    from mjx_arenas.sim import kernels

    asked = json.loads((folder / "asked.json").read_text())
    model, on = mujoco.MjModel.from_binary_path(str(folder / "model.mjb")), wp.get_device(asked["device"])
    needed = kernels.of_step(model, kernels.Sizes(*asked["sizes"]), asked["fields"], on)
    for index, one in enumerate(needed):
        with contextlib.suppress(FileExistsError):
            (folder / str(index)).touch(exist_ok=False)
            kernels.load(*one, on)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
