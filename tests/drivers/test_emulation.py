from __future__ import annotations

import pytest

from drivers import DeviceLostError, Line, ModelPort, PtyEmulator, SerialPort, drain


class Parrot:
    """Says everything back after a while, byte by byte at 9600 baud."""

    def __init__(self, delay_ns: int = 5_000_000, baud: int | None = 9600) -> None:
        self.line = Line(baud)
        self.delay_ns = delay_ns

    def receive(self, data: bytes, now_ns: int) -> None:
        for at in range(len(data)):
            self.line.send(data[at : at + 1], now_ns + self.delay_ns)

    def transmit(self, now_ns: int) -> bytes:
        return self.line.due(now_ns)

    def next_ns(self) -> int | None:
        return self.line.next_ns()


def test_bytes_take_the_time_of_the_wire() -> None:
    port = ModelPort(Parrot())
    port.write(b"ab")
    first, second = port.read(1.0), port.read(1.0)
    assert first is not None
    assert second is not None
    assert (first.data, second.data) == (b"a", b"b")
    byte_ns = 10 * 10**9 // 9600
    assert first.t_ns == 5_000_000 + byte_ns
    assert second.t_ns - first.t_ns == byte_ns


def test_silence_is_none_after_the_time_out_and_no_real_time_passes() -> None:
    port = ModelPort(Parrot())
    assert port.read(3600.0) is None
    assert port.now_ns() == 3600 * 10**9


def test_bytes_that_come_during_a_pause_wait() -> None:
    port = ModelPort(Parrot())
    port.write(b"abc")
    port.pause(1.0)
    chunk = port.read(0.0)
    assert chunk is not None
    assert (chunk.data, chunk.t_ns) == (b"abc", 10**9)


def test_a_model_that_is_due_and_silent_does_not_hang_the_port() -> None:
    class Shy(Parrot):
        def next_ns(self) -> int | None:
            return 0

    assert ModelPort(Shy()).read(0.001) is None


def test_a_pulled_cable_fails_reads_and_writes_until_it_is_back() -> None:
    port = ModelPort(Parrot(), name="parrot")
    port.unplug()
    with pytest.raises(DeviceLostError, match="parrot"):
        port.read(0.1)
    with pytest.raises(DeviceLostError, match="plug it in again"):
        port.write(b"x")
    port.plug()
    port.write(b"x")
    assert port.read(1.0) is not None


def test_drain_reads_until_it_is_quiet() -> None:
    port = ModelPort(Parrot())
    port.write(b"x" * 100)
    assert drain(port) == 100
    assert port.read(0.5) is None


def test_drain_ends_with_a_device_that_never_pauses() -> None:
    class Chatter(Parrot):
        def next_ns(self) -> int | None:
            return 0

        def transmit(self, now_ns: int) -> bytes:  # noqa: ARG002  the model's signature
            return b"x"

    port = ModelPort(Chatter())
    assert drain(port, limit_s=0.001) > 0
    assert port.now_ns() >= 1_000_000


def test_behind_a_pseudo_terminal_a_model_answers_a_serial_port() -> None:
    with PtyEmulator(Parrot(delay_ns=0, baud=None)) as emulator:
        port = SerialPort(emulator.path)
        port.write(bytes(range(256)))
        got = b""
        while len(got) < 256:
            chunk = port.read(5.0)
            assert chunk is not None
            got += chunk.data
        port.close()
    assert got == bytes(range(256))
    assert emulator.sent_bytes == 256


def test_hanging_up_is_a_lost_device() -> None:
    emulator = PtyEmulator(Parrot())
    with emulator:
        port = SerialPort(emulator.path)
        emulator.unplug()
        with pytest.raises(DeviceLostError, match=emulator.path):
            port.read(5.0)
    port.close()
