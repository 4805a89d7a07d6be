"""How a person says that it is enough: Ctrl-C, a closed terminal, the system's stop."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def asked_to_end() -> Iterator[threading.Event]:
    """An event that Ctrl-C, SIGTERM and SIGHUP set while the block lasts, so that it ends whole.

    For the main thread only, as Python has it.
    """
    asked = threading.Event()
    before: dict[int, Callable[..., object] | int | None] = {
        number: signal.signal(number, lambda *_: asked.set()) for number in _SIGNALS
    }
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
