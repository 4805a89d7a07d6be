"""What is read from an MPU-9250, as records for the raw log, and from records to samples. Pure.

I2C has no stream of its own, so each poll becomes one chunk of records that holds every byte as it
was read. `Mpu9250Decoder` turns chunks into samples, live in the driver and later from a log.

A record is its kind (1 byte), the length of what follows (u16) and that; all little endian, except
for what the chip itself sends:

    S  version 1 (u8), then as read back WHO_AM_I, SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG,
       ACCEL_CONFIG2 and, with a magnetometer, ASAX, ASAY, ASAZ: the FIFO starts anew, and with it
       the device's clock
    M  ST1 ... ST2 of the AK8963; belongs to the newest sample of the next F
    F  microseconds from reading FIFO_COUNT to the chunk's stamp (u32), then frames of 14 bytes

The device's clock counts samples: sample k since the last S is at k nominal periods.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace

from drivers.device import Counters, Reading, Tick
from drivers.imu.mpu9250 import registers as reg
from drivers.imu.sample import STANDARD_GRAVITY_M_S2, ImuSample, Vector
from drivers.port import Chunk

SETTINGS, MAGNETOMETER, FIFO = b"S", b"M", b"F"
VERSION = 1
COUNT_WIRE_NS = 45_000
"""FIFO_COUNT is latched before its two bytes cross the wire: 18 bits at 400 kHz."""

_HEADER = struct.Struct("<cH")
_AGE = struct.Struct("<I")
_FRAME = struct.Struct(">7h")
_FIELD = struct.Struct("<3h")


@dataclass(frozen=True)
class Settings:
    """The registers by which frames are read, as the chip itself gives them back.

    sensitivity : ASAX, ASAY, ASAZ of the magnetometer, None without one.
    """

    who_am_i: int
    rate_divider: int
    config: int
    gyro_config: int
    accel_config: int
    accel_config2: int
    sensitivity: tuple[int, int, int] | None = None

    @property
    def rate_hz(self) -> float:
        """Nominal samples a second; the chip's own oscillator is up to 1 % off."""
        return reg.BASE_RATE_HZ / (1 + self.rate_divider)

    @property
    def period_ns(self) -> int:
        """Nominal time from one sample to the next."""
        return (1 + self.rate_divider) * 1_000_000_000 // reg.BASE_RATE_HZ

    @property
    def gyro_scale(self) -> float:
        """Radians per second in one count."""
        return gyro_scale(reg.GYRO_RANGES_DEG_S[self.gyro_config >> 3 & 3])

    @property
    def accel_scale(self) -> float:
        """Metres per second squared in one count."""
        return accel_scale(reg.ACCEL_RANGES_G[self.accel_config >> 3 & 3])

    @property
    def gyro_delay_ns(self) -> int:
        """How old the angular velocity is when the chip gives it out; 0 where it is not known."""
        return reg.GYRO_DELAY_NS.get(self.config & 7, 0)

    @property
    def acceleration_lag_ns(self) -> int:
        """How much older than that the acceleration is."""
        delay_ns = reg.ACCEL_UNFILTERED_DELAY_NS
        if not self.accel_config2 & 8:
            delay_ns = reg.ACCEL_DELAY_NS.get(self.accel_config2 & 7, self.gyro_delay_ns)
        return delay_ns - self.gyro_delay_ns


def gyro_scale(range_deg_s: int) -> float:
    """Radians per second in one count at a full scale of 250, 500, 1000 or 2000 deg/s."""
    counts = reg.GYRO_COUNTS_PER_DEG_S[reg.GYRO_RANGES_DEG_S.index(range_deg_s)]
    return math.radians(1.0) / counts


def accel_scale(range_g: int) -> float:
    """Metres per second squared in one count at a full scale of 2, 4, 8 or 16 g."""
    return STANDARD_GRAVITY_M_S2 / reg.ACCEL_COUNTS_PER_G[reg.ACCEL_RANGES_G.index(range_g)]


def temperature_c(counts: int) -> float:
    """Degrees Celsius of the die; not the formula of the MPU-6050 that some drivers use."""
    return counts / reg.TEMPERATURE_COUNTS_PER_C + reg.TEMPERATURE_OFFSET_C


def accelerometer_axes(magnetometer: Vector) -> Vector:
    """A field in the axes of the AK8963, in those of the accelerometer; its own inverse.

    The two dice lie differently in the package (PS-MPU-9250A-01 figures 4 and 5).
    """
    x, y, z = magnetometer
    return (y, x, -z)


def samples_from_frames(
    frames: bytes, first_ns: int, settings: Settings, epoch: int = 0
) -> list[ImuSample]:
    """The samples in frames of 14 bytes, of the FIFO or of bursts from register 0x3B.

    first_ns : the first one's time on the device's clock; the others follow at nominal periods.
    """
    accel, gyro = settings.accel_scale, settings.gyro_scale
    lag_ns, period_ns = settings.acceleration_lag_ns, settings.period_ns
    return [
        ImuSample(
            device_ns=first_ns + k * period_ns,
            angular_velocity_rad_s=(gx * gyro, gy * gyro, gz * gyro),
            linear_acceleration_m_s2=(ax * accel, ay * accel, az * accel),
            temperature_c=temperature_c(temperature),
            acceleration_lag_ns=lag_ns,
            epoch=epoch,
        )
        for k, (ax, ay, az, temperature, gx, gy, gz) in enumerate(_FRAME.iter_unpack(frames))
    ]


