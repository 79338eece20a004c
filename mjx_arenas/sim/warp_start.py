"""Warp's start on a machine without a GPU, of which it prints a line (host)."""

import functools
import os
import sys
import tempfile

_NO_DRIVER = b"Could not find or load the NVIDIA CUDA driver"


@functools.cache
def without_gpu() -> None:
    """Starts Warp, once, without the line that there is no driver of a GPU, which its C prints whatever it is told.

    What else is written to stderr meanwhile is written there afterwards.
    """
    import warp

    sys.stderr.flush()
    try:
        stderr = os.dup(2)
    except OSError:  # there is none
        warp.init()
        return
    with tempfile.TemporaryFile() as held:
        os.dup2(held.fileno(), 2)
        try:
            warp.init()
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
            held.seek(0)
            for line in held:
                if _NO_DRIVER not in line:
                    os.write(2, line)
