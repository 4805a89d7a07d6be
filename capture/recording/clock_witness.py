"""Other clocks, asked at the start and at the end of a recording, in the background.

Nothing here may delay or spoil a recording: what fails is kept as a fault, what takes too long is
left behind.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial

from capture.chrony import chrony_words
from capture.network_clock import ask
from capture.session_info import PeerClock

FIRST_S, LAST_S = 2.0, 0.5
WAIT_S = 2.0
"""So long the end of a recording waits for the last answers, its data being safe already."""
Asked = Callable[[str, float, Callable[[], bool]], PeerClock]


def _ask(server: str, seconds: float, ended: Callable[[], bool]) -> PeerClock:
    return ask(server, seconds, ended=ended)


class ClockWitness:
    """What the clock server and chrony say; `server` "" asks none.

    faults : why there was no answer.
    """

    def __init__(
        self, server: str = "", asked: Asked = _ask, chrony: Callable[[], str] = chrony_words
    ) -> None:
        self.faults: list[str] = []
        self._server, self._asked, self._chrony = server, asked, chrony
        self._told: list[PeerClock] = []
        self._words: list[str] = []
        self._ended = threading.Event()
        self._threads: list[threading.Thread] = []

    def begin(self) -> None:
        """Ask for the first time."""
        self._start(partial(self._look, FIRST_S, self._ended.is_set))

    def begin_last(self) -> None:
        """Ask again, where anybody has answered before."""
        self._ended.set()
        self._start(self._look_again)

    def told(self, wait_s: float = WAIT_S) -> tuple[tuple[PeerClock, ...], tuple[str, ...]]:
        """The answers, and chrony's words, as far as they have come after so long."""
        for thread in self._threads:
            thread.join(wait_s)
        return tuple(self._told), tuple(self._words)

    def _start(self, work: Callable[[], None]) -> None:
        thread = threading.Thread(target=work, name="clock witness", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _look_again(self) -> None:
        self._threads[0].join(WAIT_S)
        if self._told or self._words or not self.faults:
            self._look(LAST_S, lambda: False)

    def _look(self, seconds: float, ended: Callable[[], bool]) -> None:
        words = self._chrony()
        if words:
            self._words.append(words)
        if not self._server:
            return
        try:
            self._told.append(self._asked(self._server, seconds, ended))
        except Exception as err:
            self.faults.append(str(err))
