"""Warp's kernels without optimization: they compile for longer than they run. For Pythons that tests start, and conftest.py."""

import importlib.util

if importlib.util.find_spec("warp") is not None:
    import warp

    warp.config.optimization_level = 0
