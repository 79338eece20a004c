"""The GPU, before JAX is there to be asked."""

import importlib.util
import os

_JAX_MEMORY = ("XLA_PYTHON_CLIENT_PREALLOCATE", "XLA_PYTHON_CLIENT_MEM_FRACTION")


def has_gpu() -> bool:
    """Whether there is an NVIDIA GPU, on Linux or on Windows below it."""
    return any(os.path.exists(device) for device in ("/dev/nvidiactl", "/dev/dxg"))


def leave_room(impl: str | None) -> None:
    """Has JAX take the GPU's memory as it needs it, where Warp will allocate its own beside; what is set stays.

    JAX takes three quarters when it starts, so this must come before its first use.

    Args:
        impl: of MJX, or the engine, that will step; None: the quick one here.
    """
    warp = impl == "warp" or (impl is None and importlib.util.find_spec("warp") is not None)
    if warp and has_gpu() and not any(name in os.environ for name in _JAX_MEMORY):
        os.environ["XLA_PYTHON_CLIENT_PREALLOCATE"] = "false"
