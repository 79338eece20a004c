"""The folder in which JAX keeps compiled programs from one process to the next, set before JAX is imported."""

import os
import pathlib


def folder() -> pathlib.Path:
    """The default folder of XLA's programs."""
    cache = os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache"
    return pathlib.Path(cache, "mjx_arenas", "xla")


def keep() -> None:
    """Makes JAX keep its programs, as Warp keeps its kernels by itself. Variables that are already set stay.

    For programs of the library's own, not for the user's: it holds for all of JAX in the process. It must come before JAX's first
    use. XLA logs, on CPUs, a long line for each program that it takes from there: those lines are switched off.
    """
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(folder()))
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
