"""Two machines with clocks of their own, on the loopback."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from capture import read_peer_clock
from capture.network_clock.round_trip import (
    MachineClocks,
    NetworkClockError,
    _packed,
    _Packet,
    _parsed,
    ask,
    host_and_port,
    opened_server,
    serve,
)
from trackside.cli import trackside

LAPTOP = "22222222-2222-2222-2222-222222222222"
AHEAD_NS, UTC_NS = 7_000_000_123_456, 1_780_000_000_000_000_000
HERE = MachineClocks(pause=lambda _: None)
S = 1_000_000_000


def laptop() -> MachineClocks:
    """The clocks of a machine whose monotonic clock is ahead of ours, and whose UTC is its own."""
    begun_ns = time.monotonic_ns()
    return MachineClocks(
        monotonic_ns=lambda: time.monotonic_ns() + AHEAD_NS,
        utc_ns=lambda: UTC_NS + time.monotonic_ns() - begun_ns,
        boot_id=LAPTOP,
    )


@contextmanager
def served(clocks: MachineClocks) -> Iterator[int]:
    """A server of these clocks; its port."""
    ended = threading.Event()
    with closing(opened_server(0, "127.0.0.1")) as server:
        told: list[int] = []
        thread = threading.Thread(target=lambda: told.append(serve(server, ended.is_set, clocks)))
        thread.start()
        try:
            yield int(server.getsockname()[1])
        finally:
            ended.set()
            thread.join(5.0)
            assert not thread.is_alive()


def test_the_offset_of_a_machine_is_found_within_its_bound() -> None:
    with served(laptop()) as port:
        told = ask(f"127.0.0.1:{port}", 0.3, HERE)
    assert abs(told.offset_monotonic_ns - AHEAD_NS) <= told.uncertainty_ns
    assert 0 < told.uncertainty_ns < 5_000_000
    assert told.answers >= 5
    assert (told.boot_id, told.peer) == (LAPTOP, f"127.0.0.1:{port}")
    # UTC of the peer now, by what it was told to be ahead of ours.
    assert abs(told.utc_ns + told.offset_utc_ns - UTC_NS) < 2 * S


class OneTime:
    """One time for two machines, which goes on by itself between any two readings of a clock."""

    def __init__(self) -> None:
        self.now_ns = 1_000 * S
        self._rng = np.random.default_rng(3)

    def clocks(self, ahead_ns: int) -> MachineClocks:
        def read() -> int:
            self.now_ns += int(self._rng.exponential(3_000_000))
            return self.now_ns + ahead_ns

        return MachineClocks(read, lambda: self.now_ns + UTC_NS, lambda _: None, LAPTOP)


def test_ways_of_many_lengths_are_bounded_by_the_shortest() -> None:
    time_of_both = OneTime()
    with served(time_of_both.clocks(AHEAD_NS)) as port:
        told = ask(f"127.0.0.1:{port}", 10.0, time_of_both.clocks(0))
    # Three milliseconds each way in the mean, each at random.
    assert told.answers > 100
    assert told.round_trip_ns < 3_000_000
    assert abs(told.offset_monotonic_ns - AHEAD_NS) <= told.uncertainty_ns


def test_nobody_who_answers_is_told_in_time() -> None:
    with closing(opened_server(0, "127.0.0.1")) as silent:
        port = silent.getsockname()[1]
        begun_s = time.monotonic()
        with pytest.raises(NetworkClockError, match=r"0 answers.*clock serve run there"):
            ask(f"127.0.0.1:{port}", 0.4, HERE)
        assert time.monotonic() - begun_s < 5.0
    with pytest.raises(NetworkClockError, match="no such machine"):
        ask("no-such-machine.invalid", 0.2, HERE)


def test_a_port_that_is_taken_is_told() -> None:
    with closing(opened_server(0, "127.0.0.1")) as first:
        port = first.getsockname()[1]
        with pytest.raises(NetworkClockError, match="is trackside clock serve running already"):
            opened_server(port, "127.0.0.1")


def test_foreign_datagrams_are_neither_answered_nor_believed() -> None:
    with served(laptop()) as port, closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as one:
        place = ("127.0.0.1", port)
        question = _packed(_Packet(1, 5, 77))
        other = [b"XXXX" + question[4:], question[:4] + b"\x09" + question[5:]]
        for foreign in (b"", b"hello", question[:-1], *other, _packed(_Packet(2, 5, 77))):
            one.sendto(foreign, place)
        one.sendto(question, place)
        one.settimeout(5.0)
        answer = _parsed(one.recv(2048), 2)
        assert answer is not None
        assert (answer.sequence, answer.asked_ns, answer.boot_id) == (5, 77, LAPTOP)
        one.settimeout(0.05)
        with pytest.raises(TimeoutError):
            one.recv(2048)


@given(st.binary(max_size=100))
def test_no_bytes_whatsoever_break_the_parser(data: bytes) -> None:
    assert _parsed(data, 1) is None or data.startswith(b"TSCK")


def test_a_packet_comes_back_as_it_was() -> None:
    packet = _Packet(2, 2**60, -5, 1, 2, 3, 4, LAPTOP)
    assert _parsed(_packed(packet), 2) == packet
    assert len(_packed(packet)) == 72


def test_hosts_and_ports() -> None:
    assert host_and_port("laptop") == ("laptop", 47123)
    assert host_and_port("10.0.0.2:5000") == ("10.0.0.2", 5000)
    for wrong in (":5", "laptop:", "laptop:x", "laptop:70000"):
        with pytest.raises(ValueError, match="HOST"):
            host_and_port(wrong)


def test_serve_answers_until_it_is_asked_to_end() -> None:
    with closing(opened_server(0, "127.0.0.1")) as free:
        port = int(free.getsockname()[1])
    command = [sys.executable, "-m", "trackside", "clock", "serve", "--port", str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert f"UDP port {port}" in process.stdout.readline()
        told = ask(f"127.0.0.1:{port}", 0.3, HERE)
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=20)
    assert process.returncode == 0
    assert "asked by 127.0.0.1" in said
    assert f"{told.answers} questions answered" in said
    # One machine, one clock.
    assert abs(told.offset_monotonic_ns) <= told.uncertainty_ns
    assert told.boot_id == told.own_boot_id


def test_ask_prints_a_table_and_keeps_the_answer(tmp_path: Path) -> None:
    file = tmp_path / "clock.yaml"
    with served(laptop()) as port:
        words = ["clock", "ask", f"127.0.0.1:{port}", "--seconds", "0.3", "-o", str(file)]
        done = CliRunner().invoke(trackside, words)
        assert done.exit_code == 0, done.output
        again = CliRunner().invoke(trackside, words)
    assert "uncertainty [ms]" in done.output
    assert "trackside join CAR FILM --clock" in done.output
    assert abs(read_peer_clock(file).offset_monotonic_ns - AHEAD_NS) < 5_000_000
    assert "exists already" in str(again.exception)
    wrong = CliRunner().invoke(trackside, ["clock", "ask", "laptop:x"])
    assert "no HOST or HOST:PORT" in str(wrong.exception)
