"""How an MPU-9250 is found, set up and checked, register by register."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

from dialogue import UsageError
from drivers.errors import DeviceFaultError, NoAnswerError
from drivers.imu.mpu9250 import registers as reg
from drivers.imu.mpu9250.bus import Bus
from drivers.imu.mpu9250.protocol import Settings

TRIES = 3
RESET_S, WAKE_S, AK_MODE_S = 0.100, 0.035, 0.010


@dataclass(frozen=True)
class Mpu9250Config:
    """How the IMU is wired and set.

    bus : path of the I2C bus; address : 0x68, 0x69 or None for the one that answers;
    rate_hz : a divisor of 1000 from 4 to 1000; gyro_range_deg_s, accel_range_g : full scales;
    gyro_filter, accel_filter : DLPF_CFG 1 (184 Hz) to 6 (5 Hz); 3 is 41 Hz, right for a car.
    Raises `UsageError` for what the chip cannot do.
    """

    bus: str = "/dev/i2c-1"
    address: int | None = None
    rate_hz: int = 200
    gyro_range_deg_s: int = 1000
    accel_range_g: int = 8
    gyro_filter: int = 3
    accel_filter: int = 3

    def __post_init__(self) -> None:
        """Refuse what the chip cannot do."""
        allowed = {
            "address": (None, *reg.ADDRESSES),
            "rate_hz": tuple(n for n in range(4, 1001) if reg.BASE_RATE_HZ % n == 0),
            "gyro_range_deg_s": reg.GYRO_RANGES_DEG_S,
            "accel_range_g": reg.ACCEL_RANGES_G,
            "gyro_filter": tuple(reg.GYRO_DELAY_NS),
            "accel_filter": tuple(reg.ACCEL_DELAY_NS),
        }
        for name, values in allowed.items():
            if getattr(self, name) not in values:
                raise UsageError(
                    f"MPU-9250: {name} is {getattr(self, name)}; the chip knows "
                    f"{', '.join(str(value) for value in values)}"
                )


@dataclass(frozen=True)
class Chip:
    """An MPU-9250 that was found: where it is, how it reads, and what it lacks and why."""

    address: int
    settings: Settings
    no_magnetometer_because: str | None = None


def find(bus: Bus, address: int | None) -> tuple[int, int]:
    """Address and WHO_AM_I of the chip; nothing is written, as it might be another one.

    Raises `NoAnswerError` where nothing answers, `DeviceFaultError` for another chip.
    """
    wanted = reg.ADDRESSES if address is None else (address,)
    answers = {at: who for at in reg.ADDRESSES if (who := _ask(bus, at, reg.WHO_AM_I)) is not None}
    for at in wanted:
        if answers.get(at) in reg.MODELS:
            return at, answers[at]
    for at in wanted:
        if at in answers:
            raise DeviceFaultError(f"{bus.name}: {_stranger(at, answers[at])}")
    places = " or ".join(f"0x{at:02x}" for at in wanted)
    others = "".join(f" (0x{at:02x} answers: set that address)" for at in answers)
    raise NoAnswerError(
        f"{bus.name}: no chip answers at {places}{others}; check 3.3 V, ground, SDA and SCL and "
        f"that NCS is high, then look with: i2cdetect -y -r {bus.name.rpartition('-')[2]}"
    )


def start(bus: Bus, config: Mpu9250Config) -> Chip:
    """Reset the chip, set it as wished, read that back; the FIFO is still off.

    Raises `NoAnswerError`, `DeviceFaultError`, and `OSError` where the bus fails in between.
    """
    address, who = find(bus, config.address)
    bus.write_byte(address, reg.PWR_MGMT_1, reg.RESET)
    bus.pause(RESET_S)
    bus.write_byte(address, reg.PWR_MGMT_1, reg.CLOCK_PLL)
    bus.pause(WAKE_S)
    wished = {
        reg.PWR_MGMT_2: 0x00,
        reg.SMPLRT_DIV: reg.BASE_RATE_HZ // config.rate_hz - 1,
        reg.CONFIG: reg.FIFO_STOPS_WHEN_FULL | config.gyro_filter,
        reg.GYRO_CONFIG: reg.GYRO_RANGES_DEG_S.index(config.gyro_range_deg_s) << 3,
        reg.ACCEL_CONFIG: reg.ACCEL_RANGES_G.index(config.accel_range_g) << 3,
        reg.ACCEL_CONFIG2: config.accel_filter,
        reg.USER_CTRL: 0x00,
        reg.INT_PIN_CFG: reg.LATCHED_AND_BYPASS,
        reg.INT_ENABLE: reg.OVERFLOW,
    }
    write_checked(bus, address, wished)
    sensitivity, why = _start_magnetometer(bus, who)
    read = bus.read_block(address, reg.SMPLRT_DIV, 5)
    settings = Settings(who, read[0], read[1], read[2], read[3], read[4], sensitivity)
    return Chip(address, settings, why)


def write_checked(bus: Bus, address: int, wished: dict[int, int]) -> None:
    """Write registers and read each back; raises `DeviceFaultError` where one differs."""
    for register, value in wished.items():
        bus.write_byte(address, register, value)
        found = bus.read_block(address, register, 1)[0]
        if found != value:
            raise DeviceFaultError(
                f"MPU-9250 at 0x{address:02x} on {bus.name}: register 0x{register:02x} was set to "
                f"0x{value:02x} and reads 0x{found:02x}; take its power away for a moment and try "
                "again; if it stays so, the wires are too long or the chip is damaged"
            )


def restart_fifo(bus: Bus, address: int) -> None:
    """Empty the FIFO and let it fill from the next sample on."""
    bus.write_byte(address, reg.FIFO_EN, 0x00)
    bus.write_byte(address, reg.USER_CTRL, reg.FIFO_RESET)
    bus.write_byte(address, reg.USER_CTRL, reg.FIFO_ENABLE)
    bus.write_byte(address, reg.FIFO_EN, reg.FIFO_ALL)


def stop(bus: Bus, address: int) -> None:
    """Let the chip sleep."""
    bus.write_byte(address, reg.FIFO_EN, 0x00)
    bus.write_byte(address, reg.PWR_MGMT_1, reg.SLEEP)


def _start_magnetometer(bus: Bus, who: int) -> tuple[tuple[int, int, int] | None, str | None]:
    """Its factory sensitivity, in mode 16 bit and 100 Hz; or why there is none."""
    if who not in reg.WITH_MAGNETOMETER:
        return None, f"the chip is an {reg.MODELS[who]} (WHO_AM_I 0x{who:02x}), which has none"
    identity = _ask(bus, reg.AK_ADDRESS, reg.AK_WHO_AM_I)
    if identity is None:
        return None, f"no AK8963 answers at 0x{reg.AK_ADDRESS:02x}"
    if identity != reg.AK_IDENTITY:
        where = f"0x{reg.AK_ADDRESS:02x}"
        return None, f"{where} says 0x{identity:02x}, an AK8963 would say 0x{reg.AK_IDENTITY:02x}"
    for mode in (reg.AK_POWER_DOWN, reg.AK_FUSE_ROM):
        bus.write_byte(reg.AK_ADDRESS, reg.AK_CONTROL_1, mode)
        bus.pause(AK_MODE_S)
    x, y, z = bus.read_block(reg.AK_ADDRESS, reg.AK_SENSITIVITY, 3)
    bus.write_byte(reg.AK_ADDRESS, reg.AK_CONTROL_1, reg.AK_POWER_DOWN)
    bus.pause(AK_MODE_S)
    write_checked(bus, reg.AK_ADDRESS, {reg.AK_CONTROL_1: reg.AK_16_BIT_100_HZ})
    return (x, y, z), None


def _ask(bus: Bus, address: int, register: int) -> int | None:
    """A register of a chip that may not be there; one disturbed transfer does not decide it."""
    for _ in range(TRIES):
        with contextlib.suppress(OSError):
            return bus.read_block(address, register, 1)[0]
    return None


def _stranger(address: int, who: int) -> str:
    where = f"the chip at 0x{address:02x} says WHO_AM_I 0x{who:02x}"
    if who == reg.MPU_6050:
        return (
            f"{where}: an MPU-6050, whose filters and temperature are others and which this "
            "driver does not read; use an MPU-9250, MPU-9255 or MPU-6500"
        )
    return (
        f"{where}; an MPU-9250 says 0x71, an MPU-9255 0x73, an MPU-6500 0x70. It is another chip "
        "(a clock DS3231 has the same address) or the wires are bad (0x00, 0xff)"
    )
