from __future__ import annotations

import os
import signal

import pytest

from dialogue import asked_to_end


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_sets_the_event_and_nothing_else(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with asked_to_end() as ended:
        assert not ended.is_set()
        os.kill(os.getpid(), number)
        assert ended.wait(5.0)
    assert signal.getsignal(number) is before
