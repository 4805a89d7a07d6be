"""What an IMU gives in simulated time."""

from __future__ import annotations

from typing import Protocol

from drivers import Device, Reading
from drivers.imu import ImuSample


class Line(Protocol):
    """Where simulated time passes: a port or a bus."""

    def now_ns(self) -> int:
        """Simulated time."""


def collect(imu: Device[ImuSample], line: Line, seconds: float) -> list[Reading[ImuSample]]:
    """What comes in that time of the line."""
    end_ns = line.now_ns() + round(seconds * 1e9)
    readings = []
    while line.now_ns() < end_ns:
        reading = imu.read(0.1)
        if reading is not None:
            readings.append(reading)
    return readings


def samples_of(readings: list[Reading[ImuSample]]) -> list[ImuSample]:
    return [sample for reading in readings for sample in reading.samples]
