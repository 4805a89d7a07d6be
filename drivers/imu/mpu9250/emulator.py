"""An MPU-9250 with its AK8963 as an I2C bus shows it: registers, FIFO, filter delays, faults."""

from __future__ import annotations

import errno
import math
import struct
import time

from drivers.imu.mpu9250 import registers as reg
from drivers.imu.mpu9250.protocol import Settings, accelerometer_axes
from drivers.imu.sample import Motion, Source, Vector, at_rest

BIT_NS = 2500
"""One bit on the wire at 400 kHz."""
TRIM_CODES = (120, 118, 122, 100, 101, 99)
"""SELF_TEST registers of a healthy chip: gyro x, y, z, accelerometer x, y, z."""


class FakeMpu9250Bus:
    """A `Bus` with one MPU-9250 on it, in simulated time that passes in `pause` and on the wire.

    source : its motion by the bus's time. What can be set at any time: rate_error (the oscillator,
    0.01 is 1 % fast), who_am_i, has_magnetometer, unplugged, stuck_register (does not take writes),
    failing_transfers (so many of the next fail), magnetometer_overflow, self_test_strength (1 is a
    healthy chip's answer). `reset_chip()` is what a dip of its power does.
    """

    def __init__(
        self,
        source: Source = at_rest,
        *,
        name: str = "fake i2c",
        address: int = 0x68,
        who_am_i: int = 0x71,
        has_magnetometer: bool = True,
        sensitivity: tuple[int, int, int] = (176, 178, 166),
        start_ns: int = 1_000_000_000,
    ) -> None:
        self.source, self.address = source, address
        self.who_am_i, self.has_magnetometer = who_am_i, has_magnetometer
        self.sensitivity = sensitivity
        self.rate_error = 0.0
        self.unplugged = self.closed = self.magnetometer_overflow = False
        self.stuck_register: int | None = None
        self.failing_transfers = 0
        self.self_test_strength = 1.0
        self.samples_taken = 0
        self.transfers = 0
        self._name, self._now_ns = name, start_ns
        self.reset_chip()

    def reset_chip(self) -> None:
        """Registers as after power comes: asleep, FIFO off, the magnetometer down."""
        self._registers = bytearray(128)
        self._registers[reg.PWR_MGMT_1] = reg.SLEEP
        self._registers[reg.SELF_TEST_GYRO : reg.SELF_TEST_GYRO + 3] = bytes(TRIM_CODES[:3])
        self._registers[reg.SELF_TEST_ACCEL : reg.SELF_TEST_ACCEL + 3] = bytes(TRIM_CODES[3:])
        self._ak = bytearray(0x13)
        self._ak[reg.AK_WHO_AM_I] = reg.AK_IDENTITY
        self._fifo = bytearray()
        self._overflow = self._ready = False
        self._sampled_ns, self._field_ns = self._now_ns, self._now_ns

    @property
    def name(self) -> str:
        """As given."""
        return self._name

    def now_ns(self) -> int:
        """Simulated time."""
        return self._now_ns

    def pause(self, seconds: float) -> None:
        """Let simulated time pass."""
        self._now_ns += max(round(seconds * 1e9), 0)

    def read_block(self, address: int, register: int, count: int) -> bytes:
        """Bytes from a register on, as the chip that has this address would give them."""
        # The chip latches what it answers once it is addressed; then the bytes cross the wire.
        self._spend(3)
        self._check(address)
        self._advance()
        data = self._answer(address, register, count)
        self._spend(count)
        return data

    def write_byte(self, address: int, register: int, value: int) -> None:
        """Set a register and do what that does."""
        self._spend(3)
        self._check(address)
        self._advance()
        if address == reg.AK_ADDRESS:
            self._ak[register] = value
            return
        if register == self.stuck_register:
            return
        if register == reg.PWR_MGMT_1 and value & reg.RESET:
            self.reset_chip()
            return
        if register == reg.USER_CTRL and value & reg.FIFO_RESET:
            self._fifo.clear()
            value &= ~reg.FIFO_RESET
        was_asleep = self._registers[reg.PWR_MGMT_1] & reg.SLEEP
        self._registers[register] = value
        if register == reg.PWR_MGMT_1 and was_asleep:
            self._sampled_ns = self._now_ns

    def close(self) -> None:
        """Note that the driver is done."""
        self.closed = True

    def _answer(self, address: int, register: int, count: int) -> bytes:
        if address == reg.AK_ADDRESS:
            return self._read_magnetometer(register, count)
        if register == reg.FIFO_R_W:
            return self._drain(count)
        if register == reg.FIFO_COUNT:
            return struct.pack(">H", len(self._fifo))[:count]
        if register == reg.INT_STATUS:
            status = reg.OVERFLOW * self._overflow | reg.DATA_READY * self._ready
            self._overflow = self._ready = False
            return bytes([status])
        if register == reg.WHO_AM_I:
            return bytes([self.who_am_i])
        return bytes(self._registers[register : register + count])

    def _spend(self, wire_bytes: int) -> None:
        self._now_ns += wire_bytes * 9 * BIT_NS

    def _check(self, address: int) -> None:
        self.transfers += 1
        if self.closed:
            raise OSError(errno.EBADF, "the bus is closed")
        bypass = self._registers[reg.INT_PIN_CFG] & 0x02
        there = address == self.address or (
            address == reg.AK_ADDRESS and self.has_magnetometer and bypass
        )
        if self.failing_transfers > 0:
            self.failing_transfers -= 1
            there = False
        if self.unplugged or not there:
            raise OSError(errno.EREMOTEIO, "Remote I/O error")

    def _settings(self) -> Settings:
        return Settings(self.who_am_i, *self._registers[reg.SMPLRT_DIV : reg.ACCEL_CONFIG2 + 1])

    def _advance(self) -> None:
        """Take every sample whose time has come."""
        if self._registers[reg.PWR_MGMT_1] & reg.SLEEP:
            return
        settings = self._settings()
        period_ns = settings.period_ns / (1.0 + self.rate_error)
        while self._sampled_ns + period_ns <= self._now_ns:
            self._sampled_ns = round(self._sampled_ns + period_ns)
            self._sample(settings)

    def _sample(self, settings: Settings) -> None:
        gyro_ns = self._sampled_ns - settings.gyro_delay_ns
        turning = self.source(gyro_ns)
        pulling = self.source(gyro_ns - settings.acceleration_lag_ns)
        frame = self._frame(settings, turning, pulling)
        self._registers[reg.ACCEL_OUT : reg.ACCEL_OUT + reg.FRAME_BYTES] = frame
        self._ready = True
        self.samples_taken += 1
        filling = (
            self._registers[reg.USER_CTRL] & reg.FIFO_ENABLE
            and self._registers[reg.FIFO_EN] == reg.FIFO_ALL
        )
        if not filling:
            return
        room = reg.FIFO_BYTES - len(self._fifo)
        self._fifo += frame[:room]
        if room < len(frame):
            self._overflow = True

    def _frame(self, settings: Settings, turning: Motion, pulling: Motion) -> bytes:
        gyro = [value / settings.gyro_scale for value in turning.angular_velocity_rad_s]
        accel = [value / settings.accel_scale for value in pulling.linear_acceleration_m_s2]
        for k in range(3):
            bit = 0x80 >> k
            if settings.gyro_config & bit:
                gyro[k] += self._own_answer(TRIM_CODES[k], settings.gyro_config)
            if settings.accel_config & bit:
                accel[k] += self._own_answer(TRIM_CODES[3 + k], settings.accel_config)
        warmth = turning.temperature_c - reg.TEMPERATURE_OFFSET_C
        counts = (*accel, warmth * reg.TEMPERATURE_COUNTS_PER_C, *gyro)
        return struct.pack(">7h", *(_int16(value) for value in counts))

    def _own_answer(self, code: int, config: int) -> float:
        """What the self test adds: the factory's trim, at the full scale in force."""
        full_scale: float = 2.0 ** (config >> 3 & 3)
        return self.self_test_strength * 2620.0 * math.pow(1.01, code - 1) / full_scale

    def _drain(self, count: int) -> bytes:
        """What the FIFO holds; where it is empty the last byte again, as the chip does."""
        data = bytes(self._fifo[:count])
        del self._fifo[:count]
        return data + (data[-1:] or b"\x00") * (count - len(data))

    def _read_magnetometer(self, register: int, count: int) -> bytes:
        mode = self._ak[reg.AK_CONTROL_1]
        fuses = bytes(self.sensitivity) if mode == reg.AK_FUSE_ROM else bytes(3)
        self._ak[reg.AK_SENSITIVITY :] = fuses
        if register == reg.AK_STATUS_1 and mode == reg.AK_16_BIT_100_HZ:
            self._measure_field()
        data = bytes(self._ak[register : register + count])
        if register <= 0x09 < register + count:
            self._ak[reg.AK_STATUS_1] = 0
        return data

    def _measure_field(self) -> None:
        """The newest of a hundred readings a second, if it has not been read yet."""
        latest_ns = self._now_ns - self._now_ns % 10_000_000
        if latest_ns <= self._field_ns:
            return
        self._field_ns = latest_ns
        field = self._field_counts(self.source(latest_ns).magnetic_field_t)
        status_2 = reg.AK_16_BIT | (reg.AK_OVERFLOW if self.magnetometer_overflow else 0)
        self._ak[reg.AK_STATUS_1 : 0x0A] = bytes([reg.AK_DATA_READY]) + field + bytes([status_2])

    def _field_counts(self, field_t: Vector) -> bytes:
        counts = (
            value / reg.AK_TESLA_PER_COUNT_16_BIT / ((adjust - 128) / 256.0 + 1.0)
            for value, adjust in zip(accelerometer_axes(field_t), self.sensitivity, strict=True)
        )
        return struct.pack("<3h", *(max(min(round(value), 32760), -32760) for value in counts))


class RealTimeMpu9250Bus(FakeMpu9250Bus):
    """The same at real pace, by the machine's monotonic clock; begin it at `start_ns` of that."""

    def now_ns(self) -> int:
        """The machine's monotonic clock."""
        self._now_ns = time.monotonic_ns()
        return self._now_ns

    def pause(self, seconds: float) -> None:
        """Sleep."""
        time.sleep(seconds)
        self.now_ns()


def _int16(value: float) -> int:
    return max(min(round(value), 32767), -32768)