def magnetic_field_t(status_and_data: bytes, sensitivity: tuple[int, int, int]) -> Vector | None:
    """The field, in the accelerometer's axes, in 8 bytes ST1 ... ST2 of the AK8963.

    None where there is nothing new, or where the field was too strong (HOFL).
    """
    first, last = status_and_data[0], status_and_data[7]
    if not first & reg.AK_DATA_READY or last & reg.AK_OVERFLOW:
        return None
    unit = reg.AK_TESLA_PER_COUNT_14_BIT
    if last & reg.AK_16_BIT:
        unit = reg.AK_TESLA_PER_COUNT_16_BIT
    counts = _FIELD.unpack_from(status_and_data, 1)
    x, y, z = (
        count * unit * ((adjust - 128) / 256.0 + 1.0)
        for count, adjust in zip(counts, sensitivity, strict=True)
    )
    return accelerometer_axes((x, y, z))


def settings_record(settings: Settings) -> bytes:
    """The record S: the FIFO starts anew, with these settings."""
    registers = (
        settings.who_am_i,
        settings.rate_divider,
        settings.config,
        settings.gyro_config,
        settings.accel_config,
        settings.accel_config2,
        *(settings.sensitivity or ()),
    )
    return _record(SETTINGS, bytes((VERSION, *registers)))


def magnetometer_record(status_and_data: bytes) -> bytes:
    """The record M of one reading ST1 ... ST2."""
    return _record(MAGNETOMETER, status_and_data)


def fifo_record(age_us: int, frames: bytes) -> bytes:
    """The record F of what the FIFO held `age_us` before the chunk's stamp."""
    return _record(FIFO, _AGE.pack(age_us) + frames)


class Mpu9250Decoder:
    """Chunks of records in, samples and ticks out; the same live and from a log.

    counters : where it counts; bytes that are no record are counted, never an error.
    """

    def __init__(self, counters: Counters | None = None) -> None:
        self.counters = counters or Counters()
        self.epoch = -1
        self._settings: Settings | None = None
        self._count = 0
        self._field: Vector | None = None

    def feed(self, chunk: Chunk) -> Reading[ImuSample]:
        """What one chunk holds; samples before the first record S cannot be read."""
        samples: list[ImuSample] = []
        ticks: list[Tick] = []
        for kind, body in self._records(chunk.data):
            if kind == SETTINGS:
                self._begin(body)
            elif kind == MAGNETOMETER:
                self._take_field(body)
            else:
                found = self._frames(body[_AGE.size :])
                if found:
                    age_ns = _AGE.unpack_from(body)[0] * 1000
                    ticks.append(self._tick(found[-1], chunk.t_ns - age_ns))
                samples += found
        self.counters.samples += len(samples)
        return Reading((chunk,), tuple(ticks), tuple(samples))

    def _records(self, data: bytes) -> Iterator[tuple[bytes, bytes]]:
        at = 0
        while at + _HEADER.size <= len(data):
            kind, length = _HEADER.unpack_from(data, at)
            start = at + _HEADER.size
            body = data[start : start + length]
            if len(body) != length or not _whole(kind, body):
                break
            yield kind, body
            at = start + length
        if at < len(data):
            self.counters.bad_frames += 1
            self.counters.bad_bytes += len(data) - at

    def _begin(self, body: bytes) -> None:
        asa = (body[7], body[8], body[9]) if len(body) == 10 else None
        who, divider, config, gyro, accel, accel2 = body[1:7]
        self._settings = Settings(who, divider, config, gyro, accel, accel2, asa)
        self.epoch += 1
        self._count, self._field = 0, None

    def _take_field(self, body: bytes) -> None:
        if self._settings is None or self._settings.sensitivity is None:
            return
        self._field = magnetic_field_t(body, self._settings.sensitivity)
        if body[7] & reg.AK_OVERFLOW:
            details = self.counters.details
            details["magnetometer_overflows"] = details.get("magnetometer_overflows", 0) + 1

    def _frames(self, frames: bytes) -> list[ImuSample]:
        settings = self._settings
        if settings is None:
            self.counters.bad_frames += 1
            return []
        first_ns = self._count * settings.period_ns
        samples = samples_from_frames(frames, first_ns, settings, self.epoch)
        self._count += len(samples)
        if samples and self._field is not None:
            samples[-1] = replace(samples[-1], magnetic_field_t=self._field)
            self._field = None
        return samples

    def _tick(self, newest: ImuSample, arrival_ns: int) -> Tick:
        assert self._settings is not None
        delay_ns = self._settings.gyro_delay_ns + COUNT_WIRE_NS
        return Tick(newest.device_ns, arrival_ns, delay_ns, newest.epoch)


def _record(kind: bytes, body: bytes) -> bytes:
    return _HEADER.pack(kind, len(body)) + body


def _whole(kind: bytes, body: bytes) -> bool:
    """Whether this can be a record of that kind."""
    if kind == SETTINGS:
        return len(body) in (7, 10) and body[0] == VERSION
    if kind == MAGNETOMETER:
        return len(body) == reg.AK_READ_BYTES
    frames = len(body) - _AGE.size
    return kind == FIFO and frames >= 0 and frames % reg.FRAME_BYTES == 0
