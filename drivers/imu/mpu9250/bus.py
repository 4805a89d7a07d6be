"""An I2C bus together with the clock of whoever waits on it; on the car through smbus2."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import time
from typing import TYPE_CHECKING, Protocol

from drivers.errors import (
    DriverError,
    PortBusyError,
    PortDeniedError,
    PortError,
    PortMissingError,
)

if TYPE_CHECKING:
    from smbus2 import SMBus


class Bus(Protocol):
    """Registers of chips on an I2C bus, and the clock by which they are polled.

    `read_block` and `write_byte` raise `OSError` when no chip acknowledges or the bus is closed.
    """

    @property
    def name(self) -> str:
        """How a person knows the bus: its path."""

    def now_ns(self) -> int:
        """The monotonic time that stamps what is read."""

    def pause(self, seconds: float) -> None:
        """Let that time pass."""

    def read_block(self, address: int, register: int, count: int) -> bytes:
        """That many bytes from a register on, in one transfer."""

    def write_byte(self, address: int, register: int, value: int) -> None:
        """Set one register."""

    def close(self) -> None:
        """Give the bus back; may be called twice."""


class SmbusBus:
    """An I2C bus of this machine, such as /dev/i2c-1; no second program of ours may hold it.

    Raises `DriverError` where smbus2 is not installed, else `PortMissingError`,
    `PortDeniedError`, `PortBusyError` or `PortError`.
    """

    def __init__(self, path: str) -> None:
        try:
            import smbus2
        except ImportError as err:
            raise DriverError(
                f"{path}: an IMU on I2C needs the package smbus2, which is not installed; "
                "install it with: pip install trackside[imu-i2c]"
            ) from err
        self._name = path
        self._read, self._write = smbus2.i2c_msg.read, smbus2.i2c_msg.write
        self._bus: SMBus = smbus2.SMBus()
        try:
            self._bus.open(path)
            # Two programs that empty one FIFO would each get half of the samples.
            fcntl.flock(self._descriptor(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as err:
            self.close()
            raise _opening_error(path, err) from err

    @property
    def name(self) -> str:
        """The path it was opened by."""
        return self._name

    def now_ns(self) -> int:
        """The machine's monotonic clock."""
        return time.monotonic_ns()

    def pause(self, seconds: float) -> None:
        """Sleep."""
        time.sleep(max(seconds, 0.0))

    def read_block(self, address: int, register: int, count: int) -> bytes:
        """That many bytes from a register on, in one transfer with a repeated start."""
        self._descriptor()
        answer = self._read(address, count)
        self._bus.i2c_rdwr(self._write(address, [register]), answer)
        return bytes(answer)

    def write_byte(self, address: int, register: int, value: int) -> None:
        """Set one register."""
        self._descriptor()
        self._bus.i2c_rdwr(self._write(address, [register, value]))

    def close(self) -> None:
        """Give the bus back."""
        with contextlib.suppress(OSError):
            self._bus.close()

    def _descriptor(self) -> int:
        descriptor = self._bus.fd
        if descriptor is None:
            raise OSError(errno.EBADF, f"{self._name} is closed")
        return int(descriptor)


def _opening_error(path: str, err: OSError) -> PortError:
    """The system's word, and what a person does about it."""
    if err.errno in (errno.EACCES, errno.EPERM):
        return PortDeniedError(
            f"{path}: no permission; add yourself to the group that owns it "
            "(sudo usermod -aG i2c $USER, then log in again)"
        )
    if err.errno in (errno.EAGAIN, errno.EBUSY):
        return PortBusyError(
            f"{path}: another program of trackside reads this bus; stop that program "
            f"(fuser -v {path} names it)"
        )
    if err.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return PortMissingError(
            f"{path}: there is no such I2C bus; see which there are with ls /dev/i2c-* "
            "(none: sudo modprobe i2c-dev) and set the IMU's bus in rig.yaml"
        )
    return PortError(f"{path}: cannot be opened as an I2C bus: {err}; ls -l /dev/i2c-* shows them")
