"""Warp starts without a line about the GPU that is not there, and keeps all others."""

import os
import subprocess
import sys

import pytest

from mjx_arenas import gpu
from mjx_arenas.sim import warp_start

warp = pytest.importorskip("warp")


def test_other_lines_are_written_afterwards(monkeypatch, capfd):
    """Whatever Warp's own library writes, also where its start fails."""

    def init():
        os.write(2, b"one\nWarp CUDA warning: Could not find or load the NVIDIA CUDA driver. No GPU.\nother\n")
        raise RuntimeError("failed")

    monkeypatch.setattr(warp, "init", init)
    with pytest.raises(RuntimeError, match="failed"):
        warp_start.without_gpu.__wrapped__()
    os.write(2, b"after\n")
    assert capfd.readouterr().err == "one\nother\nafter\n"


@pytest.mark.skipif(gpu.has_gpu(), reason="there is a GPU")
def test_nothing_is_said_without_a_gpu():
    code = "import mjx_arenas as mja; print(mja.TableArena().put_model('warp').impl.value)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("warp\n", "")
