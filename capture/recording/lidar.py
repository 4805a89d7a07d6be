"""What a lidar reads -> `/raw/lidar`, `/lidar/points`, `/scan`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from capture.clock import ClockFilter, UtcLine
from capture.point_cloud import point_cloud_message
from capture.recording.imu import clock_state
from capture.recording.translation import LogMessage, raw_messages
from capture.sensor_messages import laser_scan_message
from capture.topics import (
    LOG_NAME,
    POINTS_TOPIC,
    POINTS_TYPE,
    RAW_LIDAR_TOPIC,
    SCAN_TOPIC,
    SCAN_TYPE,
)
from drivers import Reading
from drivers.rplidar import Revolution
from geometry import Floats, Stamps

FRAME = "lidar"
RANGE_LIMITS_M = (0.05, 40.0)


class LidarTranslator:
    """Messages of one lidar; each beam has its own time on our clock."""

    log_name = LOG_NAME
    topic = POINTS_TOPIC

    def __init__(self, utc: UtcLine) -> None:
        self.clock = ClockFilter()
        self._utc = utc

    def messages(self, reading: Reading[Revolution]) -> Iterator[LogMessage]:
        """The raw bytes, then every revolution they complete, as points and as a scan."""
        yield from raw_messages(reading, RAW_LIDAR_TOPIC, self._utc)
        self.clock.observe_all(reading.ticks)
        for turn in reading.samples:
            line = self.clock.line_of(turn.epoch)
            if line is None or not reading.raw:
                continue  # a turn whose time nobody knows is in the raw record only
            arrival_ns = reading.raw[-1].t_ns
            beam_t_ns = line.all_ours(turn.device_ns) + self._utc.utc(0)
            stamp_ns, intensity = int(beam_t_ns[0]), turn.quality.astype(np.float64)
            points = point_cloud_message(
                stamp_ns, beam_t_ns, turn.range_m, turn.bearing_rad, intensity, FRAME
            )
            yield LogMessage(POINTS_TOPIC, POINTS_TYPE, points, arrival_ns, stamp_ns)
            scan = even_scan(beam_t_ns, turn.range_m, turn.bearing_rad, intensity)
            yield LogMessage(SCAN_TOPIC, SCAN_TYPE, scan.message(), arrival_ns, scan.stamp_ns)

    def state(self) -> Mapping[str, object]:
        """The skew of the lidar's clock and how often it began anew."""
        return clock_state(self.clock)


@dataclass(frozen=True, eq=False)
class EvenScan:
    """A revolution on evenly spaced bearings, counter-clockwise from just above 0 to 2 pi.

    stamp_ns : of ray 0; the lidar turns clockwise, so time_increment_s is negative and ray 0 is
    the newest. range_m : infinity where no beam with an echo fell.
    """

    stamp_ns: int
    increment_rad: float
    time_increment_s: float
    range_m: Floats
    intensity: Floats

    def message(self) -> bytes:
        """As `sensor_msgs/LaserScan`."""
        return laser_scan_message(
            self.stamp_ns,
            FRAME,
            angle_min_rad=0.5 * self.increment_rad,
            angle_increment_rad=self.increment_rad,
            time_increment_s=self.time_increment_s,
            scan_time_s=abs(self.time_increment_s) * self.range_m.size,
            range_limits_m=RANGE_LIMITS_M,
            range_m=self.range_m,
            intensity=self.intensity,
        )


def even_scan(
    beam_t_ns: Stamps, range_m: Floats, bearing_rad: Floats, intensity: Floats
) -> EvenScan:
    """The beams of one revolution, as many rays as beams, each ray the beam nearest to it.

    A `LaserScan` can say no better; `/lidar/points` has every beam where and when it was.
    """
    count = max(range_m.size, 2)
    increment = math.tau / count
    place = np.mod(bearing_rad, math.tau) / increment
    ray = np.minimum(place.astype(np.int64), count - 1)
    # Of the beams in one ray's sector the last written stays: first those without echo, then the
    # ones further from its middle.
    order = np.lexsort((-np.abs(place - ray - 0.5), ~np.isnan(range_m)))
    ranges, intensities = np.full(count, np.inf), np.zeros(count)
    ranges[ray[order]] = range_m[order]
    intensities[ray[order]] = intensity[order]
    ranges[np.isnan(ranges)] = np.inf
    stamp_ns, slope_ns = _time_of_rays(beam_t_ns, bearing_rad, increment)
    return EvenScan(stamp_ns, increment, slope_ns * 1e-9, ranges, intensities)


def _time_of_rays(beam_t_ns: Stamps, bearing_rad: Floats, increment: float) -> tuple[int, float]:
    """When ray 0 was shot, and how much later each next ray: a line through all beams."""
    unwrapped = np.unwrap(bearing_rad)
    # The turn begins near 0 and goes down to -2 pi; as rays it goes from 2 pi down to 0.
    ray = (unwrapped - math.tau * (round(float(unwrapped.mean() / math.tau - 0.5)))) / increment
    since_ns = (beam_t_ns - beam_t_ns[0]).astype(np.float64)
    if ray.size < 2:
        return int(beam_t_ns[0]), 0.0
    slope_ns, at_zero_ns = np.polyfit(ray - 0.5, since_ns, 1)
    return int(beam_t_ns[0]) + round(float(at_zero_ns)), float(slope_ns)
