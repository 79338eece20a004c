"""What a signal that asks this process to stop does: it stops at once, and nothing unfinished stays."""

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator

from mjx_arenas.files import output

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_more: list[Callable[[], str]] = []


@contextlib.contextmanager
def saying(more: Callable[[], str]) -> Iterator[None]:
    """Has more be said to whoever stops what runs meanwhile."""
    _more.append(more)
    try:
        yield
    finally:
        _more.remove(more)


def listen() -> None:
    """Starts a thread that waits for the signals.

    Python itself answers them between two of its own instructions, which may be minutes away while XLA compiles.
    Signals that are ignored, as `nohup` and a script's `&` ask for, stay so.
    """
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing)
    for number in SIGNALS:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, lambda *_: None)  # the thread's
    threading.Thread(target=_wait, args=(reading,), daemon=True).start()


def _wait(reading: int) -> None:
    number = 0
    while number not in SIGNALS:
        number = os.read(reading, 1)[0]
    output.abandon()
    words = ["interrupted"]
    for more in _more:
        with contextlib.suppress(Exception):  # such as of a folder that cannot be read: it stops without
            words.append(more())
    clear_line_and_show_cursor = b"\r\x1b[K\x1b[?25h" if os.isatty(2) else b""
    with contextlib.suppress(OSError):  # nobody reads
        os.write(2, clear_line_and_show_cursor + "; ".join(words).encode() + b"\n")
    os._exit(128 + number)
