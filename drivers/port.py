"""A byte stream to a device, together with the clock that stamps its bytes.

Every driver is written against `Port`. On the car it is a `SerialPort`; in tests it is the device's
emulator itself (`drivers.emulation.ModelPort`), whose clock needs no real time to pass.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import select
import time
from dataclasses import dataclass
from typing import Protocol

from drivers.errors import (
    DeviceLostError,
    PortBusyError,
    PortDeniedError,
    PortError,
    PortMissingError,
)

READ_BYTES = 65536


@dataclass(frozen=True)
class Chunk:
    """Bytes as they came, and when: `time.monotonic_ns()` just after the read that gave them."""

    t_ns: int
    data: bytes


class Port(Protocol):
    """A byte stream to a device, and the clock by which its bytes are stamped.

    Raises `DeviceLostError` from `read` and `write` when the other end is gone.
    """

    @property
    def name(self) -> str:
        """How a person knows the port: its path."""

    def now_ns(self) -> int:
        """The monotonic time that stamps the chunks."""

    def pause(self, seconds: float) -> None:
        """Let that time pass; bytes that arrive meanwhile wait."""

    def read(self, timeout_s: float) -> Chunk | None:
        """All bytes that have come, as soon as there is one; None if none came in time."""

    def write(self, data: bytes) -> None:
        """Send all bytes."""

    def set_baud(self, baud: int) -> None:
        """Change the speed of the line; bytes that wait are dropped."""

    def close(self) -> None:
        """Give the port back; may be called twice."""


class SerialPort:
    """A serial port of this machine, raw and held exclusively.

    path : a device path, best one under /dev/serial/by-id; dtr : state of that line, which starts
    and stops the motor of some lidars (None leaves it as it is).
    Raises `PortMissingError`, `PortDeniedError`, `PortBusyError` or `PortError`.
    """

    def __init__(self, path: str, baud: int = 115200, *, dtr: bool | None = None) -> None:
        import serial

        self._name = path
        self._serial = serial.Serial()
        self._serial.port, self._serial.baudrate = path, baud
        self._serial.timeout, self._serial.write_timeout = 0, 1.0
        self._serial.exclusive = True
        if dtr is not None:
            self._serial.dtr = dtr  # before opening: pyserial would assert it
        try:
            self._serial.open()
            # TIOCEXCL does not stop root, nor programs that opened the port before us.
            fcntl.flock(self._serial.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except (OSError, serial.SerialException) as err:
            self._serial.close()
            raise _opening_error(path, err) from err
        with contextlib.suppress(ValueError, OSError, NotImplementedError):
            self._serial.set_low_latency_mode(True)  # FTDI waits 16 ms otherwise; a pty cannot

    @property
    def name(self) -> str:
        """The path it was opened by."""
        return self._name

    def now_ns(self) -> int:
        """The machine's monotonic clock."""
        return time.monotonic_ns()

    def pause(self, seconds: float) -> None:
        """Sleep."""
        time.sleep(seconds)

    def read(self, timeout_s: float) -> Chunk | None:
        """All bytes that have come, as soon as there is one; None if none came in time."""
        try:
            ready, _, _ = select.select([self._serial.fileno()], [], [], max(timeout_s, 0.0))
            if not ready:
                return None
            data = os.read(self._serial.fileno(), READ_BYTES)
            t_ns = time.monotonic_ns()
        except (OSError, TypeError, ValueError) as err:
            raise self._lost(err) from err
        if not data:
            raise self._lost(None)
        return Chunk(t_ns, data)

    def write(self, data: bytes) -> None:
        """Send all bytes."""
        import serial

        try:
            self._serial.write(data)
        except (OSError, TypeError, serial.SerialException) as err:  # TypeError: closed meanwhile
            raise self._lost(err) from err

    def set_baud(self, baud: int) -> None:
        """Change the speed of the line; bytes that wait are dropped."""
        import termios

        import serial

        try:
            self._serial.baudrate = baud
            self._serial.reset_input_buffer()
        except (OSError, serial.SerialException, termios.error) as err:
            raise self._lost(err) from err

    def set_dtr(self, level: bool) -> None:
        """Set that line, which stays so after closing; nothing happens where a port has none."""
        import termios

        try:
            attributes = termios.tcgetattr(self._serial.fileno())
            attributes[2] &= ~termios.HUPCL  # else the system lowers the line when we close
            termios.tcsetattr(self._serial.fileno(), termios.TCSANOW, attributes)
            self._serial.dtr = level
        except (OSError, TypeError, ValueError, termios.error) as err:
            if getattr(err, "errno", None) not in (errno.ENOTTY, errno.EINVAL):
                raise self._lost(err) from err

    def close(self) -> None:
        """Give the port back."""
        with contextlib.suppress(OSError):
            self._serial.close()

    def _lost(self, err: Exception | None) -> DeviceLostError:
        why = f" ({err})" if err else ""
        return DeviceLostError(
            f"{self._name}: the device is gone{why}; check its cable and power, plug it in again"
        )


def drain(port: Port, *, quiet_s: float = 0.05, limit_s: float = 1.0) -> int:
    """Read until nothing has come for `quiet_s`; how many bytes were thrown away.

    Ends after `limit_s` in any case: a device that never pauses is the caller's to judge.
    """
    thrown, end_ns = 0, port.now_ns() + round(limit_s * 1e9)
    while port.now_ns() < end_ns:
        chunk = port.read(quiet_s)
        if chunk is None:
            break
        thrown += len(chunk.data)
    return thrown


def _opening_error(path: str, err: Exception) -> PortError:
    """The system's word, and what a person does about it."""
    number = getattr(err, "errno", None)
    if number is None and isinstance(err.__cause__ or err.__context__, OSError):
        number = getattr(err.__cause__ or err.__context__, "errno", None)
    if number in (errno.EACCES, errno.EPERM):
        return PortDeniedError(
            f"{path}: no permission; add yourself to the group that owns it "
            "(sudo usermod -aG dialout $USER, then log in again) or install the udev rules "
            "(docs/car.md)"
        )
    if number in (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK):
        return PortBusyError(
            f"{path}: another program holds it; stop that program "
            f"(fuser -v {path} names it; ModemManager is a usual one: trackside doctor)"
        )
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return PortMissingError(
            f"{path}: nothing is plugged in there; check cable and power, then see "
            "trackside devices for the ports there are"
        )
    return PortError(f"{path}: cannot be opened as a serial port: {err}; see trackside devices")
