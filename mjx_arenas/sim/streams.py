"""Keeps JAX's streams known to Warp (host).

Warp lists the streams that it may record graphs on by their address. A `warp.Stream` around a stream of JAX's adds it, and takes it off the
list when Python collects it, although other `warp.Stream`s of the same stream may live. MJX makes one for each graph that it records. If
that of an earlier program is collected at such a time, Warp knows the stream no longer ("unknown stream").
docs/upstream/external_streams.md has a script.
"""

import functools
from typing import Any


@functools.cache
def keep_known() -> None:
    """Has Warp take a stream off its list only with the `warp.Stream` that made it, so those of JAX's stay."""
    import warp

    release = warp.Stream.__del__

    @functools.wraps(release)
    def of_its_own(stream: Any) -> None:
        if stream.owner:
            release(stream)

    warp.Stream.__del__ = of_its_own
