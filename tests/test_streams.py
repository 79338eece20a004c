"""Warp keeps the streams that another library owns."""

import types

import pytest

from mjx_arenas.sim import streams

warp = pytest.importorskip("warp")


def collected(owner):
    """Whether a stream was given back when its `warp.Stream` was collected."""
    asked = []

    class Stream(types.SimpleNamespace):
        @property
        def cuda_stream(self):  # what Warp looks at first; None is not given back
            asked.append(self)

    warp.Stream.__del__(Stream(owner=owner))
    return bool(asked)


def test_kept(monkeypatch):
    """Not that of JAX; its own. Without `keep_known` both."""
    given_back = warp.Stream.__del__
    monkeypatch.setattr(warp.Stream, "__del__", getattr(given_back, "__wrapped__", given_back))
    assert collected(owner=True)
    assert collected(owner=False)
    streams.keep_known.__wrapped__()
    assert collected(owner=True)
    assert not collected(owner=False)
