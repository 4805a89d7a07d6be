"""What an IMU reads -> `/raw/imu`, `/imu/data_raw`, `/imu/mag`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from capture.clock import ClockFilter, UtcLine
from capture.recording.still import StillPeriod
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

FRAME = "imu"
OSCILLATOR_SKEW = 0.02
"""An MPU-9250 samples by an oscillator that is good to 1 % (PS-MPU-9250A-01, 3.2)."""


class ImuTranslator:
    """Messages of one IMU; its clock is tied to ours by what arrived until then.

    still : sees every sample with the time at which it was measured.
    """

    log_name = LOG_NAME
    topic = IMU_TOPIC

    def __init__(self, utc: UtcLine, still: StillPeriod | None = None) -> None:
        self.clock = ClockFilter(max_skew=OSCILLATOR_SKEW)
        self._utc, self._still = utc, still or StillPeriod()

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
            self._still.note(measured_ns, sample)

    def state(self) -> Mapping[str, object]:
        """The skew of the IMU's clock, how often it began anew, and what the still period told."""
        return {**clock_state(self.clock), **self._still.state()}

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
