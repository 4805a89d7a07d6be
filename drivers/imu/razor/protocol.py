"""The stream of the default firmware: bytes to samples, live and later from a raw log. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from drivers.device import Counters, Reading, Tick
from drivers.errors import DeviceFaultError
from drivers.imu.mpu9250 import registers as reg
from drivers.imu.mpu9250.protocol import accel_scale, accelerometer_axes, gyro_scale
from drivers.imu.razor.columns import QUATERNION_ONE, WISHED, Columns
from drivers.imu.razor.lines import NO_SENSOR, LineReader, Row, reply_of, row_of
from drivers.imu.sample import STANDARD_GRAVITY_M_S2, ImuSample, Vector
from drivers.port import Chunk

GYRO_DELAY_NS = reg.GYRO_DELAY_NS[2]
"""Whatever config.h says, the DMP library sets the gyro to 92 Hz ..."""
ACCELERATION_LAG_NS = reg.ACCEL_UNFILTERED_DELAY_NS - GYRO_DELAY_NS
"""... and leaves the accelerometer unfiltered, which makes it the younger of the two."""
HALF_MILLISECOND_NS = 500_000
"""millis() is cut to whole milliseconds: on average the truth is half of one later."""
WRAP_MS = 1 << 32
MOST_STEP_MS = 2000


@dataclass(frozen=True)
class Layout:
    """How the lines of one recording are to be read; `identify()` tells it for the session."""

    columns: Columns = WISHED
    accel_range_g: int = 2
    gyro_range_deg_s: int = 2000
    period_ms: float = 10.0


@dataclass
class MillisClock:
    """The board's millis() as a time that never goes back; epoch counts its restarts."""

    epoch: int = 0
    _last_ms: int | None = None
    _total_ms: int = 0
    _suspect_ms: int | None = None
    step_ms: int = field(default=0, init=False)
    """How far the last `advance` went; 0 at a start."""

    def advance(self, millis: int) -> int | None:
        """Nanoseconds on the board's clock; None where the number is not to be believed yet.

        A wrap after 49.7 days goes on; a jump is a restart if the next line goes on from there,
        and else it was a bad line.
        """
        if self._last_ms is None:
            return self._begin(millis)
        step = (millis - self._last_ms) % WRAP_MS
        if 0 < step <= MOST_STEP_MS:
            self._last_ms, self._suspect_ms = millis, None
            self._total_ms += step
            self.step_ms = step
            return self._total_ms * 1_000_000
        suspect, self._suspect_ms = self._suspect_ms, millis
        if suspect is not None and 0 < (millis - suspect) % WRAP_MS <= MOST_STEP_MS:
            self.epoch += 1
            return self._begin(millis)
        return None

    def restart(self) -> None:
        """The connection is a new one: nothing ties the next line to the last."""
        if self._last_ms is not None:
            self.epoch += 1
        self._last_ms = self._suspect_ms = None

    def _begin(self, millis: int) -> int:
        self._last_ms, self._suspect_ms = millis, None
        self._total_ms, self.step_ms = millis, 0
        return millis * 1_000_000


class RazorDecoder:
    """Chunks in, samples and ticks out.

    A line of another form, or whose time does not fit, is counted and left out. Lines that the
    board left out (its compass was late) are told by its clock and counted as lost.
    Raises `DeviceFaultError` when the board says that it has lost its sensor.
    """

    def __init__(self, layout: Layout, counters: Counters, clock: MillisClock) -> None:
        self.layout, self.counters = layout, counters
        self._clock = clock
        self._lines = LineReader(counters)
        self._decimals = layout.columns.decimals()
        self._places = layout.columns.places()

    def feed(self, chunk: Chunk) -> Reading[ImuSample]:
        """What these bytes complete."""
        samples: list[ImuSample] = []
        ticks: list[Tick] = []
        for line in self._lines.feed(chunk.data):
            if line.text == NO_SENSOR:
                raise DeviceFaultError(no_sensor_text())
            if reply_of(line.text) is not None:
                continue
            row = row_of(line.text)
            sample = self._sample(row, chunk.t_ns) if row is not None else None
            if sample is None:
                self.counters.bad_frames += 1
                continue
            samples.append(sample)
            delay_ns = GYRO_DELAY_NS - (HALF_MILLISECOND_NS if "time" in self._places else 0)
            ticks.append(Tick(sample.device_ns, chunk.t_ns, delay_ns, sample.epoch))
        self.counters.samples += len(samples)
        return Reading((chunk,), tuple(ticks), tuple(samples))

    def _sample(self, row: Row, arrival_ns: int) -> ImuSample | None:
        if row.decimals != self._decimals:
            return None
        device_ns: int | None = arrival_ns
        if "time" in self._places:
            device_ns = self._clock.advance(int(row.values[0]))
            missed = round(self._clock.step_ms / self.layout.period_ms) - 1
            if device_ns is not None and missed > 0:
                self.counters.lost_samples += missed
        if device_ns is None:
            return None
        return sample_of(row, self.layout, device_ns, self._clock.epoch)


def sample_of(row: Row, layout: Layout, device_ns: int, epoch: int = 0) -> ImuSample | None:
    """The sample in a line, in SI units; None where the line has no gyro or no acceleration."""
    places, raw = layout.columns.places(), layout.columns.raw
    if "gyro" not in places or "accel" not in places:
        return None
    accel = accel_scale(layout.accel_range_g) if raw else STANDARD_GRAVITY_M_S2
    gyro = gyro_scale(layout.gyro_range_deg_s) if raw else math.radians(1.0)
    tesla = reg.AK_TESLA_PER_COUNT_16_BIT if raw else 1e-6
    field_t = None
    if "mag" in places:  # printed in the magnetometer's own axes, already adjusted by its fuses
        field_t = accelerometer_axes(_scaled(row.values[places["mag"]], tesla))
    orientation = None
    if "quaternion" in places:
        one = QUATERNION_ONE if raw else 1.0
        w, x, y, z = (value / one for value in row.values[places["quaternion"]])
        orientation = (w, x, y, z)
    return ImuSample(
        device_ns=device_ns,
        angular_velocity_rad_s=_scaled(row.values[places["gyro"]], gyro),
        linear_acceleration_m_s2=_scaled(row.values[places["accel"]], accel),
        magnetic_field_t=field_t,
        orientation_wxyz=orientation,
        acceleration_lag_ns=ACCELERATION_LAG_NS,
        epoch=epoch,
    )


def no_sensor_text() -> str:
    """What to do when the board does not find its own sensor."""
    return (
        "the Razor says 'Error connecting to MPU-9250': its processor does not find its sensor; "
        "take its power away for ten seconds and plug it in again; if it says so again, the board "
        "is damaged"
    )


def _scaled(values: tuple[float, ...], unit: float) -> Vector:
    x, y, z = values
    return (x * unit, y * unit, z * unit)
