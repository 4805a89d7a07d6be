from __future__ import annotations

import os
import pty
import stat
import termios
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from drivers import (
    DeviceLostError,
    PortBusyError,
    PortDeniedError,
    PortError,
    PortMissingError,
    SerialPort,
)


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    ours, theirs = pty.openpty()
    yield ours, os.ttyname(theirs)
    os.close(ours)
    os.close(theirs)


def test_a_port_that_is_not_there() -> None:
    with pytest.raises(PortMissingError, match=r"nothing is plugged in there.*trackside devices"):
        SerialPort("/dev/ttyUSB99")


def test_a_port_that_is_taken(terminal: tuple[int, str]) -> None:
    _, path = terminal
    first = SerialPort(path)
    with pytest.raises(PortBusyError, match="another program holds it"):
        SerialPort(path)
    first.close()
    SerialPort(path).close()


def test_a_file_is_no_serial_port(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("no port")
    with pytest.raises(PortError, match="cannot be opened as a serial port"):
        SerialPort(str(file))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may open every port")
def test_a_port_without_permission_for_users(tmp_path: Path) -> None:
    file = tmp_path / "port"
    file.touch(mode=stat.S_IWGRP)
    with pytest.raises(PortDeniedError, match="dialout"):
        SerialPort(str(file))


def test_a_refusal_of_the_system_is_told_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    import serial

    def refuse(_: object) -> None:
        raise serial.SerialException(13, "could not open port: Permission denied")

    monkeypatch.setattr(serial.Serial, "open", refuse)
    with pytest.raises(PortDeniedError, match="usermod -aG dialout"):
        SerialPort("/dev/ttyUSB0")


def test_a_chunk_is_stamped_when_it_was_read(terminal: tuple[int, str]) -> None:
    ours, path = terminal
    port = SerialPort(path, 57600)
    assert port.read(0.0) is None
    before_ns = port.now_ns()
    os.write(ours, b"hello")
    chunk = port.read(1.0)
    assert chunk is not None
    assert chunk.data == b"hello"
    assert before_ns < chunk.t_ns <= port.now_ns()
    port.set_baud(115200)
    port.close()
    port.close()


def test_a_line_that_a_port_has_not_is_no_obstacle_and_stays_after_closing(
    terminal: tuple[int, str],
) -> None:
    _, path = terminal
    port = SerialPort(path, dtr=False)
    keeper = os.open(path, os.O_RDWR | os.O_NOCTTY)
    port.set_dtr(True)
    port.close()
    # Without HUPCL the system leaves the lines of a real port as they are when it is closed.
    assert not termios.tcgetattr(keeper)[2] & termios.HUPCL
    os.close(keeper)


ASK: list[Callable[[SerialPort], object]] = [
    lambda port: port.read(0.0),
    lambda port: port.write(b"x"),
    lambda port: port.set_baud(57600),
    lambda port: port.set_dtr(True),
]


@pytest.mark.parametrize("ask", ASK)
def test_a_closed_port_is_a_lost_device_whatever_is_asked(
    terminal: tuple[int, str], ask: Callable[[SerialPort], object]
) -> None:
    _, path = terminal
    port = SerialPort(path)
    port.close()
    with pytest.raises(DeviceLostError, match=path):
        ask(port)
