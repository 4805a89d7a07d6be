"""`SmbusBus` against a stand-in for the kernel: there is no I2C bus where tests run."""

from __future__ import annotations

import builtins
import errno
import sys
import types
from pathlib import Path

import pytest
import smbus2

from drivers import DriverError, PortBusyError, PortDeniedError, PortError, PortMissingError
from drivers.imu.mpu9250 import Mpu9250, Mpu9250Config, SmbusBus


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> tuple[str, list[list[bytes | int]]]:
    """A file that opens as a bus, and each transfer made on it; reads answer 0, 1, 2, ..."""
    path = tmp_path / "i2c-7"
    path.touch()
    transfers: list[list[bytes | int]] = []

    def transfer(self: smbus2.SMBus, *messages: smbus2.i2c_msg) -> None:
        assert self.fd is not None
        told: list[bytes | int] = []
        for message in messages:
            if message.flags & 1:
                told += [message.addr, len(message)]
                for k in range(len(message)):
                    message.buf[k] = k % 256
            else:
                told += [message.addr, bytes(message)]
        transfers.append(told)

    monkeypatch.setattr(smbus2.SMBus, "_get_funcs", lambda _: smbus2.I2cFunc(0))
    monkeypatch.setattr(smbus2.SMBus, "i2c_rdwr", transfer)
    return str(path), transfers


def test_a_read_is_one_transfer_with_a_repeated_start(
    kernel: tuple[str, list[list[bytes | int]]],
) -> None:
    path, transfers = kernel
    bus = SmbusBus(path)
    # 504 bytes: far more than the 32 of an SMBus block.
    assert bus.read_block(0x68, 0x74, 504) == bytes(k % 256 for k in range(504))
    bus.write_byte(0x68, 0x6B, 0x80)
    assert transfers == [[0x68, b"\x74", 0x68, 504], [0x68, b"\x6b\x80"]]
    assert bus.name == path
    bus.close()


def test_its_clock_is_the_monotonic_one(kernel: tuple[str, list[list[bytes | int]]]) -> None:
    bus = SmbusBus(kernel[0])
    before_ns = bus.now_ns()
    bus.pause(0.001)
    bus.pause(-1.0)
    assert bus.now_ns() - before_ns >= 1_000_000
    bus.close()


def test_a_second_program_may_not_hold_it(kernel: tuple[str, list[list[bytes | int]]]) -> None:
    first = SmbusBus(kernel[0])
    with pytest.raises(PortBusyError, match="another program of trackside reads this bus"):
        SmbusBus(kernel[0])
    first.close()
    SmbusBus(kernel[0]).close()


def test_a_closed_bus_is_an_error_of_the_system(
    kernel: tuple[str, list[list[bytes | int]]],
) -> None:
    bus = SmbusBus(kernel[0])
    bus.close()
    bus.close()
    with pytest.raises(OSError, match="is closed"):
        bus.read_block(0x68, 0x75, 1)
    with pytest.raises(OSError, match="is closed"):
        bus.write_byte(0x68, 0x75, 1)


def test_a_bus_that_is_not_there() -> None:
    imu = Mpu9250(Mpu9250Config(bus="/dev/i2c-99"))
    with pytest.raises(PortMissingError, match=r"no such I2C bus.*ls /dev/i2c-\*.*modprobe"):
        imu.connect()
    imu.close()


@pytest.mark.parametrize(
    ("number", "kind", "words"),
    [
        (errno.EACCES, PortDeniedError, r"usermod -aG i2c \$USER"),
        (errno.EBUSY, PortBusyError, "fuser"),
        (errno.EIO, PortError, "cannot be opened as an I2C bus"),
    ],
)
def test_a_refusal_of_the_system_is_told_with_its_remedy(
    number: int, kind: type[PortError], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: smbus2.SMBus, __: str) -> None:
        raise OSError(number, "no")

    monkeypatch.setattr(smbus2.SMBus, "open", refuse)
    with pytest.raises(kind, match=words):
        SmbusBus("/dev/i2c-1")


def test_a_file_is_no_bus(tmp_path: Path) -> None:
    path = tmp_path / "i2c-3"
    path.touch()
    with pytest.raises(PortError, match="cannot be opened as an I2C bus"):
        SmbusBus(str(path))


def test_a_missing_package_is_told_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = builtins.__import__

    def without(name: str, *rest: object, **more: object) -> types.ModuleType:
        if name == "smbus2":
            raise ImportError(name)
        return plain(name, *rest, **more)  # type: ignore[arg-type]  # handed through

    monkeypatch.delitem(sys.modules, "smbus2", raising=False)
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(DriverError, match=r"pip install trackside\[imu-i2c\]"):
        SmbusBus("/dev/i2c-1")
