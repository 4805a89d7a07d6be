"""What an IMU reads -> `/raw/imu`, `/imu/data_raw`, `/imu/mag`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from capture.clock import ClockFilter, UtcLine
from capture.recording.translation import LogMessage, raw_messages
from capture.sensor_messages import imu_message, magnetic_field_message
from capture.topics import (
    IMU_TOPIC,
    IMU_TYPE,
    LOG_NAME,
    MAGNETIC_FIELD_TOPIC,
    MAGNETIC_FIELD_TYPE,
    RAW_IMU_TOPIC,
)
from drivers import Reading
from drivers.imu import ImuSample
from geometry import Floats

FRAME = "imu"
OSCILLATOR_SKEW = 0.02
"""An MPU-9250 samples by an oscillator that is good to 1 % (PS-MPU-9250A-01, 3.2)."""


class StillPeriod:
    """The angular velocity while the car is asked to stand, for a bias that a person can read."""

    def __init__(self) -> None:
        self._rates: list[tuple[float, float, float]] = []

    def note(self, angular_velocity_rad_s: tuple[float, float, float]) -> None:
        """One more sample."""
        self._rates.append(angular_velocity_rad_s)

    @property
    def rates_rad_s(self) -> Floats:
        """(n, 3): all of them."""
        return np.array(self._rates, dtype=np.float64).reshape(-1, 3)


class ImuTranslator:
    """Messages of one IMU; its clock is tied to ours by what arrived until then.

    still_until_ns : monotonic; samples until then also go into `still`.
    """

    log_name = LOG_NAME
    topic = IMU_TOPIC

    def __init__(self, utc: UtcLine) -> None:
        self.clock = ClockFilter(max_skew=OSCILLATOR_SKEW)
        self.still = StillPeriod()
        self.still_until_ns = 0
        self._utc = utc

    def messages(self, reading: Reading[ImuSample]) -> Iterator[LogMessage]:
        """The raw bytes, then each sample."""
        yield from raw_messages(reading, RAW_IMU_TOPIC, self._utc)
        self.clock.observe_all(reading.ticks)
        for sample in reading.samples:
            line = self.clock.line_of(sample.epoch)
            if line is None or not reading.raw:
                continue  # a sample whose time nobody knows is in the raw record only
            arrival_ns = reading.raw[-1].t_ns
            measured_ns = line.ours(sample.device_ns)
            stamp_ns = self._utc.utc(measured_ns)
            yield self._imu(sample, arrival_ns, stamp_ns)
            if sample.magnetic_field_t is not None:
                data = magnetic_field_message(stamp_ns, FRAME, sample.magnetic_field_t)
                yield LogMessage(
                    MAGNETIC_FIELD_TOPIC, MAGNETIC_FIELD_TYPE, data, arrival_ns, stamp_ns
                )
            if measured_ns < self.still_until_ns:
                self.still.note(sample.angular_velocity_rad_s)

    def state(self) -> Mapping[str, object]:
        """The skew of the IMU's clock and how often it began anew."""
        return clock_state(self.clock)

    def _imu(self, sample: ImuSample, arrival_ns: int, stamp_ns: int) -> LogMessage:
        data = imu_message(
            stamp_ns, FRAME, sample.angular_velocity_rad_s, sample.linear_acceleration_m_s2
        )
        return LogMessage(IMU_TOPIC, IMU_TYPE, data, arrival_ns, stamp_ns)


def clock_state(clock: ClockFilter) -> Mapping[str, object]:
    """What the diagnostics tell of a device's clock: enough to redo or doubt a stamp."""
    line = clock.line
    if line is None:
        return {"clock": "not yet known"}
    return {
        "clock_skew_ppm": f"{line.skew * 1e6:.2f}",
        "clock_device_ns": line.device_origin_ns,
        "clock_monotonic_ns": line.our_origin_ns,
        "clock_restarts": clock.restarts,
    }
